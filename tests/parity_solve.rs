//! Stages `solver` and `motion`, each pass alone: the GPU computes what the CPU does, in every order of invocations.
//! Oracle: the mirror (its plain form), which makes the inputs too.
//!
//! Tolerances are shares of the largest number of a field in its element, or of 1.

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

/// What each field may be off: (name, tolerance), with the largest error that was measured on llvmpipe beside it.
mod off {
    type Field = (&'static str, f32);
    pub(crate) const INERTIA: Field = ("inverse inertia", 1e-6); // 0
    pub(crate) const SEPARATION: Field = ("separation", 2e-6); // 2.4e-7
    pub(crate) const MASSES: Field = ("masses", 2e-6); // 2.1e-7
    pub(crate) const APPROACH: Field = ("approach", 5e-6); // 4.8e-7
    // A gap is divided by the sub-step, 240 to the second: its last bit is 3e-5 m/s. Velocities, impulses, approach.
    pub(crate) const SWEEP: [Field; 3] = [("velocity", 3e-4), ("impulse", 3e-4), ("approach", 1e-4)]; // 3.4e-5 3.1e-5 6.1e-6
    pub(crate) const LONG: [Field; 3] = [("velocity", 5e-4), ("impulse", 5e-4), ("approach", 5e-4)]; // 4.6e-5 6.0e-5 3.7e-5
    pub(crate) const STEP: [Field; 3] = [("velocity", 1e-3), ("impulse", 1e-3), ("approach", 5e-4)]; // 6.7e-5 1.1e-4 5.4e-5
    pub(crate) const STEP_WAY: Field = ("translation", 1e-5); // 1.8e-7
    pub(crate) const STEP_TURN: Field = ("turn", 1e-5); // 2.5e-7
    pub(crate) const VELOCITY: Field = ("velocity", 1e-6); // 0
    pub(crate) const WAY: Field = ("translation", 1e-6); // 0
    pub(crate) const TURN: Field = ("turn", 1e-5); // 1.2e-6
    pub(crate) const TURNED: Field = ("turned velocity", 1e-5); // 8.9e-7
    pub(crate) const ROTATION: Field = ("rotation", 1e-6); // 1.2e-7
    pub(crate) const POSE: Field = ("pose", 1e-6); // 1.2e-7
}

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
    // Impulses as the changes of velocity that they are at their points.
    let mass: Vec<f32> = used(&cpu.1.heads, &cpu.1.points).iter().map(|p| p.normal_mass.max(1e-3)).collect();
    let impulses = [used(&cpu.1.heads, &cpu.1.impulses), used(&cpu.1.heads, &gpu.1.impulses)];
    let changes = |side: &[Impulse]| -> Vec<[f32; 3]> {
        let change = |(i, m): (&Impulse, &f32)| [i.normal / m, i.tangent[0] / m, i.tangent[1] / m];
        side.iter().zip(&mass).map(change).collect()
    };
    floats.check(what, impulse, (&changes(&impulses[0]), &changes(&impulses[1])), |change| *change);
    assert!(impulses[0].iter().map(|i| i.feature).eq(impulses[1].iter().map(|i| i.feature)), "{what}: features");
    let both = (&used(&cpu.1.heads, &cpu.1.points)[..], &used(&cpu.1.heads, &gpu.1.points)[..]);
    let highest =
        |points: &[ConstraintPoint]| -> Vec<f32> { points.iter().zip(&mass).map(|(p, m)| p.max_impulse / m).collect() };
    floats.check(what, impulse, (&highest(both.0), &highest(both.1)), |x| [*x]);
    floats.check(what, approach, both, |p| [p.approach]);
}

