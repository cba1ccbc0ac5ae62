//! Walks of a tree, three ways, and the pairs that they find. Twin of `shaders/broadphase/lbvh/walk.wgsl`.
//!
//! A walk needs no stack: each node knows where it escapes to. That is the right child where its run ends at a split, as
//! in Prokopenko and Lebrun-Grandié, "Revising Apetrei's bounding volume hierarchy construction algorithm to allow
//! stackless traversal" (2024); and a leaf that begins at its own escape finds each pair once. Two other ways of walking
//! are here to compare: history flags (Harada, GDC 2009) and a short stack.

use super::Tree;
use crate::broadphase::{Boxes, Found, Query, Sink, collect, matter};
use tumble_core::Traversal;
use tumble_core::layout::{Aabb, NO_NODE, root_of};
use tumble_core::limits::TURN_LIMIT;

/// Nodes that a walk with a stack keeps; where there is no room for one, its subtree is walked by escapes.
const STACK: usize = 24;

impl Tree {
    /// Pairs of leaf `leaf` with those after it; returns the turns that it took.
    pub(in crate::broadphase) fn partners_after(
        &self,
        leaf: usize,
        boxes: &Boxes,
        traversal: Traversal,
        sink: &mut Sink,
    ) -> u32 {
        let i = self.members[leaf];
        let own = &boxes.aabbs[i as usize];
        let mut offer = |j: u32| {
            if matter(own.body, boxes.aabbs[j as usize].body) {
                sink.push(i, j);
            }
        };
        let first = self.nodes[2 * leaf].escape;
        if traversal == Traversal::Escape {
            return self.walk_by_escapes(first, NO_NODE, own, &mut offer);
        }
        // What hangs to the right of the way from the leaf to the root, from the leaf up.
        let (mut top, mut turns) = (first, 0);
        while top != NO_NODE && turns <= TURN_LIMIT {
            turns = self.walk(top, own, traversal, turns, &mut offer);
            top = self.nodes[top as usize].escape;
        }
        turns
    }

    /// Pairs of collider `i`, which is not in the tree, with all leaves; returns the turns that it took.
    pub(in crate::broadphase) fn partners_of(
        &self,
        boxes: &Boxes,
        i: u32,
        traversal: Traversal,
        sink: &mut Sink,
    ) -> u32 {
        let own = &boxes.aabbs[i as usize];
        let mut offer = |j: u32| {
            if matter(own.body, boxes.aabbs[j as usize].body) {
                sink.push(i, j);
            }
        };
        match (root_of(self.count()), traversal) {
            (NO_NODE, _) => 0,
            (root, Traversal::Escape) => self.walk_by_escapes(root, NO_NODE, own, &mut offer),
            (root, _) => self.walk(root, own, traversal, 0, &mut offer),
        }
    }

    /// Offers the colliders of all leaves whose boxes overlap `own`; returns the turns.
    pub(crate) fn overlapping(&self, own: &Aabb, offer: &mut impl FnMut(u32)) -> u32 {
        self.walk_by_escapes(root_of(self.count()), NO_NODE, own, offer)
    }

    /// Offers the colliders of all leaves below node `top` whose boxes overlap `own`; returns the turns, those `before`
    /// included.
    fn walk(&self, top: u32, own: &Aabb, traversal: Traversal, before: u32, offer: &mut impl FnMut(u32)) -> u32 {
        match traversal {
            Traversal::Stack => self.walk_with_stack(top, own, before, offer),
            _ => self.walk_by_history(top, own, before, offer),
        }
    }

    /// From node `top` until node `end` comes.
    fn walk_by_escapes(&self, top: u32, end: u32, own: &Aabb, offer: &mut impl FnMut(u32)) -> u32 {
        let query = Query::new(own);
        let (mut next, mut turns) = (top, 0);
        while next != end && turns <= TURN_LIMIT {
            turns += 1;
            let node = &self.nodes[next as usize];
            if !query.overlaps(node) {
                next = node.escape;
            } else if next % 2 == 0 {
                offer(node.child);
                next = node.escape;
            } else {
                next = node.child;
            }
        }
        turns
    }

