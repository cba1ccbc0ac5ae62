//! Stage `island`: which moving bodies hang together by contacts and joints. Twin of `shaders/island.wgsl`.
//!
//! An island is a connected component of bodies that move over contacts with points and over joints, broken or not; those
//! with what does not move join nothing. Its label is the lowest slot of its bodies. Here by union-find, each root the lowest of its set, one
//! contact after the other; the shader does the same with all at once. Labels are minima, so that both agree.

use crate::batch::{Ends, NO_BODY};
use crate::bounds::moves;
use tumble_core::layout::{BodyState, Manifold};

/// Label of a body that belongs to no island, since it does not move.
pub const NO_ISLAND: u32 = u32::MAX;

/// The label of each body's island. `manifolds` and `ends` are those of the step's pairs, `joined` is
/// [`Topology::joined`](tumble_core::Topology::joined).
pub fn label(states: &[BodyState], manifolds: &[Manifold], ends: &[Ends], joined: &[[u32; 2]]) -> Vec<u32> {
    let own = |(slot, state): (usize, &BodyState)| if moves(state.flags) { slot as u32 } else { NO_ISLAND };
    let mut labels: Vec<u32> = states.iter().enumerate().map(own).collect();
    let touching =
        ends.iter().zip(manifolds).filter(|(_, manifold)| manifold.count > 0).map(|(ends, _)| [ends.a, ends.b]);
    let touching = touching.filter(|&[a, b]| a != NO_BODY && b != NO_BODY);
    let moving = |body: &u32| moves(states[*body as usize].flags);
    let joined = joined.iter().copied().filter(|pair| pair.iter().all(moving));
    for [a, b] in touching.chain(joined) {
        let (a, b) = (root(&mut labels, a), root(&mut labels, b));
        labels[a.max(b) as usize] = a.min(b);
    }
    // A label is never above its body's slot, so those below are final when it is looked up.
    for slot in 0..labels.len() {
        if labels[slot] != NO_ISLAND {
            labels[slot] = labels[labels[slot] as usize];
        }
    }
    labels
}

/// The lowest body known to hang together with this one. Halves the way there.
fn root(labels: &mut [u32], slot: u32) -> u32 {
    let mut at = slot;
    while labels[at as usize] != at {
        let above = labels[labels[at as usize] as usize];
        labels[at as usize] = above;
        at = above;
    }
    at
}

/// Number of islands.
pub fn count(labels: &[u32]) -> u32 {
    labels.iter().enumerate().map(|(slot, &label)| u32::from(label == slot as u32)).sum()
}
