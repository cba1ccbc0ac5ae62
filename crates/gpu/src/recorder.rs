//! Recording a step: dispatches, one after the other, in one compute pass.

use std::collections::HashMap;

use tumble_core::{Error, Result};
use wgpu::{CommandEncoder, ComputePass, SubmissionIndex};

use crate::buffers::Buffers;
use crate::device::Gpu;
use crate::pipelines::Pass;
use crate::timer::Timer;

/// Workgroups that one dimension of a dispatch holds.
const MOST_PER_DIMENSION: u32 = 65_535;

/// Submissions after which a bind group that was not used is dropped.
const KEPT_FOR: u64 = 64;

/// A buffer, or a part of one, for one of a pass's names.
#[derive(Debug, Clone, PartialEq)]
pub struct Bind<'a> {
    /// The global's name in the shader.
    pub name: &'a str,
    /// The buffer.
    pub buffer: &'a wgpu::Buffer,
    /// First byte of the part: a multiple of 256.
    pub offset: u64,
    /// Bytes of the part; `None` for all from `offset` on.
    pub bytes: Option<std::num::NonZeroU64>,
}

impl<'a> Bind<'a> {
    /// The whole buffer.
    pub fn new(name: &'a str, buffer: &'a wgpu::Buffer) -> Self {
        Self { name, buffer, offset: 0, bytes: None }
    }

    /// `bytes` bytes from `offset` (a multiple of 256) on; all from there on when `bytes` is 0.
    pub fn part(name: &'a str, buffer: &'a wgpu::Buffer, offset: u64, bytes: u64) -> Self {
        Self { name, buffer, offset, bytes: std::num::NonZeroU64::new(bytes) }
    }

    fn is(&self, kept: &(String, wgpu::Buffer, u64, u64)) -> bool {
        let bytes = self.bytes.map_or(0, std::num::NonZeroU64::get);
        self.name == kept.0 && *self.buffer == kept.1 && self.offset == kept.2 && bytes == kept.3
    }

    fn kept(&self) -> (String, wgpu::Buffer, u64, u64) {
        let bytes = self.bytes.map_or(0, std::num::NonZeroU64::get);
        (self.name.to_owned(), self.buffer.clone(), self.offset, bytes)
    }
}

/// Bind groups kept from step to step, so that a step like the last one makes none.
#[derive(Debug, Default)]
pub struct BindCache {
    generation: u64,
    submissions: u64,
    created: u64,
    groups: HashMap<u64, Vec<CachedGroup>>,
}

#[derive(Debug)]
struct CachedGroup {
    overrides: Vec<(String, wgpu::Buffer, u64, u64)>,
    group: wgpu::BindGroup,
    used: u64,
}

impl BindCache {
    /// Nothing kept yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Bind groups made so far, all told.
    pub fn created(&self) -> u64 {
        self.created
    }

    fn group(&mut self, gpu: &Gpu, buffers: &Buffers, pass: &Pass, overrides: &[Bind]) -> Result<&wgpu::BindGroup> {
        if self.generation != buffers.generation() {
            // Some named buffer was replaced, and a group of this cache may still hold the old one.
            self.groups.clear();
            self.generation = buffers.generation();
        }
        let groups = self.groups.entry(pass.id).or_default();
        let same = |cached: &CachedGroup| {
            cached.overrides.len() == overrides.len()
                && overrides.iter().zip(&cached.overrides).all(|(bind, kept)| bind.is(kept))
        };
        let index = match groups.iter().position(same) {
            Some(index) => index,
            None => {
                let group = bind_group(gpu, buffers, pass, overrides)?;
                let overrides = overrides.iter().map(Bind::kept).collect();
                groups.push(CachedGroup { overrides, group, used: 0 });
                self.created += 1;
                groups.len() - 1
            }
        };
        groups[index].used = self.submissions;
        Ok(&groups[index].group)
    }

    /// Counts one submission and drops what was not used for long.
    fn age(&mut self) {
        self.submissions += 1;
        let oldest = self.submissions.saturating_sub(KEPT_FOR);
        self.groups.retain(|_, groups| {
            groups.retain(|group| group.used >= oldest);
            !groups.is_empty()
        });
    }
}

fn bind_group(gpu: &Gpu, buffers: &Buffers, pass: &Pass, overrides: &[Bind]) -> Result<wgpu::BindGroup> {
    if let Some(stray) = overrides.iter().find(|bind| pass.bindings.iter().all(|binding| binding.name != bind.name)) {
        let message = format!("it binds nothing called `{}`", stray.name);
        return Err(Error::Gpu { what: format!("pass {}", pass.label), message });
    }
    let mut entries = Vec::with_capacity(pass.bindings.len());
    for binding in &pass.bindings {
        let bound = match overrides.iter().find(|bind| bind.name == binding.name) {
            Some(bind) => wgpu::BufferBinding { buffer: bind.buffer, offset: bind.offset, size: bind.bytes },
            None => wgpu::BufferBinding { buffer: buffers.buffer(&binding.name)?, offset: 0, size: None },
        };
        entries.push(wgpu::BindGroupEntry { binding: binding.binding, resource: wgpu::BindingResource::Buffer(bound) });
    }
    let descriptor = wgpu::BindGroupDescriptor { label: Some(&pass.label), layout: &pass.layout, entries: &entries };
    gpu.scoped(&format!("bindings of pass {}", pass.label), || gpu.device.create_bind_group(&descriptor))
}

