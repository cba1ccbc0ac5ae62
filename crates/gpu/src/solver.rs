//! Stage `solver`: rows, sub-steps, and the way back. Host side of `shaders/solver/`.

use crate::joint::{Joint, Part};
use crate::split::Split;
use crate::store::{Sizes, args, index_part, level_part};
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::layout::{StepParams, batching, solver};
use tumble_core::{JointSet, Plan, Result};

/// Sweeps of one pass and soft, and those that others share.
const PASSES: &str = "solver/passes";
/// Sweeps of the solvers that are there for comparison.
const CLASSIC: &str = "solver/classic";
/// Sweeps over the last batch by mass splitting.
const SPLIT: &str = "solver/split";

/// A sweep over all batches: one dispatch for each wide one, one for the rest.
struct Sweep {
    batch: Arc<Pass>,
    tail: Arc<Pass>,
    /// The last batch by mass splitting.
    split: Option<Arc<Pass>>,
}

/// A pass over all bodies.
struct ByBody(Arc<Pass>);

impl ByBody {
    fn new(gpu: &Gpu, pipelines: &mut Pipelines, stem: &str, entry: &str) -> Result<Self> {
        Ok(Self(pipelines.pass(gpu, stem, entry)?))
    }

    fn record(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        recorder.dispatch(&self.0, &[level_part(buffers, step)?], by_body(step))
    }
}

/// The sub-steps of one solver.
enum Law {
    OnePass { first: ByBody, load: Sweep, pass: Sweep, next: ByBody, last: ByBody },
    Soft { start: Start, solve: Sweep, positions: ByBody, relax: Sweep },
    GaussSeidel { start: Start, visit: Sweep, last: Sweep, positions: ByBody },
    Jacobi { split: Sweep, start: Start, begin: ByBody, visit: Sweep, last: Sweep, settle: ByBody, positions: ByBody },
    Penalty { first: ByBody, press: Sweep, settle: ByBody, positions: ByBody },
}

/// What a sub-step with a warm start begins with.
struct Start {
    velocities: ByBody,
    warm_start: Sweep,
}

pub(crate) struct Solver {
    bodies: Arc<Pass>,
    /// Where the last batch may be solved by mass splitting.
    split: Option<Split>,
    constraints: Arc<Pass>,
    carry: Arc<Pass>,
    /// Where islands have levels of sub-steps.
    rewind: Option<ByBody>,
    law: Law,
    restitution: Option<Sweep>,
    store: Arc<Pass>,
    /// Where bodies are joined.
    joints: Option<Joint>,
}

impl Sweep {
    fn new(gpu: &Gpu, pipelines: &mut Pipelines, stem: &str, visit: &str) -> Result<Self> {
        Ok(Self {
            batch: pipelines.pass(gpu, stem, visit)?,
            tail: pipelines.pass(gpu, stem, &format!("{visit}_tail"))?,
            split: None,
        })
    }

    /// One whose last batch may be solved by mass splitting.
    fn splitting(gpu: &Gpu, pipelines: &mut Pipelines, plan: &Plan, stem: &str, visit: &str) -> Result<Self> {
        let pass = plan.split.then(|| pipelines.pass(gpu, SPLIT, &format!("{visit}_split"))).transpose()?;
        Ok(Self { split: pass, ..Self::new(gpu, pipelines, stem, visit)? })
    }

    fn record(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        let own = buffers.buffer("dispatch_args")?;
        let level = level_part(buffers, step)?;
        for index in 0..step.wide_batches {
            let batch = [index_part("batch", buffers, index)?, level.clone()];
            recorder.dispatch_indirect(&self.batch, &batch, own, args::batch(index))?;
        }
        recorder.dispatch_indirect(&self.tail, std::slice::from_ref(&level), own, args::TAIL)?;
        match self.split.as_ref().filter(|_| splits_last(step)) {
            Some(split) => recorder.dispatch_indirect(split, &[level], own, args::TAIL),
            None => Ok(()),
        }
    }
}

impl Start {
    fn new(gpu: &Gpu, pipelines: &mut Pipelines, plan: &Plan) -> Result<Self> {
        let velocities = ByBody::new(gpu, pipelines, "motion", "integrate_velocities")?;
        Ok(Self { velocities, warm_start: Sweep::splitting(gpu, pipelines, plan, PASSES, "warm_start")? })
    }

