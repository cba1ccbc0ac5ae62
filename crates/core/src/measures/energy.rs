//! Energy and momentum of the dynamic bodies. The sums are f64; masses and inertias are the f32 values that the
//! backends use too.

use crate::builder::{RigidBodyBuilder, RigidBodyType};
use crate::handle::BodyHandle;
use crate::mass::MassProperties;
use crate::poses::{Pose, Poses, Velocities};
use crate::scene::Scene;
use glam::DVec3;

/// Kinetic energy, of translation and rotation, J.
pub fn kinetic_energy(scene: &Scene, poses: &Poses, velocities: &Velocities) -> f64 {
    dynamic_bodies(scene)
        .filter_map(|(body, _, mass)| {
            let (pose, velocity) = (poses.get(body).ok()?, velocities.get(body).ok()?);
            let (v, w) = (velocity.linear.as_dvec3(), velocity.angular.as_dvec3());
            Some(0.5 * f64::from(mass.mass) * v.length_squared() + 0.5 * w.dot(spin(&mass, pose, w)))
        })
        .sum()
}

/// Potential energy in the scene's gravity, J; zero for a centre of mass at the world's origin. Each body's
/// gravity scale counts.
pub fn potential_energy(scene: &Scene, poses: &Poses) -> f64 {
    let gravity = scene.gravity.as_dvec3();
    dynamic_bodies(scene)
        .filter_map(|(body, builder, mass)| {
            let center = center_of_mass(&mass, poses.get(body).ok()?);
            Some(-f64::from(mass.mass) * f64::from(builder.gravity_scale) * gravity.dot(center))
        })
        .sum()
}

/// Linear momentum, kg m/s.
pub fn linear_momentum(scene: &Scene, velocities: &Velocities) -> DVec3 {
    dynamic_bodies(scene)
        .filter_map(|(body, _, mass)| Some(f64::from(mass.mass) * velocities.get(body).ok()?.linear.as_dvec3()))
        .sum()
}

/// Angular momentum about the world's origin, kg m²/s.
pub fn angular_momentum(scene: &Scene, poses: &Poses, velocities: &Velocities) -> DVec3 {
    dynamic_bodies(scene)
        .filter_map(|(body, _, mass)| {
            let (pose, velocity) = (poses.get(body).ok()?, velocities.get(body).ok()?);
            let momentum = f64::from(mass.mass) * velocity.linear.as_dvec3();
            Some(center_of_mass(&mass, pose).cross(momentum) + spin(&mass, pose, velocity.angular.as_dvec3()))
        })
        .sum()
}

fn dynamic_bodies(scene: &Scene) -> impl Iterator<Item = (BodyHandle, &RigidBodyBuilder, MassProperties)> {
    scene.bodies().filter_map(|body| {
        let builder = scene.body(body).ok()?;
        let dynamic = builder.body_type == RigidBodyType::Dynamic;
        dynamic.then(|| scene.mass_properties(body).ok().map(|mass| (body, builder, mass)))?
    })
}

/// In the world, m.
fn center_of_mass(mass: &MassProperties, pose: &Pose) -> DVec3 {
    let rotation = pose.rotation.as_dquat().normalize();
    pose.translation.as_dvec3() + rotation * mass.center_of_mass.as_dvec3()
}

/// Angular momentum about the centre of mass at angular velocity `w` (rad/s, world axes), kg m²/s, world axes.
fn spin(mass: &MassProperties, pose: &Pose, w: DVec3) -> DVec3 {
    let principal = pose.rotation.as_dquat().normalize() * mass.principal_frame.as_dquat().normalize();
    principal * (mass.principal_inertia.as_dvec3() * (principal.inverse() * w))
}
