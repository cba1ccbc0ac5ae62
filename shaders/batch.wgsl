// Stage `batch`: colours the graph of constraints, so that no two constraints of a batch share a moving body.
// Twin of crates/cpu/src/batch.rs.
//
// Harada, "Parallelizing the Physics Pipeline" (GDC 2009): each constraint without a batch writes itself to its
// bodies; one that reads itself on both keeps the batch. There the last writer wins; here the lowest hashed index does
// (an atomic minimum), so that the result depends on the constraints alone. By write-and-verify, the talk's own law, a
// winner joins the batch that is being filled, a few rounds a batch; else it takes the lowest batch that neither body
// is in, and every round places at least one. Persistent constraints keep their batch while they touch; fixed,
// kinematic and frozen bodies never conflict. What the rounds leave goes to the last batch, solved in sequence.
// Contacts with what does not move can be had last: they then take the highest free batch instead of the lowest.
//
//   begin      one thread a pair: keeps its batch, or puts the pair on the list `unplaced`. Reads next_pairs,
//              manifolds, batch_of_slot; writes pair_batch, masks
//   bid        one thread an entry of the list: claims its bodies; one that finds no batch free joins the last one.
//              Reads next_pairs; writes claims, pair_batch, masks
//   place      the same: who holds both bodies takes the batch. The host runs 8 rounds of these two, or 60 to write and
//              verify. Reads next_pairs, claims; writes pair_batch, masks
//   unclaim    one thread a body: clears claims, for write-and-verify, whose rounds are too many for their bits
//   compact    the same: who still waits goes on a shorter list (in `batch_order`, which is not yet in use)
//   tail       one workgroup, one thread each 256th entry of that list: bids and places in more rounds
//   finish     one thread a pair: who still waits joins the last batch; batch_keys and batch_order, to be sorted
//   degree     one thread a body: how many batches it is in, from masks
//   (primitives/sort of batch_keys with batch_order)
//   table      one thread a batch: its first constraint, from batch_keys; those that nobody is in come behind the others
//   gate       one workgroup: what the step reports, whether it may go on, and dispatch_args for the solver
//
// All count in `counters`. What the rounds do to the graph is in shared/graph.wgsl.

//#import shared/control.wgsl
//#import shared/graph.wgsl
//#import shared/manifold.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

const PENDING: u32 = 254u; // in place of a batch: wants one
const WIDE_ROUNDS: u32 = 8u; // rounds over all entries at once, but for write-and-verify; crates/core/src/limits.rs
const BATCH_ROUNDS: u32 = 62u; // and most rounds in all
const COUNTER_NEXT_COLORED_AS: u32 = 31u; // scratch words of the counters
const COUNTER_LEFT: u32 = 109u;

// Elements of `dispatch_args`. Those below are the batches that have a dispatch of their own.
const ARGS_TAIL: u32 = 63u; // the other batches
const ARGS_CONSTRAINTS: u32 = 64u;
const ARGS_PAIRS: u32 = 65u;
const ARGS_DEAD: u32 = 66u;
const ARGS: u32 = 67u;
const SOLVER_WORKGROUP: u32 = 64u;
const MOST_PER_DIMENSION: u32 = 65535u;

