//! The law of `gauss_seidel`, several constraints at a time: the same operations in the same order, so the same
//! results.

use super::lanes::{BodyLanes, ConstraintLanes, HeadLanes, PointLanes};
use super::push_lanes::{apply, arms, count, push_tangent, separation};
use super::simd::Lanes;
use tumble_core::layout::StepParams;

/// One visit to the constraints of a group.
#[inline(always)]
pub(super) fn visit<L: Lanes>(
    last: bool,
    c: &mut ConstraintLanes<L>,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
    step: &StepParams,
) {
    let (head, points) = c.split();
    for p in points.iter_mut() {
        push_normal(head, p, p.normal_mass, a, b, step);
    }
    for p in points {
        push_tangent(head, p, a, b);
        if last {
            count(p);
        }
    }
}

#[inline(always)]
pub(super) fn push_normal<L: Lanes>(
    head: &HeadLanes<L>,
    p: &mut PointLanes<L>,
    mass: L,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
    step: &StepParams,
) {
    let (normal, [ra, rb]) = (head.normal, arms(head, p));
    let velocity = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    let separation = separation(head, p, a, b);
    let beyond = (separation + L::splat(step.slop)).fast_min(L::ZERO);
    let pull = (head.bias_rate * beyond).fast_max(L::splat(-step.push_speed));
    let gap = separation * L::splat(step.inverse_h);
    let bias = separation.simd_gt(L::ZERO).bitselect(gap, pull);
    let sum = p.normal - mass * (velocity + bias);
    let new = sum.fast_max(L::ZERO);
    let good = sum.is_finite();
    let push = good & (new - p.normal);
    p.normal = good.bitselect(new, p.normal);
    apply(a, b, ra, rb, push * normal);
    let first = good & p.normal.simd_eq(L::ZERO) & p.total[0].simd_eq(L::ZERO);
    p.approach = first.bitselect(p.approach.fast_min(velocity), p.approach);
}
