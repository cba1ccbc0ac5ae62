//! Buffers that are too small: they grow and the bits stay, or the world says so and keeps its last good state.

mod common;
#[path = "common/worlds.rs"]
mod worlds;

use tumble::World;
use tumble_core::glam::{Quat, Vec3};
use tumble_core::{
    BodyHandle, Capacities, ColliderBuilder, Error, Params, Pose, RigidBodyBuilder, Scene, limits, scenes,
};
use worlds::{SIDES, Side, drop_pair, hash, report, steps};

const STEPS: usize = 26;
/// The scene's first bodies have landed by then.
const LATE: usize = 18;

const BUFFERS: [&str; 4] = ["pairs", "bodies", "colliders", "edits"];

/// Room for all that the play needs, and no more than that.
const AMPLE: Capacities = Capacities {
    pairs: Some(4000),
    bodies: Some(400),
    colliders: Some(400),
    edits: Some(2000),
    grow: false,
    ..GROWING
};
const GROWING: Capacities =
    Capacities { pairs: None, bodies: None, colliders: None, edits: None, grow: true, max_array_bytes: 2 << 30 };

fn params(capacities: Capacities) -> Params {
    Params { capacities, ..Params::default() }
}

/// Ample, but for one buffer.
fn tight(buffer: &str, room: u32, grow: bool) -> Capacities {
    let mut capacities = Capacities { grow, ..AMPLE };
    *match buffer {
        "pairs" => &mut capacities.pairs,
        "bodies" => &mut capacities.bodies,
        "colliders" => &mut capacities.colliders,
        _ => &mut capacities.edits,
    } = Some(room);
    capacities
}

/// A scene and what is done to it before each step. Every step has impulses; at step `rush` much comes at once.
struct Play {
    scene: Scene,
    rush: usize,
}

impl Play {
    /// The rush at the first step, or when three steps are in flight and bodies lie on each other.
    fn all() -> [Self; 2] {
        [1, LATE].map(|rush| Self { scene: scenes::mixed(60), rush })
    }

    fn edit(&self, world: &mut World, step: usize) {
        let bodies: Vec<BodyHandle> = world.scene().bodies().collect();
        let movable = |i: usize| bodies[5 + i % (bodies.len() - 5)];
        // A step that is run again is as long as it was, and falls as it did.
        let dt = if step.is_multiple_of(3) { 0.01 } else { 1.0 / 60.0 };
        world.set_params(Params { dt, ..*world.params() }).unwrap();
        let edit = world.edit();
        edit.set_gravity(Vec3::new((step % 4) as f32, -9.81, 0.0)).unwrap();
        for i in 0..4 {
            let body = movable(7 * step + 13 * i);
            edit.apply_impulse(body, Vec3::new(20.0 * i as f32, 90.0, -30.0)).unwrap();
            edit.add_force_at_point(body, Vec3::new(0.0, 400.0, 100.0), Vec3::new(0.1, 1.0, 0.2)).unwrap();
        }
        if step == self.rush + 1 || step == self.rush + 2 {
            // In flight behind the rush: if that stops, nothing of this may have been done when it is run again.
            for i in 0..6 {
                let brick = ColliderBuilder::cuboid(0.2, 0.3, 0.1).density(5000.0).translation(Vec3::X * 0.5);
                edit.attach(movable(9 * i), brick).unwrap();
            }
            edit.remove(movable(11)).unwrap();
            let body = RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, 14.0, 0.0));
            edit.insert(body, ColliderBuilder::cuboid(0.4, 0.4, 0.4)).unwrap();
        }
        if step != self.rush {
            return;
        }
        // A crowd at one place: pairs, bodies and colliders at once.
        for i in 0..30 {
            let place = Vec3::new(0.2 * (i % 3) as f32, 4.0 + 0.1 * i as f32, 0.1 * (i % 5) as f32);
            let body = RigidBodyBuilder::dynamic().translation(place).angvel(Vec3::X);
            let shape = if i % 2 == 0 { ColliderBuilder::ball(0.3) } else { ColliderBuilder::cuboid(0.3, 0.2, 0.4) };
            let new = edit.insert(body, shape.density(1000.0)).unwrap();
            edit.attach(new.body, ColliderBuilder::ball(0.2).density(1000.0).translation(Vec3::X * 0.3)).unwrap();
            edit.apply_impulse(new.body, Vec3::new(0.0, -50.0, 0.0)).unwrap();
        }
        // What was there moves before it changes, and after: a step that is run again must find what it would have
        // found.
        for i in 0..6 {
            let body = movable(9 * i);
            let turn = Quat::from_rotation_y(0.3 * i as f32);
            edit.set_pose(body, Pose { translation: Vec3::new(i as f32 - 3.0, 9.0, 0.5), rotation: turn }).unwrap();
            edit.apply_impulse_at_point(body, Vec3::new(100.0, 0.0, 0.0), Vec3::new(0.0, 9.3, 0.5)).unwrap();
            edit.attach(body, ColliderBuilder::cuboid(0.3, 0.1, 0.2).density(2000.0).translation(Vec3::Y * 0.4))
                .unwrap();
            edit.apply_torque_impulse(body, Vec3::new(0.0, 30.0, 10.0)).unwrap();
        }
        edit.remove(movable(4)).unwrap();
        for i in 0..80 {
            edit.apply_torque_impulse(movable(50 + i % 7), Vec3::new(0.1, 0.2 * i as f32, 0.0)).unwrap();
        }
    }

    /// Plays all steps. `on_error` is told of every error, and must have seen to it that the next call can go on.
    fn run(&self, world: &mut World, mut on_error: impl FnMut(&mut World, Error)) -> u64 {
        for step in 1..=STEPS {
            self.edit(world, step);
            while let Err(error) = world.step() {
                on_error(world, error);
            }
        }
        while let Err(error) = world.sync() {
            on_error(world, error);
        }
        assert_eq!(report(world).step, STEPS as u64);
        hash(world)
    }

    /// The hash after each step from 0 on, and the pairs in it, with ample room.
    fn ample(&self, side: Side) -> (Vec<u64>, Vec<u32>) {
        let mut world = side.world(&self.scene, &params(AMPLE));
        let (mut hashes, mut pairs) = (vec![hash(&mut world)], vec![0]);
        for step in 1..=STEPS {
            self.edit(&mut world, step);
            world.step().unwrap();
            let report = report(&mut world);
            assert_eq!((report.growths.len(), report.lost), (0, 0), "{report}");
            pairs.push(report.pairs);
            hashes.push(hash(&mut world));
        }
        (hashes, pairs)
    }

    /// Room that is enough before the rush and too little after: that of the scene, or half of what the rush needs.
    fn too_little(&self, buffer: &str, pairs: &[u32]) -> u32 {
        match buffer {
            "pairs" => {
                let (before, after) = (pairs[..self.rush].iter().max().unwrap(), pairs[self.rush]);
                assert!(after > before + 50, "{before} and {after}");
                before + 25
            }
            "edits" => 40,
            _ => 1,
        }
    }
}

