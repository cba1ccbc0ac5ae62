//! Stage `solver`: rows, sub-steps, and the way back. Host side of `shaders/solver/`.

use crate::store::{args, index_part};
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::layout::{StepParams, solver};
use tumble_core::{Plan, Result};

/// A sweep over all batches: one dispatch for each wide one, one for the rest.
struct Sweep {
    batch: Arc<Pass>,
    tail: Arc<Pass>,
}

/// The sub-steps of one solver.
enum Law {
    OnePass { first: Arc<Pass>, load: Sweep, pass: Sweep, next: Arc<Pass>, last: Arc<Pass> },
    Soft { velocities: Arc<Pass>, warm_start: Sweep, solve: Sweep, positions: Arc<Pass>, relax: Sweep },
}

pub(crate) struct Solver {
    bodies: Arc<Pass>,
    constraints: Arc<Pass>,
    carry: Arc<Pass>,
    law: Law,
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

impl Law {
    fn new(gpu: &Gpu, pipelines: &mut Pipelines, law: u32) -> Result<Self> {
        let mut sweep = |visit| Sweep::new(gpu, pipelines, visit);
        if law == solver::SOFT {
            let (warm_start, solve, relax) = (sweep("warm_start")?, sweep("solve")?, sweep("relax")?);
            let mut body = |entry| pipelines.pass(gpu, "motion", entry);
            let (velocities, positions) = (body("integrate_velocities")?, body("integrate_positions")?);
            return Ok(Self::Soft { velocities, warm_start, solve, positions, relax });
        }
        let (load, pass) = (sweep("load")?, sweep("one_pass")?);
        let mut body = |entry| pipelines.pass(gpu, "motion", entry);
        let [first, next, last] = [body("first_substep")?, body("next_substep")?, body("last_substep")?];
        Ok(Self::OnePass { first, load, pass, next, last })
    }

    fn record(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        let (wide, bodies) = (step.wide_batches, step.body_count.div_ceil(256));
        match self {
            Self::OnePass { first, load, pass, next, last } => {
                recorder.dispatch(first, &[], bodies)?;
                load.record(recorder, buffers, wide)?;
                for substep in 1..=step.substeps {
                    pass.record(recorder, buffers, wide)?;
                    recorder.dispatch(if substep < step.substeps { next } else { last }, &[], bodies)?;
                }
            }
            Self::Soft { velocities, warm_start, solve, positions, relax } => {
                for _ in 0..step.substeps {
                    recorder.dispatch(velocities, &[], bodies)?;
                    warm_start.record(recorder, buffers, wide)?;
                    solve.record(recorder, buffers, wide)?;
                    recorder.dispatch(positions, &[], bodies)?;
                    relax.record(recorder, buffers, wide)?;
                }
            }
        }
        Ok(())
    }
}

impl Solver {
    /// With the law of this code (`StepParams::solver`).
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, plan: &Plan, law: u32) -> Result<Self> {
        let restitution = plan.restitution.then(|| Sweep::new(gpu, pipelines, "restitution")).transpose()?;
        Ok(Self {
            bodies: pipelines.pass(gpu, "solver/prepare", "bodies")?,
            constraints: pipelines.pass(gpu, "solver/prepare", "constraints")?,
            carry: pipelines.pass(gpu, "solver/prepare", "carry")?,
            law: Law::new(gpu, pipelines, law)?,
            restitution,
            store: pipelines.pass(gpu, "solver/store", "store")?,
        })
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        recorder.stage("prepare");
        let own = buffers.buffer("dispatch_args")?;
        recorder.dispatch(&self.bodies, &[], step.body_count.div_ceil(256))?;
        recorder.dispatch_indirect(&self.constraints, &[], own, args::CONSTRAINTS)?;
        recorder.dispatch_indirect(&self.carry, &[], own, args::CONSTRAINTS)?;
        recorder.stage("solver");
        self.law.record(recorder, buffers, step)?;
        if let Some(restitution) = &self.restitution {
            restitution.record(recorder, buffers, step.wide_batches)?;
        }
        recorder.dispatch_indirect(&self.store, &[], own, args::CONSTRAINTS)
    }
}
