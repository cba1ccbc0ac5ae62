//! Joints of bodies that move along and turn about some of the world's axes alone, on both sides, directly and by
//! Gauss-Seidel. Oracle: analysis.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use std::f64::consts::TAU;
use tumble::World;
use tumble::prelude::*;
use tumble_core::glam::DVec3;
use worlds::{SIDES, Side, steps};

const SOLVERS: [JointSolver; 2] = [JointSolver::Direct, JointSolver::GaussSeidel];

fn each() -> impl Iterator<Item = (Side, JointSolver)> {
    SIDES.into_iter().flat_map(|side| SOLVERS.map(|joints| (side, joints)))
}

fn world(side: Side, scene: &Scene, joints: JointSolver) -> World {
    side.world(scene, &Params { joints, ..Params::default() })
}

fn place(world: &mut World, body: BodyHandle) -> Vec3 {
    world.poses().unwrap()[body].translation
}

/// A body of a world in two dimensions.
fn flat(body: RigidBodyBuilder) -> RigidBodyBuilder {
    body.enabled_translations(true, true, false).enabled_rotations(false, false, true)
}

/// Whether nothing of these bodies is out of the plane z = 0, to the bit.
#[track_caller]
fn assert_flat(world: &mut World, bodies: &[BodyHandle], what: &str) {
    let (poses, velocities) = (world.poses().unwrap(), world.velocities().unwrap());
    for &body in bodies {
        let (pose, moved) = (poses[body], velocities[body]);
        let turn = [pose.rotation.x, pose.rotation.y, moved.angular.x, moved.angular.y];
        let out = turn.into_iter().chain([pose.translation.z, moved.linear.z]).all(|x| x == 0.0);
        assert!(out, "{what}: {body} is out of the plane: {pose:?}, {moved:?}");
    }
}

/// A frame that is turned somehow, the same in both bodies while they stand as they were made.
fn turned(joint: JointBuilder, by: Quat) -> JointBuilder {
    let frame = by * joint.local_rotation1;
    joint.local_rotation1(frame).local_rotation2(frame)
}

/// Rods on a hook, each on the one above, out to the side; the joints are `joint`, and bodies are told by `hold`.
fn chain(
    count: usize,
    joint: &JointBuilder,
    hold: fn(RigidBodyBuilder) -> RigidBodyBuilder,
) -> (Scene, Vec<BodyHandle>) {
    let mut scene = Scene::new();
    let mut above = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.02)).body;
    let mut rods = Vec::new();
    for i in 0..count {
        let body = RigidBodyBuilder::dynamic().translation(Vec3::X * (0.2 + 0.4 * i as f32));
        let rod = scene.insert(hold(body), ColliderBuilder::cuboid(0.2, 0.03, 0.05)).body;
        let arm = if i == 0 { Vec3::ZERO } else { Vec3::X * 0.2 };
        let joint = joint.clone().local_anchor1(arm).local_anchor2(Vec3::X * -0.2).contacts_enabled(false);
        scene.insert_joint(above, rod, joint).unwrap();
        rods.push(rod);
        above = rod;
    }
    (scene, rods)
}

/// A double pendulum of hinges keeps to its plane by itself: locks do nothing there, whatever the frames of its joints. With
/// ball joints it keeps to it where it is held. All swing alike until rounding tells: 2.2e-5 m in 60 steps.
#[test]
fn a_pendulum_in_its_plane_does_not_notice_locks() {
    let tilt = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-1.1);
    let free = JointBuilder::revolute(Vec3::Z);
    let same = [
        ("hinges", free.clone()),
        ("ball joints", JointBuilder::spherical()),
        ("ball joints of turned frames", turned(JointBuilder::spherical(), tilt)),
        ("hinges of frames turned about them", turned(JointBuilder::revolute(Vec3::Z), Quat::from_rotation_z(0.4))),
    ];
    for (side, joints) in each() {
        let run = |joint: &JointBuilder, hold| {
            let (scene, rods) = chain(2, joint, hold);
            let mut world = world(side, &scene, joints);
            let mut way = Vec::new();
            for _ in 0..60 {
                world.step().unwrap();
                way.extend(rods.iter().map(|&rod| place(&mut world, rod)));
            }
            way
        };
        let expected = run(&free, |body| body);
        assert!(expected[60].y < -0.15, "{side:?}, {joints:?}: it falls, {}", expected[60]);
        for (name, joint) in &same {
            let off = run(joint, flat).iter().zip(&expected).map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
            println!("{side:?}, {joints:?}, {name}: off by {off:e} m");
            assert!(off < 1e-4, "{side:?}, {joints:?}, {name}: {off} m");
        }
    }
}

