//! Limits, motors and friction of joints side by side: `drive` in lanes. Axes and flags are the same in all of them.

use super::drive::kind;
use crate::solver::simd::Lanes;
use std::f32::consts::TAU;
use tumble_core::layout::{Joint, joint_bits};

/// Pieces; kinds are numbers of [`kind`] as floats.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PieceLanes<L> {
    pub(super) kind: L,
    pub(super) gamma: L,
    pub(super) goal: L,
}

/// See [`AxisState`](super::drive::AxisState).
pub(super) struct AxisLanes<L> {
    pub(super) coordinate: L,
    pub(super) velocity: L,
    pub(super) impulse: L,
    pub(super) response: L,
}

/// See [`JointDrive`](tumble_core::layout::JointDrive).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct DriveLanes<L> {
    pub(super) low: L,
    pub(super) high: L,
    target_pos: L,
    target_vel: L,
    stiffness: L,
    damping: L,
    max_force: L,
    friction: L,
}

/// What locked axes give way with.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Softness<L> {
    frequency: L,
    damping_ratio: L,
}

impl<L: Lanes> AxisLanes<L> {
    /// The impulse that takes the axis from the velocity that it has by itself to another one.
    #[inline(always)]
    fn needed(&self, velocity: L, free: L) -> L {
        (velocity - free) / self.response
    }
}

#[inline(always)]
fn hard<L: Lanes>(number: u32, goal: L) -> PieceLanes<L> {
    PieceLanes { kind: L::splat(number as f32), gamma: L::ZERO, goal }
}

impl<L: Lanes> DriveLanes<L> {
    pub(super) fn set(&mut self, lane: usize, joint: &Joint, axis: usize) {
        let from = &joint.drives[axis];
        let put = |to: &mut L, value: f32| to.as_mut_array()[lane] = value;
        put(&mut self.low, from.low);
        put(&mut self.high, from.high);
        put(&mut self.friction, from.friction);
        if joint.axes >> (joint_bits::MOTOR + axis as u32) & 1 != 0 {
            put(&mut self.target_pos, from.target_pos);
            put(&mut self.target_vel, from.target_vel);
            put(&mut self.stiffness, from.stiffness);
            put(&mut self.damping, from.damping);
            put(&mut self.max_force, from.max_force);
        }
    }
}

impl<L: Lanes> Softness<L> {
    pub(super) fn set(&mut self, lane: usize, joint: &Joint) {
        self.frequency.as_mut_array()[lane] = joint.frequency;
        self.damping_ratio.as_mut_array()[lane] = joint.damping_ratio;
    }
}

#[inline(always)]
pub(super) fn is<L: Lanes>(lanes: L, number: u32) -> L {
    lanes.simd_eq(L::splat(number as f32))
}

/// See [`piece`](super::drive::piece).
#[inline(always)]
pub(super) fn piece<L: Lanes>(
    [axes, flags]: [u32; 2],
    axis: usize,
    (drive, softness): (&DriveLanes<L>, &Softness<L>),
    at: &AxisLanes<L>,
    [h, share]: [f32; 2],
    was: L,
) -> PieceLanes<L> {
    let has = |bit: u32| axes >> (bit + axis as u32) & 1 != 0;
    let fixed = PieceLanes::default();
    let moves = at.response.simd_gt(L::ZERO);
    if has(joint_bits::LOCKED) {
        return choose(moves, locked(flags, softness, at, [h, share]), fixed);
    }
    let (step, given) = (L::splat(h), L::splat(h) * L::splat(share));
    let motor = Motor::of(flags, axis, has(joint_bits::MOTOR), drive, at, [step, given]);
    let rub = drive.friction * step * L::splat(share);
    let free = at.velocity - at.response * at.impulse;
    let more = at.needed(L::ZERO, free) - motor.impulse(L::ZERO);
    let rubbed = more.simd_gt(L::ZERO).bitselect(rub, -rub);
    let mut found = fixed;
    found.goal = rubbed;
    if motor.is {
        let velocity = (free + at.response * (motor.start + rubbed)) / (L::ONE + at.response * motor.slope);
        let impulse = motor.start - motor.slope * velocity;
        found.goal = impulse.fast_max(-motor.most).fast_min(motor.most) + rubbed;
        let gamma = L::ONE / motor.slope;
        let kind = L::splat(kind::SOFT as f32);
        let soft = PieceLanes { kind, gamma, goal: gamma * (motor.start + rubbed) };
        found = choose(motor.slope.simd_gt(L::ZERO) & !impulse.abs().simd_gt(motor.most), soft, found);
    }
    found = choose(rub.simd_gt(L::ZERO) & !more.abs().simd_gt(rub), hard(kind::STUCK, L::ZERO), found);
    if has(joint_bits::LIMITED) {
        let to_low = ((drive.low - at.coordinate) / step).fast_min(L::ZERO);
        let to_high = ((drive.high - at.coordinate) / step).fast_max(L::ZERO);
        let rubs = to_low.simd_gt(L::ZERO).bitselect(-rub, rub);
        let low = at.needed(to_low, free).simd_gt(motor.impulse(to_low) + rubs) & !is(was, kind::HIGH);
        let rubs = (-to_high).simd_gt(L::ZERO).bitselect(-rub, rub);
        let high = at.needed(to_high, free).simd_lt(motor.impulse(to_high) - rubs) & !is(was, kind::LOW);
        found = choose(high, hard(kind::HIGH, to_high), found);
        found = choose(low, hard(kind::LOW, to_low), found);
        let off = at.coordinate - drive.low;
        found = choose(drive.low.simd_eq(drive.high), hard(kind::LOCKED, -off / step), found);
    }
    choose(moves, found, fixed)
}

