//! What a world keeps, and a step of it: the plan phase, which writes nothing that lasts, and the commit.

use super::asleep::{self, Asleep, Outcome, Waking};
use crate::batch::{self, Batches, Ends, Ordered};
use crate::broadphase::{self, Boxes, Finder, Search, TooMany};
use crate::contact::{self, Matched};
use crate::joint::{self, Joints};
use crate::shared::Shared;
use crate::solver::{self, Rows, prepare, split, store};
use crate::{bounds, continuous, edit, island, level, motion, narrowphase, sleep};
use bytemuck::Zeroable;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;
use tumble_core::edit::EditBatch;
use tumble_core::layout::{
    Aabb, BodyProps, BodyState, Collider, Control, FoundManifold, Impulse, LAST_BATCH, Manifold, ManifoldMemory, Pair,
    PoseRecord, QUARANTINE_NAMES, SolverBody, StepParams, UNBATCHED, batching, body_flags,
};
use tumble_core::stopwatch::Stopwatch;
use tumble_core::{Broadphase, Error, JointSet, Params, Result, limits};

/// What lives past a step; written only when a step commits (properties and colliders by edits, absolutely).
pub(super) struct Kept {
    pub(super) control: Control,
    pub(super) states: Vec<BodyState>,
    pub(super) props: Vec<BodyProps>,
    pub(super) colliders: Vec<Collider>,
    pub(super) pairs: Vec<Pair>,
    pub(super) free: Vec<u32>,
    /// By slot.
    pub(super) batch_of_slot: Vec<u32>,
    /// Four a slot.
    pub(super) impulses: Vec<Impulse>,
    /// By slot.
    pub(super) memory: Vec<ManifoldMemory>,
    /// By slot.
    pub(super) found: Vec<FoundManifold>,
    pub(super) poses: Vec<PoseRecord>,
    /// The solver's rows, kept for their room alone.
    pub(super) rows: Rows,
    pub(super) asleep: Asleep,
    pub(super) joints: Joints,
    /// Those of the last step.
    pub(super) joint_set: Arc<JointSet>,
}

/// What the plan phase of a step finds; nothing of it lasts unless the step commits.
pub(super) struct Planned {
    pub(super) states: Vec<BodyState>,
    pub(super) matched: Matched,
    pub(super) manifolds: Vec<Manifold>,
    pub(super) batches: Batches,
    pub(super) control: Control,
    ends: Vec<Ends>,
    waking: Waking,
    joints: Arc<JointSet>,
}

/// What a step is to do, beside its numbers.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    pub(super) edits: &'a EditBatch,
    pub(super) params: &'a Params,
    pub(super) broadphase: Broadphase,
}

/// A bound that the plan phase found passed.
pub(super) struct Overflow {
    pub(super) buffer: &'static str,
    pub(super) needed: u64,
    pub(super) capacity: u32,
}

impl Kept {
    pub(super) fn reserve_pairs(&mut self, capacity: u32) -> Result<()> {
        let (old, count) = (self.batch_of_slot.len() as u32, capacity as usize);
        // Lowest slots on top of the stack.
        let mut free: Vec<u32> = Vec::new();
        reserve(&mut free, count, "free_slots")?;
        reserve(&mut self.batch_of_slot, count, "batch_of_slot")?;
        reserve(&mut self.found, count, "found_manifolds")?;
        reserve(&mut self.memory, count, "slot_memory")?;
        reserve(&mut self.impulses, 4 * count, "slot_impulses")?;
        free.extend((old..capacity).rev());
        free.append(&mut self.free);
        self.free = free;
        self.batch_of_slot.resize(count, UNBATCHED);
        self.found.resize(count, FoundManifold::zeroed());
        self.memory.resize(count, ManifoldMemory::default());
        self.impulses.resize(4 * count, contact::NO_IMPULSE);
        Ok(())
    }

    /// Bytes of what is kept, and of the last step's scratch.
    pub(super) fn bytes(&self) -> u64 {
        let body =
            2 * size_of::<BodyState>() + size_of::<BodyProps>() + size_of::<PoseRecord>() + size_of::<SolverBody>();
        let collider = size_of::<Collider>() + size_of::<Aabb>();
        let slot = 8 + 4 * size_of::<Impulse>() + size_of::<ManifoldMemory>() + size_of::<FoundManifold>();
        let pair = 2 * size_of::<Pair>() + size_of::<Manifold>() + 12;
        let counted = self.states.len() * body
            + self.colliders.len() * collider
            + self.batch_of_slot.len() * slot
            + self.pairs.len() * pair;
        counted as u64 + self.rows.bytes() + self.asleep.bytes()
    }

