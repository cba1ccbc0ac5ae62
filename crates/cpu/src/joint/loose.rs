//! The joints of batches within a step: in lanes where they are alike (`batches_lanes`), one by one where limits, motors,
//! springs or free axes make them differ (`batches`), by all threads.

use super::Part;
use super::batches::{Loose, stiffen};
use super::batches_lanes::{fits_lanes, locks_angles};
use super::groups::{Groups, Seen, SharedGroups};
use super::island::{Scene, Store};
use super::rows::{Body, breaks};
use crate::bounds::moves;
use crate::shared::Shared;
use crate::workers::blocks;
use bytemuck::Zeroable;
use std::ops::Range;
use std::sync::Arc;
use tumble_core::JointSet;
use tumble_core::layout::{BodyState, JointState, SolverBody, StepParams};
use wide::f32x4;

/// Fewest units of a block: of eight joints each.
const UNITS: usize = 8;
/// Joints of a unit that are visited one by one.
const SINGLES: usize = 8;
/// Fewest groups of bodies of a block.
const BODY_GROUPS: usize = 16;
/// Fewest bodies of a block.
const BODIES: usize = 64;

/// Joints of one batch that a thread visits together.
#[derive(Debug, Clone, Copy)]
enum Unit {
    /// A group.
    Lanes(usize),
    /// Single ones, from the first to before the last.
    Singles(usize, usize),
}

/// A joint that is visited by itself.
#[derive(Debug, Clone, Copy)]
struct Single {
    slot: u32,
    loose: Loose,
    /// What lasts of it.
    state: JointState,
}

/// The joints of batches.
#[derive(Debug, Default)]
pub(super) struct LooseJoints {
    /// What all this is made from.
    built: Option<Arc<JointSet>>,
    /// Whether no joint goes into a group.
    one_by_one: bool,
    groups: Groups,
    singles: Vec<Single>,
    /// Batch by batch.
    units: Vec<Unit>,
    /// First unit of each batch, and the end.
    batches: Vec<usize>,
    /// Where the impulse of the joint at each place lies.
    seats: Vec<u32>,
    /// Impulses along, in the world.
    impulses: Vec<f32x4>,
}

/// The same in a step.
pub(super) struct RunningLoose<'a> {
    groups: SharedGroups<'a>,
    /// Bodies whose inertia is made together.
    lanes: usize,
    singles: Shared<'a, Single>,
    units: &'a [Unit],
    batches: &'a [usize],
    seats: &'a [u32],
    impulses: Shared<'a, f32x4>,
}

impl LooseJoints {
    /// So many side by side, or all one by one; none if the processor does not take that many.
    pub(super) fn with_lanes(lanes: usize) -> Option<Self> {
        if lanes == 1 {
            return Some(Self { one_by_one: true, ..Self::default() });
        }
        Some(Self { groups: Groups::with_lanes(lanes)?, ..Self::default() })
    }

    /// Sorts joints into groups, where they are others than in the last step.
    pub(super) fn build(&mut self, set: &Arc<JointSet>) {
        if self.built.as_ref().is_some_and(|built| Arc::ptr_eq(built, set)) {
            return;
        }
        self.built = Some(set.clone());
        self.groups.clear();
        (self.singles, self.units, self.batches) = (Vec::new(), Vec::new(), vec![0]);
        let topology = &set.topology;
        let first = topology.direct_joints() as usize;
        self.seats = vec![0; topology.joints.len() - first];
        let lanes = self.groups.lanes();
        let mut seats_of_singles = Vec::new();
        for batch in topology.batches.windows(2) {
            let places = batch[0] as usize..batch[1] as usize;
            let joint = |place: &usize| &set.joints[topology.joints[*place] as usize];
            let (alike, others): (Vec<_>, Vec<_>) =
                places.partition(|place| !self.one_by_one && fits_lanes(joint(place)));
            let (fixed, balls): (Vec<_>, Vec<_>) = alike.into_iter().partition(|place| locks_angles(joint(place)));
            for places in balls.chunks(lanes).chain(fixed.chunks(lanes)) {
                let group = self.units.iter().filter(|unit| matches!(unit, Unit::Lanes(_))).count();
                let slots: Vec<u32> = places.iter().map(|&place| topology.joints[place]).collect();
                self.groups.push_joints(set, &slots);
                self.units.push(Unit::Lanes(group));
                places.iter().enumerate().for_each(|(k, place)| self.seats[place - first] = (group * lanes + k) as u32);
            }
            for places in others.chunks(SINGLES) {
                self.units.push(Unit::Singles(self.singles.len(), self.singles.len() + places.len()));
                for &place in places {
                    seats_of_singles.push(place - first);
                    let slot = topology.joints[place];
                    self.singles.push(Single { slot, loose: Loose::default(), state: JointState::zeroed() });
                }
            }
            self.batches.push(self.units.len());
        }
        let first_single = self.units.iter().filter(|unit| matches!(unit, Unit::Lanes(_))).count() * lanes;
        for (k, place) in seats_of_singles.into_iter().enumerate() {
            self.seats[place] = (first_single + k) as u32;
        }
        self.impulses = vec![f32x4::ZERO; first_single + self.singles.len()];
        if !self.one_by_one {
            self.groups.push_bodies(set, &self.seats);
        }
    }

