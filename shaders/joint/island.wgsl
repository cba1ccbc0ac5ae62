// Joints that are solved directly, together: block LDL^T. Twin of crates/cpu/src/joint/island.rs, which says why.
//
//   begin    once a step: joints as they are, the factor
//   solve    before contacts: velocities that take the joints to where they belong
//   relax    when bodies have moved: poses onto the joints, velocities that keep them there
//   store    once a step: what lasts; names and counts the joints that are broken, in counters
//
// One workgroup an island, all islands at the level of sub-steps of the dispatch. Joints, bodies, blocks and entries of
// the factor are shared out to its invocations; blocks of one level of the elimination do not touch each other. Reads and
// writes what `joint/rows` names, and `joint_factors`: for each block its inverted diagonal (3) and its value (1), then
// for each entry L and L D (3 and 3).

//#import joint/inertia.wgsl

// How often pieces are chosen in a sub-step.
const CHOICES: u32 = 3u;
// Share of a sub-step's impulses of motors, friction and springs that is given before bodies move, and once more after.
const HALF: f32 = 0.5;
const INVOCATIONS: u32 = 64u;
// Solves of a relaxation.
const TURNS: u32 = 2u;

@group(0) @binding(10) var<storage, read_write> joint_factors: array<vec4<f32>>;

@group(0) @binding(12) var<storage, read_write> counters: array<atomic<u32>>;

var<workgroup> shared_island: JointIsland;
var<workgroup> shared_runs: u32;
var<workgroup> shared_changed: atomic<u32>;
var<workgroup> shared_again: u32;

fn joint_island(index: u32) -> JointIsland {
    let at = joint_layout.islands + 8u * index;
    return JointIsland(
        joint_tables[at], joint_tables[at + 1u], joint_tables[at + 2u], joint_tables[at + 3u],
        joint_tables[at + 4u], joint_tables[at + 5u], joint_tables[at + 6u], joint_tables[at + 7u],
    );
}

fn joint_block(index: u32) -> JointBlock {
    let at = joint_layout.blocks + 8u * index;
    return JointBlock(
        joint_tables[at], joint_tables[at + 1u], joint_tables[at + 2u], joint_tables[at + 3u],
        joint_tables[at + 4u], joint_tables[at + 5u], joint_tables[at + 6u], 0u,
    );
}

fn joint_entry(index: u32) -> JointEntry {
    let at = joint_layout.entries + 8u * index;
    return JointEntry(
        joint_tables[at], joint_tables[at + 1u], joint_tables[at + 2u], joint_tables[at + 3u],
        vec2<u32>(joint_tables[at + 4u], joint_tables[at + 5u]), vec2<u32>(),
    );
}

fn load_factor(at: u32) -> mat3x3<f32> {
    return mat3x3<f32>(joint_factors[at].xyz, joint_factors[at + 1u].xyz, joint_factors[at + 2u].xyz);
}

fn save_factor(at: u32, m: mat3x3<f32>) {
    joint_factors[at] = vec4<f32>(m[0], 0.0);
    joint_factors[at + 1u] = vec4<f32>(m[1], 0.0);
    joint_factors[at + 2u] = vec4<f32>(m[2], 0.0);
}

fn diagonal_at(block: u32) -> u32 {
    return 4u * block;
}

fn value_at(block: u32) -> u32 {
    return 4u * block + 3u;
}

fn lower_at(entry: u32) -> u32 {
    return 4u * joint_layout.block_count + 6u * entry;
}

fn upper_at(entry: u32) -> u32 {
    return lower_at(entry) + 3u;
}

// Makes the island known to its workgroup; 1 where this dispatch is to run it.
fn open_island(index: u32, lid: u32) -> u32 {
    if lid == 0u {
        shared_runs = 0u;
        if index < joint_layout.island_count && control.stop == 0u {
            shared_island = joint_island(index);
            // That of its first body that moves; one that nothing moves is left alone.
            for (var k = 0u; k < shared_island.body_count; k++) {
                let body = joint_body(shared_island.first_body + k).body;
                if moves(work_states[body].flags) {
                    shared_runs = u32(solver_bodies[body].level == step.level);
                    break;
                }
            }
        }
    }
    return workgroupUniformLoad(&shared_runs);
}

