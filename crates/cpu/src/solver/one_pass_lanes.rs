//! The law of `one_pass`, four constraints at a time: the same operations in the same order, so the same results.

use super::lanes::{BodyLanes, ConstraintLanes, HeadLanes, LANES, PointLanes, V3, Weights};
use super::one_pass::FADE;
use super::push_lanes::{apply, push_tangent, separation, warm_start};
use tumble_core::layout::StepParams;
use wide::f32x4;

/// Applies the stored impulses; what each body's weights grow by.
#[inline(always)]
pub(super) fn load(c: &mut ConstraintLanes, a: &mut BodyLanes, b: &mut BodyLanes) -> [Weights; 2] {
    let (head, points) = c.split();
    warm_start(head, points, a, b);
    let mut weight = f32x4::ZERO;
    for p in points {
        let [x, y] = p.tangent;
        weight += over(p.normal * p.normal, p.normal_mass) + over(x * x + y * y, p.tangent_mass);
    }
    let [from_a, from_b] = eigenvalues(a, b);
    [Weights { weight, weighted: weight * from_b }, Weights { weight, weighted: weight * from_a }]
}

/// One visit to four constraints of one batch. The push that is to be counted to what the sub-step began with, of each
/// point that had one.
#[inline(always)]
pub(super) fn pass(
    c: &mut ConstraintLanes,
    a: &mut BodyLanes,
    b: &mut BodyLanes,
    step: &StepParams,
) -> [Option<V3>; 4] {
    let (head, points) = c.split();
    let mut before = [(f32x4::ZERO, [f32x4::ZERO; 2]); LANES];
    for (before, p) in before.iter_mut().zip(points.iter_mut()) {
        *before = (p.normal, p.tangent);
        push_normal(head, p, a, b, step);
    }
    for p in points.iter_mut() {
        push_tangent(head, p, a, b);
    }
    remember(head, points, a, b, step);
    let mut blows = [None; 4];
    for ((blown, (normal, tangent)), p) in blows.iter_mut().zip(before).zip(points) {
        let blow = p.normal - normal;
        let hard = blow.simd_gt(f32x4::splat(step.blow_speed) * p.normal_mass);
        if hard.any() {
            let (x, y) = (p.tangent[0] - tangent[0], p.tangent[1] - tangent[1]);
            let push = blow * head.normal + x * head.tangents[0] + y * head.tangents[1];
            *blown = Some(V3::new(hard & push.x, hard & push.y, hard & push.z));
            p.normal = hard.bitselect(normal, p.normal);
            p.tangent = [hard.bitselect(tangent[0], p.tangent[0]), hard.bitselect(tangent[1], p.tangent[1])];
        }
    }
    blows
}

#[inline(always)]
fn push_normal(head: &HeadLanes, p: &mut PointLanes, a: &mut BodyLanes, b: &mut BodyLanes, step: &StepParams) {
    let (normal, ra, rb, mass) = (head.normal, p.anchor_a, p.anchor_b, p.normal_mass);
    let velocity = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    let separation = separation(head, p, a, b);
    let first = p.max_impulse.simd_eq(f32x4::ZERO);
    p.approach = first.bitselect(p.approach.fast_min(velocity), p.approach);
    let band = f32x4::splat(step.memory_band) * head.remembered;
    let pressed = p.normal.simd_gt(f32x4::ZERO) & (separation * mass).simd_lt(band);
    let apart = separation.simd_gt(f32x4::ZERO) & !pressed;
    let close = -mass * (velocity + separation * f32x4::splat(step.inverse_h));
    let leak = head.impulse_scale * (p.normal - head.remembered);
    let spring = head.mass_scale * mass * head.bias_rate * separation;
    let pull = (spring + leak).fast_max(f32x4::splat(-step.push_speed) * mass);
    let press = -(head.mass_scale * mass * velocity + pull);
    let sum = p.normal + apart.bitselect(close, press);
    let new = sum.fast_max(f32x4::ZERO);
    let push = new - p.normal;
    let good = sum.is_finite();
    let push = good.bitselect(push, f32x4::ZERO);
    p.normal = good.bitselect(new, p.normal);
    p.max_impulse = good.bitselect(p.max_impulse.fast_max(new), p.max_impulse);
    apply(a, b, ra, rb, push * normal);
}

#[inline(always)]
fn remember(head: &mut HeadLanes, points: &[PointLanes], a: &BodyLanes, b: &BodyLanes, step: &StepParams) {
    let mut sum = f32x4::ZERO;
    for p in points {
        sum += p.normal;
    }
    // A lane without a constraint has no points.
    let mean = sum / head.counts.fast_max(f32x4::ONE);
    let [from_a, from_b] = eigenvalues(a, b);
    let rate = (f32x4::splat(step.memory_gain) * (from_a + from_b)).fast_min(f32x4::splat(step.memory_limit));
    let followed = head.remembered + rate * (mean - head.remembered);
    head.remembered = mean.simd_gt(f32x4::ZERO).bitselect(followed, f32x4::splat(FADE) * head.remembered);
}

#[inline(always)]
fn eigenvalues(a: &BodyLanes, b: &BodyLanes) -> [f32x4; 2] {
    [
        a.inverse_mass.simd_gt(f32x4::ZERO).bitselect(a.eigenvalue, b.eigenvalue),
        b.inverse_mass.simd_gt(f32x4::ZERO).bitselect(b.eigenvalue, a.eigenvalue),
    ]
}

fn over(square: f32x4, mass: f32x4) -> f32x4 {
    mass.simd_gt(f32x4::ZERO) & (square / mass)
}
