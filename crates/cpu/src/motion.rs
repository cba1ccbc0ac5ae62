//! Stage `motion`: bodies move; the step's result becomes the state. Twin of `shaders/motion.wgsl`.

use crate::bounds::{STATE_LIMIT, moves};
use crate::math::{finite, quat, rotate, rotate_back, unlocked, vec3};
use crate::solver::one_pass::ease;
use glam::{Quat, Vec3};
use tumble_core::layout::{BodyProps, BodyState, SolverBody, StepParams, body_flags, locks, solver, touched};

/// Largest turn of a body in a sub-step, rad; it bounds the number of pieces of a turn.
pub const MAX_TURN: f32 = 32.0;

/// Flags of a body that stands still, whatever its kind.
const STILL: u32 = body_flags::FROZEN | body_flags::ASLEEP;

/// Acceleration by gravity and force, m/s²; none along locked axes.
fn acceleration(state: &BodyState, props: &BodyProps, step: &StepParams) -> Vec3 {
    let all = vec3(step.gravity) * props.gravity_scale + vec3(state.force) * props.inverse_mass;
    unlocked(all, props.locked, 0)
}

/// Gravity, force, torque and damping over one sub-step.
pub fn integrate_velocity(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    if !moves(state.flags) {
        return;
    }
    // Of two half kicks the first.
    let h = if body.touched & touched::JOINED != 0 { 0.5 * step.h } else { step.h };
    let linear = vec3(body.linear_velocity) + acceleration(state, props, step) * h;
    body.linear_velocity = (linear * (1.0 / (1.0 + step.h * props.linear_damping))).to_array();
    let turn = crate::math::inverse_inertia_times(body, vec3(state.torque));
    let angular = vec3(body.angular_velocity) + turn * h;
    body.angular_velocity = (angular * (1.0 / (1.0 + step.h * props.angular_damping))).to_array();
}

/// Back to where a body that nothing moves began: every level of sub-steps leads it the whole way.
pub fn rewind(body: &mut SolverBody, state: &BodyState, _: &BodyProps, _: &StepParams) {
    if !moves(state.flags) {
        body.translation = [0.0; 3];
        body.delta = [0.0, 0.0, 0.0, 1.0];
    }
}

/// One pass: velocities before the first sub-step's impulses.
pub fn first_substep(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    integrate_velocity(body, state, props, step);
    body.linear_start = body.linear_velocity;
    body.angular_start = body.angular_velocity;
}

/// One pass: moves the body, and starts the next sub-step with the impulses of this one: what they added to the
/// velocity, they will add again.
pub fn next_substep(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    let linear = vec3(body.linear_velocity) - vec3(body.linear_start);
    let angular = vec3(body.angular_velocity) - vec3(body.angular_start);
    integrate_position(body, state, props, step);
    first_substep(body, state, props, step);
    if body.inverse_mass > 0.0 {
        body.linear_velocity = (vec3(body.linear_velocity) + linear).to_array();
        body.angular_velocity = (vec3(body.angular_velocity) + angular).to_array();
    }
}

/// Whether half of a body's kicks comes after it has moved, and half of what its contacts bear with it. (One pass alone
/// carries that over.)
fn comes_in_halves(body: &SolverBody, step: &StepParams) -> bool {
    body.touched & touched::JOINED != 0 && body.inverse_mass > 0.0 && step.solver == solver::ONE_PASS
}

/// Adds to the body's velocities a share of what contacts have added in this sub-step; that stays what it was.
fn add_load(body: &mut SolverBody, share: f32) {
    let linear = share * (vec3(body.linear_velocity) - vec3(body.linear_start));
    let angular = share * (vec3(body.angular_velocity) - vec3(body.angular_start));
    body.linear_velocity = (vec3(body.linear_velocity) + linear).to_array();
    body.angular_velocity = (vec3(body.angular_velocity) + angular).to_array();
    body.linear_start = (vec3(body.linear_start) + linear).to_array();
    body.angular_start = (vec3(body.angular_start) + angular).to_array();
}

/// With joints, one pass: of the impulses that contacts begin with, half came with the last step's second half of gravity.
pub fn halve_load(body: &mut SolverBody, _: &BodyState, _: &BodyProps, step: &StepParams) {
    if comes_in_halves(body, step) {
        add_load(body, -0.5);
    }
}

