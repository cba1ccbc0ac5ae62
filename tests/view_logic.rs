//! The parts of `examples/view` that need no window: the clock of real time, and the spring that pulls a body. Oracles:
//! arithmetic, and the exact course of a critically damped spring, in worlds on the CPU.

#[path = "../examples/view/clock.rs"]
mod clock;
#[expect(dead_code, reason = "the window's own")]
#[path = "../examples/view/grab.rs"]
mod grab;

use clock::{Clock, MOST_STEPS};
use grab::Grab;
use tumble::prelude::*;

const DT: f64 = 1.0 / 60.0;

#[test]
fn real_time_becomes_steps() {
    // Frames of any length that a machine keeps up with: as many steps as time.
    for frame in [0.1 * DT, 0.7 * DT, DT, 1.9 * DT, 3.99 * DT] {
        let mut clock = Clock::default();
        let frames = (100.0 * DT / frame).round() as u32;
        let steps: u32 = (0..frames).map(|_| clock.steps(frame, DT)).sum();
        let due = f64::from(frames) * frame / DT;
        assert!((f64::from(steps) - due).abs() < 1.0 + 1e-6, "{frame}: {steps} of {due}");
        let slowness = clock.slowness().unwrap();
        // A span is at least half a second: 30 steps, one more or less.
        assert!((slowness - 1.0).abs() < 1.0 / 29.0, "{frame}: {slowness}");
    }
}

#[test]
fn a_slow_machine_falls_behind_and_does_not_rush_after() {
    let mut clock = Clock::default();
    for _ in 0..40 {
        assert_eq!(clock.steps(10.0 * DT, DT), MOST_STEPS);
    }
    let slowness = clock.slowness().unwrap();
    assert!((slowness - 2.5).abs() < 1e-9, "{slowness}");
    // What was not simulated is forgotten.
    assert_eq!(clock.steps(0.4 * DT, DT), 0);
    assert_eq!(clock.steps(1e6, DT), MOST_STEPS);
    assert_eq!(clock.steps(0.4 * DT, DT), 0);
    assert_eq!(clock.steps(0.7 * DT, DT), 1);
    clock.stop();
    assert_eq!(clock.steps(0.95 * DT, DT), 0);
}

