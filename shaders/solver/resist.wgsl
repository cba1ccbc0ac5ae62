// Resistance against rolling and twisting; what for is told by the twin, crates/cpu/src/solver/resist.rs. No pass, no
// binding.

//#import solver/push.wgsl

// How far a visit goes, 1 being where the turning would end.
const OVERSHOOT: f32 = 1.3;

// Angular impulses about the normal and the two tangents, as one.
fn about(head: ConstraintHead, t: mat2x3<f32>, impulse: vec3<f32>) -> vec3<f32> {
    return impulse.x * head.normal + impulse.y * t[0] + impulse.z * t[1];
}

fn turn_by(a: ptr<function, SolverBody>, b: ptr<function, SolverBody>, push: vec3<f32>) {
    (*a).angular_velocity = (*a).angular_velocity - inverse_inertia_times(a, push);
    (*b).angular_velocity = (*b).angular_velocity + inverse_inertia_times(b, push);
}

// Applies the angular impulse of the last visit.
fn warm_start_resistance(
    head: ConstraintHead,
    t: mat2x3<f32>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) {
    if resists(head) {
        turn_by(a, b, about(head, t, head.resisted));
    }
}

// Brings the angular impulse from `before` to `after`, where that is finite; what it is then.
fn push_turning(
    head: ConstraintHead,
    t: mat2x3<f32>,
    before: vec3<f32>,
    after: vec3<f32>,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) -> vec3<f32> {
    let push = about(head, t, after - before);
    if !is_finite3(push) {
        return before;
    }
    turn_by(a, b, push);
    return after;
}

// Against relative turning, up to what `sum`, the normal impulse of all points, allows. The impulse after it.
fn resist(
    head: ConstraintHead,
    t: mat2x3<f32>,
    sum: f32,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) -> vec3<f32> {
    let before = head.resisted;
    let spin = dot(head.normal, (*b).angular_velocity - (*a).angular_velocity);
    var twist = before.x - OVERSHOOT * head.twisting_inertia * spin;
    let most_twist = head.twisting_resistance * sum;
    if abs(twist) > most_twist {
        twist *= most_twist / abs(twist);
    }
    let twisted = push_turning(head, t, before, vec3<f32>(twist, before.yz), a, b);

    let turn = (*b).angular_velocity - (*a).angular_velocity;
    var x = before.y - OVERSHOOT * head.rolling_inertia * dot(t[0], turn);
    var y = before.z - OVERSHOOT * head.rolling_inertia * dot(t[1], turn);
    let size = sqrt(x * x + y * y);
    let most = head.rolling_resistance * sum;
    if size > most {
        let scale = most / size;
        x *= scale;
        y *= scale;
    }
    return push_turning(head, t, twisted, vec3<f32>(twisted.x, x, y), a, b);
}
