//! Limits, motors and friction of one axis of a joint, and the springs of soft joints. Twin of `shaders/joint/drive.wgsl`.
//!
//! Impulse over velocity is a monotone graph: a motor is a slope between its largest forces, friction a step at zero, a
//! limit a step without end at the velocity that just reaches it. Where the line of what the axis does by itself
//! (velocity = free + k impulse) meets the graph, is the piece of it that holds: one that fixes the velocity (`Hard`),
//! one that fixes a mixture of both (`Soft`), or one that fixes the impulse. Choosing pieces, solving, and choosing again
//! is a semi-smooth Newton method (Hintermüller, Ito and Kunisch, "The primal-dual active set strategy as a semismooth
//! Newton method", 2002).

use bytemuck::Zeroable;
use std::f32::consts::TAU;
use tumble_core::layout::{Joint, JointDrive, joint_bits};

/// A piece of the graph: velocity + `gamma` impulse = `goal` where the row is `active`, else impulse = `goal`.
#[derive(Debug, Clone, Copy, PartialEq, Zeroable)]
pub struct Piece {
    /// Which piece; the same number means the same rows of the system.
    pub kind: u32,
    /// (m/s) / (N s), or (rad/s) / (N m s).
    pub gamma: f32,
    /// m/s or rad/s where active, else N s or N m s.
    pub goal: f32,
    /// How far the coordinate is from where a hard row wants it, m or rad.
    pub off: f32,
}

/// Values of [`Piece::kind`].
pub mod kind {
    /// No impulse but that of `goal`.
    pub const FIXED: u32 = 0;
    /// The axis is locked.
    pub const LOCKED: u32 = 1;
    /// At the lowest coordinate.
    pub const LOW: u32 = 2;
    /// At the highest coordinate.
    pub const HIGH: u32 = 3;
    /// Held by friction.
    pub const STUCK: u32 = 4;
    /// A damped spring.
    pub const SOFT: u32 = 5;
}

/// Where an axis is, and what moves it.
#[derive(Debug, Clone, Copy)]
pub struct AxisState {
    /// m or rad.
    pub coordinate: f32,
    /// m/s or rad/s.
    pub velocity: f32,
    /// What its rows have given in this sub-step, N s or N m s.
    pub impulse: f32,
    /// Change of velocity by a unit impulse.
    pub response: f32,
}

/// The piece that holds for axis `axis` of the joint, over a sub-step of length `h`, where `was` held before. The impulses of
/// motors, friction and springs are `share` of those of the sub-step. No choice leaps from one limit to the other: impulses are those of all rows together, and in a corner of several limits they may be
/// so large that an axis seems to fly past all of its range. What is beyond a limit stands still there until the poses
/// are projected.
pub fn piece(joint: &Joint, axis: usize, at: &AxisState, h: f32, share: f32, was: u32) -> Piece {
    let has = |bit: u32| joint.axes >> (bit + axis as u32) & 1 != 0;
    if at.response <= 0.0 {
        // Neither body can be moved this way.
        return Piece { kind: kind::FIXED, gamma: 0.0, goal: 0.0, off: 0.0 };
    }
    if has(joint_bits::LOCKED) {
        return locked(joint, at, h, share);
    }
    let drive = &joint.drives[axis];
    if has(joint_bits::LIMITED) && drive.low == drive.high {
        let off = at.coordinate - drive.low;
        return Piece { kind: kind::LOCKED, gamma: 0.0, goal: -off / h, off };
    }
    let motor = Motor::of(joint, axis, has(joint_bits::MOTOR), at, h, share);
    let rub = drive.friction * h * share;
    let free = at.velocity - at.response * at.impulse;
    let needed = |velocity: f32| (velocity - free) / at.response;
    let rubs = |velocity: f32| if velocity > 0.0 { -rub } else { rub };
    if has(joint_bits::LIMITED) {
        let JointDrive { low, high, .. } = *drive;
        let (to_low, to_high) = (((low - at.coordinate) / h).min(0.0), ((high - at.coordinate) / h).max(0.0));
        let hard = |kind, goal, limit: f32| Piece { kind, gamma: 0.0, goal, off: at.coordinate - limit };
        if was != kind::HIGH && needed(to_low) > motor.impulse(to_low) + rubs(to_low) {
            return hard(kind::LOW, to_low, low);
        }
        if was != kind::LOW && needed(to_high) < motor.impulse(to_high) - rubs(-to_high) {
            return hard(kind::HIGH, to_high, high);
        }
    }
    let more = needed(0.0) - motor.impulse(0.0);
    if rub > 0.0 && more.abs() <= rub {
        return Piece { kind: kind::STUCK, gamma: 0.0, goal: 0.0, off: 0.0 };
    }
    let rubbed = if more > 0.0 { rub } else { -rub };
    let velocity = (free + at.response * (motor.start + rubbed)) / (1.0 + at.response * motor.slope);
    let impulse = motor.start - motor.slope * velocity;
    if motor.slope > 0.0 && impulse.abs() <= motor.most {
        let gamma = 1.0 / motor.slope;
        return Piece { kind: kind::SOFT, gamma, goal: gamma * (motor.start + rubbed), off: 0.0 };
    }
    Piece { kind: kind::FIXED, gamma: 0.0, goal: impulse.clamp(-motor.most, motor.most) + rubbed, off: 0.0 }
}

/// A locked axis, hard or soft.
fn locked(joint: &Joint, at: &AxisState, h: f32, share: f32) -> Piece {
    if joint.flags & joint_bits::SOFT == 0 {
        return Piece { kind: kind::LOCKED, gamma: 0.0, goal: -at.coordinate / h, off: at.coordinate };
    }
    let mass = 1.0 / at.response;
    let stiffness = joint.frequency * joint.frequency * mass;
    let damping = 2.0 * joint.damping_ratio * joint.frequency * mass;
    let gamma = 1.0 / (h * (damping + h * stiffness));
    Piece { kind: kind::SOFT, gamma: gamma / share, goal: -gamma * h * stiffness * at.coordinate, off: 0.0 }
}

/// Impulse = start - slope velocity, between -most and most.
struct Motor {
    start: f32,
    slope: f32,
    most: f32,
}

impl Motor {
    /// The implicit spring and damper; nothing where there is none.
    fn of(joint: &Joint, axis: usize, is: bool, at: &AxisState, h: f32, share: f32) -> Self {
        if !is {
            return Self { start: 0.0, slope: 0.0, most: 0.0 };
        }
        let drive = &joint.drives[axis];
        let forced = joint.flags >> (joint_bits::FORCE_BASED + axis as u32) & 1 != 0;
        let mass = if forced { 1.0 } else { 1.0 / at.response };
        let (stiffness, damping) = (mass * drive.stiffness, mass * drive.damping);
        let mut off = at.coordinate - drive.target_pos;
        if axis >= 3 {
            // The shorter way round.
            off -= TAU * (off / TAU).round_ties_even();
        }
        let given = h * share;
        let start = given * (damping * drive.target_vel - stiffness * off);
        Self { start, slope: given * (damping + h * stiffness), most: drive.max_force * given }
    }

    fn impulse(&self, velocity: f32) -> f32 {
        (self.start - self.slope * velocity).clamp(-self.most, self.most)
    }
}
