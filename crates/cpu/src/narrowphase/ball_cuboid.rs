//! Ball against cuboid. Twin of `shaders/narrowphase/ball_cuboid.wgsl`.

use super::{Couple, flip};
use crate::math::{rotate, rotate_back};
use glam::Vec3;
use tumble_core::layout::Manifold;

/// One point. Outside, the cuboid's nearest point decides the normal; inside, its nearest face. `swapped`: the
/// cuboid comes first.
pub fn collide(couple: &Couple, swapped: bool) -> Manifold {
    // From here on a is the cuboid.
    let couple = if swapped { *couple } else { couple.swap() };
    let (cuboid, ball) = (&couple.a, &couple.b);
    let local = rotate_back(cuboid.rotation, ball.position - cuboid.position);
    let nearest = local.clamp(-cuboid.size, cuboid.size);
    let out = local - nearest;
    let distance = out.length();
    let (normal, depth) = if distance > 1e-7 { (out / distance, distance) } else { nearest_face(local, cuboid.size) };
    let normal = rotate(cuboid.rotation, normal);
    let separation = depth - ball.size.x;
    let point = ball.position - normal * (ball.size.x + 0.5 * separation);
    let manifold = couple.single(normal, point, separation);
    if swapped { manifold } else { flip(manifold) }
}

/// Outward normal of the face nearest to a point inside, and the (negative) distance to it.
fn nearest_face(local: Vec3, size: Vec3) -> (Vec3, f32) {
    let gap = size - local.abs();
    let sign = |x: f32| if x < 0.0 { -1.0 } else { 1.0 };
    if gap.x <= gap.y && gap.x <= gap.z {
        (Vec3::new(sign(local.x), 0.0, 0.0), -gap.x)
    } else if gap.y <= gap.z {
        (Vec3::new(0.0, sign(local.y), 0.0), -gap.y)
    } else {
        (Vec3::new(0.0, 0.0, sign(local.z)), -gap.z)
    }
}