#[test]
fn prepare_builds_the_mirrors_rows() {
    let mut floats = Floats::default();
    for (what, stage) in Stage::all() {
        for permute in PERMUTATIONS {
            let what = format!("{what}, permuted {permute}");
            let alone = &mut Alone::new(permute);
            stage.put(alone, 8);
            let mark = 0xab;
            for name in ["solver_bodies", "heads", "points", "impulses"] {
                let bytes = alone.take::<u8>(name).len();
                alone.put(name, &vec![mark; bytes]);
            }
            let (by_body, by_constraint) = (stage.by_body(), stage.by_constraint());
            alone.run(|chain| {
                chain.pass("solver/prepare", "bodies", by_body);
                chain.pass("solver/prepare", "constraints", by_constraint);
                chain.pass("solver/prepare", "carry", by_constraint);
            });
            let (bodies, rows) = Stage::take_solver(alone);
            let both = (&stage.bodies[..], &bodies[..]);
            let plain =
                |b: &SolverBody| SolverBody { inverse_inertia_diagonal: [0.0; 3], inverse_inertia_off: [0.0; 3], ..*b };
            assert!(both.0.iter().map(plain).eq(both.1.iter().map(plain)), "{what}: bodies");
            floats.check(&what, off::INERTIA, both, |b| b.inverse_inertia_diagonal);
            floats.check(&what, off::INERTIA, both, |b| b.inverse_inertia_off);

            assert!(stage.rows.heads == rows.heads, "{what}: heads");
            let heads = &rows.heads;
            assert!(used(heads, &rows.impulses) == used(heads, &stage.rows.impulses), "{what}: impulses");
            let both = (&used(heads, &stage.rows.points)[..], &used(heads, &rows.points)[..]);
            let exact = |p: &ConstraintPoint| (p.anchor_a, p.anchor_b, p.max_impulse, p.pad_a);
            assert!(both.0.iter().map(exact).eq(both.1.iter().map(exact)), "{what}: points");
            floats.check(&what, off::SEPARATION, both, |p| [p.adjusted_separation]);
            floats.check(&what, off::MASSES, both, |p| [p.normal_mass, p.tangent_mass]);
            floats.check(&what, off::APPROACH, both, |p| [p.approach]);

            let unused = |head: &ConstraintHead| 4 - head.count as usize;
            let marked = rows.points.iter().filter(|p| p.pad_a == u32::from_ne_bytes([mark; 4])).count();
            assert_eq!(marked, heads.iter().map(unused).sum::<usize>(), "{what}: only points in use are written");
        }
    }
    eprintln!("prepare\n{floats}");
}

#[test]
fn each_visit_does_what_the_mirrors_does() {
    let mut floats = Floats::default();
    for (what, mut stage) in Stage::all() {
        stage.frame.step.restitution_threshold = 0.01;
        stage.advance();
        for visit in VISITS {
            let (mut bodies, mut rows) = (stage.bodies.clone(), stage.rows.clone());
            rows.sweep(&mut bodies, &stage.frame.step, visit.0);
            let changes = bodies != stage.bodies;
            assert!(changes || stage.frame.batches.order.len() < 10, "{what}, {visit:?}: nothing to do");
            let mut first: Option<(Vec<SolverBody>, PlainRows)> = None;
            for (wide_batches, permute) in [(8, 0), (8, 1), (8, 2), (0, 0), (0, 2), (63, 0), (63, 1)] {
                let what = format!("{what}, {visit:?}, {wide_batches} wide, permuted {permute}");
                let alone = &mut Alone::new(permute);
                stage.put(alone, wide_batches);
                alone.run(|chain| stage.sweep(chain, visit, wide_batches));
                let gpu = Stage::take_solver(alone);
                check_solver(&what, &mut floats, (&bodies, &rows), (&gpu.0, &gpu.1), off::SWEEP);
                assert!(gpu.0.iter().map(still).eq(stage.bodies.iter().map(still)), "{what}: bodies");
                // Bit for bit, however the batches are spread over dispatches.
                let first = first.get_or_insert_with(|| gpu.clone());
                let same = first.0 == gpu.0 && first.1.points == gpu.1.points && first.1.impulses == gpu.1.impulses;
                assert!(same, "{what}: not the same bits");
            }
        }
    }
    eprintln!("one sweep\n{floats}");
}

