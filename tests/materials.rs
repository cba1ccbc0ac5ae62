//! Resistance against rolling and twisting, and surfaces that move, on both sides and by every solver. Oracle: analysis.
//! Each prints its row: `cargo test --release --test materials -- --nocapture --test-threads 1`.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use tumble::prelude::*;
use tumble_core::{OnePass, Soft, Solver, Velocities, measures, scenes};
use worlds::{SIDES, steps};

const G: f32 = 9.81;
const DT: f32 = 1.0 / 60.0;

/// Every side with every solver.
fn on_all(case: impl Fn(&str, &dyn Fn(Scene) -> World)) {
    for side in SIDES {
        for solver in [Solver::OnePass(OnePass::default()), Solver::Soft(Soft::default())] {
            let params = Params { solver, ..Params::default() };
            case(&format!("{side:?}, {solver}"), &|scene| side.world(&scene, &params));
        }
    }
}

fn row(case: &str, by: &str, measured: f32, exact: f32, within: f32) {
    println!("{case:<44} {by:<14}  {measured:>10.5}  exact {exact:>10.5}  within {within:.0e}");
    assert!((measured - exact).abs() <= within, "{case}, {by}: {measured} for {exact}");
}

fn speeds(velocities: &Velocities, body: BodyHandle) -> [f32; 2] {
    let velocity = velocities[body];
    [velocity.linear.length(), velocity.angular.length()]
}

/// Oracle: I dw/dt about the point of contact, 7/5 m r² dw/dt = -resistance r m g.
#[test]
fn a_rolling_ball_is_slowed_and_stops() {
    on_all(|by, make| {
        for (resistance, speed) in [(0.1f32, 3.0f32), (0.02, 1.0)] {
            let slows = 5.0 / 7.0 * resistance * G;
            let (scene, body) = scenes::rolling_ball(resistance, speed);
            let mut world = make(scene);
            let half = (0.5 * speed / slows / DT) as usize;
            steps(&mut world, half);
            let [linear, angular] = speeds(&world.velocities().unwrap(), body);
            let exact = speed - slows * half as f32 * DT;
            row(&format!("rolling, resistance {resistance}, m/s half way"), by, linear, exact, 1e-3 * speed);
            row("  does not slip, m/s", by, 0.5 * angular, linear, 1e-3 * speed);
            steps(&mut world, half + 60);
            let way = world.poses().unwrap()[body].translation.x;
            row("  way to rest, m", by, way, 0.5 * speed * speed / slows, 5e-3 * speed * speed / slows);
            let [linear, angular] = speeds(&world.velocities().unwrap(), body);
            row("  at rest, m/s", by, linear.max(angular), 0.0, 1e-4);
        }
    });
}

/// Oracle: the normal force moves by resistance r at most, so a ball rolls from atan(resistance) on.
#[test]
fn a_ball_rests_on_slopes_up_to_its_resistance() {
    on_all(|by, make| {
        let resistance = 0.2f32;
        for (share, rolls) in [(0.95f32, false), (1.1, true)] {
            let angle = (share * resistance).atan();
            let (scene, body) = scenes::ball_on_slope(resistance, angle);
            let start = scene.body(body).unwrap().translation;
            let mut world = make(scene);
            steps(&mut world, 300);
            let velocities = world.velocities().unwrap();
            let way = (world.poses().unwrap()[body].translation - start).length();
            let [linear, angular] = speeds(&velocities, body);
            if rolls {
                let gains = 5.0 / 7.0 * G * (angle.sin() - resistance * angle.cos());
                row("slope of 1.1 resistance, m/s after 5 s", by, linear, 5.0 * gains, 0.02 * 5.0 * gains);
            } else {
                row("slope of 0.95 resistance, m after 5 s", by, way, 0.0, 1e-3);
                row("  speed", by, linear.max(angular), 0.0, 1e-4);
            }
        }
    });
}

/// Oracle: torque = resistance radius m g, so the spin ends after I w / torque.
#[test]
fn spin_ends_when_the_torque_has_taken_it() {
    on_all(|by, make| {
        let (resistance, spin) = (0.1f32, 6.0f32);
        let (scene, [ball, cuboid]) = scenes::spinning(resistance, spin);
        // I over m and radius: 2/5 r; (1 + 1) / 12 over 0.25 m.
        let slows = |arm: f32| resistance * G / arm;
        let arms = [(ball, "ball", 0.4 * 0.5), (cuboid, "box", 2.0 / 12.0 / 0.25)];
        let mut world = make(scene);
        let mut done = 0;
        for (body, name, arm) in arms {
            let half = (0.5 * spin / slows(arm) / DT) as usize;
            steps(&mut world, half - done);
            let velocities = world.velocities().unwrap();
            let exact = spin - slows(arm) * half as f32 * DT;
            row(&format!("spinning {name}, rad/s half way"), by, velocities[body].angular.y, exact, 0.01 * spin);
            steps(&mut world, half + 12);
            done = 2 * half + 12;
            row("  at rest, rad/s", by, speeds(&world.velocities().unwrap(), body)[1], 0.0, 1e-4);
        }
    });
}

