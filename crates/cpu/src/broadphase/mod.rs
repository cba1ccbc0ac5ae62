//! Stage `broadphase`: which colliders' boxes overlap. Every broad phase here returns the same list.
//!
//! Bounded colliders are what a broad phase is about. Those without end (half-spaces) are few, and are tested against
//! all the others one by one, whichever it is.

pub mod brute_force;
mod collect;
mod finder;
pub mod grid;
pub mod lbvh;
pub mod sweep;

pub(crate) use collect::{Sink, collect};
pub(crate) use finder::{Finder, Search};

use crate::bounds::{FAR, size_class};
use bytemuck::NoUninit;
use rayon::prelude::*;
use tumble_core::layout::{Aabb, aabb_body};
use tumble_core::limits::{SWEEP_ITEM_LIMIT, TURN_LIMIT, UNBOUNDED_LIMIT};
use wide::f32x4;

/// Size classes that a float's exponent and two mantissa bits can tell apart.
pub const CLASSES: usize = 1024;

/// The boxes of a step, and what broad phases want to know of them all.
#[derive(Debug, Clone)]
pub struct Boxes<'a> {
    /// By collider slot.
    pub aabbs: &'a [Aabb],
    /// Live colliders without end, ascending.
    pub unbounded: Vec<u32>,
    /// How many bounded colliders there are of each size class.
    pub classes: Vec<u32>,
    /// Lowest middle of a bounded collider, m; infinite when there is none.
    pub low: [f32; 3],
    /// Highest middle.
    pub high: [f32; 3],
}

impl<'a> Boxes<'a> {
    /// Looks all boxes over.
    pub fn new(aabbs: &'a [Aabb]) -> Self {
        let none = || Self {
            aabbs,
            unbounded: Vec::new(),
            classes: vec![0; CLASSES],
            low: [f32::INFINITY; 3],
            high: [f32::NEG_INFINITY; 3],
        };
        let survey = |chunk: usize| {
            let mut boxes = none();
            let first = chunk * SURVEY;
            for (i, aabb) in aabbs.iter().enumerate().skip(first).take(SURVEY) {
                if bounded(aabb) {
                    boxes.classes[aabb.class as usize] += 1;
                    let middle = center(aabb);
                    boxes.low = lowest(boxes.low, middle);
                    boxes.high = highest(boxes.high, middle);
                } else if aabb.body & aabb_body::LIVE != 0 {
                    boxes.unbounded.push(i as u32);
                }
            }
            boxes
        };
        const SURVEY: usize = 8192;
        let chunks: Vec<_> = (0..aabbs.len().div_ceil(SURVEY)).into_par_iter().map(survey).collect();
        chunks.into_iter().fold(none(), |mut all, chunk| {
            all.unbounded.extend(chunk.unbounded);
            all.classes.iter_mut().zip(chunk.classes).for_each(|(sum, count)| *sum += count);
            all.low = lowest(all.low, chunk.low);
            all.high = highest(all.high, chunk.high);
            all
        })
    }
}

/// What a broad phase found.
#[derive(Debug, Clone, Default)]
pub struct Found {
    /// (a, b) with a < b, sorted; worth nothing when there are more than were asked for.
    pub pairs: Vec<[u32; 2]>,
    /// How many there are.
    pub count: u64,
    /// Most turns that the search for one collider's partners takes in the shader.
    pub most_turns: u32,
    /// Turns of all, modulo 2^32.
    pub turns: u32,
    /// Items of work of the sweep. When these are too many, nothing else was looked for.
    pub items: u64,
}

impl Found {
    /// Panics unless each pair has a < b and the list rises strictly.
    pub fn assert_well_formed(&self) {
        assert_eq!(self.pairs.len() as u64, self.count, "pairs in the list, and counted");
        tumble_core::validate::pairs(&self.pairs).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// What a shader's loops could not do in one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TooMany {
    /// So many turns for one collider.
    Turns(u32),
    /// So many colliders without end.
    Unbounded(u32),
    /// So many items of work of the sweep.
    Items(u64),
}

/// Whether a shader's loops would pass their bounds.
pub fn too_many(boxes: &Boxes, found: &Found) -> Option<TooMany> {
    let unbounded = boxes.unbounded.len() as u32;
    if unbounded > UNBOUNDED_LIMIT {
        return Some(TooMany::Unbounded(unbounded));
    }
    if found.items > SWEEP_ITEM_LIMIT.into() {
        return Some(TooMany::Items(found.items));
    }
    (found.most_turns > TURN_LIMIT).then_some(TooMany::Turns(found.most_turns))
}

/// Whether two boxes overlap and a contact between them could push anything.
#[inline]
pub fn meets(a: &Aabb, b: &Aabb) -> bool {
    overlaps(a.min, a.max, b.min, b.max) && matter(a.body, b.body)
}

/// Whether two boxes overlap or touch.
#[inline]
pub fn overlaps(a_min: [f32; 3], a_max: [f32; 3], b_min: [f32; 3], b_max: [f32; 3]) -> bool {
    let apart = (a_min[0] > b_max[0])
        | (b_min[0] > a_max[0])
        | (a_min[1] > b_max[1])
        | (b_min[1] > a_max[1])
        | (a_min[2] > b_max[2])
        | (b_min[2] > a_max[2]);
    !apart
}

/// A box to compare with many: [`overlaps`], in one comparison a side.
pub(crate) struct Query {
    min: f32x4,
    max: f32x4,
}

impl Query {
    /// For this box.
    #[inline]
    pub(crate) fn new(aabb: &Aabb) -> Self {
        let [x, y, z] = aabb.min;
        let [u, v, w] = aabb.max;
        Self { min: f32x4::new([x, y, z, 0.0]), max: f32x4::new([u, v, w, 0.0]) }
    }

    /// Whether it overlaps or touches a box or node: three floats, a word, three floats, a word.
    #[inline]
    pub(crate) fn overlaps<T: NoUninit>(&self, other: &T) -> bool {
        let [a, b, c, d, e, f, g, h]: [f32; 8] = bytemuck::cast(*other);
        let apart = f32x4::new([a, b, c, d]).simd_gt(self.max) | self.min.simd_gt(f32x4::new([e, f, g, h]));
        // The words have no say.
        apart.to_bitmask() & 0b111 == 0
    }
}

/// Whether a contact between colliders of these bodies ([`aabb_body`]) could push anything, or could if it were awake.
#[inline]
pub fn matter(a: u32, b: u32) -> bool {
    let both = a & b & aabb_body::LIVE != 0;
    let one_moves = (a | b) & (aabb_body::DYNAMIC | aabb_body::ASLEEP) != 0;
    both && one_moves && (a ^ b) & aabb_body::INDEX != 0
}

/// Whether a collider lives and has an end.
pub fn bounded(aabb: &Aabb) -> bool {
    aabb.body & aabb_body::LIVE != 0 && aabb.class < size_class(FAR)
}

/// Middle of a box.
pub fn center(aabb: &Aabb) -> [f32; 3] {
    std::array::from_fn(|i| 0.5 * (aabb.min[i] + aabb.max[i]))
}

fn lowest(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i].min(b[i]))
}

fn highest(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| a[i].max(b[i]))
}
