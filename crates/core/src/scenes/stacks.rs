//! Scenes that stand and should go on standing.

use super::{DENSITY, FRICTION, add_floor, ball, cuboid, dynamic};
use crate::handle::BodyHandle;
use crate::scene::Scene;
use glam::Vec3;

/// `bodies` boxes of 1 m stacked on the floor, exactly touching.
pub fn column(bodies: usize) -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    for i in 0..bodies {
        scene.insert(dynamic(Vec3::new(0.0, i as f32 + 0.5, 0.0)), cuboid(Vec3::splat(0.5)));
    }
    scene
}

/// A standing wall of 1 m boxes in the x-y plane, `base` of them in the lowest layer and one fewer in each above:
/// base (base + 1) / 2 in all, 5,050 for a base of 100. Layers touch exactly; neighbours are 0.05 m apart.
pub fn pyramid(base: usize) -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    for layer in 0..base {
        let count = base - layer;
        for i in 0..count {
            let x = (i as f32 - (count as f32 - 1.0) * 0.5) * 1.05;
            scene.insert(dynamic(Vec3::new(x, layer as f32 + 0.5, 0.0)), cuboid(Vec3::splat(0.5)));
        }
    }
    scene
}

/// One plate of 20 x 1 x 20 m (wider, if it must be) on the floor, and `bodies` boxes and balls of 0.5 m in turn on
/// top of it, each touching the plate and none another: `bodies` + 1 dynamic bodies, the plate first.
pub fn hub(bodies: usize) -> Scene {
    const SPACING: f32 = 0.8;
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    let edge = bodies.isqrt() + usize::from(bodies.isqrt().pow(2) < bodies);
    let half = (edge as f32 * SPACING * 0.5).max(10.0);
    scene.insert(dynamic(Vec3::new(0.0, 0.5, 0.0)), cuboid(Vec3::new(half, 0.5, half)));
    for i in 0..bodies {
        let middle = (edge as f32 - 1.0) * 0.5;
        let (x, z) = ((i % edge) as f32 - middle, (i / edge) as f32 - middle);
        let collider = if (i % edge + i / edge).is_multiple_of(2) { cuboid(Vec3::splat(0.25)) } else { ball(0.25) };
        scene.insert(dynamic(Vec3::new(x * SPACING, 1.25, z * SPACING)), collider);
    }
    scene
}

/// A box of 1 m on an equal one that is `ratio` times lighter, on the floor. Hands back the light one, below, and
/// the heavy one.
pub fn mass_ratio(ratio: f32) -> (Scene, BodyHandle, BodyHandle) {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    let light = scene.insert(dynamic(Vec3::new(0.0, 0.5, 0.0)), cuboid(Vec3::splat(0.5))).body;
    let heavy = cuboid(Vec3::splat(0.5)).density(DENSITY * ratio);
    let heavy = scene.insert(dynamic(Vec3::new(0.0, 1.5, 0.0)), heavy).body;
    (scene, light, heavy)
}

/// 4 x 4 x 4 boxes of 1 m, each overlapping its neighbours by 0.25 m, the lowest touching the floor. Hands back the
/// boxes.
pub fn overlap_cube() -> (Scene, Vec<BodyHandle>) {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    let mut boxes = Vec::new();
    for i in 0..64 {
        let place = Vec3::new((i % 4) as f32 - 1.5, (i / 16) as f32, (i / 4 % 4) as f32 - 1.5);
        let body = dynamic(place * 0.75 + Vec3::Y * 0.5);
        boxes.push(scene.insert(body, cuboid(Vec3::splat(0.5))).body);
    }
    (scene, boxes)
}