/// A chain that is locked to its plane, kicked out of it, and hung from a hook beside it: nothing leaves the plane, nor is
/// anything thrown, and the joints hold within it: 2.3e-7 m, by Gauss-Seidel 9.5e-3 m.
#[test]
fn a_chain_stays_in_its_plane() {
    for (side, joints) in each() {
        for (name, joint) in [
            ("ball joints", JointBuilder::spherical()),
            ("hinges of turned frames", turned(JointBuilder::revolute(Vec3::Z), Quat::from_rotation_z(0.7))),
            ("universal joints", JointBuilder::universal(Vec3::Z, Vec3::X)),
        ] {
            let kicked = |body: RigidBodyBuilder| flat(body).linvel(Vec3::Z * 3.0).angvel(Vec3::new(2.0, 5.0, 0.5));
            let (mut scene, rods) = chain(8, &joint, kicked);
            scene.gravity = Vec3::new(0.0, -9.81, 4.0);
            // As the first rod's, one more a centimetre beside the plane.
            let beside = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.01)).body;
            let last = JointBuilder::rope(0.9).local_anchor1(Vec3::new(3.2, 0.0, 0.01));
            scene.insert_joint(beside, rods[7], last.local_anchor2(Vec3::X * 0.2)).unwrap();
            let mut world = world(side, &scene, joints);
            let (mut apart, mut highest) = (0.0f32, f32::MIN);
            for _ in 0..12 {
                steps(&mut world, 10);
                assert_flat(&mut world, &rods, name);
                let all = world.joints().unwrap().all;
                apart = all.iter().map(|joint| joint.separation).fold(apart, f32::max);
                highest = rods.iter().map(|&rod| place(&mut world, rod).y).fold(highest, f32::max);
            }
            println!("{side:?}, {joints:?}, {name}: apart by {apart:e} m, up to {highest} m");
            let most = if joints == JointSolver::Direct { 1e-5 } else { 2e-2 };
            assert!(apart < most && highest < 0.3, "{side:?}, {joints:?}, {name}: {apart} m, {highest} m");
        }
    }
}

/// A wheel that cannot leave its place, on what stands still. Hands back the wheel.
fn wheel(scene: &mut Scene, at: Vec3, hinge: JointBuilder) -> BodyHandle {
    let ground = scene.insert(RigidBodyBuilder::fixed().translation(at), ColliderBuilder::ball(0.01)).body;
    let body = RigidBodyBuilder::dynamic().translation(at).lock_translations();
    let wheel = scene.insert(body, ColliderBuilder::cuboid(0.3, 0.3, 0.05)).body;
    scene.insert_joint(ground, wheel, hinge.contacts_enabled(false)).unwrap();
    wheel
}

/// A wheel on a motor: its speed goes to its goal as 1 - exp(-c t), wherever its anchor lies on its axis.
#[test]
fn a_wheel_by_locks_follows_its_motor() {
    for (side, joints) in each() {
        let hinge = JointBuilder::revolute(Vec3::Z).motor_velocity(JointAxis::AngX, 3.0, 5.0);
        for (name, along) in [("in its middle", 0.0), ("beside it", 0.2)] {
            let mut scene = Scene::new();
            let anchor = Vec3::Z * along;
            let hinge = hinge.clone().local_anchor1(anchor).local_anchor2(anchor);
            let at = Vec3::new(1.0, 2.0, 3.0);
            let wheel = wheel(&mut scene, at, hinge);
            let mut world = world(side, &scene, joints);
            let mut worst = 0.0f64;
            for step in 1..=60 {
                world.step().unwrap();
                let speed = world.velocities().unwrap()[wheel];
                let exact = 3.0 * (1.0 - (-5.0 * f64::from(step) / 60.0).exp());
                worst = worst.max((f64::from(speed.angular.z) - exact).abs());
                assert!(
                    speed.linear == Vec3::ZERO && place(&mut world, wheel) == at,
                    "{side:?}, {joints:?}: {speed:?}"
                );
            }
            println!("{side:?}, {joints:?}, {name}: speed off by {worst} of 3");
            // An implicit damper is late by half a sub-step: 3 * 5 / 480 at the start.
            assert!(worst < 0.02, "{side:?}, {joints:?}, {name}: {worst}");
        }
    }
}

