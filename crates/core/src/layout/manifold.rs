use bytemuck::{Pod, Zeroable};

/// [`Pair::slot`] of a pair that has none yet.
pub const NO_SLOT: u32 = u32::MAX;

/// Kinds of pairs, by shapes; order within the pair is the order of the pair list.
pub mod pair_kind {
    /// Nothing to do.
    pub const NONE: u32 = 0;
    /// Ball and ball.
    pub const BALL_BALL: u32 = 1;
    /// Ball and cuboid, in either order.
    pub const BALL_CUBOID: u32 = 2;
    /// Cuboid and cuboid.
    pub const CUBOID_CUBOID: u32 = 3;
    /// Ball and half-space, in either order.
    pub const BALL_HALFSPACE: u32 = 4;
    /// Cuboid and half-space, in either order.
    pub const CUBOID_HALFSPACE: u32 = 5;
    /// Number of kinds.
    pub const COUNT: u32 = 6;
    /// Masks the kind out of [`Pair::kind`](super::Pair::kind).
    pub const MASK: u32 = 255;
    /// Set when the pair was not in the last step's list.
    pub const FRESH: u32 = 256;
    /// Set when it is left out of the step since neither end is awake: what its slot remembers stays as it is.
    pub const ASLEEP: u32 = 512;
}

/// Two colliders whose boxes overlap, `a < b`; lists of them are sorted by (a, b). 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct Pair {
    /// Collider of the lower slot.
    pub a: u32,
    /// Collider of the higher slot.
    pub b: u32,
    /// Where the pair's impulses and batch live from step to step.
    pub slot: u32,
    /// Which of the kinds in [`pair_kind`].
    pub kind: u32,
}

/// One point of a manifold. 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ManifoldPoint {
    /// Midway between the surfaces, from the centre of mass of the first body, world axes, m.
    pub anchor: [f32; 3],
    /// Gap along the normal, negative when they overlap, m.
    pub separation: f32,
}

/// Contact of one pair in one step, as the narrow phase leaves it. 112 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Manifold {
    /// From a to b, world axes, unit.
    pub normal: [f32; 3],
    /// Points in use, 0 to 4.
    pub count: u32,
    /// Which features meet at each point; equal from step to step while they do.
    pub features: [u32; 4],
    /// From the centre of mass of the first body to that of the second when the points were found, world axes, m.
    pub between: [f32; 3],
    /// 1 when the points are those of an earlier step.
    pub recycled: u32,
    /// The points.
    pub points: [ManifoldPoint; 4],
}

/// A manifold as it was found, with what is needed to tell how far the two have moved since. 144 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct FoundManifold {
    /// Rotation of the first body's principal frame then.
    pub rotation_a: [f32; 4],
    /// Rotation of the second body's.
    pub rotation_b: [f32; 4],
    /// The manifold, with the separations of then.
    pub manifold: Manifold,
}
