//! Bodies that move along and turn about some of the world's axes alone, on both sides.

#[path = "common/analysis.rs"]
#[expect(dead_code, reason = "this program uses a part")]
mod analysis;
mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use analysis::assert_near;
use tumble::World;
use tumble_core::glam::{DMat3, DQuat, DVec2, DVec3, Quat, Vec3};
use tumble_core::{
    BodyHandle, ColliderBuilder, GaussSeidel, Jacobi, MassProperties, OnePass, Params, Pose, RigidBodyBuilder, Scene,
    Soft, Solver, Velocity,
};
use worlds::{SIDES, steps};

fn pose(world: &mut World, body: BodyHandle) -> Pose {
    world.poses().unwrap()[body]
}

fn velocity(world: &mut World, body: BodyHandle) -> Velocity {
    world.velocities().unwrap()[body]
}

/// A body of a world in two dimensions.
fn flat(x: f32, y: f32) -> RigidBodyBuilder {
    let body = RigidBodyBuilder::dynamic().translation(Vec3::new(x, y, 0.0));
    body.enabled_translations(true, true, false).enabled_rotations(false, false, true)
}

/// Whether nothing of these bodies is out of the plane z = 0, to the bit.
#[track_caller]
fn assert_flat(world: &mut World, bodies: &[BodyHandle]) {
    let (poses, velocities) = (world.poses().unwrap(), world.velocities().unwrap());
    for &body in bodies {
        let (pose, moved) = (poses[body], velocities[body]);
        let turn = [pose.rotation.x, pose.rotation.y, moved.angular.x, moved.angular.y];
        let out = turn.into_iter().chain([pose.translation.z, moved.linear.z]).all(|x| x == 0.0);
        assert!(out, "{body} is out of the plane: {pose:?}, {moved:?}");
    }
}

/// A stack, a heap in a pit and a ball that rolls, with obstacles beside the plane that push out of it. Oracle: analysis
/// (nothing leaves the plane, what is thrown rolls at 5/7 of its speed, the stack rests).
#[test]
fn a_world_in_two_dimensions_stays_flat() {
    let mut scene = Scene::new();
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    let stack: Vec<_> = (0..6)
        .map(|i| {
            let shape = if i % 2 == 0 { ColliderBuilder::cuboid(0.5, 0.25, 0.4) } else { ColliderBuilder::ball(0.25) };
            let shape = if i % 2 == 0 { shape } else { shape.rolling_resistance(0.1) };
            scene.insert(flat(0.0, 0.25 + 0.5 * i as f32), shape).body
        })
        .collect();
    for x in [5.0, 9.0] {
        scene.insert(
            RigidBodyBuilder::fixed().translation(Vec3::new(x, 1.0, 0.0)),
            ColliderBuilder::cuboid(0.2, 1.0, 1.0),
        );
        // Their middles lie beside the plane.
        let beside = RigidBodyBuilder::fixed().translation(Vec3::new(x + 1.2, 0.1, 0.2));
        scene.insert(beside, ColliderBuilder::ball(0.6));
    }
    let heap: Vec<_> = (0..40)
        .map(|i| {
            let at = flat(5.6 + 0.55 * (i % 6) as f32, 1.0 + 0.6 * (i / 6) as f32)
                .rotation(Quat::from_rotation_z(0.3 * i as f32));
            let shape = if i % 3 == 0 { ColliderBuilder::ball(0.25) } else { ColliderBuilder::cuboid(0.2, 0.25, 0.3) };
            // All kinds of speed, along locked axes too: there it is none.
            scene.insert(at.linvel(Vec3::new(1.0, -1.0, 2.0)).angvel(Vec3::new(4.0, -3.0, 1.0)), shape).body
        })
        .collect();
    let roller = flat(-30.0, 0.5).linvel(Vec3::X * 7.0);
    let roller = scene.insert(roller, ColliderBuilder::ball(0.5)).body;
    for side in SIDES {
        let mut world = side.world(&scene, &Params::default());
        for round in 0..12 {
            if round == 6 {
                // Pushed every way.
                for &body in &heap {
                    world
                        .edit()
                        .apply_impulse_at_point(body, Vec3::new(0.1, 0.4, 0.3), Vec3::new(7.0, 1.0, 0.1))
                        .unwrap();
                    world.edit().apply_torque_impulse(body, Vec3::new(0.02, -0.01, 0.01)).unwrap();
                    world.edit().add_force_at_point(body, Vec3::new(3.0, 2.0, 9.0), Vec3::new(7.0, 2.0, 0.5)).unwrap();
                    world.edit().add_torque(body, Vec3::ONE).unwrap();
                }
            }
            steps(&mut world, 15);
            assert_flat(&mut world, &[&stack[..], &heap, &[roller]].concat());
        }
        let rolls = velocity(&mut world, roller);
        assert_near(&format!("{side:?}, rolls"), rolls.linear.as_dvec3(), DVec3::X * 5.0, 1e-4); // 1.3e-5
        assert_near(&format!("{side:?}, turns"), rolls.angular.as_dvec3(), DVec3::NEG_Z * 10.0, 1e-4); // 1.3e-5
        for (i, &body) in stack.iter().enumerate() {
            let at = pose(&mut world, body).translation.as_dvec3();
            assert_near(&format!("{side:?}, stack {i}"), at, DVec3::Y * (0.25 + 0.5 * i as f64), 2e-4); // 1.9e-5
        }
    }
}

