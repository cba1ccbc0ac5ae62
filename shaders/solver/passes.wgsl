// The sweeps over constraints, batch by batch; the laws of a visit are in `solver/soft` and `solver/one_pass`.
// Twin of crates/cpu/src/solver/mod.rs (`PlainRows::sweep`).
//
// Reads and writes `heads` (what they remember and resist), `points`, `impulses` and `solver_bodies` (velocities, and what the
// sub-step began with). Constraints of one batch share no moving body, so each has a thread of its own:
//
//   warm_start, solve, relax (soft), load, one_pass (one pass), restitution
//              one batch a dispatch (`batch`), one thread a constraint
//   ..._tail   one workgroup: the batches from `step.wide_batches` on, one after the other, one thread each 256th
//              constraint; the last batch, whose constraints do share bodies, in order: each thread in turn visits 128
//
// Harada, "Parallelizing the Physics Pipeline" (GDC 2009). Loops: 9 turns for each 256 constraints of the tail; in the
// last batch 9 for each of the 128, and one a thread.

//#import solver/one_pass.wgsl
//#import solver/resist.wgsl
//#import solver/soft.wgsl
//#import solver/sweep.wgsl

// Kinds of visit of the one pass; the others are in `solver/soft`.
const LOAD: u32 = 4u;
const PASS: u32 = 5u;

// One visit to constraint c: normals first, then friction within the cone that they allow. Only the velocities of
// bodies that move are written. (A constraint has a point at least; a loop that tests at its end saves llvmpipe one
// turn with no lane active.)
fn visit(kind: u32, c: u32) {
    let head = heads[c];
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    let t = tangents(head.normal);
    let first = 4u * c;
    let end = first + min(head.count, 4u);
    var sum = 0.0;
    var p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        if kind == WARM_START {
            warm_start_point(head, t, &point, &impulse, &a, &b);
        } else if kind == RESTITUTION {
            bounce(head, &point, &impulse, &a, &b, step);
            impulses[p].normal = impulse.normal;
            points[p].total.x = point.total.x;
        } else {
            // It seldom changes, and a write that is not made costs nothing.
            let lowest = point.approach;
            push_normal(kind, head, &point, &impulse, &a, &b, step);
            sum += impulse.normal;
            impulses[p].normal = impulse.normal;
            if point.approach < lowest {
                points[p].approach = point.approach;
            }
        }
        continuing {
            p++;
            break if p >= end;
        }
    }
    if kind == WARM_START {
        warm_start_resistance(head, t, &a, &b);
    }
    if kind == SOLVE || kind == RELAX {
        p = first;
        loop {
            var point = points[p];
            var impulse = impulses[p];
            push_tangent(head, t, &point, &impulse, &a, &b);
            impulses[p].tangent = impulse.tangent;
            if kind == RELAX {
                points[p].total = count(&point, &impulse);
            }
            continuing {
                p++;
                break if p >= end;
            }
        }
        if resists(head) {
            heads[c].resisted = resist(head, t, sum, &a, &b);
        }
    }
    if a.inverse_mass > 0.0 {
        solver_bodies[head.body_a].linear_velocity = a.linear_velocity;
        solver_bodies[head.body_a].angular_velocity = a.angular_velocity;
    }
    if b.inverse_mass > 0.0 {
        solver_bodies[head.body_b].linear_velocity = b.linear_velocity;
        solver_bodies[head.body_b].angular_velocity = b.angular_velocity;
    }
}

// Applies the impulses of the last step to constraint c, and weighs the eigenvalues of its bodies with them.
fn load_constraint(c: u32) {
    let head = heads[c];
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    let t = tangents(head.normal);
    let first = 4u * c;
    let end = first + min(head.count, 4u);
    var weight = 0.0;
    var p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        warm_start_point(head, t, &point, &impulse, &a, &b);
        weight += weight_of(&point, &impulse);
        continuing {
            p++;
            break if p >= end;
        }
    }
    warm_start_resistance(head, t, &a, &b);
    let twist = head.resisted.x;
    let rolling = head.resisted.yz;
    weight += over(twist * twist, head.twisting_inertia) + over(dot(rolling, rolling), head.rolling_inertia);
    let own = eigenvalues(&a, &b);
    if a.inverse_mass > 0.0 {
        solver_bodies[head.body_a].linear_velocity = a.linear_velocity;
        solver_bodies[head.body_a].angular_velocity = a.angular_velocity;
        solver_bodies[head.body_a].weight = a.weight + weight;
        solver_bodies[head.body_a].weighted = a.weighted + weight * own.y;
    }
    if b.inverse_mass > 0.0 {
        solver_bodies[head.body_b].linear_velocity = b.linear_velocity;
        solver_bodies[head.body_b].angular_velocity = b.angular_velocity;
        solver_bodies[head.body_b].weight = b.weight + weight;
        solver_bodies[head.body_b].weighted = b.weighted + weight * own.x;
    }
}

// All that one pass does to constraint c in a sub-step: normals first, then friction, then the memory; and blows are put
// aside.
fn pass_over(c: u32) {
    let head = heads[c];
    var a = solver_bodies[head.body_a];
    var b = solver_bodies[head.body_b];
    let t = tangents(head.normal);
    let first = 4u * c;
    let end = first + min(head.count, 4u);
    var before: array<vec3<f32>, 4>;
    var sum = 0.0;
    var p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        before[p - first] = vec3<f32>(impulse.normal, impulse.tangent[0], impulse.tangent[1]);
        let lowest = point.approach;
        pass_normal(head, &point, &impulse, &a, &b, step);
        sum += impulse.normal;
        impulses[p].normal = impulse.normal;
        if point.approach < lowest {
            points[p].approach = point.approach;
        }
        continuing {
            p++;
            break if p >= end;
        }
    }
    let mean = sum / f32(head.count);
    let rate = memory_rate(&a, &b, step);
    let remembered = remember(head.remembered, mean, rate);
    heads[c].remembered = remembered;
    var blown = false;
    p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        push_tangent(head, t, &point, &impulse, &a, &b);
        points[p].total = count(&point, &impulse);
        points[p].deviation = deviate(point.deviation, remembered, impulse.normal, mean, rate);
        let was = before[p - first];
        let blow = impulse.normal - was.x;
        if blow > step.blow_speed * point.normal_mass {
            // It is given once: the next sub-step starts without it.
            let x = impulse.tangent[0] - was.y;
            let y = impulse.tangent[1] - was.z;
            start_after(arms(head, &point), blow * head.normal + x * t[0] + y * t[1], &a, &b);
            impulse.tangent = array<f32, 2>(was.y, was.z);
            impulses[p].normal = was.x;
            blown = true;
        }
        impulses[p].tangent = impulse.tangent;
        continuing {
            p++;
            break if p >= end;
        }
    }
    if resists(head) {
        heads[c].resisted = resist(head, t, sum, &a, &b);
    }
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
