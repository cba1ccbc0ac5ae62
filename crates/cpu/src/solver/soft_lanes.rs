//! The law of `soft`, several constraints at a time: the same operations in the same order, so the same results.

use super::Visit;
use super::lanes::{BodyLanes, ConstraintLanes, HeadLanes, PointLanes};
use super::push_lanes::{apply, arms, count, push_tangent, separation};
use super::resist_lanes::resist;
use super::simd::Lanes;
use tumble_core::layout::StepParams;

/// One visit to the constraints of a group.
#[inline(always)]
pub(super) fn visit<L: Lanes>(
    visit: Visit,
    c: &mut ConstraintLanes<L>,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
    step: &StepParams,
) {
    let (head, points) = c.split();
    for p in points.iter_mut() {
        push_normal(visit, head, p, a, b, step);
    }
    for p in points.iter_mut() {
        push_tangent(head, p, a, b);
        if visit == Visit::Relax {
            count(p);
        }
    }
    resist(head, points, a, b);
}

#[inline(always)]
fn push_normal<L: Lanes>(
    visit: Visit,
    head: &HeadLanes<L>,
    p: &mut PointLanes<L>,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
    step: &StepParams,
) {
    let (normal, [ra, rb]) = (head.normal, arms(head, p));
    let velocity = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    let separation = separation(head, p, a, b);
    let apart = separation.simd_gt(L::ZERO);
    let gap = separation * L::splat(step.inverse_h);
    let (bias, mass_scale, impulse_scale) = if visit == Visit::Solve {
        let (mass_scale, impulse_scale) = (head.mass_scale, head.impulse_scale);
        let pull = (head.bias_rate * separation).fast_max(L::splat(-step.push_speed));
        (pull, apart.bitselect(L::ONE, mass_scale), apart.bitselect(L::ZERO, impulse_scale))
    } else {
        let first = p.total[0].simd_eq(L::ZERO) & p.normal.simd_eq(L::ZERO);
        p.approach = first.bitselect(p.approach.fast_min(velocity), p.approach);
        (L::ZERO, L::ONE, L::ZERO)
    };
    let bias = apart.bitselect(gap, bias);
    let change = -p.normal_mass * mass_scale * (velocity + bias) - impulse_scale * p.normal;
    let sum = p.normal + change;
    let new = sum.fast_max(L::ZERO);
    let push = new - p.normal;
    let good = sum.is_finite();
    let push = good.bitselect(push, L::ZERO);
    p.normal = good.bitselect(new, p.normal);
    apply(a, b, ra, rb, push * normal);
}
