// Jacobi iterations with mass splitting; what for is told by the twin, crates/cpu/src/solver/jacobi.rs. No pass, no
// binding.

//#import solver/gauss_seidel.wgsl

// One of the parts that a body is split into.
fn part_of(body: SolverBody) -> SolverBody {
    var part = body;
    part.inverse_mass *= body.weight;
    part.inverse_inertia_diagonal *= body.weight;
    part.inverse_inertia_off *= body.weight;
    return part;
}

// How a body gives way at `r` to a unit impulse along `normal`.
fn yield_of(body: ptr<function, SolverBody>, r: vec3<f32>, normal: vec3<f32>) -> f32 {
    let turn = cross(r, normal);
    var moved = 1.0;
    if is_locked((*body).touched) {
        moved = dot(along_free((*body).touched, normal), normal);
    }
    return (*body).inverse_mass * moved + dot(turn, inverse_inertia_times(body, turn));
}

// Adds the change of velocity of one of `parts` parts to the mean.
fn add_change(body: ptr<function, SolverBody>, part: ptr<function, SolverBody>, parts: f32) {
    let linear = ((*part).linear_velocity - (*body).linear_velocity) / parts;
    let angular = ((*part).angular_velocity - (*body).angular_velocity) / parts;
    (*body).linear_start = (*body).linear_start + linear;
    (*body).angular_start = (*body).angular_start + angular;
}
