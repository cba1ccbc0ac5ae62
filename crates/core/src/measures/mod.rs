//! What a run is judged by, computed on the host in f64 from the scene and the poses and velocities that came
//! back: overlap, separation of joints, energy, momentum, and a hash of the exact state.

mod energy;
mod hash;
mod joints;
mod overlap;

pub use energy::{angular_momentum, kinetic_energy, linear_momentum, potential_energy};
pub use hash::state_hash;
pub use joints::{JointError, joint_coordinates, joint_error};
pub use overlap::{
    DPose, ball_ball_separation, ball_cuboid_separation, ball_halfspace_separation, cuboid_cuboid_separation,
    cuboid_halfspace_separation, penetration,
};

use crate::builder::RigidBodyType;
use crate::handle::BodyHandle;
use crate::poses::{Pose, Poses, Velocities, Velocity};
use crate::scene::Scene;
use glam::Vec3;

/// The poses with which the bodies were inserted (m, body frame to world), as step 0.
pub fn initial_poses(scene: &Scene) -> Poses {
    let bodies = scene.bodies.iter().map(|(slot, generation, entry)| {
        let body = &entry.builder;
        let pose = Pose { translation: body.translation, rotation: body.rotation.normalize() };
        (BodyHandle { slot, generation }, pose)
    });
    Poses::collect(0, bodies)
}

/// The velocities with which the bodies were inserted (m/s, rad/s, world axes), as step 0.
pub fn initial_velocities(scene: &Scene) -> Velocities {
    let bodies = scene.bodies.iter().map(|(slot, generation, entry)| {
        let body = &entry.builder;
        let fixed = body.body_type == RigidBodyType::Fixed;
        let velocity = if fixed {
            Velocity { linear: Vec3::ZERO, angular: Vec3::ZERO }
        } else {
            Velocity { linear: body.linvel, angular: body.angvel }
        };
        (BodyHandle { slot, generation }, velocity)
    });
    Velocities::collect(0, bodies)
}
