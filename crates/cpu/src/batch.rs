//! Stage `batch`: colours the graph of constraints, so that no two constraints of a batch share a moving body.
//! Twin of `shaders/batch.wgsl`.
//!
//! Harada, "Parallelizing the Physics Pipeline" (GDC 2009): each constraint without a batch writes itself to its
//! bodies; one that reads itself on both keeps the batch. There the last writer wins; here the lowest hashed index
//! does (an atomic minimum), so that the result depends on the constraints alone and every round places at least one. A
//! winner takes the lowest batch that neither body is in. Constraints keep their batch while they touch; fixed,
//! kinematic and frozen bodies never conflict. What the rounds leave goes to the last batch, solved in sequence.

use tumble_core::layout::{BATCHES, BodyState, LAST_BATCH, Manifold, Pair, StepParams, UNBATCHED};

use crate::bounds::moves;
use tumble_core::limits::{WIDE_ROUNDS, tail_rounds};

/// What one constraint needs to be placed. `NO_BODY` where nothing moves.
#[derive(Debug, Clone, Copy)]
pub struct Ends {
    /// Body of the first collider.
    pub a: u32,
    /// Body of the second.
    pub b: u32,
}

/// In place of a body that never conflicts.
pub const NO_BODY: u32 = u32::MAX;

/// How this step's constraints are batched.
#[derive(Debug, Default)]
pub struct Batches {
    /// Batch of each pair; [`UNBATCHED`] when it does not touch.
    pub of_pair: Vec<u32>,
    /// Pair of each constraint, batch by batch, in pair order within one.
    pub order: Vec<u32>,
    /// First constraint of each batch, and the end.
    pub start: Vec<u32>,
    /// Batches that each body is in.
    pub masks: Vec<u64>,
    /// Rounds that placing took.
    pub rounds: u32,
    /// One more than the highest batch in use, the last one excluded.
    pub batch_count: u32,
    /// Most constraints on one body.
    pub max_degree: u32,
}

/// A bijection of 26 bits: equal inputs alone collide.
pub fn hash26(x: u32) -> u32 {
    const MASK: u32 = (1 << 26) - 1;
    let mut h = x.wrapping_mul(0x9e37_79b1) & MASK;
    h ^= h >> 13;
    h = h.wrapping_mul(0x85eb_ca6b) & MASK;
    h ^ h >> 13
}

/// Claim of a constraint in a round: later rounds undercut earlier ones, so that claims need no clearing.
pub fn claim(pair: u32, round: u32) -> u32 {
    (63 - round) << 26 | hash26(pair)
}

/// The moving bodies of a pair.
pub fn ends(pair: &Pair, body_of: &impl Fn(u32) -> u32, states: &[BodyState]) -> Ends {
    let end = |collider: u32| {
        let body = body_of(collider);
        if moves(states[body as usize].flags) { body } else { NO_BODY }
    };
    Ends { a: end(pair.a), b: end(pair.b) }
}

/// Places every touching pair. `kept[slot]` is the batch of the last step; `recolor` forgets them all.
pub fn place(
    pairs: &[Pair],
    manifolds: &[Manifold],
    ends: &[Ends],
    kept: &[u32],
    recolor: bool,
    body_count: usize,
    step: &StepParams,
) -> Batches {
    let mut masks = vec![0u64; body_count];
    let mut of_pair = vec![UNBATCHED; pairs.len()];
    let mut unplaced = Vec::new();
    for (i, pair) in pairs.iter().enumerate() {
        if manifolds[i].count == 0 {
            continue;
        }
        let fresh = pair.kind & tumble_core::layout::pair_kind::FRESH != 0;
        let batch = if fresh || recolor { UNBATCHED } else { kept[pair.slot as usize] };
        if batch < LAST_BATCH {
            of_pair[i] = batch;
            join(&mut masks, ends[i], batch);
        } else {
            unplaced.push(i as u32);
        }
    }
    let mut claims = vec![u32::MAX; body_count];
    let mut rounds = 0;
    let mut allowed = step.batch_rounds;
    while !unplaced.is_empty() && rounds < allowed {
        if rounds == WIDE_ROUNDS {
            allowed = WIDE_ROUNDS + tail_rounds(unplaced.len() as u32);
        }
        for &i in &unplaced {
            // Masks only fill: one that finds none free never will, and must not stand in its neighbours' way.
            if lowest_free(&masks, ends[i as usize]) < LAST_BATCH {
                bid(&mut claims, ends[i as usize], claim(i, rounds));
            } else {
                of_pair[i as usize] = LAST_BATCH;
            }
        }
        unplaced.retain(|&i| {
            if of_pair[i as usize] == LAST_BATCH {
                join(&mut masks, ends[i as usize], LAST_BATCH);
                return false;
            }
            let won = holds(&claims, ends[i as usize], claim(i, rounds));
            if won {
                let batch = lowest_free(&masks, ends[i as usize]);
                of_pair[i as usize] = batch;
                join(&mut masks, ends[i as usize], batch);
            }
            !won
        });
        rounds += 1;
    }
    for &i in &unplaced {
        of_pair[i as usize] = LAST_BATCH;
        join(&mut masks, ends[i as usize], LAST_BATCH);
    }
    let (order, start) = sort_by_batch(&of_pair);
    let used = masks.iter().fold(0, |all, m| all | m) & !(1 << LAST_BATCH);
    let batch_count = (0..LAST_BATCH as usize).rev().find(|&b| start[b + 1] > start[b]).map_or(0, |b| b as u32 + 1);
    debug_assert!(used >> batch_count == 0);
    let max_degree = masks.iter().map(|m| m.count_ones()).max().unwrap_or(0);
    Batches { of_pair, order, start, masks, rounds, batch_count, max_degree }
}

/// Whether bodies lost so many constraints that batches stand half empty: the next step colours anew. Colouring
/// anew gives fewer than twice the highest degree, so this never repeats for nothing.
pub fn wasteful(batch_count: u32, max_degree: u32) -> bool {
    batch_count > 2 * max_degree
}

fn join(masks: &mut [u64], ends: Ends, batch: u32) {
    for body in [ends.a, ends.b] {
        if body != NO_BODY {
            masks[body as usize] |= 1 << batch;
        }
    }
}

fn bid(claims: &mut [u32], ends: Ends, claim: u32) {
    for body in [ends.a, ends.b] {
        if body != NO_BODY {
            claims[body as usize] = claims[body as usize].min(claim);
        }
    }
}

fn holds(claims: &[u32], ends: Ends, claim: u32) -> bool {
    [ends.a, ends.b].iter().all(|&body| body == NO_BODY || claims[body as usize] == claim)
}

fn lowest_free(masks: &[u64], ends: Ends) -> u32 {
    let taken =
        [ends.a, ends.b].iter().filter(|&&body| body != NO_BODY).fold(0, |all, &body| all | masks[body as usize]);
    (!taken).trailing_zeros()
}

/// Stable counting sort of the touching pairs by batch.
fn sort_by_batch(of_pair: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; BATCHES as usize + 1];
    for &batch in of_pair.iter().filter(|&&b| b != UNBATCHED) {
        start[batch as usize] += 1;
    }
    let total = crate::primitives::exclusive_scan(&mut start);
    let mut cursor = start.clone();
    let mut order = vec![0u32; total as usize];
    for (i, &batch) in of_pair.iter().enumerate().filter(|(_, b)| **b != UNBATCHED) {
        order[cursor[batch as usize] as usize] = i as u32;
        cursor[batch as usize] += 1;
    }
    (order, start)
}
