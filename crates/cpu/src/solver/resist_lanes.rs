//! The law of `resist`, several constraints at a time: the same operations in the same order, so the same results. Groups
//! of which none resists are passed by.

use super::lanes::{BodyLanes, HeadLanes, Lane, PointLanes, V3};
use super::resist::OVERSHOOT;

/// Applies the angular impulses of the last visit.
#[inline(always)]
pub(super) fn warm_start(head: &HeadLanes, a: &mut BodyLanes, b: &mut BodyLanes) {
    if head.resists {
        turn_by(head, a, b, about(head, head.resisted));
    }
}

/// Against relative turning, up to what the normal impulses allow.
#[inline(always)]
pub(super) fn resist(head: &mut HeadLanes, points: &[PointLanes], a: &mut BodyLanes, b: &mut BodyLanes) {
    if head.resists {
        resist_group(head, points, a, b);
    }
}

#[inline(never)]
fn resist_group(head: &mut HeadLanes, points: &[PointLanes], a: &mut BodyLanes, b: &mut BodyLanes) {
    let mut sum = Lane::ZERO;
    for p in points {
        sum += p.normal;
    }
    let overshoot = Lane::splat(OVERSHOOT);
    let [before, x0, y0] = head.resisted;
    let turn = b.angular - a.angular;
    let twist = before - overshoot * head.twisting_inertia * head.normal.dot(turn);
    let most = head.twisting_resistance * sum;
    let scale = twist.abs().simd_gt(most).bitselect(most / twist.abs(), Lane::ONE);
    push(head, [twist * scale, x0, y0], a, b);

    let turn = b.angular - a.angular;
    let x = x0 - overshoot * head.rolling_inertia * head.tangents[0].dot(turn);
    let y = y0 - overshoot * head.rolling_inertia * head.tangents[1].dot(turn);
    let length = (x * x + y * y).sqrt();
    let most = head.rolling_resistance * sum;
    let scale = length.simd_gt(most).bitselect(most / length, Lane::ONE);
    push(head, [head.resisted[0], x * scale, y * scale], a, b);
}

/// Brings the angular impulses to `after`, where that is finite.
#[inline(always)]
fn push(head: &mut HeadLanes, after: [Lane; 3], a: &mut BodyLanes, b: &mut BodyLanes) {
    let before = head.resisted;
    let push = about(head, [after[0] - before[0], after[1] - before[1], after[2] - before[2]]);
    let good = push.x.is_finite() & push.y.is_finite() & push.z.is_finite();
    for ((to, after), before) in head.resisted.iter_mut().zip(after).zip(before) {
        *to = good.bitselect(after, before);
    }
    turn_by(head, a, b, V3::new(good & push.x, good & push.y, good & push.z));
}

#[inline(always)]
fn about(head: &HeadLanes, [twist, x, y]: [Lane; 3]) -> V3 {
    let [t1, t2] = head.tangents;
    twist * head.normal + x * t1 + y * t2
}

/// Lanes that resist nothing keep their velocity to the sign of a zero.
#[inline(always)]
fn turn_by(head: &HeadLanes, a: &mut BodyLanes, b: &mut BodyLanes, push: V3) {
    let resists = head.rolling_resistance.simd_gt(Lane::ZERO) | head.twisting_resistance.simd_gt(Lane::ZERO);
    let only = |new: V3, old: V3| {
        V3::new(resists.bitselect(new.x, old.x), resists.bitselect(new.y, old.y), resists.bitselect(new.z, old.z))
    };
    a.angular = only(a.angular - a.inverse_inertia_times(push), a.angular);
    b.angular = only(b.angular + b.inverse_inertia_times(push), b.angular);
}
