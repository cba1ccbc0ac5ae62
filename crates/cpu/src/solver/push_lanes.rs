//! What the laws of `push` do, several constraints at a time: the same operations in the same order, so the same results.

use super::lanes::{BodyLanes, HeadLanes, PointLanes};
use super::resist_lanes;
use super::simd::{Lanes, V3};
use tumble_core::layout::StepParams;

#[inline(always)]
pub(super) fn warm_start<L: Lanes>(
    head: &HeadLanes<L>,
    points: &[PointLanes<L>],
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
) {
    let (normal, [t1, t2]) = (head.normal, head.tangents);
    for p in points {
        let push = p.normal * normal + p.tangent[0] * t1 + p.tangent[1] * t2;
        let [ra, rb] = arms(head, p);
        apply(a, b, ra, rb, push);
    }
    resist_lanes::warm_start(head, a, b);
}

/// From the bodies' centres of mass to one point of each.
#[inline(always)]
pub(super) fn arms<L: Lanes>(head: &HeadLanes<L>, p: &PointLanes<L>) -> [V3<L>; 2] {
    [p.anchor, p.anchor - head.between]
}

/// Counts a sub-step's impulses.
#[inline(always)]
pub(super) fn count<L: Lanes>(p: &mut PointLanes<L>) {
    p.total[0] += p.normal;
    p.total[1] += p.tangent[0];
    p.total[2] += p.tangent[1];
}

/// Gaps at one point of each.
#[inline(always)]
pub(super) fn separation<L: Lanes>(head: &HeadLanes<L>, p: &PointLanes<L>, a: &BodyLanes<L>, b: &BodyLanes<L>) -> L {
    let [ra, rb] = arms(head, p);
    let (core_a, core_b) = (ra - head.round_a * head.normal, rb - head.round_b * head.normal);
    let moved = b.translation - a.translation + b.turned(core_b) - a.turned(core_a);
    p.adjusted_separation + head.normal.dot(moved)
}

#[inline(always)]
pub(super) fn push_tangent<L: Lanes>(
    head: &HeadLanes<L>,
    p: &mut PointLanes<L>,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
) {
    let ([t1, t2], [ra, rb]) = (head.tangents, arms(head, p));
    let slide = b.velocity_at(rb) - a.velocity_at(ra);
    let [u, v] = head.surface_velocity;
    let x = p.tangent[0] - p.tangent_mass * (t1.dot(slide) + u);
    let y = p.tangent[1] - p.tangent_mass * (t2.dot(slide) + v);
    let length = (x * x + y * y).sqrt();
    let most = head.friction * p.normal;
    let scale = length.simd_gt(most).bitselect(most / length, L::ONE);
    let (x, y) = (x * scale, y * scale);
    let push = (x - p.tangent[0]) * t1 + (y - p.tangent[1]) * t2;
    let good = push.x.is_finite() & push.y.is_finite() & push.z.is_finite();
    let push = V3::new(good & push.x, good & push.y, good & push.z);
    p.tangent = [good.bitselect(x, p.tangent[0]), good.bitselect(y, p.tangent[1])];
    apply(a, b, ra, rb, push);
}

#[inline(always)]
pub(super) fn bounce<L: Lanes>(
    head: &HeadLanes<L>,
    p: &mut PointLanes<L>,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
    step: &StepParams,
) {
    let (restitution, normal) = (head.restitution, head.normal);
    let threshold = L::splat(-step.restitution_threshold);
    let bounces = restitution.simd_gt(L::ZERO) & !p.approach.simd_gt(threshold) & p.total[0].simd_gt(L::ZERO);
    let [ra, rb] = arms(head, p);
    let velocity = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    let change = -p.normal_mass * (velocity + restitution * p.approach);
    let sum = p.normal + change;
    let new = sum.fast_max(L::ZERO);
    let push = new - p.normal;
    let good = bounces & sum.is_finite();
    p.normal = good.bitselect(new, p.normal);
    p.total[0] += good & push;
    apply(a, b, ra, rb, (good & push) * normal);
}

#[inline(always)]
pub(super) fn apply<L: Lanes>(a: &mut BodyLanes<L>, b: &mut BodyLanes<L>, ra: V3<L>, rb: V3<L>, push: V3<L>) {
    a.linear = a.linear - a.inverse_mass * a.along_free(push);
    a.angular = a.angular - a.inverse_inertia_times(ra.cross(push));
    b.linear = b.linear + b.inverse_mass * b.along_free(push);
    b.angular = b.angular + b.inverse_inertia_times(rb.cross(push));
}
