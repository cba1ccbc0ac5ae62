//! Stage `joint`: what holds bodies together. Twin of `shaders/joint/`.
//!
//! Joints go first in a sub-step, contacts after them; once bodies have moved, poses are projected onto the joints and
//! velocities solved anew with the arms as they are then, which keeps a pendulum's energy. Gravity comes in two half
//! kicks, before and after. Islands of joints are solved directly where that pays (`island`), larger ones by
//! Gauss-Seidel, batch by batch (`batches`); both with the geometric stiffness of joints as inertia.

pub mod batches;
mod batches_lanes;
pub mod drive;
pub mod frame;
mod groups;
pub mod held;
pub mod inertia;
mod inertia_lanes;
pub mod island;
mod joined_lanes;
mod loose;
pub mod rows;
mod turn_lanes;

use crate::bounds::moves;
use crate::math::finite;
use crate::shared::Shared;
use crate::workers::blocks;
use bytemuck::Zeroable;
use island::{Island, Scene, Store};
use loose::{LooseJoints, RunningLoose};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, Mutex};
use tumble_core::JointSet;
use tumble_core::layout::{
    BREAK_NAMES, BodyProps, BodyState, Control, Joint, JointIsland, JointState, SolverBody, StepParams, joint_bits,
    touched,
};

/// A part of a sub-step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Once a step, before its sub-steps: islands.
    Begin,
    /// Before contacts: islands.
    Solve,
    /// After bodies have moved: islands.
    Relax,
    /// Once a step: the joints of batches.
    BeginLoose,
    /// The inertia of the bodies of batches.
    Stiffen,
    /// Batches: impulses of the last sub-step.
    WarmStartLoose,
    /// Batches: before contacts.
    SolveLoose,
    /// Batches: after bodies have moved.
    RelaxLoose,
}

/// The joints of a world.
#[derive(Debug, Default)]
pub struct Joints {
    /// What lasts of each joint, by slot.
    pub states: Vec<JointState>,
    islands: Vec<Mutex<Island>>,
    /// Joints of batches.
    loose: LooseJoints,
}

/// Joints in a step: what all threads see.
pub struct Running<'a> {
    scene: Scene<'a>,
    states: &'a [JointState],
    islands: &'a [Mutex<Island>],
    loose: RunningLoose<'a>,
}

impl Store for Shared<'_, SolverBody> {
    fn get(&self, slot: usize) -> SolverBody {
        // SAFETY: islands share no body that moves, and others are not written.
        unsafe { Shared::get(self, slot) }
    }

    fn set(&self, slot: usize, body: SolverBody) {
        // SAFETY: as above.
        unsafe { Shared::set(self, slot, body) };
    }
}

impl Joints {
    /// Joints of batches so many side by side at most, instead of as many as the processor takes; none if that is not a
    /// number that it takes. Results with one differ from the others by rounding, those with several do not.
    #[doc(hidden)]
    pub fn with_lanes(lanes: usize) -> Option<Self> {
        Some(Self { loose: LooseJoints::with_lanes(lanes)?, ..Self::default() })
    }

    /// Room for the joints of a step.
    pub fn reserve(&mut self, set: &Arc<JointSet>) {
        let topology = &set.topology;
        self.states.resize(set.joints.len(), JointState::zeroed());
        self.islands.resize_with(topology.islands.len(), Mutex::default);
        self.loose.build(set);
    }

    /// The passes of a step over these joints.
    pub(crate) fn running<'a>(
        &'a mut self,
        set: &'a JointSet,
        states: &'a [BodyState],
        props: &'a [BodyProps],
    ) -> Running<'a> {
        Running {
            scene: Scene { set, states, props },
            states: &self.states,
            islands: &self.islands,
            loose: self.loose.running(),
        }
    }

    /// Takes down what a level of sub-steps left of its joints, and names those that broke.
    pub(crate) fn store(
        &mut self,
        set: &JointSet,
        states: &[BodyState],
        bodies: &[SolverBody],
        step: &StepParams,
        control: &mut Control,
    ) {
        let all = Shared::new(&mut self.states);
        let broke = Mutex::new(Vec::new());
        let keep = |slot: u32, new: JointState| {
            let joint = &set.joints[slot as usize];
            // SAFETY: a joint is kept once.
            let was_whole = !is_broken(joint, &unsafe { all.get(slot as usize) });
            let state = kept(new);
            // SAFETY: as above.
            unsafe { all.set(slot as usize, state) };
            if was_whole && is_broken(joint, &state) {
                broke.lock().expect("no thread panicked with it").push(slot);
            }
        };
        self.loose.for_each_lasting(set, &all, states, bodies, step, &keep);
        for (info, island) in set.topology.islands.iter().zip(&mut self.islands) {
            if level(set, info, states, |slot| bodies[slot].level) != Some(step.level) {
                continue;
            }
            let island = island.get_mut().expect("no thread panicked with it");
            let slots = &set.topology.joints[info.first_joint as usize..][..info.joint_count as usize];
            slots.iter().zip(island.states(set)).for_each(|(&slot, state)| keep(slot, state));
        }
        broke.into_inner().expect("no thread panicked with it").into_iter().for_each(|slot| name(control, slot));
    }

    /// How many are broken.
    pub(crate) fn broken(&self, set: &JointSet) -> u32 {
        let all = set.joints.par_iter().zip(&self.states).with_min_len(1024);
        all.map(|(joint, state)| u32::from(is_broken(joint, state))).sum()
    }
}

