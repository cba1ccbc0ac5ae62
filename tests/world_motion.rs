//! Bodies that are moved by poses: they arrive, whatever the sub-steps, and what they meet sees their velocity. On both
//! sides.

#[path = "common/analysis.rs"]
#[expect(dead_code, reason = "this program uses a part")]
mod analysis;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use analysis::assert_near;
use std::f64::consts::PI;
use tumble::World;
use tumble_core::glam::{DQuat, DVec3, Quat, Vec3};
use tumble_core::{
    Accuracy, BodyHandle, Capacities, ColliderBuilder, Error, Params, Pose, RigidBodyBuilder, RigidBodyType, Scene,
    Sleep, Velocity, scenes,
};
use worlds::{SIDES, Side, hash, report, steps};

const DT: f64 = 1.0 / 60.0;

fn with(accuracy: Accuracy) -> Params {
    Params { accuracy, ..Params::default() }
}

fn pose(world: &mut World, body: BodyHandle) -> Pose {
    world.poses().unwrap()[body]
}

fn velocity(world: &mut World, body: BodyHandle) -> Velocity {
    world.velocities().unwrap()[body]
}

const STILL: Velocity = Velocity { linear: Vec3::ZERO, angular: Vec3::ZERO };

/// The angle between two rotations, rad, good near half a turn too.
fn between(a: DQuat, b: DQuat) -> f64 {
    let turn = a * b.conjugate();
    2.0 * turn.xyz().length().atan2(turn.w.abs())
}

fn posed(at: Vec3) -> RigidBodyBuilder {
    RigidBodyBuilder::kinematic_position_based().translation(at)
}

/// A few millimetres to 20 m a step, and turns of nothing to half a turn.
fn targets() -> Vec<Pose> {
    let axis = Vec3::new(0.36, -0.48, 0.8);
    let at = |translation, angle: f32, axis: Vec3| Pose { translation, rotation: Quat::from_axis_angle(axis, angle) };
    vec![
        at(Vec3::new(0.0, 10.003, 0.0), 0.0, Vec3::Y),
        at(Vec3::new(0.1, 10.0, -0.2), 1e-3, axis),
        at(Vec3::new(-7.0, 12.0, 9.0), 0.4, axis),
        at(Vec3::new(-7.0, 12.0, 9.0), 3.5, axis),
        at(Vec3::new(-3.0, 29.0, 5.0), -2.0, Vec3::X),
        // Half a turn about another axis: one way round is as good as the other.
        Pose { translation: Vec3::new(3.0, 11.0, 5.0), rotation: Quat::from_rotation_z(PI as f32) },
        at(Vec3::new(3.0, 11.0, 5.0), 0.0, Vec3::Y),
    ]
}

