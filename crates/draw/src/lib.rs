//! Pictures of scenes, drawn with wgpu.
//!
//! Poses are read in the vertex shaders from the buffer in which a world on the GPU keeps them: nothing is copied. For
//! poses that lie on the host, [`PoseUpload`] makes such a buffer. A [`Renderer`] draws into any texture, an
//! [`Offscreen`] is one that can be read back, a [`Camera`] says from where.
//!
//! Worlds are not known here: what is handed in is a device, a buffer of [`PoseRecord`](tumble_core::layout::PoseRecord)
//! and the [`Scene`](tumble_core::Scene) that tells shapes.

mod bounds;
mod camera;
mod instances;
mod offscreen;
mod pipelines;
mod poses;
mod renderer;
#[doc(hidden)]
pub mod shaders;
mod style;
mod targets;

pub use bounds::Bounds;
pub use camera::{Camera, OrbitCamera};
pub use offscreen::Offscreen;
pub use poses::PoseUpload;
pub use renderer::Renderer;
pub use style::{Line, Marker, Style};

use tumble_core::{Error, Result};

/// Runs `f`, which makes `what`, with every error of the device caught.
fn scoped<T>(device: &wgpu::Device, what: &str, f: impl FnOnce() -> T) -> Result<T> {
    let validation = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
    let value = f();
    // Last in, first out; no memory is the root of what is refused after it.
    let memory = pollster::block_on(memory.pop());
    match memory.or(pollster::block_on(validation.pop())) {
        Some(error) => Err(Error::Gpu { what: what.to_owned(), message: error.to_string() }),
        None => Ok(value),
    }
}
