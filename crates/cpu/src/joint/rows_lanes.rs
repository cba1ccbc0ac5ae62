//! The rows of joints side by side: `rows` in lanes.

use super::drive::kind;
use super::drive_lanes::{AxisLanes, DriveLanes, PieceLanes, Softness, is, piece};
use super::frame::used;
use super::frame_lanes::{Anchors, FrameLanes, PoseLanes, frame};
use super::lanes::{M3, Q, at, is_some, length, masked, put};
use super::rows::{JUMP, KAPPA, LEAST, MAX_PROJECTION, SAME_SPRING, THETA};
use crate::solver::simd::{Lanes, V3};
use tumble_core::layout::{Joint, JointState, joint_bits};

/// See [`Body`](super::rows::Body).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BodyLanes<L> {
    pub(super) linear: V3<L>,
    pub(super) angular: V3<L>,
    pub(super) inverse_mass: L,
    pub(super) inverse_inertia: M3<L>,
    pub(super) pose: PoseLanes<L>,
}

/// See [`Block`](super::rows::Block).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BlockLanes<L> {
    /// Axes of the active rows.
    axes: M3<L>,
    /// What those along turn each body by; those about turn by their axes.
    turns: [M3<L>; 2],
    responses: [M3<L>; 2],
    pub(super) impulse: V3<L>,
    pub(super) push: V3<L>,
    own: V3<L>,
    pieces: [PieceLanes<L>; 3],
    /// By how much the last prediction of the separation was off.
    remainder: V3<L>,
}

/// See [`Work`](super::rows::Work).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct WorkLanes<L> {
    /// Axes and flags.
    kind: [u32; 2],
    /// Those not broken.
    whole: L,
    anchors: Anchors<L>,
    drives: [DriveLanes<L>; 6],
    softness: Softness<L>,
    frame: FrameLanes<L>,
    pub(super) blocks: [BlockLanes<L>; 2],
    pub(super) impulse: V3<L>,
    torque: V3<L>,
}

impl<L: Lanes> PoseLanes<L> {
    #[inline(always)]
    pub(super) fn moved(&self, way: V3<L>, turn: V3<L>) -> Self {
        let angle = length(turn);
        let most = L::splat(0.5 * MAX_PROJECTION);
        let share = angle.simd_gt(L::splat(MAX_PROJECTION)).bitselect(most / angle, L::splat(0.5));
        let turn = Q { imaginary: share * turn, w: L::ONE }.normalized();
        Self { translation: self.translation + way, rotation: turn.times(self.rotation).normalized() }
    }
}

impl<L: Lanes> BodyLanes<L> {
    #[inline(always)]
    pub(super) fn predicted(&self, h: f32) -> PoseLanes<L> {
        let h = L::splat(h);
        let half = (L::splat(0.5) * h) * self.angular;
        let square = half.dot(half);
        let near = square.simd_lt(L::ONE);
        let half = near.bitselect(L::ONE + square / L::splat(3.0), L::ONE) * half;
        let turn = Q { imaginary: half, w: L::ONE }.normalized();
        PoseLanes {
            translation: self.pose.translation + h * self.linear,
            rotation: turn.times(self.pose.rotation).normalized(),
        }
    }
}

impl<L: Lanes> BlockLanes<L> {
    #[inline(always)]
    fn turn(&self, which: usize, second: usize) -> M3<L> {
        if which == 0 { self.turns[second] } else { self.axes }
    }

    #[inline(always)]
    fn velocity(&self, which: usize, a: &BodyLanes<L>, b: &BodyLanes<L>) -> V3<L> {
        let turned = self.turn(which, 1).back(b.angular) - self.turn(which, 0).back(a.angular);
        if which == 0 { self.axes.back(b.linear - a.linear) + turned } else { turned }
    }

    #[inline(always)]
    pub(super) fn diagonal(&self, which: usize, a: &BodyLanes<L>, b: &BodyLanes<L>, regularization: f32) -> M3<L> {
        let turned_a = self.turn(which, 0).back_matrix(self.responses[0]);
        let turned_b = self.turn(which, 1).back_matrix(self.responses[1]);
        let mut k = if which == 0 {
            let along = self.axes.back_matrix(self.axes).scaled(a.inverse_mass + b.inverse_mass);
            along.plus(turned_a).plus(turned_b)
        } else {
            turned_a.plus(turned_b)
        };
        let more = L::splat(regularization / 3.0) * (k.0[0].x + k.0[1].y + k.0[2].z);
        for row in 0..3 {
            let piece = &self.pieces[row];
            let own = is(piece.kind, kind::FIXED).bitselect(L::ONE, piece.gamma + more);
            let was = at(&k.0[row], row);
            put(&mut k.0[row], row, was + own);
        }
        k
    }

