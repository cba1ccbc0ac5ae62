//! Draws a scene.

use crate::instances::{Instance, Instances};
use crate::pipelines::{DrawPipelines, Frame, Stroke, flags};
use crate::targets::{self, SHADOW_SIZE, Targets};
use crate::{Camera, Style, scoped};
use glam::{Mat4, Vec3, Vec4};
use tumble_core::{Error, Result, Scene};
use wgpu::util::DeviceExt;
use wgpu::{
    BindGroup, Buffer, BufferUsages, CommandEncoder, Device, IndexFormat, LoadOp, Operations, RenderPass, StoreOp,
    TextureFormat, TextureView,
};

/// Towards the key light.
const LIGHT: Vec3 = Vec3::new(0.45, 0.80, 0.40);
/// Corners of a quad as two triangles, three quads in turn (the faces of a box that an eye sees).
const QUADS: [u16; 18] = [0, 1, 2, 2, 1, 3, 4, 5, 6, 6, 5, 7, 8, 9, 10, 10, 9, 11];
/// Corners of the ball's shadow.
const DISC: u32 = 16;

/// Draws one scene's bodies where a buffer of poses says they are. One device, one format of pictures.
#[derive(Debug)]
pub struct Renderer {
    device: Device,
    format: TextureFormat,
    samples: u32,
    pipelines: DrawPipelines,
    shadow_map: TextureView,
    shadow_sampler: wgpu::Sampler,
    indices: Buffer,
    cuboids: List,
    balls: List,
    halfspaces: List,
    walls: u32,
    targets: Option<Targets>,
}

/// Instances of one shape on the device.
#[derive(Debug, Default)]
struct List {
    buffer: Option<Buffer>,
    count: u32,
}

