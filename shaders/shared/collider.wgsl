// Colliders and their boxes. Fields and units: crates/core/src/layout/collider.rs.
// (`class` is a word that WGSL keeps for itself: the field is `size_class` here.)

const SHAPE_NONE: u32 = 0u;
const SHAPE_BALL: u32 = 1u;
const SHAPE_CUBOID: u32 = 2u;
const SHAPE_HALFSPACE: u32 = 3u;

const AABB_INDEX: u32 = 0x0fffffffu;
const AABB_ASLEEP: u32 = 0x10000000u;
const AABB_FIXED: u32 = 0x20000000u;
const AABB_DYNAMIC: u32 = 0x80000000u;
const AABB_LIVE: u32 = 0x40000000u;

struct Collider {
    size: vec3<f32>,
    shape: u32,
    position: vec3<f32>,
    body: u32,
    rotation: vec4<f32>,
    friction: f32,
    restitution: f32,
    combine: u32,
    born: u32,
    surface_velocity: vec3<f32>,
    rolling_resistance: f32,
    twisting_resistance: f32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

struct Aabb {
    min: vec3<f32>,
    body: u32,
    max: vec3<f32>,
    size_class: u32,
}
