//! Joints of large islands, by Gauss-Seidel over batches that share no body that moves. Twin of
//! `shaders/joint/batches.wgsl`.
//!
//! As soft sub-stepping does with contacts: impulses of the last sub-step are applied with the arms as they are now, rows
//! are solved as damped springs whose frequency goes with that of the sub-steps, so that the error falls with time, and
//! once more as rigid when bodies have moved. The inertia includes the geometric stiffness of all joints of a body.

use super::drive::kind;
use super::frame::{frame, used};
use super::inertia::{inverse_inertia, own_arm, stiffening};
use super::island::{REGULARIZATION, Scene, Store};
use super::rows::{Body, Work};
use crate::math::vec3;
use glam::{Mat3, Vec3};
use tumble_core::layout::{JointBody, JointState, SolverBody, StepParams, joint_bits};

/// Share of the separation of locked rows that is taken out in a sub-step: a spring of 0.25 / h Hz with twice critical
/// damping, solved implicitly.
pub const SHARE: f32 = 0.282;
/// What such a spring takes of the mass.
pub const MASS_SHARE: f32 = 0.897_4;
/// Share of the impulse that it lets go.
pub const LEAK: f32 = 0.102_6;

/// Share of the impulse that a rigid row lets go where its bodies have other joints between them. Two that lock the same pass
/// on what each has too much to the other, and it grows: plates on two bolts each, three in a row, gained 0.7 m of height.
/// With a tenth some still did, with three tenths they sag twice as far.
pub const TWICE_LEAK: f32 = 0.15;

/// Up to three rows as a sweep needs them.
#[derive(Debug, Clone, Copy, Default)]
struct Rows {
    /// Their axes in the world.
    axes: Mat3,
    /// Inverse of what impulses do to the velocities of active rows; ones for the others.
    mass: Mat3,
    /// See [`Piece`](super::drive::Piece).
    kinds: [u32; 3],
    /// The same.
    goal: Vec3,
    /// The same.
    gamma: Vec3,
    /// Impulses of this sub-step.
    impulse: Vec3,
}

/// A joint in a step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Loose {
    /// Slots of its bodies.
    pub bodies: [u32; 2],
    arms: [Vec3; 2],
    rows: [Rows; 2],
    /// Bit 0: it has rows along; bit 1: about.
    used: u32,
    /// What its rigid rows let go when they relax.
    leak: f32,
}

impl Rows {
    /// What a row lacks of its goal. When rows relax, those that are hard come to rest, but for a way that is free until a
    /// limit; springs stay as they are.
    fn lack(&self, row: usize, velocity: f32, relax: bool) -> f32 {
        let goal = self.goal[row];
        match (self.kinds[row], relax) {
            (kind::FIXED, _) => goal - self.impulse[row],
            (kind::SOFT, true) => 0.0,
            (kind::LOCKED | kind::STUCK, true) => -velocity,
            (kind::LOW, true) => goal.min(0.0) - velocity,
            (kind::HIGH, true) => goal.max(0.0) - velocity,
            (kind::LOCKED, false) => SHARE * goal - velocity,
            (_, false) => goal - velocity - self.gamma[row] * self.impulse[row],
            _ => 0.0,
        }
    }
}

impl Loose {
    /// A joint at the beginning of a step, and what lasts of it.
    pub fn begin(
        scene: &Scene<'_>,
        slot: u32,
        state: JointState,
        bodies: &impl Store,
        step: &StepParams,
    ) -> (Self, JointState) {
        let joint = &scene.set.joints[slot as usize];
        let slots = [joint.body_a, joint.body_b];
        let own = Self { bodies: slots, ..Self::default() };
        let [a, b] = slots.map(|slot| Body::of(&bodies.get(slot as usize), &scene.states[slot as usize]));
        if !(a.moves() || b.moves()) {
            return (own, state);
        }
        let mut work = Work::new(slot, joint, state, between(scene, slots), step.h);
        work.refresh(joint, &a, &b);
        work.carry_impulses(1.0);
        (Self::of(&mut work, scene, &a, &b, step), work.state)
    }

    /// The rows of `work`, whose axes and impulses are those of now.
    fn of(work: &mut Work, scene: &Scene<'_>, a: &Body, b: &Body, step: &StepParams) -> Self {
        let joint = &scene.set.joints[work.slot as usize];
        if work.choose(joint, a, b, step.h, 1.0) {
            work.rebuild(a, b);
        }
        let mut loose = Self {
            bodies: [joint.body_a, joint.body_b],
            arms: [work.frame.arm_a, work.frame.arm_b],
            leak: if joint.flags & joint_bits::TWICE != 0 { TWICE_LEAK } else { 0.0 },
            ..Self::default()
        };
        for which in 0..2 {
            let block = &work.blocks[which];
            if used(work.axes, which) == 0 || block.own == Vec3::ZERO {
                continue;
            }
            loose.used |= 1 << which;
            let [x, y, z] = &block.pieces;
            loose.rows[which] = Rows {
                axes: if which == 0 { work.frame.along } else { work.frame.about },
                mass: block.diagonal(a, b, REGULARIZATION).inverse(),
                kinds: [x.kind, y.kind, z.kind],
                goal: Vec3::new(x.goal, y.goal, z.goal),
                gamma: Vec3::new(x.gamma, y.gamma, z.gamma),
                impulse: block.impulse,
            };
        }
        loose
    }

