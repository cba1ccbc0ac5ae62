//! Stage `contact`: keeps what outlives a step. Twin of `shaders/contact.wgsl`.
//!
//! A pair that stays keeps its slot, with impulses and batch; a new one takes the slot of a pair that went, else one
//! from the free list. All by rank in sorted lists, so that every run hands out the same slots. A pair stays when it
//! is in both lists and neither collider was inserted in this step (else its slot number is someone else's). Pairs that
//! joints keep from colliding are on the list like others, so that all broad phases find the same, but of no kind.

use tumble_core::layout::{Collider, Impulse, Manifold, NO_SLOT, Pair, UNBATCHED, pair_kind, shape_kind};

/// Feature of an impulse that belongs to no point.
pub const NO_FEATURE: u32 = u32::MAX;

/// The impulse of no point.
pub const NO_IMPULSE: Impulse = Impulse { normal: 0.0, tangent: [0.0; 2], feature: NO_FEATURE };

/// What `match_pairs` decides; nothing of it lasts before `commit`.
#[derive(Debug, Default)]
pub struct Matched {
    /// This step's pairs with their slots.
    pub pairs: Vec<Pair>,
    /// Pairs that were not in the last list.
    pub new_count: u32,
    /// Slots of pairs that are gone, in the order of the last list.
    pub dead_slots: Vec<u32>,
}

/// Which pass treats a pair of these shapes.
pub fn kind_of(a: u32, b: u32) -> u32 {
    use shape_kind::{BALL, CUBOID, HALFSPACE};
    let (low, high) = (a.min(b), a.max(b));
    match (low, high) {
        (BALL, BALL) => pair_kind::BALL_BALL,
        (BALL, CUBOID) => pair_kind::BALL_CUBOID,
        (CUBOID, CUBOID) => pair_kind::CUBOID_CUBOID,
        (BALL, HALFSPACE) => pair_kind::BALL_HALFSPACE,
        (CUBOID, HALFSPACE) => pair_kind::CUBOID_HALFSPACE,
        _ => pair_kind::NONE,
    }
}

/// Whether joints keep two bodies from colliding; `apart` is [`Topology::apart`](tumble_core::Topology::apart).
fn are_apart(apart: &[[u32; 2]], a: u32, b: u32) -> bool {
    !apart.is_empty() && apart.binary_search(&[a.min(b), a.max(b)]).is_ok()
}

/// Gives each pair of this step a slot, and a kind; that of bodies which do not collide is none. `old` and `found` are
/// sorted by (a, b); `free` is a stack.
pub fn match_pairs(
    old: &[Pair],
    found: &[[u32; 2]],
    colliders: &[Collider],
    apart: &[[u32; 2]],
    free: &[u32],
    step: u32,
) -> Matched {
    let newborn = |a: u32, b: u32| colliders[a as usize].born == step || colliders[b as usize].born == step;
    let mut pairs = Vec::with_capacity(found.len());
    let mut dead_slots = Vec::new();
    let mut fresh = Vec::new();
    let mut next_old = 0;
    for &[a, b] in found {
        while next_old < old.len() && (old[next_old].a, old[next_old].b) < (a, b) {
            dead_slots.push(old[next_old].slot);
            next_old += 1;
        }
        let (one, other) = (&colliders[a as usize], &colliders[b as usize]);
        let kind = match are_apart(apart, one.body, other.body) {
            true => pair_kind::NONE,
            false => kind_of(one.shape, other.shape),
        };
        let listed = next_old < old.len() && (old[next_old].a, old[next_old].b) == (a, b);
        if listed && !newborn(a, b) {
            pairs.push(Pair { a, b, slot: old[next_old].slot, kind });
            next_old += 1;
        } else {
            if listed {
                dead_slots.push(old[next_old].slot);
                next_old += 1;
            }
            fresh.push(pairs.len());
            pairs.push(Pair { a, b, slot: NO_SLOT, kind: kind | pair_kind::FRESH });
        }
    }
    dead_slots.extend(old[next_old..].iter().map(|p| p.slot));
    for (rank, &at) in fresh.iter().enumerate() {
        pairs[at].slot =
            if rank < dead_slots.len() { dead_slots[rank] } else { free[free.len() - 1 - (rank - dead_slots.len())] };
    }
    Matched { pairs, new_count: fresh.len() as u32, dead_slots }
}

/// The free list after the step: slots of dead pairs that no new pair took are pushed, others were popped.
pub fn commit_free(free: &mut Vec<u32>, matched: &Matched) {
    let taken = matched.new_count as usize;
    let dead = matched.dead_slots.len();
    free.truncate(free.len() - taken.saturating_sub(dead));
    free.extend_from_slice(&matched.dead_slots[taken.min(dead)..]);
}

/// What the store remembers of a pair: its batch, and no impulses when it does not touch.
pub fn commit_pair(manifold: &Manifold, batch: u32, batch_of_slot: &mut u32, impulses: &mut [Impulse]) {
    if manifold.count == 0 {
        *batch_of_slot = UNBATCHED;
        for impulse in impulses {
            *impulse = NO_IMPULSE;
        }
    } else {
        *batch_of_slot = batch;
    }
}
