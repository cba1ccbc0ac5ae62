//! Scenes in which many bodies fall into a pit and come to rest as a heap.

use super::random::Random;
use super::{add_floor, ball, cuboid, dynamic};
use crate::builder::{ColliderBuilder, RigidBodyBuilder};
use crate::scene::Scene;
use glam::{Quat, Vec3};

const SEED: u64 = 0x7475_6d62_6c65;
/// How far a body is moved off its place in the grid along each axis, m.
const SHIFT: f32 = 0.04;

/// Where the bodies of a heap begin.
struct Grid {
    /// Edge of a place, m.
    spacing: f32,
    /// Largest component of a body's turn, see [`small_turn`].
    turn: f32,
    /// Width of the grid as a share of cbrt(bodies) places: small bodies need a narrow pit to become a heap.
    width: f64,
}

/// `bodies` boxes of 1 m dropped into a pit.
pub fn pile(bodies: usize) -> Scene {
    pile_seeded(bodies, SEED)
}

/// [`pile`] with other small shifts and turns.
pub fn pile_seeded(bodies: usize, seed: u64) -> Scene {
    heap(bodies, seed, Grid { spacing: 1.5, turn: 0.1, width: 1.0 }, |_, _| vec![cuboid(Vec3::splat(0.5))])
}

/// `bodies` balls of radius 0.5 m dropped into a pit.
pub fn balls(bodies: usize) -> Scene {
    balls_seeded(bodies, SEED)
}

/// [`balls`] with other small shifts.
pub fn balls_seeded(bodies: usize, seed: u64) -> Scene {
    heap(bodies, seed, Grid { spacing: 1.1, turn: 0.1, width: 1.0 }, |_, _| vec![ball(0.5)])
}

/// `bodies` boxes and balls of many sizes (half extents and radii 0.25 to 0.6 m), every eighth a compound of a box
/// and a ball, dropped into a pit.
pub fn mixed(bodies: usize) -> Scene {
    mixed_seeded(bodies, SEED)
}

/// [`mixed`] with other sizes, small shifts and turns.
pub fn mixed_seeded(bodies: usize, seed: u64) -> Scene {
    heap(bodies, seed, Grid { spacing: MIXED_SPACING, turn: MIXED_TURN, width: 0.8 }, mixed_colliders)
}

/// Keeps two bodies of [`mixed_colliders`] apart, shifted and turned by up to [`MIXED_TURN`], m.
pub(super) const MIXED_SPACING: f32 = 1.5;
/// Largest component of the turn of a mixed body, see [`small_turn`].
pub(super) const MIXED_TURN: f32 = 0.03;

/// Colliders of body `i` of a mixed scene: boxes and balls in turn, every eighth body a lopsided compound.
pub(super) fn mixed_colliders(i: usize, random: &mut Random) -> Vec<ColliderBuilder> {
    if i % 8 == 7 {
        let beam = cuboid(Vec3::new(0.4, 0.2, 0.3)).translation(Vec3::new(-0.15, 0.0, 0.0));
        return vec![beam, ball(0.25).translation(Vec3::new(0.3, 0.2, 0.1))];
    }
    let mut size = || random.range(0.25, 0.6);
    if i.is_multiple_of(2) { vec![cuboid(Vec3::new(size(), size(), size()))] } else { vec![ball(size())] }
}

/// Adds `body` with all of `colliders`.
pub(super) fn insert(scene: &mut Scene, body: RigidBodyBuilder, colliders: Vec<ColliderBuilder>) {
    let mut handle = None;
    for collider in colliders {
        match handle {
            None => handle = Some(scene.insert(body.clone(), collider).body),
            // A fresh handle and colliders of this file: nothing that `attach` would refuse.
            Some(body) => drop(scene.attach(body, collider)),
        }
    }
}

/// A turn whose quaternion has vector components of up to `reach` before it is normalised: by up to
/// 2 atan(sqrt(3) reach), 0.34 rad for 0.1. Made without sine and cosine, which differ between machines.
pub(super) fn small_turn(random: &mut Random, reach: f32) -> Quat {
    Quat::from_vec4(random.vector(reach).extend(1.0).normalize())
}

/// A small shift off a place in a grid, m.
pub(super) fn small_shift(random: &mut Random) -> Vec3 {
    random.vector(SHIFT)
}

/// A grid of about cbrt(bodies) places along each edge, above a pit of the same width. Each layer is half a place off
/// the one below, so that no columns form.
fn heap(bodies: usize, seed: u64, grid: Grid, colliders: impl Fn(usize, &mut Random) -> Vec<ColliderBuilder>) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    add_floor(&mut scene, super::FRICTION, 0.0);
    let edge = ((grid.width * (bodies as f64).cbrt()).ceil() as usize).max(1);
    let layers = bodies.div_ceil(edge * edge);
    add_walls(&mut scene, (edge as f32 + 0.5) * grid.spacing, (layers as f32 + 1.0) * grid.spacing);
    let middle = (edge as f32 - 1.0) * 0.5;
    let quarter = |odd: bool| if odd { 0.25 } else { -0.25 };
    for i in 0..bodies {
        let (x, z, layer) = (i % edge, i / edge % edge, i / (edge * edge));
        let place = Vec3::new(
            x as f32 - middle + quarter(layer % 2 == 1),
            layer as f32 + 0.5,
            z as f32 - middle + quarter(layer / 2 % 2 == 1),
        );
        let own = colliders(i, &mut random);
        let shift = small_shift(&mut random);
        let turn = small_turn(&mut random, grid.turn);
        insert(&mut scene, dynamic(place * grid.spacing + shift).rotation(turn), own);
    }
    scene
}

/// Four walls, 2 m thick, around a square of inner width `width`.
pub(super) fn add_walls(scene: &mut Scene, width: f32, height: f32) {
    const THICK: f32 = 1.0;
    let (reach, up) = (width * 0.5 + THICK, height * 0.5);
    for side in [-1.0, 1.0] {
        let across_x = cuboid(Vec3::new(THICK, up, reach + THICK));
        let across_z = cuboid(Vec3::new(width * 0.5, up, THICK));
        scene.insert(RigidBodyBuilder::fixed().translation(Vec3::new(side * reach, up, 0.0)), across_x);
        scene.insert(RigidBodyBuilder::fixed().translation(Vec3::new(0.0, up, side * reach)), across_z);
    }
}
