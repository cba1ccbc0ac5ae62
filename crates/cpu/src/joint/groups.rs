//! The joints of batches and their bodies in lanes, as wide as the processor takes them.

use super::Part;
use super::batches_lanes::{JointLanes, MadeLanes, NO_JOINT, TurnLanes, level_of, locks_angles};
use super::inertia_lanes::{BodyGroup, EndLanes};
use super::island::Scene;
use crate::shared::Shared;
#[cfg(target_arch = "x86_64")]
use crate::solver::avx2::{self, F32x8};
use crate::solver::lanes::NO_BODY;
use crate::solver::simd::Lanes;
use rayon::prelude::*;
use std::ops::Range;
use tumble_core::JointSet;
use tumble_core::layout::{BodyState, JointState, SolverBody, StepParams};
use wide::f32x4;

/// Joints and bodies in lanes.
#[derive(Debug)]
pub(super) enum Groups {
    Four(Lots<f32x4>),
    /// Only where the processor has AVX2.
    #[cfg(target_arch = "x86_64")]
    Eight(Lots<F32x8>),
}

/// The same, for threads that write different ones.
pub(super) enum SharedGroups<'a> {
    Four(SharedLots<'a, f32x4>),
    #[cfg(target_arch = "x86_64")]
    Eight(SharedLots<'a, F32x8>),
}

/// Of one width.
#[derive(Debug, Default)]
pub(super) struct Lots<L: Lanes> {
    made: Vec<MadeLanes<L>>,
    joints: Vec<JointLanes<L>>,
    /// Place in `turns` of each group of joints.
    turns_of: Vec<Option<u32>>,
    turns: Vec<TurnLanes<L>>,
    bodies: Vec<BodyGroup<L>>,
    ends: Vec<EndLanes<L>>,
}

/// The same, for threads that write different ones.
pub(super) struct SharedLots<'a, L: Lanes> {
    made: &'a [MadeLanes<L>],
    joints: Shared<'a, JointLanes<L>>,
    turns_of: &'a [Option<u32>],
    turns: Shared<'a, TurnLanes<L>>,
    bodies: &'a [BodyGroup<L>],
    ends: &'a [EndLanes<L>],
}

/// What all visits see.
pub(super) struct Seen<'a> {
    pub(super) scene: &'a Scene<'a>,
    /// What lasts of joints, by slot.
    pub(super) states: &'a [JointState],
    /// Impulses along, in the world, by seat.
    pub(super) impulses: &'a Shared<'a, f32x4>,
    pub(super) bodies: &'a Shared<'a, SolverBody>,
    pub(super) step: &'a StepParams,
}

impl Default for Groups {
    /// As wide as can be.
    fn default() -> Self {
        Self::with_lanes(8).unwrap_or(Self::Four(Lots::default()))
    }
}

impl Groups {
    /// None if the processor does not take so many at once.
    pub(super) fn with_lanes(lanes: usize) -> Option<Self> {
        match lanes {
            4 => Some(Self::Four(Lots::default())),
            #[cfg(target_arch = "x86_64")]
            8 if avx2::is_there() => Some(Self::Eight(Lots::default())),
            _ => None,
        }
    }

    /// Joints of a group.
    pub(super) fn lanes(&self) -> usize {
        match self {
            Self::Four(_) => f32x4::COUNT,
            #[cfg(target_arch = "x86_64")]
            Self::Eight(_) => F32x8::COUNT,
        }
    }

    pub(super) fn clear(&mut self) {
        match self {
            Self::Four(lots) => *lots = Lots::default(),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(lots) => *lots = Lots::default(),
        }
    }

    /// Takes up to as many joints as there are lanes, by slot, all with rows about or all without.
    pub(super) fn push_joints(&mut self, set: &JointSet, slots: &[u32]) {
        match self {
            Self::Four(lots) => lots.push_joints(set, slots),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(lots) => lots.push_joints(set, slots),
        }
    }

