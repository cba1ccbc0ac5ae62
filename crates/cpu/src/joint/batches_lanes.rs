//! The joints of `batches` that hold their anchors together, or those and all angles, several at a time: the visits of
//! [`Loose`](super::batches::Loose) with what these need alone. Results differ by rounding: arms turn with the change of
//! their body's rotation, and masses are inverted as the symmetric matrices that they are.

use super::batches::{LEAK, MASS_SHARE, SHARE};
use super::island::REGULARIZATION;
use super::joined_lanes::{Held, Symmetric, product, rotate};
use super::turn_lanes::rotation_vector;
use crate::bounds::moves;
use crate::math::vec3;
use crate::shared::Shared;
use crate::solver::lanes::NO_BODY;
use crate::solver::simd::{Lanes, V3};
use tumble_core::layout::{BodyState, Joint, JointState, SolverBody, StepParams, joint_bits};
use wide::f32x4;

/// No joint in a lane.
pub(super) const NO_JOINT: u32 = u32::MAX;

/// Whether a joint can be solved in lanes: its anchors are locked, its angles all or none, nothing drives it, and
/// nothing of it is soft.
pub(super) fn fits_lanes(joint: &Joint) -> bool {
    let odd = joint_bits::SOFT | joint_bits::COUPLED | joint_bits::HELD | joint_bits::TWICE;
    let axes = joint.axes >> joint_bits::LOCKED & 63;
    joint.flags & odd == 0 && joint.axes >> joint_bits::DRIVEN & 63 == 0 && (axes == 7 || axes == 63)
}

/// Whether it locks angles too.
pub(super) fn locks_angles(joint: &Joint) -> bool {
    joint.axes >> (joint_bits::LOCKED + 3) & 7 != 0
}

/// What joints are made of, which changes with the set of joints alone.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MadeLanes<L: Lanes> {
    /// [`NO_JOINT`] where there is none.
    pub(super) slots: L::Indices,
    /// That of [`JointState::tag`].
    pub(super) tags: L::Indices,
    bodies: [L::Indices; 2],
    anchors: [V3<L>; 2],
    /// Joint frames to those of the bodies.
    frames: [[L; 4]; 2],
    break_force: L,
    break_torque: L,
}

/// Three rows of each joint.
#[derive(Debug, Clone, Copy, Default)]
struct RowLanes<L> {
    /// Inverse of what impulses do to the velocities; zero in rows that nothing can move.
    mass: Symmetric<L>,
    /// m/s or rad/s.
    goal: V3<L>,
    /// Impulses of this sub-step.
    impulse: V3<L>,
}

/// Joints of one batch in a step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct JointLanes<L: Lanes> {
    /// [`NO_BODY`] where a joint takes no part in the step.
    bodies: [L::Indices; 2],
    arms: [V3<L>; 2],
    /// Along the axes of the world.
    along: RowLanes<L>,
    /// From one centre of mass to the other when the step began.
    between: V3<L>,
    /// From the centres of mass to the anchors when the step began.
    starts: [V3<L>; 2],
}

/// The rows about of joints that have some.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TurnLanes<L> {
    axes: [V3<L>; 3],
    about: RowLanes<L>,
    /// Joint frames in the world when the step began.
    starts: [[L; 4]; 2],
}

impl<L: Lanes> MadeLanes<L> {
    /// No joint in any lane.
    pub(super) fn empty() -> Self {
        let mut empty = Self::default();
        empty.slots.as_mut().fill(NO_JOINT);
        empty
    }

    /// Puts a joint into a lane.
    pub(super) fn set(&mut self, lane: usize, slot: u32, joint: &Joint) {
        self.slots.as_mut()[lane] = slot;
        self.tags.as_mut()[lane] = joint.generation.wrapping_add(1);
        let ends = [(joint.body_a, joint.anchor_a, joint.rotation_a), (joint.body_b, joint.anchor_b, joint.rotation_b)];
        for (k, (body, anchor, rotation)) in ends.into_iter().enumerate() {
            self.bodies[k].as_mut()[lane] = body;
            self.anchors[k].set(lane, anchor);
            set_quat(&mut self.frames[k], lane, rotation);
        }
        self.break_force.as_mut_array()[lane] = joint.break_force;
        self.break_torque.as_mut_array()[lane] = joint.break_torque;
    }

    /// The body of a joint that decides which level of sub-steps it is solved at.
    pub(super) fn leader(&self, lane: usize, states: &[BodyState]) -> Option<u32> {
        let bodies = self.bodies.each_ref().map(|bodies| bodies.as_ref()[lane]);
        bodies.into_iter().find(|&slot| moves(states[slot as usize].flags))
    }
}