/// The second half of gravity and forces, for bodies that joints hold, and half of what their contacts bear: what lies on
/// the floor has no velocity then, and its joints nothing to hold. No load of contacts of this sub-step.
fn kick_again(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    if !moves(state.flags) || body.touched & touched::JOINED == 0 {
        return;
    }
    let linear = acceleration(state, props, step) * (0.5 * step.h);
    let angular = crate::math::inverse_inertia_times(body, vec3(state.torque)) * (0.5 * step.h);
    body.linear_velocity = (vec3(body.linear_velocity) + linear).to_array();
    body.angular_velocity = (vec3(body.angular_velocity) + angular).to_array();
    body.linear_start = (vec3(body.linear_start) + linear).to_array();
    body.angular_start = (vec3(body.angular_start) + angular).to_array();
    if comes_in_halves(body, step) {
        add_load(body, 0.5);
    }
}

/// With joints: moves the body; what turning adds to its angular velocity is no load of contacts.
pub fn move_body(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    let before = vec3(body.angular_velocity);
    integrate_position(body, state, props, step);
    let turned = vec3(body.angular_velocity) - before;
    body.angular_start = (vec3(body.angular_start) + turned).to_array();
    kick_again(body, state, props, step);
}

/// With joints, one pass: moves the body in the last sub-step.
pub fn move_last(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    body.eigenvalue = ease(body, state, props);
    move_body(body, state, props, step);
}

/// With joints, one pass: starts the next sub-step, as [`next_substep`].
pub fn start_next(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    let linear = vec3(body.linear_velocity) - vec3(body.linear_start);
    let angular = vec3(body.angular_velocity) - vec3(body.angular_start);
    first_substep(body, state, props, step);
    if body.inverse_mass > 0.0 {
        body.linear_velocity = (vec3(body.linear_velocity) + linear).to_array();
        body.angular_velocity = (vec3(body.angular_velocity) + angular).to_array();
    }
    halve_load(body, state, props, step);
}

/// One pass: takes down how soft the load on the body is, and moves it.
pub fn last_substep(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    body.eigenvalue = ease(body, state, props);
    integrate_position(body, state, props, step);
}

/// Position and rotation over one sub-step.
///
/// A body that no constraint touches falls by the mean of its old and new velocity (gravity in two half kicks: exact
/// for a constant force). One that is touched moves by the velocity that its contacts were solved for.
pub fn integrate_position(body: &mut SolverBody, state: &BodyState, props: &BodyProps, step: &StepParams) {
    let kind = state.flags & body_flags::KIND;
    if kind == body_flags::NONE || kind == body_flags::FIXED || state.flags & STILL != 0 {
        return;
    }
    if props.locked != 0 && moves(state.flags) {
        // Whatever pushed it.
        body.linear_velocity = unlocked(vec3(body.linear_velocity), props.locked, 0).to_array();
        let turns = unlocked(vec3(body.angular_velocity), props.locked, locks::FIRST_ROTATION);
        body.angular_velocity = turns.to_array();
    }
    let mut way = vec3(body.linear_velocity) * step.h;
    if body.touched & touched::ANY == 0 && kind == body_flags::DYNAMIC {
        way -= acceleration(state, props, step) * (0.5 * step.h * step.h);
    }
    body.translation = (vec3(body.translation) + way).to_array();
    turn(body, state, props, step.h);
}

