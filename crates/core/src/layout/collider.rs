use bytemuck::{Pod, Zeroable};

/// Values of [`Collider::shape`].
pub mod shape_kind {
    /// The slot is empty.
    pub const NONE: u32 = 0;
    /// `size[0]` is the radius.
    pub const BALL: u32 = 1;
    /// `size` holds the half extents.
    pub const CUBOID: u32 = 2;
    /// Everything below the plane through the collider's origin whose outward normal is its y axis.
    pub const HALFSPACE: u32 = 3;
}

/// Bits of [`Aabb::body`].
pub mod aabb_body {
    /// Index of the body.
    pub const INDEX: u32 = 0x0fff_ffff;
    /// Set when the body sleeps: contacts push it no more until it wakes.
    pub const ASLEEP: u32 = 0x1000_0000;
    /// Set when the body is fixed: it stays where it is until it is edited.
    pub const FIXED: u32 = 0x2000_0000;
    /// Set when a contact can push the body.
    pub const DYNAMIC: u32 = 0x8000_0000;
    /// Set when the collider takes part in the step at all.
    pub const LIVE: u32 = 0x4000_0000;
}

/// A shape on a body. 96 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Collider {
    /// Half extents of a cuboid, radius of a ball in the first; m.
    pub size: [f32; 3],
    /// [`shape_kind`].
    pub shape: u32,
    /// Origin in the body's principal frame, m.
    pub position: [f32; 3],
    /// Index of the body.
    pub body: u32,
    /// Collider frame to the body's principal frame.
    pub rotation: [f32; 4],
    /// Coulomb coefficient.
    pub friction: f32,
    /// 0 to 1.
    pub restitution: f32,
    /// Combine rules: friction in bits 0..2, restitution in bits 2..4, see `CombineRule`.
    pub combine: u32,
    /// Step in which it was inserted: its contacts of earlier steps were someone else's.
    pub born: u32,
    /// Of its surface against the body, in the body's principal frame, m/s.
    pub surface_velocity: [f32; 3],
    /// Largest rolling torque over normal force and radius.
    pub rolling_resistance: f32,
    /// The same about the normal.
    pub twisting_resistance: f32,
    /// Unused.
    pub pad_a: u32,
    /// Unused.
    pub pad_b: u32,
    /// Unused.
    pub pad_c: u32,
}

/// Bounding box of a collider over the coming step. 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Aabb {
    /// Lower corner, m.
    pub min: [f32; 3],
    /// [`aabb_body`].
    pub body: u32,
    /// Upper corner, m.
    pub max: [f32; 3],
    /// Size class of the longest edge: its float's exponent and two leading mantissa bits, plus one.
    pub class: u32,
}
