//! Extremes: what is fast, crowded, far away, of odd sizes or numbers, or wrong, on both sides; beside rapier where
//! nothing says what is right. See the rows with `cargo test --release --test extremes -- --nocapture --test-threads 1`.

#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/beside.rs"]
mod beside;
mod common;

use beside::{Any, SUBSTEPS, ours, substeps};
use tumble::prelude::*;
use tumble_bench::hard_cases::{Ask, By, Case};
use tumble_core::{Accuracy, measures, scenes};

fn run(world: &mut World, steps: usize) {
    for _ in 0..steps {
        world.step().expect("step");
    }
}

/// Records a number of one of our sides with its usual sub-steps, and asserts what is asked of it.
#[track_caller]
fn row(case: &Case, by: By, quantity: &str, unit: &str, value: f64, ask: Ask) {
    assert!(case.row(by, SUBSTEPS, quantity, unit, value, ask), "{by:?}: {quantity}: {value} {unit} for {ask:?}");
}

/// What was lost or put in quarantine.
fn spoilt(world: &mut World) -> f64 {
    let report = world.sync().expect("report");
    report.lost as f64 + f64::from(report.quarantined)
}

#[test]
fn a_bullet_stops_at_a_thin_wall() {
    let case = Case::new("D01", "ball r 0.1 m at 200 m/s, wall of 0.1 m");
    for by in By::OURS {
        let (scene, body) = scenes::bullet();
        let mut world = ours(by, scene, Params::default());
        let mut farthest = f32::MIN;
        for _ in 0..30 {
            run(&mut world, 1);
            farthest = farthest.max(world.poses().expect("poses")[body].translation.x);
        }
        row(&case, by, "farthest, centre of the wall at 0", "m", farthest.into(), Ask::AtMost(-0.1));
    }
}

/// The middle stays before the wall's face at -0.1 m.
#[test]
fn spinning_boxes_do_not_pass_a_wall() {
    let case = Case::new("D02", "spinning, wall of 0.2 m");
    // (half extents, speed m/s, spin rad/s)
    let cases = [
        ("box 180 m/s, 30 rad/s", Vec3::splat(0.1), 180.0, Vec3::new(0.0, 30.0, 10.0)),
        ("stick 100 m/s, 50 rad/s", Vec3::new(0.5, 0.02, 0.02), 100.0, Vec3::new(0.0, 0.0, 50.0)),
        ("stick 100 m/s, -50 rad/s", Vec3::new(0.5, 0.02, 0.02), 100.0, Vec3::new(0.0, 0.0, -50.0)),
        ("stick 100 m/s, 20 rad/s", Vec3::new(0.5, 0.02, 0.02), 100.0, Vec3::new(0.0, 0.0, 20.0)),
        ("stick 100 m/s, 80 rad/s", Vec3::new(0.5, 0.02, 0.02), 100.0, Vec3::new(5.0, 0.0, 80.0)),
    ];
    for by in By::OURS {
        for (name, half, speed, spin) in cases {
            let mut scene = Scene::new();
            scene.gravity = Vec3::ZERO;
            scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(0.1, 20.0, 20.0));
            let body = RigidBodyBuilder::dynamic().translation(Vec3::new(-5.0, 0.0, 0.0));
            let body = body.linvel(Vec3::X * speed).angvel(spin);
            let body = scene.insert(body, ColliderBuilder::cuboid(half.x, half.y, half.z).density(1000.0)).body;
            let mut world = ours(by, scene, Params::default());
            let mut farthest = f32::MIN;
            for _ in 0..60 {
                run(&mut world, 1);
                farthest = farthest.max(world.poses().expect("poses")[body].translation.x);
            }
            row(&case, by, &format!("{name}, farthest"), "m", farthest.into(), Ask::AtMost(-0.1));
        }
    }
}

#[test]
fn overlap_leaves_slowly() {
    let case = Case::new("D03", "4 x 4 x 4 boxes, 25 % overlap");
    for by in By::ALL {
        let (scene, bodies) = scenes::overlap_cube();
        let mut world = Any::new(by, &scene, Params::default());
        let mut fastest = 0.0f32;
        for _ in 0..60 {
            world.steps(1);
            let velocities = world.state().1;
            fastest = bodies.iter().map(|b| velocities[*b].linear.length()).fold(fastest, f32::max);
        }
        let ask = if by == By::Rapier { Ask::Said } else { Ask::AtMost(3.0) };
        let held = case.row(by, substeps(by, SUBSTEPS), "fastest body", "m/s", fastest.into(), ask);
        assert!(held, "{by:?}: a body left at {fastest} m/s");
    }
}

