//! Standard scenes: counts, packing, no overlap at the start. Oracle: analysis, and the measure of overlap (itself
//! tested in `measures.rs`).

use tumble_core::glam::{Mat3, Vec3};
use tumble_core::layout::{body_flags, shape_kind};
use tumble_core::measures::{initial_poses, initial_velocities, linear_momentum, penetration, state_hash};
use tumble_core::scenes::Crowd;
use tumble_core::{PackedScene, Penetration, Pose, Poses, RigidBodyType, Scene, Shape, scenes};

/// Dynamic bodies in a scene that packs.
fn dynamic(scene: &Scene) -> usize {
    let packed = PackedScene::new(scene).unwrap();
    tumble_core::validate::finite_states(&packed.states).unwrap();
    packed.states.iter().filter(|s| s.flags == body_flags::DYNAMIC).count()
}

fn overlap(scene: &Scene) -> f64 {
    penetration(scene, &initial_poses(scene)).max_m
}

fn hash(scene: &Scene) -> u64 {
    state_hash(&initial_poses(scene), &initial_velocities(scene))
}

#[test]
fn every_standard_scene_has_the_bodies_asked_for() {
    for standard in scenes::ALL {
        assert_eq!(scenes::find(standard.name).map(|s| s.name), Some(standard.name));
        for bodies in [0, 1, 2, 255, 256, 257, standard.default_bodies] {
            let scene = (standard.build)(bodies);
            let found = dynamic(&scene);
            if standard.name == "many_pyramids" && bodies >= 55 {
                assert_eq!(found, bodies / 55 * 55);
            } else if standard.name.ends_with("pyramid") || standard.name == "many_pyramids" {
                let base = (0..).take_while(|b| b * (b + 1) / 2 <= bodies).last().unwrap();
                assert_eq!(found, base * (base + 1) / 2);
            } else {
                // Nets are square, and of the others no half is built.
                let most = match standard.name {
                    "net" | "joint_grid" => bodies.isqrt().pow(2),
                    "ragdolls" => bodies / scenes::RAGDOLL_BODIES * scenes::RAGDOLL_BODIES,
                    "four_bars" => bodies / 3 * 3,
                    "cars" => bodies / scenes::CAR_BODIES * scenes::CAR_BODIES,
                    _ => bodies,
                };
                assert_eq!(found, most, "{}", standard.name);
            }
            assert!(overlap(&scene) <= 1e-6, "{} of {bodies}: {:e} m", standard.name, overlap(&scene));
        }
    }
    assert!(scenes::find("no such scene").is_none());
}

#[test]
fn the_pyramid_of_base_100_has_5050_boxes() {
    assert_eq!(dynamic(&scenes::pyramid(100)), 5050);
    assert_eq!(dynamic(&(scenes::find("pyramid").unwrap().build)(5050)), 5050);
    assert_eq!(dynamic(&(scenes::find("pyramid").unwrap().build)(5049)), 4950);
}

/// Neither a gap nor an overlap, to the last bit.
#[test]
fn stacks_touch_exactly() {
    for (scene, name) in [
        (scenes::column(40), "column"),
        (scenes::pyramid(20), "pyramid"),
        (scenes::topped_pyramid(10, 300.0), "topped pyramid"),
        (scenes::wide_pyramid(15), "wide pyramid"),
        (scenes::many_pyramids(9, 10), "many pyramids"),
        (scenes::large_on_small(), "large on small"),
        (scenes::hub(500), "hub"),
    ] {
        let poses = initial_poses(&scene);
        assert_eq!(penetration(&scene, &poses).max_m, 0.0, "{name}");
        let lowest = scene.bodies().map(|b| poses[b].translation.y).filter(|&y| y > 0.0).fold(f32::MAX, f32::min);
        assert_eq!(lowest, 0.5, "{name}");
    }
}