    /// Everything up to the first write to what lives past the step.
    pub(super) fn plan(
        &mut self,
        asked: &Asked,
        finder: &mut Finder,
        step: &StepParams,
        watch: &mut Stopwatch,
    ) -> std::result::Result<Planned, Overflow> {
        let run = watch.begin("edit");
        let mut control = Control { step: step.step, colored_as: self.control.colored_as, ..Control::zeroed() };
        let states = self.edit(asked.edits, step);
        let Asked { edits, params, broadphase } = *asked;
        let mut states = self.quarantine(states, &mut control);
        let (mut waking, woken) = self.wake_by_edits(edits, step, &mut states);
        let run = watch.next(run, "bounds");
        let aabbs: Vec<Aabb> =
            self.colliders.par_iter().with_min_len(256).map(|c| self.bounds(c, &states, step)).collect();
        let run = watch.next(run, "broadphase");
        let boxes = Boxes::new(&aabbs);
        let mut stale = edits.stale;
        stale.moving |= self.asleep.changed || waking.any();
        let mut found = finder.find(&boxes, &Search { step, params, broadphase, stale });
        self.find_sleepers(&boxes, &states, &waking, step.pair_capacity, &mut found);
        let run = watch.next(run, "contact");
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
        let with_asleep = control.pair_count.saturating_add(self.asleep.pairs_after(&waking));
        if with_asleep > step.pair_capacity {
            return over("pairs", with_asleep, step.pair_capacity);
        }
        let old = if woken.is_empty() { Cow::from(&self.pairs) } else { asleep::merged(&self.pairs, &woken).into() };
        let apart = &edits.joints.topology.apart;
        let mut matched = contact::match_pairs(&old, &found.pairs, &self.colliders, apart, &self.free, step.step);
        control.new_count = matched.new_count;
        control.dead_count = matched.dead_slots.len() as u32;
        let run = watch.next(run, "narrowphase");
        let mut manifolds: Vec<Manifold> = matched
            .pairs
            .par_iter()
            .enumerate()
            .with_min_len(64)
            .map(|(i, pair)| match i as u32 == step.drop_pair {
                true => narrowphase::EMPTY,
                false => narrowphase::collide(pair, &self.colliders, &states, &self.found[pair.slot as usize], step),
            })
            .collect();
        let woken = self.wake_by_touch(&matched.pairs, &manifolds, &mut states, &mut waking);
        if !woken.is_empty() {
            let collide = |pair: &Pair| {
                narrowphase::collide(pair, &self.colliders, &states, &self.found[pair.slot as usize], step)
            };
            let theirs: Vec<Manifold> = woken.par_iter().with_min_len(64).map(collide).collect();
            asleep::join(&mut matched.pairs, &mut manifolds, &woken, &theirs);
            control.pair_count = matched.pairs.len() as u32;
        }
        control.processed = control.pair_count - u32::from(step.drop_pair < control.pair_count);
        control.constraint_count = manifolds.iter().map(|m| u32::from(m.count > 0)).sum();
        control.point_count = manifolds.iter().map(|m| m.count).sum();
        let run = watch.next(run, "batch");
        let body_of = |collider: u32| self.colliders[collider as usize].body;
        let ends: Vec<_> = matched.pairs.iter().map(|p| batch::ends(p, &body_of, &states)).collect();
        let recolor = self.control.colored_as != step.batching;
        let batches = batch::place(&matched.pairs, &manifolds, &ends, &self.batch_of_slot, recolor, states.len(), step);
        control.rounds = batches.rounds;
        control.batch_count = batches.batch_count;
        control.max_degree = batches.max_degree;
        control.colored_as = batch::colored_as(&batches, step.batching);
        control.batch_start[..batches.start.len()].copy_from_slice(&batches.start);
        control.last_count = batches.order.len() as u32 - batches.start[batches.start.len() - 2];
        control.solved = batches.order.len() as u32;
        watch.end(run);
        if control.last_count > step.last_limit {
            return over("last batch", control.last_count, step.last_limit);
        }
        let joints = edits.joints.clone();
        Ok(Planned { states, matched, manifolds, batches, control, ends, waking, joints })
    }

