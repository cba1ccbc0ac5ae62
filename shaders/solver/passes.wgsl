// The sweeps over constraints, batch by batch; a visit to one of them is in `solver/visit`.
// Twin of crates/cpu/src/solver/mod.rs (`PlainRows::sweep`).
//
// Reads and writes `heads` (what they remember and resist), `points`, `impulses` and `solver_bodies` (velocities, and what the
// sub-step began with). Constraints of one batch share no moving body, so each has a thread of its own:
//
//   warm_start, solve, relax (soft), load, one_pass (one pass), restitution
//              one batch a dispatch (`batch`), one thread a constraint
//   ..._tail   one workgroup: the batches from `step.wide_batches` on, one after the other, one thread each 256th
//              constraint; the last batch, whose constraints do share bodies, in order: each thread in turn visits 128.
//              (By mass splitting it has a pass of its own, in `solver/split`.)
//
// Harada, "Parallelizing the Physics Pipeline" (GDC 2009). Loops: 9 turns for each 256 constraints of the tail; in the
// last batch 9 for each of the 128, and one a thread.

//#import solver/visit.wgsl

// One visit to constraint c. Only the velocities of bodies that move are written.
fn visit(kind: u32, c: u32) {
    let head = heads[c];
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    visit_points(kind, c, head, &a, &b);
    if a.inverse_mass > 0.0 {
        solver_bodies[head.body_a].linear_velocity = a.linear_velocity;
        solver_bodies[head.body_a].angular_velocity = a.angular_velocity;
    }
    if b.inverse_mass > 0.0 {
        solver_bodies[head.body_b].linear_velocity = b.linear_velocity;
        solver_bodies[head.body_b].angular_velocity = b.angular_velocity;
    }
}

fn load_constraint(c: u32) {
    let head = heads[c];
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    load_points(c, head, &a, &b);
    if a.inverse_mass > 0.0 {
        solver_bodies[head.body_a].linear_velocity = a.linear_velocity;
        solver_bodies[head.body_a].angular_velocity = a.angular_velocity;
        solver_bodies[head.body_a].weight = a.weight;
        solver_bodies[head.body_a].weighted = a.weighted;
    }
    if b.inverse_mass > 0.0 {
        solver_bodies[head.body_b].linear_velocity = b.linear_velocity;
        solver_bodies[head.body_b].angular_velocity = b.angular_velocity;
        solver_bodies[head.body_b].weight = b.weight;
        solver_bodies[head.body_b].weighted = b.weighted;
    }
}

fn pass_over(c: u32) {
    let head = heads[c];
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    let blown = pass_points(c, head, &a, &b);
    if a.inverse_mass > 0.0 {
        solver_bodies[head.body_a].linear_velocity = a.linear_velocity;
        solver_bodies[head.body_a].angular_velocity = a.angular_velocity;
        if blown {
            solver_bodies[head.body_a].linear_start = a.linear_start;
            solver_bodies[head.body_a].angular_start = a.angular_start;
        }
    }
    if b.inverse_mass > 0.0 {
        solver_bodies[head.body_b].linear_velocity = b.linear_velocity;
        solver_bodies[head.body_b].angular_velocity = b.angular_velocity;
        if blown {
            solver_bodies[head.body_b].linear_start = b.linear_start;
            solver_bodies[head.body_b].angular_start = b.angular_start;
        }
    }
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
fn load(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = constraint_of(wg, num, lid);
    if c != NONE {
        load_constraint(c);
    }
}

@compute @workgroup_size(64)
fn one_pass(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = constraint_of(wg, num, lid);
    if c != NONE {
        pass_over(c);
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

fn visit_any(kind: u32, c: u32) {
    if kind == LOAD {
        load_constraint(c);
    } else if kind == PASS {
        pass_over(c);
    } else {
        visit(kind, c);
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
            if is_of_level(c) {
                visit_any(kind, c);
            }
        }
        storageBarrier();
    }
    if splits_last() {
        return;
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
fn load_tail(@builtin(local_invocation_index) lid: u32) {
    tail(LOAD, lid);
}

@compute @workgroup_size(256)
fn one_pass_tail(@builtin(local_invocation_index) lid: u32) {
    tail(PASS, lid);
}

@compute @workgroup_size(256)
fn restitution_tail(@builtin(local_invocation_index) lid: u32) {
    tail(RESTITUTION, lid);
}
