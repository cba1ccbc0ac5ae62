//! The law of `one_pass`, several constraints at a time: the same operations in the same order, so the same results.

use super::lanes::{BodyLanes, ConstraintLanes, HeadLanes, PointLanes, Weights};
use super::one_pass::{DEVIATION, FADE};
use super::push_lanes::{apply, arms, count, push_tangent, separation, warm_start};
use super::resist_lanes::resist;
use super::simd::{Lanes, V3};
use tumble_core::layout::StepParams;

/// Applies the stored impulses; what each body's weights grow by.
#[inline(always)]
pub(super) fn load<L: Lanes>(
    c: &mut ConstraintLanes<L>,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
) -> [Weights<L>; 2] {
    let (head, points) = c.split();
    warm_start(head, points, a, b);
    let mut weight = L::ZERO;
    for p in points {
        let [x, y] = p.tangent;
        weight += over(p.normal * p.normal, p.normal_mass) + over(x * x + y * y, p.tangent_mass);
    }
    if head.resists {
        let [twist, x, y] = head.resisted;
        weight += over(twist * twist, head.twisting_inertia) + over(x * x + y * y, head.rolling_inertia);
    }
    let [from_a, from_b] = eigenvalues(a, b);
    [Weights { weight, weighted: weight * from_b }, Weights { weight, weighted: weight * from_a }]
}

/// One visit to the constraints of a group. The push that is to be counted to what the sub-step began with, of each
/// point that had one.
#[inline(always)]
pub(super) fn pass<L: Lanes>(
    c: &mut ConstraintLanes<L>,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
    step: &StepParams,
) -> [Option<V3<L>>; 4] {
    let (head, points) = c.split();
    let mut before = [(L::ZERO, [L::ZERO; 2]); 4];
    for (before, p) in before.iter_mut().zip(points.iter_mut()) {
        *before = (p.normal, p.tangent);
        push_normal(head, p, a, b, step);
    }
    for p in points.iter_mut() {
        push_tangent(head, p, a, b);
        count(p);
    }
    resist(head, points, a, b);
    remember(head, points, a, b, step);
    let mut blows = [None; 4];
    for ((blown, (normal, tangent)), p) in blows.iter_mut().zip(before).zip(points) {
        let blow = p.normal - normal;
        let hard = blow.simd_gt(L::splat(step.blow_speed) * p.normal_mass);
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
fn push_normal<L: Lanes>(
    head: &HeadLanes<L>,
    p: &mut PointLanes<L>,
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
    step: &StepParams,
) {
    let (normal, [ra, rb], mass) = (head.normal, arms(head, p), p.normal_mass);
    let velocity = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    let separation = separation(head, p, a, b);
    let remembered = head.remembered + p.deviation;
    let band = L::splat(step.memory_band) * remembered;
    let pressed = p.normal.simd_gt(L::ZERO) & (separation * mass).simd_lt(band);
    let apart = separation.simd_gt(L::ZERO) & !pressed;
    let close = -mass * (velocity + separation * L::splat(step.inverse_h));
    let leak = head.impulse_scale * (p.normal - remembered);
    let spring = head.mass_scale * mass * head.bias_rate * separation;
    let pull = (spring + leak).fast_max(L::splat(-step.push_speed) * mass);
    let press = -(head.mass_scale * mass * velocity + pull);
    let sum = p.normal + apart.bitselect(close, press);
    let new = sum.fast_max(L::ZERO);
    let push = new - p.normal;
    let good = sum.is_finite();
    let push = good.bitselect(push, L::ZERO);
    p.normal = good.bitselect(new, p.normal);
    let free = good & new.simd_eq(L::ZERO) & p.total[0].simd_eq(L::ZERO);
    p.approach = free.bitselect(p.approach.fast_min(velocity), p.approach);
    apply(a, b, ra, rb, push * normal);
}

#[inline(always)]
fn remember<L: Lanes>(
    head: &mut HeadLanes<L>,
    points: &mut [PointLanes<L>],
    a: &BodyLanes<L>,
    b: &BodyLanes<L>,
    step: &StepParams,
) {
    let mut sum = L::ZERO;
    for p in points.iter() {
        sum += p.normal;
    }
    // A lane without a constraint has no points.
    let mean = sum / head.counts.fast_max(L::ONE);
    let [from_a, from_b] = eigenvalues(a, b);
    let rate = (L::splat(step.memory_gain) * (from_a + from_b)).fast_min(L::splat(step.memory_limit));
    let followed = head.remembered + rate * (mean - head.remembered);
    let remembered = mean.simd_gt(L::ZERO).bitselect(followed, L::splat(FADE) * head.remembered);
    head.remembered = remembered;
    for (k, p) in points.iter_mut().enumerate() {
        let used = head.counts.simd_gt(L::splat(k as f32));
        let more = p.normal - mean;
        let own = remembered + p.deviation + L::splat(DEVIATION) * rate * rate * (more - p.deviation);
        let own = own.fast_max(L::ZERO);
        let own = p.normal.simd_gt(L::ZERO).bitselect(own, L::splat(FADE) * own.fast_min(remembered));
        p.deviation = used & (own - remembered);
    }
}

#[inline(always)]
fn eigenvalues<L: Lanes>(a: &BodyLanes<L>, b: &BodyLanes<L>) -> [L; 2] {
    [
        a.inverse_mass.simd_gt(L::ZERO).bitselect(a.eigenvalue, b.eigenvalue),
        b.inverse_mass.simd_gt(L::ZERO).bitselect(b.eigenvalue, a.eigenvalue),
    ]
}

#[inline(always)]
fn over<L: Lanes>(square: L, mass: L) -> L {
    mass.simd_gt(L::ZERO) & (square / mass)
}
