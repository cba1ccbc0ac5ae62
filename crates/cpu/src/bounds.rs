//! Stage `bounds`: checks every body's state, then gives each collider a box that holds it for the whole step.
//! Twin of `shaders/bounds.wgsl`.
//!
//! The box is swept by the body's predicted motion (velocity, gravity and force over the step, and the arc of its
//! rotation) and widened by half the speculative distance, so that boxes overlap wherever a contact may be needed.
//! Poses are read relative to nothing: precision ends where f32 does, some kilometres from the origin.

use crate::math::{finite, quat, rotate, vec3};
use glam::{Mat3, Vec3};
use tumble_core::layout::{Aabb, BodyProps, BodyState, Collider, StepParams, aabb_body, body_flags, shape_kind};

/// Beyond this a velocity (m/s, rad/s) or position (m) is taken for what it is: an explosion.
pub const STATE_LIMIT: f32 = 1e9;

/// Stands for infinity in the box of a half-space.
pub const FAR: f32 = 1e30;

/// The box of what takes no part.
pub const NOWHERE: Aabb = Aabb { min: [FAR; 3], body: 0, max: [-FAR; 3], class: 0 };

/// Puts a body whose state is not finite (or past [`STATE_LIMIT`]) in quarantine: it stands still at `last`, the
/// pose that it had when the last step committed. True when that happened now.
pub fn quarantine(state: &mut BodyState, last: &BodyState) -> bool {
    if state.flags & body_flags::KIND == body_flags::NONE {
        return false;
    }
    let small = |v: [f32; 3]| finite(v) && vec3(v).abs().max_element() <= STATE_LIMIT;
    let [x, y, z, w] = state.rotation;
    let pose_good = small(state.position) && finite([x, y, z]) && finite([w; 3]);
    let good = pose_good
        && small(state.linear_velocity)
        && small(state.angular_velocity)
        && finite(state.force)
        && finite(state.torque);
    if !pose_good {
        state.position = last.position;
        state.rotation = last.rotation;
    }
    let frozen_before = last.flags & body_flags::FROZEN != 0 && last.generation == state.generation;
    if !good {
        state.flags |= body_flags::FROZEN;
    }
    if state.flags & body_flags::FROZEN != 0 {
        state.linear_velocity = [0.0; 3];
        state.angular_velocity = [0.0; 3];
        state.force = [0.0; 3];
        state.torque = [0.0; 3];
        return !frozen_before;
    }
    false
}

/// Whether contacts can push the body.
pub fn moves(flags: u32) -> bool {
    flags & (body_flags::KIND | body_flags::FROZEN | body_flags::ASLEEP) == body_flags::DYNAMIC
}

/// The box of one collider over the step.
pub fn collider_bounds(collider: &Collider, state: &BodyState, props: &BodyProps, step: &StepParams) -> Aabb {
    let live = collider.shape != shape_kind::NONE && state.flags & body_flags::KIND != body_flags::NONE;
    if !live {
        return NOWHERE;
    }
    let dynamic = moves(state.flags);
    let fixed = state.flags & body_flags::KIND == body_flags::FIXED;
    let body = collider.body
        | aabb_body::LIVE
        | if dynamic { aabb_body::DYNAMIC } else { 0 }
        | if state.flags & body_flags::ASLEEP != 0 { aabb_body::ASLEEP } else { 0 }
        | if fixed { aabb_body::FIXED } else { 0 };
    let rotation = quat(state.rotation);
    let offset = rotate(rotation, vec3(collider.position));
    let center = vec3(state.position) + offset;
    let orientation = rotation * quat(collider.rotation);
    if collider.shape == shape_kind::HALFSPACE {
        return halfspace_bounds(center, rotate(orientation, Vec3::Y), body, step);
    }
    let (extent, reach) = if collider.shape == shape_kind::BALL {
        (Vec3::splat(collider.size[0]), offset.length())
    } else {
        let size = vec3(collider.size);
        let m = Mat3::from_quat(orientation);
        (m.x_axis.abs() * size.x + m.y_axis.abs() * size.y + m.z_axis.abs() * size.z, offset.length() + size.length())
    };
    let acceleration = if dynamic {
        vec3(step.gravity) * props.gravity_scale + vec3(state.force) * props.inverse_mass
    } else {
        Vec3::ZERO
    };
    // Where it ends lies between the two.
    let straight = vec3(state.linear_velocity) * step.dt;
    let sweep = (vec3(state.linear_velocity) + acceleration * step.dt) * step.dt;
    let arc = (vec3(state.angular_velocity).length() * step.dt).min(2.0) * reach;
    let margin = extent + Vec3::splat(arc + 0.5 * step.speculative_distance);
    let min = (center - margin).min(center - margin + straight).min(center - margin + sweep);
    let max = (center + margin).max(center + margin + straight).max(center + margin + sweep);
    Aabb { min: min.to_array(), body, max: max.to_array(), class: size_class((max - min).max_element()) }
}

/// What a rotation's rounding leaves of the other two components when a normal is meant to be an axis, and the room that
/// such a tilt needs 10 km away, m.
const TILT: f32 = 1e-6;
const TILT_MARGIN: f32 = 0.01;

/// A half-space has a tight box only when its normal is an axis; else it meets every box, and the narrow phase
/// decides. (A slanted test would be a sum of products, which a driver may fuse: sides would disagree.)
fn halfspace_bounds(center: Vec3, normal: Vec3, body: u32, step: &StepParams) -> Aabb {
    let (mut min, mut max) = ([-FAR; 3], [FAR; 3]);
    let margin = 0.5 * step.speculative_distance + TILT_MARGIN;
    for axis in 0..3 {
        let (u, v) = (normal[(axis + 1) % 3], normal[(axis + 2) % 3]);
        if u.abs() > TILT || v.abs() > TILT {
            continue;
        }
        if normal[axis] > 0.0 {
            max[axis] = center[axis] + margin;
        } else {
            min[axis] = center[axis] - margin;
        }
    }
    Aabb { min, body, max, class: size_class(FAR) }
}

/// Four classes an octave: exponent and two leading mantissa bits, plus one. [`class_edge`] lies above its members.
pub fn size_class(extent: f32) -> u32 {
    (extent.to_bits() >> 21) + 1
}

/// Upper edge of a size class, m.
pub fn class_edge(class: u32) -> f32 {
    f32::from_bits(class << 21)
}
