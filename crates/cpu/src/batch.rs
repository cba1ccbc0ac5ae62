//! Stage `batch`: colours the graph of constraints, so that no two constraints of a batch share a moving body.
//! Twin of `shaders/batch.wgsl`.
//!
//! Harada, "Parallelizing the Physics Pipeline" (GDC 2009): each constraint without a batch writes itself to its
//! bodies; one that reads itself on both keeps the batch. There the last writer wins; here the lowest hashed index
//! does (an atomic minimum), so that the result depends on the constraints alone. By write-and-verify, the talk's own
//! law, a winner joins the batch that is being filled, a few rounds a batch; else it takes the lowest batch that
//! neither body is in, and every round places at least one. Persistent constraints keep their batch while they touch;
//! fixed, kinematic and frozen bodies never conflict. What the rounds leave goes to the last batch, solved in sequence.
//!
//! Contacts with what does not move can be had last: they then take the highest free batch instead of the lowest. So
//! neither side has to know how many batches the other takes, and batches that nobody is in are left out of the order.

use tumble_core::layout::{BATCHES, BodyState, LAST_BATCH, Manifold, Pair, StepParams, UNBATCHED, batching};

use crate::bounds::moves;
use std::borrow::Cow;
use tumble_core::limits::{TRIES, VERIFY_ROUNDS, tail_rounds, wide_rounds};

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
    /// Batch of each pair, some of 64 numbers; [`UNBATCHED`] when it does not touch.
    pub of_pair: Vec<u32>,
    /// Pair of each constraint, batch by batch; within one those with most points first, then in pair order.
    pub order: Vec<u32>,
    /// First constraint of each batch, and the end. Here batches that nobody is in come behind the others, but before
    /// the last one.
    pub start: Vec<u32>,
    /// Batches that each body is in.
    pub masks: Vec<u64>,
    /// Rounds that placing took.
    pub rounds: u32,
    /// Batches in use, the last one excluded.
    pub batch_count: u32,
    /// Most constraints on one body.
    pub max_degree: u32,
}

/// Some of the constraints of a step, batch by batch, as in [`Batches`].
pub struct Ordered<'a> {
    /// Pair of each constraint.
    pub order: Cow<'a, [u32]>,
    /// First constraint of each batch, and the end.
    pub start: Cow<'a, [u32]>,
}

impl Batches {
    /// Those whose pair `is_one`, in the same order.
    pub fn of_level(&self, is_one: impl Fn(u32) -> bool) -> Ordered<'static> {
        let mut order = Vec::new();
        let mut start = vec![0];
        for bounds in self.start.windows(2) {
            let batch = &self.order[bounds[0] as usize..bounds[1] as usize];
            order.extend(batch.iter().copied().filter(|&pair| is_one(pair)));
            start.push(order.len() as u32);
        }
        Ordered { order: order.into(), start: start.into() }
    }
}

/// A bijection of 26 bits: equal inputs alone collide.
pub fn hash26(x: u32) -> u32 {
    const MASK: u32 = (1 << 26) - 1;
    let mut h = x.wrapping_mul(0x9e37_79b1) & MASK;
    h ^= h >> 13;
    h = h.wrapping_mul(0x85eb_ca6b) & MASK;
    h ^ h >> 13
}

