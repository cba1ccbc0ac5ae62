//! Impulses go back to the slots that outlive the step. Twin of `shaders/solver/store.wgsl`.

use crate::contact::NO_FEATURE;
use tumble_core::layout::{ConstraintHead, Impulse};

/// Writes the impulses of one constraint to its slot.
pub fn store(head: &ConstraintHead, impulses: &[Impulse], slot: &mut [Impulse]) {
    for i in 0..4 {
        slot[i] = if i < head.count as usize {
            impulses[i]
        } else {
            Impulse { normal: 0.0, tangent: [0.0; 2], feature: NO_FEATURE }
        };
    }
}