/// As long as a last batch may be, whose end some drivers would cut off if one invocation went through all of it.
#[test]
fn a_long_last_batch_is_visited_to_its_end() {
    let mut floats = Floats::default();
    let mut stage = Stage::new(&scenes::pile(1000), 60);
    stage.advance();
    let (count, length) = (stage.rows.heads.len(), stage.frame.step.last_limit as usize);
    let mut rows = PlainRows::default();
    for c in (0..count).cycle().take(length) {
        rows.heads.push(stage.rows.heads[c]);
        rows.points.extend_from_slice(&stage.rows.points[4 * c..4 * c + 4]);
        rows.impulses.extend_from_slice(&stage.rows.impulses[4 * c..4 * c + 4]);
    }
    stage.rows = rows;
    stage.control.batch_start[..64].fill(0);
    stage.control.batch_start[64] = length as u32;
    for permute in PERMUTATIONS {
        let alone = &mut Alone::new(permute);
        stage.put(alone, 8);
        alone.run(|chain| chain.pass("solver/passes", "relax_tail", 1));
        let gpu = Stage::take_solver(alone);
        let (mut bodies, mut rows) = (stage.bodies.clone(), stage.rows.clone());
        rows.sweep(&mut bodies, &stage.frame.step, Visit::Relax);
        check_solver(&format!("permuted {permute}"), &mut floats, (&bodies, &rows), (&gpu.0, &gpu.1), off::LONG);
    }
    eprintln!("a long last batch\n{floats}");
}

#[test]
fn bodies_are_integrated_alike() {
    let mut floats = Floats::default();
    for (what, mut stage) in Stage::all() {
        stage.advance();
        // Turns of some radians a sub-step, of too many, and of no number at all.
        for (i, body) in stage.bodies.iter_mut().enumerate() {
            match i % 32 {
                3 => body.angular_velocity = [900.0, 1.0, -700.0],
                10 => body.angular_velocity = [3e4, 2e5, 1e3],
                17 => body.angular_velocity = [f32::NAN, 0.0, 1.0],
                24 => body.linear_velocity = [0.0, f32::INFINITY, 0.0],
                _ => {}
            }
        }
        for permute in PERMUTATIONS {
            let what = format!("{what}, permuted {permute}");
            let (cpu, frame) = (&stage.cpu, &stage.frame);
            let alone = &mut Alone::new(permute);
            stage.put(alone, 8);
            let mut bodies = stage.bodies.clone();
            for (i, body) in bodies.iter_mut().enumerate() {
                motion::integrate_velocity(body, &frame.states[i], &cpu.props[i], &frame.step);
            }
            alone.run(|chain| chain.pass("motion", "integrate_velocities", stage.by_body()));
            let gpu: Vec<SolverBody> = alone.take("solver_bodies");
            floats.check(&what, off::VELOCITY, (&bodies, &gpu), |b| b.linear_velocity);
            floats.check(&what, off::VELOCITY, (&bodies, &gpu), |b| b.angular_velocity);
            assert!(gpu.iter().map(still).eq(stage.bodies.iter().map(still)), "{what}");

            alone.put("solver_bodies", &bodies);
            for (i, body) in bodies.iter_mut().enumerate() {
                motion::integrate_position(body, &frame.states[i], &cpu.props[i], &frame.step);
            }
            alone.run(|chain| chain.pass("motion", "integrate_positions", stage.by_body()));
            let gpu: Vec<SolverBody> = alone.take("solver_bodies");
            floats.check(&what, off::WAY, (&bodies, &gpu), |b| b.translation);
            floats.check(&what, off::TURN, (&bodies, &gpu), |b| b.delta);
            floats.check(&what, off::TURNED, (&bodies, &gpu), |b| b.angular_velocity);
        }
    }
    eprintln!("motion\n{floats}");
}

