// The graph of constraints and the batches that bodies are in: what a round of stage `batch` does to them.
// Twin of crates/cpu/src/batch.rs.
//
// Passes hand over `batching`, of the step. Reads next_pairs and, for which body a collider is on and whether that
// moves, the boxes in aabbs; reads and writes pair_batch (a batch a pair), masks (a bit a batch, two words a body) and
// claims (one a body).

//#import shared/collider.wgsl
//#import shared/control.wgsl
//#import shared/pair.wgsl
//#import shared/step.wgsl

const TRIES: u32 = 3u; // rounds in which write-and-verify fills one batch; crates/core/src/limits.rs
const VERIFY_ROUNDS: u32 = 60u; // and all its rounds that share claims
const NO_BODY: u32 = 0xffffffffu; // in place of a body that never conflicts

// The moving bodies of a pair.
struct Ends {
    a: u32,
    b: u32,
}

@group(0) @binding(0) var<storage, read> next_pairs: array<Pair>;
@group(0) @binding(1) var<storage, read> aabbs: array<Aabb>;
@group(0) @binding(2) var<storage, read_write> pair_batch: array<u32>;
@group(0) @binding(3) var<storage, read_write> masks: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> claims: array<atomic<u32>>;

// A bijection of 26 bits: equal inputs alone collide.
fn hash26(x: u32) -> u32 {
    let mask = (1u << 26u) - 1u;
    var h = (x * 0x9e3779b1u) & mask;
    h = h ^ (h >> 13u);
    h = (h * 0x85ebca6bu) & mask;
    return h ^ (h >> 13u);
}

fn verifies(batching: u32) -> bool {
    return (batching & BATCHING_LAW) == BATCHING_WRITE_AND_VERIFY;
}

// Claim of a constraint in a round: later rounds undercut earlier ones, so that claims need no clearing but once
// in write-and-verify, which has more rounds.
fn claim(pair: u32, round_index: u32, batching: u32) -> u32 {
    let turn = select(round_index, round_index % VERIFY_ROUNDS, verifies(batching));
    return ((63u - turn) << 26u) | hash26(pair);
}

fn end_of(collider: u32) -> u32 {
    let body = aabbs[collider].body;
    return select(NO_BODY, body & AABB_INDEX, (body & AABB_DYNAMIC) != 0u);
}

fn ends(pair: u32) -> Ends {
    return Ends(end_of(next_pairs[pair].a), end_of(next_pairs[pair].b));
}

fn join_one(body: u32, batch: u32) {
    if body != NO_BODY {
        atomicOr(&masks[2u * body + batch / 32u], 1u << (batch % 32u));
    }
}

fn join(at: Ends, batch: u32) {
    join_one(at.a, batch);
    join_one(at.b, batch);
}

fn taken(at: Ends, word: u32) -> u32 {
    var bits = 0u;
    if at.a != NO_BODY {
        bits |= atomicLoad(&masks[2u * at.a + word]);
    }
    if at.b != NO_BODY {
        bits |= atomicLoad(&masks[2u * at.b + word]);
    }
    return bits;
}

// The batch that a constraint may join in this round: UNBATCHED when there is none in this one, LAST_BATCH when there
// will be none.
fn wanted(at: Ends, round_index: u32, batching: u32) -> u32 {
    let from_above = (batching & BATCHING_STATIC_LAST) != 0u && (at.a == NO_BODY || at.b == NO_BODY);
    if verifies(batching) {
        let filling = round_index / TRIES;
        let batch = select(filling, LAST_BATCH - 1u - filling, from_above);
        let is_free = ((taken(at, batch / 32u) >> (batch % 32u)) & 1u) == 0u;
        return select(UNBATCHED, batch, is_free);
    }
    let low = ~taken(at, 0u);
    let high = ~taken(at, 1u) & 0x7fffffffu;
    if from_above && high != 0u {
        return 32u + firstLeadingBit(high);
    }
    if low != 0u {
        return select(firstTrailingBit(low), firstLeadingBit(low), from_above);
    }
    return select(LAST_BATCH, 32u + firstTrailingBit(high), high != 0u);
}

fn holds(at: Ends, bidden: u32) -> bool {
    if at.a != NO_BODY && atomicLoad(&claims[at.a]) != bidden {
        return false;
    }
    return at.b == NO_BODY || atomicLoad(&claims[at.b]) == bidden;
}

// Masks only fill: one that finds none free never will, and must not stand in its neighbours' way.
fn bid_for(pair: u32, round_index: u32, batching: u32) {
    let at = ends(pair);
    let batch = wanted(at, round_index, batching);
    if batch == UNBATCHED {
        return;
    }
    if batch == LAST_BATCH {
        pair_batch[pair] = LAST_BATCH;
        join(at, LAST_BATCH);
        return;
    }
    let bidden = claim(pair, round_index, batching);
    if at.a != NO_BODY {
        atomicMin(&claims[at.a], bidden);
    }
    if at.b != NO_BODY {
        atomicMin(&claims[at.b], bidden);
    }
}

// Winners of one round share no moving body, so that each alone reads and fills the masks of its own.
fn place_if_held(pair: u32, round_index: u32, batching: u32) -> bool {
    let at = ends(pair);
    if !holds(at, claim(pair, round_index, batching)) {
        return false;
    }
    let batch = wanted(at, round_index, batching);
    pair_batch[pair] = batch;
    join(at, batch);
    return true;
}
