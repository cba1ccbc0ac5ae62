//! Textures that a picture needs besides the one it is drawn into: samples, depth, and the shadow map.

use crate::scoped;
use tumble_core::{Error, Result};
use wgpu::{Device, Extent3d, TextureFormat, TextureUsages, TextureView};

pub(crate) const DEPTH_FORMAT: TextureFormat = TextureFormat::Depth32Float;
/// Texels along an edge of the shadow map; what every device has.
pub(crate) const SHADOW_SIZE: u32 = 2048;

/// Of one size, kept from picture to picture.
#[derive(Debug)]
pub(crate) struct Targets {
    pub(crate) size: (u32, u32),
    pub(crate) depth: TextureView,
    /// Where there are several samples a pixel; resolved into the picture.
    pub(crate) samples: Option<TextureView>,
}

impl Targets {
    pub(crate) fn new(device: &Device, format: TextureFormat, samples: u32, size: (u32, u32)) -> Result<Self> {
        check_size(device, size)?;
        let make = |label, format| texture(device, label, format, samples, size, TextureUsages::RENDER_ATTACHMENT);
        scoped(device, "textures to draw into", || Self {
            size,
            depth: make("depth", DEPTH_FORMAT),
            samples: (samples > 1).then(|| make("samples", format)),
        })
    }
}

pub(crate) fn shadow_map(device: &Device) -> TextureView {
    let usage = TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING;
    texture(device, "shadow map", DEPTH_FORMAT, 1, (SHADOW_SIZE, SHADOW_SIZE), usage)
}

fn texture(
    device: &Device,
    label: &str,
    format: TextureFormat,
    sample_count: u32,
    (width, height): (u32, u32),
    usage: TextureUsages,
) -> TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    });
    texture.create_view(&Default::default())
}

/// Refuses pictures without pixels, and those larger than a texture of the device may be.
pub(crate) fn check_size(device: &Device, (width, height): (u32, u32)) -> Result<()> {
    let most = device.limits().max_texture_dimension_2d;
    for (field, value) in [("width", width), ("height", height)] {
        if value == 0 {
            let (what, value) = ("the picture".into(), value.to_string());
            return Err(Error::Invalid { what, field, value, allowed: "1 pixel and more" });
        }
        if value > most {
            let value = format!("{value}, and this device draws at most {most}");
            let allowed = "what the device's max_texture_dimension_2d allows, in pixels";
            return Err(Error::Invalid { what: "the picture".into(), field, value, allowed });
        }
    }
    Ok(())
}
