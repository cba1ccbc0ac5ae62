// The sweeps over constraints of the solvers that are there for comparison; the laws of a visit are in
// `solver/gauss_seidel`, `solver/jacobi` and `solver/penalty`. Twin of crates/cpu/src/solver/mod.rs
// (`PlainRows::sweep`).
//
// Reads `heads`, and reads and writes `points`, `impulses` and `solver_bodies`: Gauss-Seidel their velocities, Jacobi
// and penalty the sums in `linear_start` and `angular_start`, so that no constraint sees what others did.
//
//   gauss_seidel, split, jacobi, penalty
//              one batch a dispatch (`batch`), one thread a constraint; `last_...` also counts the sub-step's impulses
//   ..._tail   one workgroup, the other batches: as in `solver/passes`, and with the same loops
//   begin      one thread a body: the sums start with the velocities
//   settle     the same: the sums become the velocities

//#import solver/jacobi.wgsl
//#import solver/penalty.wgsl
//#import solver/sweep.wgsl

// What a visit does.
const GAUSS_SEIDEL: u32 = 0u;
const LAST_GAUSS_SEIDEL: u32 = 1u;
const SPLIT: u32 = 2u;
const JACOBI: u32 = 3u;
const LAST_JACOBI: u32 = 4u;
const PENALTY: u32 = 5u;

// Counts constraint c at its bodies.
fn split_for(c: u32) {
    let a = heads[c].body_a;
    let b = heads[c].body_b;
    if solver_bodies[a].inverse_mass > 0.0 {
        solver_bodies[a].weight += 1.0;
    }
    if solver_bodies[b].inverse_mass > 0.0 {
        solver_bodies[b].weight += 1.0;
    }
}

// One iteration of constraint c: normals first, then friction within the cone that they allow. Jacobi pushes its parts
// of the bodies and adds what they changed to the sums.
fn iterate(kind: u32, c: u32) {
    let head = heads[c];
    let split = kind == JACOBI || kind == LAST_JACOBI;
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    var after_a = a;
    var after_b = b;
    var parts = 1.0;
    if split {
        after_a = part_of(a);
        after_b = part_of(b);
        parts = max(a.weight, b.weight);
    }
    let t = tangents(head.normal);
    let first = 4u * c;
    let end = first + min(head.count, 4u);
    var p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        let lowest = point.approach;
        var mass = point.normal_mass;
        if split {
            let r = arms(head, &point);
            mass *= (yield_of(&a, r[0], head.normal) + yield_of(&b, r[1], head.normal))
                / (yield_of(&after_a, r[0], head.normal) + yield_of(&after_b, r[1], head.normal));
        }
        iterate_normal(head, &point, &impulse, mass, &after_a, &after_b, step);
        impulses[p].normal = impulse.normal;
        if point.approach < lowest {
            points[p].approach = point.approach;
        }
        continuing {
            p++;
            break if p >= end;
        }
    }
    p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        // No more than the mass that is split so; friction against what has many contacts is slow.
        point.tangent_mass /= parts;
        push_tangent(head, t, &point, &impulse, &after_a, &after_b);
        impulses[p].tangent = impulse.tangent;
        if kind == LAST_GAUSS_SEIDEL || kind == LAST_JACOBI {
            points[p].total = count(&point, &impulse);
        }
        continuing {
            p++;
            break if p >= end;
        }
    }
    if split {
        write_sums(head, &a, &b, &after_a, &after_b, vec2<f32>(a.weight, b.weight));
        return;
    }
    if a.inverse_mass > 0.0 {
        solver_bodies[head.body_a].linear_velocity = after_a.linear_velocity;
        solver_bodies[head.body_a].angular_velocity = after_a.angular_velocity;
    }
    if b.inverse_mass > 0.0 {
        solver_bodies[head.body_b].linear_velocity = after_b.linear_velocity;
        solver_bodies[head.body_b].angular_velocity = after_b.angular_velocity;
    }
}

// All that springs and dampers do to constraint c in a sub-step.
fn press_on(c: u32) {
    let head = heads[c];
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    var after_a = a;
    var after_b = b;
    let t = tangents(head.normal);
    let first = 4u * c;
    let end = first + min(head.count, 4u);
    var p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        penalty_point(head, t, &point, &impulse, &a, &b, &after_a, &after_b);
        impulses[p] = impulse;
        points[p].approach = point.approach;
        points[p].total = count(&point, &impulse);
        continuing {
            p++;
            break if p >= end;
        }
    }
    write_sums(head, &a, &b, &after_a, &after_b, vec2<f32>(1.0, 1.0));
}

