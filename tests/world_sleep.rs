//! Islands fall asleep, stay as they are, and wake on each cause. Oracles: analysis (formulas, conserved quantities), the
//! state before, and worlds in which nothing sleeps.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use tumble::prelude::*;
use tumble_core::{BodyHandle, Editor, Sleep, StepReport, measures, scenes};
use tumble_gpu::Pipelines;
use worlds::{SIDES, Side, hash, report, steps};

const SLEEP: Sleep = Sleep { distance: 2e-3, time: 0.5 };

fn asleep_params() -> Params {
    Params { sleep: Some(SLEEP), ..Params::default() }
}

/// A world after as many steps as it takes until so many bodies sleep.
fn settled(side: Side, scene: &Scene, bodies: u32) -> World {
    let mut world = side.world(scene, &asleep_params());
    for _ in 0..60 {
        steps(&mut world, 20);
        if report(&mut world).asleep == bodies {
            return world;
        }
    }
    panic!("{side:?}: {} of {bodies} bodies sleep after 1,200 steps", report(&mut world));
}

/// Bodies asleep, islands awake, islands asleep.
fn counts(report: &StepReport) -> (u32, u32, u32) {
    assert_eq!(report.lost, 0, "{report}");
    (report.asleep, report.islands, report.islands_asleep)
}

fn bodies(scene: &Scene) -> Vec<BodyHandle> {
    scene.bodies().collect()
}

/// Bodies of a scene that can be pushed, in the order of their insertion.
fn dynamic(scene: &Scene) -> Vec<BodyHandle> {
    let moves = |body: &BodyHandle| scene.body(*body).unwrap().body_type == RigidBodyType::Dynamic;
    bodies(scene).into_iter().filter(moves).collect()
}

/// Oracle: the state before. What sleeps does not move by a bit, can be seen, and carries its weight.
#[test]
fn islands_fall_asleep_and_are_still_there() {
    let scene = scenes::many_pyramids(4, 5);
    for side in SIDES {
        let mut world = settled(side, &scene, 60);
        assert_eq!(counts(&report(&mut world)), (60, 0, 4), "{side:?}");
        let (before, at_rest) = (report(&mut world), hash(&mut world));
        assert!(world.velocities().unwrap().iter().all(|v| *v == Velocity { linear: Vec3::ZERO, angular: Vec3::ZERO }));
        let ray = [Ray::new(Vec3::new(-5.0, 0.5, -1.5), Vec3::X)];
        let hit = world.cast_rays(&ray).unwrap();
        let contacts = world.contacts().unwrap();
        steps(&mut world, 20);
        if let World::Gpu(world) = &world {
            assert_eq!(world.dispatches(), 1, "nothing is recorded but the passage of time");
        }
        let after = report(&mut world);
        assert_eq!((hash(&mut world), after.step), (at_rest, before.step + 20), "{side:?}");
        let numbers = |r: &StepReport| (r.pairs, r.manifolds, r.contacts, counts(r));
        assert_eq!(numbers(&after), numbers(&before), "{side:?}");
        assert_eq!(world.cast_rays(&ray).unwrap(), hit, "{side:?}");
        let later = world.contacts().unwrap();
        assert_eq!((later.all.len(), later.step), (contacts.all.len(), after.step), "{side:?}");
        // 60 boxes of 1,000 kg; 5 % for what was not quite steady when they fell asleep.
        let floor = later.all.iter().filter(|c| scene.body(c.body_a).unwrap().body_type == RigidBodyType::Fixed);
        let force: Vec3 = floor.map(|contact| contact.impulse() / later.dt).sum();
        let weight = 60.0 * 1000.0 * 9.81;
        assert!((force.y.abs() / weight - 1.0).abs() < 0.05, "{side:?}: {force} of {weight} N");
    }
}

/// Oracle: what was asked for. Without the parameter, and with a body that must stay awake, nothing sleeps.
#[test]
fn nothing_sleeps_unasked() {
    for side in SIDES {
        let mut world = side.world(&scenes::column(3), &Params::default());
        steps(&mut world, 150);
        assert_eq!(counts(&report(&mut world)), (0, 0, 0), "{side:?}");
        let mut scene = scenes::many_pyramids(2, 2);
        let top = *dynamic(&scene).last().unwrap();
        let builder = scene.body(top).unwrap().clone().can_sleep(false);
        let (_, collider) = scene.colliders_of(top).unwrap()[0];
        let collider = collider.clone();
        scene.remove(top).unwrap();
        scene.insert(builder, collider);
        let mut world = side.world(&scene, &asleep_params());
        steps(&mut world, 150);
        assert_eq!(counts(&report(&mut world)), (3, 1, 1), "{side:?}: the wall with the wakeful box stays awake");
    }
}

