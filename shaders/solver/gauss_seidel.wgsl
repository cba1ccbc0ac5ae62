// Projected Gauss-Seidel with Baumgarte stabilisation: rigid contacts. Twin of crates/cpu/src/solver/gauss_seidel.rs.
// No pass, no binding.
//
// Catto, "Iterative Dynamics with Temporal Coherence" (GDC 2005).

//#import solver/push.wgsl

// A gap is closed no faster than it lasts; overlap beyond the slop is undone by a velocity.
fn iterate_normal(
    head: ConstraintHead,
    point: ptr<function, ConstraintPoint>,
    impulse: ptr<function, Impulse>,
    mass: f32,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
    step: StepParams,
) {
    let normal = head.normal;
    let r = arms(head, point);
    let velocity = dot(normal, relative_velocity(a, b, r[0], r[1]));
    let separation = separation_of(head, point, a, b);
    var bias = separation * step.inverse_h;
    if separation <= 0.0 {
        bias = max(head.bias_rate * min(separation + step.slop, 0.0), -step.push_speed);
    }
    let sum = (*impulse).normal - mass * (velocity + bias);
    // The sum, and not the push: the larger of NaN and zero may be zero.
    if is_finite_bits(sum) {
        let new_normal = max(sum, 0.0);
        let push = new_normal - (*impulse).normal;
        (*impulse).normal = new_normal;
        apply(a, b, r[0], r[1], push * normal);
        // Without the last sub-step's gravity: a bounce must not gain by it.
        if new_normal == 0.0 && (*point).total.x == 0.0 {
            (*point).approach = min((*point).approach, velocity);
        }
    }
}