/// Axes with inertia of their own: a turned brick, in a body's own frame too.
fn brick(body: RigidBodyBuilder) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let askew = Quat::from_xyzw(0.3, -0.2, 0.5, 0.8).normalize();
    let shape = ColliderBuilder::cuboid(0.2, 0.5, 0.9).density(100.0).rotation(Quat::from_rotation_x(0.4));
    let body = scene.insert(body.rotation(askew), shape).body;
    (scene, body)
}

/// In the world, kg m².
fn inertia(mass: &MassProperties, rotation: Quat) -> DMat3 {
    let frame = DMat3::from_quat((rotation.as_dquat() * mass.principal_frame.as_dquat()).normalize());
    frame * DMat3::from_diagonal(mass.principal_inertia.as_dvec3()) * frame.transpose()
}

/// What an angular impulse, and a torque for a step, give a body that is held about some axes: the inverse of what is left
/// of its inertia. Oracle: analysis in f64.
#[test]
fn what_is_held_turns_with_the_inertia_that_is_left() {
    let push = Vec3::new(3.0, -2.0, 5.0);
    for side in SIDES {
        for by_torque in [false, true] {
            for held in 0..8 {
                let free: [bool; 3] = std::array::from_fn(|axis| held >> axis & 1 == 0);
                let (scene, body) = brick(RigidBodyBuilder::dynamic().enabled_rotations(free[0], free[1], free[2]));
                let mut world = side.world(&scene, &Params::default());
                let mass = world.scene().mass_properties(body).unwrap();
                let whole = inertia(&mass, world.scene().body(body).unwrap().rotation);
                if by_torque {
                    world.edit().add_torque(body, push * 60.0 * 1e-2).unwrap();
                } else {
                    world.edit().apply_torque_impulse(body, push * 1e-2).unwrap();
                }
                world.step().unwrap();
                // A locked axis has a moment of its own, and no product with the others.
                let mut left = whole;
                let mut load = push.as_dvec3() * 1e-2;
                for axis in (0..3).filter(|&axis| !free[axis]) {
                    for other in 0..3 {
                        left.col_mut(axis)[other] = 0.0;
                        left.col_mut(other)[axis] = 0.0;
                    }
                    left.col_mut(axis)[axis] = 1.0;
                    load[axis] = 0.0;
                }
                let found = velocity(&mut world, body).angular;
                for axis in (0..3).filter(|&axis| !free[axis]) {
                    assert_eq!(found[axis], 0.0, "{side:?}, {free:?}");
                }
                // Free in all, gyroscopic torque changes it within the step.
                let tolerance = if held == 0 { 2e-4 } else { 4e-6 }; // 1.8e-5, 3.5e-7
                assert_near(&format!("{side:?}, {free:?}"), found.as_dvec3(), left.inverse() * load, tolerance);
            }
        }
    }
}

