//! A world on the GPU: submission, the ring of statuses and the edit log. What grows is in `growth`.

mod growth;
mod queries;
mod results;

use crate::broadphase::Choice;
use crate::joined::Joined;
use crate::joint;
use crate::query::Query;
use crate::readback::{Readback, read_now};
use crate::stages::{Built, Stages};
use crate::store::{self, Sizes, level_offset};
use crate::{BindCache, Buffers, Gpu, Pipelines, Recorder, Timer};
use bytemuck::Zeroable;
use glam::Vec3;
use growth::within;
use std::collections::VecDeque;
use std::sync::Arc;
use tumble_core::edit::EditBatch;
use tumble_core::layout::{Control, LAST_BATCH, Pair, PoseRecord, StepParams};
use tumble_core::limits::{self, Room};
use tumble_core::stopwatch::{Span, Stopwatch};
use tumble_core::{
    Editor, JointSet, JointsSolved, Params, Poses, Result, Scene, StageRun, StageTime, StepReport, WantedLevels,
};

/// Steps in flight before `step` waits.
const IN_FLIGHT: usize = 3;
/// Batches with a dispatch of their own as long as no report has told how many there are.
const WIDE_BATCHES: u32 = 24;
/// Constraints from which on a batch is worth a dispatch at first; those behind the last such batch share a workgroup.
const WIDE: u32 = 256;

/// A simulation on a GPU.
///
/// Steps are submitted and not waited for; each leaves a status that comes back on its own. A step that finds a buffer
/// too small raises a flag: neither it nor the ones behind it commit anything. When its status arrives, the buffer is
/// made larger and those steps run again, edits included.
pub struct World {
    gpu: Gpu,
    editor: Editor,
    params: Params,
    pipelines: Pipelines,
    buffers: Buffers,
    stages: Stages,
    sizes: Sizes,
    joined: Joined,
    /// Records that the buffers of edits have room for.
    edit_room: u32,
    built: Built,
    cache: BindCache,
    timer: Option<Timer>,
    statuses: Readback,
    pose_copies: Readback,
    step_copies: Readback,
    newest_poses: Option<Poses>,
    /// Submitted steps whose status has not come, oldest first.
    flying: VecDeque<Record>,
    /// Steps to run again once there is room.
    waiting: VecDeque<Record>,
    submitted: u32,
    last: Control,
    /// What the last committed step was told.
    last_step: StepParams,
    /// The joints that it had.
    last_joints: Arc<JointSet>,
    /// Most pairs that a step had.
    most_pairs: u32,
    /// Of the last few steps: the number, how many batches were worth a dispatch, and how many bodies were awake where
    /// they may sleep.
    known: VecDeque<(u32, u32, u32)>,
    /// Levels of sub-steps that the last few steps wanted.
    levels: WantedLevels,
    /// Gravity and speculative distance of the last step, as bits, if bodies could sleep in it.
    told: Option<[u32; 4]>,
    /// The last step that had edits, or woke all.
    disturbed: u32,
    /// Constraints from which on a batch is worth one.
    wide: u32,
    /// Dispatches that the last submission recorded.
    dispatches: u32,
    /// How far colliders lay apart in the step of this number.
    extent: Option<(u32, Vec3)>,
    device_runs: Vec<StageRun>,
    watch: Stopwatch,
    growths: Vec<(&'static str, u32)>,
    drop_pair: u32,
    /// The joints that are in the buffers.
    uploaded: Arc<JointSet>,
    /// From the first query on.
    query: Option<Query>,
}

/// All that a step needs to be run, and run again.
struct Record {
    step: StepParams,
    edits: EditBatch,
    wants: Built,
    /// It was submitted as a step in which nothing is awake.
    idle: bool,
}

impl World {
    /// Loads a scene onto the best adapter there is, a software one too.
    ///
    /// # Errors
    /// What is wrong with the scene or the parameters; [`Error::NoAdapter`](tumble_core::Error::NoAdapter);
    /// [`Error::Limits`](tumble_core::Error::Limits) and [`Error::OutOfMemory`](tumble_core::Error::OutOfMemory) when the
    /// adapter is too small for the scene.
    pub fn new(scene: Scene, params: Params) -> Result<Self> {
        Self::with_gpu(Gpu::any()?, scene, params)
    }