    fn record(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        self.velocities.record(recorder, buffers, step)?;
        self.warm_start.record(recorder, buffers, step)
    }
}

impl Law {
    fn new(gpu: &Gpu, pipelines: &mut Pipelines, plan: &Plan, law: u32) -> Result<Self> {
        let mut sweep = |stem, visit| Sweep::splitting(gpu, pipelines, plan, stem, visit);
        Ok(match law {
            solver::SOFT => {
                let (solve, relax) = (sweep(PASSES, "solve")?, sweep(PASSES, "relax")?);
                let positions = ByBody::new(gpu, pipelines, "motion", "integrate_positions")?;
                Self::Soft { start: Start::new(gpu, pipelines, plan)?, solve, positions, relax }
            }
            solver::GAUSS_SEIDEL => {
                let (visit, last) = (sweep(CLASSIC, "gauss_seidel")?, sweep(CLASSIC, "last_gauss_seidel")?);
                let positions = ByBody::new(gpu, pipelines, "motion", "integrate_positions")?;
                Self::GaussSeidel { start: Start::new(gpu, pipelines, plan)?, visit, last, positions }
            }
            solver::JACOBI => {
                let mut sweep = |visit| Sweep::new(gpu, pipelines, CLASSIC, visit);
                let (split, visit, last) = (sweep("split")?, sweep("jacobi")?, sweep("last_jacobi")?);
                let mut body = |stem, entry| ByBody::new(gpu, pipelines, stem, entry);
                let (begin, settle) = (body(CLASSIC, "begin")?, body(CLASSIC, "settle")?);
                let positions = body("motion", "integrate_positions")?;
                Self::Jacobi { split, start: Start::new(gpu, pipelines, plan)?, begin, visit, last, settle, positions }
            }
            solver::PENALTY => {
                let press = Sweep::new(gpu, pipelines, CLASSIC, "penalty")?;
                let mut body = |stem, entry| ByBody::new(gpu, pipelines, stem, entry);
                let (first, settle) = (body("motion", "first_substep")?, body(CLASSIC, "settle")?);
                Self::Penalty { first, press, settle, positions: body("motion", "integrate_positions")? }
            }
            _ => {
                let (load, pass) = (sweep(PASSES, "load")?, sweep(PASSES, "one_pass")?);
                let mut body = |entry| ByBody::new(gpu, pipelines, "motion", entry);
                let [first, next, last] = [body("first_substep")?, body("next_substep")?, body("last_substep")?];
                Self::OnePass { first, load, pass, next, last }
            }
        })
    }

    fn record(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers,
        step: &StepParams,
        joints: Option<&Joint>,
    ) -> Result<()> {
        match self {
            Self::OnePass { first, load, .. } => {
                first.record(recorder, buffers, step)?;
                load.record(recorder, buffers, step)?;
                joints.map_or(Ok(()), |joints| joints.record_loaded(recorder, buffers, step))?;
            }
            Self::Jacobi { split, .. } => split.record(recorder, buffers, step)?,
            _ => {}
        }
        (1..=step.substeps).try_for_each(|substep| self.record_substep(recorder, buffers, step, joints, substep))
    }

    /// Joints come before contacts, and once more when bodies have moved.
    fn record_substep(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers,
        step: &StepParams,
        joints: Option<&Joint>,
        substep: u32,
    ) -> Result<()> {
        let solve = |recorder: &mut Recorder| match joints {
            Some(joints) => joints.record(recorder, buffers, step, Part::Solve),
            None => Ok(()),
        };
        let move_bodies = |recorder: &mut Recorder, positions: &ByBody| match joints {
            Some(joints) => joints.record_move(recorder, buffers, step, false),
            None => positions.record(recorder, buffers, step),
        };
        match self {
            Self::OnePass { pass, next, last, .. } => {
                solve(recorder)?;
                pass.record(recorder, buffers, step)?;
                let is_last = substep == step.substeps;
                match joints {
                    None => if is_last { last } else { next }.record(recorder, buffers, step),
                    Some(joints) => {
                        joints.record_move(recorder, buffers, step, is_last)?;
                        if is_last { Ok(()) } else { joints.record_next(recorder, buffers, step) }
                    }
                }
            }
            Self::Soft { start, solve: springs, positions, relax } => {
                start.record(recorder, buffers, step)?;
                solve(recorder)?;
                springs.record(recorder, buffers, step)?;
                move_bodies(recorder, positions)?;
                relax.record(recorder, buffers, step)
            }
            Self::GaussSeidel { start, visit, last, positions } => {
                start.record(recorder, buffers, step)?;
                solve(recorder)?;
                for _ in 1..step.iterations {
                    visit.record(recorder, buffers, step)?;
                }
                last.record(recorder, buffers, step)?;
                move_bodies(recorder, positions)
            }
            Self::Jacobi { start, begin, visit, last, settle, positions, .. } => {
                start.record(recorder, buffers, step)?;
                solve(recorder)?;
                begin.record(recorder, buffers, step)?;
                for iteration in 1..=step.iterations {
                    let visit = if iteration < step.iterations { visit } else { last };
                    visit.record(recorder, buffers, step)?;
                    settle.record(recorder, buffers, step)?;
                }
                move_bodies(recorder, positions)
            }
            Self::Penalty { first, press, settle, positions } => {
                first.record(recorder, buffers, step)?;
                solve(recorder)?;
                press.record(recorder, buffers, step)?;
                settle.record(recorder, buffers, step)?;
                move_bodies(recorder, positions)
            }
        }
    }
}

