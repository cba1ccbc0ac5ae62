//! Stage `narrowphase`: where and how deep two colliders touch; one file a pair kind.
//!
//! A manifold has up to four points, each midway between the surfaces, with the gap along one common normal (from a
//! to b) and the features that meet there. A point is kept while its gap is below the speculative distance plus the
//! way that the bodies close in the step, so that a fast body is stopped before it is through.

pub mod ball_ball;
pub mod ball_cuboid;
pub mod ball_halfspace;
mod clip;
pub mod cuboid_cuboid;
pub mod cuboid_halfspace;
pub mod recycle;

use crate::math::{quat, rotate, vec3};
use glam::{Quat, Vec3};
use tumble_core::layout::{
    BodyState, Collider, FoundManifold, Manifold, ManifoldPoint, Pair, StepParams, pair_kind, shape_kind,
};

/// A collider where it is, relative to the centre of mass of the pair's first body.
#[derive(Debug, Clone, Copy)]
pub struct Placed {
    /// Radius or half extents, m.
    pub size: Vec3,
    /// Origin, m.
    pub position: Vec3,
    /// Collider frame to world.
    pub rotation: Quat,
    /// Centre of mass of its body, m.
    pub center: Vec3,
    /// Velocity of the centre of mass, m/s.
    pub linear: Vec3,
    /// rad/s.
    pub angular: Vec3,
    /// Rotation of its body's principal frame.
    pub body_rotation: Quat,
}

/// Two placed colliders and how far ahead to look.
#[derive(Debug, Clone, Copy)]
pub struct Couple {
    /// First collider; its body's centre of mass is the origin.
    pub a: Placed,
    /// Second collider.
    pub b: Placed,
    /// Gap below which a contact at rest is kept, m.
    pub distance: f32,
    /// Length of the step, s.
    pub dt: f32,
}

/// A manifold without points.
pub const EMPTY: Manifold = Manifold {
    normal: [0.0; 3],
    count: 0,
    features: [0; 4],
    between: [0.0; 3],
    recycled: 0,
    points: [ManifoldPoint { anchor: [0.0; 3], separation: 0.0 }; 4],
};

/// Places the colliders of a pair relative to the first body, which keeps digits far from the world's origin.
pub fn place(pair: &Pair, colliders: &[Collider], states: &[BodyState], step: &StepParams) -> Couple {
    let (ca, cb) = (&colliders[pair.a as usize], &colliders[pair.b as usize]);
    let (sa, sb) = (&states[ca.body as usize], &states[cb.body as usize]);
    let between = vec3(sb.position) - vec3(sa.position);
    let placed = |c: &Collider, s: &BodyState, center: Vec3| {
        let rotation = quat(s.rotation);
        Placed {
            size: vec3(c.size),
            position: center + rotate(rotation, vec3(c.position)),
            rotation: rotation * quat(c.rotation),
            center,
            linear: vec3(s.linear_velocity),
            angular: vec3(s.angular_velocity),
            body_rotation: rotation,
        }
    };
    let (a, b) = (placed(ca, sa, Vec3::ZERO), placed(cb, sb, between));
    Couple { a, b, distance: step.speculative_distance, dt: step.dt }
}

/// The manifold of one pair; `found` is what its slot remembers.
pub fn collide(
    pair: &Pair,
    colliders: &[Collider],
    states: &[BodyState],
    found: &FoundManifold,
    step: &StepParams,
) -> Manifold {
    let couple = place(pair, colliders, states, step);
    let kind = pair.kind & pair_kind::MASK;
    let boxes = kind == pair_kind::CUBOID_CUBOID || kind == pair_kind::CUBOID_HALFSPACE;
    if boxes
        && pair.kind & pair_kind::FRESH == 0
        && let Some(manifold) = recycle::recycle(&couple, found)
    {
        return manifold;
    }
    let swapped = colliders[pair.a as usize].shape > colliders[pair.b as usize].shape;
    let mut manifold = match kind {
        pair_kind::BALL_BALL => ball_ball::collide(&couple),
        pair_kind::BALL_CUBOID => ball_cuboid::collide(&couple, swapped),
        pair_kind::CUBOID_CUBOID => cuboid_cuboid::collide(&couple),
        pair_kind::BALL_HALFSPACE => ball_halfspace::collide(&couple, swapped),
        pair_kind::CUBOID_HALFSPACE => cuboid_halfspace::collide(&couple, swapped),
        _ => EMPTY,
    };
    manifold.between = couple.b.center.to_array();
    manifold
}

impl Couple {
    /// The same two with their roles exchanged.
    pub fn swap(&self) -> Self {
        Self { a: self.b, b: self.a, ..*self }
    }

    /// How far the two may move against each other before their contact is found anew, m.
    pub fn recycle_distance(&self) -> f32 {
        let smallest = |p: &Placed| if p.size.x > 0.0 { p.size.min_element() } else { f32::MAX };
        recycle::SHARE * smallest(&self.a).min(smallest(&self.b))
    }

    /// How far apart the two may be at a point and still need a contact in this step.
    pub fn reach(&self, point: Vec3, normal: Vec3) -> f32 {
        let at_a = self.a.linear + self.a.angular.cross(point - self.a.center);
        let at_b = self.b.linear + self.b.angular.cross(point - self.b.center);
        self.distance + (-normal.dot(at_b - at_a)).max(0.0) * self.dt
    }

    /// An upper bound of `reach` over all points and normals.
    pub fn farthest(&self) -> f32 {
        let arc = |p: &Placed| p.angular.length() * ((p.position - p.center).length() + p.size.length());
        self.distance + ((self.b.linear - self.a.linear).length() + arc(&self.a) + arc(&self.b)) * self.dt
    }

    /// A manifold of one point, if it is near enough. `normal` points from a to b.
    pub fn single(&self, normal: Vec3, point: Vec3, separation: f32) -> Manifold {
        let mut manifold = EMPTY;
        if separation <= self.reach(point, normal) {
            manifold.normal = normal.to_array();
            manifold.count = 1;
            manifold.points[0] = ManifoldPoint { anchor: point.to_array(), separation };
        }
        manifold
    }
}

/// Turns a manifold of (b, a) into that of (a, b). Anchors are relative to the first body of the pair either way.
pub fn flip(mut manifold: Manifold) -> Manifold {
    manifold.normal = (-vec3(manifold.normal)).to_array();
    manifold
}

const _: () = assert!(shape_kind::BALL < shape_kind::CUBOID && shape_kind::CUBOID < shape_kind::HALFSPACE);
