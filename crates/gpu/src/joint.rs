//! Stage `joint`: what holds bodies together. Host side of `shaders/joint/`.

use crate::store::{index_part, level_part};
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::layout::{Joint as Description, JointState, JointTables, StepParams};
use tumble_core::topology::WIDE_JOINTS;
use tumble_core::{JointSet, Result};
use wgpu::BufferUsages;

/// Bytes of a `JointWork`, see `shaders/joint/rows.wgsl`.
const WORK_BYTES: u64 = 96 + 64 + 2 * (6 * 48 + 7 * 16);

/// A visit to every joint of the batches: one dispatch for each wide one, one for the rest.
struct Visit {
    batch: Arc<Pass>,
    tail: Arc<Pass>,
}

/// The passes, and what the host knows of the joints of the step that is recorded.
pub(crate) struct Joint {
    mark: Arc<Pass>,
    begin: Arc<Pass>,
    solve: Arc<Pass>,
    relax: Arc<Pass>,
    store: Arc<Pass>,
    begin_loose: Arc<Pass>,
    stiffen: Arc<Pass>,
    warm_start: Visit,
    solve_loose: Visit,
    relax_loose: Visit,
    move_body: Arc<Pass>,
    move_last: Arc<Pass>,
    start_next: Arc<Pass>,
    halve_load: Arc<Pass>,
    /// The joints that are recorded.
    set: Arc<JointSet>,
    tables: JointTables,
    /// Joints of each wide batch.
    wide: Vec<u32>,
}

/// A part of a sub-step.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Once a step and level, before its sub-steps.
    Begin,
    /// Before contacts.
    Solve,
    /// After bodies have moved.
    Relax,
}

impl Joint {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines) -> Result<Self> {
        let mut pass = |stem: &str, entry: &str| pipelines.pass(gpu, stem, entry);
        let mut island = |entry| pass("joint/island", entry);
        let [mark, begin, solve] = [island("mark")?, island("begin")?, island("solve")?];
        let [relax, store] = [island("relax")?, island("store")?];
        let mut visit = |entry: &str| -> Result<Visit> {
            let tail = pass("joint/batches", &format!("{entry}_tail"))?;
            Ok(Visit { batch: pass("joint/batches", entry)?, tail })
        };
        let [warm_start, solve_loose, relax_loose] = [visit("warm_start")?, visit("solve")?, visit("relax")?];
        let begin_loose = pass("joint/batches", "begin")?;
        let stiffen = pass("joint/batches", "stiffen_bodies")?;
        let [move_body, move_last] = [pass("motion", "move_body")?, pass("motion", "move_last")?];
        let [start_next, halve_load] = [pass("motion", "start_next")?, pass("motion", "halve_load")?];
        Ok(Self {
            mark,
            begin,
            solve,
            relax,
            store,
            begin_loose,
            stiffen,
            warm_start,
            solve_loose,
            relax_loose,
            move_body,
            move_last,
            start_next,
            halve_load,
            set: Arc::default(),
            tables: bytemuck::Zeroable::zeroed(),
            wide: Vec::new(),
        })
    }

    /// What the step that is recorded next has.
    pub(crate) fn prepare(&mut self, set: &Arc<JointSet>) {
        if Arc::ptr_eq(&self.set, set) {
            return;
        }
        self.set = set.clone();
        let topology = &set.topology;
        self.tables = topology.pack().0;
        let wide = topology.batches.windows(2).map(|batch| batch[1] - batch[0]);
        self.wide = wide.take(self.tables.wide_batches as usize).collect();
    }

    /// Whether there is any joint.
    pub(crate) fn any(&self) -> bool {
        self.tables.joint_count > 0
    }

    /// Once solver bodies are prepared.
    pub(crate) fn record_mark(&self, recorder: &mut Recorder) -> Result<()> {
        recorder.dispatch(&self.mark, &[], self.tables.body_count.div_ceil(256))
    }

    /// Once all sub-steps are done.
    pub(crate) fn record_store(&self, recorder: &mut Recorder) -> Result<()> {
        recorder.dispatch(&self.store, &[], self.tables.joint_count.div_ceil(256))
    }

    pub(crate) fn record(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers,
        step: &StepParams,
        part: Part,
    ) -> Result<()> {
        let level = [level_part(buffers, step)?];
        let island = match part {
            Part::Begin => &self.begin,
            Part::Solve => &self.solve,
            Part::Relax => &self.relax,
        };
        recorder.dispatch(island, &level, self.tables.island_count)?;
        let loose = self.tables.joint_count - self.tables.direct_joints;
        if loose == 0 {
            return Ok(());
        }
        let bodies = (self.tables.body_count - self.tables.direct_bodies).div_ceil(256);
        match part {
            Part::Begin => {
                recorder.dispatch(&self.begin_loose, &level, loose.div_ceil(256))?;
                recorder.dispatch(&self.stiffen, &level, bodies)
            }
            Part::Solve => {
                self.record_visit(recorder, buffers, step, &self.warm_start)?;
                self.record_visit(recorder, buffers, step, &self.solve_loose)
            }
            Part::Relax => {
                recorder.dispatch(&self.stiffen, &level, bodies)?;
                self.record_visit(recorder, buffers, step, &self.relax_loose)
            }
        }
    }

    /// Bodies move, and what follows when they have.
    pub(crate) fn record_move(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers,
        step: &StepParams,
        last: bool,
    ) -> Result<()> {
        let pass = if last { &self.move_last } else { &self.move_body };
        recorder.dispatch(pass, &[level_part(buffers, step)?], step.body_count.div_ceil(256))?;
        self.record(recorder, buffers, step, Part::Relax)
    }

    /// One pass: once contacts gave the impulses that they begin with.
    pub(crate) fn record_loaded(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        recorder.dispatch(&self.halve_load, &[level_part(buffers, step)?], step.body_count.div_ceil(256))
    }

    /// One pass: the next sub-step begins.
    pub(crate) fn record_next(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        recorder.dispatch(&self.start_next, &[level_part(buffers, step)?], step.body_count.div_ceil(256))
    }

    fn record_visit(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams, visit: &Visit) -> Result<()> {
        for (index, &count) in self.wide.iter().enumerate() {
            let batch = [index_part("batch", buffers, index as u32)?, level_part(buffers, step)?];
            recorder.dispatch(&visit.batch, &batch, count.div_ceil(256))?;
        }
        let tail = u32::from(self.tables.batch_count > self.tables.wide_batches);
        recorder.dispatch(&visit.tail, &[level_part(buffers, step)?], tail)
    }
}

