//! Stage `level`: how many sub-steps each island gets. Twin of `shaders/level.wgsl`.
//!
//! What the last step left is measured where this one finds its contacts: the deepest overlap of each island, and the
//! widest separation of its joints. Where either is more than its tolerance the island wants the next level, which has
//! twice the sub-steps; after some calm steps, the one below. Bodies keep what their islands want, so that islands may meet
//! and part: the most wanted counts. And no island gets less than any of its bodies asks for (`BodyProps::least_level`);
//! without a tolerance that is all it gets.

use crate::batch::{Ends, NO_BODY};
use crate::island::NO_ISLAND;
use crate::joint::is_of;
use tumble_core::JointSet;
use tumble_core::layout::{
    BodyProps, BodyState, Control, JointState, LEVEL_CALM, LEVEL_HOLD, MOST_CREDIT, Manifold, StepParams, joint_bits,
};

/// What stands for the overlap of contacts and joints that have none, m; 0 is that of an island without any.
pub const NO_OVERLAP: f32 = 1e-30;

/// What an island wants that wanted `credit` and has this overlap, m; the separation of joints counts as overlap.
pub fn next_credit(credit: u32, overlap: f32, tolerance: f32) -> u32 {
    if overlap == 0.0 || tolerance < 0.0 {
        0
    } else if overlap > tolerance {
        ((credit / LEVEL_HOLD + 2) * LEVEL_HOLD - 1).min(MOST_CREDIT)
    } else if LEVEL_CALM as f32 * overlap < tolerance {
        credit.saturating_sub(1)
    } else {
        credit
    }
}

/// Deepest overlap of a manifold, m.
pub fn overlap(manifold: &Manifold) -> f32 {
    let points = &manifold.points[..manifold.count as usize];
    points.iter().fold(NO_OVERLAP, |deepest, point| deepest.max(-point.separation))
}

/// A body of a constraint that moves; of two, the first.
fn moving_body(manifold: &Manifold, ends: Ends) -> Option<usize> {
    let body = if ends.a != NO_BODY { ends.a } else { ends.b };
    (manifold.count > 0 && body != NO_BODY).then_some(body as usize)
}

/// The contacts of a step.
pub struct Touching<'a> {
    /// By pair.
    pub manifolds: &'a [Manifold],
    /// The same.
    pub ends: &'a [Ends],
}

/// Its joints, and what the step before left of them.
pub struct Held<'a> {
    /// By slot.
    pub joints: &'a JointSet,
    /// The same; may be shorter.
    pub states: &'a [JointState],
}

impl Held<'_> {
    /// A body of each joint that is not broken and between bodies of which one moves; of two, the first; and the joint's
    /// separation, m.
    fn each<'a>(&'a self, labels: &'a [u32]) -> impl Iterator<Item = (usize, f32)> + 'a {
        let joints = self.joints.joints.iter().enumerate().filter(|(_, joint)| joint.flags & joint_bits::ALIVE != 0);
        joints.filter_map(|(slot, joint)| {
            let ends = [joint.body_a as usize, joint.body_b as usize];
            let body = ends.into_iter().find(|&body| labels[body] != NO_ISLAND)?;
            let state = self.states.get(slot).filter(|state| is_of(joint, state));
            let is_whole = state.is_none_or(|state| state.broken == 0);
            is_whole.then_some((body, state.map_or(0.0, |state| state.separation)))
        })
    }
}

/// Decides for each island. Credits are in `states` before and after; `labels` and contacts are those of the step.
pub fn decide(
    states: &mut [BodyState],
    props: &[BodyProps],
    labels: &[u32],
    touching: &Touching<'_>,
    held: &Held<'_>,
    step: &StepParams,
    control: &mut Control,
) {
    let mut overlaps = vec![0.0f32; states.len()];
    let (mut credits, mut leasts) = (vec![0; states.len()], vec![0; states.len()]);
    let bodies = states.iter().zip(props).zip(labels);
    for ((state, props), &label) in bodies.filter(|(_, label)| **label != NO_ISLAND) {
        credits[label as usize] = state.credit.max(credits[label as usize]);
        leasts[label as usize] = props.least_level.max(leasts[label as usize]);
    }
    let (mut deepest, mut widest) = (0.0f32, 0.0f32);
    let contacts = || touching.manifolds.iter().zip(touching.ends);
    for (manifold, ends) in contacts() {
        if let Some(body) = moving_body(manifold, *ends) {
            let deep = &mut overlaps[labels[body] as usize];
            *deep = overlap(manifold).max(*deep);
            deepest = deepest.max(*deep);
        }
    }
    for (body, separation) in held.each(labels) {
        let deep = &mut overlaps[labels[body] as usize];
        // As overlap of the same share of its tolerance.
        *deep = (separation * step.joint_scale).max(NO_OVERLAP).max(*deep);
        widest = widest.max(separation);
    }
    for (state, &label) in states.iter_mut().zip(labels).filter(|(_, label)| **label != NO_ISLAND) {
        let overlap = overlaps[label as usize];
        let least = LEVEL_HOLD * leasts[label as usize];
        state.credit = next_credit(credits[label as usize], overlap, step.tolerance).max(least);
        control.levels_wanted |= 1 << (state.credit / LEVEL_HOLD);
        control.levels_used |= 1 << step.level_of(state.credit);
        control.bodies_over += u32::from(step.tolerance >= 0.0 && overlap > step.tolerance);
    }
    let touching = contacts().filter_map(|(manifold, ends)| moving_body(manifold, *ends));
    for body in touching.chain(held.each(labels).map(|(body, _)| body)) {
        control.visits = control.visits.wrapping_add(step.substeps << step.level_of(states[body].credit));
    }
    (control.residual, control.joint_residual) = (deepest.to_bits(), widest.to_bits());
}
