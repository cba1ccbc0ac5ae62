// Counters and decisions of a step. Fields: crates/core/src/layout/control.rs.
//
// Most passes read it as a uniform, so its arrays are of vec4: element i of `batch_start` is
// `batch_start[i / 4][i % 4]`.
// Passes that count bind the same buffer as `array<atomic<u32>>` and find a field by its word, CONTROL_<FIELD>; of a
// vector or an array that is the first word.

const BATCHES: u32 = 64u;
const LAST_BATCH: u32 = 63u;
const UNBATCHED: u32 = 255u;
const QUARANTINE_NAMES: u32 = 8u;
const BREAK_NAMES: u32 = 8u;

const OVERFLOW_NONE: u32 = 0u;
const OVERFLOW_PAIRS: u32 = 1u;
const OVERFLOW_TURNS: u32 = 2u;
const OVERFLOW_LAST_BATCH: u32 = 3u;
const OVERFLOW_UNBOUNDED: u32 = 4u;
const OVERFLOW_SWEEP: u32 = 5u;

const CONTROL_STOP: u32 = 0u;
const CONTROL_OVERFLOW: u32 = 1u;
const CONTROL_NEEDED: u32 = 2u;
const CONTROL_STEP: u32 = 3u;
const CONTROL_OLD_PAIR_COUNT: u32 = 4u;
const CONTROL_FREE_COUNT: u32 = 5u;
const CONTROL_COLORED_AS: u32 = 6u;
const CONTROL_FROZEN_COUNT: u32 = 7u;
const CONTROL_PAIR_COUNT: u32 = 8u;
const CONTROL_PROCESSED: u32 = 9u;
const CONTROL_NEW_COUNT: u32 = 10u;
const CONTROL_DEAD_COUNT: u32 = 11u;
const CONTROL_CONSTRAINT_COUNT: u32 = 12u;
const CONTROL_POINT_COUNT: u32 = 13u;
const CONTROL_BATCH_COUNT: u32 = 14u;
const CONTROL_ROUNDS: u32 = 15u;
const CONTROL_UNPLACED: u32 = 16u;
const CONTROL_LAST_COUNT: u32 = 17u;
const CONTROL_LARGE_COUNT: u32 = 18u;
const CONTROL_MAX_DEGREE: u32 = 19u;
const CONTROL_SOLVED: u32 = 20u;
const CONTROL_TURNS: u32 = 21u;
const CONTROL_CELL_CLASS: u32 = 22u;
const CONTROL_CELL_BITS: u32 = 23u;
const CONTROL_CENTER_MIN: u32 = 24u;
const CONTROL_INVERSE_CELL: u32 = 27u;
const CONTROL_CENTER_MAX: u32 = 28u;
const CONTROL_BATCH_START: u32 = 32u;
const CONTROL_QUARANTINED: u32 = 100u;
const CONTROL_ISLANDS: u32 = 112u;
const CONTROL_ISLANDS_OPEN: u32 = 113u;
const CONTROL_ASLEEP: u32 = 114u;
const CONTROL_ISLANDS_ASLEEP: u32 = 115u;
const CONTROL_AWAKE: u32 = 116u;
const CONTROL_MANIFOLDS_ASLEEP: u32 = 117u;
const CONTROL_LEVELS_WANTED: u32 = 118u;
const CONTROL_LEVELS_USED: u32 = 119u;
const CONTROL_VISITS: u32 = 120u;
const CONTROL_RESIDUAL: u32 = 121u;
const CONTROL_BODIES_OVER: u32 = 122u;
const CONTROL_BROKEN_JOINTS: u32 = 123u;
const CONTROL_JOINT_RESIDUAL: u32 = 124u;
const CONTROL_NEWLY_BROKEN: u32 = 128u;

struct Control {
    stop: u32,
    overflow: u32,
    needed: u32,
    step: u32,
    old_pair_count: u32,
    free_count: u32,
    colored_as: u32,
    frozen_count: u32,
    pair_count: u32,
    processed: u32,
    new_count: u32,
    dead_count: u32,
    constraint_count: u32,
    point_count: u32,
    batch_count: u32,
    rounds: u32,
    unplaced: u32,
    last_count: u32,
    large_count: u32,
    max_degree: u32,
    solved: u32,
    turns: u32,
    cell_class: u32,
    cell_bits: u32,
    center_min: vec3<u32>,
    inverse_cell: u32,
    center_max: vec3<u32>,
    pad_a: u32,
    batch_start: array<vec4<u32>, 17>,
    quarantined: array<vec4<u32>, 2>,
    pad_b: vec4<u32>,
    islands: u32,
    islands_open: u32,
    asleep: u32,
    islands_asleep: u32,
    awake: u32,
    manifolds_asleep: u32,
    levels_wanted: u32,
    levels_used: u32,
    visits: u32,
    residual: u32,
    bodies_over: u32,
    broken_joints: u32,
    joint_residual: u32,
    pad_c: u32,
    pad_d: u32,
    pad_e: u32,
    newly_broken: array<vec4<u32>, 2>,
}
