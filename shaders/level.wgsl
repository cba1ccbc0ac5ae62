// Stage `level`: how many sub-steps each island gets. Twin of crates/cpu/src/level.rs.
//
// What the last step left is measured where this one finds its contacts: the deepest overlap of each island, and the
// widest separation of its joints. Where either is more than its tolerance the island wants the next level, which has
// twice the sub-steps; after some calm steps, the one below. Bodies keep what their islands want, so that islands may meet
// and part: the most wanted counts. And no island gets less than any of its bodies asks for (`props`); without a tolerance
// that is all it gets.
//
//   begin    one thread a body: clears island_credits, island_leasts and island_overlaps
//   ask      the same: what its body wants, from work_states, and asks for, from props, for the island that `islands` names; in
//            island_credits and island_leasts
//   measure  one thread a pair: the overlap of its manifold, in island_overlaps. Reads next_pairs, manifolds, aabbs
//   measure_joints  one thread a slot of a joint: its separation, in island_overlaps. Reads joints, joint_states
//   decide   one thread a body: its island's next credit, in work_states; counts in counters
//   spend    one thread a pair: counts the visits to its constraint in counters

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/control.wgsl
//#import shared/joint.wgsl
//#import shared/level.wgsl
//#import shared/manifold.wgsl
//#import shared/pair.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

const NO_ISLAND: u32 = 0xffffffffu;
const NO_OVERLAP: f32 = 1e-30; // m: stands for that of contacts and joints that have none

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read_write> work_states: array<BodyState>;
@group(0) @binding(3) var<storage, read> next_pairs: array<Pair>;
@group(0) @binding(4) var<storage, read> manifolds: array<Manifold>;
@group(0) @binding(5) var<storage, read> aabbs: array<Aabb>;
@group(0) @binding(6) var<storage, read> islands: array<u32>;
@group(0) @binding(7) var<storage, read_write> island_credits: array<atomic<u32>>;
@group(0) @binding(8) var<storage, read_write> island_overlaps: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read> props: array<BodyProps>;
@group(0) @binding(10) var<storage, read_write> island_leasts: array<atomic<u32>>;
@group(0) @binding(11) var<storage, read> joints: array<Joint>;
@group(0) @binding(12) var<storage, read> joint_states: array<JointState>;

var<workgroup> visits: atomic<u32>;
var<workgroup> worst: atomic<u32>;

@compute @workgroup_size(256)
fn begin(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count {
        atomicStore(&island_credits[i], 0u);
        atomicStore(&island_leasts[i], 0u);
        atomicStore(&island_overlaps[i], 0u);
    }
}

@compute @workgroup_size(256)
fn ask(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && islands[i] != NO_ISLAND {
        atomicMax(&island_credits[islands[i]], work_states[i].credit);
        atomicMax(&island_leasts[islands[i]], props[i].least_level);
    }
}

// A body of pair i that moves; of two, the first; NO_ISLAND without, or where the pair is no constraint.
fn moving_body(i: u32) -> u32 {
    if i >= atomicLoad(&counters[CONTROL_PAIR_COUNT]) || i >= step.pair_capacity || manifolds[i].count == 0u {
        return NO_ISLAND;
    }
    let body_a = aabbs[next_pairs[i].a].body;
    let body_b = aabbs[next_pairs[i].b].body;
    if (body_a & AABB_DYNAMIC) != 0u {
        return body_a & AABB_INDEX;
    }
    return select(NO_ISLAND, body_b & AABB_INDEX, (body_b & AABB_DYNAMIC) != 0u);
}

// Deepest overlap of manifold i, m.
fn overlap(i: u32) -> f32 {
    var deepest = NO_OVERLAP;
    for (var k = 0u; k < min(manifolds[i].count, 4u); k++) {
        deepest = max(deepest, -manifolds[i].points[k].separation);
    }
    return deepest;
}

