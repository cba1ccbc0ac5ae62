//! A walk through a tree from near to far. Twin of `nearest_first` in `shaders/query/closest.wgsl`.

use crate::broadphase::lbvh::Tree;
use tumble_core::layout::{TreeNode, root_of};
use tumble_core::limits::TURN_LIMIT;

/// Nodes kept for later; where there is no room for one, its subtree is walked by escapes at once.
const STACK: usize = 32;

/// Offers the colliders of all leaves whose key is no more than the best one, nearer children first. `key` of a node is
/// no more than those of what is below it, `None` where nothing below it is met; `offer` is given a collider, its leaf's
/// key and the best key, which it may lower. Returns the turns that it took.
pub(super) fn nearest_first(
    tree: &Tree,
    key: impl Fn(&TreeNode) -> Option<f32>,
    mut best: f32,
    mut offer: impl FnMut(u32, f32, &mut f32),
) -> u32 {
    let nodes = &tree.nodes[..];
    let key = |node: u32| key(&nodes[node as usize]).unwrap_or(f32::MAX);
    let root = root_of(tree.count());
    if tree.count() == 0 {
        return 0;
    }
    let (mut later, mut depth) = ([(0u32, 0f32); STACK], 0);
    let (mut next, mut own, mut turns) = (root, key(root), 0);
    while turns <= TURN_LIMIT {
        turns += 1;
        // The best may have come down since the node was kept.
        if own <= best {
            if next % 2 == 0 {
                offer(nodes[next as usize].child, own, &mut best);
            } else {
                let left = nodes[next as usize].child;
                let right = nodes[left as usize].escape;
                let (mut near, mut far) = ((left, key(left)), (right, key(right)));
                if far.1 < near.1 {
                    (near, far) = (far, near);
                }
                if far.1 <= best {
                    if depth == STACK {
                        turns = by_escapes(nodes, far.0, turns, &key, &mut best, &mut offer);
                    } else {
                        later[depth] = far;
                        depth += 1;
                    }
                }
                if near.1 <= best {
                    (next, own) = near;
                    continue;
                }
            }
        }
        if depth == 0 {
            break;
        }
        depth -= 1;
        (next, own) = later[depth];
    }
    turns
}

/// The same for the subtree of `top`, from left to right; returns the turns, those before added.
fn by_escapes(
    nodes: &[TreeNode],
    top: u32,
    before: u32,
    key: impl Fn(u32) -> f32,
    best: &mut f32,
    offer: &mut impl FnMut(u32, f32, &mut f32),
) -> u32 {
    let end = nodes[top as usize].escape;
    let (mut next, mut turns) = (top, before);
    while next != end && turns <= TURN_LIMIT {
        turns += 1;
        let own = key(next);
        let node = &nodes[next as usize];
        if own > *best {
            next = node.escape;
        } else if next % 2 == 0 {
            offer(node.child, own, best);
            next = node.escape;
        } else {
            next = node.child;
        }
    }
    turns
}
