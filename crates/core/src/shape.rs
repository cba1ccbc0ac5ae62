use crate::error::{Result, check};
use crate::layout::shape_kind;
use glam::Vec3;

/// The form of a collider, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Shape {
    /// A ball about the origin.
    Ball {
        /// m, above zero.
        radius: f32,
    },
    /// A box about the origin.
    Cuboid {
        /// m, each above zero.
        half_extents: Vec3,
    },
    /// Everything on the side of the origin's plane that `normal` points away from. It has no mass.
    HalfSpace {
        /// Outward, unit.
        normal: Vec3,
    },
}

impl Shape {
    pub(crate) fn validate(&self, what: &impl Fn() -> String) -> Result<()> {
        const SIZE: &str = "finite numbers from 1e-6 to 1e6 m";
        let fits = |x: f32| (1e-6..=1e6).contains(&x);
        match *self {
            Shape::Ball { radius } => check(fits(radius), what, "ball.radius", radius, SIZE),
            Shape::Cuboid { half_extents } => check(
                half_extents.to_array().into_iter().all(fits),
                what,
                "cuboid.half_extents",
                half_extents.to_array(),
                SIZE,
            ),
            Shape::HalfSpace { normal } => check(
                (1e-6..=1e6).contains(&normal.length()),
                what,
                "halfspace.normal",
                normal.to_array(),
                "a vector of length 1e-6 to 1e6 (it is normalised)",
            ),
        }
    }

    /// `size` and `shape` of [`layout::Collider`](crate::layout::Collider).
    pub(crate) fn pack(&self) -> ([f32; 3], u32) {
        match *self {
            Shape::Ball { radius } => ([radius, 0.0, 0.0], shape_kind::BALL),
            Shape::Cuboid { half_extents } => (half_extents.to_array(), shape_kind::CUBOID),
            Shape::HalfSpace { .. } => ([0.0; 3], shape_kind::HALFSPACE),
        }
    }
}