    /// For the passes of a step.
    pub(super) fn running(&mut self) -> RunningLoose<'_> {
        RunningLoose {
            lanes: if self.one_by_one { 1 } else { self.groups.lanes() },
            groups: self.groups.shared(),
            singles: Shared::new(&mut self.singles),
            units: &self.units,
            batches: &self.batches,
            seats: &self.seats,
            impulses: Shared::new(&mut self.impulses),
        }
    }

    /// Calls `keep(slot, state)` with what a level of sub-steps left of each of its joints, from many threads at once.
    /// `before` is what lasted of them, by slot.
    pub(super) fn for_each_lasting(
        &self,
        set: &JointSet,
        before: &Shared<'_, JointState>,
        states: &[BodyState],
        bodies: &[SolverBody],
        step: &StepParams,
        keep: &(impl Fn(u32, JointState) + Sync),
    ) {
        self.groups.for_each_lasting(before, states, bodies, step, keep);
        for Single { slot, loose, state } in &self.singles {
            let moving = loose.bodies.into_iter().find(|&slot| moves(states[slot as usize].flags));
            if moving.is_some_and(|slot| bodies[slot as usize].level == step.level) {
                let broken = state.broken | u32::from(breaks(&set.joints[*slot as usize], state));
                keep(*slot, JointState { broken, ..*state });
            }
        }
    }
}

