//! Stage `broadphase`: which colliders' boxes overlap. Every broad phase here returns the same list.
//!
//! Bounded colliders are what a broad phase is about. Those without end (half-spaces) are few, and are tested against
//! all the others one by one, whichever it is.

pub mod brute_force;
mod finder;
pub mod grid;
pub mod lbvh;
pub mod sweep;

pub(crate) use finder::{Finder, Search};

use crate::bounds::{FAR, size_class};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use tumble_core::layout::{Aabb, aabb_body};
use tumble_core::limits::{SWEEP_ITEM_LIMIT, TURN_LIMIT, UNBOUNDED_LIMIT};

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

/// Whether a contact between colliders of these bodies ([`aabb_body`]) could push anything.
#[inline]
pub fn matter(a: u32, b: u32) -> bool {
    let both = a & b & aabb_body::LIVE != 0;
    let one_moves = (a | b) & aabb_body::DYNAMIC != 0;
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

/// Where one chunk of a search leaves its pairs.
#[derive(Debug)]
pub(crate) struct Sink {
    pairs: Vec<[u32; 2]>,
    count: u64,
    room: usize,
    most_turns: u32,
    turns: u32,
}

impl Sink {
    /// A pair, in either order.
    #[inline]
    pub(crate) fn push(&mut self, i: u32, j: u32) {
        self.count += 1;
        if self.pairs.len() < self.room {
            self.pairs.push([i.min(j), i.max(j)]);
        }
    }

    /// The search for one collider's partners took so many turns.
    #[inline]
    pub(crate) fn took(&mut self, turns: u32) {
        self.most_turns = self.most_turns.max(turns);
        self.turns = self.turns.wrapping_add(turns);
    }

    /// Pairs of collider `i` with those of a list that it is not on.
    #[inline]
    pub(crate) fn with_list(&mut self, boxes: &Boxes, list: &[u32], i: u32) {
        for &j in list {
            if meets(&boxes.aabbs[i as usize], &boxes.aabbs[j as usize]) {
                self.push(i, j);
            }
        }
    }
}

/// Runs `search` over 0..count in chunks, in parallel, and sorts what they find. Pairs within `list`, of those that all are
/// tested against, are added here. Beyond `most`, pairs are counted and not kept.
pub(crate) fn collect(
    boxes: &Boxes,
    list: &[u32],
    count: usize,
    most: u32,
    search: impl Fn(Range<usize>, &mut Sink) + Sync,
) -> Found {
    const CHUNK: usize = 512;
    let total = AtomicU64::new(0);
    let sink = || Sink { pairs: Vec::new(), count: 0, room: most as usize, most_turns: 0, turns: 0 };
    let chunk = |chunk: usize| {
        let mut own = sink();
        let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(count);
        own.pairs.reserve(4 * range.len());
        search(range, &mut own);
        if total.fetch_add(own.count, Ordering::Relaxed) + own.count > most.into() {
            own.pairs = Vec::new();
        }
        own
    };
    let mut chunks: Vec<Sink> = (0..count.div_ceil(CHUNK)).into_par_iter().map(chunk).collect();
    let mut rest = sink();
    list.iter().enumerate().for_each(|(k, &i)| rest.with_list(boxes, &list[k + 1..], i));
    chunks.push(rest);
    let mut found = Found { count: chunks.iter().map(|c| c.count).sum(), ..Found::default() };
    found.most_turns = chunks.iter().map(|c| c.most_turns).max().unwrap_or(0);
    found.turns = chunks.iter().fold(0, |sum, c| sum.wrapping_add(c.turns));
    if found.count <= most.into() {
        let lists: Vec<_> = chunks.into_iter().map(|c| c.pairs).collect();
        found.pairs = sorted(&lists, boxes.aabbs.len());
    }
    found
}

/// All pairs of `lists`, sorted: a counting sort by the lower collider, then each collider's few partners.
fn sorted(lists: &[Vec<[u32; 2]>], colliders: usize) -> Vec<[u32; 2]> {
    let mut start = vec![0u32; colliders + 1];
    lists.iter().flatten().for_each(|pair| start[pair[0] as usize + 1] += 1);
    for i in 0..colliders {
        start[i + 1] += start[i];
    }
    let mut pairs = vec![[0; 2]; start[colliders] as usize];
    let mut cursor = start.clone();
    for pair in lists.iter().flatten() {
        let at = &mut cursor[pair[0] as usize];
        pairs[*at as usize] = *pair;
        *at += 1;
    }
    let mut rest = &mut pairs[..];
    let mut owners = Vec::with_capacity(colliders);
    for two in start.windows(2).filter(|two| two[1] > two[0] + 1) {
        let skip = two[0] as usize - (start[colliders] as usize - rest.len());
        let (own, after) = rest[skip..].split_at_mut((two[1] - two[0]) as usize);
        owners.push(own);
        rest = after;
    }
    owners.into_par_iter().with_min_len(1024).for_each(|own| own.sort_unstable());
    pairs
}
