//! Stage `solver`, each pass alone: the GPU computes what the CPU does, in every order of invocations. Oracle: the
//! mirror (its plain form), which makes the inputs too.
//!
//! Tolerances are shares of the largest number of a field in its element, or of 1.

#[path = "common/alone.rs"]
mod alone;
mod common;
#[path = "common/floats.rs"]
mod floats;
#[expect(dead_code, reason = "a part of a frame is enough here")]
#[path = "common/frame.rs"]
mod frame;
#[path = "common/stage.rs"]
mod stage;

use alone::Alone;
use floats::Floats;
use stage::{PERMUTATIONS, Stage, VisitPasses, solvers, still, used};
use tumble_core::layout::*;
use tumble_core::{LastBatch, Params, Solver, scenes};
use tumble_cpu::solver::{Bodies, PlainRows, Visit, solve_plain};

/// What each field may be off: (name, tolerance), with the largest error that was measured on llvmpipe beside it.
mod off {
    type Field = (&'static str, f32);
    pub(crate) const INERTIA: Field = ("inverse inertia", 1e-6); // 0
    pub(crate) const SEPARATION: Field = ("separation", 2e-6); // 2.4e-7
    pub(crate) const MASSES: Field = ("masses", 2e-6); // 2.1e-7
    pub(crate) const BELT: Field = ("belt", 2e-6); // 1.2e-7
    pub(crate) const APPROACH: Field = ("approach", 5e-6); // 6.9e-7
    // A gap is divided by the sub-step, 480 to the second: its last bit is 3e-5 m/s. Velocities, impulses, approach,
    // angular impulses. 1.3e-4 5.7e-5 3.0e-5 1.1e-4
    pub(crate) const SWEEP: [Field; 4] = [("velocity", 3e-4), ("impulse", 3e-4), ("approach", 1e-4), ("turning", 3e-4)];
    // 9.9e-5 8.2e-3 5.4e-2 8.7e-5; whether a speed counts as approach hangs on an impulse being zero or nearly so.
    pub(crate) const LONG: [Field; 4] = [("velocity", 5e-4), ("impulse", 2e-2), ("approach", 1e-1), ("turning", 2e-2)];
    // Three sub-steps of eight: the last bit decides which contact closes a gap and which one presses, and in a
    // heap of 3,000 bodies some decide otherwise. (Soft, four: 8.2e-5 1.1e-4 8.0e-5.) 3.4e-2 2.8e-2 2.3e-2 5.9e-2
    pub(crate) const STEP: [Field; 4] = [("velocity", 5e-2), ("impulse", 5e-2), ("approach", 5e-2), ("turning", 2e-1)];
    pub(crate) const WEIGHT: Field = ("weight", 1e-5); // 0; of split bodies 4.1e-7
    pub(crate) const STEP_WAY: Field = ("translation", 2e-4); // 6.0e-5
    pub(crate) const STEP_TURN: Field = ("turn", 3e-4); // 8.1e-5
}

fn check_solver(
    what: &str,
    floats: &mut Floats,
    cpu: (&[SolverBody], &PlainRows),
    gpu: (&[SolverBody], &PlainRows),
    [velocity, impulse, approach, turning]: [(&'static str, f32); 4],
) {
    floats.check(what, velocity, (cpu.0, gpu.0), |b| b.linear_velocity);
    floats.check(what, velocity, (cpu.0, gpu.0), |b| b.angular_velocity);
    let fixed = |head: &ConstraintHead| ConstraintHead { remembered: 0.0, resisted: [0.0; 3], ..*head };
    assert!(cpu.1.heads.iter().map(fixed).eq(gpu.1.heads.iter().map(fixed)), "{what}: heads");
    for of in [|b: &SolverBody| b.linear_start, |b: &SolverBody| b.angular_start] {
        floats.check(what, velocity, (cpu.0, gpu.0), of);
    }
    floats.check(what, off::WEIGHT, (cpu.0, gpu.0), |b| [b.weight, b.weighted]);
    let first_mass = |c: usize| cpu.1.points[4 * c].normal_mass.max(1e-3);
    let kept = |side: &PlainRows| -> Vec<f32> {
        side.heads.iter().enumerate().map(|(c, head)| head.remembered / first_mass(c)).collect()
    };
    floats.check(what, impulse, (&kept(cpu.1), &kept(gpu.1)), |x| [*x]);
    // Angular ones as changes of angular velocity.
    let turned = |side: &PlainRows| -> Vec<[f32; 3]> {
        let inertias = |head: &ConstraintHead| [head.twisting_inertia, head.rolling_inertia, head.rolling_inertia];
        let change = |head: &ConstraintHead| {
            let inertias = inertias(head);
            std::array::from_fn(|k| head.resisted[k] / inertias[k].max(1e-3))
        };
        side.heads.iter().map(change).collect()
    };
    floats.check(what, turning, (&turned(cpu.1), &turned(gpu.1)), |x| *x);
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
    let more =
        |points: &[ConstraintPoint]| -> Vec<f32> { points.iter().zip(&mass).map(|(p, m)| p.deviation / m).collect() };
    floats.check(what, impulse, (&more(both.0), &more(both.1)), |x| [*x]);
    let totals = |points: &[ConstraintPoint]| -> Vec<[f32; 3]> {
        points.iter().zip(&mass).map(|(p, m)| p.total.map(|total| total / m)).collect()
    };
    floats.check(what, impulse, (&totals(both.0), &totals(both.1)), |x| *x);
    floats.check(what, approach, both, |p| [p.approach]);
}

#[test]
fn prepare_builds_the_mirrors_rows() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut floats = Floats::default();
    for (what, mut stage) in Stage::all() {
        stage.refresh();
        for (permute, alone) in alones.iter_mut().enumerate() {
            let what = format!("{what}, permuted {permute}");
            stage.put(alone, 8);
            let mark = 0xab;
            for name in ["solver_bodies", "heads", "points", "impulses"] {
                let bytes = alone.take::<u8>(name).len();
                alone.put(name, &vec![mark; bytes]);
            }
            let (by_body, by_constraint) = (stage.by_body(), stage.by_constraint());
            alone.run(|chain| chain.pass("solver/prepare", "bodies", by_body));
            if stage.frame.splits_last() {
                list_parts(&stage, alone, &what);
            }
            alone.run(|chain| {
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

            let told = |head: &ConstraintHead| ConstraintHead {
                rolling_inertia: 0.0,
                twisting_inertia: 0.0,
                surface_velocity: [0.0; 2],
                ..*head
            };
            assert!(stage.rows.heads.iter().map(told).eq(rows.heads.iter().map(told)), "{what}: heads");
            let both = (&stage.rows.heads[..], &rows.heads[..]);
            floats.check(&what, off::MASSES, both, |head| [head.rolling_inertia, head.twisting_inertia]);
            floats.check(&what, off::BELT, both, |head| head.surface_velocity);
            let busy = |head: &&ConstraintHead| head.rolling_inertia > 0.0 && head.resisted != [0.0; 3];
            let belts = stage.rows.heads.iter().filter(|head| head.surface_velocity != [0.0; 2]).count();
            let resisting = stage.rows.heads.iter().filter(busy).count();
            assert!(!what.contains("3000") || (belts > 20 && resisting > 20), "{what}: {belts}, {resisting}");
            let heads = &rows.heads;
            assert!(used(heads, &rows.impulses) == used(heads, &stage.rows.impulses), "{what}: impulses");
            let both = (&used(heads, &stage.rows.points)[..], &used(heads, &rows.points)[..]);
            let exact = |p: &ConstraintPoint| (p.anchor, p.total, p.deviation, p.pad_b);
            assert!(both.0.iter().map(exact).eq(both.1.iter().map(exact)), "{what}: points");
            floats.check(&what, off::SEPARATION, both, |p| [p.adjusted_separation]);
            floats.check(&what, off::MASSES, both, |p| [p.normal_mass, p.tangent_mass]);
            floats.check(&what, off::APPROACH, both, |p| [p.approach]);

            let unused = |head: &ConstraintHead| 4 - head.count as usize;
            let mark = u32::from_ne_bytes([mark; 4]);
            let marked = rows.points.iter().filter(|p| p.pad_b == mark).count();
            assert_eq!(marked, heads.iter().map(unused).sum::<usize>(), "{what}: only points in use are written");
            assert_eq!(rows.impulses.iter().filter(|i| i.feature == mark).count(), marked, "{what}: impulses too");
        }
    }
    eprintln!("prepare\n{floats}");
}

/// Lists the parts of bodies and counts them, with a sort of this side between. Oracle: that sort, of the mirror's rows.
fn list_parts(stage: &Stage, alone: &mut Alone, what: &str) {
    let ends = stage.parts();
    assert!(ends.len() > 800 && ends.iter().any(|end| end.0 == u32::MAX), "{what}: {} ends", ends.len());
    for name in ["part_bodies", "part_ends"] {
        alone.put(name, &vec![0xab_u32; ends.len()]);
    }
    alone.put("part_count", &[0u32]);
    alone.run(|chain| chain.pass("solver/parts", "list", ends.len().div_ceil(512) as u32 + 1));
    assert_eq!(alone.take::<u32>("part_count"), [ends.len() as u32], "{what}");
    let bodies = alone.take::<u32>("part_bodies");
    let mut listed: Vec<_> = bodies.into_iter().zip(alone.take::<u32>("part_ends")).collect();
    assert!(listed.iter().zip(0..).all(|(end, i)| end.1 == i), "{what}: the sort is stable, so order decides");
    listed.sort();
    assert!(listed == ends, "{what}: parts");
    stage.put_parts(alone);
    alone.run(|chain| chain.pass("solver/parts", "count", ends.len().div_ceil(256) as u32 + 1));
}

#[test]
fn each_visit_does_what_the_mirrors_does() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut floats = Floats::default();
    let all = solvers().into_iter().flat_map(|(s, visits)| Stage::all_by(s).map(move |all| (all, visits.clone())));
    for ((what, mut stage), visits) in all {
        stage.frame.step.restitution_threshold = 0.01;
        stage.advance();
        for visit in visits {
            let (mut bodies, mut rows) = (stage.bodies.clone(), stage.rows.clone());
            rows.sweep(&mut bodies, &stage.frame.step, visit.0);
            let changes = bodies != stage.bodies;
            assert!(changes || stage.frame.batches.order.len() < 10, "{what}, {visit:?}: nothing to do");
            let mut first: Option<(Vec<SolverBody>, PlainRows)> = None;
            for (wide_batches, permute) in [(8, 0), (8, 1), (8, 2), (0, 0), (0, 2), (63, 0), (63, 1)] {
                let what = format!("{what}, {visit:?}, {wide_batches} wide, permuted {permute}");
                let alone = &mut alones[permute];
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
    let mut alones = PERMUTATIONS.map(Alone::new);
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
    for (permute, alone) in alones.iter_mut().enumerate() {
        stage.put(alone, 8);
        alone.run(|chain| chain.pass("solver/passes", "one_pass_tail", 1));
        let gpu = Stage::take_solver(alone);
        let (mut bodies, mut rows) = (stage.bodies.clone(), stage.rows.clone());
        rows.sweep(&mut bodies, &stage.frame.step, Visit::Pass);
        check_solver(&format!("permuted {permute}"), &mut floats, (&bodies, &rows), (&gpu.0, &gpu.1), off::LONG);
    }
    eprintln!("a long last batch\n{floats}");
}

/// As long as a last batch may be, by mass splitting: two bodies with more ends than any chunk of a sum, and many others.
#[test]
fn a_long_last_batch_is_split_to_its_end() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut floats = Floats::default();
    let mut stage = splitting(500);
    stage.advance();
    let first = stage.control.batch_start[LAST_BATCH as usize] as usize;
    let (own, length) = (stage.rows.heads.len() - first, stage.frame.step.last_limit as usize);
    let mut rows = PlainRows::default();
    for c in (first..first + own).cycle().take(length) {
        rows.heads.push(stage.rows.heads[c]);
        rows.points.extend_from_slice(&stage.rows.points[4 * c..4 * c + 4]);
        rows.impulses.extend_from_slice(&stage.rows.impulses[4 * c..4 * c + 4]);
    }
    // Every other contact of the plate is made one of some box, so that there are two hubs.
    let (hub, other) = (1, rows.heads.last().unwrap().body_b);
    let on_hub = |head: &&mut ConstraintHead| head.body_a == hub && head.body_b != other;
    rows.heads.iter_mut().filter(on_hub).step_by(2).for_each(|head| head.body_a = other);
    let mut ends = vec![0; stage.bodies.len()];
    for body in rows.heads.iter().flat_map(|head| [head.body_a, head.body_b]) {
        ends[body as usize] += 1;
    }
    assert!(ends[hub as usize] > 16_000 && ends[other as usize] > 16_000, "{hub} and {other}");
    for (body, ends) in stage.bodies.iter_mut().zip(ends) {
        body.parts = if body.inverse_mass > 0.0 { ends } else { 0 };
    }
    rows.split_last(length, &stage.bodies);
    stage.rows = rows;
    stage.control.batch_start[..64].fill(0);
    stage.control.batch_start[64] = length as u32;
    let mut first = None;
    for (permute, alone) in alones.iter_mut().enumerate() {
        stage.put(alone, 8);
        alone.run(|chain| chain.pass("solver/split", "one_pass_split", 1));
        let gpu = Stage::take_solver(alone);
        let (mut bodies, mut rows) = (stage.bodies.clone(), stage.rows.clone());
        rows.sweep(&mut bodies, &stage.frame.step, Visit::Pass);
        assert!(bodies[hub as usize] != stage.bodies[hub as usize], "nothing to do");
        check_solver(&format!("permuted {permute}"), &mut floats, (&bodies, &rows), (&gpu.0, &gpu.1), off::SWEEP);
        let first = first.get_or_insert_with(|| gpu.clone());
        assert!(first.0 == gpu.0 && first.1.impulses == gpu.1.impulses, "permuted {permute}: not the same bits");
    }
    eprintln!("a long last batch, split\n{floats}");
}

/// A hub whose last batch is solved by mass splitting, in mid-motion.
fn splitting(bodies: usize) -> Stage {
    let params = Params { last_batch: LastBatch::MassSplitting, ..Params::default() };
    Stage::with(params, &scenes::hub(bodies), 2)
}

/// What a sweep of another level left is nothing to add up.
#[test]
fn parts_of_other_levels_stay_as_they_are() {
    let mut stage = splitting(200);
    stage.frame.step.level = 1;
    let alone = &mut Alone::new(0);
    stage.put(alone, 8);
    alone.run(|chain| {
        for visit in ["load", "one_pass", "restitution"] {
            chain.pass("solver/split", &format!("{visit}_split"), 1);
        }
    });
    let (bodies, rows) = Stage::take_solver(alone);
    assert!(bodies == stage.bodies && rows.points == stage.rows.points && rows.impulses == stage.rows.impulses);
}

#[test]
fn a_whole_step_of_sweeps_stays_together() {
    let mut alones = PERMUTATIONS.map(Alone::new);
    let mut floats = Floats::default();
    for (what, mut stage) in solvers().into_iter().flat_map(|(solver, _)| Stage::all_by(solver)) {
        stage.frame.step.substeps = 3;
        let (mut bodies, mut rows) = (stage.bodies.clone(), stage.rows.clone());
        let moving = Bodies { solver: &mut bodies, states: &stage.frame.states, props: &stage.cpu.props };
        solve_plain(&mut rows, moving, &stage.frame.step, true);
        let mut first: Option<(Vec<SolverBody>, PlainRows)> = None;
        for (permute, alone) in alones.iter_mut().enumerate() {
            let what = format!("{what}, permuted {permute}");
            stage.put(alone, 8);
            alone.run(|chain| {
                stage.solve(chain);
                chain.pass("solver/store", "store", stage.by_constraint());
            });
            let gpu = Stage::take_solver(alone);
            check_solver(&what, &mut floats, (&bodies, &rows), (&gpu.0, &gpu.1), off::STEP);
            floats.check(&what, off::STEP_WAY, (&bodies, &gpu.0), |b| b.translation);
            floats.check(&what, off::STEP_TURN, (&bodies, &gpu.0), |b| b.delta);
            // The store copies: exactly what the mirror makes of the same impulses.
            assert!(alone.take::<Impulse>("slot_impulses") == stage.cpu.stored(&stage.frame, &gpu.1), "{what}: store");
            assert!(
                alone.take::<ManifoldMemory>("slot_memory") == stage.cpu.remembered(&stage.frame, &gpu.1),
                "{what}"
            );
            let first = first.get_or_insert_with(|| gpu.clone());
            assert!(first.0 == gpu.0 && first.1.impulses == gpu.1.impulses, "{what}: not the same bits");
        }
    }
    eprintln!("a step\n{floats}");
}

#[test]
fn a_stopped_step_writes_nothing() {
    for stage in [Stage::new(&scenes::pile(300), 40), splitting(200)] {
        stopped_step_writes_nothing(stage);
    }
}

fn stopped_step_writes_nothing(mut stage: Stage) {
    stage.control.stop = 1;
    let alone = &mut Alone::new(0);
    stage.put(alone, 8);
    let names =
        ["counters", "states", "poses", "slot_impulses", "slot_memory", "solver_bodies", "heads", "points", "impulses"];
    alone.put("part_count", &[0u32]);
    let take = |alone: &Alone| names.map(|name| alone.take::<u8>(name));
    let before = take(alone);
    let (by_body, by_constraint) = (stage.by_body(), stage.by_constraint());
    alone.run(|chain| {
        let substeps = ["first_substep", "next_substep", "last_substep"];
        let others = ["integrate_velocities", "integrate_positions", "commit", "write_poses"];
        for entry in substeps.into_iter().chain(others) {
            chain.pass("motion", entry, by_body);
        }
        chain.pass("solver/prepare", "bodies", by_body);
        if stage.frame.splits_last() {
            chain.pass("solver/parts", "list", by_constraint);
            chain.pass("solver/parts", "count", 2 * by_constraint);
        }
        chain.pass("solver/prepare", "constraints", by_constraint);
        chain.pass("solver/prepare", "carry", by_constraint);
        for entry in ["begin", "settle"] {
            chain.pass("solver/classic", entry, by_body);
        }
        // (Not by all of them can the last batch be split.)
        let all = if stage.frame.splits_last() { 3 } else { solvers().len() };
        for visit in solvers().into_iter().take(all).flat_map(|(_, visits)| visits) {
            stage.sweep(chain, visit, 8);
        }
        chain.pass("solver/store", "store", by_constraint);
    });
    for (name, (before, after)) in names.iter().zip(before.iter().zip(&take(alone))) {
        assert!(before == after, "{name}");
    }
}

/// Visits that apply or weigh what earlier steps found: nothing of a bad body gets there.
const BEFORE_PUSHES: [Visit; 3] = [Visit::WarmStart, Visit::Load, Visit::Split];

/// A body whose velocity is no number pushes nothing: what the others do is what they do when nothing of it is pushed.
#[test]
fn a_bad_body_harms_no_other() {
    for (solver, visits) in solvers() {
        bad_body_harms_no_other(solver, &visits);
    }
}

fn bad_body_harms_no_other(solver: Solver, visits: &[VisitPasses]) {
    let mut stage = Stage::by(solver, &scenes::pile(300), 60);
    stage.advance();
    let most = |b: &u32| stage.rows.heads.iter().filter(|h| h.body_a == *b || h.body_b == *b).count();
    let bad = (5..305).max_by_key(most).unwrap();
    let touching = |h: &ConstraintHead| h.body_a == bad || h.body_b == bad;
    assert!(stage.rows.heads.iter().filter(|h| touching(h)).count() > 3);
    // The same with contacts that push nothing where the bad body is.
    let mut mute = stage.rows.clone();
    for (c, head) in mute.heads.iter_mut().enumerate().filter(|(_, head)| touching(head)) {
        (head.friction, head.mass_scale, head.impulse_scale) = (0.0, 0.0, 0.0);
        (head.rolling_inertia, head.twisting_inertia, head.resisted) = (0.0, 0.0, [0.0; 3]);
        mute.points[4 * c..][..4].iter_mut().for_each(|p| (p.normal_mass, p.tangent_mass) = (0.0, 0.0));
        mute.impulses[4 * c..][..4].iter_mut().for_each(|i| (i.normal, i.tangent) = (0.0, [0.0; 2]));
    }
    let mut ill = stage.bodies.clone();
    ill[bad as usize].linear_velocity = [f32::NAN; 3];
    ill[bad as usize].angular_velocity = [f32::NAN; 3];
    let alone = &mut Alone::new(0);
    stage.put(alone, 8);
    for &visit in visits.iter().filter(|visit| !BEFORE_PUSHES.contains(&visit.0)) {
        let mut sweep = |bodies: &[SolverBody], rows: &PlainRows| {
            alone.put("solver_bodies", bodies);
            alone.put("heads", &rows.heads);
            alone.put("points", &rows.points);
            alone.put("impulses", &rows.impulses);
            alone.run(|chain| stage.sweep(chain, visit, 8));
            let mut bodies = bodies.to_vec();
            rows.clone().sweep(&mut bodies, &stage.frame.step, visit.0);
            [bodies, alone.take("solver_bodies")]
        };
        let (with, without) = (sweep(&ill, &stage.rows), sweep(&stage.bodies, &mute));
        for (side, (with, without)) in ["CPU", "GPU"].iter().zip(with.iter().zip(&without)) {
            for (i, (with, without)) in with.iter().zip(without).enumerate().filter(|(i, _)| *i != bad as usize) {
                assert_eq!(with, without, "{solver}, {side}, {visit:?}: body {i}");
            }
        }
    }
}
