//! Stage `solver`: rows (`prepare`), the laws of a visit (`one_pass`, `soft`, `gauss_seidel`, `jacobi` and `penalty`, on
//! `push` and `resist`; several constraints at a time in those called `_lanes`), the passes over batches (`passes`; in plain
//! form here; the last batch on parts of bodies by `split`), and the way back to the store (`store`). Twin of
//! `shaders/solver/`.
//!
//! Contacts are found once a step and solved in sub-steps (Macklin et al., "Small Steps in Physics Simulation", SCA
//! 2019), by one of these:
//!
//! - one pass: each sub-step predicts velocities by what the last one added to them, visits every contact once, and
//!   integrates positions;
//! - soft, the shape that Box2D 3, Box3D and rapier converged on (Catto, "Solver2D", 2024): in each sub-step velocities
//!   are integrated, impulses of the last sub-step applied, contacts solved as damped springs, positions integrated, and
//!   contacts solved again as rigid, which takes out the velocity that the springs put in;
//! - Gauss-Seidel and Jacobi: the same, but that contacts are rigid and solved many times before positions are
//!   integrated;
//! - penalty: velocities are integrated, contacts push once with what overlaps, positions are integrated.
//!
//! Bounces come last.

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
mod gauss_seidel;
mod gauss_seidel_lanes;
mod groups;
mod jacobi;
mod jacobi_lanes;
pub(crate) mod lanes;
pub mod one_pass;
mod one_pass_lanes;
mod passes;
mod penalty;
mod penalty_lanes;
pub mod prepare;
mod prepare_lanes;
mod push;
mod push_lanes;
mod resist;
mod resist_lanes;
pub(crate) mod simd;
mod soft;
mod soft_lanes;
pub mod split;
pub mod store;

use crate::bounds::moves;
use crate::joint::{self, Part};
use crate::math::tangents;
use crate::motion;
use groups::Groups;
use prepare::Contact;
use split::Parts;
use store::Solved;
use tumble_core::layout::{
    BodyProps, BodyState, Collider, ConstraintHead, ConstraintPoint, Impulse, LAST_BATCH, SolverBody, StepParams,
    batching, solver,
};

/// The constraints of a step. Batches lie in groups of constraints side by side, the last one in plain rows.
#[derive(Default)]
pub struct Rows {
    /// Groups, batch by batch; a batch's last group may have empty lanes.
    groups: Groups,
    /// First group of each batch but the last, and the end.
    group_start: Vec<usize>,
    /// First constraint of each group, and how many it has.
    members: Vec<(u32, u32)>,
    /// The last batch.
    last: PlainRows,
    /// First constraint of the last batch.
    last_first: usize,
}

/// Constraints in plain rows; points and impulses are four a constraint.
#[derive(Debug, Default, Clone)]
pub struct PlainRows {
    /// One a constraint.
    pub heads: Vec<ConstraintHead>,
    /// Four a constraint.
    pub points: Vec<ConstraintPoint>,
    /// Four a constraint.
    pub impulses: Vec<Impulse>,
    /// Those at the end that are solved by mass splitting.
    parts: Parts,
}

/// One constraint in plain form.
pub type PlainConstraint = (ConstraintHead, [ConstraintPoint; 4], [Impulse; 4]);

/// What a visit to a constraint does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Visit {
    /// Soft, Gauss-Seidel, Jacobi: applies the impulses of the last visit.
    WarmStart,
    /// Soft: as springs.
    Solve,
    /// Soft: rigid, no bias.
    Relax,
    /// One pass: applies the impulses of the last step.
    Load,
    /// One pass: all there is in a sub-step.
    Pass,
    /// Gauss-Seidel.
    GaussSeidel,
    /// The same, last of a sub-step.
    LastGaussSeidel,
    /// Jacobi: counts each body's constraints.
    Split,
    /// Jacobi.
    Jacobi,
    /// The same, last of a sub-step.
    LastJacobi,
    /// Penalty.
    Penalty,
    /// Bounces.
    Restitution,
}

/// Bodies of a step, by slot.
pub struct Bodies<'a> {
    /// Hot state, which the solver moves.
    pub solver: &'a mut [SolverBody],
    /// State at the start of the step.
    pub states: &'a [BodyState],
    /// Properties.
    pub props: &'a [BodyProps],
}