impl RunningLoose<'_> {
    /// The stages of a part of a sub-step: each a range of units, groups of bodies or bodies, and into how many blocks it
    /// is cut. Batches too small to be cut lie one behind the other in one block.
    pub(super) fn stages(&self, part: Part, bodies: usize) -> Vec<(Range<usize>, u32)> {
        match part {
            Part::Stiffen if self.lanes > 1 => {
                let groups = self.groups.body_groups();
                vec![(0..groups, blocks(groups, BODY_GROUPS))]
            }
            Part::Stiffen => vec![(0..bodies, blocks(bodies, BODIES))],
            Part::BeginLoose => vec![(0..self.units.len(), blocks(self.units.len(), UNITS))],
            _ => {
                let mut stages: Vec<(Range<usize>, u32)> = Vec::new();
                for units in self.batches.windows(2).map(|batch| batch[0]..batch[1]) {
                    let count = blocks(units.len(), UNITS);
                    match stages.last_mut() {
                        Some((last, 1)) if count == 1 => last.end = units.end,
                        _ => stages.push((units, count)),
                    }
                }
                stages
            }
        }
    }

    /// Some units of a stage, in order. Those of one batch share no body that moves.
    pub(super) fn visit(
        &self,
        part: Part,
        range: Range<usize>,
        scene: &Scene<'_>,
        states: &[JointState],
        bodies: &Shared<'_, SolverBody>,
        step: &StepParams,
    ) {
        let seen = Seen { scene, states, impulses: &self.impulses, bodies, step };
        for units in self.units[range].chunk_by(|a, b| matches!((a, b), (Unit::Lanes(_), Unit::Lanes(_)))) {
            match (units[0], units[units.len() - 1]) {
                // SAFETY: a group is in one block of one stage, and batches share no body that moves.
                (Unit::Lanes(first), Unit::Lanes(last)) => unsafe { self.groups.visit(part, first..last + 1, &seen) },
                (Unit::Singles(first, end), _) => {
                    (first..end).for_each(|single| self.visit_single(part, single, &seen))
                }
                _ => unreachable!("units of a chunk are alike"),
            }
        }
    }

    fn visit_single(&self, part: Part, single: usize, seen: &Seen<'_>) {
        // SAFETY: a joint is in one block of one stage.
        let Single { slot, loose, state } = unsafe { &mut self.singles.slice_mut(single..single + 1)[0] };
        if part == Part::BeginLoose {
            let before = seen.states[*slot as usize];
            (*loose, *state) = Loose::begin(seen.scene, *slot, before, seen.bodies, seen.step);
        } else {
            visit(part, *slot, loose, state, seen);
        }
        let [x, y, z] = state.impulse;
        let seat = self.impulses_of_singles() + single;
        // SAFETY: a seat is that of one joint.
        unsafe { self.impulses.set(seat, f32x4::new([x, y, z, 0.0])) };
    }

    fn impulses_of_singles(&self) -> usize {
        self.impulses.len() - self.singles.len()
    }

    /// The inertia of some groups of bodies, or of some bodies where there are no groups.
    pub(super) fn stiffen(
        &self,
        range: Range<usize>,
        scene: &Scene<'_>,
        bodies: &Shared<'_, SolverBody>,
        step: &StepParams,
    ) {
        let topology = &scene.set.topology;
        let all = &topology.bodies[topology.direct_bodies() as usize..];
        let seen = Seen { scene, states: &[], impulses: &self.impulses, bodies, step };
        if self.lanes > 1 {
            // SAFETY: a body is in one group, and no joint is visited in this stage.
            unsafe { self.groups.stiffen(range.clone(), &seen) };
        }
        let of_range = range.start * self.lanes..all.len().min(range.end * self.lanes);
        for info in all[of_range].iter().filter(|info| self.lanes == 1 || scene.props[info.body as usize].locked != 0) {
            let mut body = Store::get(bodies, info.body as usize);
            if body.level != step.level {
                continue;
            }
            let impulse = |place: u32| {
                let seat = self.seats[(place - topology.direct_joints()) as usize];
                // SAFETY: no joint is written in this stage.
                let [x, y, z, _] = unsafe { self.impulses.get(seat as usize) }.to_array();
                glam::Vec3::new(x, y, z)
            };
            stiffen(scene, info, impulse, &mut body, step);
            Store::set(bodies, info.body as usize, body);
        }
    }
}

/// One visit to a single joint.
fn visit(part: Part, slot: u32, loose: &mut Loose, state: &mut JointState, seen: &Seen<'_>) {
    let Seen { scene, bodies, step, .. } = seen;
    let [ia, ib] = loose.bodies.map(|slot| slot as usize);
    // What does not move is read by many.
    let is_moved = |slot: usize| moves(scene.states[slot].flags);
    // SAFETY: joints of a batch share no body that moves, and only those are written.
    let [mut copy_a, mut copy_b] = [ia, ib].map(|slot| (!is_moved(slot)).then(|| Store::get(*bodies, slot)));
    let [a, b] = [(ia, &mut copy_a), (ib, &mut copy_b)].map(|(slot, copy)| match copy {
        Some(copy) => copy,
        // SAFETY: as above.
        None => unsafe { &mut bodies.slice_mut(slot..slot + 1)[0] },
    });
    if (if is_moved(ia) { a.level } else { b.level }) != step.level || !(is_moved(ia) || is_moved(ib)) {
        return;
    }
    let [mut seen_a, mut seen_b] = match part {
        Part::RelaxLoose => [Body::of(a, &scene.states[ia]), Body::of(b, &scene.states[ib])],
        _ => [Body::still(a), Body::still(b)],
    };
    match part {
        Part::WarmStartLoose => loose.warm_start(&mut seen_a, &mut seen_b),
        Part::SolveLoose => loose.solve(&mut seen_a, &mut seen_b),
        _ => loose.relax(scene, state, slot, &mut seen_a, &mut seen_b, step),
    }
    seen_a.put_velocities(a);
    seen_b.put_velocities(b);
}
