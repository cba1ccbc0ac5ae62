//! Gathers the pairs that the threads of a search find, and sorts them.

use super::{Boxes, Found, meets};
use crate::shared::Shared;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

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
    const CHUNK: usize = 128;
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

/// Lower colliders of one bucket, as a power of two: as many counters fit the fastest cache.
const BUCKET_BITS: u32 = 10;
/// Pairs that a thread scatters at least.
const SCATTER: usize = 1 << 15;

/// All pairs of `lists`, sorted: into buckets by the lower collider, then each bucket by itself. Both are counting sorts,
/// so the order of the lists does not show.
fn sorted(lists: &[Vec<[u32; 2]>], colliders: usize) -> Vec<[u32; 2]> {
    let count: usize = lists.iter().map(Vec::len).sum();
    let buckets = (colliders >> BUCKET_BITS) + 1;
    let bucket = |pair: &[u32; 2]| (pair[0] >> BUCKET_BITS) as usize;
    let groups = (count / SCATTER).clamp(1, 4 * rayon::current_num_threads());
    let groups: Vec<&[Vec<[u32; 2]>]> = lists.chunks(lists.len().div_ceil(groups).max(1)).collect();
    let counted = |group: &&[Vec<[u32; 2]>]| {
        let mut counts = vec![0usize; buckets];
        group.iter().flatten().for_each(|pair| counts[bucket(pair)] += 1);
        counts
    };
    let mut cursors: Vec<Vec<usize>> = groups.par_iter().map(counted).collect();
    let mut start = Vec::with_capacity(buckets + 1);
    let mut sum = 0;
    for b in 0..buckets {
        start.push(sum);
        for counts in &mut cursors {
            sum += std::mem::replace(&mut counts[b], sum);
        }
    }
    start.push(sum);
    let mut pairs = vec![[0; 2]; count];
    let places = Shared::new(&mut pairs);
    groups.par_iter().zip(&mut cursors).for_each(|(group, cursor)| {
        for pair in group.iter().flatten() {
            let at = &mut cursor[bucket(pair)];
            // SAFETY: each group counted its pairs of each bucket, and has as many places there to itself.
            unsafe { places.set(*at, *pair) };
            *at += 1;
        }
    });
    let mut slices = Vec::with_capacity(buckets);
    let mut rest = &mut pairs[..];
    for two in start.windows(2) {
        let (own, after) = rest.split_at_mut(two[1] - two[0]);
        slices.push(own);
        rest = after;
    }
    slices.into_par_iter().with_min_len(4).for_each_init(Vec::new, sort_bucket);
    pairs
}

/// Sorts pairs whose lower colliders differ in the lowest [`BUCKET_BITS`] bits alone.
fn sort_bucket(scratch: &mut Vec<[u32; 2]>, pairs: &mut [[u32; 2]]) {
    const LOW: u32 = (1 << BUCKET_BITS) - 1;
    let mut ends = [0u32; 1 << BUCKET_BITS];
    pairs.iter().for_each(|pair| ends[(pair[0] & LOW) as usize] += 1);
    let mut sum = 0;
    for end in &mut ends {
        sum += std::mem::replace(end, sum);
    }
    scratch.clear();
    scratch.extend_from_slice(pairs);
    for pair in &*scratch {
        let at = &mut ends[(pair[0] & LOW) as usize];
        pairs[*at as usize] = *pair;
        *at += 1;
    }
    // Each collider's partners.
    let mut first = 0;
    for end in ends {
        let own = &mut pairs[first..end as usize];
        match own.len() {
            0 | 1 => {}
            2..=16 => insertion_sort(own),
            _ => own.sort_unstable_by_key(|pair| pair[1]),
        }
        first = end as usize;
    }
}

/// Sorts a few pairs of one lower collider.
fn insertion_sort(pairs: &mut [[u32; 2]]) {
    for i in 1..pairs.len() {
        let pair = pairs[i];
        let mut at = i;
        while at > 0 && pairs[at - 1][1] > pair[1] {
            pairs[at] = pairs[at - 1];
            at -= 1;
        }
        pairs[at] = pair;
    }
}
