//! Resistance against rolling and twisting, and surfaces that move, on both sides and by every solver. Oracle: analysis.
//! Each prints its rows: `cargo test --release --test materials -- --nocapture --test-threads 1`.

mod common;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use tumble::prelude::*;
use tumble_bench::hard_cases::{Ask, By, Case};
use tumble_core::{OnePass, Soft, Solver, Velocities, measures, scenes};
use worlds::{SIDES, Side, steps};

const G: f32 = 9.81;
const DT: f32 = 1.0 / 60.0;

/// One case by one side and solver. Those of the default solver come into the table of hard cases.
struct Rows<'a> {
    case: &'a Case,
    side: Side,
    solver: Solver,
}

impl Rows<'_> {
    fn row(&self, quantity: &str, unit: &str, measured: f32, exact: f32, within: f32) {
        let (by, solver) = (if self.side == Side::Cpu { By::Cpu } else { By::Gpu }, self.solver);
        if solver == Solver::default() {
            let ask = Ask::Near(exact.into(), within.into());
            self.case.row(by, Params::default().accuracy.most(), quantity, unit, measured.into(), ask);
        } else {
            println!("{quantity:<44} {by:?}, {solver}: {measured:>10.5}  exact {exact:>10.5}  within {within:.0e}");
        }
        let held = (measured - exact).abs() <= within;
        assert!(held, "{}, {quantity}, {by:?}, {solver}: {measured} for {exact}", self.case.name());
    }
}

/// Every side with every solver.
fn on_all(row: &str, name: &str, run: impl Fn(&Rows, &dyn Fn(Scene) -> World)) {
    let case = Case::new(row, name);
    for side in SIDES {
        for solver in [Solver::OnePass(OnePass::default()), Solver::Soft(Soft::default())] {
            let params = Params { solver, ..Params::default() };
            run(&Rows { case: &case, side, solver }, &|scene| side.world(&scene, &params));
        }
    }
}

fn speeds(velocities: &Velocities, body: BodyHandle) -> [f32; 2] {
    let velocity = velocities[body];
    [velocity.linear.length(), velocity.angular.length()]
}

/// Oracle: I dw/dt about the point of contact, 7/5 m r² dw/dt = -resistance r m g.
#[test]
fn a_rolling_ball_is_slowed_and_stops() {
    on_all("A11", "rolling ball, resistance", |by, make| {
        for (resistance, speed) in [(0.1f32, 3.0f32), (0.02, 1.0)] {
            let slows = 5.0 / 7.0 * resistance * G;
            let (scene, body) = scenes::rolling_ball(resistance, speed);
            let mut world = make(scene);
            let half = (0.5 * speed / slows / DT) as usize;
            steps(&mut world, half);
            let [linear, angular] = speeds(&world.velocities().unwrap(), body);
            let exact = speed - slows * half as f32 * DT;
            by.row(&format!("speed half way, {resistance}"), "m/s", linear, exact, 1e-3 * speed);
            by.row(&format!("surface speed half way, {resistance}"), "m/s", 0.5 * angular, linear, 1e-3 * speed);
            steps(&mut world, half + 60);
            let way = world.poses().unwrap()[body].translation.x;
            by.row(
                &format!("way to rest, {resistance}"),
                "m",
                way,
                0.5 * speed * speed / slows,
                5e-3 * speed * speed / slows,
            );
            let [linear, angular] = speeds(&world.velocities().unwrap(), body);
            by.row(&format!("speed at rest, {resistance}"), "m/s", linear.max(angular), 0.0, 1e-4);
        }
    });
}

/// Oracle: the normal force moves by resistance r at most, so a ball rolls from atan(resistance) on.
#[test]
fn a_ball_rests_on_slopes_up_to_its_resistance() {
    on_all("A12", "ball on a slope, rolling resistance 0.2", |by, make| {
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
                by.row("speed after 5 s, slope of 1.1 times it", "m/s", linear, 5.0 * gains, 0.02 * 5.0 * gains);
            } else {
                by.row("way after 5 s, slope of 0.95 times it", "m", way, 0.0, 1e-3);
                by.row("speed after 5 s, slope of 0.95 times it", "m/s", linear.max(angular), 0.0, 1e-4);
            }
        }
    });
}

/// Oracle: torque = resistance radius m g, so the spin ends after I w / torque.
#[test]
fn spin_ends_when_the_torque_has_taken_it() {
    on_all("A13", "spin, twisting resistance 0.1", |by, make| {
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
            by.row(&format!("{name}, spin half way"), "rad/s", velocities[body].angular.y, exact, 0.01 * spin);
            steps(&mut world, half + 12);
            done = 2 * half + 12;
            by.row(&format!("{name}, spin at rest"), "rad/s", speeds(&world.velocities().unwrap(), body)[1], 0.0, 1e-4);
        }
    });
}

