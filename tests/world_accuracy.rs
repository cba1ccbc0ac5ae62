//! Accuracy on demand, whole worlds: sub-steps go where they are needed, never above the cap, and the report says so.

mod common;
#[path = "common/worlds.rs"]
#[expect(dead_code, reason = "this program uses a part")]
mod worlds;

use tumble_core::glam::{Quat, Vec3};
use tumble_core::{Accuracy, ColliderBuilder, Params, RigidBodyBuilder, Scene, Spent, measures, scenes};
use worlds::{SIDES, Side, hash, report, steps};

fn params(penetration: f32, most: u32) -> Params {
    Params { accuracy: Accuracy::Tolerance { penetration, joint: 1e-4, most }, ..Params::default() }
}

/// Far from each other: a box under one of 1,000 times its mass, and boxes that lie on the ground by themselves.
fn heavy_and_light(light: usize) -> Scene {
    let (mut scene, ..) = scenes::mass_ratio(1000.0);
    for i in 0..light {
        let place = Vec3::new(20.0 + 2.0 * i as f32, 0.5, 0.0);
        let body = RigidBodyBuilder::dynamic().translation(place);
        scene.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).friction(0.6));
    }
    scene
}

fn spent(world: &mut tumble::World) -> Spent {
    report(world).accuracy.expect("the world has a tolerance")
}

/// Oracle: the same scene with the same sub-steps for all (rest is rest), and the counts of its islands.
#[test]
fn sub_steps_go_to_the_island_that_needs_them() {
    const LIGHT: usize = 30;
    let scene = heavy_and_light(LIGHT);
    for side in SIDES {
        let mut world = side.world(&scene, &params(1e-4, 32));
        steps(&mut world, 90);
        let Spent { substeps, visits, residual_m, .. } = spent(&mut world);
        println!("{side:?}: after 90 steps {substeps} sub-steps at most, {visits} visits, {residual_m} m");
        // New worlds begin with all; after 3 x 16 calm steps and those of the reports the light ones have the fewest, 4.
        assert_eq!(substeps, 32, "{side:?}: the heavy island takes all there is");
        assert_eq!(visits, 4 * LIGHT as u32 + 2 * 32, "{side:?}: and nobody else");
        steps(&mut world, 510);
        let Spent { residual_m, bodies_over, .. } = spent(&mut world);
        println!("{side:?}: after 600 steps {residual_m} m left");
        assert!(residual_m <= 1e-4 && bodies_over == 0, "{side:?}: {residual_m} m are left");
        // With 8 sub-steps for all the heavy one sinks by 15 mm (`docs/solver.md`).
        let deepest = measures::penetration(&scene, &world.poses().unwrap()).max_m;
        assert!(deepest <= 1.1e-4, "{side:?}: {deepest} m by poses");
    }
}

/// Oracle: the cap as told.
#[test]
fn the_cap_is_kept_and_what_is_left_is_told() {
    let (scene, ..) = scenes::mass_ratio(1000.0);
    for side in SIDES {
        let mut world = side.world(&scene, &params(1e-6, 8));
        for step in 0..30 {
            steps(&mut world, 1);
            let spent = spent(&mut world);
            assert!(spent.substeps <= 8 && spent.visits <= 2 * 8, "{side:?}, step {step}: {spent:?}");
        }
        let report = report(&mut world);
        let spent = report.accuracy.unwrap();
        assert!(spent.residual_m > 1e-6 && spent.bodies_over == 2, "{side:?}: {spent:?}");
        assert!(report.to_string().contains("2 bodies over the tolerance"), "{report}");
    }
}

