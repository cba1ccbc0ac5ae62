//! The rows of joints: what impulses they exchange with their bodies. Twin of `shaders/joint/rows.wgsl`.
//!
//! Each joint has up to two blocks of three rows, along its axes and about them. A row that does nothing at the moment
//! is zero. For locked rows the separation is predicted: it must be gone after the sub-step, and what is linear in the
//! velocities is off by the remainder d, which is taken in where it is small or smooth.

use super::begun;
use super::drive::{AxisState, Piece, kind, piece};
use super::frame::{Frame, Pose, frame, used};
use super::held::{answer, ghost, pushed};
use super::inertia::inverse_inertia_of;
use crate::math::{free, is_locked, quat, vec3};
use bytemuck::Zeroable;
use glam::{Mat3, Quat, Vec3};
use tumble_core::layout::{BodyState, Joint, JointState, SolverBody, joint_bits, touched};

/// A body as joints see it.
#[derive(Debug, Clone, Copy)]
pub struct Body {
    /// m/s.
    pub linear: Vec3,
    /// rad/s.
    pub angular: Vec3,
    /// 1/kg along the world's axes; zero along those that are locked.
    pub inverse_mass: Vec3,
    /// 1/(kg m²), in the world, geometric stiffness included; zero about locked axes.
    pub inverse_inertia: Mat3,
    /// 1/kg of what has no locked axis; zero where nothing pushes it.
    pub whole: f32,
    /// Whether it moves, and is held along or about an axis of the world.
    pub is_held: bool,
    /// Where it is.
    pub pose: Pose,
}

/// Largest turn of a body by a projection, rad.
pub const MAX_PROJECTION: f32 = 0.5;

impl Pose {
    /// Moved by a way and a turn, m and rad.
    pub fn moved(&self, way: Vec3, turn: Vec3) -> Self {
        let angle = turn.length();
        let half = turn * (if angle > MAX_PROJECTION { 0.5 * MAX_PROJECTION / angle } else { 0.5 });
        let turn = Quat::from_xyzw(half.x, half.y, half.z, 1.0).normalize();
        Self { translation: self.translation + way, rotation: (turn * self.rotation).normalize() }
    }
}

impl Body {
    /// As the solver has it.
    pub fn of(body: &SolverBody, state: &BodyState) -> Self {
        let rotation = (quat(body.delta) * quat(state.rotation)).normalize();
        Self { pose: Pose { translation: vec3(body.translation), rotation }, ..Self::still(body) }
    }

    /// The same without its pose.
    pub fn still(body: &SolverBody) -> Self {
        Self {
            linear: vec3(body.linear_velocity),
            angular: vec3(body.angular_velocity),
            inverse_mass: body.inverse_mass * free(body.touched, touched::FIRST_LOCK),
            inverse_inertia: inverse_inertia_of(body),
            whole: body.inverse_mass,
            is_held: body.inverse_mass > 0.0 && (is_locked(body) || body.inverse_inertia_diagonal.contains(&0.0)),
            pose: Pose { translation: Vec3::ZERO, rotation: Quat::IDENTITY },
        }
    }

    /// The solver's body with these velocities; what joints add to them is no load of contacts.
    pub fn put_velocities(&self, body: &mut SolverBody) {
        let (linear, angular) = (vec3(body.linear_velocity), vec3(body.angular_velocity));
        body.linear_start = (vec3(body.linear_start) + (self.linear - linear)).to_array();
        body.angular_start = (vec3(body.angular_start) + (self.angular - angular)).to_array();
        body.linear_velocity = self.linear.to_array();
        body.angular_velocity = self.angular.to_array();
    }

    /// Whether anything pushes it.
    pub fn moves(&self) -> bool {
        self.whole > 0.0
    }

    /// What it answers a row with: a push along `along`, a turn about `turn` and the response to that.
    fn answer(&self, along: Vec3, turn: Vec3, response: Vec3) -> f32 {
        let own = along.dot(self.inverse_mass * along) + turn.dot(response);
        let i = &self.inverse_inertia;
        let most = if along == Vec3::ZERO { i.x_axis.x + i.y_axis.y + i.z_axis.z } else { self.whole };
        if self.is_held { answer(own, most) } else { own }
    }