fn set_quat<L: Lanes>(to: &mut [L; 4], lane: usize, from: [f32; 4]) {
    to.iter_mut().zip(from).for_each(|(to, from)| to.as_mut_array()[lane] = from);
}

impl<L: Lanes> JointLanes<L> {
    /// Joints in a step, those of other levels, broken ones and those that nothing moves left out.
    pub(super) fn begin(
        made: &MadeLanes<L>,
        turns: Option<&mut TurnLanes<L>>,
        joints: &[JointState],
        states: &[BodyState],
        level_of: impl Fn(u32) -> u32,
        step: &StepParams,
    ) -> Self {
        let mut own = Self::default();
        own.bodies.iter_mut().for_each(|bodies| bodies.as_mut().fill(NO_BODY));
        let (mut rotations, mut torque) = ([[L::ZERO; 4]; 2], V3::default());
        for lane in 0..L::COUNT {
            let slot = made.slots.as_ref()[lane];
            if slot == NO_JOINT || made.leader(lane, states).map(&level_of) != Some(step.level) {
                continue;
            }
            let joint = &joints[slot as usize];
            let is_known = joint.tag == made.tags.as_ref()[lane];
            if is_known && joint.broken != 0 {
                continue;
            }
            let ends = made.bodies.each_ref().map(|bodies| bodies.as_ref()[lane]);
            let [a, b] = ends.map(|slot| &states[slot as usize]);
            for (k, (slot, state)) in ends.into_iter().zip([a, b]).enumerate() {
                own.bodies[k].as_mut()[lane] = slot;
                set_quat(&mut rotations[k], lane, state.rotation);
            }
            own.between.set(lane, (vec3(b.position) - vec3(a.position)).to_array());
            if is_known {
                let scale = if joint.h == step.h || joint.h == 0.0 { 1.0 } else { step.h / joint.h };
                own.along.impulse.set(lane, joint.impulse.map(|x| scale * x));
                torque.set(lane, joint.torque.map(|x| scale * x));
            }
        }
        let own = &mut own;
        L::run(
            #[inline(always)]
            || own.start(made, rotations, torque, turns),
        );
        *own
    }

    #[inline(always)]
    fn start(&mut self, made: &MadeLanes<L>, rotations: [[L; 4]; 2], torque: V3<L>, turns: Option<&mut TurnLanes<L>>) {
        let ([a, b], [to_a, to_b]) = (rotations, made.anchors);
        self.starts = [rotate(a, to_a), rotate(b, to_b)];
        if let Some(turns) = turns {
            let [qa, qb] = [product(a, made.frames[0]), product(b, made.frames[1])];
            turns.starts = [qa, qb];
            turns.axes = rotation_vector(qa, qb).0;
            turns.about.impulse = transposed_times(turns.axes, torque);
        }
    }

    /// Arms, axes, goals and masses with the poses as they are now. Impulses as [`JointLanes::relax`].
    ///
    /// # Safety
    /// No other thread writes these joints' bodies meanwhile.
    #[inline(always)]
    pub(super) unsafe fn refresh(
        &mut self,
        turns: Option<&mut TurnLanes<L>>,
        bodies: &Shared<'_, f32x4>,
        step: &StepParams,
    ) -> L::Rows {
        // SAFETY: the caller's promise.
        let [a, b] = unsafe { Held::gather_both(bodies, self.bodies, true) };
        self.rebuild(turns, &a, &b, step);
        self.impulses()
    }

    #[inline(always)]
    fn rebuild(&mut self, turns: Option<&mut TurnLanes<L>>, a: &Held<L>, b: &Held<L>, step: &StepParams) {
        let over = L::splat(-1.0 / step.h);
        let (to_a, arm_b) = (a.body.turned(self.starts[0]), b.body.turned(self.starts[1]));
        let offset = self.between + (b.body.translation - a.body.translation) + (arm_b - to_a);
        self.arms = [to_a + offset, arm_b];
        let masses = Symmetric { diagonal: a.inverse_masses + b.inverse_masses, off: V3::default() };
        let response = masses.plus(arm_response(a.inertia(), self.arms[0])).plus(arm_response(b.inertia(), arm_b));
        self.along.set(response, over * offset);
        if let Some(turns) = turns {
            let [start_a, start_b] = turns.starts;
            let (axes, turn) = rotation_vector(product(a.body.delta, start_a), product(b.body.delta, start_b));
            turns.axes = axes;
            turns.about.set(seen_along(axes, a.inertia().plus(b.inertia())), over * turn);
        }
    }

