//! The law of `jacobi`, several constraints at a time: the same operations in the same order, so the same results.

use super::gauss_seidel_lanes::push_normal;
use super::lanes::{BodyLanes, ConstraintLanes, HeadLanes, NO_BODY, PointLanes, ROWS, START};
use super::push_lanes::{arms, count, push_tangent};
use super::simd::{Lanes, V3};
use crate::shared::Shared;
use tumble_core::layout::StepParams;
use wide::f32x4;

/// One visit to the constraints of a group; what it leaves of their parts of the bodies, split into `parts`.
#[inline(always)]
pub(super) fn visit<L: Lanes>(
    last: bool,
    c: &mut ConstraintLanes<L>,
    [a, b]: [&BodyLanes<L>; 2],
    parts: [L; 2],
    step: &StepParams,
) -> [BodyLanes<L>; 2] {
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
fn part<L: Lanes>(body: &BodyLanes<L>, parts: L) -> BodyLanes<L> {
    let mut part = *body;
    part.inverse_mass = body.inverse_mass * parts;
    part.inertia_diagonal = parts * body.inertia_diagonal;
    part.inertia_off = parts * body.inertia_off;
    part
}

#[inline(always)]
fn share<L: Lanes>(head: &HeadLanes<L>, p: &PointLanes<L>, [a, b]: [&BodyLanes<L>; 2], parts: [&BodyLanes<L>; 2]) -> L {
    let [ra, rb] = arms(head, p);
    let n = head.normal;
    (yields(a, ra, n) + yields(b, rb, n)) / (yields(parts[0], ra, n) + yields(parts[1], rb, n))
}

#[inline(always)]
fn yields<L: Lanes>(body: &BodyLanes<L>, r: V3<L>, normal: V3<L>) -> L {
    let turn = r.cross(normal);
    let along = || body.inverse_mass * body.along_free(normal).dot(normal);
    body.if_locked(body, body.inverse_mass, along) + turn.dot(body.inverse_inertia_times(turn))
}

/// How many parts each body is split into.
#[inline(always)]
pub(super) fn parts<L: Lanes>(read: impl Fn(usize) -> f32x4, index: L::Indices) -> L {
    let mut parts = L::ZERO;
    for (lane, &i) in index.as_ref().iter().enumerate().filter(|(_, i)| **i != NO_BODY) {
        parts.as_mut_array()[lane] = read(ROWS * i as usize + START).as_array()[3];
    }
    parts
}

/// Adds the changes of velocity of one of `parts` parts to the means of those that move.
///
/// # Safety
/// No other thread touches any of those bodies meanwhile.
#[inline(always)]
pub(super) unsafe fn add_change<L: Lanes>(
    body: &BodyLanes<L>,
    part: &BodyLanes<L>,
    parts: L,
    bodies: &Shared<'_, f32x4>,
    index: L::Indices,
) {
    let changes = [(part.linear - body.linear) / parts, (part.angular - body.angular) / parts];
    for (lane, &i) in index.as_ref().iter().enumerate() {
        if body.inverse_mass.as_array()[lane] > 0.0 {
            for (row, change) in changes.iter().enumerate() {
                let at = |l: L| l.as_array()[lane];
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
