// Resistance against rolling and twisting; what for is told by the twin, crates/cpu/src/solver/resist.rs. No pass, no
// binding.

//#import solver/push.wgsl

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

// Against relative turning, up to what `sum`, the normal impulse of all points, allows. The impulse after it.
fn resist(
    head: ConstraintHead,
    t: mat2x3<f32>,
    sum: f32,
    a: ptr<function, SolverBody>,
    b: ptr<function, SolverBody>,
) -> vec3<f32> {
    let turn = (*b).angular_velocity - (*a).angular_velocity;
    var twist = head.resisted.x - head.twisting_inertia * dot(head.normal, turn);
    var x = head.resisted.y - head.rolling_inertia * dot(t[0], turn);
    var y = head.resisted.z - head.rolling_inertia * dot(t[1], turn);
    let most_twist = head.twisting_resistance * sum;
    if abs(twist) > most_twist {
        twist *= most_twist / abs(twist);
    }
    let size = sqrt(x * x + y * y);
    let most = head.rolling_resistance * sum;
    if size > most {
        let scale = most / size;
        x *= scale;
        y *= scale;
    }
    let after = vec3<f32>(twist, x, y);
    let push = about(head, t, after - head.resisted);
    if !is_finite3(push) {
        return head.resisted;
    }
    turn_by(a, b, push);
    return after;
}
