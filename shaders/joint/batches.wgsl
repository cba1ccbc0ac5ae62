// Joints of large islands, by Gauss-Seidel over batches that share no body that moves. Twin of
// crates/cpu/src/joint/batches.rs, which says why.
//
//   begin        once a step, one thread a joint of the batches
//   stiffen      one thread a body of theirs: its inertia with the geometric stiffness of its joints
//   warm_start, solve, relax            one thread a joint of the batch that `batch` names
//   warm_start_tail, solve_tail, relax_tail   one workgroup: all batches without a dispatch of their own, one by one
//
// Reads and writes what `joint/rows` names.

//#import joint/inertia.wgsl

// Share of the separation of locked rows that is taken out in a sub-step.
const SHARE: f32 = 0.282;
// What a spring takes of the mass.
const MASS_SHARE: f32 = 0.8974;
// Share of the impulse that it lets go.
const LEAK: f32 = 0.1026;

@group(0) @binding(11) var<uniform> batch: vec4<u32>;

// The level of sub-steps of a joint; none where nothing moves.
fn level_of_joint(place: u32) -> u32 {
    let a = joint_works[place].body_a;
    let b = joint_works[place].body_b;
    if solver_bodies[a].inverse_mass > 0.0 {
        return solver_bodies[a].level;
    }
    return select(LEVELS, solver_bodies[b].level, solver_bodies[b].inverse_mass > 0.0);
}

// The rows of a joint whose axes and impulses are those of now.
fn make_rows(place: u32) {
    // No piece is kept for being like the last one: each visit factors anew.
    for (var which = 0u; which < 2u; which++) {
        joint_works[place].rows[which].kinds = vec3<u32>();
        joint_works[place].rows[which].gamma = vec3<f32>();
    }
    if choose(place, 1.0) {
        rebuild(place);
    }
    for (var blocks = blocks_in_use(joint_works[place].axes); blocks != 0u; blocks &= blocks - 1u) {
        let which = firstTrailingBit(blocks);
        joint_works[place].rows[which].mass = inverse3(diagonal_block(place, which));
    }
}

// What a row lacks of its goal; when rows relax, those that are hard come to rest, but for a way that is free until a
// limit, and springs stay as they are.
fn row_lack(kind: u32, goal: f32, velocity: f32, gamma: f32, impulse: f32, relaxes: bool) -> f32 {
    if kind == PIECE_FIXED {
        return goal - impulse;
    }
    if !relaxes {
        return select(goal, SHARE * goal, kind == PIECE_LOCKED) - velocity - gamma * impulse;
    }
    if kind == PIECE_SOFT {
        return 0.0;
    }
    let free = select(select(0.0, max(goal, 0.0), kind == PIECE_HIGH), min(goal, 0.0), kind == PIECE_LOW);
    return free - velocity;
}

fn push_along(place: u32, which: u32, impulse: vec3<f32>) {
    let ia = joint_works[place].body_a;
    let ib = joint_works[place].body_b;
    var push: vec3<f32>;
    var turn_a: vec3<f32>;
    var turn_b: vec3<f32>;
    if which == 0u {
        push = joint_works[place].along * impulse;
        turn_a = cross(joint_works[place].arm_a, push);
        turn_b = cross(joint_works[place].arm_b, push);
    } else {
        turn_a = joint_works[place].about * impulse;
        turn_b = turn_a;
    }
    if solver_bodies[ia].inverse_mass > 0.0 {
        add_velocities(ia, -push, -turn_response(ia, turn_a));
    }
    if solver_bodies[ib].inverse_mass > 0.0 {
        add_velocities(ib, push, turn_response(ib, turn_b));
    }
}

fn visit_rows(place: u32, relaxes: bool) {
    for (var blocks = blocks_in_use(joint_works[place].axes); blocks != 0u; blocks &= blocks - 1u) {
        let which = firstTrailingBit(blocks);
        let velocities = row_velocities(place, which);
        let kinds = joint_works[place].rows[which].kinds;
        let before = joint_works[place].rows[which].impulse;
        var lacking: vec3<f32>;
        for (var left = rows_in_use(joint_works[place].axes, which); left != 0u; left &= left - 1u) {
            let row = firstTrailingBit(left);
            lacking[row] = row_lack(kinds[row], joint_works[place].rows[which].goal[row], velocities[row],
                joint_works[place].rows[which].gamma[row], before[row], relaxes);
        }
        var impulse = joint_works[place].rows[which].mass * lacking;
        if !relaxes {
            impulse = select(impulse, MASS_SHARE * impulse - LEAK * before, kinds == vec3<u32>(PIECE_LOCKED));
        }
        joint_works[place].rows[which].impulse = before + impulse;
        push_along(place, which, impulse);
    }
}

