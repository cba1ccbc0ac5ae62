//! Chains, bridges, nets: bodies that hang by ball joints. Joined bodies do not collide.

use super::heaps::small_turn;
use super::random::Random;
use super::{add_floor, ball, cuboid, dynamic};
use crate::builder::{ColliderBuilder, RigidBodyBuilder};
use crate::handle::{BodyHandle, JointHandle};
use crate::joint::JointBuilder;
use crate::scene::Scene;
use glam::{Quat, Vec3};
use std::f32::consts::{PI, TAU};

/// Radius of the balls of chains, cables, loops and nets, m.
const LINK: f32 = 0.1;
/// Their density, kg/m³: 0.42 kg each.
const LINK_DENSITY: f32 = 100.0;
/// From one of them to the next, m.
const PITCH: f32 = 0.5;
/// What hangs begins here.
const TOP: Vec3 = Vec3::new(0.0, 20.0, 0.0);

/// A body that stands still, to hang others from: a ball of 1 cm, 10 m above the place, out of the way of all.
pub(super) fn anchor(scene: &mut Scene, at: Vec3) -> BodyHandle {
    let out_of_the_way = ColliderBuilder::ball(0.01).translation(Vec3::Y * 10.0);
    scene.insert(RigidBodyBuilder::fixed().translation(at), out_of_the_way).body
}

/// Joins two bodies of a scene at a place in the world, without contacts between them.
pub(super) fn join(scene: &mut Scene, a: BodyHandle, b: BodyHandle, joint: JointBuilder, at: Vec3) -> JointHandle {
    let local = |body| {
        let builder = scene.body(body).expect("a body of this scene");
        builder.rotation.inverse() * (at - builder.translation)
    };
    let joint = joint.local_anchor1(local(a)).local_anchor2(local(b)).contacts_enabled(false);
    scene.insert_joint(a, b, joint).expect("two bodies of this scene and a joint of these files")
}

fn link(scene: &mut Scene, at: Vec3, ratio: f32) -> BodyHandle {
    scene.insert(dynamic(at), ball(LINK).density(LINK_DENSITY * ratio)).body
}

/// Balls of radius 0.1 m and 100 kg/m³ along a broken line, one in the middle of each piece, joined where pieces meet; the
/// first hangs from `start` by a joint where the line begins. The ball `heavy` is `ratio` times as heavy.
fn line(scene: &mut Scene, points: &[Vec3], start: BodyHandle, heavy: usize, ratio: f32) -> Vec<BodyHandle> {
    let mut before = start;
    let pieces = points.windows(2).enumerate().map(|(i, piece)| {
        let body = link(scene, 0.5 * (piece[0] + piece[1]), if i == heavy { ratio } else { 1.0 });
        join(scene, before, body, JointBuilder::spherical(), piece[0]);
        before = body;
        body
    });
    pieces.collect()
}

/// A chain of so many links, let go level: balls of radius 0.1 m and 100 kg/m³, 0.5 m apart, joined half way; the first
/// hangs 0.5 m from what stands still, and the last is `ratio` times as heavy.
pub fn chain(links: usize, ratio: f32) -> Scene {
    let mut scene = Scene::new();
    let mut before = anchor(&mut scene, TOP);
    for i in 1..=links {
        let at = TOP + Vec3::X * (PITCH * i as f32);
        let body = link(&mut scene, at, if i == links { ratio } else { 1.0 });
        let joint_at = if i == 1 { TOP } else { at - Vec3::X * (0.5 * PITCH) };
        join(&mut scene, before, body, JointBuilder::spherical(), joint_at);
        before = body;
    }
    scene
}

