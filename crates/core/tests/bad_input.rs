//! Bad input is refused where it enters, with an error that names the field. Oracle: analysis throughout (the
//! documented range of each field).

use tumble_core::glam::{Quat, Vec3};
use tumble_core::{
    Accuracy, ColliderBuilder, Error, GaussSeidel, Jacobi, OnePass, PackedScene, Params, Penalty, RigidBodyBuilder,
    Scene, Soft, Solver,
};

const NAN: f32 = f32::NAN;
const INF: f32 = f32::INFINITY;
/// What no length, density or mass may be.
const NOT_POSITIVE: [f32; 5] = [0.0, -1.0, NAN, INF, -INF];

/// Asserts that the pair is refused with an error that names `field`: at once by `try_insert`, and by the packing
/// after `insert`.
fn refused(body: RigidBodyBuilder, collider: ColliderBuilder, field: &str) {
    let mut scene = Scene::new();
    let error = scene.try_insert(body.clone(), collider.clone()).expect_err(field);
    let Error::Invalid { field: named, .. } = &error else { panic!("{field}: {error:?}") };
    assert_eq!(*named, field, "{error}");
    assert!(error.to_string().contains(field) && error.to_string().contains("allowed: "), "{error}");
    assert!(scene.is_empty(), "what is refused is not inserted");

    scene.insert(body, collider);
    assert_eq!(PackedScene::new(&scene).expect_err(field).to_string(), error.to_string());
}

fn bad_body(change: impl FnOnce(RigidBodyBuilder) -> RigidBodyBuilder, field: &str) {
    refused(change(RigidBodyBuilder::dynamic()), ColliderBuilder::ball(1.0), field);
}

fn bad_collider(collider: ColliderBuilder, field: &str) {
    refused(RigidBodyBuilder::dynamic(), collider.clone(), field);
    refused(RigidBodyBuilder::fixed(), collider, field);
}

/// `value` in each of the three places of a vector that is fine else.
fn in_each_place(value: f32) -> [Vec3; 3] {
    [Vec3::new(value, 1.0, 1.0), Vec3::new(1.0, value, 1.0), Vec3::new(1.0, 1.0, value)]
}

#[test]
fn body_vectors() {
    for bad in [NAN, INF, -INF, 2e7].into_iter().flat_map(in_each_place) {
        bad_body(|b| b.translation(bad), "translation");
        bad_body(|b| b.linvel(bad), "linvel");
        bad_body(|b| b.angvel(bad), "angvel");
    }
}

#[test]
fn body_rotation() {
    for q in [[0.0; 4], [0.0, 0.0, 0.0, NAN], [INF, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.1], [3.0, 0.0, 0.0, 0.0]] {
        bad_body(|b| b.rotation(Quat::from_array(q)), "rotation");
        bad_collider(ColliderBuilder::ball(1.0).rotation(Quat::from_array(q)), "rotation");
    }
}

#[test]
fn body_factors() {
    for bad in [NAN, INF, -INF, 2e6] {
        bad_body(|b| b.gravity_scale(bad), "gravity_scale");
    }
    for bad in [NAN, INF, -INF, -0.1] {
        bad_body(|b| b.linear_damping(bad), "linear_damping");
        bad_body(|b| b.angular_damping(bad), "angular_damping");
    }
}

#[test]
fn shapes() {
    for bad in NOT_POSITIVE.into_iter().chain([1e-7, 1e7]) {
        bad_collider(ColliderBuilder::ball(bad), "ball.radius");
        for half in in_each_place(bad) {
            bad_collider(ColliderBuilder::cuboid(half.x, half.y, half.z), "cuboid.half_extents");
        }
    }
    for bad in [Vec3::ZERO, Vec3::new(NAN, 1.0, 0.0), Vec3::new(0.0, INF, 0.0), Vec3::new(0.0, 1e30, 0.0)] {
        refused(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(bad), "halfspace.normal");
    }
}

