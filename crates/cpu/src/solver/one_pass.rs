//! One sweep a sub-step, and contacts that remember what they bear. Twin of `shaders/solver/one_pass.wgsl`.
//!
//! Between sub-steps the bodies alone carry impulses and gravity over (`motion::next_substep`), so that no visit is
//! spent on a warm start but the first. A contact is a damped spring of `stiffness` mass / h²: the leak that damps it lets
//! it give way by load h² / (stiffness mass). Here the leak leads not to zero but to a remembered impulse, which follows
//! the impulses: the mean over the manifold's points, and much more slowly what each has more or less. Once it has caught
//! up, nothing gives way. (Were the points quicker, columns would sway and topple: what holds them upright is that an end
//! which bears more gives way.)
//!
//! How fast it may follow: with a rate of less than (1 - stiffness) e / leak the two do not swing, e being the smallest
//! eigenvalue of D^-1 A, A the matrix of contacts and D its diagonal. For the load as it is, e is no more than the
//! Rayleigh quotient of the impulses: twice the kinetic energy that all of them together would give the bodies, over the
//! sum of impulse² / mass. Both are sums over bodies and contacts; `ease` takes each body's own quotient and mixes it with
//! its neighbours' along the load, step by step. The weighted mean stays that of the whole, so that the bound holds, and
//! every part of a pile gets the rate of its own neighbourhood, with no sum over islands.

use super::push::{apply, arms, count, push_tangent, relative_velocity, separation, warm_start};
use super::resist::resist;
use crate::math::{along_free, finite, inverse_inertia_times, quat, rotate_back, vec3};
use glam::Vec3;
use tumble_core::layout::{BodyProps, BodyState, ConstraintHead, ConstraintPoint, Impulse, SolverBody, StepParams};

/// Share of a body's eigenvalue that comes from its neighbours: with 0.95 from those up to some four contacts away.
pub const EASE_MIX: f32 = 0.95;
/// No eigenvalue of D^-1 A is larger.
pub const MAX_EIGENVALUE: f32 = 4.0;
/// What a point has more or less than the mean is remembered at this times the square of the mean's rate, a sub-step: a
/// twentieth of it at most, and next to nothing where loads are so soft that a column might sway.
pub const DEVIATION: f32 = 2.5;
/// Share of the memory that is left, each sub-step, of a contact that does not push.
pub const FADE: f32 = 0.9;

