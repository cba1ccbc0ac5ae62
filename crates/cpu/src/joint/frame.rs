//! Where a joint's bodies are against each other: its axes and coordinates. Twin of `shaders/joint/frame.wgsl`.
//!
//! The rate of a coordinate is that of the second body's motion against the first along or about its axis: for axes
//! along, at the second anchor; the axes turn with the first body. What turns about: a hinge has the angle about its
//! axis, and the sines by which the axes of its two bodies differ; a universal joint, which locks one axis, the angle
//! about the first free one, fixed to the first body, that about the second one, fixed to the second body, and the cosine
//! between them; any other joint the rotation vector, whose rates follow from the angular velocity by the inverse of the
//! left Jacobian of SO(3).

use crate::math::{rotate, rotate_back};
use glam::{Mat3, Quat, Vec3};
use tumble_core::layout::{Joint, joint_bits};

/// Where a body is: its centre of mass, and its principal frame.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// m, from wherever the step began for it.
    pub translation: Vec3,
    /// Principal frame to world.
    pub rotation: Quat,
}

/// A joint between two poses.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// From the first centre of mass to the second anchor, m.
    pub arm_a: Vec3,
    /// From the second centre of mass to the second anchor, m.
    pub arm_b: Vec3,
    /// Axes along, in the world.
    pub along: Mat3,
    /// Axes about, in the world.
    pub about: Mat3,
    /// Coordinates along, m.
    pub shift: Vec3,
    /// Coordinates about, rad; of locked axes what they are off by.
    pub turn: Vec3,
}

impl Frame {
    /// That of a joint that nobody has looked at.
    pub const NONE: Self = Self {
        arm_a: Vec3::ZERO,
        arm_b: Vec3::ZERO,
        along: Mat3::ZERO,
        about: Mat3::ZERO,
        shift: Vec3::ZERO,
        turn: Vec3::ZERO,
    };
}

/// The joint's frame. `between` leads from where the first body's centre of mass was when the step began to where the
/// second one's was, m.
pub fn frame(joint: &Joint, a: &Pose, b: &Pose, between: Vec3) -> Frame {
    let (qa, qb) = (a.rotation * Quat::from_array(joint.rotation_a), b.rotation * Quat::from_array(joint.rotation_b));
    let (to_a, arm_b) =
        (rotate(a.rotation, Vec3::from(joint.anchor_a)), rotate(b.rotation, Vec3::from(joint.anchor_b)));
    let offset = between + (b.translation - a.translation) + (arm_b - to_a);
    let (along, shift) =
        if used(joint.axes, 0) != 0 { axes_along(joint, qa, offset) } else { (Mat3::ZERO, Vec3::ZERO) };
    let (about, turn) = if used(joint.axes, 1) != 0 { axes_about(joint, qa, qb) } else { (Mat3::ZERO, Vec3::ZERO) };
    Frame { arm_a: to_a + offset, arm_b, along, about, shift, turn }
}

/// The rows along (0) or about (1) that something may act on, a bit a row; what has none is left out everywhere.
pub fn used(axes: u32, which: usize) -> u32 {
    (axes >> joint_bits::LOCKED | axes >> joint_bits::DRIVEN) >> (3 * which) & 7
}

/// Shorter distances of the anchors have no direction, m.
pub(super) const SHORTEST: f32 = 1e-9;

fn axes_along(joint: &Joint, qa: Quat, offset: Vec3) -> (Mat3, Vec3) {
    if joint.flags & joint_bits::COUPLED != 0 {
        let distance = offset.length();
        let axis = if distance > SHORTEST { offset / distance } else { rotate(qa, Vec3::X) };
        return (Mat3::from_cols(axis, Vec3::ZERO, Vec3::ZERO), Vec3::new(distance, 0.0, 0.0));
    }
    if joint.axes >> joint_bits::LOCKED & 7 == 7 {
        // Three locked axes are as good as any other three.
        return (Mat3::IDENTITY, offset);
    }
    let axes = Mat3::from_quat(qa);
    (axes, axes.transpose() * offset)
}

