//! Bounds that both sides share: of loops, which some drivers cut short in silence, and of buffers.

use crate::error::{Error, Result};
use crate::layout::{BodyState, Collider, EditRecord, batching};
use crate::params::Capacities;

/// Rounds of placing before the rest goes to the last batch; each round places at least one constraint, and in
/// practice a constant share.
pub const BATCH_ROUNDS: u32 = 62;

/// Most constraints in the last batch: each is one turn of a loop, and some drivers end loops at 65,535 turns.
pub const LAST_LIMIT: u32 = 32_768;

/// Most turns that the search for one collider's partners takes, candidates of the grid or nodes of a tree: the same
/// bound.
pub const TURN_LIMIT: u32 = 50_000;

/// Most colliders without end (half-spaces), which are tested against all. One invocation may walk along them twice, once
/// for itself and once for one of them: with the above below the same bound.
pub const UNBOUNDED_LIMIT: u32 = 4096;

/// Most slices of a sliced grid: their sizes are added up in two words.
pub const SLICE_LIMIT: u32 = 65_536;

/// Steps after which a world looks again how far its colliders lie apart, for the choice of a broad phase.
pub const LOOK_EVERY: u32 = 64;

/// Steps after which the status of a step has come back from a GPU: no decision looks at a later one.
pub const STATUS_DELAY: u32 = 3;

/// Candidates that one turn of work of the sweep looks at.
pub const SWEEP_CHUNK: u32 = 256;

/// Most such turns of all colliders together: 7e10 candidates, seconds on any GPU.
pub const SWEEP_ITEM_LIMIT: u32 = 1 << 28;

/// How large the grid's cell table is for `colliders` colliders: log2 of at least two cells each.
pub fn cell_table_bits(colliders: u32) -> u32 {
    (colliders.max(1) * 2).next_power_of_two().trailing_zeros().clamp(6, 24)
}

/// How many colliders may be left out of the grid because they are larger than a cell: a few, that all are tested
/// against, or an eighth when these have a tree.
pub fn large_limit(colliders: u32, tree: bool) -> u32 {
    let few = 8 + (colliders / 1024).min(56);
    if tree { few.max(colliders / 8) } else { few }
}

/// Room in the pair list at first.
pub fn initial_pairs(capacities: &Capacities, colliders: u32) -> u32 {
    let most = capacities.max_array_bytes / BYTES_A_PAIR;
    capacities.pairs.unwrap_or_else(|| u64::from(colliders.saturating_mul(8).max(1024)).min(most).max(1) as u32)
}

/// Room for what edits bring: bodies, colliders and the edits themselves, in elements. The same on both sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// Slots of bodies.
    pub bodies: u32,
    /// Slots of colliders.
    pub colliders: u32,
    /// Records of one step's edits.
    pub edits: u32,
}

impl Room {
    /// Room at first, for a scene of so many slots.
    pub fn first(capacities: &Capacities, bodies: u32, colliders: u32) -> Self {
        Self {
            bodies: bodies.max(capacities.bodies.unwrap_or(1)),
            colliders: colliders.max(capacities.colliders.unwrap_or(1)),
            edits: capacities.edits.unwrap_or(256),
        }
    }

    /// Room for what a step needs, where that is allowed, and the names of what grew.
    ///
    /// # Errors
    /// [`Error::Capacity`] names what may not grow.
    pub fn grown(&self, needed: &Room, capacities: &Capacities) -> Result<(Self, Vec<&'static str>)> {
        let (mut room, mut names) = (*self, Vec::new());
        for (buffer, capacity, needed, bytes) in [
            ("bodies", &mut room.bodies, needed.bodies, size_of::<BodyState>()),
            ("colliders", &mut room.colliders, needed.colliders, size_of::<Collider>()),
            ("edits", &mut room.edits, needed.edits, size_of::<EditRecord>()),
        ] {
            if needed > *capacity {
                *capacity = more(buffer, needed.into(), *capacity, bytes as u64, capacities)?;
                names.push(buffer);
            }
        }
        Ok((room, names))
    }
}

/// Room to make in `buffer`, whose widest array has `bytes` an element, when `needed` did not fit.
///
/// # Errors
/// [`Error::Capacity`] when it may not grow so far.
pub fn more(buffer: &'static str, needed: u64, capacity: u32, bytes: u64, capacities: &Capacities) -> Result<u32> {
    let most = (capacities.max_array_bytes / bytes).min(u64::from(u32::MAX >> 6));
    let room = grown(needed).min(most);
    if !capacities.grow || room < needed {
        return Err(Error::Capacity { buffer, needed, capacity: capacity.into() });
    }
    Ok(room as u32)
}

/// Room to make when `needed` elements did not fit: a quarter more, so that a growing scene does not grow its buffers
/// in every step.
pub fn grown(needed: u64) -> u64 {
    (needed + needed / 4).next_multiple_of(1024)
}

/// Rounds of placing that run over all new constraints at once; later ones run in one workgroup over what is left.
pub const WIDE_ROUNDS: u32 = 8;

/// Rounds in which write-and-verify fills one batch.
pub const TRIES: u32 = 3;

/// Rounds of write-and-verify that run over all constraints at once, 20 batches. One workgroup adds as many.
pub const VERIFY_ROUNDS: u32 = 60;

/// Rounds over all constraints at once, as [`StepParams::batching`](crate::layout::StepParams::batching) asks.
pub fn wide_rounds(batching: u32) -> u32 {
    if batching & batching::LAW == batching::WRITE_AND_VERIFY { VERIFY_ROUNDS } else { WIDE_ROUNDS }
}

/// Most rounds in all.
pub fn batch_rounds(batching: u32) -> u32 {
    if batching & batching::LAW == batching::WRITE_AND_VERIFY { 2 * VERIFY_ROUNDS } else { BATCH_ROUNDS }
}

/// How many rounds that one workgroup may add for `left` constraints within its loops' bound.
pub fn tail_rounds(batching: u32, left: u32) -> u32 {
    (batch_rounds(batching) - wide_rounds(batching)).min(24_000 / left.div_ceil(256).max(1))
}

/// Bytes of the widest array that follows the number of pairs.
pub const BYTES_A_PAIR: u64 = 192;