#[test]
fn collider_fields() {
    let ball = || ColliderBuilder::ball(1.0);
    for bad in NOT_POSITIVE {
        bad_collider(ball().density(bad), "density");
        bad_collider(ball().mass(bad), "mass");
    }
    for bad in [NAN, INF, -INF, -0.1] {
        bad_collider(ball().friction(bad), "friction");
        bad_collider(ball().restitution(bad), "restitution");
        bad_collider(ball().rolling_resistance(bad), "rolling_resistance");
        bad_collider(ball().twisting_resistance(bad), "twisting_resistance");
    }
    bad_collider(ball().rolling_resistance(2e6), "rolling_resistance");
    bad_collider(ball().twisting_resistance(2e6), "twisting_resistance");
    for bad in [NAN, INF, -INF, 2e6].into_iter().flat_map(in_each_place) {
        bad_collider(ball().surface_velocity(bad), "surface_velocity");
    }
    bad_collider(ball().restitution(1.1), "restitution");
    for bad in [NAN, INF, -2e7].into_iter().flat_map(in_each_place) {
        bad_collider(ball().translation(bad), "translation");
    }
}

/// The edges of every range are allowed.
#[test]
fn edges_are_allowed() {
    let mut scene = Scene::new();
    let body = || RigidBodyBuilder::dynamic().translation(Vec3::splat(-1e7)).linvel(Vec3::splat(1e6));
    for collider in [
        ColliderBuilder::ball(1e-3).friction(0.0).restitution(1.0),
        ColliderBuilder::cuboid(1e3, 1e-3, 1.0).friction(1e6).restitution(0.0),
        ColliderBuilder::ball(1.0).rolling_resistance(1e6).twisting_resistance(1e6),
        ColliderBuilder::ball(1.0).surface_velocity(Vec3::splat(-1e6)),
        ColliderBuilder::ball(1.0).mass(1e12),
    ] {
        scene.try_insert(body().linear_damping(0.0).gravity_scale(-1.0), collider).unwrap();
    }
    PackedScene::new(&scene).unwrap();
}

#[test]
fn a_dynamic_body_weighs_something() {
    refused(RigidBodyBuilder::dynamic(), ColliderBuilder::halfspace(Vec3::Y), "mass");
    refused(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(1e6).density(1e12), "mass");
    refused(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(1e-6).mass(1e-18), "inertia");
    let mut scene = Scene::new();
    let body = scene.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(1.0)).body;
    let error = scene.attach(body, ColliderBuilder::halfspace(Vec3::Y)).unwrap_err();
    assert!(error.to_string().contains("shape is"), "{error}");
    scene.try_insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y)).unwrap();
    scene.try_insert(RigidBodyBuilder::kinematic_velocity_based(), ColliderBuilder::halfspace(Vec3::Y)).unwrap();
}

#[test]
fn attached_colliders() {
    let mut scene = Scene::new();
    let body = scene.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(1.0)).body;
    let error = scene.attach(body, ColliderBuilder::ball(NAN)).unwrap_err();
    assert!(error.to_string().contains("ball.radius is NaN"), "{error}");
    assert!(error.to_string().contains("body 0"), "{error}");
    assert_eq!(scene.collider_count(), 1);
    PackedScene::new(&scene).unwrap();
}

/// A scene that already holds bad values can still be asked, changed and packed without a panic; the first error
/// stays.
#[test]
fn a_bad_scene_does_not_panic() {
    for bad in NOT_POSITIVE {
        let mut scene = Scene::new();
        let body = scene.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(bad, 1.0, 1.0)).body;
        let _ = scene.attach(body, ColliderBuilder::cuboid(1.0, 2.0, 1.0).translation(Vec3::ONE));
        let _ = scene.mass_properties(body);
        scene.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(1.0).density(bad));
        let error = PackedScene::new(&scene).unwrap_err();
        assert!(error.to_string().contains("cuboid.half_extents"), "{error}");
    }
}

#[test]
fn gravity() {
    for bad in [NAN, INF, 2e6].into_iter().flat_map(in_each_place) {
        let mut scene = Scene::new();
        scene.gravity = bad;
        let error = PackedScene::new(&scene).unwrap_err();
        assert!(error.to_string().starts_with("Scene: gravity is "), "{error}");
    }
}