/// Oracle: the same with ample room, each step waited for.
#[test]
fn growth_leaves_the_bits() {
    for (side, play) in SIDES.into_iter().flat_map(|side| Play::all().map(|play| (side, play))) {
        let (hashes, pairs) = play.ample(side);
        for buffer in BUFFERS {
            let room = play.too_little(buffer, &pairs);
            let mut world = side.world(&play.scene, &params(tight(buffer, room, true)));
            let hash = play.run(&mut world, |_, error| panic!("{error}"));
            let report = report(&mut world);
            let what = format!("{buffer} at step {} on {side:?}: {report}", play.rush);
            assert_eq!(hash, hashes[STEPS], "{what}");
            assert!(report.growths_of(buffer) > 0 && report.growths.len() == 1, "{what}");
            assert_eq!(report.lost, 0, "{what}");
        }
    }
}

/// All of them at once, from nothing. Oracle: the same with ample room.
#[test]
fn all_grow_at_once() {
    for (side, play) in SIDES.into_iter().flat_map(|side| Play::all().map(|play| (side, play))) {
        let (hashes, _) = play.ample(side);
        let least = Capacities { pairs: Some(1), bodies: Some(1), colliders: Some(1), edits: Some(1), ..GROWING };
        let mut world = side.world(&play.scene, &params(least));
        let hash = play.run(&mut world, |_, error| panic!("{error}"));
        let report = report(&mut world);
        assert_eq!(hash, hashes[STEPS], "{side:?}: {report}");
        assert!(BUFFERS.iter().all(|buffer| report.growths_of(buffer) > 0), "{report}");
    }
}

/// Both sides count alike. Oracle: the mirror.
#[test]
fn both_sides_grow_alike() {
    for play in Play::all() {
        let least = Capacities { pairs: Some(30), ..GROWING };
        let [cpu, gpu] = SIDES.map(|side| {
            let mut world = side.world(&play.scene, &params(least));
            play.run(&mut world, |_, error| panic!("{error}"));
            let mut growths = report(&mut world).growths;
            growths.sort();
            growths
        });
        assert_eq!(cpu, gpu);
    }
}