    /// Takes the bodies of the joints of batches, whose impulses lie at `seats`, by place.
    pub(super) fn push_bodies(&mut self, set: &JointSet, seats: &[u32]) {
        match self {
            Self::Four(lots) => lots.push_bodies(set, seats),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(lots) => lots.push_bodies(set, seats),
        }
    }

    /// For the threads of one parallel pass.
    pub(super) fn shared(&mut self) -> SharedGroups<'_> {
        match self {
            Self::Four(lots) => SharedGroups::Four(lots.shared()),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(lots) => SharedGroups::Eight(lots.shared()),
        }
    }

    /// Calls `keep(slot, state)` with what a level of sub-steps left of each of its joints, from many threads at once.
    pub(super) fn for_each_lasting(
        &self,
        before: &Shared<'_, JointState>,
        states: &[BodyState],
        bodies: &[SolverBody],
        step: &StepParams,
        keep: &(impl Fn(u32, JointState) + Sync),
    ) {
        match self {
            Self::Four(lots) => lots.for_each_lasting(before, states, bodies, step, keep),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(lots) => lots.for_each_lasting(before, states, bodies, step, keep),
        }
    }
}

impl SharedGroups<'_> {
    /// A visit to each of some groups of joints, in order.
    ///
    /// # Safety
    /// No other thread touches these groups meanwhile, nor what moves of their bodies.
    pub(super) unsafe fn visit(&self, part: Part, groups: Range<usize>, seen: &Seen<'_>) {
        match self {
            // SAFETY: the caller's promise.
            Self::Four(lots) => unsafe { lots.visit(part, groups, seen) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the caller's promise.
            Self::Eight(lots) => unsafe { lots.visit(part, groups, seen) },
        }
    }

    /// Groups of bodies.
    pub(super) fn body_groups(&self) -> usize {
        match self {
            Self::Four(lots) => lots.bodies.len(),
            #[cfg(target_arch = "x86_64")]
            Self::Eight(lots) => lots.bodies.len(),
        }
    }

    /// The inertia of the bodies of some groups.
    ///
    /// # Safety
    /// No other thread touches these bodies meanwhile, nor writes impulses.
    pub(super) unsafe fn stiffen(&self, groups: Range<usize>, seen: &Seen<'_>) {
        match self {
            // SAFETY: the caller's promise.
            Self::Four(lots) => unsafe { lots.stiffen(groups, seen) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the caller's promise.
            Self::Eight(lots) => unsafe { lots.stiffen(groups, seen) },
        }
    }
}

impl<L: Lanes> Lots<L> {
    fn push_joints(&mut self, set: &JointSet, slots: &[u32]) {
        let mut made = MadeLanes::empty();
        for (lane, &slot) in slots.iter().enumerate() {
            made.set(lane, slot, &set.joints[slot as usize]);
        }
        let turns = locks_angles(&set.joints[slots[0] as usize]);
        self.turns_of.push(turns.then_some(self.turns.len() as u32));
        self.turns.extend(turns.then(TurnLanes::default));
        self.made.push(made);
        self.joints.push(JointLanes::default());
    }

    fn push_bodies(&mut self, set: &JointSet, seats: &[u32]) {
        let topology = &set.topology;
        let first_place = topology.direct_joints();
        for bodies in topology.bodies[topology.direct_bodies() as usize..].chunks(L::COUNT) {
            let first_end = self.ends.len() as u32;
            let end_count = bodies.iter().map(|body| body.end_count).max().unwrap_or(0);
            let mut group = BodyGroup::<L> { first_end, end_count, ..BodyGroup::default() };
            group.slots.as_mut().fill(NO_BODY);
            let mut ends = vec![EndLanes::<L>::default(); end_count as usize];
            for (lane, body) in bodies.iter().enumerate() {
                group.slots.as_mut()[lane] = body.body;
                let own = &topology.ends[body.first_end as usize..][..body.end_count as usize];
                for (to, &end) in ends.iter_mut().zip(own) {
                    let joint = &set.joints[topology.joints[end as usize / 2] as usize];
                    to.set(lane, end & 1 == 1, joint, seats[(end / 2 - first_place) as usize]);
                }
            }
            self.ends.extend(ends);
            self.bodies.push(group);
        }
    }

    fn shared(&mut self) -> SharedLots<'_, L> {
        SharedLots {
            made: &self.made,
            joints: Shared::new(&mut self.joints),
            turns_of: &self.turns_of,
            turns: Shared::new(&mut self.turns),
            bodies: &self.bodies,
            ends: &self.ends,
        }
    }

    fn for_each_lasting(
        &self,
        before: &Shared<'_, JointState>,
        states: &[BodyState],
        bodies: &[SolverBody],
        step: &StepParams,
        keep: &(impl Fn(u32, JointState) + Sync),
    ) {
        self.made.par_iter().zip(&self.joints).zip(&self.turns_of).with_min_len(256 / L::COUNT).for_each(
            |((made, joints), turns)| {
                let turns = turns.map(|place| &self.turns[place as usize]);
                for (lane, &slot) in made.slots.as_ref().iter().enumerate().filter(|(_, slot)| **slot != NO_JOINT) {
                    let leader = made.leader(lane, states);
                    if leader.is_some_and(|body| bodies[body as usize].level == step.level) {
                        // SAFETY: a joint is in one lane of one group.
                        let before = unsafe { before.get(slot as usize) };
                        keep(slot, joints.lasting(made, turns, lane, &before, step.h));
                    }
                }
            },
        );
    }
}

