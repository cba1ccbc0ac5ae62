use bytemuck::{Pod, Zeroable};

/// Bits of [`Joint::axes`] and [`Joint::flags`].
pub mod joint_bits {
    /// Axis k is locked: bit k of `axes`.
    pub const LOCKED: u32 = 0;
    /// Axis k has limits, a motor or friction: bit k + 8.
    pub const DRIVEN: u32 = 8;
    /// Axis k has limits: bit k + 16.
    pub const LIMITED: u32 = 16;
    /// Axis k has a motor: bit k + 24.
    pub const MOTOR: u32 = 24;
    /// Flag: a joint lives in the slot.
    pub const ALIVE: u32 = 1;
    /// Flag: the first axis along is the distance of the anchors.
    pub const COUPLED: u32 = 2;
    /// Flag: it lies on a cycle of joints.
    pub const IN_CYCLE: u32 = 4;
    /// Flag: locked axes are soft.
    pub const SOFT: u32 = 8;
    /// Flag: the joined bodies do not collide.
    pub const APART: u32 = 16;
    /// Flag: the world holds one of its bodies along or about some axes.
    pub const HELD: u32 = 32;
    /// Flag: its bodies have other joints between them, what does not move being one body.
    pub const TWICE: u32 = 64;
    /// Flag: it lies on a cycle and may lock what others of it, or the world, lock already: it is more than a ball joint.
    pub const OVERLOCKED: u32 = 128;
    /// Flag: the motor of axis k is force based: bit k + 8.
    pub const FORCE_BASED: u32 = 8;
}

/// One axis of a joint. 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct JointDrive {
    /// Lowest coordinate, m or rad.
    pub low: f32,
    /// Highest coordinate.
    pub high: f32,
    /// Motor: where to, m or rad.
    pub target_pos: f32,
    /// Motor: how fast, m/s or rad/s.
    pub target_vel: f32,
    /// Motor.
    pub stiffness: f32,
    /// Motor.
    pub damping: f32,
    /// Motor: N or N m; at most 1e30.
    pub max_force: f32,
    /// Largest force of dry friction, N or N m.
    pub friction: f32,
}

/// What a joint is; changes only by edits. 304 bytes. Frames are in the bodies' principal frames.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Joint {
    /// Joint frame to that of the first body.
    pub rotation_a: [f32; 4],
    /// Joint frame to that of the second body.
    pub rotation_b: [f32; 4],
    /// From the first body's centre of mass, m.
    pub anchor_a: [f32; 3],
    /// Slot of the first body.
    pub body_a: u32,
    /// From the second body's centre of mass, m.
    pub anchor_b: [f32; 3],
    /// Slot of the second body.
    pub body_b: u32,
    /// See [`joint_bits`].
    pub axes: u32,
    /// See [`joint_bits`].
    pub flags: u32,
    /// Of the handle.
    pub generation: u32,
    /// What locked axes give way with, rad/s.
    pub frequency: f32,
    /// Of critical damping.
    pub damping_ratio: f32,
    /// N; at most 1e30.
    pub break_force: f32,
    /// N m; at most 1e30.
    pub break_torque: f32,
    /// Unused.
    pub pad_a: u32,
    /// By axis.
    pub drives: [JointDrive; 6],
}

/// What lasts of a joint from step to step, written by the solver. 80 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct JointState {
    /// On the second body in one sub-step, N s, world frame.
    pub impulse: [f32; 3],
    /// Generation of the joint that this is of, plus one; 0 before its first step.
    pub tag: u32,
    /// About the anchor, on the second body in one sub-step, N m s, world frame.
    pub torque: [f32; 3],
    /// 1 once it is broken.
    pub broken: u32,
    /// By how much the last prediction of the separation was off what is linear, m/s.
    pub remainder: [f32; 3],
    /// Length of the sub-steps that all this is of, s.
    pub h: f32,
    /// The same of the angles, rad/s.
    pub angular_remainder: [f32; 3],
    /// Unused.
    pub pad_a: u32,
    /// Farthest that locked axes were off at the end of the last step, m.
    pub separation: f32,
    /// The same of the angles, rad.
    pub angle: f32,
    /// Unused.
    pub pad_b: [u32; 2],
}

/// In place of a body that does not move.
pub const NO_BODY: u32 = u32::MAX;

/// Joints that are solved directly, together. 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct JointIsland {
    /// First of its blocks, which lie in the order of elimination.
    pub first_block: u32,
    /// Number of blocks.
    pub block_count: u32,
    /// Place of the first block of its first level.
    pub first_level: u32,
    /// Number of levels.
    pub level_count: u32,
    /// First of its joints.
    pub first_joint: u32,
    /// Number of joints.
    pub joint_count: u32,
    /// First of its bodies.
    pub first_body: u32,
    /// Number of bodies.
    pub body_count: u32,
}

/// A block on the diagonal: up to three rows of one joint. 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct JointBlock {
    /// Twice the joint's place for the rows along its axes, plus one for those about them.
    pub row: u32,
    /// First of the entries below it.
    pub first_entry: u32,
    /// Number of entries below it.
    pub entry_count: u32,
    /// First of the terms taken from it.
    pub first_term: u32,
    /// Number of terms.
    pub term_count: u32,
    /// First of the entries left of it.
    pub first_row: u32,
    /// Number of entries left of it.
    pub row_count: u32,
    /// Unused.
    pub pad_a: u32,
}

/// A block below the diagonal. 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct JointEntry {
    /// Block of its row.
    pub row: u32,
    /// Block of its column.
    pub column: u32,
    /// First of the terms taken from it.
    pub first_term: u32,
    /// Number of terms.
    pub term_count: u32,
    /// Bodies that move and that both joints hold, [`NO_BODY`] where there is none.
    pub shared_bodies: [u32; 2],
    /// Unused.
    pub pad_a: [u32; 2],
}

/// A body that joints move. 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct JointBody {
    /// Its slot.
    pub body: u32,
    /// First of the joints at it.
    pub first_end: u32,
    /// Number of joints at it.
    pub end_count: u32,
    /// 1 where they are solved directly.
    pub direct: u32,
}

/// Where in the words of [`Topology::pack`](crate::Topology::pack) each table begins, and how many elements some have. 80
/// bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct JointTables {
    /// First word of the islands.
    pub islands: u32,
    /// First word of the blocks.
    pub blocks: u32,
    /// First word of the levels.
    pub levels: u32,
    /// First word of the entries.
    pub entries: u32,
    /// First word of the terms.
    pub terms: u32,
    /// First word of the rows.
    pub rows: u32,
    /// First word of the joints' slots.
    pub joints: u32,
    /// First word of the bodies.
    pub bodies: u32,
    /// First word of the ends.
    pub ends: u32,
    /// First word of the batches.
    pub batches: u32,
    /// Number of islands.
    pub island_count: u32,
    /// Number of blocks.
    pub block_count: u32,
    /// Number of entries.
    pub entry_count: u32,
    /// Number of joints.
    pub joint_count: u32,
    /// Joints that are solved directly, the first ones.
    pub direct_joints: u32,
    /// Number of bodies.
    pub body_count: u32,
    /// Bodies of joints that are solved directly, the first ones.
    pub direct_bodies: u32,
    /// Number of batches.
    pub batch_count: u32,
    /// Batches that have a dispatch of their own, the first ones.
    pub wide_batches: u32,
    /// Unused.
    pub pad_a: u32,
}