    /// Applies the impulses of the last sub-step.
    ///
    /// # Safety
    /// No other thread touches these joints' bodies that move meanwhile, nor writes the others.
    #[inline(always)]
    pub(super) unsafe fn warm_start(&mut self, turns: Option<&mut TurnLanes<L>>, bodies: &Shared<'_, f32x4>) {
        // SAFETY: the caller's promise.
        let [mut a, mut b] = unsafe { Held::gather_both(bodies, self.bodies, false) };
        self.push_along(self.along.impulse, &mut a, &mut b);
        if let Some(turns) = turns {
            turns.push(turns.about.impulse, &mut a, &mut b);
        }
        // SAFETY: the caller's promise.
        unsafe { Held::put_both(bodies, a, b) };
    }

    /// Solves the rows as springs.
    ///
    /// # Safety
    /// As for [`JointLanes::warm_start`].
    #[inline(always)]
    pub(super) unsafe fn solve(&mut self, turns: Option<&mut TurnLanes<L>>, bodies: &Shared<'_, f32x4>) {
        // SAFETY: the caller's promise.
        let [mut a, mut b] = unsafe { Held::gather_both(bodies, self.bodies, false) };
        let impulse = self.along.spring(self.velocity(&a, &b));
        self.push_along(impulse, &mut a, &mut b);
        if let Some(turns) = turns {
            let impulse = turns.about.spring(turns.velocity(&a, &b));
            turns.push(impulse, &mut a, &mut b);
        }
        // SAFETY: the caller's promise.
        unsafe { Held::put_both(bodies, a, b) };
    }

    /// Solves the rows as rigid, with the arms as they are now. The impulses that they end with, in the world, as four
    /// numbers of each.
    ///
    /// # Safety
    /// As for [`JointLanes::warm_start`].
    #[inline(always)]
    pub(super) unsafe fn relax(
        &mut self,
        mut turns: Option<&mut TurnLanes<L>>,
        bodies: &Shared<'_, f32x4>,
        step: &StepParams,
    ) -> L::Rows {
        // SAFETY: the caller's promise.
        let [mut a, mut b] = unsafe { Held::gather_both(bodies, self.bodies, true) };
        self.rebuild(turns.as_deref_mut(), &a, &b, step);
        let impulse = self.along.rigid(self.velocity(&a, &b));
        self.push_along(impulse, &mut a, &mut b);
        if let Some(turns) = turns {
            let impulse = turns.about.rigid(turns.velocity(&a, &b));
            turns.push(impulse, &mut a, &mut b);
        }
        // SAFETY: the caller's promise.
        unsafe { Held::put_both(bodies, a, b) };
        self.impulses()
    }

    /// The impulses along of the last sub-step, in the world, as four numbers of each.
    #[inline(always)]
    fn impulses(&self) -> L::Rows {
        let V3 { x, y, z } = self.along.impulse;
        L::rows([x, y, z, L::ZERO])
    }

    #[inline(always)]
    fn velocity(&self, a: &Held<L>, b: &Held<L>) -> V3<L> {
        b.body.velocity_at(self.arms[1]) - a.body.velocity_at(self.arms[0])
    }

    #[inline(always)]
    fn push_along(&self, impulse: V3<L>, a: &mut Held<L>, b: &mut Held<L>) {
        a.push(-1.0, impulse, self.arms[0].cross(impulse));
        b.push(1.0, impulse, self.arms[1].cross(impulse));
    }

    /// What lasts of the joint of a lane after a step; nothing new of one that nothing moved.
    pub(super) fn lasting(
        &self,
        made: &MadeLanes<L>,
        turns: Option<&TurnLanes<L>>,
        lane: usize,
        before: &JointState,
        h: f32,
    ) -> JointState {
        let at = |v: &V3<L>| [v.x, v.y, v.z].map(|x| x.as_array()[lane]);
        let size = |v: [f32; 3]| vec3(v).length();
        let tag = made.tags.as_ref()[lane];
        let before = if before.tag == tag { *before } else { bytemuck::Zeroable::zeroed() };
        // A broken joint is in no lane: zeros.
        let impulse = at(&self.along.impulse);
        let world = |t: &TurnLanes<L>| {
            let [x, y, z] = t.axes.each_ref().map(|axis| vec3(at(axis)));
            let about = at(&t.about.impulse);
            (x * about[0] + y * about[1] + z * about[2]).to_array()
        };
        let torque = turns.map_or([0.0; 3], world);
        let breaks = size(impulse) > made.break_force.as_array()[lane] * h
            || size(torque) > made.break_torque.as_array()[lane] * h;
        JointState {
            impulse,
            torque,
            tag,
            broken: before.broken | u32::from(breaks),
            h,
            separation: h * size(at(&self.along.goal)),
            angle: turns.map_or(0.0, |t| h * size(at(&t.about.goal))),
            ..before
        }
    }
}

