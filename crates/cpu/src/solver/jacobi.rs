//! Jacobi iterations with mass splitting. Twin of `shaders/solver/jacobi.wgsl`.
//!
//! A body of n contacts is split into n parts of mass / n, one for each contact to push; after the iteration the body
//! has the mean of their velocities. So every contact sees the velocities that the iteration began with, and what it
//! does is summed in `linear_start` and `angular_start`: batch by batch, hence in an order that no thread decides.

use super::gauss_seidel::push_normal;
use super::push::{arms, count, push_tangent};
use crate::math::{along_free, inverse_inertia_times, is_locked, vec3};
use glam::Vec3;
use tumble_core::layout::{BodyProps, BodyState, ConstraintHead, ConstraintPoint, Impulse, SolverBody, StepParams};

/// Counts the constraint at its bodies.
pub(super) fn split(a: &mut SolverBody, b: &mut SolverBody) {
    a.weight += 1.0;
    b.weight += 1.0;
}

/// Before the first iteration of a sub-step.
pub(super) fn begin(body: &mut SolverBody, _: &BodyState, _: &BodyProps, _: &StepParams) {
    body.linear_start = body.linear_velocity;
    body.angular_start = body.angular_velocity;
}

/// After an iteration.
pub(super) fn settle(body: &mut SolverBody, _: &BodyState, _: &BodyProps, _: &StepParams) {
    body.linear_velocity = body.linear_start;
    body.angular_velocity = body.angular_start;
}

/// One visit to one constraint: the law of `gauss_seidel` on its parts of the bodies.
pub(super) fn visit(
    last: bool,
    head: &ConstraintHead,
    tangents: [Vec3; 2],
    points: &mut [ConstraintPoint],
    impulses: &mut [Impulse],
    [a, b]: [&mut SolverBody; 2],
    step: &StepParams,
) {
    let (mut part_a, mut part_b) = (part(a), part(b));
    for (point, impulse) in points.iter_mut().zip(impulses.iter_mut()) {
        let mass = point.normal_mass * share(head, point, [a, b], [&part_a, &part_b]);
        push_normal(head, point, impulse, mass, &mut part_a, &mut part_b, step);
    }
    let parts = a.weight.max(b.weight);
    for (point, impulse) in points.iter_mut().zip(impulses) {
        // No more than the mass that is split so; friction against what has many contacts is slow.
        let light = ConstraintPoint { tangent_mass: point.tangent_mass / parts, ..*point };
        push_tangent(head, tangents, &light, impulse, &mut part_a, &mut part_b);
        if last {
            count(point, impulse);
        }
    }
    let (parts_a, parts_b) = (a.weight, b.weight);
    add_change(a, &part_a, parts_a);
    add_change(b, &part_b, parts_b);
}

/// Adds the change of velocity of one of `parts` parts to the mean. (Of a body that does not move it means nothing, and
/// is not written.)
pub(super) fn add_change(body: &mut SolverBody, part: &SolverBody, parts: f32) {
    let linear = (vec3(part.linear_velocity) - vec3(body.linear_velocity)) / parts;
    let angular = (vec3(part.angular_velocity) - vec3(body.angular_velocity)) / parts;
    body.linear_start = (vec3(body.linear_start) + linear).to_array();
    body.angular_start = (vec3(body.angular_start) + angular).to_array();
}

fn part(body: &SolverBody) -> SolverBody {
    let parts = body.weight;
    SolverBody {
        inverse_mass: body.inverse_mass * parts,
        inverse_inertia_diagonal: body.inverse_inertia_diagonal.map(|x| x * parts),
        inverse_inertia_off: body.inverse_inertia_off.map(|x| x * parts),
        ..*body
    }
}

/// The mass seen along the normal, parts for bodies.
fn share(head: &ConstraintHead, point: &ConstraintPoint, [a, b]: [&SolverBody; 2], parts: [&SolverBody; 2]) -> f32 {
    let [ra, rb] = arms(head, point);
    let yields = |body: &SolverBody, r: Vec3| {
        let turn = r.cross(vec3(head.normal));
        let normal = vec3(head.normal);
        let moved = if is_locked(body) { along_free(body, normal).dot(normal) } else { 1.0 };
        body.inverse_mass * moved + turn.dot(inverse_inertia_times(body, turn))
    };
    (yields(a, ra) + yields(b, rb)) / (yields(parts[0], ra) + yields(parts[1], rb))
}