    /// Where it is after h, as far as its velocities tell.
    pub fn predicted(&self, h: f32) -> Pose {
        let half = 0.5 * h * self.angular;
        let turn = Quat::from_xyzw(half.x, half.y, half.z, 1.0).normalize();
        // A turn by the tangent of half the angle is too short by a twelfth of the cube; this is the next order.
        let square = half.dot(half);
        let half = half * (1.0 + square / 3.0);
        let turn = if square < 1.0 { Quat::from_xyzw(half.x, half.y, half.z, 1.0).normalize() } else { turn };
        Pose { translation: self.pose.translation + h * self.linear, rotation: (turn * self.pose.rotation).normalize() }
    }
}

/// Up to three rows. Not `Default`: the matrices of glam are one by that.
#[derive(Debug, Clone, Copy, Zeroable)]
pub struct Block {
    /// Directions of the impulses along; zero for rows about, and for those not active.
    pub along: Mat3,
    /// What they turn the first body by: arms times axes, or axes about.
    pub turn_a: Mat3,
    /// The same of the second body.
    pub turn_b: Mat3,
    /// Change of the first body's angular velocity by a unit impulse.
    pub response_a: Mat3,
    /// The same of the second body.
    pub response_b: Mat3,
    /// Impulses of this sub-step, N s or N m s.
    pub impulse: Vec3,
    /// What they give now.
    pub push: Vec3,
    /// Change of the rows' own velocities by a unit impulse, where all rows would be active.
    pub own: Vec3,
    /// Pieces of the three rows.
    pub pieces: [Piece; 3],
}

/// A joint in a step.
#[derive(Debug, Clone, Copy)]
pub struct Work {
    /// Its slot.
    pub slot: u32,
    /// Its axes, see [`joint_bits`]; none once it is broken.
    pub axes: u32,
    /// What lasts of it.
    pub state: JointState,
    /// From the first centre of mass to the second one when the step began, m.
    pub between: Vec3,
    /// Its axes and coordinates now.
    pub frame: Frame,
    /// Rows along and about.
    pub blocks: [Block; 2],
}

impl Block {
    /// Velocities of the rows.
    pub fn velocity(&self, a: &Body, b: &Body) -> Vec3 {
        self.along.transpose() * (b.linear - a.linear)
            + (self.turn_b.transpose() * b.angular - self.turn_a.transpose() * a.angular)
    }

    /// The block on the diagonal of the system; rows that are not active have a one.
    pub fn diagonal(&self, a: &Body, b: &Body, regularization: f32) -> Mat3 {
        let is_held = a.is_held || b.is_held;
        let mut k = pushed(&self.along, &self.along, a.inverse_mass + b.inverse_mass, a.whole + b.whole, is_held)
            + self.turn_a.transpose() * self.response_a
            + self.turn_b.transpose() * self.response_b;
        if is_held {
            k += ghost(self.along, self.turn_b, a, b);
        }
        let more = regularization / 3.0 * (k.x_axis.x + k.y_axis.y + k.z_axis.z);
        for row in 0..3 {
            let piece = &self.pieces[row];
            k.col_mut(row)[row] += if piece.kind == kind::FIXED { 1.0 } else { piece.gamma + more };
        }
        k
    }
}

impl Work {
    /// A joint at the beginning of a step with sub-steps of length `h`; it is yet to be refreshed.
    pub fn new(slot: u32, joint: &Joint, state: JointState, between: Vec3, h: f32) -> Self {
        let state = begun(joint, state, h);
        let axes = if state.broken != 0 { 0 } else { joint.axes };
        Self { slot, axes, state, between, frame: Frame::NONE, blocks: [Block::zeroed(); 2] }
    }

    /// A share of the impulses of the last sub-step, in the axes as they are now.
    pub fn carry_impulses(&mut self, share: f32) {
        self.blocks[0].impulse = self.frame.along.transpose() * (share * vec3(self.state.impulse));
        self.blocks[1].impulse = self.frame.about.transpose() * (share * vec3(self.state.torque));
    }

