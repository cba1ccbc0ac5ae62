//! Stage `solver`: rows (`prepare`), the law of one visit (`soft`), the passes over batches (here), and the way back
//! to the store (`store`). Twin of `shaders/solver/`.
//!
//! Soft sub-stepping, the shape that Box2D 3, Box3D and rapier converged on (Catto, "Solver2D", 2024; Macklin et al.,
//! "Small Steps in Physics Simulation", SCA 2019): contacts are found once a step, and in each sub-step velocities
//! are integrated, impulses of the last sub-step applied, contacts solved as damped springs, positions integrated, and
//! contacts solved again as rigid, which takes out the velocity that the springs put in. Bounces come last.

pub mod prepare;
pub mod soft;
pub mod store;

use crate::motion;
use crate::shared::Shared;
use rayon::prelude::*;
use tumble_core::layout::{
    BodyProps, BodyState, ConstraintHead, ConstraintPoint, Impulse, LAST_BATCH, SolverBody, StepParams,
};

/// The constraints of a step in batch order; points and impulses are four a constraint.
#[derive(Debug, Default)]
pub struct Rows {
    /// One a constraint.
    pub heads: Vec<ConstraintHead>,
    /// Four a constraint.
    pub points: Vec<ConstraintPoint>,
    /// Four a constraint.
    pub impulses: Vec<Impulse>,
}

/// What a visit to a constraint does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Visit {
    /// Applies the impulses of the last visit.
    WarmStart,
    /// Soft.
    Solve,
    /// Rigid, no bias.
    Relax,
    /// Bounces.
    Restitution,
}

/// Runs all sub-steps. `start` holds the batches' first constraints.
pub fn solve(
    rows: &mut Rows,
    start: &[u32],
    bodies: &mut [SolverBody],
    states: &[BodyState],
    props: &[BodyProps],
    step: &StepParams,
    restitution: bool,
) {
    for _ in 0..step.substeps {
        bodies.par_iter_mut().zip(states.par_iter().zip(props)).with_min_len(512).for_each(|(body, (state, props))| {
            motion::integrate_velocity(body, state, props, step);
        });
        sweep(rows, start, bodies, step, Visit::WarmStart);
        sweep(rows, start, bodies, step, Visit::Solve);
        bodies.par_iter_mut().zip(states.par_iter().zip(props)).with_min_len(512).for_each(|(body, (state, props))| {
            motion::integrate_position(body, state, props, step);
        });
        sweep(rows, start, bodies, step, Visit::Relax);
    }
    if restitution {
        sweep(rows, start, bodies, step, Visit::Restitution);
    }
}

/// One visit to every constraint, batch by batch; the last batch in sequence.
pub fn sweep(rows: &mut Rows, start: &[u32], bodies: &mut [SolverBody], step: &StepParams, visit: Visit) {
    for batch in 0..=LAST_BATCH as usize {
        let range = start[batch] as usize..start[batch + 1] as usize;
        if range.is_empty() {
            continue;
        }
        let heads = &rows.heads[range.clone()];
        let points = &mut rows.points[4 * range.start..4 * range.end];
        let impulses = &mut rows.impulses[4 * range.start..4 * range.end];
        let bodies = Shared::new(bodies);
        let one = |(head, (points, impulses)): (&ConstraintHead, (&mut [ConstraintPoint], &mut [Impulse]))| {
            // SAFETY: constraints of one batch share no moving body (`batch`), the last batch runs on one thread,
            // and bodies that do not move are never written.
            let mut a = unsafe { bodies.get(head.body_a as usize) };
            // SAFETY: as above.
            let mut b = unsafe { bodies.get(head.body_b as usize) };
            soft::visit(visit, head, points, impulses, &mut a, &mut b, step);
            if a.inverse_mass > 0.0 {
                // SAFETY: as above.
                unsafe { bodies.set(head.body_a as usize, a) };
            }
            if b.inverse_mass > 0.0 {
                // SAFETY: as above.
                unsafe { bodies.set(head.body_b as usize, b) };
            }
        };
        if batch == LAST_BATCH as usize {
            heads.iter().zip(points.chunks_exact_mut(4).zip(impulses.chunks_exact_mut(4))).for_each(one);
        } else {
            let points = points.par_chunks_exact_mut(4);
            heads.par_iter().zip(points.zip(impulses.par_chunks_exact_mut(4))).with_min_len(128).for_each(one);
        }
    }
}
