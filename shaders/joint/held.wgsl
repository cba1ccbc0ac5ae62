// Rows between bodies that are held along or about axes of the world: some of them, or some mixtures of them, move nothing.
// Twin of crates/cpu/src/joint/held.rs, which says why. No pass, no binding.

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

// What a block of rows has on the diagonal for the axes of the world that neither body answers along, or about; along others
// they answer with up to `most`.
fn ghost(rows: mat3x3<f32>, answers: vec3<f32>, most: f32) -> mat3x3<f32> {
    let held = select(vec3<f32>(), vec3<f32>(GHOST * most), answers == vec3<f32>());
    return transpose(rows) * scaled(held, rows);
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
