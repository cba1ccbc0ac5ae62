//! Questions about where colliders are: rays, overlaps, nearest points. What a user asks and gets, how both sides take
//! it, and what is refused.
//!
//! Answers are those of the state after all submitted steps. An edit is seen once a step has applied it. Where two
//! colliders answer equally well, the one of the lower slot does.

use crate::builder::{check_position, check_rotation};
use crate::edit::Editor;
use crate::error::{Error, Result, check};
use crate::handle::{BodyHandle, ColliderHandle};
use crate::layout::{NO_COLLIDER, PlacedShape, QueryAnswer, QueryPoint, QueryRay, QueryVolume, shape_kind};
use crate::limits::{TURN_LIMIT, UNBOUNDED_LIMIT};
use bytemuck::Zeroable;
use glam::{Mat3, Quat, Vec3};
use std::ops::Index;

/// Most queries that one dispatch answers: so many lists of overlaps still have a length that fits a word.
pub const BATCH: usize = 65_536;

/// Longest distance that a query looks at, m; an infinite one means that.
const FARTHEST: f64 = 1e15;

/// Stands for the inverse of a direction's component that is nothing.
const STEEP: f32 = 1e20;

/// A half-line, as in parry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it begins, m.
    pub origin: Vec3,
    /// Where it goes; of any length that is not zero. Times of impact are in units of that length.
    pub direction: Vec3,
    /// Hits later than this do not count; infinite for all.
    pub max_time_of_impact: f32,
    /// Whether a ray that begins inside a collider hits it there, at time 0 and with a normal of zero. If not, it hits
    /// the surface from inside.
    pub solid: bool,
}

impl Ray {
    /// A ray without end that finds colliders solid.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, max_time_of_impact: f32::INFINITY, solid: true }
    }

    /// Where it is at this time.
    pub fn point_at(&self, time: f32) -> Vec3 {
        self.origin + self.direction * time
    }

    fn pack(&self, what: impl Fn() -> String) -> Result<QueryRay> {
        check_position(self.origin, &what, "origin")?;
        let length = self.direction.as_dvec3().length();
        check(
            (1e-12..=1e12).contains(&length),
            &what,
            "direction",
            self.direction.to_array(),
            "finite numbers, of a length of 1e-12 to 1e12",
        )?;
        check(
            self.max_time_of_impact >= 0.0,
            &what,
            "max_time_of_impact",
            self.max_time_of_impact,
            "zero and more, infinity included",
        )?;
        let direction = (self.direction.as_dvec3() / length).as_vec3();
        let inverse = |x: f32| if x.abs() > 1.0 / STEEP { 1.0 / x } else { STEEP.copysign(x) };
        Ok(QueryRay {
            origin: self.origin.to_array(),
            max_distance: (f64::from(self.max_time_of_impact) * length).min(FARTHEST) as f32,
            direction: direction.to_array(),
            solid: self.solid.into(),
            inverse: direction.to_array().map(inverse),
            pad_a: 0,
        })
    }
}

/// What a ray hits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayHit {
    /// The collider.
    pub collider: ColliderHandle,
    /// Its body.
    pub body: BodyHandle,
    /// [`Ray::point_at`] this time it hits.
    pub time_of_impact: f32,
    /// Unit normal of the surface in the world, against the ray; zero for a ray that begins inside a solid collider.
    pub normal: Vec3,
}

/// A shape in the world whose overlaps are asked for. Shapes that touch overlap.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum OverlapShape {
    /// A ball.
    Ball {
        /// m.
        center: Vec3,
        /// m; zero asks which colliders hold a point.
        radius: f32,
    },
    /// A box.
    Cuboid {
        /// m.
        center: Vec3,
        /// m.
        half_extents: Vec3,
        /// Box to world.
        rotation: Quat,
    },
}

const LENGTH: &str = "finite numbers from 0 to 1e7 m";

impl OverlapShape {
    fn pack(&self, what: impl Fn() -> String) -> Result<QueryVolume> {
        let fits = |v: Vec3| v.min_element() >= 0.0 && v.max_element() <= 1e7 && v.is_finite();
        let (position, shape, size, rotation) = match *self {
            Self::Ball { center, radius } => {
                check(fits(Vec3::splat(radius)), &what, "radius", radius, LENGTH)?;
                (center, shape_kind::BALL, Vec3::new(radius, 0.0, 0.0), Quat::IDENTITY)
            }
            Self::Cuboid { center, half_extents, rotation } => {
                check(fits(half_extents), &what, "half_extents", half_extents.to_array(), LENGTH)?;
                check_rotation(rotation, &what, "rotation")?;
                (center, shape_kind::CUBOID, half_extents, rotation.normalize())
            }
        };
        check_position(position, &what, "center")?;
        let extent = match self {
            Self::Ball { radius, .. } => Vec3::splat(*radius),
            Self::Cuboid { .. } => {
                let m = Mat3::from_quat(rotation);
                m.x_axis.abs() * size.x + m.y_axis.abs() * size.y + m.z_axis.abs() * size.z
            }
        };
        // What rounding may take from the box, and more.
        let extent = extent + Vec3::splat(1e-6 * (position.abs() + extent).max_element());
        Ok(QueryVolume {
            min: (position - extent).to_array(),
            max: (position + extent).to_array(),
            placed: PlacedShape {
                position: position.to_array(),
                shape,
                rotation: rotation.to_array(),
                size: size.to_array(),
                pad_a: 0,
            },
            ..QueryVolume::zeroed()
        })
    }
}