// Whether a piece changed since this was last asked.
fn take_changed(lid: u32) -> u32 {
    workgroupBarrier();
    if lid == 0u {
        shared_again = atomicExchange(&shared_changed, 0u);
    }
    return workgroupUniformLoad(&shared_again);
}

// What impulses of the column's rows do to the velocities of the row's, by the bodies that both joints hold.
fn coupling(entry: JointEntry) -> mat3x3<f32> {
    let row = joint_tables[joint_layout.blocks + 8u * entry.row];
    let column = joint_tables[joint_layout.blocks + 8u * entry.column];
    let i = row >> 1u;
    let j = column >> 1u;
    var value: mat3x3<f32>;
    for (var k = 0u; k < 2u; k++) {
        let slot = entry.shared_bodies[k];
        if slot == NO_BODY {
            continue;
        }
        let first_i = joint_works[i].body_a == slot;
        let first_j = joint_works[j].body_a == slot;
        var turns = joint_works[i].rows[row & 1u].turn_b;
        if first_i {
            turns = joint_works[i].rows[row & 1u].turn_a;
        }
        var response = joint_works[j].rows[column & 1u].response_b;
        if first_j {
            response = joint_works[j].rows[column & 1u].response_a;
        }
        let along = transpose(joint_works[i].rows[row & 1u].along) * joint_works[j].rows[column & 1u].along;
        let sign = select(-1.0, 1.0, first_i == first_j);
        value += (along * solver_bodies[slot].inverse_mass + transpose(turns) * response) * sign;
    }
    return value;
}

// What has been eliminated before, taken from a block.
fn take_terms(start: mat3x3<f32>, first: u32, count: u32) -> mat3x3<f32> {
    var value = start;
    for (var k = 0u; k < count; k++) {
        let at = joint_layout.terms + 2u * (first + k);
        value -= load_factor(lower_at(joint_tables[at])) * transpose(load_factor(upper_at(joint_tables[at + 1u])));
    }
    return value;
}

// Assembles and factors the system, level by level.
fn factor(island: JointIsland, lid: u32) {
    for (var level = 0u; level < island.level_count; level++) {
        let at = joint_layout.levels + island.first_level + level;
        let first = joint_tables[at];
        let end = joint_tables[at + 1u];
        for (var k = first + lid; k < end; k += INVOCATIONS) {
            let block = joint_block(k);
            let own = diagonal_block(block.row >> 1u, block.row & 1u);
            save_factor(diagonal_at(k), inverse3(take_terms(own, block.first_term, block.term_count)));
        }
        storageBarrier();
        let first_entry = joint_block(first).first_entry;
        let last = joint_block(end - 1u);
        for (var e = first_entry + lid; e < last.first_entry + last.entry_count; e += INVOCATIONS) {
            let entry = joint_entry(e);
            let value = take_terms(coupling(entry), entry.first_term, entry.term_count);
            save_factor(upper_at(e), value);
            save_factor(lower_at(e), value * load_factor(diagonal_at(entry.column)));
        }
        storageBarrier();
    }
}

// Forward and back substitution on the blocks' values.
fn substitute(island: JointIsland, lid: u32) {
    for (var level = 0u; level < island.level_count; level++) {
        let at = joint_layout.levels + island.first_level + level;
        for (var k = joint_tables[at] + lid; k < joint_tables[at + 1u]; k += INVOCATIONS) {
            let block = joint_block(k);
            var value = joint_factors[value_at(k)].xyz;
            for (var x = 0u; x < block.row_count; x++) {
                let row = joint_layout.rows + 2u * (block.first_row + x);
                value -= load_factor(lower_at(joint_tables[row])) * joint_factors[value_at(joint_tables[row + 1u])].xyz;
            }
            joint_factors[value_at(k)] = vec4<f32>(value, 0.0);
        }
        storageBarrier();
    }
    for (var back = 0u; back < island.level_count; back++) {
        let at = joint_layout.levels + island.first_level + island.level_count - 1u - back;
        for (var k = joint_tables[at] + lid; k < joint_tables[at + 1u]; k += INVOCATIONS) {
            let block = joint_block(k);
            var value = load_factor(diagonal_at(k)) * joint_factors[value_at(k)].xyz;
            for (var e = block.first_entry; e < block.first_entry + block.entry_count; e++) {
                let row = joint_tables[joint_layout.entries + 8u * e];
                value -= transpose(load_factor(lower_at(e))) * joint_factors[value_at(row)].xyz;
            }
            joint_factors[value_at(k)] = vec4<f32>(value, 0.0);
        }
        storageBarrier();
    }
}

