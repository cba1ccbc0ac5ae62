//! Stage `joint`: what holds bodies together. Twin of `shaders/joint/`.
//!
//! Joints go first in a sub-step, contacts after them; once bodies have moved, poses are projected onto the joints and
//! velocities solved anew with the arms as they are then, which keeps a pendulum's energy. Gravity comes in two half
//! kicks, before and after. Islands of joints are solved directly where that pays (`island`), larger ones by
//! Gauss-Seidel, batch by batch (`batches`); both with the geometric stiffness of joints as inertia.

pub mod batches;
pub mod drive;
mod drive_lanes;
pub mod frame;
mod frame_lanes;
pub mod island;
mod island_lanes;
mod lanes;
pub mod plan;
pub mod rows;
mod rows_lanes;
mod units;

use crate::bounds::moves;
use crate::math::{finite, vec3};
use crate::shared::Shared;
use batches::Loose;
use bytemuck::Zeroable;
use island::{Scene, Store};
use rows::Body;
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

impl Part {
    /// Whether it is about islands that are solved directly.
    pub fn is_of_islands(self) -> bool {
        matches!(self, Self::Begin | Self::Solve | Self::Relax)
    }
}

/// The joints of a world.
#[derive(Debug)]
pub struct Joints {
    /// What lasts of each joint, by slot.
    pub states: Vec<JointState>,
    units: Vec<Mutex<Box<dyn Unit>>>,
    /// What the units were made for: the topology, and axes and flags of its joints.
    made_for: (Arc<Topology>, Vec<[u32; 2]>),
    /// Joints of batches, by their place behind those of islands.
    loose: Vec<Loose>,
    /// What lasts of those, in the same order.
    loose_states: Vec<JointState>,
    /// Most islands that are solved side by side; 1 for all alone, else 4, or 8 where the processor has AVX2.
    abreast: usize,
}

impl Default for Joints {
    fn default() -> Self {
        Self {
            states: Vec::new(),
            units: Vec::new(),
            made_for: Default::default(),
            loose: Vec::new(),
            loose_states: Vec::new(),
            abreast: units::most_abreast(),
        }
    }
}

