//! Stage `broadphase/sweep`: sort and sweep along one axis. Twin of `shaders/broadphase/sweep.wgsl`.
//!
//! After Liu, Harada, Lee and Kim, "Real-time collision culling of a million bodies on graphics processing units"
//! (SIGGRAPH Asia 2010): colliders are sorted by where their boxes begin along the axis of largest variance, and each is
//! tested against those that begin before it ends. How many these are, a search in the sorted list tells; so that one
//! long box keeps no thread busy for long, no item of work has more than [`SWEEP_CHUNK`] of them.
//!
//! The first item of each place in the sorted list takes its first candidates, and the list of those without end. What
//! is left goes to extra items, numbered by a scan: where boxes are short there are none, and nothing to search.

use super::{Boxes, Found, bounded, center, collect, meets};
use crate::primitives::radix_sort_by;
use rayon::prelude::*;
use std::ops::Range;
use tumble_core::layout::Aabb;
use tumble_core::limits::{SWEEP_CHUNK, SWEEP_ITEM_LIMIT};
use wide::f32x8;

/// Bytes of all arrays a collider: keys with colliders, boxes and their sides, ends, offsets.
pub const BYTES: u64 = 12 + size_of::<Aabb>() as u64 + 16 + 4 + 4;

/// Colliders along the axis.
#[derive(Debug, Clone, Default)]
pub struct Sorted {
    /// Where the boxes begin, as integers that rise with the place.
    pub keys: Vec<u32>,
    /// The boxes; the collider stands in `class`.
    pub boxes: Vec<Aabb>,
    /// Their sides across the axis, lower and upper along the one and along the other, to compare many at once.
    across: [Vec<f32>; 4],
}

/// Work by items: one for each place, then the extra ones.
#[derive(Debug, Clone, Default)]
pub struct Items {
    /// How many extra ones come before those of each place, modulo 2^32.
    pub offsets: Vec<u32>,
    /// All, those of the places included.
    pub count: u64,
}

/// The axis along which the middles of bounded boxes vary most, of several the first. Middles count in 64ths of the
/// domain, by the same rule as codes of a tree: one subtraction and one multiplication by a power of two.
pub fn axis(boxes: &Boxes) -> usize {
    let extent = (0..3).map(|i| boxes.high[i] - boxes.low[i]).fold(0.0, f32::max);
    let exponent = (extent.to_bits() >> 23).clamp(64, 190);
    let scale = f32::from_bits((127 + 6 + 126 - exponent) << 23);
    let add = |a: [u64; 7], b: [u64; 7]| std::array::from_fn(|i| a[i] + b[i]);
    let sum = |chunk: &[Aabb]| {
        chunk.iter().filter(|aabb| bounded(aabb)).fold([0; 7], |sum, aabb| {
            let middle = center(aabb);
            let [x, y, z] = std::array::from_fn(|i| ((middle[i] - boxes.low[i]) * scale).clamp(0.0, 63.0) as u64);
            add(sum, [1, x, y, z, x * x, y * y, z * z])
        })
    };
    let [count, x, y, z, xx, yy, zz] = boxes.aabbs.par_chunks(8192).map(sum).reduce(|| [0; 7], add);
    // count² times the variance: below 2^64 up to 2^26 colliders.
    let [x, y, z] = [count * xx - x * x, count * yy - y * y, count * zz - z * z];
    match (x >= y && x >= z, y >= z) {
        (true, _) => 0,
        (_, true) => 1,
        _ => 2,
    }
}

/// An integer that is larger when the float is. Floats below the normal ones count as 0, as some GPUs have it; the boxes
/// have the last word.
fn key(x: f32) -> u32 {
    let bits = x.to_bits();
    match bits {
        _ if bits & 0x7f80_0000 == 0 => 1 << 31,
        _ if bits >> 31 == 0 => bits | 1 << 31,
        _ => !bits,
    }
}

/// Sorts the bounded colliders by where they begin; equal ones keep their order.
pub fn sort(boxes: &Boxes, axis: usize) -> Sorted {
    let with_key = |(i, aabb): (usize, &Aabb)| bounded(aabb).then(|| u64::from(key(aabb.min[axis])) << 32 | i as u64);
    let mut order: Vec<u64> = boxes.aabbs.par_iter().enumerate().with_min_len(2048).filter_map(with_key).collect();
    radix_sort_by(&mut order, &mut Vec::new(), 32..64, |both| *both);
    let entry = |&both: &u64| Aabb { class: both as u32, ..boxes.aabbs[both as u32 as usize] };
    let keys = order.iter().map(|both| (both >> 32) as u32).collect();
    let boxes: Vec<Aabb> = order.par_iter().with_min_len(2048).map(entry).collect();
    let mut across = [const { Vec::new() }; 4];
    // Short lists are made sooner than shared.
    let at_once = if boxes.len() < 2048 { 4 } else { 1 };
    across.par_iter_mut().enumerate().with_min_len(at_once).for_each(|(side, list)| {
        let axis = (axis + 1 + side / 2) % 3;
        *list = boxes.iter().map(|aabb| if side % 2 == 0 { aabb.min[axis] } else { aabb.max[axis] }).collect();
    });
    Sorted { keys, boxes, across }
}

