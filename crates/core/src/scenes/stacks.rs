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
    add_wall(&mut scene, base, Vec3::ZERO);
    scene
}

/// A wall as of [`pyramid`], the middle of its foot at `at`.
fn add_wall(scene: &mut Scene, base: usize, at: Vec3) {
    for layer in 0..base {
        let count = base - layer;
        for i in 0..count {
            let x = (i as f32 - (count as f32 - 1.0) * 0.5) * 1.05;
            scene.insert(dynamic(at + Vec3::new(x, layer as f32 + 0.5, 0.0)), cuboid(Vec3::splat(0.5)));
        }
    }
}

/// `count` walls as of [`pyramid`], each with `base` boxes in its lowest layer, in rows and columns as near to a square
/// as can be: 14 x 14 walls of base 10 are 10,780 boxes. Neighbours are 2 m and more apart.
pub fn many_pyramids(count: usize, base: usize) -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    let edge = count.isqrt() + usize::from(count.isqrt().pow(2) < count);
    let middle = (edge as f32 - 1.0) * 0.5;
    for i in 0..count {
        let (column, row) = ((i % edge) as f32 - middle, (i / edge) as f32 - middle);
        add_wall(&mut scene, base, Vec3::new(column * (base as f32 * 1.05 + 2.0), 0.0, row * 3.0));
    }
    scene
}

/// A [`pyramid`] whose topmost box is `ratio` times as heavy as the others.
pub fn topped_pyramid(base: usize, ratio: f32) -> Scene {
    let mut scene = pyramid(base);
    if let Some(top) = scene.bodies().last() {
        let place = scene.body(top).map(|body| body.translation).unwrap_or_default();
        // The last body is of this scene and living, or there would be none.
        let _ = scene.remove(top);
        scene.insert(dynamic(place), cuboid(Vec3::splat(0.5)).density(DENSITY * ratio));
    }
    scene
}

/// Square layers of 1 m boxes, `layers` x `layers` of them in the lowest and one row fewer each way in each above,
/// half a box over the one below: 1,240 boxes for 15 layers. Neighbours are 0.05 m apart.
pub fn wide_pyramid(layers: usize) -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    for layer in 0..layers {
        let count = layers - layer;
        let place = |i: usize| (i as f32 - (count as f32 - 1.0) * 0.5) * 1.05;
        for i in 0..count * count {
            let at = Vec3::new(place(i % count), layer as f32 + 0.5, place(i / count));
            scene.insert(dynamic(at), cuboid(Vec3::splat(0.5)));
        }
    }
    scene
}

/// A cube of 20 m on two of 1 m, 8 m apart: it weighs 8,000 times as much as either.
pub fn large_on_small() -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    for x in [-4.5, 4.5] {
        scene.insert(dynamic(Vec3::new(x, 0.5, 0.0)), cuboid(Vec3::splat(0.5)));
    }
    scene.insert(dynamic(Vec3::new(0.0, 11.0, 0.0)), cuboid(Vec3::splat(10.0)));
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