/// Whether what lasts is of this joint.
pub fn is_of(joint: &Joint, state: &JointState) -> bool {
    joint.flags & joint_bits::ALIVE != 0 && state.tag == joint.generation.wrapping_add(1)
}

fn is_broken(joint: &Joint, state: &JointState) -> bool {
    is_of(joint, state) && state.broken != 0
}

/// Names a joint that broke; of those that share a place, the highest slot.
fn name(control: &mut Control, slot: u32) {
    let place = &mut control.newly_broken[slot as usize % BREAK_NAMES];
    *place = (*place).max(slot + 1);
}

/// What is kept of a joint: nothing if it is not finite.
fn kept(state: JointState) -> JointState {
    if finite(state.impulse) && finite(state.torque) { state } else { JointState::zeroed() }
}

impl Running<'_> {
    /// The stages of a part of a sub-step: each a range of what threads may share, and into how many blocks it is cut.
    pub(crate) fn stages(&self, part: Part) -> Vec<(Range<usize>, u32)> {
        let topology = &self.scene.set.topology;
        match part {
            Part::Begin | Part::Solve | Part::Relax => {
                let islands = topology.islands.len();
                vec![(0..islands, blocks(islands, 1))]
            }
            _ => self.loose.stages(part, topology.bodies.len() - topology.direct_bodies() as usize),
        }
    }

    /// Some of a stage. What is in a range shares nothing that is written with the rest.
    pub(crate) fn run(&self, part: Part, range: Range<usize>, bodies: &Shared<'_, SolverBody>, step: &StepParams) {
        match part {
            Part::Begin | Part::Solve | Part::Relax => {
                range.for_each(|index| self.run_island(part, index, bodies, step));
            }
            Part::Stiffen => self.loose.stiffen(range, &self.scene, bodies, step),
            _ => self.loose.visit(part, range, &self.scene, self.states, bodies, step),
        }
    }

    fn run_island(&self, part: Part, index: usize, bodies: &Shared<'_, SolverBody>, step: &StepParams) {
        let info = &self.scene.set.topology.islands[index];
        let level = level(self.scene.set, info, self.scene.states, |slot| Store::get(bodies, slot).level);
        if level != Some(step.level) {
            return;
        }
        let mut island = self.islands[index].lock().expect("no thread panicked with it");
        match part {
            Part::Begin => island.begin(&self.scene, info, self.states, bodies, step),
            Part::Solve => island.solve(&self.scene, bodies, step),
            _ => island.relax(&self.scene, bodies, step),
        }
    }
}

/// Marks the bodies that joints move which are not broken: see [`SolverBody::touched`]. `states` is what lasts of the joints,
/// by slot; those that have none are whole.
pub fn mark(set: &JointSet, states: &[JointState], bodies: &mut [SolverBody]) {
    let topology = &set.topology;
    let is_whole = |&end: &u32| {
        let slot = topology.joints[end as usize / 2] as usize;
        !states.get(slot).is_some_and(|state| is_broken(&set.joints[slot], state))
    };
    for body in &topology.bodies {
        let ends = &topology.ends[body.first_end as usize..][..body.end_count as usize];
        if ends.iter().any(is_whole) {
            bodies[body.body as usize].touched |= if body.direct != 0 { touched::JOINED } else { touched::CONTACT };
        }
    }
}

/// The level of sub-steps of an island that is solved directly, by that of each body; none where all its bodies sleep or
/// are in quarantine: nothing is solved then, and what its joints remember stays.
fn level(set: &JointSet, info: &JointIsland, states: &[BodyState], of: impl Fn(usize) -> u32) -> Option<u32> {
    let bodies = &set.topology.bodies[info.first_body as usize..][..info.body_count as usize];
    let awake = bodies.iter().map(|body| body.body as usize).find(|&slot| moves(states[slot].flags));
    awake.map(of)
}
