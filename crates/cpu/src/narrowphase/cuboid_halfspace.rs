//! Cuboid against half-space. Twin of `shaders/narrowphase/cuboid_halfspace.wgsl`.

use super::clip::{Candidates, reduce};
use super::{Couple, EMPTY, flip};
use crate::math::{rotate, rotate_back};
use glam::Vec3;
use tumble_core::layout::Manifold;

/// Up to four of the eight corners. `swapped`: the half-space comes first.
pub fn collide(couple: &Couple, swapped: bool) -> Manifold {
    // From here on a is the half-space.
    let couple = if swapped { *couple } else { couple.swap() };
    let (plane, cuboid) = (&couple.a, &couple.b);
    let normal = rotate(plane.rotation, Vec3::Y);
    // Most cuboids that the broad phase offers to a slanted half-space are nowhere near it.
    let down = rotate_back(cuboid.rotation, normal).abs().dot(cuboid.size);
    if normal.dot(cuboid.position - plane.position) - down > couple.farthest() {
        return EMPTY;
    }
    // Points that may come to touch while the manifold is recycled.
    let spare = couple.recycle_distance();
    let mut corners = Candidates::default();
    for corner in 0..8 {
        let sign = Vec3::new(side(corner, 0), side(corner, 1), side(corner, 2));
        let at = cuboid.position + rotate(cuboid.rotation, sign * cuboid.size);
        let separation = normal.dot(at - plane.position);
        let point = at - normal * (0.5 * separation);
        if separation <= couple.reach(point, normal) + spare {
            corners.push(point, separation, corner);
        }
    }
    let manifold = reduce(&corners, normal, 0.25 * couple.distance);
    if swapped { manifold } else { flip(manifold) }
}

fn side(corner: u32, axis: u32) -> f32 {
    if corner >> axis & 1 == 0 { -1.0 } else { 1.0 }
}
