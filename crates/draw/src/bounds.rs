//! What a picture is to show.

use glam::{Mat3, Vec3};
use tumble_core::{ColliderBuilder, Pose, Poses, RigidBodyType, Scene, Shape};

/// Fewer boxes than this have no outliers.
const FEW: usize = 16;
/// How far beyond the middle nine tenths a box may lie, in their widths, and be no outlier.
const FENCE: f32 = 1.0;

/// A box along the world's axes, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Bounds {
    /// Around this middle.
    pub fn new(middle: Vec3, half_extents: Vec3) -> Self {
        Self { min: middle - half_extents, max: middle + half_extents }
    }

    /// Holds the dynamic bodies, or where there are none all others. Half-spaces do not count, nor do bodies that flew
    /// far away from the rest. A box of 1 m where nothing is left.
    pub fn of(scene: &Scene, poses: &Poses) -> Self {
        let boxes = |counts: &dyn Fn(RigidBodyType) -> bool| -> Vec<Self> {
            let bodies = scene.bodies().filter(|body| scene.body(*body).is_ok_and(|b| counts(b.body_type)));
            let boxes = bodies.filter_map(|body| {
                let (pose, colliders) = (poses.get(body).ok()?, scene.colliders_of(body).ok()?);
                let boxes = colliders.iter().filter_map(|(_, collider)| Self::of_collider(pose, collider));
                boxes.reduce(Self::union).filter(|all| all.min.is_finite() && all.max.is_finite())
            });
            boxes.collect()
        };
        let mut found = boxes(&|kind| kind == RigidBodyType::Dynamic);
        if found.is_empty() {
            found = boxes(&|_| true);
        }
        if let Some(fence) = Self::fence(&found) {
            found.retain(|one| fence.contains(one.middle()));
        }
        found.into_iter().reduce(Self::union).unwrap_or(Self::new(Vec3::ZERO, Vec3::splat(0.5)))
    }

    /// Where boxes that count have their middle; `None` if all count.
    fn fence(boxes: &[Self]) -> Option<Self> {
        if boxes.len() < FEW {
            return None;
        }
        let mut fence = Self::new(Vec3::ZERO, Vec3::ZERO);
        for axis in 0..3 {
            let mut middles: Vec<_> = boxes.iter().map(|one| one.middle()[axis]).collect();
            middles.sort_by(f32::total_cmp);
            let (low, high) = (middles[middles.len() / 20], middles[middles.len() - 1 - middles.len() / 20]);
            // A flat heap is no reason to drop what lies on it.
            let widest = boxes.iter().map(|one| one.half_extents()[axis]).fold(0.0, f32::max);
            let reach = FENCE * (high - low) + 4.0 * widest;
            fence.min[axis] = low - reach;
            fence.max[axis] = high + reach;
        }
        Some(fence)
    }

    /// `None` for what has no end.
    fn of_collider(pose: &Pose, collider: &ColliderBuilder) -> Option<Self> {
        let half = match collider.shape {
            Shape::Ball { radius } => Vec3::splat(radius),
            Shape::Cuboid { half_extents } => {
                let axes = Mat3::from_quat(pose.rotation * collider.rotation);
                axes.x_axis.abs() * half_extents.x
                    + axes.y_axis.abs() * half_extents.y
                    + axes.z_axis.abs() * half_extents.z
            }
            _ => return None,
        };
        Some(Self::new(pose.translation + pose.rotation * collider.translation, half))
    }

    /// m.
    pub fn middle(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// m.
    pub fn half_extents(&self) -> Vec3 {
        0.5 * (self.max - self.min)
    }

    fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }
}