/// Joints in a step: what all threads see.
pub struct Running<'a> {
    scene: Scene<'a>,
    states: &'a [JointState],
    units: &'a [Mutex<Box<dyn Unit>>],
    loose: Shared<'a, Loose>,
    loose_states: Shared<'a, JointState>,
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
    /// Room for the joints of a step.
    pub fn reserve(&mut self, set: &JointSet) {
        let topology = &set.topology;
        self.states.resize(set.joints.len(), JointState::zeroed());
        self.plan(set);
        let loose = (topology.joint_count() - topology.direct_joints()) as usize;
        self.loose.resize(loose, Loose::default());
        self.loose_states.resize(loose, JointState::zeroed());
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
            loose: Shared::new(&mut self.loose),
            loose_states: Shared::new(&mut self.loose_states),
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
        let first = set.topology.direct_joints() as usize;
        let scene = Scene { set, states, props: &[] };
        let unit = |unit: &mut Mutex<Box<dyn Unit>>| {
            unit.get_mut().expect("no thread panicked with it").store(&scene, &self.states, step)
        };
        let new: Vec<_> = self.units.iter_mut().flat_map(unit).collect();
        let all = &mut self.states;
        let mut keep = |slot: u32, new: JointState| {
            let joint = &set.joints[slot as usize];
            let state = &mut all[slot as usize];
            let was_whole = !is_broken(joint, state);
            *state = kept(new);
            if was_whole && is_broken(joint, state) {
                name(control, slot);
            }
        };
        for (place, (loose, state)) in self.loose.iter().zip(&self.loose_states).enumerate() {
            let moving = loose.bodies.into_iter().find(|&slot| moves(states[slot as usize].flags));
            if moving.is_some_and(|slot| bodies[slot as usize].level == step.level) {
                let slot = set.topology.joints[first + place];
                let broken = state.broken | u32::from(rows::breaks(&set.joints[slot as usize], state));
                keep(slot, JointState { broken, ..*state });
            }
        }
        new.into_iter().for_each(|(slot, state)| keep(slot, state));
    }

    /// How many are broken.
    pub(crate) fn broken(&self, set: &JointSet) -> u32 {
        set.joints.iter().zip(&self.states).map(|(joint, state)| u32::from(is_broken(joint, state))).sum()
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
    /// The stages of a part of a sub-step: each a range of islands, bodies or joints that threads may share.
    pub fn stages(&self, part: Part) -> Vec<Range<usize>> {
        let topology = &self.scene.set.topology;
        let first = topology.direct_joints() as usize;
        let batches = topology.batches.windows(2).map(|b| b[0] as usize - first..b[1] as usize - first);
        let one = match part {
            Part::Begin | Part::Solve | Part::Relax => 0..self.units.len(),
            Part::BeginLoose => 0..topology.joints.len() - first,
            Part::Stiffen => topology.direct_bodies() as usize..topology.bodies.len(),
            Part::WarmStartLoose | Part::SolveLoose | Part::RelaxLoose => return batches.collect(),
        };
        std::iter::once(one).collect()
    }

    /// Some of a stage's islands, bodies or joints. Those of a stage share nothing that is written.
    pub(crate) fn run(&self, part: Part, range: Range<usize>, bodies: &Shared<'_, SolverBody>, step: &StepParams) {
        match part {
            Part::Begin | Part::Solve | Part::Relax => {
                for index in range {
                    let mut unit = self.units[index].lock().expect("no thread panicked with it");
                    unit.run(part, &self.scene, self.states, bodies, step);
                }
            }
            Part::Stiffen => range.for_each(|index| self.stiffen(index, bodies, step)),
            _ => {
                // SAFETY: a joint is in one block of one stage.
                let (loose, states) =
                    unsafe { (self.loose.slice_mut(range.clone()), self.loose_states.slice_mut(range.clone())) };
                let first = self.scene.set.topology.direct_joints() as usize + range.start;
                for (index, (loose, state)) in loose.iter_mut().zip(states).enumerate() {
                    let slot = self.scene.set.topology.joints[first + index];
                    if part == Part::BeginLoose {
                        let state_of = self.states[slot as usize];
                        (*loose, *state) = Loose::begin(&self.scene, slot, state_of, bodies, step);
                    } else {
                        self.visit(part, slot, loose, state, bodies, step);
                    }
                }
            }
        }
    }

    fn visit(
        &self,
        part: Part,
        slot: u32,
        loose: &mut Loose,
        state: &mut JointState,
        bodies: &Shared<'_, SolverBody>,
        step: &StepParams,
    ) {
        let [ia, ib] = loose.bodies.map(|slot| slot as usize);
        // What does not move is read by many.
        let is_moved = |slot: usize| moves(self.scene.states[slot].flags);
        // SAFETY: joints of a batch share no body that moves, and only those are written.
        let [mut copy_a, mut copy_b] = [ia, ib].map(|slot| (!is_moved(slot)).then(|| Store::get(bodies, slot)));
        let [a, b] = [(ia, &mut copy_a), (ib, &mut copy_b)].map(|(slot, copy)| match copy {
            Some(copy) => copy,
            // SAFETY: as above.
            None => unsafe { &mut bodies.slice_mut(slot..slot + 1)[0] },
        });
        if (if is_moved(ia) { a.level } else { b.level }) != step.level || !(is_moved(ia) || is_moved(ib)) {
            return;
        }
        let [mut seen_a, mut seen_b] = match part {
            Part::RelaxLoose => [Body::of(a, &self.scene.states[ia]), Body::of(b, &self.scene.states[ib])],
            _ => [Body::still(a), Body::still(b)],
        };
        match part {
            Part::WarmStartLoose => loose.warm_start(&mut seen_a, &mut seen_b),
            Part::SolveLoose => loose.solve(&mut seen_a, &mut seen_b),
            _ => loose.relax(&self.scene, state, slot, &mut seen_a, &mut seen_b, step),
        }
        seen_a.put_velocities(a);
        seen_b.put_velocities(b);
    }

    fn stiffen(&self, index: usize, bodies: &Shared<'_, SolverBody>, step: &StepParams) {
        let info = &self.scene.set.topology.bodies[index];
        let first = self.scene.set.topology.direct_joints();
        let mut body = Store::get(bodies, info.body as usize);
        // SAFETY: no joint is written in this stage.
        let impulse = |place: u32| vec3(unsafe { self.loose_states.get((place - first) as usize) }.impulse);
        if body.level == step.level {
            batches::stiffen(&self.scene, info, impulse, &mut body, step);
            Store::set(bodies, info.body as usize, body);
        }
    }
}

/// Marks the bodies that joints move: see [`SolverBody::touched`].
pub fn mark(set: &JointSet, bodies: &mut [SolverBody]) {
    for body in &set.topology.bodies {
        let bit = if body.direct != 0 { touched::JOINED } else { touched::CONTACT };
        bodies[body.body as usize].touched |= bit;
    }
}

/// The level of sub-steps of an island that is solved directly, by that of each body; none where all its bodies sleep or
/// are in quarantine: nothing is solved then, and what its joints remember stays.
fn level_of(scene: &Scene<'_>, info: &JointIsland, solver: &impl Store) -> Option<u32> {
    let bodies = &scene.set.topology.bodies[info.first_body as usize..][..info.body_count as usize];
    let awake = bodies.iter().map(|body| body.body as usize).find(|&slot| moves(scene.states[slot].flags));
    awake.map(|slot| solver.get(slot).level)
}
