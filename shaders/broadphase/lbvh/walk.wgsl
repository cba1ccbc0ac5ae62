// Stage broadphase/lbvh, the walks: pairs from trees that are up to date. Twin of crates/cpu/src/broadphase/lbvh/walk.rs.
//
//   pairs_by_*, pairs_with_stack    one thread a leaf: its pairs with the leaves after it, and with large_list. Reads
//                                   nodes, leaf_count, aabbs; writes pair_keys.
//   across_by_*, across_with_stack  one thread a collider slot: pairs of a collider that is not in this tree with those
//                                   that are.
//
// Three ways of walking: by escapes; by history flags after Harada (GDC 2009); with a short stack a thread.

//#import shared/pairs.wgsl
//#import shared/thread.wgsl
//#import shared/tree.wgsl

const STACK: u32 = 24u;

@group(0) @binding(5) var<uniform> tree: TreeInfo;
@group(0) @binding(6) var<storage, read> nodes: array<TreeNode>;
@group(0) @binding(7) var<storage, read> parents_of: array<u32>;
@group(0) @binding(8) var<storage, read> leaf_count: array<u32>;

fn enters(node: u32, own: Aabb) -> bool {
    return !(any(own.min > nodes[node].max) || any(nodes[node].min > own.max));
}

// A pair of collider i with one whose leaf's box overlaps.
fn offer(i: u32, own: Aabb, j: u32) {
    if matter(own.body, aabbs[j].body) {
        keep_pair(i, j);
    }
}

// From node `top` until node `end` comes: pairs of collider i with the leaves whose boxes overlap. Returns its turns.
fn walk_by_escapes(top: u32, end: u32, i: u32, own: Aabb) -> u32 {
    var next = top;
    var turns = 0u;
    while next != end && turns <= TURN_LIMIT {
        turns += 1u;
        let node = nodes[next];
        if any(own.min > node.max) || any(node.min > own.max) {
            next = node.escape;
        } else if next % 2u == 0u {
            offer(i, own, node.child);
            next = node.escape;
        } else {
            next = node.child;
        }
    }
    return turns;
}

// The same below node `top`; returns the turns, those `before` included. Bit k of `pending` tells that the right child at
// level k below it is still to be seen. A turn goes down to a child, or up to the parent or over to the sibling: all in
// one loop, since llvmpipe counts a turn of a loop within it at every turn, entered or not, and ends both too early.
fn walk_by_history(top: u32, i: u32, own: Aabb, before: u32) -> u32 {
    var next = top;
    var depth = 0u;
    var pending = vec4<u32>(0u);
    var rising = false;
    var turns = before + 1u;
    if !enters(top, own) {
        return turns;
    }
    while turns <= TURN_LIMIT {
        turns += 1u;
        if !rising && next % 2u == 0u {
            offer(i, own, nodes[next].child);
            rising = true;
        } else if !rising {
            let left = nodes[next].child;
            let right = nodes[left].escape;
            let to_left = enters(left, own);
            let to_right = enters(right, own);
            if to_left || to_right {
                depth += 1u;
                if to_left && to_right {
                    pending[depth / 32u] |= 1u << (depth % 32u);
                }
                next = select(right, left, to_left);
                continue;
            }
            rising = true;
        }
        if depth == 0u {
            break;
        }
        if ((pending[depth / 32u] >> (depth % 32u)) & 1u) == 1u {
            pending[depth / 32u] &= ~(1u << (depth % 32u));
            next = nodes[next].escape;
            rising = false;
        } else {
            depth -= 1u;
            next = parents_of[next];
        }
    }
    return turns;
}