/// 12.5 million pairs, with 16 MiB an array: an error that counts them, and the last good state.
#[test]
fn five_thousand_at_one_point() {
    let case = Case::new("D04", "5,000 balls at one point");
    for by in By::OURS {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        for _ in 0..5000 {
            scene.insert(RigidBodyBuilder::dynamic().translation(Vec3::Y * 3.0), ColliderBuilder::ball(0.5));
        }
        let capacities = Capacities { max_array_bytes: 16 << 20, ..Capacities::default() };
        let mut world = ours(by, scene, Params { capacities, ..Params::default() });
        let error = world.step().and_then(|()| world.sync()).unwrap_err();
        let Error::Capacity { buffer: "pairs", needed, .. } = error else { panic!("{error}") };
        row(&case, by, "pairs that Error::Capacity counts", "1", needed as f64, Ask::Near(12_497_500.0, 0.0));
        let poses = world.poses().expect("the last good state");
        let still = poses.iter().filter(|p| p.translation == Vec3::Y * 3.0).count();
        row(&case, by, "bodies where they were", "1", still as f64, Ask::AtLeast(5000.0));
    }
    // Few enough that their pairs fit.
    let case = Case::new("D04", "200 balls and boxes at one point, 1 s");
    for by in By::ALL {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
        for i in 0..200 {
            let shape = if i % 2 == 0 { ColliderBuilder::ball(0.2) } else { ColliderBuilder::cuboid(0.2, 0.2, 0.2) };
            scene.insert(RigidBodyBuilder::dynamic().translation(Vec3::Y * 3.0), shape);
        }
        let mut world = Any::new(by, &scene, Params::default());
        world.steps(60);
        let out = world.state().0.iter().map(|p| p.translation.length()).fold(0.0, f32::max);
        case.row(by, substeps(by, SUBSTEPS), "farthest body", "m", out.into(), Ask::Beside(1.0));
        if let Any::Ours(world) = &mut world {
            // Pushes of all that overlap add up: 29 m. What is asked is that it is finite.
            assert!(out < 100.0, "{by:?}: {out} m");
            row(&case, by, "lost or quarantined", "1", spoilt(world), Ask::AtMost(0.0));
        }
    }
}

/// A stack of six boxes of 1 m, 1, 5 and 20 km from the origin. Half a unit in the last place of its coordinates is
/// 0.03, 0.24 and 1 mm there; what the solver does in between is relative to the bodies.
#[test]
fn stacks_far_from_the_origin() {
    for kilometres in [1.0f32, 5.0, 20.0] {
        let case = Case::new("D05", &format!("stack of 6, {kilometres:>2} km from the origin, 5 s"));
        for by in By::ALL {
            let away = Vec3::new(1000.0 * kilometres, 0.0, 0.0);
            let mut scene = Scene::new();
            scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y).friction(0.6));
            let bodies: Vec<_> = (0..6)
                .map(|i| {
                    let body = RigidBodyBuilder::dynamic().translation(away + Vec3::Y * (0.5 + i as f32));
                    scene.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).friction(0.6)).body
                })
                .collect();
            let mut world = Any::new(by, &scene, Params::default());
            world.steps(300);
            let poses = world.state().0;
            let aside = bodies.iter().map(|b| (poses[*b].translation - away).with_y(0.0).length()).fold(0.0, f32::max);
            let deepest = measures::penetration(&scene, &poses).max_m * 1e3;
            let n = substeps(by, SUBSTEPS);
            case.row(by, n, "deepest overlap", "mm", deepest, Ask::Beside(0.1));
            case.row(by, n, "sideways drift", "mm", f64::from(aside) * 1e3, Ask::Beside(0.1));
            let bound = if kilometres > 5.0 { 0.1 } else { 0.05 };
            let held = by == By::Rapier || aside < bound && deepest < 0.1;
            assert!(held, "{by:?}: at {kilometres} km {aside} m aside, {deepest} mm deep");
        }
    }
}

