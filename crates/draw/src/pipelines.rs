//! Everything that is made once a device and format: layouts and pipelines.

use crate::shaders;
use crate::targets::DEPTH_FORMAT;
use bytemuck::{Pod, Zeroable};
use wgpu::{
    BindGroupLayout, BindGroupLayoutEntry, BindingType, BlendState, BufferBindingType, CompareFunction, Device,
    RenderPipeline, ShaderModule, ShaderStages, TextureFormat, VertexAttribute, VertexBufferLayout, VertexStepMode,
};

/// `Frame` of `frame.wgsl`. 208 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct Frame {
    pub(crate) view_projection: [[f32; 4]; 4],
    pub(crate) shadow_projection: [[f32; 4]; 4],
    pub(crate) eye: [f32; 3],
    pub(crate) near: f32,
    pub(crate) look_at: [f32; 3],
    pub(crate) pixel: f32,
    pub(crate) forward: [f32; 3],
    pub(crate) flags: u32,
    pub(crate) light: [f32; 3],
    pub(crate) texel: f32,
    pub(crate) size: [f32; 2],
    pub(crate) distance: f32,
    pub(crate) pad: f32,
}

/// Bits of [`Frame::flags`], as in `frame.wgsl`.
pub(crate) mod flags {
    pub(crate) const ENCODE: u32 = 1;
    pub(crate) const SHADOWS: u32 = 2;
    pub(crate) const SEE_THROUGH: u32 = 4;
    pub(crate) const SAMPLES: u32 = 8;
}

/// `Stroke` of `overlay.wgsl`. 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct Stroke {
    pub(crate) from: [f32; 3],
    pub(crate) radius: f32,
    pub(crate) to: [f32; 3],
    pub(crate) color: [u8; 4],
}

const INSTANCE: [VertexAttribute; 6] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Uint32, 2 => Float32x4, 3 => Float32x3, 4 => Uint32, 5 => Unorm8x4];
const STROKE: [VertexAttribute; 4] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Float32x3, 3 => Unorm8x4];

#[derive(Debug)]
pub(crate) struct DrawPipelines {
    /// Frame and poses.
    pub(crate) shadow_layout: BindGroupLayout,
    /// Frame, poses, colours, shadow map and its sampler.
    pub(crate) layout: BindGroupLayout,
    pub(crate) cuboid_shadow: RenderPipeline,
    pub(crate) ball_shadow: RenderPipeline,
    pub(crate) cuboid: RenderPipeline,
    pub(crate) ball: RenderPipeline,
    pub(crate) ground: RenderPipeline,
    pub(crate) background: RenderPipeline,
    pub(crate) glass: RenderPipeline,
    pub(crate) stroke: RenderPipeline,
    pub(crate) stroke_faint: RenderPipeline,
}

/// What tells one pipeline from the next.
struct Kind<'a> {
    module: &'a ShaderModule,
    vertex: &'a str,
    /// None draws depth alone, into the shadow map.
    fragment: Option<&'a str>,
    buffer: Option<VertexBufferLayout<'a>>,
    compare: CompareFunction,
    writes_depth: bool,
    blend: Option<BlendState>,
    /// The fragment's fourth component says how many of the samples it covers.
    covers: bool,
}

