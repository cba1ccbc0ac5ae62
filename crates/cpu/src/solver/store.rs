//! Impulses go back to the slots that outlive the step. Twin of `shaders/solver/store.wgsl`.

use crate::contact::NO_FEATURE;
use tumble_core::layout::{Impulse, Manifold, ManifoldMemory};

/// What the solver leaves of a constraint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solved {
    /// Normal and tangential impulse of the last sub-step, by point; of points not in use too.
    pub impulses: [(f32, [f32; 2]); 4],
    /// Sums over the sub-steps.
    pub totals: [[f32; 3]; 4],
    /// What the points bear in the long run, on the mean.
    pub remembered: f32,
    /// Angular impulse against twisting and rolling.
    pub resisted: [f32; 3],
    /// What each point bears more.
    pub deviations: [f32; 4],
}

/// What the slot remembers of one point.
pub fn store(manifold: &Manifold, point: usize, solved: &Solved) -> Impulse {
    if point < manifold.count as usize {
        let (normal, tangent) = solved.impulses[point];
        Impulse { normal, tangent, feature: manifold.features[point] }
    } else {
        Impulse { normal: 0.0, tangent: [0.0; 2], feature: NO_FEATURE }
    }
}

/// What the slot remembers of the manifold as a whole.
pub fn store_memory(manifold: &Manifold, solved: &Solved) -> ManifoldMemory {
    let used = |point: usize| point < manifold.count as usize;
    ManifoldMemory {
        remembered: solved.remembered * manifold.count as f32,
        resisted: solved.resisted,
        deviations: std::array::from_fn(|point| if used(point) { solved.deviations[point] } else { 0.0 }),
        totals: std::array::from_fn(|point| if used(point) { solved.totals[point] } else { [0.0; 3] }),
    }
}
