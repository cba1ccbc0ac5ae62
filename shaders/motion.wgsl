// Stage `motion`: bodies move; the step's result becomes the state. Twin of crates/cpu/src/motion.rs. All with one
// thread a body:
//
//   integrate_velocities   velocities in `solver_bodies`, from `work_states` (forces) and `props`
//   integrate_positions    translation and delta there
//   rewind                 translation and delta of what nothing moves as at first
//   first_substep, next_substep, last_substep   both, as one pass wants it
//   move_body, move_last, start_next   the same where there are joints, which come between
//   commit                 `states` from `solver_bodies`, `shares` and `work_states`; counts and names bodies in quarantine
//   write_poses            `poses`, the bodies' own frames for users and renderers, from `states` and `props`
//
// Rotation by the implicit midpoint rule with Cayley's map: Simo and Wong, "Unconditionally Stable Algorithms for Rigid
// Body Dynamics that Exactly Preserve Energy and Momentum" (1991).

//#import shared/body.wgsl
//#import shared/control.wgsl
//#import shared/level.wgsl
//#import shared/math.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

// Largest turn of a body in a sub-step, rad; it bounds the number of pieces of a turn.
const MAX_TURN: f32 = 32.0;
// Flags of a body that stands still, whatever its kind.
const STILL: u32 = BODY_FROZEN | BODY_ASLEEP;
// Beyond this a velocity (m/s, rad/s) or position (m) is taken for what it is: an explosion.
const STATE_LIMIT: f32 = 1e9;
// Share of a body's eigenvalue that comes from its neighbours.
const EASE_MIX: f32 = 0.95;
// No eigenvalue is larger.
const MAX_EIGENVALUE: f32 = 4.0;
const COUNTER_FROZEN_COUNT: u32 = 108u; // scratch word of the counters

@group(0) @binding(0) var<uniform> control: Control;
@group(0) @binding(1) var<uniform> step: StepParams;
@group(0) @binding(2) var<storage, read> work_states: array<BodyState>;
@group(0) @binding(3) var<storage, read> props: array<BodyProps>;
@group(0) @binding(4) var<storage, read_write> solver_bodies: array<SolverBody>;
@group(0) @binding(5) var<storage, read_write> states: array<BodyState>;
@group(0) @binding(6) var<storage, read_write> poses: array<PoseRecord>;
@group(0) @binding(8) var<storage, read> shares: array<u32>;
@group(0) @binding(7) var<storage, read_write> counters: array<atomic<u32>>;

// Acceleration by gravity and force, m/s²; none along locked axes.
fn acceleration(i: u32) -> vec3<f32> {
    let all = step.gravity * props[i].gravity_scale + work_states[i].force * props[i].inverse_mass;
    return select(all, vec3<f32>(), three_bits(props[i].locked, 0u));
}

// Whether body i is one of those of the step's level, or one that nothing pushes, which takes part in all.
fn takes_part(i: u32) -> bool {
    return control.stop == 0u && (solver_bodies[i].level == step.level || !moves(work_states[i].flags));
}

// Gravity, force, torque and damping over one sub-step.
fn integrate_velocity(i: u32) {
    if !moves(work_states[i].flags) {
        return;
    }
    // Of two half kicks the first.
    let h = select(step.h, 0.5 * step.h, (solver_bodies[i].touched & TOUCHED_JOINED) != 0u);
    let linear = solver_bodies[i].linear_velocity + acceleration(i) * h;
    solver_bodies[i].linear_velocity = linear * (1.0 / (1.0 + step.h * props[i].linear_damping));
    let turn = symmetric_times(
        solver_bodies[i].inverse_inertia_diagonal,
        solver_bodies[i].inverse_inertia_off,
        work_states[i].torque,
    );
    let angular = solver_bodies[i].angular_velocity + turn * h;
    solver_bodies[i].angular_velocity = angular * (1.0 / (1.0 + step.h * props[i].angular_damping));
}

@compute @workgroup_size(256)
fn integrate_velocities(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && takes_part(i) {
        integrate_velocity(i);
    }
}