impl DrawPipelines {
    /// To be called in an error scope.
    pub(crate) fn new(device: &Device, format: TextureFormat, samples: u32) -> Self {
        let shadow_layout = group_layout(device, "shadow", &[uniform(0), storage(1)]);
        let layout = group_layout(device, "picture", &[uniform(0), storage(1), storage(2), map(3), sampler(4)]);
        let [bodies, ground, overlay] = shaders::ALL.map(|(name, text)| {
            let source = wgpu::ShaderSource::Wgsl(text.into());
            device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source })
        });
        let buffer = |attributes, array_stride| VertexBufferLayout {
            array_stride,
            step_mode: VertexStepMode::Instance,
            attributes,
        };
        let instance = || Some(buffer(&INSTANCE, size_of::<crate::instances::Instance>() as u64));
        let stroke = || Some(buffer(&STROKE, size_of::<Stroke>() as u64));
        let make = |layout: &BindGroupLayout, kind: Kind| pipeline(device, format, samples, layout, kind);
        let opaque = |module, vertex, fragment| Kind {
            module,
            vertex,
            fragment: Some(fragment),
            buffer: instance(),
            compare: CompareFunction::GreaterEqual,
            writes_depth: true,
            blend: None,
            covers: false,
        };
        let shadow = |vertex| Kind { fragment: None, ..opaque(&bodies, vertex, "") };
        let blended = |kind| Kind { blend: Some(BlendState::ALPHA_BLENDING), writes_depth: false, ..kind };
        let over = |fragment| Kind { buffer: stroke(), ..blended(opaque(&overlay, "stroke", fragment)) };
        Self {
            cuboid_shadow: make(&shadow_layout, shadow("cuboid_shadow")),
            ball_shadow: make(&shadow_layout, shadow("ball_shadow")),
            cuboid: make(&layout, opaque(&bodies, "cuboid", "cuboid_color")),
            ball: make(&layout, Kind { covers: true, ..opaque(&bodies, "ball", "ball_color") }),
            ground: make(&layout, opaque(&ground, "ground", "ground_color")),
            background: make(
                &layout,
                Kind { buffer: None, writes_depth: false, ..opaque(&ground, "background", "background_color") },
            ),
            glass: make(&layout, blended(opaque(&bodies, "glass", "glass_color"))),
            stroke: make(&layout, over("stroke_color")),
            stroke_faint: make(&layout, Kind { compare: CompareFunction::Less, ..over("stroke_faint") }),
            shadow_layout,
            layout,
        }
    }
}

fn pipeline(
    device: &Device,
    format: TextureFormat,
    samples: u32,
    layout: &BindGroupLayout,
    kind: Kind,
) -> RenderPipeline {
    let label = Some(kind.vertex);
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    // Colour alone: what covers a part of the samples makes no hole in the picture.
    let targets = [Some(wgpu::ColorTargetState { format, blend: kind.blend, write_mask: wgpu::ColorWrites::COLOR })];
    let buffers = [kind.buffer];
    let is_picture = kind.fragment.is_some();
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: kind.module,
            entry_point: Some(kind.vertex),
            compilation_options: Default::default(),
            buffers: if buffers[0].is_some() { &buffers } else { &[] },
        },
        primitive: Default::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(kind.writes_depth),
            depth_compare: Some(kind.compare),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: wgpu::MultisampleState {
            count: if is_picture { samples } else { 1 },
            mask: !0,
            alpha_to_coverage_enabled: kind.covers && samples > 1,
        },
        fragment: kind.fragment.map(|entry| wgpu::FragmentState {
            module: kind.module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn group_layout(device: &Device, label: &str, entries: &[BindGroupLayoutEntry]) -> BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
}

fn entry(binding: u32, visibility: ShaderStages, ty: BindingType) -> BindGroupLayoutEntry {
    BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

fn uniform(binding: u32) -> BindGroupLayoutEntry {
    let ty = BindingType::Buffer { ty: BufferBindingType::Uniform, has_dynamic_offset: false, min_binding_size: None };
    entry(binding, ShaderStages::VERTEX_FRAGMENT, ty)
}

fn storage(binding: u32) -> BindGroupLayoutEntry {
    let ty = BufferBindingType::Storage { read_only: true };
    entry(binding, ShaderStages::VERTEX, BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None })
}

fn map(binding: u32) -> BindGroupLayoutEntry {
    let ty = BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Depth,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    entry(binding, ShaderStages::FRAGMENT, ty)
}

fn sampler(binding: u32) -> BindGroupLayoutEntry {
    entry(binding, ShaderStages::FRAGMENT, BindingType::Sampler(wgpu::SamplerBindingType::Comparison))
}
