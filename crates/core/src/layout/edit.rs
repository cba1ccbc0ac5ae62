use bytemuck::{Pod, Zeroable};

/// Values of [`EditRecord::op`]. Poses and points are in the world, of the body's own frame.
pub mod edit_op {
    /// A body comes to be: `kind` its flags, `generation` its generation, data as for `PROPS`.
    pub const SPAWN: u32 = 1;
    /// Mass properties change (a collider came): data\[0\] inverse inertia, inverse mass; 1 inertia, gravity scale;
    /// 2 centre of mass, linear damping; 3 frame; 4 angular damping; 5 and 6 centre of mass and frame of before. The
    /// body's own frame stays where it is. With `kind` 1 they are those that the body has: its state stays as it is.
    pub const PROPS: u32 = 2;
    /// The body is gone.
    pub const REMOVE: u32 = 3;
    /// data\[0\] position, data\[1\] rotation of the body's own frame.
    pub const POSE: u32 = 4;
    /// data\[0\] linear velocity of the centre of mass, data\[1\] angular velocity.
    pub const VELOCITY: u32 = 5;
    /// data\[0\] impulse at the centre of mass, data\[1\] angular impulse.
    pub const IMPULSE: u32 = 6;
    /// data\[0\] impulse, data\[1\] the point where it acts.
    pub const IMPULSE_AT: u32 = 7;
    /// data\[0\] force at the centre of mass, data\[1\] torque, for this step.
    pub const FORCE: u32 = 8;
    /// data\[0\] force, data\[1\] the point where it acts at the start of the step, for this step.
    pub const FORCE_AT: u32 = 9;
    /// The body is put in quarantine.
    pub const FREEZE: u32 = 10;
    /// Nothing changes; like all edits it wakes the body.
    pub const WAKE: u32 = 11;
    /// data\[0\] position, data\[1\] rotation of the body's own frame at the end of the step: it gets the velocities that
    /// lead there.
    pub const NEXT_POSE: u32 = 12;
    /// A collider is written: data\[0..6\] its 96 bytes, `born` excepted, which is the step's number.
    pub const COLLIDER: u32 = 13;
    /// The collider is gone: all zero but for the body that it was on.
    pub const COLLIDER_REMOVE: u32 = 14;
}

/// One edit. 128 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct EditRecord {
    /// [`edit_op`].
    pub op: u32,
    /// Slot of the body or collider.
    pub target: u32,
    /// Flags of a body that comes to be; see `edit_op::PROPS` too.
    pub kind: u32,
    /// Its generation.
    pub generation: u32,
    /// Arguments, by operation: floats as their bits, so that no unit ever takes an index for a subnormal float.
    pub data: [[u32; 4]; 7],
}

/// The edits of one body or one collider, in the order in which they were made. 8 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct EditRange {
    /// First record.
    pub first: u32,
    /// Number of records.
    pub count: u32,
}
