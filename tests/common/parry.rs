//! Queries answered by parry 0.31, over the colliders of a world where its poses say that they are.

use parry3d::bounding_volume::Aabb;
use parry3d::math::Pose as ParryPose;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::{Ray as ParryRay, RayIntersection, intersection_test};
use parry3d::shape::{Ball, Cuboid, HalfSpace, Shape as ParryShape};
use tumble::World;
use tumble_core::glam::Vec3;
use tumble_core::{BodyHandle, ColliderHandle, NearestQuery, OverlapShape, Ray, Shape};

/// A collider as parry takes it.
pub(crate) struct Entry {
    pub(crate) collider: ColliderHandle,
    pub(crate) body: BodyHandle,
    pub(crate) own: Shape,
    pub(crate) shape: Box<dyn ParryShape>,
    pub(crate) pose: ParryPose,
}

/// All colliders, by slot, and parry's tree over those that have an end.
pub(crate) struct Oracle {
    pub(crate) entries: Vec<Entry>,
    bvh: Bvh,
    endless: Vec<usize>,
}

/// Grown by so much on every side.
pub(crate) fn shape_of(shape: Shape, grown: f32) -> Box<dyn ParryShape> {
    match shape {
        Shape::Ball { radius } => Box::new(Ball::new((radius + grown).max(0.0))),
        Shape::Cuboid { half_extents } => Box::new(Cuboid::new((half_extents + grown).max(Vec3::ZERO))),
        Shape::HalfSpace { normal } => Box::new(HalfSpace::new(normal.normalize())),
        other => panic!("{other:?}"),
    }
}

impl Oracle {
    pub(crate) fn new(world: &mut World) -> Self {
        let poses = world.poses().unwrap();
        let scene = world.scene();
        let mut entries = Vec::new();
        for body in scene.bodies() {
            let at = poses[body];
            for (collider, builder) in scene.colliders_of(body).unwrap() {
                let position = at.translation + at.rotation * builder.translation;
                let pose = ParryPose::from_parts(position, at.rotation * builder.rotation.normalize());
                let shape = shape_of(builder.shape, 0.0);
                entries.push(Entry { collider, body, own: builder.shape, shape, pose });
            }
        }
        entries.sort_by_key(|entry| entry.collider.slot());
        let is_endless = |entry: &Entry| matches!(entry.own, Shape::HalfSpace { .. });
        let endless = (0..entries.len()).filter(|&i| is_endless(&entries[i])).collect();
        let ends = entries.iter().enumerate().filter(|(_, entry)| !is_endless(entry));
        let boxes: Vec<(usize, Aabb)> = ends.map(|(i, e)| (i, e.shape.compute_aabb(&e.pose))).collect();
        Self { bvh: Bvh::from_iter(BvhBuildStrategy::Binned, boxes), entries, endless }
    }

    /// The collider of this handle.
    pub(crate) fn find(&self, collider: ColliderHandle) -> &Entry {
        let index = self.entries.binary_search_by_key(&collider.slot(), |entry| entry.collider.slot());
        let entry = &self.entries[index.unwrap_or_else(|_| panic!("{collider} does not live"))];
        assert_eq!(entry.collider, collider);
        entry
    }

    /// Time of impact with one collider, grown by so much.
    pub(crate) fn time(&self, entry: &Entry, grown: f32, ray: &Ray) -> Option<f32> {
        let own = ParryRay::new(ray.origin, ray.direction);
        shape_of(entry.own, grown).cast_ray(&entry.pose, &own, ray.max_time_of_impact, ray.solid)
    }

    pub(crate) fn cast(&self, ray: &Ray) -> Option<(&Entry, RayIntersection)> {
        let own = ParryRay::new(ray.origin, ray.direction);
        let cast = |i: usize, most: f32| {
            let entry = &self.entries[i];
            entry.shape.cast_ray_and_get_normal(&entry.pose, &own, most, ray.solid)
        };
        let most = ray.max_time_of_impact.min(f32::MAX);
        let time = |i: u32, most: f32| cast(i as usize, most).map(|hit| hit.time_of_impact);
        let mut best = self.bvh.cast_ray(&own, most, time).map(|(i, time)| (i as usize, time));
        for &i in &self.endless {
            let most = best.map_or(most, |(_, time)| time);
            best = cast(i, most).map(|hit| (i, hit.time_of_impact)).or(best);
        }
        let (i, _) = best?;
        Some((&self.entries[i], cast(i, most)?))
    }

    /// Whether the shape, grown by so much, overlaps the collider.
    pub(crate) fn meets(&self, entry: &Entry, shape: &OverlapShape, grown: f32) -> bool {
        let (pose, shape) = placed(shape, grown);
        intersection_test(&pose, &*shape, &entry.pose, &*entry.shape).unwrap().intersecting
    }

    /// Colliders whose boxes meet the shape's, and those without end.
    pub(crate) fn candidates(&self, shape: &OverlapShape) -> Vec<&Entry> {
        let (pose, shape) = placed(shape, 0.1);
        let aabb = shape.compute_aabb(&pose);
        let found = self.bvh.intersect_aabb(&aabb).map(|i| i as usize);
        let mut all: Vec<usize> = found.chain(self.endless.iter().copied()).collect();
        all.sort_unstable();
        all.into_iter().map(|i| &self.entries[i]).collect()
    }

    /// The nearest collider, its nearest point, and the distance; colliders are solid.
    pub(crate) fn nearest(&self, query: &NearestQuery) -> Option<(&Entry, Vec3, f32)> {
        let most = query.max_distance.min(f32::MAX);
        let project = |i: u32, _: f32| {
            let entry = &self.entries[i as usize];
            Some(entry.shape.project_point(&entry.pose, query.point, true))
        };
        let found = self.bvh.project_point(query.point, most, project);
        let mut best = found.map(|(i, (distance, at))| (i as usize, at.point, distance));
        for &i in &self.endless {
            let entry = &self.entries[i];
            let point = entry.shape.project_point(&entry.pose, query.point, true).point;
            let distance = point.distance(query.point);
            if distance <= best.map_or(most, |best| best.2) {
                best = Some((i, point, distance));
            }
        }
        best.map(|(i, point, distance)| (&self.entries[i], point, distance))
    }
}

fn placed(shape: &OverlapShape, grown: f32) -> (ParryPose, Box<dyn ParryShape>) {
    match *shape {
        OverlapShape::Ball { center, radius } => {
            (ParryPose::from_translation(center), shape_of(Shape::Ball { radius }, grown))
        }
        OverlapShape::Cuboid { center, half_extents, rotation } => {
            (ParryPose::from_parts(center, rotation.normalize()), shape_of(Shape::Cuboid { half_extents }, grown))
        }
        ref other => panic!("{other:?}"),
    }
}