impl Sorted {
    /// Visits those of `candidates` whose boxes overlap the one at `place`.
    fn partners(&self, axis: usize, place: usize, candidates: Range<usize>, mut visit: impl FnMut(&Aabb)) {
        let own = &self.boxes[place];
        let mut try_one = |other: &Aabb| {
            if meets(own, other) {
                visit(other);
            }
        };
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let [min_u, max_u, min_v, max_v] = [own.min[u], own.max[u], own.min[v], own.max[v]].map(f32x8::splat);
        let mut next = candidates.start;
        while next + LANES <= candidates.end {
            let [low_u, high_u, low_v, high_v] =
                [0, 1, 2, 3].map(|side| f32x8::from(&self.across[side][next..next + LANES]));
            let apart = low_u.simd_gt(max_u) | min_u.simd_gt(high_u) | low_v.simd_gt(max_v) | min_v.simd_gt(high_v);
            let mut near = !apart.to_bitmask() & ((1 << LANES) - 1);
            while near != 0 {
                try_one(&self.boxes[next + near.trailing_zeros() as usize]);
                near &= near - 1;
            }
            next += LANES;
        }
        self.boxes[next..candidates.end].iter().for_each(try_one);
    }
}

/// Candidates that one comparison looks at.
const LANES: usize = 8;

/// For each place the first one that begins behind its end.
pub fn ends(sorted: &Sorted, axis: usize) -> Vec<u32> {
    let end = |(place, aabb): (usize, &Aabb)| {
        let last = key(aabb.max[axis]);
        (place + sorted.keys[place..].partition_point(|&first| first <= last)) as u32
    };
    sorted.boxes.par_iter().enumerate().with_min_len(1024).map(end).collect()
}

/// Numbers the items of work.
pub fn items(ends: &[u32]) -> Items {
    let mut items = Items { offsets: Vec::with_capacity(ends.len()), count: ends.len() as u64 };
    for (place, &end) in ends.iter().enumerate() {
        items.offsets.push((items.count - ends.len() as u64) as u32);
        let candidates = (end - place as u32).saturating_sub(1);
        items.count += u64::from(candidates.div_ceil(SWEEP_CHUNK).saturating_sub(1));
    }
    items
}

impl Items {
    /// Place whose item this is, and the candidates that it looks at.
    pub fn candidates(&self, ends: &[u32], item: usize) -> (usize, Range<usize>) {
        let chunk = SWEEP_CHUNK as usize;
        let (place, before) = match item.checked_sub(ends.len()) {
            None => (item, 0),
            Some(extra) => {
                let place = self.offsets.partition_point(|&offset| offset as usize <= extra) - 1;
                (place, 1 + extra - self.offsets[place] as usize)
            }
        };
        let first = place + 1 + before * chunk;
        (place, first..(ends[place] as usize).min(first + chunk).max(first))
    }
}

/// All pairs; beyond `most` they are counted and not kept.
pub fn find_pairs(boxes: &Boxes, most: u32) -> Found {
    let axis = axis(boxes);
    let sorted = sort(boxes, axis);
    let ends = ends(&sorted, axis);
    let items = items(&ends);
    if items.count > SWEEP_ITEM_LIMIT.into() {
        return Found { items: items.count, ..Found::default() };
    }
    // So many at once that there are not too many lists of pairs.
    let group = (items.count as usize / 65_536).max(1);
    let count = items.count as usize;
    collect(boxes, &boxes.unbounded, count.div_ceil(group), most, |range, sink| {
        for item in range.start * group..(range.end * group).min(count) {
            let (place, candidates) = items.candidates(&ends, item);
            let own = &sorted.boxes[place];
            if item < ends.len() {
                sink.with_list(boxes, &boxes.unbounded, own.class);
            }
            sink.took(candidates.len() as u32);
            sorted.partners(axis, place, candidates, |other| sink.push(own.class, other.class));
        }
    })
}