impl Renderer {
    /// For pictures of `format` (any 8-bit colour; where it does not encode sRGB, the shaders do) of this scene.
    ///
    /// # Errors
    /// [`Error::Gpu`] when the device refuses, as one without storage buffers in vertex shaders does; [`Error::Limits`]
    /// as for [`set_scene`](Self::set_scene).
    pub fn new(device: &Device, format: TextureFormat, scene: &Scene) -> Result<Self> {
        let features = format.guaranteed_format_features(device.features()).flags;
        let can_sample = features.contains(wgpu::TextureFormatFeatureFlags::MULTISAMPLE_X4)
            && features.contains(wgpu::TextureFormatFeatureFlags::MULTISAMPLE_RESOLVE);
        let samples = if can_sample { 4 } else { 1 };
        let mut renderer = scoped(device, "the pipelines that draw", || {
            let mut indices: Vec<u16> = QUADS.into();
            indices.extend((1..DISC as u16 - 1).flat_map(|i| [0, i, i + 1]));
            Self {
                device: device.clone(),
                format,
                samples,
                pipelines: DrawPipelines::new(device, format, samples),
                shadow_map: targets::shadow_map(device),
                shadow_sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                    label: Some("shadow"),
                    mag_filter: wgpu::FilterMode::Linear,
                    min_filter: wgpu::FilterMode::Linear,
                    compare: Some(wgpu::CompareFunction::GreaterEqual),
                    ..Default::default()
                }),
                indices: buffer(device, "corners", bytemuck::cast_slice(&indices), BufferUsages::INDEX),
                cuboids: List::default(),
                balls: List::default(),
                halfspaces: List::default(),
                walls: 0,
                targets: None,
            }
        })?;
        renderer.set_scene(scene)?;
        Ok(renderer)
    }

    /// Takes over the scene's bodies, shapes and colours, after edits. Bodies that the buffer of poses does not hold yet,
    /// or no longer, are not drawn.
    ///
    /// # Errors
    /// [`Error::Limits`] when there are more colliders than a buffer of the device holds; [`Error::Gpu`].
    pub fn set_scene(&mut self, scene: &Scene) -> Result<()> {
        let all = Instances::of(scene);
        self.cuboids = self.list("cuboids", &all.cuboids)?;
        self.balls = self.list("balls", &all.balls)?;
        self.halfspaces = self.list("half-spaces", &all.halfspaces)?;
        self.walls = all.walls as u32;
        Ok(())
    }

    fn list(&self, name: &str, instances: &[Instance]) -> Result<List> {
        let (needed, available) = (size_of_val(instances) as u64, self.device.limits().max_buffer_size);
        if needed > available {
            let adapter = self.device.adapter_info().name;
            return Err(Error::Limits { adapter, limit: "max_buffer_size", needed, available });
        }
        if instances.is_empty() {
            return Ok(List::default());
        }
        let what = format!("the buffer of drawn {name}");
        let bytes = bytemuck::cast_slice(instances);
        let buffer = scoped(&self.device, &what, || buffer(&self.device, name, bytes, BufferUsages::VERTEX))?;
        Ok(List { buffer: Some(buffer), count: instances.len() as u32 })
    }

    /// Records a picture of `size` (width and height of `view`, pixels) into `encoder`. `poses` is what
    /// `World::pose_buffer` of the GPU side returns, or [`PoseUpload`](crate::PoseUpload): handed in each time, so that
    /// it may have been replaced. The picture shows what is in it when the commands run. Everything in `view` is
    /// overwritten. Nothing is drawn into a picture without pixels.
    ///
    /// # Errors
    /// [`Error::Invalid`] when the picture is larger than the device draws; [`Error::Gpu`].
    pub fn draw(
        &mut self,
        encoder: &mut CommandEncoder,
        view: &TextureView,
        size: (u32, u32),
        camera: &Camera,
        poses: &Buffer,
        style: &Style,
    ) -> Result<()> {
        if size.0 == 0 || size.1 == 0 {
            return Ok(());
        }
        let targets = match self.targets.take() {
            Some(targets) if targets.size == size => targets,
            _ => Targets::new(&self.device, self.format, self.samples, size)?,
        };
        let frame = self.frame(size, camera, style);
        let strokes = strokes(style);
        let (groups, strokes) = scoped(&self.device, "what a picture binds", || {
            // Made anew for each picture, so that several may be recorded before one is submitted.
            let strokes = (!strokes.is_empty()).then(|| {
                let bytes = bytemuck::cast_slice(&strokes);
                (buffer(&self.device, "strokes", bytes, BufferUsages::VERTEX), strokes.len() as u32)
            });
            (self.bind(&frame, poses, style), strokes)
        })?;
        if style.shadows {
            self.draw_shadows(encoder, &groups[0]);
        }
        let target = targets.samples.as_ref().unwrap_or(view);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("picture"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: targets.samples.is_some().then_some(view),
                ops: Operations {
                    load: LoadOp::Clear(wgpu::Color::BLACK),
                    store: if targets.samples.is_some() { StoreOp::Discard } else { StoreOp::Store },
                },
            })],
            depth_stencil_attachment: Some(depth_attachment(&targets.depth, StoreOp::Discard)),
            ..Default::default()
        });
        pass.set_bind_group(0, &groups[1], &[]);
        pass.set_index_buffer(self.indices.slice(..), IndexFormat::Uint16);
        pass.set_pipeline(&self.pipelines.cuboid);
        self.cuboids.draw(&mut pass, 0..18);
        pass.set_pipeline(&self.pipelines.ball);
        self.balls.draw(&mut pass, 0..6);
        pass.set_pipeline(&self.pipelines.ground);
        self.halfspaces.draw(&mut pass, 0..6);
        pass.set_pipeline(&self.pipelines.background);
        pass.draw(0..3, 0..1);
        if style.see_through && self.walls > 0 {
            pass.set_pipeline(&self.pipelines.glass);
            List { buffer: self.cuboids.buffer.clone(), count: self.walls }.draw(&mut pass, 0..18);
        }
        if let Some((buffer, count)) = strokes {
            pass.set_vertex_buffer(0, buffer.slice(..));
            for pipeline in [&self.pipelines.stroke_faint, &self.pipelines.stroke] {
                pass.set_pipeline(pipeline);
                pass.draw_indexed(0..6, 0, 0..count);
            }
        }
        drop(pass);
        self.targets = Some(targets);
        Ok(())
    }

    fn draw_shadows(&self, encoder: &mut CommandEncoder, group: &BindGroup) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadows"),
            color_attachments: &[],
            depth_stencil_attachment: Some(depth_attachment(&self.shadow_map, StoreOp::Store)),
            ..Default::default()
        });
        pass.set_bind_group(0, group, &[]);
        pass.set_index_buffer(self.indices.slice(..), IndexFormat::Uint16);
        pass.set_pipeline(&self.pipelines.cuboid_shadow);
        self.cuboids.draw(&mut pass, 0..18);
        pass.set_pipeline(&self.pipelines.ball_shadow);
        self.balls.draw(&mut pass, 18..18 + 3 * (DISC - 2));
    }

    /// The shadow pass's group and the picture's.
    fn bind(&self, frame: &Frame, poses: &Buffer, style: &Style) -> [BindGroup; 2] {
        let uniform = buffer(&self.device, "frame", bytemuck::bytes_of(frame), BufferUsages::UNIFORM);
        let none = [[0; 4]];
        let colors: &[[u8; 4]] = if style.colors.is_empty() { &none } else { style.colors };
        let colors = buffer(&self.device, "colours", bytemuck::cast_slice(colors), BufferUsages::STORAGE);
        let resources = [
            uniform.as_entire_binding(),
            poses.as_entire_binding(),
            colors.as_entire_binding(),
            wgpu::BindingResource::TextureView(&self.shadow_map),
            wgpu::BindingResource::Sampler(&self.shadow_sampler),
        ];
        let entries: Vec<_> =
            (0..).zip(resources).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
        [(&self.pipelines.shadow_layout, 2), (&self.pipelines.layout, 5)].map(|(layout, count)| {
            let entries = &entries[..count];
            self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("picture"), layout, entries })
        })
    }

    fn frame(&self, size: (u32, u32), camera: &Camera, style: &Style) -> Frame {
        let (width, height) = (size.0 as f32, size.1 as f32);
        let light = LIGHT.normalize();
        let tan = (0.5 * camera.fov_y).tan();
        let distance = camera.eye.distance(camera.look_at).max(camera.near);
        let radius = shadow_radius(1.2 * distance * tan * (width / height).max(1.0));
        let flag = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
        Frame {
            view_projection: camera.view_projection(width / height).to_cols_array_2d(),
            shadow_projection: shadow_projection(camera.look_at, light, radius).to_cols_array_2d(),
            eye: camera.eye.to_array(),
            near: camera.near,
            look_at: camera.look_at.to_array(),
            pixel: 2.0 * tan / height,
            forward: camera.axes()[2].to_array(),
            flags: flag(!self.format.is_srgb(), flags::ENCODE)
                | flag(style.shadows, flags::SHADOWS)
                | flag(style.see_through, flags::SEE_THROUGH)
                | flag(self.samples > 1, flags::SAMPLES),
            light: light.to_array(),
            texel: 2.0 * radius / SHADOW_SIZE as f32,
            size: [width, height],
            distance,
            pad: 0.0,
        }
    }
}