    /// What impulses of the column's rows do to the velocities of this block's, by a body that both joints hold; `second`
    /// for whether it is the second one of each.
    #[inline(always)]
    pub(super) fn coupling(
        &self,
        column: &Self,
        [which, other]: [usize; 2],
        second: [bool; 2],
        inverse_mass: L,
    ) -> M3<L> {
        let turned = self.turn(which, usize::from(second[0])).back_matrix(column.responses[usize::from(second[1])]);
        let all = if which == 0 && other == 0 {
            self.axes.back_matrix(column.axes).scaled(inverse_mass).plus(turned)
        } else {
            turned
        };
        all.scaled(L::splat(if second[0] == second[1] { 1.0 } else { -1.0 }))
    }
}

impl<L: Lanes> WorkLanes<L> {
    pub(super) fn new(kind: [u32; 2]) -> Self {
        Self { kind, ..Self::default() }
    }

    /// Puts a joint into a lane; `state` is that which it begins the step with.
    pub(super) fn set(&mut self, lane: usize, joint: &Joint, state: &JointState, between: [f32; 3]) {
        self.whole.as_mut_array()[lane] = f32::from_bits(if state.broken == 0 { u32::MAX } else { 0 });
        self.anchors.rotations[0].set(lane, joint.rotation_a);
        self.anchors.rotations[1].set(lane, joint.rotation_b);
        self.anchors.anchors[0].set(lane, joint.anchor_a);
        self.anchors.anchors[1].set(lane, joint.anchor_b);
        self.anchors.between.set(lane, between);
        self.impulse.set(lane, state.impulse);
        self.torque.set(lane, state.torque);
        self.blocks[0].remainder.set(lane, state.remainder);
        self.blocks[1].remainder.set(lane, state.angular_remainder);
        for axis in (0..6).filter(|axis| used(joint.axes, axis / 3) >> (axis % 3) & 1 != 0) {
            self.drives[axis].set(lane, joint, axis);
        }
        if joint.flags & joint_bits::SOFT != 0 {
            self.softness.set(lane, joint);
        }
    }

    /// What lasts of the joint in a lane; `state` has what does not change. Broken or not is left as it is.
    pub(super) fn lasting(&self, lane: usize, [separation, angle]: [L; 2], state: JointState) -> JointState {
        let number = |l: L| l.as_array()[lane];
        let vector = |v: V3<L>| [number(v.x), number(v.y), number(v.z)];
        JointState {
            impulse: vector(self.impulse),
            torque: vector(self.torque),
            remainder: vector(self.blocks[0].remainder),
            angular_remainder: vector(self.blocks[1].remainder),
            separation: number(separation),
            angle: number(angle),
            ..state
        }
    }

    /// The anchor at the first or second body, from its centre of mass.
    #[inline(always)]
    pub(super) fn anchor(&self, end: usize) -> V3<L> {
        self.anchors.anchors[end]
    }

    #[inline(always)]
    fn uses(&self, which: usize) -> bool {
        used(self.kind[0], which) != 0
    }

    #[inline(always)]
    pub(super) fn carry_impulses(&mut self, share: f32) {
        self.blocks[0].impulse = self.frame.axes[0].back(L::splat(share) * self.impulse);
        self.blocks[1].impulse = self.frame.axes[1].back(L::splat(share) * self.torque);
    }

    #[inline(always)]
    pub(super) fn forget_impulses(&mut self) {
        for block in &mut self.blocks {
            block.impulse = V3::default();
        }
    }

    #[inline(always)]
    pub(super) fn look(&mut self, a: &BodyLanes<L>, b: &BodyLanes<L>) {
        self.frame.coordinates = frame(self.kind, &self.anchors, &a.pose, &b.pose).coordinates;
    }

    #[inline(always)]
    pub(super) fn refresh(&mut self, a: &BodyLanes<L>, b: &BodyLanes<L>) {
        self.frame = frame(self.kind, &self.anchors, &a.pose, &b.pose);
        self.rebuild(a, b);
    }

