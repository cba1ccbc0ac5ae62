//! Stage `motion`: commit and poses; its sub-steps are the solver's. Host side of `shaders/motion.wgsl`.

use crate::{Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;

pub(crate) struct Motion {
    commit: Arc<Pass>,
    write_poses: Arc<Pass>,
}

impl Motion {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "motion", entry);
        Ok(Self { commit: pass("commit")?, write_poses: pass("write_poses")? })
    }

    pub(crate) fn record_commit(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        recorder.stage("motion");
        recorder.dispatch(&self.commit, &[], step.body_count.div_ceil(256))
    }

    pub(crate) fn record_poses(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        recorder.stage("motion");
        recorder.dispatch(&self.write_poses, &[], step.body_count.div_ceil(256))
    }
}
