// The rows of joints: what impulses they exchange with their bodies. Twin of crates/cpu/src/joint/rows.rs.
//
// A joint in a step is a `JointWork`, by its place in the topology; it has rows along its axes and about them. Imported
// by `joint/island` and `joint/batches`; reads `joints`, `joint_tables`, `props`, `work_states`, reads and writes
// `joint_states`, `joint_works` and `solver_bodies`.

//#import joint/drive.wgsl
//#import joint/frame.wgsl
//#import shared/body.wgsl
//#import shared/control.wgsl
//#import shared/joint.wgsl
//#import shared/level.wgsl
//#import shared/math.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

// Turn of a body in a sub-step up to which a prediction of the separation is believed, rad.
const THETA: f32 = 0.03;
// Relative change of a remainder up to which it is believed.
const KAPPA: f32 = 0.2;
// What is believed of it at least.
const LEAST: f32 = 0.3;
// What an angle is beyond a limit by is undone up to here, rad: angles leap where a joint turns by more than half a turn.
const JUMP: f32 = 0.2;
// Springs that differ by no more than this share are one.
const SAME_SPRING: f32 = 0.1;
// Largest turn of a body by a projection, rad.
const MAX_PROJECTION: f32 = 0.5;
// Share of its trace over three that is added to a block of a joint on a tree.
const REGULARIZATION: f32 = 1e-6;
// The same of joints on cycles, where rows may say the same twice.
const CYCLE_REGULARIZATION: f32 = 1e-5;

// Up to three rows.
struct JointRows {
    along: mat3x3<f32>,
    turn_a: mat3x3<f32>,
    turn_b: mat3x3<f32>,
    response_a: mat3x3<f32>,
    response_b: mat3x3<f32>,
    mass: mat3x3<f32>, // by Gauss-Seidel: inverse of the block
    impulse: vec3<f32>,
    push: vec3<f32>,
    own: vec3<f32>,
    kinds: vec3<u32>,
    gamma: vec3<f32>,
    goal: vec3<f32>,
    remainder: vec3<f32>,
}

struct JointWork {
    along: mat3x3<f32>,
    about: mat3x3<f32>,
    arm_a: vec3<f32>,
    slot: u32,
    arm_b: vec3<f32>,
    axes: u32,
    shift: vec3<f32>,
    body_a: u32,
    turned: vec3<f32>,
    body_b: u32,
    rows: array<JointRows, 2>,
}

// A body as joints see it.
struct Seen {
    linear: vec3<f32>,
    angular: vec3<f32>,
    inverse_mass: f32,
    translation: vec3<f32>,
    rotation: vec4<f32>,
}

@group(0) @binding(0) var<uniform> control: Control;
@group(0) @binding(1) var<uniform> step: StepParams;
@group(0) @binding(2) var<uniform> joint_layout: JointTables;
@group(0) @binding(3) var<storage, read> work_states: array<BodyState>;
@group(0) @binding(4) var<storage, read> props: array<BodyProps>;
@group(0) @binding(5) var<storage, read_write> solver_bodies: array<SolverBody>;
@group(0) @binding(6) var<storage, read> joints: array<Joint>;
@group(0) @binding(7) var<storage, read> joint_tables: array<u32>;
@group(0) @binding(8) var<storage, read_write> joint_states: array<JointState>;
@group(0) @binding(9) var<storage, read_write> joint_works: array<JointWork>;

fn see(slot: u32) -> Seen {
    let turned = unit(multiply(solver_bodies[slot].delta, work_states[slot].rotation));
    return Seen(
        solver_bodies[slot].linear_velocity,
        solver_bodies[slot].angular_velocity,
        solver_bodies[slot].inverse_mass,
        solver_bodies[slot].translation,
        turned,
    );
}

fn turn_response(slot: u32, v: vec3<f32>) -> vec3<f32> {
    return symmetric_times(solver_bodies[slot].inverse_inertia_diagonal, solver_bodies[slot].inverse_inertia_off, v);
}

