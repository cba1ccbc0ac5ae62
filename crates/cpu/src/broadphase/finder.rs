//! Runs the broad phase that was asked for, and keeps what outlives a step: trees.

use super::{Boxes, Found, brute_force, grid, lbvh, sweep};
use glam::Vec3;
use tumble_core::edit::Stale;
use tumble_core::layout::{StepParams, tree_members};
use tumble_core::limits::STATUS_DELAY;
use tumble_core::wear::Wear;
use tumble_core::{Broadphase, MortonBits, Params, Traversal};

/// The broad phase of a world.
#[derive(Debug, Default)]
pub(crate) struct Finder {
    moving: lbvh::Tree,
    fixed: lbvh::Tree,
    wear: Wear,
    /// What the trees were made for, and the margins of the fixed one's boxes.
    made_for: Option<(MortonBits, Traversal, [u32; 2])>,
    bytes: u64,
    /// How far the middles of bounded colliders lay apart in the last step, m; below zero without any.
    extent: Vec3,
}

/// What it is to look for, and how.
pub(crate) struct Search<'a> {
    pub(crate) step: &'a StepParams,
    pub(crate) params: &'a Params,
    pub(crate) broadphase: Broadphase,
    pub(crate) stale: Stale,
}

impl Finder {
    /// All pairs, and the grid's class if there is one.
    pub(crate) fn find(&mut self, boxes: &Boxes, search: &Search) -> Found {
        let Search { step, params, broadphase, .. } = *search;
        let most = step.pair_capacity;
        self.extent = Vec3::from_array(boxes.high) - Vec3::from_array(boxes.low);
        if broadphase != Broadphase::Lbvh {
            // Trees that are not kept up to date hear of no edits.
            self.made_for = None;
        }
        match broadphase {
            Broadphase::BruteForce => {
                self.bytes = 0;
                brute_force::find_pairs(boxes, most)
            }
            Broadphase::Lbvh => {
                self.refresh(boxes, search);
                let found = lbvh::find_pairs(&self.moving, &self.fixed, boxes, params.traversal, most);
                self.wear.walked(step.step, found.turns);
                self.bytes = self.moving.bytes() + self.fixed.bytes();
                found
            }
            Broadphase::SweepAndPrune => {
                self.bytes = sweep::BYTES * boxes.aabbs.len() as u64;
                sweep::find_pairs(boxes, most)
            }
            kind => {
                let mut grid = grid::choose(boxes, step);
                if kind == Broadphase::SlicedGrid {
                    grid = grid::slice(&grid, boxes, step);
                }
                let cells = grid::fill(&grid, boxes, step);
                self.bytes = cells.bytes();
                let large = match cells.large.len() > LIST {
                    true => grid::Large::Tree(params.traversal),
                    false => grid::Large::List,
                };
                grid::find_pairs(&grid, &cells, boxes, large, most)
            }
        }
    }

    /// Bytes that it used in the last step.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// How far the middles of bounded colliders lay apart in the last step, m.
    pub(crate) fn extent(&self) -> Vec3 {
        self.extent
    }

    /// Brings the trees up to the step: new where they must be, refitted where they may.
    fn refresh(&mut self, boxes: &Boxes, search: &Search) {
        let Search { step, params, stale, .. } = *search;
        let margins = [step.dt, step.speculative_distance].map(f32::to_bits);
        let made_for = Some((params.morton_bits, params.traversal, margins));
        let other = self.made_for != made_for;
        self.made_for = made_for;
        let history = params.traversal == Traversal::History;
        let build = |members| {
            let mut tree = lbvh::Tree::new(boxes, params.morton_bits, members);
            if history {
                tree.link_parents();
            }
            tree
        };
        if other || stale.fixed {
            self.fixed = build(tree_members::FIXED);
        }
        let until = step.step.saturating_sub(STATUS_DELAY);
        if other || stale.moving || self.wear.is_due(until, self.moving.count()) {
            self.moving = build(tree_members::MOVING);
            self.wear.built(step.step);
        } else {
            self.moving.refit(boxes);
        }
    }
}

/// So many colliders outside the grid are tested against all; more get a tree.
const LIST: usize = 64;
