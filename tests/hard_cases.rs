//! Cases with a formula, on both sides. Oracle: analysis, unless a test says otherwise. Each prints its row; see them
//! all with `cargo test --release --test hard_cases -- --nocapture --test-threads 1`.

mod common;

use std::f32::consts::PI;
use tumble::prelude::*;
use tumble_core::{Accuracy, measures, scenes};

/// Runs `case` on the CPU and on the GPU.
fn on_both(case: impl Fn(&str, &dyn Fn(Scene, Params) -> World)) {
    case("cpu", &|scene, params| World::new(scene, params, Backend::Cpu).expect("a valid scene"));
    case("gpu", &|scene, params| {
        let world = tumble_gpu::World::with_gpu(common::gpu().clone(), scene, params).expect("a valid scene");
        World::Gpu(Box::new(world))
    });
}

fn run(world: &mut World, steps: usize) {
    for _ in 0..steps {
        world.step().expect("step");
    }
}

fn row(case: &str, side: &str, measured: f64, exact: f64, within: &str) {
    println!("{case:<44} {side}  {measured:>12.6}  exact {exact:>12.6}  within {within}");
}

fn near(case: &str, side: &str, measured: f64, exact: f64, relative: f64) {
    row(case, side, measured, exact, &format!("{:.3} %", relative * 100.0));
    let error = (measured - exact).abs();
    assert!(error <= relative * exact.abs(), "{case} on {side}: {measured} for {exact}, off by {error}");
}

#[test]
fn free_fall_and_projectile() {
    on_both(|side, make| {
        for velocity in [Vec3::ZERO, Vec3::new(8.0, 12.0, -3.0)] {
            let (scene, body) = scenes::free_fall(velocity);
            let mut world = make(scene, Params::default());
            run(&mut world, 60);
            let end = world.poses().expect("poses")[body].translation.as_dvec3();
            let exact = velocity.as_dvec3() + glam::DVec3::new(0.0, -9.81 / 2.0, 0.0);
            near("free fall / projectile, path after 1 s, m", side, end.length(), exact.length(), 1e-5);
            assert!((end - exact).length() <= 1e-5 * exact.length(), "{end} for {exact}");
        }
    });
}

#[test]
fn sliding_box_stops_where_friction_says() {
    on_both(|side, make| {
        for mu in [0.2f32, 0.4, 0.7] {
            for degrees in [0.0f32, 35.0] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let (scene, body) = scenes::sliding_box(mu, 6.0 * Vec3::new(cos, 0.0, sin));
                let mut world = make(scene, Params::default());
                run(&mut world, (6.0 / (mu * 9.81) * 60.0) as usize + 30);
                let end = world.poses().expect("poses")[body].translation;
                let way = (end.x * end.x + end.z * end.z).sqrt();
                near(
                    &format!("sliding box, mu {mu}, {degrees} deg, m"),
                    side,
                    way.into(),
                    (36.0 / (2.0 * mu * 9.81)).into(),
                    0.01,
                );
            }
        }
    });
}

#[test]
fn friction_is_isotropic() {
    on_both(|side, make| {
        // The scene has nothing but directions: one box each, far apart.
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y).friction(0.5));
        let bodies: Vec<_> = (0..12)
            .map(|i| {
                let (sin, cos) = (i as f32 * PI / 6.0).sin_cos();
                let out = Vec3::new(cos, 0.0, sin);
                let body = RigidBodyBuilder::dynamic().translation(out * 20.0 + Vec3::Y * 0.25).linvel(out * 20.0);
                (out, scene.insert(body, ColliderBuilder::cuboid(0.5, 0.25, 0.5).friction(0.5)).body)
            })
            .collect();
        let mut world = make(scene, Params::default());
        run(&mut world, 290);
        let poses = world.poses().expect("poses");
        let ways: Vec<f32> = bodies.iter().map(|(out, b)| (poses[*b].translation - *out * 20.0).dot(*out)).collect();
        let (low, high) = ways.iter().fold((f32::MAX, f32::MIN), |(l, h), &w| (l.min(w), h.max(w)));
        row("friction isotropy, spread of 12 ways, m", side, (high - low).into(), 0.0, "0.01 m");
        assert!(high - low <= 0.01, "ways from {low} to {high}: {ways:?}");
    });
}

