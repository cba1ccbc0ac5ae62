//! The law of `penalty`, several constraints at a time: the same operations in the same order, so the same results.

use super::lanes::{BodyLanes, ConstraintLanes};
use super::push_lanes::{apply, arms, count, separation};
use super::simd::{Lanes, V3};

/// One visit to the constraints of a group; what it leaves of the bodies.
#[inline(always)]
pub(super) fn visit<L: Lanes>(c: &mut ConstraintLanes<L>, a: &BodyLanes<L>, b: &BodyLanes<L>) -> [BodyLanes<L>; 2] {
    let (head, points) = c.split();
    let (mut after_a, mut after_b) = (*a, *b);
    let (normal, [t1, t2]) = (head.normal, head.tangents);
    for p in points {
        let [ra, rb] = arms(head, p);
        let relative = b.velocity_at(rb) - a.velocity_at(ra);
        let velocity = normal.dot(relative);
        let separation = separation(head, p, a, b);
        let pull = head.bias_rate * separation + head.mass_scale * velocity;
        let sum = separation.simd_lt(L::ZERO) & (-p.normal_mass * pull);
        let press = sum.fast_max(L::ZERO);
        let damper = head.mass_scale * p.tangent_mass;
        let (x, y) = (-damper * t1.dot(relative), -damper * t2.dot(relative));
        let length = (x * x + y * y).sqrt();
        let most = head.friction * press;
        let scale = length.simd_gt(most).bitselect(most / length, L::ONE);
        let (x, y) = (x * scale, y * scale);
        let push = press * normal + x * t1 + y * t2;
        let good = sum.is_finite() & push.x.is_finite() & push.y.is_finite() & push.z.is_finite();
        p.normal = good & press;
        p.tangent = [good & x, good & y];
        apply(&mut after_a, &mut after_b, ra, rb, V3::new(good & push.x, good & push.y, good & push.z));
        let first = good & press.simd_eq(L::ZERO) & p.total[0].simd_eq(L::ZERO);
        p.approach = first.bitselect(p.approach.fast_min(velocity), p.approach);
        count(p);
    }
    [after_a, after_b]
}
