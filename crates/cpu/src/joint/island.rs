//! Joints that are solved directly, together: block LDL^T. Twin of `shaders/joint/island.wgsl`.
//!
//! One factor a sub-step serves the projection of the poses, the velocities that are left when the impulses act on the new
//! arms, and the next sub-step's velocities. The system K is that of the rows, with a little more on its diagonal, and its
//! inertia includes the geometric stiffness of all joints of a body: a force held at its old arm makes a light body stiff,
//! and no exact solver survives that.

use super::frame::Pose;
use super::held::pushed;
use super::inertia::{inverse_inertia, own_arm, stiffening};
use super::plan::{Plan, PlanEntry};
use super::rows::{Body, Work};
use crate::math::{quat, vec3};
use glam::{Mat3, Mat3A, Vec3, Vec3A};
use std::sync::Arc;
use tumble_core::JointSet;
use tumble_core::layout::{BodyProps, BodyState, JointIsland, JointState, SolverBody, StepParams, joint_bits};

/// Share of its trace over three that is added to a block of a joint on a tree.
pub const REGULARIZATION: f32 = 1e-6;
/// The same of joints on cycles, where rows may say the same twice.
pub const CYCLE_REGULARIZATION: f32 = 1e-5;
/// The same of those that may lock what is locked already. With a tenth of it 14 of 160 random islands with cycles and
/// pairs joined twice blew up, now none does. Ball joints do without: nets are three times as exact.
pub const OVERLOCKED_REGULARIZATION: f32 = 1e-4;
/// How often pieces are chosen in a sub-step.
pub const CHOICES: u32 = 3;
/// Share of a sub-step's impulses of motors, friction and springs that is given before bodies move, and once more after:
/// as gravity, or springs would sag by what they give against one half of it only.
pub const HALF: f32 = 0.5;

/// The joints of an island and their bodies, while a step runs.
#[derive(Debug, Default)]
pub struct Island {
    plan: Arc<Plan>,
    works: Vec<Work>,
    bodies: Vec<Body>,
    /// Slots of the bodies: first those that joints move, then others that they hold.
    slots: Vec<u32>,
    /// Inverted.
    diagonal: Vec<Mat3A>,
    /// L times D below the diagonal, transposed.
    upper: Vec<Mat3A>,
    /// L below the diagonal.
    lower: Vec<Mat3A>,
    /// Right-hand sides and solutions.
    values: Vec<Vec3A>,
    /// Where bodies will be.
    next: Vec<Pose>,
    /// What predictions of the separations are off by.
    remainders: Vec<[Vec3; 2]>,
}

/// The solver's bodies, as a part of the joints' passes sees them: reads and writes by slot.
pub trait Store {
    /// One body.
    fn get(&self, slot: usize) -> SolverBody;
    /// Puts it back.
    fn set(&self, slot: usize, body: SolverBody);
}

/// What the passes over joints read.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The joints and their order.
    pub set: &'a JointSet,
    /// Bodies at the start of the step.
    pub states: &'a [BodyState],
    /// What bodies are made of.
    pub props: &'a [BodyProps],
}

impl Island {
    /// An island that is solved by this plan, and the slots of its bodies.
    pub fn new(plan: Arc<Plan>, slots: Vec<u32>) -> Self {
        Self { plan, slots, ..Self::default() }
    }

    /// Begins a step: reads bodies and joints, chooses pieces, and factors.
    pub fn begin(
        &mut self,
        scene: &Scene<'_>,
        info: &JointIsland,
        states: &[JointState],
        bodies: &impl Store,
        step: &StepParams,
    ) {
        self.read(scene, bodies);
        let joints = &scene.set.topology.joints[info.first_joint as usize..][..info.joint_count as usize];
        self.works.clear();
        for &slot in joints {
            let joint = &scene.set.joints[slot as usize];
            let [a, b] = [joint.body_a, joint.body_b].map(|body| vec3(scene.states[body as usize].position));
            self.works.push(Work::new(slot, joint, states[slot as usize], b - a, step.h));
        }
        self.stiffen(scene, step);
        for (work, &[a, b]) in self.works.iter_mut().zip(&self.plan.ends) {
            let joint = &scene.set.joints[work.slot as usize];
            work.refresh(joint, &self.bodies[a], &self.bodies[b]);
            work.carry_impulses(HALF);
            work.choose(joint, &self.bodies[a], &self.bodies[b], step.h, HALF);
            work.rebuild(&self.bodies[a], &self.bodies[b]);
        }
        self.factor(scene);
        self.write(bodies, |body, _, new| body.put_inertia(new));
    }

    /// Reads the bodies as they are now.
    fn read(&mut self, scene: &Scene<'_>, bodies: &impl Store) {
        self.bodies.clear();
        let read = |&slot: &u32| Body::of(&bodies.get(slot as usize), &scene.states[slot as usize]);
        self.bodies.extend(self.slots.iter().map(read));
    }

