//! The joints of the coming step as both sides take them: packed anew where an edit touched them, and the topology only
//! where that asks for it.

use crate::builder::RigidBodyType;
use crate::handle::JointHandle;
use crate::layout::{Control, Joint, joint_bits};
use crate::packed::pack_joint;
use crate::scene::Scene;
use crate::topology::{JointSolver, Topology};
use bytemuck::Zeroable;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Flags of joints that the topology gives them.
const OF_TOPOLOGY: u32 = joint_bits::IN_CYCLE | joint_bits::TWICE | joint_bits::OVERLOCKED;

/// The joints of a step. Equal pointers mean equal joints.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointSet {
    /// By slot; empty slots are zero.
    pub joints: Vec<Joint>,
    /// How they are solved.
    pub topology: Arc<Topology>,
}

impl JointSet {
    /// The handle of the joint at a slot, if one is there.
    pub(crate) fn handle(&self, slot: u32) -> Option<JointHandle> {
        let joint = self.joints.get(slot as usize).filter(|joint| joint.flags & joint_bits::ALIVE != 0)?;
        Some(JointHandle { slot, generation: joint.generation })
    }

    /// The joints that a step names as newly broken.
    #[doc(hidden)]
    pub fn newly_broken(&self, control: &Control) -> Vec<JointHandle> {
        let named = control.newly_broken.iter().filter_map(|name| name.checked_sub(1));
        let mut joints: Vec<_> = named.filter_map(|slot| self.handle(slot)).collect();
        joints.sort_unstable_by_key(|joint| joint.slot);
        joints
    }
}

/// What changed of the joints since the last step.
#[derive(Debug, Clone, Default)]
pub(crate) struct JointEdits {
    set: Arc<JointSet>,
    solver: JointSolver,
    /// Slots to pack anew.
    changed: BTreeSet<u32>,
    /// Whether those that the scene came with are packed.
    begun: bool,
}

impl JointEdits {
    /// These joints are others now, or no more.
    pub(crate) fn changed(&mut self, joints: &[JointHandle]) {
        self.changed.extend(joints.iter().map(|joint| joint.slot));
    }

    /// The joints of the coming step.
    pub(crate) fn set(&mut self, scene: &Scene, solver: JointSolver) -> Arc<JointSet> {
        if !std::mem::replace(&mut self.begun, true) {
            self.changed.extend(scene.joints.iter().map(|(slot, ..)| slot));
        }
        let again = std::mem::replace(&mut self.solver, solver) != solver;
        if self.changed.is_empty() && !again {
            return self.set.clone();
        }
        let mut joints = self.set.joints.clone();
        joints.resize(scene.joints.len(), Joint::zeroed());
        let mut rebuild = again;
        for slot in std::mem::take(&mut self.changed) {
            let old = joints[slot as usize];
            let live = scene.joints.at(slot).map(|(generation, _)| JointHandle { slot, generation });
            let mut new = live.and_then(|handle| pack_joint(scene, handle).ok()).unwrap_or(Joint::zeroed());
            new.flags |= old.flags & OF_TOPOLOGY;
            rebuild |= shape(&old) != shape(&new);
            joints[slot as usize] = new;
        }
        let mut topology = self.set.topology.clone();
        if rebuild {
            let moves = |slot: u32| {
                scene.bodies.at(slot).is_some_and(|(_, body)| body.builder.body_type == RigidBodyType::Dynamic)
            };
            let held = |slot: u32| scene.bodies.at(slot).is_some_and(|(_, body)| body.builder.locked() != 0);
            topology = Arc::new(Topology::new(&mut joints, &moves, &held, solver));
        }
        self.set = Arc::new(JointSet { joints, topology });
        self.set.clone()
    }
}

/// What the topology depends on.
fn shape(joint: &Joint) -> (u32, u32, u32, u32) {
    let axes = joint.axes >> joint_bits::LOCKED | joint.axes >> joint_bits::DRIVEN;
    (joint.body_a, joint.body_b, axes & 63, joint.flags & (joint_bits::ALIVE | joint_bits::APART))
}