#[test]
fn ramp_slips_from_its_angle() {
    on_both(|side, make| {
        for mu in [0.1f32, 0.3, 0.5, 0.7, 1.0] {
            for (off, slips) in [(-0.5f32, false), (0.5, true)] {
                let angle = mu.atan() + off.to_radians();
                let (scene, body) = scenes::ramp(mu, angle);
                let mut world = make(scene, Params::default());
                // A box in doubt has 3 s to show: at half a degree above it slips at 0.08 m/s².
                run(&mut world, 60);
                let before = world.poses().expect("poses")[body].translation;
                run(&mut world, 120);
                let way = (world.poses().expect("poses")[body].translation - before).length();
                row(&format!("ramp, mu {mu}, {off:+} deg, way in 2 s, m"), side, way.into(), 0.0, "slips above 0.05");
                assert_eq!(way > 0.05, slips, "mu {mu}, {off} degrees off on {side}: {way} m in 2 s");
            }
        }
    });
}

#[test]
fn restitution_gives_back_its_share() {
    on_both(|side, make| {
        for e in [0.5f32, 0.8, 1.0] {
            let height = 5.0f32;
            let (scene, body) = scenes::bouncing_ball(e, height);
            let mut world = make(scene, Params::default());
            let (mut lowest_seen, mut peak) = (false, 0.0f32);
            for _ in 0..260 {
                world.step().expect("step");
                let y = world.poses().expect("poses")[body].translation.y - 0.5;
                lowest_seen |= y < 0.3;
                if lowest_seen {
                    let up = world.velocities().expect("velocities")[body].linear.y;
                    peak = peak.max(y);
                    if up < 0.0 && y > 0.3 {
                        break;
                    }
                }
            }
            // Between steps the true top is at most g dt² / 8 higher.
            near(&format!("restitution {e}, height, m"), side, peak.into(), (e * e * height).into(), 0.02);
            assert!(e < 1.0 || peak <= height, "e = 1 gained {} m", peak - height);
        }
    });
}

#[test]
fn ball_slips_then_rolls() {
    on_both(|side, make| {
        let (mu, speed) = (0.3f32, 5.0f32);
        let (scene, body) = scenes::slip_to_roll(mu, speed);
        let mut world = make(scene, Params { dt: 1.0 / 240.0, ..Params::default() });
        let mut rolls = None;
        for step in 1..400 {
            world.step().expect("step");
            let v = world.velocities().expect("velocities")[body];
            // Slip speed of the lowest point.
            if rolls.is_none() && (v.linear.x + 0.5 * v.angular.z).abs() < 0.005 {
                rolls = Some(step as f64 / 240.0);
            }
        }
        let end = world.velocities().expect("velocities")[body].linear.x;
        near("slip to roll, final speed, m/s", side, end.into(), (speed * 5.0 / 7.0).into(), 0.005);
        // A step is 0.9 % of the time, and slip must fall below 0.1 % of the speed: one step of grace.
        let exact = f64::from(2.0 * speed / (7.0 * mu * 9.81));
        near("slip to roll, time, s", side, rolls.expect("it rolls in the end"), exact, 0.005 + 1.0 / 240.0 / exact);
    });
}

#[test]
fn free_box_keeps_momentum_and_energy() {
    on_both(|side, make| {
        let (scene, _) = scenes::free_box();
        let mut world = make(scene.clone(), Params::default());
        let state = |world: &mut World| {
            let (poses, velocities) = (world.poses().expect("poses"), world.velocities().expect("velocities"));
            let momentum = measures::angular_momentum(&scene, &poses, &velocities);
            (momentum, measures::kinetic_energy(&scene, &poses, &velocities))
        };
        let (l0, e0) = state(&mut world);
        run(&mut world, 600);
        let (l1, e1) = state(&mut world);
        let drift = (l1 - l0).length() / l0.length();
        row("free box 10 s, angular momentum, relative", side, drift, 0.0, "1 %");
        row("free box 10 s, energy, relative", side, e1 / e0 - 1.0, 0.0, "1 %");
        assert!(drift < 0.01 && (e1 / e0 - 1.0).abs() < 0.01);
    });
}

