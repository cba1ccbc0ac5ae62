//! A world on the CPU: the face, capacity and the edit log. What it keeps, and the order of the passes, is in `kept`.

mod asleep;
mod contacts;
mod kept;
mod queries;

use crate::broadphase::Finder;
use crate::query;
use crate::solver::Rows;
use asleep::Asleep;
use bytemuck::Zeroable;
use glam::Vec3;
use kept::{Asked, Kept, Overflow};
use std::sync::Arc;
use tumble_core::edit::EditBatch;
use tumble_core::layout::{Control, PoseRecord, StepParams};
use tumble_core::limits::{self, Room};
use tumble_core::stopwatch::{Span, Stopwatch};
use tumble_core::{
    Broadphase, Editor, Error, JointsSolved, Params, Poses, Result, Scene, StageTime, StepReport, Velocities,
    WantedLevels,
};

/// A scene of no more colliders runs on the caller's thread: none of its passes is long enough to be shared, and waking
/// others took longer than the step (one free box: 32 us a step with two threads, 3 us alone).
const ALONE: u32 = 32;

/// A simulation on the CPU.
pub struct World {
    editor: Editor,
    params: Params,
    pool: rayon::ThreadPool,
    kept: Kept,
    room: Room,
    report: StepReport,
    adapter: String,
    growths: Vec<(&'static str, u32)>,
    drop_pair: u32,
    finder: Finder,
    /// How far colliders lay apart in the step of this number.
    extent: Option<(u32, Vec3)>,
    queries: query::Cached,
    watch: Stopwatch,
    /// What the last committed step was told.
    last_step: StepParams,
    /// Levels of sub-steps that the last few steps wanted.
    levels: WantedLevels,
    /// Why the last step did not run.
    failed: Option<Error>,
}

impl World {
    /// Loads a scene.
    pub fn new(scene: Scene, params: Params) -> Result<Self> {
        params.validate()?;
        let (editor, packed) = Editor::new(scene)?;
        let threads = params.threads.unwrap_or(0);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| Error::Invalid {
            what: format!("Params ({error})"),
            field: "threads",
            value: threads.to_string(),
            allowed: "a number of threads that the system can start",
        })?;
        let rows = Rows::default();
        let (lanes, threads) = (rows.lanes(), pool.current_num_threads());
        let adapter = format!("{}, {lanes} lanes, {threads} threads", std::env::consts::ARCH);
        let mut kept = Kept {
            control: Control::zeroed(),
            poses: packed.states.iter().zip(&packed.props).map(|(s, p)| PoseRecord::of(s, p)).collect(),
            states: packed.states,
            props: packed.props,
            colliders: packed.colliders,
            pairs: Vec::new(),
            free: Vec::new(),
            batch_of_slot: Vec::new(),
            impulses: Vec::new(),
            memory: Vec::new(),
            found: Vec::new(),
            rows,
            asleep: Asleep::default(),
            joints: crate::joint::Joints::default(),
            joint_set: Arc::default(),
        };
        let (bodies, colliders) = (kept.states.len() as u32, kept.colliders.len() as u32);
        kept.reserve_pairs(limits::initial_pairs(&params.capacities, colliders))?;
        Ok(Self {
            editor,
            room: Room::first(&params.capacities, bodies, colliders),
            params,
            pool,
            kept,
            report: StepReport::default(),
            adapter,
            growths: Vec::new(),
            drop_pair: u32::MAX,
            finder: Finder::default(),
            extent: None,
            queries: query::Cached::default(),
            watch: Stopwatch::default(),
            last_step: StepParams::zeroed(),
            levels: WantedLevels::default(),
            failed: None,
        })
    }

    /// Adds a remark to what reports say of where the world runs.
    #[doc(hidden)]
    pub fn note(&mut self, remark: &str) {
        self.adapter = format!("{} ({remark})", self.adapter);
    }

    /// Before the first step: visits so many joints of large islands at a time, 1, 4 or 8, instead of as many as the processor
    /// takes; false if that is not a number that it takes. One at a time differs from several by rounding.
    #[doc(hidden)]
    pub fn set_joint_lanes(&mut self, lanes: usize) -> bool {
        let joints = crate::joint::Joints::with_lanes(lanes);
        let is_one = joints.is_some();
        self.kept.joints = joints.unwrap_or_default();
        is_one
    }

    /// Edits for the next step.
    pub fn edit(&mut self) -> &mut Editor {
        &mut self.editor
    }

    /// The scene as edited so far.
    pub fn scene(&self) -> &Scene {
        self.editor.scene()
    }

    /// Parameters in force.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Parameters from the next step on. The number of threads stays as it was.
    pub fn set_params(&mut self, params: Params) -> Result<()> {
        params.validate()?;
        self.params = params;
        Ok(())
    }

    /// Test hook: the next step leaves out the pair of this index.
    #[doc(hidden)]
    pub fn drop_pair(&mut self, index: u32) {
        self.drop_pair = index;
    }

