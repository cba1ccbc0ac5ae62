// One visit to one constraint by one pass or soft sub-stepping: what its points do to two bodies, or to parts of them, which
// the caller reads and writes. Writes `heads` (what they remember and resist), `points` and `impulses`. No pass; imported by
// `solver/passes` and `solver/split`. Twin of crates/cpu/src/solver/mod.rs (`PlainRows::visit`).

//#import solver/one_pass.wgsl
//#import solver/resist.wgsl
//#import solver/soft.wgsl
//#import solver/sweep.wgsl

// Kinds of visit of the one pass; the others are in `solver/soft`.
const LOAD: u32 = 4u;
const PASS: u32 = 5u;

// Soft, bounces, and the warm start of others: normals first, then friction within the cone that they allow. (A constraint
// has a point at least; a loop that tests at its end saves llvmpipe one turn with no lane active.)
fn visit_points(
    kind: u32,
    c: u32,
    head: ConstraintHead,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) {
    let t = tangents(head.normal);
    let first = 4u * c;
    let end = first + min(head.count, 4u);
    var sum = 0.0;
    var p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        if kind == WARM_START {
            warm_start_point(head, t, &point, &impulse, a, b);
        } else if kind == RESTITUTION {
            bounce(head, &point, &impulse, a, b, step);
            impulses[p].normal = impulse.normal;
            points[p].total.x = point.total.x;
        } else {
            // It seldom changes, and a write that is not made costs nothing.
            let lowest = point.approach;
            push_normal(kind, head, &point, &impulse, a, b, step);
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
        warm_start_resistance(head, t, a, b);
    }
    if kind == SOLVE || kind == RELAX {
        p = first;
        loop {
            var point = points[p];
            var impulse = impulses[p];
            push_tangent(head, t, &point, &impulse, a, b);
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
            heads[c].resisted = resist(head, t, sum, a, b);
        }
    }
}

// One pass: applies the impulses of the last step, and weighs the eigenvalues of the bodies with them.
fn load_points(c: u32, head: ConstraintHead, a: ptr<function, SolverBody>, b: ptr<function, SolverBody>) {
    let t = tangents(head.normal);
    let first = 4u * c;
    let end = first + min(head.count, 4u);
    var weight = 0.0;
    var p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        warm_start_point(head, t, &point, &impulse, a, b);
        weight += weight_of(&point, &impulse);
        continuing {
            p++;
            break if p >= end;
        }
    }
    warm_start_resistance(head, t, a, b);
    let twist = head.resisted.x;
    let rolling = head.resisted.yz;
    weight += over(twist * twist, head.twisting_inertia) + over(dot(rolling, rolling), head.rolling_inertia);
    let own = eigenvalues(a, b);
    (*a).weight += weight;
    (*a).weighted += weight * own.y;
    (*b).weight += weight;
    (*b).weighted += weight * own.x;
}

// All that one pass does in a sub-step: normals first, then friction, then the memory. Blows are put aside; true where
// there was one.
fn pass_points(c: u32, head: ConstraintHead, a: ptr<function, SolverBody>, b: ptr<function, SolverBody>) -> bool {
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
        pass_normal(head, &point, &impulse, a, b, step);
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
    let rate = memory_rate(a, b, step);
    let remembered = remember(head.remembered, mean, rate);
    heads[c].remembered = remembered;
    var blown = false;
    p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        push_tangent(head, t, &point, &impulse, a, b);
        points[p].total = count(&point, &impulse);
        points[p].deviation = deviate(point.deviation, remembered, impulse.normal, mean, rate);
        let was = before[p - first];
        let blow = impulse.normal - was.x;
        if blow > step.blow_speed * point.normal_mass {
            // It is given once: the next sub-step starts without it.
            let x = impulse.tangent[0] - was.y;
            let y = impulse.tangent[1] - was.z;
            start_after(arms(head, &point), blow * head.normal + x * t[0] + y * t[1], a, b);
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
        heads[c].resisted = resist(head, t, sum, a, b);
    }
    return blown;
}
