//! Resistance against rolling and twisting: an angular impulse a manifold, of no more than its normal impulse times a
//! length. Twin of `shaders/solver/resist.wgsl`.
//!
//! Like friction it is a cone (about the two tangents) and a range (about the normal) around what is accumulated, solved
//! once a visit, after friction. The bound is that of Box2D 3 and Box3D: coefficient times radius times normal impulse.
//!
//! What accumulates over sub-steps is a torsion spring of inertia / h² while motion lasts, so towers of balls buckle like
//! columns of springs: of 30 balls, with one sweep in each of 8 sub-steps, all fell within 20 s. Each visit goes a little
//! too far (successive over-relaxation), which makes that spring as much stiffer at no cost: now they stand. Twisting goes
//! before rolling, not along with it, since of two that are coupled each may only go too far when it sees the other.

use crate::math::{finite, inverse_inertia_times, vec3};
use glam::Vec3;
use tumble_core::layout::{ConstraintHead, Impulse, SolverBody};

/// How far a visit goes, 1 being where the turning would end. From 1.6 on towers sway.
pub(super) const OVERSHOOT: f32 = 1.3;

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
    tangents: [Vec3; 2],
    impulses: &[Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
) {
    if !resists(head) {
        return;
    }
    let sum = impulses.iter().map(|i| i.normal).fold(0.0, |sum, normal| sum + normal);
    let [before, x0, y0] = head.resisted;
    let turn = vec3(b.angular_velocity) - vec3(a.angular_velocity);
    let mut twist = before - OVERSHOOT * head.twisting_inertia * vec3(head.normal).dot(turn);
    let most = head.twisting_resistance * sum;
    if twist.abs() > most {
        twist *= most / twist.abs();
    }
    push(head, tangents, [twist, x0, y0], a, b);

    let turn = vec3(b.angular_velocity) - vec3(a.angular_velocity);
    let mut x = x0 - OVERSHOOT * head.rolling_inertia * tangents[0].dot(turn);
    let mut y = y0 - OVERSHOOT * head.rolling_inertia * tangents[1].dot(turn);
    let length = (x * x + y * y).sqrt();
    let most = head.rolling_resistance * sum;
    if length > most {
        let scale = most / length;
        x *= scale;
        y *= scale;
    }
    push(head, tangents, [head.resisted[0], x, y], a, b);
}

/// Brings the angular impulse to `after`, where that is finite.
fn push(head: &mut ConstraintHead, tangents: [Vec3; 2], after: [f32; 3], a: &mut SolverBody, b: &mut SolverBody) {
    let before = head.resisted;
    let push = about(head, tangents, [after[0] - before[0], after[1] - before[1], after[2] - before[2]]);
    if finite(push.to_array()) {
        head.resisted = after;
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
