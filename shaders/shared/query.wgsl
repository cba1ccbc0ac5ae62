// Queries: rays, shapes and points, and what they are answered. Fields and units: crates/core/src/layout/query.rs.

const NO_COLLIDER: u32 = 0xffffffffu;

// Words of `query_status`.
const QUERY_UNBOUNDED: u32 = 0u;
const QUERY_TURNS: u32 = 1u;
const QUERY_TOTAL: u32 = 2u;
const QUERY_COUNT: u32 = 3u;

struct PlacedShape {
    position: vec3<f32>,
    shape: u32,
    rotation: vec4<f32>,
    size: vec3<f32>,
    pad_a: u32,
}

struct QueryRay {
    origin: vec3<f32>,
    max_distance: f32,
    direction: vec3<f32>,
    solid: u32,
    inverse: vec3<f32>,
    pad_a: u32,
}

struct QueryVolume {
    min: vec3<f32>,
    pad_a: u32,
    max: vec3<f32>,
    pad_b: u32,
    placed: PlacedShape,
}

struct QueryPoint {
    point: vec3<f32>,
    max_squared: f32,
}

struct QueryAnswer {
    vector: vec3<f32>,
    distance: f32,
    collider: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

struct QueryInfo {
    count: u32,
    collider_count: u32,
    capacity: u32,
    pad_a: u32,
}
