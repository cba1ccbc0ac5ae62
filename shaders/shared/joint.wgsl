// Joints: what they are, what lasts of them, and in what order they are solved.
// Fields and units: crates/core/src/layout/joint.rs.

const JOINT_LOCKED: u32 = 0u;
const JOINT_DRIVEN: u32 = 8u;
const JOINT_LIMITED: u32 = 16u;
const JOINT_MOTOR: u32 = 24u;
const JOINT_ALIVE: u32 = 1u;
const JOINT_COUPLED: u32 = 2u;
const JOINT_IN_CYCLE: u32 = 4u;
const JOINT_SOFT: u32 = 8u;
const JOINT_APART: u32 = 16u;
const JOINT_HELD: u32 = 32u;
const JOINT_TWICE: u32 = 64u;
const JOINT_OVERLOCKED: u32 = 128u;
const JOINT_FORCE_BASED: u32 = 8u;
const NO_BODY: u32 = 0xffffffffu;

struct JointDrive {
    low: f32,
    high: f32,
    target_pos: f32,
    target_vel: f32,
    stiffness: f32,
    damping: f32,
    max_force: f32,
    friction: f32,
}

struct Joint {
    rotation_a: vec4<f32>,
    rotation_b: vec4<f32>,
    anchor_a: vec3<f32>,
    body_a: u32,
    anchor_b: vec3<f32>,
    body_b: u32,
    axes: u32,
    flags: u32,
    generation: u32,
    frequency: f32,
    damping_ratio: f32,
    break_force: f32,
    break_torque: f32,
    pad_a: u32,
    drives: array<JointDrive, 6>,
}

struct JointState {
    impulse: vec3<f32>,
    tag: u32,
    torque: vec3<f32>,
    broken: u32,
    remainder: vec3<f32>,
    h: f32,
    angular_remainder: vec3<f32>,
    pad_a: u32,
    separation: f32,
    angle: f32,
    pad_b: vec2<u32>,
}

struct JointIsland {
    first_block: u32,
    block_count: u32,
    first_level: u32,
    level_count: u32,
    first_joint: u32,
    joint_count: u32,
    first_body: u32,
    body_count: u32,
}

struct JointBlock {
    row: u32,
    first_entry: u32,
    entry_count: u32,
    first_term: u32,
    term_count: u32,
    first_row: u32,
    row_count: u32,
    pad_a: u32,
}

struct JointEntry {
    row: u32,
    column: u32,
    first_term: u32,
    term_count: u32,
    shared_bodies: vec2<u32>,
    pad_a: vec2<u32>,
}

struct JointBody {
    body: u32,
    first_end: u32,
    end_count: u32,
    direct: u32,
}

// Where in `joint_tables` each table begins, in words, and how many elements some have.
struct JointTables {
    islands: u32,
    blocks: u32,
    levels: u32,
    entries: u32,
    terms: u32,
    rows: u32,
    joints: u32,
    bodies: u32,
    ends: u32,
    batches: u32,
    island_count: u32,
    block_count: u32,
    entry_count: u32,
    joint_count: u32,
    direct_joints: u32,
    body_count: u32,
    direct_bodies: u32,
    batch_count: u32,
    wide_batches: u32,
    pad_a: u32,
}