    /// Puts bodies back as `put` changes them.
    fn write(&self, bodies: &impl Store, put: impl Fn(&Body, usize, &mut SolverBody)) {
        for (body, &slot) in self.bodies.iter().zip(&self.slots[..self.plan.moved()]) {
            if body.moves() {
                let mut new = bodies.get(slot as usize);
                put(body, slot as usize, &mut new);
                bodies.set(slot as usize, new);
            }
        }
    }

    /// Velocities that take the joints to where they belong within the sub-step.
    pub fn solve(&mut self, scene: &Scene<'_>, bodies: &impl Store, step: &StepParams) {
        self.read(scene, bodies);
        let mut changed = false;
        self.remainders.clear();
        self.next.clear();
        self.next.extend(self.bodies.iter().map(|body| body.predicted(step.h)));
        for (work, &[a, b]) in self.works.iter_mut().zip(&self.plan.ends) {
            let next = [&self.next[a], &self.next[b]];
            let (joint, a, b) = (&scene.set.joints[work.slot as usize], &self.bodies[a], &self.bodies[b]);
            work.look(joint, a, b);
            changed |= work.choose(joint, a, b, step.h, HALF);
            work.forget_impulses();
            self.remainders.push(work.remainders(joint, [a, b], next, step.h));
        }
        for choice in 0..CHOICES {
            if changed {
                self.rebuild(scene);
            }
            self.works.iter_mut().for_each(Work::fix);
            self.push(|work, second, body| work.push_fixed(second, body));
            self.solve_rows(|island, joint, which| {
                let [a, b] = island.plan.ends[joint];
                let lack = island.works[joint].lack(which, &island.bodies[a], &island.bodies[b], false);
                lack - island.remainders[joint][which]
            });
            changed = false;
            if choice + 1 < CHOICES {
                for (work, &[a, b]) in self.works.iter_mut().zip(&self.plan.ends) {
                    let joint = &scene.set.joints[work.slot as usize];
                    changed |= work.choose(joint, &self.bodies[a], &self.bodies[b], step.h, HALF);
                }
            }
            if !changed {
                break;
            }
        }
        self.write(bodies, |body, _, new| body.put_velocities(new));
    }

    /// Poses onto the joints, and velocities that keep them there with the arms as they are now.
    pub fn relax(&mut self, scene: &Scene<'_>, bodies: &impl Store, step: &StepParams) {
        self.read(scene, bodies);
        self.works.iter_mut().for_each(Work::keep_impulses);
        self.works.iter_mut().for_each(Work::forget_impulses);
        self.stiffen(scene, step);
        for (work, &[a, b]) in self.works.iter_mut().zip(&self.plan.ends) {
            work.refresh(&scene.set.joints[work.slot as usize], &self.bodies[a], &self.bodies[b]);
        }
        self.factor(scene);
        self.project(scene);
        self.works.iter_mut().for_each(Work::fix);
        self.push(|work, second, body| work.push_fixed(second, body));
        self.solve_rows(|island, joint, which| {
            let [a, b] = island.plan.ends[joint];
            island.works[joint].lack(which, &island.bodies[a], &island.bodies[b], true)
        });
        self.works.iter_mut().for_each(Work::add_impulses);
        self.write(bodies, |body, slot, new| {
            body.put_velocities(new);
            body.put_inertia(new);
            new.translation = body.pose.translation.to_array();
            new.delta = (body.pose.rotation * quat(scene.states[slot].rotation).conjugate()).normalize().to_array();
        });
    }

    /// What lasts of the joints after a step.
    pub fn states(&mut self, set: &JointSet) -> impl Iterator<Item = JointState> {
        let bodies = &self.bodies;
        self.works.iter_mut().zip(&self.plan.ends).map(|(work, &[a, b])| {
            let joint = &set.joints[work.slot as usize];
            // Where the last projection left it.
            work.look(joint, &bodies[a], &bodies[b]);
            work.lasting(joint)
        })
    }

    fn rebuild(&mut self, scene: &Scene<'_>) {
        for (work, &[a, b]) in self.works.iter_mut().zip(&self.plan.ends) {
            work.rebuild(&self.bodies[a], &self.bodies[b]);
        }
        self.factor(scene);
    }

    /// The bodies' inertia with the geometric stiffness of their joints.
    fn stiffen(&mut self, scene: &Scene<'_>, step: &StepParams) {
        for (index, body) in self.bodies[..self.plan.moved()].iter_mut().enumerate() {
            let props = &scene.props[self.slots[index] as usize];
            if !body.moves() {
                continue;
            }
            let mut more = Mat3::ZERO;
            for &end in self.plan.at(index) {
                let work = &self.works[end / 2];
                let arm = own_arm(&scene.set.joints[work.slot as usize], end & 1 == 1, body.pose.rotation);
                let impulse = vec3(work.state.impulse);
                more += stiffening(arm, if end & 1 == 1 { impulse } else { -impulse }, step.h);
            }
            body.inverse_inertia = inverse_inertia(body.pose.rotation, props, more);
        }
    }

