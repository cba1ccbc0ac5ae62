//! Stage `motion`: commit and poses; its sub-steps are the solver's. Host side of `shaders/motion.wgsl` and
//! `shaders/continuous.wgsl`.

use crate::store::args;
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;

pub(crate) struct Motion {
    shorten: Arc<Pass>,
    commit: Arc<Pass>,
    write_poses: Arc<Pass>,
}

impl Motion {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        let mut pass = |stem, entry| pipelines.pass(gpu, stem, entry);
        let shorten = pass("continuous", "shorten")?;
        Ok(Self { shorten, commit: pass("motion", "commit")?, write_poses: pass("motion", "write_poses")? })
    }

    pub(crate) fn record_commit(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        recorder.stage("motion");
        recorder.dispatch_indirect(&self.shorten, &[], buffers.buffer("dispatch_args")?, args::PAIRS)?;
        recorder.dispatch(&self.commit, &[], step.body_count.div_ceil(256))
    }

    pub(crate) fn record_poses(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        recorder.stage("motion");
        recorder.dispatch(&self.write_poses, &[], step.body_count.div_ceil(256))
    }
}
