//! Bounds that both sides share: of loops, which some drivers cut short in silence, and of buffers.

use crate::params::Capacities;

/// Rounds of placing before the rest goes to the last batch; each round places at least one constraint, and in
/// practice a constant share.
pub const BATCH_ROUNDS: u32 = 62;

/// Most constraints in the last batch: each is one turn of a loop, and some drivers end loops at 65,535 turns.
pub const LAST_LIMIT: u32 = 32_768;

/// Most candidates around one collider that the grid visits: the same bound.
pub const CELL_LOOP_LIMIT: u32 = 50_000;

/// How large the grid's cell table is for `colliders` colliders: log2 of at least two cells each.
pub fn cell_table_bits(colliders: u32) -> u32 {
    (colliders.max(1) * 2).next_power_of_two().trailing_zeros().clamp(6, 24)
}

/// How many colliders may be left out of the grid because they are larger than a cell.
pub fn large_limit(colliders: u32) -> u32 {
    8 + (colliders / 1024).min(56)
}

/// Room in the pair list at first.
pub fn initial_pairs(capacities: &Capacities, colliders: u32) -> u32 {
    capacities.pairs.unwrap_or_else(|| colliders.saturating_mul(8).max(1024))
}

/// Room to make when `needed` elements did not fit: a quarter more, so that a growing scene does not grow its buffers
/// in every step.
pub fn grown(needed: u64) -> u64 {
    (needed + needed / 4).next_multiple_of(1024)
}

/// Rounds of placing that run over all new constraints at once; later ones run in one workgroup over what is left.
pub const WIDE_ROUNDS: u32 = 8;

/// How many rounds that one workgroup may add for `left` constraints within its loops' bound.
pub fn tail_rounds(left: u32) -> u32 {
    (BATCH_ROUNDS - WIDE_ROUNDS).min(24_000 / left.div_ceil(256).max(1))
}

/// Bytes of the widest array that follows the number of pairs.
pub const BYTES_A_PAIR: u64 = 192;
