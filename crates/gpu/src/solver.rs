//! Stage `solver`: rows, sub-steps, and the way back. Host side of `shaders/solver/`.

use crate::motion::Motion;
use crate::store::{args, index_part};
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::layout::StepParams;
use tumble_core::{Plan, Result};

/// A sweep over all batches: one dispatch for each wide one, one for the rest.
struct Sweep {
    batch: Arc<Pass>,
    tail: Arc<Pass>,
}

pub(crate) struct Solver {
    bodies: Arc<Pass>,
    constraints: Arc<Pass>,
    carry: Arc<Pass>,
    warm_start: Sweep,
    solve: Sweep,
    relax: Sweep,
    restitution: Option<Sweep>,
    store: Arc<Pass>,
}

impl Sweep {
    fn new(gpu: &Gpu, pipelines: &mut Pipelines, visit: &str) -> Result<Self> {
        Ok(Self {
            batch: pipelines.pass(gpu, "solver/passes", visit)?,
            tail: pipelines.pass(gpu, "solver/passes", &format!("{visit}_tail"))?,
        })
    }

    fn record(&self, recorder: &mut Recorder, buffers: &Buffers, wide_batches: u32) -> Result<()> {
        let own = buffers.buffer("dispatch_args")?;
        for index in 0..wide_batches {
            let batch = [index_part("batch", buffers, index)?];
            recorder.dispatch_indirect(&self.batch, &batch, own, args::batch(index))?;
        }
        recorder.dispatch_indirect(&self.tail, &[], own, args::TAIL)
    }
}

impl Solver {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, plan: &Plan) -> Result<Self> {
        let restitution = plan.restitution.then(|| Sweep::new(gpu, pipelines, "restitution")).transpose()?;
        Ok(Self {
            bodies: pipelines.pass(gpu, "solver/prepare", "bodies")?,
            constraints: pipelines.pass(gpu, "solver/prepare", "constraints")?,
            carry: pipelines.pass(gpu, "solver/prepare", "carry")?,
            warm_start: Sweep::new(gpu, pipelines, "warm_start")?,
            solve: Sweep::new(gpu, pipelines, "solve")?,
            relax: Sweep::new(gpu, pipelines, "relax")?,
            restitution,
            store: pipelines.pass(gpu, "solver/store", "store")?,
        })
    }

    pub(crate) fn record(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers,
        motion: &Motion,
        step: &StepParams,
    ) -> Result<()> {
        recorder.stage("prepare");
        let own = buffers.buffer("dispatch_args")?;
        recorder.dispatch(&self.bodies, &[], step.body_count.div_ceil(256))?;
        recorder.dispatch_indirect(&self.constraints, &[], own, args::CONSTRAINTS)?;
        recorder.dispatch_indirect(&self.carry, &[], own, args::CONSTRAINTS)?;
        recorder.stage("solver");
        for _ in 0..step.substeps {
            motion.record_velocities(recorder, step)?;
            self.warm_start.record(recorder, buffers, step.wide_batches)?;
            self.solve.record(recorder, buffers, step.wide_batches)?;
            motion.record_positions(recorder, step)?;
            self.relax.record(recorder, buffers, step.wide_batches)?;
        }
        if let Some(restitution) = &self.restitution {
            restitution.record(recorder, buffers, step.wide_batches)?;
        }
        recorder.dispatch_indirect(&self.store, &[], own, args::CONSTRAINTS)
    }
}
