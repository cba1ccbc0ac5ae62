// Stage `island`: which moving bodies hang together by contacts and joints. Twin of crates/cpu/src/island.rs.
//
// An island is a connected component of bodies that move over contacts with points and over joints, broken or not; its
// label is the lowest slot of its bodies. Union-find with an atomic minimum for a hook, after Playne and Hawick, "A New Algorithm for Parallel
// Connected-Component Labelling on GPUs" (IEEE TPDS, 2018): each of these hangs the higher of its two roots under the
// lower, and one that comes too late goes on with what it finds there. No invocation waits for another, labels only
// fall, and where all hooks are made they are minima, whatever the order.
//
//   begin        one thread a body: its own label, NO_ISLAND if it does not move. Reads work_states; writes islands
//   hook         one thread a pair: joins the islands of its bodies. Reads next_pairs, manifolds, aabbs; writes islands
//   hook_joined  one thread a pair of bodies with joints between them: the same. Reads joined, work_states; writes islands
//   flatten      one thread a body: goes down to the root, so far as its turns allow. Writes islands
//   count        the same again, all the way; counts islands in counters
//
// Turns are bounded. Where they do not suffice, which no graph has been seen to do, ISLANDS_OPEN is raised in counters,
// and labels are worth nothing in this step.

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/control.wgsl
//#import shared/manifold.wgsl
//#import shared/pair.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

const NO_ISLAND: u32 = 0xffffffffu;
const HOOK_TURNS: u32 = 20000u;
const FLATTEN_TURNS: u32 = 4096u;

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> work_states: array<BodyState>;
@group(0) @binding(3) var<storage, read> next_pairs: array<Pair>;
@group(0) @binding(4) var<storage, read> manifolds: array<Manifold>;
@group(0) @binding(5) var<storage, read> aabbs: array<Aabb>;
@group(0) @binding(6) var<storage, read_write> islands: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read> joined: array<vec2<u32>>; // their number, then pairs of bodies

var<workgroup> roots: atomic<u32>;

@compute @workgroup_size(256)
fn begin(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count {
        atomicStore(&islands[i], select(NO_ISLAND, i, moves(work_states[i].flags)));
    }
}

@compute @workgroup_size(256)
fn hook(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= atomicLoad(&counters[CONTROL_PAIR_COUNT]) || i >= step.pair_capacity || manifolds[i].count == 0u {
        return;
    }
    let body_a = aabbs[next_pairs[i].a].body;
    let body_b = aabbs[next_pairs[i].b].body;
    if (body_a & body_b & AABB_DYNAMIC) != 0u {
        join(body_a & AABB_INDEX, body_b & AABB_INDEX);
    }
}

@compute @workgroup_size(256)
fn hook_joined(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= joined[0].x {
        return;
    }
    let pair = joined[1u + i];
    if moves(work_states[pair.x].flags) && moves(work_states[pair.y].flags) {
        join(pair.x, pair.y);
    }
}

// Makes the islands of two bodies that move one.
fn join(body_a: u32, body_b: u32) {
    var a = body_a;
    var b = body_b;
    // One loop, since some drivers count the turns of an inner one again and again.
    for (var turn = 0u; turn < HOOK_TURNS; turn++) {
        let below_a = atomicLoad(&islands[a]);
        let below_b = atomicLoad(&islands[b]);
        if below_a != a || below_b != b {
            // Down two steps at a time, and the way is half as long for those who follow.
            a = descend(a, below_a);
            b = descend(b, below_b);
            continue;
        }
        if a == b {
            return;
        }
        let low = min(a, b);
        let high = max(a, b);
        let found = atomicMin(&islands[high], low);
        if found == high {
            return;
        }
        // Somebody hung it under another meanwhile: that one and the lower still have to meet.
        a = found;
        b = low;
    }
    atomicStore(&counters[CONTROL_ISLANDS_OPEN], 1u);
}

// From a body below which `below` lies, as far as is known without looking further than one more step.
fn descend(body: u32, below: u32) -> u32 {
    if below == body {
        return body;
    }
    let next = atomicLoad(&islands[below]);
    if next != below {
        atomicMin(&islands[body], next);
    }
    return next;
}

// The label of body i, and whether it is the last word.
fn lowest(i: u32) -> vec2<u32> {
    var at = i;
    for (var turn = 0u; turn < FLATTEN_TURNS; turn++) {
        let below = atomicLoad(&islands[at]);
        if below == at || below == NO_ISLAND {
            return vec2<u32>(below, 1u);
        }
        at = below;
    }
    return vec2<u32>(at, 0u);
}

@compute @workgroup_size(256)
fn flatten(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count {
        atomicMin(&islands[i], lowest(i).x);
    }
}

@compute @workgroup_size(256)
fn count(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count {
        let found = lowest(i);
        atomicMin(&islands[i], found.x);
        if found.x == i {
            atomicAdd(&roots, 1u);
        }
        if found.y == 0u {
            atomicStore(&counters[CONTROL_ISLANDS_OPEN], 1u);
        }
    }
    workgroupBarrier();
    if lid == 0u {
        atomicAdd(&counters[CONTROL_ISLANDS], atomicLoad(&roots));
    }
}
