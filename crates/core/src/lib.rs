//! The ground floor of `tumble`: what a scene is, how it lies in memory, what a step is told and what it
//! reports. No pass lives here; both backends build on this crate and neither sees the other.
//!
//! Data flows one way: [`Scene`] (builders, handles) → [`PackedScene`] (flat arrays) → a backend's buffers →
//! [`StepReport`] and poses.

mod accuracy;
mod builder;
mod choice;
pub mod contacts;
pub mod edit;
#[doc(hidden)]
pub mod elimination;
mod error;
mod handle;
mod joint;
mod joint_edits;
pub mod joints;
pub mod layout;
pub mod limits;
mod mass;
pub mod measures;
mod packed;
mod params;
pub mod plan;
mod poses;
pub mod query;
mod report;
mod scene;
pub mod scenes;
mod shape;
mod solver;
#[doc(hidden)]
pub mod stopwatch;
#[doc(hidden)]
pub mod topology;
pub mod validate;
pub mod wear;

pub use accuracy::{Accuracy, Spent, WantedLevels};
pub use builder::{ColliderBuilder, CombineRule, RigidBodyBuilder, RigidBodyType};
pub use choice::Spread;
pub use contacts::{Contact, ContactPoint, Contacts};
pub use edit::Editor;
pub use error::{Error, Result};
pub use handle::{BodyHandle, ColliderHandle, Inserted, JointHandle};
pub use joint::{JointAxis, JointBuilder, JointMotor, JointSoftness, MotorModel};
pub use joint_edits::JointSet;
pub use joints::{JointReading, Joints};
pub use mass::MassProperties;
pub use packed::PackedScene;
pub use params::{Batching, Broadphase, Capacities, LastBatch, MortonBits, Params, Sleep, Traversal};
pub use plan::Plan;
pub use poses::{Pose, Poses, Velocities, Velocity};
pub use query::{Nearest, NearestQuery, Overlap, OverlapShape, Overlaps, Ray, RayHit};
pub use report::{JointsSolved, Penetration, StageRun, StageTime, StepReport};
pub use scene::Scene;
pub use shape::Shape;
pub use solver::{GaussSeidel, Jacobi, OnePass, Penalty, Soft, Solver};
pub use topology::{JointSolver, Topology};

pub use glam;
