//! Rows between bodies that are held along or about axes of the world: some of them, or some mixtures of them, move nothing.
//! Twin of `shaders/joint/held.wgsl`.

use super::rows::Body;
use glam::{Mat3, Vec3};

/// Share of what a body answers along its free axes up to which it does not answer at all: directions within a hundredth
/// of a radian of what is locked.
pub const NO_ANSWER: f32 = 1e-4;
/// Axes that neither body answers along are on the diagonal of the system with this share of what they answer with along
/// others. A row that is nearly square to all that can move would else take as far a way as it takes: that of a rope that
/// leads out of a plane and is too short. A row in a plane does not notice, one askew by 45 degrees gets 96 % of its impulse.
pub const GHOST: f32 = 0.04;

/// What a body that is held answers a row with, where along its free axes it answers with up to `most`.
pub fn answer(response: f32, most: f32) -> f32 {
    if response <= NO_ANSWER * most { 0.0 } else { response }
}

/// What a block of rows has on the diagonal for the axes of the world that neither body answers along, or about. Whatever is
/// asked of them then gets an impulse of a sensible size, and moves nothing.
pub fn ghost(along: Mat3, about: Mat3, a: &Body, b: &Body) -> Mat3 {
    let turns = |body: &Body| {
        let i = &body.inverse_inertia;
        Vec3::new(i.x_axis.x, i.y_axis.y, i.z_axis.z)
    };
    let (rows, answers, most) = if along == Mat3::ZERO {
        let both = turns(a) + turns(b);
        (about, both, both.x + both.y + both.z)
    } else {
        (along, a.inverse_mass + b.inverse_mass, a.whole + b.whole)
    };
    let held = Vec3::select(answers.cmpeq(Vec3::ZERO), Vec3::splat(GHOST * most), Vec3::ZERO);
    rows.transpose() * scaled(held, rows)
}

/// What pushes along the columns of `with` do along those of `along`: by a body, of which the mass is `whole`, or less along
/// axes that are locked. (Where none is, in the order of operations of what is solved in lanes.)
pub fn pushed(along: &Mat3, with: &Mat3, inverse_mass: Vec3, whole: f32, is_held: bool) -> Mat3 {
    if is_held { along.transpose() * scaled(inverse_mass, *with) } else { along.transpose() * *with * whole }
}

/// Each column of the matrix times `scale`, axis by axis.
fn scaled(scale: Vec3, m: Mat3) -> Mat3 {
    Mat3::from_cols(scale * m.x_axis, scale * m.y_axis, scale * m.z_axis)
}
