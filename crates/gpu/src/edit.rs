//! Stage `edit`: working copy of the states, and the step's edits. Host side of `shaders/edit.wgsl`.

use crate::{Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::{Control, StepParams};

pub(crate) struct Edit {
    begin: Arc<Pass>,
    apply: Arc<Pass>,
}

/// Size classes that `begin` clears.
const CLASSES: u32 = 1024;

impl Edit {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        Ok(Self { begin: pipelines.pass(gpu, "edit", "begin")?, apply: pipelines.pass(gpu, "edit", "apply")? })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        recorder.stage("edit");
        let words = size_of::<Control>() as u32 / 4;
        recorder.dispatch(&self.begin, &[], step.body_count.max(CLASSES).max(words).div_ceil(256))?;
        recorder.dispatch(&self.apply, &[], step.edit_ranges.div_ceil(256))
    }
}
