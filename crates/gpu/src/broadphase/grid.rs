//! Stage `broadphase/grid`: uniform grid. Host side of `shaders/broadphase/grid.wgsl`.

use crate::primitives::{Count, Scan, ScanOptions, Sort, SortOptions};
use crate::store::{Sizes, word};
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;

pub(crate) struct Grid {
    choose: Arc<Pass>,
    clear: Arc<Pass>,
    count: Arc<Pass>,
    scatter: Arc<Pass>,
    pair_count: Arc<Pass>,
    gate: Arc<Pass>,
    pair_fill: Arc<Pass>,
    scan_cells: Scan,
    scan_pairs: Scan,
    sort: Sort,
}

impl Grid {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "broadphase/grid", entry);
        let [choose, clear, count, scatter] = [pass("choose")?, pass("clear")?, pass("count")?, pass("scatter")?];
        let [pair_count, gate, pair_fill] = [pass("pair_count")?, pass("gate")?, pass("pair_fill")?];
        let host = |capacity| ScanOptions { capacity, count: Count::Host(0), total: None };
        let pairs = ScanOptions { total: Some(word::PAIR_COUNT), ..host(sizes.colliders) };
        let bits = 32 - sizes.colliders.saturating_sub(1).leading_zeros();
        let by_pair = SortOptions { capacity: sizes.pairs, count: Count::Word(word::PAIR_COUNT), bits: vec![bits; 2] };
        Ok(Self {
            choose,
            clear,
            count,
            scatter,
            pair_count,
            gate,
            pair_fill,
            scan_cells: Scan::new(gpu, pipelines, host(sizes.cells()))?,
            scan_pairs: Scan::new(gpu, pipelines, pairs)?,
            sort: Sort::new(gpu, pipelines, by_pair)?,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.sort.bytes()
    }

    /// Tells the scans how long their arrays are in this step.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, step: &StepParams) -> Result<()> {
        self.scan_cells.set_count(gpu, (1 << step.cell_table_bits) + 1)?;
        self.scan_pairs.set_count(gpu, step.collider_count)
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        recorder.stage("broadphase");
        let colliders = step.collider_count.div_ceil(256);
        let counters = buffers.buffer("counters")?;
        recorder.dispatch(&self.choose, &[], 1)?;
        recorder.dispatch(&self.clear, &[], ((1u32 << step.cell_table_bits) + 1).div_ceil(256))?;
        recorder.dispatch(&self.count, &[], colliders)?;
        self.scan_cells.record(recorder, buffers.buffer("cell_start")?, None)?;
        recorder.dispatch(&self.scatter, &[], colliders)?;
        recorder.dispatch(&self.pair_count, &[], colliders)?;
        self.scan_pairs.record(recorder, buffers.buffer("partner_offset")?, Some(counters))?;
        recorder.dispatch(&self.gate, &[], 1)?;
        recorder.dispatch(&self.pair_fill, &[], colliders)?;
        let (keys, values) = (buffers.buffer("pair_keys")?, buffers.buffer("pair_values")?);
        self.sort.record(recorder, keys, values, Some(counters))
    }
}