/// Claim of a constraint in a round below 63: later rounds undercut earlier ones, so that claims need no clearing.
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
    let (mut rounds, wide) = (0, wide_rounds(step.batching));
    let mut allowed = step.batch_rounds;
    while !unplaced.is_empty() && rounds < allowed {
        if rounds == wide {
            allowed = wide + tail_rounds(step.batching, unplaced.len() as u32);
        }
        let turn = claim_round(step.batching, rounds);
        if turn == 0 && rounds > 0 {
            claims.fill(u32::MAX);
        }
        for &i in &unplaced {
            match wanted(&masks, ends[i as usize], rounds, step.batching) {
                // Masks only fill: one that finds none free never will, and must not stand in its neighbours' way.
                LAST_BATCH => of_pair[i as usize] = LAST_BATCH,
                UNBATCHED => {}
                _ => bid(&mut claims, ends[i as usize], claim(i, turn)),
            }
        }
        unplaced.retain(|&i| {
            if of_pair[i as usize] == LAST_BATCH {
                join(&mut masks, ends[i as usize], LAST_BATCH);
                return false;
            }
            let won = holds(&claims, ends[i as usize], claim(i, turn));
            if won {
                let batch = wanted(&masks, ends[i as usize], rounds, step.batching);
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
    let (order, start, batch_count) = sort_by_batch(&of_pair, manifolds);
    let max_degree = masks.iter().map(|m| m.count_ones()).max().unwrap_or(0);
    Batches { of_pair, order, start, masks, rounds, batch_count, max_degree }
}

/// What these batches are good for, see [`Control::colored_as`](tumble_core::layout::Control::colored_as).
pub fn colored_as(batches: &Batches, batching: u32) -> u32 {
    let persistent = batching & batching::LAW == batching::PERSISTENT;
    if persistent && !wasteful(batches, batching) { batching } else { 0 }
}

/// Whether bodies lost so many constraints that batches stand half empty: the next step colours anew. Colouring
/// anew gives fewer than twice the highest degree, and no more than that degree for the contacts that come last, so
/// this never repeats for nothing.
pub fn wasteful(batches: &Batches, batching: u32) -> bool {
    let share = if batching & batching::STATIC_LAST == 0 { 2 } else { 3 };
    batches.batch_count > share * batches.max_degree
}

/// Number of the round among those that share claims.
fn claim_round(batching: u32, round: u32) -> u32 {
    if batching & batching::LAW == batching::WRITE_AND_VERIFY { round % VERIFY_ROUNDS } else { round }
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

/// The batch that a constraint may join in this round: [`UNBATCHED`] when there is none in this one, [`LAST_BATCH`]
/// when there will be none.
fn wanted(masks: &[u64], ends: Ends, round: u32, batching: u32) -> u32 {
    let taken =
        [ends.a, ends.b].iter().filter(|&&body| body != NO_BODY).fold(0, |all, &body| all | masks[body as usize]);
    let from_above = batching & batching::STATIC_LAST != 0 && (ends.a == NO_BODY || ends.b == NO_BODY);
    if batching & batching::LAW == batching::WRITE_AND_VERIFY {
        let filling = round / TRIES;
        let batch = if from_above { LAST_BATCH - 1 - filling } else { filling };
        return if taken >> batch & 1 == 0 { batch } else { UNBATCHED };
    }
    let free = !taken & !(1 << LAST_BATCH);
    match (free, from_above) {
        (0, _) => LAST_BATCH,
        (_, true) => free.ilog2(),
        (_, false) => free.trailing_zeros(),
    }
}

/// What constraints are sorted by: those of one batch by their points, so that those solved side by side have as many; but
/// the last batch, which is solved in sequence, not.
fn sort_key(batch: u32, points: u32) -> usize {
    (4 * batch + if batch == LAST_BATCH { 0 } else { 4 - points }) as usize
}

/// Stable counting sort of the touching pairs: their order, the starts of batches, how many are in use.
fn sort_by_batch(of_pair: &[u32], manifolds: &[Manifold]) -> (Vec<u32>, Vec<u32>, u32) {
    let mut cursor = vec![0u32; 4 * BATCHES as usize + 1];
    let keys = || {
        let touching = of_pair.iter().zip(manifolds).enumerate().filter(|(_, (batch, _))| **batch != UNBATCHED);
        touching.map(|(i, (&batch, manifold))| (i, sort_key(batch, manifold.count)))
    };
    keys().for_each(|(_, key)| cursor[key] += 1);
    let total = crate::primitives::exclusive_scan(&mut cursor);
    let mut start: Vec<u32> = cursor.iter().step_by(4).copied().collect();
    let mut order = vec![0u32; total as usize];
    for (i, key) in keys() {
        order[cursor[key] as usize] = i as u32;
        cursor[key] += 1;
    }
    // Those that nobody is in go to the end.
    let mut used = 0;
    for batch in 0..LAST_BATCH as usize {
        if start[batch] < start[batch + 1] {
            start[used] = start[batch];
            used += 1;
        }
    }
    let last_start = start[LAST_BATCH as usize];
    start[used..LAST_BATCH as usize].fill(last_start);
    (order, start, used as u32)
}
