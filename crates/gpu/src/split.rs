//! Which parts bodies are split into in the last batch. Host side of `shaders/solver/parts.wgsl`.

use crate::primitives::{Count, Sort, SortOptions};
use crate::store::Sizes;
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;

pub(crate) struct Split {
    list: Arc<Pass>,
    count: Arc<Pass>,
    sort: Sort,
    /// Entries that there is room for.
    room: u32,
}

impl Split {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes) -> Result<Self> {
        // Room for the number of a body, and for one above all.
        let bits = u32::BITS - sizes.bodies.leading_zeros();
        let by_body = SortOptions { capacity: sizes.parts, count: Count::Word(0), bits: vec![bits] };
        Ok(Self {
            list: pipelines.pass(gpu, "solver/parts", "list")?,
            count: pipelines.pass(gpu, "solver/parts", "count")?,
            sort: Sort::new(gpu, pipelines, by_body)?,
            room: sizes.parts,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.sort.bytes()
    }

    /// Once there are bodies, and before there are masses.
    pub(crate) fn record(&self, recorder: &mut Recorder, buffers: &Buffers) -> Result<()> {
        recorder.dispatch(&self.list, &[], self.room.div_ceil(512))?;
        let (bodies, ends) = (buffers.buffer("part_bodies")?, buffers.buffer("part_ends")?);
        self.sort.record(recorder, bodies, ends, Some(buffers.buffer("part_count")?))?;
        recorder.dispatch(&self.count, &[], self.room.div_ceil(256))
    }
}