impl Rows {
    /// Rows with so many constraints side by side instead of the most that the processor takes; none if that is not a
    /// number that it takes. Results are the same.
    #[doc(hidden)]
    pub fn with_lanes(lanes: usize) -> Option<Self> {
        Some(Self { groups: Groups::with_lanes(lanes)?, ..Self::default() })
    }

    /// Builds the rows of all constraints; `contact(c)` gives what constraint c of `start`'s order is made of. Buffers
    /// are used again.
    pub fn build<'c>(
        &mut self,
        start: &[u32],
        colliders: &[Collider],
        bodies: &[SolverBody],
        states: &[BodyState],
        step: &StepParams,
        contact: impl Fn(usize) -> Contact<'c> + Sync,
    ) {
        self.group_start.clear();
        self.members.clear();
        for batch in 0..LAST_BATCH as usize {
            self.group_start.push(self.members.len());
            for first in (start[batch]..start[batch + 1]).step_by(self.groups.lanes()) {
                self.members.push((first, (start[batch + 1] - first).min(self.groups.lanes() as u32)));
            }
        }
        self.group_start.push(self.members.len());
        self.groups.build(&self.members, colliders, bodies, states, step, &contact);
        let last = start[LAST_BATCH as usize] as usize..start[LAST_BATCH as usize + 1] as usize;
        self.last_first = last.start;
        let split = step.batching & batching::SPLIT_LAST != 0;
        let (count, contact) = (last.len(), |c| Contact { split, ..contact(c) });
        self.last =
            PlainRows::build(last, |c| prepare::prepare_constraint(&contact(c), colliders, bodies, states, step));
        if split {
            self.last.split_last(count, bodies);
        }
    }

    /// Calls `take(c, solved)` for every constraint, from many threads at once.
    pub fn for_each_constraint(&self, take: impl Fn(usize, &Solved) + Sync) {
        self.groups.for_each_constraint(&self.members, &take);
        for c in 0..self.last.heads.len() {
            take(self.last_first + c, &self.last.solved(c));
        }
    }

    /// Constraints side by side.
    pub(crate) fn lanes(&self) -> usize {
        self.groups.lanes()
    }

    /// Bytes that the rows hold.
    pub(crate) fn bytes(&self) -> u64 {
        self.groups.bytes() + (self.members.capacity() * size_of::<(u32, u32)>()) as u64
    }
}

impl PlainRows {
    /// These rows, all in sequence.
    pub fn new(heads: Vec<ConstraintHead>, points: Vec<ConstraintPoint>, impulses: Vec<Impulse>) -> Self {
        Self { heads, points, impulses, parts: Parts::default() }
    }

    /// Builds constraints `range` of `make`.
    pub fn build(range: std::ops::Range<usize>, make: impl Fn(usize) -> PlainConstraint) -> Self {
        let mut rows = Self::default();
        for c in range {
            let (head, points, impulses) = make(c);
            rows.heads.push(head);
            rows.points.extend(points);
            rows.impulses.extend(impulses);
        }
        rows
    }

    /// What the solver leaves of constraint c.
    pub fn solved(&self, c: usize) -> Solved {
        let (points, impulses) = (&self.points[4 * c..][..4], &self.impulses[4 * c..][..4]);
        Solved {
            impulses: std::array::from_fn(|k| (impulses[k].normal, impulses[k].tangent)),
            totals: std::array::from_fn(|k| points[k].total),
            remembered: self.heads[c].remembered,
            resisted: self.heads[c].resisted,
            deviations: std::array::from_fn(|k| points[k].deviation),
        }
    }

    /// Has the last `count` constraints solved by mass splitting. Their masses must be those that parts of the bodies see.
    pub fn split_last(&mut self, count: usize, bodies: &[SolverBody]) {
        self.parts = Parts::of(&self.heads[self.heads.len() - count..], bodies);
    }

