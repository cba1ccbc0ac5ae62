// One visit to one constraint by the solvers that are there for comparison: what its points do to two bodies, or to parts of
// them, which the caller reads and writes. Writes `points` and `impulses`. No pass; imported by `solver/classic` and
// `solver/split`. Twin of crates/cpu/src/solver/gauss_seidel.rs and jacobi.rs.

//#import solver/jacobi.wgsl
//#import solver/sweep.wgsl

// What a visit does; other kinds are in `solver/soft` and `solver/visit`.
const GAUSS_SEIDEL: u32 = 6u;
const LAST_GAUSS_SEIDEL: u32 = 7u;
const SPLIT: u32 = 8u;
const JACOBI: u32 = 9u;
const LAST_JACOBI: u32 = 10u;
const PENALTY: u32 = 11u;

// Normals first, then friction within the cone that they allow. `after_a` and `after_b` begin as a and b, or as what Jacobi
// splits them into.
fn iterate_points(
    kind: u32,
    c: u32,
    head: ConstraintHead,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
    after_a: ptr<function, SolverBody>,
    after_b: ptr<function, SolverBody>,
) {
    let split = kind == JACOBI || kind == LAST_JACOBI;
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
            mass *= (yield_of(a, r[0], head.normal) + yield_of(b, r[1], head.normal))
                / (yield_of(after_a, r[0], head.normal) + yield_of(after_b, r[1], head.normal));
        }
        iterate_normal(head, &point, &impulse, mass, after_a, after_b, step);
        impulses[p].normal = impulse.normal;
        if point.approach < lowest {
            points[p].approach = point.approach;
        }
        continuing {
            p++;
            break if p >= end;
        }
    }
    var parts = 1.0;
    if split {
        parts = max((*a).weight, (*b).weight);
    }
    p = first;
    loop {
        var point = points[p];
        var impulse = impulses[p];
        // No more than the mass that is split so; friction against what has many contacts is slow.
        point.tangent_mass /= parts;
        push_tangent(head, t, &point, &impulse, after_a, after_b);
        impulses[p].tangent = impulse.tangent;
        if kind == LAST_GAUSS_SEIDEL || kind == LAST_JACOBI {
            points[p].total = count(&point, &impulse);
        }
        continuing {
            p++;
            break if p >= end;
        }
    }
}