    /// Assembles and factors K: level by level, each block of a level by itself.
    fn factor(&mut self, scene: &Scene<'_>) {
        let plan = Arc::clone(&self.plan);
        self.diagonal.resize(plan.blocks.len(), Mat3A::ZERO);
        self.upper.resize(plan.entries.len(), Mat3A::ZERO);
        self.lower.resize(plan.entries.len(), Mat3A::ZERO);
        for (k, block) in plan.blocks.iter().enumerate() {
            let mut diagonal = Mat3A::from(self.diagonal_of(scene, block.joint, block.which));
            for &[row, column] in &plan.terms[block.terms.clone()] {
                diagonal -= self.lower[row] * self.upper[column];
            }
            self.diagonal[k] = diagonal.inverse();
            for index in block.entries.clone() {
                let entry = &plan.entries[index];
                let mut value = Mat3A::from(self.entry_of(entry));
                for &[row, column] in &plan.terms[entry.terms.clone()] {
                    value -= self.lower[row] * self.upper[column];
                }
                self.upper[index] = value.transpose();
                self.lower[index] = value * self.diagonal[k];
            }
        }
    }

    fn diagonal_of(&self, scene: &Scene<'_>, joint: usize, which: usize) -> Mat3 {
        let work = &self.works[joint];
        let [a, b] = self.plan.ends[joint];
        let more = regularization(scene.set.joints[work.slot as usize].flags);
        work.blocks[which].diagonal(&self.bodies[a], &self.bodies[b], more)
    }

    /// What impulses of the column's rows do to the velocities of the row's, by the bodies that both joints hold.
    fn entry_of(&self, entry: &PlanEntry) -> Mat3 {
        let places = [&self.plan.blocks[entry.row], &self.plan.blocks[entry.column]];
        let [row, column] = places.map(|place| &self.works[place.joint].blocks[place.which]);
        let mut value = Mat3::ZERO;
        for shared in &entry.shared {
            let turn = if shared.second[0] { row.turn_b } else { row.turn_a };
            let response = if shared.second[1] { column.response_b } else { column.response_a };
            let sign = if shared.second[0] == shared.second[1] { 1.0 } else { -1.0 };
            let mut one = turn.transpose() * response;
            if places.iter().all(|place| place.which == 0) {
                let body = &self.bodies[shared.body];
                one = pushed(&row.along, &column.along, body.inverse_mass, body.whole, body.is_held) + one;
            }
            value += one * sign;
        }
        value
    }

    /// Solves for the impulses that give each block's rows `wanted`, and applies them.
    fn solve_rows(&mut self, wanted: impl Fn(&Self, usize, usize) -> Vec3) {
        self.substitute(wanted);
        for (block, &value) in self.plan.blocks.iter().zip(&self.values) {
            let block = &mut self.works[block.joint].blocks[block.which];
            block.push = value.into();
            block.impulse += block.push;
        }
        self.push(Work::push);
    }

    /// Gives each body what all its joints give it.
    fn push(&mut self, push: impl Fn(&Work, bool, &mut Body)) {
        for (index, body) in self.bodies[..self.plan.moved()].iter_mut().enumerate() {
            for &end in self.plan.at(index) {
                push(&self.works[end / 2], end & 1 == 1, body);
            }
        }
    }

    /// Forward and back substitution.
    fn substitute(&mut self, wanted: impl Fn(&Self, usize, usize) -> Vec3) {
        let mut values = std::mem::take(&mut self.values);
        values.clear();
        for block in &self.plan.blocks {
            let mut value = Vec3A::from(wanted(self, block.joint, block.which));
            for &[entry, column] in &self.plan.rows[block.rows.clone()] {
                value -= self.lower[entry] * values[column];
            }
            values.push(value);
        }
        for (k, block) in self.plan.blocks.iter().enumerate().rev() {
            let mut value = self.diagonal[k] * values[k];
            for entry in block.entries.clone() {
                value -= self.lower[entry].transpose() * values[self.plan.entries[entry].row];
            }
            values[k] = value;
        }
        self.values = values;
    }

    /// Moves the bodies to where the hard rows hold, as far as one linear step leads; velocities stay.
    fn project(&mut self, scene: &Scene<'_>) {
        self.substitute(|island, joint, which| {
            let work = &island.works[joint];
            -work.off(&scene.set.joints[work.slot as usize], which)
        });
        for (block, &value) in self.plan.blocks.iter().zip(&self.values) {
            self.works[block.joint].blocks[block.which].push = value.into();
        }
        for (index, body) in self.bodies[..self.plan.moved()].iter_mut().enumerate() {
            if body.moves() {
                let mut way = Body { linear: Vec3::ZERO, angular: Vec3::ZERO, ..*body };
                for &end in self.plan.at(index) {
                    self.works[end / 2].push(end & 1 == 1, &mut way);
                }
                body.pose = body.pose.moved(way.linear, way.angular);
            }
        }
    }
}

/// What a joint's blocks have more on the diagonal.
pub fn regularization(flags: u32) -> f32 {
    if flags & joint_bits::OVERLOCKED != 0 {
        OVERLOCKED_REGULARIZATION
    } else if flags & joint_bits::IN_CYCLE != 0 {
        CYCLE_REGULARIZATION
    } else {
        REGULARIZATION
    }
}
