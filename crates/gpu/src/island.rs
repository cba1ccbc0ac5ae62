//! Stage `island`: which moving bodies hang together. Host side of `shaders/island.wgsl`.

use crate::{Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;

pub(crate) struct Island {
    begin: Arc<Pass>,
    hook: Arc<Pass>,
    hook_joined: Arc<Pass>,
    flatten: Arc<Pass>,
    count: Arc<Pass>,
}

impl Island {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "island", entry);
        let [begin, hook, hook_joined] = [pass("begin")?, pass("hook")?, pass("hook_joined")?];
        Ok(Self { begin, hook, hook_joined, flatten: pass("flatten")?, count: pass("count")? })
    }

    /// `a_pair`: arguments for one thread a pair; `joined`: number of pairs of bodies with joints between them. Labels are
    /// in `islands` from here on.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder,
        step: &StepParams,
        a_pair: (&wgpu::Buffer, u64),
        joined: u32,
    ) -> Result<()> {
        recorder.stage("island");
        let by_body = step.body_count.div_ceil(256);
        recorder.dispatch(&self.begin, &[], by_body)?;
        recorder.dispatch_indirect(&self.hook, &[], a_pair.0, a_pair.1)?;
        recorder.dispatch(&self.hook_joined, &[], joined.div_ceil(256))?;
        recorder.dispatch(&self.flatten, &[], by_body)?;
        recorder.dispatch(&self.count, &[], by_body)
    }
}