    #[inline(always)]
    pub(super) fn rebuild(&mut self, a: &BodyLanes<L>, b: &BodyLanes<L>) {
        let masses = a.inverse_mass + b.inverse_mass;
        for which in 0..2 {
            let rows = used(self.kind[0], which);
            let block = &mut self.blocks[which];
            for row in 0..3 {
                if rows >> row & 1 == 0 {
                    continue;
                }
                let axis = self.frame.axes[which].0[row];
                let [arm_a, arm_b] = self.frame.arms;
                let turns = if which == 0 { [arm_a.cross(axis), arm_b.cross(axis)] } else { [axis, axis] };
                let responses = [a.inverse_inertia.times(turns[0]), b.inverse_inertia.times(turns[1])];
                let turned = [turns[0].dot(responses[0]), turns[1].dot(responses[1])];
                let own =
                    if which == 0 { axis.dot(axis) * masses + turned[0] + turned[1] } else { turned[0] + turned[1] };
                put(&mut block.own, row, own);
                let active = !is(block.pieces[row].kind, kind::FIXED);
                block.axes.0[row] = masked(active, axis);
                for end in 0..2 {
                    if which == 0 {
                        block.turns[end].0[row] = masked(active, turns[end]);
                    }
                    block.responses[end].0[row] = masked(active, responses[end]);
                }
            }
        }
    }

    /// Chooses the pieces; the lanes whose system is another one by it.
    #[inline(always)]
    pub(super) fn choose(&mut self, a: &BodyLanes<L>, b: &BodyLanes<L>, h: f32, share: f32) -> L {
        let axes = self.kind[0];
        let mut changed = L::ZERO;
        for axis in 0..6 {
            if (axes | axes >> joint_bits::DRIVEN) >> axis & 1 == 0 {
                continue;
            }
            let (which, row) = (axis / 3, axis % 3);
            let was = self.blocks[which].pieces[row];
            let moved = self.moved(which, row, a, b);
            let mut new = piece(self.kind, axis, (&self.drives[axis], &self.softness), &moved, [h, share], was.kind);
            let differs = (was.gamma - new.gamma).abs().simd_gt(L::splat(SAME_SPRING) * was.gamma);
            new.gamma = (was.kind.simd_eq(new.kind) & !differs).bitselect(was.gamma, new.gamma);
            changed = changed | !was.kind.simd_eq(new.kind) | !was.gamma.simd_eq(new.gamma);
            let kept = &mut self.blocks[which].pieces[row];
            kept.kind = self.whole & new.kind;
            kept.gamma = self.whole & new.gamma;
            kept.goal = self.whole & new.goal;
        }
        changed & self.whole
    }

    /// Adds what the rows give now to the velocities of a body.
    #[inline(always)]
    pub(super) fn push(&self, second: bool, inverse_mass: L, linear: &mut V3<L>, angular: &mut V3<L>) {
        for which in 0..2 {
            if !self.uses(which) {
                continue;
            }
            let block = &self.blocks[which];
            let turn = block.responses[usize::from(second)].times(block.push);
            *angular = if second { *angular + turn } else { *angular - turn };
            if which == 0 {
                let way = inverse_mass * block.axes.times(block.push);
                *linear = if second { *linear + way } else { *linear - way };
            }
        }
    }

    /// What rows of a fixed impulse are still to give in the lanes that go on.
    #[inline(always)]
    pub(super) fn fix(&mut self, goes_on: L) {
        for which in 0..2 {
            if !self.uses(which) {
                continue;
            }
            let block = &mut self.blocks[which];
            for row in 0..3 {
                let piece = block.pieces[row];
                let impulse = at(&block.impulse, row);
                let push = is(piece.kind, kind::FIXED) & goes_on & (piece.goal - impulse);
                put(&mut block.push, row, push);
                put(&mut block.impulse, row, impulse + push);
            }
        }
    }

    /// Whether any row of a fixed impulse gives something.
    #[inline(always)]
    pub(super) fn fixes(&self) -> bool {
        let [along, about] = [self.blocks[0].push, self.blocks[1].push];
        (is_some(along) | is_some(about)).any()
    }

    #[inline(always)]
    pub(super) fn push_fixed(&self, second: bool, body: &mut BodyLanes<L>) {
        let push = self.frame.axes[0].times(self.blocks[0].push);
        let arm = self.frame.arms[usize::from(second)];
        let torque = arm.cross(push) + self.frame.axes[1].times(self.blocks[1].push);
        let (way, turn) = (body.inverse_mass * push, body.inverse_inertia.times(torque));
        (body.linear, body.angular) =
            if second { (body.linear + way, body.angular + turn) } else { (body.linear - way, body.angular - turn) };
    }

    #[inline(always)]
    fn moved(&self, which: usize, row: usize, a: &BodyLanes<L>, b: &BodyLanes<L>) -> AxisLanes<L> {
        let block = &self.blocks[which];
        let axis = self.frame.axes[which].0[row];
        let velocity = if which == 0 {
            let [arm_a, arm_b] = self.frame.arms;
            axis.dot(b.linear + b.angular.cross(arm_b) - a.linear - a.angular.cross(arm_a))
        } else {
            axis.dot(b.angular - a.angular)
        };
        AxisLanes {
            coordinate: at(&self.frame.coordinates[which], row),
            velocity,
            impulse: at(&block.impulse, row),
            response: at(&block.own, row),
        }
    }

