//! **tumble** simulates rigid bodies on any GPU that wgpu reaches, and on the CPU. Every pass exists twice: a WGSL
//! compute shader, and a plain Rust function that computes the same thing.
//!
//! ```
//! use tumble::prelude::*;
//!
//! # fn main() -> Result<()> {
//! let mut scene = Scene::new();
//! scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
//! let ball = scene.insert(
//!     RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, 10.0, 0.0)),
//!     ColliderBuilder::ball(0.5).restitution(0.7),
//! );
//! scene.attach(ball.body, ColliderBuilder::cuboid(0.1, 0.1, 0.1).translation(Vec3::X))?;
//! let mut world = World::new(scene, Params::default(), Backend::Auto)?;
//! for _ in 0..300 {
//!     world.step()?;
//! }
//! let report = world.sync()?;
//! let poses = world.poses()?;
//! println!("{:?} {report}", poses[ball.body]);
//! assert!(poses[ball.body].translation.y < 1.0);
//! # Ok(())
//! # }
//! ```

mod world;

#[cfg(feature = "cpu")]
pub use tumble_cpu as cpu;
#[cfg(feature = "gpu")]
pub use tumble_gpu as gpu;

pub use tumble_core as core;
pub use tumble_core::{
    Accuracy, Batching, BodyHandle, Broadphase, Capacities, ColliderBuilder, ColliderHandle, CombineRule, Contact,
    ContactPoint, Contacts, Editor, Error, GaussSeidel, Inserted, Jacobi, JointAxis, JointBuilder, JointHandle,
    JointMotor, JointReading, JointSoftness, JointSolver, Joints, JointsSolved, LastBatch, MortonBits, MotorModel,
    Nearest, NearestQuery, OnePass, Overlap, OverlapShape, Overlaps, Params, Penalty, Pose, Poses, Ray, RayHit, Result,
    RigidBodyBuilder, RigidBodyType, Scene, Shape, Sleep, Soft, Solver, Spent, StepReport, Traversal, Velocities,
    Velocity,
};
pub use world::{Backend, World};

/// What most programs need.
pub mod prelude {
    pub use crate::{
        Accuracy, Backend, Batching, BodyHandle, Broadphase, Capacities, ColliderBuilder, ColliderHandle, CombineRule,
        Contact, ContactPoint, Contacts, Error, JointAxis, JointBuilder, JointHandle, JointMotor, JointReading,
        JointSolver, Joints, MotorModel, Nearest, NearestQuery, Overlap, OverlapShape, Overlaps, Params, Pose, Poses,
        Ray, RayHit, Result, RigidBodyBuilder, RigidBodyType, Scene, Shape, Sleep, StepReport, Velocities, Velocity,
        World,
    };
    pub use glam::{Quat, Vec3};
}
