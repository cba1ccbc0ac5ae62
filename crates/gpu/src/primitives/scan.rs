//! Exclusive scan of u32, in place: the host side of `shaders/primitives/scan.wgsl`, which says how it works.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use tumble_core::{Error, Result};
use wgpu::BufferUsages;

use super::{Args, Count, Job, NO_WORD, UNIFORM_STEP};
use crate::device::Gpu;
use crate::pipelines::{Pass, Pipelines};
use crate::recorder::{Bind, Recorder};

/// Elements of one workgroup.
const BLOCK: u32 = 2048;
/// Up to so many elements one workgroup scans alone: two dispatches less are worth its few turns.
const SHORT: u32 = 4 * BLOCK;
/// More would make `scan_sums` take more turns than every driver allows a loop (65,535 less a margin).
const MOST: u32 = 1 << 30;

/// What a [`Scan`] is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScanOptions {
    /// Most elements that it will be given, up to 2^30.
    pub capacity: u32,
    /// How many there are.
    pub count: Count,
    /// Word of the `counts` buffer where the sum of all goes.
    pub total: Option<u32>,
}

/// A scan of arrays up to some capacity. The passes are shared by all scans of one [`Pipelines`]; the scratch is its
/// own.
#[derive(Debug)]
pub struct Scan {
    passes: Passes,
    options: ScanOptions,
    shape: Shape,
    params: wgpu::Buffer,
    sums: wgpu::Buffer,
    no_counts: wgpu::Buffer,
    args: Option<Args>,
}

#[derive(Debug)]
struct Passes {
    reduce: Arc<Pass>,
    scan_sums: Arc<Pass>,
    scan_blocks: Arc<Pass>,
}

/// How the array's length follows from the count: `times` elements for each `per`, rounded up.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub(super) per: u32,
    pub(super) times: u32,
}

impl Shape {
    /// Length of the array for this count.
    fn elements(self, count: u32) -> u32 {
        count.div_ceil(self.per) * self.times
    }
}

/// As in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct ScanParams {
    count: u32,
    count_word: u32,
    per: u32,
    times: u32,
    units: u32,
    total_word: u32,
    unused: [u32; 2],
}

impl Scan {
    /// Elements that one workgroup scans.
    pub const BLOCK: u32 = BLOCK;

    /// Makes a scan.
    ///
    /// # Errors
    /// [`Error::Capacity`] when the capacity is more than 2^30 or the host's count more than the capacity; as for
    /// [`Pipelines::pass`] and [`Gpu::create_buffer`].
    pub fn new(gpu: &Gpu, pipelines: &mut Pipelines, options: ScanOptions) -> Result<Self> {
        let mut scan = Self::shaped(gpu, pipelines, options, Shape { per: 1, times: 1 })?;
        if let Count::Word(word) = options.count
            && !scan.is_short()
        {
            scan.args = Some(Args::new(gpu, pipelines, &[Job::new(word, options.capacity, BLOCK)])?);
        }
        Ok(scan)
    }

    /// A scan whose length follows from a count of something else; `options.capacity` is of that.
    pub(super) fn shaped(gpu: &Gpu, pipelines: &mut Pipelines, options: ScanOptions, shape: Shape) -> Result<Self> {
        let elements = u64::from(options.capacity.div_ceil(shape.per)) * u64::from(shape.times);
        if elements > u64::from(MOST) {
            return Err(Error::Capacity { buffer: "scan", needed: elements, capacity: MOST.into() });
        }
        let passes = Passes {
            reduce: pipelines.pass(gpu, "primitives/scan", "reduce")?,
            scan_sums: pipelines.pass(gpu, "primitives/scan", "scan_sums")?,
            scan_blocks: pipelines.pass(gpu, "primitives/scan", "scan_blocks")?,
        };
        let storage = BufferUsages::STORAGE;
        let mut scan = Self {
            passes,
            options,
            shape,
            params: gpu.create_buffer(
                "scan params",
                2 * UNIFORM_STEP,
                BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            )?,
            sums: gpu.create_buffer("scan sums", elements.div_ceil(BLOCK.into()) * 4, storage)?,
            no_counts: gpu.create_buffer("scan without counts", 4, storage)?,
            args: None,
        };
        scan.write(gpu, options.count)?;
        Ok(scan)
    }

    /// Most elements that it takes.
    pub fn capacity(&self) -> u32 {
        self.options.capacity
    }

