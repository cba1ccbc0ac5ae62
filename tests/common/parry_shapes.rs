//! Colliders as parry has them.

use parry3d::shape::{Ball, Cuboid, HalfSpace, Shape};
use tumble_core::glam::Vec3;
use tumble_core::layout::{Collider, shape_kind};

/// A collider's shape, in the collider's frame.
pub(crate) fn shape_of(collider: &Collider) -> Option<Box<dyn Shape>> {
    match collider.shape {
        shape_kind::BALL => Some(Box::new(Ball::new(collider.size[0]))),
        shape_kind::CUBOID => Some(Box::new(Cuboid::new(Vec3::from_array(collider.size)))),
        shape_kind::HALFSPACE => Some(Box::new(HalfSpace::new(Vec3::Y))),
        _ => None,
    }
}
