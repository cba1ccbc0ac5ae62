//! Crowds: boxes and balls placed at random, for broad phases. What overlaps is no matter here.

use super::heaps::insert;
use super::random::Random;
use super::{ball, cuboid, dynamic};
use crate::builder::RigidBodyBuilder;
use crate::scene::Scene;
use glam::{Quat, Vec3};
use std::fmt;

/// How the bodies of a [`crowd`] lie.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Crowd {
    /// One size, all over a cube.
    Uniform,
    /// All over a cube; the largest is so many times the smallest, and as many are larger than s as 1 / s.
    Ratio(f32),
    /// In clusters of about a hundred, far from each other.
    Clustered,
    /// All in one place.
    OnePoint,
    /// Along the x axis.
    Line,
    /// In the plane y = 0.
    Plane,
    /// All over a cube at up to 120 m/s along each axis, two bodies' sizes a step.
    Fast,
    /// As [`Crowd::Uniform`], 8 km from the origin.
    Far,
    /// Sizes of 0.3 % to 20 % of the cube's edge, as in Liu, Harada, Lee and Kim, "Real-Time Collision Culling of a
    /// Million Bodies on Graphics Processing Units" (SIGGRAPH Asia 2010). Partners grow with the count.
    Liu,
}

impl Crowd {
    /// One of each kind, and two of the kind that has a number.
    pub const ALL: [Self; 10] = [
        Self::Uniform,
        Self::Ratio(10.0),
        Self::Ratio(1000.0),
        Self::Clustered,
        Self::OnePoint,
        Self::Line,
        Self::Plane,
        Self::Fast,
        Self::Far,
        Self::Liu,
    ];

    /// Smallest and largest size, m.
    fn sizes(self) -> [f32; 2] {
        match self {
            // The smallest is not much larger than the margins of the boxes.
            Self::Ratio(ratio) => [0.25, 0.25 * ratio.max(1.0)],
            Self::Liu => [0.003 * LIU, 0.2 * LIU],
            _ => [1.0, 1.0],
        }
    }
}

impl fmt::Display for Crowd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ratio(ratio) => write!(f, "1:{ratio}"),
            kind => f.write_str(&format!("{kind:?}").to_lowercase()),
        }
    }
}

/// Partners that a body has in the mean, far from the cube's sides.
const PARTNERS: f32 = 6.0;
/// Mean edge of a body's box over its size.
const BOX: f32 = 1.1;
/// Fastest along an axis, m/s.
const FAST: f32 = 120.0;
/// Edge of the cube of [`Crowd::Liu`], m.
const LIU: f32 = 100.0;
/// Bodies of one cluster.
const CLUSTER: usize = 100;
/// 8 km from the origin, along no axis.
const FAR: Vec3 = Vec3::new(16_000.0 / 7.0, -24_000.0 / 7.0, 48_000.0 / 7.0);

/// `bodies` boxes and balls in turn, every sixteenth fixed; no gravity and no floor. The cube (square, line) is so large
/// that a body's box meets about five others.
pub fn crowd(kind: Crowd, bodies: usize) -> Scene {
    let mut random = Random::new(0x63_726f_7764);
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let [small, large] = kind.sizes();
    let sizes: Vec<f32> = (0..bodies).map(|_| small / (1.0 - random.range(0.0, 1.0) * (1.0 - small / large))).collect();
    let places = Places::new(kind, &sizes, &mut random);
    for (i, size) in sizes.into_iter().enumerate() {
        let place = places.any(kind, i, &mut random);
        let half = 0.5 * size;
        let collider = match i % 2 {
            0 => cuboid(half * (Vec3::splat(0.8) + random.vector(0.2))),
            _ => ball(half),
        };
        let turn = random.vector(1.0).extend(random.range(0.1, 1.0)).normalize();
        let velocity = random.vector(if kind == Crowd::Fast { FAST } else { 1.0 });
        let body = match i % 16 {
            5 => RigidBodyBuilder::fixed().translation(place),
            _ => dynamic(place).linvel(velocity),
        };
        insert(&mut scene, body.rotation(Quat::from_vec4(turn)), vec![collider]);
    }
    scene
}

/// Where bodies may be.
struct Places {
    /// Half the edge of the cube, square or line, m.
    reach: f32,
    /// Middles of clusters.
    clusters: Vec<Vec3>,
}

impl Places {
    fn new(kind: Crowd, sizes: &[f32], random: &mut Random) -> Self {
        let count = sizes.len().max(1) as f64;
        let mean = |power: i32| sizes.iter().map(|&s| f64::from(BOX * s).powi(power)).sum::<f64>() / count;
        // Two boxes of edges a and b meet in (a + b)³ of the places that one may have to the other.
        let cube = (2.0 * mean(3) + 6.0 * mean(2) * mean(1)) / f64::from(PARTNERS);
        let edge = |places: f64| (places * cube).cbrt();
        let edge = match kind {
            Crowd::Liu => f64::from(LIU),
            Crowd::Line => count * 2.0 * mean(1) / f64::from(PARTNERS),
            Crowd::Plane => (count * 4.0 * mean(1).powi(2) / f64::from(PARTNERS)).sqrt(),
            Crowd::Clustered => edge(CLUSTER as f64),
            // Boxes are longer by 1 s / 60 of a mean speed of half the fastest.
            Crowd::Fast => edge(count) * (1.0 + f64::from(FAST) / 120.0),
            _ => edge(count),
        };
        let reach = 0.5 * edge.ceil() as f32;
        let clusters = match kind {
            Crowd::Clustered => {
                let apart = 6.0 * reach * (count / CLUSTER as f64).cbrt().ceil() as f32;
                (0..sizes.len().div_ceil(CLUSTER)).map(|_| random.vector(apart)).collect()
            }
            _ => Vec::new(),
        };
        Self { reach, clusters }
    }

    fn any(&self, kind: Crowd, i: usize, random: &mut Random) -> Vec3 {
        let place = random.vector(self.reach);
        match kind {
            Crowd::OnePoint => Vec3::new(3.0, -2.0, 1.0),
            Crowd::Line => Vec3::X * place.x,
            Crowd::Plane => place * Vec3::new(1.0, 0.0, 1.0),
            Crowd::Far => place + FAR,
            Crowd::Clustered => place + self.clusters[i % self.clusters.len()],
            _ => place,
        }
    }
}
