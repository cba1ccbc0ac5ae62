// The inertia of bodies with the geometric stiffness of their joints. Twin of
// crates/cpu/src/joint/inertia.rs. Imported by `joint/island` and `joint/batches`; reads and writes what `joint/rows` names.

//#import joint/rows.wgsl

// Share of the geometric stiffness that joints add to the inertia.
const STIFFENING: f32 = 2.0;

// Geometric stiffness of a joint at one of its bodies, as inertia over a sub-step.
fn stiffening(arm: vec3<f32>, impulse: vec3<f32>, h: f32) -> mat3x3<f32> {
    let pull = dot(arm, impulse);
    let square = dot(arm, arm);
    if pull <= 0.0 || square == 0.0 {
        return mat3x3<f32>();
    }
    let share = STIFFENING * h * pull;
    let outer = mat3x3<f32>(arm * arm.x, arm * arm.y, arm * arm.z) * (1.0 / square);
    let one = mat3x3<f32>(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0));
    return (one - outer) * share;
}

// Table `bodies` of the topology.
fn joint_body(index: u32) -> JointBody {
    let at = joint_layout.bodies + 4u * index;
    return JointBody(joint_tables[at], joint_tables[at + 1u], joint_tables[at + 2u], joint_tables[at + 3u]);
}

// The matrix with ones on the diagonal for rows and columns that are zero: what is held about an axis can be inverted.
fn unheld(m: mat3x3<f32>) -> mat3x3<f32> {
    var all = m;
    for (var axis = 0u; axis < 3u; axis++) {
        all[axis][axis] = select(m[axis][axis], 1.0, m[axis][axis] == 0.0);
    }
    return all;
}

// The inertia of a body in the world with that of all its joints, inverted; zero where nothing turns it. Of one that is
// held about axes, the rows and columns of the others alone are inverted.
fn inverse_inertia(slot: u32, rotation: vec4<f32>, more: mat3x3<f32>) -> mat3x3<f32> {
    let r = mat3_from_quat(rotation);
    let i = props[slot].inverse_inertia;
    let p = props[slot].inertia;
    let stiff = any(more[0] != vec3<f32>()) || any(more[1] != vec3<f32>()) || any(more[2] != vec3<f32>());
    let held = three_bits(props[slot].locked, LOCKED_FIRST_ROTATION);
    if any(held) && !stiff {
        return held_inverse_inertia(rotation, p, held);
    }
    if !stiff || all(i == vec3<f32>()) {
        return mat3x3<f32>(r[0] * i.x, r[1] * i.y, r[2] * i.z) * transpose(r);
    }
    let inertia = mat3x3<f32>(r[0] * p.x, r[1] * p.y, r[2] * p.z) * transpose(r) + more;
    if !any(held) {
        return inverse3(inertia);
    }
    let free = select(vec3<f32>(1.0), vec3<f32>(), held);
    let both = mat3x3<f32>(free * free.x, free * free.y, free * free.z);
    let left = mat3x3<f32>(inertia[0] * both[0], inertia[1] * both[1], inertia[2] * both[2]);
    let inverse = inverse3(unheld(left));
    return mat3x3<f32>(inverse[0] * both[0], inverse[1] * both[1], inverse[2] * both[2]);
}

// The body's inertia with the geometric stiffness of its joints. What contacts will add again to its angular velocity is
// what their torques do to the new inertia.
fn stiffen(index: u32) {
    let info = joint_body(index);
    let slot = info.body;
    if solver_bodies[slot].inverse_mass == 0.0 {
        return;
    }
    let rotation = see(slot).rotation;
    var more: mat3x3<f32>;
    for (var k = 0u; k < info.end_count; k++) {
        let end = joint_tables[joint_layout.ends + info.first_end + k];
        let joint = joint_tables[joint_layout.joints + (end >> 1u)];
        let second = (end & 1u) == 1u;
        let arm = rotate(rotation, select(joints[joint].anchor_a, joints[joint].anchor_b, second));
        let impulse = select(-joint_states[joint].impulse, joint_states[joint].impulse, second);
        more += stiffening(arm, impulse, step.h);
    }
    let inertia = inverse_inertia(slot, rotation, more);
    let before = unheld(inverse_inertia_of(slot));
    let carried = solver_bodies[slot].angular_velocity - solver_bodies[slot].angular_start;
    if determinant(before) > 0.0 && any(carried != vec3<f32>()) {
        solver_bodies[slot].angular_start = solver_bodies[slot].angular_velocity - inertia * (inverse3(before) * carried);
    }
    solver_bodies[slot].inverse_inertia_diagonal = vec3<f32>(inertia[0].x, inertia[1].y, inertia[2].z);
    solver_bodies[slot].inverse_inertia_off = vec3<f32>(inertia[0].y, inertia[0].z, inertia[1].z);
}
