//! Stable radix sort: the host side of `shaders/primitives/sort.wgsl`, which says how it works.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use tumble_core::{Error, Result};
use wgpu::BufferUsages;

use super::scan::{Shape, no_counts};
use super::{Args, Count, Job, Scan, ScanOptions, UNIFORM_STEP};
use crate::device::Gpu;
use crate::pipelines::{Pass, Pipelines};
use crate::recorder::{Bind, Recorder};

/// Elements of one workgroup.
const BLOCK: u32 = 3072;
/// Most bits of one digit.
const DIGIT_BITS: u32 = 8;

/// What a [`Sort`] is to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SortOptions {
    /// Most elements that it will be given.
    pub capacity: u32,
    /// How many there are.
    pub count: Count,
    /// One entry for each word of a key, 1 to 4, most significant word first: how many of its lowest bits count, 0 to
    /// 32. The others move with the element.
    pub bits: Vec<u32>,
}

/// How a workgroup finds the order of its elements. The result is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Ranking {
    /// With workgroup memory alone, on any device. What [`Sort::new`] takes.
    #[default]
    Portable,
    /// With sub-group operations, on devices that have `wgpu::Features::SUBGROUP` ([`Gpu::has_subgroups`]); slow where
    /// sub-groups have fewer than 32 invocations. Measure before choosing it: `cargo bench --bench sort`.
    Subgroup,
}

/// A sort of keys of one shape, with one u32 value each, up to some capacity. The passes are shared by all sorts of one
/// [`Pipelines`]; the scratch, as large as the keys and values together, is its own.
#[derive(Debug)]
pub struct Sort {
    passes: Passes,
    options: SortOptions,
    digits: Vec<Digit>,
    /// Rows of the histogram: values of the widest digit.
    radix: u32,
    params: wgpu::Buffer,
    keys: wgpu::Buffer,
    values: wgpu::Buffer,
    histogram: wgpu::Buffer,
    no_counts: wgpu::Buffer,
    scan: Scan,
    args: Option<Args>,
}

#[derive(Debug)]
struct Passes {
    count_digits: Arc<Pass>,
    scatter: Arc<Pass>,
    copy: Arc<Pass>,
}

/// Some bits of one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Digit {
    word: u32,
    shift: u32,
    mask: u32,
}

/// Where a pass reads or writes.
#[derive(Debug, Clone, Copy)]
struct Ends<'a> {
    keys: &'a wgpu::Buffer,
    values: &'a wgpu::Buffer,
}

/// As in the shader.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct SortParams {
    count: u32,
    count_word: u32,
    capacity: u32,
    words: u32,
    word: u32,
    shift: u32,
    mask: u32,
    radix: u32,
}

/// The digits of a key, least significant first; none spans two words, and those of a word share its bits evenly.
fn digits(bits: &[u32]) -> Vec<Digit> {
    let mut digits = Vec::new();
    for (word, &bits) in bits.iter().enumerate().rev() {
        let mut shift = 0;
        for left in (1..=bits.div_ceil(DIGIT_BITS)).rev() {
            let width = (bits - shift).div_ceil(left);
            digits.push(Digit { word: word as u32, shift, mask: (1 << width) - 1 });
            shift += width;
        }
    }
    digits
}

impl Sort {
    /// Makes a sort, with the ranking that works everywhere.
    ///
    /// # Errors
    /// [`Error::Invalid`] for keys of no or more than 4 words, or more than 32 bits of a word; [`Error::Capacity`] when
    /// the host's count is more than the capacity; as for [`Pipelines::pass`] and [`Gpu::create_buffer`].
    pub fn new(gpu: &Gpu, pipelines: &mut Pipelines, options: SortOptions) -> Result<Self> {
        Self::with_ranking(gpu, pipelines, options, Ranking::Portable)
    }

