//! The law of `resist`, several constraints at a time: the same operations in the same order, so the same results. Groups
//! of which none resists are passed by.

use super::lanes::{BodyLanes, HeadLanes, PointLanes};
use super::resist::OVERSHOOT;
use super::simd::{Lanes, V3};

/// Applies the angular impulses of the last visit.
#[inline(always)]
pub(super) fn warm_start<L: Lanes>(head: &HeadLanes<L>, a: &mut BodyLanes<L>, b: &mut BodyLanes<L>) {
    if head.resists {
        turn_by(head, a, b, about(head, head.resisted));
    }
}

/// Against relative turning, up to what the normal impulses allow.
#[inline(always)]
pub(super) fn resist<L: Lanes>(
    head: &mut HeadLanes<L>,
    points: &[PointLanes<L>],
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
) {
    if head.resists {
        // Apart, since it is seldom called.
        L::run(
            #[inline(always)]
            || resist_group(head, points, a, b),
        );
    }
}

#[inline(always)]
fn resist_group<L: Lanes>(
    head: &mut HeadLanes<L>,
    points: &[PointLanes<L>],
    a: &mut BodyLanes<L>,
    b: &mut BodyLanes<L>,
) {
    let mut sum = L::ZERO;
    for p in points {
        sum += p.normal;
    }
    let overshoot = L::splat(OVERSHOOT);
    let [before, x0, y0] = head.resisted;
    let turn = b.angular - a.angular;
    let twist = before - overshoot * head.twisting_inertia * head.normal.dot(turn);
    let most = head.twisting_resistance * sum;
    let scale = twist.abs().simd_gt(most).bitselect(most / twist.abs(), L::ONE);
    push(head, [twist * scale, x0, y0], a, b);

    let turn = b.angular - a.angular;
    let x = x0 - overshoot * head.rolling_inertia * head.tangents[0].dot(turn);
    let y = y0 - overshoot * head.rolling_inertia * head.tangents[1].dot(turn);
    let length = (x * x + y * y).sqrt();
    let most = head.rolling_resistance * sum;
    let scale = length.simd_gt(most).bitselect(most / length, L::ONE);
    push(head, [head.resisted[0], x * scale, y * scale], a, b);
}

/// Brings the angular impulses to `after`, where that is finite.
#[inline(always)]
fn push<L: Lanes>(head: &mut HeadLanes<L>, after: [L; 3], a: &mut BodyLanes<L>, b: &mut BodyLanes<L>) {
    let before = head.resisted;
    let push = about(head, [after[0] - before[0], after[1] - before[1], after[2] - before[2]]);
    let good = push.x.is_finite() & push.y.is_finite() & push.z.is_finite();
    for ((to, after), before) in head.resisted.iter_mut().zip(after).zip(before) {
        *to = good.bitselect(after, before);
    }
    turn_by(head, a, b, V3::new(good & push.x, good & push.y, good & push.z));
}

#[inline(always)]
fn about<L: Lanes>(head: &HeadLanes<L>, [twist, x, y]: [L; 3]) -> V3<L> {
    let [t1, t2] = head.tangents;
    twist * head.normal + x * t1 + y * t2
}

/// Lanes that resist nothing keep their velocity to the sign of a zero.
#[inline(always)]
fn turn_by<L: Lanes>(head: &HeadLanes<L>, a: &mut BodyLanes<L>, b: &mut BodyLanes<L>, push: V3<L>) {
    let resists = head.rolling_resistance.simd_gt(L::ZERO) | head.twisting_resistance.simd_gt(L::ZERO);
    a.angular = chosen(resists, a.angular - a.inverse_inertia_times(push), a.angular);
    b.angular = chosen(resists, b.angular + b.inverse_inertia_times(push), b.angular);
}

#[inline(always)]
fn chosen<L: Lanes>(mask: L, new: V3<L>, old: V3<L>) -> V3<L> {
    V3::new(mask.bitselect(new.x, old.x), mask.bitselect(new.y, old.y), mask.bitselect(new.z, old.z))
}