/// Oracle: without resistance the same column falls; with it the force goes through the middle fifth of every ball. Soft
/// contacts sink by load / (mass (2 pi f)²) each, 6 cm in all here. Without overshoot the one pass drifts by 14 mm.
#[test]
fn a_column_of_balls_stands() {
    on_all("B02", "column of 30 balls, resistance 0.1, 10 s", |by, make| {
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
        let soft = by.solver != Solver::default();
        by.row("sink", "m", sink, 0.0, if soft { 0.07 } else { 1e-3 });
        by.row("deepest overlap", "m", measures::penetration(&scene, &poses).max_m as f32, 0.0, 5e-3);
        by.row("sideways drift", "m", drift, 0.0, 5e-3);
        by.row("fastest body", "m/s", speed, 0.0, 1e-3);
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
    on_all("A14", "box on a belt of 1 m/s, mu 0.3", |by, make| {
        let (mu, speed) = (0.3f32, 1.0f32);
        // A part across the contact is of no account.
        let velocity = Vec3::new(0.6, 0.7, -0.8) * speed;
        let along = Vec3::new(0.6, 0.0, -0.8);
        let (scene, body) = scenes::conveyor(mu, velocity);
        let mut world = make(scene);
        let until = (speed / (mu * G) / DT) as usize;
        steps(&mut world, until / 2);
        let linear = world.velocities().unwrap()[body].linear;
        by.row("speed half way", "m/s", linear.dot(along), mu * G * (until / 2) as f32 * DT, 0.01);
        by.row("speed aside, half way", "m/s", (linear - linear.dot(along) * along).length(), 0.0, 5e-3);
        steps(&mut world, until - until / 2 + 2);
        for wait in [0, 120] {
            steps(&mut world, wait);
            let velocity = world.velocities().unwrap()[body];
            by.row(&format!("speed, {wait} steps later"), "m/s", velocity.linear.dot(along), speed, 1e-3);
            by.row(
                &format!("off the belt's velocity, {wait} steps later"),
                "m/s",
                (velocity.linear - along * speed).length(),
                0.0,
                1e-3,
            );
            by.row(&format!("turning, {wait} steps later"), "rad/s", velocity.angular.length(), 0.0, 1e-3);
        }
    });
}

/// What comes by an edit resists and runs as what was there at first, and what goes leaves nothing behind in its slots.
/// Oracle: the scene that had it from the start; and each of the three changes the motion.
#[test]
fn edits_bring_materials() {
    let insert = |material: [f32; 3], add: &mut dyn FnMut(RigidBodyBuilder, ColliderBuilder) -> BodyHandle| {
        let [belt, rolling, twisting] = material;
        let floor = ColliderBuilder::cuboid(20.0, 0.5, 20.0).surface_velocity(belt * Vec3::new(0.5, 0.0, 0.2));
        let ball = ColliderBuilder::ball(0.5).rolling_resistance(rolling).twisting_resistance(twisting);
        let thrown = RigidBodyBuilder::dynamic().translation(Vec3::Y * 0.5).angvel(Vec3::new(1.0, 5.0, 2.0));
        [add(RigidBodyBuilder::fixed().translation(Vec3::NEG_Y * 0.5), floor), add(thrown, ball)]
    };
    let by_edit = |world: &mut World, material| {
        insert(material, &mut |body, collider| world.edit().insert(body, collider).unwrap().body)
    };
    let after = |world: &mut World| {
        steps(world, 60);
        worlds::hash(world)
    };
    for side in SIDES {
        let all = [[1.0, 0.3, 0.2], [0.0, 0.3, 0.2], [1.0, 0.0, 0.2], [1.0, 0.3, 0.0], [0.0; 3]];
        let found = all.map(|material| {
            let mut scene = Scene::new();
            insert(material, &mut |body, collider| scene.insert(body, collider).body);
            let expected = after(&mut side.world(&scene, &Params::default()));
            let mut world = side.world(&Scene::new(), &Params::default());
            by_edit(&mut world, material);
            assert_eq!(after(&mut world), expected, "{side:?}: inserted with {material:?}");
            // The slots had all of it before, and the last one freed is the first one used.
            let mut world = side.world(&Scene::new(), &Params::default());
            let [floor, ball] = by_edit(&mut world, all[0]);
            steps(&mut world, 20);
            world.edit().remove(ball).unwrap();
            world.edit().remove(floor).unwrap();
            steps(&mut world, 1);
            by_edit(&mut world, material);
            assert_eq!(after(&mut world), expected, "{side:?}: in used slots, with {material:?}");
            expected
        });
        let different: std::collections::HashSet<_> = found.into_iter().collect();
        assert_eq!(different.len(), all.len(), "{side:?}: what is left out changes nothing: {found:?}");
    }
}