    /// The working copy of the states with the step's edits applied.
    fn edit(&mut self, edits: &EditBatch, step: &StepParams) -> Vec<BodyState> {
        self.props.resize(step.body_count as usize, BodyProps::zeroed());
        self.colliders.resize(step.collider_count as usize, Collider::zeroed());
        let mut states: Vec<BodyState> = self.states.iter().map(edit::begin).collect();
        states.resize(step.body_count as usize, BodyState::zeroed());
        let mut targets = edit::Targets { states: &mut states, props: &mut self.props, colliders: &mut self.colliders };
        for range in &edits.ranges {
            edit::apply(*range, &edits.records, step, &mut targets);
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

    /// Those asleep are kept elsewhere, and are nowhere here.
    fn bounds(&self, collider: &Collider, states: &[BodyState], step: &StepParams) -> Aabb {
        let body = collider.body as usize;
        if sleep::sleeps(states[body].flags) {
            return bounds::NOWHERE;
        }
        bounds::collider_bounds(collider, &states[body], &self.props[body], step)
    }

    /// Solves and writes everything that lives past the step.
    pub(super) fn commit(&mut self, planned: Planned, step: &StepParams, restitution: bool, watch: &mut Stopwatch) {
        let run = watch.begin("prepare");
        let Planned { mut states, matched, manifolds, batches, mut control, ends, waking, joints } = planned;
        self.joints.reserve(&joints);
        let labels = self.labels(&states, &manifolds, &ends, &joints.topology.joined, step);
        control.islands = island::count(&labels);
        if step.is_leveled() {
            let touching = level::Touching { manifolds: &manifolds, ends: &ends };
            let held = level::Held { joints: &joints, states: &self.joints.states };
            level::decide(&mut states, &self.props, &labels, &touching, &held, step, &mut control);
        }
        let mut bodies: Vec<SolverBody> = (0..states.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|i| prepare::prepare_body(&states[i], &self.props[i], batches.masks[i], step))
            .collect();
        joint::mark(&joints, &self.joints.states, &mut bodies);
        if step.batching & batching::SPLIT_LAST != 0 {
            let last = &batches.order[batches.start[LAST_BATCH as usize] as usize..];
            let ends = last.iter().map(|&pair| bodies_of(&matched.pairs[pair as usize], &self.colliders));
            split::count_parts(&mut bodies, ends);
        }
        let mut run = run;
        for (index, step) in step.by_level().enumerate() {
            if index > 0 {
                run = watch.next(run, "prepare");
            }
            let own = self.of_level(&batches, &matched, &bodies, &step);
            self.rows.build(&own.start, &self.colliders, &bodies, &states, &step, |c| {
                let index = own.order[c] as usize;
                let pair = &matched.pairs[index];
                let [a, b] = bodies_of(pair, &self.colliders).map(|body| &states[body]);
                let stored = &self.impulses[4 * pair.slot as usize..][..4];
                let memory = &self.memory[pair.slot as usize];
                let scale = prepare::scale(a, b, step.h);
                prepare::Contact { pair, manifold: &manifolds[index], stored, memory, scale, split: false }
            });
            run = watch.next(run, "solver");
            let moving = solver::Bodies { solver: &mut bodies, states: &states, props: &self.props };
            let running =
                (!joints.topology.joints.is_empty()).then(|| self.joints.running(&joints, &states, &self.props));
            solver::solve(&mut self.rows, moving, running.as_ref(), &step, restitution);
            self.joints.store(&joints, &states, &bodies, &step, &mut control);
            self.store(&own.order, &matched, &manifolds);
        }
        let run = watch.next(run, "motion");
        contact::commit_free(&mut self.free, &matched);
        self.commit_slots(&states, &matched, &manifolds, &batches);
        let mut shares = vec![1.0f32; states.len()];
        let short = matched.pairs.par_iter().with_min_len(512);
        let short = short.filter_map(|pair| continuous::share(pair, &self.colliders, &states, &bodies));
        for (body, share) in short.collect::<Vec<_>>() {
            shares[body as usize] = shares[body as usize].min(share);
        }
        self.poses.resize(states.len(), PoseRecord::zeroed());
        let moved = bodies.par_iter().zip(&self.props).zip(states.par_iter_mut().zip(&mut self.poses));
        let bad = moved.enumerate().with_min_len(256).filter_map(|(slot, ((body, props), (state, pose)))| {
            let (new, bad) = motion::commit(body, state, shares[slot], step);
            (*state, *pose) = (new, PoseRecord::of(&new, props));
            bad.then_some(slot)
        });
        bad.collect::<Vec<_>>().into_iter().for_each(|slot| name(&mut control, slot));
        self.states = states;
        self.pairs = matched.pairs;
        let joined = &joints.topology.joined;
        let outcome = Outcome { labels, manifolds: &manifolds, ends: &ends, joined, waking };
        self.settle(outcome, step, &mut control);
        control.frozen_count = self
            .states
            .iter()
            .map(|s| u32::from(s.flags & body_flags::FROZEN != 0 && s.flags & body_flags::KIND != 0))
            .sum();
        control.broken_joints = self.joints.broken(&joints);
        control.old_pair_count = self.pairs.len() as u32;
        control.free_count = self.free.len() as u32;
        self.joint_set = joints;
        self.control = control;
        watch.end(run);
    }

    /// The constraints of the step's level in their order.
    fn of_level<'a>(
        &self,
        batches: &'a Batches,
        matched: &Matched,
        bodies: &[SolverBody],
        step: &StepParams,
    ) -> Ordered<'a> {
        if step.levels.count_ones() == 1 {
            return Ordered { order: Cow::from(&batches.order), start: Cow::from(&batches.start) };
        }
        batches.of_level(|pair| {
            let [a, b] = bodies_of(&matched.pairs[pair as usize], &self.colliders).map(|body| &bodies[body]);
            prepare::level(a, b) == step.level
        })
    }