#[test]
fn structures_have_the_bodies_and_masses_they_say() {
    assert_eq!(dynamic(&scenes::many_pyramids(196, 10)), 10_780);
    assert_eq!(dynamic(&scenes::wide_pyramid(15)), 1240);
    let structures = [
        (scenes::card_house(5), 40),
        (scenes::jenga(30), 90),
        (scenes::dominoes(30), 30),
        (scenes::plank_tower(40), 80),
    ];
    for (scene, bodies) in structures.into_iter().chain([(scenes::tiny_pyramid(10), 55)]) {
        assert_eq!(dynamic(&scene), bodies);
        // To the last bits of leaning cards and touching dominoes.
        assert!(penetration(&scene, &initial_poses(&scene)).max_m < 2e-6, "{bodies}");
    }
    let masses = |scene: &Scene| {
        let all: Vec<_> = scene.bodies().map(|b| scene.mass_properties(b).unwrap().mass).filter(|&m| m > 0.0).collect();
        all.iter().fold(0.0, |most: f32, &m| most.max(m)) / all.iter().fold(f32::MAX, |least, &m| least.min(m))
    };
    assert_eq!(dynamic(&scenes::topped_pyramid(10, 300.0)), 55);
    // Densities and volumes are rounded to f32.
    assert!((masses(&scenes::topped_pyramid(10, 300.0)) / 300.0 - 1.0).abs() < 2e-7);
    assert!((masses(&scenes::large_on_small()) / 8000.0 - 1.0).abs() < 2e-7);
}

#[test]
fn scenes_repeat_and_seeds_differ() {
    for standard in scenes::ALL {
        assert_eq!(hash(&(standard.build)(300)), hash(&(standard.build)(300)), "{}", standard.name);
    }
    assert_ne!(hash(&scenes::pile_seeded(300, 1)), hash(&scenes::pile_seeded(300, 2)));
    assert_ne!(hash(&scenes::balls_seeded(300, 1)), hash(&scenes::balls_seeded(300, 2)));
    assert_ne!(hash(&scenes::mixed_seeded(300, 1)), hash(&scenes::mixed_seeded(300, 2)));
    for seed in 0..20 {
        assert_eq!(overlap(&scenes::pile_seeded(500, seed)), 0.0);
        assert_eq!(overlap(&scenes::balls_seeded(500, seed)), 0.0);
        assert_eq!(overlap(&scenes::mixed_seeded(500, seed)), 0.0);
    }
}

/// Every body of a heap begins within the walls, and the settled heap (60 % full) stays below their rim.
#[test]
fn heaps_fit_their_pit() {
    for (scene, name) in [(scenes::pile(4000), "pile"), (scenes::balls(4000), "balls"), (scenes::mixed(4000), "mixed")]
    {
        let packed = PackedScene::new(&scene).unwrap();
        let walls: Vec<_> = packed
            .colliders
            .iter()
            .filter(|c| c.shape == shape_kind::CUBOID && packed.states[c.body as usize].flags == body_flags::FIXED)
            .collect();
        assert_eq!(walls.len(), 4, "{name}");
        let face = |axis: usize| {
            let inner = walls.iter().map(|w| packed.states[w.body as usize].position[axis].abs() - w.size[axis]);
            inner.fold(0.0, f32::max)
        };
        let (x, z, rim) = (face(0), face(2), 2.0 * walls[0].size[1]);
        assert!(x == z && x > 0.0, "{name}");
        let mut volume = 0.0;
        for (body, state) in scene.bodies().zip(&packed.states).filter(|(_, s)| s.flags == body_flags::DYNAMIC) {
            let [px, py, pz] = state.position;
            assert!(px.abs() < x && pz.abs() < z && py > 0.0 && py < rim, "{name}: {:?}", state.position);
            volume += scene.mass_properties(body).unwrap().mass / scenes::DENSITY;
        }
        let height = volume / (4.0 * x * z) / 0.6;
        assert!(height < 0.9 * rim && height > 0.3 * (2.0 * x), "{name}: {height} m high, {} m wide", 2.0 * x);
    }
}

#[test]
fn mixed_has_every_shape_and_compounds() {
    let scene = scenes::mixed(400);
    let packed = PackedScene::new(&scene).unwrap();
    let count = |shape| packed.colliders.iter().filter(|c| c.shape == shape).count();
    assert!(count(shape_kind::BALL) > 100 && count(shape_kind::CUBOID) > 100);
    let compounds = scene.bodies().filter(|&b| scene.colliders_of(b).unwrap().len() == 2).count();
    assert_eq!(compounds, 50);
}