fn warm_start_one(place: u32) {
    if level_of_joint(place) != step.level {
        return;
    }
    for (var blocks = blocks_in_use(joint_works[place].axes); blocks != 0u; blocks &= blocks - 1u) {
        let which = firstTrailingBit(blocks);
        push_along(place, which, joint_works[place].rows[which].impulse);
    }
}

fn solve_one(place: u32) {
    if level_of_joint(place) == step.level {
        visit_rows(place, false);
    }
}

fn relax_one(place: u32) {
    if level_of_joint(place) != step.level {
        return;
    }
    refresh(place);
    make_rows(place);
    visit_rows(place, true);
    keep_impulses(place);
}

@compute @workgroup_size(256)
fn begin(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    let place = joint_layout.direct_joints + invocation(wg, num, lid);
    if place >= joint_layout.joint_count || control.stop != 0u {
        return;
    }
    joint_works[place].body_a = joints[joint_tables[joint_layout.joints + place]].body_a;
    joint_works[place].body_b = joints[joint_tables[joint_layout.joints + place]].body_b;
    if level_of_joint(place) != step.level {
        return;
    }
    begin_joint(place);
    refresh(place);
    carry_impulses(place, 1.0);
    make_rows(place);
}

@compute @workgroup_size(256)
fn stiffen_bodies(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    let index = joint_layout.direct_bodies + invocation(wg, num, lid);
    if index < joint_layout.body_count && control.stop == 0u && solver_bodies[joint_body(index).body].level == step.level {
        stiffen(index);
    }
}

// The place of this invocation in the batch that `batch` names; past all where there is none.
fn place_in_batch(index: u32) -> u32 {
    let at = joint_layout.batches + batch.x;
    let place = joint_tables[at] + index;
    return select(joint_layout.joint_count, place, place < joint_tables[at + 1u] && control.stop == 0u);
}

@compute @workgroup_size(256)
fn warm_start(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    let place = place_in_batch(invocation(wg, num, lid));
    if place < joint_layout.joint_count {
        warm_start_one(place);
    }
}

@compute @workgroup_size(256)
fn solve(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    let place = place_in_batch(invocation(wg, num, lid));
    if place < joint_layout.joint_count {
        solve_one(place);
    }
}

@compute @workgroup_size(256)
fn relax(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    let place = place_in_batch(invocation(wg, num, lid));
    if place < joint_layout.joint_count {
        relax_one(place);
    }
}

// The batches of the tail: the first one, and behind the last; none once the step is stopped.
fn tail_batches() -> vec2<u32> {
    return select(vec2<u32>(), vec2<u32>(joint_layout.wide_batches, joint_layout.batch_count), control.stop == 0u);
}

@compute @workgroup_size(256)
fn warm_start_tail(@builtin(local_invocation_index) lid: u32) {
    let batches = tail_batches();
    for (var b = batches.x; b < batches.y; b++) {
        let at = joint_layout.batches + b;
        for (var place = joint_tables[at] + lid; place < joint_tables[at + 1u]; place += WORKGROUP) {
            warm_start_one(place);
        }
        storageBarrier();
    }
}

@compute @workgroup_size(256)
fn solve_tail(@builtin(local_invocation_index) lid: u32) {
    let batches = tail_batches();
    for (var b = batches.x; b < batches.y; b++) {
        let at = joint_layout.batches + b;
        for (var place = joint_tables[at] + lid; place < joint_tables[at + 1u]; place += WORKGROUP) {
            solve_one(place);
        }
        storageBarrier();
    }
}

@compute @workgroup_size(256)
fn relax_tail(@builtin(local_invocation_index) lid: u32) {
    let batches = tail_batches();
    for (var b = batches.x; b < batches.y; b++) {
        let at = joint_layout.batches + b;
        for (var place = joint_tables[at] + lid; place < joint_tables[at + 1u]; place += WORKGROUP) {
            relax_one(place);
        }
        storageBarrier();
    }
}
