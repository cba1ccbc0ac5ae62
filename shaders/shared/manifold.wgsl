// Contact of one pair in one step. Fields and units: crates/core/src/layout/manifold.rs.

struct ManifoldPoint {
    anchor: vec3<f32>,
    separation: f32,
}

struct Manifold {
    normal: vec3<f32>,
    count: u32,
    features: vec4<u32>,
    points: array<ManifoldPoint, 4>,
}
