//! Stage `joint`: what holds bodies together. Twin of `shaders/joint/`.
//!
//! Joints go first in a sub-step, contacts after them; once bodies have moved, poses are projected onto the joints and
//! velocities solved anew with the arms as they are then, which keeps a pendulum's energy. Gravity comes in two half
//! kicks, before and after. Islands of joints are solved directly where that pays (`island`), larger ones by
//! Gauss-Seidel, batch by batch (`batches`); both with the geometric stiffness of joints as inertia.

pub mod batches;
mod batches_lanes;
pub mod drive;
mod drive_lanes;
pub mod frame;
mod frame_lanes;
mod groups;
pub mod held;
pub mod inertia;
mod inertia_lanes;
pub mod island;
mod island_lanes;
mod joined_lanes;
mod lanes;
mod loose;
pub mod plan;
pub mod rows;
mod rows_lanes;
mod turn_lanes;
mod units;

use crate::bounds::moves;
use crate::math::finite;
use crate::shared::Shared;
use crate::workers::blocks;
use bytemuck::Zeroable;
use island::{Scene, Store};
use loose::{LooseJoints, RunningLoose};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, Mutex};
use tumble_core::layout::{
    BREAK_NAMES, BodyProps, BodyState, Control, Joint, JointIsland, JointState, SolverBody, StepParams, joint_bits,
    touched,
};
use tumble_core::{JointSet, Topology};
use units::Unit;

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
#[derive(Debug)]
pub struct Joints {
    /// What lasts of each joint, by slot.
    pub states: Vec<JointState>,
    units: Vec<Mutex<Box<dyn Unit>>>,
    /// What the units were made for: the topology, and axes and flags of its joints.
    made_for: (Arc<Topology>, Vec<[u32; 2]>),
    /// Most islands that are solved side by side; 1 for all alone, else 4, or 8 where the processor has AVX2.
    abreast: usize,
    /// Joints of batches.
    loose: LooseJoints,
}

impl Default for Joints {
    fn default() -> Self {
        Self {
            states: Vec::new(),
            units: Vec::new(),
            made_for: Default::default(),
            abreast: units::most_abreast(),
            loose: LooseJoints::default(),
        }
    }
}

/// Joints in a step: what all threads see.
pub struct Running<'a> {
    scene: Scene<'a>,
    states: &'a [JointState],
    units: &'a [Mutex<Box<dyn Unit>>],
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
        self.states.resize(set.joints.len(), JointState::zeroed());
        self.plan(set);
        self.loose.build(set);
    }

    /// Makes the islands anew where joints came or went, or are of another kind.
    fn plan(&mut self, set: &JointSet) {
        let kind = |&slot: &u32| [set.joints[slot as usize].axes, set.joints[slot as usize].flags];
        let kinds = set.topology.joints[..set.topology.direct_joints() as usize].iter().map(kind);
        if Arc::ptr_eq(&self.made_for.0, &set.topology) && self.made_for.1.iter().copied().eq(kinds.clone()) {
            return;
        }
        self.made_for = (Arc::clone(&set.topology), kinds.collect());
        self.units = units::units(set, self.abreast);
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
            units: &self.units,
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
        let scene = Scene { set, states, props: &[] };
        let unit = |unit: &mut Mutex<Box<dyn Unit>>| {
            unit.get_mut().expect("no thread panicked with it").store(&scene, &self.states, step)
        };
        let new: Vec<_> = self.units.iter_mut().flat_map(unit).collect();
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
        new.into_iter().for_each(|(slot, state)| keep(slot, state));
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

/// What a joint begins a step with that has sub-steps of length `h`.
pub fn begun(joint: &Joint, state: JointState, h: f32) -> JointState {
    let fresh = JointState { tag: joint.generation + 1, h, ..JointState::zeroed() };
    let mut state = if state.tag == fresh.tag { state } else { fresh };
    let scale = if state.h == h || state.h == 0.0 { 1.0 } else { h / state.h };
    state.impulse = state.impulse.map(|x| scale * x);
    state.torque = state.torque.map(|x| scale * x);
    state.h = h;
    if state.broken != 0 {
        (state.impulse, state.torque) = ([0.0; 3], [0.0; 3]);
    }
    state
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
            Part::Begin | Part::Solve | Part::Relax => vec![(0..self.units.len(), blocks(self.units.len(), 1))],
            _ => self.loose.stages(part, topology.bodies.len() - topology.direct_bodies() as usize),
        }
    }

    /// Some of a stage. What is in a range shares nothing that is written with the rest.
    pub(crate) fn run(&self, part: Part, range: Range<usize>, bodies: &Shared<'_, SolverBody>, step: &StepParams) {
        match part {
            Part::Begin | Part::Solve | Part::Relax => {
                for index in range {
                    let mut unit = self.units[index].lock().expect("no thread panicked with it");
                    unit.run(part, &self.scene, self.states, bodies, step);
                }
            }
            Part::Stiffen => self.loose.stiffen(range, &self.scene, bodies, step),
            _ => self.loose.visit(part, range, &self.scene, self.states, bodies, step),
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
fn level_of(scene: &Scene<'_>, info: &JointIsland, solver: &impl Store) -> Option<u32> {
    let bodies = &scene.set.topology.bodies[info.first_body as usize..][..info.body_count as usize];
    let awake = bodies.iter().map(|body| body.body as usize).find(|&slot| moves(scene.states[slot].flags));
    awake.map(|slot| solver.get(slot).level)
}
