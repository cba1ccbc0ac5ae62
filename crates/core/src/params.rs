//! What the user may set, with units and defaults.

use crate::accuracy::Accuracy;
use crate::error::{Result, check};
use crate::layout::{StepParams, batching};
use crate::limits::{BYTES_A_PAIR, LAST_LIMIT, batch_rounds};
use crate::solver::{Law, Solver, Spring};
use crate::topology::JointSolver;
use glam::Vec3;
use std::fmt;

/// An impulse that changes the speed at a point by more than this, m/s, in one sub-step is a blow: it does not carry
/// over to the next sub-step. At 0.1 m/s piles fall apart; without, two dropped boxes rebound at 1.7 m/s.
const BLOW_SPEED: f32 = 1.0;

/// Which broad phase finds the pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Broadphase {
    /// The one that the scene's size, count and extent call for, see [`Broadphase::resolve`].
    #[default]
    Auto,
    /// Every collider against every other: for tiny worlds, and as an oracle.
    BruteForce,
    /// Uniform grid whose table wraps; colliders larger than a cell take another path.
    Grid,
    /// The same grid, stored slice by slice along its longest axis, each slice with bounds of its own: for domains that
    /// are wide and sparse.
    SlicedGrid,
    /// Linear bounding volume hierarchy: any sizes.
    Lbvh,
    /// Sort and sweep along the axis of largest variance: long, thin scenes.
    SweepAndPrune,
}

impl fmt::Display for Broadphase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::BruteForce => "brute force",
            Self::Grid => "grid",
            Self::SlicedGrid => "sliced grid",
            Self::Lbvh => "lbvh",
            Self::SweepAndPrune => "sweep and prune",
        })
    }
}

/// How a tree is walked. All find the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Traversal {
    /// Each node knows where to go on when its subtree is done or not entered; no memory of the way.
    #[default]
    Escape,
    /// One bit a level tells whether the other child is still to be seen, and links to the parents lead there
    /// (Harada, GDC 2009).
    History,
    /// A short stack a thread.
    Stack,
}

/// Precision of the codes along which a tree is sorted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum MortonBits {
    /// 10 bits an axis: cells of a thousandth of the scene's extent.
    #[default]
    Bits30,
    /// 21 bits an axis, for domains so wide that bodies would share such cells.
    Bits63,
}

/// How constraints are put into batches: groups within which no two share a moving body, so that each can be solved in
/// parallel. All need no more than the constraints themselves, so that results do not depend on timing; they differ in
/// the order in which constraints are solved, and so in results.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Batching {
    /// One batch after the other, each step anew: every constraint that is in none yet bids for both its bodies, and
    /// joins the batch if it holds both; a few tries a batch (Harada, GDC 2009).
    WriteAndVerify,
    /// Each step anew, but who holds both bodies takes the lowest batch that neither is in: fewer rounds.
    LowestFree,
    /// The same, and who is in a batch stays there as long as the surfaces touch, so that only what is new is placed.
    #[default]
    Persistent,
}

impl fmt::Display for Batching {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::WriteAndVerify => "write and verify",
            Self::LowestFree => "lowest free",
            Self::Persistent => "persistent",
        })
    }
}

/// How the last batch is solved: the constraints for which no other batch was left, where some body has more than 63.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum LastBatch {
    /// One constraint after the other: each sees what those before it did. Accurate, and slow on a GPU, where one
    /// invocation after the other works.
    #[default]
    Sequence,
    /// All at once: each body is split into as many parts as it has constraints in the last batch, each constraint works
    /// on parts of its own, and the body takes the mean of their velocities (Tonge, Benevolenski and Voroshilov, "Mass
    /// Splitting for Jitter-Free Parallel Rigid Body Simulation", SIGGRAPH 2012). Momentum is kept, and nothing depends on
    /// an order.
    ///
    /// Good on a GPU, where hubs are heavy: a plate that weighs what it carries, or more, is as accurate as in sequence. Bad
    /// on a CPU, where it takes longer, and where hubs are light: contacts are springs of a part's mass, so that they give
    /// way farther, and bounce less. A plate under 10 times its weight overlaps 5 times as deeply as in sequence; under 100
    /// times it sinks in (`docs/solver.md`).
    ///
    /// With [`Solver::Jacobi`] and [`Solver::Penalty`], which solve all constraints at once, it changes nothing.
    MassSplitting,
}

impl fmt::Display for LastBatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Sequence => "sequence",
            Self::MassSplitting => "mass splitting",
        })
    }
}