    /// Runs one step.
    ///
    /// # Errors
    /// [`Error::Capacity`] when it needs more room than it may have: the step did not run, its edits wait for the next
    /// call, and the last good state stays readable.
    pub fn step(&mut self) -> Result<()> {
        let span = Span::enter("step");
        self.watch.start(self.params.profile);
        let needed = Room {
            bodies: self.editor.body_slots() as u32,
            colliders: self.editor.collider_slots() as u32,
            edits: self.editor.edit_count() as u32,
        };
        let (room, grown) = self.room.grown(&needed, &self.params.capacities)?;
        self.room = room;
        grown.into_iter().for_each(|buffer| self.count_growth(buffer));
        let number = self.kept.control.step + 1;
        // As late as on a GPU.
        if let Some((_, extent)) = self.extent.take_if(|(seen, _)| *seen + limits::STATUS_DELAY == number) {
            self.editor.look(extent);
        }
        let edits = self.editor.take(self.params.joints);
        let mut step = self.params.step_params(number, self.editor.scene().gravity);
        step.body_count = needed.bodies;
        step.collider_count = needed.colliders;
        step.edit_ranges = edits.ranges.len() as u32;
        step.cell_table_bits = limits::cell_table_bits(step.collider_count);
        step.large_limit = limits::large_limit(step.collider_count, self.editor.spread().is_wide());
        step.drop_pair = self.drop_pair;
        step.levels = self.levels.of(&step, self.editor.plan().asked_levels);
        if self.kept.is_idle(&edits, &step) {
            self.kept.pass_time(&step);
            self.last_step.step = step.step;
            self.finish(self.watch.runs().len(), self.report.broadphase);
            return Ok(());
        }
        self.failed = self.run(&edits, step, &span).err();
        if let Some(error) = self.failed.clone() {
            self.editor.put_back(edits);
            return Err(error);
        }
        self.drop_pair = u32::MAX;
        if (step.step + limits::STATUS_DELAY).is_multiple_of(limits::LOOK_EVERY) {
            self.extent = Some((step.step, self.finder.extent()));
        }
        Ok(())
    }

    /// Waits for all steps (here they are done) and returns the last one's report.
    pub fn sync(&mut self) -> Result<StepReport> {
        Ok(self.report.clone())
    }

    /// All poses after the last step.
    pub fn poses(&mut self) -> Result<Poses> {
        Ok(Poses::from_records(self.kept.control.step as u64, &self.kept.poses))
    }

    /// The newest finished poses.
    pub fn try_poses(&mut self) -> Result<Option<Poses>> {
        self.poses().map(Some)
    }

    /// All velocities after the last step.
    pub fn velocities(&mut self) -> Result<Velocities> {
        Ok(Velocities::from_states(self.kept.control.step as u64, &self.kept.states))
    }

    /// Plans and commits a step, growing the pair list between where that is needed and allowed.
    fn run(&mut self, edits: &EditBatch, mut step: StepParams, span: &Span) -> Result<()> {
        let restitution = self.editor.plan().restitution;
        let broadphase = self.params.broadphase.resolve(self.editor.spread());
        loop {
            let attempt = self.watch.runs().len();
            step.pair_capacity = (self.kept.impulses.len() / 4) as u32;
            let (kept, pool, finder, watch) = (&mut self.kept, &self.pool, &mut self.finder, &mut self.watch);
            let asked = Asked { edits, params: &self.params, broadphase };
            let mut planned_and_committed = || {
                let planned = kept.plan(&asked, finder, &step, watch)?;
                kept.commit(planned, &step, restitution, watch);
                Ok(())
            };
            let run = match step.collider_count <= ALONE {
                true => planned_and_committed(),
                false => pool.install(|| {
                    let _span = span.enter_again();
                    planned_and_committed()
                }),
            };
            match run {
                Ok(()) => {
                    self.last_step = step;
                    self.finish(attempt, broadphase);
                    return Ok(());
                }
                Err(overflow) => {
                    let growth = self.watch.begin("growth");
                    self.grow(overflow)?;
                    self.watch.end(growth);
                }
            }
        }
    }

    fn grow(&mut self, overflow: Overflow) -> Result<()> {
        let Overflow { buffer, needed, capacity } = overflow;
        if buffer != "pairs" {
            return Err(Error::Capacity { buffer, needed, capacity: capacity.into() });
        }
        let room = limits::more(buffer, needed, capacity, limits::BYTES_A_PAIR, &self.params.capacities)?;
        self.kept.reserve_pairs(room)?;
        self.count_growth(buffer);
        Ok(())
    }

    fn count_growth(&mut self, buffer: &'static str) {
        match self.growths.iter_mut().find(|(name, _)| *name == buffer) {
            Some((_, count)) => *count += 1,
            None => self.growths.push((buffer, 1)),
        }
    }

    /// `attempt`: where the runs of the one that went through begin.
    fn finish(&mut self, attempt: usize, broadphase: Broadphase) {
        self.levels.push(&self.kept.control);
        let mut report = StepReport::from_control(&self.kept.control);
        report.joints = JointsSolved::of(&self.kept.joint_set.topology);
        report.newly_broken = self.kept.joint_set.newly_broken(&self.kept.control);
        report.backend = "cpu";
        report.adapter = self.adapter.clone();
        report.bodies = self.editor.scene().len() as u32;
        report.growths = self.growths.clone();
        report.broadphase = broadphase;
        report.broadphase_bytes = self.finder.bytes();
        report.memory_bytes = self.kept.bytes() + self.finder.bytes() + self.queries.bytes();
        report.accuracy = StepReport::spent(&self.kept.control, &self.last_step);
        report.stages = StageTime::sums(&self.watch.runs()[attempt..]);
        report.host_runs = self.watch.runs().to_vec();
        self.report = report;
    }
}
