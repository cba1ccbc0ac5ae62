//! The law of one visit: soft contacts with a friction cone. Twin of `shaders/solver/soft.wgsl`.

use super::Visit;
use crate::math::{finite, inverse_inertia_times, quat, rotate, tangents, vec3};
use glam::Vec3;
use tumble_core::layout::{ConstraintHead, ConstraintPoint, Impulse, SolverBody, StepParams};

/// One visit to one constraint: normals first, then friction within the cone that they allow.
pub fn visit(
    visit: Visit,
    head: &ConstraintHead,
    points: &mut [ConstraintPoint],
    impulses: &mut [Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
    step: &StepParams,
) {
    let normal = vec3(head.normal);
    let (t1, t2) = tangents(normal);
    let count = head.count as usize;
    match visit {
        Visit::WarmStart => {
            for (point, impulse) in points.iter().zip(impulses.iter()).take(count) {
                let push = impulse.normal * normal + impulse.tangent[0] * t1 + impulse.tangent[1] * t2;
                apply(a, b, vec3(point.anchor_a), vec3(point.anchor_b), push);
            }
        }
        Visit::Solve | Visit::Relax => {
            for (point, impulse) in points.iter_mut().zip(impulses.iter_mut()).take(count) {
                push_normal(visit, head, point, impulse, a, b, step);
            }
            for (point, impulse) in points.iter().zip(impulses.iter_mut()).take(count) {
                push_tangent(head.friction, t1, t2, point, impulse, a, b);
            }
        }
        Visit::Restitution => {
            for (point, impulse) in points.iter_mut().zip(impulses.iter_mut()).take(count) {
                bounce(head.restitution, normal, point, impulse, a, b, step);
            }
        }
    }
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
    let (ra, rb) = (vec3(point.anchor_a), vec3(point.anchor_b));
    let velocity = normal.dot(relative_velocity(a, b, ra, rb));
    let moved = vec3(b.translation) - vec3(a.translation) + rotate(quat(b.delta), rb) - rotate(quat(a.delta), ra);
    let separation = point.adjusted_separation + normal.dot(moved);
    let (bias, mass_scale, impulse_scale) = if separation > 0.0 {
        (separation * step.inverse_h, 1.0, 0.0)
    } else if visit == Visit::Solve {
        ((head.bias_rate * separation).max(-step.push_speed), head.mass_scale, head.impulse_scale)
    } else {
        (0.0, 1.0, 0.0)
    };
    if visit == Visit::Relax && point.max_impulse == 0.0 {
        point.approach = point.approach.min(velocity);
    }
    let change = -point.normal_mass * mass_scale * (velocity + bias) - impulse_scale * impulse.normal;
    let sum = impulse.normal + change;
    // The sum, and not the push: the larger of NaN and zero is zero.
    if finite([sum; 3]) {
        let new = sum.max(0.0);
        let push = new - impulse.normal;
        impulse.normal = new;
        point.max_impulse = point.max_impulse.max(new);
        apply(a, b, ra, rb, push * normal);
    }
}

/// Friction against the sliding velocity, within the cone.
fn push_tangent(
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

/// Gives back a share of the speed at which the points met, where they met fast enough and pushed at all.
fn bounce(
    restitution: f32,
    normal: Vec3,
    point: &mut ConstraintPoint,
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

fn relative_velocity(a: &SolverBody, b: &SolverBody, ra: Vec3, rb: Vec3) -> Vec3 {
    let at_a = vec3(a.linear_velocity) + vec3(a.angular_velocity).cross(ra);
    let at_b = vec3(b.linear_velocity) + vec3(b.angular_velocity).cross(rb);
    at_b - at_a
}

/// Applies `push` to b at `rb` and its opposite to a at `ra`.
fn apply(a: &mut SolverBody, b: &mut SolverBody, ra: Vec3, rb: Vec3, push: Vec3) {
    a.linear_velocity = (vec3(a.linear_velocity) - a.inverse_mass * push).to_array();
    a.angular_velocity = (vec3(a.angular_velocity) - inverse_inertia_times(a, ra.cross(push))).to_array();
    b.linear_velocity = (vec3(b.linear_velocity) + b.inverse_mass * push).to_array();
    b.angular_velocity = (vec3(b.angular_velocity) + inverse_inertia_times(b, rb.cross(push))).to_array();
}
