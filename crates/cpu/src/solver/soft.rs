//! Soft contacts with a friction cone: springs in the solve visit, rigid in the relax visit. Twin of
//! `shaders/solver/soft.wgsl`.

use super::Visit;
use super::push::{apply, arms, count, push_tangent, relative_velocity, separation};
use super::resist::resist;
use crate::math::{finite, vec3};
use glam::Vec3;
use tumble_core::layout::{ConstraintHead, ConstraintPoint, Impulse, SolverBody, StepParams};

/// One visit to one constraint: normals first, then friction within the cone that they allow.
pub(super) fn visit(
    visit: Visit,
    head: &mut ConstraintHead,
    tangents: [Vec3; 2],
    points: &mut [ConstraintPoint],
    impulses: &mut [Impulse],
    [a, b]: [&mut SolverBody; 2],
    step: &StepParams,
) {
    for (point, impulse) in points.iter_mut().zip(impulses.iter_mut()) {
        push_normal(visit, head, point, impulse, a, b, step);
    }
    for (point, impulse) in points.iter_mut().zip(impulses.iter_mut()) {
        push_tangent(head, tangents, point, impulse, a, b);
        if visit == Visit::Relax {
            count(point, impulse);
        }
    }
    resist(head, tangents, impulses, a, b);
}

/// A gap is closed no faster than it lasts; overlap is a damped spring when soft, and left alone when rigid.
fn push_normal(
    visit: Visit,
    head: &ConstraintHead,
    point: &mut ConstraintPoint,
    impulse: &mut Impulse,
    a: &mut SolverBody,
    b: &mut SolverBody,
    step: &StepParams,
) {
    let normal = vec3(head.normal);
    let [ra, rb] = arms(head, point);
    let velocity = normal.dot(relative_velocity(a, b, ra, rb));
    let separation = separation(head, point, a, b);
    let (bias, mass_scale, impulse_scale) = if separation > 0.0 {
        (separation * step.inverse_h, 1.0, 0.0)
    } else if visit == Visit::Solve {
        ((head.bias_rate * separation).max(-step.push_speed), head.mass_scale, head.impulse_scale)
    } else {
        (0.0, 1.0, 0.0)
    };
    if visit == Visit::Relax && point.total[0] == 0.0 && impulse.normal == 0.0 {
        point.approach = point.approach.min(velocity);
    }
    let change = -point.normal_mass * mass_scale * (velocity + bias) - impulse_scale * impulse.normal;
    let sum = impulse.normal + change;
    // The sum, and not the push: the larger of NaN and zero is zero.
    if finite([sum; 3]) {
        let new = sum.max(0.0);
        let push = new - impulse.normal;
        impulse.normal = new;
        apply(a, b, ra, rb, push * normal);
    }
}
