//! Joints that are solved directly, together: block LDL^T. Twin of `shaders/joint/island.wgsl`.
//!
//! One factor a sub-step serves the projection of the poses, the velocities that are left when the impulses act on the new
//! arms, and the next sub-step's velocities. The system K is that of the rows, with a little more on its diagonal, and its
//! inertia includes the geometric stiffness of all joints of a body: a force held at its old arm makes a light body stiff,
//! and no exact solver survives that.

use super::rows::{Body, Work, inverse_inertia, own_arm, stiffening};
use crate::math::{quat, vec3};
use glam::{Mat3, Vec3};
use tumble_core::layout::{
    BodyProps, BodyState, JointBlock, JointEntry, JointIsland, JointState, NO_BODY, SolverBody, StepParams, joint_bits,
};
use tumble_core::{JointSet, Topology};

/// Share of its trace over three that is added to a block of a joint on a tree.
pub const REGULARIZATION: f32 = 1e-6;
/// The same of joints on cycles, where rows may say the same twice.
pub const CYCLE_REGULARIZATION: f32 = 1e-5;
/// How often pieces are chosen in a sub-step.
pub const CHOICES: u32 = 3;
/// Share of a sub-step's impulses of motors, friction and springs that is given before bodies move, and once more after:
/// as gravity, or springs would sag by what they give against one half of it only.
pub const HALF: f32 = 0.5;

/// The joints of an island and their bodies, while a step runs.
#[derive(Debug, Default, Clone)]
pub struct Island {
    /// What the topology says.
    info: Option<JointIsland>,
    works: Vec<Work>,
    /// Bodies of each joint, in `bodies`.
    ends: Vec<[usize; 2]>,
    bodies: Vec<Body>,
    /// Their slots: first those that joints move, then others that they hold.
    slots: Vec<u32>,
    /// The joint at each of the bodies that move: twice its place in the island, plus one for the second body.
    joints_at: Vec<Vec<u32>>,
    diagonal: Vec<Mat3>,
    /// L times D below the diagonal.
    upper: Vec<Mat3>,
    /// L below the diagonal.
    lower: Vec<Mat3>,
    /// Right-hand sides and solutions.
    values: Vec<Vec3>,
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
    /// Begins a step: reads bodies and joints, chooses pieces, and factors.
    pub fn begin(
        &mut self,
        scene: &Scene<'_>,
        info: &JointIsland,
        states: &[JointState],
        bodies: &impl Store,
        step: &StepParams,
    ) {
        let topology = &*scene.set.topology;
        self.info = Some(*info);
        self.gather(scene, info, bodies);
        let first = info.first_joint as usize;
        self.works.clear();
        for &slot in &topology.joints[first..][..info.joint_count as usize] {
            let joint = &scene.set.joints[slot as usize];
            let [a, b] = [joint.body_a, joint.body_b].map(|body| vec3(scene.states[body as usize].position));
            self.works.push(Work::new(slot, joint, states[slot as usize], b - a, step.h));
        }
        self.stiffen(scene, step);
        for (work, &[a, b]) in self.works.iter_mut().zip(&self.ends) {
            let joint = &scene.set.joints[work.slot as usize];
            work.refresh(joint, &self.bodies[a], &self.bodies[b]);
            work.carry_impulses(HALF);
            work.choose(joint, &self.bodies[a], &self.bodies[b], step.h, HALF);
            work.rebuild(&self.bodies[a], &self.bodies[b]);
        }
        self.factor(scene);
    }

    /// Reads the bodies as they are now.
    pub fn gather(&mut self, scene: &Scene<'_>, info: &JointIsland, bodies: &impl Store) {
        let topology = &*scene.set.topology;
        let joints = &topology.joints[info.first_joint as usize..][..info.joint_count as usize];
        self.slots.clear();
        self.ends.clear();
        self.joints_at.clear();
        let own = &topology.bodies[info.first_body as usize..][..info.body_count as usize];
        for body in own {
            self.slots.push(body.body);
            let at = &topology.ends[body.first_end as usize..][..body.end_count as usize];
            self.joints_at.push(at.iter().map(|end| end - 2 * info.first_joint).collect());
        }
        for &slot in joints {
            let joint = &scene.set.joints[slot as usize];
            self.ends.push([joint.body_a, joint.body_b].map(|body| {
                own.binary_search_by_key(&body, |b| b.body).unwrap_or_else(|_| {
                    self.slots.push(body);
                    self.slots.len() - 1
                })
            }));
        }
        self.read(scene, bodies);
    }

