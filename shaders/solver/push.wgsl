// What the laws of all solvers share: how a push changes two bodies, friction, bounces. Twin of
// crates/cpu/src/solver/push.rs. No pass, no binding; `solver/passes` visits the points of a constraint with it.
//
// Each push is checked before it is done: one that is not finite is dropped.

//#import shared/body.wgsl
//#import shared/constraint.wgsl
//#import shared/math.wgsl
//#import shared/step.wgsl

fn inverse_inertia_times(body: ptr<function, SolverBody>, v: vec3<f32>) -> vec3<f32> {
    return symmetric_times((*body).inverse_inertia_diagonal, (*body).inverse_inertia_off, v);
}

fn relative_velocity(
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
    ra: vec3<f32>,
    rb: vec3<f32>,
) -> vec3<f32> {
    let at_a = (*a).linear_velocity + cross((*a).angular_velocity, ra);
    let at_b = (*b).linear_velocity + cross((*b).angular_velocity, rb);
    return at_b - at_a;
}

// Applies `push` to b at `rb` and its opposite to a at `ra`.
fn apply(
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
    ra: vec3<f32>,
    rb: vec3<f32>,
    push: vec3<f32>,
) {
    (*a).linear_velocity = (*a).linear_velocity - (*a).inverse_mass * along_free((*a).touched, push);
    (*a).angular_velocity = (*a).angular_velocity - inverse_inertia_times(a, cross(ra, push));
    (*b).linear_velocity = (*b).linear_velocity + (*b).inverse_mass * along_free((*b).touched, push);
    (*b).angular_velocity = (*b).angular_velocity + inverse_inertia_times(b, cross(rb, push));
}

// From the bodies' centres of mass to a point, as columns.
fn arms(head: ConstraintHead, point: ptr<function, ConstraintPoint>) -> mat2x3<f32> {
    let ra = (*point).anchor;
    return mat2x3<f32>(ra, ra - head.between);
}

fn warm_start_point(
    head: ConstraintHead,
    t: mat2x3<f32>,
    point: ptr<function, ConstraintPoint>,
    impulse: ptr<function, Impulse>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) {
    let push = (*impulse).normal * head.normal + (*impulse).tangent[0] * t[0] + (*impulse).tangent[1] * t[1];
    let r = arms(head, point);
    apply(a, b, r[0], r[1], push);
}

// Gap at a point now; the normal is held, the arms turn with the bodies but for their round parts.
fn separation_of(
    head: ConstraintHead,
    point: ptr<function, ConstraintPoint>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) -> f32 {
    let r = arms(head, point);
    let core_a = r[0] - head.round_a * head.normal;
    let core_b = r[1] - head.round_b * head.normal;
    let from_a = rotate((*a).delta, core_a);
    let from_b = rotate((*b).delta, core_b);
    let moved = (*b).translation - (*a).translation + from_b - from_a;
    return (*point).adjusted_separation + dot(head.normal, moved);
}

// Friction against the sliding velocity, within the cone.
fn push_tangent(
    head: ConstraintHead,
    t: mat2x3<f32>,
    point: ptr<function, ConstraintPoint>,
    impulse: ptr<function, Impulse>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) {
    let r = arms(head, point);
    let slide = relative_velocity(a, b, r[0], r[1]);
    var x = (*impulse).tangent[0] - (*point).tangent_mass * (dot(t[0], slide) + head.surface_velocity.x);
    var y = (*impulse).tangent[1] - (*point).tangent_mass * (dot(t[1], slide) + head.surface_velocity.y);
    let size = sqrt(x * x + y * y);
    let most = head.friction * (*impulse).normal;
    if size > most {
        let scale = most / size;
        x *= scale;
        y *= scale;
    }
    let push = (x - (*impulse).tangent[0]) * t[0] + (y - (*impulse).tangent[1]) * t[1];
    if is_finite3(push) {
        (*impulse).tangent[0] = x;
        (*impulse).tangent[1] = y;
        apply(a, b, r[0], r[1], push);
    }
}

// All that a point pushed in the step so far, with this sub-step's impulse.
fn count(point: ptr<function, ConstraintPoint>, impulse: ptr<function, Impulse>) -> vec3<f32> {
    return (*point).total + vec3<f32>((*impulse).normal, (*impulse).tangent[0], (*impulse).tangent[1]);
}

// Gives back a share of the speed at which the points met, where they met fast enough and pushed at all.
fn bounce(
    head: ConstraintHead,
    point: ptr<function, ConstraintPoint>,
    impulse: ptr<function, Impulse>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
    step: StepParams,
) {
    let approach = (*point).approach;
    if head.restitution == 0.0 || approach > -step.restitution_threshold || (*point).total.x == 0.0 {
        return;
    }
    let r = arms(head, point);
    let velocity = dot(head.normal, relative_velocity(a, b, r[0], r[1]));
    let change = -(*point).normal_mass * (velocity + head.restitution * approach);
    let sum = (*impulse).normal + change;
    if is_finite_bits(sum) {
        let new_normal = max(sum, 0.0);
        let push = new_normal - (*impulse).normal;
        (*impulse).normal = new_normal;
        (*point).total.x += push;
        apply(a, b, r[0], r[1], push * head.normal);
    }
}