    /// Begins without impulses.
    pub fn forget_impulses(&mut self) {
        self.blocks.iter_mut().for_each(|block| block.impulse = Vec3::ZERO);
    }

    /// Takes the coordinates from the poses; axes and rows stay those of the factor.
    pub fn look(&mut self, joint: &Joint, a: &Body, b: &Body) {
        let now = frame(joint, &a.pose, &b.pose, self.between);
        (self.frame.shift, self.frame.turn) = (now.shift, now.turn);
    }

    /// Takes axes, coordinates and rows from the poses; pieces stay as they were.
    pub fn refresh(&mut self, joint: &Joint, a: &Body, b: &Body) {
        self.frame = frame(joint, &a.pose, &b.pose, self.between);
        self.rebuild(a, b);
    }

    /// The rows that are active, from the axes.
    pub fn rebuild(&mut self, a: &Body, b: &Body) {
        let Frame { arm_a, arm_b, along, about, .. } = self.frame;
        for (which, block) in self.blocks.iter_mut().enumerate().filter(|(which, _)| used(self.axes, *which) != 0) {
            let rows = used(self.axes, which);
            for row in 0..3 {
                let axis = if rows >> row & 1 == 0 {
                    Vec3::ZERO
                } else if which == 0 {
                    along.col(row)
                } else {
                    about.col(row)
                };
                let (turn_a, turn_b) = if which == 0 { (arm_a.cross(axis), arm_b.cross(axis)) } else { (axis, axis) };
                let (response_a, response_b) = (a.inverse_inertia * turn_a, b.inverse_inertia * turn_b);
                let push = if which == 0 { axis } else { Vec3::ZERO };
                block.own[row] = if a.is_held || b.is_held {
                    a.answer(push, turn_a, response_a) + b.answer(push, turn_b, response_b)
                } else {
                    push.dot(push) * (a.whole + b.whole) + turn_a.dot(response_a) + turn_b.dot(response_b)
                };
                let active = block.pieces[row].kind != kind::FIXED;
                let set = |m: &mut Mat3, v: Vec3| *m.col_mut(row) = if active { v } else { Vec3::ZERO };
                set(&mut block.along, push);
                set(&mut block.turn_a, turn_a);
                set(&mut block.turn_b, turn_b);
                set(&mut block.response_a, response_a);
                set(&mut block.response_b, response_b);
            }
        }
    }

    /// Chooses the pieces of all rows for the velocities and impulses as they are, see [`piece`]. Whether the system is
    /// another one by it.
    pub fn choose(&mut self, joint: &Joint, a: &Body, b: &Body, h: f32, share: f32) -> bool {
        if joint.flags & joint_bits::SOFT == 0 && self.axes >> joint_bits::DRIVEN & 63 == 0 {
            return self.choose_locked(h);
        }
        let mut changed = false;
        for axis in 0..6 {
            if (self.axes | self.axes >> joint_bits::DRIVEN) >> axis & 1 == 0 {
                continue;
            }
            let (which, row) = (axis / 3, axis % 3);
            let was = self.blocks[which].pieces[row].kind;
            let mut new = piece(joint, axis, &self.at(which, row, a, b), h, share, was);
            let piece = &mut self.blocks[which].pieces[row];
            if piece.kind == new.kind && (piece.gamma - new.gamma).abs() <= SAME_SPRING * piece.gamma {
                // Its goal goes with either.
                new.gamma = piece.gamma;
            }
            changed |= piece.kind != new.kind || piece.gamma != new.gamma;
            *piece = new;
        }
        changed
    }

    /// Gives a body what the rows give now.
    pub fn push(&self, second: bool, body: &mut Body) {
        for (_, block) in self.blocks.iter().enumerate().filter(|(which, _)| used(self.axes, *which) != 0) {
            let along = block.along * block.push;
            if second {
                body.linear += body.inverse_mass * along;
                body.angular += block.response_b * block.push;
            } else {
                body.linear -= body.inverse_mass * along;
                body.angular -= block.response_a * block.push;
            }
        }
    }