/// Oracle: the same with ample room, step by step.
#[test]
fn without_growth_the_last_good_state_stays() {
    for (side, play) in SIDES.into_iter().flat_map(|side| Play::all().map(|play| (side, play))) {
        let (hashes, pairs) = play.ample(side);
        for buffer in BUFFERS {
            let what = format!("{buffer} at step {} on {side:?}", play.rush);
            let room = play.too_little(buffer, &pairs);
            let mut world = side.world(&play.scene, &params(tight(buffer, room, false)));
            let mut errors = 0;
            let hash = play.run(&mut world, |world, error| {
                errors += 1;
                let Error::Capacity { buffer: named, needed, capacity } = error.clone() else { panic!("{error}") };
                let scene_holds = if matches!(buffer, "bodies" | "colliders") { 65 } else { 0 };
                assert!(
                    named == buffer && needed > capacity && capacity >= u64::from(room).max(scene_holds),
                    "{what}: {error}"
                );
                assert!(error.to_string().contains(&format!("`{buffer}`")), "{error}");
                // It says so again, and answers for the step before the rush.
                assert_eq!(world.step(), Err(error), "{what}");
                let last = world.poses().unwrap();
                assert_eq!(
                    (last.step(), world.velocities().unwrap().step()),
                    (play.rush as u64 - 1, last.step()),
                    "{what}"
                );
                assert_eq!(worlds::hash(world), hashes[play.rush - 1], "{what}");
                assert_eq!(world.try_poses().map(drop), Ok(()));
                let capacities = Capacities { grow: true, ..world.params().capacities };
                world.set_params(Params { capacities, ..*world.params() }).unwrap();
            });
            assert_eq!((hash, errors), (hashes[STEPS], 1), "{what}");
            assert!(report(&mut world).growths_of(buffer) > 0, "{what}");
        }
    }
}

/// What is read first tells of the error, once; and a world whose growth stays forbidden answers for ever.
#[test]
fn the_error_comes_from_whatever_waits_first() {
    let capacities = Capacities { pairs: Some(8), grow: false, ..GROWING };
    let expected = |error: Error| {
        assert!(matches!(error, Error::Capacity { buffer: "pairs", capacity: 8, .. }), "{error}");
    };
    type Ask = fn(&mut World) -> Result<(), Error>;
    let asks: [Ask; 3] =
        [|world| world.sync().map(drop), |world| world.poses().map(drop), |world| world.velocities().map(drop)];
    for ask in asks {
        let mut world = Side::Gpu.world(&scenes::overlap_cube().0, &params(capacities));
        world.step().unwrap();
        expected(ask(&mut world).unwrap_err());
        let start = world.poses().unwrap();
        assert_eq!(start.step(), 0);
        expected(world.sync().unwrap_err());
        expected(world.step().unwrap_err());
        assert_eq!(world.poses().unwrap(), start);
    }
    let mut world = Side::Cpu.world(&scenes::overlap_cube().0, &params(capacities));
    for _ in 0..3 {
        expected(world.step().unwrap_err());
        assert_eq!((world.poses().unwrap().step(), report(&mut world).step), (0, 0));
    }
}

/// Growth that would pass the bound on an array is growth that is impossible; as much as it allows is made.
#[test]
fn no_array_passes_its_bound() {
    for side in SIDES {
        let stepped = |capacities: Capacities| {
            let mut world = side.world(&scenes::overlap_cube().0, &params(capacities));
            world.step().and_then(|()| world.sync())
        };
        let small = Capacities { pairs: Some(8), ..GROWING };
        let Err(Error::Capacity { needed, .. }) = stepped(Capacities { grow: false, ..small }) else { panic!() };
        let bytes = needed * limits::BYTES_A_PAIR;
        let refused = stepped(Capacities { max_array_bytes: bytes - 1, ..small });
        assert_eq!(refused, Err(Error::Capacity { buffer: "pairs", needed, capacity: 8 }), "{side:?}");
        let report = stepped(Capacities { max_array_bytes: bytes, ..small }).unwrap();
        assert_eq!((u64::from(report.pairs), report.growths_of("pairs")), (needed, 1), "{side:?}: {report}");
    }
}