// The same with a short stack; where it is full, the subtree is walked by escapes, up to node `end`.
fn walk_with_stack(top: u32, i: u32, own: Aabb, before: u32) -> u32 {
    var stack: array<u32, STACK>;
    var next = top;
    var depth = 0u;
    var escaping = false;
    var end = NO_NODE;
    var turns = before + 1u;
    if !enters(top, own) {
        return turns;
    }
    while turns <= TURN_LIMIT {
        turns += 1u;
        if escaping {
            let inside = enters(next, own);
            let child = nodes[next].child;
            if inside && next % 2u == 0u {
                offer(i, own, child);
            }
            next = select(nodes[next].escape, child, inside && next % 2u == 1u);
            if next != end {
                continue;
            }
            escaping = false;
        } else if next % 2u == 0u {
            offer(i, own, nodes[next].child);
        } else {
            let left = nodes[next].child;
            let right = nodes[left].escape;
            let to_left = enters(left, own);
            let to_right = enters(right, own);
            if to_left && to_right && depth == STACK {
                escaping = true;
                end = nodes[next].escape;
                next = left;
                continue;
            }
            if to_left && to_right {
                stack[depth] = right;
                depth += 1u;
            }
            if to_left || to_right {
                next = select(right, left, to_left);
                continue;
            }
        }
        if depth == 0u {
            break;
        }
        depth -= 1u;
        next = stack[depth];
    }
    return turns;
}

// Whether the search may run.
fn runs() -> bool {
    return atomicLoad(&counters[CONTROL_STOP]) == 0u;
}

// Pairs within large_list; beside a grid the grid sees to them.
fn list_itself(place: u32) {
    if tree.members != MEMBERS_LARGE {
        within_list(place);
    }
}

@compute @workgroup_size(256)
fn pairs_by_escapes(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let leaf = invocation(wg, num, lid);
    var turns = 0u;
    if runs() {
        list_itself(leaf);
        if leaf < leaf_count[0] {
            let i = nodes[2u * leaf].child;
            let own = aabbs[i];
            with_list(i, own);
            turns = walk_by_escapes(nodes[2u * leaf].escape, NO_NODE, i, own);
        }
    }
    end_search(local_index(lid), turns);
}

@compute @workgroup_size(256)
fn pairs_by_history(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let leaf = invocation(wg, num, lid);
    var turns = 0u;
    if runs() {
        list_itself(leaf);
        if leaf < leaf_count[0] {
            let i = nodes[2u * leaf].child;
            let own = aabbs[i];
            with_list(i, own);
            // What hangs to the right of the way from the leaf to the root, from the leaf up.
            var top = nodes[2u * leaf].escape;
            while top != NO_NODE && turns <= TURN_LIMIT {
                turns = walk_by_history(top, i, own, turns);
                top = nodes[top].escape;
            }
        }
    }
    end_search(local_index(lid), turns);
}

@compute @workgroup_size(256)
fn pairs_with_stack(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let leaf = invocation(wg, num, lid);
    var turns = 0u;
    if runs() {
        list_itself(leaf);
        if leaf < leaf_count[0] {
            let i = nodes[2u * leaf].child;
            let own = aabbs[i];
            with_list(i, own);
            var top = nodes[2u * leaf].escape;
            while top != NO_NODE && turns <= TURN_LIMIT {
                turns = walk_with_stack(top, i, own, turns);
                top = nodes[top].escape;
            }
        }
    }
    end_search(local_index(lid), turns);
}

// Whether a collider that is not in this tree is to be tested against it.
fn looks_across(aabb: Aabb) -> bool {
    if tree.members == MEMBERS_LARGE {
        return bounded(aabb) && aabb.size_class <= atomicLoad(&counters[CONTROL_CELL_CLASS]);
    }
    return bounded(aabb) && (aabb.body & AABB_FIXED) == 0u;
}

@compute @workgroup_size(256)
fn across_by_escapes(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    var turns = 0u;
    if runs() && i < tree.slots && leaf_count[0] != 0u && looks_across(aabbs[i]) {
        let top = root_of(leaf_count[0]);
        turns = walk_by_escapes(top, NO_NODE, i, aabbs[i]);
    }
    end_search(local_index(lid), turns);
}

@compute @workgroup_size(256)
fn across_by_history(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    var turns = 0u;
    if runs() && i < tree.slots && leaf_count[0] != 0u && looks_across(aabbs[i]) {
        turns = walk_by_history(root_of(leaf_count[0]), i, aabbs[i], 0u);
    }
    end_search(local_index(lid), turns);
}

@compute @workgroup_size(256)
fn across_with_stack(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    var turns = 0u;
    if runs() && i < tree.slots && leaf_count[0] != 0u && looks_across(aabbs[i]) {
        turns = walk_with_stack(root_of(leaf_count[0]), i, aabbs[i], 0u);
    }
    end_search(local_index(lid), turns);
}