// Adds what the parts of a constraint's bodies changed to the sums of those that move.
fn write_sums(
    head: ConstraintHead,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
    after_a: ptr<function, SolverBody>,
    after_b: ptr<function, SolverBody>,
    parts: vec2<f32>,
) {
    if (*a).inverse_mass > 0.0 {
        add_change(a, after_a, parts.x);
        solver_bodies[head.body_a].linear_start = (*a).linear_start;
        solver_bodies[head.body_a].angular_start = (*a).angular_start;
    }
    if (*b).inverse_mass > 0.0 {
        add_change(b, after_b, parts.y);
        solver_bodies[head.body_b].linear_start = (*b).linear_start;
        solver_bodies[head.body_b].angular_start = (*b).angular_start;
    }
}

fn visit_any(kind: u32, c: u32) {
    if kind == SPLIT {
        split_for(c);
    } else if kind == PENALTY {
        press_on(c);
    } else {
        iterate(kind, c);
    }
}

fn one_of_batch(kind: u32, wg: vec3<u32>, num: vec3<u32>, lid: u32) {
    let c = constraint_of(wg, num, lid);
    if c != NONE {
        visit_any(kind, c);
    }
}

// As in `solver/passes`. What a batch wrote, the barrier shows to the next one: they share a workgroup.
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
            if is_of_level(c) {
                visit_any(kind, c);
            }
        }
        storageBarrier();
    }
    let first = start_of(LAST_BATCH);
    let end = start_of(BATCHES);
    for (var turn = 0u; turn < (end - first + TURN - 1u) / TURN; turn++) {
        if local == turn % WORKGROUP {
            for (var c = first + turn * TURN; c < min(first + (turn + 1u) * TURN, end); c++) {
                if is_of_level(c) {
                    visit_any(kind, c);
                }
            }
        }
        storageBarrier();
    }
}

@compute @workgroup_size(64)
fn gauss_seidel(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    one_of_batch(GAUSS_SEIDEL, wg, num, lid);
}

@compute @workgroup_size(256)
fn gauss_seidel_tail(@builtin(local_invocation_index) lid: u32) {
    tail(GAUSS_SEIDEL, lid);
}

@compute @workgroup_size(64)
fn last_gauss_seidel(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    one_of_batch(LAST_GAUSS_SEIDEL, wg, num, lid);
}

@compute @workgroup_size(256)
fn last_gauss_seidel_tail(@builtin(local_invocation_index) lid: u32) {
    tail(LAST_GAUSS_SEIDEL, lid);
}

@compute @workgroup_size(64)
fn split(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    one_of_batch(SPLIT, wg, num, lid);
}

@compute @workgroup_size(256)
fn split_tail(@builtin(local_invocation_index) lid: u32) {
    tail(SPLIT, lid);
}

@compute @workgroup_size(64)
fn jacobi(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    one_of_batch(JACOBI, wg, num, lid);
}

@compute @workgroup_size(256)
fn jacobi_tail(@builtin(local_invocation_index) lid: u32) {
    tail(JACOBI, lid);
}

@compute @workgroup_size(64)
fn last_jacobi(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    one_of_batch(LAST_JACOBI, wg, num, lid);
}

@compute @workgroup_size(256)
fn last_jacobi_tail(@builtin(local_invocation_index) lid: u32) {
    tail(LAST_JACOBI, lid);
}

@compute @workgroup_size(64)
fn penalty(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    one_of_batch(PENALTY, wg, num, lid);
}

@compute @workgroup_size(256)
fn penalty_tail(@builtin(local_invocation_index) lid: u32) {
    tail(PENALTY, lid);
}

@compute @workgroup_size(256)
fn begin(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && control.stop == 0u && solver_bodies[i].level == step.level {
        solver_bodies[i].linear_start = solver_bodies[i].linear_velocity;
        solver_bodies[i].angular_start = solver_bodies[i].angular_velocity;
    }
}

@compute @workgroup_size(256)
fn settle(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && control.stop == 0u && solver_bodies[i].level == step.level {
        solver_bodies[i].linear_velocity = solver_bodies[i].linear_start;
        solver_bodies[i].angular_velocity = solver_bodies[i].angular_start;
    }
}
