// Stage contact: keeps what outlives a step. Twin of crates/cpu/src/contact.rs.
//
// A pair that stays keeps its slot, with impulses and batch; a new one takes the slot of a pair that went, else one
// from the free list. All by rank in sorted lists, so that every run hands out the same slots. A pair stays when it is
// in both lists and neither collider was inserted in this step (else its slot number is someone else's).
//
//   find_old       one thread a pair of the last step: dead_rank = 1 if it is gone. Reads pairs, pair_keys, colliders.
//   (primitives/scan of dead_rank, total to DEAD_COUNT)
//   find_new       one thread a pair: next_pairs, fresh_rank = 1 if it is new. Reads pair_keys, pairs, colliders, apart.
//   (primitives/scan of fresh_rank, total to NEW_COUNT)
//   list_dead      one thread a pair of the last step: dead_slots, in the order of that list. Reads dead_rank, pairs.
//   assign         one thread a pair: slots of new ones in next_pairs, empty manifolds; counts pairs that no narrow
//                  phase treats (two half-spaces, or bodies that joints keep from colliding) as visited. Reads fresh_rank,
//                  dead_slots, free_slots.
// and once the step is known to be good (all of these return when it stopped):
//   commit_pairs   one thread a pair: pairs = next_pairs; batch_of_slot; slot_impulses of pairs that do not touch.
//                  Reads manifolds, pair_batch.
//   commit_found   one thread a pair: found_manifolds (by slot) of pairs whose contact was found anew. Reads
//                  next_pairs, manifolds, colliders, work_states.
//   commit_free    one thread a dead pair: slots that no new one took go on free_slots. Reads dead_slots.
//   commit_counts  one invocation: the counters that outlive the step.

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/constraint.wgsl
//#import shared/control.wgsl
//#import shared/manifold.wgsl
//#import shared/pair.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

// Feature of an impulse that belongs to no point.
const NO_FEATURE: u32 = 0xffffffffu;

// Words in which the step left what outlives it.
const NEXT_COLORED_AS: u32 = 31u;
const NEXT_FROZEN_COUNT: u32 = 108u;

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<uniform> control: Control;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> pairs: array<Pair>;
@group(0) @binding(4) var<storage, read_write> next_pairs: array<Pair>;
@group(0) @binding(5) var<storage, read> pair_keys: array<u32>;
@group(0) @binding(6) var<storage, read> colliders: array<Collider>;
@group(0) @binding(7) var<storage, read_write> dead_rank: array<u32>;
@group(0) @binding(8) var<storage, read_write> dead_slots: array<u32>;
@group(0) @binding(9) var<storage, read_write> fresh_rank: array<u32>;
@group(0) @binding(10) var<storage, read_write> free_slots: array<u32>;
@group(0) @binding(11) var<storage, read_write> manifolds: array<Manifold>;
@group(0) @binding(12) var<storage, read> pair_batch: array<u32>;
@group(0) @binding(13) var<storage, read_write> batch_of_slot: array<u32>;
@group(0) @binding(14) var<storage, read_write> slot_impulses: array<Impulse>;
@group(0) @binding(15) var<storage, read> work_states: array<BodyState>;
@group(0) @binding(16) var<storage, read_write> found_manifolds: array<FoundManifold>;
@group(0) @binding(17) var<storage, read> apart: array<vec2<u32>>; // their number, then sorted pairs of bodies

// Which pass treats a pair of these shapes.
fn kind_of(a: u32, b: u32) -> u32 {
    let low = min(a, b);
    let high = max(a, b);
    if low == SHAPE_BALL && high == SHAPE_BALL {
        return PAIR_BALL_BALL;
    }
    if low == SHAPE_BALL && high == SHAPE_CUBOID {
        return PAIR_BALL_CUBOID;
    }
    if low == SHAPE_CUBOID && high == SHAPE_CUBOID {
        return PAIR_CUBOID_CUBOID;
    }
    if low == SHAPE_BALL && high == SHAPE_HALFSPACE {
        return PAIR_BALL_HALFSPACE;
    }
    if low == SHAPE_CUBOID && high == SHAPE_HALFSPACE {
        return PAIR_CUBOID_HALFSPACE;
    }
    return PAIR_NONE;
}

fn newborn(a: u32, b: u32) -> bool {
    return colliders[a].born == step.step || colliders[b].born == step.step;
}

fn precedes(a: u32, b: u32, than_a: u32, than_b: u32) -> bool {
    return a < than_a || (a == than_a && b < than_b);
}

