//! Stage `level`: how many sub-steps each island gets. Host side of `shaders/level.wgsl`.

use crate::{Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;

pub(crate) struct Level {
    begin: Arc<Pass>,
    ask: Arc<Pass>,
    measure: Arc<Pass>,
    measure_joints: Arc<Pass>,
    decide: Arc<Pass>,
    spend: Arc<Pass>,
    spend_joints: Arc<Pass>,
}

impl Level {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "level", entry);
        let [begin, ask, measure] = [pass("begin")?, pass("ask")?, pass("measure")?];
        let [decide, spend] = [pass("decide")?, pass("spend")?];
        let [measure_joints, spend_joints] = [pass("measure_joints")?, pass("spend_joints")?];
        Ok(Self { begin, ask, measure, measure_joints, decide, spend, spend_joints })
    }

    /// Once islands are labelled. `a_pair`: arguments for one thread a pair; `joints`: slots of joints.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder,
        step: &StepParams,
        a_pair: (&wgpu::Buffer, u64),
        joints: u32,
    ) -> Result<()> {
        recorder.stage("level");
        let (by_body, by_joint) = (step.body_count.div_ceil(256), joints.div_ceil(256));
        recorder.dispatch(&self.begin, &[], by_body)?;
        recorder.dispatch(&self.ask, &[], by_body)?;
        recorder.dispatch_indirect(&self.measure, &[], a_pair.0, a_pair.1)?;
        if joints > 0 {
            recorder.dispatch(&self.measure_joints, &[], by_joint)?;
        }
        recorder.dispatch(&self.decide, &[], by_body)?;
        recorder.dispatch_indirect(&self.spend, &[], a_pair.0, a_pair.1)?;
        if joints > 0 {
            recorder.dispatch(&self.spend_joints, &[], by_joint)?;
        }
        Ok(())
    }
}
