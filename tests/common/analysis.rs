//! A body whose motion has a formula, and how far what came back may be off it.

use tumble_core::glam::{DQuat, DVec3, Quat, Vec3};
use tumble_core::{BodyHandle, ColliderBuilder, RigidBodyBuilder, Scene};

// Shares of what is expected, in f32 on either side; beside each the largest that was measured.
/// A way of 4 mm to 0.7 m, at 2 to 7 m from the origin: half in the last place there is 2.4e-7 m a sub-step.
pub(crate) const WAY: f64 = 1e-4; // 1.9e-5
/// A path of 2 to 12 m.
pub(crate) const PATH: f64 = 1e-5; // 1.3e-6
/// The own frame comes back from the principal one by a product of two rotations, rad.
pub(crate) const ROTATION: f64 = 1e-6; // 1.0e-7

/// A turned compound whose centre of mass and principal axes lie off its own frame, without gravity.
pub(crate) fn compound(linvel: Vec3, angvel: Vec3) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let turn = Quat::from_xyzw(0.3, -0.2, 0.5, 0.8).normalize();
    let body = RigidBodyBuilder::dynamic().translation(Vec3::new(1.0, 2.0, -0.5)).rotation(turn);
    let tilt = Quat::from_xyzw(0.1, 0.4, -0.2, 0.9).normalize();
    let beam = ColliderBuilder::cuboid(0.6, 0.2, 0.3).density(200.0).translation(Vec3::X * 0.4).rotation(tilt);
    let body = scene.insert(body.linvel(linvel).angvel(angvel), beam).body;
    scene.attach(body, ColliderBuilder::ball(0.3).density(500.0).translation(Vec3::new(-0.3, 0.5, 0.1))).unwrap();
    (scene, body)
}

/// The angle between two rotations, rad. (glam's has an arc cosine, which knows nothing of angles below 5e-4.)
pub(crate) fn turn(a: Quat, b: Quat) -> f64 {
    turn_of(a.as_dquat(), b.as_dquat())
}

pub(crate) fn turn_of(a: DQuat, b: DQuat) -> f64 {
    2.0 * (a * b.conjugate()).xyz().length().min(1.0).asin()
}

/// As a share of the size of what is expected.
#[track_caller]
pub(crate) fn assert_near(what: &str, found: DVec3, expected: DVec3, tolerance: f64) {
    let off = found.distance(expected) / expected.length().max(1e-3);
    println!("{what}: {off:.1e} of {tolerance:.0e}");
    assert!(off <= tolerance, "{what}: {found} and not {expected}: {off:e}, allowed {tolerance:e}");
}
