//! Stage `joint`: what holds bodies together. Twin of `shaders/joint/`.
//!
//! Joints go first in a sub-step, contacts after them; once bodies have moved, poses are projected onto the joints and
//! velocities solved anew with the arms as they are then, which keeps a pendulum's energy. Gravity comes in two half
//! kicks, before and after. Islands of joints are solved directly where that pays (`island`), larger ones by
//! Gauss-Seidel, batch by batch (`batches`); both with the geometric stiffness of joints as inertia.

pub mod drive;
pub mod frame;
pub mod island;
pub mod rows;

use crate::bounds::moves;
use crate::math::{finite, vec3};
use crate::shared::Shared;
use bytemuck::Zeroable;
use island::{Island, Scene, Store};
use std::sync::Mutex;
use tumble_core::JointSet;
use tumble_core::layout::{BodyProps, BodyState, JointIsland, JointState, SolverBody, StepParams, touched};

/// A part of a sub-step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Once a step, before its sub-steps.
    Begin,
    /// Before contacts.
    Solve,
    /// After bodies have moved.
    Relax,
}

/// The joints of a world.
#[derive(Debug, Default)]
pub struct Joints {
    /// What lasts of each joint, by slot.
    pub states: Vec<JointState>,
    islands: Vec<Mutex<Island>>,
}

/// Joints in a step: what all threads see.
pub struct Running<'a> {
    scene: Scene<'a>,
    states: &'a [JointState],
    islands: &'a [Mutex<Island>],
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
        self.states.resize(set.joints.len(), JointState::zeroed());
        self.islands.resize_with(set.topology.islands.len(), Mutex::default);
    }

    /// The passes of a step over these joints.
    pub fn running<'a>(&'a self, set: &'a JointSet, states: &'a [BodyState], props: &'a [BodyProps]) -> Running<'a> {
        Running { scene: Scene { set, states, props }, states: &self.states, islands: &self.islands }
    }

    /// Takes down what a level of sub-steps left of its joints.
    pub fn store(&mut self, set: &JointSet, states: &[BodyState], bodies: &[SolverBody], step: &StepParams) {
        for (info, island) in set.topology.islands.iter().zip(&mut self.islands) {
            if level(set, info, states, |slot| bodies[slot].level) != Some(step.level) {
                continue;
            }
            let island = island.get_mut().expect("no thread panicked with it");
            let slots = &set.topology.joints[info.first_joint as usize..][..info.joint_count as usize];
            for (&slot, state) in slots.iter().zip(island.states(step)) {
                let [impulse, torque] = [state.impulse, state.torque].map(vec3);
                let good = finite(impulse.to_array()) && finite(torque.to_array());
                self.states[slot as usize] = if good { state } else { JointState::zeroed() };
            }
        }
    }
}

impl Running<'_> {
    /// Number of islands that are solved directly.
    pub fn islands(&self) -> usize {
        self.islands.len().min(self.scene.set.topology.islands.len())
    }

    /// A part of a sub-step of an island.
    pub(crate) fn run(&self, part: Part, index: usize, bodies: &Shared<'_, SolverBody>, step: &StepParams) {
        let info = &self.scene.set.topology.islands[index];
        let level = level(self.scene.set, info, self.scene.states, |slot| Store::get(bodies, slot).level);
        if level != Some(step.level) {
            return;
        }
        let mut island = self.islands[index].lock().expect("no thread panicked with it");
        match part {
            Part::Begin => island.begin(&self.scene, info, self.states, bodies, step),
            Part::Solve => island.solve(&self.scene, bodies, step),
            Part::Relax => island.relax(&self.scene, bodies, step),
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
fn level(set: &JointSet, info: &JointIsland, states: &[BodyState], of: impl Fn(usize) -> u32) -> Option<u32> {
    let bodies = &set.topology.bodies[info.first_body as usize..][..info.body_count as usize];
    let awake = bodies.iter().map(|body| body.body as usize).find(|&slot| moves(states[slot].flags));
    awake.map(of)
}