// Solves I (w1 - w0) + h m x I m = 0, m = (w0 + w1) / 2, for w1.
fn midpoint(w0: vec3<f32>, inertia: vec3<f32>, h: f32) -> vec3<f32> {
    var w = w0;
    for (var newton = 0u; newton < 2u; newton++) {
        let m = 0.5 * (w + w0);
        let im = inertia * m;
        let residual = inertia * (w - w0) + h * cross(m, im);
        // Jacobian: diag(I) + h/2 ([m] diag(I) - [I m]), column by column.
        let s = 0.5 * h;
        let x = vec3<f32>(inertia.x, s * (m.z * inertia.x - im.z), s * (im.y - m.y * inertia.x));
        let y = vec3<f32>(s * (im.z - m.z * inertia.y), inertia.y, s * (m.x * inertia.y - im.x));
        let z = vec3<f32>(s * (m.y * inertia.z - im.y), s * (im.x - m.x * inertia.z), inertia.z);
        let yz = cross(y, z);
        let solution = vec3<f32>(dot(residual, yz), dot(residual, cross(z, x)), dot(residual, cross(x, y)));
        w -= solution / dot(x, yz);
    }
    return w;
}

// The rotation (h w / 2, 1), normalised.
fn cayley(w: vec3<f32>, h: f32) -> vec4<f32> {
    return unit(vec4<f32>(0.5 * h * w, 1.0));
}

// The rotation by |w| h about w, where that is no more than one radian. Sine and cosine by their series, good to the
// last bit or two there: WGSL promises them to 2^-11 only, which could slow a spin by a visible share.
fn half_turn(w: vec3<f32>, h: f32) -> vec4<f32> {
    let half = 0.5 * h * w;
    let s = dot(half, half);
    let ratio = 1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0)));
    let cosine = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0))));
    return vec4<f32>(half * ratio, cosine);
}

// Rotation over `h`: the implicit midpoint rule for Euler's equation in the body's frame with Cayley's map, two Newton
// steps, and the change of the angular velocity added as a difference, which keeps rounding out of it. Turns of more
// than one radian are made in pieces.
fn turn(i: u32, h: f32) {
    let inertia = props[i].inertia;
    let start = work_states[i].rotation;
    var angular = solver_bodies[i].angular_velocity;
    var angle = sqrt(dot(angular, angular)) * h;
    if !is_finite_bits(angle) {
        return;
    }
    if angle > MAX_TURN {
        angular *= MAX_TURN / angle;
        angle = MAX_TURN;
    }
    let pieces = clamp(ceil(angle), 1.0, MAX_TURN);
    let piece = h / pieces;
    var delta = solver_bodies[i].delta;
    // Kinematic bodies, round ones and those held about an axis turn at a constant rate.
    let largest = max(inertia.x, max(inertia.y, inertia.z));
    let smallest = min(inertia.x, min(inertia.y, inertia.z));
    let held = (props[i].locked & LOCKED_ROTATIONS) != 0u;
    let steady = !moves(work_states[i].flags) || largest - smallest <= 1e-6 * largest || held;
    for (var k = 0u; k < u32(pieces); k++) {
        if steady {
            delta = unit(multiply(half_turn(angular, piece), delta));
        } else {
            let q0 = unit(multiply(delta, start));
            let w0 = rotate_back(q0, angular);
            let w1 = midpoint(w0, inertia, piece);
            let mean = 0.5 * (w0 + w1);
            let q1 = unit(multiply(q0, cayley(mean, piece)));
            angular += rotate(q1, w1) - rotate(q0, w0);
            delta = unit(multiply(q1, conjugate(start)));
        }
    }
    solver_bodies[i].delta = delta;
    solver_bodies[i].angular_velocity = angular;
}

// Position and rotation over one sub-step.
//
// A body that no constraint touches falls by the mean of its old and new velocity (gravity in two half kicks: exact for
// a constant force). One that is touched moves by the velocity that its contacts were solved for.
fn integrate_position(i: u32) {
    let kind = work_states[i].flags & BODY_KIND;
    if kind == BODY_NONE || kind == BODY_FIXED || (work_states[i].flags & STILL) != 0u {
        return;
    }
    let locked = props[i].locked;
    if locked != 0u && moves(work_states[i].flags) {
        // Whatever pushed it.
        let linear = select(solver_bodies[i].linear_velocity, vec3<f32>(), three_bits(locked, 0u));
        let turns = three_bits(locked, LOCKED_FIRST_ROTATION);
        solver_bodies[i].linear_velocity = linear;
        solver_bodies[i].angular_velocity = select(solver_bodies[i].angular_velocity, vec3<f32>(), turns);
    }
    var way = solver_bodies[i].linear_velocity * step.h;
    if (solver_bodies[i].touched & TOUCHED_ANY) == 0u && kind == BODY_DYNAMIC {
        way -= acceleration(i) * (0.5 * step.h * step.h);
    }
    solver_bodies[i].translation = solver_bodies[i].translation + way;
    turn(i, step.h);
}