@compute @workgroup_size(256)
fn measure(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let body = moving_body(i);
    if body != NO_ISLAND {
        // As integers, floats that are not negative keep their order.
        let deep = bitcast<u32>(overlap(i));
        atomicMax(&island_overlaps[islands[body]], deep);
        atomicMax(&worst, deep);
    }
    workgroupBarrier();
    if lid == 0u {
        atomicMax(&counters[CONTROL_RESIDUAL], atomicLoad(&worst));
    }
}

// Whether what lasts of a joint is of this one.
fn is_known(slot: u32) -> bool {
    return joint_states[slot].tag == joints[slot].generation + 1u;
}

// A body that moves of a joint that is not broken; of two, the first; NO_ISLAND without.
fn moving_joined(slot: u32) -> u32 {
    if slot >= arrayLength(&joints) || (joints[slot].flags & JOINT_ALIVE) == 0u {
        return NO_ISLAND;
    }
    if is_known(slot) && joint_states[slot].broken != 0u {
        return NO_ISLAND;
    }
    if islands[joints[slot].body_a] != NO_ISLAND {
        return joints[slot].body_a;
    }
    return select(NO_ISLAND, joints[slot].body_b, islands[joints[slot].body_b] != NO_ISLAND);
}

@compute @workgroup_size(256)
fn measure_joints(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let slot = invocation(wg, num, lid);
    let body = moving_joined(slot);
    if body != NO_ISLAND {
        let separation = select(0.0, joint_states[slot].separation, is_known(slot));
        // As overlap of the same share of its tolerance.
        atomicMax(&island_overlaps[islands[body]], bitcast<u32>(max(separation * step.joint_scale, NO_OVERLAP)));
        atomicMax(&worst, bitcast<u32>(separation));
    }
    workgroupBarrier();
    if lid == 0u {
        atomicMax(&counters[CONTROL_JOINT_RESIDUAL], atomicLoad(&worst));
    }
}

// What an island wants that wanted `credit` and has this overlap, m; the separation of joints counts as overlap.
fn next_credit(credit: u32, overlap: f32, tolerance: f32) -> u32 {
    if overlap == 0.0 || tolerance < 0.0 {
        return 0u;
    } else if overlap > tolerance {
        return min((credit / LEVEL_HOLD + 2u) * LEVEL_HOLD - 1u, MOST_CREDIT);
    } else if f32(LEVEL_CALM) * overlap < tolerance {
        return max(credit, 1u) - 1u;
    }
    return credit;
}

@compute @workgroup_size(256)
fn decide(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count || islands[i] == NO_ISLAND {
        return;
    }
    let island = islands[i];
    let deepest = bitcast<f32>(atomicLoad(&island_overlaps[island]));
    var credit = next_credit(atomicLoad(&island_credits[island]), deepest, step.tolerance);
    credit = max(credit, LEVEL_HOLD * atomicLoad(&island_leasts[island]));
    if atomicLoad(&counters[CONTROL_ISLANDS_OPEN]) != 0u {
        // Bodies that hang together must have the same level, and who does is not known.
        credit = MOST_CREDIT;
    }
    work_states[i].credit = credit;
    atomicOr(&counters[CONTROL_LEVELS_WANTED], 1u << (credit / LEVEL_HOLD));
    atomicOr(&counters[CONTROL_LEVELS_USED], 1u << level_of(step.levels, credit));
    if step.tolerance >= 0.0 && deepest > step.tolerance {
        atomicAdd(&counters[CONTROL_BODIES_OVER], 1u);
    }
}

@compute @workgroup_size(256)
fn spend(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let body = moving_body(i);
    if body != NO_ISLAND {
        atomicAdd(&visits, step.substeps << level_of(step.levels, work_states[body].credit));
    }
    workgroupBarrier();
    if lid == 0u {
        atomicAdd(&counters[CONTROL_VISITS], atomicLoad(&visits));
    }
}

@compute @workgroup_size(256)
fn spend_joints(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let body = moving_joined(invocation(wg, num, lid));
    if body != NO_ISLAND {
        atomicAdd(&visits, step.substeps << level_of(step.levels, work_states[body].credit));
    }
    workgroupBarrier();
    if lid == 0u {
        atomicAdd(&counters[CONTROL_VISITS], atomicLoad(&visits));
    }
}
