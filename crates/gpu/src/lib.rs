//! The GPU side of `tumble`: every pass as a wgpu compute shader.
//!
//! [`Gpu`] is a device and what can go wrong with it, [`Pipelines`] turns a shader into passes whose bindings go by
//! name, [`Buffers`] holds what has those names, and a [`Recorder`] records dispatches. The parts under [`primitives`]
//! work alone, on a user's own buffers.

mod batch;
mod bounds;
mod broadphase;
pub mod buffers;
mod contact;
pub mod device;
mod edit;
mod island;
mod joined;
mod joint;
mod level;
mod motion;
mod narrowphase;
pub mod pipelines;
pub mod primitives;
mod query;
pub mod readback;
pub mod recorder;
mod sleep;
mod solver;
mod split;
mod stages;
mod store;
mod timer;
mod world;

pub use buffers::Buffers;
pub use device::Gpu;
pub use pipelines::{Pass, Pipelines, Shader};
pub use readback::Readback;
pub use recorder::{Bind, BindCache, Recorder};
pub use timer::Timer;
pub use world::World;
