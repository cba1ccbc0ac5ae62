//! Islands that get more sub-steps because a body asks for them, on both sides.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use tumble::World;
use tumble_core::glam::Vec3;
use tumble_core::{
    Accuracy, BodyHandle, ColliderBuilder, Error, Params, Plan, Pose, RigidBodyBuilder, Scene, Velocity, scenes,
};
use worlds::{SIDES, hash, report, steps};

fn with(substeps: u32) -> Params {
    Params { accuracy: Accuracy::Substeps(substeps), ..Params::default() }
}

/// Far from each other: columns of boxes, and behind them a column whose body `asker` asks for `factor`.
fn columns(asker: usize, factor: u32) -> (Scene, Vec<BodyHandle>, Vec<BodyHandle>) {
    let mut scene = Scene::new();
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    let mut column = |x: f32, factors: [u32; 5]| {
        let boxes = factors.into_iter().enumerate().map(|(i, factor)| {
            let body = RigidBodyBuilder::dynamic().translation(Vec3::new(x, 0.5 + i as f32, 0.0));
            let shape = ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(if i == 4 { 20.0 } else { 1.0 });
            scene.insert(body.substep_factor(factor), shape).body
        });
        boxes.collect::<Vec<_>>()
    };
    let others = [0.0, 4.0, 8.0].map(|x| column(x, [1; 5])).concat();
    let mut factors = [1; 5];
    factors[asker] = factor;
    let asks = column(12.0, factors);
    (scene, others, asks)
}

/// The bits of these bodies' poses and velocities, as numbers that may be compared.
fn bits(world: &mut World, bodies: &[BodyHandle]) -> Vec<[u32; 13]> {
    let (poses, velocities) = (world.poses().unwrap(), world.velocities().unwrap());
    let of = |body: &BodyHandle| {
        let (Pose { translation: p, rotation: q }, Velocity { linear: v, angular: w }) =
            (poses[*body], velocities[*body]);
        [p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z, w.x, w.y, w.z].map(f32::to_bits)
    };
    bodies.iter().map(of).collect()
}

/// Oracles: a world with that many sub-steps for all has the bits of the island that asks, one in which nobody asks those
/// of the others. Whichever body asks.
#[test]
fn who_asks_gets_more_and_others_the_same() {
    for side in SIDES {
        for (asker, factor) in [(0, 2), (4, 4), (2, 8)] {
            let (scene, others, asks) = columns(asker, factor);
            let mut world = side.world(&scene, &with(8));
            let mut usual = side.world(&columns(asker, 1).0, &with(8));
            let mut finer = side.world(&columns(asker, 1).0, &with(8 * factor));
            for round in 0..4 {
                [&mut world, &mut usual, &mut finer].into_iter().for_each(|world| steps(world, 15));
                let what = format!("{side:?}, factor {factor}, round {round}");
                assert_eq!(bits(&mut world, &others), bits(&mut usual, &others), "{what}: others");
                assert_eq!(bits(&mut world, &asks), bits(&mut finer, &asks), "{what}: who asks");
                assert_ne!(bits(&mut world, &asks), bits(&mut usual, &asks), "{what}: it is another number");
            }
            assert!(report(&mut world).accuracy.is_none(), "no tolerance, nothing was measured");
        }
    }
}