fn axes_about(joint: &Joint, qa: Quat, qb: Quat) -> (Mat3, Vec3) {
    let between = qa.conjugate() * qb;
    let between = if between.w < 0.0 { -between } else { between };
    let locked = joint.axes >> (joint_bits::LOCKED + 3) & 7;
    match locked.count_ones() {
        2 => hinge((7 & !locked).trailing_zeros() as usize, qa, between),
        1 => universal(locked.trailing_zeros() as usize, qa, qb, between),
        _ => rotation_vector(qa, between),
    }
}

fn hinge(axis: usize, qa: Quat, between: Quat) -> (Mat3, Vec3) {
    let unit = Vec3::AXES[axis];
    let imaginary = Vec3::new(between.x, between.y, between.z);
    let mut turn = unit.cross(rotate(between, unit));
    turn[axis] = 2.0 * arc_tangent(imaginary[axis], between.w);
    (Mat3::from_quat(qa), turn)
}

fn universal(locked: usize, qa: Quat, qb: Quat, between: Quat) -> (Mat3, Vec3) {
    let (j, k) = ((locked + 1) % 3, (locked + 2) % 3);
    let (mut axes, mut turn) = (Mat3::ZERO, Vec3::ZERO);
    let second = rotate(between, Vec3::AXES[k]);
    let first = rotate_back(between, Vec3::AXES[j]);
    turn[j] = arc_tangent(second[locked], second[k]);
    turn[k] = arc_tangent(first[locked], first[j]);
    turn[locked] = -second[j];
    *axes.col_mut(j) = rotate(qa, Vec3::AXES[j]);
    *axes.col_mut(k) = rotate(qb, Vec3::AXES[k]);
    let normal = axes.col(j).cross(axes.col(k));
    let length = normal.length();
    *axes.col_mut(locked) = if length > 1e-3 { normal / length } else { rotate(qa, Vec3::AXES[locked]) };
    (axes, turn)
}

fn rotation_vector(qa: Quat, between: Quat) -> (Mat3, Vec3) {
    let imaginary = Vec3::new(between.x, between.y, between.z);
    let sine = imaginary.length();
    // Both factors by their series where the angle is small.
    let half = arc_tangent(sine, between.w);
    let small = sine < 1e-2;
    let ratio = if small { 2.0 + sine * sine / 3.0 } else { 2.0 * half / sine };
    let turn = imaginary * ratio;
    let square = turn.dot(turn);
    let share = if small { 1.0 / 12.0 + square / 720.0 } else { (1.0 - half * between.w / sine) / square };
    let column = |unit: Vec3| {
        let once = turn.cross(unit);
        rotate(qa, unit + 0.5 * once + share * turn.cross(once))
    };
    (Mat3::from_cols(column(Vec3::X), column(Vec3::Y), column(Vec3::Z)), turn)
}

/// The angle of the point (x, y), in (-π, π]: WGSL promises its own to 4096 units in the last place only. Polynomial of
/// Cephes' `atanf` (Moshier, 1984), good to two units.
pub fn arc_tangent(y: f32, x: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = (ax.min(ay), ax.max(ay));
    if high == 0.0 {
        return 0.0;
    }
    let ratio = low / high;
    let far = ratio > 0.414_213_57;
    let t = if far { (ratio - 1.0) / (ratio + 1.0) } else { ratio };
    let z = t * t;
    let series = ((0.080_537_446 * z - 0.138_776_86) * z + 0.199_777_1) * z - 0.333_329_5;
    let mut angle = series * z * t + t;
    angle = if far { angle + FRAC_PI_4 } else { angle };
    angle = if ay > ax { FRAC_PI_2 - angle } else { angle };
    angle = if x < 0.0 { PI - angle } else { angle };
    if y < 0.0 { -angle } else { angle }
}