/// Each target is reached in its step, with the velocity of the straight way and the shorter turn; then the body stands,
/// bit for bit. For any number of sub-steps, and where islands have their own. Oracle: analysis.
#[test]
fn targets_are_reached_in_their_step() {
    let accuracies = [1, 3, 8, 32, 256].map(Accuracy::Substeps);
    for accuracy in accuracies.into_iter().chain([Accuracy::Tolerance { penetration: 1e-4, joint: 1e-4, most: 64 }]) {
        let (mut far, mut turned, mut fast) = (0f64, 0f64, 0f64);
        for side in SIDES {
            // Elsewhere, a box under 1,000 times its mass takes the highest level, and boxes alone the lowest.
            let (mut scene, ..) = scenes::mass_ratio(1000.0);
            let body = scene.insert(posed(Vec3::Y * 10.0), ColliderBuilder::cuboid(0.4, 0.2, 0.3)).body;
            for i in 0..4 {
                let alone = RigidBodyBuilder::dynamic().translation(Vec3::new(20.0 + 2.0 * i as f32, 0.5, 0.0));
                scene.insert(alone, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
            }
            let mut world = side.world(&scene, &with(accuracy));
            steps(&mut world, if accuracy.is_by_island() { 60 } else { 2 });
            for (k, target) in targets().into_iter().enumerate() {
                let before = pose(&mut world, body);
                world.edit().set_next_kinematic_pose(body, target).unwrap();
                world.step().unwrap();
                let (after, moved) = (pose(&mut world, body), velocity(&mut world, body));
                let size = f64::from(target.translation.length().max(before.translation.length()));
                let way = target.translation.as_dvec3() - before.translation.as_dvec3();
                far = far.max(f64::from(after.translation.distance(target.translation)) / size);
                turned = turned.max(between(after.rotation.as_dquat(), target.rotation.as_dquat()));
                fast = fast.max((moved.linear.as_dvec3() * DT).distance(way) / size);
                // The velocity is that of the way that it went, and not of a longer one round.
                let spin = moved.angular.as_dvec3() * DT;
                let led = DQuat::from_scaled_axis(spin) * before.rotation.as_dquat();
                turned = turned.max(between(led, target.rotation.as_dquat()));
                assert!(spin.length() <= PI + TURNED, "{side:?}, {accuracy}, target {k}: {spin}");
                steps(&mut world, 2);
                assert_eq!(pose(&mut world, body), after, "{side:?}, {accuracy}, target {k}: without one it stands");
                assert_eq!(velocity(&mut world, body), STILL, "{side:?}, {accuracy}, target {k}");
            }
        }
        println!("{accuracy}: {far:.1e} of the distance, {turned:.1e} rad; velocity {fast:.1e}");
        assert!(far < FAR && turned < TURNED && fast < FAST, "{accuracy}: {far:e}, {turned:e} rad, {fast:e}");
    }
}

// Beside each the largest that was measured; where it grows with the number of sub-steps, that of 256 and of 32 or fewer.
const FAR: f64 = 1e-5; // 1.8e-6, 1.2e-7 of the distance from the origin
const TURNED: f64 = 6e-6; // 1.1e-6, 7.1e-7 rad
const FAST: f64 = 5e-7; // 7.1e-8
const ALIKE: f64 = 2e-5; // 3.4e-6, share of what the other platform gave

/// A box on a lift that goes up and down by 2 m, as a sine with 0.45 g at its most: it neither sinks in nor comes off, and
/// has the lift's velocity, which changes by up to 0.074 m/s from step to step. Oracle: analysis.
#[test]
fn a_lift_carries_its_load() {
    let height = |t: f64| 1.0 - (2.1 * t).cos();
    let mut scene = Scene::new();
    let lift = scene.insert(posed(Vec3::Y), ColliderBuilder::cuboid(1.0, 0.25, 1.0)).body;
    let load = RigidBodyBuilder::dynamic().translation(Vec3::Y * 1.75);
    let load = scene.insert(load, ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(1000.0)).body;
    for side in SIDES {
        let mut world = side.world(&scene, &Params::default());
        let (mut off, mut slow) = (0f32, 0f32);
        for step in 1..=360 {
            let y = (1.0 + height(f64::from(step) * DT)) as f32;
            world.edit().set_next_kinematic_pose(lift, (Vec3::Y * y).into()).unwrap();
            world.step().unwrap();
            let (on, under) = (pose(&mut world, load), pose(&mut world, lift));
            off = off.max((on.translation.y - under.translation.y - 0.75).abs());
            let speeds = velocity(&mut world, load).linear - velocity(&mut world, lift).linear;
            slow = slow.max(speeds.length());
        }
        println!("{side:?}: {off:.1e} m off the lift, {slow:.1e} m/s");
        // Measured: 5.7e-5 m, 0.031 m/s.
        assert!(off < 3e-4 && slow < 0.074, "{side:?}: {off} m, {slow} m/s");
    }
}

/// A box on a platform that turns by 1 rad/s rides round with it: 2 m from the middle friction of 0.6 holds up to 1.7 rad/s.
/// Oracles: a platform of the same velocity that is not told poses, and analysis. The box goes out by 6.5 % a second on
/// either: arms of contacts between boxes are kept for up to 11.5 degrees (`narrowphase/recycle`).
#[test]
fn a_turning_platform_carries_its_load() {
    let rides = |side: Side, platform: RigidBodyBuilder| {
        let mut scene = Scene::new();
        let platform = scene.insert(platform, ColliderBuilder::cuboid(3.0, 0.25, 3.0).friction(0.6)).body;
        let load = RigidBodyBuilder::dynamic().translation(Vec3::new(2.0, 0.5, 0.0)).linvel(Vec3::NEG_Z * 2.0);
        let shape = ColliderBuilder::cuboid(0.25, 0.25, 0.25).density(1000.0).friction(0.6);
        let load = scene.insert(load.angvel(Vec3::Y), shape).body;
        let mut world = side.world(&scene, &Params::default());
        for step in 1..=60 {
            let rotation = Quat::from_rotation_y((f64::from(step) * DT) as f32);
            let told = world.edit().set_next_kinematic_pose(platform, Pose { translation: Vec3::ZERO, rotation });
            assert!(told.is_ok() || scene.body(platform).unwrap().body_type == RigidBodyType::KinematicVelocityBased);
            world.step().unwrap();
        }
        (pose(&mut world, load), velocity(&mut world, load))
    };
    for side in SIDES {
        let (on, moved) = rides(side, posed(Vec3::ZERO));
        let (same, as_fast) = rides(side, RigidBodyBuilder::kinematic_velocity_based().angvel(Vec3::Y));
        let place = same.translation.as_dvec3();
        assert_near(&format!("{side:?}, place"), on.translation.as_dvec3(), place, ALIKE);
        assert_near(&format!("{side:?}, speed"), moved.linear.as_dvec3(), as_fast.linear.as_dvec3(), ALIKE);
        let exact = DVec3::new(2.0 * 1f64.cos(), 0.5, -2.0 * 1f64.sin());
        assert_near(&format!("{side:?}, place"), on.translation.as_dvec3(), exact, 0.13); // 0.066
        assert_near(&format!("{side:?}, spin"), moved.angular.as_dvec3(), DVec3::Y, 3e-3); // 5.8e-4
    }
}

/// A wall that is told one pose after the other pushes a ball before it at its speed, and the ball then goes on alone.
/// Oracle: analysis.
#[test]
fn what_is_in_the_way_is_pushed() {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let wall = scene.insert(posed(Vec3::ZERO), ColliderBuilder::cuboid(0.1, 1.0, 1.0)).body;
    let ball = RigidBodyBuilder::dynamic().translation(Vec3::X * 1.1);
    let ball = scene.insert(ball, ColliderBuilder::ball(0.5).friction(0.0)).body;
    for side in SIDES {
        let mut world = side.world(&scene, &Params::default());
        for step in 1..=60 {
            world.edit().set_next_kinematic_pose(wall, (Vec3::X * (0.05 * step as f32)).into()).unwrap();
            world.step().unwrap();
        }
        steps(&mut world, 30);
        let (pushed, stopped) = (velocity(&mut world, ball).linear, pose(&mut world, wall).translation);
        assert_near(&format!("{side:?}, ball"), pushed.as_dvec3(), DVec3::X * 3.0, 2e-3); // 1.9e-4
        assert_near(&format!("{side:?}, wall"), stopped.as_dvec3(), DVec3::X * 3.0, FAR);
    }
}

/// Oracle: the same world with room from the beginning, to the bit: a target is no less where a step runs again.
#[test]
fn a_step_that_runs_again_goes_the_same_way() {
    let scene = |at: &mut Vec<BodyHandle>| {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        for i in 0..40 {
            let place = Vec3::new((i % 7) as f32 * 0.9, 0.5 + (i / 7) as f32 * 0.9, 0.0);
            scene.insert(RigidBodyBuilder::dynamic().translation(place), ColliderBuilder::ball(0.5));
        }
        at.push(scene.insert(posed(Vec3::new(-3.0, 1.0, 0.0)), ColliderBuilder::cuboid(0.5, 1.0, 1.0)).body);
        scene
    };
    for side in SIDES {
        let hashes = [Some(4), None].map(|pairs| {
            let mut pusher = Vec::new();
            let capacities = Capacities { pairs, ..Capacities::default() };
            let mut world = side.world(&scene(&mut pusher), &Params { capacities, ..Params::default() });
            for step in 1..=20 {
                let rotation = Quat::from_rotation_y(0.05 * step as f32);
                let translation = Vec3::new(-3.0 + 0.1 * step as f32, 1.0, 0.0);
                world.edit().set_next_kinematic_pose(pusher[0], Pose { translation, rotation }).unwrap();
                world.step().unwrap();
            }
            let grew = report(&mut world).growths.iter().any(|(name, _)| *name == "pairs");
            assert_eq!(grew, pairs.is_some(), "{side:?}: the buffer of pairs grows");
            hash(&mut world)
        });
        assert_eq!(hashes[0], hashes[1], "{side:?}");
    }
}

/// What lies on a platform stays awake while that is moved, sleeps once it stands, and wakes when it is moved again.
/// Oracle: the rule.
#[test]
fn a_platform_that_moves_keeps_its_load_awake() {
    let mut scene = Scene::new();
    let platform = scene.insert(posed(Vec3::ZERO), ColliderBuilder::cuboid(1.0, 0.5, 1.0)).body;
    let load = RigidBodyBuilder::dynamic().translation(Vec3::Y);
    scene.insert(load, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    let params = Params { sleep: Some(Sleep { distance: 1e-2, time: 0.25 }), ..Params::default() };
    for side in SIDES {
        let mut world = side.world(&scene, &params);
        // 0.1 mm a step: slower than what counts as rest.
        for step in 1..=60 {
            world.edit().set_next_kinematic_pose(platform, (Vec3::Y * (1e-4 * step as f32)).into()).unwrap();
            world.step().unwrap();
            assert_eq!(report(&mut world).asleep, 0, "{side:?}, step {step}");
        }
        steps(&mut world, 30);
        assert_eq!(report(&mut world).asleep, 1, "{side:?}: it stands");
        world.edit().set_next_kinematic_pose(platform, (Vec3::Y * 7e-3).into()).unwrap();
        steps(&mut world, 2);
        assert_eq!(report(&mut world).asleep, 0, "{side:?}: it was moved");
    }
}

/// Oracle: what is allowed.
#[test]
fn bad_targets_are_refused() {
    let mut scene = Scene::new();
    let at = |x: f32| Vec3::X * x;
    let [fixed, dynamic, fast, own] = [
        RigidBodyBuilder::fixed(),
        RigidBodyBuilder::dynamic().translation(at(3.0)),
        RigidBodyBuilder::kinematic_velocity_based().translation(at(6.0)),
        posed(at(9.0)).linvel(Vec3::Y).angvel(Vec3::Y),
    ]
    .map(|body| scene.insert(body, ColliderBuilder::ball(0.5)).body);
    for side in SIDES {
        let mut world = side.world(&scene, &Params::default());
        for body in [fixed, dynamic, fast] {
            let error = world.edit().set_next_kinematic_pose(body, Vec3::ONE.into()).unwrap_err();
            assert!(matches!(error, Error::Invalid { field: "body_type", .. }), "{error}");
            assert!(error.to_string().contains("kinematic_position_based"), "{error}");
        }
        let bad = [
            (Pose { translation: at(f32::NAN), rotation: Quat::IDENTITY }, "translation"),
            (Pose { translation: at(2e7), rotation: Quat::IDENTITY }, "translation"),
            (Pose { translation: Vec3::ZERO, rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0) }, "rotation"),
            (Pose { translation: Vec3::ZERO, rotation: Quat::from_xyzw(0.0, f32::INFINITY, 0.0, 1.0) }, "rotation"),
        ];
        for (pose, name) in bad {
            let error = world.edit().set_next_kinematic_pose(own, pose).unwrap_err();
            assert!(matches!(error, Error::Invalid { field, .. } if field == name), "{error}");
        }
        // Nothing of that was taken, and a velocity at its beginning is none.
        world.step().unwrap();
        assert_eq!(pose(&mut world, own).translation, at(9.0), "{side:?}");
        // A velocity that is set lasts for one step.
        world.edit().set_velocity(own, Vec3::Y * 6.0, Vec3::ZERO).unwrap();
        steps(&mut world, 3);
        assert!((pose(&mut world, own).translation - Vec3::new(9.0, 0.1, 0.0)).length() < 1e-6, "{side:?}");
        // Farther than any velocity leads: quarantine, as for all that explodes.
        world.set_params(Params { dt: 1e-6, ..Params::default() }).unwrap();
        world.edit().set_next_kinematic_pose(own, at(9e6).into()).unwrap();
        world.step().unwrap();
        assert_eq!(report(&mut world).newly_quarantined, [own.slot() as u32], "{side:?}");
        world.edit().remove(own).unwrap();
        assert_eq!(world.edit().set_next_kinematic_pose(own, Vec3::ONE.into()).unwrap_err(), Error::StaleBody(own));
    }
}

/// Damping and the factor on gravity, each by itself and together. Oracles: analysis, exp(-c t) within the half c² h t that
/// implicit steps of length h are off, and the fall at g s / c in the end.
#[test]
fn damping_and_gravity_scale_do_what_they_say() {
    let throw = Vec3::new(3.0, 1.0, -2.0);
    let mut scene = Scene::new();
    let mut insert = |x: f32, body: RigidBodyBuilder| {
        let body = body.translation(Vec3::X * x).linvel(throw).angvel(throw);
        scene.insert(body, ColliderBuilder::ball(0.5)).body
    };
    let dynamic = RigidBodyBuilder::dynamic;
    let floats = insert(0.0, dynamic().gravity_scale(0.0).linear_damping(0.5).angular_damping(2.0));
    let rises = insert(50.0, dynamic().gravity_scale(-2.5));
    let sinks = insert(100.0, dynamic().gravity_scale(1.5).linear_damping(8.0));
    let h = DT / 8.0;
    for side in SIDES {
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 120);
        let moved = velocity(&mut world, floats);
        let lost = |c: f64| throw.as_dvec3() * (-2.0 * c).exp();
        assert_near(&format!("{side:?}, slows"), moved.linear.as_dvec3(), lost(0.5), 1.1 * 0.5 * 0.5 * 0.5 * h * 2.0);
        assert_near(&format!("{side:?}, turns"), moved.angular.as_dvec3(), lost(2.0), 1.1 * 0.5 * 2.0 * 2.0 * h * 2.0);
        let way = throw.as_dvec3() * 2.0 * (1.0 - (-1f64).exp());
        assert_near(&format!("{side:?}, way"), pose(&mut world, floats).translation.as_dvec3(), way, 1e-3); // 3.0e-4
        let risen = throw.as_dvec3() * 2.0 + DVec3::Y * (2.5 * 9.81 * 2.0) + DVec3::X * 50.0;
        assert_near(&format!("{side:?}, rises"), pose(&mut world, rises).translation.as_dvec3(), risen, 1e-5);
        let speed = velocity(&mut world, sinks).linear.as_dvec3();
        assert_near(&format!("{side:?}, sinks"), speed, DVec3::NEG_Y * (1.5 * 9.81 / 8.0), 1e-5);
    }
}