#[test]
fn a_whole_step_of_sweeps_stays_together() {
    let mut floats = Floats::default();
    for (what, stage) in Stage::all() {
        let (mut bodies, mut rows) = (stage.bodies.clone(), stage.rows.clone());
        let moving = Bodies { solver: &mut bodies, states: &stage.frame.states, props: &stage.cpu.props };
        solve_plain(&mut rows, moving, &stage.frame.step, true);
        let mut first: Option<(Vec<SolverBody>, PlainRows)> = None;
        for permute in PERMUTATIONS {
            let what = format!("{what}, permuted {permute}");
            let alone = &mut Alone::new(permute);
            stage.put(alone, 8);
            alone.run(|chain| {
                for _ in 0..stage.frame.step.substeps {
                    chain.pass("motion", "integrate_velocities", stage.by_body());
                    stage.sweep(chain, VISITS[0], 8);
                    stage.sweep(chain, VISITS[1], 8);
                    chain.pass("motion", "integrate_positions", stage.by_body());
                    stage.sweep(chain, VISITS[2], 8);
                }
                stage.sweep(chain, VISITS[3], 8);
                chain.pass("solver/store", "store", stage.by_constraint());
            });
            let gpu = Stage::take_solver(alone);
            check_solver(&what, &mut floats, (&bodies, &rows), (&gpu.0, &gpu.1), off::STEP);
            floats.check(&what, off::STEP_WAY, (&bodies, &gpu.0), |b| b.translation);
            floats.check(&what, off::STEP_TURN, (&bodies, &gpu.0), |b| b.delta);
            // The store copies: exactly what the mirror makes of the same impulses.
            assert!(alone.take::<Impulse>("slot_impulses") == stage.cpu.stored(&stage.frame, &gpu.1), "{what}: store");
            let first = first.get_or_insert_with(|| gpu.clone());
            assert!(first.0 == gpu.0 && first.1.impulses == gpu.1.impulses, "{what}: not the same bits");
        }
    }
    eprintln!("a step\n{floats}");
}

#[test]
fn the_result_becomes_the_state() {
    let mut floats = Floats::default();
    for (what, mut stage) in Stage::all() {
        stage.advance();
        for (i, body) in stage.bodies.iter_mut().enumerate() {
            match i % 64 {
                9 => body.angular_velocity[1] = f32::NAN,
                23 => body.translation[0] = f32::NEG_INFINITY,
                37 => body.delta[3] = f32::NAN,
                51 => body.linear_velocity[2] = 2e9,
                _ => {}
            }
        }
        for permute in PERMUTATIONS {
            let what = format!("{what}, permuted {permute}");
            let alone = &mut Alone::new(permute);
            stage.put(alone, 8);
            let groups = stage.by_body();
            alone.run(|chain| {
                chain.pass("motion", "commit", groups);
                chain.pass("motion", "write_poses", groups);
            });
            let gpu: Vec<BodyState> = alone.take("states");
            let mut counters: Vec<u32> = bytemuck::cast_slice(&[stage.control]).to_vec();
            let mut states = Vec::new();
            for (i, (body, state)) in stage.bodies.iter().zip(&stage.frame.states).enumerate() {
                let (state, bad) = motion::commit(body, state);
                let frozen = state.flags & body_flags::FROZEN != 0 && state.flags & body_flags::KIND != 0;
                counters[FROZEN_COUNT] += u32::from(frozen);
                if bad {
                    let name = &mut counters[QUARANTINED + i % QUARANTINE_NAMES];
                    *name = (*name).max(i as u32 + 1);
                }
                states.push(state);
            }
            assert_eq!(alone.take::<u32>("counters"), counters, "{what}");
            assert_eq!(counters[QUARANTINED..FROZEN_COUNT].iter().any(|name| *name != 0), states.len() > 100, "{what}");
            let plain = |s: &BodyState| BodyState { rotation: [0.0; 4], ..*s };
            assert!(gpu.iter().map(plain).eq(states.iter().map(plain)), "{what}: states");
            floats.check(&what, off::ROTATION, (&states, &gpu), |s| s.rotation);

            let poses: Vec<_> = gpu.iter().zip(&stage.cpu.props).map(|(s, p)| PoseRecord::of(s, p)).collect();
            let gpu: Vec<PoseRecord> = alone.take("poses");
            assert!(gpu.iter().map(|p| p.tag).eq(poses.iter().map(|p| p.tag)), "{what}: tags");
            floats.check(&what, off::POSE, (&poses, &gpu), |p| p.translation);
            floats.check(&what, off::POSE, (&poses, &gpu), |p| p.rotation);
        }
    }
    eprintln!("commit\n{floats}");
}