/// The plate of the hub touches the floor and each of the others, and those touch nothing else.
#[test]
fn the_hub_carries_all_the_others() {
    let scene = scenes::hub(500);
    let poses = initial_poses(&scene);
    let plate = scene.bodies().nth(1).unwrap();
    assert_eq!(penetration(&scene, &poses), Penetration::default());
    // Raised by 1/1024 m, the plate overlaps all 500 by that, and the floor no more.
    let rise = 1.0 / 1024.0;
    let raised = scene.bodies().map(|body| {
        let Pose { translation, rotation } = poses[body];
        (body, Pose { translation: translation + Vec3::Y * if body == plate { rise } else { 0.0 }, rotation })
    });
    let found = penetration(&scene, &Poses::collect(1, raised));
    assert_eq!(found, Penetration { max_m: rise.into(), mean_m: rise.into() });
    let packed = PackedScene::new(&scene).unwrap();
    let half = packed.colliders[1].size;
    for (state, collider) in packed.states.iter().zip(&packed.colliders).skip(2) {
        let [x, y, z] = state.position;
        assert!(x.abs() + 0.25 < half[0] && z.abs() + 0.25 < half[2]);
        assert_eq!((y, collider.size[0]), (1.25, 0.25));
    }
    let places: std::collections::HashSet<_> =
        packed.states.iter().skip(2).map(|s| s.position.map(|x| (x / 0.8 * 2.0).round() as i32)).collect();
    assert_eq!(places.len(), 500, "each has a place of its own, 0.8 m from the next");
    assert!(dynamic(&scenes::hub(2000)) == 2001 && overlap(&scenes::hub(2000)) == 0.0);
}

