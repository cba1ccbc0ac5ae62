//! Which broad phase suits a scene.

use crate::limits::large_limit;
use crate::params::Broadphase;
use crate::scene::Scene;
use crate::shape::Shape;
use glam::Vec3;

/// What the choice rests on: shapes, and how far apart they are, at insertion and as a world sees it from time to time.
/// Half-spaces do not count.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spread {
    /// All colliders.
    pub all: u32,
    /// Those that have an end.
    pub colliders: u32,
    /// Size of the largest collider over that of the median one, when the few that a grid may leave out are left out.
    pub size_ratio: f32,
    /// Mean size, m.
    pub mean_size: f32,
    /// Colliders that begin within one mean size along the longest axis: what a sweep compares each with.
    pub abreast: f32,
}

impl Spread {
    /// Of a scene.
    pub fn of(scene: &Scene) -> Self {
        let mut sizes = Vec::with_capacity(scene.collider_count());
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (_, _, collider) in scene.colliders.iter() {
            sizes.push(match collider.builder.shape {
                Shape::Ball { radius } => 2.0 * radius,
                Shape::Cuboid { half_extents } => 2.0 * half_extents.max_element(),
                Shape::HalfSpace { .. } => continue,
            });
            if let Ok(body) = scene.body(collider.body) {
                let middle = body.translation + body.rotation * collider.builder.translation;
                (low, high) = (low.min(middle), high.max(middle));
            }
        }
        Self { all: scene.collider_count() as u32, ..Self::from_sizes(sizes, high - low) }
    }

    /// Of colliders of these sizes whose middles fill a box of this extent.
    pub fn from_sizes(mut sizes: Vec<f32>, extent: Vec3) -> Self {
        let count = sizes.len();
        if count == 0 {
            return Self::default();
        }
        let mean = sizes.iter().map(|&size| f64::from(size)).sum::<f64>() / count as f64;
        let mut nth = |n: usize| *sizes.select_nth_unstable_by(n, f32::total_cmp).1;
        let median = nth(count / 2).max(f32::MIN_POSITIVE);
        let largest = nth(count - 1 - (large_limit(count as u32, false) as usize).min(count - 1));
        Self {
            all: count as u32,
            colliders: count as u32,
            size_ratio: largest / median,
            mean_size: mean as f32,
            abreast: 0.0,
        }
        .across(extent)
    }

    /// The same colliders, when their middles fill a box of this extent.
    pub fn across(self, extent: Vec3) -> Self {
        let longest = extent.max_element().max(self.mean_size);
        let abreast = self.colliders as f32 * self.mean_size / longest.max(f32::MIN_POSITIVE);
        Self { abreast, ..self }
    }

    /// Whether so many sizes differ so much that a grid needs a tree beside it.
    pub fn is_wide(&self) -> bool {
        self.size_ratio > 4.0
    }
}

/// Up to so many colliders, hardly anything is faster than testing each against all.
const FEW: u32 = 128;
/// Up to so many colliders abreast, a sweep is faster than a grid.
const ABREAST: f32 = 200.0;
/// The same where a grid has no say, and a tree is slower.
const ABREAST_OF_TREE: f32 = 400.0;

impl Broadphase {
    /// What `Auto` stands for in a scene like this; anything else stands for itself.
    ///
    /// The rule, measured on the CPU (`docs/broadphase.md`): up to 128 colliders each is tested against all. Else a sweep, as
    /// long as few lie abreast along the longest axis: 200, or 400 where sizes differ more than fourfold. Beyond, a tree where
    /// sizes differ so, and a grid where they do not.
    pub fn resolve(self, spread: &Spread) -> Self {
        match (self, spread.is_wide()) {
            (Self::Auto, _) if spread.colliders <= FEW => Self::BruteForce,
            (Self::Auto, wide) if spread.abreast <= if wide { ABREAST_OF_TREE } else { ABREAST } => Self::SweepAndPrune,
            (Self::Auto, true) => Self::Lbvh,
            (Self::Auto, false) => Self::Grid,
            (named, _) => named,
        }
    }
}