/// A cable of so many balls between two fixed points, sagging by 0.7 m, the one in the middle `ratio` times as heavy.
pub fn cable(links: usize, ratio: f32) -> Scene {
    let mut scene = Scene::new();
    let start = anchor(&mut scene, TOP);
    let point = |i: usize| {
        let sag = 0.7 * (PI * i as f32 / links.max(1) as f32).sin();
        TOP + Vec3::new(0.98 * PITCH * i as f32, -sag, 0.0)
    };
    let points: Vec<_> = (0..=links).map(point).collect();
    let all = line(&mut scene, &points, start, links / 2, ratio);
    if let Some(&last) = all.last() {
        let end = anchor(&mut scene, points[links]);
        join(&mut scene, last, end, JointBuilder::spherical(), points[links]);
    }
    scene
}

/// A closed chain of twelve balls that hangs from one point, wavy; the fifth is `ratio` times as heavy.
pub fn closed_chain(ratio: f32) -> Scene {
    const LINKS: usize = 12;
    let mut scene = Scene::new();
    let radius = 0.5 * PITCH / (PI / LINKS as f32).sin();
    let start = anchor(&mut scene, TOP + Vec3::Y * radius);
    let point = |i: usize| {
        let (sin, cos) = (i as f32 * TAU / LINKS as f32).sin_cos();
        TOP + Vec3::new(radius * sin, radius * cos, 0.6 * sin * cos)
    };
    let points: Vec<_> = (0..=LINKS).map(point).collect();
    let all = line(&mut scene, &points, start, 4, ratio);
    join(&mut scene, all[LINKS - 1], all[0], JointBuilder::spherical(), points[0]);
    scene
}

/// A rope bridge of so many planks, 0.36 x 0.05 x 1.2 m and 600 kg/m³, 0.4 m apart between fixed ends, hung with a sag:
/// each is tied to the next by two ball joints, 1.2 m apart.
pub fn rope_bridge(planks: usize) -> Scene {
    const STEP: f32 = 0.4;
    let half = Vec3::new(0.18, 0.025, 0.6);
    let mut scene = Scene::new();
    let mut before = anchor(&mut scene, TOP);
    // Knots along a parabola whose slope at its ends is 0.35.
    let knot = |i: usize| {
        let u = i as f32 / planks.max(1) as f32;
        TOP + Vec3::new(STEP * i as f32, -0.35 * STEP * planks as f32 * u * (1.0 - u), 0.0)
    };
    let tie = |scene: &mut Scene, a, b, at: Vec3| {
        for side in [-0.6f32, 0.6] {
            join(scene, a, b, JointBuilder::spherical(), at + Vec3::Z * side);
        }
    };
    for i in 0..planks {
        let (from, to) = (knot(i), knot(i + 1));
        let turn = Quat::from_rotation_arc(Vec3::X, (to - from).normalize());
        let at = 0.5 * (from + to);
        let plank = scene.insert(dynamic(at).rotation(turn), cuboid(half).density(600.0)).body;
        tie(&mut scene, before, plank, from);
        before = plank;
    }
    if planks > 0 {
        let end = anchor(&mut scene, knot(planks));
        tie(&mut scene, before, end, knot(planks));
    }
    scene
}

/// `edge` x `edge` balls in a level square, `pitch` apart, each joined to its neighbours half way. The place of ball
/// (i, k) is at x = i, z = k.
fn sheet(
    scene: &mut Scene,
    edge: usize,
    pitch: f32,
    insert: impl Fn(&mut Scene, Vec3) -> BodyHandle,
) -> Vec<BodyHandle> {
    let place = |i: usize, k: usize| TOP + Vec3::new(i as f32, 0.0, k as f32) * pitch;
    let all: Vec<_> = (0..edge * edge).map(|index| insert(scene, place(index / edge, index % edge))).collect();
    for i in 0..edge {
        for k in 0..edge {
            let (this, at) = (all[i * edge + k], place(i, k));
            let half = 0.5 * pitch;
            if i + 1 < edge {
                join(scene, this, all[(i + 1) * edge + k], JointBuilder::spherical(), at + Vec3::X * half);
            }
            if k + 1 < edge {
                join(scene, this, all[i * edge + k + 1], JointBuilder::spherical(), at + Vec3::Z * half);
            }
        }
    }
    all
}