    fn read(&mut self, scene: &Scene<'_>, bodies: &impl Store) {
        self.bodies.clear();
        let read = |&slot: &u32| Body::of(&bodies.get(slot as usize), &scene.states[slot as usize]);
        self.bodies.extend(self.slots.iter().map(read));
    }

    /// Puts velocities, poses and inertia back; what joints added to the velocities is no load of contacts.
    fn write(&self, scene: &Scene<'_>, bodies: &impl Store, poses: bool) {
        for (index, &slot) in self.slots[..self.joints_at.len()].iter().enumerate() {
            let (body, mut new) = (&self.bodies[index], bodies.get(slot as usize));
            if new.inverse_mass == 0.0 {
                continue;
            }
            body.put_velocities(&mut new);
            if poses {
                new.translation = body.pose.translation.to_array();
                let start = quat(scene.states[slot as usize].rotation);
                new.delta = (body.pose.rotation * start.conjugate()).normalize().to_array();
            }
            new = body.put_inertia(new);
            bodies.set(slot as usize, new);
        }
    }

    /// Velocities that take the joints to where they belong within the sub-step.
    pub fn solve(&mut self, scene: &Scene<'_>, bodies: &impl Store, step: &StepParams) {
        self.read(scene, bodies);
        let topology = &*scene.set.topology;
        let mut remainders = Vec::with_capacity(self.works.len());
        let mut changed = false;
        for (work, &[a, b]) in self.works.iter_mut().zip(&self.ends) {
            let (joint, a, b) = (&scene.set.joints[work.slot as usize], &self.bodies[a], &self.bodies[b]);
            work.look(joint, a, b);
            changed |= work.choose(joint, a, b, step.h, HALF);
            work.forget_impulses();
            remainders.push(work.remainders(joint, a, b, step.h));
        }
        for choice in 0..CHOICES {
            if changed {
                self.rebuild(scene);
            }
            self.works.iter_mut().for_each(Work::fix);
            self.push(|work, second, body| work.push_fixed(second, body));
            self.solve_rows(topology, |island, joint, which| {
                let [a, b] = island.ends[joint];
                island.works[joint].lack(which, &island.bodies[a], &island.bodies[b], false) - remainders[joint][which]
            });
            changed = false;
            if choice + 1 < CHOICES {
                for (work, &[a, b]) in self.works.iter_mut().zip(&self.ends) {
                    let joint = &scene.set.joints[work.slot as usize];
                    changed |= work.choose(joint, &self.bodies[a], &self.bodies[b], step.h, HALF);
                }
            }
            if !changed {
                break;
            }
        }
        self.write(scene, bodies, false);
    }

    /// Poses onto the joints, and velocities that keep them there with the arms as they are now.
    pub fn relax(&mut self, scene: &Scene<'_>, bodies: &impl Store, step: &StepParams) {
        self.read(scene, bodies);
        let topology = &*scene.set.topology;
        self.works.iter_mut().for_each(Work::keep_impulses);
        self.works.iter_mut().for_each(Work::forget_impulses);
        self.stiffen(scene, step);
        for (work, &[a, b]) in self.works.iter_mut().zip(&self.ends) {
            work.refresh(&scene.set.joints[work.slot as usize], &self.bodies[a], &self.bodies[b]);
        }
        self.factor(scene);
        self.project(scene);
        self.works.iter_mut().for_each(Work::fix);
        self.push(|work, second, body| work.push_fixed(second, body));
        self.solve_rows(topology, |island, joint, which| {
            let [a, b] = island.ends[joint];
            island.works[joint].lack(which, &island.bodies[a], &island.bodies[b], true)
        });
        self.works.iter_mut().for_each(Work::add_impulses);
        self.write(scene, bodies, true);
    }