    /// What rows of a fixed impulse are still to give; others give nothing.
    pub fn fix(&mut self) {
        for (_, block) in self.blocks.iter_mut().enumerate().filter(|(which, _)| used(self.axes, *which) != 0) {
            for row in 0..3 {
                let fixed = block.pieces[row].kind == kind::FIXED;
                block.push[row] = if fixed { block.pieces[row].goal - block.impulse[row] } else { 0.0 };
                block.impulse[row] += block.push[row];
            }
        }
    }

    /// Gives a body what rows of a fixed impulse give now: they are in no block of the system.
    pub fn push_fixed(&self, second: bool, body: &mut Body) {
        if self.blocks[0].push == Vec3::ZERO && self.blocks[1].push == Vec3::ZERO {
            return;
        }
        let push = self.frame.along * self.blocks[0].push;
        let arm = if second { self.frame.arm_b } else { self.frame.arm_a };
        let turn = body.inverse_inertia * (arm.cross(push) + self.frame.about * self.blocks[1].push);
        if second {
            body.linear += body.inverse_mass * push;
            body.angular += turn;
        } else {
            body.linear -= body.inverse_mass * push;
            body.angular -= turn;
        }
    }

    /// The same where all axes are locked hard, or free.
    fn choose_locked(&mut self, h: f32) -> bool {
        let mut changed = false;
        for which in (0..2).filter(|&which| used(self.axes, which) != 0) {
            let coordinates = if which == 0 { self.frame.shift } else { self.frame.turn };
            let (rows, block) = (used(self.axes, which), &mut self.blocks[which]);
            for row in (0..3).filter(|row| rows >> row & 1 != 0) {
                let new = if block.own[row] > 0.0 {
                    Piece { kind: kind::LOCKED, gamma: 0.0, goal: -coordinates[row] / h, off: coordinates[row] }
                } else {
                    Piece::zeroed()
                };
                changed |= block.pieces[row].kind != new.kind;
                block.pieces[row] = new;
            }
        }
        changed
    }

    /// Where an axis is.
    fn at(&self, which: usize, row: usize, a: &Body, b: &Body) -> AxisState {
        let Frame { arm_a, arm_b, along, about, shift, turn } = &self.frame;
        let block = &self.blocks[which];
        let velocity = if which == 0 {
            let velocity = b.linear + b.angular.cross(*arm_b) - a.linear - a.angular.cross(*arm_a);
            along.col(row).dot(velocity)
        } else {
            about.col(row).dot(b.angular - a.angular)
        };
        let coordinate = if which == 0 { shift[row] } else { turn[row] };
        AxisState { coordinate, velocity, impulse: block.impulse[row], response: block.own[row] }
    }

    /// What the rows of a block still lack of their goals with the velocities as they are. `relax`: hard rows are to stand
    /// still.
    pub fn lack(&self, which: usize, a: &Body, b: &Body, relax: bool) -> Vec3 {
        let block = &self.blocks[which];
        let velocity = block.velocity(a, b);
        let mut lack = Vec3::ZERO;
        for row in 0..3 {
            let piece = &block.pieces[row];
            let goal = if relax && piece.kind != kind::SOFT { 0.0 } else { piece.goal };
            if piece.kind != kind::FIXED {
                lack[row] = goal - velocity[row] - piece.gamma * block.impulse[row];
            }
        }
        lack
    }

    /// By how much the separation of the locked rows will be off what is linear, as far as it is to be believed: spins
    /// make it wrong, unless it is as it was in the last sub-step. `next` is where the bodies will be.
    pub fn remainders(&mut self, joint: &Joint, [a, b]: [&Body; 2], next: [&Pose; 2], h: f32) -> [Vec3; 2] {
        let next = frame(joint, next[0], next[1], self.between);
        let now = self.frame;
        let spin = h * a.angular.length().max(b.angular.length()) / THETA;
        let still = 1.0 / (1.0 + spin * spin * spin * spin);
        let mut remainders = [Vec3::ZERO; 2];
        for which in (0..2).filter(|&which| used(self.axes, which) != 0) {
            let way = if which == 0 { next.shift - now.shift } else { next.turn - now.turn };
            let block = &self.blocks[which];
            let mut off = way / h - block.velocity(a, b);
            for row in 0..3 {
                off[row] = match block.pieces[row].kind {
                    kind::LOCKED => off[row],
                    // It may have come into the system just now, and have no rows yet. Angles may leap by a turn.
                    kind::LOW | kind::HIGH if which == 0 => way[row] / h - self.at(which, row, a, b).velocity,
                    _ => 0.0,
                };
            }
            let kept = if which == 0 { &mut self.state.remainder } else { &mut self.state.angular_remainder };
            let before = vec3(*kept);
            *kept = off.to_array();
            let change = (off - before).length() / ((off.length() + before.length()) * KAPPA + 1e-9);
            let smooth = 1.0 / (1.0 + change * change * change * change);
            let belief = LEAST + (1.0 - LEAST) * still.max(smooth);
            remainders[which] = off * belief;
        }
        remainders
    }