#[test]
fn closed_system_keeps_momentum() {
    on_both(|side, make| {
        let drifts: Vec<f64> = [60.0f32, 240.0]
            .into_iter()
            .map(|rate| {
                let scene = scenes::closed_system(120);
                let mut world = make(scene.clone(), Params { dt: 1.0 / rate, ..Params::default() });
                let state = |world: &mut World| {
                    let (poses, velocities) = (world.poses().expect("poses"), world.velocities().expect("velocities"));
                    let p = measures::linear_momentum(&scene, &velocities);
                    (p, measures::angular_momentum(&scene, &poses, &velocities))
                };
                let scale: f64 = {
                    let velocities = world.velocities().expect("velocities");
                    let mass = |b| f64::from(scene.mass_properties(b).expect("living").mass);
                    scene.bodies().map(|b| mass(b) * f64::from(velocities[b].linear.length())).sum()
                };
                let (p0, l0) = state(&mut world);
                run(&mut world, 2 * rate as usize);
                let (p1, l1) = state(&mut world);
                let linear = (p1 - p0).length() / scale;
                row(&format!("closed system, dt 1/{rate}, linear / sum |p|"), side, linear, 0.0, "1e-6");
                assert!(linear < 1e-6, "linear momentum drifts by {linear}");
                (l1 - l0).length() / scale
            })
            .collect();
        row("closed system, angular, dt 1/60, m", side, drifts[0], 0.0, "");
        row("closed system, angular, dt 1/240, m", side, drifts[1], 0.0, "falls with dt");
        assert!(drifts[1] < drifts[0] && drifts[0] < 1e-2, "{drifts:?}");
    });
}

#[test]
fn cradle_hands_on_its_speed() {
    on_both(|side, make| {
        for gap in [1e-3f32, 0.0] {
            let (scene, balls) = scenes::cradle(1.0, gap);
            let mut world = make(scene, Params::default());
            run(&mut world, 90);
            let velocities = world.velocities().expect("velocities");
            let speeds: Vec<f32> = balls.iter().map(|b| velocities[*b].linear.x).collect();
            row(&format!("cradle, gap {gap} m, last ball, m/s"), side, speeds[4].into(), 1.0, "said, not asserted");
            // Momentum stays; how much goes with the last ball is what one pass of restitution reaches.
            assert!((speeds.iter().sum::<f32>() - 1.0).abs() < 1e-4, "{speeds:?}");
            assert!(speeds.iter().map(|v| v * v).sum::<f32>() <= 1.0 + 1e-4, "energy gained: {speeds:?}");
        }
    });
}

#[test]
fn a_bullet_stops_at_a_thin_wall() {
    on_both(|side, make| {
        let (scene, body) = scenes::bullet();
        let mut world = make(scene, Params::default());
        run(&mut world, 30);
        let x = world.poses().expect("poses")[body].translation.x;
        row("bullet 200 m/s, 0.1 m wall, x, m", side, x.into(), -0.15, "stays before");
        assert!(x < -0.1, "the bullet is at {x}");
    });
}

#[test]
fn overlap_leaves_slowly() {
    on_both(|side, make| {
        let (scene, bodies) = scenes::overlap_cube();
        let mut world = make(scene, Params::default());
        let mut fastest = 0.0f32;
        for _ in 0..60 {
            world.step().expect("step");
            let velocities = world.velocities().expect("velocities");
            fastest = bodies.iter().map(|b| velocities[*b].linear.length()).fold(fastest, f32::max);
        }
        row("25 % overlap, fastest, m/s", side, fastest.into(), 3.0, "at most");
        assert!(fastest <= 3.0, "a body left at {fastest} m/s");
    });
}