#[test]
fn small_scenes_pack_and_hand_back_their_bodies() {
    let at = |scene: &Scene, body| initial_poses(scene)[body].translation;
    let v = |scene: &Scene, body| initial_velocities(scene)[body].linear;

    let (scene, body) = scenes::free_fall(Vec3::new(1.0, 2.0, 3.0));
    assert_eq!((dynamic(&scene), at(&scene, body), v(&scene, body)), (1, Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)));
    let (scene, body) = scenes::sliding_box(0.4, Vec3::X * 5.0);
    assert_eq!((dynamic(&scene), overlap(&scene), v(&scene, body)), (1, 0.0, Vec3::X * 5.0));
    let (scene, body) = scenes::slip_to_roll(0.4, 5.0);
    assert_eq!((dynamic(&scene), overlap(&scene), v(&scene, body)), (1, 0.0, Vec3::X * 5.0));
    let (scene, body) = scenes::rolling_ball(0.1, 3.0);
    let (builder, collider) = (scene.body(body).unwrap(), scene.colliders_of(body).unwrap()[0].1);
    assert_eq!((builder.linvel, builder.angvel), (Vec3::X * 3.0, Vec3::Z * -6.0));
    assert_eq!((collider.rolling_resistance, collider.twisting_resistance), (0.1, 0.0));
    let (scene, body) = scenes::conveyor(0.3, Vec3::X);
    assert!(overlap(&scene) == 0.0 && scene.body(body).unwrap().linvel == Vec3::ZERO);
    assert!(overlap(&scenes::ball_column(30, 0.1)) < 1e-5 && dynamic(&scenes::ball_column(30, 0.1)) == 30);
    let (scene, [ball, slab]) = scenes::spinning(0.1, 6.0);
    assert!([ball, slab].iter().all(|&body| scene.body(body).unwrap().angvel == Vec3::Y * 6.0));
    let (scene, body) = scenes::bouncing_ball(0.8, 2.0);
    assert_eq!((dynamic(&scene), at(&scene, body)), (1, Vec3::Y * 2.5));
    assert!(PackedScene::new(&scene).unwrap().plan.restitution);
    let (scene, _) = scenes::bullet();
    assert_eq!((dynamic(&scene), scene.len(), overlap(&scene)), (1, 2, 0.0));
    let (scene, light, heavy) = scenes::mass_ratio(10_000.0);
    let mass = |body| scene.mass_properties(body).unwrap().mass;
    assert!((mass(heavy) / mass(light) / 10_000.0 - 1.0).abs() < 1e-6);
    assert!(at(&scene, heavy).y == 1.5 && at(&scene, light).y == 0.5 && overlap(&scene) == 0.0);

    let (scene, body) = scenes::free_box();
    let inertia = scene.mass_properties(body).unwrap().principal_inertia;
    assert!((inertia - Vec3::new(13.0, 10.0, 5.0) * 500.0).length() < 0.01, "m / 12 (b² + c²), m = 6,000 kg");
    assert_eq!(initial_velocities(&scene)[body].angular, Vec3::new(3.0, 7.0, 2.0));

    let (scene, body) = scenes::tumbling_box();
    let inertia = scene.mass_properties(body).unwrap().principal_inertia;
    assert!((inertia - Vec3::new(1.06, 0.85, 0.29) * 7.5).length() < 1e-3, "m / 12 (b² + c²), m = 90 kg");
    assert_eq!(initial_velocities(&scene)[body].angular, Vec3::new(0.08, 8.0, 0.08));
    let (scene, body) = scenes::t_handle();
    let mass = scene.mass_properties(body).unwrap();
    // The bar about x, y, z and the handle, a cylinder of 0.6 m and radius 0.15 m, 0.4 m from it.
    let (bar, handle) = (40.0f32, 0.6 * 3.0 * 0.15 * 0.15 * 1000.0);
    let apart = bar * handle / (bar + handle) * 0.16;
    let across = handle * (3.0 * 0.0225 + 0.36) / 12.0 + apart;
    let exact =
        Vec3::new(bar * 0.05 / 12.0 + across, bar * 4.04 / 12.0 + across, bar * 4.01 / 12.0 + handle * 0.0225 / 2.0);
    let mut found = mass.principal_inertia.to_array();
    found.sort_by(f32::total_cmp);
    assert!((Vec3::from_array(found) - Vec3::new(exact.x, exact.z, exact.y)).length() < 1e-2, "{found:?}, {exact}");

    for gap in [0.0, 1e-3] {
        let (scene, balls) = scenes::cradle(1.0, gap);
        assert_eq!((dynamic(&scene), v(&scene, balls[0])), (5, Vec3::X));
        let x = balls.map(|b| at(&scene, b).x);
        assert!((x[1] - x[0] - 1.5).abs() < 1e-6);
        assert!((1..4).all(|i| (x[i + 1] - x[i] - 1.0 - gap).abs() < 1e-6), "{x:?}");
        assert!(overlap(&scene) <= 1e-6);
    }
    let (scene, boxes) = scenes::overlap_cube();
    assert_eq!((dynamic(&scene), boxes.len()), (64, 64));
    assert!((overlap(&scene) - 0.25).abs() < 1e-6, "a quarter of a box");
}

/// The box lies on the slope: it touches the plane, whose normal has the asked angle to the vertical.
#[test]
fn ramps_lean_as_asked() {
    for degrees in [0.0f32, 5.0, 30.0, 45.0] {
        let (scene, body) = scenes::ramp(0.5, degrees.to_radians());
        let normal = initial_poses(&scene)[body].rotation * Vec3::Y;
        assert!((normal.y.acos().to_degrees() - degrees).abs() < 0.05 && normal.x >= 0.0, "{normal}");
        assert!(overlap(&scene) < 1e-6);
        assert!((initial_poses(&scene)[body].translation - normal * 0.25).length() < 1e-6);
    }
}

/// Nothing of the closed system is fixed, nothing overlaps, and most fly inwards.
#[test]
fn the_closed_system_is_closed() {
    let scene = scenes::closed_system(120);
    assert_eq!((dynamic(&scene), scene.len(), scene.gravity), (120, 120, Vec3::ZERO));
    assert!(scene.bodies().all(|b| scene.body(b).unwrap().body_type == RigidBodyType::Dynamic));
    assert_eq!(overlap(&scene), 0.0);
    let (poses, velocities) = (initial_poses(&scene), initial_velocities(&scene));
    let inwards = poses.iter().zip(velocities.iter()).filter(|(p, v)| p.translation.dot(v.linear) < 0.0).count();
    assert!(inwards > 100);
    assert!(linear_momentum(&scene, &velocities).is_finite());
    assert_eq!(hash(&scene), hash(&scenes::closed_system(120)));
}

