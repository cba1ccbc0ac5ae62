//! Structures that stand by friction and balance, and a row that falls as it should.

use super::{DENSITY, FRICTION, add_floor, cuboid, dynamic};
use crate::builder::RigidBodyBuilder;
use crate::scene::Scene;
use glam::{Quat, Vec3};
use std::f32::consts::FRAC_PI_2;

/// A house of cards of so many levels: cards of 0.4 x 0.2 m and 2 mm thick, friction 0.7, in pairs that lean against each
/// other at 29.8 degrees from upright; on each two neighbouring pairs lies a card, and on those the next level.
/// levels (levels + 1) leaning cards and levels (levels - 1) / 2 lying ones.
pub fn card_house(levels: usize) -> Scene {
    const MU: f32 = 0.7;
    let half = Vec3::new(0.001, 0.2, 0.1);
    // Lying cards meet end to end, 1 mm apart, over the ridges.
    let pitch = 2.0 * half.y + 0.001;
    let card = || cuboid(half).friction(MU);
    let mut scene = Scene::new();
    add_floor(&mut scene, MU, 0.0);
    // Half a pitch is the span of one leaning card: 2 (half.y sin + half.x cos).
    let reach = half.y.hypot(half.x);
    let lean = (0.25 * pitch / reach).asin() - (half.x / half.y).atan();
    let (sin, cos) = lean.sin_cos();
    let rise = 2.0 * (half.y * cos + half.x * sin);
    for level in 0..levels {
        let floor = level as f32 * (rise + 2.0 * half.x);
        let pairs = levels - level;
        let ridge = |i: usize| (i as f32 - (pairs as f32 - 1.0) * 0.5) * pitch;
        for i in 0..pairs {
            for side in [-1.0f32, 1.0] {
                let at = Vec3::new(ridge(i) + side * 0.25 * pitch, floor + 0.5 * rise, 0.0);
                scene.insert(dynamic(at).rotation(Quat::from_rotation_z(side * lean)), card());
            }
            if i + 1 < pairs {
                let at = Vec3::new(0.5 * (ridge(i) + ridge(i + 1)), floor + rise + half.x, 0.0);
                scene.insert(dynamic(at).rotation(Quat::from_rotation_z(FRAC_PI_2)), card());
            }
        }
    }
    scene
}

/// A tower of `layers` of three wooden blocks each, 0.15 x 0.03 x 0.05 m, 600 kg/m³, friction 0.5, each layer across the
/// one below.
pub fn jenga(layers: usize) -> Scene {
    const MU: f32 = 0.5;
    let half = Vec3::new(0.075, 0.015, 0.0247);
    let mut scene = Scene::new();
    add_floor(&mut scene, MU, 0.0);
    for layer in 0..layers {
        let turn = if layer % 2 == 0 { Quat::IDENTITY } else { Quat::from_rotation_y(FRAC_PI_2) };
        for place in [-1.0f32, 0.0, 1.0] {
            let at = turn * Vec3::new(0.0, 0.0, place * 0.05) + Vec3::Y * (2 * layer + 1) as f32 * half.y;
            scene.insert(dynamic(at).rotation(turn), cuboid(half).friction(MU).density(600.0));
        }
    }
    scene
}

/// A row of `count` dominoes, 48 x 24 x 7.5 mm, 18 mm apart, friction 0.3; the first leans by 0.2 rad towards the others.
pub fn dominoes(count: usize) -> Scene {
    const MU: f32 = 0.3;
    let half = Vec3::new(0.003_75, 0.024, 0.012);
    let mut scene = Scene::new();
    add_floor(&mut scene, MU, 0.0);
    for i in 0..count {
        let mut at = Vec3::new(i as f32 * 0.018, half.y, 0.0);
        let mut body = RigidBodyBuilder::dynamic();
        if i == 0 {
            let lean = 0.2f32;
            at.y = half.y * lean.cos() + half.x * lean.sin();
            body = body.rotation(Quat::from_rotation_z(-lean));
        }
        scene.insert(body.translation(at), cuboid(half).friction(MU));
    }
    scene
}

/// A square tower of planks, 0.12 x 0.024 x 0.008 m as in Kapla, two a layer, lying flat, each layer across the one below
/// with its planks at the edges; friction 0.6, 700 kg/m³.
pub fn plank_tower(layers: usize) -> Scene {
    let half = Vec3::new(0.06, 0.004, 0.012);
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    for layer in 0..layers {
        let turn = if layer % 2 == 0 { Quat::IDENTITY } else { Quat::from_rotation_y(FRAC_PI_2) };
        for side in [-1.0f32, 1.0] {
            let at = turn * Vec3::new(0.0, 0.0, side * (half.x - half.z)) + Vec3::Y * (2 * layer + 1) as f32 * half.y;
            scene.insert(dynamic(at).rotation(turn), cuboid(half).density(700.0));
        }
    }
    scene
}

/// A standing wall as [`pyramid`](super::pyramid) of boxes of 5 cm, a size near the distance at which contacts are kept.
pub fn tiny_pyramid(base: usize) -> Scene {
    let half = 0.025f32;
    let mut scene = Scene::new();
    add_floor(&mut scene, FRICTION, 0.0);
    for layer in 0..base {
        let count = base - layer;
        for i in 0..count {
            let x = (i as f32 - (count as f32 - 1.0) * 0.5) * 2.1 * half;
            let at = Vec3::new(x, (2 * layer + 1) as f32 * half, 0.0);
            scene.insert(dynamic(at), cuboid(Vec3::splat(half)).density(DENSITY));
        }
    }
    scene
}