    /// One visit to every constraint, in order. Within a batch the order is of no account.
    pub fn sweep(&mut self, bodies: &mut [SolverBody], step: &StepParams, visit: Visit) {
        let (count, split) = (self.heads.len(), self.parts.count());
        for c in 0..count - split {
            let [ia, ib] = self.bodies_of(c);
            let (mut a, mut b) = (bodies[ia], bodies[ib]);
            self.visit(c, &mut a, &mut b, step, visit);
            if a.inverse_mass > 0.0 {
                bodies[ia] = a;
            }
            if b.inverse_mass > 0.0 {
                bodies[ib] = b;
            }
        }
        let mut parts = std::mem::take(&mut self.parts);
        for c in count - split..count {
            let before = self.bodies_of(c).map(|body| split::part(&bodies[body]));
            let [mut a, mut b] = before;
            self.visit(c, &mut a, &mut b, step, visit);
            parts.add(c + split - count, &before, &[a, b]);
        }
        parts.join(bodies);
        self.parts = parts;
    }

    fn bodies_of(&self, c: usize) -> [usize; 2] {
        [self.heads[c].body_a as usize, self.heads[c].body_b as usize]
    }

    /// One visit to constraint c.
    fn visit(&mut self, c: usize, a: &mut SolverBody, b: &mut SolverBody, step: &StepParams, visit: Visit) {
        let head = &mut self.heads[c];
        let count = head.count as usize;
        let (points, impulses) = (&mut self.points[4 * c..][..count], &mut self.impulses[4 * c..][..count]);
        let tangents = tangents(head.normal.into()).into();
        match visit {
            Visit::WarmStart => push::warm_start(head, tangents, points, impulses, a, b),
            Visit::Solve | Visit::Relax => soft::visit(visit, head, tangents, points, impulses, [a, b], step),
            Visit::Load => one_pass::load(head, tangents, points, impulses, a, b),
            Visit::Pass => one_pass::pass(head, tangents, points, impulses, a, b, step),
            Visit::GaussSeidel | Visit::LastGaussSeidel => {
                let last = visit == Visit::LastGaussSeidel;
                gauss_seidel::visit(last, head, tangents, points, impulses, [a, b], step);
            }
            Visit::Split => jacobi::split(a, b),
            Visit::Jacobi | Visit::LastJacobi => {
                let last = visit == Visit::LastJacobi;
                jacobi::visit(last, head, tangents, points, impulses, [a, b], step);
            }
            Visit::Penalty => penalty::visit(head, tangents, points, impulses, a, b),
            Visit::Restitution => push::restitution(head, points, impulses, a, b, step),
        }
    }
}

/// One pass of a step's schedule.
#[derive(Debug, Clone, Copy)]
enum Pass {
    /// Over all bodies.
    Bodies(BodyPass),
    /// A visit to every constraint.
    Sweep(Visit),
    /// A part of a sub-step of joints.
    Joints(joint::Part),
}

/// What is done to each body.
type BodyPass = fn(&mut SolverBody, &BodyState, &BodyProps, &StepParams);

/// Runs all sub-steps of the step's level, by the law of `step.solver`.
pub fn solve(
    rows: &mut Rows,
    bodies: Bodies<'_>,
    joints: Option<&joint::Running<'_>>,
    step: &StepParams,
    restitution: bool,
) {
    passes::run(rows, bodies, joints, step, &schedule(step, restitution, joints.is_some()));
}

/// The same in plain rows, one constraint after the other: what `solve` is tested against.
pub fn solve_plain(rows: &mut PlainRows, bodies: Bodies<'_>, step: &StepParams, restitution: bool) {
    let Bodies { solver, states, props } = bodies;
    for pass in schedule(step, restitution, false) {
        match pass {
            Pass::Bodies(each) => {
                for (i, body) in solver.iter_mut().enumerate().filter(|(i, body)| takes_part(body, &states[*i], step)) {
                    each(body, &states[i], &props[i], step);
                }
            }
            Pass::Sweep(visit) => rows.sweep(solver, step, visit),
            Pass::Joints(_) => unreachable!("a schedule without joints"),
        }
    }
}

/// Whether a body is one of those of the step's level, or one that nothing pushes, which takes part in all.
fn takes_part(body: &SolverBody, state: &BodyState, step: &StepParams) -> bool {
    body.level == step.level || !moves(state.flags)
}

