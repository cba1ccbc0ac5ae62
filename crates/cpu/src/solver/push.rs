//! What the laws of all solvers share: how a push changes two bodies, friction, bounces. Twin of
//! `shaders/solver/push.wgsl`.

use crate::math::{finite, inverse_inertia_times, quat, rotate, vec3};
use glam::Vec3;
use tumble_core::layout::{ConstraintHead, ConstraintPoint, Impulse, SolverBody, StepParams};

/// Applies the impulses of the last visit.
pub(super) fn warm_start(
    head: &ConstraintHead,
    [t1, t2]: [Vec3; 2],
    points: &[ConstraintPoint],
    impulses: &[Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
) {
    for (point, impulse) in points.iter().zip(impulses) {
        let push = impulse.normal * vec3(head.normal) + impulse.tangent[0] * t1 + impulse.tangent[1] * t2;
        apply(a, b, vec3(point.anchor_a), vec3(point.anchor_b), push);
    }
}

/// Gap at a point now; the normal is held, the arms turn with the bodies but for their round parts.
pub(super) fn separation(head: &ConstraintHead, point: &ConstraintPoint, a: &SolverBody, b: &SolverBody) -> f32 {
    let normal = vec3(head.normal);
    let core_a = vec3(point.anchor_a) - head.round_a * normal;
    let core_b = vec3(point.anchor_b) - head.round_b * normal;
    let (from_a, from_b) = (rotate(quat(a.delta), core_a), rotate(quat(b.delta), core_b));
    let moved = vec3(b.translation) - vec3(a.translation) + from_b - from_a;
    point.adjusted_separation + normal.dot(moved)
}

/// Friction against the sliding velocity, within the cone.
pub(super) fn push_tangent(
    friction: f32,
    t1: Vec3,
    t2: Vec3,
    point: &ConstraintPoint,
    impulse: &mut Impulse,
    a: &mut SolverBody,
    b: &mut SolverBody,
) {
    let (ra, rb) = (vec3(point.anchor_a), vec3(point.anchor_b));
    let slide = relative_velocity(a, b, ra, rb);
    let mut x = impulse.tangent[0] - point.tangent_mass * t1.dot(slide);
    let mut y = impulse.tangent[1] - point.tangent_mass * t2.dot(slide);
    let length = (x * x + y * y).sqrt();
    let most = friction * impulse.normal;
    if length > most {
        let scale = most / length;
        x *= scale;
        y *= scale;
    }
    let push = (x - impulse.tangent[0]) * t1 + (y - impulse.tangent[1]) * t2;
    if finite(push.to_array()) {
        impulse.tangent = [x, y];
        apply(a, b, ra, rb, push);
    }
}

/// Bounces of all points of one constraint.
pub(super) fn restitution(
    head: &ConstraintHead,
    points: &[ConstraintPoint],
    impulses: &mut [Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
    step: &StepParams,
) {
    for (point, impulse) in points.iter().zip(impulses) {
        bounce(head.restitution, vec3(head.normal), point, impulse, a, b, step);
    }
}

/// Gives back a share of the speed at which the points met, where they met fast enough and pushed at all.
fn bounce(
    restitution: f32,
    normal: Vec3,
    point: &ConstraintPoint,
    impulse: &mut Impulse,
    a: &mut SolverBody,
    b: &mut SolverBody,
    step: &StepParams,
) {
    if restitution == 0.0 || point.approach > -step.restitution_threshold || point.max_impulse == 0.0 {
        return;
    }
    let (ra, rb) = (vec3(point.anchor_a), vec3(point.anchor_b));
    let velocity = normal.dot(relative_velocity(a, b, ra, rb));
    let change = -point.normal_mass * (velocity + restitution * point.approach);
    let sum = impulse.normal + change;
    if finite([sum; 3]) {
        let new = sum.max(0.0);
        let push = new - impulse.normal;
        impulse.normal = new;
        apply(a, b, ra, rb, push * normal);
    }
}

pub(super) fn relative_velocity(a: &SolverBody, b: &SolverBody, ra: Vec3, rb: Vec3) -> Vec3 {
    let at_a = vec3(a.linear_velocity) + vec3(a.angular_velocity).cross(ra);
    let at_b = vec3(b.linear_velocity) + vec3(b.angular_velocity).cross(rb);
    at_b - at_a
}

/// Applies `push` to b at `rb` and its opposite to a at `ra`.
pub(super) fn apply(a: &mut SolverBody, b: &mut SolverBody, ra: Vec3, rb: Vec3, push: Vec3) {
    a.linear_velocity = (vec3(a.linear_velocity) - a.inverse_mass * push).to_array();
    a.angular_velocity = (vec3(a.angular_velocity) - inverse_inertia_times(a, ra.cross(push))).to_array();
    b.linear_velocity = (vec3(b.linear_velocity) + b.inverse_mass * push).to_array();
    b.angular_velocity = (vec3(b.angular_velocity) + inverse_inertia_times(b, rb.cross(push))).to_array();
}
