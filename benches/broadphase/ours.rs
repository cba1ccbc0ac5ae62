//! Our broad phases on the CPU, as a world runs them.

use crate::{Sample, Watch};
use tumble_core::layout::{Aabb, StepParams, tree_members};
use tumble_core::wear::Wear;
use tumble_core::{MortonBits, Traversal, limits};
use tumble_cpu::broadphase::{Boxes, brute_force, grid, lbvh};

const MOST: u32 = 1 << 30;

pub(crate) fn brute_force(aabbs: &[Aabb]) -> Sample {
    let mut watch = Watch::new();
    let boxes = Boxes::new(aabbs);
    watch.lap();
    let found = brute_force::find_pairs(&boxes, MOST);
    watch.lap();
    watch.sample(found.count, 0)
}

/// `tree`: an eighth of the colliders may be larger than a cell and go into a tree; else a few, all tested against.
pub(crate) fn grid(aabbs: &[Aabb], step: &StepParams, sliced: bool, tree: bool) -> Sample {
    let step = StepParams { large_limit: limits::large_limit(step.collider_count, tree), ..*step };
    let mut watch = Watch::new();
    let boxes = Boxes::new(aabbs);
    let mut grid = grid::choose(&boxes, &step);
    if sliced {
        grid = grid::slice(&grid, &boxes, &step);
    }
    let cells = grid::fill(&grid, &boxes, &step);
    watch.lap();
    let large = if tree { grid::Large::Tree(Traversal::Escape) } else { grid::Large::List };
    let found = grid::find_pairs(&grid, &cells, &boxes, large, MOST);
    watch.lap();
    watch.sample(found.count, cells.bytes())
}

/// Trees of what moves and of what is fixed, kept from step to step.
pub(crate) struct Lbvh {
    moving: lbvh::Tree,
    fixed: lbvh::Tree,
    traversal: Traversal,
    wear: Wear,
    step: u32,
}

impl Lbvh {
    pub(crate) fn build(aabbs: &[Aabb], bits: MortonBits, traversal: Traversal) -> (Self, Sample) {
        let mut watch = Watch::new();
        let boxes = Boxes::new(aabbs);
        let [moving, fixed] =
            [tree_members::MOVING, tree_members::FIXED].map(|members| lbvh::Tree::new(&boxes, bits, members));
        let mut lbvh = Self { moving, fixed, traversal, wear: Wear::default(), step: 1 };
        if traversal == Traversal::History {
            lbvh.moving.link_parents();
            lbvh.fixed.link_parents();
        }
        watch.lap();
        let (sample, _) = lbvh.walk(watch, &boxes);
        (lbvh, sample)
    }

    /// Refits, or builds anew where that is due, and walks. The fixed tree stays. Returns the walk's turns too.
    pub(crate) fn refit(&mut self, aabbs: &[Aabb], rebuild: bool) -> (Sample, u32) {
        let mut watch = Watch::new();
        let boxes = Boxes::new(aabbs);
        self.step += 1;
        if rebuild || self.wear.is_due(self.step - 1, self.moving.count()) {
            self.moving = lbvh::Tree::new(&boxes, MortonBits::Bits30, tree_members::MOVING);
            self.wear.built(self.step);
        } else {
            self.moving.refit(&boxes);
        }
        watch.lap();
        let (sample, turns) = self.walk(watch, &boxes);
        self.wear.walked(self.step, turns);
        (sample, turns)
    }

    fn walk(&self, mut watch: Watch, boxes: &Boxes) -> (Sample, u32) {
        let found = lbvh::find_pairs(&self.moving, &self.fixed, boxes, self.traversal, MOST);
        watch.lap();
        (watch.sample(found.count, self.moving.bytes() + self.fixed.bytes()), found.turns)
    }
}
