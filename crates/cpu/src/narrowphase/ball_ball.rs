//! Ball against ball. Twin of `shaders/narrowphase/ball_ball.wgsl`.

use super::Couple;
use glam::Vec3;
use tumble_core::layout::Manifold;

/// One point midway between the surfaces. Balls at one place are pushed apart along y.
pub fn collide(couple: &Couple) -> Manifold {
    let (a, b) = (&couple.a, &couple.b);
    let between = b.position - a.position;
    let distance = between.length();
    let normal = if distance > 1e-9 { between / distance } else { Vec3::Y };
    let separation = distance - a.size.x - b.size.x;
    couple.single(normal, a.position + normal * (a.size.x + 0.5 * separation), separation)
}