    #[inline(always)]
    pub(super) fn lack(&self, which: usize, a: &BodyLanes<L>, b: &BodyLanes<L>, relax: bool) -> V3<L> {
        let block = &self.blocks[which];
        let velocity = block.velocity(which, a, b);
        let mut lack = V3::default();
        for row in 0..3 {
            let piece = &block.pieces[row];
            let goal = if relax { is(piece.kind, kind::SOFT) & piece.goal } else { piece.goal };
            let less = goal - at(&velocity, row) - piece.gamma * at(&block.impulse, row);
            put(&mut lack, row, !is(piece.kind, kind::FIXED) & less);
        }
        lack
    }

    #[inline(always)]
    pub(super) fn remainders(&mut self, [a, b]: [&BodyLanes<L>; 2], next: [&PoseLanes<L>; 2], h: f32) -> [V3<L>; 2] {
        let n = L::splat;
        let next = frame(self.kind, &self.anchors, next[0], next[1]).coordinates;
        let now = self.frame.coordinates;
        let spin = n(h) * length(a.angular).fast_max(length(b.angular)) / n(THETA);
        let still = L::ONE / (L::ONE + spin * spin * spin * spin);
        let mut remainders = [V3::default(); 2];
        for which in 0..2 {
            if !self.uses(which) {
                continue;
            }
            let way = (next[which] - now[which]) / n(h);
            let straight = self.blocks[which].velocity(which, a, b);
            let mut off = V3::default();
            for row in 0..3 {
                let kind = self.blocks[which].pieces[row].kind;
                let mut one = is(kind, kind::LOCKED) & (at(&way, row) - at(&straight, row));
                let limited = is(kind, kind::LOW) | is(kind, kind::HIGH);
                if which == 0 && limited.any() {
                    one = limited.bitselect(at(&way, row) - self.moved(which, row, a, b).velocity, one);
                }
                put(&mut off, row, one);
            }
            let block = &mut self.blocks[which];
            let before = block.remainder;
            block.remainder = super::lanes::select(self.whole, off, before);
            let change = length(off - before) / ((length(off) + length(before)) * n(KAPPA) + n(1e-9));
            let smooth = L::ONE / (L::ONE + change * change * change * change);
            let belief = n(LEAST) + n(1.0 - LEAST) * still.fast_max(smooth);
            remainders[which] = belief * off;
        }
        remainders
    }

    #[inline(always)]
    pub(super) fn off(&self, which: usize) -> V3<L> {
        let mut off = V3::default();
        for row in 0..3 {
            let drive = &self.drives[3 * which + row];
            let kind = self.blocks[which].pieces[row].kind;
            let (from_low, from_high) = (self.beyond(which, row, drive.low), self.beyond(which, row, drive.high));
            let mut limited =
                is(kind, kind::LOW) & from_low.fast_min(L::ZERO) | is(kind, kind::HIGH) & from_high.fast_max(L::ZERO);
            if which == 1 {
                limited = !limited.abs().simd_gt(L::splat(JUMP)) & limited;
            }
            put(&mut off, row, is(kind, kind::LOCKED) & from_low | limited);
        }
        off
    }

    #[inline(always)]
    fn beyond(&self, which: usize, row: usize, limit: L) -> L {
        at(&self.frame.coordinates[which], row) - limit
    }

    #[inline(always)]
    pub(super) fn off_by(&self) -> [L; 2] {
        let mut lengths = [L::ZERO; 2];
        for (which, length_of) in lengths.iter_mut().enumerate() {
            let mut off = V3::default();
            for row in 0..3 {
                let locked = is(self.blocks[which].pieces[row].kind, kind::LOCKED);
                put(&mut off, row, locked & self.beyond(which, row, self.drives[3 * which + row].low));
            }
            *length_of = length(off);
        }
        lengths
    }

    #[inline(always)]
    pub(super) fn keep_impulses(&mut self) {
        self.impulse = self.frame.axes[0].times(self.blocks[0].impulse);
        self.torque = self.frame.axes[1].times(self.blocks[1].impulse);
    }

    #[inline(always)]
    pub(super) fn add_impulses(&mut self) {
        self.impulse = self.impulse + self.frame.axes[0].times(self.blocks[0].impulse);
        self.torque = self.torque + self.frame.axes[1].times(self.blocks[1].impulse);
    }
}