/// What a step begins with.
const BEGIN_JOINTS: [Part; 3] = [Part::Begin, Part::BeginLoose, Part::Stiffen];
/// Before contacts.
const SOLVE_JOINTS: [Part; 3] = [Part::Solve, Part::WarmStartLoose, Part::SolveLoose];
/// After bodies have moved.
const RELAX_JOINTS: [Part; 3] = [Part::Relax, Part::Stiffen, Part::RelaxLoose];

fn joint_passes(joints: bool, parts: &[Part]) -> impl Iterator<Item = Pass> {
    parts.iter().filter(move |_| joints).map(|&part| Pass::Joints(part))
}

/// The passes of one level of a step, in order. Joints come before contacts, and once more after bodies have moved.
fn schedule(step: &StepParams, restitution: bool, joints: bool) -> Vec<Pass> {
    use Pass::{Bodies, Sweep};
    let mut passes = Vec::new();
    if step.levels.trailing_zeros() < step.level {
        passes.push(Bodies(motion::rewind));
    }
    passes.extend(joint_passes(joints, &BEGIN_JOINTS));
    match step.solver {
        solver::ONE_PASS => {
            passes.extend([Bodies(motion::first_substep), Sweep(Visit::Load)]);
            passes.extend(joints.then_some(Bodies(motion::halve_load)));
            for substep in 1..=step.substeps {
                passes.extend(joint_passes(joints, &SOLVE_JOINTS));
                passes.push(Sweep(Visit::Pass));
                match (joints, substep < step.substeps) {
                    (false, true) => passes.push(Bodies(motion::next_substep)),
                    (false, false) => passes.push(Bodies(motion::last_substep)),
                    (true, next) => {
                        passes.push(Bodies(if next { motion::move_body } else { motion::move_last }));
                        passes.extend(joint_passes(true, &RELAX_JOINTS));
                        passes.extend(next.then_some(Bodies(motion::start_next)));
                    }
                }
            }
        }
        solver::JACOBI => passes.push(Sweep(Visit::Split)),
        _ => {}
    }
    let others = if step.solver == solver::ONE_PASS { 0 } else { step.substeps };
    for _ in 0..others {
        passes.extend(substep(step, joints));
    }
    if restitution {
        passes.push(Sweep(Visit::Restitution));
    }
    passes
}

/// A sub-step of the solvers whose sub-steps are all alike.
fn substep(step: &StepParams, joints: bool) -> Vec<Pass> {
    use Pass::{Bodies, Sweep};
    let start = [Bodies(motion::integrate_velocity), Sweep(Visit::WarmStart)];
    let again = step.iterations.saturating_sub(1) as usize;
    let solve: Vec<_> = joint_passes(joints, &SOLVE_JOINTS).collect();
    let mut positions = vec![Bodies(if joints { motion::move_body } else { motion::integrate_position })];
    positions.extend(joint_passes(joints, &RELAX_JOINTS));
    let mut passes = Vec::new();
    match step.solver {
        solver::SOFT => {
            passes.extend(start);
            passes.extend(solve);
            passes.push(Sweep(Visit::Solve));
            passes.extend(positions);
            passes.push(Sweep(Visit::Relax));
        }
        solver::GAUSS_SEIDEL => {
            passes.extend(start);
            passes.extend(solve);
            passes.extend(std::iter::repeat_n(Sweep(Visit::GaussSeidel), again));
            passes.push(Sweep(Visit::LastGaussSeidel));
            passes.extend(positions);
        }
        solver::JACOBI => {
            passes.extend(start);
            passes.extend(solve);
            passes.push(Bodies(jacobi::begin));
            for _ in 0..again {
                passes.extend([Sweep(Visit::Jacobi), Bodies(jacobi::settle)]);
            }
            passes.extend([Sweep(Visit::LastJacobi), Bodies(jacobi::settle)]);
            passes.extend(positions);
        }
        _ => {
            passes.push(Bodies(motion::first_substep));
            passes.extend(solve);
            passes.extend([Sweep(Visit::Penalty), Bodies(jacobi::settle)]);
            passes.extend(positions);
        }
    }
    passes
}