/// Boxes of a crowd's bodies as they stand.
fn bounding_boxes(scene: &Scene) -> Vec<[Vec3; 2]> {
    let bounds = |body| {
        let builder = scene.body(body).unwrap();
        let (_, collider) = scene.colliders_of(body).unwrap()[0];
        let half = match collider.shape {
            Shape::Cuboid { half_extents: h } => {
                let turn = Mat3::from_quat(builder.rotation);
                turn.x_axis.abs() * h.x + turn.y_axis.abs() * h.y + turn.z_axis.abs() * h.z
            }
            Shape::Ball { radius } => Vec3::splat(radius),
            _ => unreachable!(),
        };
        // Half of the sweep over 1/60 s.
        let sweep = builder.linvel.abs() / 120.0;
        let middle = builder.translation + builder.linvel / 120.0;
        [middle - half - sweep, middle + half + sweep]
    };
    scene.bodies().map(bounds).collect()
}

/// In a crowd a body's box meets a few others, but where all are in one place.
#[test]
fn crowds_are_as_dense_as_they_say() {
    for kind in Crowd::ALL {
        let count = if kind == Crowd::Liu { 20_000 } else { 5000 };
        let scene = scenes::crowd(kind, count);
        let boxes = bounding_boxes(&scene);
        let meets = |a: &[Vec3; 2], b: &[Vec3; 2]| a[0].cmple(b[1]).all() && b[0].cmple(a[1]).all();
        let found: usize = boxes.iter().map(|a| boxes.iter().filter(|b| meets(a, b)).count() - 1).sum();
        let partners = found as f32 / count as f32;
        println!("{kind}: {partners} partners");
        match kind {
            Crowd::OnePoint => assert_eq!(partners, 4999.0),
            _ => assert!((2.0..8.0).contains(&partners), "{kind}: {partners} partners"),
        }
    }
}

#[test]
fn crowds_are_what_they_are_called() {
    for (kind, name) in Crowd::ALL.into_iter().zip([
        "uniform",
        "1:10",
        "1:1000",
        "clustered",
        "onepoint",
        "line",
        "plane",
        "fast",
        "far",
        "liu",
    ]) {
        assert_eq!(kind.to_string(), name);
        for count in [0, 1, 2, 3, 257] {
            let scene = scenes::crowd(kind, count);
            assert_eq!((scene.len(), dynamic(&scene)), (count, count - (count + 10) / 16), "{kind} of {count}");
            assert_eq!(hash(&scene), hash(&scenes::crowd(kind, count)), "{kind} of {count}");
        }
        let boxes = bounding_boxes(&scenes::crowd(kind, 5000));
        let middles = || boxes.iter().map(|b| (b[0] + b[1]) * 0.5);
        let sizes = || boxes.iter().map(|b| (b[1] - b[0]).max_element());
        let spread = middles().fold(Vec3::MIN, Vec3::max) - middles().fold(Vec3::MAX, Vec3::min);
        let ratio = sizes().fold(0.0, f32::max) / sizes().fold(f32::MAX, f32::min);
        match kind {
            Crowd::Ratio(asked) => assert!(ratio > 0.3 * asked && ratio < 2.5 * asked, "{ratio}"),
            Crowd::Liu => assert!((10.0..150.0).contains(&ratio) && spread.max_element() < 100.0, "{ratio}"),
            Crowd::Fast => assert!(sizes().fold(0.0, f32::max) > 2.5, "swept"),
            _ => assert!(ratio < 2.5, "{kind}: {ratio}"),
        }
        match kind {
            Crowd::OnePoint => assert!(spread.max_element() < 0.1),
            Crowd::Line => assert!(spread.x > 500.0 && spread.y < 0.1 && spread.z < 0.1),
            Crowd::Plane => assert!(spread.x > 30.0 && spread.y < 0.1 && spread.z > 30.0),
            Crowd::Clustered => assert!(spread.min_element() > 100.0),
            Crowd::Far => assert!(middles().all(|m| (m.length() - 8000.0).abs() < 30.0)),
            _ => assert!(spread.min_element() > 10.0, "{spread}"),
        }
    }
}