/// A collider that a shape overlaps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Overlap {
    /// The collider.
    pub collider: ColliderHandle,
    /// Its body.
    pub body: BodyHandle,
}

/// What each of several shapes overlaps: a list a query, in the order of the queries, by collider slot within one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Overlaps {
    ends: Vec<usize>,
    all: Vec<Overlap>,
}

impl Overlaps {
    /// Number of queries.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there were no queries.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// What each query overlaps.
    pub fn iter(&self) -> impl Iterator<Item = &[Overlap]> {
        (0..self.len()).map(|query| &self[query])
    }

    /// What all of them overlap, one list after the other.
    pub fn all(&self) -> &[Overlap] {
        &self.all
    }

    /// Appends the list of one query, given by slots in any order.
    #[doc(hidden)]
    pub fn push(&mut self, slots: &mut [u32], editor: &Editor) {
        slots.sort_unstable();
        let named = |slot: &u32| editor.collider_at(*slot).map(|(collider, body)| Overlap { collider, body });
        self.all.extend(slots.iter().filter_map(named));
        self.ends.push(self.all.len());
    }
}

impl Index<usize> for Overlaps {
    type Output = [Overlap];

    /// What the query of this index overlaps.
    fn index(&self, query: usize) -> &[Overlap] {
        let first = query.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.all[first..self.ends[query]]
    }
}

/// A point whose nearest collider is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestQuery {
    /// m.
    pub point: Vec3,
    /// Colliders farther than this do not count, m; infinite for all.
    pub max_distance: f32,
}

impl NearestQuery {
    /// However far it is.
    pub fn new(point: Vec3) -> Self {
        Self { point, max_distance: f32::INFINITY }
    }

    fn pack(&self, what: impl Fn() -> String) -> Result<QueryPoint> {
        check_position(self.point, &what, "point")?;
        let distance = self.max_distance;
        check(distance >= 0.0, &what, "max_distance", distance, "zero and more, infinity included")?;
        let distance = f64::from(distance).min(FARTHEST);
        Ok(QueryPoint { point: self.point.to_array(), max_squared: (distance * distance) as f32 })
    }
}

/// The collider nearest to a point. One that holds the point is at distance 0, and the point itself is its nearest one:
/// colliders are solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// The collider.
    pub collider: ColliderHandle,
    /// Its body.
    pub body: BodyHandle,
    /// Its nearest point in the world, m.
    pub point: Vec3,
    /// m.
    pub distance: f32,
}

/// Rays as passes take them.
///
/// # Errors
/// [`Error::Invalid`] names the ray and the field.
#[doc(hidden)]
pub fn pack_rays(rays: &[Ray]) -> Result<Vec<QueryRay>> {
    rays.iter().enumerate().map(|(i, ray)| ray.pack(|| format!("ray {i}"))).collect()
}

/// Shapes as passes take them.
///
/// # Errors
/// [`Error::Invalid`] names the shape and the field.
#[doc(hidden)]
pub fn pack_shapes(shapes: &[OverlapShape]) -> Result<Vec<QueryVolume>> {
    shapes.iter().enumerate().map(|(i, shape)| shape.pack(|| format!("overlap shape {i}"))).collect()
}

/// Points as passes take them.
///
/// # Errors
/// [`Error::Invalid`] names the point and the field.
#[doc(hidden)]
pub fn pack_points(points: &[NearestQuery]) -> Result<Vec<QueryPoint>> {
    points.iter().enumerate().map(|(i, point)| point.pack(|| format!("nearest query {i}"))).collect()
}

/// What a ray's answer means.
#[doc(hidden)]
pub fn ray_hit(answer: &QueryAnswer, ray: &Ray, editor: &Editor) -> Option<RayHit> {
    let (collider, body) = named(answer, editor)?;
    let time = f64::from(answer.distance) / ray.direction.as_dvec3().length();
    let time_of_impact = (time as f32).min(ray.max_time_of_impact);
    Some(RayHit { collider, body, time_of_impact, normal: answer.vector.into() })
}

/// What a point's answer means.
#[doc(hidden)]
pub fn nearest(answer: &QueryAnswer, editor: &Editor) -> Option<Nearest> {
    let (collider, body) = named(answer, editor)?;
    Some(Nearest { collider, body, point: answer.vector.into(), distance: answer.distance })
}

fn named(answer: &QueryAnswer, editor: &Editor) -> Option<(ColliderHandle, BodyHandle)> {
    if answer.collider == NO_COLLIDER { None } else { editor.collider_at(answer.collider) }
}

/// Refuses answers of a batch whose loops passed their bounds.
///
/// # Errors
/// [`Error::Capacity`]: one of the queries took so many `turns`, or there are so many `unbounded` colliders.
#[doc(hidden)]
pub fn check_bounds(turns: u32, unbounded: u32) -> Result<()> {
    let over = |buffer, needed: u32, capacity: u32| match needed > capacity {
        true => Err(Error::Capacity { buffer, needed: needed.into(), capacity: capacity.into() }),
        false => Ok(()),
    };
    over("half-spaces", unbounded, UNBOUNDED_LIMIT)?;
    over("query", turns, TURN_LIMIT)
}
