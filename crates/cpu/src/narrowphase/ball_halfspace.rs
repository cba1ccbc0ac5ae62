//! Ball against half-space. Twin of `shaders/narrowphase/ball_halfspace.wgsl`.

use super::{Couple, flip};
use crate::math::rotate;
use glam::Vec3;
use tumble_core::layout::Manifold;

/// One point below the ball. `swapped`: the half-space comes first.
pub fn collide(couple: &Couple, swapped: bool) -> Manifold {
    // From here on a is the half-space.
    let couple = if swapped { *couple } else { couple.swap() };
    let (plane, ball) = (&couple.a, &couple.b);
    let normal = rotate(plane.rotation, Vec3::Y);
    let height = normal.dot(ball.position - plane.position);
    let separation = height - ball.size.x;
    let point = ball.position - normal * (ball.size.x + 0.5 * separation);
    let manifold = couple.single(normal, point, separation);
    if swapped { manifold } else { flip(manifold) }
}