    /// Loads a scene onto a user's own device, for example a renderer's. The device keeps its handlers.
    ///
    /// # Errors
    /// As for [`World::new`].
    pub fn with_device(device: wgpu::Device, queue: wgpu::Queue, scene: Scene, params: Params) -> Result<Self> {
        Self::with_gpu(Gpu::from_device(device, queue), scene, params)
    }

    /// Loads a scene onto this device.
    ///
    /// # Errors
    /// As for [`World::new`].
    pub fn with_gpu(gpu: Gpu, scene: Scene, params: Params) -> Result<Self> {
        Self::with_pipelines(gpu, Pipelines::new(), scene, params)
    }

    /// For tests: with passes that run in another order.
    #[doc(hidden)]
    pub fn with_pipelines(gpu: Gpu, mut pipelines: Pipelines, scene: Scene, params: Params) -> Result<Self> {
        params.validate()?;
        gpu.check_limits()?;
        let (editor, packed) = Editor::new(scene)?;
        let (bodies, colliders) = (packed.states.len() as u32, packed.colliders.len() as u32);
        let pairs = limits::initial_pairs(&within(&gpu, &params), colliders);
        let room = Room::first(&params.capacities, bodies, colliders);
        let plan = packed.plan.with(&params);
        let sizes = Sizes { bodies: room.bodies, colliders: room.colliders, pairs, islands: 0, parts: 0 }.with(&plan);
        let buffers = store::create(&gpu, &packed, &sizes, room.edits)?;
        let poses: Vec<PoseRecord> =
            packed.states.iter().zip(&packed.props).map(|(s, p)| PoseRecord::of(s, p)).collect();
        gpu.queue.write_buffer(buffers.buffer("poses")?, 0, bytemuck::cast_slice(&poses));
        let solver = params.step_params(0, Vec3::ZERO).solver;
        let built = Built { plan, choice: Choice::new(&params, &editor), solver };
        let stages = {
            let _span = Span::enter("pipelines");
            Stages::new(&gpu, &mut pipelines, &sizes, &built)?
        };
        let timer = if params.profile { Timer::new(&gpu)? } else { None };
        let control_bytes = size_of::<Control>() as u64;
        Ok(Self {
            statuses: Readback::new(&gpu, "status", control_bytes, IN_FLIGHT)?,
            pose_copies: Readback::new(&gpu, "pose copy", pose_bytes(&sizes), 1)?,
            step_copies: Readback::new(&gpu, "step copy", control_bytes, 1)?,
            newest_poses: None,
            flying: VecDeque::new(),
            waiting: VecDeque::new(),
            submitted: 0,
            last: Control::zeroed(),
            last_step: StepParams::zeroed(),
            last_joints: Arc::default(),
            most_pairs: 0,
            known: VecDeque::new(),
            levels: WantedLevels::default(),
            told: None,
            disturbed: 0,
            wide: WIDE,
            dispatches: 0,
            extent: None,
            device_runs: Vec::new(),
            watch: Stopwatch::default(),
            growths: Vec::new(),
            drop_pair: u32::MAX,
            uploaded: Arc::default(),
            built,
            query: None,
            cache: BindCache::new(),
            gpu,
            editor,
            params,
            pipelines,
            buffers,
            stages,
            sizes,
            joined: Joined::default(),
            edit_room: room.edits,
            timer,
        })
    }

    /// Edits for the next step.
    pub fn edit(&mut self) -> &mut Editor {
        &mut self.editor
    }

    /// The scene as edited so far; poses in it are those at insertion.
    pub fn scene(&self) -> &Scene {
        self.editor.scene()
    }