/// Held about two axes, or about one, a brick goes on at the rate that it has; with all free its axis would wander. Oracle:
/// analysis.
#[test]
fn what_is_held_does_not_precess() {
    let spin = Vec3::new(2.0, 3.0, -1.0);
    for side in SIDES {
        for free in [[false, true, false], [true, false, true], [false, false, false]] {
            let held = RigidBodyBuilder::dynamic().enabled_rotations(free[0], free[1], free[2]).angvel(spin);
            let (scene, body) = brick(held);
            let mut world = side.world(&scene, &Params::default());
            steps(&mut world, 300);
            let left = Vec3::from_array(std::array::from_fn(|axis| if free[axis] { spin[axis] } else { 0.0 }));
            assert_eq!(velocity(&mut world, body).angular, left, "{side:?}, {free:?}");
            let start = scene.body(body).unwrap().rotation.as_dquat().normalize();
            let end = DQuat::from_scaled_axis(left.as_dvec3() * 5.0) * start;
            let off = (pose(&mut world, body).rotation.as_dquat() * end.conjugate()).xyz().length();
            println!("{side:?}, {free:?}: {off:.1e}");
            assert!(off < 1e-5, "{side:?}, {free:?}: {off}"); // 1.2e-6
        }
    }
}

const SOLVERS: [fn() -> Solver; 4] = [
    || Solver::OnePass(OnePass::default()),
    || Solver::Soft(Soft::default()),
    || Solver::GaussSeidel(GaussSeidel::default()),
    || Solver::Jacobi(Jacobi::default()),
];

/// A ball hits the slope of a wedge that moves along x alone: as to mass, the wedge is M along x and endless along y. With
/// every solver that is rigid. Oracle: analysis, J = v n / (1/m + nx² / M).
#[test]
fn a_push_meets_the_mass_along_each_axis() {
    let normal = DVec2::new(0.6, 0.8);
    let turn = Quat::from_rotation_z(-(0.6f32.atan2(0.8)));
    let (ball_mass, wedge_mass, speed) = (2.0, 3.0, 3.0);
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let wedge = RigidBodyBuilder::dynamic().rotation(turn).enabled_translations(true, false, false).lock_rotations();
    let wedge = scene.insert(wedge, ColliderBuilder::cuboid(2.0, 0.5, 2.0).mass(wedge_mass as f32).friction(0.0)).body;
    let at = normal * 1.2;
    let ball =
        RigidBodyBuilder::dynamic().translation(Vec3::new(at.x as f32, at.y as f32, 0.0)).linvel(Vec3::NEG_Y * 3.0);
    let ball = scene.insert(ball, ColliderBuilder::ball(0.5).mass(ball_mass as f32).friction(0.0)).body;
    let push = speed * normal.y / (1.0 / ball_mass + normal.x * normal.x / wedge_mass);
    for side in SIDES {
        for solver in SOLVERS {
            let params = Params { solver: solver(), ..Params::default() };
            let mut world = side.world(&scene, &params);
            steps(&mut world, 12);
            let what = format!("{side:?}, {}", params.solver);
            let (hit, moved) = (velocity(&mut world, ball).linear, velocity(&mut world, wedge));
            let flies = DVec3::NEG_Y * speed + push / ball_mass * normal.extend(0.0);
            assert_near(&format!("{what}, ball"), hit.as_dvec3(), flies, 5e-6); // 4.7e-7
            assert_near(
                &format!("{what}, wedge"),
                moved.linear.as_dvec3(),
                DVec3::NEG_X * push * normal.x / wedge_mass,
                5e-6, // 2.6e-7
            );
            let at = pose(&mut world, wedge);
            assert!(
                at.translation.y == 0.0
                    && at.translation.z == 0.0
                    && moved.linear.y == 0.0
                    && moved.angular == Vec3::ZERO
            );
            assert!(at.rotation.angle_between(turn) < 1e-3, "{what}: {at:?}");
        }
    }
}

