//! Figures of eleven boxes: a heap of them.

use super::heaps::{add_walls, small_turn};
use super::joints::join;
use super::random::Random;
use super::{add_floor, cuboid};
use crate::builder::RigidBodyBuilder;
use crate::handle::BodyHandle;
use crate::joint::{JointAxis, JointBuilder};
use crate::scene::Scene;
use glam::{Quat, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};

/// Bodies of a figure.
pub const RAGDOLL_BODIES: usize = 11;
/// kg.
const WEIGHT: f32 = 75.0;
/// From one figure of a heap to the next, m: along the floor and up.
const SPACING: [f32; 2] = [2.2, 0.6];

/// A part of a figure that stands upright at the origin, arms held out, facing +z: shares of its weight after de Leva
/// ("Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", 1996), hands and feet with what they are on.
struct Part {
    at: Vec3,
    half: Vec3,
    /// Of the figure's weight.
    share: f32,
}

fn part(at: [f32; 3], half: [f32; 3], share: f32) -> Part {
    Part { at: Vec3::from(at), half: Vec3::from(half), share }
}

/// A ball joint that turns by no more than `most` (rad) about each axis.
fn socket(most: f32) -> JointBuilder {
    let limited = |joint: JointBuilder, axis| joint.limits(axis, [-most, most]);
    [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ].into_iter().fold(JointBuilder::spherical(), limited)
}

/// A hinge that bends one way, by up to 2.4 rad.
fn knee(axis: Vec3) -> JointBuilder {
    JointBuilder::revolute(axis).limits(JointAxis::AngX, [0.0, 2.4])
}

/// Adds a figure of 75 kg whose soles are at `at`; hands back its pelvis.
fn add_ragdoll(scene: &mut Scene, at: Vec3, turn: Quat) -> BodyHandle {
    let mut add = |part: &Part| {
        let body = RigidBodyBuilder::dynamic().translation(at + turn * part.at).rotation(turn);
        scene.insert(body, cuboid(part.half).mass(part.share * WEIGHT)).body
    };
    let pelvis = add(&part([0.0, 1.0, 0.0], [0.16, 0.09, 0.1], 0.112));
    let chest = add(&part([0.0, 1.31, 0.0], [0.17, 0.21, 0.11], 0.323));
    let head = add(&part([0.0, 1.65, 0.0], [0.08, 0.12, 0.09], 0.069));
    let limbs = [-1.0f32, 1.0].map(|side| {
        let arm = add(&part([side * 0.32, 1.45, 0.0], [0.14, 0.05, 0.05], 0.027));
        let forearm = add(&part([side * 0.67, 1.45, 0.0], [0.2, 0.04, 0.04], 0.022));
        let thigh = add(&part([side * 0.09, 0.7, 0.0], [0.075, 0.2, 0.075], 0.142));
        let shank = add(&part([side * 0.09, 0.27, 0.0], [0.06, 0.22, 0.07], 0.057));
        (side, [arm, forearm, thigh, shank])
    });
    let mut tie = |a, b, joint, place: [f32; 3]| _ = join(scene, a, b, joint, at + turn * Vec3::from(place));
    tie(pelvis, chest, socket(0.4), [0.0, 1.095, 0.0]);
    tie(chest, head, socket(0.5), [0.0, 1.525, 0.0]);
    for (side, [arm, forearm, thigh, shank]) in limbs {
        tie(chest, arm, socket(1.3), [side * 0.175, 1.45, 0.0]);
        tie(arm, forearm, knee(Vec3::NEG_Y * side), [side * 0.465, 1.45, 0.0]);
        tie(pelvis, thigh, socket(1.0), [side * 0.09, 0.905, 0.0]);
        tie(thigh, shank, knee(Vec3::X), [side * 0.09, 0.495, 0.0]);
    }
    pelvis
}

/// A figure of 75 kg, eleven boxes on six ball joints and four hinges, all with limits, that is let go 1 m above the
/// floor, leaning.
pub fn ragdoll() -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, super::FRICTION, 0.0);
    add_ragdoll(&mut scene, Vec3::Y, Quat::from_rotation_x(0.3));
    scene
}

/// So many figures dropped into a pit, lying flat in layers of four to sixteen.
pub fn ragdolls(count: usize) -> Scene {
    ragdolls_seeded(count, 0x7261_6764_6f6c)
}

/// [`ragdolls`] with other small turns.
pub fn ragdolls_seeded(count: usize, seed: u64) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    add_floor(&mut scene, super::FRICTION, 0.0);
    let edge = ((count as f64 * 0.1).sqrt().ceil() as usize).clamp(2, 4);
    let layers = count.div_ceil(edge * edge);
    add_walls(&mut scene, edge as f32 * SPACING[0], (layers as f32 + 1.0) * SPACING[1]);
    let middle = 0.5 * (edge as f32 - 1.0);
    for i in 0..count {
        let (x, z, layer) = (i % edge, i / edge % edge, i / (edge * edge));
        let place = Vec3::new(
            (x as f32 - middle) * SPACING[0],
            (layer as f32 + 0.5) * SPACING[1],
            (z as f32 - middle) * SPACING[0],
        );
        let quarter = Quat::from_rotation_y(FRAC_PI_2 * (random.range(0.0, 4.0).floor()));
        let flat = Quat::from_rotation_x(if random.range(0.0, 1.0) < 0.5 { FRAC_PI_2 } else { PI + FRAC_PI_2 });
        let turn = small_turn(&mut random, 0.04) * quarter * flat;
        // The middle of the figure is above the middle of its place.
        add_ragdoll(&mut scene, place - turn * Vec3::Y * 0.9, turn);
    }
    scene
}
