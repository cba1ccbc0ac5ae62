//! The rotation vector of [`frame`](super::frame), several at a time.

use super::joined_lanes::{choose, length, product, rotate};
use crate::solver::simd::{Lanes, V3};

/// Axes in the world and coordinates of joints that lock all angles, from their frames at both bodies.
#[inline(always)]
pub(super) fn rotation_vector<L: Lanes>(qa: [L; 4], qb: [L; 4]) -> ([V3<L>; 3], V3<L>) {
    let [x, y, z, w] = qa;
    let [x, y, z, w] = product([-x, -y, -z, w], qb);
    let negative = w.simd_lt(L::ZERO);
    let (imaginary, w) = (V3::new(x, y, z), w.abs());
    let imaginary = choose(negative, V3::default() - imaginary, imaginary);
    let sine = length(imaginary);
    let half = arc_tangent(sine, w);
    let small = sine.simd_lt(L::splat(1e-2));
    let ratio = small.bitselect(L::splat(2.0) + sine * sine * L::splat(1.0 / 3.0), L::splat(2.0) * half / sine);
    let turn = ratio * imaginary;
    let square = turn.dot(turn);
    let share =
        small.bitselect(L::splat(1.0 / 12.0) + square * L::splat(1.0 / 720.0), (L::ONE - half * w / sine) / square);
    let (zero, one) = (L::ZERO, L::ONE);
    let x = column(qa, turn, share, V3::new(one, zero, zero));
    let y = column(qa, turn, share, V3::new(zero, one, zero));
    let z = column(qa, turn, share, V3::new(zero, zero, one));
    ([x, y, z], turn)
}

/// What the inverse of the left Jacobian makes of an axis of the first body, in the world.
#[inline(always)]
fn column<L: Lanes>(qa: [L; 4], turn: V3<L>, share: L, unit: V3<L>) -> V3<L> {
    let once = turn.cross(unit);
    rotate(qa, unit + L::splat(0.5) * once + share * turn.cross(once))
}

/// [`arc_tangent`](super::frame::arc_tangent) where neither is negative.
#[inline(always)]
fn arc_tangent<L: Lanes>(y: L, x: L) -> L {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let (low, high) = (x.fast_min(y), x.fast_max(y));
    let ratio = high.simd_gt(L::ZERO) & (low / high);
    let far = ratio.simd_gt(L::splat(0.414_213_57));
    let t = far.bitselect((ratio - L::ONE) / (ratio + L::ONE), ratio);
    let z = t * t;
    let series = ((L::splat(0.080_537_446) * z - L::splat(0.138_776_86)) * z + L::splat(0.199_777_1)) * z
        - L::splat(0.333_329_5);
    let angle = series * z * t + t + (far & L::splat(FRAC_PI_4));
    y.simd_gt(x).bitselect(L::splat(FRAC_PI_2) - angle, angle)
}
