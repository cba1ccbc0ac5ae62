//! A scene in mid-motion on both sides: what the passes of `solver` and `motion` read.

use bytemuck::Zeroable;
use tumble_core::layout::*;
use tumble_core::{GaussSeidel, Jacobi, LastBatch, OnePass, Params, Penalty, Scene, Soft, Solver, scenes};
use tumble_cpu::solver::{Bodies, PlainRows, Visit, solve_plain};

use crate::alone::{Alone, Chain};
use crate::frame::{Cpu, Frame, control_of, scene_of};

pub(crate) const PERMUTATIONS: [u32; 3] = [0, 1, 2];
pub(crate) const SIZES: [usize; 7] = [0, 1, 2, 255, 256, 257, 3000];
/// A visit, and the shader and pass that makes it; behind `_tail` that of the other batches.
pub(crate) type VisitPasses = (Visit, &'static str, &'static str);
const PASSES: &str = "solver/passes";
const CLASSIC: &str = "solver/classic";
const WARM_START: VisitPasses = (Visit::WarmStart, PASSES, "warm_start");
const SOLVE: VisitPasses = (Visit::Solve, PASSES, "solve");
const RELAX: VisitPasses = (Visit::Relax, PASSES, "relax");
const LOAD: VisitPasses = (Visit::Load, PASSES, "load");
const PASS: VisitPasses = (Visit::Pass, PASSES, "one_pass");
const GAUSS_SEIDEL: VisitPasses = (Visit::GaussSeidel, CLASSIC, "gauss_seidel");
const LAST_GAUSS_SEIDEL: VisitPasses = (Visit::LastGaussSeidel, CLASSIC, "last_gauss_seidel");
const SPLIT: VisitPasses = (Visit::Split, CLASSIC, "split");
const JACOBI: VisitPasses = (Visit::Jacobi, CLASSIC, "jacobi");
const LAST_JACOBI: VisitPasses = (Visit::LastJacobi, CLASSIC, "last_jacobi");
const PENALTY: VisitPasses = (Visit::Penalty, CLASSIC, "penalty");
const RESTITUTION: VisitPasses = (Visit::Restitution, PASSES, "restitution");

/// Every solver, with its visits.
pub(crate) fn solvers() -> [(Solver, Vec<VisitPasses>); 5] {
    [
        (Solver::OnePass(OnePass::default()), vec![LOAD, PASS, RESTITUTION]),
        (Solver::Soft(Soft::default()), vec![WARM_START, SOLVE, RELAX, RESTITUTION]),
        (Solver::GaussSeidel(GaussSeidel::default()), vec![GAUSS_SEIDEL, LAST_GAUSS_SEIDEL, RESTITUTION]),
        (Solver::Jacobi(Jacobi::default()), vec![SPLIT, JACOBI, LAST_JACOBI, RESTITUTION]),
        (Solver::Penalty(Penalty::default()), vec![PENALTY, RESTITUTION]),
    ]
}

/// A scene in mid-motion, and its next step up to the solver.
pub(crate) struct Stage {
    pub(crate) cpu: Cpu,
    pub(crate) frame: Frame,
    pub(crate) control: Control,
    pub(crate) bodies: Vec<SolverBody>,
    pub(crate) rows: PlainRows,
}

impl Stage {
    pub(crate) fn new(scene: &Scene, steps: u32) -> Self {
        Self::by(Solver::default(), scene, steps)
    }

    pub(crate) fn by(solver: Solver, scene: &Scene, steps: u32) -> Self {
        Self::with(Params { solver, ..Params::default() }, scene, steps)
    }

    pub(crate) fn with(params: Params, scene: &Scene, steps: u32) -> Self {
        let cpu = Cpu::after_with(params, scene, steps);
        let frame = cpu.plan(false);
        let mut control = control_of(&frame, false);
        control.batch_start[..65].copy_from_slice(&frame.batches.start);
        control.batch_count = frame.batches.batch_count;
        control.solved = frame.batches.order.len() as u32;
        let bodies = cpu.bodies(&frame);
        let rows = cpu.rows(&frame, &bodies);
        let mut stage = Self { cpu, frame, control, bodies, rows };
        stage.spoil();
        stage
    }

