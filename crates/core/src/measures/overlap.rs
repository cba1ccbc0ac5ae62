//! How deep colliders overlap, in f64.
//!
//! The `*_separation` functions are signed: negative by the depth when two shapes overlap (the shortest way out),
//! positive by a gap when they are apart.

use crate::builder::RigidBodyType;
use crate::poses::{Pose, Poses};
use crate::report::Penetration;
use crate::scene::Scene;
use crate::shape::Shape;
use glam::{DQuat, DVec3};
use std::collections::HashSet;

/// A placement in f64: rotate, then translate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DPose {
    /// m.
    pub translation: DVec3,
    /// Local frame to world, unit.
    pub rotation: DQuat,
}

impl DPose {
    /// From a translation (m) and a rotation, which is normalised.
    pub fn new(translation: DVec3, rotation: DQuat) -> Self {
        Self { translation, rotation: rotation.normalize() }
    }

    /// The world directions of the three local axes.
    fn axes(&self) -> [DVec3; 3] {
        DVec3::AXES.map(|axis| self.rotation * axis)
    }
}

impl From<Pose> for DPose {
    fn from(pose: Pose) -> Self {
        Self::new(pose.translation.as_dvec3(), pose.rotation.as_dquat())
    }
}

/// Two balls; exact. All in m.
pub fn ball_ball_separation(radius_a: f64, center_a: DVec3, radius_b: f64, center_b: DVec3) -> f64 {
    center_a.distance(center_b) - radius_a - radius_b
}

/// A ball and a box of half extents `half`; exact, the ball's centre inside the box included. All in m.
pub fn ball_cuboid_separation(radius: f64, center: DVec3, half: DVec3, pose: DPose) -> f64 {
    let local = pose.rotation.inverse() * (center - pose.translation);
    let outside = local.abs() - half;
    let distance = if outside.max_element() > 0.0 {
        outside.max(DVec3::ZERO).length()
    } else {
        // Inside: the way to the nearest face.
        outside.max_element()
    };
    distance - radius
}

/// Two boxes by their 15 separating axes, m. The depth is exact; the gap is the widest that any of the axes shows,
/// which is at most the distance.
pub fn cuboid_cuboid_separation(half_a: DVec3, pose_a: DPose, half_b: DVec3, pose_b: DPose) -> f64 {
    let (axes_a, axes_b) = (pose_a.axes(), pose_b.axes());
    let offset = pose_b.translation - pose_a.translation;
    let gap = |axis: DVec3| offset.dot(axis).abs() - reach(half_a, axes_a, axis) - reach(half_b, axes_b, axis);
    let mut best = f64::NEG_INFINITY;
    for axis in axes_a.into_iter().chain(axes_b) {
        best = best.max(gap(axis));
    }
    for a in axes_a {
        for b in axes_b {
            let cross = a.cross(b);
            let length = cross.length();
            // Edges that are nearly parallel separate nothing that the faces do not.
            if length >= 1e-6 {
                best = best.max(gap(cross / length));
            }
        }
    }
    best
}

/// A ball and everything below the plane through `point` with outward unit normal `normal`; exact, m.
pub fn ball_halfspace_separation(radius: f64, center: DVec3, normal: DVec3, point: DVec3) -> f64 {
    (center - point).dot(normal) - radius
}

/// A box and everything below the plane through `point` with outward unit normal `normal`; exact, m.
pub fn cuboid_halfspace_separation(half: DVec3, pose: DPose, normal: DVec3, point: DVec3) -> f64 {
    (pose.translation - point).dot(normal) - reach(half, pose.axes(), normal)
}

/// How far a box of half extents `half` reaches from its centre along the unit vector `direction`.
fn reach(half: DVec3, axes: [DVec3; 3], direction: DVec3) -> f64 {
    half.x * axes[0].dot(direction).abs()
        + half.y * axes[1].dot(direction).abs()
        + half.z * axes[2].dot(direction).abs()
}

/// Depth of all overlapping pairs of colliders, m: the deepest and the mean. A pair counts when its colliders are
/// on different bodies, at least one of them dynamic, which no joint keeps from colliding. Bodies without a pose are left out, and so are
/// pairs of half-spaces.
pub fn penetration(scene: &Scene, poses: &Poses) -> Penetration {
    let (mut bounded, planes) = place(scene, poses);
    let mut depths = Depths { apart: apart(scene), ..Depths::default() };
    for plane in &planes {
        for other in &bounded {
            depths.add(plane, other);
        }
    }
    // Sort and sweep along the axis on which the colliders are spread the widest.
    let axis = widest_axis(&bounded);
    bounded.sort_by(|a, b| a.min[axis].total_cmp(&b.min[axis]));
    let mut cross_axes = [0, 1, 2].into_iter().filter(|&i| i != axis);
    let (u, v) = (cross_axes.next().unwrap_or(1), cross_axes.next().unwrap_or(2));
    for (i, a) in bounded.iter().enumerate() {
        for b in &bounded[i + 1..] {
            if b.min[axis] > a.max[axis] {
                break;
            }
            if a.min[u] <= b.max[u] && b.min[u] <= a.max[u] && a.min[v] <= b.max[v] && b.min[v] <= a.max[v] {
                depths.add(a, b);
            }
        }
    }
    Penetration {
        max_m: depths.deepest,
        mean_m: if depths.count > 0 { depths.total / depths.count as f64 } else { 0.0 },
    }
}

