//! A world on the CPU: buffers, the order of the passes, capacity and the edit log.

use crate::batch::{self, Batches};
use crate::broadphase::{self, Boxes, Finder, Search, TooMany};
use crate::contact::{self, Matched};
use crate::shared::Shared;
use crate::solver::{self, Rows, prepare, store};
use crate::{bounds, edit, motion, narrowphase, query};
use bytemuck::Zeroable;
use glam::Vec3;
use rayon::prelude::*;
use std::time::Instant;
use tumble_core::edit::EditBatch;
use tumble_core::layout::{
    Aabb, BodyProps, BodyState, Collider, Control, FoundManifold, Impulse, Manifold, Pair, PoseRecord,
    QUARANTINE_NAMES, SolverBody, StepParams, UNBATCHED, body_flags,
};
use tumble_core::limits::{self, Room};
use tumble_core::{Broadphase, Editor, Error, Params, Poses, Result, Scene, StageTime, StepReport, Velocities};
use tumble_core::{Nearest, NearestQuery, OverlapShape, Overlaps, Ray, RayHit};

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
    /// Why the last step did not run.
    failed: Option<Error>,
}

/// What lives past a step; written only when a step commits (properties and colliders by edits, absolutely).
struct Kept {
    control: Control,
    states: Vec<BodyState>,
    props: Vec<BodyProps>,
    colliders: Vec<Collider>,
    pairs: Vec<Pair>,
    free: Vec<u32>,
    /// By slot.
    batch_of_slot: Vec<u32>,
    /// Four a slot.
    impulses: Vec<Impulse>,
    /// By slot.
    found: Vec<FoundManifold>,
    poses: Vec<PoseRecord>,
    /// The solver's rows, kept for their room alone.
    rows: Rows,
}

/// What the plan phase of a step finds; nothing of it lasts unless the step commits.
struct Planned {
    states: Vec<BodyState>,
    matched: Matched,
    manifolds: Vec<Manifold>,
    batches: Batches,
    control: Control,
}

/// Milliseconds by stage, when asked for.
struct Stopwatch {
    last: Option<Instant>,
    stages: Vec<StageTime>,
}

