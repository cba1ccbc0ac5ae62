//! Stage `motion`: integration, commit, poses. Host side of `shaders/motion.wgsl`.

use crate::{Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;

pub(crate) struct Motion {
    integrate_velocities: Arc<Pass>,
    integrate_positions: Arc<Pass>,
    commit: Arc<Pass>,
    write_poses: Arc<Pass>,
}

impl Motion {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "motion", entry);
        Ok(Self {
            integrate_velocities: pass("integrate_velocities")?,
            integrate_positions: pass("integrate_positions")?,
            commit: pass("commit")?,
            write_poses: pass("write_poses")?,
        })
    }

    pub(crate) fn record_velocities(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        recorder.dispatch(&self.integrate_velocities, &[], step.body_count.div_ceil(256))
    }

    pub(crate) fn record_positions(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        recorder.dispatch(&self.integrate_positions, &[], step.body_count.div_ceil(256))
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
