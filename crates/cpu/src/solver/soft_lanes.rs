//! The law of `soft`, several constraints at a time: the same operations in the same order, so the same results.

use super::Visit;
use super::lanes::{BodyLanes, ConstraintLanes, HeadLanes, Lane, PointLanes};
use super::push_lanes::{apply, arms, count, push_tangent, separation};
use super::resist_lanes::resist;
use tumble_core::layout::StepParams;

/// One visit to the constraints of a group.
#[inline(always)]
pub(super) fn visit(visit: Visit, c: &mut ConstraintLanes, a: &mut BodyLanes, b: &mut BodyLanes, step: &StepParams) {
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
fn push_normal(
    visit: Visit,
    head: &HeadLanes,
    p: &mut PointLanes,
    a: &mut BodyLanes,
    b: &mut BodyLanes,
    step: &StepParams,
) {
    let (normal, [ra, rb]) = (head.normal, arms(head, p));
    let velocity = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    let separation = separation(head, p, a, b);
    let apart = separation.simd_gt(Lane::ZERO);
    let gap = separation * Lane::splat(step.inverse_h);
    let (bias, mass_scale, impulse_scale) = if visit == Visit::Solve {
        let (mass_scale, impulse_scale) = (head.mass_scale, head.impulse_scale);
        let pull = (head.bias_rate * separation).fast_max(Lane::splat(-step.push_speed));
        (pull, apart.bitselect(Lane::ONE, mass_scale), apart.bitselect(Lane::ZERO, impulse_scale))
    } else {
        let first = p.total[0].simd_eq(Lane::ZERO) & p.normal.simd_eq(Lane::ZERO);
        p.approach = first.bitselect(p.approach.fast_min(velocity), p.approach);
        (Lane::ZERO, Lane::ONE, Lane::ZERO)
    };
    let bias = apart.bitselect(gap, bias);
    let change = -p.normal_mass * mass_scale * (velocity + bias) - impulse_scale * p.normal;
    let sum = p.normal + change;
    let new = sum.fast_max(Lane::ZERO);
    let push = new - p.normal;
    let good = sum.is_finite();
    let push = good.bitselect(push, Lane::ZERO);
    p.normal = good.bitselect(new, p.normal);
    apply(a, b, ra, rb, push * normal);
}