/// Oracle: without resistance the same column falls; with it the force goes through the middle fifth of every ball. Soft
/// contacts sink by load / (mass (2 pi f)²) each, 6 cm in all here. Without overshoot the one pass drifts by 14 mm.
#[test]
fn a_column_of_balls_stands() {
    on_all(|by, make| {
        let scene = scenes::ball_column(30, 0.1);
        let bodies: Vec<_> = scene.bodies().skip(1).collect();
        let start: Vec<_> = bodies.iter().map(|&b| scene.body(b).unwrap().translation).collect();
        let mut world = make(scene.clone());
        steps(&mut world, 600);
        let (poses, velocities) = (world.poses().unwrap(), world.velocities().unwrap());
        let moved = bodies.iter().zip(&start).map(|(&b, &s)| poses[b].translation - s);
        let drift = moved.clone().map(|m| m.x.hypot(m.z)).fold(0.0, f32::max);
        let sink = moved.map(|m| -m.y).fold(0.0, f32::max);
        let speed = bodies.iter().map(|&b| speeds(&velocities, b)[0]).fold(0.0, f32::max);
        let soft = by.contains("soft");
        row("30 balls, 10 s: sink, m", by, sink, 0.0, if soft { 0.07 } else { 1e-3 });
        row("  deepest overlap, m", by, measures::penetration(&scene, &poses).max_m as f32, 0.0, 5e-3);
        row("  sideways drift, m", by, drift, 0.0, 5e-3);
        row("  speed left, m/s", by, speed, 0.0, 1e-3);
    });
    let scene = scenes::ball_column(30, 0.0);
    let mut world = worlds::Side::Cpu.world(&scene, &Params::default());
    steps(&mut world, 600);
    let top = world.poses().unwrap()[scene.bodies().last().unwrap()].translation.y;
    assert!(top < 15.0, "without resistance it stands too, its top at {top} m");
}

/// Oracle: friction pulls with mu g until the box goes as fast as the belt.
#[test]
fn a_belt_carries_a_box_along() {
    on_all(|by, make| {
        let (mu, speed) = (0.3f32, 1.0f32);
        // A part across the contact is of no account.
        let velocity = Vec3::new(0.6, 0.7, -0.8) * speed;
        let along = Vec3::new(0.6, 0.0, -0.8);
        let (scene, body) = scenes::conveyor(mu, velocity);
        let mut world = make(scene);
        let until = (speed / (mu * G) / DT) as usize;
        steps(&mut world, until / 2);
        let linear = world.velocities().unwrap()[body].linear;
        row("belt, m/s half way", by, linear.dot(along), mu * G * (until / 2) as f32 * DT, 0.01);
        row("  aside, m/s", by, (linear - linear.dot(along) * along).length(), 0.0, 5e-3);
        steps(&mut world, until - until / 2 + 2);
        for wait in [0, 120] {
            steps(&mut world, wait);
            let velocity = world.velocities().unwrap()[body];
            row("  of the belt's speed, m/s", by, velocity.linear.dot(along), speed, 1e-3);
            row("  off it, m/s, rad/s", by, (velocity.linear - along * speed).length(), 0.0, 1e-3);
            row("  turning, rad/s", by, velocity.angular.length(), 0.0, 1e-3);
        }
    });
}

/// What comes by an edit resists and runs as what was there at first. Oracle: the scene that had it from the start.
#[test]
fn edits_bring_materials() {
    for side in SIDES {
        let floor = || ColliderBuilder::cuboid(20.0, 0.5, 20.0).surface_velocity(Vec3::new(0.5, 0.0, 0.2));
        let ball = || ColliderBuilder::ball(0.5).rolling_resistance(0.3).twisting_resistance(0.2);
        let below = || RigidBodyBuilder::fixed().translation(Vec3::NEG_Y * 0.5);
        let thrown = || RigidBodyBuilder::dynamic().translation(Vec3::Y * 0.5).angvel(Vec3::new(1.0, 5.0, 2.0));
        let mut scene = Scene::new();
        scene.insert(below(), floor());
        scene.insert(thrown(), ball());
        let mut first = side.world(&scene, &Params::default());
        let mut later = side.world(&Scene::new(), &Params::default());
        later.edit().insert(below(), floor()).unwrap();
        later.edit().insert(thrown(), ball()).unwrap();
        for world in [&mut first, &mut later] {
            steps(world, 60);
        }
        assert_eq!(worlds::hash(&mut first), worlds::hash(&mut later), "{side:?}");
        let body = first.scene().bodies().nth(1).unwrap();
        let [linear, _] = speeds(&first.velocities().unwrap(), body);
        assert!(linear > 0.3, "{side:?}: the belt has not pulled: {linear}");
    }
}