    /// Makes a sort with this ranking.
    ///
    /// # Errors
    /// [`Error::Invalid`] for sub-group ranking on a device without sub-group operations; as for [`Sort::new`].
    pub fn with_ranking(gpu: &Gpu, pipelines: &mut Pipelines, options: SortOptions, ranking: Ranking) -> Result<Self> {
        let scatter = match ranking {
            Ranking::Portable => "primitives/sort",
            Ranking::Subgroup if gpu.has_subgroups() => "primitives/sort_subgroup",
            Ranking::Subgroup => {
                let (value, allowed) = ("Subgroup".into(), "Portable, since the device lacks Features::SUBGROUP");
                return Err(Error::Invalid { what: "Sort".into(), field: "ranking", value, allowed });
            }
        };
        let allowed = "1 to 4 entries of 0 to 32";
        if !(1..=4).contains(&options.bits.len()) || options.bits.iter().any(|bits| *bits > 32) {
            let value = format!("{:?}", options.bits);
            return Err(Error::Invalid { what: "Sort".into(), field: "bits", value, allowed });
        }
        let passes = Passes {
            count_digits: pipelines.pass(gpu, "primitives/sort", "count_digits")?,
            scatter: pipelines.pass(gpu, scatter, "scatter")?,
            copy: pipelines.pass(gpu, "primitives/sort", "copy")?,
        };
        let digits = digits(&options.bits);
        let radix = digits.iter().map(|digit| digit.mask + 1).max().unwrap_or(1);
        let capacity = options.capacity;
        let scan_options = ScanOptions { capacity, count: options.count, total: None };
        let scan = Scan::shaped(gpu, pipelines, scan_options, Shape { per: BLOCK, times: radix })?;
        let args = match options.count {
            Count::Host(_) => None,
            Count::Word(word) => {
                let jobs = [Job::new(word, capacity, BLOCK), Job::new(word, capacity, Scan::BLOCK / radix * BLOCK)];
                Some(Args::new(gpu, pipelines, &jobs)?)
            }
        };
        let [elements, words, steps] = [capacity.into(), options.bits.len() as u64, digits.len() as u64];
        let storage = BufferUsages::STORAGE;
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let mut sort = Self {
            passes,
            params: gpu.create_buffer("sort params", steps * UNIFORM_STEP, uniform)?,
            // The result may stay here, to be copied by the caller.
            keys: gpu.create_buffer("sort keys", elements * words * 4, storage | BufferUsages::COPY_SRC)?,
            values: gpu.create_buffer("sort values", elements * 4, storage | BufferUsages::COPY_SRC)?,
            histogram: gpu.create_buffer(
                "sort histogram",
                u64::from(capacity.div_ceil(BLOCK)) * u64::from(radix) * 4,
                storage,
            )?,
            no_counts: gpu.create_buffer("sort without counts", 4, storage)?,
            scan,
            args,
            digits,
            radix,
            options,
        };
        sort.write(gpu, sort.options.count)?;
        Ok(sort)
    }

    /// Most elements that it takes.
    pub fn capacity(&self) -> u32 {
        self.options.capacity
    }

    /// Bytes of its scratch.
    pub fn bytes(&self) -> u64 {
        self.keys.size() + self.values.size() + self.histogram.size()
    }

    /// Changes the number of elements that the host says, for all that is submitted from now on, recorded before or
    /// after.
    ///
    /// # Errors
    /// [`Error::Capacity`] when `count` is more than the capacity, [`Error::Invalid`] when the count is on the GPU.
    pub fn set_count(&mut self, gpu: &Gpu, count: u32) -> Result<()> {
        self.scan.set_count(gpu, count)?;
        self.write(gpu, Count::Host(count))
    }

    fn write(&mut self, gpu: &Gpu, count: Count) -> Result<()> {
        let capacity = self.options.capacity;
        if let Count::Host(count) = count
            && count > capacity
        {
            return Err(Error::Capacity { buffer: "sort", needed: count.into(), capacity: capacity.into() });
        }
        self.options.count = count;
        let (count, count_word) = count.words();
        let words = self.options.bits.len() as u32;
        for (step, &Digit { word, shift, mask }) in self.digits.iter().enumerate() {
            let params = SortParams { count, count_word, capacity, words, word, shift, mask, radix: self.radix };
            gpu.queue.write_buffer(&self.params, step as u64 * UNIFORM_STEP, bytemuck::bytes_of(&params));
        }
        Ok(())
    }