    /// Parameters in force.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Parameters from the next step on.
    ///
    /// # Errors
    /// [`Error::Invalid`](tumble_core::Error::Invalid) names the field.
    pub fn set_params(&mut self, params: Params) -> Result<()> {
        params.validate()?;
        if params.profile && self.timer.is_none() {
            self.timer = Timer::new(&self.gpu)?;
        }
        self.params = params;
        Ok(())
    }

    /// The device, for a renderer.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The bodies' poses on the GPU, a [`PoseRecord`] a handle slot, written at the end of each step; and a number that
    /// changes when the buffer is replaced because the world grew. Bind it; do not write it.
    ///
    /// # Errors
    /// None that a user can cause.
    pub fn pose_buffer(&self) -> Result<(&wgpu::Buffer, u64)> {
        Ok((self.buffers.buffer("poses")?, self.buffers.generation_of("poses")))
    }

    /// Test hook: colliders of the pairs of the last step, once it has run.
    #[doc(hidden)]
    pub fn pairs(&mut self) -> Result<Vec<[u32; 2]>> {
        self.take_statuses(0)?;
        let bytes = u64::from(self.last.old_pair_count) * size_of::<Pair>() as u64;
        let pairs = match bytes {
            0 => Vec::new(),
            _ => read_now(&self.gpu, self.buffers.buffer("pairs")?, 0, bytes)?,
        };
        Ok(bytemuck::pod_collect_to_vec::<u8, Pair>(&pairs).iter().map(|pair| [pair.a, pair.b]).collect())
    }

    /// Test hook: the next step leaves out the pair of this index.
    #[doc(hidden)]
    pub fn drop_pair(&mut self, index: u32) {
        self.drop_pair = index;
    }

    /// For benches: batches of fewer constraints share one dispatch, if no larger one comes behind them. Results do not
    /// change.
    #[doc(hidden)]
    pub fn fuse_below(&mut self, constraints: u32) {
        self.wide = constraints;
    }

    /// For benches: dispatches that the last step recorded.
    #[doc(hidden)]
    pub fn dispatches(&self) -> u32 {
        self.dispatches
    }

    /// Submits one step. Waits only when three are in flight.
    ///
    /// # Errors
    /// [`Error::Capacity`](tumble_core::Error::Capacity) when this step or an earlier one needs more room than it may
    /// have: nothing is submitted, the edits wait for the next call, and the last good state stays readable.
    /// [`Error::DeviceLost`](tumble_core::Error::DeviceLost), [`Error::OutOfMemory`](tumble_core::Error::OutOfMemory) and
    /// [`Error::Gpu`](tumble_core::Error::Gpu) from the device.
    pub fn step(&mut self) -> Result<()> {
        let _span = Span::enter("step");
        self.watch.start(self.params.profile);
        self.run_waiting()?;
        self.take_statuses(IN_FLIGHT - 1)?;
        let (bodies, colliders) = (self.editor.body_slots() as u32, self.editor.collider_slots() as u32);
        self.make_room(Room { bodies, colliders, edits: self.editor.edit_count() as u32 })?;
        if let Some((_, extent)) = self.extent.take_if(|(seen, _)| *seen + limits::STATUS_DELAY == self.submitted + 1) {
            self.editor.look(extent);
        }
        let edits = self.editor.take(self.params.joints);
        let mut step = self.params.step_params(self.submitted + 1, self.editor.scene().gravity);
        step.body_count = bodies;
        step.collider_count = colliders;
        step.edit_ranges = edits.ranges.len() as u32;
        step.cell_table_bits = limits::cell_table_bits(colliders);
        let plan = self.editor.plan().with(&self.params);
        let choice = Choice::new(&self.params, &self.editor);
        let wants = Built { plan, choice, solver: step.solver };
        step.large_limit = limits::large_limit(colliders, wants.choice.large_tree);
        step.drop_pair = std::mem::replace(&mut self.drop_pair, u32::MAX);
        let [x, y, z] = step.gravity;
        let told = self.params.sleep.map(|_| [x, y, z, step.speculative_distance].map(f32::to_bits));
        step.wake_all = u32::from(told != self.told);
        self.told = told;
        if step.wake_all != 0 || !edits.records.is_empty() {
            self.disturbed = step.step;
        }
        self.submitted += 1;
        self.submit(Record { step, edits, wants, idle: false })
    }