impl<L: Lanes> SharedLots<'_, L> {
    /// # Safety
    /// As for [`SharedGroups::visit`].
    unsafe fn visit(&self, part: Part, groups: Range<usize>, seen: &Seen<'_>) {
        let (bodies, step) = (seen.bodies.rows(), seen.step);
        // SAFETY: the caller's promise.
        let joints = unsafe { self.joints.slice_mut(groups.clone()) };
        let turns = |group: usize| {
            let place = self.turns_of[group]? as usize;
            // SAFETY: the caller's promise, as each group has turns of its own.
            Some(unsafe { &mut self.turns.slice_mut(place..place + 1)[0] })
        };
        if part == Part::BeginLoose {
            for (group, joints) in groups.clone().zip(joints.iter_mut()) {
                let level = |slot| level_of(seen.bodies, slot);
                let turns = turns(group);
                *joints = JointLanes::begin(&self.made[group], turns, seen.states, seen.scene.states, level, step);
            }
        }
        let keep = |group: usize, impulses: L::Rows| {
            for (lane, &impulse) in impulses.as_ref().iter().enumerate() {
                // SAFETY: a seat is that of one joint.
                unsafe { seen.impulses.set(group * L::COUNT + lane, impulse) };
            }
        };
        L::run(
            #[inline(always)]
            || {
                for (group, joints) in groups.zip(joints) {
                    let turns = turns(group);
                    match part {
                        // SAFETY: the caller's promise.
                        Part::WarmStartLoose => unsafe { joints.warm_start(turns, &bodies) },
                        // SAFETY: the caller's promise.
                        Part::SolveLoose => unsafe { joints.solve(turns, &bodies) },
                        // SAFETY: the caller's promise.
                        Part::BeginLoose => keep(group, unsafe { joints.refresh(turns, &bodies, step) }),
                        // SAFETY: the caller's promise.
                        _ => keep(group, unsafe { joints.relax(turns, &bodies, step) }),
                    }
                }
            },
        );
    }

    /// # Safety
    /// As for [`SharedGroups::stiffen`].
    unsafe fn stiffen(&self, groups: Range<usize>, seen: &Seen<'_>) {
        let bodies = seen.bodies.rows();
        let made = (seen.scene.states, seen.scene.props);
        L::run(
            #[inline(always)]
            || {
                for group in &self.bodies[groups.clone()] {
                    let ends = &self.ends[group.first_end as usize..][..group.end_count as usize];
                    // SAFETY: the caller's promise.
                    unsafe { group.stiffen(ends, seen.impulses, &bodies, made, seen.step) };
                }
            },
        );
    }
}