    /// Changes the number of elements that the host says, for all that is submitted from now on, recorded before or
    /// after.
    ///
    /// # Errors
    /// [`Error::Capacity`] when `count` is more than the capacity, [`Error::Invalid`] when the count is on the GPU.
    pub fn set_count(&mut self, gpu: &Gpu, count: u32) -> Result<()> {
        if let Count::Word(word) = self.options.count {
            let (value, allowed) = (format!("{count} from the host"), "word of a buffer, as it was made");
            return Err(Error::Invalid { what: format!("count in word {word}"), field: "count", value, allowed });
        }
        self.write(gpu, Count::Host(count))
    }

    fn write(&mut self, gpu: &Gpu, count: Count) -> Result<()> {
        let capacity = self.options.capacity;
        if let Count::Host(count) = count
            && count > capacity
        {
            return Err(Error::Capacity { buffer: "scan", needed: count.into(), capacity: capacity.into() });
        }
        self.options.count = count;
        let (count, count_word) = count.words();
        let total_word = self.options.total.unwrap_or(NO_WORD);
        let Shape { per, times } = self.shape;
        let array =
            ScanParams { count, count_word, per, times, units: capacity.div_ceil(per), total_word, unused: [0; 2] };
        // The array of block sums has one element for each block: BLOCK / times units.
        let per = per * (BLOCK / times);
        let sums = ScanParams { per, times: 1, units: capacity.div_ceil(per), ..array };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&array));
        gpu.queue.write_buffer(&self.params, UNIFORM_STEP, bytemuck::bytes_of(&sums));
        Ok(())
    }

    fn is_short(&self) -> bool {
        self.shape.elements(self.options.capacity) <= SHORT
    }

    /// Records the scan of `data`: array of u32, read and written. `counts` (storage) is needed when the count or the
    /// total is a word of it.
    ///
    /// # Errors
    /// [`Error::Invalid`] when `counts` is needed and `None`; as for [`Recorder::dispatch`].
    pub fn record(&self, recorder: &mut Recorder, data: &wgpu::Buffer, counts: Option<&wgpu::Buffer>) -> Result<()> {
        let needed = self.options.total.is_some() || matches!(self.options.count, Count::Word(_));
        let counts = match counts {
            Some(counts) => counts,
            None if needed => return Err(no_counts("Scan")),
            None => &self.no_counts,
        };
        if let Some(args) = &self.args {
            args.record(recorder, counts)?;
        }
        self.record_with(recorder, data, counts, self.args.as_ref().map(|args| (args.buffer(), 0)))
    }

    /// The same with arguments (buffer and offset) for a count on the GPU that were made before, if they are needed.
    pub(super) fn record_with(
        &self,
        recorder: &mut Recorder,
        data: &wgpu::Buffer,
        counts: &wgpu::Buffer,
        args: Option<(&wgpu::Buffer, u64)>,
    ) -> Result<()> {
        let bytes = size_of::<ScanParams>() as u64;
        let params = Bind::part("params", &self.params, 0, bytes);
        let [data, counts] = [Bind::new("data", data), Bind::new("counts", counts)];
        let elements = match self.options.count {
            Count::Host(count) => self.shape.elements(count),
            Count::Word(_) => self.shape.elements(self.options.capacity),
        };
        if elements <= SHORT {
            return recorder.dispatch(&self.passes.scan_sums, &[params, counts, data], 1);
        }
        let sums = Bind::new("sums", &self.sums);
        let blocks = [params, counts.clone(), data, sums];
        let over_sums =
            [Bind::part("params", &self.params, UNIFORM_STEP, bytes), counts, Bind::new("data", &self.sums)];
        match (self.options.count, args) {
            (Count::Word(_), Some((args, offset))) => {
                recorder.dispatch_indirect(&self.passes.reduce, &blocks, args, offset)?;
                recorder.dispatch(&self.passes.scan_sums, &over_sums, 1)?;
                recorder.dispatch_indirect(&self.passes.scan_blocks, &blocks, args, offset)
            }
            _ => {
                let groups = elements.div_ceil(BLOCK);
                recorder.dispatch(&self.passes.reduce, &blocks, groups)?;
                recorder.dispatch(&self.passes.scan_sums, &over_sums, 1)?;
                recorder.dispatch(&self.passes.scan_blocks, &blocks, groups)
            }
        }
    }
}

/// The error for a missing buffer of counts.
pub(super) fn no_counts(what: &str) -> Error {
    let allowed = "a buffer, since the count or the total is a word of it";
    Error::Invalid { what: what.into(), field: "counts", value: "None".into(), allowed }
}
