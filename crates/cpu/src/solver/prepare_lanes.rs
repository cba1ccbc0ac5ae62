//! The points of `prepare`, several constraints at a time: the same operations in the same order, so the same results.

use super::lanes::{BodyLanes, ConstraintLanes, Lane, V3};
use super::push_lanes::arms;
use wide::f32x4;

/// Fills in what follows from the geometry: tangents, the other arm, masses, approach. `bodies` as rows.
pub(super) fn prepare(c: &mut ConstraintLanes, bodies: &[f32x4]) {
    let (head, points) = c.split();
    let a = BodyLanes::gather(|i| bodies[i], head.body_a, false);
    let b = BodyLanes::gather(|i| bodies[i], head.body_b, false);
    let normal = head.normal;
    head.tangents = tangents(normal);
    let [t1, t2] = head.tangents;
    let half = Lane::splat(0.5);
    for (k, p) in points.iter_mut().enumerate() {
        let used = head.counts.simd_gt(Lane::splat(k as f32));
        let [ra, rb] = arms(head, p);
        let along = |u: V3, v: V3| response(&a, &b, ra, rb, u, v);
        let (k11, k12, k22) = (along(t1, t1), along(t1, t2), along(t2, t2));
        let apart = Lane::splat(0.25) * (k11 - k22) * (k11 - k22) + k12 * k12;
        let stiffest = half * (k11 + k22) + apart.sqrt();
        p.adjusted_separation -= normal.dot(rb - ra) - (head.round_b - head.round_a);
        p.normal_mass = used & inverse(along(normal, normal));
        p.tangent_mass = used & inverse(stiffest);
        p.approach = normal.dot(b.velocity_at(rb) - a.velocity_at(ra));
    }
}

fn tangents(n: V3) -> [V3; 2] {
    let flat = n.x.abs().simd_lt(Lane::splat(0.577_350_3));
    let t = V3::new(flat.bitselect(Lane::ZERO, n.y), flat.bitselect(n.z, -n.x), flat.bitselect(-n.y, Lane::ZERO));
    let length = t.dot(t).sqrt();
    let t = (Lane::ONE / length) * t;
    // A lane without a constraint has no normal, and must not make others' numbers slow or its own infinite.
    let good = length.simd_gt(Lane::ZERO);
    let t = V3::new(good & t.x, good & t.y, good & t.z);
    [t, n.cross(t)]
}

fn response(a: &BodyLanes, b: &BodyLanes, ra: V3, rb: V3, u: V3, v: V3) -> Lane {
    let turn_a = a.inverse_inertia_times(ra.cross(u)).cross(ra);
    let turn_b = b.inverse_inertia_times(rb.cross(u)).cross(rb);
    (a.inverse_mass + b.inverse_mass) * u.dot(v) + v.dot(turn_a + turn_b)
}

fn inverse(x: Lane) -> Lane {
    x.simd_gt(Lane::ZERO) & (Lane::ONE / x)
}