// The blocks' values become what their rows give now; `count`: and what they have given.
fn take_values(island: JointIsland, lid: u32, counts: bool) {
    for (var k = island.first_block + lid; k < island.first_block + island.block_count; k += INVOCATIONS) {
        let row = joint_tables[joint_layout.blocks + 8u * k];
        let value = joint_factors[value_at(k)].xyz;
        joint_works[row >> 1u].rows[row & 1u].push = value;
        if counts {
            joint_works[row >> 1u].rows[row & 1u].impulse += value;
        }
    }
    storageBarrier();
}

// Each body takes what all its joints give it now; `fixed_rows`: those of a fixed impulse.
fn push_bodies(island: JointIsland, lid: u32, fixed_rows: bool) {
    for (var k = island.first_body + lid; k < island.first_body + island.body_count; k += INVOCATIONS) {
        let info = joint_body(k);
        var linear: vec3<f32>;
        var angular: vec3<f32>;
        for (var x = 0u; x < info.end_count; x++) {
            let end = joint_tables[joint_layout.ends + info.first_end + x];
            var push: Push;
            if fixed_rows {
                push = fixed_push_of(end, info.body);
            } else {
                push = push_of(end);
            }
            linear += push.linear;
            angular += push.angular;
        }
        if solver_bodies[info.body].inverse_mass > 0.0 {
            add_velocities(info.body, linear, angular);
        }
    }
    storageBarrier();
}

// Moves the bodies by what all their joints give them now.
fn project_bodies(island: JointIsland, lid: u32) {
    for (var k = island.first_body + lid; k < island.first_body + island.body_count; k += INVOCATIONS) {
        let info = joint_body(k);
        let slot = info.body;
        var linear: vec3<f32>;
        var angular: vec3<f32>;
        for (var x = 0u; x < info.end_count; x++) {
            let push = push_of(joint_tables[joint_layout.ends + info.first_end + x]);
            linear += push.linear;
            angular += push.angular;
        }
        if solver_bodies[slot].inverse_mass > 0.0 {
            let angle = sqrt(dot(angular, angular));
            let half = angular * select(0.5, 0.5 * MAX_PROJECTION / angle, angle > MAX_PROJECTION);
            solver_bodies[slot].translation += solver_bodies[slot].inverse_mass * linear;
            solver_bodies[slot].delta = unit(multiply(unit(vec4<f32>(half, 1.0)), solver_bodies[slot].delta));
        }
    }
    storageBarrier();
}

@compute @workgroup_size(64)
fn begin(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    if open_island(workgroup_index(wg, num), lid) == 0u {
        return;
    }
    let island = workgroupUniformLoad(&shared_island);
    for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
        begin_joint(k);
    }
    storageBarrier();
    for (var k = island.first_body + lid; k < island.first_body + island.body_count; k += INVOCATIONS) {
        stiffen(k);
    }
    storageBarrier();
    for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
        refresh(k);
        carry_impulses(k, HALF);
        _ = choose(k, HALF);
    }
    storageBarrier();
    for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
        rebuild(k);
    }
    storageBarrier();
    factor(island, lid);
}