impl<L: Lanes> TurnLanes<L> {
    #[inline(always)]
    fn velocity(&self, a: &Held<L>, b: &Held<L>) -> V3<L> {
        transposed_times(self.axes, b.body.angular - a.body.angular)
    }

    #[inline(always)]
    fn push(&self, impulse: V3<L>, a: &mut Held<L>, b: &mut Held<L>) {
        let [x, y, z] = self.axes;
        let turn = impulse.x * x + impulse.y * y + impulse.z * z;
        a.push(-1.0, V3::default(), turn);
        b.push(1.0, V3::default(), turn);
    }
}

impl<L: Lanes> RowLanes<L> {
    /// Mass and goal, from what unit impulses do. Rows that nothing can move are left out.
    #[inline(always)]
    fn set(&mut self, mut response: Symmetric<L>, goal: V3<L>) {
        let V3 { x, y, z } = response.diagonal;
        let active = V3::new(x.simd_gt(L::ZERO), y.simd_gt(L::ZERO), z.simd_gt(L::ZERO));
        let more = L::splat(REGULARIZATION / 3.0) * (x + y + z);
        response.diagonal = response.diagonal + V3::new(more, more, more);
        self.goal = goal;
        if !(!(active.x & active.y & active.z)).any() {
            self.mass = response.inverse();
            return;
        }
        let ones = V3::new(L::ONE, L::ONE, L::ONE);
        let kept = |v: V3<L>| V3::new(active.x & v.x, active.y & v.y, active.z & v.z);
        response.diagonal = V3::new(
            active.x.bitselect(response.diagonal.x, ones.x),
            active.y.bitselect(response.diagonal.y, ones.y),
            active.z.bitselect(response.diagonal.z, ones.z),
        );
        let pairs = V3::new(active.x & active.y, active.x & active.z, active.y & active.z);
        let off = |v: V3<L>| V3::new(pairs.x & v.x, pairs.y & v.y, pairs.z & v.z);
        response.off = off(response.off);
        let mass = response.inverse();
        self.mass = Symmetric { diagonal: kept(mass.diagonal), off: off(mass.off) };
        self.goal = kept(goal);
        self.impulse = kept(self.impulse);
    }

    /// What rows that are springs give at this velocity.
    #[inline(always)]
    fn spring(&mut self, velocity: V3<L>) -> V3<L> {
        let impulse = self.mass.times(L::splat(SHARE) * self.goal - velocity);
        let impulse = L::splat(MASS_SHARE) * impulse - L::splat(LEAK) * self.impulse;
        self.impulse = self.impulse + impulse;
        impulse
    }

    /// What rigid rows give.
    #[inline(always)]
    fn rigid(&mut self, velocity: V3<L>) -> V3<L> {
        let impulse = self.mass.times(V3::default() - velocity);
        self.impulse = self.impulse + impulse;
        impulse
    }
}

/// What an impulse at an arm does to the velocity there by turning the body.
#[inline(always)]
fn arm_response<L: Lanes>(inertia: Symmetric<L>, V3 { x, y, z }: V3<L>) -> Symmetric<L> {
    let (d, o) = (inertia.diagonal, inertia.off);
    // The inertia times the arm times each axis.
    let of_x = [d.y * z - o.z * y, o.z * z - d.z * y];
    let of_y = V3::new(o.y * x - d.x * z, o.z * x - o.x * z, d.z * x - o.y * z);
    let of_z = V3::new(d.x * y - o.x * x, o.x * y - d.y * x, o.y * y - o.z * x);
    Symmetric {
        diagonal: V3::new(z * of_x[0] - y * of_x[1], x * of_y.z - z * of_y.x, y * of_z.x - x * of_z.y),
        off: V3::new(z * of_y.y - y * of_y.z, z * of_z.y - y * of_z.z, x * of_z.z - z * of_z.x),
    }
}

/// A matrix as these axes see it.
#[inline(always)]
fn seen_along<L: Lanes>([x, y, z]: [V3<L>; 3], of: Symmetric<L>) -> Symmetric<L> {
    let (to_x, to_y, to_z) = (of.times(x), of.times(y), of.times(z));
    Symmetric {
        diagonal: V3::new(x.dot(to_x), y.dot(to_y), z.dot(to_z)),
        off: V3::new(x.dot(to_y), x.dot(to_z), y.dot(to_z)),
    }
}

#[inline(always)]
fn transposed_times<L: Lanes>([x, y, z]: [V3<L>; 3], v: V3<L>) -> V3<L> {
    V3::new(x.dot(v), y.dot(v), z.dot(v))
}

/// The level of a body.
pub(super) fn level_of(bodies: &Shared<'_, SolverBody>, slot: u32) -> u32 {
    // SAFETY: no level is written in a step.
    unsafe { bodies.get(slot as usize) }.level
}
