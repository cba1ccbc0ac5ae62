//! Joints after the last step, in bulk: where they are, what they bear, and which are broken.

use crate::error::{Error, Result};
use crate::handle::{BodyHandle, JointHandle};
use crate::joint::JointAxis;
use crate::joint_edits::JointSet;
use crate::layout::{BodyState, Joint, JointState, joint_bits};
use glam::{DMat3, DQuat, DVec3, Quat, Vec3};
use std::ops::Index;

/// All joints of a world as of the end of one step, in slot order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joints {
    /// The step; 0 before the first.
    pub step: u64,
    /// One for each joint that the step had.
    pub all: Vec<JointReading>,
}

/// What a joint does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointReading {
    /// Which joint.
    pub joint: JointHandle,
    /// The bodies that it joins, the first one first.
    pub bodies: [BodyHandle; 2],
    /// Where the second joint frame is in the first one, m and rad, by [`JointAxis`]; see
    /// [`JointBuilder`](crate::JointBuilder). Of a hinge and a universal joint, the coordinates of locked angles are the
    /// sines of what they are off by. Of a coupled joint the first one is the distance of the anchors, and the other two
    /// along are 0.
    pub coordinates: [f32; 6],
    /// What the joint pushes the second body with at its anchor, and the first the other way: N, world axes. The force of
    /// the last sub-step; 0 of a joint that broke in a step before.
    pub force: Vec3,
    /// What it turns the second body with, about its anchor, and the first the other way: N m, world axes, taken as the
    /// force is.
    pub torque: Vec3,
    /// How far locked axes along are off, all together, m; 0 once broken.
    pub separation: f32,
    /// How far locked axes about are off, all together, rad; 0 once broken.
    pub angle: f32,
    /// Whether it is broken.
    pub broken: bool,
}

impl JointReading {
    /// The coordinate of one axis, m or rad.
    pub fn coordinate(&self, axis: JointAxis) -> f32 {
        self.coordinates[axis as usize]
    }
}

impl Joints {
    /// What `joint` does, or [`Error::StaleJoint`].
    pub fn get(&self, joint: JointHandle) -> Result<&JointReading> {
        let place = self.all.binary_search_by_key(&joint.slot, |reading| reading.joint.slot);
        let reading = place.ok().map(|place| &self.all[place]).filter(|reading| reading.joint == joint);
        reading.ok_or(Error::StaleJoint(joint))
    }

    /// From what a world keeps of its last committed step: its number, its joints, and by slot its bodies and what lasts
    /// of its joints.
    #[doc(hidden)]
    pub fn read(step: u64, set: &JointSet, bodies: &[BodyState], states: &[JointState]) -> Self {
        let slots = (0..set.joints.len() as u32).filter_map(|slot| set.handle(slot));
        let all = slots.map(|joint| {
            let slot = joint.slot as usize;
            read(joint, &set.joints[slot], bodies, states.get(slot))
        });
        Self { step, all: all.collect() }
    }
}

/// Panics on a stale handle, as slices do on a bad index; [`Joints::get`] does not.
impl Index<JointHandle> for Joints {
    type Output = JointReading;
    fn index(&self, joint: JointHandle) -> &JointReading {
        match self.get(joint) {
            Ok(reading) => reading,
            Err(error) => panic!("{error}"),
        }
    }
}

fn read(handle: JointHandle, joint: &Joint, bodies: &[BodyState], state: Option<&JointState>) -> JointReading {
    // What is of another joint that was in the slot, or of none, is nothing of this one.
    let state = state.filter(|state| state.tag == joint.generation.wrapping_add(1));
    let broken = state.is_some_and(|state| state.broken != 0);
    let ends = [joint.body_a, joint.body_b];
    let [a, b] = ends.map(|slot| &bodies[slot as usize]);
    let coordinates = coordinates(joint, a, b);
    let off = |axis: usize| {
        let drive = &joint.drives[axis];
        let locked = joint.axes >> (joint_bits::LOCKED + axis as u32) & 1 != 0;
        let held = joint.axes >> (joint_bits::LIMITED + axis as u32) & 1 != 0 && drive.low == drive.high;
        if (locked || held) && !broken { coordinates[axis] - f64::from(drive.low) } else { 0.0 }
    };
    let length = |first: usize| DVec3::new(off(first), off(first + 1), off(first + 2)).length() as f32;
    let rate = state.filter(|state| state.h > 0.0).map_or(0.0, |state| 1.0 / state.h);
    let per_second = |of: fn(&JointState) -> [f32; 3]| state.map_or(Vec3::ZERO, |state| rate * Vec3::from(of(state)));
    JointReading {
        joint: handle,
        bodies: ends.map(|slot| BodyHandle { slot, generation: bodies[slot as usize].generation }),
        coordinates: coordinates.map(|x| x as f32),
        force: per_second(|state| state.impulse),
        torque: per_second(|state| state.torque),
        separation: length(0),
        angle: length(3),
        broken,
    }
}

/// Where the joint's second frame is in its first one; locked axes of equal limits keep their own value.
fn coordinates(joint: &Joint, a: &BodyState, b: &BodyState) -> [f64; 6] {
    let rotation = |q: [f32; 4]| Quat::from_array(q).as_dquat().normalize();
    let vector = |v: [f32; 3]| Vec3::from_array(v).as_dvec3();
    let (turn_a, turn_b) = (rotation(a.rotation), rotation(b.rotation));
    let anchor_a = vector(a.position) + turn_a * vector(joint.anchor_a);
    let anchor_b = vector(b.position) + turn_b * vector(joint.anchor_b);
    let (frame_a, frame_b) = (turn_a * rotation(joint.rotation_a), turn_b * rotation(joint.rotation_b));
    let offset = anchor_b - anchor_a;
    let along = match joint.flags & joint_bits::COUPLED != 0 {
        true => DVec3::new(offset.length(), 0.0, 0.0),
        false => frame_a.conjugate() * offset,
    };
    let about = angles(joint.axes >> (joint_bits::LOCKED + 3) & 7, frame_a.conjugate() * frame_b);
    [along.x, along.y, along.z, about.x, about.y, about.z]
}

/// The coordinates about the axes, of which those in `locked` are locked.
fn angles(locked: u32, between: DQuat) -> DVec3 {
    // The shorter way round.
    let between = if between.w < 0.0 { -between } else { between };
    let axes = DMat3::from_quat(between);
    let mut about = DVec3::ZERO;
    match locked.count_ones() {
        2 => {
            let axis = (7 & !locked).trailing_zeros() as usize;
            about = DVec3::AXES[axis].cross(axes.col(axis));
            about[axis] = 2.0 * between.to_array()[axis].atan2(between.w);
        }
        1 => {
            let lock = locked.trailing_zeros() as usize;
            let (first, second) = ((lock + 1) % 3, (lock + 2) % 3);
            // The second body's second axis in the first body's frame, and the first body's first axis in the second's.
            let (theirs, ours) = (axes.col(second), axes.row(first));
            about[first] = theirs[lock].atan2(theirs[second]);
            about[second] = ours[lock].atan2(ours[first]);
            about[lock] = -theirs[first];
        }
        _ => about = between.to_scaled_axis(),
    }
    about
}
