use bytemuck::{Pod, Zeroable};

/// Values of [`StepParams::solver`].
pub mod solver {
    /// One sweep a sub-step.
    pub const ONE_PASS: u32 = 0;
    /// Soft sub-stepping.
    pub const SOFT: u32 = 1;
    /// Projected Gauss-Seidel.
    pub const GAUSS_SEIDEL: u32 = 2;
    /// Jacobi with mass splitting.
    pub const JACOBI: u32 = 3;
    /// Springs and dampers, explicit.
    pub const PENALTY: u32 = 4;
}

/// What one step is told, as a uniform. 176 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct StepParams {
    /// Length of the step, s.
    pub dt: f32,
    /// Length of a sub-step, s.
    pub h: f32,
    /// 1 / h.
    pub inverse_h: f32,
    /// Number of sub-steps.
    pub substeps: u32,
    /// m/s².
    pub gravity: [f32; 3],
    /// Number of the step, from 1.
    pub step: u32,
    /// Spring of a contact between bodies that move: share of the overlap undone, 1/s.
    pub bias_rate: f32,
    /// Factor on the mass.
    pub mass_scale: f32,
    /// Share of the impulse that leaks.
    pub impulse_scale: f32,
    /// Fastest speed at which overlap is undone, m/s.
    pub push_speed: f32,
    /// Gap below which a contact is kept, m.
    pub speculative_distance: f32,
    /// Slowest approach that bounces, m/s.
    pub restitution_threshold: f32,
    /// Body slots in use.
    pub body_count: u32,
    /// Collider slots in use.
    pub collider_count: u32,
    /// Room in the pair list.
    pub pair_capacity: u32,
    /// log2 of the number of grid cells.
    pub cell_table_bits: u32,
    /// Colliders that may be left out of the grid because they are large.
    pub large_limit: u32,
    /// Edit ranges of this step.
    pub edit_ranges: u32,
    /// Test hook: the pair of this index is dropped before the narrow phase.
    pub drop_pair: u32,
    /// 1 when the user's poses are to be written.
    pub write_poses: u32,
    /// Rounds in which constraints are placed in batches before the rest goes to the last one.
    pub batch_rounds: u32,
    /// Most constraints that the last batch may hold.
    pub last_limit: u32,
    /// Batches that have a dispatch of their own; the others share one.
    pub wide_batches: u32,
    /// `bias_rate` of contacts with what does not move.
    pub static_bias_rate: f32,
    /// `mass_scale` of those.
    pub static_mass_scale: f32,
    /// `impulse_scale` of those.
    pub static_impulse_scale: f32,
    /// One pass: rate at which memory follows, a sub-step, over the eigenvalue of the load.
    pub memory_gain: f32,
    /// The largest such rate.
    pub memory_limit: f32,
    /// Gap times mass, over the remembered impulse, below which a contact that pushes is still pressed, s.
    pub memory_band: f32,
    /// Change of speed by which an impulse is a blow, m/s.
    pub blow_speed: f32,
    /// Which of the laws in [`solver`].
    pub solver: u32,
    /// How constraints are put into batches, see [`batching`].
    pub batching: u32,
    /// How far a point of a body's surface may stray while the body is at rest, m; below 0 where nothing sleeps.
    pub sleep_distance: f32,
    /// How long all bodies of an island must have been at rest before it sleeps, s.
    pub sleep_time: f32,
    /// 1 when all who sleep wake.
    pub wake_all: u32,
    /// Gauss-Seidel and Jacobi: visits to every contact in a sub-step.
    pub iterations: u32,
    /// The same: overlap left alone, m.
    pub slop: f32,
    /// Bit l where this step runs level l of sub-steps: those with 2^l times the sub-steps of the lowest.
    pub levels: u32,
    /// Level that `h` and all that follows from it are of: 0, but in a level's own passes.
    pub level: u32,
    /// Accuracy on demand: overlap that may be left, m; below 0 where none is measured.
    pub tolerance: f32,
    /// What a metre of separation of a joint counts for, as overlap.
    pub joint_scale: f32,
    /// Unused.
    pub pad_a: u32,
}

/// Words of [`StepParams::batching`]: a law, and flags.
pub mod batching {
    /// Batch after batch, anew each step.
    pub const WRITE_AND_VERIFY: u32 = 1;
    /// The lowest batch that both bodies are free in, anew each step.
    pub const LOWEST_FREE: u32 = 2;
    /// The same, kept from step to step.
    pub const PERSISTENT: u32 = 3;
    /// Bits of the law.
    pub const LAW: u32 = 3;
    /// Flag: contacts with what does not move take the highest free batch, not the lowest.
    pub const STATIC_LAST: u32 = 4;
    /// Flag: the last batch is solved by mass splitting, not in sequence.
    pub const SPLIT_LAST: u32 = 8;
}
