//! Projected Gauss-Seidel with Baumgarte stabilisation: rigid contacts, visited in turn and many times a sub-step. Twin
//! of `shaders/solver/gauss_seidel.wgsl`.

use super::push::{apply, arms, count, push_tangent, relative_velocity, separation};
use crate::math::{finite, vec3};
use glam::Vec3;
use tumble_core::layout::{ConstraintHead, ConstraintPoint, Impulse, SolverBody, StepParams};

/// One visit to one constraint: normals first, then friction within the cone that they allow. The `last` of a sub-step
/// counts its impulses.
pub(super) fn visit(
    last: bool,
    head: &ConstraintHead,
    tangents: [Vec3; 2],
    points: &mut [ConstraintPoint],
    impulses: &mut [Impulse],
    [a, b]: [&mut SolverBody; 2],
    step: &StepParams,
) {
    for (point, impulse) in points.iter_mut().zip(impulses.iter_mut()) {
        push_normal(head, point, impulse, point.normal_mass, a, b, step);
    }
    for (point, impulse) in points.iter_mut().zip(impulses) {
        push_tangent(head, tangents, point, impulse, a, b);
        if last {
            count(point, impulse);
        }
    }
}

/// A gap is closed no faster than it lasts; overlap beyond the slop is undone by a velocity.
pub(super) fn push_normal(
    head: &ConstraintHead,
    point: &mut ConstraintPoint,
    impulse: &mut Impulse,
    mass: f32,
    a: &mut SolverBody,
    b: &mut SolverBody,
    step: &StepParams,
) {
    let normal = vec3(head.normal);
    let [ra, rb] = arms(head, point);
    let velocity = normal.dot(relative_velocity(a, b, ra, rb));
    let separation = separation(head, point, a, b);
    let bias = if separation > 0.0 {
        separation * step.inverse_h
    } else {
        (head.bias_rate * (separation + step.slop).min(0.0)).max(-step.push_speed)
    };
    let sum = impulse.normal - mass * (velocity + bias);
    // The sum, and not the push: the larger of NaN and zero is zero.
    if finite([sum; 3]) {
        let new = sum.max(0.0);
        let push = new - impulse.normal;
        impulse.normal = new;
        apply(a, b, ra, rb, push * normal);
        // Without the last sub-step's gravity: a bounce must not gain by it.
        if new == 0.0 && point.total[0] == 0.0 {
            point.approach = point.approach.min(velocity);
        }
    }
}