@compute @workgroup_size(256)
fn integrate_positions(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && takes_part(i) {
        integrate_position(i);
    }
}

// Back to where bodies that nothing moves began: every level of sub-steps leads them the whole way.
@compute @workgroup_size(256)
fn rewind(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && control.stop == 0u && !moves(work_states[i].flags) {
        solver_bodies[i].translation = vec3<f32>();
        solver_bodies[i].delta = vec4<f32>(0.0, 0.0, 0.0, 1.0);
    }
}

fn start(i: u32) {
    integrate_velocity(i);
    solver_bodies[i].linear_start = solver_bodies[i].linear_velocity;
    solver_bodies[i].angular_start = solver_bodies[i].angular_velocity;
}

// One pass: velocities before the first sub-step's impulses.
@compute @workgroup_size(256)
fn first_substep(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && takes_part(i) {
        start(i);
    }
}

// One pass: moves the body, and starts the next sub-step with the impulses of this one: what they added to the
// velocity, they will add again.
@compute @workgroup_size(256)
fn next_substep(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count || !takes_part(i) {
        return;
    }
    let linear = solver_bodies[i].linear_velocity - solver_bodies[i].linear_start;
    let angular = solver_bodies[i].angular_velocity - solver_bodies[i].angular_start;
    integrate_position(i);
    start(i);
    if solver_bodies[i].inverse_mass > 0.0 {
        solver_bodies[i].linear_velocity = solver_bodies[i].linear_velocity + linear;
        solver_bodies[i].angular_velocity = solver_bodies[i].angular_velocity + angular;
    }
}

// Whether half of a body's kicks comes after it has moved, and half of what its contacts bear with it.
fn comes_in_halves(i: u32) -> bool {
    return (solver_bodies[i].touched & TOUCHED_JOINED) != 0u && solver_bodies[i].inverse_mass > 0.0
        && step.solver == SOLVER_ONE_PASS;
}

// Adds to the body's velocities a share of what contacts have added in this sub-step; that stays what it was.
fn add_load(i: u32, share: f32) {
    let linear = share * (solver_bodies[i].linear_velocity - solver_bodies[i].linear_start);
    let angular = share * (solver_bodies[i].angular_velocity - solver_bodies[i].angular_start);
    solver_bodies[i].linear_velocity += linear;
    solver_bodies[i].angular_velocity += angular;
    solver_bodies[i].linear_start += linear;
    solver_bodies[i].angular_start += angular;
}

// With joints, one pass: of the impulses that contacts begin with, half came with the last step's second half of gravity.
@compute @workgroup_size(256)
fn halve_load(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && takes_part(i) && comes_in_halves(i) {
        add_load(i, -0.5);
    }
}

// The second half of gravity and forces, for bodies that joints hold, and half of what their contacts bear. No load of
// contacts of this sub-step.
fn kick_again(i: u32) {
    if !moves(work_states[i].flags) || (solver_bodies[i].touched & TOUCHED_JOINED) == 0u {
        return;
    }
    let linear = acceleration(i) * (0.5 * step.h);
    let angular = symmetric_times(
        solver_bodies[i].inverse_inertia_diagonal,
        solver_bodies[i].inverse_inertia_off,
        work_states[i].torque,
    ) * (0.5 * step.h);
    solver_bodies[i].linear_velocity += linear;
    solver_bodies[i].angular_velocity += angular;
    solver_bodies[i].linear_start += linear;
    solver_bodies[i].angular_start += angular;
    if comes_in_halves(i) {
        add_load(i, 0.5);
    }
}

fn move_one(i: u32) {
    let before = solver_bodies[i].angular_velocity;
    integrate_position(i);
    solver_bodies[i].angular_start += solver_bodies[i].angular_velocity - before;
    kick_again(i);
}

