//! A walk through a tree from near to far. Twin of `nearest_first` in `shaders/query/closest.wgsl`.

use crate::broadphase::lbvh::Tree;
use tumble_core::layout::{NO_NODE, TreeNode, root_of};
use tumble_core::limits::TURN_LIMIT;

/// Nodes kept for later, and one more; where there is no room for one, its subtree is walked by escapes at once.
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
    if root == NO_NODE {
        return 0;
    }
    let (mut later, mut depth) = ([(0u32, 0f32); STACK], 0);
    let (mut next, mut own, mut turns) = (root, key(root), 0);
    // While a subtree is walked by escapes: where that ends. The node to go on from is then on top of the stack.
    let mut end = None;
    while turns <= TURN_LIMIT {
        turns += 1;
        let node = &nodes[next as usize];
        let is_leaf = next % 2 == 0;
        // The best may have come down since the node was kept.
        let enters = own <= best;
        if enters && is_leaf {
            offer(node.child, own, &mut best);
        }
        if end.is_some() {
            next = if enters && !is_leaf { node.child } else { node.escape };
            if Some(next) != end {
                own = key(next);
                continue;
            }
            end = None;
        } else if enters && !is_leaf {
            let left = node.child;
            let right = nodes[left as usize].escape;
            let (mut near, mut far) = ((left, key(left)), (right, key(right)));
            if far.1 < near.1 {
                (near, far) = (far, near);
            }
            if far.1 <= best && depth == STACK - 1 {
                // The last place is the nearer child's.
                later[depth] = near;
                depth += 1;
                end = Some(nodes[far.0 as usize].escape);
                (next, own) = far;
                continue;
            }
            if far.1 <= best {
                later[depth] = far;
                depth += 1;
            }
            if near.1 <= best {
                (next, own) = near;
                continue;
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
