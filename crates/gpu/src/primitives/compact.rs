//! Stable compaction: the host side of `shaders/primitives/compact.wgsl`, which says how it works.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use tumble_core::{Error, Result};
use wgpu::BufferUsages;

use super::scan::Shape;
use super::{Args, Count, Job, Scan, ScanOptions};
use crate::device::Gpu;
use crate::pipelines::{Pass, Pipelines};
use crate::recorder::{Bind, Recorder};

/// Elements of one workgroup.
const BLOCK: u32 = 2048;

/// What a [`Compact`] is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CompactOptions {
    /// Most elements that it will be given.
    pub capacity: u32,
    /// How many there are.
    pub count: Count,
    /// Word of the `counts` buffer where the number of those kept goes.
    pub kept: u32,
}

/// Keeps the elements that have a flag, in order. The passes are shared by all compactions of one [`Pipelines`]; the
/// scratch is its own.
#[derive(Debug)]
pub struct Compact {
    count_kept: Arc<Pass>,
    write_indices: Arc<Pass>,
    write_values: Arc<Pass>,
    options: CompactOptions,
    params: wgpu::Buffer,
    sums: wgpu::Buffer,
    scan: Scan,
    args: Option<Args>,
}

/// As in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct CompactParams {
    count: u32,
    count_word: u32,
    capacity: u32,
    unused: u32,
}

impl Compact {
    /// Makes a compaction.
    ///
    /// # Errors
    /// [`Error::Capacity`] when the host's count is more than the capacity; [`Error::Invalid`] when the number of those
    /// kept would go over the count; as for [`Pipelines::pass`] and [`Gpu::create_buffer`].
    pub fn new(gpu: &Gpu, pipelines: &mut Pipelines, options: CompactOptions) -> Result<Self> {
        let CompactOptions { capacity, count, kept } = options;
        if count == Count::Word(kept) {
            let (value, allowed) = (kept.to_string(), "another word than the count's");
            return Err(Error::Invalid { what: "Compact".into(), field: "kept", value, allowed });
        }
        let blocks = capacity.div_ceil(BLOCK);
        let scan_options = ScanOptions { capacity, count, total: Some(kept) };
        let scan = Scan::shaped(gpu, pipelines, scan_options, Shape { per: BLOCK, times: 1 })?;
        let args = match count {
            Count::Host(_) => None,
            Count::Word(word) => {
                let jobs = [Job::new(word, capacity, BLOCK), Job::new(word, capacity, Scan::BLOCK * BLOCK)];
                Some(Args::new(gpu, pipelines, &jobs)?)
            }
        };
        let mut pass = |entry| pipelines.pass(gpu, "primitives/compact", entry);
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let mut compact = Self {
            count_kept: pass("count_kept")?,
            write_indices: pass("write_indices")?,
            write_values: pass("write_values")?,
            options,
            params: gpu.create_buffer("compact params", size_of::<CompactParams>() as u64, uniform)?,
            sums: gpu.create_buffer("compact sums", u64::from(blocks) * 4, BufferUsages::STORAGE)?,
            scan,
            args,
        };
        compact.write(gpu, count);
        Ok(compact)
    }

    /// Most elements that it takes.
    pub fn capacity(&self) -> u32 {
        self.options.capacity
    }

    /// Bytes of its scratch.
    pub fn bytes(&self) -> u64 {
        self.sums.size()
    }

    /// Changes the number of elements that the host says, for all that is submitted from now on, recorded before or
    /// after.
    ///
    /// # Errors
    /// [`Error::Capacity`] when `count` is more than the capacity, [`Error::Invalid`] when the count is on the GPU.
    pub fn set_count(&mut self, gpu: &Gpu, count: u32) -> Result<()> {
        self.scan.set_count(gpu, count)?;
        self.write(gpu, Count::Host(count));
        Ok(())
    }

    /// The scan has found the count good.
    fn write(&mut self, gpu: &Gpu, count: Count) {
        self.options.count = count;
        let (count, count_word) = count.words();
        let params = CompactParams { count, count_word, capacity: self.options.capacity, unused: 0 };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
    }

    /// Records the compaction: to `kept` go, one word each and in order, the indices of the elements whose word of
    /// `flags` is not zero, or their `values`; how many there are goes to the word of `counts` that was asked for. All
    /// are storage; `kept` must hold as many words as can be kept, and what lies behind them stays.
    ///
    /// # Errors
    /// As for [`Recorder::dispatch`].
    pub fn record(
        &self,
        recorder: &mut Recorder,
        flags: &wgpu::Buffer,
        values: Option<&wgpu::Buffer>,
        kept: &wgpu::Buffer,
        counts: &wgpu::Buffer,
    ) -> Result<()> {
        if let Some(args) = &self.args {
            args.record(recorder, counts)?;
        }
        let [params, counted] = [Bind::new("params", &self.params), Bind::new("counts", counts)];
        let [flags, sums, kept] = [Bind::new("flags", flags), Bind::new("sums", &self.sums), Bind::new("kept", kept)];
        let binds = [params.clone(), counted.clone(), flags.clone(), sums.clone()];
        self.dispatch(recorder, &self.count_kept, &binds)?;
        let scan_args = self.args.as_ref().map(|args| (args.buffer(), 16));
        self.scan.record_with(recorder, &self.sums, counts, scan_args)?;
        match values.map(|values| Bind::new("values", values)) {
            None => self.dispatch(recorder, &self.write_indices, &[params, counted, flags, sums, kept]),
            Some(values) => self.dispatch(recorder, &self.write_values, &[params, counted, flags, values, sums, kept]),
        }
    }

    fn dispatch(&self, recorder: &mut Recorder, pass: &Pass, binds: &[Bind]) -> Result<()> {
        let most = match self.options.count {
            Count::Host(count) => count,
            Count::Word(_) => self.options.capacity,
        };
        match &self.args {
            Some(args) => recorder.dispatch_indirect(pass, binds, args.buffer(), 0),
            None => recorder.dispatch(pass, binds, most.div_ceil(BLOCK)),
        }
    }
}