/// A body that the user moves, and stacks with levels of their own on it and beside it, goes its whole way once. Oracle:
/// its velocity times the time.
#[test]
fn what_nothing_moves_goes_its_way_once() {
    let mut scene = heavy_and_light(3);
    let carrier = RigidBodyBuilder::kinematic_velocity_based()
        .translation(Vec3::new(0.0, 10.0, 0.0))
        .linvel(Vec3::new(0.25, 0.0, 0.5))
        .angvel(Vec3::new(0.0, 0.3, 0.0));
    let carrier = scene.insert(carrier, ColliderBuilder::cuboid(4.0, 0.1, 4.0)).body;
    let load = RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, 10.6, 0.0));
    let load = scene.insert(load, ColliderBuilder::cuboid(0.5, 0.5, 0.5).friction(1.0)).body;
    for side in SIDES {
        let mut world = side.world(&scene, &params(1e-4, 32));
        steps(&mut world, 120);
        let poses = world.poses().unwrap();
        // Measured: 4.8e-7 m and 3e-7 rad.
        let off = (poses[carrier].translation - Vec3::new(0.5, 10.0, 1.0)).length();
        let turned = poses[carrier].rotation.angle_between(Quat::from_rotation_y(0.6));
        assert!(off <= 2e-5 && turned <= 1e-3, "{side:?}: {off} m, {turned} rad off");
        let carried = poses[load].translation - poses[carrier].translation;
        assert!(carried.length() < 0.7, "{side:?}: the load rides along, {carried}");
    }
}

/// Oracles: the same world with another number of threads (bits), and the mirror (what is spent in each step, exactly).
#[test]
fn both_sides_spend_alike() {
    let scene = heavy_and_light(6);
    let mut worlds = SIDES.map(|side| side.world(&scene, &params(1e-3, 32)));
    let mut alone = Side::Cpu.world(&scene, &Params { threads: Some(1), ..params(1e-3, 32) });
    let mut visits = std::collections::BTreeSet::new();
    for step in 0..200 {
        let [cpu, gpu] = worlds.each_mut().map(|world| {
            world.step().unwrap();
            spent(world)
        });
        alone.step().unwrap();
        visits.insert(cpu.visits);
        assert_eq!((cpu.substeps, cpu.visits), (gpu.substeps, gpu.visits), "step {step}");
        // Measured: 2e-6 m at most.
        assert!((cpu.residual_m - gpu.residual_m).abs() <= 2e-5, "step {step}: {cpu:?}, {gpu:?}");
    }
    println!("visits a step: {visits:?}");
    // All at 32 sub-steps at first, then the light ones at 16, 8 and 4.
    assert!(visits.len() >= 4, "levels change in this scene: {visits:?}");
    assert_eq!(hash(&mut worlds[0]), hash(&mut alone));
}

/// Oracle: what was told; a tenth of a millimetre is no f32.
#[test]
fn tolerances_are_shown_as_told() {
    let shown = |penetration| params(penetration, 16).accuracy.to_string();
    assert_eq!(shown(1e-4), "0.1 mm, joints 0.1 mm, 16 sub-steps at most");
    assert_eq!(shown(1e-6), "0.001 mm, joints 0.1 mm, 16 sub-steps at most");
    assert_eq!([1, 8].map(|n| Accuracy::Substeps(n).to_string()), ["1 sub-step", "8 sub-steps"]);
}

/// From a tolerance to a number of sub-steps and back, in mid-run. Oracle: the scene stays as it is (at rest), the report
/// follows.
#[test]
fn accuracy_may_change_between_steps() {
    let scene = scenes::column(10);
    for side in SIDES {
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 60);
        assert!(report(&mut world).accuracy.is_none());
        for accuracy in
            [params(1e-3, 32).accuracy, Accuracy::Substeps(3), params(1e-3, 8).accuracy, Accuracy::Substeps(8)]
        {
            world.set_params(Params { accuracy, ..Params::default() }).unwrap();
            steps(&mut world, 60);
            assert_eq!(report(&mut world).accuracy.is_some(), accuracy.is_by_island(), "{side:?}, {accuracy}");
        }
        let poses = world.poses().unwrap();
        let sink = scene.bodies().map(|b| scene.body(b).unwrap().translation.y - poses[b].translation.y);
        let sink = sink.fold(0.0, f32::max);
        println!("{side:?}: sink {sink} m after 4 changes");
        assert!(sink < 1e-3, "{side:?}: {sink} m");
    }
}
