//! Stage `bounds`: quarantine and boxes. Host side of `shaders/bounds.wgsl`.

use crate::{Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;

pub(crate) struct Bounds {
    quarantine: Arc<Pass>,
    collider_bounds: Arc<Pass>,
}

impl Bounds {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        Ok(Self {
            quarantine: pipelines.pass(gpu, "bounds", "quarantine")?,
            collider_bounds: pipelines.pass(gpu, "bounds", "collider_bounds")?,
        })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        recorder.stage("bounds");
        recorder.dispatch(&self.quarantine, &[], step.body_count.div_ceil(256))?;
        recorder.dispatch(&self.collider_bounds, &[], step.collider_count.div_ceil(256))
    }
}
