//! Resistance against rolling and twisting: an angular impulse a manifold, of no more than its normal impulse times a
//! length. Twin of `shaders/solver/resist.wgsl`.
//!
//! Like friction it is a cone (about the two tangents) and a range (about the normal) around what is accumulated, solved
//! once a visit, after friction. The bound is that of Box2D 3 and Box3D: coefficient times radius times normal impulse.

use crate::math::{finite, inverse_inertia_times, vec3};
use glam::Vec3;
use tumble_core::layout::{ConstraintHead, Impulse, SolverBody};

/// Whether rolling or twisting is resisted.
pub(super) fn resists(head: &ConstraintHead) -> bool {
    head.rolling_resistance > 0.0 || head.twisting_resistance > 0.0
}

/// Applies the angular impulse of the last visit.
pub(super) fn warm_start(head: &ConstraintHead, tangents: [Vec3; 2], a: &mut SolverBody, b: &mut SolverBody) {
    if resists(head) {
        turn_by(a, b, about(head, tangents, head.resisted));
    }
}

/// Against relative turning, up to what the normal impulses allow.
pub(super) fn resist(
    head: &mut ConstraintHead,
    [t1, t2]: [Vec3; 2],
    impulses: &[Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
) {
    if !resists(head) {
        return;
    }
    let sum = impulses.iter().map(|i| i.normal).fold(0.0, |sum, normal| sum + normal);
    let turn = vec3(b.angular_velocity) - vec3(a.angular_velocity);
    let before = head.resisted;
    let mut twist = before[0] - head.twisting_inertia * vec3(head.normal).dot(turn);
    let mut x = before[1] - head.rolling_inertia * t1.dot(turn);
    let mut y = before[2] - head.rolling_inertia * t2.dot(turn);
    let most_twist = head.twisting_resistance * sum;
    if twist.abs() > most_twist {
        twist *= most_twist / twist.abs();
    }
    let length = (x * x + y * y).sqrt();
    let most = head.rolling_resistance * sum;
    if length > most {
        let scale = most / length;
        x *= scale;
        y *= scale;
    }
    let push = about(head, [t1, t2], [twist - before[0], x - before[1], y - before[2]]);
    if finite(push.to_array()) {
        head.resisted = [twist, x, y];
        turn_by(a, b, push);
    }
}

/// Angular impulses about the normal and the two tangents, as one.
fn about(head: &ConstraintHead, [t1, t2]: [Vec3; 2], [twist, x, y]: [f32; 3]) -> Vec3 {
    twist * vec3(head.normal) + x * t1 + y * t2
}

fn turn_by(a: &mut SolverBody, b: &mut SolverBody, push: Vec3) {
    a.angular_velocity = (vec3(a.angular_velocity) - inverse_inertia_times(a, push)).to_array();
    b.angular_velocity = (vec3(b.angular_velocity) + inverse_inertia_times(b, push)).to_array();
}
