// Contacts as the solver sees them. Fields and units: crates/core/src/layout/constraint.rs.

struct ConstraintHead {
    normal: vec3<f32>,
    friction: f32,
    body_a: u32,
    body_b: u32,
    slot: u32,
    count: u32,
    restitution: f32,
    bias_rate: f32,
    mass_scale: f32,
    impulse_scale: f32,
    remembered: f32,
    round_a: f32,
    round_b: f32,
    rolling_resistance: f32,
    between: vec3<f32>,
    twisting_resistance: f32,
    resisted: vec3<f32>,
    rolling_inertia: f32,
    surface_velocity: vec2<f32>,
    twisting_inertia: f32,
    level: u32,
}

struct ConstraintPoint {
    anchor: vec3<f32>,
    adjusted_separation: f32,
    normal_mass: f32,
    tangent_mass: f32,
    approach: f32,
    deviation: f32,
    total: vec3<f32>,
    pad_b: u32,
}

// An array, not a vec2: that would be aligned to 8 bytes and the struct would not be 16.
struct Impulse {
    normal: f32,
    tangent: array<f32, 2>,
    feature: u32,
}

struct ManifoldMemory {
    remembered: f32,
    resisted: array<f32, 3>,
    deviations: array<f32, 4>,
    totals: array<array<f32, 3>, 4>,
}

// Whether rolling or twisting is resisted.
fn resists(head: ConstraintHead) -> bool {
    return head.rolling_resistance > 0.0 || head.twisting_resistance > 0.0;
}