/// Creates the buffers of joints, with room for none.
pub(crate) fn create(gpu: &Gpu, buffers: &mut Buffers) -> Result<()> {
    let storage = BufferUsages::STORAGE;
    buffers.create(gpu, "joints", size_of::<Description>() as u64, 1, storage)?;
    buffers.create(gpu, "joint_states", size_of::<JointState>() as u64, 1, storage)?;
    buffers.create(gpu, "joint_works", WORK_BYTES, 1, storage)?;
    buffers.create(gpu, "joint_tables", 4, 1, storage)?;
    buffers.create(gpu, "joint_factors", 16, 1, storage)?;
    buffers.create(gpu, "joint_layout", size_of::<JointTables>() as u64, 1, BufferUsages::UNIFORM)
}

/// Writes the joints of the coming step, all of them; what lasts of joints stays.
pub(crate) fn upload(gpu: &Gpu, buffers: &mut Buffers, set: &JointSet) -> Result<()> {
    let (tables, words) = set.topology.pack();
    buffers.grow(gpu, "joints", set.joints.len() as u64, false)?;
    buffers.grow(gpu, "joint_states", set.joints.len() as u64, true)?;
    buffers.grow(gpu, "joint_works", tables.joint_count.into(), false)?;
    buffers.grow(gpu, "joint_tables", words.len() as u64, false)?;
    let factors = 4 * u64::from(tables.block_count) + 6 * u64::from(tables.entry_count);
    buffers.grow(gpu, "joint_factors", factors, false)?;
    let write = |name: &str, bytes: &[u8]| -> Result<()> {
        gpu.queue.write_buffer(buffers.buffer(name)?, 0, bytes);
        Ok(())
    };
    write("joints", bytemuck::cast_slice(&set.joints))?;
    write("joint_tables", bytemuck::cast_slice(&words))?;
    write("joint_layout", bytemuck::bytes_of(&tables))
}

const _: () = assert!(WIDE_JOINTS == 256, "a wide batch fills a workgroup");
