//! The same scene gives the same bits: run after run, with any number of threads, in any order of the GPU's
//! invocations, and with the solver's constraints one after the other or as many at a time as the processor takes.

mod common;
#[expect(dead_code, reason = "a part of a frame is enough here")]
#[path = "common/frame.rs"]
mod frame;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use common::gpu;
use frame::{Cpu, scene_of};
use tumble::World;
use tumble_core::glam::Vec3;
use tumble_core::layout::SolverBody;
use tumble_core::{
    ColliderBuilder, GaussSeidel, Jacobi, LastBatch, OnePass, Params, Penalty, RigidBodyBuilder, Scene, Soft, Solver,
    measures, scenes,
};
use tumble_cpu::solver::prepare::Contact;
use tumble_cpu::solver::store::Solved;
use tumble_cpu::solver::{Bodies, Rows, solve, solve_plain};
use tumble_gpu::Pipelines;
use worlds::{SIDES, hash, report, steps};

/// Scenes that fall, meet and are not yet at rest, and one whose last batch is solved in sequence.
fn falling() -> Vec<(&'static str, Scene, usize)> {
    vec![
        ("pile", scenes::pile(80), 50),
        ("mixed", scenes::mixed(90), 50),
        ("bouncing balls", bouncing(100), 50),
        ("hub", scenes::hub(150), 10),
    ]
}

/// Balls with restitution, dropped into a pit in a heap.
fn bouncing(bodies: usize) -> Scene {
    let source = scenes::balls(bodies);
    let mut scene = Scene::new();
    for handle in source.bodies() {
        let body = source.body(handle).unwrap().clone().linvel(Vec3::new(0.5, -3.0, 0.2));
        let (_, collider) = source.colliders_of(handle).unwrap()[0];
        scene.insert(body, collider.clone().restitution(0.6));
    }
    scene
}

/// Runs it and says what came of it; whatever is compared must have had something to do.
fn run(mut world: World, count: usize) -> u64 {
    steps(&mut world, count);
    let report = report(&mut world);
    assert_eq!((report.step, report.lost, report.quarantined), (count as u64, 0, 0), "{report}");
    assert!(report.contacts > 100, "{report}");
    hash(&mut world)
}

/// Oracle: the first run.
#[test]
fn three_runs() {
    for side in SIDES {
        for (name, scene, count) in falling() {
            let hashes = [0, 1, 2].map(|_| run(side.world(&scene, &Params::default()), count));
            assert_eq!(hashes, [hashes[0]; 3], "{name} on {side:?}");
        }
    }
}

/// Other small shifts of the same scene give other bits: the hash sees them.
#[test]
fn another_seed_is_another_hash() {
    for side in SIDES {
        let runs = [1, 2].map(|seed| run(side.world(&scenes::pile_seeded(80, seed), &Params::default()), 50));
        assert_ne!(runs[0], runs[1], "{side:?}");
    }
}

/// Oracle: one thread. Enough bodies that every parallel pass has work for several.
#[test]
fn any_number_of_threads() {
    let scenes = falling().into_iter().chain([("large mixed", scenes::mixed(3000), 60)]);
    for (name, scene, count) in scenes {
        let hashes = [1, 2, 3, 7].map(|threads| {
            let params = Params { threads: Some(threads), ..Params::default() };
            let world = worlds::Side::Cpu.world(&scene, &params);
            run(world, count)
        });
        assert_eq!(hashes, [hashes[0]; 4], "{name}");
    }
}

/// Oracle: the order in which the driver takes invocations and workgroups. The scene is in its pit and edited on the
/// way, so that every pass has something to do.
#[test]
fn any_order_of_invocations() {
    for (name, scene, count) in falling() {
        let hashes = [0, 1, 2].map(|permute| {
            let pipelines = Pipelines::permuted(permute);
            let params = Params::default();
            let world = tumble_gpu::World::with_pipelines(gpu().clone(), pipelines, scene.clone(), params);
            let mut world = World::Gpu(Box::new(world.unwrap()));
            steps(&mut world, count / 2);
            let handles: Vec<_> = world.scene().bodies().collect();
            for (i, &body) in handles.iter().enumerate().skip(5).step_by(7) {
                let edit = world.edit();
                match i % 3 {
                    0 => edit.apply_impulse(body, Vec3::new(300.0, 900.0, -200.0)).unwrap(),
                    1 => edit.remove(body).unwrap(),
                    _ => drop(edit.attach(body, ColliderBuilder::ball(0.3).translation(Vec3::Y * 0.4)).unwrap()),
                }
            }
            for i in 0..300 {
                let place = Vec3::new((i % 7) as f32 - 3.0, 12.0 + (i / 49) as f32, (i / 7 % 7) as f32 - 3.0);
                let body = RigidBodyBuilder::dynamic().translation(place).linvel(Vec3::NEG_Y);
                world.edit().insert(body, ColliderBuilder::ball(0.25)).unwrap();
            }
            run_on(world, count)
        });
        assert_eq!(hashes, [hashes[0]; 3], "{name}");
    }
}

/// To step `count`.
fn run_on(mut world: World, count: usize) -> u64 {
    let done = report(&mut world).step as usize;
    steps(&mut world, count - done);
    assert!(report(&mut world).contacts > 100);
    hash(&mut world)
}