    pub(crate) fn all() -> impl Iterator<Item = (String, Self)> {
        Self::all_by(Solver::default())
    }

    pub(crate) fn all_by(solver: Solver) -> impl Iterator<Item = (String, Self)> {
        let of =
            move |what: String, scene: &Scene, steps| (format!("{solver}, {what}"), Self::by(solver, scene, steps));
        let sizes = SIZES.into_iter().map(move |bodies| of(format!("{bodies} bodies"), &scene_of(bodies), 40));
        let hub = of("hub".to_owned(), &scenes::hub(500), 2);
        let params = Params { solver, last_batch: LastBatch::MassSplitting, ..Params::default() };
        let split = Self::with(params, &scenes::hub(500), 2);
        let split = split.frame.splits_last().then(|| (format!("{solver}, hub, split"), split));
        // So deep that overlap is undone at the highest speed.
        let overlap = of("overlap".to_owned(), &scenes::overlap_cube().0, 0);
        sizes.chain([hub, overlap]).chain(split)
    }

    /// Fills the places of points that are not in use, as an earlier step would.
    fn spoil(&mut self) {
        for (i, impulse) in self.rows.impulses.iter_mut().enumerate() {
            if i as u32 % 4 >= self.rows.heads[i / 4].count {
                *impulse = Impulse { normal: 7.0, tangent: [7.0; 2], feature: 7 };
            }
        }
    }

    /// Every third pair is new: what its slot remembers is another's.
    pub(crate) fn refresh(&mut self) {
        self.frame.matched.pairs.iter_mut().step_by(3).for_each(|pair| pair.kind |= pair_kind::FRESH);
        self.rows = self.cpu.rows(&self.frame, &self.bodies);
    }

    /// Everything that the passes read, and `solver_bodies` and rows as they are now.
    pub(crate) fn put(&self, alone: &mut Alone, wide_batches: u32) {
        let Self { cpu, frame, .. } = self;
        alone.put("step", &[StepParams { wide_batches, ..frame.step }]);
        alone.put("counters", &[self.control]);
        alone.put("work_states", &frame.states);
        alone.put("props", &cpu.props);
        alone.put("colliders", &cpu.colliders);
        alone.put("masks", &frame.batches.masks);
        alone.put("batch_order", &frame.batches.order);
        alone.put("next_pairs", &frame.matched.pairs);
        alone.put("manifolds", &frame.manifolds);
        alone.put("slot_impulses", &cpu.impulses);
        alone.put("slot_memory", &cpu.memory);
        alone.put("states", &cpu.states);
        alone.put("shares", &vec![1f32; cpu.states.len()]);
        alone.put("poses", &vec![PoseRecord::zeroed(); cpu.states.len()]);
        self.put_solver(alone);
    }

    pub(crate) fn put_solver(&self, alone: &mut Alone) {
        alone.put("solver_bodies", &self.bodies);
        alone.put("heads", &self.rows.heads);
        alone.put("points", &self.rows.points);
        alone.put("impulses", &self.rows.impulses);
        if self.frame.splits_last() {
            self.put_parts(alone);
        }
    }

    /// What is listed of the parts of bodies.
    pub(crate) fn put_parts(&self, alone: &mut Alone) {
        let (bodies, ends): (Vec<u32>, Vec<u32>) = self.parts().into_iter().unzip();
        alone.put("part_bodies", &bodies);
        alone.put("part_ends", &ends);
        // Of a step before.
        alone.put("part_changes", &vec![f32::NAN; 16 * ends.len()]);
    }

    /// Ends of the last batch's constraints by body: (body or no number of any, twice the constraint plus the side).
    pub(crate) fn parts(&self) -> Vec<(u32, u32)> {
        let first = self.control.batch_start[LAST_BATCH as usize] as usize;
        let slots = self.rows.heads[first..].iter().flat_map(|head| [head.body_a, head.body_b]);
        let moving = |slot: u32| self.bodies[slot as usize].inverse_mass > 0.0;
        let mut ends: Vec<_> = slots.map(|slot| if moving(slot) { slot } else { u32::MAX }).zip(0..).collect();
        ends.sort();
        ends
    }