fn inverse_inertia_of(slot: u32) -> mat3x3<f32> {
    let d = solver_bodies[slot].inverse_inertia_diagonal;
    let o = solver_bodies[slot].inverse_inertia_off;
    return mat3x3<f32>(vec3<f32>(d.x, o.x, o.y), vec3<f32>(o.x, d.y, o.z), vec3<f32>(o.y, o.z, d.z));
}

// The inverse by cross products; zero where there is none.
fn inverse3(m: mat3x3<f32>) -> mat3x3<f32> {
    let yz = cross(m[1], m[2]);
    let zx = cross(m[2], m[0]);
    let xy = cross(m[0], m[1]);
    let determinant = dot(m[2], xy);
    if determinant == 0.0 {
        return mat3x3<f32>();
    }
    let s = 1.0 / determinant;
    return transpose(mat3x3<f32>(yz * s, zx * s, xy * s));
}

// A vector along v and a turn by it: the tangent of half the angle, one order further.
fn predicted_rotation(body: Seen, h: f32) -> vec4<f32> {
    let half = 0.5 * h * body.angular;
    let square = dot(half, half);
    let longer = select(half, half * (1.0 + square / 3.0), square < 1.0);
    return unit(multiply(unit(vec4<f32>(longer, 1.0)), body.rotation));
}

// A joint at the beginning of a step with sub-steps of length `h`: what lasts of it is that of this joint, and of such
// sub-steps.
fn begin_joint(place: u32) {
    let slot = joint_tables[joint_layout.joints + place];
    if joint_states[slot].tag != joints[slot].generation + 1u {
        joint_states[slot] = JointState(vec3<f32>(), joints[slot].generation + 1u, vec3<f32>(), 0u, vec3<f32>(), step.h,
            vec3<f32>(), 0u, 0.0, 0.0, vec2<u32>());
    }
    let was = joint_states[slot].h;
    let scale = select(step.h / was, 1.0, was == step.h || was == 0.0);
    joint_states[slot].impulse *= scale;
    joint_states[slot].torque *= scale;
    joint_states[slot].h = step.h;
    if joint_states[slot].broken != 0u {
        joint_states[slot].impulse = vec3<f32>();
        joint_states[slot].torque = vec3<f32>();
    }
    joint_works[place].slot = slot;
    joint_works[place].axes = select(joints[slot].axes, 0u, joint_states[slot].broken != 0u);
    joint_works[place].body_a = joints[slot].body_a;
    joint_works[place].body_b = joints[slot].body_b;
    for (var which = 0u; which < 2u; which++) {
        joint_works[place].rows[which].impulse = vec3<f32>();
        joint_works[place].rows[which].push = vec3<f32>();
        joint_works[place].rows[which].kinds = vec3<u32>();
        joint_works[place].rows[which].gamma = vec3<f32>();
        joint_works[place].rows[which].goal = vec3<f32>();
        joint_works[place].rows[which].remainder = vec3<f32>();
        joint_works[place].rows[which].own = vec3<f32>();
        joint_works[place].rows[which].along = mat3x3<f32>();
        joint_works[place].rows[which].turn_a = mat3x3<f32>();
        joint_works[place].rows[which].turn_b = mat3x3<f32>();
        joint_works[place].rows[which].response_a = mat3x3<f32>();
        joint_works[place].rows[which].response_b = mat3x3<f32>();
    }
}

// From the first body's centre of mass to the second one's when both have moved from where the step began.
fn between(a: u32, b: u32, way_a: vec3<f32>, way_b: vec3<f32>) -> vec3<f32> {
    return (work_states[b].position - work_states[a].position) + (way_b - way_a);
}

fn frame_now(place: u32) -> JointFrame {
    let ia = joint_works[place].body_a;
    let ib = joint_works[place].body_b;
    let a = see(ia);
    let b = see(ib);
    return joint_frame(joints[joint_works[place].slot], a.rotation, b.rotation, between(ia, ib, a.translation, b.translation));
}

