//! Mass, centre of mass and principal inertia of a body from its colliders; parry does the arithmetic.

use crate::builder::ColliderBuilder;
use crate::shape::Shape;
use glam::{Quat, Vec3};
use parry3d::mass_properties::MassProperties as ParryMass;
use parry3d::math::Pose as ParryPose;

/// What a body weighs and how it resists turning, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassProperties {
    /// kg.
    pub mass: f32,
    /// m.
    pub center_of_mass: Vec3,
    /// Principal moments about the centre of mass, kg m².
    pub principal_inertia: Vec3,
    /// Principal frame to body frame.
    pub principal_frame: Quat,
}

impl MassProperties {
    /// Those of all `colliders` together; mass zero when none has any.
    pub fn of<'a>(colliders: impl Iterator<Item = &'a ColliderBuilder>) -> Self {
        let sum = colliders
            .filter_map(single)
            .reduce(|a, b| a + b)
            .unwrap_or_else(|| ParryMass::new(Vec3::ZERO, 0.0, Vec3::ZERO));
        Self {
            mass: sum.mass(),
            center_of_mass: sum.local_com,
            principal_inertia: sum.principal_inertia(),
            principal_frame: sum.principal_inertia_local_frame.normalize(),
        }
    }
}

fn single(collider: &ColliderBuilder) -> Option<ParryMass> {
    let density = if collider.mass.is_some() { 1.0 } else { collider.density };
    let mut own = match collider.shape {
        Shape::Ball { radius } => ParryMass::from_ball(density, radius),
        Shape::Cuboid { half_extents } => ParryMass::from_cuboid(density, half_extents),
        Shape::HalfSpace { .. } => return None,
    };
    if let Some(mass) = collider.mass {
        own.set_mass(mass, true);
    }
    Some(own.transform_by(&ParryPose::from_parts(collider.translation, collider.rotation.normalize())))
}