/// The report's `lost` is found less processed. Oracle: analysis.
#[test]
fn a_dropped_pair_is_told_of() {
    for side in SIDES {
        let mut world = side.world(&scenes::pyramid(6), &Params::default());
        steps(&mut world, 2);
        assert_eq!(report(&mut world).lost, 0);
        let pairs = report(&mut world).pairs;
        for (index, lost) in [(0, 1), (pairs - 1, 1), (pairs, 0), (u32::MAX, 0)] {
            drop_pair(&mut world, index);
            world.step().unwrap();
            let report = report(&mut world);
            assert_eq!((report.lost, report.pairs), (lost, pairs), "{side:?}, pair {index}: {report}");
            assert_eq!(report.to_string().contains("LOST 1"), lost == 1);
        }
        world.step().unwrap();
        assert_eq!(report(&mut world).lost, 0, "{side:?}: one step only");
    }
}

/// 12.5 million pairs: an error that names the buffer, and a world that still answers.
#[test]
fn five_thousand_at_one_point() {
    let mut scene = Scene::new();
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    for _ in 0..5000 {
        let body = RigidBodyBuilder::dynamic().translation(Vec3::Y * 3.0);
        scene.insert(body, ColliderBuilder::ball(0.5));
    }
    for side in SIDES {
        let capacities = Capacities { max_array_bytes: 16 << 20, ..GROWING };
        let mut world = side.world(&scene, &params(capacities));
        for _ in 0..2 {
            let error = world.step().and_then(|()| world.sync()).unwrap_err();
            let pairs = 5000 * 4999 / 2;
            let Error::Capacity { buffer: "pairs", needed, .. } = error else { panic!("{error}") };
            assert_eq!(needed, pairs, "{side:?}");
            let poses = world.poses().unwrap();
            assert_eq!((poses.step(), poses.iter().count()), (0, 5001));
        }
    }
}

/// Few enough that their pairs fit: balls and boxes at one point stay finite, and in the neighbourhood.
#[test]
fn a_crowd_at_one_point() {
    let mut scene = Scene::new();
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    for i in 0..100 {
        let body = RigidBodyBuilder::dynamic().translation(Vec3::Y * 3.0);
        let shape = if i % 2 == 0 { ColliderBuilder::ball(0.2) } else { ColliderBuilder::cuboid(0.2, 0.2, 0.2) };
        scene.insert(body, shape);
    }
    for side in SIDES {
        let mut world = side.world(&scene, &params(GROWING));
        steps(&mut world, 1);
        let first = report(&mut world);
        assert!(first.pairs == 99 * 50 && first.last_batch > 0 && first.growths_of("pairs") > 0, "{first}");
        steps(&mut world, 20);
        let (poses, velocities, report) = (world.poses().unwrap(), world.velocities().unwrap(), report(&mut world));
        assert_eq!((report.lost, report.quarantined), (0, 0), "{report}");
        assert!(poses.iter().all(|p| p.translation.is_finite() && p.translation.length() < 20.0), "{side:?}");
        assert!(velocities.iter().all(|v| v.linear.is_finite() && v.angular.is_finite()), "{side:?}");
    }
}

/// Bounds of the shaders' loops: both sides refuse the same. Oracle: analysis.
#[test]
fn loops_have_bounds() {
    // More specks in one cell than may be looked at, fixed, so that no pair is found on the way.
    let mut crowded = Scene::new();
    let specks = limits::TURN_LIMIT + 5;
    for _ in 0..specks {
        crowded.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.001));
    }
    // Half-spaces have no cell.
    let mut endless = Scene::new();
    for i in 0..=limits::UNBOUNDED_LIMIT {
        let body = RigidBodyBuilder::fixed().translation(Vec3::NEG_Y * i as f32);
        endless.insert(body, ColliderBuilder::halfspace(Vec3::Y));
    }
    // One plate on the floor carries them all: each of 62 rounds places one of its contacts, the rest is left.
    let hub = scenes::hub(limits::LAST_LIMIT as usize + 200);
    for (name, scene, pairs, expected) in [
        (
            "crowded",
            crowded,
            1000,
            Error::Capacity { buffer: "partners", needed: u64::from(specks) - 1, capacity: 50_000 },
        ),
        ("endless", endless, 1000, Error::Capacity { buffer: "half-spaces", needed: 4097, capacity: 4096 }),
        ("hub", hub, 70_000, Error::Capacity { buffer: "last batch", needed: 32_907, capacity: 32_768 }),
    ] {
        for side in SIDES {
            let capacities = Capacities { pairs: Some(pairs), ..GROWING };
            let mut world = side.world(&scene, &params(capacities));
            for _ in 0..2 {
                let error = world.step().and_then(|()| world.sync()).unwrap_err();
                assert_eq!(error, expected, "{name} on {side:?}");
                assert_eq!(world.poses().unwrap().iter().count(), scene.len(), "{name} on {side:?}");
            }
        }
    }
}
