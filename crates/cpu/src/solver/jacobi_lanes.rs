//! The law of `jacobi`, several constraints at a time: the same operations in the same order, so the same results.

use super::gauss_seidel_lanes::push_normal;
use super::lanes::{BodyLanes, ConstraintLanes, HeadLanes, LANES, Lane, NO_BODY, PointLanes, ROWS, START, V3};
use super::push_lanes::{arms, count, push_tangent};
use crate::shared::Shared;
use tumble_core::layout::StepParams;
use wide::f32x4;

/// One visit to the constraints of a group; what it leaves of their parts of the bodies, split into `parts`.
#[inline(always)]
pub(super) fn visit(
    last: bool,
    c: &mut ConstraintLanes,
    [a, b]: [&BodyLanes; 2],
    parts: [Lane; 2],
    step: &StepParams,
) -> [BodyLanes; 2] {
    let (head, points) = c.split();
    let (mut part_a, mut part_b) = (part(a, parts[0]), part(b, parts[1]));
    for p in points.iter_mut() {
        let mass = p.normal_mass * share(head, p, [a, b], [&part_a, &part_b]);
        push_normal(head, p, mass, &mut part_a, &mut part_b, step);
    }
    let most = parts[0].fast_max(parts[1]);
    for p in points {
        let mass = p.tangent_mass;
        p.tangent_mass = mass / most;
        push_tangent(head, p, &mut part_a, &mut part_b);
        p.tangent_mass = mass;
        if last {
            count(p);
        }
    }
    [part_a, part_b]
}

#[inline(always)]
fn part(body: &BodyLanes, parts: Lane) -> BodyLanes {
    let mut part = *body;
    part.inverse_mass = body.inverse_mass * parts;
    part.inertia_diagonal = parts * body.inertia_diagonal;
    part.inertia_off = parts * body.inertia_off;
    part
}

#[inline(always)]
fn share(head: &HeadLanes, p: &PointLanes, [a, b]: [&BodyLanes; 2], parts: [&BodyLanes; 2]) -> Lane {
    let [ra, rb] = arms(head, p);
    let yields = |body: &BodyLanes, r: V3| {
        let turn = r.cross(head.normal);
        body.inverse_mass + turn.dot(body.inverse_inertia_times(turn))
    };
    (yields(a, ra) + yields(b, rb)) / (yields(parts[0], ra) + yields(parts[1], rb))
}

/// How many parts each body is split into.
#[inline(always)]
pub(super) fn parts(read: impl Fn(usize) -> f32x4, index: [u32; LANES]) -> Lane {
    let mut parts = Lane::ZERO;
    for (lane, &i) in index.iter().enumerate().filter(|(_, i)| **i != NO_BODY) {
        parts.as_mut_array()[lane] = read(ROWS * i as usize + START).as_array()[3];
    }
    parts
}

/// Adds the changes of velocity of one of `parts` parts to the means of those that move.
///
/// # Safety
/// No other thread touches any of those bodies meanwhile.
#[inline(always)]
pub(super) unsafe fn add_change(
    body: &BodyLanes,
    part: &BodyLanes,
    parts: Lane,
    bodies: &Shared<'_, f32x4>,
    index: [u32; LANES],
) {
    let over = |v: V3| V3::new(v.x / parts, v.y / parts, v.z / parts);
    let changes = [over(part.linear - body.linear), over(part.angular - body.angular)];
    for (lane, i) in index.into_iter().enumerate() {
        if body.inverse_mass.as_array()[lane] > 0.0 {
            for (row, change) in changes.iter().enumerate() {
                let at = |l: Lane| l.as_array()[lane];
                let row = ROWS * i as usize + START + row;
                // SAFETY: the caller's promise.
                let start = unsafe { bodies.get(row) };
                let more = f32x4::new([at(change.x), at(change.y), at(change.z), 0.0]);
                // SAFETY: the caller's promise.
                unsafe { bodies.set(row, start + more) };
            }
        }
    }
}