    /// Bit k of `pending` tells that the right child at level k below `top` is still to be seen. One loop, as the shader
    /// must have it: a turn goes down to a child, or up to the parent or over to the sibling.
    fn walk_by_history(&self, top: u32, own: &Aabb, before: u32, offer: &mut impl FnMut(u32)) -> u32 {
        let (mut next, mut level, mut pending, mut turns) = (top, 0u32, 0u128, before + 1);
        let mut rising = false;
        let query = Query::new(own);
        if !self.enters(top, &query) {
            return turns;
        }
        while turns <= TURN_LIMIT {
            turns += 1;
            if !rising && next % 2 == 0 {
                offer(self.nodes[next as usize].child);
                rising = true;
            } else if !rising {
                let left = self.nodes[next as usize].child;
                let right = self.nodes[left as usize].escape;
                let (to_left, to_right) = (self.enters(left, &query), self.enters(right, &query));
                if to_left || to_right {
                    level += 1;
                    pending |= u128::from(to_left && to_right) << level;
                    next = if to_left { left } else { right };
                    continue;
                }
                rising = true;
            }
            if level == 0 {
                break;
            }
            if pending >> level & 1 == 1 {
                pending &= !(1 << level);
                next = self.nodes[next as usize].escape;
                rising = false;
            } else {
                level -= 1;
                next = self.parents[next as usize];
            }
        }
        turns
    }

    /// Where the stack is full, the subtree is walked by escapes, up to node `end`.
    fn walk_with_stack(&self, top: u32, own: &Aabb, before: u32, offer: &mut impl FnMut(u32)) -> u32 {
        let (mut next, mut stack, mut depth, mut turns) = (top, [0u32; STACK], 0, before + 1);
        let (mut escaping, mut end) = (false, NO_NODE);
        let query = Query::new(own);
        if !self.enters(top, &query) {
            return turns;
        }
        while turns <= TURN_LIMIT {
            turns += 1;
            let node = &self.nodes[next as usize];
            if escaping {
                let inside = query.overlaps(node);
                if inside && next % 2 == 0 {
                    offer(node.child);
                }
                next = if inside && next % 2 == 1 { node.child } else { node.escape };
                if next != end {
                    continue;
                }
                escaping = false;
            } else if next % 2 == 0 {
                offer(node.child);
            } else {
                let left = node.child;
                let right = self.nodes[left as usize].escape;
                let (to_left, to_right) = (self.enters(left, &query), self.enters(right, &query));
                if to_left && to_right && depth == STACK {
                    (escaping, end, next) = (true, node.escape, left);
                    continue;
                }
                if to_left && to_right {
                    stack[depth] = right;
                    depth += 1;
                }
                if to_left || to_right {
                    next = if to_left { left } else { right };
                    continue;
                }
            }
            if depth == 0 {
                break;
            }
            depth -= 1;
            next = stack[depth];
        }
        turns
    }

    #[inline]
    fn enters(&self, node: u32, query: &Query) -> bool {
        query.overlaps(&self.nodes[node as usize])
    }
}

/// All pairs, from a tree of what moves and one of what is fixed, both refitted; beyond `most` they are counted and not
/// kept. Trees walked by history need their parents.
pub fn find_pairs(moving: &Tree, fixed: &Tree, boxes: &Boxes, traversal: Traversal, most: u32) -> Found {
    collect(boxes, &boxes.unbounded, moving.members.len(), most, |range, sink| {
        for leaf in range {
            let i = moving.members[leaf];
            sink.with_list(boxes, &boxes.unbounded, i);
            let turns = moving.partners_after(leaf, boxes, traversal, sink);
            sink.took(turns);
            let turns = fixed.partners_of(boxes, i, traversal, sink);
            sink.took(turns);
        }
    })
}
