//! The law of `resist`, several constraints at a time: the same operations in the same order, so the same results. Groups
//! of which none resists are passed by.

use super::lanes::{BodyLanes, HeadLanes, Lane, PointLanes, V3};

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
    let turn = b.angular - a.angular;
    let before = head.resisted;
    let twist = before[0] - head.twisting_inertia * head.normal.dot(turn);
    let x = before[1] - head.rolling_inertia * head.tangents[0].dot(turn);
    let y = before[2] - head.rolling_inertia * head.tangents[1].dot(turn);
    let most_twist = head.twisting_resistance * sum;
    let twist = twist * twist.abs().simd_gt(most_twist).bitselect(most_twist / twist.abs(), Lane::ONE);
    let length = (x * x + y * y).sqrt();
    let most = head.rolling_resistance * sum;
    let scale = length.simd_gt(most).bitselect(most / length, Lane::ONE);
    let (x, y) = (x * scale, y * scale);
    let push = about(head, [twist - before[0], x - before[1], y - before[2]]);
    let good = push.x.is_finite() & push.y.is_finite() & push.z.is_finite();
    let push = V3::new(good & push.x, good & push.y, good & push.z);
    head.resisted = [good.bitselect(twist, before[0]), good.bitselect(x, before[1]), good.bitselect(y, before[2])];
    turn_by(head, a, b, push);
}

fn about(head: &HeadLanes, [twist, x, y]: [Lane; 3]) -> V3 {
    let [t1, t2] = head.tangents;
    twist * head.normal + x * t1 + y * t2
}

/// Lanes that resist nothing keep their velocity to the sign of a zero.
fn turn_by(head: &HeadLanes, a: &mut BodyLanes, b: &mut BodyLanes, push: V3) {
    let resists = head.rolling_resistance.simd_gt(Lane::ZERO) | head.twisting_resistance.simd_gt(Lane::ZERO);
    let only = |new: V3, old: V3| {
        V3::new(resists.bitselect(new.x, old.x), resists.bitselect(new.y, old.y), resists.bitselect(new.z, old.z))
    };
    a.angular = only(a.angular - a.inverse_inertia_times(push), a.angular);
    b.angular = only(b.angular + b.inverse_inertia_times(push), b.angular);
}
