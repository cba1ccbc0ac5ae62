//! Impulses go back to the slots that outlive the step. Twin of `shaders/solver/store.wgsl`.

use crate::contact::NO_FEATURE;
use tumble_core::layout::{Impulse, Manifold, ManifoldMemory};

/// What the slot remembers of one point.
pub fn store(manifold: &Manifold, point: usize, normal: f32, tangent: [f32; 2]) -> Impulse {
    if point < manifold.count as usize {
        Impulse { normal, tangent, feature: manifold.features[point] }
    } else {
        Impulse { normal: 0.0, tangent: [0.0; 2], feature: NO_FEATURE }
    }
}

/// What the slot remembers of the manifold as a whole.
pub fn store_memory(manifold: &Manifold, remembered: f32) -> ManifoldMemory {
    ManifoldMemory { remembered: remembered * manifold.count as f32, ..ManifoldMemory::default() }
}
