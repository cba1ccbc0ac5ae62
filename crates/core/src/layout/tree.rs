use bytemuck::{Pod, Zeroable};

/// No node: where a walk ends.
pub const NO_NODE: u32 = u32::MAX;

/// Node of a tree over n leaves. 32 bytes. Leaf p of the sorted order is node 2 p, internal node i of Karras's numbering
/// is node 2 i + 1, so that the root is node 1 (node 0 of a tree of one leaf), and a node is a leaf when it is even.
///
/// The right child is where the left child escapes to.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct TreeNode {
    /// Lower corner, m.
    pub min: [f32; 3],
    /// Left child; the collider where the node is a leaf.
    pub child: u32,
    /// Upper corner, m.
    pub max: [f32; 3],
    /// Where a walk goes on when it is done with this node's subtree, or does not enter it; [`NO_NODE`] at the end.
    pub escape: u32,
}

/// What a tree is built of, as a uniform. 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct TreeInfo {
    /// Collider slots to look through.
    pub slots: u32,
    /// Which colliders are in it, see [`tree_members`].
    pub members: u32,
    /// Words of a code, 1 or 2.
    pub words: u32,
    /// Room for leaves, a power of two.
    pub capacity: u32,
}

/// Values of [`TreeInfo::members`].
pub mod tree_members {
    /// Bounded colliders of bodies that are not fixed.
    pub const MOVING: u32 = 0;
    /// Bounded colliders of fixed bodies.
    pub const FIXED: u32 = 1;
    /// Bounded colliders larger than a cell of the grid.
    pub const LARGE: u32 = 2;
    /// Every bounded collider.
    pub const ALL: u32 = 3;
}

/// The root of a tree of so many leaves.
pub const fn root_of(count: u32) -> u32 {
    match count {
        0 => NO_NODE,
        1 => 0,
        _ => 1,
    }
}