impl Stopwatch {
    fn new(on: bool) -> Self {
        Self { last: on.then(Instant::now), stages: Vec::new() }
    }
    fn lap(&mut self, stage: &'static str) {
        if let Some(last) = &mut self.last {
            let now = Instant::now();
            let milliseconds = Some((now - *last).as_secs_f64() * 1e3);
            self.stages.push(StageTime { stage, milliseconds });
            *last = now;
        }
    }
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
        let adapter = format!("{}, {} threads", std::env::consts::ARCH, pool.current_num_threads());
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
            found: Vec::new(),
            rows: Rows::default(),
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
            failed: None,
        })
    }

    /// Adds a remark to what reports say of where the world runs.
    #[doc(hidden)]
    pub fn note(&mut self, remark: &str) {
        self.adapter = format!("{} ({remark})", self.adapter);
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
        let edits = self.editor.take();
        let mut step = self.params.step_params(number, self.editor.scene().gravity);
        step.body_count = needed.bodies;
        step.collider_count = needed.colliders;
        step.edit_ranges = edits.ranges.len() as u32;
        step.cell_table_bits = limits::cell_table_bits(step.collider_count);
        step.large_limit = limits::large_limit(step.collider_count, self.editor.spread().is_wide());
        step.drop_pair = self.drop_pair;
        self.failed = self.run(&edits, step).err();
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

    /// The first collider that each ray meets, or none; in the order of the rays.
    ///
    /// # Errors
    /// [`Error::Invalid`] names the ray and the field. [`Error::Capacity`] when a ray meets more nodes of the tree than a
    /// shader's loop may, or when the last step did not run for want of room: its edits are half applied.
    pub fn cast_rays(&mut self, rays: &[Ray]) -> Result<Vec<Option<RayHit>>> {
        self.ask(|queries, editor| queries.cast_rays(rays, editor))
    }

    /// Whether each ray meets any collider; cheaper than [`World::cast_rays`].
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn cast_rays_any(&mut self, rays: &[Ray]) -> Result<Vec<bool>> {
        self.ask(|queries, _| queries.cast_rays_any(rays))
    }

    /// The colliders that each shape overlaps.
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn overlaps(&mut self, shapes: &[OverlapShape]) -> Result<Overlaps> {
        self.ask(|queries, editor| queries.overlaps(shapes, editor))
    }

    /// The collider nearest to each point, or none.
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn nearest(&mut self, points: &[NearestQuery]) -> Result<Vec<Option<Nearest>>> {
        self.ask(|queries, editor| queries.nearest(points, editor))
    }

    /// Asks about the state after the last step.
    fn ask<T: Send>(&mut self, ask: impl FnOnce(&query::Cached, &Editor) -> Result<T> + Send) -> Result<T> {
        self.failed.clone().map_or(Ok(()), Err)?;
        let (kept, editor, queries) = (&self.kept, &self.editor, &mut self.queries);
        self.pool.install(|| {
            queries.refresh(kept.control.step, &kept.colliders, &kept.states, self.params.morton_bits);
            ask(queries, editor)
        })
    }

    /// Plans and commits a step, growing the pair list between where that is needed and allowed.
    fn run(&mut self, edits: &EditBatch, mut step: StepParams) -> Result<()> {
        let restitution = self.editor.plan().restitution;
        let broadphase = self.params.broadphase.resolve(self.editor.spread());
        loop {
            let mut watch = Stopwatch::new(self.params.profile);
            step.pair_capacity = (self.kept.impulses.len() / 4) as u32;
            let (kept, pool, finder) = (&mut self.kept, &self.pool, &mut self.finder);
            let asked = Asked { edits, params: &self.params, broadphase };
            let planned = pool.install(|| kept.plan(&asked, finder, &step, &mut watch));
            match planned {
                Ok(planned) => {
                    pool.install(|| kept.commit(planned, &step, restitution, &mut watch));
                    self.finish(watch, broadphase);
                    return Ok(());
                }
                Err(overflow) => self.grow(overflow)?,
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

    fn finish(&mut self, watch: Stopwatch, broadphase: Broadphase) {
        let mut report = StepReport::from_control(&self.kept.control);
        report.backend = "cpu";
        report.adapter = self.adapter.clone();
        report.bodies = self.editor.scene().len() as u32;
        report.growths = self.growths.clone();
        report.broadphase = broadphase;
        report.broadphase_bytes = self.finder.bytes();
        report.memory_bytes = self.kept.bytes() + self.finder.bytes() + self.queries.bytes();
        report.stages = watch.stages;
        self.report = report;
    }
}

/// What a step is to do, beside its numbers.
#[derive(Clone, Copy)]
struct Asked<'a> {
    edits: &'a EditBatch,
    params: &'a Params,
    broadphase: Broadphase,
}

/// A bound that the plan phase found passed.
struct Overflow {
    buffer: &'static str,
    needed: u64,
    capacity: u32,
}

impl Kept {
    fn reserve_pairs(&mut self, capacity: u32) -> Result<()> {
        let (old, count) = (self.batch_of_slot.len() as u32, capacity as usize);
        // Lowest slots on top of the stack.
        let mut free: Vec<u32> = Vec::new();
        reserve(&mut free, count, "free_slots")?;
        reserve(&mut self.batch_of_slot, count, "batch_of_slot")?;
        reserve(&mut self.found, count, "found_manifolds")?;
        reserve(&mut self.impulses, 4 * count, "slot_impulses")?;
        free.extend((old..capacity).rev());
        free.append(&mut self.free);
        self.free = free;
        self.batch_of_slot.resize(count, UNBATCHED);
        self.found.resize(count, FoundManifold::zeroed());
        self.impulses.resize(4 * count, contact::NO_IMPULSE);
        Ok(())
    }

    /// Bytes of what is kept, and of the last step's scratch.
    fn bytes(&self) -> u64 {
        let body =
            2 * size_of::<BodyState>() + size_of::<BodyProps>() + size_of::<PoseRecord>() + size_of::<SolverBody>();
        let collider = size_of::<Collider>() + size_of::<Aabb>();
        let slot = 8 + 4 * size_of::<Impulse>() + size_of::<FoundManifold>();
        let pair = 2 * size_of::<Pair>() + size_of::<Manifold>() + 12;
        let counted = self.states.len() * body
            + self.colliders.len() * collider
            + self.batch_of_slot.len() * slot
            + self.pairs.len() * pair;
        counted as u64 + self.rows.bytes()
    }

    /// Everything up to the first write to what lives past the step.
    fn plan(
        &mut self,
        asked: &Asked,
        finder: &mut Finder,
        step: &StepParams,
        watch: &mut Stopwatch,
    ) -> std::result::Result<Planned, Overflow> {
        let mut control = Control { step: step.step, recolor: self.control.recolor, ..Control::zeroed() };
        let states = self.edit(asked.edits, step);
        let states = self.quarantine(states, &mut control);
        watch.lap("edit");
        let aabbs: Vec<Aabb> =
            self.colliders.par_iter().with_min_len(256).map(|c| self.bounds(c, &states, step)).collect();
        watch.lap("bounds");
        let Asked { edits, params, broadphase } = *asked;
        let boxes = Boxes::new(&aabbs);
        let found = finder.find(&boxes, &Search { step, params, broadphase, stale: edits.stale });
        watch.lap("broadphase");
        control.pair_count = found.count.min(u32::MAX.into()) as u32;
        control.turns = found.turns;
        let over = |buffer, needed: u32, capacity: u32| Err(Overflow { buffer, needed: needed.into(), capacity });
        match broadphase::too_many(&boxes, &found) {
            Some(TooMany::Turns(turns)) => return over("partners", turns, limits::TURN_LIMIT),
            Some(TooMany::Items(count)) => {
                return over("sweep", count.min(u32::MAX.into()) as u32, limits::SWEEP_ITEM_LIMIT);
            }
            Some(TooMany::Unbounded(count)) => return over("half-spaces", count, limits::UNBOUNDED_LIMIT),
            None => {}
        }
        if control.pair_count > step.pair_capacity {
            return over("pairs", control.pair_count, step.pair_capacity);
        }
        let matched = contact::match_pairs(&self.pairs, &found.pairs, &self.colliders, &self.free, step.step);
        control.new_count = matched.new_count;
        control.dead_count = matched.dead_slots.len() as u32;
        watch.lap("contact");
        let manifolds: Vec<Manifold> = matched
            .pairs
            .par_iter()
            .enumerate()
            .with_min_len(64)
            .map(|(i, pair)| match i as u32 == step.drop_pair {
                true => narrowphase::EMPTY,
                false => narrowphase::collide(pair, &self.colliders, &states, &self.found[pair.slot as usize], step),
            })
            .collect();
        control.processed = control.pair_count - u32::from(step.drop_pair < control.pair_count);
        control.constraint_count = manifolds.iter().map(|m| u32::from(m.count > 0)).sum();
        control.point_count = manifolds.iter().map(|m| m.count).sum();
        watch.lap("narrowphase");
        let body_of = |collider: u32| self.colliders[collider as usize].body;
        let ends: Vec<_> = matched.pairs.iter().map(|p| batch::ends(p, &body_of, &states)).collect();
        let recolor = self.control.recolor != 0;
        let batches = batch::place(&matched.pairs, &manifolds, &ends, &self.batch_of_slot, recolor, states.len(), step);
        control.rounds = batches.rounds;
        control.batch_count = batches.batch_count;
        control.max_degree = batches.max_degree;
        control.recolor = u32::from(batch::wasteful(batches.batch_count, batches.max_degree));
        control.batch_start[..batches.start.len()].copy_from_slice(&batches.start);
        control.last_count = batches.order.len() as u32 - batches.start[batches.start.len() - 2];
        control.solved = batches.order.len() as u32;
        watch.lap("batch");
        if control.last_count > step.last_limit {
            return over("last batch", control.last_count, step.last_limit);
        }
        Ok(Planned { states, matched, manifolds, batches, control })
    }

    /// The working copy of the states with the step's edits applied.
    fn edit(&mut self, edits: &EditBatch, step: &StepParams) -> Vec<BodyState> {
        self.props.resize(step.body_count as usize, BodyProps::zeroed());
        self.colliders.resize(step.collider_count as usize, Collider::zeroed());
        let mut states = self.states.clone();
        states.resize(step.body_count as usize, BodyState::zeroed());
        let mut targets = edit::Targets { states: &mut states, props: &mut self.props, colliders: &mut self.colliders };
        for range in &edits.ranges {
            edit::apply(*range, &edits.records, step.step, &mut targets);
        }
        states
    }

    fn quarantine(&self, mut states: Vec<BodyState>, control: &mut Control) -> Vec<BodyState> {
        let none = BodyState::zeroed();
        for (slot, state) in states.iter_mut().enumerate() {
            if bounds::quarantine(state, self.states.get(slot).unwrap_or(&none)) {
                name(control, slot);
            }
        }
        states
    }

    fn bounds(&self, collider: &Collider, states: &[BodyState], step: &StepParams) -> Aabb {
        let body = collider.body as usize;
        bounds::collider_bounds(collider, &states[body], &self.props[body], step)
    }

    /// Solves and writes everything that lives past the step.
    fn commit(&mut self, planned: Planned, step: &StepParams, restitution: bool, watch: &mut Stopwatch) {
        let Planned { states, matched, manifolds, batches, mut control } = planned;
        let mut bodies: Vec<SolverBody> = (0..states.len())
            .into_par_iter()
            .with_min_len(512)
            .map(|i| prepare::prepare_body(&states[i], &self.props[i], batches.masks[i]))
            .collect();
        self.rows.build(&batches.start, &self.colliders, &bodies, step, |c| {
            let index = batches.order[c] as usize;
            let pair = &matched.pairs[index];
            let stored = &self.impulses[4 * pair.slot as usize..][..4];
            prepare::Contact { pair, manifold: &manifolds[index], stored }
        });
        watch.lap("prepare");
        let moving = solver::Bodies { solver: &mut bodies, states: &states, props: &self.props };
        solver::solve(&mut self.rows, moving, step, restitution);
        watch.lap("solver");
        contact::commit_free(&mut self.free, &matched);
        self.commit_slots(&states, &matched, &manifolds, &batches);
        let committed: Vec<_> =
            bodies.par_iter().zip(&states).with_min_len(512).map(|(b, s)| motion::commit(b, s)).collect();
        for (slot, (_, bad)) in committed.iter().enumerate() {
            if *bad {
                name(&mut control, slot);
            }
        }
        self.states = committed.into_par_iter().with_min_len(512).map(|(state, _)| state).collect();
        let posed = self.states.par_iter().zip(&self.props).with_min_len(512);
        self.poses = posed.map(|(s, p)| PoseRecord::of(s, p)).collect();
        self.pairs = matched.pairs;
        control.frozen_count = self
            .states
            .iter()
            .map(|s| u32::from(s.flags & body_flags::FROZEN != 0 && s.flags & body_flags::KIND != 0))
            .sum();
        control.old_pair_count = self.pairs.len() as u32;
        control.free_count = self.free.len() as u32;
        self.control = control;
        watch.lap("motion");
    }

    /// What the slots remember: how the contact was found, its batch, its impulses.
    fn commit_slots(&mut self, states: &[BodyState], matched: &Matched, manifolds: &[Manifold], batches: &Batches) {
        let rotation = |collider: u32| states[self.colliders[collider as usize].body as usize].rotation;
        let found = Shared::new(&mut self.found);
        let batch_of_slot = Shared::new(&mut self.batch_of_slot);
        let impulses = Shared::new(bytemuck::cast_slice_mut::<Impulse, [Impulse; 4]>(&mut self.impulses));
        matched.pairs.par_iter().enumerate().with_min_len(1024).for_each(|(i, pair)| {
            let (slot, manifold) = (pair.slot as usize, manifolds[i]);
            let (mut batch, mut own) = (UNBATCHED, [contact::NO_IMPULSE; 4]);
            contact::commit_pair(&manifold, batches.of_pair[i], &mut batch, &mut own);
            // SAFETY: the pairs of one list have slots of their own (`contact`), and each is visited once.
            unsafe { batch_of_slot.set(slot, batch) };
            if manifold.recycled == 0 {
                let new = FoundManifold { rotation_a: rotation(pair.a), rotation_b: rotation(pair.b), manifold };
                // SAFETY: as above.
                unsafe { found.set(slot, new) };
            }
            if manifold.count == 0 {
                // SAFETY: as above.
                unsafe { impulses.set(slot, own) };
            }
        });
        self.rows.for_each_constraint(|c, solved| {
            let index = batches.order[c] as usize;
            let slot = matched.pairs[index].slot as usize;
            let stored = std::array::from_fn(|k| store::store(&manifolds[index], k, solved[k].0, solved[k].1));
            // SAFETY: as above; each constraint is one of those pairs.
            unsafe { impulses.set(slot, stored) };
        });
    }
}

/// Makes room for `count` elements in all, or says that there is none.
fn reserve<T>(buffer: &mut Vec<T>, count: usize, name: &str) -> Result<()> {
    let more = count.saturating_sub(buffer.len());
    let bytes = (count * size_of::<T>()) as u64;
    buffer.try_reserve_exact(more).map_err(|_| Error::OutOfMemory { buffer: name.into(), bytes })
}

/// Names a body newly in quarantine; of those that share a place, the highest slot.
fn name(control: &mut Control, slot: usize) {
    let place = &mut control.quarantined[slot % QUARANTINE_NAMES];
    *place = (*place).max(slot as u32 + 1);
}