/// Oracle: analysis. Two walls sleep; what is done to one wakes it whole, in the same step, and not the other.
#[test]
fn every_edit_wakes_its_island_alone() {
    type Cause = fn(&mut Editor, BodyHandle);
    let causes: [(&str, Cause); 9] = [
        ("wake", |e, b| e.wake(b).unwrap()),
        ("impulse", |e, b| e.apply_impulse(b, Vec3::Y).unwrap()),
        ("impulse at a point", |e, b| e.apply_impulse_at_point(b, Vec3::Y, Vec3::ZERO).unwrap()),
        ("force", |e, b| e.add_force(b, Vec3::Y).unwrap()),
        ("torque", |e, b| e.add_torque(b, Vec3::Y).unwrap()),
        ("velocity", |e, b| e.set_velocity(b, Vec3::Y, Vec3::ZERO).unwrap()),
        ("pose", |e, b| e.set_pose(b, Vec3::new(0.0, 9.0, 9.0).into()).unwrap()),
        ("collider", |e, b| _ = e.attach(b, ColliderBuilder::ball(0.1)).unwrap()),
        ("removal", |e, b| e.remove(b).unwrap()),
    ];
    let scene = scenes::many_pyramids(2, 3);
    let top = dynamic(&scene)[5];
    for side in SIDES {
        let mut world = settled(side, &scene, 12);
        for (name, cause) in &causes {
            cause(world.edit(), top);
            world.step().unwrap();
            let (asleep, awake, islands) = counts(&report(&mut world));
            assert_eq!((asleep, islands), (6, 1), "{side:?}, {name}: the other wall sleeps on");
            assert!(awake > 0, "{side:?}, {name}");
            if *name != "removal" && *name != "pose" {
                steps(&mut world, 300);
                assert_eq!(counts(&report(&mut world)), (12, 0, 2), "{side:?}, {name}: asleep again");
            } else {
                world = settled(side, &scene, 12);
            }
        }
        world.edit().set_gravity(Vec3::NEG_Y).unwrap();
        world.step().unwrap();
        assert_eq!(counts(&report(&mut world)), (0, 2, 0), "{side:?}, gravity");
        let mut world = settled(side, &scene, 12);
        world.set_params(Params::default()).unwrap();
        world.step().unwrap();
        assert_eq!(counts(&report(&mut world)), (0, 0, 0), "{side:?}, without the parameter");
    }
}

/// A box asleep on a fixed one, 5 m up.
fn shelf() -> (Scene, BodyHandle, BodyHandle) {
    let mut scene = Scene::new();
    let at = |y: f32| Vec3::new(0.0, y, 0.0);
    let support = scene.insert(RigidBodyBuilder::fixed().translation(at(5.0)), ColliderBuilder::cuboid(1.0, 0.5, 1.0));
    let item = RigidBodyBuilder::dynamic().translation(at(6.0));
    let item = scene.insert(item, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1000.0));
    (scene, support.body, item.body)
}

/// Oracle: analysis, free fall.
#[test]
fn removal_of_the_support_wakes() {
    for side in SIDES {
        for moved in [false, true] {
            let (scene, support, item) = shelf();
            let mut world = settled(side, &scene, 1);
            let from = world.poses().unwrap()[item].translation.y;
            match moved {
                true => world.edit().set_pose(support, Vec3::new(9.0, 5.0, 0.0).into()).unwrap(),
                false => world.edit().remove(support).unwrap(),
            }
            steps(&mut world, 30);
            let fallen = from - world.poses().unwrap()[item].translation.y;
            assert_eq!(report(&mut world).asleep, 0);
            // g t² / 2 after half a second; to a millimetre, for what was left of the contact.
            assert!((fallen - 0.5 * 9.81 * 0.25).abs() < 1e-3, "{side:?}, moved {moved}: fell {fallen} m");
        }
    }
}