impl List {
    fn draw(&self, pass: &mut RenderPass, indices: std::ops::Range<u32>) {
        if let Some(buffer) = &self.buffer {
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw_indexed(indices, 0, 0..self.count);
        }
    }
}

/// In steps of a quarter of an octave, so that shadows stay as they are while the camera zooms a little.
fn shadow_radius(wanted: f32) -> f32 {
    ((4.0 * wanted.log2()).ceil() / 4.0).exp2()
}

/// World to the shadow map: `radius` to all sides of `middle`, and four times that towards the light and away from it.
fn shadow_projection(middle: Vec3, light: Vec3, radius: f32) -> Mat4 {
    let right = light.cross(Vec3::Z).normalize();
    let up = light.cross(right);
    // On whole texels, so that shadows do not swim while the camera moves.
    let texel = 2.0 * radius / SHADOW_SIZE as f32;
    let snap = |axis: Vec3| (middle.dot(axis) / texel).round() * texel / radius;
    let row = |axis: Vec3| (axis / radius).extend(-snap(axis));
    let depth = (light / (8.0 * radius)).extend(0.5 - middle.dot(light) / (8.0 * radius));
    Mat4::from_cols(row(right), row(up), depth, Vec4::W).transpose()
}

fn strokes(style: &Style) -> Vec<Stroke> {
    let dots = style.markers.iter().map(|marker| {
        let at = marker.position.to_array();
        Stroke { from: at, radius: marker.radius, to: at, color: marker.color }
    });
    let lines = style.lines.iter().map(|line| Stroke {
        from: line.from.to_array(),
        radius: 0.0,
        to: line.to.to_array(),
        color: line.color,
    });
    lines.chain(dots).collect()
}

fn depth_attachment(view: &TextureView, store: StoreOp) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    let depth_ops = Some(Operations { load: LoadOp::Clear(0.0), store });
    wgpu::RenderPassDepthStencilAttachment { view, depth_ops, stencil_ops: None }
}

fn buffer(device: &Device, label: &str, contents: &[u8], usage: BufferUsages) -> Buffer {
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
}
