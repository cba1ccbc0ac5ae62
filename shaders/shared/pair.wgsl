// Pairs of colliders whose boxes overlap. Fields: crates/core/src/layout/manifold.rs.

const NO_SLOT: u32 = 0xffffffffu;

const PAIR_NONE: u32 = 0u;
const PAIR_BALL_BALL: u32 = 1u;
const PAIR_BALL_CUBOID: u32 = 2u;
const PAIR_CUBOID_CUBOID: u32 = 3u;
const PAIR_BALL_HALFSPACE: u32 = 4u;
const PAIR_CUBOID_HALFSPACE: u32 = 5u;
const PAIR_COUNT: u32 = 6u;
const PAIR_MASK: u32 = 255u;
const PAIR_FRESH: u32 = 256u;
const PAIR_ASLEEP: u32 = 512u;

struct Pair {
    a: u32,
    b: u32,
    slot: u32,
    kind: u32,
}