/// Oracle: analysis. A ball hits one of equal mass that sleeps, with restitution 1 and without friction: they exchange
/// their velocities. So the sleeper wakes before the blow is solved, not after.
#[test]
fn a_blow_reaches_the_sleeper() {
    for side in SIDES {
        let mut scene = Scene::new();
        scene.gravity = Vec3::ZERO;
        let ball = ColliderBuilder::ball(0.5).density(1000.0).restitution(1.0).friction(0.0);
        let sleeper = scene.insert(RigidBodyBuilder::dynamic(), ball.clone()).body;
        let flies = RigidBodyBuilder::dynamic().translation(Vec3::X * -7.0).linvel(Vec3::X * 5.0);
        let flyer = scene.insert(flies, ball).body;
        let mut world = side.world(&scene, &asleep_params());
        steps(&mut world, 60);
        assert_eq!(counts(&report(&mut world)), (1, 1, 1), "{side:?}");
        steps(&mut world, 40);
        assert_eq!(counts(&report(&mut world)).0, 0, "{side:?}");
        let velocities = world.velocities().unwrap();
        let (left, right) = (velocities[flyer].linear.x, velocities[sleeper].linear.x);
        // Both sides give 0 and 5 to rounding where nothing sleeps.
        assert!(left.abs() < 1e-3 && (right - 5.0).abs() < 1e-3, "{side:?}: {left} and {right} m/s");
    }
}

/// Oracle: no body lies below the floor or deeper in another than where nothing sleeps, up to half as much again.
#[test]
fn a_pile_of_sleepers_is_hit() {
    let scene = scenes::pile(60);
    for side in SIDES {
        let mut world = settled(side, &scene, 60);
        let mut wakeful = side.world(&scene, &Params::default());
        steps(&mut wakeful, report(&mut world).step as usize);
        let top = world.poses().unwrap().iter().map(|pose| pose.translation.y).fold(0.0, f32::max);
        let ball = || {
            let body = RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, top + 4.0, 0.0)).linvel(Vec3::Y * -8.0);
            (body, ColliderBuilder::ball(0.8).density(2000.0))
        };
        for world in [&mut world, &mut wakeful] {
            let (body, collider) = ball();
            world.edit().insert(body, collider).unwrap();
        }
        steps(&mut world, 10);
        assert_eq!(counts(&report(&mut world)), (60, 1, 1), "{side:?}: still in the air");
        steps(&mut wakeful, 10);
        let mut deepest = [0.0f64; 2];
        for _ in 0..12 {
            for (world, deepest) in [&mut world, &mut wakeful].into_iter().zip(&mut deepest) {
                steps(world, 5);
                let poses = world.poses().unwrap();
                *deepest = deepest.max(measures::penetration(world.scene(), &poses).max_m);
                assert!(dynamic(world.scene()).iter().all(|body| poses[*body].translation.y > 0.0), "{side:?}");
            }
        }
        assert_eq!(report(&mut world).asleep, 0, "{side:?}");
        assert!(deepest[0] < 1.5 * deepest[1], "{side:?}: {deepest:?} m deep");
    }
}

/// Oracle: analysis. What creeps by more than `distance` in `time` is never frozen: it is where its velocity takes it.
#[test]
fn what_creeps_is_not_frozen() {
    let sleep = Some(Sleep { distance: 1e-3, time: 1.5 });
    for side in SIDES {
        let mut scene = Scene::new();
        scene.gravity = Vec3::ZERO;
        let creeps = RigidBodyBuilder::dynamic().linvel(Vec3::X * 1e-3);
        let free = scene.insert(creeps, ColliderBuilder::ball(0.5)).body;
        // A box on a slow plate.
        let plate = RigidBodyBuilder::kinematic_velocity_based().translation(Vec3::Y * 5.0).linvel(Vec3::X * 1e-3);
        scene.insert(plate, ColliderBuilder::cuboid(2.0, 0.5, 2.0));
        let rider = RigidBodyBuilder::dynamic().translation(Vec3::Y * 6.0);
        let rider = scene.insert(rider, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).body;
        let mut world = side.world(&scene, &Params { sleep, ..Params::default() });
        // Its weight, since the scene has none, holds it.
        let count = if side == Side::Cpu { 3600 } else { 600 };
        for _ in 0..count {
            world.edit().add_force(rider, Vec3::Y * -9.81).unwrap();
            world.step().unwrap();
            assert!(side == Side::Gpu || report(&mut world).asleep == 0, "{side:?}");
        }
        let way = 1e-3 * count as f32 / 60.0;
        let poses = world.poses().unwrap();
        assert!((poses[free].translation.x - way).abs() < 1e-5, "{side:?}: {:?}", poses[free]);
        // The plate has to take it along first.
        assert!((poses[rider].translation.x - way).abs() < 1e-3, "{side:?}: {:?}", poses[rider]);
    }
}

