// The sweeps over constraints, batch by batch; the law of a visit is in `solver/soft`.
// Twin of crates/cpu/src/solver/mod.rs (`PlainRows::sweep`).
//
// Reads `heads`; reads and writes `points`, `impulses` and the velocities in `solver_bodies`. Constraints of one batch
// share no moving body, so each has a thread of its own:
//
//   warm_start, solve, relax, restitution   one batch a dispatch (`batch`), one thread a constraint
//   ..._tail   one workgroup: the batches from `step.wide_batches` on, one after the other, one thread each 256th
//              constraint; the last batch, whose constraints do share bodies, in order: each thread in turn visits 128
//
// Harada, "Parallelizing the Physics Pipeline" (GDC 2009). Loops take at most 9 turns for each 256 constraints of the
// tail, and 11 for each 8 of the last batch.

//#import shared/control.wgsl
//#import shared/thread.wgsl
//#import solver/soft.wgsl

struct BatchIndex {
    index: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

@group(0) @binding(0) var<uniform> control: Control;
@group(0) @binding(1) var<uniform> step: StepParams;
@group(0) @binding(2) var<uniform> batch: BatchIndex;
@group(0) @binding(3) var<storage, read> heads: array<ConstraintHead>;
@group(0) @binding(4) var<storage, read_write> points: array<ConstraintPoint>;
@group(0) @binding(5) var<storage, read_write> impulses: array<Impulse>;
@group(0) @binding(6) var<storage, read_write> solver_bodies: array<SolverBody>;

const SOLVER_WORKGROUP: u32 = 64u;
const TURN: u32 = 128u; // constraints of the last batch that one thread visits in a row

fn start_of(index: u32) -> u32 {
    return control.batch_start[index / 4u][index % 4u];
}


fn one(kind: u32, head: ConstraintHead, t: mat2x3<f32>, point: ptr<function, ConstraintPoint>, impulse: ptr<function, Impulse>, a: ptr<function, SolverBody>, b: ptr<function, SolverBody>) {
        if kind == WARM_START {
            warm_start_point(head.normal, t, point, impulse, a, b);
        } else if kind == RESTITUTION {
            bounce(head.restitution, head.normal, point, impulse, a, b, step);
        } else {
            push_normal(kind, head, point, impulse, a, b, step);
        }
}
fn write(kind: u32, p: u32, point: ptr<function, ConstraintPoint>, impulse: ptr<function, Impulse>) {
        if kind == WARM_START {
        } else if kind == RESTITUTION {
            impulses[p].normal = (*impulse).normal;
        } else {
            impulses[p] = *impulse;
            points[p].max_impulse = (*point).max_impulse;
            if kind == RELAX {
                points[p].approach = (*point).approach;
            }
        }
}
fn visit(kind: u32, c: u32) {
    let head = heads[c];
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    let t = tangents(head.normal);
    let first = 4u * c;
    var p0: ConstraintPoint;
    var i0: Impulse;
    if head.count > 0u {
        p0 = points[first + 0u];
        i0 = impulses[first + 0u];
        one(kind, head, t, &p0, &i0, &a, &b);
    }
    var p1: ConstraintPoint;
    var i1: Impulse;
    if head.count > 1u {
        p1 = points[first + 1u];
        i1 = impulses[first + 1u];
        one(kind, head, t, &p1, &i1, &a, &b);
    }
    var p2: ConstraintPoint;
    var i2: Impulse;
    if head.count > 2u {
        p2 = points[first + 2u];
        i2 = impulses[first + 2u];
        one(kind, head, t, &p2, &i2, &a, &b);
    }
    var p3: ConstraintPoint;
    var i3: Impulse;
    if head.count > 3u {
        p3 = points[first + 3u];
        i3 = impulses[first + 3u];
        one(kind, head, t, &p3, &i3, &a, &b);
    }
    if kind == SOLVE || kind == RELAX {
        if head.count > 0u { push_tangent(head.friction, t, &p0, &i0, &a, &b); }
        if head.count > 1u { push_tangent(head.friction, t, &p1, &i1, &a, &b); }
        if head.count > 2u { push_tangent(head.friction, t, &p2, &i2, &a, &b); }
        if head.count > 3u { push_tangent(head.friction, t, &p3, &i3, &a, &b); }
    }
    if head.count > 0u { write(kind, first + 0u, &p0, &i0); }
    if head.count > 1u { write(kind, first + 1u, &p1, &i1); }
    if head.count > 2u { write(kind, first + 2u, &p2, &i2); }
    if head.count > 3u { write(kind, first + 3u, &p3, &i3); }

    if a.inverse_mass > 0.0 {
        solver_bodies[head.body_a].linear_velocity = a.linear_velocity;
        solver_bodies[head.body_a].angular_velocity = a.angular_velocity;
    }
    if b.inverse_mass > 0.0 {
        solver_bodies[head.body_b].linear_velocity = b.linear_velocity;
        solver_bodies[head.body_b].angular_velocity = b.angular_velocity;
    }
}

// Constraint of an invocation of the batch's dispatch, or NONE. Workgroups are smaller here than `invocation` takes
// them to be.
const NONE: u32 = 0xffffffffu;

fn constraint_of(wg: vec3<u32>, num: vec3<u32>, lid: u32) -> u32 {
    var local = lid;
    if PERMUTE == 1u {
        local = SOLVER_WORKGROUP - 1u - lid;
    } else if PERMUTE == 2u {
        local = reverseBits(lid) >> 26u;
    }
    let c = start_of(batch.index) + workgroup_index(wg, num) * SOLVER_WORKGROUP + local;
    return select(NONE, c, c < start_of(batch.index + 1u) && control.stop == 0u);
}

@compute @workgroup_size(64)
fn warm_start(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = constraint_of(wg, num, lid);
    if c != NONE {
        visit(WARM_START, c);
    }
}

@compute @workgroup_size(64)
fn solve(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = constraint_of(wg, num, lid);
    if c != NONE {
        visit(SOLVE, c);
    }
}

@compute @workgroup_size(64)
fn relax(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = constraint_of(wg, num, lid);
    if c != NONE {
        visit(RELAX, c);
    }
}

@compute @workgroup_size(64)
fn restitution(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = constraint_of(wg, num, lid);
    if c != NONE {
        visit(RESTITUTION, c);
    }
}

// The batches from `wide_batches` on. What a batch wrote, the barrier shows to the next one: they share a workgroup.
fn tail(kind: u32, lid: u32) {
    if control.stop != 0u {
        return;
    }
    let local = local_index(lid);
    for (var index = step.wide_batches; index < control.batch_count; index++) {
        let end = start_of(index + 1u);
        if start_of(index) == end {
            continue;
        }
        for (var c = start_of(index) + local; c < end; c += WORKGROUP) {
            visit(kind, c);
        }
        storageBarrier();
    }
    let first = start_of(LAST_BATCH);
    let end = start_of(BATCHES);
    for (var turn = 0u; turn < (end - first + TURN - 1u) / TURN; turn++) {
        if local == turn % WORKGROUP {
            for (var c = first + turn * TURN; c < min(first + (turn + 1u) * TURN, end); c++) {
                visit(kind, c);
            }
        }
        storageBarrier();
    }
}

@compute @workgroup_size(256)
fn warm_start_tail(@builtin(local_invocation_index) lid: u32) {
    tail(WARM_START, lid);
}

@compute @workgroup_size(256)
fn solve_tail(@builtin(local_invocation_index) lid: u32) {
    tail(SOLVE, lid);
}

@compute @workgroup_size(256)
fn relax_tail(@builtin(local_invocation_index) lid: u32) {
    tail(RELAX, lid);
}

@compute @workgroup_size(256)
fn restitution_tail(@builtin(local_invocation_index) lid: u32) {
    tail(RESTITUTION, lid);
}