fn splits_last(step: &StepParams) -> bool {
    step.batching & batching::SPLIT_LAST != 0
}

fn by_body(step: &StepParams) -> u32 {
    step.body_count.div_ceil(256)
}

impl Solver {
    /// With the law of this code (`StepParams::solver`).
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes, plan: &Plan, law: u32) -> Result<Self> {
        let mut bounce = || Sweep::splitting(gpu, pipelines, plan, PASSES, "restitution");
        let restitution = plan.restitution.then(&mut bounce).transpose()?;
        Ok(Self {
            bodies: pipelines.pass(gpu, "solver/prepare", "bodies")?,
            split: plan.split.then(|| Split::new(gpu, pipelines, sizes)).transpose()?,
            constraints: pipelines.pass(gpu, "solver/prepare", "constraints")?,
            carry: pipelines.pass(gpu, "solver/prepare", "carry")?,
            rewind: plan.levels.then(|| ByBody::new(gpu, pipelines, "motion", "rewind")).transpose()?,
            law: Law::new(gpu, pipelines, plan, law)?,
            restitution,
            store: pipelines.pass(gpu, "solver/store", "store")?,
            joints: plan.joints.then(|| Joint::new(gpu, pipelines)).transpose()?,
        })
    }

    /// Bytes of its own scratch.
    pub(crate) fn bytes(&self) -> u64 {
        self.split.as_ref().map_or(0, Split::bytes)
    }

    /// Tells the solver which joints the step has that is recorded next.
    pub(crate) fn prepare(&mut self, joints: &Arc<JointSet>) {
        if let Some(own) = &mut self.joints {
            own.prepare(joints);
        }
    }

    fn joints(&self) -> Option<&Joint> {
        self.joints.as_ref().filter(|joints| joints.any())
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        recorder.stage("prepare");
        let own = buffers.buffer("dispatch_args")?;
        recorder.dispatch(&self.bodies, &[], by_body(step))?;
        if let Some(joints) = self.joints() {
            joints.record_mark(recorder)?;
        }
        if let Some(split) = self.split.as_ref().filter(|_| splits_last(step)) {
            split.record(recorder, buffers)?;
        }
        recorder.dispatch_indirect(&self.constraints, &[], own, args::CONSTRAINTS)?;
        recorder.dispatch_indirect(&self.carry, &[], own, args::CONSTRAINTS)?;
        recorder.stage("solver");
        for step in step.by_level() {
            self.record_level(recorder, buffers, &step)?;
        }
        if let Some(joints) = self.joints() {
            joints.record_store(recorder)?;
        }
        recorder.dispatch_indirect(&self.store, &[], own, args::CONSTRAINTS)
    }

    /// Records all sub-steps of the step's level.
    fn record_level(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        if let Some(rewind) = self.rewind.as_ref().filter(|_| step.levels.trailing_zeros() < step.level) {
            rewind.record(recorder, buffers, step)?;
        }
        if let Some(joints) = self.joints() {
            joints.record(recorder, buffers, step, Part::Begin)?;
        }
        self.law.record(recorder, buffers, step, self.joints())?;
        self.restitution.as_ref().map_or(Ok(()), |restitution| restitution.record(recorder, buffers, step))
    }
}