/// Nothing is lost, nothing turns infinite, and no more energy is there than at the start, kinetic and potential.
#[test]
fn odd_parameters_stay_finite() {
    let case = Case::new("D06", "heap of 40 mixed, odd parameters, 40 steps");
    for by in By::OURS {
        for (dt, substeps) in [(1.0f32 / 15.0, 4), (1.0 / 240.0, 4), (1.0 / 60.0, 1), (1.0 / 60.0, 32)] {
            for gravity in [0.0f32, 9.81, 1000.0] {
                let mut scene = scenes::mixed(40);
                scene.gravity = Vec3::new(0.0, -gravity, 0.0);
                let energy = |poses: &Poses, velocities: &Velocities| {
                    measures::kinetic_energy(&scene, poses, velocities) + measures::potential_energy(&scene, poses)
                };
                let before = energy(&measures::initial_poses(&scene), &measures::initial_velocities(&scene));
                let mut world =
                    ours(by, scene.clone(), Params { dt, accuracy: Accuracy::Substeps(substeps), ..Params::default() });
                let mut gained = 0.0f64;
                for _ in 0..8 {
                    run(&mut world, 5);
                    let now = energy(&world.poses().expect("poses"), &world.velocities().expect("velocities"));
                    assert!(now.is_finite());
                    gained = gained.max((now - before) / before.max(1.0));
                }
                assert_eq!(spoilt(&mut world), 0.0, "{by:?}: dt {dt}, {substeps} sub-steps, g {gravity}");
                let what = format!("energy gained, share, dt 1/{:.0}, {substeps} sub-steps, g {gravity}", 1.0 / dt);
                let held = case.row(by, substeps, &what, "1", gained, Ask::AtMost(1e-4));
                assert!(held, "{by:?}: {what}: {gained}");
            }
        }
    }
}

/// Each value is refused when the world is made, by an error that names its field.
#[test]
fn bad_values_are_refused() {
    let case = Case::new("D07", "dt 0, mass 0, extent 0, NaN, infinite");
    let with = |body: RigidBodyBuilder, collider: ColliderBuilder, field: &'static str| {
        let mut scene = Scene::new();
        scene.insert(body, collider);
        (scene, Params::default(), field)
    };
    let (dynamic, ball) = (RigidBodyBuilder::dynamic, || ColliderBuilder::ball(0.5));
    for by in By::OURS {
        let bad = [
            (Scene::new(), Params { dt: 0.0, ..Params::default() }, "dt"),
            (Scene::new(), Params { dt: f32::NAN, ..Params::default() }, "dt"),
            with(dynamic(), ball().mass(0.0), "mass"),
            with(dynamic(), ball().density(f32::INFINITY), "density"),
            with(dynamic(), ColliderBuilder::ball(0.0), "ball.radius"),
            with(dynamic(), ColliderBuilder::cuboid(1.0, 0.0, 1.0), "cuboid.half_extents"),
            with(dynamic().translation(Vec3::X * f32::NAN), ball(), "translation"),
            with(dynamic().linvel(Vec3::X * f32::INFINITY), ball(), "linvel"),
        ];
        let count = bad.len() as f64;
        let refused = bad.into_iter().filter(|(scene, params, name)| {
            let made = match by {
                By::Cpu => World::new(scene.clone(), *params, Backend::Cpu).err(),
                _ => tumble_gpu::World::with_gpu(common::gpu().clone(), scene.clone(), *params).err(),
            };
            let named = matches!(&made, Some(Error::Invalid { field, .. }) if field == name);
            assert!(named, "{by:?}: {name}: {made:?}");
            named
        });
        row(&case, by, "refused by an error that names the field", "1", refused.count() as f64, Ask::AtLeast(count));
    }
}