/// A ball that bounces fully off what is held along all axes comes back as from a wall, and one that meets a bar which can
/// only turn loses to it what its inertia takes. Oracle: analysis, J = v / (1/m + r² / I).
#[test]
fn what_cannot_move_can_turn() {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let block = RigidBodyBuilder::dynamic().lock_translations().lock_rotations();
    let block =
        scene.insert(block, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(0.1).restitution(1.0).friction(0.0)).body;
    let bouncer = RigidBodyBuilder::dynamic().translation(Vec3::X * 1.2).linvel(Vec3::NEG_X * 4.0);
    let bouncer = scene.insert(bouncer, ColliderBuilder::ball(0.5).restitution(1.0).friction(0.0)).body;
    let bar = RigidBodyBuilder::dynamic().translation(Vec3::Y * 9.0).lock_translations();
    let bar = scene.insert(bar, ColliderBuilder::cuboid(1.0, 0.1, 0.1).mass(3.0).friction(0.0)).body;
    let hitter = RigidBodyBuilder::dynamic().translation(Vec3::new(0.8, 9.7, 0.0)).linvel(Vec3::NEG_Y * 2.0);
    let hitter = scene.insert(hitter, ColliderBuilder::ball(0.5).mass(0.5).friction(0.0)).body;
    for side in SIDES {
        let mut world = side.world(&scene, &Params::default());
        let mass = world.scene().mass_properties(bar).unwrap();
        steps(&mut world, 6);
        let back = velocity(&mut world, bouncer).linear;
        assert_near(&format!("{side:?}, back"), back.as_dvec3(), DVec3::X * 4.0, 1e-6); // 0
        // 0.8 m from the middle; the thinnest axis is not the one that it turns about.
        let moment = f64::from(mass.principal_inertia.max_element());
        let push = 2.0 / (1.0 / 0.5 + 0.64 / moment);
        // The bar turns while it is hit, with arms as at the beginning of the step: 3.8e-3, 1.2e-2.
        let (turns, hit) = (velocity(&mut world, bar), velocity(&mut world, hitter).linear);
        assert_near(&format!("{side:?}, bar"), turns.angular.as_dvec3(), DVec3::NEG_Z * push * 0.8 / moment, 1e-2);
        assert_near(&format!("{side:?}, ball"), hit.as_dvec3(), DVec3::Y * (push / 0.5 - 2.0), 3e-2);
        steps(&mut world, 60);
        for (body, at) in [(block, Vec3::ZERO), (bar, Vec3::Y * 9.0)] {
            assert_eq!(pose(&mut world, body).translation, at, "{side:?}: {body} stays where it is");
            assert_eq!(velocity(&mut world, body).linear, Vec3::ZERO);
        }
        assert_eq!(pose(&mut world, block).rotation, Quat::IDENTITY);
    }
}

/// Gravity, forces, impulses, velocities and poses: a body goes where it may, by what it is told. Oracle: analysis.
#[test]
fn edits_and_gravity_keep_to_the_free_axes() {
    for side in SIDES {
        let mut scene = Scene::new();
        scene.gravity = Vec3::new(1.0, -9.81, 2.0);
        let body = RigidBodyBuilder::dynamic().enabled_translations(true, false, true).lock_rotations();
        let body =
            scene.insert(body.linvel(Vec3::new(0.5, 8.0, 0.0)), ColliderBuilder::cuboid(0.3, 0.3, 0.3).mass(2.0)).body;
        let mut world = side.world(&scene, &Params::default());
        steps(&mut world, 60);
        let at = pose(&mut world, body).translation;
        assert_near(&format!("{side:?}, falls"), at.as_dvec3(), DVec3::new(1.0, 0.0, 1.0), 1e-5);
        assert_eq!((at.y, velocity(&mut world, body).linear.y), (0.0, 0.0), "{side:?}");
        world.edit().set_gravity(Vec3::ZERO).unwrap();
        world.edit().set_velocity(body, Vec3::new(0.0, 7.0, 0.0), Vec3::ONE).unwrap();
        world.edit().apply_impulse(body, Vec3::new(2.0, 9.0, 0.0)).unwrap();
        world.edit().add_force(body, Vec3::new(0.0, 50.0, 120.0)).unwrap();
        world.edit().apply_impulse_at_point(body, Vec3::Y, Vec3::ZERO).unwrap();
        world.step().unwrap();
        let moved = velocity(&mut world, body);
        assert_near(&format!("{side:?}, pushed"), moved.linear.as_dvec3(), DVec3::new(1.0, 0.0, 1.0), 1e-5);
        assert_eq!((moved.linear.y, moved.angular), (0.0, Vec3::ZERO), "{side:?}");
        // Locks hold it where it is, wherever it is put.
        world.edit().set_pose(body, Vec3::new(1.0, 2.0, 3.0).into()).unwrap();
        steps(&mut world, 60);
        let at = pose(&mut world, body).translation;
        assert_near(&format!("{side:?}, put"), at.as_dvec3(), DVec3::new(2.0, 2.0, 4.0), 1e-5);
        assert_eq!(at.y, 2.0, "{side:?}");
    }
}