#[test]
fn odd_parameters_stay_finite() {
    on_both(|side, make| {
        let odd = [(1.0 / 15.0, 4), (1.0 / 240.0, 4), (1.0 / 60.0, 1), (1.0 / 60.0, 32)];
        for (dt, substeps) in odd {
            for gravity in [0.0f32, 9.81, 1000.0] {
                let mut scene = scenes::mixed(40);
                scene.gravity = Vec3::new(0.0, -gravity, 0.0);
                let mut world =
                    make(scene.clone(), Params { dt, accuracy: Accuracy::Substeps(substeps), ..Params::default() });
                run(&mut world, 40);
                let (poses, velocities) = (world.poses().expect("poses"), world.velocities().expect("velocities"));
                let energy = measures::kinetic_energy(&scene, &poses, &velocities);
                let report = world.sync().expect("report");
                row(&format!("dt {dt:.4}, {substeps} sub-steps, g {gravity}, J"), side, energy, 0.0, "finite");
                assert!(energy.is_finite() && report.quarantined == 0 && report.lost == 0, "{report}");
            }
        }
    });
}

#[test]
fn spinning_boxes_do_not_pass_a_wall() {
    on_both(|side, make| {
        // (half extents, speed m/s, spin rad/s)
        let cases = [
            ("box 180 m/s, 30 rad/s", Vec3::splat(0.1), 180.0, Vec3::new(0.0, 30.0, 10.0)),
            ("stick 100 m/s, 50 rad/s", Vec3::new(0.5, 0.02, 0.02), 100.0, Vec3::new(0.0, 0.0, 50.0)),
            ("stick 100 m/s, -50 rad/s", Vec3::new(0.5, 0.02, 0.02), 100.0, Vec3::new(0.0, 0.0, -50.0)),
            ("stick 100 m/s, 20 rad/s", Vec3::new(0.5, 0.02, 0.02), 100.0, Vec3::new(0.0, 0.0, 20.0)),
            ("stick 100 m/s, 80 rad/s", Vec3::new(0.5, 0.02, 0.02), 100.0, Vec3::new(5.0, 0.0, 80.0)),
        ];
        for (name, half, speed, spin) in cases {
            let mut scene = Scene::new();
            scene.gravity = Vec3::ZERO;
            scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(0.1, 20.0, 20.0));
            let body = RigidBodyBuilder::dynamic().translation(Vec3::new(-5.0, 0.0, 0.0));
            let body = body.linvel(Vec3::X * speed).angvel(spin);
            let body = scene.insert(body, ColliderBuilder::cuboid(half.x, half.y, half.z).density(1000.0)).body;
            let mut world = make(scene, Params::default());
            let mut farthest = f32::MIN;
            for _ in 0..60 {
                world.step().expect("step");
                farthest = farthest.max(world.poses().expect("poses")[body].translation.x);
            }
            row(&format!("{name}, 0.2 m wall, farthest x, m"), side, farthest.into(), -0.1, "stays before");
            let end = world.poses().expect("poses")[body].translation.x;
            assert!(farthest <= -0.1 && end < -0.1, "{name} on {side}: the middle came to {farthest}, ends at {end}");
        }
    });
}

/// A stack of six boxes of 1 m, 1, 5 and 20 km from the origin. Half a unit in the last place of its coordinates is
/// 0.03, 0.24 and 1 mm there; what the solver does in between is relative to the bodies.
#[test]
fn stacks_far_from_the_origin() {
    on_both(|side, make| {
        for kilometres in [1.0f32, 5.0, 20.0] {
            let away = Vec3::new(1000.0 * kilometres, 0.0, 0.0);
            let mut scene = Scene::new();
            scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y).friction(0.6));
            let bodies: Vec<_> = (0..6)
                .map(|i| {
                    let body = RigidBodyBuilder::dynamic().translation(away + Vec3::Y * (0.5 + i as f32));
                    scene.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).friction(0.6)).body
                })
                .collect();
            let mut world = make(scene.clone(), Params::default());
            run(&mut world, 300);
            let poses = world.poses().expect("poses");
            let aside = bodies.iter().map(|b| (poses[*b].translation - away).with_y(0.0).length()).fold(0.0, f32::max);
            let deepest = measures::penetration(&scene, &poses).max_m * 1e3;
            row(&format!("6-stack at {kilometres} km, deepest, mm"), side, deepest, 2.77, "said");
            row(&format!("6-stack at {kilometres} km, sideways, m"), side, aside.into(), 0.0, "0.05 up to 5 km");
            assert!(kilometres > 5.0 || aside < 0.05, "the stack at {kilometres} km drifted by {aside} m");
        }
    });
}