// Whether this step found the pair (a, b).
fn is_found(a: u32, b: u32) -> bool {
    var low = 0u;
    var high = control.pair_count;
    while low < high {
        let middle = low + (high - low) / 2u;
        if precedes(pair_keys[2u * middle], pair_keys[2u * middle + 1u], a, b) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low < control.pair_count && pair_keys[2u * low] == a && pair_keys[2u * low + 1u] == b;
}

// Slot that the pair (a, b) had in the last step, NO_SLOT if it was not there.
fn old_slot(a: u32, b: u32) -> u32 {
    var low = 0u;
    var high = control.old_pair_count;
    while low < high {
        let middle = low + (high - low) / 2u;
        if precedes(pairs[middle].a, pairs[middle].b, a, b) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if low < control.old_pair_count && pairs[low].a == a && pairs[low].b == b {
        return pairs[low].slot;
    }
    return NO_SLOT;
}

// Whether joints keep two bodies from colliding.
fn are_apart(a: u32, b: u32) -> bool {
    let count = apart[0].x;
    let low_body = min(a, b);
    let high_body = max(a, b);
    var low = 0u;
    var high = count;
    // 26 turns at most: there are no more joints.
    for (var turn = 0u; turn < 27u && low < high; turn++) {
        let middle = low + (high - low) / 2u;
        let pair = apart[1u + middle];
        if precedes(pair.x, pair.y, low_body, high_body) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low < count && all(apart[1u + low] == vec2<u32>(low_body, high_body));
}

@compute @workgroup_size(256)
fn find_old(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= control.old_pair_count {
        return;
    }
    let a = pairs[i].a;
    let b = pairs[i].b;
    let dead = control.stop == 0u && (newborn(a, b) || !is_found(a, b));
    dead_rank[i] = select(0u, 1u, dead);
}

@compute @workgroup_size(256)
fn find_new(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= control.pair_count {
        return;
    }
    let a = pair_keys[2u * i];
    let b = pair_keys[2u * i + 1u];
    var kind = kind_of(colliders[a].shape, colliders[b].shape);
    if apart[0].x != 0u && are_apart(colliders[a].body, colliders[b].body) {
        kind = PAIR_NONE;
    }
    var slot = NO_SLOT;
    if !newborn(a, b) {
        slot = old_slot(a, b);
    }
    let fresh = slot == NO_SLOT;
    next_pairs[i] = Pair(a, b, slot, kind | select(0u, PAIR_FRESH, fresh));
    fresh_rank[i] = select(0u, 1u, fresh);
}

@compute @workgroup_size(256)
fn list_dead(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= control.old_pair_count {
        return;
    }
    let rank = dead_rank[i];
    var next = control.dead_count;
    if i + 1u < control.old_pair_count {
        next = dead_rank[i + 1u];
    }
    if next > rank {
        dead_slots[rank] = pairs[i].slot;
    }
}

@compute @workgroup_size(256)
fn assign(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= atomicLoad(&counters[CONTROL_PAIR_COUNT]) {
        return;
    }
    let kind = next_pairs[i].kind;
    if (kind & PAIR_FRESH) != 0u {
        let rank = fresh_rank[i];
        let dead_count = atomicLoad(&counters[CONTROL_DEAD_COUNT]);
        if rank < dead_count {
            next_pairs[i].slot = dead_slots[rank];
        } else {
            next_pairs[i].slot = free_slots[atomicLoad(&counters[CONTROL_FREE_COUNT]) - 1u - (rank - dead_count)];
        }
    }
    manifolds[i] = Manifold();
    if (kind & PAIR_MASK) == PAIR_NONE && i != step.drop_pair {
        atomicAdd(&counters[CONTROL_PROCESSED], 1u);
    }
}

@compute @workgroup_size(256)
fn commit_pairs(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= control.pair_count || control.stop != 0u {
        return;
    }
    pairs[i] = next_pairs[i];
    if (next_pairs[i].kind & PAIR_ASLEEP) != 0u {
        return;
    }
    commit_pair(manifolds[i].count, pair_batch[i], next_pairs[i].slot);
}

// What the store remembers of a pair: its batch, and no impulses when it does not touch.
fn commit_pair(point_count: u32, batch: u32, slot: u32) {
    if point_count == 0u {
        batch_of_slot[slot] = UNBATCHED;
        for (var k = 0u; k < 4u; k++) {
            slot_impulses[4u * slot + k] = Impulse(0.0, array<f32, 2>(0.0, 0.0), NO_FEATURE);
        }
    } else {
        batch_of_slot[slot] = batch;
    }
}

@compute @workgroup_size(256)
fn commit_found(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= control.pair_count || control.stop != 0u {
        return;
    }
    if manifolds[i].recycled == 0u && (next_pairs[i].kind & PAIR_ASLEEP) == 0u {
        let pair = next_pairs[i];
        let rotation_a = work_states[colliders[pair.a].body].rotation;
        let rotation_b = work_states[colliders[pair.b].body].rotation;
        found_manifolds[pair.slot] = FoundManifold(rotation_a, rotation_b, manifolds[i]);
    }
}

// The free list after the step: slots of dead pairs that no new pair took are pushed, others were popped.
@compute @workgroup_size(256)
fn commit_free(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let rank = invocation(wg, num, lid);
    if rank >= control.dead_count || rank < control.new_count || control.stop != 0u {
        return;
    }
    free_slots[control.free_count + (rank - control.new_count)] = dead_slots[rank];
}

@compute @workgroup_size(256)
fn commit_counts(@builtin(local_invocation_index) lid: u32) {
    if local_index(lid) != 0u || atomicLoad(&counters[CONTROL_STOP]) != 0u {
        return;
    }
    let dead = atomicLoad(&counters[CONTROL_DEAD_COUNT]);
    let fresh = atomicLoad(&counters[CONTROL_NEW_COUNT]);
    atomicAdd(&counters[CONTROL_FREE_COUNT], dead - fresh);
    atomicStore(&counters[CONTROL_OLD_PAIR_COUNT], atomicLoad(&counters[CONTROL_PAIR_COUNT]));
    atomicStore(&counters[CONTROL_STEP], step.step);
    atomicStore(&counters[CONTROL_COLORED_AS], atomicLoad(&counters[NEXT_COLORED_AS]));
    atomicStore(&counters[CONTROL_FROZEN_COUNT], atomicLoad(&counters[NEXT_FROZEN_COUNT]));
}