/// A box of 1 km, one of 1 mm on it and one on the floor beside it. On top half a unit in the last place is 0.03 mm.
#[test]
fn a_millimetre_and_a_kilometre() {
    let case = Case::new("D08", "boxes of 1 mm and of 1 km, 5 s");
    for by in By::ALL {
        let mut scene = Scene::new();
        scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y).friction(0.6));
        let mut insert = |at: Vec3, half: f32| {
            let collider = ColliderBuilder::cuboid(half, half, half).density(1000.0).friction(0.6);
            (scene.insert(RigidBodyBuilder::dynamic().translation(at), collider).body, at)
        };
        let all = [
            ("large", insert(Vec3::Y * 500.0, 500.0)),
            ("small, on it", insert(Vec3::Y * 1000.0005, 5e-4)),
            ("small, on the floor", insert(Vec3::new(501.0, 5e-4, 0.0), 5e-4)),
        ];
        let mut world = Any::new(by, &scene, Params::default());
        world.steps(300);
        let poses = world.state().0;
        for (name, (body, at)) in all {
            let moved = f64::from((poses[body].translation - at).length()) * 1e3;
            case.row(by, substeps(by, SUBSTEPS), &format!("{name}, moved"), "mm", moved, Ask::Beside(0.1));
            assert!(by == By::Rapier || moved < 1.0, "{by:?}: {name} moved by {moved} mm");
        }
        if let Any::Ours(world) = &mut world {
            row(&case, by, "lost or quarantined", "1", spoilt(world), Ask::AtMost(0.0));
        }
    }
}

/// More contacts on one body than there are batches.
#[test]
fn a_hub_of_five_hundred() {
    let case = Case::new("D09", "plate under 500 bodies, 5 s");
    let scene = scenes::hub(500);
    for by in By::ALL {
        let mut world = Any::new(by, &scene, Params::default());
        world.steps(300);
        let n = substeps(by, SUBSTEPS);
        if let Any::Ours(world) = &mut world {
            let last = f64::from(world.sync().expect("report").last_batch);
            row(&case, by, "constraints in the last batch", "1", last, Ask::AtLeast(1.0));
        }
        let overlap = measures::penetration(&scene, &world.state().0);
        case.row(by, n, "deepest overlap", "mm", overlap.max_m * 1e3, Ask::Beside(0.1));
        case.row(by, n, "mean overlap", "mm", overlap.mean_m * 1e3, Ask::Beside(0.1));
        assert!(by == By::Rapier || overlap.max_m < 1e-4, "{by:?}: {overlap:?}");
    }
}

/// A ball 50 km away makes the cells of 30-bit codes 49 m wide: all of a column of 20 have the same. Oracle: brute force
/// finds the same pairs, and so gives the same bits.
#[test]
fn a_tower_of_equal_codes() {
    let case = Case::new("D10", "column of 20, all codes equal, 2 s");
    let mut scene = scenes::column(20);
    scene.insert(RigidBodyBuilder::fixed().translation(Vec3::splat(-50_000.0)), ColliderBuilder::ball(1.0));
    for by in By::OURS {
        let states = [Broadphase::Lbvh, Broadphase::BruteForce].map(|broadphase| {
            let mut world = ours(by, scene.clone(), Params { broadphase, ..Params::default() });
            run(&mut world, 120);
            world.poses().expect("poses").iter().copied().collect::<Vec<_>>()
        });
        let differ = states[0].iter().zip(&states[1]).filter(|(a, b)| a != b).count();
        row(&case, by, "bodies that differ from brute force's", "1", differ as f64, Ask::AtMost(0.0));
        let top = states[0].iter().map(|p| f64::from(p.translation.y)).fold(f64::MIN, f64::max);
        row(&case, by, "height of the top", "m", top, Ask::Near(19.5, 1e-3));
    }
}

#[test]
fn counts_around_a_workgroup() {
    let case = Case::new("D11", "0, 1, 2, 255, 256, 257 boxes, 1 s");
    for by in By::OURS {
        for bodies in [0usize, 1, 2, 255, 256, 257] {
            let scene = if bodies == 0 { Scene::new() } else { scenes::pile(bodies) };
            let mut world = ours(by, scene, Params::default());
            run(&mut world, 60);
            let poses = world.poses().expect("poses");
            let wrong = poses.iter().filter(|p| !p.translation.is_finite() || p.translation.y < -1.0).count();
            let wrong = wrong as f64 + spoilt(&mut world);
            row(&case, by, &format!("{bodies} boxes: lost, quarantined or fallen out"), "1", wrong, Ask::AtMost(0.0));
        }
    }
}