    /// What lasts of the joints after a step.
    pub fn states(&mut self, set: &JointSet) -> impl Iterator<Item = JointState> {
        let bodies = &self.bodies;
        self.works.iter_mut().zip(&self.ends).map(|(work, &[a, b])| {
            let joint = &set.joints[work.slot as usize];
            // Where the last projection left it.
            work.look(joint, &bodies[a], &bodies[b]);
            work.lasting(joint)
        })
    }

    fn rebuild(&mut self, scene: &Scene<'_>) {
        for (work, &[a, b]) in self.works.iter_mut().zip(&self.ends) {
            work.rebuild(&self.bodies[a], &self.bodies[b]);
        }
        self.factor(scene);
    }

    /// The bodies' inertia with the geometric stiffness of their joints.
    fn stiffen(&mut self, scene: &Scene<'_>, step: &StepParams) {
        for (index, at) in self.joints_at.iter().enumerate() {
            let props = &scene.props[self.slots[index] as usize];
            let body = &mut self.bodies[index];
            if body.inverse_mass == 0.0 {
                continue;
            }
            let mut more = Mat3::ZERO;
            for &end in at {
                let work = &self.works[end as usize / 2];
                let arm = own_arm(&scene.set.joints[work.slot as usize], end & 1 == 1, body.pose.rotation);
                let impulse = vec3(work.state.impulse);
                more += stiffening(arm, if end & 1 == 1 { impulse } else { -impulse }, step.h);
            }
            body.inverse_inertia = inverse_inertia(body.pose.rotation, props, more);
        }
    }

    /// Assembles and factors K: level by level, each block of a level by itself.
    fn factor(&mut self, scene: &Scene<'_>) {
        let topology = &*scene.set.topology;
        let Some(info) = self.info else { return };
        let blocks = &topology.blocks[info.first_block as usize..][..info.block_count as usize];
        let first_entry = blocks.first().map_or(0, |block| block.first_entry) as usize;
        let entry_count: usize = blocks.iter().map(|block| block.entry_count as usize).sum();
        self.diagonal.resize(blocks.len(), Mat3::ZERO);
        self.upper.resize(entry_count, Mat3::ZERO);
        self.lower.resize(entry_count, Mat3::ZERO);
        for (k, block) in blocks.iter().enumerate() {
            let mut diagonal = self.diagonal_of(scene, &info, block);
            for [row, column] in &topology.terms[block.first_term as usize..][..block.term_count as usize] {
                let (row, column) = (*row as usize - first_entry, *column as usize - first_entry);
                diagonal -= self.lower[row] * self.upper[column].transpose();
            }
            self.diagonal[k] = diagonal.inverse();
            for index in block.first_entry as usize..(block.first_entry + block.entry_count) as usize {
                let entry = &topology.entries[index];
                let mut value = self.entry_of(scene, &info, entry);
                for [row, column] in &topology.terms[entry.first_term as usize..][..entry.term_count as usize] {
                    let (row, column) = (*row as usize - first_entry, *column as usize - first_entry);
                    value -= self.lower[row] * self.upper[column].transpose();
                }
                self.upper[index - first_entry] = value;
                self.lower[index - first_entry] = value * self.diagonal[k];
            }
        }
    }

    fn diagonal_of(&self, scene: &Scene<'_>, info: &JointIsland, block: &JointBlock) -> Mat3 {
        let (joint, which) = place(info, block.row);
        let work = &self.works[joint];
        let [a, b] = self.ends[joint];
        let in_cycle = scene.set.joints[work.slot as usize].flags & joint_bits::IN_CYCLE != 0;
        let more = if in_cycle { CYCLE_REGULARIZATION } else { REGULARIZATION };
        work.blocks[which].diagonal(&self.bodies[a], &self.bodies[b], more)
    }

