//! Stages `solver` and `motion`, each pass alone: the GPU computes what the CPU does, in every order of invocations.
//! Oracle: the mirror (its plain form), which makes the inputs too.
//!
//! Tolerances are shares of the largest number of the field in the array, or of 1; beside each is the largest error that
//! was measured (llvmpipe).

#[path = "common/alone.rs"]
mod alone;
mod common;
#[path = "common/floats.rs"]
mod floats;
#[path = "common/frame.rs"]
mod frame;

use alone::{Alone, Chain};
use bytemuck::Zeroable;
use floats::Floats;
use frame::{Cpu, Frame, control_of, scene_of};
use tumble_core::layout::*;
use tumble_core::{Scene, scenes};
use tumble_cpu::motion;
use tumble_cpu::solver::{Bodies, PlainRows, Visit, solve_plain};

const PERMUTATIONS: [u32; 3] = [0, 1, 2];
const SIZES: [usize; 7] = [0, 1, 2, 255, 256, 257, 3000];
const VISITS: [(Visit, &str, &str); 4] = [
    (Visit::WarmStart, "warm_start", "warm_start_tail"),
    (Visit::Solve, "solve", "solve_tail"),
    (Visit::Relax, "relax", "relax_tail"),
    (Visit::Restitution, "restitution", "restitution_tail"),
];
/// First word of the names of bodies in quarantine, and the scratch word of their count.
const QUARANTINED: usize = 100;
const FROZEN_COUNT: usize = 108;

/// A scene in mid-motion, and its next step up to the solver.
struct Stage {
    cpu: Cpu,
    frame: Frame,
    control: Control,
    bodies: Vec<SolverBody>,
    rows: PlainRows,
}

impl Stage {
    fn new(scene: &Scene, steps: u32) -> Self {
        let cpu = Cpu::after(scene, steps);
        let frame = cpu.plan(false);
        let mut control = control_of(&frame, false);
        control.batch_start[..65].copy_from_slice(&frame.batches.start);
        control.batch_count = frame.batches.batch_count;
        control.solved = frame.batches.order.len() as u32;
        let bodies = cpu.bodies(&frame);
        let rows = cpu.rows(&frame, &bodies);
        Self { cpu, frame, control, bodies, rows }
    }

    fn all() -> impl Iterator<Item = (String, Self)> {
        let sizes = SIZES.into_iter().map(|bodies| (format!("{bodies} bodies"), Self::new(&scene_of(bodies), 40)));
        sizes.chain([("hub".to_owned(), Self::new(&scenes::hub(500), 2))])
    }

    /// Everything that the passes read, and `solver_bodies` and rows as they are now.
    fn put(&self, alone: &mut Alone, wide_batches: u32) {
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
        alone.put("states", &cpu.states);
        alone.put("poses", &vec![PoseRecord::zeroed(); cpu.states.len()]);
        self.put_solver(alone);
    }

    fn put_solver(&self, alone: &mut Alone) {
        alone.put("solver_bodies", &self.bodies);
        alone.put("heads", &self.rows.heads);
        alone.put("points", &self.rows.points);
        alone.put("impulses", &self.rows.impulses);
    }

    fn take_solver(alone: &Alone) -> (Vec<SolverBody>, PlainRows) {
        let rows =
            PlainRows { heads: alone.take("heads"), points: alone.take("points"), impulses: alone.take("impulses") };
        (alone.take("solver_bodies"), rows)
    }

    fn by_body(&self) -> u32 {
        self.frame.step.body_count.div_ceil(256) + 1
    }

    fn by_constraint(&self) -> u32 {
        self.control.solved.div_ceil(256) + 1
    }

    /// One visit to every constraint on the GPU: a dispatch a batch, and one for those from `wide_batches` on.
    fn sweep(&self, chain: &mut Chain, (_, wide, tail): (Visit, &str, &str), wide_batches: u32) {
        for batch in 0..wide_batches {
            let start = &self.frame.batches.start[batch as usize..];
            let groups = (start[1] - start[0]).div_ceil(64) + 1;
            chain.indexed("solver/passes", wide, ("batch", batch), groups);
        }
        chain.pass("solver/passes", tail, 1);
    }

    /// The state in the midst of a step: one sub-step is done.
    fn advance(&mut self) {
        let Self { cpu, frame, bodies, rows, .. } = self;
        let step = StepParams { substeps: 1, ..frame.step };
        let moving = Bodies { solver: bodies, states: &frame.states, props: &cpu.props };
        solve_plain(rows, moving, &step, false);
    }
}

