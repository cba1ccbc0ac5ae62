//! The law of `soft`, four constraints at a time: the same operations in the same order, so the same results.

use super::Visit;
use super::lanes::{BodyLanes, ConstraintLanes, HeadLanes, PointLanes};
use super::push_lanes::{apply, push_tangent, separation};
use tumble_core::layout::StepParams;
use wide::f32x4;

/// One visit to four constraints of one batch.
#[inline(always)]
pub(super) fn visit(visit: Visit, c: &mut ConstraintLanes, a: &mut BodyLanes, b: &mut BodyLanes, step: &StepParams) {
    let (head, points) = c.split();
    for p in points.iter_mut() {
        push_normal(visit, head, p, a, b, step);
    }
    for p in points {
        push_tangent(head, p, a, b);
    }
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
    let (normal, ra, rb) = (head.normal, p.anchor_a, p.anchor_b);
    let velocity = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    let separation = separation(head, p, a, b);
    let apart = separation.simd_gt(f32x4::ZERO);
    let gap = separation * f32x4::splat(step.inverse_h);
    let (bias, mass_scale, impulse_scale) = if visit == Visit::Solve {
        let (mass_scale, impulse_scale) = (head.mass_scale, head.impulse_scale);
        let pull = (head.bias_rate * separation).fast_max(f32x4::splat(-step.push_speed));
        (pull, apart.bitselect(f32x4::ONE, mass_scale), apart.bitselect(f32x4::ZERO, impulse_scale))
    } else {
        let first = p.max_impulse.simd_eq(f32x4::ZERO);
        p.approach = first.bitselect(p.approach.fast_min(velocity), p.approach);
        (f32x4::ZERO, f32x4::ONE, f32x4::ZERO)
    };
    let bias = apart.bitselect(gap, bias);
    let change = -p.normal_mass * mass_scale * (velocity + bias) - impulse_scale * p.normal;
    let sum = p.normal + change;
    let new = sum.fast_max(f32x4::ZERO);
    let push = new - p.normal;
    let good = sum.is_finite();
    let push = good.bitselect(push, f32x4::ZERO);
    p.normal = good.bitselect(new, p.normal);
    p.max_impulse = good.bitselect(p.max_impulse.fast_max(new), p.max_impulse);
    apply(a, b, ra, rb, push * normal);
}
