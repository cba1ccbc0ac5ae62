// How bodies are split in the last batch, once a step; what for is told by crates/cpu/src/solver/split.rs.
//
//   list       one thread a constraint of the last batch: an entry in `part_bodies` and `part_ends` for each of its two
//              ends, the body (above all where it does not move) and twice the constraint's number plus the side; their
//              count in `part_count`. Both are then sorted by body
//   count      one thread an entry: `parts` in `solver_bodies`, the number of each body's entries
//
// Reads `batch_order`, `next_pairs` and `colliders`, since `heads` are made later, of what is counted here.

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/control.wgsl
//#import shared/pair.wgsl
//#import shared/thread.wgsl

const NO_BODY: u32 = 0xffffffffu;

@group(0) @binding(0) var<uniform> control: Control;
@group(0) @binding(1) var<storage, read> batch_order: array<u32>;
@group(0) @binding(2) var<storage, read> next_pairs: array<Pair>;
@group(0) @binding(3) var<storage, read> colliders: array<Collider>;
@group(0) @binding(4) var<storage, read_write> solver_bodies: array<SolverBody>;
@group(0) @binding(5) var<storage, read_write> part_bodies: array<u32>;
@group(0) @binding(6) var<storage, read_write> part_ends: array<u32>;
@group(0) @binding(7) var<storage, read_write> part_count: array<u32>;

// First constraint of the last batch, and how many it has.
fn last_batch() -> vec2<u32> {
    let first = control.batch_start[LAST_BATCH / 4u][LAST_BATCH % 4u];
    let end = control.batch_start[BATCHES / 4u][BATCHES % 4u];
    return vec2<u32>(first, select(end - first, 0u, control.stop != 0u));
}

fn body_of(collider: u32) -> u32 {
    let body = colliders[collider].body;
    return select(NO_BODY, body, solver_bodies[body].inverse_mass > 0.0);
}

@compute @workgroup_size(256)
fn list(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let j = invocation(wg, num, lid);
    let last = last_batch();
    if j == 0u {
        part_count[0] = 2u * last.y;
    }
    if j >= last.y {
        return;
    }
    let pair = next_pairs[batch_order[last.x + j]];
    part_bodies[2u * j] = body_of(pair.a);
    part_bodies[2u * j + 1u] = body_of(pair.b);
    part_ends[2u * j] = 2u * j;
    part_ends[2u * j + 1u] = 2u * j + 1u;
}

@compute @workgroup_size(256)
fn count(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let e = invocation(wg, num, lid);
    let entries = 2u * last_batch().y;
    if e >= entries {
        return;
    }
    let body = part_bodies[e];
    if body == NO_BODY || (e > 0u && part_bodies[e - 1u] == body) {
        return;
    }
    // The first entry of another body.
    var low = e + 1u;
    var high = entries;
    for (var turn = 0u; turn < 32u && low < high; turn++) {
        let middle = low + (high - low) / 2u;
        if part_bodies[middle] == body {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    solver_bodies[body].parts = low - e;
}