/// A crank, a rod and a slide that are no more than ball joints and locks: the slide is at r cos(a) + sqrt(l² - r² sin²(a)), to
/// 2.5e-6 m, by Gauss-Seidel 3.2e-3 m.
#[test]
fn a_crank_drives_its_slide() {
    let (r, l) = (0.2f64, 1.0f64);
    for (side, joints) in each() {
        let mut scene = Scene::new();
        scene.gravity = Vec3::ZERO;
        let hinge = JointBuilder::revolute(Vec3::Z).motor_velocity(JointAxis::AngX, 5.0, 1e3);
        let crank = wheel(&mut scene, Vec3::ZERO, hinge);
        let rod = RigidBodyBuilder::dynamic().translation(Vec3::X * 0.7);
        let rod = scene.insert(rod, ColliderBuilder::cuboid(0.5, 0.02, 0.02)).body;
        let slide = RigidBodyBuilder::dynamic().translation(Vec3::X * 1.2).enabled_translations(true, false, false);
        let slide = scene.insert(slide.lock_rotations(), ColliderBuilder::cuboid(0.1, 0.1, 0.1)).body;
        let ball = JointBuilder::spherical().contacts_enabled(false);
        let first = ball.clone().local_anchor1(Vec3::X * 0.2).local_anchor2(Vec3::X * -0.5);
        scene.insert_joint(crank, rod, first).unwrap();
        scene.insert_joint(rod, slide, ball.local_anchor1(Vec3::X * 0.5)).unwrap();
        let mut world = world(side, &scene, joints);
        let (mut off, mut turned, mut before) = (0.0f64, 0.0, 0.0);
        for _ in 0..150 {
            world.step().unwrap();
            let poses = world.poses().unwrap();
            let axis = poses[crank].rotation.as_dquat() * DVec3::X;
            let angle = axis.y.atan2(axis.x);
            let turn: f64 = angle - before;
            turned += turn - TAU * (turn / TAU).round();
            before = angle;
            let at = poses[slide].translation.as_dvec3();
            let exact = r * angle.cos() + (l * l - (r * angle.sin()).powi(2)).sqrt();
            off = off.max((at.x - exact).abs());
            assert!(at.y == 0.0 && at.z == 0.0 && poses[slide].rotation == Quat::IDENTITY, "{side:?}: {at}");
            assert_eq!(poses[crank].translation, Vec3::ZERO, "{side:?}, {joints:?}");
        }
        println!("{side:?}, {joints:?}: off by {off:e} m, turned by {turned} rad");
        let most = if joints == JointSolver::Direct { 2e-5 } else { 6e-3 };
        assert!(off < most && (turned - 12.5).abs() < 0.2, "{side:?}, {joints:?}: {off} m, {turned} rad");
    }
}

/// What hangs pulls on what is locked, which bears it and does not move: a ball under a beam without a free axis, and a ball
/// that gravity pulls straight out of the plane of the body that it hangs on.
#[test]
fn what_is_locked_bears_a_pull_and_stays() {
    const WEIGHT: f32 = 2.0 * 9.81;
    for (side, joints) in each() {
        let mut scene = Scene::new();
        let all: [fn(RigidBodyBuilder) -> RigidBodyBuilder; 3] = [
            |body| body.lock_translations().lock_rotations(),
            flat,
            |body| body.enabled_translations(true, true, false),
        ];
        scene.gravity = Vec3::NEG_Z * 9.81;
        let held: Vec<_> = all
            .iter()
            .enumerate()
            .map(|(i, hold)| {
                let at = Vec3::X * (3.0 * i as f32);
                let body = hold(RigidBodyBuilder::dynamic().translation(at));
                let beam = scene.insert(body, ColliderBuilder::cuboid(0.2, 0.1, 0.1)).body;
                let below = RigidBodyBuilder::dynamic().translation(at - Vec3::Z * 0.5);
                let ball = scene.insert(below, ColliderBuilder::ball(0.1).mass(2.0)).body;
                let joint = JointBuilder::spherical().local_anchor2(Vec3::Z * 0.5);
                (at, beam, scene.insert_joint(beam, ball, joint).unwrap())
            })
            .collect();
        let mut world = world(side, &scene, joints);
        steps(&mut world, 120);
        let read = world.joints().unwrap();
        for (i, &(at, beam, joint)) in held.iter().enumerate() {
            let (force, to) = (read[joint].force, place(&mut world, beam));
            println!("{side:?}, {joints:?}, {i}: {force} N, {to}");
            assert!((force.length() - WEIGHT).abs() < 0.01 * WEIGHT, "{side:?}, {joints:?}, {i}: {force} N");
            assert!(to.z == 0.0 && (to - at).length() < 1e-6, "{side:?}, {joints:?}, {i}: {to}");
        }
    }
}