/// Rotation over `h`: the implicit midpoint rule for Euler's equation in the body's frame with Cayley's map, two
/// Newton steps, and the change of the angular velocity added as a difference, which keeps rounding out of it.
/// Turns of more than one radian are made in pieces.
fn turn(body: &mut SolverBody, state: &BodyState, props: &BodyProps, h: f32) {
    let inertia = vec3(props.inertia);
    let start = quat(state.rotation);
    let mut angular = vec3(body.angular_velocity);
    let mut angle = angular.length() * h;
    if !finite([angle; 3]) {
        return;
    }
    if angle > MAX_TURN {
        angular *= MAX_TURN / angle;
        angle = MAX_TURN;
    }
    let pieces = angle.ceil().max(1.0);
    let piece = h / pieces;
    let mut delta = quat(body.delta);
    // Kinematic bodies, round ones and those held about an axis turn at a constant rate.
    let held = props.locked & locks::ROTATIONS != 0;
    let round = inertia.max_element() - inertia.min_element() <= 1e-6 * inertia.max_element();
    let steady = !moves(state.flags) || round || held;
    for _ in 0..pieces as u32 {
        if steady {
            delta = (half_turn(angular, piece) * delta).normalize();
            continue;
        }
        let q0 = (delta * start).normalize();
        let w0 = rotate_back(q0, angular);
        let w1 = midpoint(w0, inertia, piece);
        let mean = 0.5 * (w0 + w1);
        let q1 = (q0 * cayley(mean, piece)).normalize();
        angular += rotate(q1, w1) - rotate(q0, w0);
        delta = (q1 * start.conjugate()).normalize();
    }
    body.delta = delta.to_array();
    body.angular_velocity = angular.to_array();
}

/// Solves I (w1 - w0) + h m x I m = 0, m = (w0 + w1) / 2, for w1.
fn midpoint(w0: Vec3, inertia: Vec3, h: f32) -> Vec3 {
    let mut w = w0;
    for _ in 0..2 {
        let m = 0.5 * (w + w0);
        let im = inertia * m;
        let residual = inertia * (w - w0) + h * m.cross(im);
        // Jacobian: diag(I) + h/2 ([m] diag(I) - [I m]), column by column.
        let s = 0.5 * h;
        let x = Vec3::new(inertia.x, s * (m.z * inertia.x - im.z), s * (im.y - m.y * inertia.x));
        let y = Vec3::new(s * (im.z - m.z * inertia.y), inertia.y, s * (m.x * inertia.y - im.x));
        let z = Vec3::new(s * (m.y * inertia.z - im.y), s * (im.x - m.x * inertia.z), inertia.z);
        let yz = y.cross(z);
        let determinant = x.dot(yz);
        let solution = Vec3::new(residual.dot(yz), residual.dot(z.cross(x)), residual.dot(x.cross(y)));
        w -= solution / determinant;
    }
    w
}

/// The rotation (h w / 2, 1), normalised.
fn cayley(w: Vec3, h: f32) -> Quat {
    let half = 0.5 * h * w;
    Quat::from_xyzw(half.x, half.y, half.z, 1.0).normalize()
}

/// The rotation by |w| h about w, where that is no more than one radian. Sine and cosine by their series, good to the
/// last bit or two there, and the same on every machine.
fn half_turn(w: Vec3, h: f32) -> Quat {
    let half = 0.5 * h * w;
    let s = half.dot(half);
    let ratio = 1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0)));
    let cosine = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0))));
    Quat::from_xyzw(half.x * ratio, half.y * ratio, half.z * ratio, cosine)
}

/// The state after the step, the body having gone `share` of its way (see `continuous`). A result that is not finite is
/// thrown away: the body keeps its pose and is put in quarantine. Returns the state and whether that happened.
pub fn commit(body: &SolverBody, state: &BodyState, share: f32, step: &StepParams) -> (BodyState, bool) {
    let mut new = *state;
    new.force = [0.0; 3];
    new.torque = [0.0; 3];
    if state.flags & body_flags::KIND == body_flags::NONE || state.flags & STILL != 0 {
        return (new, false);
    }
    let small = |v: [f32; 3]| finite(v) && vec3(v).abs().max_element() <= STATE_LIMIT;
    let position = (vec3(state.position) + vec3(body.translation) * share).to_array();
    let [x, y, z, w] = body.delta;
    let good = small(position)
        && small(body.linear_velocity)
        && small(body.angular_velocity)
        && finite([x, y, z])
        && finite([w; 3]);
    if good {
        new.position = position;
        new.rotation = (quat(body.delta) * quat(state.rotation)).normalize().to_array();
        new.linear_velocity = body.linear_velocity;
        new.angular_velocity = body.angular_velocity;
        new.eigenvalue = body.eigenvalue;
        new.h = step.h_of(body.level);
    } else {
        new.flags |= body_flags::FROZEN;
        new.linear_velocity = [0.0; 3];
        new.angular_velocity = [0.0; 3];
    }
    (new, !good)
}
