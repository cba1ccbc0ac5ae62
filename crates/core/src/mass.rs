//! Mass, centre of mass and principal inertia of a body from its colliders. Parry knows each shape; compounds are
//! summed here in f64, because parry 0.31 finds wrong principal axes where the two smaller moments are equal (plates)
//! and where moments are below some 1e-5 kg m².

use crate::builder::ColliderBuilder;
use crate::shape::Shape;
use glam::{DMat3, DQuat, DVec3, Quat, Vec3};
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
        let parts: Vec<ParryMass> = colliders.filter_map(single).collect();
        match parts[..] {
            [] => Self::from(ParryMass::new(Vec3::ZERO, 0.0, Vec3::ZERO)),
            [one] => Self::from(one),
            _ => sum(&parts),
        }
    }

    fn from(own: ParryMass) -> Self {
        Self {
            mass: own.mass(),
            center_of_mass: own.local_com,
            principal_inertia: own.principal_inertia(),
            principal_frame: own.principal_inertia_local_frame.normalize(),
        }
    }
}

/// Those of several parts together, by parallel axes.
fn sum(parts: &[ParryMass]) -> MassProperties {
    let mass: f64 = parts.iter().map(|p| f64::from(p.mass())).sum();
    let center = parts.iter().map(|p| f64::from(p.mass()) * p.local_com.as_dvec3()).sum::<DVec3>() / mass;
    let mut tensor = DMat3::ZERO;
    for part in parts {
        let frame = DMat3::from_quat(part.principal_inertia_local_frame.as_dquat().normalize());
        let arm = part.local_com.as_dvec3() - center;
        let outer = DMat3::from_cols(arm * arm.x, arm * arm.y, arm * arm.z);
        tensor += frame * DMat3::from_diagonal(part.principal_inertia().as_dvec3()) * frame.transpose();
        tensor += (DMat3::from_diagonal(DVec3::splat(arm.length_squared())) - outer) * f64::from(part.mass());
    }
    let (moments, frame) = diagonalise(tensor);
    MassProperties {
        mass: mass as f32,
        center_of_mass: center.as_vec3(),
        principal_inertia: moments.as_vec3(),
        principal_frame: frame.as_quat().normalize(),
    }
}

/// Eigenvalues and eigenvectors of a symmetric matrix, by Jacobi's rotations; exact for any multiplicity and scale.
fn diagonalise(mut a: DMat3) -> (DVec3, DQuat) {
    let mut frame = DMat3::IDENTITY;
    for _sweep in 0..8 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a.col(q)[p];
            if off == 0.0 {
                continue;
            }
            let cotangent = (a.col(q)[q] - a.col(p)[p]) / (2.0 * off);
            let tangent = cotangent.signum() / (cotangent.abs() + (cotangent * cotangent + 1.0).sqrt());
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = cosine;
            turn.col_mut(q)[q] = cosine;
            turn.col_mut(q)[p] = tangent * cosine;
            turn.col_mut(p)[q] = -tangent * cosine;
            a = turn.transpose() * a * turn;
            frame *= turn;
        }
    }
    (DVec3::new(a.x_axis.x, a.y_axis.y, a.z_axis.z), DQuat::from_mat3(&frame).normalize())
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