/// Joints that ask for what nothing can do (a body of a plane on a rod straight out of it, on a hook beside it, between two
/// planes, or without any free axis) throw nothing about: what is in the plane holds, and the rest is as it was.
#[test]
fn what_nothing_can_move_moves_nothing() {
    let tilt = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-1.1);
    let frozen = |body: RigidBodyBuilder| body.lock_translations().lock_rotations();
    for (side, joints) in each() {
        let mut scene = Scene::new();
        let mut at = Vec3::ZERO;
        let mut all = Vec::new();
        // A motor along an axis that is all but square to the plane.
        let lift = Vec3::new(1e-3, 0.0, 1.0);
        let kinds = [
            JointBuilder::generic(&[]).local_axis1(lift).local_axis2(lift).motor_velocity(JointAxis::LinX, 1.0, 1000.0),
            JointBuilder::fixed(),
            turned(JointBuilder::fixed(), tilt),
            JointBuilder::spherical(),
            turned(JointBuilder::spherical(), tilt),
            JointBuilder::revolute(Vec3::Z),
            JointBuilder::revolute(Vec3::X),
            JointBuilder::prismatic(Vec3::new(1.0, 0.2, 0.3)),
            JointBuilder::distance(0.3),
            JointBuilder::rope(0.1),
            JointBuilder::spring(0.1, 100.0, 1.0),
            JointBuilder::fixed().softness(5.0, 0.5),
            JointBuilder::revolute(Vec3::Y)
                .motor_velocity(JointAxis::AngX, 3.0, 50.0)
                .limits(JointAxis::AngX, [-0.1, 0.1]),
        ];
        for kind in kinds {
            for (second, hold) in [(false, flat as fn(_) -> _), (true, flat), (false, frozen), (true, frozen)] {
                at += Vec3::X * 3.0;
                let anchor = match second {
                    // Beside the plane of the other.
                    true => flat(RigidBodyBuilder::dynamic().translation(at + Vec3::Z * 0.2)),
                    false => RigidBodyBuilder::fixed().translation(at + Vec3::Z * 0.2),
                };
                let anchor = scene.insert(anchor, ColliderBuilder::ball(0.01)).body;
                let start = at + Vec3::Y * 0.1;
                let body = hold(RigidBodyBuilder::dynamic().translation(start));
                let body = scene.insert(body, ColliderBuilder::cuboid(0.3, 0.2, 0.1)).body;
                scene.insert_joint(anchor, body, kind.clone().contacts_enabled(false)).unwrap();
                all.push((body, start, kind.clone(), second, all.len()));
            }
        }
        scene.gravity = Vec3::new(0.3, 0.0, -9.81);
        let mut world = world(side, &scene, joints);
        for _ in 0..60 {
            steps(&mut world, 2);
            for (body, start, kind, second, i) in &all {
                let (to, speed) = (place(&mut world, *body), world.velocities().unwrap()[*body]);
                let way = (to - *start).length();
                let fast = speed.linear.length() + 0.3 * speed.angular.length();
                let what = format!("{side:?}, {joints:?}, {i}, {second}, {kind:?}");
                assert!(to.z == 0.0 && way < 1.0 && fast < 3.0, "{what}: {way} m, {fast} m/s, {to}");
            }
        }
        let read = world.joints().unwrap();
        for reading in &read.all {
            assert!(reading.force.length() < 1e5 && reading.torque.length() < 1e4, "{side:?}, {joints:?}: {reading:?}");
        }
    }
}
