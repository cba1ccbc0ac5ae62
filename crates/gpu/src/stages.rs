//! The stages of a step, in order.

use crate::batch::Batch;
use crate::bounds::Bounds;
use crate::broadphase::{Broadphase, Choice};
use crate::contact::Contact;
use crate::edit::Edit;
use crate::island::Island;
use crate::level::Level;
use crate::motion::Motion;
use crate::narrowphase::Narrowphase;
use crate::sleep::Sleep;
use crate::solver::Solver;
use crate::store::Sizes;
use crate::{Buffers, Gpu, Pipelines, Recorder};
use tumble_core::edit::EditBatch;
use tumble_core::layout::StepParams;
use tumble_core::{JointSet, Plan, Result};

/// What decides which passes there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Built {
    pub(crate) plan: Plan,
    pub(crate) choice: Choice,
    /// `StepParams::solver`.
    pub(crate) solver: u32,
}

/// Every stage that the plan needs, made for arrays of these sizes.
pub(crate) struct Stages {
    edit: Edit,
    bounds: Bounds,
    pub(crate) broadphase: Broadphase,
    contact: Contact,
    narrowphase: Narrowphase,
    /// Where bodies may sleep.
    sleep: Option<Sleep>,
    /// Where something asks which bodies hang together.
    island: Option<Island>,
    /// Where islands have sub-steps of their own.
    level: Option<Level>,
    batch: Batch,
    solver: Solver,
    motion: Motion,
}

impl Stages {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes, built: &Built) -> Result<Self> {
        let plan = &built.plan;
        Ok(Self {
            edit: Edit::new(gpu, pipelines)?,
            bounds: Bounds::new(gpu, pipelines)?,
            broadphase: Broadphase::new(gpu, pipelines, sizes, &built.choice)?,
            contact: Contact::new(gpu, pipelines, sizes)?,
            narrowphase: Narrowphase::new(gpu, pipelines, plan)?,
            sleep: plan.sleep.then(|| Sleep::new(gpu, pipelines, sizes)).transpose()?,
            island: plan.islands().then(|| Island::new(gpu, pipelines)).transpose()?,
            level: plan.levels.then(|| Level::new(gpu, pipelines)).transpose()?,
            batch: Batch::new(gpu, pipelines, sizes)?,
            solver: Solver::new(gpu, pipelines, sizes, plan, built.solver)?,
            motion: Motion::new(gpu, pipelines)?,
        })
    }

    /// Bytes of the stages' own scratch.
    pub(crate) fn bytes(&self) -> u64 {
        self.broadphase.bytes() + self.broadphase.sort_bytes() + self.batch.bytes() + self.solver.bytes()
    }

    /// Tells stages what they must know on the host before the step is submitted.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, step: &StepParams, edits: &EditBatch) -> Result<()> {
        self.solver.prepare(&edits.joints);
        self.broadphase.prepare(gpu, step, edits.stale)
    }

    /// Records one step: the plan phase up to the second gate, then the commit phase, whose passes do nothing once the
    /// stop flag is up.
    pub(crate) fn record(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers,
        step: &StepParams,
        joints: &JointSet,
    ) -> Result<()> {
        let may_sleep = step.sleep_distance >= 0.0;
        let joined = joints.topology.joined.len() as u32;
        self.edit.record(recorder, step)?;
        if let Some(sleep) = self.sleep.as_ref().filter(|_| may_sleep || step.wake_all != 0) {
            sleep.record_edits(recorder, buffers, step, joined)?;
        }
        self.bounds.record(recorder, step)?;
        self.broadphase.record(recorder, buffers, step)?;
        self.contact.record_match(recorder, buffers)?;
        self.narrowphase.record(recorder, self.contact.a_pair())?;
        if let Some(sleep) = self.sleep.as_ref().filter(|_| may_sleep) {
            sleep.record_touch(recorder, step, self.contact.a_pair())?;
        }
        let leveled = step.is_leveled();
        if let Some(island) = self.island.as_ref().filter(|_| may_sleep || leveled) {
            island.record(recorder, step, self.contact.a_pair(), joined)?;
        }
        if let Some(level) = self.level.as_ref().filter(|_| leveled) {
            level.record(recorder, step, self.contact.a_pair(), joints.joints.len() as u32)?;
        }
        self.batch.record(recorder, buffers, step, self.contact.a_pair())?;

        self.solver.record(recorder, buffers, step)?;
        self.contact.record_commit(recorder, buffers)?;
        self.motion.record_commit(recorder, buffers, step)?;
        if let Some(sleep) = self.sleep.as_ref().filter(|_| may_sleep) {
            sleep.record_settle(recorder, step)?;
        }
        self.motion.record_poses(recorder, step)?;
        self.contact.record_counts(recorder)
    }

    /// Records a step in which nothing is awake: but for its number, all is as it was.
    pub(crate) fn record_idle(&self, recorder: &mut Recorder) -> Result<()> {
        self.sleep.as_ref().map_or(Ok(()), |sleep| sleep.record_pass_time(recorder))
    }
}
