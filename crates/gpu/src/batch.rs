//! Stage `batch`: colouring. Host side of `shaders/batch.wgsl`.

use crate::primitives::{Args, Count, Job, Sort, SortOptions};
use crate::store::{Sizes, index_part, word};
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::{StepParams, batching};
use tumble_core::limits::wide_rounds;

pub(crate) struct Batch {
    begin: Arc<Pass>,
    bid: Arc<Pass>,
    place: Arc<Pass>,
    unclaim: Arc<Pass>,
    compact: Arc<Pass>,
    tail: Arc<Pass>,
    finish: Arc<Pass>,
    degree: Arc<Pass>,
    table: Arc<Pass>,
    gate: Arc<Pass>,
    sort: Sort,
    /// One thread a constraint that waits for a batch.
    args: Args,
}

impl Batch {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "batch", entry);
        let [begin, bid, place, unclaim] = [pass("begin")?, pass("bid")?, pass("place")?, pass("unclaim")?];
        let [compact, tail] = [pass("compact")?, pass("tail")?];
        let [finish, degree, table, gate] = [pass("finish")?, pass("degree")?, pass("table")?, pass("gate")?];
        let by_batch = SortOptions { capacity: sizes.pairs, count: Count::Word(word::PAIR_COUNT), bits: vec![8] };
        Ok(Self {
            begin,
            bid,
            place,
            unclaim,
            compact,
            tail,
            finish,
            degree,
            table,
            gate,
            sort: Sort::new(gpu, pipelines, by_batch)?,
            args: Args::new(gpu, pipelines, &[Job::new(word::UNPLACED, sizes.pairs, 256)])?,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.sort.bytes()
    }

    /// `a_pair`: arguments for one thread a pair.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers,
        step: &StepParams,
        a_pair: (&wgpu::Buffer, u64),
    ) -> Result<()> {
        recorder.stage("batch");
        let counters = buffers.buffer("counters")?;
        recorder.dispatch_indirect(&self.begin, &[], a_pair.0, a_pair.1)?;
        self.args.record(recorder, counters)?;
        let waiting = self.args.buffer();
        for index in 0..wide_rounds(step.batching) {
            let round = [index_part("round", buffers, index)?];
            recorder.dispatch_indirect(&self.bid, &round, waiting, 0)?;
            recorder.dispatch_indirect(&self.place, &round, waiting, 0)?;
        }
        recorder.dispatch_indirect(&self.compact, &[], waiting, 0)?;
        if step.batching & batching::LAW == batching::WRITE_AND_VERIFY {
            recorder.dispatch(&self.unclaim, &[], step.body_count.div_ceil(256))?;
        }
        recorder.dispatch(&self.tail, &[], 1)?;
        recorder.dispatch_indirect(&self.finish, &[], a_pair.0, a_pair.1)?;
        recorder.dispatch(&self.degree, &[], step.body_count.div_ceil(256))?;
        let (keys, values) = (buffers.buffer("batch_keys")?, buffers.buffer("batch_order")?);
        self.sort.record(recorder, keys, values, Some(counters))?;
        recorder.dispatch(&self.table, &[], 1)?;
        recorder.dispatch(&self.gate, &[], 1)
    }
}