    /// What impulses of the column's rows do to the velocities of the row's, by the bodies that both joints hold.
    fn entry_of(&self, scene: &Scene<'_>, info: &JointIsland, entry: &JointEntry) -> Mat3 {
        let topology = &*scene.set.topology;
        let (i, row) = place(info, topology.blocks[entry.row as usize].row);
        let (j, column) = place(info, topology.blocks[entry.column as usize].row);
        let slots = [i, j].map(|joint| self.works[joint].slot as usize);
        let first = slots.map(|slot| scene.set.joints[slot].body_a);
        let (row, column) = (&self.works[i].blocks[row], &self.works[j].blocks[column]);
        let mut value = Mat3::ZERO;
        for slot in entry.shared_bodies.into_iter().filter(|&slot| slot != NO_BODY) {
            let (turn, turn_sign) = if first[0] == slot { (row.turn_a, -1.0) } else { (row.turn_b, 1.0) };
            let (response, sign) = if first[1] == slot { (column.response_a, -1.0) } else { (column.response_b, 1.0) };
            let index = self.ends[i][usize::from(first[0] != slot)];
            let along = row.along.transpose() * column.along * self.bodies[index].inverse_mass;
            value += (along + turn.transpose() * response) * (turn_sign * sign);
        }
        value
    }

    /// Solves for the impulses that give each block's rows `wanted`, and applies them.
    fn solve_rows(&mut self, topology: &Topology, wanted: impl Fn(&Self, usize, usize) -> Vec3) {
        self.substitute(topology, wanted);
        let Some(info) = self.info else { return };
        let blocks = &topology.blocks[info.first_block as usize..][..info.block_count as usize];
        for (k, block) in blocks.iter().enumerate() {
            let (joint, which) = place(&info, block.row);
            self.works[joint].blocks[which].push = self.values[k];
            self.works[joint].blocks[which].impulse += self.values[k];
        }
        self.push(Work::push);
    }

    /// Gives each body what all its joints give it.
    fn push(&mut self, push: impl Fn(&Work, bool, &mut Body)) {
        for (body, at) in self.bodies.iter_mut().zip(&self.joints_at) {
            for &end in at {
                push(&self.works[end as usize / 2], end & 1 == 1, body);
            }
        }
    }

    /// Forward and back substitution.
    fn substitute(&mut self, topology: &Topology, wanted: impl Fn(&Self, usize, usize) -> Vec3) {
        let Some(info) = self.info else { return };
        let blocks = &topology.blocks[info.first_block as usize..][..info.block_count as usize];
        let first_entry = blocks.first().map_or(0, |block| block.first_entry) as usize;
        let mut values = std::mem::take(&mut self.values);
        values.resize(blocks.len(), Vec3::ZERO);
        for (k, block) in blocks.iter().enumerate() {
            let (joint, which) = place(&info, block.row);
            let mut value = wanted(self, joint, which);
            for [entry, column] in &topology.rows[block.first_row as usize..][..block.row_count as usize] {
                value -= self.lower[*entry as usize - first_entry] * values[(column - info.first_block) as usize];
            }
            values[k] = value;
        }
        for (k, block) in blocks.iter().enumerate().rev() {
            let mut value = self.diagonal[k] * values[k];
            for index in block.first_entry as usize..(block.first_entry + block.entry_count) as usize {
                let row = (topology.entries[index].row - info.first_block) as usize;
                value -= self.lower[index - first_entry].transpose() * values[row];
            }
            values[k] = value;
        }
        self.values = values;
    }

    /// Moves the bodies to where the hard rows hold, as far as one linear step leads; velocities stay.
    fn project(&mut self, scene: &Scene<'_>) {
        let topology = &*scene.set.topology;
        self.substitute(topology, |island, joint, which| {
            let work = &island.works[joint];
            -work.off(&scene.set.joints[work.slot as usize], which)
        });
        let Some(info) = self.info else { return };
        let blocks = &topology.blocks[info.first_block as usize..][..info.block_count as usize];
        for (k, block) in blocks.iter().enumerate() {
            let (joint, which) = place(&info, block.row);
            self.works[joint].blocks[which].push = self.values[k];
        }
        for (body, at) in self.bodies.iter_mut().zip(&self.joints_at).filter(|(body, _)| body.inverse_mass > 0.0) {
            let mut way = Body { linear: Vec3::ZERO, angular: Vec3::ZERO, ..*body };
            for &end in at {
                self.works[end as usize / 2].push(end & 1 == 1, &mut way);
            }
            body.pose = body.pose.moved(way.linear, way.angular);
        }
    }
}

/// Joint and block of a row's number.
fn place(info: &JointIsland, row: u32) -> (usize, usize) {
    ((row / 2 - info.first_joint) as usize, (row % 2) as usize)
}