/// Oracle: analysis. A kinematic body that comes along pushes a sleeper before it; one that stands lets it sleep.
#[test]
fn what_is_driven_wakes_and_pushes() {
    for side in SIDES {
        let mut scene = scenes::column(1);
        let item = dynamic(&scene)[0];
        let drive = RigidBodyBuilder::kinematic_velocity_based().translation(Vec3::new(-4.0, 0.6, 0.0));
        let drive = scene.insert(drive, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).body;
        let mut world = settled(side, &scene, 1);
        world.edit().set_velocity(drive, Vec3::X * 2.0, Vec3::ZERO).unwrap();
        steps(&mut world, 30);
        assert_eq!(report(&mut world).asleep, 1, "{side:?}: 2 m away");
        steps(&mut world, 120);
        let poses = world.poses().unwrap();
        let gap = poses[item].translation.x - poses[drive].translation.x;
        assert_eq!(report(&mut world).asleep, 0, "{side:?}");
        assert!((0.95..1.1).contains(&gap), "{side:?}: {gap} m apart");
        // Slowly, so that the item does not slide ahead. Then it stands: both may rest, and the sleeper knows when it
        // leaves again.
        world.edit().set_velocity(drive, Vec3::X * 0.02, Vec3::ZERO).unwrap();
        steps(&mut world, 1200);
        assert_eq!(report(&mut world).asleep, 0, "{side:?}: pushed");
        world.edit().set_velocity(drive, Vec3::ZERO, Vec3::ZERO).unwrap();
        steps(&mut world, 120);
        assert_eq!(counts(&report(&mut world)), (1, 0, 1), "{side:?}");
        world.edit().set_velocity(drive, Vec3::X, Vec3::ZERO).unwrap();
        steps(&mut world, 1);
        assert_eq!(report(&mut world).asleep, 0, "{side:?}");
    }
}

/// Oracle: analysis. A box on a plate without friction stays where it is, but the plate glides on below: it must not
/// sleep before that stands.
#[test]
fn nothing_sleeps_on_what_glides() {
    for side in SIDES {
        let mut scene = Scene::new();
        let slick = |collider: ColliderBuilder| collider.friction(0.0);
        let glides = RigidBodyBuilder::kinematic_velocity_based().linvel(Vec3::X * 0.5);
        let plate = scene.insert(glides, slick(ColliderBuilder::cuboid(20.0, 0.5, 5.0))).body;
        let item = RigidBodyBuilder::dynamic().translation(Vec3::Y);
        let item = scene.insert(item, slick(ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1000.0))).body;
        let mut world = side.world(&scene, &asleep_params());
        for _ in 0..120 {
            world.step().unwrap();
            assert_eq!(counts(&report(&mut world)), (0, 1, 0), "{side:?}: not for one step");
        }
        assert!(world.poses().unwrap()[item].translation.x.abs() < 1e-4, "{side:?}");
        world.edit().set_velocity(plate, Vec3::ZERO, Vec3::ZERO).unwrap();
        steps(&mut world, 60);
        assert_eq!(counts(&report(&mut world)), (1, 0, 1), "{side:?}");
    }
}

/// Sleeps, is hit, pushed, robbed of a body and given another, and sleeps again.
fn life(mut world: World) -> u64 {
    let all = dynamic(world.scene());
    steps(&mut world, 150);
    assert!(report(&mut world).islands_asleep > 1, "{}", report(&mut world));
    world.edit().apply_impulse(all[3], Vec3::new(2000.0, 3000.0, 500.0)).unwrap();
    steps(&mut world, 30);
    // Onto a wall that sleeps.
    let ball = RigidBodyBuilder::dynamic().translation(Vec3::new(-3.5, 6.0, 1.5)).linvel(Vec3::Y * -9.0);
    world.edit().insert(ball, ColliderBuilder::ball(0.6).density(3000.0)).unwrap();
    steps(&mut world, 40);
    world.edit().remove(all[14]).unwrap();
    steps(&mut world, 200);
    let report = report(&mut world);
    assert!(report.islands_asleep > 0 && report.lost == 0, "{report}");
    hash(&mut world)
}

