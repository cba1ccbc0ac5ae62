//! What the laws of all solvers share: how a push changes two bodies, friction, bounces. Twin of
//! `shaders/solver/push.wgsl`.

use super::resist;
use crate::math::{along_free, finite, inverse_inertia_times, quat, rotate, vec3};
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
        let [ra, rb] = arms(head, point);
        apply(a, b, ra, rb, push);
    }
    resist::warm_start(head, [t1, t2], a, b);
}

/// From the bodies' centres of mass to a point.
pub(super) fn arms(head: &ConstraintHead, point: &ConstraintPoint) -> [Vec3; 2] {
    let ra = vec3(point.anchor);
    [ra, ra - vec3(head.between)]
}

/// Gap at a point now; the normal is held, the arms turn with the bodies but for their round parts.
pub(super) fn separation(head: &ConstraintHead, point: &ConstraintPoint, a: &SolverBody, b: &SolverBody) -> f32 {
    let normal = vec3(head.normal);
    let [ra, rb] = arms(head, point);
    let (core_a, core_b) = (ra - head.round_a * normal, rb - head.round_b * normal);
    let (from_a, from_b) = (rotate(quat(a.delta), core_a), rotate(quat(b.delta), core_b));
    let moved = vec3(b.translation) - vec3(a.translation) + from_b - from_a;
    point.adjusted_separation + normal.dot(moved)
}

/// Friction against the sliding velocity, within the cone.
pub(super) fn push_tangent(
    head: &ConstraintHead,
    [t1, t2]: [Vec3; 2],
    point: &ConstraintPoint,
    impulse: &mut Impulse,
    a: &mut SolverBody,
    b: &mut SolverBody,
) {
    let [ra, rb] = arms(head, point);
    let slide = relative_velocity(a, b, ra, rb);
    let [u, v] = head.surface_velocity;
    let mut x = impulse.tangent[0] - point.tangent_mass * (t1.dot(slide) + u);
    let mut y = impulse.tangent[1] - point.tangent_mass * (t2.dot(slide) + v);
    let length = (x * x + y * y).sqrt();
    let most = head.friction * impulse.normal;
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

/// Counts a sub-step's impulse.
pub(super) fn count(point: &mut ConstraintPoint, impulse: &Impulse) {
    point.total[0] += impulse.normal;
    point.total[1] += impulse.tangent[0];
    point.total[2] += impulse.tangent[1];
}

/// Gives back a share of the speed at which the points met, where they met fast enough and pushed at all.
pub(super) fn restitution(
    head: &ConstraintHead,
    points: &mut [ConstraintPoint],
    impulses: &mut [Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
    step: &StepParams,
) {
    for (point, impulse) in points.iter_mut().zip(impulses) {
        bounce(head, point, impulse, a, b, step);
    }
}

fn bounce(
    head: &ConstraintHead,
    point: &mut ConstraintPoint,
    impulse: &mut Impulse,
    a: &mut SolverBody,
    b: &mut SolverBody,
    step: &StepParams,
) {
    if head.restitution == 0.0 || point.approach > -step.restitution_threshold || point.total[0] == 0.0 {
        return;
    }
    let (normal, [ra, rb]) = (vec3(head.normal), arms(head, point));
    let velocity = normal.dot(relative_velocity(a, b, ra, rb));
    let change = -point.normal_mass * (velocity + head.restitution * point.approach);
    let sum = impulse.normal + change;
    if finite([sum; 3]) {
        let new = sum.max(0.0);
        let push = new - impulse.normal;
        impulse.normal = new;
        point.total[0] += push;
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
    a.linear_velocity = (vec3(a.linear_velocity) - a.inverse_mass * along_free(a, push)).to_array();
    a.angular_velocity = (vec3(a.angular_velocity) - inverse_inertia_times(a, ra.cross(push))).to_array();
    b.linear_velocity = (vec3(b.linear_velocity) + b.inverse_mass * along_free(b, push)).to_array();
    b.angular_velocity = (vec3(b.angular_velocity) + inverse_inertia_times(b, rb.cross(push))).to_array();
}
