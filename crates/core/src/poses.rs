//! Bulk results, by handle.

use crate::error::{Error, Result};
use crate::handle::BodyHandle;
use crate::layout::{BodyState, PoseRecord, body_flags};
use glam::{Quat, Vec3};
use std::ops::Index;

/// Where a body's own frame is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// m, world.
    pub translation: Vec3,
    /// Body frame to world.
    pub rotation: Quat,
}

/// How a body moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Velocity {
    /// Of the centre of mass, m/s, world axes.
    pub linear: Vec3,
    /// rad/s, world axes.
    pub angular: Vec3,
}

/// Bits of a generation that results carry.
const GENERATION: u32 = 0x00ff_ffff;

/// A value for each body, as of the end of one step.
#[derive(Debug, Clone, PartialEq)]
pub struct PerBody<T> {
    step: u64,
    values: Vec<Option<(u32, T)>>,
}

/// The pose of every body.
pub type Poses = PerBody<Pose>;
/// The velocity of every body.
pub type Velocities = PerBody<Velocity>;

impl<T> PerBody<T> {
    /// From values by handle, for results that come from elsewhere.
    pub fn collect(step: u64, values: impl Iterator<Item = (BodyHandle, T)>) -> Self {
        let mut slots: Vec<Option<(u32, T)>> = Vec::new();
        for (body, value) in values {
            if slots.len() <= body.slot() {
                slots.resize_with(body.slot() + 1, || None);
            }
            slots[body.slot()] = Some((body.generation() & GENERATION, value));
        }
        Self { step, values: slots }
    }
    /// The value of `body`, or [`Error::StaleBody`].
    pub fn get(&self, body: BodyHandle) -> Result<&T> {
        match self.values.get(body.slot()) {
            Some(Some((generation, value))) if *generation == body.generation() & GENERATION => Ok(value),
            _ => Err(Error::StaleBody(body)),
        }
    }
    /// All values, in slot order.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.values.iter().flatten().map(|(_, value)| value)
    }
    /// The step at whose end they were taken; 0 before the first.
    pub fn step(&self) -> u64 {
        self.step
    }
}

/// Panics on a stale handle, as slices do on a bad index; [`PerBody::get`] does not.
impl<T> Index<BodyHandle> for PerBody<T> {
    type Output = T;
    fn index(&self, body: BodyHandle) -> &T {
        match self.get(body) {
            Ok(value) => value,
            Err(error) => panic!("{error}"),
        }
    }
}

impl PerBody<Pose> {
    /// From the renderer's records, by slot.
    pub fn from_records(step: u64, records: &[PoseRecord]) -> Self {
        let pose = |r: &PoseRecord| Pose {
            translation: Vec3::from_array(r.translation),
            rotation: Quat::from_array(r.rotation),
        };
        let values = records.iter().map(|r| (r.tag & body_flags::KIND != 0).then(|| (r.tag >> 8, pose(r)))).collect();
        Self { step, values }
    }
}

impl PerBody<Velocity> {
    /// From the bodies' states, by slot.
    pub fn from_states(step: u64, states: &[BodyState]) -> Self {
        let velocity = |s: &BodyState| Velocity {
            linear: Vec3::from_array(s.linear_velocity),
            angular: Vec3::from_array(s.angular_velocity),
        };
        let values = states
            .iter()
            .map(|s| (s.flags & body_flags::KIND != 0).then(|| (s.generation & GENERATION, velocity(s))))
            .collect();
        Self { step, values }
    }
}