#[test]
fn params() {
    let good = Params::default();
    good.validate().unwrap();
    let by = |solver| Params { solver, ..good };
    let within = |accuracy| Params { accuracy, ..good };
    let capacities = |pairs| tumble_core::Capacities { pairs: Some(pairs), ..good.capacities };
    let mut cases = vec![
        (within(Accuracy::Substeps(0)), "accuracy.substeps"),
        (within(Accuracy::Substeps(257)), "accuracy.substeps"),
        (within(Accuracy::Tolerance { penetration: 0.0, joint: 1e-3, most: 32 }), "accuracy.penetration"),
        (within(Accuracy::Tolerance { penetration: 1.5, joint: 1e-3, most: 32 }), "accuracy.penetration"),
        (within(Accuracy::Tolerance { penetration: 1e-3, joint: 0.0, most: 32 }), "accuracy.joint"),
        (within(Accuracy::Tolerance { penetration: 1e-3, joint: 1.5, most: 32 }), "accuracy.joint"),
        (within(Accuracy::Tolerance { penetration: 1e-3, joint: 1e-3, most: 0 }), "accuracy.most"),
        (within(Accuracy::Tolerance { penetration: 1e-3, joint: 1e-3, most: 12 }), "accuracy.most"),
        (within(Accuracy::Tolerance { penetration: 1e-3, joint: 1e-3, most: 264 }), "accuracy.most"),
        (Params { threads: Some(0), ..good }, "threads"),
        (Params { capacities: capacities(0), ..good }, "capacities.pairs"),
    ];
    for bad in [NAN, INF, -INF, -1.0] {
        cases.extend([
            (Params { dt: bad, ..good }, "dt"),
            (within(Accuracy::Tolerance { penetration: bad, joint: 1e-3, most: 32 }), "accuracy.penetration"),
            (within(Accuracy::Tolerance { penetration: 1e-3, joint: bad, most: 32 }), "accuracy.joint"),
            (by(Solver::Soft(Soft { frequency: bad, ..Soft::default() })), "solver.frequency"),
            (by(Solver::Soft(Soft { static_frequency: bad, ..Soft::default() })), "solver.static_frequency"),
            (by(Solver::Soft(Soft { damping_ratio: bad, ..Soft::default() })), "solver.damping_ratio"),
            (by(Solver::OnePass(OnePass { stiffness: bad, ..OnePass::default() })), "solver.stiffness"),
            (by(Solver::OnePass(OnePass { leak: bad, ..OnePass::default() })), "solver.leak"),
            (by(Solver::GaussSeidel(GaussSeidel { baumgarte: bad, ..GaussSeidel::default() })), "solver.baumgarte"),
            (by(Solver::GaussSeidel(GaussSeidel { slop: bad, ..GaussSeidel::default() })), "solver.slop"),
            (by(Solver::Jacobi(Jacobi { baumgarte: bad, ..Jacobi::default() })), "solver.baumgarte"),
            (by(Solver::Jacobi(Jacobi { slop: bad, ..Jacobi::default() })), "solver.slop"),
            (by(Solver::Penalty(Penalty { stiffness_share: bad, ..Penalty::default() })), "solver.stiffness_share"),
            (by(Solver::Penalty(Penalty { damping_ratio: bad, ..Penalty::default() })), "solver.damping_ratio"),
            (Params { max_push_speed: bad, ..good }, "max_push_speed"),
            (Params { speculative_distance: bad, ..good }, "speculative_distance"),
            (Params { restitution_threshold: bad, ..good }, "restitution_threshold"),
        ]);
    }
    cases.push((Params { dt: 0.0, ..good }, "dt"));
    for bad in [0, 257] {
        let (gauss_seidel, jacobi) = (GaussSeidel::default(), Jacobi::default());
        cases.extend([
            (by(Solver::GaussSeidel(GaussSeidel { iterations: bad, ..gauss_seidel })), "solver.iterations"),
            (by(Solver::Jacobi(Jacobi { iterations: bad, ..jacobi })), "solver.iterations"),
        ]);
    }
    // At a share of 0.25 a damping ratio of 0.375 is the bound.
    let penalty = |stiffness_share, damping_ratio| by(Solver::Penalty(Penalty { stiffness_share, damping_ratio }));
    penalty(0.25, 0.374).validate().unwrap();
    cases.extend([(penalty(0.25, 0.376), "solver.damping_ratio"), (penalty(1.0, 0.0), "solver.stiffness_share")]);
    for (params, field) in cases {
        let error = params.validate().expect_err(field);
        assert!(error.to_string().starts_with(&format!("Params: {field} is ")), "{error}");
    }
}
