//! Scenes of a few bodies whose motion has a formula.

use super::heaps::{MIXED_SPACING, MIXED_TURN, insert, mixed_colliders, small_shift, small_turn};
use super::random::Random;
use super::{add_floor, ball, cuboid, dynamic};
use crate::builder::{ColliderBuilder, CombineRule, RigidBodyBuilder};
use crate::handle::BodyHandle;
use crate::scene::Scene;
use glam::{Quat, Vec3};

/// Half extents of the boxes that slide, m: flat, so that they do not tip over.
const SLIDER: Vec3 = Vec3::new(0.5, 0.25, 0.5);

/// A ball of radius 0.5 m at the origin, thrown with `velocity` (m/s), and nothing else.
pub fn free_fall(velocity: Vec3) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    let body = scene.insert(dynamic(Vec3::ZERO).linvel(velocity), ball(0.5)).body;
    (scene, body)
}

/// A box of 1 x 0.5 x 1 m on the floor with friction `mu`, sliding with `velocity` (m/s): it stops after
/// v² / (2 mu g).
pub fn sliding_box(mu: f32, velocity: Vec3) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    add_floor(&mut scene, mu, 0.0);
    let body = dynamic(Vec3::new(0.0, SLIDER.y, 0.0)).linvel(velocity);
    let body = scene.insert(body, cuboid(SLIDER).friction(mu)).body;
    (scene, body)
}

/// A box of 1 x 0.5 x 1 m at rest on a plane that falls by `angle` (rad) towards +x, with friction `mu`: it slips from
/// atan(mu), with g (sin angle - mu cos angle) along (cos angle, -sin angle, 0).
pub fn ramp(mu: f32, angle: f32) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    let turn = Quat::from_rotation_z(-angle);
    scene.insert(RigidBodyBuilder::fixed().rotation(turn), ColliderBuilder::halfspace(Vec3::Y).friction(mu));
    let body = dynamic(turn * Vec3::new(0.0, SLIDER.y, 0.0)).rotation(turn);
    let body = scene.insert(body, cuboid(SLIDER).friction(mu)).body;
    (scene, body)
}

/// A ball of radius 0.5 m let go with its lowest point `height` (m) above the floor, restitution `e`: it comes back
/// to e² height.
pub fn bouncing_ball(e: f32, height: f32) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    add_floor(&mut scene, super::FRICTION, e);
    let body = scene.insert(dynamic(Vec3::new(0.0, 0.5 + height, 0.0)), ball(0.5).restitution(e)).body;
    (scene, body)
}

/// A ball of radius 0.5 m on the floor, sliding along +x with `speed` (m/s) and no spin, friction `mu`: from
/// t = 2 speed / (7 mu g) on it rolls with 5/7 of the speed.
pub fn slip_to_roll(mu: f32, speed: f32) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    add_floor(&mut scene, mu, 0.0);
    let body = dynamic(Vec3::new(0.0, 0.5, 0.0)).linvel(Vec3::X * speed);
    let body = scene.insert(body, ball(0.5).friction(mu)).body;
    (scene, body)
}

/// A tilted box of 1 x 2 x 3 m turning with (3, 7, 2) rad/s, without gravity: angular momentum and energy stay.
pub fn free_box() -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let tilt = Quat::from_xyzw(0.2, -0.3, 0.1, 0.9).normalize();
    let body = dynamic(Vec3::ZERO).rotation(tilt).angvel(Vec3::new(3.0, 7.0, 2.0));
    let body = scene.insert(body, cuboid(Vec3::new(0.5, 1.0, 1.5))).body;
    (scene, body)
}

/// `bodies` boxes, balls and compounds, restitution 0.5, flying and turning towards each other; no gravity and nothing
/// else: linear and angular momentum stay.
pub fn closed_system(bodies: usize) -> Scene {
    let mut random = Random::new(0x636c_6f73_6564);
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let edge = ((bodies as f64).cbrt().ceil() as usize).max(1);
    for i in 0..bodies {
        let place = Vec3::new((i % edge) as f32, (i / (edge * edge)) as f32, (i / edge % edge) as f32);
        let place = (place - (edge as f32 - 1.0) * 0.5) * MIXED_SPACING + small_shift(&mut random);
        let colliders = mixed_colliders(i, &mut random).into_iter().map(|c| c.restitution(0.5)).collect();
        let body = dynamic(place)
            .rotation(small_turn(&mut random, MIXED_TURN))
            .linvel(-0.5 * place + random.vector(0.5))
            .angvel(random.vector(1.0));
        insert(&mut scene, body, colliders);
    }
    scene
}

