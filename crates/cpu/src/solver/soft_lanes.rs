//! The law of `soft`, four constraints at a time: the same operations in the same order, so the same results.

use super::Visit;
use super::lanes::{BodyLanes, ConstraintLanes, PointLanes, V3};
use tumble_core::layout::StepParams;
use wide::f32x4;

/// One visit to four constraints of one batch.
#[inline(always)]
pub(crate) fn visit(visit: Visit, c: &mut ConstraintLanes, a: &mut BodyLanes, b: &mut BodyLanes, step: &StepParams) {
    let (normal, [t1, t2], count) = (c.normal, c.tangents, c.count);
    match visit {
        Visit::WarmStart => {
            for p in &c.points[..count] {
                let push = p.normal * normal + p.tangent[0] * t1 + p.tangent[1] * t2;
                apply(a, b, p.anchor_a, p.anchor_b, push);
            }
        }
        Visit::Solve | Visit::Relax => {
            let soft = [c.bias_rate, c.mass_scale, c.impulse_scale];
            for p in &mut c.points[..count] {
                push_normal(visit, normal, soft, p, a, b, step);
            }
            for p in &mut c.points[..count] {
                push_tangent(c.friction, t1, t2, p, a, b);
            }
        }
        Visit::Restitution => {
            for p in &mut c.points[..count] {
                bounce(c.restitution, normal, p, a, b, step);
            }
        }
    }
}

#[inline(always)]
fn push_normal(
    visit: Visit,
    normal: V3,
    soft: [f32x4; 3],
    p: &mut PointLanes,
    a: &mut BodyLanes,
    b: &mut BodyLanes,
    step: &StepParams,
) {
    let (ra, rb) = (p.anchor_a, p.anchor_b);
    let velocity = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    let moved = b.translation - a.translation + b.turned(rb) - a.turned(ra);
    let separation = p.adjusted_separation + normal.dot(moved);
    let apart = separation.simd_gt(f32x4::ZERO);
    let gap = separation * f32x4::splat(step.inverse_h);
    let (bias, mass_scale, impulse_scale) = if visit == Visit::Solve {
        let [rate, mass_scale, impulse_scale] = soft;
        let pull = (rate * separation).fast_max(f32x4::splat(-step.push_speed));
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

#[inline(always)]
fn push_tangent(friction: f32x4, t1: V3, t2: V3, p: &mut PointLanes, a: &mut BodyLanes, b: &mut BodyLanes) {
    let (ra, rb) = (p.anchor_a, p.anchor_b);
    let slide = b.velocity_at(rb) - a.velocity_at(ra);
    let x = p.tangent[0] - p.tangent_mass * t1.dot(slide);
    let y = p.tangent[1] - p.tangent_mass * t2.dot(slide);
    let length = (x * x + y * y).sqrt();
    let most = friction * p.normal;
    let scale = length.simd_gt(most).bitselect(most / length, f32x4::ONE);
    let (x, y) = (x * scale, y * scale);
    let push = (x - p.tangent[0]) * t1 + (y - p.tangent[1]) * t2;
    let good = push.x.is_finite() & push.y.is_finite() & push.z.is_finite();
    let push = V3::new(good & push.x, good & push.y, good & push.z);
    p.tangent = [good.bitselect(x, p.tangent[0]), good.bitselect(y, p.tangent[1])];
    apply(a, b, ra, rb, push);
}

#[inline(always)]
fn bounce(restitution: f32x4, normal: V3, p: &mut PointLanes, a: &mut BodyLanes, b: &mut BodyLanes, step: &StepParams) {
    let threshold = f32x4::splat(-step.restitution_threshold);
    let bounces =
        restitution.simd_gt(f32x4::ZERO) & !p.approach.simd_gt(threshold) & p.max_impulse.simd_gt(f32x4::ZERO);
    let velocity = normal.dot(b.velocity_at(p.anchor_b) - a.velocity_at(p.anchor_a));
    let change = -p.normal_mass * (velocity + restitution * p.approach);
    let sum = p.normal + change;
    let new = sum.fast_max(f32x4::ZERO);
    let push = new - p.normal;
    let good = bounces & sum.is_finite();
    p.normal = good.bitselect(new, p.normal);
    apply(a, b, p.anchor_a, p.anchor_b, (good & push) * normal);
}

#[inline(always)]
fn apply(a: &mut BodyLanes, b: &mut BodyLanes, ra: V3, rb: V3, push: V3) {
    a.linear = a.linear - a.inverse_mass * push;
    a.angular = a.angular - a.inverse_inertia_times(ra.cross(push));
    b.linear = b.linear + b.inverse_mass * push;
    b.angular = b.angular + b.inverse_inertia_times(rb.cross(push));
}
