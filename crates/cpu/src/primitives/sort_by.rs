//! Radix sort of anything by some bits of a key, in parallel: the fast version of [`radix_sort`](super::radix_sort).
//!
//! One pass by the most significant bits that differ, shared among the threads, makes buckets that fit a core's cache;
//! each is then sorted by one thread, least significant digit first. What is large after the first pass (keys that
//! crowd together) is split again. A stable sort has one result, so neither the buckets nor the threads show.

use std::ops::Range;

use rayon::prelude::*;

use crate::shared::Shared;

/// Up to so many elements, insertion sort.
const FEW: usize = 48;
/// Up to so many elements, one thread sorts from the least significant digit on.
const MANY: usize = 1 << 14;
/// Elements a bucket, when keys are spread evenly.
const BUCKET: usize = 1 << 12;
/// Most bits by which elements are split at once.
const SPLIT_BITS: u32 = 8;
/// Bits of a digit within a bucket.
const DIGIT_BITS: u32 = 8;
const DIGITS: usize = 1 << DIGIT_BITS;
/// Elements that a thread takes at least when keys are only read.
const READ: usize = 1 << 15;

/// Sorts `elements` by the bits `bits` of `key` (0 the least significant), in place and in parallel; elements of equal
/// bits keep their order. The result is the same for any number of threads.
///
/// `scratch` is made as long as `elements`; what it holds afterwards is of no use. Give the same one again, and nothing
/// is allocated. `key` is called several times an element and must always give the same.
///
/// # Panics
/// When `bits` ends past 64, or `key` gives different keys for one element.
pub fn radix_sort_by<T: Copy + Send + Sync>(
    elements: &mut Vec<T>,
    scratch: &mut Vec<T>,
    bits: Range<u32>,
    key: impl Fn(&T) -> u64 + Sync,
) {
    assert!(bits.end <= 64, "bits {bits:?} of a key that has 64");
    if elements.len() < 2 || bits.is_empty() {
        return;
    }
    scratch.resize(elements.len(), elements[0]);
    let mask = u64::MAX >> (64 - (bits.end - bits.start));
    let start = bits.start;
    let key = move |element: &T| (key(element) >> start) & mask;
    sort(elements, scratch, Where::From, &key);
}

/// Where the sorted elements are to lie.
#[derive(Clone, Copy, PartialEq)]
enum Where {
    From,
    To,
}

/// Sorts what lies in `from`; both slices are as long.
fn sort<T: Copy + Send + Sync>(from: &mut [T], to: &mut [T], end: Where, key: &(impl Fn(&T) -> u64 + Sync)) {
    if from.len() <= FEW {
        insertion_sort(from, key);
        return finish(from, to, end);
    }
    let found = look(from, key);
    if found.is_sorted {
        return finish(from, to, end);
    }
    // Not sorted, so that some bit differs.
    let differ = found.any & !found.all;
    let bits = differ.trailing_zeros()..64 - differ.leading_zeros();
    if from.len() <= MANY { by_digits(from, to, bits, end, key) } else { split(from, to, bits, end, key) }
}

/// Moves the sorted elements from where they are, `from`, to where they are to lie.
fn finish<T: Copy>(from: &mut [T], to: &mut [T], end: Where) {
    if end == Where::To {
        to.copy_from_slice(from);
    }
}

fn insertion_sort<T: Copy>(elements: &mut [T], key: &impl Fn(&T) -> u64) {
    for i in 1..elements.len() {
        let element = elements[i];
        let its_key = key(&element);
        let mut place = i;
        while place > 0 && key(&elements[place - 1]) > its_key {
            elements[place] = elements[place - 1];
            place -= 1;
        }
        elements[place] = element;
    }
}

/// What the keys have in common.
#[derive(Clone, Copy)]
struct Look {
    /// Bits that are set in any key.
    any: u64,
    /// Bits that are set in all keys.
    all: u64,
    is_sorted: bool,
}

fn look<T: Sync>(elements: &[T], key: &(impl Fn(&T) -> u64 + Sync)) -> Look {
    if elements.len() > 2 * READ && rayon::current_num_threads() > 1 {
        // The parts share an element, so that their neighbours are compared.
        let (left, right) = (&elements[..elements.len() / 2 + 1], &elements[elements.len() / 2..]);
        let (a, b) = rayon::join(|| look(left, key), || look(right, key));
        return Look { any: a.any | b.any, all: a.all & b.all, is_sorted: a.is_sorted && b.is_sorted };
    }
    let mut last = key(&elements[0]);
    let mut found = Look { any: last, all: last, is_sorted: true };
    for element in &elements[1..] {
        let key = key(element);
        found.any |= key;
        found.all &= key;
        found.is_sorted &= last <= key;
        last = key;
    }
    found
}