/// Slots of bodies that a joint keeps from colliding, lower first.
fn apart(scene: &Scene) -> HashSet<[u32; 2]> {
    let pair = |joint| {
        let ([a, b], joint) = (scene.joined(joint).ok()?.map(|body| body.slot), scene.joint(joint).ok()?);
        (!joint.contacts_enabled).then_some([a.min(b), a.max(b)])
    };
    scene.joints().filter_map(pair).collect()
}

#[derive(Default)]
struct Depths {
    apart: HashSet<[u32; 2]>,
    deepest: f64,
    total: f64,
    count: u64,
}

impl Depths {
    fn add(&mut self, a: &Placed, b: &Placed) {
        if a.body == b.body || !(a.dynamic || b.dynamic) {
            return;
        }
        let depth = -separation(&a.form, &b.form);
        if depth > 0.0 && !self.apart.contains(&[a.body.min(b.body), a.body.max(b.body)]) {
            self.deepest = self.deepest.max(depth);
            self.total += depth;
            self.count += 1;
        }
    }
}

/// A collider in the world.
struct Placed {
    min: [f64; 3],
    max: [f64; 3],
    body: u32,
    dynamic: bool,
    form: Form,
}

enum Form {
    Ball { radius: f64, center: DVec3 },
    Cuboid { half: DVec3, pose: DPose },
    HalfSpace { normal: DVec3, point: DVec3 },
}

fn separation(a: &Form, b: &Form) -> f64 {
    use Form::{Ball, Cuboid, HalfSpace};
    match (a, b) {
        (&Ball { radius: ra, center: ca }, &Ball { radius: rb, center: cb }) => ball_ball_separation(ra, ca, rb, cb),
        (&Cuboid { half: ha, pose: pa }, &Cuboid { half: hb, pose: pb }) => cuboid_cuboid_separation(ha, pa, hb, pb),
        (&Ball { radius, center }, &Cuboid { half, pose }) | (&Cuboid { half, pose }, &Ball { radius, center }) => {
            ball_cuboid_separation(radius, center, half, pose)
        }
        (&Ball { radius, center }, &HalfSpace { normal, point })
        | (&HalfSpace { normal, point }, &Ball { radius, center }) => {
            ball_halfspace_separation(radius, center, normal, point)
        }
        (&Cuboid { half, pose }, &HalfSpace { normal, point })
        | (&HalfSpace { normal, point }, &Cuboid { half, pose }) => {
            cuboid_halfspace_separation(half, pose, normal, point)
        }
        (HalfSpace { .. }, HalfSpace { .. }) => 0.0,
    }
}

/// All colliders with finite poses: balls and boxes with their bounds, and half-spaces.
fn place(scene: &Scene, poses: &Poses) -> (Vec<Placed>, Vec<Placed>) {
    let (mut bounded, mut planes) = (Vec::with_capacity(scene.collider_count()), Vec::new());
    for (_, _, collider) in scene.colliders.iter() {
        let (Ok(entry), Ok(&pose)) = (scene.entry(collider.body), poses.get(collider.body)) else { continue };
        if !(pose.translation.is_finite() && pose.rotation.is_finite()) {
            continue;
        }
        let (body, own) = (DPose::from(pose), &collider.builder);
        let pose = DPose::new(
            body.translation + body.rotation * own.translation.as_dvec3(),
            body.rotation * own.rotation.as_dquat().normalize(),
        );
        let (extent, form) = match own.shape {
            Shape::Ball { radius } => {
                let radius = f64::from(radius);
                (DVec3::splat(radius), Form::Ball { radius, center: pose.translation })
            }
            Shape::Cuboid { half_extents } => {
                let half = half_extents.as_dvec3();
                let extent = DVec3::from_array(DVec3::AXES.map(|axis| reach(half, pose.axes(), axis)));
                (extent, Form::Cuboid { half, pose })
            }
            Shape::HalfSpace { normal } => {
                let normal = pose.rotation * normal.as_dvec3().normalize();
                (DVec3::INFINITY, Form::HalfSpace { normal, point: pose.translation })
            }
        };
        let placed = Placed {
            min: (pose.translation - extent).to_array(),
            max: (pose.translation + extent).to_array(),
            body: collider.body.slot,
            dynamic: entry.builder.body_type == RigidBodyType::Dynamic,
            form,
        };
        if extent.is_finite() { bounded.push(placed) } else { planes.push(placed) }
    }
    (bounded, planes)
}

fn widest_axis(bounded: &[Placed]) -> usize {
    let spread = |axis: usize| {
        let starts = bounded.iter().map(|p| p.min[axis]);
        starts.clone().fold(f64::NEG_INFINITY, f64::max) - starts.fold(f64::INFINITY, f64::min)
    };
    (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0)
}
