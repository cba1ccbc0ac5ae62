//! The CPU side of `tumble`: every pass as a typed function over slices, and a world that runs them.
//!
//! Each file has a shader of the same stem in `shaders/`; a pass here reads like that shader. Passes run in parallel
//! with rayon and give the same bits for any number of threads.

pub mod batch;
pub mod bounds;
pub mod broadphase;
pub mod contact;
pub mod continuous;
pub mod edit;
pub mod island;
pub mod joint;
pub mod level;
mod math;
pub mod motion;
pub mod narrowphase;
pub mod primitives;
pub mod query;
mod shared;
pub mod sleep;
pub mod solver;
mod workers;
mod world;

pub use world::World;