/// One thread, least significant digit first; `bits` are those that differ.
fn by_digits<T: Copy>(from: &mut [T], to: &mut [T], bits: Range<u32>, end: Where, key: &impl Fn(&T) -> u64) {
    let width = bits.end - bits.start;
    let digits = width.div_ceil(DIGIT_BITS);
    let each = width.div_ceil(digits);
    let mut counters = [[0u32; DIGITS]; 64usize.div_ceil(DIGIT_BITS as usize)];
    let mask = (1usize << each) - 1;
    for element in from.iter() {
        let mut rest = key(element) >> bits.start;
        for counters in &mut counters[..digits as usize] {
            counters[rest as usize & mask] += 1;
            rest >>= each;
        }
    }
    let (mut at, mut other, mut is_here) = (from, to, Where::From);
    for (digit, counters) in (0..).zip(&mut counters[..digits as usize]) {
        let shift = bits.start + digit * each;
        let digit_of = |element: &T| (key(element) >> shift) as usize & mask;
        if counters[digit_of(&at[0])] as usize == at.len() {
            continue;
        }
        let mut sum = 0;
        for counter in &mut counters[..=mask] {
            sum += std::mem::replace(counter, sum);
        }
        for element in at.iter() {
            let counter = &mut counters[digit_of(element)];
            other[*counter as usize] = *element;
            *counter += 1;
        }
        (at, other) = (other, at);
        is_here = if is_here == Where::From { Where::To } else { Where::From };
    }
    if is_here != end {
        other.copy_from_slice(at);
    }
}

/// All threads: moves the elements into buckets by the most significant of `bits`, and sorts those.
fn split<T: Copy + Send + Sync>(
    from: &mut [T],
    to: &mut [T],
    bits: Range<u32>,
    end: Where,
    key: &(impl Fn(&T) -> u64 + Sync),
) {
    let count = from.len();
    let wanted = (count / BUCKET).ilog2().clamp(1, SPLIT_BITS);
    let shift = bits.end - wanted.min(bits.end - bits.start);
    // Bits above those that differ are the same in all keys.
    let mask = (1usize << (bits.end - shift)) - 1;
    let bucket_of = |element: &T| (key(element) >> shift) as usize & mask;

    let threads = rayon::current_num_threads();
    let chunk = count.div_ceil(threads).max(READ);
    let mut counts: Vec<Vec<usize>> = from
        .par_chunks(chunk)
        .map(|elements| {
            let mut counts = vec![0; mask + 1];
            for element in elements {
                counts[bucket_of(element)] += 1;
            }
            counts
        })
        .collect();

    // Where each chunk's elements of each bucket go: (next, end).
    let mut sizes = vec![0; mask + 1];
    let mut ranges = vec![vec![(0, 0); mask + 1]; counts.len()];
    let mut next = 0;
    for bucket in 0..=mask {
        let begin = next;
        for (counts, ranges) in counts.iter_mut().zip(&mut ranges) {
            ranges[bucket] = (next, next + counts[bucket]);
            next += counts[bucket];
        }
        sizes[bucket] = next - begin;
    }

    let target = Shared::new(to);
    from.par_chunks(chunk).zip(&mut ranges).for_each(|(elements, ranges)| {
        for element in elements {
            let (next, end) = &mut ranges[bucket_of(element)];
            assert!(next < end, "a key changed while its element was sorted");
            // SAFETY: the ranges of chunks and buckets do not overlap, each place of one is written once, and nobody
            // reads before all have ended.
            unsafe { target.set(*next, *element) };
            *next += 1;
        }
    });

    let mut parts = Vec::with_capacity(sizes.len());
    let (mut from, mut to) = (from, to);
    for size in sizes {
        let (from_part, from_rest) = from.split_at_mut(size);
        let (to_part, to_rest) = to.split_at_mut(size);
        parts.push((to_part, from_part));
        (from, to) = (from_rest, to_rest);
    }
    let other = if end == Where::From { Where::To } else { Where::From };
    parts.into_par_iter().for_each(|(from, to)| sort(from, to, other, key));
}

#[cfg(test)]
mod tests {
    use super::{FEW, MANY, radix_sort_by};

    /// Keys by a multiplicative hash, their place as the value.
    fn elements(count: usize, bits: u32) -> Vec<(u64, u32)> {
        (0..count as u32).map(|i| ((u64::from(i).wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> (64 - bits), i)).collect()
    }

    #[test]
    fn is_the_stable_sort_for_every_path() {
        let mut scratch = Vec::new();
        for count in [0, 1, 2, FEW, FEW + 1, 1000, MANY, MANY + 1, 100_000] {
            for bits in [1, 7, 8, 9, 20, 33, 64] {
                let mut sorted = elements(count, bits);
                let mut expected = sorted.clone();
                expected.sort_by_key(|element| element.0);
                radix_sort_by(&mut sorted, &mut scratch, 0..64, |element| element.0);
                assert!(sorted == expected, "{count} elements of {bits} bits");
            }
        }
    }

    #[test]
    fn only_the_bits_that_are_asked_for_count() {
        let mut sorted = elements(100_000, 64);
        let mut expected = sorted.clone();
        expected.sort_by_key(|element| (element.0 >> 13) & 0xfffff);
        radix_sort_by(&mut sorted, &mut Vec::new(), 13..33, |element| element.0);
        assert!(sorted == expected);
        radix_sort_by(&mut sorted, &mut Vec::new(), 5..5, |element| element.0);
        assert!(sorted == expected);
    }

    /// Nearly all keys fall into one bucket of each split.
    #[test]
    fn crowded_keys_are_split_again() {
        let mut sorted = elements(200_000, 18);
        sorted[0].0 = 1 << 63;
        sorted[77].0 = 1 << 40;
        let mut expected = sorted.clone();
        expected.sort_by_key(|element| element.0);
        radix_sort_by(&mut sorted, &mut Vec::new(), 0..64, |element| element.0);
        assert!(sorted == expected);
    }
}
