//! Where the bodies of joints are against each other, in f64, from the description of the joints alone.

use crate::handle::JointHandle;
use crate::joint::{JointAxis, JointBuilder};
use crate::poses::{Pose, Poses};
use crate::scene::Scene;
use glam::{DQuat, DVec3};

/// How far joints are from where they belong.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct JointError {
    /// Of the anchors along locked axes and beyond limits, the largest of all joints, m.
    pub max_m: f64,
    /// Its mean over all joints, m.
    pub mean_m: f64,
    /// Of angles about locked axes and beyond limits, the largest of all joints, rad.
    pub max_rad: f64,
}

/// How far all joints of a scene are from where they belong. Joints that are soft, or that broke, count as the others.
pub fn joint_error(scene: &Scene, poses: &Poses) -> JointError {
    let mut error = JointError::default();
    for handle in scene.joints() {
        let (Ok(joint), Some(at)) = (scene.joint(handle), joint_coordinates(scene, poses, handle)) else { continue };
        let [along, about] =
            [0, 3].map(|first| (first..first + 3).map(|axis| off(joint, axis, at[axis]).powi(2)).sum::<f64>().sqrt());
        error.max_m = error.max_m.max(along);
        error.mean_m += along / scene.joint_count() as f64;
        error.max_rad = error.max_rad.max(about);
    }
    error
}

/// How far the coordinate is from where its axis is locked, or beyond its limits.
fn off(joint: &JointBuilder, axis: usize, at: f64) -> f64 {
    if joint.locked[axis] {
        return at;
    }
    joint.limits[axis].map_or(0.0, |[low, high]| (f64::from(low) - at).max(at - f64::from(high)).max(0.0))
}

/// The six coordinates of a joint by [`JointAxis`], m and rad, as [`JointBuilder`] defines them; about locked axes of
/// hinges and universal joints the sine of what they are off by. None for a handle that is no more.
pub fn joint_coordinates(scene: &Scene, poses: &Poses, joint: JointHandle) -> Option<[f64; 6]> {
    let (builder, [a, b]) = (scene.joint(joint).ok()?, scene.joined(joint).ok()?);
    let (a, b) = (poses.get(a).ok()?, poses.get(b).ok()?);
    let turned = |pose: &Pose, local: glam::Quat| (pose.rotation.as_dquat() * local.as_dquat()).normalize();
    let (qa, qb) = (turned(a, builder.local_rotation1), turned(b, builder.local_rotation2));
    let place = |pose: &Pose, local: glam::Vec3| {
        pose.translation.as_dvec3() + pose.rotation.as_dquat().normalize() * local.as_dvec3()
    };
    let offset = place(b, builder.local_anchor2) - place(a, builder.local_anchor1);
    let along = if builder.coupled { DVec3::new(offset.length(), 0.0, 0.0) } else { qa.inverse() * offset };
    let about = angles(builder, qa.inverse() * qb);
    Some([along.x, along.y, along.z, about.x, about.y, about.z])
}

/// Angles of a rotation about the axes of the joint.
fn angles(joint: &JointBuilder, turn: DQuat) -> DVec3 {
    let about = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ].map(|axis| joint.locked[axis as usize]);
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let mut angles = DVec3::ZERO;
    match about.iter().filter(|&&locked| locked).count() {
        2 => {
            let free = about.iter().position(|locked| !locked).unwrap_or(0);
            let axis = DVec3::AXES[free];
            angles = axis.cross(turn * axis);
            angles[free] = 2.0 * turn.to_array()[free].atan2(turn.w);
        }
        1 => {
            let locked = about.iter().position(|locked| *locked).unwrap_or(0);
            let (j, k) = ((locked + 1) % 3, (locked + 2) % 3);
            let (second, first) = (turn * DVec3::AXES[k], turn.inverse() * DVec3::AXES[j]);
            angles[j] = second[locked].atan2(second[k]);
            angles[k] = first[locked].atan2(first[j]);
            angles[locked] = -second[j];
        }
        _ => angles = turn.to_scaled_axis(),
    }
    angles
}
