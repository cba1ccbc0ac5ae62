//! Stage `broadphase/brute_force`: host side of `shaders/broadphase/brute_force.wgsl`.

use crate::{Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::layout::StepParams;
use tumble_core::{Error, Result};

/// Others that one invocation looks at.
const OTHERS: u32 = 256;

pub(crate) struct BruteForce {
    pairs: Arc<Pass>,
}

impl BruteForce {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        Ok(Self { pairs: pipelines.pass(gpu, "broadphase/brute_force", "pairs")? })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        let threads = u64::from(step.collider_count) * u64::from(step.collider_count.div_ceil(OTHERS));
        let threads = u32::try_from(threads).map_err(|_| Error::Invalid {
            what: "Params".into(),
            field: "broadphase",
            value: format!("BruteForce for {} colliders", step.collider_count),
            allowed: "up to a million colliders; take another broad phase",
        })?;
        recorder.dispatch(&self.pairs, &[], threads.div_ceil(256))
    }
}