    /// Applies the impulses of the last sub-step.
    pub fn warm_start(&mut self, a: &mut Body, b: &mut Body) {
        for which in 0..2 {
            if self.used >> which & 1 != 0 {
                self.push(which, self.rows[which].impulse, a, b);
            }
        }
    }

    /// Solves the rows: locked ones as springs, or all as rigid.
    fn visit(&mut self, a: &mut Body, b: &mut Body, relax: bool) {
        for which in 0..2 {
            if self.used >> which & 1 == 0 {
                continue;
            }
            let rows = &self.rows[which];
            let velocity = match which {
                0 => b.linear + b.angular.cross(self.arms[1]) - a.linear - a.angular.cross(self.arms[0]),
                _ => b.angular - a.angular,
            };
            let own = rows.axes.transpose() * velocity;
            let lack = |row: usize| rows.lack(row, own[row], relax);
            let lack = Vec3::new(lack(0), lack(1), lack(2));
            let mut impulse = rows.mass * lack;
            let [share, leak] = if relax { [1.0, self.leak] } else { [MASS_SHARE, LEAK] };
            for row in (0..3).filter(|&row| rows.kinds[row] == kind::LOCKED) {
                impulse[row] = share * impulse[row] - leak * rows.impulse[row];
            }
            self.rows[which].impulse += impulse;
            self.push(which, impulse, a, b);
        }
    }

    /// Solves the rows as springs.
    pub fn solve(&mut self, a: &mut Body, b: &mut Body) {
        self.visit(a, b, false);
    }

    /// Solves the rows as rigid, with the arms as they are now.
    pub fn relax(
        &mut self,
        scene: &Scene<'_>,
        state: &mut JointState,
        slot: u32,
        a: &mut Body,
        b: &mut Body,
        step: &StepParams,
    ) {
        let joint = &scene.set.joints[slot as usize];
        let mut work = Work::new(slot, joint, *state, between(scene, self.bodies), step.h);
        for which in 0..2 {
            work.blocks[which].impulse = self.rows[which].impulse;
        }
        work.frame = frame(joint, &a.pose, &b.pose, work.between);
        work.rebuild(a, b);
        *self = Self::of(&mut work, scene, a, b, step);
        self.visit(a, b, true);
        state.impulse = (work.frame.along * self.rows[0].impulse).to_array();
        state.torque = (work.frame.about * self.rows[1].impulse).to_array();
        [state.separation, state.angle] = work.off_by(joint);
    }

    fn push(&mut self, which: usize, impulse: Vec3, a: &mut Body, b: &mut Body) {
        let push = self.rows[which].axes * impulse;
        if which == 1 {
            a.angular -= a.inverse_inertia * push;
            b.angular += b.inverse_inertia * push;
            return;
        }
        a.linear -= a.inverse_mass * push;
        a.angular -= a.inverse_inertia * self.arms[0].cross(push);
        b.linear += b.inverse_mass * push;
        b.angular += b.inverse_inertia * self.arms[1].cross(push);
    }
}

/// From the first centre of mass to the second one when the step began, m.
fn between(scene: &Scene<'_>, bodies: [u32; 2]) -> Vec3 {
    let [a, b] = bodies.map(|slot| vec3(scene.states[slot as usize].position));
    b - a
}

/// The body's inertia with the geometric stiffness of its joints; `impulse` is that of the joint at a place.
pub fn stiffen(
    scene: &Scene<'_>,
    info: &JointBody,
    impulse: impl Fn(u32) -> Vec3,
    body: &mut SolverBody,
    step: &StepParams,
) {
    let slot = info.body as usize;
    let (seen, mut more) = (Body::of(body, &scene.states[slot]), Mat3::ZERO);
    if !seen.moves() {
        return;
    }
    let topology = &scene.set.topology;
    for &end in &topology.ends[info.first_end as usize..][..info.end_count as usize] {
        let joint = &scene.set.joints[topology.joints[end as usize / 2] as usize];
        let arm = own_arm(joint, end & 1 == 1, seen.pose.rotation);
        let impulse = impulse(end / 2);
        more += stiffening(arm, if end & 1 == 1 { impulse } else { -impulse }, step.h);
    }
    let stiffened = inverse_inertia(seen.pose.rotation, &scene.props[slot], more);
    Body { inverse_inertia: stiffened, ..seen }.put_inertia(body);
}