/// Points in use.
fn used<T: Copy>(heads: &[ConstraintHead], four: &[T]) -> Vec<T> {
    let of = |(head, four): (&ConstraintHead, &[T])| four[..head.count as usize].to_vec();
    heads.iter().zip(four.chunks_exact(4)).flat_map(of).collect()
}

/// All but the velocities, which must be as they were, bit for bit.
fn still(body: &SolverBody) -> SolverBody {
    SolverBody { linear_velocity: [0.0; 3], angular_velocity: [0.0; 3], ..*body }
}

fn check_solver(
    what: &str,
    floats: &mut Floats,
    cpu: (&[SolverBody], &PlainRows),
    gpu: (&[SolverBody], &PlainRows),
    [velocity, impulse, approach]: [(&'static str, f32); 3],
) {
    floats.check(what, velocity, (cpu.0, gpu.0), |b| b.linear_velocity);
    floats.check(what, velocity, (cpu.0, gpu.0), |b| b.angular_velocity);
    assert_eq!(cpu.1.heads, gpu.1.heads, "{what}");
    let both = (&used(&cpu.1.heads, &cpu.1.impulses)[..], &used(&cpu.1.heads, &gpu.1.impulses)[..]);
    floats.check(what, impulse, both, |i| [i.normal, i.tangent[0], i.tangent[1]]);
    assert!(both.0.iter().zip(both.1).all(|(cpu, gpu)| cpu.feature == gpu.feature), "{what}: features");
    let both = (&used(&cpu.1.heads, &cpu.1.points)[..], &used(&cpu.1.heads, &gpu.1.points)[..]);
    floats.check(what, impulse, both, |p| [p.max_impulse]);
    floats.check(what, approach, both, |p| [p.approach]);
}

#[test]
fn timing() {
    for (name, scene) in
        [("pile", scenes::pile(3000)), ("balls", scenes::balls(3000)), ("pyramid", scenes::pyramid(60))]
    {
        let mut stage = Stage::new(&scene, 80);
        stage.advance();
        let start = &stage.frame.batches.start;
        let sizes: Vec<u32> = start.windows(2).map(|w| w[1] - w[0]).filter(|n| *n > 0).collect();
        eprintln!(
            "{name}: {} constraints, {} points, batches {sizes:?}",
            stage.rows.heads.len(),
            stage.rows.heads.iter().map(|h| h.count).sum::<u32>()
        );
        for wide in [63, 8, 0] {
            for visit in VISITS {
                let alone = &mut Alone::new(0);
                stage.put(alone, wide);
                let mut best = f64::MAX;
                for _ in 0..15 {
                    stage.put_solver(alone);
                    let _ = alone.take::<u32>("heads");
                    let t = std::time::Instant::now();
                    alone.run(|chain| {
                        for _ in 0..10 {
                            for batch in 0..wide {
                                let start = &stage.frame.batches.start[batch as usize..];
                                let groups = (start[1] - start[0]).div_ceil(64);
                                chain.indexed("solver/passes", visit.1, ("batch", batch), groups);
                            }
                            chain.pass("solver/passes", visit.2, 1);
                        }
                    });
                    let _ = alone.take::<u32>("solver_bodies");
                    best = best.min(t.elapsed().as_secs_f64() / 10.0);
                }
                eprintln!("  wide {wide} {:12} {:.3} ms a sweep", visit.1, best * 1e3);
            }
        }
        let (mut b, mut r) = (stage.bodies.clone(), stage.rows.clone());
        let t = std::time::Instant::now();
        for _ in 0..10 {
            r.sweep(&mut b, &stage.frame.step, Visit::Solve);
        }
        eprintln!("  cpu plain solve {:.3} ms", t.elapsed().as_secs_f64() * 100.0);
        let alone = &mut Alone::new(0);
        stage.put(alone, 8);
        for (stem, entry, groups) in [
            ("motion", "integrate_velocities", stage.by_body()),
            ("motion", "integrate_positions", stage.by_body()),
            ("motion", "commit", stage.by_body()),
            ("solver/prepare", "bodies", stage.by_body()),
            ("solver/prepare", "constraints", stage.by_constraint()),
            ("solver/prepare", "carry", stage.by_constraint()),
            ("solver/store", "store", stage.by_constraint()),
        ] {
            let mut best = f64::MAX;
            for _ in 0..10 {
                let _ = alone.take::<u32>("heads");
                let t = std::time::Instant::now();
                alone.run(|chain| {
                    for _ in 0..10 {
                        chain.pass(stem, entry, groups)
                    }
                });
                let _ = alone.take::<u32>("solver_bodies");
                best = best.min(t.elapsed().as_secs_f64() / 10.0);
            }
            eprintln!("  {entry:20} {:.3} ms", best * 1e3);
        }
    }
}
