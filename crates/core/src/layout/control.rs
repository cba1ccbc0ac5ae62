use bytemuck::{Pod, Zeroable};

/// Number of batches, the last one included.
pub const BATCHES: u32 = 64;
/// The batch that is solved in sequence: hubs, and what the rounds could not place.
pub const LAST_BATCH: u32 = 63;
/// Batch of a manifold that has no constraint.
pub const UNBATCHED: u32 = 255;
/// How many quarantined bodies a step names; more are only counted.
pub const QUARANTINE_NAMES: usize = 8;
/// How many joints that broke a step names; more are only counted.
pub const BREAK_NAMES: usize = 8;

/// Values of [`Control::overflow`]: which buffer or bound was passed.
pub mod overflow {
    /// Nothing was.
    pub const NONE: u32 = 0;
    /// The pair list and all that is sized by it.
    pub const PAIRS: u32 = 1;
    /// The search for one collider's partners takes more turns than a shader's loop may.
    pub const TURNS: u32 = 2;
    /// More constraints in the last batch than a shader's loop may visit.
    pub const LAST_BATCH: u32 = 3;
    /// More colliders without end than a shader's loop may visit.
    pub const UNBOUNDED: u32 = 4;
    /// More items of work of the sweep than `SWEEP_ITEM_LIMIT`.
    pub const SWEEP: u32 = 5;
}

/// Counters and decisions of a step, kept where the passes run. 544 bytes.
///
/// Everything from `pair_count` on is written anew each step. `stop` is sticky: raised in the plan phase, cleared by
/// the host when the buffer has grown.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Control {
    /// Non-zero: nothing of this step or a later one is committed.
    pub stop: u32,
    /// Which bound was passed, see [`overflow`].
    pub overflow: u32,
    /// Elements needed there.
    pub needed: u32,
    /// The last step that committed.
    pub step: u32,
    /// Pairs of the last committed step, in `pairs`.
    pub old_pair_count: u32,
    /// Slots on the free list.
    pub free_count: u32,
    /// What the kept batches are good for: `StepParams::batching` of the steps that may keep them. A step with another
    /// one colours everything anew, and so does every step after 0.
    pub colored_as: u32,
    /// Bodies in quarantine, all told.
    pub frozen_count: u32,

    /// Pairs that the broad phase found.
    pub pair_count: u32,
    /// Pairs that the narrow phase visited.
    pub processed: u32,
    /// Pairs that were not in the last list.
    pub new_count: u32,
    /// Pairs of the last list that are gone.
    pub dead_count: u32,
    /// Constraints: manifolds with points.
    pub constraint_count: u32,
    /// Contact points.
    pub point_count: u32,
    /// Batches in use, the last one excluded.
    pub batch_count: u32,
    /// Rounds that placing took.
    pub rounds: u32,

    /// Constraints left to place.
    pub unplaced: u32,
    /// Constraints in the last batch.
    pub last_count: u32,
    /// Colliders that all others are tested against: those without end, and the few too large for a grid.
    pub large_count: u32,
    /// Most constraints on one dynamic body.
    pub max_degree: u32,
    /// Constraints that the solver visited.
    pub solved: u32,
    /// Turns of all searches for partners, modulo 2^32.
    pub turns: u32,
    /// Size class of the grid's cells.
    pub cell_class: u32,
    /// Bits of the cell index along x | y << 8 | z << 16.
    pub cell_bits: u32,

    /// Lowest centre of a collider, as order-preserving integers.
    pub center_min: [u32; 3],
    /// 1 / cell edge, 1/m, as float bits.
    pub inverse_cell: u32,
    /// Highest centre.
    pub center_max: [u32; 3],
    /// Unused.
    pub pad_a: u32,

    /// First constraint of each batch in use, in their order, then those in no use, then the last one; behind it the
    /// number of all.
    pub batch_start: [u32; 68],
    /// Slots of bodies newly quarantined in this step, plus one; zero where there is none.
    pub quarantined: [u32; QUARANTINE_NAMES],
    /// What passes of one step tell each other, see `contact.wgsl` and `broadphase/grid.wgsl`.
    pub pad_b: [u32; 4],

    /// Islands of bodies that are awake, where they are looked for.
    pub islands: u32,
    /// 1 when a bound kept islands from being told apart.
    pub islands_open: u32,
    /// Bodies asleep.
    pub asleep: u32,
    /// Islands asleep.
    pub islands_asleep: u32,
    /// Bodies awake that contacts can push, and kinematic ones that move; where bodies may sleep.
    pub awake: u32,
    /// Manifolds with points of those asleep, which are no constraints of the step.
    pub manifolds_asleep: u32,
    /// Accuracy on demand: bit l where some body wants level l.
    pub levels_wanted: u32,
    /// The same of the level that it got.
    pub levels_used: u32,

    /// Constraints and joints, each times its sub-steps, modulo 2^32.
    pub visits: u32,
    /// Deepest overlap, m, as float bits.
    pub residual: u32,
    /// Bodies of islands with more overlap or separation than the tolerances.
    pub bodies_over: u32,
    /// Joints that are broken, all told.
    pub broken_joints: u32,
    /// Widest separation of locked axes, m, as float bits.
    pub joint_residual: u32,
    /// Unused.
    pub pad_c: u32,
    /// Unused.
    pub pad_d: u32,
    /// Unused.
    pub pad_e: u32,
    /// Slots of joints that broke in this step, plus one; zero where there is none.
    pub newly_broken: [u32; BREAK_NAMES],
}