    /// Waits for all submitted steps; the last one's report.
    ///
    /// # Errors
    /// As for [`World::step`].
    pub fn sync(&mut self) -> Result<StepReport> {
        self.run_waiting()?;
        self.take_statuses(0)?;
        Ok(self.report())
    }

    fn report(&self) -> StepReport {
        let mut report = StepReport::from_control(&self.last);
        report.joints = JointsSolved::of(&self.last_joints.topology);
        report.newly_broken = self.last_joints.newly_broken(&self.last);
        report.backend = "gpu";
        report.adapter = format!("{}, {}", self.gpu.info.name, self.gpu.info.driver_info);
        report.bodies = self.editor.scene().len() as u32;
        report.growths = self.growths.clone();
        report.broadphase = self.built.choice.which;
        report.broadphase_bytes = self.stages.broadphase.bytes();
        report.memory_bytes = self.buffers.bytes() + self.stages.bytes();
        report.memory_bytes += self.query.as_ref().map_or(0, Query::bytes);
        report.accuracy = StepReport::spent(&self.last, &self.last_step);
        report.stages = StageTime::sums(&self.device_runs);
        report.host_runs = self.watch.runs().to_vec();
        report.device_runs = self.device_runs.clone();
        report
    }

    /// Records and submits one step, and its status behind it.
    fn submit(&mut self, mut record: Record) -> Result<()> {
        let mut wanted = self.built;
        let widened = wanted.plan.widen(&record.wants.plan);
        let Built { choice, solver, .. } = record.wants;
        if widened || (wanted.choice, wanted.solver) != (choice, solver) {
            (wanted.choice, wanted.solver) = (choice, solver);
            let run = self.watch.begin("pipelines");
            self.sizes = self.sizes.with(&wanted.plan);
            store::grow(&self.gpu, &mut self.buffers, &self.sizes)?;
            self.stages = Stages::new(&self.gpu, &mut self.pipelines, &self.sizes, &wanted)?;
            self.watch.end(run);
            self.built = wanted;
        }
        let step = &mut record.step;
        step.pair_capacity = self.sizes.pairs;
        // The report of exactly three steps ago, so that no decision hangs on what has arrived. (It only decides which
        // dispatch a batch is in: the bits are the same.)
        step.levels = self.levels.of(step, record.wants.plan.asked_levels);
        let known = self.known.iter().find(|(number, ..)| number + limits::STATUS_DELAY == step.step);
        step.wide_batches = known.map_or(WIDE_BATCHES, |(_, count, _)| *count);
        // Nothing was awake then, and nothing has happened since that could wake anybody.
        let undisturbed = self.disturbed + limits::STATUS_DELAY <= step.step;
        record.idle = undisturbed && known.is_some_and(|(.., awake)| *awake == 0);
        let run = self.watch.begin("upload");
        self.upload(&record)?;
        if !record.idle {
            self.stages.prepare(&self.gpu, &record.step, &record.edits)?;
        }
        let run = self.watch.next(run, "record");
        let timer = if self.params.profile { self.timer.as_mut() } else { None };
        let mut recorder = Recorder::new(&self.gpu, &self.buffers, &mut self.cache, timer);
        match record.idle {
            true => self.stages.record_idle(&mut recorder)?,
            false => self.stages.record(&mut recorder, &self.buffers, &record.step, &record.edits.joints)?,
        }
        self.statuses.copy(recorder.encoder(), self.buffers.buffer("control")?, 0);
        self.dispatches = recorder.dispatches();
        let run = self.watch.next(run, "submit");
        let index = recorder.submit()?;
        self.watch.end(run);
        self.statuses.submitted(&index);
        self.flying.push_back(record);
        Ok(())
    }