#[test]
fn a_stopped_step_writes_nothing() {
    let mut stage = Stage::new(&scenes::pile(300), 40);
    stage.control.stop = 1;
    let alone = &mut Alone::new(0);
    stage.put(alone, 8);
    let names = ["counters", "states", "poses", "slot_impulses", "solver_bodies", "heads", "points", "impulses"];
    let take = |alone: &Alone| names.map(|name| alone.take::<u8>(name));
    let before = take(alone);
    let (by_body, by_constraint) = (stage.by_body(), stage.by_constraint());
    alone.run(|chain| {
        for entry in ["integrate_velocities", "integrate_positions", "commit", "write_poses"] {
            chain.pass("motion", entry, by_body);
        }
        chain.pass("solver/prepare", "bodies", by_body);
        chain.pass("solver/prepare", "constraints", by_constraint);
        chain.pass("solver/prepare", "carry", by_constraint);
        for visit in VISITS {
            stage.sweep(chain, visit, 8);
        }
        chain.pass("solver/store", "store", by_constraint);
    });
    for (name, (before, after)) in names.iter().zip(before.iter().zip(&take(alone))) {
        assert!(before == after, "{name}");
    }
}

/// A body whose velocity is no number pushes nothing: what the others do is what they do when nothing of it is pushed.
#[test]
fn a_bad_body_harms_no_other() {
    let mut stage = Stage::new(&scenes::pile(300), 60);
    stage.advance();
    let most = |b: &u32| stage.rows.heads.iter().filter(|h| h.body_a == *b || h.body_b == *b).count();
    let bad = (5..305).max_by_key(most).unwrap();
    let touching = |h: &ConstraintHead| h.body_a == bad || h.body_b == bad;
    assert!(stage.rows.heads.iter().filter(|h| touching(h)).count() > 3);
    for visit in [VISITS[1], VISITS[2]] {
        let alone = &mut Alone::new(0);
        stage.put(alone, 8);
        let mut bodies = stage.bodies.clone();
        bodies[bad as usize].linear_velocity = [f32::NAN; 3];
        alone.put("solver_bodies", &bodies);
        alone.run(|chain| stage.sweep(chain, visit, 8));
        let with_nan: Vec<SolverBody> = alone.take("solver_bodies");
        // The same without its contacts.
        let mut heads = stage.rows.heads.clone();
        let mut points = stage.rows.points.clone();
        for (c, head) in heads.iter_mut().enumerate().filter(|(_, h)| touching(h)) {
            head.friction = 0.0;
            points[4 * c..4 * c + 4].iter_mut().for_each(|p| (p.normal_mass, p.tangent_mass) = (0.0, 0.0));
            (head.impulse_scale, head.mass_scale) = (0.0, 0.0);
        }
        alone.put("solver_bodies", &stage.bodies);
        alone.put("heads", &heads);
        alone.put("points", &points);
        let mut impulses = stage.rows.impulses.clone();
        for (c, _) in heads.iter().enumerate().filter(|(_, h)| touching(h)) {
            impulses[4 * c..4 * c + 4].iter_mut().for_each(|i| (i.normal, i.tangent) = (0.0, [0.0; 2]));
        }
        alone.put("impulses", &impulses);
        alone.run(|chain| stage.sweep(chain, visit, 8));
        let without: Vec<SolverBody> = alone.take("solver_bodies");
        for (i, (with, without)) in with_nan.iter().zip(&without).enumerate().filter(|(i, _)| *i != bad as usize) {
            assert_eq!(with, without, "{visit:?}: body {i}");
        }
    }
}
