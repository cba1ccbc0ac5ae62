//! A scene in mid-motion on both sides: what the passes of `solver` and `motion` read.

use bytemuck::Zeroable;
use tumble_core::layout::*;
use tumble_core::{OnePass, Scene, Soft, Solver, scenes};
use tumble_cpu::solver::{Bodies, PlainRows, Visit, solve_plain};

use crate::alone::{Alone, Chain};
use crate::frame::{Cpu, Frame, control_of, scene_of};

pub(crate) const PERMUTATIONS: [u32; 3] = [0, 1, 2];
pub(crate) const SIZES: [usize; 7] = [0, 1, 2, 255, 256, 257, 3000];
/// Visits, and the passes that make them.
pub(crate) type VisitPasses = (Visit, &'static str, &'static str);
pub(crate) const WARM_START: VisitPasses = (Visit::WarmStart, "warm_start", "warm_start_tail");
pub(crate) const SOLVE: VisitPasses = (Visit::Solve, "solve", "solve_tail");
pub(crate) const RELAX: VisitPasses = (Visit::Relax, "relax", "relax_tail");
pub(crate) const LOAD: VisitPasses = (Visit::Load, "load", "load_tail");
pub(crate) const PASS: VisitPasses = (Visit::Pass, "one_pass", "one_pass_tail");
pub(crate) const RESTITUTION: VisitPasses = (Visit::Restitution, "restitution", "restitution_tail");

/// Every solver, with its visits.
pub(crate) fn solvers() -> [(Solver, Vec<VisitPasses>); 2] {
    [
        (Solver::OnePass(OnePass::default()), vec![LOAD, PASS, RESTITUTION]),
        (Solver::Soft(Soft::default()), vec![WARM_START, SOLVE, RELAX, RESTITUTION]),
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
        let cpu = Cpu::after_by(solver, scene, steps);
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
        // So deep that overlap is undone at the highest speed.
        let overlap = of("overlap".to_owned(), &scenes::overlap_cube().0, 0);
        sizes.chain([hub, overlap])
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
    }

    pub(crate) fn take_solver(alone: &Alone) -> (Vec<SolverBody>, PlainRows) {
        let rows =
            PlainRows { heads: alone.take("heads"), points: alone.take("points"), impulses: alone.take("impulses") };
        (alone.take("solver_bodies"), rows)
    }

    pub(crate) fn by_body(&self) -> u32 {
        self.frame.step.body_count.div_ceil(256) + 1
    }

    pub(crate) fn by_constraint(&self) -> u32 {
        self.control.solved.div_ceil(256) + 1
    }

    /// One visit to every constraint on the GPU: a dispatch a batch, and one for those from `wide_batches` on.
    pub(crate) fn sweep(&self, chain: &mut Chain, (_, wide, tail): VisitPasses, wide_batches: u32) {
        for batch in 0..wide_batches {
            let start = &self.frame.batches.start[batch as usize..];
            let groups = (start[1] - start[0]).div_ceil(64) + 1;
            chain.indexed("solver/passes", wide, ("batch", batch), groups);
        }
        chain.pass("solver/passes", tail, 1);
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
