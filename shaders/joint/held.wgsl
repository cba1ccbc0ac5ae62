// Rows between bodies that are held along or about axes of the world: some of them, or some mixtures of them, move nothing.
// Twin of crates/cpu/src/joint/held.rs, which says why. Imported by `joint/rows`; reads what that names.

// Share of what a body answers along its free axes up to which it does not answer at all: directions within a hundredth
// of a radian of what is locked.
const NO_ANSWER: f32 = 1e-4;
// Axes that neither body answers along are on the diagonal of the system with this share of what they answer with along
// others.
const GHOST: f32 = 0.04;

// What a body that is held answers a row with, where along its free axes it answers with up to `most`.
fn answer(response: f32, most: f32) -> f32 {
    return select(response, 0.0, response <= NO_ANSWER * most);
}

// What a block of rows has on the diagonal for the axes of the world that neither body answers along, or about.
fn ghost(place: u32, which: u32) -> mat3x3<f32> {
    let ia = joint_works[place].body_a;
    let ib = joint_works[place].body_b;
    var rows = joint_works[place].rows[which].along;
    var answers = inverse_masses(ia) + inverse_masses(ib);
    var most = solver_bodies[ia].inverse_mass + solver_bodies[ib].inverse_mass;
    if which == 1u {
        rows = joint_works[place].rows[which].turn_b;
        answers = solver_bodies[ia].inverse_inertia_diagonal + solver_bodies[ib].inverse_inertia_diagonal;
        most = answers.x + answers.y + answers.z;
    }
    let held = select(vec3<f32>(), vec3<f32>(GHOST * most), answers == vec3<f32>());
    return transpose(rows) * scaled(held, rows);
}

// 1/kg along the world's axes; zero along those that are locked.
fn inverse_masses(slot: u32) -> vec3<f32> {
    return along_free(solver_bodies[slot].touched, vec3<f32>(solver_bodies[slot].inverse_mass));
}

// Whether the body moves, and is held along or about an axis of the world.
fn is_held(slot: u32) -> bool {
    let turns = solver_bodies[slot].inverse_inertia_diagonal;
    return solver_bodies[slot].inverse_mass > 0.0 && (is_locked(solver_bodies[slot].touched) || any(turns == vec3<f32>()));
}

// What a body answers a row with: a push along `along`, a turn about `turn` and the response to that.
fn own_answer(slot: u32, along: vec3<f32>, turn: vec3<f32>, response: vec3<f32>) -> f32 {
    let own = dot(along, inverse_masses(slot) * along) + dot(turn, response);
    let turns = dot(solver_bodies[slot].inverse_inertia_diagonal, vec3<f32>(1.0));
    let most = select(solver_bodies[slot].inverse_mass, turns, all(along == vec3<f32>()));
    return select(own, answer(own, most), is_held(slot));
}

// Each column of the matrix times `scale`, axis by axis.
fn scaled(scale: vec3<f32>, m: mat3x3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(scale * m[0], scale * m[1], scale * m[2]);
}

// The inverse by cross products; zero where there is none.
fn inverse3(m: mat3x3<f32>) -> mat3x3<f32> {
    let yz = cross(m[1], m[2]);
    let zx = cross(m[2], m[0]);
    let xy = cross(m[0], m[1]);
    let determinant = dot(m[2], xy);
    if determinant == 0.0 {
        return mat3x3<f32>();
    }
    let s = 1.0 / determinant;
    return transpose(mat3x3<f32>(yz * s, zx * s, xy * s));
}