// Axes, coordinates and rows from the poses; pieces stay as they were.
fn refresh(place: u32) {
    let now = frame_now(place);
    joint_works[place].arm_a = now.arm_a;
    joint_works[place].arm_b = now.arm_b;
    joint_works[place].along = now.along.axes;
    joint_works[place].about = now.about.axes;
    joint_works[place].shift = now.along.coordinates;
    joint_works[place].turned = now.about.coordinates;
    rebuild(place);
}

// The coordinates from the poses; axes and rows stay those of the factor.
fn look(place: u32) {
    let now = frame_now(place);
    joint_works[place].shift = now.along.coordinates;
    joint_works[place].turned = now.about.coordinates;
}

// The rows that are active, from the axes.
fn rebuild(place: u32) {
    let ia = joint_works[place].body_a;
    let ib = joint_works[place].body_b;
    let masses = solver_bodies[ia].inverse_mass + solver_bodies[ib].inverse_mass;
    for (var blocks = blocks_in_use(joint_works[place].axes); blocks != 0u; blocks &= blocks - 1u) {
        let which = firstTrailingBit(blocks);
        var own: vec3<f32>;
        for (var left = rows_in_use(joint_works[place].axes, which); left != 0u; left &= left - 1u) {
            let row = firstTrailingBit(left);
            let axis = select(joint_works[place].about[row], joint_works[place].along[row], which == 0u);
            var turn_a = axis;
            var turn_b = axis;
            var push = vec3<f32>();
            if which == 0u {
                turn_a = cross(joint_works[place].arm_a, axis);
                turn_b = cross(joint_works[place].arm_b, axis);
                push = axis;
            }
            let response_a = turn_response(ia, turn_a);
            let response_b = turn_response(ib, turn_b);
            own[row] = dot(push, push) * masses + dot(turn_a, response_a) + dot(turn_b, response_b);
            let is_active = f32(joint_works[place].rows[which].kinds[row] != PIECE_FIXED);
            joint_works[place].rows[which].along[row] = push * is_active;
            joint_works[place].rows[which].turn_a[row] = turn_a * is_active;
            joint_works[place].rows[which].turn_b[row] = turn_b * is_active;
            joint_works[place].rows[which].response_a[row] = response_a * is_active;
            joint_works[place].rows[which].response_b[row] = response_b * is_active;
        }
        joint_works[place].rows[which].own = own;
    }
}

// Velocities of all rows of a block, active or not.
fn row_velocities(place: u32, which: u32) -> vec3<f32> {
    let ia = joint_works[place].body_a;
    let ib = joint_works[place].body_b;
    let wa = solver_bodies[ia].angular_velocity;
    let wb = solver_bodies[ib].angular_velocity;
    if which == 1u {
        return transpose(joint_works[place].about) * (wb - wa);
    }
    let velocity = solver_bodies[ib].linear_velocity + cross(wb, joint_works[place].arm_b)
        - solver_bodies[ia].linear_velocity - cross(wa, joint_works[place].arm_a);
    return transpose(joint_works[place].along) * velocity;
}

// Velocities of the active rows.
fn active_velocities(place: u32, which: u32) -> vec3<f32> {
    let ia = joint_works[place].body_a;
    let ib = joint_works[place].body_b;
    let linear = solver_bodies[ib].linear_velocity - solver_bodies[ia].linear_velocity;
    return transpose(joint_works[place].rows[which].along) * linear
        + (transpose(joint_works[place].rows[which].turn_b) * solver_bodies[ib].angular_velocity
        - transpose(joint_works[place].rows[which].turn_a) * solver_bodies[ia].angular_velocity);
}