/// A solved step's bodies, and the impulses of every point in use.
type Outcome = (Vec<SolverBody>, Vec<Vec<[u32; 3]>>);

fn all_bits(solved: &Solved, points: usize) -> Vec<[u32; 3]> {
    let impulses = solved.impulses[..points].iter().map(|(normal, [x, y])| [*normal, *x, *y]);
    let deviations = solved.deviations[..points].iter().map(|d| [*d, 0.0, 0.0]);
    let memory = deviations.chain([[solved.remembered, 0.0, 0.0], solved.resisted]);
    let rest = solved.totals[..points].iter().copied().chain(memory);
    impulses.chain(rest).map(|three| three.map(f32::to_bits)).collect()
}

/// Constraints that this processor can take at a time: four, and eight with AVX2. Machines differ in that, and must not in
/// their results.
fn widths() -> Vec<usize> {
    let widths: Vec<usize> = [4, 8].into_iter().filter(|&lanes| Rows::with_lanes(lanes).is_some()).collect();
    #[cfg(target_arch = "x86_64")]
    assert_eq!(widths.contains(&8), std::arch::is_x86_feature_detected!("avx2"));
    assert_eq!(widths[0], 4);
    widths
}

/// Oracle: the mirror within the CPU side, constraints one after the other.
#[test]
fn several_at_a_time() {
    let scenes = [
        ("2", scene_of(2), 3),
        ("mixed", scenes::mixed(300), 80),
        ("bouncing balls", bouncing(200), 70),
        ("pile", scenes::pile(150), 90),
        ("hub", scenes::hub(200), 5),
        ("split hub", scenes::hub(200), 5),
        ("pyramid", scenes::pyramid(15), 5),
    ];
    let threads = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let solvers = [
        Solver::OnePass(OnePass::default()),
        Solver::Soft(Soft::default()),
        Solver::GaussSeidel(GaussSeidel::default()),
        Solver::Jacobi(Jacobi::default()),
        Solver::Penalty(Penalty::default()),
    ];
    for ((name, scene, count), solver) in scenes.iter().flat_map(|scene| solvers.map(|solver| (scene, solver))) {
        let last_batch = if *name == "split hub" { LastBatch::MassSplitting } else { LastBatch::Sequence };
        let cpu = Cpu::after_with(Params { solver, last_batch, ..Params::default() }, scene, *count);
        for recolor in [false, true] {
            let frame = cpu.plan(recolor);
            let (start, order) = (&frame.batches.start, &frame.batches.order);
            assert!(!order.is_empty(), "{name} has no contact");
            let plain: Outcome = {
                let mut bodies = cpu.bodies(&frame);
                let mut rows = cpu.rows(&frame, &bodies);
                let moving = Bodies { solver: &mut bodies, states: &frame.states, props: &cpu.props };
                solve_plain(&mut rows, moving, &frame.step, true);
                let count = |c: usize| rows.heads[c].count as usize;
                (bodies, (0..rows.heads.len()).map(|c| all_bits(&rows.solved(c), count(c))).collect())
            };
            for lanes in widths() {
                let mut bodies = cpu.bodies(&frame);
                let mut rows = Rows::with_lanes(lanes).unwrap();
                // It tells by itself which constraints work on parts.
                let contact = |c| Contact { split: false, ..cpu.contact(&frame, c) };
                rows.build(start, &cpu.colliders, &bodies, &frame.states, &frame.step, contact);
                let moving = Bodies { solver: &mut bodies, states: &frame.states, props: &cpu.props };
                threads.install(|| solve(&mut rows, moving, None, &frame.step, true));
                let used = std::sync::Mutex::new(vec![Vec::new(); order.len()]);
                rows.for_each_constraint(|c, solved| {
                    let count = frame.manifolds[order[c] as usize].count as usize;
                    used.lock().unwrap()[c] = all_bits(solved, count);
                });
                for (i, (several, one)) in bodies.iter().zip(&plain.0).enumerate() {
                    assert_eq!(
                        bytemuck::bytes_of(several),
                        bytemuck::bytes_of(one),
                        "{name}, {solver}, {lanes} lanes: body {i}: {several:?} {one:?}"
                    );
                }
                assert_eq!(used.into_inner().unwrap(), plain.1, "{name}, {solver}, {lanes} lanes");
            }
            let last = start[start.len() - 1] - start[start.len() - 2];
            assert_eq!(last > 0, name.ends_with("hub"), "{name}: {last} in the last batch");
        }
    }
}

/// Reading poses and reports in between changes nothing, on either side. Oracle: a run that reads nothing.
#[test]
fn looking_changes_nothing() {
    for side in SIDES {
        let blind = run(side.world(&scenes::mixed(100), &Params::default()), 60);
        let mut world = side.world(&scenes::mixed(100), &Params { profile: true, ..Params::default() });
        for step in 0..60 {
            world.step().unwrap();
            match step % 5 {
                0 => drop(report(&mut world)),
                1 => drop(world.poses().unwrap()),
                2 => drop(world.try_poses().unwrap()),
                3 => drop(measures::kinetic_energy(
                    &scenes::mixed(100),
                    &world.poses().unwrap(),
                    &world.velocities().unwrap(),
                )),
                _ => {}
            }
        }
        assert_eq!(hash(&mut world), blind, "{side:?}");
    }
}
