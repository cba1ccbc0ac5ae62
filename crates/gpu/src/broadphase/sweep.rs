//! Stage `broadphase/sweep`: sort and sweep along one axis. Host side of `shaders/broadphase/sweep.wgsl`.

use super::those_of;
use crate::primitives::{Count, Scan, ScanOptions, Sort, SortOptions};
use crate::store::Sizes;
use crate::{Bind, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;
use wgpu::BufferUsages;

/// Words of `sweep_state`.
const STATE_WORDS: u64 = 16;

pub(crate) struct Sweep {
    begin: Arc<Pass>,
    spread: Arc<Pass>,
    keys: Arc<Pass>,
    ends: Arc<Pass>,
    deal: Arc<Pass>,
    sweep: Arc<Pass>,
    sort: Sort,
    scan: Scan,
    state: wgpu::Buffer,
    sort_keys: wgpu::Buffer,
    order: wgpu::Buffer,
    places: wgpu::Buffer,
    sides: wgpu::Buffer,
    offsets: wgpu::Buffer,
    args: wgpu::Buffer,
}

impl Sweep {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "broadphase/sweep", entry);
        let [begin, spread, keys] = [pass("begin")?, pass("spread")?, pass("keys")?];
        let [ends, deal, sweep] = [pass("ends")?, pass("deal")?, pass("sweep")?];
        let (capacity, count) = (sizes.colliders.max(1), Count::Host(0));
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let each = |name, bytes: usize| gpu.create_buffer(name, bytes as u64 * u64::from(capacity), storage);
        Ok(Self {
            begin,
            spread,
            keys,
            ends,
            deal,
            sweep,
            sort: Sort::new(gpu, pipelines, SortOptions { capacity, count, bits: vec![32] })?,
            scan: Scan::new(gpu, pipelines, ScanOptions { capacity, count, total: None })?,
            state: gpu.create_buffer("sweep state", 4 * STATE_WORDS, storage)?,
            sort_keys: each("sweep keys", 4)?,
            order: each("sweep order", 4)?,
            places: each("sweep places", 8)?,
            sides: each("sweep sides", 16)?,
            offsets: each("sweep offsets", 4)?,
            args: gpu.create_buffer("sweep arguments", 16, storage | BufferUsages::INDIRECT)?,
        })
    }

    /// Bytes of all arrays, and of the sort's scratch.
    pub(crate) fn bytes(&self) -> u64 {
        let own = [&self.sort_keys, &self.order, &self.places, &self.sides, &self.offsets];
        own.iter().map(|buffer| buffer.size()).sum::<u64>() + self.sort.bytes()
    }

    /// Tells sort and scan how many colliders there are in this step.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, step: &StepParams) -> Result<()> {
        self.sort.set_count(gpu, step.collider_count)?;
        self.scan.set_count(gpu, step.collider_count)
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        let own = [
            Bind::new("sweep_state", &self.state),
            Bind::new("sweep_keys", &self.sort_keys),
            Bind::new("sweep_order", &self.order),
            Bind::new("sweep_places", &self.places),
            Bind::new("sweep_sides", &self.sides),
            Bind::new("sweep_offsets", &self.offsets),
            Bind::new("sweep_args", &self.args),
        ];
        let run = |recorder: &mut Recorder, pass, groups| recorder.dispatch(pass, &those_of(pass, &own), groups);
        let colliders = step.collider_count.div_ceil(256);
        run(recorder, &self.begin, 1)?;
        run(recorder, &self.spread, colliders)?;
        run(recorder, &self.keys, colliders)?;
        self.sort.record(recorder, &self.sort_keys, &self.order, None)?;
        run(recorder, &self.ends, colliders)?;
        self.scan.record(recorder, &self.offsets, None)?;
        run(recorder, &self.deal, 1)?;
        recorder.dispatch_indirect(&self.sweep, &those_of(&self.sweep, &own), &self.args, 0)
    }
}
