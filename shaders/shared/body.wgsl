// Bodies: what lasts, what they are made of, the hot state of one step, and poses as users see them.
// Fields and units: crates/core/src/layout/body.rs.

const BODY_NONE: u32 = 0u;
const BODY_FIXED: u32 = 1u;
const BODY_KINEMATIC: u32 = 2u;
const BODY_DYNAMIC: u32 = 3u;
const BODY_KIND: u32 = 3u;
const BODY_FROZEN: u32 = 4u;
const BODY_ASLEEP: u32 = 8u;
const BODY_STAYS_AWAKE: u32 = 16u;
const BODY_POSED: u32 = 32u;

const LOCKED_TRANSLATIONS: u32 = 7u;
const LOCKED_ROTATIONS: u32 = 56u;
const LOCKED_FIRST_ROTATION: u32 = 3u;

const TOUCHED_CONTACT: u32 = 1u;
const TOUCHED_JOINED: u32 = 2u;
const TOUCHED_ANY: u32 = 3u;
const TOUCHED_FIRST_LOCK: u32 = 28u;

struct BodyState {
    position: vec3<f32>,
    flags: u32,
    rotation: vec4<f32>,
    linear_velocity: vec3<f32>,
    generation: u32,
    angular_velocity: vec3<f32>,
    credit: u32,
    force: vec3<f32>,
    h: f32,
    torque: vec3<f32>,
    eigenvalue: f32,
}

struct BodyProps {
    inverse_inertia: vec3<f32>,
    inverse_mass: f32,
    inertia: vec3<f32>,
    gravity_scale: f32,
    center_of_mass: vec3<f32>,
    linear_damping: f32,
    frame: vec4<f32>,
    angular_damping: f32,
    reach: f32,
    locked: u32,
    least_level: u32,
}

struct Rest {
    position: vec3<f32>,
    time: f32,
    rotation: vec4<f32>,
    island: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

struct SolverBody {
    linear_velocity: vec3<f32>,
    inverse_mass: f32,
    angular_velocity: vec3<f32>,
    touched: u32,
    translation: vec3<f32>,
    eigenvalue: f32,
    delta: vec4<f32>,
    inverse_inertia_diagonal: vec3<f32>,
    level: u32,
    inverse_inertia_off: vec3<f32>,
    parts: u32,
    linear_start: vec3<f32>,
    weight: f32,
    angular_start: vec3<f32>,
    weighted: f32,
}

struct PoseRecord {
    translation: vec3<f32>,
    tag: u32,
    rotation: vec4<f32>,
}

// Whether contacts can push the body.
fn moves(flags: u32) -> bool {
    return (flags & (BODY_KIND | BODY_FROZEN | BODY_ASLEEP)) == BODY_DYNAMIC;
}

// Which of three bits are set, `first` being the lowest.
fn three_bits(word: u32, first: u32) -> vec3<bool> {
    return (vec3<u32>(word >> first) & vec3<u32>(1u, 2u, 4u)) != vec3<u32>();
}

// Whether a body of these flags does not move along some axis.
fn is_locked(touched: u32) -> bool {
    return (touched >> TOUCHED_FIRST_LOCK) != 0u;
}

// What is left of a push on a body of these flags where axes are locked.
fn along_free(touched: u32, push: vec3<f32>) -> vec3<f32> {
    return select(push, vec3<f32>(), three_bits(touched, TOUCHED_FIRST_LOCK));
}

// Mass splitting: a part of a body, before any constraint of the last batch worked on it.
fn last_part(body: SolverBody) -> SolverBody {
    var part = body;
    let parts = f32(max(body.parts, 1u));
    part.inverse_mass *= parts;
    part.inverse_inertia_diagonal *= parts;
    part.inverse_inertia_off *= parts;
    part.weight = 0.0;
    part.weighted = 0.0;
    return part;
}
