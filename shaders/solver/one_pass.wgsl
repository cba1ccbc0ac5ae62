// One sweep a sub-step, and contacts that remember what they bear; what for is told by the twin,
// crates/cpu/src/solver/one_pass.rs. No pass, no binding.

//#import solver/push.wgsl

// Share of the memory that is left, each sub-step, of a contact that does not push.
const FADE: f32 = 0.9;
// What a point has more or less than the mean is remembered at this times the square of the mean's rate.
const DEVIATION: f32 = 2.5;

fn over(square: f32, mass: f32) -> f32 {
    if mass > 0.0 {
        return square / mass;
    }
    return 0.0;
}

// What a point's impulse weighs.
fn weight_of(point: ptr<function, ConstraintPoint>, impulse: ptr<function, Impulse>) -> f32 {
    let normal = (*impulse).normal;
    let x = (*impulse).tangent[0];
    let y = (*impulse).tangent[1];
    return over(normal * normal, (*point).normal_mass) + over(x * x + y * y, (*point).tangent_mass);
}

// The bodies' eigenvalues; one that does not move has the other's.
fn eigenvalues(a: ptr<function, SolverBody>, b: ptr<function, SolverBody>) -> vec2<f32> {
    var own = vec2<f32>((*a).eigenvalue, (*b).eigenvalue);
    if (*a).inverse_mass == 0.0 {
        own.x = own.y;
    }
    if (*b).inverse_mass == 0.0 {
        own.y = own.x;
    }
    return own;
}

// A gap is closed no faster than it lasts. Overlap is a damped spring whose leak leads to what is remembered; so is a gap
// so small that the spring still presses, or contacts would swing about their onset.
fn pass_normal(
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
    let mass = (*point).normal_mass;
    let remembered = head.remembered + (*point).deviation;
    let pressed = (*impulse).normal > 0.0 && separation * mass < step.memory_band * remembered;
    var change = 0.0;
    if separation > 0.0 && !pressed {
        change = -mass * (velocity + separation * step.inverse_h);
    } else {
        let leak = head.impulse_scale * ((*impulse).normal - remembered);
        let spring = head.mass_scale * mass * head.bias_rate * separation;
        let pull = max(spring + leak, -step.push_speed * mass);
        change = -(head.mass_scale * mass * velocity + pull);
    }
    let sum = (*impulse).normal + change;
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

// How fast memory follows, a sub-step.
fn memory_rate(a: ptr<function, SolverBody>, b: ptr<function, SolverBody>, step: StepParams) -> f32 {
    let own = eigenvalues(a, b);
    return min(step.memory_gain * (own.x + own.y), step.memory_limit);
}

// The memory of the mean follows that of the impulses.
fn remember(remembered: f32, mean: f32, rate: f32) -> f32 {
    if mean > 0.0 {
        return remembered + rate * (mean - remembered);
    }
    return FADE * remembered;
}

// A point's deviation from the mean follows that of its impulse; `remembered` is the new mean.
fn deviate(deviation: f32, remembered: f32, normal: f32, mean: f32, rate: f32) -> f32 {
    let own = max(remembered + deviation + DEVIATION * rate * rate * (normal - mean - deviation), 0.0);
    if normal > 0.0 {
        return own - remembered;
    }
    return FADE * min(own, remembered) - remembered;
}

// Counts `push` to what the sub-step began with.
fn start_after(
    r: mat2x3<f32>,
    push: vec3<f32>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) {
    (*a).linear_start = (*a).linear_start - (*a).inverse_mass * along_free((*a).touched, push);
    (*a).angular_start = (*a).angular_start - inverse_inertia_times(a, cross(r[0], push));
    (*b).linear_start = (*b).linear_start + (*b).inverse_mass * along_free((*b).touched, push);
    (*b).angular_start = (*b).angular_start + inverse_inertia_times(b, cross(r[1], push));
}
