//! The points of `prepare`, several constraints at a time: the same operations in the same order, so the same results.

use super::lanes::{BodyLanes, BodyRows, ConstraintLanes};
use super::push_lanes::arms;
use super::simd::{Lanes, V3};

/// Fills in what follows from the geometry: tangents, the other arm, masses, approach. `bodies` as rows.
#[inline(always)]
pub(super) fn prepare<L: Lanes>(c: &mut ConstraintLanes<L>, bodies: &[BodyRows]) {
    let (head, points) = c.split();
    let a = BodyLanes::gather(|i| &bodies[i], head.body_a, false);
    let b = BodyLanes::gather(|i| &bodies[i], head.body_b, false);
    let normal = head.normal;
    head.tangents = tangents(normal);
    let [t1, t2] = head.tangents;
    let half = L::splat(0.5);
    for (k, p) in points.iter_mut().enumerate() {
        let used = head.counts.simd_gt(L::splat(k as f32));
        let [ra, rb] = arms(head, p);
        let (k11, k12) = (response(&a, &b, ra, rb, t1, t1), response(&a, &b, ra, rb, t1, t2));
        let k22 = response(&a, &b, ra, rb, t2, t2);
        let apart = L::splat(0.25) * (k11 - k22) * (k11 - k22) + k12 * k12;
        let stiffest = half * (k11 + k22) + apart.sqrt();
        p.adjusted_separation -= normal.dot(rb - ra) - (head.round_b - head.round_a);
        p.normal_mass = used & inverse(response(&a, &b, ra, rb, normal, normal));
        p.tangent_mass = used & inverse(stiffest);
        p.approach = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    }
}

#[inline(always)]
fn tangents<L: Lanes>(n: V3<L>) -> [V3<L>; 2] {
    let flat = n.x.abs().simd_lt(L::splat(0.577_350_3));
    let t = V3::new(flat.bitselect(L::ZERO, n.y), flat.bitselect(n.z, -n.x), flat.bitselect(-n.y, L::ZERO));
    let length = t.dot(t).sqrt();
    let t = (L::ONE / length) * t;
    // A lane without a constraint has no normal, and must not make others' numbers slow or its own infinite.
    let good = length.simd_gt(L::ZERO);
    let t = V3::new(good & t.x, good & t.y, good & t.z);
    [t, n.cross(t)]
}

#[inline(always)]
fn response<L: Lanes>(a: &BodyLanes<L>, b: &BodyLanes<L>, ra: V3<L>, rb: V3<L>, u: V3<L>, v: V3<L>) -> L {
    let turn_a = a.inverse_inertia_times(ra.cross(u)).cross(ra);
    let turn_b = b.inverse_inertia_times(rb.cross(u)).cross(rb);
    let along = |body: &BodyLanes<L>| body.inverse_mass * body.along_free(u).dot(v);
    let moved = a.if_locked(b, (a.inverse_mass + b.inverse_mass) * u.dot(v), || along(a) + along(b));
    moved + v.dot(turn_a + turn_b)
}

#[inline(always)]
fn inverse<L: Lanes>(x: L) -> L {
    x.simd_gt(L::ZERO) & (L::ONE / x)
}