// Chooses the pieces of all rows for the velocities and impulses as they are, see `piece`. Whether the system is another
// one by it.
fn choose(place: u32, share: f32) -> bool {
    let slot = joint_works[place].slot;
    let axes = joint_works[place].axes;
    var changed = false;
    for (var blocks = blocks_in_use(axes); blocks != 0u; blocks &= blocks - 1u) {
        let which = firstTrailingBit(blocks);
        let velocities = row_velocities(place, which);
        let coordinates = select(joint_works[place].turned, joint_works[place].shift, which == 0u);
        for (var left = rows_in_use(axes, which); left != 0u; left &= left - 1u) {
            let row = firstTrailingBit(left);
            let axis = 3u * which + row;
            let at = AxisState(
                coordinates[row],
                velocities[row],
                joint_works[place].rows[which].impulse[row],
                joint_works[place].rows[which].own[row],
            );
            let kind = joint_works[place].rows[which].kinds[row];
            var new_piece = piece(axes, joints[slot].flags, joints[slot].frequency, joints[slot].damping_ratio,
                joints[slot].drives[axis], axis, at, step.h, share, kind);
            let gamma = joint_works[place].rows[which].gamma[row];
            if kind == new_piece.kind && abs(gamma - new_piece.gamma) <= SAME_SPRING * gamma {
                // Its goal goes with either.
                new_piece.gamma = gamma;
            }
            changed |= kind != new_piece.kind || gamma != new_piece.gamma;
            joint_works[place].rows[which].kinds[row] = new_piece.kind;
            joint_works[place].rows[which].gamma[row] = new_piece.gamma;
            joint_works[place].rows[which].goal[row] = new_piece.goal;
        }
    }
    return changed;
}

// What the rows of a block still lack of their goals. `relax`: hard rows are to stand still.
fn lack(place: u32, which: u32, relax: bool) -> vec3<f32> {
    let velocities = active_velocities(place, which);
    let kinds = joint_works[place].rows[which].kinds;
    let goal = joint_works[place].rows[which].goal;
    let gamma = joint_works[place].rows[which].gamma;
    let impulse = joint_works[place].rows[which].impulse;
    var lacking: vec3<f32>;
    for (var left = rows_in_use(joint_works[place].axes, which); left != 0u; left &= left - 1u) {
        let row = firstTrailingBit(left);
        if kinds[row] != PIECE_FIXED {
            let wanted = select(goal[row], 0.0, relax && kinds[row] != PIECE_SOFT);
            lacking[row] = wanted - velocities[row] - gamma[row] * impulse[row];
        }
    }
    return lacking;
}

// By how much the separation of the locked rows will be off what is linear, as far as it is to be believed.
fn predict(place: u32) {
    let slot = joint_works[place].slot;
    let ia = joint_works[place].body_a;
    let ib = joint_works[place].body_b;
    let h = step.h;
    let a = see(ia);
    let b = see(ib);
    let way = between(ia, ib, a.translation + h * a.linear, b.translation + h * b.linear);
    let next = joint_frame(joints[slot], predicted_rotation(a, h), predicted_rotation(b, h), way);
    let fastest = max(sqrt(dot(a.angular, a.angular)), sqrt(dot(b.angular, b.angular)));
    let spin = h * fastest / THETA;
    let still = 1.0 / (1.0 + spin * spin * spin * spin);
    for (var blocks = blocks_in_use(joint_works[place].axes); blocks != 0u; blocks &= blocks - 1u) {
        let which = firstTrailingBit(blocks);
        var change = next.along.coordinates - joint_works[place].shift;
        var before = joint_states[slot].remainder;
        if which == 1u {
            change = next.about.coordinates - joint_works[place].turned;
            before = joint_states[slot].angular_remainder;
        }
        let kinds = joint_works[place].rows[which].kinds;
        let locked = change / h - active_velocities(place, which);
        // It may have come into the system just now, and have no rows yet. Angles may leap by a turn.
        let limited = change / h - row_velocities(place, which);
        let at_a_limit = (kinds == vec3<u32>(PIECE_LOW)) | (kinds == vec3<u32>(PIECE_HIGH));
        let at_limit = at_a_limit & vec3<bool>(which == 0u);
        let off = select(select(vec3<f32>(), limited, at_limit), locked, kinds == vec3<u32>(PIECE_LOCKED));
        if which == 0u {
            joint_states[slot].remainder = off;
        } else {
            joint_states[slot].angular_remainder = off;
        }
        let differs = off - before;
        let moved = sqrt(dot(differs, differs)) / ((sqrt(dot(off, off)) + sqrt(dot(before, before))) * KAPPA + 1e-9);
        let smooth_share = 1.0 / (1.0 + moved * moved * moved * moved);
        joint_works[place].rows[which].remainder = off * (LEAST + (1.0 - LEAST) * max(still, smooth_share));
    }
}

