//! Scenes of what resists rolling and twisting, and of belts.

use super::{FRICTION, add_floor, ball, cuboid, dynamic};
use crate::builder::{ColliderBuilder, RigidBodyBuilder};
use crate::handle::BodyHandle;
use crate::scene::Scene;
use glam::{Quat, Vec3};

/// A ball of radius 0.5 m that rolls on the floor along +x with `speed` (m/s), rolling resistance `resistance`: it loses
/// 5/7 `resistance` g of its speed each second.
pub fn rolling_ball(resistance: f32, speed: f32) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    let body = dynamic(Vec3::new(0.0, 0.5, 0.0)).linvel(Vec3::X * speed).angvel(Vec3::NEG_Z * (speed / 0.5));
    let body = scene.insert(body, ball(0.5).rolling_resistance(resistance)).body;
    (scene, body)
}

/// A ball of radius 0.5 m put on a plane that falls by `angle` (rad) towards +x and has rolling resistance
/// `resistance`: it rolls from atan(`resistance`), with 5/7 g (sin angle - `resistance` cos angle).
pub fn ball_on_slope(resistance: f32, angle: f32) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    let turn = Quat::from_rotation_z(-angle);
    let plane = ColliderBuilder::halfspace(Vec3::Y).friction(FRICTION).rolling_resistance(resistance);
    scene.insert(RigidBodyBuilder::fixed().rotation(turn), plane);
    let body = scene.insert(dynamic(turn * Vec3::new(0.0, 0.5, 0.0)), ball(0.5)).body;
    (scene, body)
}

/// A ball of radius 0.5 m and a flat box of 1 x 0.5 x 1 m, 10 m apart on the floor, turning about the vertical with `spin`
/// (rad/s), twisting resistance `resistance`, no friction: torque is `resistance` m g times 0.5 m for the ball and 0.25 m
/// for the box.
pub fn spinning(resistance: f32, spin: f32) -> (Scene, [BodyHandle; 2]) {
    let mut scene = Scene::new();
    add_floor(&mut scene, 0.0, 0.0);
    let half = Vec3::new(0.5, 0.25, 0.5);
    let bodies = [(ball(0.5), 0.5, 0.0), (cuboid(half), half.y, 10.0)].map(|(collider, y, x)| {
        let body = dynamic(Vec3::new(x, y, 0.0)).angvel(Vec3::Y * spin);
        scene.insert(body, collider.friction(0.0).twisting_resistance(resistance)).body
    });
    (scene, bodies)
}

/// `count` balls of radius 0.5 m, one on the other, each up to 5 mm beside the one below, rolling and twisting
/// resistance `resistance`: they stand when it is above 0.01, the shift over the radius.
pub fn ball_column(count: usize, resistance: f32) -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    for i in 0..count {
        let (sin, cos) = (2.4 * i as f32).sin_cos();
        let place = Vec3::new(0.0025 * cos, 0.5 + i as f32, 0.0025 * sin);
        let collider = ball(0.5).rolling_resistance(resistance).twisting_resistance(resistance);
        scene.insert(dynamic(place), collider);
    }
    scene
}

/// A flat box of 1 x 0.5 x 1 m at rest on a fixed belt that runs with `velocity` (m/s, its part across the floor counts),
/// friction `mu`: it goes along after |velocity| / (mu g).
pub fn conveyor(mu: f32, velocity: Vec3) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    // The belt lies turned, and its velocity is told in its own frame.
    let turn = Quat::from_rotation_y(0.7);
    let belt = ColliderBuilder::cuboid(50.0, 0.5, 50.0).friction(mu).surface_velocity(turn.inverse() * velocity);
    scene.insert(RigidBodyBuilder::fixed().translation(Vec3::NEG_Y * 0.5).rotation(turn), belt);
    let body = scene.insert(dynamic(Vec3::new(0.0, 0.25, 0.0)), cuboid(Vec3::new(0.5, 0.25, 0.5)).friction(mu)).body;
    (scene, body)
}