/// `groups` workgroups over two dimensions, (x, y): as few rows as will do, at most y - 1 workgroups too many. What
/// `primitives/args.wgsl` does for counts that only the GPU knows.
pub fn split(groups: u32) -> (u32, u32) {
    let y = groups.div_ceil(MOST_PER_DIMENSION).max(1);
    (groups.div_ceil(y), y)
}

/// Commands of one submission. Dispatches go into one compute pass (one a stage when a timer runs); nothing runs
/// before [`Recorder::submit`].
pub struct Recorder<'a> {
    gpu: &'a Gpu,
    buffers: &'a Buffers,
    cache: &'a mut BindCache,
    timer: Option<&'a mut Timer>,
    // Declared before the encoder, so that it is dropped, and ended, before it.
    compute: Option<ComputePass<'static>>,
    encoder: CommandEncoder,
    pipeline: Option<u64>,
    stage: Option<&'static str>,
    dispatches: u32,
}

impl<'a> Recorder<'a> {
    /// Starts recording. Names that a dispatch does not override are looked up in `buffers`; with a `timer`, each
    /// stage is timed.
    pub fn new(gpu: &'a Gpu, buffers: &'a Buffers, cache: &'a mut BindCache, timer: Option<&'a mut Timer>) -> Self {
        let encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("tumble") });
        let timer = timer.and_then(|timer| timer.start().then_some(timer));
        Self { gpu, buffers, cache, timer, compute: None, encoder, pipeline: None, stage: None, dispatches: 0 }
    }

    /// The device that this records for.
    pub fn gpu(&self) -> &'a Gpu {
        self.gpu
    }

    /// Dispatches recorded so far.
    pub fn dispatches(&self) -> u32 {
        self.dispatches
    }

    /// What follows belongs to the stage of this name; a name may come back, and its times add up.
    pub fn stage(&mut self, name: &'static str) {
        if self.timer.is_some() && self.stage != Some(name) {
            self.compute = None;
        }
        self.stage = Some(name);
    }

    /// Records `groups` workgroups of `pass`; none when `groups` is 0. More than 65,535 take two dimensions, and may be
    /// some too many.
    ///
    /// # Errors
    /// [`Error::Gpu`] when a name has no buffer, or a buffer does not fit the pass.
    pub fn dispatch(&mut self, pass: &Pass, overrides: &[Bind], groups: u32) -> Result<()> {
        if groups == 0 {
            return Ok(());
        }
        let (x, y) = split(groups);
        self.prepare(pass, overrides)?.dispatch_workgroups(x, y, 1);
        Ok(())
    }

    /// Records `pass` with the three numbers of workgroups that lie in `args` from byte `offset` on, when it runs.
    ///
    /// # Errors
    /// As for [`Recorder::dispatch`].
    pub fn dispatch_indirect(
        &mut self,
        pass: &Pass,
        overrides: &[Bind],
        args: &wgpu::Buffer,
        offset: u64,
    ) -> Result<()> {
        self.prepare(pass, overrides)?.dispatch_workgroups_indirect(args, offset);
        Ok(())
    }

    fn prepare(&mut self, pass: &Pass, overrides: &[Bind]) -> Result<&mut ComputePass<'static>> {
        let group = self.cache.group(self.gpu, self.buffers, pass, overrides)?;
        let compute = match &mut self.compute {
            Some(compute) => compute,
            none => {
                let stage = self.stage.unwrap_or("other");
                let timestamp_writes = self.timer.as_mut().and_then(|timer| timer.stage(stage));
                let descriptor = wgpu::ComputePassDescriptor { label: Some(stage), timestamp_writes };
                self.pipeline = None;
                // The encoder is not touched before the pass ends, which `encoder` and `submit` see to.
                none.insert(self.encoder.begin_compute_pass(&descriptor).forget_lifetime())
            }
        };
        if self.pipeline != Some(pass.id) {
            compute.set_pipeline(&pass.pipeline);
            self.pipeline = Some(pass.id);
        }
        compute.set_bind_group(0, group, &[]);
        self.dispatches += 1;
        Ok(compute)
    }

    /// The encoder, for copies: ends the compute pass, and the next dispatch begins another.
    pub fn encoder(&mut self) -> &mut CommandEncoder {
        self.compute = None;
        &mut self.encoder
    }

    /// Submits all that was recorded.
    ///
    /// # Errors
    /// [`Error::Gpu`] when the device refuses it, [`Error::DeviceLost`] when it is gone.
    pub fn submit(mut self) -> Result<SubmissionIndex> {
        self.compute = None;
        if let Some(timer) = self.timer.as_mut() {
            timer.finish(&mut self.encoder);
        }
        let Self { gpu, cache, encoder, timer, .. } = self;
        cache.age();
        let index = gpu.scoped("a step", || gpu.queue.submit([encoder.finish()]))?;
        if let Some(timer) = timer {
            timer.submitted(&index);
        }
        Ok(index)
    }
}
