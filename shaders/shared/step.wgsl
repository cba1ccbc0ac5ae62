// What one step is told, as a uniform. Fields and units: crates/core/src/layout/step.rs.

// `batching`: a law, and flags.
const BATCHING_WRITE_AND_VERIFY: u32 = 1u;
const BATCHING_LOWEST_FREE: u32 = 2u;
const BATCHING_PERSISTENT: u32 = 3u;
const BATCHING_LAW: u32 = 3u;
const BATCHING_STATIC_LAST: u32 = 4u;
const BATCHING_SPLIT_LAST: u32 = 8u;

const SOLVER_ONE_PASS: u32 = 0u;
const SOLVER_SOFT: u32 = 1u;
const SOLVER_GAUSS_SEIDEL: u32 = 2u;
const SOLVER_JACOBI: u32 = 3u;
const SOLVER_PENALTY: u32 = 4u;

struct StepParams {
    dt: f32,
    h: f32,
    inverse_h: f32,
    substeps: u32,
    gravity: vec3<f32>,
    step: u32,
    bias_rate: f32,
    mass_scale: f32,
    impulse_scale: f32,
    push_speed: f32,
    speculative_distance: f32,
    restitution_threshold: f32,
    body_count: u32,
    collider_count: u32,
    pair_capacity: u32,
    cell_table_bits: u32,
    large_limit: u32,
    edit_ranges: u32,
    drop_pair: u32,
    write_poses: u32,
    batch_rounds: u32,
    last_limit: u32,
    wide_batches: u32,
    static_bias_rate: f32,
    static_mass_scale: f32,
    static_impulse_scale: f32,
    memory_gain: f32,
    memory_limit: f32,
    memory_band: f32,
    blow_speed: f32,
    solver: u32,
    batching: u32,
    sleep_distance: f32,
    sleep_time: f32,
    wake_all: u32,
    iterations: u32,
    slop: f32,
    levels: u32,
    level: u32,
    tolerance: f32,
    joint_scale: f32,
    pad_a: u32,
}