// What a projection of the poses is to take out, m and rad.
fn off_by(place: u32, which: u32) -> vec3<f32> {
    let slot = joint_works[place].slot;
    let coordinates = select(joint_works[place].turned, joint_works[place].shift, which == 0u);
    var off: vec3<f32>;
    for (var left = rows_in_use(joint_works[place].axes, which); left != 0u; left &= left - 1u) {
        let row = firstTrailingBit(left);
        let axis = 3u * which + row;
        let kind = joint_works[place].rows[which].kinds[row];
        let to_low = coordinates[row] - joints[slot].drives[axis].low;
        if kind == PIECE_LOCKED {
            off[row] = to_low;
        } else if kind == PIECE_LOW {
            off[row] = min(to_low, 0.0);
        } else if kind == PIECE_HIGH {
            off[row] = max(coordinates[row] - joints[slot].drives[axis].high, 0.0);
        }
        if which == 1u && kind != PIECE_LOCKED && abs(off[row]) > JUMP {
            off[row] = 0.0;
        }
    }
    return off;
}

// A share of the impulses of the last sub-step, in the axes as they are now.
fn carry_impulses(place: u32, share: f32) {
    let slot = joint_works[place].slot;
    joint_works[place].rows[0].impulse = transpose(joint_works[place].along) * (share * joint_states[slot].impulse);
    joint_works[place].rows[1].impulse = transpose(joint_works[place].about) * (share * joint_states[slot].torque);
}

// Begins without impulses.
fn forget_impulses(place: u32) {
    joint_works[place].rows[0].impulse = vec3<f32>();
    joint_works[place].rows[1].impulse = vec3<f32>();
}

// What it gives its bodies before they move, in the world.
fn keep_impulses(place: u32) {
    let slot = joint_works[place].slot;
    joint_states[slot].impulse = joint_works[place].along * joint_works[place].rows[0].impulse;
    joint_states[slot].torque = joint_works[place].about * joint_works[place].rows[1].impulse;
}

// And what it gives them after that.
fn add_impulses(place: u32) {
    let slot = joint_works[place].slot;
    joint_states[slot].impulse += joint_works[place].along * joint_works[place].rows[0].impulse;
    joint_states[slot].torque += joint_works[place].about * joint_works[place].rows[1].impulse;
}

// What rows of a fixed impulse are still to give; others give nothing.
fn fix(place: u32) {
    for (var blocks = blocks_in_use(joint_works[place].axes); blocks != 0u; blocks &= blocks - 1u) {
        let which = firstTrailingBit(blocks);
        let fixed = joint_works[place].rows[which].kinds == vec3<u32>(PIECE_FIXED);
        let more = joint_works[place].rows[which].goal - joint_works[place].rows[which].impulse;
        let push = select(vec3<f32>(), more, fixed);
        joint_works[place].rows[which].push = push;
        joint_works[place].rows[which].impulse += push;
    }
}

// A change of velocities.
struct Push {
    linear: vec3<f32>,
    angular: vec3<f32>,
}

// What a joint gives one of its bodies now: `end` is twice its place, plus one for the second body.
fn push_of(end: u32) -> Push {
    let place = end >> 1u;
    var push: Push;
    for (var blocks = blocks_in_use(joint_works[place].axes); blocks != 0u; blocks &= blocks - 1u) {
        let which = firstTrailingBit(blocks);
        let given = joint_works[place].rows[which].push;
        push.linear += joint_works[place].rows[which].along * given;
        if (end & 1u) == 1u {
            push.angular += joint_works[place].rows[which].response_b * given;
        } else {
            push.angular += joint_works[place].rows[which].response_a * given;
        }
    }
    let sign = select(-1.0, 1.0, (end & 1u) == 1u);
    return Push(sign * push.linear, sign * push.angular);
}

