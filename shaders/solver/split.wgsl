// The sweeps over the last batch by mass splitting. Twin of crates/cpu/src/solver/split.rs, which tells what for.
//
//   ..._split  one workgroup, one thread each 256th constraint: visits it on parts of its bodies, and writes what it did to
//              them to `part_changes`; then one thread a body adds up what its parts changed, and writes the mean
//
// Reads `part_bodies` and `part_ends` of `solver/parts`: the ends of the last batch's constraints, body by body. What
// a body's parts changed is added up in order, 64 at a time and then those sums, so that no sum hangs on who comes first.
//
// Loops, for 32,768 constraints: 9 turns for each 256 of them; 256 and 64 for each of these; 256, and 1,024 in all.

//#import solver/iterate.wgsl
//#import solver/visit.wgsl

const NO_BODY: u32 = 0xffffffffu;
const CHUNK: u32 = 64u;

// What a constraint changed of a part; or several, of several.
struct Change {
    linear: vec3<f32>,
    weight: f32,
    angular: vec3<f32>,
    weighted: f32,
    linear_start: vec3<f32>,
    pad_a: u32,
    angular_start: vec3<f32>,
    pad_b: u32,
}

@group(0) @binding(7) var<storage, read> part_bodies: array<u32>;
@group(0) @binding(8) var<storage, read> part_ends: array<u32>;
@group(0) @binding(9) var<storage, read_write> part_changes: array<Change>;

fn change_of(before: ptr<function, SolverBody>, after: ptr<function, SolverBody>) -> Change {
    return Change(
        (*after).linear_velocity - (*before).linear_velocity,
        (*after).weight,
        (*after).angular_velocity - (*before).angular_velocity,
        (*after).weighted,
        (*after).linear_start - (*before).linear_start,
        0u,
        (*after).angular_start - (*before).angular_start,
        0u,
    );
}

fn add(sum: ptr<function, Change>, more: Change) {
    (*sum).linear += more.linear;
    (*sum).weight += more.weight;
    (*sum).angular += more.angular;
    (*sum).weighted += more.weighted;
    (*sum).linear_start += more.linear_start;
    (*sum).angular_start += more.angular_start;
}

// A visit to constraint c, number j of the last batch.
fn visit_parts(kind: u32, c: u32, j: u32) {
    let head = heads[c];
    var before_a = last_part(solver_bodies[head.body_a]);
    var before_b = last_part(solver_bodies[head.body_b]);
    var a = before_a;
    var b = before_b;
    if kind == LOAD {
        load_points(c, head, &a, &b);
    } else if kind == PASS {
        pass_points(c, head, &a, &b);
    } else if kind >= GAUSS_SEIDEL {
        iterate_points(kind, c, head, &before_a, &before_b, &a, &b);
    } else {
        visit_points(kind, c, head, &a, &b);
    }
    part_changes[2u * j] = change_of(&before_a, &a);
    part_changes[2u * j + 1u] = change_of(&before_b, &b);
}

// Whether entry e is the first of its body.
fn begins(e: u32) -> bool {
    return e == 0u || part_bodies[e - 1u] != part_bodies[e];
}

// Whether this sweep is for the constraint of entry e, and so for all of its body's.
fn is_swept(e: u32) -> bool {
    return part_bodies[e] != NO_BODY && is_of_level(start_of(LAST_BATCH) + part_ends[e] / 2u);
}

// What entries from e on changed of one body, to the end of their chunk.
fn add_chunk(e: u32, count: u32) {
    let body = part_bodies[e];
    let end = min(e - e % CHUNK + CHUNK, count);
    var sum = part_changes[part_ends[e]];
    var next = e + 1u;
    while next < end && part_bodies[next] == body {
        add(&sum, part_changes[part_ends[next]]);
        next++;
    }
    part_changes[part_ends[e]] = sum;
}

// Gives the body of entry e, its first, the mean of its parts.
fn join(kind: u32, e: u32, count: u32) {
    let body = part_bodies[e];
    var sum = part_changes[part_ends[e]];
    var next = e - e % CHUNK + CHUNK;
    while next < count && part_bodies[next] == body {
        add(&sum, part_changes[part_ends[next]]);
        next += CHUNK;
    }
    let parts = f32(solver_bodies[body].parts);
    solver_bodies[body].linear_velocity += sum.linear / parts;
    solver_bodies[body].angular_velocity += sum.angular / parts;
    if kind == LOAD {
        solver_bodies[body].weight += sum.weight;
        solver_bodies[body].weighted += sum.weighted;
    }
    if kind == PASS {
        solver_bodies[body].linear_start += sum.linear_start / parts;
        solver_bodies[body].angular_start += sum.angular_start / parts;
    }
}

// The last batch. What its constraints wrote, the barriers show to those who add: they share a workgroup.
fn split_last(kind: u32, lid: u32) {
    if control.stop != 0u {
        return;
    }
    let local = local_index(lid);
    let first = start_of(LAST_BATCH);
    let count = start_of(BATCHES) - first;
    for (var j = local; j < count; j += WORKGROUP) {
        if is_of_level(first + j) {
            visit_parts(kind, first + j, j);
        }
    }
    storageBarrier();
    for (var e = local; e < 2u * count; e += WORKGROUP) {
        if (e % CHUNK == 0u || begins(e)) && is_swept(e) {
            add_chunk(e, 2u * count);
        }
    }
    storageBarrier();
    for (var e = local; e < 2u * count; e += WORKGROUP) {
        if begins(e) && is_swept(e) {
            join(kind, e, 2u * count);
        }
    }
}

@compute @workgroup_size(256)
fn warm_start_split(@builtin(local_invocation_index) lid: u32) {
    split_last(WARM_START, lid);
}

@compute @workgroup_size(256)
fn solve_split(@builtin(local_invocation_index) lid: u32) {
    split_last(SOLVE, lid);
}

@compute @workgroup_size(256)
fn relax_split(@builtin(local_invocation_index) lid: u32) {
    split_last(RELAX, lid);
}

@compute @workgroup_size(256)
fn load_split(@builtin(local_invocation_index) lid: u32) {
    split_last(LOAD, lid);
}

@compute @workgroup_size(256)
fn one_pass_split(@builtin(local_invocation_index) lid: u32) {
    split_last(PASS, lid);
}

@compute @workgroup_size(256)
fn gauss_seidel_split(@builtin(local_invocation_index) lid: u32) {
    split_last(GAUSS_SEIDEL, lid);
}

@compute @workgroup_size(256)
fn last_gauss_seidel_split(@builtin(local_invocation_index) lid: u32) {
    split_last(LAST_GAUSS_SEIDEL, lid);
}

@compute @workgroup_size(256)
fn restitution_split(@builtin(local_invocation_index) lid: u32) {
    split_last(RESTITUTION, lid);
}