    /// Bytes that a sort of `count` elements reads and writes, all passes together, by the algorithm: each digit's pass
    /// reads the word with the digit, reads and writes keys and values, and goes through the histogram five times
    /// (written, summed, read and written by the scan, read). The copy that ends [`Sort::record`] when the number of
    /// digits is odd counts as well.
    pub fn traffic_bytes(&self, count: u32) -> u64 {
        let elements = u64::from(count);
        let moved = 2 * 4 * elements * (self.options.bits.len() as u64 + 1);
        let histogram = 4 * u64::from(count.div_ceil(BLOCK)) * u64::from(self.radix);
        let digits = self.digits.len() as u64;
        digits * (4 * elements + moved + 5 * histogram) + (digits % 2) * moved
    }

    /// Records the sort of `keys` (element i's words from i * words on) and `values`, both storage, both sorted in
    /// place when it has run. `counts` (storage) is needed when the count is a word of it.
    ///
    /// # Errors
    /// [`Error::Invalid`] when `counts` is needed and `None`; as for [`Recorder::dispatch`].
    pub fn record(
        &self,
        recorder: &mut Recorder,
        keys: &wgpu::Buffer,
        values: &wgpu::Buffer,
        counts: Option<&wgpu::Buffer>,
    ) -> Result<()> {
        let (sorted_keys, sorted_values) = self.record_moving(recorder, keys, values, counts)?;
        if sorted_keys == keys {
            return Ok(());
        }
        let (from, to) = (Ends { keys: sorted_keys, values: sorted_values }, Ends { keys, values });
        let counts = counts.unwrap_or(&self.no_counts);
        self.dispatch(recorder, &self.passes.copy, &self.binds(0, counts, from, to))
    }

    /// Like [`Sort::record`], and saves its last copy: when it has run, the sorted keys and values lie in the buffers
    /// that it returns. They are the given ones when the number of digits (of up to 8 bits, none over two words) is
    /// even, else the sort's own scratch, good until it runs again.
    ///
    /// # Errors
    /// As for [`Sort::record`].
    pub fn record_moving<'a>(
        &'a self,
        recorder: &mut Recorder,
        keys: &'a wgpu::Buffer,
        values: &'a wgpu::Buffer,
        counts: Option<&wgpu::Buffer>,
    ) -> Result<(&'a wgpu::Buffer, &'a wgpu::Buffer)> {
        let counts = match (counts, &self.args) {
            (Some(counts), _) => counts,
            (None, Some(_)) => return Err(no_counts("Sort")),
            (None, None) => &self.no_counts,
        };
        if let Some(args) = &self.args {
            args.record(recorder, counts)?;
        }
        let (mut from, mut to) = (Ends { keys, values }, Ends { keys: &self.keys, values: &self.values });
        for step in 0..self.digits.len() {
            let [params, counted, keys_in, ..] = self.binds(step, counts, from, to);
            let histogram = Bind::new("histogram", &self.histogram);
            self.dispatch(recorder, &self.passes.count_digits, &[params, counted, keys_in, histogram.clone()])?;
            let scan_args = self.args.as_ref().map(|args| (args.buffer(), 16));
            self.scan.record_with(recorder, &self.histogram, counts, scan_args)?;
            let [a, b, c, d, e, f] = self.binds(step, counts, from, to);
            self.dispatch(recorder, &self.passes.scatter, &[a, b, c, d, e, f, histogram])?;
            (from, to) = (to, from);
        }
        Ok((from.keys, from.values))
    }

    fn binds<'a>(&'a self, step: usize, counts: &'a wgpu::Buffer, from: Ends<'a>, to: Ends<'a>) -> [Bind<'a>; 6] {
        [
            Bind::part("params", &self.params, step as u64 * UNIFORM_STEP, size_of::<SortParams>() as u64),
            Bind::new("counts", counts),
            Bind::new("keys_in", from.keys),
            Bind::new("values_in", from.values),
            Bind::new("keys_out", to.keys),
            Bind::new("values_out", to.values),
        ]
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
