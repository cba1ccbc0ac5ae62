// Contact of one pair in one step. Fields and units: crates/core/src/layout/manifold.rs.

struct ManifoldPoint {
    anchor: vec3<f32>,
    separation: f32,
}

struct Manifold {
    normal: vec3<f32>,
    count: u32,
    features: vec4<u32>,
    between: vec3<f32>,
    recycled: u32,
    points: array<ManifoldPoint, 4>,
}

// A manifold as it was found, with what is needed to tell how far the two have moved since.
struct FoundManifold {
    rotation_a: vec4<f32>,
    rotation_b: vec4<f32>,
    manifold: Manifold,
}