struct Round {
    index: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

@group(0) @binding(5) var<uniform> step: StepParams;
@group(0) @binding(6) var<uniform> round: Round;
@group(0) @binding(7) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(8) var<storage, read> manifolds: array<Manifold>;
@group(0) @binding(9) var<storage, read> batch_of_slot: array<u32>;
@group(0) @binding(10) var<storage, read_write> unplaced: array<u32>;
@group(0) @binding(11) var<storage, read_write> batch_keys: array<u32>;
@group(0) @binding(12) var<storage, read_write> batch_order: array<u32>;
@group(0) @binding(13) var<storage, read_write> dispatch_args: array<vec4<u32>>;

var<workgroup> appended: atomic<u32>;
var<workgroup> append_first: u32;
var<workgroup> entries_left: u32;
var<workgroup> still_pending: atomic<u32>;
var<workgroup> any_pending: u32;
var<workgroup> highest_degree: atomic<u32>;
var<workgroup> firsts: array<u32, 65>; // of each batch, and the end

// Where on a list whose length is in `counters[word]` this invocation's element goes, if it `wants` one. The order is
// the atomics', and nothing depends on it. To be called by all invocations of a workgroup, once in a dispatch.
fn append(wants: bool, word: u32, lid: u32) -> u32 {
    var rank = 0u;
    if wants {
        rank = atomicAdd(&appended, 1u);
    }
    workgroupBarrier();
    if lid == 0u {
        let here = atomicLoad(&appended);
        if here != 0u {
            append_first = atomicAdd(&counters[word], here);
        }
    }
    return workgroupUniformLoad(&append_first) + rank;
}

@compute @workgroup_size(256)
fn begin(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    var batch = UNBATCHED;
    if i < atomicLoad(&counters[CONTROL_PAIR_COUNT]) {
        if manifolds[i].count > 0u {
            batch = PENDING;
            let pair = next_pairs[i];
            if (pair.kind & PAIR_FRESH) == 0u && atomicLoad(&counters[CONTROL_COLORED_AS]) == step.batching {
                let kept = batch_of_slot[pair.slot];
                if kept < LAST_BATCH {
                    batch = kept;
                    join(ends(i), kept);
                }
            }
        }
        pair_batch[i] = batch;
    }
    let at = append(batch == PENDING, CONTROL_UNPLACED, lid);
    if batch == PENDING {
        unplaced[at] = i;
    }
}

@compute @workgroup_size(256)
fn bid(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let k = invocation(wg, num, lid);
    if k >= atomicLoad(&counters[CONTROL_UNPLACED]) || round.index >= step.batch_rounds {
        return;
    }
    let pair = unplaced[k];
    if pair_batch[pair] != PENDING {
        return;
    }
    // A round counts when something waits. The load spares most of them the atomic that all would meet at.
    if atomicLoad(&counters[CONTROL_ROUNDS]) <= round.index {
        atomicMax(&counters[CONTROL_ROUNDS], round.index + 1u);
    }
    bid_for(pair, round.index, step.batching);
}

@compute @workgroup_size(256)
fn place(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let k = invocation(wg, num, lid);
    if k >= atomicLoad(&counters[CONTROL_UNPLACED]) || round.index >= step.batch_rounds {
        return;
    }
    let pair = unplaced[k];
    if pair_batch[pair] == PENDING {
        place_if_held(pair, round.index, step.batching);
    }
}

@compute @workgroup_size(256)
fn unclaim(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count {
        atomicStore(&claims[i], 0xffffffffu);
    }
}

@compute @workgroup_size(256)
fn compact(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let k = invocation(wg, num, lid);
    var pair = 0u;
    var waits = false;
    if k < atomicLoad(&counters[CONTROL_UNPLACED]) {
        pair = unplaced[k];
        waits = pair_batch[pair] == PENDING;
    }
    let at = append(waits, COUNTER_LEFT, lid);
    if waits {
        batch_order[at] = pair;
    }
}

fn wide_rounds() -> u32 {
    return select(WIDE_ROUNDS, VERIFY_ROUNDS, verifies(step.batching));
}

// How many rounds one workgroup may add: loops of no more than 2 x 24,000 turns and a few.
fn tail_rounds(left: u32) -> u32 {
    if step.batch_rounds <= wide_rounds() {
        return 0u;
    }
    let most = select(BATCH_ROUNDS - WIDE_ROUNDS, VERIFY_ROUNDS, verifies(step.batching));
    return min(most, 24000u / max((left + WORKGROUP - 1u) / WORKGROUP, 1u));
}

@compute @workgroup_size(256)
fn tail(@builtin(local_invocation_index) lid: u32) {
    let local = local_index(lid);
    if local == 0u {
        entries_left = atomicLoad(&counters[COUNTER_LEFT]);
    }
    let left = workgroupUniformLoad(&entries_left);
    if left == 0u {
        return;
    }
    let end = wide_rounds() + tail_rounds(left);
    for (var index = wide_rounds(); index < end; index++) {
        if local == 0u {
            atomicMax(&counters[CONTROL_ROUNDS], index + 1u);
        }
        for (var k = local; k < left; k += WORKGROUP) {
            let pair = batch_order[k];
            if pair_batch[pair] == PENDING {
                bid_for(pair, index, step.batching);
            }
        }
        storageBarrier();
        for (var k = local; k < left; k += WORKGROUP) {
            let pair = batch_order[k];
            if pair_batch[pair] == PENDING && !place_if_held(pair, index, step.batching) {
                atomicOr(&still_pending, 1u);
            }
        }
        storageBarrier();
        workgroupBarrier();
        if local == 0u {
            any_pending = atomicExchange(&still_pending, 0u);
        }
        if workgroupUniformLoad(&any_pending) == 0u {
            return;
        }
    }
}

// What constraints are sorted by: those of one batch by their points, so that those solved side by side have as many; but
// the last batch, which is solved in sequence, not.
fn sort_key(batch: u32, points: u32) -> u32 {
    if batch == UNBATCHED {
        return UNBATCHED;
    }
    return 4u * batch + select(4u - min(points, 4u), 0u, batch == LAST_BATCH);
}

@compute @workgroup_size(256)
fn finish(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= atomicLoad(&counters[CONTROL_PAIR_COUNT]) {
        return;
    }
    var batch = pair_batch[i];
    if batch == PENDING {
        batch = LAST_BATCH;
        pair_batch[i] = LAST_BATCH;
        join(ends(i), LAST_BATCH);
    }
    batch_keys[i] = sort_key(batch, manifolds[i].count);
    batch_order[i] = i;
}

@compute @workgroup_size(256)
fn degree(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count {
        let bits = countOneBits(atomicLoad(&masks[2u * i])) + countOneBits(atomicLoad(&masks[2u * i + 1u]));
        if bits != 0u {
            atomicMax(&highest_degree, bits);
        }
    }
    workgroupBarrier();
    if lid == 0u {
        let bits = atomicLoad(&highest_degree);
        if bits != 0u {
            atomicMax(&counters[CONTROL_MAX_DEGREE], bits);
        }
    }
}

// The first of the sorted keys that is no lower than the batch's; UNBATCHED, which is above all, ends the last batch.
fn first_of(batch: u32) -> u32 {
    var low = 0u;
    var high = atomicLoad(&counters[CONTROL_PAIR_COUNT]);
    let lowest = min(4u * batch, UNBATCHED);
    for (var turn = 0u; turn < 32u && low < high; turn++) {
        let middle = low + (high - low) / 2u;
        if batch_keys[middle] < lowest {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

@compute @workgroup_size(256)
fn table(@builtin(local_invocation_index) lid: u32) {
    let batch = local_index(lid);
    if batch <= BATCHES {
        firsts[batch] = first_of(batch);
    }
    workgroupBarrier();
    if batch > BATCHES {
        return;
    }
    var place = batch;
    var first = firsts[batch];
    if batch < LAST_BATCH {
        var below = 0u;
        var used = 0u;
        for (var other = 0u; other < LAST_BATCH; other++) {
            if firsts[other] < firsts[other + 1u] {
                used++;
                below += select(0u, 1u, other < batch);
            }
        }
        place = below;
        if first == firsts[batch + 1u] {
            place = used + batch - below;
            first = firsts[LAST_BATCH];
        }
    }
    atomicStore(&counters[CONTROL_BATCH_START + place], first);
}

fn start_of(batch: u32) -> u32 {
    return atomicLoad(&counters[CONTROL_BATCH_START + batch]);
}

// Workgroups of `each` for `count` elements, over two dimensions when one is too small.
fn groups_for(count: u32, each: u32) -> vec4<u32> {
    let groups = count / each + select(0u, 1u, count % each != 0u);
    let y = max(groups / MOST_PER_DIMENSION + select(0u, 1u, groups % MOST_PER_DIMENSION != 0u), 1u);
    return vec4<u32>(groups / y + select(0u, 1u, groups % y != 0u), y, 1u, 0u);
}

fn args_for(element: u32) -> vec4<u32> {
    switch element {
        case ARGS_TAIL: {
            return groups_for(select(0u, 1u, start_of(BATCHES) > start_of(min(step.wide_batches, LAST_BATCH))), 1u);
        }
        case ARGS_CONSTRAINTS: {
            return groups_for(start_of(BATCHES), WORKGROUP);
        }
        case ARGS_PAIRS: {
            return groups_for(atomicLoad(&counters[CONTROL_PAIR_COUNT]), WORKGROUP);
        }
        case ARGS_DEAD: {
            let dead = atomicLoad(&counters[CONTROL_DEAD_COUNT]);
            return groups_for(max(dead, atomicLoad(&counters[CONTROL_NEW_COUNT])), WORKGROUP);
        }
        default: {
            return groups_for(start_of(element + 1u) - start_of(element), SOLVER_WORKGROUP);
        }
    }
}

// Whether bodies lost so many constraints that batches stand half empty: the next step colours anew.
fn wasteful(batch_count: u32, max_degree: u32) -> bool {
    return batch_count > select(2u, 3u, (step.batching & BATCHING_STATIC_LAST) != 0u) * max_degree;
}

@compute @workgroup_size(256)
fn gate(@builtin(local_invocation_index) lid: u32) {
    let last_count = start_of(BATCHES) - start_of(LAST_BATCH);
    let too_many = last_count > step.last_limit;
    // Whether or not invocation 0 has raised STOP by now, all come to the same answer.
    let stopped = atomicLoad(&counters[CONTROL_STOP]) != 0u || too_many;
    if lid < ARGS {
        var args = vec4<u32>(0u);
        if !stopped {
            args = args_for(lid);
        }
        dispatch_args[lid] = args;
    }
    if lid != 0u {
        return;
    }
    var batch_count = 0u;
    for (var batch = 0u; batch < LAST_BATCH; batch++) {
        if start_of(batch + 1u) > start_of(batch) {
            batch_count = batch + 1u;
        }
    }
    let kept = (step.batching & BATCHING_LAW) == BATCHING_PERSISTENT
        && !wasteful(batch_count, atomicLoad(&counters[CONTROL_MAX_DEGREE]));
    atomicStore(&counters[CONTROL_BATCH_COUNT], batch_count);
    atomicStore(&counters[CONTROL_LAST_COUNT], last_count);
    atomicStore(&counters[CONTROL_SOLVED], start_of(BATCHES));
    atomicStore(&counters[CONTROL_UNPLACED], 0u);
    atomicStore(&counters[COUNTER_NEXT_COLORED_AS], select(0u, step.batching, kept));
    if too_many && atomicLoad(&counters[CONTROL_STOP]) == 0u {
        atomicStore(&counters[CONTROL_STOP], 1u);
        atomicStore(&counters[CONTROL_OVERFLOW], OVERFLOW_LAST_BATCH);
        atomicStore(&counters[CONTROL_NEEDED], last_count);
    }
}