// The same of rows of a fixed impulse, which are in no block of the system.
fn fixed_push_of(end: u32, body: u32) -> Push {
    let place = end >> 1u;
    let push = joint_works[place].along * joint_works[place].rows[0].push;
    let arm = select(joint_works[place].arm_a, joint_works[place].arm_b, (end & 1u) == 1u);
    let turned = turn_response(body, cross(arm, push) + joint_works[place].about * joint_works[place].rows[1].push);
    let sign = select(-1.0, 1.0, (end & 1u) == 1u);
    return Push(sign * push, sign * turned);
}

// Adds to a body's velocities; what joints add is no load of contacts.
fn add_velocities(slot: u32, linear: vec3<f32>, angular: vec3<f32>) {
    let way = solver_bodies[slot].inverse_mass * linear;
    solver_bodies[slot].linear_velocity += way;
    solver_bodies[slot].linear_start += way;
    solver_bodies[slot].angular_velocity += angular;
    solver_bodies[slot].angular_start += angular;
}

// The block on the diagonal of the system; rows that are not active have a one.
fn diagonal_block(place: u32, which: u32) -> mat3x3<f32> {
    let ia = joint_works[place].body_a;
    let ib = joint_works[place].body_b;
    let masses = solver_bodies[ia].inverse_mass + solver_bodies[ib].inverse_mass;
    let along = joint_works[place].rows[which].along;
    var k = transpose(along) * along * masses
        + transpose(joint_works[place].rows[which].turn_a) * joint_works[place].rows[which].response_a
        + transpose(joint_works[place].rows[which].turn_b) * joint_works[place].rows[which].response_b;
    let in_cycle = (joints[joint_works[place].slot].flags & JOINT_IN_CYCLE) != 0u;
    let more = select(REGULARIZATION, CYCLE_REGULARIZATION, in_cycle) / 3.0 * (k[0].x + k[1].y + k[2].z);
    let kinds = joint_works[place].rows[which].kinds;
    let gamma = joint_works[place].rows[which].gamma;
    for (var row = 0u; row < 3u; row++) {
        k[row][row] += select(gamma[row] + more, 1.0, kinds[row] == PIECE_FIXED);
    }
    return k;
}

// What lasts of a joint after a step: it breaks where its last sub-step asked for too much; what is not finite does not
// last. Whether it breaks now.
fn store_joint(place: u32) -> bool {
    let slot = joint_works[place].slot;
    let impulse = joint_states[slot].impulse;
    let torque = joint_states[slot].torque;
    if !is_finite3(impulse) || !is_finite3(torque) {
        joint_states[slot].tag = 0u;
        joint_states[slot].broken = 0u;
        return false;
    }
    // Where the last projection left it.
    look(place);
    // Each level has sub-steps of its own length.
    let h = joint_states[slot].h;
    let breaks = sqrt(dot(impulse, impulse)) > joints[slot].break_force * h
        || sqrt(dot(torque, torque)) > joints[slot].break_torque * h;
    var separation: vec3<f32>;
    var angle: vec3<f32>;
    for (var row = 0u; row < 3u; row++) {
        if joint_works[place].rows[0].kinds[row] == PIECE_LOCKED {
            separation[row] = joint_works[place].shift[row] - joints[slot].drives[row].low;
        }
        if joint_works[place].rows[1].kinds[row] == PIECE_LOCKED {
            angle[row] = joint_works[place].turned[row] - joints[slot].drives[3u + row].low;
        }
    }
    joint_states[slot].separation = sqrt(dot(separation, separation));
    joint_states[slot].angle = sqrt(dot(angle, angle));
    let breaks_now = breaks && joint_states[slot].broken == 0u;
    joint_states[slot].broken |= u32(breaks);
    return breaks_now;
}
