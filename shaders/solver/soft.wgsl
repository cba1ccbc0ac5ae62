// Soft contacts: springs in the solve visit, rigid in the relax visit. Twin of crates/cpu/src/solver/soft.rs. No pass, no
// binding.
//
// Catto, "Soft Constraints" (GDC 2011) and "Solver2D" (2024).

//#import solver/push.wgsl

// What a visit to a constraint does.
const WARM_START: u32 = 0u; // applies the impulses of the last visit
const SOLVE: u32 = 1u; // soft
const RELAX: u32 = 2u; // rigid, no bias
const RESTITUTION: u32 = 3u; // bounces

// A gap is closed no faster than it lasts; overlap is a damped spring when soft, and left alone when rigid.
fn push_normal(
    kind: u32,
    head: ConstraintHead,
    point: ptr<function, ConstraintPoint>,
    impulse: ptr<function, Impulse>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
    step: StepParams,
) {
    let normal = head.normal;
    let r = arms(head, point);
    let velocity = dot(normal, relative_velocity(a, b, r[0], r[1]));
    let separation = separation_of(head, point, a, b);
    var bias = 0.0;
    var mass_scale = 1.0;
    var impulse_scale = 0.0;
    if separation > 0.0 {
        bias = separation * step.inverse_h;
    } else if kind == SOLVE {
        bias = max(head.bias_rate * separation, -step.push_speed);
        mass_scale = head.mass_scale;
        impulse_scale = head.impulse_scale;
    }
    if kind == RELAX && (*point).total.x == 0.0 && (*impulse).normal == 0.0 {
        (*point).approach = min((*point).approach, velocity);
    }
    let change = -(*point).normal_mass * mass_scale * (velocity + bias) - impulse_scale * (*impulse).normal;
    let sum = (*impulse).normal + change;
    // The sum, and not the push: the larger of NaN and zero may be zero.
    if is_finite_bits(sum) {
        let new_normal = max(sum, 0.0);
        let push = new_normal - (*impulse).normal;
        (*impulse).normal = new_normal;
        apply(a, b, r[0], r[1], push * normal);
    }
}