#[inline(always)]
fn choose<L: Lanes>(mask: L, if_one: PieceLanes<L>, if_zero: PieceLanes<L>) -> PieceLanes<L> {
    PieceLanes {
        kind: mask.bitselect(if_one.kind, if_zero.kind),
        gamma: mask.bitselect(if_one.gamma, if_zero.gamma),
        goal: mask.bitselect(if_one.goal, if_zero.goal),
    }
}

#[inline(always)]
fn locked<L: Lanes>(flags: u32, softness: &Softness<L>, at: &AxisLanes<L>, [h, share]: [f32; 2]) -> PieceLanes<L> {
    let h = L::splat(h);
    if flags & joint_bits::SOFT == 0 {
        return PieceLanes { kind: L::splat(kind::LOCKED as f32), gamma: L::ZERO, goal: -at.coordinate / h };
    }
    let mass = L::ONE / at.response;
    let stiffness = softness.frequency * softness.frequency * mass;
    let damping = L::splat(2.0) * softness.damping_ratio * softness.frequency * mass;
    let gamma = L::ONE / (h * (damping + h * stiffness));
    let goal = -gamma * h * stiffness * at.coordinate;
    PieceLanes { kind: L::splat(kind::SOFT as f32), gamma: gamma / L::splat(share), goal }
}

struct Motor<L> {
    is: bool,
    start: L,
    slope: L,
    most: L,
}

impl<L: Lanes> Motor<L> {
    #[inline(always)]
    fn of(flags: u32, axis: usize, is: bool, drive: &DriveLanes<L>, at: &AxisLanes<L>, [h, given]: [L; 2]) -> Self {
        if !is {
            return Self { is, start: L::ZERO, slope: L::ZERO, most: L::ZERO };
        }
        let forced = flags >> (joint_bits::FORCE_BASED + axis as u32) & 1 != 0;
        let mass = if forced { L::ONE } else { L::ONE / at.response };
        let (stiffness, damping) = (mass * drive.stiffness, mass * drive.damping);
        let mut off = at.coordinate - drive.target_pos;
        if axis >= 3 {
            off = off - L::splat(TAU) * rounded(off / L::splat(TAU));
        }
        let start = given * (damping * drive.target_vel - stiffness * off);
        Self { is, start, slope: given * (damping + h * stiffness), most: drive.max_force * given }
    }

    #[inline(always)]
    fn impulse(&self, velocity: L) -> L {
        if !self.is {
            return L::ZERO;
        }
        (self.start - self.slope * velocity).fast_max(-self.most).fast_min(self.most)
    }
}

/// The nearest whole number, the even one of two: what adding so much that no fraction is left rounds to.
#[inline(always)]
fn rounded<L: Lanes>(x: L) -> L {
    let much = L::splat(12_582_912.0);
    x.abs().simd_lt(L::splat(4_194_304.0)).bitselect((x + much) - much, x)
}