    fn upload(&mut self, record: &Record) -> Result<()> {
        let edits = &record.edits;
        self.joined.upload(&self.gpu, &mut self.buffers, &edits.joints.topology)?;
        let queue = &self.gpu.queue;
        queue.write_buffer(self.buffers.buffer("step")?, 0, bytemuck::bytes_of(&record.step));
        for step in record.step.by_level() {
            queue.write_buffer(self.buffers.buffer("level_steps")?, level_offset(&step), bytemuck::bytes_of(&step));
        }
        if !Arc::ptr_eq(&self.uploaded, &edits.joints) {
            joint::upload(&self.gpu, &mut self.buffers, &edits.joints)?;
            self.uploaded = edits.joints.clone();
        }
        let queue = &self.gpu.queue;
        queue.write_buffer(self.buffers.buffer("edit_records")?, 0, bytemuck::cast_slice(&edits.records));
        queue.write_buffer(self.buffers.buffer("edit_ranges")?, 0, bytemuck::cast_slice(&edits.ranges));
        Ok(())
    }

    /// Takes statuses as they come, and waits until no more than `most` steps are in flight.
    fn take_statuses(&mut self, most: usize) -> Result<()> {
        while !self.flying.is_empty() {
            let taken = if self.flying.len() > most {
                let run = self.watch.begin("wait");
                let taken = self.statuses.wait_take(&self.gpu)?;
                self.watch.end(run);
                taken
            } else {
                self.statuses.try_take(&self.gpu)?
            };
            let Some(bytes) = taken else { break };
            let status = read_control(&bytes);
            if status.stop != 0 {
                self.stopped(status)?;
                continue;
            }
            if let Some(record) = self.flying.pop_front() {
                if (status.step + limits::STATUS_DELAY).is_multiple_of(limits::LOOK_EVERY) {
                    self.extent = Some((status.step, extent_of(&status)));
                }
                if !record.idle {
                    self.stages.broadphase.walked(record.step.step, status.turns);
                }
                let awake = if record.step.sleep_distance >= 0.0 { status.awake } else { u32::MAX };
                self.known.push_back((record.step.step, wide_batches(&status, self.wide), awake));
                self.last_step = record.step;
                self.last_joints = record.edits.joints;
                self.levels.push(&status);
                self.most_pairs = self.most_pairs.max(status.old_pair_count);
                if self.known.len() > 2 * IN_FLIGHT {
                    self.known.pop_front();
                }
            }
            self.last = status;
        }
        if let Some(timer) = &mut self.timer {
            let run = self.watch.begin("readback");
            while let Some(runs) = timer.take(&self.gpu, most == 0)? {
                self.device_runs = runs;
            }
            self.watch.end(run);
        }
        self.gpu.check()
    }
}

/// How many of the first batches have a dispatch of their own: up to the last that is worth one.
fn wide_batches(status: &Control, wide: u32) -> u32 {
    let worth = |batch: &u32| {
        let first = *batch as usize;
        status.batch_start[first + 1].saturating_sub(status.batch_start[first]) >= wide
    };
    (0..LAST_BATCH).rev().find(worth).map_or(0, |batch| batch + 1)
}

/// How far the middles of bounded colliders lay apart, m; below zero without any.
fn extent_of(status: &Control) -> Vec3 {
    // As shaders make an integer that rises with the float.
    let float = |x: u32| f32::from_bits(if x >> 31 == 1 { x & 0x7fff_ffff } else { !x });
    Vec3::from_array(status.center_max.map(float)) - Vec3::from_array(status.center_min.map(float))
}

fn pose_bytes(sizes: &Sizes) -> u64 {
    u64::from(sizes.bodies) * size_of::<PoseRecord>() as u64
}

fn read_control(bytes: &[u8]) -> Control {
    if bytes.len() == size_of::<Control>() { bytemuck::pod_read_unaligned(bytes) } else { Control::zeroed() }
}