/// A square net of `edge` x `edge` balls of radius 0.1 m and 100 kg/m³, 0.5 m apart, let go level and held by one corner;
/// the opposite corner is `ratio` times as heavy.
pub fn net(edge: usize, ratio: f32) -> Scene {
    let mut scene = Scene::new();
    let corner = TOP + Vec3::new(1.0, 0.0, 1.0) * (PITCH * edge.saturating_sub(1) as f32);
    let insert = |scene: &mut Scene, at: Vec3| link(scene, at, if at == corner { ratio } else { 1.0 });
    let all = sheet(&mut scene, edge, PITCH, insert);
    if let Some(&first) = all.first() {
        let fixed = anchor(&mut scene, TOP);
        join(&mut scene, fixed, first, JointBuilder::spherical(), TOP);
    }
    scene
}

/// A sheet of `edge` x `edge` balls of radius 0.4 m, 1 m apart, let go level; every fourth ball of the first row, and its
/// last one, hang from what stands still. (After the joint benches of rapier and Box2D.)
pub fn joint_grid(edge: usize) -> Scene {
    let mut scene = Scene::new();
    let all = sheet(&mut scene, edge, 1.0, |scene, at| scene.insert(dynamic(at), ball(0.4)).body);
    for k in (0..edge).filter(|k| k % 4 == 0 || k + 1 == edge) {
        let at = TOP + Vec3::Z * k as f32;
        let fixed = anchor(&mut scene, at);
        join(&mut scene, fixed, all[k], JointBuilder::spherical(), at);
    }
    scene
}

/// A chain of so many boxes, 0.25 x 0.08 x 0.08 m, joined end to end, that falls onto the floor and lies there as a heap.
/// It begins upright, its links a little turned.
pub fn falling_chain(links: usize) -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, super::FRICTION, 0.0);
    let mut random = Random::new(0x63_6861_696e);
    let (mut end, mut before) = (Vec3::Y * 0.3, None);
    for _ in 0..links {
        let turn = small_turn(&mut random, 0.1) * Quat::from_rotation_z(0.5 * PI);
        let half = turn * Vec3::new(LINK_LENGTH * 0.5, 0.0, 0.0);
        let body = scene.insert(dynamic(end + half).rotation(turn), cuboid(LINK_HALF)).body;
        if let Some(before) = before {
            join(&mut scene, before, body, JointBuilder::spherical(), end);
        }
        (end, before) = (end + 2.0 * half, Some(body));
    }
    scene
}

/// From joint to joint of a chain of boxes, m, and half extents of the boxes: they end short of the joints, so that two
/// that are turned against each other by 0.4 rad do not meet at the start.
const LINK_LENGTH: f32 = 0.27;
const LINK_HALF: Vec3 = Vec3::new(0.115, 0.04, 0.04);

/// A ball `ratio` times as heavy as a link at the end of a chain of so many boxes, let go level above the floor, too low
/// for it to swing through: it lands, and the chain on it.
pub fn wrecking_ball(links: usize, ratio: f32) -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, super::FRICTION, 0.0);
    let top = Vec3::Y * (0.6 * LINK_LENGTH * links as f32).max(0.5);
    let mut before = anchor(&mut scene, top);
    for i in 0..links {
        let at = top + Vec3::X * (LINK_LENGTH * i as f32);
        let body = scene.insert(dynamic(at + Vec3::X * (0.5 * LINK_LENGTH)), cuboid(LINK_HALF)).body;
        join(&mut scene, before, body, JointBuilder::spherical(), at);
        before = body;
    }
    let link_mass = 8.0 * LINK_HALF.element_product() * super::DENSITY;
    let at = top + Vec3::X * (LINK_LENGTH * links as f32);
    let radius = 0.3;
    let body = scene.insert(dynamic(at + Vec3::X * radius), ball(radius).mass(ratio * link_mass)).body;
    join(&mut scene, before, body, JointBuilder::spherical(), at);
    scene
}
