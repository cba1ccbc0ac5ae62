//! Mass properties of bodies. Oracle: analysis throughout (closed forms of balls and boxes, parallel axes).

use tumble_core::glam::{DMat3, DQuat, DVec3, Quat, Vec3};
use tumble_core::{ColliderBuilder, MassProperties, RigidBodyBuilder, Scene};

fn of(colliders: &[ColliderBuilder]) -> MassProperties {
    let mut scene = Scene::new();
    let body = scene.insert(RigidBodyBuilder::dynamic(), colliders[0].clone()).body;
    for collider in &colliders[1..] {
        scene.attach(body, collider.clone()).unwrap();
    }
    scene.mass_properties(body).unwrap()
}

/// The inertia tensor about the centre of mass in the body's frame, kg m².
fn tensor(mass: &MassProperties) -> DMat3 {
    turned(mass.principal_inertia.as_dvec3(), mass.principal_frame.as_dquat().normalize())
}

fn turned(principal: DVec3, turn: DQuat) -> DMat3 {
    let frame = DMat3::from_quat(turn);
    frame * DMat3::from_diagonal(principal) * frame.transpose()
}

/// Principal inertia of a box of half extents `half` about its centre, kg m².
fn box_inertia(mass: f64, half: DVec3) -> DVec3 {
    let h = half * half;
    DVec3::new(h.y + h.z, h.x + h.z, h.x + h.y) * (mass / 3.0)
}

fn largest(m: DMat3) -> f64 {
    m.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()))
}

fn close(what: &str, found: DMat3, expected: DMat3) {
    let error = largest(found - expected) / largest(expected);
    assert!(error < 2e-6, "{what}: {found:?} is not {expected:?}: off by {error:e}");
}

#[test]
fn ball_and_box() {
    let ball = of(&[ColliderBuilder::ball(0.3).density(500.0)]);
    let mass = 500.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.027;
    assert!((f64::from(ball.mass) / mass - 1.0).abs() < 1e-6);
    close("ball", tensor(&ball), DMat3::from_diagonal(DVec3::splat(0.4 * mass * 0.09)));

    let half = DVec3::new(0.5, 1.0, 1.5);
    let cuboid = of(&[ColliderBuilder::cuboid(0.5, 1.0, 1.5).density(1000.0)]);
    assert!((cuboid.mass - 6000.0).abs() < 1e-2);
    close("box", tensor(&cuboid), DMat3::from_diagonal(box_inertia(6000.0, half)));
}

/// `mass` in place of a density gives the same body.
#[test]
fn mass_in_place_of_density() {
    let by_density = of(&[ColliderBuilder::cuboid(0.1, 0.2, 0.3).density(250.0)]);
    let by_mass = of(&[ColliderBuilder::cuboid(0.1, 0.2, 0.3).mass(250.0 * 8.0 * 0.006)]);
    assert!((by_density.mass / by_mass.mass - 1.0).abs() < 1e-6);
    close("mass", tensor(&by_mass), tensor(&by_density));
}

/// A half-space weighs nothing.
#[test]
fn a_halfspace_weighs_nothing() {
    let alone = of(&[ColliderBuilder::ball(0.5)]);
    let mut scene = Scene::new();
    let body = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.5)).body;
    scene.attach(body, ColliderBuilder::halfspace(Vec3::Y)).unwrap();
    assert_eq!(alone, scene.mass_properties(body).unwrap());
}

/// Two equal boxes of half extents `half`, side by side along `axis` and turned together, are one box twice as long.
fn halves_make_a_whole(half: Vec3, axis: usize, turn: Quat) {
    let shift = Vec3::AXES[axis] * half;
    let one = |side: f32| {
        let collider = ColliderBuilder::cuboid(half.x, half.y, half.z).density(1000.0).rotation(turn);
        collider.translation(turn * (shift * side) + half)
    };
    let both = of(&[one(-1.0), one(1.0)]);
    let whole = half.as_dvec3() + shift.as_dvec3();
    let mass = 8000.0 * whole.x * whole.y * whole.z;
    let what = format!("half extents {half}, side by side along axis {axis}, turned by {turn}");
    assert!((f64::from(both.mass) / mass - 1.0).abs() < 1e-6, "{what}: {} kg", both.mass);
    assert!((both.center_of_mass - half).length() < 1e-6 * half.length(), "{what}: {}", both.center_of_mass);
    assert!((both.principal_frame.length() - 1.0).abs() < 1e-6);
    close(&what, tensor(&both), turned(box_inertia(mass, whole), turn.as_dquat().normalize()));
}

/// All moments differ.
#[test]
fn two_boxes_make_a_long_one() {
    for turn in [Quat::IDENTITY, Quat::from_xyzw(0.3, -0.2, 0.4, 0.8).normalize()] {
        for axis in 0..3 {
            halves_make_a_whole(Vec3::new(0.3, 0.5, 0.7), axis, turn);
        }
    }
}

/// The two smaller moments are equal, or the two larger, or all three.
#[test]
fn two_boxes_make_a_plate_a_beam_or_a_cube() {
    for turn in [Quat::IDENTITY, Quat::from_xyzw(0.3, -0.2, 0.4, 0.8).normalize()] {
        for axis in 0..3 {
            for thin in (0..3).filter(|&thin| thin != axis) {
                let mut plate = Vec3::ONE;
                plate[axis] = 0.5;
                plate[thin] = 0.1;
                halves_make_a_whole(plate, axis, turn);
            }
            let mut beam = Vec3::splat(0.5);
            beam[axis] = 2.0;
            halves_make_a_whole(beam, axis, turn);
            let mut cube = Vec3::ONE;
            cube[axis] = 0.5;
            halves_make_a_whole(cube, axis, turn);
        }
    }
}

/// From millimetres to a kilometre.
#[test]
fn size_does_not_matter() {
    let turn = Quat::from_xyzw(0.3, -0.2, 0.4, 0.8).normalize();
    for size in [1e-3, 1e-2, 0.1, 10.0, 1e3] {
        halves_make_a_whole(Vec3::new(0.3, 0.5, 0.7) * size, 0, turn);
    }
}

/// A lopsided compound by parallel axes.
#[test]
fn box_and_ball_by_parallel_axes() {
    let (half, at) = (DVec3::new(0.4, 0.2, 0.3), DVec3::new(0.5, 0.25, -0.125));
    let compound = of(&[
        ColliderBuilder::cuboid(0.4, 0.2, 0.3).density(1000.0),
        ColliderBuilder::ball(0.25).density(2000.0).translation(at.as_vec3()),
    ]);
    let half = half.as_vec3().as_dvec3();
    let (m_box, m_ball) = (8000.0 * half.x * half.y * half.z, 2000.0 * 4.0 / 3.0 * std::f64::consts::PI / 64.0);
    let center = at * (m_ball / (m_box + m_ball));
    assert!((compound.center_of_mass.as_dvec3() - center).length() < 1e-6);
    let shifted = |inertia: DVec3, mass: f64, arm: DVec3| {
        let outer = DMat3::from_cols(arm * arm.x, arm * arm.y, arm * arm.z);
        DMat3::from_diagonal(inertia + mass * arm.length_squared()) - mass * outer
    };
    let expected = shifted(box_inertia(m_box, half), m_box, center)
        + shifted(DVec3::splat(0.4 * m_ball / 16.0), m_ball, at - center);
    close("compound", tensor(&compound), expected);
}