@compute @workgroup_size(64)
fn solve(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    if open_island(workgroup_index(wg, num), lid) == 0u {
        return;
    }
    let island = workgroupUniformLoad(&shared_island);
    if lid == 0u {
        atomicStore(&shared_changed, 0u);
    }
    workgroupBarrier();
    for (var choice = 0u; choice < CHOICES; choice++) {
        for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
            if choice == 0u {
                look(k);
            }
            if choose(k, HALF) {
                atomicOr(&shared_changed, 1u);
            }
            if choice == 0u {
                forget_impulses(k);
                predict(k);
            }
        }
        storageBarrier();
        let changed = take_changed(lid);
        if choice > 0u && changed == 0u {
            break;
        }
        if changed != 0u {
            for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
                rebuild(k);
            }
            storageBarrier();
            factor(island, lid);
        }
        for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
            fix(k);
        }
        storageBarrier();
        push_bodies(island, lid, true);
        for (var k = island.first_block + lid; k < island.first_block + island.block_count; k += INVOCATIONS) {
            let row = joint_tables[joint_layout.blocks + 8u * k];
            let place = row >> 1u;
            let wanted = lack(place, row & 1u, false) - joint_works[place].rows[row & 1u].remainder;
            joint_factors[value_at(k)] = vec4<f32>(wanted, 0.0);
        }
        storageBarrier();
        substitute(island, lid);
        take_values(island, lid, true);
        push_bodies(island, lid, false);
    }
}

@compute @workgroup_size(64)
fn relax(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    if open_island(workgroup_index(wg, num), lid) == 0u {
        return;
    }
    let island = workgroupUniformLoad(&shared_island);
    for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
        keep_impulses(k);
        forget_impulses(k);
    }
    storageBarrier();
    for (var k = island.first_body + lid; k < island.first_body + island.body_count; k += INVOCATIONS) {
        stiffen(k);
    }
    storageBarrier();
    for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
        refresh(k);
    }
    storageBarrier();
    factor(island, lid);
    // First the poses, then the velocities.
    for (var turn = 0u; turn < TURNS; turn++) {
        for (var k = island.first_block + lid; k < island.first_block + island.block_count; k += INVOCATIONS) {
            let row = joint_tables[joint_layout.blocks + 8u * k];
            if turn == 0u {
                joint_factors[value_at(k)] = vec4<f32>(-off_by(row >> 1u, row & 1u), 0.0);
            } else {
                joint_factors[value_at(k)] = vec4<f32>(lack(row >> 1u, row & 1u, true), 0.0);
            }
        }
        storageBarrier();
        substitute(island, lid);
        take_values(island, lid, turn != 0u);
        if turn == 0u {
            project_bodies(island, lid);
            for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
                fix(k);
            }
            storageBarrier();
        }
        push_bodies(island, lid, turn == 0u);
    }
    for (var k = island.first_joint + lid; k < island.first_joint + island.joint_count; k += INVOCATIONS) {
        add_impulses(k);
    }
}

// One thread a joint, of all levels.
@compute @workgroup_size(256)
fn store(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    let place = invocation(wg, num, lid);
    if place >= joint_layout.joint_count || atomicLoad(&counters[CONTROL_STOP]) != 0u {
        return;
    }
    let slot = joint_tables[joint_layout.joints + place];
    if moves(work_states[joints[slot].body_a].flags) || moves(work_states[joints[slot].body_b].flags) {
        if store_joint(place) {
            atomicMax(&counters[CONTROL_NEWLY_BROKEN + slot % BREAK_NAMES], slot + 1u);
        }
    }
    if joint_states[slot].tag == joints[slot].generation + 1u && joint_states[slot].broken != 0u {
        atomicAdd(&counters[CONTROL_BROKEN_JOINTS], 1u);
    }
}

// Marks the bodies that joints move. One thread a body of the topology.
@compute @workgroup_size(256)
fn mark(@builtin(workgroup_id) wg: vec3<u32>, @builtin(num_workgroups) num: vec3<u32>, @builtin(local_invocation_index) lid: u32) {
    let index = invocation(wg, num, lid);
    if index < joint_layout.body_count && control.stop == 0u {
        let info = joint_body(index);
        solver_bodies[info.body].touched |= select(TOUCHED_CONTACT, TOUCHED_JOINED, info.direct != 0u);
    }
}
