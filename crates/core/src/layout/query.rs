use bytemuck::{Pod, Zeroable};

/// No collider: what a query answers that met none.
pub const NO_COLLIDER: u32 = u32::MAX;

/// Words of what the queries of one batch count together.
pub mod query_word {
    /// Living colliders without end.
    pub const UNBOUNDED: u32 = 0;
    /// Most turns of a query that was cut short; 0 when none was.
    pub const TURNS: u32 = 1;
    /// Overlaps of all queries.
    pub const TOTAL: u32 = 2;
    /// Number of words.
    pub const COUNT: u32 = 3;
}

/// A collider's shape in the world, or the shape of a query. 48 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PlacedShape {
    /// Origin in the world, m.
    pub position: [f32; 3],
    /// [`shape_kind`](crate::layout::shape_kind).
    pub shape: u32,
    /// Shape to world, unit quaternion x y z w.
    pub rotation: [f32; 4],
    /// Half extents of a cuboid, radius of a ball in the first; m.
    pub size: [f32; 3],
    /// Unused.
    pub pad_a: u32,
}

/// A ray with all that the host can tell ahead. 48 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct QueryRay {
    /// m.
    pub origin: [f32; 3],
    /// Length, m.
    pub max_distance: f32,
    /// Unit vector.
    pub direction: [f32; 3],
    /// 1 when a ray that begins inside a collider hits it there; 0 when it hits the surface from inside.
    pub solid: u32,
    /// 1 / direction, by component; large where that is nothing.
    pub inverse: [f32; 3],
    /// Unused.
    pub pad_a: u32,
}

/// A shape whose overlaps are asked for. 80 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct QueryVolume {
    /// Lower corner of its box, m.
    pub min: [f32; 3],
    /// Unused.
    pub pad_a: u32,
    /// Upper corner, m.
    pub max: [f32; 3],
    /// Unused.
    pub pad_b: u32,
    /// The shape.
    pub placed: PlacedShape,
}

/// A point whose nearest collider is asked for. 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct QueryPoint {
    /// m.
    pub point: [f32; 3],
    /// Square of the largest distance, m².
    pub max_squared: f32,
}

/// What a ray or a point found. 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct QueryAnswer {
    /// Normal of a hit, or the nearest point, m.
    pub vector: [f32; 3],
    /// m.
    pub distance: f32,
    /// Slot of the collider; [`NO_COLLIDER`] when there is none.
    pub collider: u32,
    /// Unused.
    pub pad_a: u32,
    /// Unused.
    pub pad_b: u32,
    /// Unused.
    pub pad_c: u32,
}

/// What a pass over queries is told. 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct QueryInfo {
    /// Queries of the batch.
    pub count: u32,
    /// Slots of colliders.
    pub collider_count: u32,
    /// Overlaps that there is room for.
    pub capacity: u32,
    /// Unused.
    pub pad_a: u32,
}