/// Room in buffers at first, and whether there may be more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capacities {
    /// Pairs of overlapping bounding boxes; `None`: eight a collider, at least 1,024.
    pub pairs: Option<u32>,
    /// Slots of bodies, where the scene has fewer; `None`: those of the scene.
    pub bodies: Option<u32>,
    /// Slots of colliders, where the scene has fewer; `None`: those of the scene.
    pub colliders: Option<u32>,
    /// Edits between two steps, each call of the editor counted by what it changes; `None`: 256.
    pub edits: Option<u32>,
    /// Whether buffers may grow when a step needs more; else [`Error::Capacity`](crate::Error::Capacity).
    pub grow: bool,
    /// No single array grows past this many bytes (a GPU's binding limit, 128 MiB by default, may lie below it).
    pub max_array_bytes: u64,
}

impl Default for Capacities {
    fn default() -> Self {
        Self { pairs: None, bodies: None, colliders: None, edits: None, grow: true, max_array_bytes: 2 << 30 }
    }
}

/// When bodies are put to sleep. A sleeping body keeps its pose, its contacts and what they push, and costs next to
/// nothing.
///
/// An island, the bodies that hang together by contacts and joints, sleeps as a whole once no point of any body's surface
/// has been farther than `distance` from where it was, for `time`. Poses decide and not velocities, since piles keep bodies that
/// rattle in their places for ever; so what creeps along more slowly than `distance / time` is taken to rest. Nothing
/// sleeps that a moving kinematic body touches.
///
/// An island wakes as a whole, within the step, when something that moves touches it, when one of its bodies or what it
/// rests on is edited or removed, and when gravity changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sleep {
    /// How far a point of the surface may stray while its body is at rest, m.
    pub distance: f32,
    /// How long all bodies of an island must have been at rest, s. Less than some tenths may catch one at the top of its
    /// flight.
    pub time: f32,
}

impl Default for Sleep {
    /// 2 mm in 2 s.
    fn default() -> Self {
        Self { distance: 2e-3, time: 2.0 }
    }
}

impl Sleep {
    fn validate(&self) -> Result<()> {
        let what = || "Params".to_string();
        let Self { distance, time } = *self;
        check((1e-6..=1e3).contains(&distance), what, "sleep.distance", distance, "1e-6 to 1000 m")?;
        check((1e-3..=1e6).contains(&time), what, "sleep.time", time, "0.001 to 1e6 s")
    }
}

/// Parameters of a world. Change them between steps with `set_params`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Length of a step, s. 1/60 at first.
    pub dt: f32,
    /// How many sub-steps a step takes. 8 at first.
    pub accuracy: Accuracy,
    /// How contacts are solved.
    pub solver: Solver,
    /// Fastest speed at which overlap is undone, m/s. 0.5 at first: chains of overlaps add up, and 64 boxes that overlap
    /// by a quarter then leave at 2.5 m/s.
    pub max_push_speed: f32,
    /// Gap below which a contact is kept before the surfaces meet, m. 0.02 at first.
    pub speculative_distance: f32,
    /// Slowest approach that bounces, m/s. 0.5 at first.
    pub restitution_threshold: f32,
    /// When bodies at rest are put to sleep. `None` at first: nothing sleeps, and nothing is spent on it. Without it, all
    /// that sleep wake.
    pub sleep: Option<Sleep>,
    /// Which broad phase. All find the same pairs, so that results do not depend on it.
    pub broadphase: Broadphase,
    /// How trees are walked.
    pub traversal: Traversal,
    /// Precision of the trees' codes.
    pub morton_bits: MortonBits,
    /// How constraints are put into batches.
    pub batching: Batching,
    /// Whether contacts with what does not move are solved after all others, the last batch (hubs) excepted. Off at
    /// first.
    pub static_contacts_last: bool,
    /// How the last batch is solved.
    pub last_batch: LastBatch,
    /// How joints are solved; [`StepReport::joints`](crate::StepReport::joints) tells how they were.
    pub joints: JointSolver,
    /// Room in buffers.
    pub capacities: Capacities,
    /// Worker threads of the CPU side; `None`: one a core. The result is the same for any number.
    pub threads: Option<usize>,
    /// Time each stage. Off at first; free when off.
    pub profile: bool,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            dt: 1.0 / 60.0,
            accuracy: Accuracy::default(),
            solver: Solver::default(),
            max_push_speed: 0.5,
            speculative_distance: 0.02,
            restitution_threshold: 0.5,
            sleep: None,
            broadphase: Broadphase::Auto,
            traversal: Traversal::default(),
            morton_bits: MortonBits::default(),
            batching: Batching::default(),
            static_contacts_last: false,
            last_batch: LastBatch::default(),
            joints: JointSolver::default(),
            capacities: Capacities::default(),
            threads: None,
            profile: false,
        }
    }
}

