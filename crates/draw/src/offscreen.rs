//! A picture that is read back instead of shown.

use crate::{Camera, Renderer, Style, scoped, targets};
use std::sync::mpsc;
use tumble_core::{Error, Result};
use wgpu::{Buffer, BufferUsages, Device, Extent3d, Queue, Texture, TextureFormat, TextureUsages, TextureView};

/// A texture to draw into, and the way back to the host.
#[derive(Debug)]
pub struct Offscreen {
    device: Device,
    queue: Queue,
    size: (u32, u32),
    texture: Texture,
    view: TextureView,
    staging: Buffer,
}

impl Offscreen {
    /// What a [`Renderer`] for it draws.
    pub const FORMAT: TextureFormat = TextureFormat::Rgba8UnormSrgb;

    /// For pictures of `width` times `height` pixels.
    ///
    /// # Errors
    /// [`Error::Invalid`] when one of them is zero, or more than the device draws; [`Error::Limits`] when the whole is
    /// more than a buffer of the device holds; [`Error::Gpu`].
    pub fn new(device: &Device, queue: &Queue, width: u32, height: u32) -> Result<Self> {
        let size = (width, height);
        targets::check_size(device, size)?;
        let needed = u64::from(row_bytes(width)) * u64::from(height);
        let available = device.limits().max_buffer_size;
        if needed > available {
            let adapter = device.adapter_info().name;
            return Err(Error::Limits { adapter, limit: "max_buffer_size", needed, available });
        }
        let (texture, staging) = scoped(device, "a texture to draw into", || {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some("offscreen"),
                size: extent(size),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: Self::FORMAT,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            let staging = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("offscreen"),
                size: needed,
                usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            (texture, staging)
        })?;
        let view = texture.create_view(&Default::default());
        Ok(Self { device: device.clone(), queue: queue.clone(), size, texture, view, staging })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// To draw into, for who records the commands.
    pub fn view(&self) -> &TextureView {
        &self.view
    }

    /// Draws and waits for a picture: see [`Renderer::draw`] and [`read`](Self::read). The renderer must be one for
    /// [`Offscreen::FORMAT`] on the same device.
    ///
    /// # Errors
    /// As for both.
    pub fn picture(&self, renderer: &mut Renderer, camera: &Camera, poses: &Buffer, style: &Style) -> Result<Vec<u8>> {
        scoped(&self.device, "a picture", || {
            let mut encoder = self.device.create_command_encoder(&Default::default());
            renderer.draw(&mut encoder, &self.view, self.size, camera, poses, style)?;
            self.queue.submit([encoder.finish()]);
            Ok(())
        })??;
        self.read()
    }

    /// Waits for what was submitted, and reads the picture: four bytes a pixel (red, green, blue in sRGB, and 255), rows
    /// from the top, without gaps.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] when it cannot be read, [`Error::Gpu`].
    pub fn read(&self) -> Result<Vec<u8>> {
        let (stride, row) = (row_bytes(self.size.0), 4 * self.size.0 as usize);
        let (sender, receiver) = mpsc::channel();
        scoped(&self.device, "the read-back of a picture", || {
            let mut encoder = self.device.create_command_encoder(&Default::default());
            let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(stride), rows_per_image: None };
            let buffer = wgpu::TexelCopyBufferInfo { buffer: &self.staging, layout };
            encoder.copy_texture_to_buffer(self.texture.as_image_copy(), buffer, extent(self.size));
            self.queue.submit([encoder.finish()]);
            // Nobody listens any more only if this function has returned.
            self.staging.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
        })?;
        let lost = |reason: String| Error::DeviceLost { reason };
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| lost(error.to_string()))?;
        let told = receiver.recv().map_err(|error| lost(error.to_string()))?;
        told.map_err(|error| lost(error.to_string()))?;
        let mapped = self.staging.get_mapped_range(..);
        let mut pixels = Vec::with_capacity(row * self.size.1 as usize);
        if let Ok(bytes) = &mapped {
            for line in bytes.chunks_exact(stride as usize) {
                pixels.extend_from_slice(&line[..row]);
            }
        }
        let refused = mapped.map(drop);
        self.staging.unmap();
        refused
            .map_err(|error| Error::Gpu { what: "the read-back of a picture".into(), message: error.to_string() })?;
        Ok(pixels)
    }
}

/// Bytes of a row in a buffer: copies want a multiple of 256.
fn row_bytes(width: u32) -> u32 {
    (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

fn extent((width, height): (u32, u32)) -> Extent3d {
    Extent3d { width, height, depth_or_array_layers: 1 }
}
