//! The last batch by mass splitting. Twin of `shaders/solver/split.wgsl`.
//!
//! A body of k constraints in the last batch is split into k parts of mass and inertia / k, all with the velocity that the
//! body has before that batch. Each constraint works on parts of its own, so none sees what others do; then the body takes
//! the mean of its parts. What a part gains by an impulse is k times what the whole body would, of which the mean keeps a
//! k-th: momentum is conserved, though the two bodies of a contact be split differently. Masses that constraints see are
//! prepared with the parts ([`Contact::split`](super::prepare::Contact::split)), so the laws of a visit know nothing of it.

use crate::math::vec3;
use glam::Vec3;
use tumble_core::layout::{ConstraintHead, SolverBody};

/// In place of a body that does not move.
const NO_SUM: u32 = u32::MAX;

/// Constraints that are solved by mass splitting, and what they do to their bodies in a sweep.
#[derive(Debug, Clone, Default)]
pub(super) struct Parts {
    /// Which sum each end of each constraint adds to, or [`NO_SUM`].
    ends: Vec<[u32; 2]>,
    /// The body of each sum.
    bodies: Vec<u32>,
    sums: Vec<Change>,
}

/// What constraints change of a body's parts.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    linear: Vec3,
    angular: Vec3,
    linear_start: Vec3,
    angular_start: Vec3,
    weight: f32,
    weighted: f32,
}

/// Counts the parts of bodies: one for each constraint that they are on, of those that `ends` gives the bodies of.
pub fn count_parts(bodies: &mut [SolverBody], ends: impl Iterator<Item = [usize; 2]>) {
    for body in ends.flatten() {
        bodies[body].parts += u32::from(bodies[body].inverse_mass > 0.0);
    }
}

/// A part of a body, before any constraint worked on it.
pub fn part(body: &SolverBody) -> SolverBody {
    let parts = body.parts.max(1) as f32;
    SolverBody {
        inverse_mass: body.inverse_mass * parts,
        inverse_inertia_diagonal: body.inverse_inertia_diagonal.map(|x| x * parts),
        inverse_inertia_off: body.inverse_inertia_off.map(|x| x * parts),
        weight: 0.0,
        weighted: 0.0,
        ..*body
    }
}

impl Parts {
    pub(super) fn of(heads: &[ConstraintHead], bodies: &[SolverBody]) -> Self {
        let mut parts = Self::default();
        let mut sum_of = vec![NO_SUM; bodies.len()];
        for head in heads {
            let ends = [head.body_a, head.body_b].map(|body| {
                let sum = &mut sum_of[body as usize];
                if *sum == NO_SUM && bodies[body as usize].inverse_mass > 0.0 {
                    *sum = parts.bodies.len() as u32;
                    parts.bodies.push(body);
                }
                *sum
            });
            parts.ends.push(ends);
        }
        parts.sums.resize(parts.bodies.len(), Change::default());
        parts
    }

    /// How many constraints.
    pub(super) fn count(&self) -> usize {
        self.ends.len()
    }

    /// Adds what constraint c did to its parts.
    pub(super) fn add(&mut self, c: usize, before: &[SolverBody; 2], after: &[SolverBody; 2]) {
        for (sum, (before, after)) in self.ends[c].into_iter().zip(before.iter().zip(after)) {
            if let Some(sum) = self.sums.get_mut(sum as usize) {
                sum.linear += vec3(after.linear_velocity) - vec3(before.linear_velocity);
                sum.angular += vec3(after.angular_velocity) - vec3(before.angular_velocity);
                sum.linear_start += vec3(after.linear_start) - vec3(before.linear_start);
                sum.angular_start += vec3(after.angular_start) - vec3(before.angular_start);
                sum.weight += after.weight;
                sum.weighted += after.weighted;
            }
        }
    }

    /// Ends a sweep: bodies take the means of their parts.
    pub(super) fn join(&mut self, bodies: &mut [SolverBody]) {
        for (&body, sum) in self.bodies.iter().zip(&mut self.sums) {
            let body = &mut bodies[body as usize];
            let parts = body.parts as f32;
            let mean = |whole: [f32; 3], change: Vec3| (vec3(whole) + change / parts).to_array();
            body.linear_velocity = mean(body.linear_velocity, sum.linear);
            body.angular_velocity = mean(body.angular_velocity, sum.angular);
            body.linear_start = mean(body.linear_start, sum.linear_start);
            body.angular_start = mean(body.angular_start, sum.angular_start);
            body.weight += sum.weight;
            body.weighted += sum.weighted;
            *sum = Change::default();
        }
    }
}