/// Bodies from 1 g to 10 t, and one that is long.
fn bodies() -> [(&'static str, ColliderBuilder); 4] {
    [
        ("ball of 1 g", ColliderBuilder::ball(0.01).mass(0.001)),
        ("box of 10 kg", ColliderBuilder::cuboid(0.2, 0.2, 0.2).mass(10.0)),
        ("rod of 1 kg", ColliderBuilder::cuboid(0.02, 0.6, 0.02).mass(1.0)),
        ("box of 10 t", ColliderBuilder::cuboid(1.0, 0.5, 2.0).mass(1e4)),
    ]
}

/// Where a held point is at the end of each step, as a share of its way, and how far from the line; m. It hangs under
/// gravity all the while.
fn course(collider: ColliderBuilder, offset: Vec3, way: Vec3, params: Params, steps: usize) -> Vec<(f32, f32)> {
    let mut scene = Scene::new();
    let start = Vec3::new(0.0, 5.0, 0.0);
    // So that the body itself, and not what lies under it, decides.
    let body = scene.insert(RigidBodyBuilder::dynamic().translation(start), collider).body;
    let mut world = World::new(scene, params, Backend::Cpu).unwrap();
    // From the front, at a point of the surface or of the middle.
    let eye = start + offset + Vec3::new(0.0, 0.0, 10.0);
    let grab = Grab::pick(&mut world, eye, -Vec3::Z, -Vec3::Z).unwrap().unwrap();
    assert_eq!(grab.body, body);
    let from = grab.point(&mut world).unwrap();
    let target = from + way;
    let mut course = Vec::new();
    for _ in 0..steps {
        grab.pull(&mut world, target).unwrap();
        world.step().unwrap();
        let gone = grab.point(&mut world).unwrap() - from;
        let share = gone.dot(way) / way.length_squared();
        course.push((share, (gone - share * way).length()));
    }
    course
}

#[test]
fn a_spring_brings_any_mass_to_the_cursor() {
    for (name, collider) in bodies() {
        // At the middle, and near an end of the rod, where pulling turns the body.
        for offset in [Vec3::ZERO, Vec3::new(0.0, 0.4, 0.0)] {
            if matches!(collider.shape, Shape::Ball { .. } if offset != Vec3::ZERO)
                || matches!(collider.shape, Shape::Cuboid { half_extents } if half_extents.y < offset.y)
            {
                continue;
            }
            for (dt, substeps) in [(1.0 / 60.0, 4), (1.0 / 240.0, 1), (1.0 / 20.0, 4)] {
                let params = Params { dt, accuracy: Accuracy::Substeps(substeps), ..Params::default() };
                let way = Vec3::new(1.0, 0.5, 0.0);
                let course = course(collider.clone(), offset, way, params, (1.5 / dt).round() as usize);
                let most = course.iter().fold(0.0, |most: f32, (share, _)| most.max(*share));
                let side = course.iter().fold(0.0, |most: f32, (_, side)| most.max(*side));
                let (share, left) = *course.last().unwrap();
                eprintln!(
                    "{name} at {offset}, dt {dt:.4}: {most:.4} of the way, {side:.4} m aside; ends at {share:.4}"
                );
                assert!(most < 1.03, "{name} at {offset}, dt {dt}: overshoots to {most}");
                assert!((share - 1.0).abs() < 0.01 && left < 0.01, "{name} at {offset}, dt {dt}: {share}, {left}");
            }
        }
    }
}

/// In the limit of short steps it goes as x = (1 + w t) e^(-w t), w = 20 rad/s.
#[test]
fn the_spring_is_critically_damped() {
    let params = Params { dt: 2e-4, accuracy: Accuracy::Substeps(1), ..Params::default() };
    let (_, collider) = bodies()[1].clone();
    let course = course(collider, Vec3::ZERO, Vec3::new(0.2, 0.0, 0.0), params, 1500);
    let mut worst = 0.0f32;
    for (i, (share, _)) in course.iter().enumerate() {
        let t = 20.0 * (i + 1) as f32 * 2e-4;
        let exact = 1.0 - (1.0 + t) * (-t).exp();
        worst = worst.max((share - exact).abs());
        assert!((share - exact).abs() < 0.02, "at w t = {t}: {share}, exactly {exact}");
    }
    eprintln!("off the exact course by {worst:.5} of the way at most");
}

#[test]
fn what_does_not_move_is_not_held() {
    let mut scene = Scene::new();
    scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    let at = |x: f32, z: f32| Vec3::new(x, 0.5, z);
    let wall = || ColliderBuilder::cuboid(0.5, 0.5, 0.1);
    scene.insert(RigidBodyBuilder::fixed().translation(at(0.0, 2.0)), wall());
    let behind = scene.insert(RigidBodyBuilder::dynamic().translation(at(0.0, 0.0)), wall()).body;
    scene.insert(RigidBodyBuilder::fixed().translation(at(3.0, 2.0)), wall());
    scene.insert(RigidBodyBuilder::kinematic_velocity_based().translation(at(6.0, 2.0)), wall());
    let mut world = World::new(scene, Params::default(), Backend::Cpu).unwrap();
    let mut pick = |origin: Vec3, direction: Vec3| Grab::pick(&mut world, origin, direction, direction).unwrap();
    // Walls are glass, and the floor is not.
    assert_eq!(pick(at(0.0, 9.0), -Vec3::Z).unwrap().body, behind);
    assert!(pick(at(3.0, 9.0), -Vec3::Z).is_none());
    assert!(pick(at(6.0, 9.0), -Vec3::Z).is_none());
    assert!(pick(Vec3::new(9.0, 5.0, 0.0), -Vec3::Y).is_none());
    assert!(pick(at(0.0, 9.0), Vec3::Z).is_none());
}
