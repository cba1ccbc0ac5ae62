//! Stage `broadphase/lbvh`: linear bounding volume hierarchy. Twin of `shaders/broadphase/lbvh/*.wgsl`; this file of
//! `build.wgsl`, `walk` of the other.
//!
//! Colliders are sorted along a Morton curve by the middles of their boxes, and the common prefixes of the codes make the
//! hierarchy, each node by itself: Karras, "Maximizing Parallelism in the Construction of BVHs, Octrees, and k-d Trees"
//! (HPG 2012); equal codes are told apart by their places. Every node covers a run of leaves, so its box is a union of
//! powers of two of them, which a pyramid over the leaves has ready: no node waits for another.

mod walk;

pub use walk::find_pairs;

use super::{Boxes, bounded, center};
use crate::bounds::FAR;
use crate::primitives::radix_sort_by;
use bytemuck::Zeroable;
use rayon::prelude::*;
use tumble_core::MortonBits;
use tumble_core::layout::{Aabb, NO_NODE, TreeNode, aabb_body, tree_members};

/// A tree over some of the colliders.
#[derive(Debug, Clone, Default)]
pub struct Tree {
    /// Codes of the leaves, rising.
    pub codes: Vec<u64>,
    /// Colliders of the leaves.
    pub members: Vec<u32>,
    /// Leaf p is node 2 p, internal node i is node 2 i + 1.
    pub nodes: Vec<TreeNode>,
    /// The leaf at the other end of internal node i's run, of which leaf i is one end.
    pub ends: Vec<u32>,
    /// Parent of each node, where a walk needs it.
    pub parents: Vec<u32>,
    /// Boxes of 2, 4, 8, ... leaves from a multiple of so many on, level after level.
    pyramid: Vec<Vec<Corners>>,
}

/// Lower and upper corner.
type Corners = [[f32; 3]; 2];

const NOTHING: Corners = [[FAR; 3], [-FAR; 3]];

fn union(a: Corners, b: Corners) -> Corners {
    [std::array::from_fn(|i| a[0][i].min(b[0][i])), std::array::from_fn(|i| a[1][i].max(b[1][i]))]
}

/// Whether a collider belongs to the tree of all, or of moving, or of fixed ones.
pub fn is_member(aabb: &Aabb, members: u32) -> bool {
    let fixed = aabb.body & aabb_body::FIXED != 0;
    bounded(aabb) && (members == tree_members::ALL || fixed == (members == tree_members::FIXED))
}

/// Turns middles into codes: lowest middle, and codes per metre, a power of two, so that the factor is exact everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantizer {
    /// Lowest middle, m.
    pub low: [f32; 3],
    /// 1/m.
    pub scale: f32,
    /// Bits an axis.
    pub bits: u32,
}

impl Quantizer {
    /// For all bounded colliders.
    pub fn new(boxes: &Boxes, bits: MortonBits) -> Self {
        let bits = if bits == MortonBits::Bits63 { 21 } else { 10 };
        let extent = (0..3).map(|i| boxes.high[i] - boxes.low[i]).fold(0.0, f32::max);
        // The next power of two above the extent goes to the number of cells.
        let exponent = (extent.to_bits() >> 23).clamp(64, 190);
        let scale = f32::from_bits((127 + bits + 126 - exponent) << 23);
        Self { low: boxes.low, scale, bits }
    }

    /// Code of a box: x lowest, the most significant bits first.
    pub fn code(&self, aabb: &Aabb) -> u64 {
        let middle = center(aabb);
        let most = (1u32 << self.bits) - 1;
        let [x, y, z] =
            std::array::from_fn(|i| ((middle[i] - self.low[i]) * self.scale).clamp(0.0, most as f32) as u32);
        spread(x) | spread(y) << 1 | spread(z) << 2
    }
}

/// The lowest 21 bits, each three places from the last.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Length of the prefix that the codes of two leaves share, places included; -1 where there is no leaf `b`.
fn shared(codes: &[u64], a: usize, b: i64) -> i32 {
    if b < 0 || b >= codes.len() as i64 {
        return -1;
    }
    let different = codes[a] ^ codes[b as usize];
    match different {
        0 => 64 + (a as u32 ^ b as u32).leading_zeros() as i32,
        _ => different.leading_zeros() as i32,
    }
}

impl Tree {
    /// A tree of all bounded colliders that are fixed, or of those that are not.
    pub fn new(boxes: &Boxes, bits: MortonBits, members: u32) -> Self {
        let member = |i: &u32| is_member(&boxes.aabbs[*i as usize], members);
        let list: Vec<u32> = (0..boxes.aabbs.len() as u32).into_par_iter().with_min_len(4096).filter(member).collect();
        Self::of_members(boxes, &list, bits)
    }

    /// A tree of these colliders.
    pub fn of_members(boxes: &Boxes, list: &[u32], bits: MortonBits) -> Self {
        let mut tree = Self::default();
        let quantizer = Quantizer::new(boxes, bits);
        let code = |i: u32| quantizer.code(&boxes.aabbs[i as usize]);
        // The sort is stable, so that the lower collider comes first of equal codes.
        let mut keys: Vec<(u64, u32)> = list.par_iter().with_min_len(1024).map(|&i| (code(i), i)).collect();
        radix_sort_by(&mut keys, &mut Vec::new(), 0..3 * quantizer.bits, |key| key.0);
        (tree.codes, tree.members) = keys.into_par_iter().with_min_len(4096).unzip();
        tree.link();
        tree.refit(boxes);
        tree
    }