/// A ball of radius 0.1 m at 200 m/s along +x, 5 m before the middle of a fixed wall 0.1 m thick at x = 0, without
/// gravity: in 1/60 s it flies 3.3 m.
pub fn bullet() -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    scene.insert(RigidBodyBuilder::fixed(), cuboid(Vec3::new(0.05, 2.0, 2.0)));
    let body = dynamic(Vec3::new(-5.0, 0.0, 0.0)).linvel(Vec3::X * 200.0);
    let body = scene.insert(body, ball(0.1)).body;
    (scene, body)
}

/// Five balls of radius 0.5 m in a row along x, `gap` (m) apart, restitution `e`, without friction and gravity. The
/// first comes from 0.5 m away with 1 m/s. Hands back the balls, the first one first.
pub fn cradle(e: f32, gap: f32) -> (Scene, [BodyHandle; 5]) {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let balls = [0, 1, 2, 3, 4].map(|i| {
        let (x, speed) = if i == 0 { (-0.5, 1.0) } else { ((i - 1) as f32 * (1.0 + gap) + 1.0, 0.0) };
        let body = dynamic(Vec3::X * x).linvel(Vec3::X * speed);
        scene.insert(body, ball(0.5).friction(0.0).restitution(e)).body
    });
    (scene, balls)
}

/// A box of 10 kg and 6 x 0.2 x 6 m on the floor, friction 0.4, and on it 25 balls of 1 kg and radius 0.1 m, 0.8 m apart,
/// friction 0.8, all at rest. Pulled along the floor by F it slides and the balls roll on it: it gains
/// (F - 0.4 (M + 25 m) g) / (M + 50 m / 7), and the balls 2/7 of that: 0.7385 and 0.2110 m/s² for 150 N. (Rolling test of
/// SimBenchmark, Robotic Systems Lab, ETH Zurich; the sizes are not its.) Hands back the box and the balls.
pub fn pulled_box() -> (Scene, BodyHandle, Vec<BodyHandle>) {
    let mut scene = Scene::new();
    add_floor(&mut scene, 0.4, 0.0);
    let pulled = cuboid(Vec3::new(3.0, 0.1, 3.0)).mass(10.0).friction(0.4);
    let pulled = scene.insert(dynamic(Vec3::Y * 0.1), pulled).body;
    let balls = (0..25).map(|i| {
        let place = Vec3::new((i % 5) as f32 - 2.0, 0.0, (i / 5) as f32 - 2.0) * 0.8 + Vec3::Y * 0.3;
        let collider = ball(0.1).mass(1.0).friction(0.8).friction_combine_rule(CombineRule::Max);
        scene.insert(dynamic(place), collider).body
    });
    let balls = balls.collect();
    (scene, pulled, balls)
}

/// A box of 0.2 x 0.5 x 0.9 m turning with 8 rad/s, all but 1 % of it about its middle axis, without gravity: it tumbles over
/// and back; angular momentum and energy stay.
pub fn tumbling_box() -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let body = dynamic(Vec3::ZERO).angvel(Vec3::new(0.08, 8.0, 0.08));
    let body = scene.insert(body, cuboid(Vec3::new(0.1, 0.25, 0.45))).body;
    (scene, body)
}

/// A T of a bar, 2 x 0.1 x 0.2 m along x, and a handle on it, 0.6 m along z, turning with (0.01, 0.01, 10) rad/s, without
/// gravity: z is its middle axis, so that it flips over and back; angular momentum and energy stay. The handle is a box with
/// the inertia of a cylinder of radius 0.15 m.
pub fn t_handle() -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let body = dynamic(Vec3::ZERO).angvel(Vec3::new(0.01, 0.01, 10.0));
    let body = scene.insert(body, cuboid(Vec3::new(1.0, 0.05, 0.1))).body;
    let side = 0.5 * 3f32.sqrt() * 0.15;
    let handle = cuboid(Vec3::new(side, side, 0.3)).translation(Vec3::Z * 0.4);
    // A fresh handle and a collider of this file: nothing that `attach` would refuse.
    drop(scene.attach(body, handle));
    (scene, body)
}