/// A box that comes under 1,000 times its mass sinks by 50 mm with 8 sub-steps, and by 1.1 mm with the 32 that the heavy one
/// asks for; so does one that comes in later. Oracle: that error falls with sub-steps.
#[test]
fn what_asks_does_not_sink() {
    let heavy = |scene: &mut Scene, x: f32, factor: u32| {
        let under = RigidBodyBuilder::dynamic().translation(Vec3::new(x, 0.5, 0.0));
        let under = scene.insert(under, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(1.0).friction(0.6)).body;
        let load = RigidBodyBuilder::dynamic().translation(Vec3::new(x, 1.5, 0.0)).substep_factor(factor);
        scene.insert(load, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(1000.0).friction(0.6));
        under
    };
    for side in SIDES {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y).friction(0.6));
        let [asks, usual] = [(0.0, 4), (5.0, 1)].map(|(x, factor)| heavy(&mut scene, x, factor));
        let mut world = side.world(&scene, &with(8));
        steps(&mut world, 120);
        let sink = |world: &mut World, body: BodyHandle| 0.5 - world.poses().unwrap()[body].translation.y;
        let (fine, coarse) = (sink(&mut world, asks), sink(&mut world, usual));
        println!("{side:?}: {fine} m, without {coarse} m");
        assert!(fine < 3e-3 && coarse > 2e-2, "{side:?}: {fine} m, without {coarse} m");
        // Nobody asks at first.
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y).friction(0.6));
        let usual = heavy(&mut scene, 0.0, 1);
        let mut world = side.world(&scene, &with(8));
        steps(&mut world, 30);
        let late = RigidBodyBuilder::dynamic().translation(Vec3::new(5.0, 0.5, 0.0));
        let late =
            world.edit().insert(late, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(1.0).friction(0.6)).unwrap().body;
        let load = RigidBodyBuilder::dynamic().translation(Vec3::new(5.0, 1.5, 0.0)).substep_factor(4);
        world.edit().insert(load, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(1000.0).friction(0.6)).unwrap();
        steps(&mut world, 120);
        let (fine, coarse) = (sink(&mut world, late), sink(&mut world, usual));
        println!("{side:?}, later: {fine} m, without {coarse} m");
        assert!(fine < 3e-3 && coarse > 2e-2, "{side:?}, later: {fine} m, without {coarse} m");
    }
}

/// With a tolerance what is asked for is the least that an island gets. Oracle: the count of visits.
#[test]
fn a_tolerance_has_a_minimum() {
    let scene = |factor: u32| {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        for i in 0..6 {
            let body = RigidBodyBuilder::dynamic().translation(Vec3::new(2.0 * i as f32, 0.5, 0.0));
            let body = body.substep_factor(if i == 3 { factor } else { 1 });
            scene.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        }
        scene
    };
    let accuracy = Accuracy::Tolerance { penetration: 1e-3, joint: 1e-3, most: 32 };
    for side in SIDES {
        for factor in [1, 2, 4, 8] {
            let mut world = side.world(&scene(factor), &Params { accuracy, ..Params::default() });
            steps(&mut world, 90);
            let spent = report(&mut world).accuracy.unwrap();
            // At rest the others take the fewest, an eighth of 32.
            assert_eq!((spent.visits, spent.substeps), (4 * 5 + 4 * factor, 4 * factor), "{side:?}, factor {factor}");
        }
    }
}

/// Oracle: the rule that the plan has what bodies ask for, and the mirror's count.
#[test]
fn only_levels_that_are_asked_for_run() {
    assert_eq!(Plan::of(&columns(0, 1).0).asked_levels, 0);
    assert!(!Plan::of(&columns(0, 1).0).islands(), "who does not ask pays for no islands");
    let plan = Plan::of(&columns(0, 4).0);
    assert!(plan.asked_levels == 0b100 && plan.levels && plan.islands());
    // What is fixed or kinematic has no island.
    let mut scene = scenes::column(2);
    scene.insert(RigidBodyBuilder::fixed().substep_factor(8), ColliderBuilder::ball(0.5));
    scene.insert(RigidBodyBuilder::kinematic_velocity_based().substep_factor(8), ColliderBuilder::ball(0.5));
    assert_eq!(Plan::of(&scene).asked_levels, 0);
}

/// Oracle: what is allowed.
#[test]
fn other_factors_are_refused() {
    for factor in [0, 3, 5, 6, 12, 16, u32::MAX] {
        let body = RigidBodyBuilder::dynamic().substep_factor(factor);
        let error = Scene::new().try_insert(body, ColliderBuilder::ball(0.5)).unwrap_err();
        assert!(matches!(error, Error::Invalid { field: "substep_factor", .. }), "{error}");
        assert!(error.to_string().contains("1, 2, 4 or 8"), "{error}");
    }
}

/// Oracle: the same world with another number of threads, to the bit.
#[test]
fn threads_do_not_matter() {
    let (scene, ..) = columns(1, 8);
    let hashes = [1, 2].map(|threads| {
        let mut world = SIDES[0].world(&scene, &Params { threads: Some(threads), ..with(4) });
        steps(&mut world, 40);
        hash(&mut world)
    });
    assert_eq!(hashes[0], hashes[1]);
}