    /// What a projection of the poses is to take out, m and rad.
    pub fn off(&self, joint: &Joint, which: usize) -> Vec3 {
        let mut off = Vec3::ZERO;
        for row in 0..3 {
            let axis = 3 * which + row;
            let coordinate = if which == 0 { self.frame.shift[row] } else { self.frame.turn[row] };
            let drive = &joint.drives[axis];
            off[row] = match self.blocks[which].pieces[row].kind {
                // Of an axis that is locked by equal limits, those; else zero.
                kind::LOCKED => coordinate - drive.low,
                kind::LOW => (coordinate - drive.low).min(0.0),
                kind::HIGH => (coordinate - drive.high).max(0.0),
                _ => 0.0,
            };
            let limited = self.blocks[which].pieces[row].kind != kind::LOCKED;
            if which == 1 && limited && off[row].abs() > JUMP {
                off[row] = 0.0;
            }
        }
        off
    }

    /// What lasts of the joint after a step: it breaks where its last sub-step asked for too much.
    pub fn lasting(&self, joint: &Joint) -> JointState {
        let [separation, angle] = self.off_by(joint);
        JointState {
            broken: self.state.broken | u32::from(breaks(joint, &self.state)),
            separation,
            angle,
            ..self.state
        }
    }

    /// How far locked axes are off, m and rad.
    pub fn off_by(&self, joint: &Joint) -> [f32; 2] {
        let (mut separation, mut angle) = (Vec3::ZERO, Vec3::ZERO);
        for row in 0..3 {
            if self.blocks[0].pieces[row].kind == kind::LOCKED {
                separation[row] = self.frame.shift[row] - joint.drives[row].low;
            }
            if self.blocks[1].pieces[row].kind == kind::LOCKED {
                angle[row] = self.frame.turn[row] - joint.drives[3 + row].low;
            }
        }
        [separation.length(), angle.length()]
    }

    /// What it gives its bodies before they move, in the world.
    pub fn keep_impulses(&mut self) {
        let [along, about] = &self.blocks;
        self.state.impulse = (self.frame.along * along.impulse).to_array();
        self.state.torque = (self.frame.about * about.impulse).to_array();
    }

    /// And what it gives them after that.
    pub fn add_impulses(&mut self) {
        let [along, about] = &self.blocks;
        self.state.impulse = (vec3(self.state.impulse) + self.frame.along * along.impulse).to_array();
        self.state.torque = (vec3(self.state.torque) + self.frame.about * about.impulse).to_array();
    }
}

/// Whether the last sub-step asked for more than the joint bears.
pub fn breaks(joint: &Joint, state: &JointState) -> bool {
    let (impulse, torque) = (vec3(state.impulse).length(), vec3(state.torque).length());
    impulse > joint.break_force * state.h || torque > joint.break_torque * state.h
}

/// Turn of a body in a sub-step up to which a prediction of the separation is believed, rad.
pub const THETA: f32 = 0.03;
/// Relative change of a remainder up to which it is believed.
pub const KAPPA: f32 = 0.2;
/// What is believed of it at least.
pub const LEAST: f32 = 0.3;
/// What an angle is beyond a limit by is undone at once up to here, rad. Beyond, it has not gone there: rotation vectors
/// leap where a joint turns by more than half a turn, and a leap of the body after them would make energy.
pub const JUMP: f32 = 0.2;
/// Springs that differ by no more than this share are one.
pub const SAME_SPRING: f32 = 0.1;
