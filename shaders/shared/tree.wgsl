// Trees over colliders. Fields: crates/core/src/layout/tree.rs.
//
// Leaf p of the sorted order is node 2 p, internal node i is node 2 i + 1: a node is a leaf when it is even. The right
// child is where the left child escapes to.

const NO_NODE: u32 = 0xffffffffu;

const MEMBERS_MOVING: u32 = 0u;
const MEMBERS_FIXED: u32 = 1u;
const MEMBERS_LARGE: u32 = 2u;
const MEMBERS_ALL: u32 = 3u;

struct TreeNode {
    min: vec3<f32>,
    child: u32,
    max: vec3<f32>,
    escape: u32,
}

struct TreeInfo {
    slots: u32,
    members: u32,
    words: u32,
    capacity: u32,
}

// The root of a tree of so many leaves.
fn root_of(count: u32) -> u32 {
    return select(select(1u, 0u, count == 1u), NO_NODE, count == 0u);
}