    /// Leaves.
    pub fn count(&self) -> u32 {
        self.members.len() as u32
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> u64 {
        let pyramid: usize = self.pyramid.iter().map(Vec::len).sum();
        let words = self.members.len() + self.ends.len() + self.parents.len();
        (8 * self.codes.len() + 4 * words + size_of::<TreeNode>() * self.nodes.len() + size_of::<Corners>() * pyramid)
            as u64
    }

    /// Children, runs and escapes of all nodes.
    fn link(&mut self) {
        let count = self.members.len();
        let codes = &self.codes;
        let internal: Vec<(u32, u32, u32)> =
            (0..count.saturating_sub(1)).into_par_iter().with_min_len(512).map(|i| internal_node(codes, i)).collect();
        self.nodes = vec![TreeNode::zeroed(); 2 * count];
        self.nodes.par_chunks_mut(2).with_min_len(512).enumerate().for_each(|(i, two)| {
            two[0].child = self.members[i];
            two[0].escape = escape(codes, i);
            if let Some((left, _, last)) = internal.get(i) {
                two[1].child = *left;
                two[1].escape = escape(codes, *last as usize);
            }
        });
        self.ends = internal.iter().map(|node| node.1).collect();
    }

    /// Parents of all nodes, for a walk by history flags.
    pub fn link_parents(&mut self) {
        self.parents = vec![NO_NODE; self.nodes.len()];
        for i in 0..self.ends.len() {
            let left = self.nodes[2 * i + 1].child;
            let right = self.nodes[left as usize].escape;
            self.parents[left as usize] = 2 * i as u32 + 1;
            self.parents[right as usize] = 2 * i as u32 + 1;
        }
    }

    /// Boxes of all nodes, from those that the colliders have now. A collider that is gone has an empty one.
    pub fn refit(&mut self, boxes: &Boxes) {
        let count = self.members.len();
        let leaves: Vec<Corners> = self.members.par_iter().with_min_len(512).map(|&i| corners(boxes, i)).collect();
        self.pyramid = pyramid(leaves);
        let (ends, pyramid) = (&self.ends, &self.pyramid);
        self.nodes.par_chunks_mut(2).with_min_len(512).enumerate().for_each(|(i, two)| {
            [two[0].min, two[0].max] = pyramid[0][i];
            if i + 1 < count {
                let end = ends[i] as usize;
                [two[1].min, two[1].max] = covered(pyramid, i.min(end), i.max(end));
            }
        });
    }

    /// Panics unless the tree is one, over these boxes, with codes that rise.
    pub fn assert_well_formed(&self, boxes: &Boxes) {
        assert!(self.codes.is_sorted(), "codes rise");
        let leaf_box = |i: u32| corners(boxes, i);
        tumble_core::validate::tree(&self.nodes, self.count(), leaf_box).unwrap_or_else(|error| panic!("{error}"));
    }
}

fn corners(boxes: &Boxes, i: u32) -> Corners {
    let aabb = &boxes.aabbs[i as usize];
    [aabb.min, aabb.max]
}

/// Left child of internal node i, the other end of its run, and the run's last leaf.
fn internal_node(codes: &[u64], i: usize) -> (u32, u32, u32) {
    let here = i as i64;
    let prefix = |j: i64| shared(codes, i, j);
    // The run goes to the side of the neighbour that shares more, as far as more is shared than with the other one.
    let way = if prefix(here + 1) > prefix(here - 1) { 1 } else { -1 };
    let least = prefix(here - way);
    let mut reach = 2;
    while prefix(here + reach * way) > least {
        reach *= 2;
    }
    let mut length = 0;
    let mut stride = reach / 2;
    while stride > 0 {
        if prefix(here + (length + stride) * way) > least {
            length += stride;
        }
        stride /= 2;
    }
    let end = here + length * way;
    // It splits where the prefix of all ends.
    let whole = prefix(end);
    let mut split = 0;
    stride = length;
    while stride > 1 {
        stride = (stride + 1) / 2;
        if prefix(here + (split + stride) * way) > whole {
            split += stride;
        }
    }
    let split = here + split * way + way.min(0);
    let first = here.min(end);
    let left = 2 * split + i64::from(split != first);
    (left as u32, end as u32, here.max(end) as u32)
}

/// Where a walk goes on after a run that ends with leaf `last`: the right child of the node that splits there, which is a
/// leaf where it is alone.
fn escape(codes: &[u64], last: usize) -> u32 {
    if last + 1 >= codes.len() {
        return NO_NODE;
    }
    let next = last as i64 + 1;
    let alone = shared(codes, last + 1, next + 1) <= shared(codes, last + 1, next - 1);
    2 * next as u32 + u32::from(!alone)
}

/// Boxes of runs of 1, 2, 4, ... leaves that begin at multiples of their length.
fn pyramid(leaves: Vec<Corners>) -> Vec<Vec<Corners>> {
    let mut levels = vec![leaves];
    while let Some(below) = levels.last().filter(|level| level.len() > 1) {
        let pair = |two: &[Corners]| union(two[0], two[1]);
        levels.push(below.par_chunks_exact(2).with_min_len(2048).map(pair).collect());
    }
    levels
}

/// Box of the leaves from `first` to `last`.
fn covered(pyramid: &[Vec<Corners>], first: usize, last: usize) -> Corners {
    let (mut from, mut to, mut sum) = (first, last + 1, NOTHING);
    for level in pyramid {
        if from >= to {
            break;
        }
        if from % 2 == 1 {
            sum = union(sum, level[from]);
            from += 1;
        }
        if to % 2 == 1 {
            to -= 1;
            sum = union(sum, level[to]);
        }
        (from, to) = (from / 2, to / 2);
    }
    sum
}
