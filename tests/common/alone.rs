//! Passes run alone on the GPU, over buffers that a test fills and reads by name.

use std::collections::HashMap;

use bytemuck::Pod;
use tumble_gpu::readback::read_now;
use tumble_gpu::{Bind, BindCache, Buffers, Pipelines, Recorder};
use wgpu::BufferUsages;

use crate::common::gpu;

/// Named buffers, and pipelines of one order of invocations.
pub(crate) struct Alone {
    pub(crate) pipelines: Pipelines,
    pub(crate) buffers: Buffers,
    cache: BindCache,
    bytes: HashMap<&'static str, usize>,
}

/// Bytes from one element of the buffer of indices to the next: uniforms lie at multiples of that.
const STRIDE: u64 = 256;

impl Alone {
    pub(crate) fn new(permute: u32) -> Self {
        let pipelines = Pipelines::permuted(permute);
        let mut alone = Self { pipelines, buffers: Buffers::new(), cache: BindCache::new(), bytes: HashMap::new() };
        let mut indices = vec![0u32; 64 * STRIDE as usize / 4];
        for i in 0..64 {
            indices[i * STRIDE as usize / 4] = i as u32;
        }
        alone.put("indices", &indices);
        alone
    }

    /// Fills the buffer of this name, made anew when its size changes.
    pub(crate) fn put<T: Pod>(&mut self, name: &'static str, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        if self.bytes.insert(name, bytes.len()) != Some(bytes.len()) {
            // Never too small for one element of a struct.
            let usages = BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::INDIRECT;
            self.buffers.create(gpu(), name, 1, bytes.len().max(512) as u64, usages).unwrap();
        }
        gpu().queue.write_buffer(self.buffers.buffer(name).unwrap(), 0, bytes);
    }

    /// What the buffer of this name holds now.
    pub(crate) fn take<T: Pod>(&self, name: &'static str) -> Vec<T> {
        let bytes = self.bytes[name] as u64;
        match bytes {
            0 => Vec::new(),
            _ => bytemuck::pod_collect_to_vec(&read_now(gpu(), self.buffers.buffer(name).unwrap(), 0, bytes).unwrap()),
        }
    }

    /// Records what `f` asks for in one submission, and runs it.
    pub(crate) fn run(&mut self, f: impl FnOnce(&mut Chain)) {
        let recorder = Recorder::new(gpu(), &self.buffers, &mut self.cache, None);
        let mut chain = Chain { recorder, pipelines: &mut self.pipelines, buffers: &self.buffers };
        f(&mut chain);
        chain.recorder.submit().unwrap();
        gpu().check().unwrap();
    }
}

/// Passes one after the other.
pub(crate) struct Chain<'a> {
    pub(crate) recorder: Recorder<'a>,
    pipelines: &'a mut Pipelines,
    buffers: &'a Buffers,
}

impl<'a> Chain<'a> {
    /// `groups` workgroups of a pass.
    pub(crate) fn pass(&mut self, stem: &str, entry: &str, groups: u32) {
        self.record(stem, entry, &[], groups);
    }

    /// The same with `index` in the uniform `name`.
    pub(crate) fn indexed(&mut self, stem: &str, entry: &str, (name, index): (&str, u32), groups: u32) {
        let bind = self.index(name, index);
        self.record(stem, entry, &[bind], groups);
    }

    fn index<'b>(&self, name: &'b str, index: u32) -> Bind<'b>
    where
        'a: 'b,
    {
        let buffers: &'a Buffers = self.buffers;
        Bind::part(name, buffers.buffer("indices").unwrap(), u64::from(index) * STRIDE, 16)
    }

    fn record(&mut self, stem: &str, entry: &str, binds: &[Bind], groups: u32) {
        let pass = self.pipelines.pass(gpu(), stem, entry).unwrap();
        let mut binds = binds.to_vec();
        // One buffer under two names.
        if pass.bindings.iter().any(|binding| binding.name == "control") {
            binds.push(Bind::new("control", self.buffers.buffer("counters").unwrap()));
        }
        self.recorder.dispatch(&pass, &binds, groups).unwrap();
    }
}
