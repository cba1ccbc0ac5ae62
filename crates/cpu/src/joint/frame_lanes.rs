//! The frames of joints side by side: `frame` in lanes. What kind of joint it is, is the same in all of them.

use super::frame::{SHORTEST, used};
use super::lanes::{M3, Q, at, length, put, select, splat};
use crate::solver::simd::{Lanes, V3};
use glam::Vec3;
use tumble_core::layout::joint_bits;

/// Where bodies are.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PoseLanes<L> {
    pub(super) translation: V3<L>,
    pub(super) rotation: Q<L>,
}

/// What joints of one kind differ in.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Anchors<L> {
    pub(super) rotations: [Q<L>; 2],
    pub(super) anchors: [V3<L>; 2],
    /// From the first centre of mass to the second one when the step began, m.
    pub(super) between: V3<L>,
}

/// See [`Frame`](super::frame::Frame).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrameLanes<L> {
    pub(super) arms: [V3<L>; 2],
    /// Axes along and about.
    pub(super) axes: [M3<L>; 2],
    /// Coordinates along and about.
    pub(super) coordinates: [V3<L>; 2],
}

/// The joints' frames.
#[inline(always)]
pub(super) fn frame<L: Lanes>(
    [axes, flags]: [u32; 2],
    joint: &Anchors<L>,
    a: &PoseLanes<L>,
    b: &PoseLanes<L>,
) -> FrameLanes<L> {
    let (qa, qb) = (a.rotation.times(joint.rotations[0]), b.rotation.times(joint.rotations[1]));
    let (to_a, arm_b) = (a.rotation.rotate(joint.anchors[0]), b.rotation.rotate(joint.anchors[1]));
    let offset = joint.between + (b.translation - a.translation) + (arm_b - to_a);
    let mut frame = FrameLanes { arms: [to_a + offset, arm_b], ..FrameLanes::default() };
    if used(axes, 0) != 0 {
        (frame.axes[0], frame.coordinates[0]) = axes_along(axes, flags, qa, offset);
    }
    if used(axes, 1) != 0 {
        (frame.axes[1], frame.coordinates[1]) = axes_about(axes, qa, qb);
    }
    frame
}

#[inline(always)]
fn axes_along<L: Lanes>(axes: u32, flags: u32, qa: Q<L>, offset: V3<L>) -> (M3<L>, V3<L>) {
    if flags & joint_bits::COUPLED != 0 {
        let distance = length(offset);
        let long = distance.simd_gt(L::splat(SHORTEST));
        let axis = select(long, offset / distance, qa.rotate(splat(Vec3::X)));
        let zero = V3::default();
        return (M3([axis, zero, zero]), V3::new(distance, L::ZERO, L::ZERO));
    }
    if axes >> joint_bits::LOCKED & 7 == 7 {
        return (M3::identity(), offset);
    }
    let axes = qa.matrix();
    (axes, axes.back(offset))
}

#[inline(always)]
fn axes_about<L: Lanes>(axes: u32, qa: Q<L>, qb: Q<L>) -> (M3<L>, V3<L>) {
    let between = qa.conjugate().times(qb);
    let far = between.w.simd_lt(L::ZERO);
    let b = between.imaginary;
    let imaginary = select(far, V3::new(-b.x, -b.y, -b.z), b);
    let between = Q { imaginary, w: far.bitselect(-between.w, between.w) };
    let locked = axes >> (joint_bits::LOCKED + 3) & 7;
    match locked.count_ones() {
        2 => hinge((7 & !locked).trailing_zeros() as usize, qa, between),
        1 => universal(locked.trailing_zeros() as usize, qa, qb, between),
        _ => rotation_vector(qa, between),
    }
}

#[inline(always)]
fn hinge<L: Lanes>(axis: usize, qa: Q<L>, between: Q<L>) -> (M3<L>, V3<L>) {
    let unit = splat(Vec3::AXES[axis]);
    let mut turn = unit.cross(between.rotate(unit));
    put(&mut turn, axis, L::splat(2.0) * arc_tangent(at(&between.imaginary, axis), between.w));
    (qa.matrix(), turn)
}

#[inline(always)]
fn universal<L: Lanes>(locked: usize, qa: Q<L>, qb: Q<L>, between: Q<L>) -> (M3<L>, V3<L>) {
    let (j, k) = ((locked + 1) % 3, (locked + 2) % 3);
    let (mut axes, mut turn) = (M3::default(), V3::default());
    let second = between.rotate(splat(Vec3::AXES[k]));
    let first = between.conjugate().rotate(splat(Vec3::AXES[j]));
    put(&mut turn, j, arc_tangent(at(&second, locked), at(&second, k)));
    put(&mut turn, k, arc_tangent(at(&first, locked), at(&first, j)));
    put(&mut turn, locked, -at(&second, j));
    axes.0[j] = qa.rotate(splat(Vec3::AXES[j]));
    axes.0[k] = qb.rotate(splat(Vec3::AXES[k]));
    let normal = axes.0[j].cross(axes.0[k]);
    let length = length(normal);
    let apart = length.simd_gt(L::splat(1e-3));
    axes.0[locked] = select(apart, normal / length, qa.rotate(splat(Vec3::AXES[locked])));
    (axes, turn)
}

#[inline(always)]
fn rotation_vector<L: Lanes>(qa: Q<L>, between: Q<L>) -> (M3<L>, V3<L>) {
    let n = L::splat;
    let sine = length(between.imaginary);
    let half = arc_tangent(sine, between.w);
    let small = sine.simd_lt(n(1e-2));
    let ratio = small.bitselect(n(2.0) + sine * sine / n(3.0), n(2.0) * half / sine);
    let turn = ratio * between.imaginary;
    let square = turn.dot(turn);
    let far = (L::ONE - half * between.w / sine) / square;
    let share = small.bitselect(n(1.0 / 12.0) + square / n(720.0), far);
    let mut axes = M3::default();
    for (column, unit) in axes.0.iter_mut().zip(Vec3::AXES) {
        let unit = splat(unit);
        let once = turn.cross(unit);
        *column = qa.rotate(unit + n(0.5) * once + share * turn.cross(once));
    }
    (axes, turn)
}

/// See [`arc_tangent`](super::frame::arc_tangent).
#[inline(always)]
fn arc_tangent<L: Lanes>(y: L, x: L) -> L {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let n = L::splat;
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = (ax.fast_min(ay), ax.fast_max(ay));
    let ratio = low / high;
    let far = ratio.simd_gt(n(0.414_213_57));
    let t = far.bitselect((ratio - L::ONE) / (ratio + L::ONE), ratio);
    let z = t * t;
    let series = ((n(0.080_537_446) * z - n(0.138_776_86)) * z + n(0.199_777_1)) * z - n(0.333_329_5);
    let angle = series * z * t + t;
    let angle = far.bitselect(angle + n(FRAC_PI_4), angle);
    let angle = ay.simd_gt(ax).bitselect(n(FRAC_PI_2) - angle, angle);
    let angle = x.simd_lt(L::ZERO).bitselect(n(PI) - angle, angle);
    let angle = y.simd_lt(L::ZERO).bitselect(-angle, angle);
    !high.simd_eq(L::ZERO) & angle
}