// With joints: moves the body; what turning adds to its angular velocity is no load of contacts.
@compute @workgroup_size(256)
fn move_body(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && takes_part(i) {
        move_one(i);
    }
}

// With joints, one pass: moves the body in the last sub-step.
@compute @workgroup_size(256)
fn move_last(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && takes_part(i) {
        solver_bodies[i].eigenvalue = ease(i);
        move_one(i);
    }
}

// With joints, one pass: starts the next sub-step, as `next_substep`.
@compute @workgroup_size(256)
fn start_next(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count || !takes_part(i) {
        return;
    }
    let linear = solver_bodies[i].linear_velocity - solver_bodies[i].linear_start;
    let angular = solver_bodies[i].angular_velocity - solver_bodies[i].angular_start;
    start(i);
    if solver_bodies[i].inverse_mass > 0.0 {
        solver_bodies[i].linear_velocity += linear;
        solver_bodies[i].angular_velocity += angular;
    }
    if comes_in_halves(i) {
        add_load(i, -0.5);
    }
}

// The body's eigenvalue anew, once its last sub-step is solved: its own quotient, mixed with those beside it.
fn ease(i: u32) -> f32 {
    let body = solver_bodies[i];
    if body.inverse_mass == 0.0 || body.weight == 0.0 {
        return 0.0;
    }
    let dv = body.linear_velocity - body.linear_start;
    let turned = multiply(body.delta, work_states[i].rotation);
    let dw = rotate_back(turned, body.angular_velocity - body.angular_start);
    let lift = dot(dv, dv) / body.inverse_mass + dot(props[i].inertia * dw, dw);
    let eased = ((1.0 - EASE_MIX) * lift + EASE_MIX * body.weighted) / body.weight;
    if is_finite_bits(eased) {
        return min(eased, MAX_EIGENVALUE);
    }
    return 0.0;
}

// One pass: takes down how soft the load on the body is, and moves it.
@compute @workgroup_size(256)
fn last_substep(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && takes_part(i) {
        solver_bodies[i].eigenvalue = ease(i);
        integrate_position(i);
    }
}

fn small(v: vec3<f32>) -> bool {
    return is_finite3(v) && max(abs(v.x), max(abs(v.y), abs(v.z))) <= STATE_LIMIT;
}

// The state after the step. A result that is not finite is thrown away: the body keeps its pose and is put in
// quarantine.
@compute @workgroup_size(256)
fn commit(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count || atomicLoad(&counters[CONTROL_STOP]) != 0u {
        return;
    }
    var state = work_states[i];
    state.force = vec3<f32>();
    state.torque = vec3<f32>();
    if (state.flags & BODY_KIND) != BODY_NONE && (state.flags & STILL) == 0u {
        let body = solver_bodies[i];
        // Its way, or as much of it as leads into nothing that stands still (`continuous`).
        let position = state.position + body.translation * bitcast<f32>(shares[i]);
        let good = small(position) && small(body.linear_velocity) && small(body.angular_velocity)
            && is_finite4(body.delta);
        if good {
            state.position = position;
            state.rotation = unit(multiply(body.delta, state.rotation));
            state.linear_velocity = body.linear_velocity;
            state.angular_velocity = body.angular_velocity;
            state.eigenvalue = body.eigenvalue;
            state.h = h_of(step.h, body.level);
        } else {
            state.flags |= BODY_FROZEN;
            state.linear_velocity = vec3<f32>();
            state.angular_velocity = vec3<f32>();
            atomicMax(&counters[CONTROL_QUARANTINED + i % QUARANTINE_NAMES], i + 1u);
        }
    }
    if (state.flags & BODY_KIND) != BODY_NONE && (state.flags & BODY_FROZEN) != 0u {
        atomicAdd(&counters[COUNTER_FROZEN_COUNT], 1u);
    }
    states[i] = state;
}

// The body's own frame.
@compute @workgroup_size(256)
fn write_poses(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count || control.stop != 0u {
        return;
    }
    let rotation = unit(multiply(states[i].rotation, conjugate(props[i].frame)));
    let translation = states[i].position - rotate(rotation, props[i].center_of_mass);
    poses[i] = PoseRecord(translation, states[i].flags | (states[i].generation << 8u), rotation);
}