impl Params {
    /// Refuses what no step can run with, naming the field.
    pub fn validate(&self) -> Result<()> {
        let what = || "Params".to_string();
        check((1e-6..=1.0).contains(&self.dt), what, "dt", self.dt, "1e-6 to 1 s")?;
        self.accuracy.validate(what)?;
        self.solver.validate(what)?;
        check((0.0..=1e6).contains(&self.max_push_speed), what, "max_push_speed", self.max_push_speed, "0 to 1e6 m/s")?;
        check(
            (0.0..=1e3).contains(&self.speculative_distance),
            what,
            "speculative_distance",
            self.speculative_distance,
            "0 to 1000 m",
        )?;
        check(
            (0.0..=1e6).contains(&self.restitution_threshold),
            what,
            "restitution_threshold",
            self.restitution_threshold,
            "0 to 1e6 m/s",
        )?;
        self.sleep.map_or(Ok(()), |sleep| sleep.validate())?;
        if let Some(threads) = self.threads {
            check((1..=1024).contains(&threads), what, "threads", threads, "1 to 1024")?;
        }
        let Capacities { pairs, bodies, colliders, edits, .. } = self.capacities;
        for (field, capacity) in [
            ("capacities.pairs", pairs),
            ("capacities.bodies", bodies),
            ("capacities.colliders", colliders),
            ("capacities.edits", edits),
        ] {
            let capacity = capacity.unwrap_or(1);
            check((1..=1 << 26).contains(&capacity), what, field, capacity, "1 to 67,108,864")?;
        }
        let fits = pairs.is_none_or(|pairs| u64::from(pairs) * BYTES_A_PAIR <= self.capacities.max_array_bytes);
        check(fits, what, "capacities.pairs", pairs, "no more than capacities.max_array_bytes / 192")?;
        Ok(())
    }

    /// The part of a step's uniform that follows from the parameters alone.
    pub fn step_params(&self, step: u32, gravity: Vec3) -> StepParams {
        let substeps = self.accuracy.fewest();
        let h = self.dt / substeps as f32;
        let law = self.solver.law(h);
        let Law { spring: Spring { bias_rate, mass_scale, impulse_scale }, fixed, .. } = law;
        StepParams {
            dt: self.dt,
            h,
            inverse_h: 1.0 / h,
            substeps,
            gravity: gravity.to_array(),
            step,
            bias_rate,
            mass_scale,
            impulse_scale,
            static_bias_rate: fixed.bias_rate,
            static_mass_scale: fixed.mass_scale,
            static_impulse_scale: fixed.impulse_scale,
            memory_gain: law.memory_gain,
            memory_limit: law.memory_limit,
            memory_band: law.memory_band,
            blow_speed: BLOW_SPEED,
            iterations: law.iterations,
            slop: law.slop,
            solver: self.solver.code(),
            push_speed: self.max_push_speed,
            speculative_distance: self.speculative_distance,
            restitution_threshold: self.restitution_threshold,
            drop_pair: u32::MAX,
            batch_rounds: batch_rounds(self.batching_word()),
            last_limit: LAST_LIMIT,
            write_poses: 1,
            sleep_distance: self.sleep.map_or(-1.0, |sleep| sleep.distance),
            sleep_time: self.sleep.map_or(f32::MAX, |sleep| sleep.time),
            batching: self.batching_word(),
            levels: 1,
            tolerance: self.accuracy.tolerance(),
            joint_scale: self.accuracy.joint_scale(),
            ..bytemuck::Zeroable::zeroed()
        }
    }

    /// Whether the last batch is solved by mass splitting.
    pub(crate) fn splits_last(&self) -> bool {
        let in_turn = matches!(self.solver, Solver::OnePass(_) | Solver::Soft(_) | Solver::GaussSeidel(_));
        in_turn && self.last_batch == LastBatch::MassSplitting
    }

    /// [`StepParams::batching`].
    fn batching_word(&self) -> u32 {
        let law = match self.batching {
            Batching::WriteAndVerify => batching::WRITE_AND_VERIFY,
            Batching::LowestFree => batching::LOWEST_FREE,
            Batching::Persistent => batching::PERSISTENT,
        };
        let static_last = if self.static_contacts_last { batching::STATIC_LAST } else { 0 };
        law | static_last | if self.splits_last() { batching::SPLIT_LAST } else { 0 }
    }
}
