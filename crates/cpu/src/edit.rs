//! Stage `edit`: the records of a step are applied to the working copy of the states. Twin of `shaders/edit.wgsl`.
//!
//! `begin` copies a committed state, `apply` runs one range of records, those of one body or collider. Writes to
//! properties and colliders are absolute, so that a step that is run again finds what it would have found.

use crate::bounds::STATE_LIMIT;
use crate::math::{finite, free, held_inverse_inertia, quat, rotate, rotate_back, scaled_axis, symmetric_times, vec3};
use glam::{Quat, Vec3};
use tumble_core::layout::{
    BodyProps, BodyState, Collider, EditRange, EditRecord, StepParams, body_flags, edit_op, locks,
};

/// What edits may change.
pub struct Targets<'a> {
    /// Working copy, by body slot.
    pub states: &'a mut [BodyState],
    /// By body slot.
    pub props: &'a mut [BodyProps],
    /// By collider slot.
    pub colliders: &'a mut [Collider],
}

/// The working copy of a committed state: what is moved by poses stands still until it is given one.
pub fn begin(state: &BodyState) -> BodyState {
    let mut state = *state;
    if state.flags & body_flags::POSED != 0 {
        state.linear_velocity = [0.0; 3];
        state.angular_velocity = [0.0; 3];
    }
    state
}

/// Applies the records of one body or one collider, in order.
pub fn apply(range: EditRange, records: &[EditRecord], step: &StepParams, targets: &mut Targets<'_>) {
    for record in &records[range.first as usize..(range.first + range.count) as usize] {
        let slot = record.target as usize;
        if record.op >= edit_op::COLLIDER {
            apply_to_collider(record, step.step, &mut targets.colliders[slot]);
        } else {
            apply_to_body(record, step, &mut targets.states[slot], &mut targets.props[slot]);
        }
    }
}

fn apply_to_collider(record: &EditRecord, step: u32, collider: &mut Collider) {
    let mut words = [[0u32; 4]; 6];
    words.copy_from_slice(&record.data[..6]);
    *collider = bytemuck::cast(words);
    collider.born = step;
}

fn apply_to_body(record: &EditRecord, step: &StepParams, state: &mut BodyState, props: &mut BodyProps) {
    let a = xyz(record.data[0]);
    let b = xyz(record.data[1]);
    match record.op {
        edit_op::SPAWN => {
            *state = bytemuck::Zeroable::zeroed();
            state.flags = record.kind;
            state.generation = record.generation;
            *props = read_props(record);
        }
        edit_op::PROPS if record.kind == 1 => *props = read_props(record),
        edit_op::PROPS => {
            let (old_com, old_frame) = (xyz(record.data[5]), xyzw(record.data[6]));
            let position = vec3(state.position);
            let own = quat(state.rotation) * old_frame.conjugate();
            *props = read_props(record);
            let moved = position + rotate(own, vec3(props.center_of_mass) - old_com);
            let angular = vec3(state.angular_velocity);
            state.linear_velocity = (vec3(state.linear_velocity) + angular.cross(moved - position)).to_array();
            state.position = moved.to_array();
            state.rotation = (own * quat(props.frame)).normalize().to_array();
        }
        edit_op::REMOVE => state.flags = body_flags::NONE,
        edit_op::POSE => {
            let own = xyzw(record.data[1]);
            if finite(a.to_array()) && finite([own.x, own.y, own.z]) && finite([own.w; 3]) {
                state.position = (a + rotate(own, vec3(props.center_of_mass))).to_array();
                state.rotation = (own * quat(props.frame)).normalize().to_array();
            } else {
                state.flags |= body_flags::FROZEN;
            }
        }
        edit_op::VELOCITY => {
            state.linear_velocity = a.to_array();
            state.angular_velocity = b.to_array();
        }
        edit_op::IMPULSE => push(state, props, a, b),
        edit_op::IMPULSE_AT => push(state, props, a, (b - vec3(state.position)).cross(a)),
        edit_op::FORCE => pull(state, props, a, b),
        edit_op::FORCE_AT => pull(state, props, a, (b - vec3(state.position)).cross(a)),
        edit_op::WAKE => {}
        edit_op::NEXT_POSE => {
            let own = xyzw(record.data[1]);
            let position = a + rotate(own, vec3(props.center_of_mass));
            let turn = (own * quat(props.frame)).normalize() * quat(state.rotation).conjugate();
            state.linear_velocity = ((position - vec3(state.position)) / step.dt).to_array();
            state.angular_velocity = (scaled_axis(turn) / step.dt).to_array();
        }
        _ => {
            state.flags |= body_flags::FROZEN;
            state.linear_velocity = [0.0; 3];
            state.angular_velocity = [0.0; 3];
        }
    }
}

/// Adds an impulse and an angular impulse. (Along locked axes velocities are taken away before they are looked at.)
fn push(state: &mut BodyState, props: &BodyProps, impulse: Vec3, angular: Vec3) {
    let q = quat(state.rotation);
    let linear = vec3(state.linear_velocity) + props.inverse_mass * impulse;
    let turn = if props.locked & locks::ROTATIONS == 0 {
        rotate(q, vec3(props.inverse_inertia) * rotate_back(q, angular))
    } else {
        let free = free(props.locked, locks::FIRST_ROTATION);
        symmetric_times(held_inverse_inertia(q, vec3(props.inertia), free), angular)
    };
    state.linear_velocity = linear.to_array();
    state.angular_velocity = (vec3(state.angular_velocity) + turn).to_array();
}

/// Adds a force and a torque for the step. What would make the body explode within the step puts it in quarantine
/// before it meets others.
fn pull(state: &mut BodyState, props: &BodyProps, force: Vec3, torque: Vec3) {
    state.force = (vec3(state.force) + force).to_array();
    state.torque = (vec3(state.torque) + torque).to_array();
    let linear = (vec3(state.force) * props.inverse_mass).to_array();
    let angular = (vec3(props.inverse_inertia) * rotate_back(quat(state.rotation), vec3(state.torque))).to_array();
    if !small(linear) || !small(angular) {
        state.flags |= body_flags::FROZEN;
    }
}

/// Whether an acceleration is none that only an explosion has.
fn small(v: [f32; 3]) -> bool {
    finite(v) && vec3(v).abs().max_element() <= STATE_LIMIT
}

fn read_props(record: &EditRecord) -> BodyProps {
    let mut words = [[0u32; 4]; 5];
    words.copy_from_slice(&record.data[..5]);
    bytemuck::cast(words)
}

fn xyz(words: [u32; 4]) -> Vec3 {
    Vec3::new(f32::from_bits(words[0]), f32::from_bits(words[1]), f32::from_bits(words[2]))
}

fn xyzw(words: [u32; 4]) -> Quat {
    Quat::from_array(words.map(f32::from_bits))
}