    pub(crate) fn take_solver(alone: &Alone) -> (Vec<SolverBody>, PlainRows) {
        let rows = PlainRows::new(alone.take("heads"), alone.take("points"), alone.take("impulses"));
        (alone.take("solver_bodies"), rows)
    }

    pub(crate) fn by_body(&self) -> u32 {
        self.frame.step.body_count.div_ceil(256) + 1
    }

    pub(crate) fn by_constraint(&self) -> u32 {
        self.control.solved.div_ceil(256) + 1
    }

    /// One visit to every constraint on the GPU: a dispatch a batch, and one for those from `wide_batches` on.
    pub(crate) fn sweep(&self, chain: &mut Chain, (_, stem, entry): VisitPasses, wide_batches: u32) {
        for batch in 0..wide_batches {
            let start = &self.frame.batches.start[batch as usize..];
            let groups = (start[1] - start[0]).div_ceil(64) + 1;
            chain.indexed(stem, entry, ("batch", batch), groups);
        }
        chain.pass(stem, &format!("{entry}_tail"), 1);
        if self.frame.splits_last() {
            chain.pass("solver/split", &format!("{entry}_split"), 1);
        }
    }

    /// All sub-steps of a step on the GPU, and the bounces, with 8 wide batches.
    pub(crate) fn solve(&self, chain: &mut Chain) {
        let StepParams { substeps, iterations, solver, .. } = self.frame.step;
        let body = |chain: &mut Chain, stem, entry| chain.pass(stem, entry, self.by_body());
        let sweep = |chain: &mut Chain, visit| self.sweep(chain, visit, 8);
        match solver {
            solver::ONE_PASS => {
                body(chain, "motion", "first_substep");
                sweep(chain, LOAD);
            }
            solver::JACOBI => sweep(chain, SPLIT),
            _ => {}
        }
        for substep in 1..=substeps {
            if [solver::SOFT, solver::GAUSS_SEIDEL, solver::JACOBI].contains(&solver) {
                body(chain, "motion", "integrate_velocities");
                sweep(chain, WARM_START);
            }
            match solver {
                solver::ONE_PASS => {
                    sweep(chain, PASS);
                    body(chain, "motion", if substep < substeps { "next_substep" } else { "last_substep" });
                    continue;
                }
                solver::SOFT => sweep(chain, SOLVE),
                solver::GAUSS_SEIDEL => {
                    (1..iterations).for_each(|_| sweep(chain, GAUSS_SEIDEL));
                    sweep(chain, LAST_GAUSS_SEIDEL);
                }
                solver::JACOBI => {
                    body(chain, CLASSIC, "begin");
                    for iteration in 1..=iterations {
                        sweep(chain, if iteration < iterations { JACOBI } else { LAST_JACOBI });
                        body(chain, CLASSIC, "settle");
                    }
                }
                _ => {
                    body(chain, "motion", "first_substep");
                    sweep(chain, PENALTY);
                    body(chain, CLASSIC, "settle");
                }
            }
            body(chain, "motion", "integrate_positions");
            if solver == solver::SOFT {
                sweep(chain, RELAX);
            }
        }
        sweep(chain, RESTITUTION);
    }

    /// The state in the midst of a step: one sub-step is done.
    pub(crate) fn advance(&mut self) {
        let Self { cpu, frame, bodies, rows, .. } = self;
        let step = StepParams { substeps: 1, ..frame.step };
        let moving = Bodies { solver: bodies, states: &frame.states, props: &cpu.props };
        solve_plain(rows, moving, &step, false);
    }
}

/// Points in use.
pub(crate) fn used<T: Copy>(heads: &[ConstraintHead], four: &[T]) -> Vec<T> {
    let of = |(head, four): (&ConstraintHead, &[T])| four[..head.count as usize].to_vec();
    heads.iter().zip(four.chunks_exact(4)).flat_map(of).collect()
}

/// All but what visits and integration of velocities change: that must be as it was, bit for bit.
pub(crate) fn still(body: &SolverBody) -> SolverBody {
    let none = [0.0; 3];
    let still = SolverBody { linear_velocity: none, angular_velocity: none, ..*body };
    SolverBody { linear_start: none, angular_start: none, weight: 0.0, weighted: 0.0, ..still }
}
