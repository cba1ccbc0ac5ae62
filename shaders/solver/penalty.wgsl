// The penalty method: a spring and a damper at each point that overlaps, pushing with what the sub-step began with.
// Twin of crates/cpu/src/solver/penalty.rs. No pass, no binding.
//
// Harada, "Real-Time Rigid Body Simulation on GPUs" (GPU Gems 3, chapter 29).

//#import solver/push.wgsl

// Sets the impulse, and applies it to `after_a` and `after_b`. The head's `bias_rate` is the spring's, its `mass_scale`
// the share of the speed that the damper takes; friction takes the same share, within the cone.
fn penalty_point(
    head: ConstraintHead,
    t: mat2x3<f32>,
    point: ptr<function, ConstraintPoint>,
    impulse: ptr<function, Impulse>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
    after_a: ptr<function, SolverBody>,
    after_b: ptr<function, SolverBody>,
) {
    let r = arms(head, point);
    let relative = relative_velocity(a, b, r[0], r[1]);
    let velocity = dot(head.normal, relative);
    let separation = separation_of(head, point, a, b);
    var sum = 0.0;
    if separation < 0.0 {
        sum = -(*point).normal_mass * (head.bias_rate * separation + head.mass_scale * velocity);
    }
    let press = max(sum, 0.0);
    let damper = head.mass_scale * (*point).tangent_mass;
    var x = -damper * dot(t[0], relative);
    var y = -damper * dot(t[1], relative);
    let size = sqrt(x * x + y * y);
    let most = head.friction * press;
    if size > most {
        let scale = most / size;
        x *= scale;
        y *= scale;
    }
    let push = press * head.normal + x * t[0] + y * t[1];
    (*impulse).normal = 0.0;
    (*impulse).tangent = array<f32, 2>(0.0, 0.0);
    // The sum too: the larger of NaN and zero may be zero.
    if is_finite_bits(sum) && is_finite3(push) {
        (*impulse).normal = press;
        (*impulse).tangent = array<f32, 2>(x, y);
        apply(after_a, after_b, r[0], r[1], push);
        if press == 0.0 && (*point).total.x == 0.0 {
            (*point).approach = min((*point).approach, velocity);
        }
    }
}