    /// What the slots remember of each constraint that was solved, those in the rows.
    fn store(&mut self, order: &[u32], matched: &Matched, manifolds: &[Manifold]) {
        let memory = Shared::new(&mut self.memory);
        let impulses = Shared::new(bytemuck::cast_slice_mut::<Impulse, [Impulse; 4]>(&mut self.impulses));
        self.rows.for_each_constraint(|c, solved| {
            let index = order[c] as usize;
            let slot = matched.pairs[index].slot as usize;
            let stored = std::array::from_fn(|k| store::store(&manifolds[index], k, solved));
            // SAFETY: the pairs of one list have slots of their own (`contact`), and each constraint is one of them.
            unsafe { impulses.set(slot, stored) };
            // SAFETY: as above.
            unsafe { memory.set(slot, store::store_memory(&manifolds[index], solved)) };
        });
    }

    /// What the slots remember of each pair: how the contact was found, its batch, and no impulse where none touch.
    fn commit_slots(&mut self, states: &[BodyState], matched: &Matched, manifolds: &[Manifold], batches: &Batches) {
        let rotation = |collider: u32| states[self.colliders[collider as usize].body as usize].rotation;
        let found = Shared::new(&mut self.found);
        let batch_of_slot = Shared::new(&mut self.batch_of_slot);
        let impulses = Shared::new(bytemuck::cast_slice_mut::<Impulse, [Impulse; 4]>(&mut self.impulses));
        matched.pairs.par_iter().enumerate().with_min_len(256).for_each(|(i, pair)| {
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
    }
}

/// Makes room for `count` elements in all, or says that there is none.
fn reserve<T>(buffer: &mut Vec<T>, count: usize, name: &str) -> Result<()> {
    let more = count.saturating_sub(buffer.len());
    let bytes = (count * size_of::<T>()) as u64;
    buffer.try_reserve_exact(more).map_err(|_| Error::OutOfMemory { buffer: name.into(), bytes })
}

/// The bodies of a pair.
fn bodies_of(pair: &Pair, colliders: &[Collider]) -> [usize; 2] {
    [pair.a, pair.b].map(|collider| colliders[collider as usize].body as usize)
}

/// Names a body newly in quarantine; of those that share a place, the highest slot.
fn name(control: &mut Control, slot: usize) {
    let place = &mut control.quarantined[slot % QUARANTINE_NAMES];
    *place = (*place).max(slot as u32 + 1);
}