/// Applies the stored impulses, and weighs the eigenvalues of the bodies' neighbours with them.
pub(super) fn load(
    head: &ConstraintHead,
    tangents: [Vec3; 2],
    points: &[ConstraintPoint],
    impulses: &[Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
) {
    warm_start(head, tangents, points, impulses, a, b);
    let mut weight = 0.0;
    for (point, impulse) in points.iter().zip(impulses) {
        let [x, y] = impulse.tangent;
        weight += over(impulse.normal * impulse.normal, point.normal_mass) + over(x * x + y * y, point.tangent_mass);
    }
    let [twist, x, y] = head.resisted;
    weight += over(twist * twist, head.twisting_inertia) + over(x * x + y * y, head.rolling_inertia);
    let [from_a, from_b] = eigenvalues(a, b);
    a.weight += weight;
    a.weighted += weight * from_b;
    b.weight += weight;
    b.weighted += weight * from_a;
}

/// One visit to one constraint: normals first, then friction within the cone that they allow, then the memory.
pub(super) fn pass(
    head: &mut ConstraintHead,
    tangents: [Vec3; 2],
    points: &mut [ConstraintPoint],
    impulses: &mut [Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
    step: &StepParams,
) {
    let mut before = [(0.0, [0.0; 2]); 4];
    for (k, (point, impulse)) in points.iter_mut().zip(impulses.iter_mut()).enumerate() {
        before[k] = (impulse.normal, impulse.tangent);
        push_normal(head, point, impulse, a, b, step);
    }
    for (point, impulse) in points.iter_mut().zip(impulses.iter_mut()) {
        push_tangent(head, tangents, point, impulse, a, b);
        count(point, impulse);
    }
    resist(head, tangents, impulses, a, b);
    remember(head, points, impulses, a, b, step);
    for (k, (point, impulse)) in points.iter().zip(impulses).enumerate() {
        // A blow is given once: the next sub-step starts without it.
        let (normal, tangent) = before[k];
        let blow = impulse.normal - normal;
        if blow > step.blow_speed * point.normal_mass {
            let (x, y) = (impulse.tangent[0] - tangent[0], impulse.tangent[1] - tangent[1]);
            let push = blow * vec3(head.normal) + x * tangents[0] + y * tangents[1];
            start_after(arms(head, point), push, a, b);
            (impulse.normal, impulse.tangent) = (normal, tangent);
        }
    }
}

/// A gap is closed no faster than it lasts. Overlap is a damped spring whose leak leads to what is remembered; so is a
/// gap so small that the spring still presses, or contacts would swing about their onset.
fn push_normal(
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
    let mass = point.normal_mass;
    let remembered = head.remembered + point.deviation;
    let pressed = impulse.normal > 0.0 && separation * mass < step.memory_band * remembered;
    let change = if separation > 0.0 && !pressed {
        -mass * (velocity + separation * step.inverse_h)
    } else {
        let leak = head.impulse_scale * (impulse.normal - remembered);
        let spring = head.mass_scale * mass * head.bias_rate * separation;
        let pull = (spring + leak).max(-step.push_speed * mass);
        -(head.mass_scale * mass * velocity + pull)
    };
    let sum = impulse.normal + change;
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

/// The memory follows: the mean that of the impulses, and each point's deviation from it theirs.
fn remember(
    head: &mut ConstraintHead,
    points: &mut [ConstraintPoint],
    impulses: &[Impulse],
    a: &SolverBody,
    b: &SolverBody,
    step: &StepParams,
) {
    let mean = impulses.iter().map(|i| i.normal).fold(0.0, |sum, normal| sum + normal) / head.count as f32;
    let [from_a, from_b] = eigenvalues(a, b);
    let rate = (step.memory_gain * (from_a + from_b)).min(step.memory_limit);
    let remembered =
        if mean > 0.0 { head.remembered + rate * (mean - head.remembered) } else { FADE * head.remembered };
    head.remembered = remembered;
    for (point, impulse) in points.iter_mut().zip(impulses) {
        let more = impulse.normal - mean;
        let own = (remembered + point.deviation + DEVIATION * rate * rate * (more - point.deviation)).max(0.0);
        let own = if impulse.normal > 0.0 { own } else { FADE * own.min(remembered) };
        point.deviation = own - remembered;
    }
}

/// The bodies' eigenvalues; one that does not move has the other's.
fn eigenvalues(a: &SolverBody, b: &SolverBody) -> [f32; 2] {
    [
        if a.inverse_mass > 0.0 { a.eigenvalue } else { b.eigenvalue },
        if b.inverse_mass > 0.0 { b.eigenvalue } else { a.eigenvalue },
    ]
}

/// Counts `push` to what the sub-step began with.
fn start_after([ra, rb]: [Vec3; 2], push: Vec3, a: &mut SolverBody, b: &mut SolverBody) {
    a.linear_start = (vec3(a.linear_start) - a.inverse_mass * along_free(a, push)).to_array();
    a.angular_start = (vec3(a.angular_start) - inverse_inertia_times(a, ra.cross(push))).to_array();
    b.linear_start = (vec3(b.linear_start) + b.inverse_mass * along_free(b, push)).to_array();
    b.angular_start = (vec3(b.angular_start) + inverse_inertia_times(b, rb.cross(push))).to_array();
}

fn over(square: f32, mass: f32) -> f32 {
    if mass > 0.0 { square / mass } else { 0.0 }
}

/// The body's eigenvalue anew, once its last sub-step is solved: its own quotient, mixed with those beside it.
pub fn ease(body: &SolverBody, state: &BodyState, props: &BodyProps) -> f32 {
    let dv = vec3(body.linear_velocity) - vec3(body.linear_start);
    let dw =
        rotate_back(quat(body.delta) * quat(state.rotation), vec3(body.angular_velocity) - vec3(body.angular_start));
    if body.inverse_mass == 0.0 || body.weight == 0.0 {
        return 0.0;
    }
    let lift = dv.dot(dv) / body.inverse_mass + (vec3(props.inertia) * dw).dot(dw);
    let eased = ((1.0 - EASE_MIX) * lift + EASE_MIX * body.weighted) / body.weight;
    if finite([eased; 3]) { eased.min(MAX_EIGENVALUE) } else { 0.0 }
}