/// Oracle: the first run. Threads, orders of invocations, broad phases, and room that grows in
/// mid-step leave the bits as they are.
#[test]
fn the_same_bits_every_time() {
    let scene = scenes::many_pyramids(4, 4);
    for side in SIDES {
        let expected = life(side.world(&scene, &asleep_params()));
        assert_eq!(life(side.world(&scene, &asleep_params())), expected, "{side:?}: run again");
        // Those that keep a tree from step to step must hear of sleepers; the others are here where a step is cheap.
        let rest = [Broadphase::BruteForce, Broadphase::SlicedGrid, Broadphase::SweepAndPrune];
        let rest = if side == Side::Cpu { &rest[..] } else { &[] };
        for broadphase in rest.iter().copied().chain([Broadphase::Lbvh]) {
            let params = Params { broadphase, ..asleep_params() };
            assert_eq!(life(side.world(&scene, &params)), expected, "{side:?}: {broadphase}");
        }
        // 60 pairs and more.
        let capacities = Capacities { pairs: Some(20), ..Capacities::default() };
        let params = Params { capacities, ..asleep_params() };
        assert_eq!(life(side.world(&scene, &params)), expected, "{side:?}: little room");
    }
    let expected = life(Side::Gpu.world(&scene, &asleep_params()));
    for order in [1, 2] {
        let gpu = common::gpu().clone();
        let world = tumble_gpu::World::with_pipelines(gpu, Pipelines::permuted(order), scene.clone(), asleep_params());
        assert_eq!(life(World::Gpu(Box::new(world.unwrap()))), expected, "order {order} of invocations");
    }
    let expected = life(Side::Cpu.world(&scene, &asleep_params()));
    for threads in [1, 3] {
        let params = Params { threads: Some(threads), ..asleep_params() };
        assert_eq!(life(Side::Cpu.world(&scene, &params)), expected, "{threads} threads");
    }
}

/// Oracle: the run that had room from the start. One wall wakes, and the list of pairs is too short.
#[test]
fn a_wake_survives_want_of_room() {
    for side in SIDES {
        let run = |pairs: Option<u32>| {
            let capacities = Capacities { pairs, ..Capacities::default() };
            let mut world = side.world(&scenes::many_pyramids(4, 4), &Params { capacities, ..asleep_params() });
            steps(&mut world, 150);
            let before = report(&mut world);
            assert_eq!(before.asleep, 40, "{side:?}: {before}");
            let all = dynamic(world.scene());
            world.edit().apply_impulse(all[3], Vec3::Y * 4000.0).unwrap();
            // Balls so near each other that they make 22 pairs at once: with those awake fewer than there is room for, with
            // those asleep more.
            for i in 0..8 {
                let at = Vec3::new(-4.0 + 0.2 * i as f32, 5.0 + 0.02 * i as f32, -1.5);
                world.edit().insert(RigidBodyBuilder::dynamic().translation(at), ColliderBuilder::ball(0.4)).unwrap();
            }
            steps(&mut world, 2);
            let first = report(&mut world);
            assert_eq!(first.asleep, 30, "{side:?}: {first}");
            steps(&mut world, 40);
            (report(&mut world).growths_of("pairs"), before.pairs, hash(&mut world))
        };
        let (growths, pairs, expected) = run(None);
        assert_eq!(growths, 0);
        let tight = run(Some(pairs + 8));
        assert_eq!((tight.0 > 0, tight.2), (true, expected), "{side:?}");
    }
}

/// Oracle: the mirror. Both sides put the same to sleep in the end.
#[test]
fn sides_agree_on_who_sleeps() {
    let mut scene = scenes::many_pyramids(3, 4);
    scene.insert(RigidBodyBuilder::dynamic().translation(Vec3::Y * 300.0), ColliderBuilder::ball(0.5));
    let [cpu, gpu] = SIDES.map(|side| {
        let mut world = side.world(&scene, &asleep_params());
        steps(&mut world, 200);
        let report = report(&mut world);
        (counts(&report), report.pairs, report.manifolds, report.contacts)
    });
    assert_eq!(cpu, gpu);
    assert_eq!(cpu.0, (30, 1, 3));
}

/// Oracle: the ranges that the documentation states.
#[test]
fn bad_parameters_are_named() {
    for (sleep, field) in [
        (Sleep { distance: 0.0, ..SLEEP }, "sleep.distance"),
        (Sleep { distance: f32::NAN, ..SLEEP }, "sleep.distance"),
        (Sleep { time: 0.0, ..SLEEP }, "sleep.time"),
        (Sleep { time: f32::INFINITY, ..SLEEP }, "sleep.time"),
    ] {
        let error = Params { sleep: Some(sleep), ..Params::default() }.validate().unwrap_err();
        assert!(error.to_string().contains(field), "{error}");
    }
}
