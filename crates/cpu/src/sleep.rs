//! Stage `sleep`: which islands have rested long enough. What a world keeps of those asleep is in `world/asleep`.
//!
//! Each body remembers a pose and how long no point of its surface has been farther than `distance` from its place there;
//! a body that strays begins anew where it is. An island falls asleep when all its bodies have rested long enough, none
//! must stay awake, and nothing kinematic that moves touches it or is joined to it.

use crate::bounds::moves;
use crate::math::{quat, vec3};
use bytemuck::Zeroable;
use tumble_core::Sleep;
use tumble_core::layout::{BodyProps, BodyState, Rest, body_flags};

/// At rest from now on.
pub fn begin(state: &BodyState) -> Rest {
    Rest { position: state.position, rotation: state.rotation, ..Rest::zeroed() }
}

/// The same after a step of length `dt` that ended in `state`.
pub fn rest(rest: &Rest, state: &BodyState, props: &BodyProps, sleep: &Sleep, dt: f32) -> Rest {
    let turn = quat(state.rotation) * quat(rest.rotation).conjugate();
    let way = (vec3(state.position) - vec3(rest.position)).length();
    // A point at the end of an arm moves by twice the arm times the sine of half the angle at most.
    let strayed = way + 2.0 * props.reach * turn.xyz().length();
    if strayed <= sleep.distance { Rest { time: rest.time + dt, ..*rest } } else { begin(state) }
}

/// Whether the body alone would let its island sleep.
pub fn rested(rest: &Rest, state: &BodyState, sleep: &Sleep) -> bool {
    moves(state.flags) && state.flags & body_flags::STAYS_AWAKE == 0 && rest.time >= sleep.time
}

/// Whether the body is one that nothing pushes, and moves.
pub fn drives(state: &BodyState) -> bool {
    let kinematic = state.flags & (body_flags::KIND | body_flags::FROZEN) == body_flags::KINEMATIC;
    kinematic && (vec3(state.linear_velocity) != glam::Vec3::ZERO || vec3(state.angular_velocity) != glam::Vec3::ZERO)
}

/// Whether a body disturbs those that joints hold to it.
pub fn pulls(state: &BodyState, edited: bool) -> bool {
    edited || moves(state.flags) || drives(state)
}

/// Whether it sleeps.
pub fn sleeps(flags: u32) -> bool {
    flags & body_flags::ASLEEP != 0
}

/// The state of a body that falls asleep.
pub fn put_to_sleep(state: &mut BodyState) {
    state.flags |= body_flags::ASLEEP;
    state.linear_velocity = [0.0; 3];
    state.angular_velocity = [0.0; 3];
}
