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
/// Up to so many elements, one thread sorts from the least significant digit on, though there are others.
const ALONE: usize = 1 << 15;
/// Up to so many elements it does so when there are no others, or they have buckets of their own.
const MANY: usize = 1 << 17;
/// Elements a bucket, when keys are spread evenly.
const BUCKET: usize = 1 << 12;
/// Bits of a digit, and most bits by which elements are split at once.
const DIGIT_BITS: u32 = 8;
const DIGITS: usize = 1 << DIGIT_BITS;
/// Fewest elements of a chunk that a thread takes.
const READ: usize = 1 << 14;

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
    if sort(elements, scratch, bits, None, &key) == Where::To {
        std::mem::swap(elements, scratch);
    }
}

/// The bits `bits` of a key, not shifted, all others zero.
fn masked<T>(bits: &Range<u32>, key: &impl Fn(&T) -> u64) -> impl Fn(&T) -> u64 {
    let mask = (u64::MAX >> (64 - (bits.end - bits.start))) << bits.start;
    move |element| key(element) & mask
}

/// Where the sorted elements lie.
#[derive(Clone, Copy, PartialEq)]
enum Where {
    From,
    To,
}

impl Where {
    fn other(self) -> Self {
        if self == Self::From { Self::To } else { Self::From }
    }
}

/// Sorts what lies in `from`, and returns where the result lies: at `end`, if that is told. Both slices are as long, and
/// `bits` are some.
fn sort<T: Copy + Send + Sync>(
    from: &mut [T],
    to: &mut [T],
    bits: Range<u32>,
    end: Option<Where>,
    key: &(impl Fn(&T) -> u64 + Sync),
) -> Where {
    if from.len() <= FEW {
        insertion_sort(from, &masked(&bits, key));
        return finish(from, to, end);
    }
    let found = look(from, &masked(&bits, key));
    if found.is_sorted {
        return finish(from, to, end);
    }
    // Not sorted, so that some bit differs.
    let differ = found.any & !found.all;
    let bits = differ.trailing_zeros()..64 - differ.leading_zeros();
    let alone = if rayon::current_num_threads() > 1 { ALONE } else { MANY };
    if from.len() <= alone { by_digits(from, to, bits, end, key) } else { split(from, to, bits, end, key) }
}

/// Sorts a bucket, whose keys differ in no other bits than `bits`.
fn sort_bucket<T: Copy + Send + Sync>(
    from: &mut [T],
    to: &mut [T],
    bits: Range<u32>,
    end: Where,
    key: &(impl Fn(&T) -> u64 + Sync),
) {
    if bits.is_empty() {
        finish(from, to, Some(end));
    } else if from.len() > FEW && from.len() <= MANY {
        by_digits(from, to, bits, Some(end), key);
    } else {
        sort(from, to, bits, Some(end), key);
    }
}

/// The sorted elements lie in `from`: copies them if they are to lie elsewhere.
fn finish<T: Copy>(from: &mut [T], to: &mut [T], end: Option<Where>) -> Where {
    if end == Some(Where::To) {
        to.copy_from_slice(from);
    }
    end.unwrap_or(Where::From)
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

/// A digit: bits of a key.
#[derive(Clone, Copy)]
struct Digit {
    shift: u32,
    mask: u8,
}

impl Digit {
    /// The lowest digit of `bits`, which are some.
    fn lowest(bits: &Range<u32>) -> Self {
        Self { shift: bits.start, mask: u8::MAX >> (DIGIT_BITS.saturating_sub(bits.end - bits.start)) }
    }

    fn of(self, key: u64) -> usize {
        ((key >> self.shift) as u8 & self.mask).into()
    }
}

/// One thread, least significant digit first; `bits` are some.
fn by_digits<T: Copy>(
    from: &mut [T],
    to: &mut [T],
    bits: Range<u32>,
    end: Option<Where>,
    key: &impl Fn(&T) -> u64,
) -> Where {
    let digit_at = |start: u32| Digit::lowest(&(start..bits.end));
    let (mut at, mut other, mut is_here) = (from, to, Where::From);
    let mut counters = [0; DIGITS];
    count(at, digit_at(bits.start), &mut counters, key);
    for start in bits.clone().step_by(DIGIT_BITS as usize) {
        let digit = digit_at(start);
        let next = (start + DIGIT_BITS < bits.end).then(|| digit_at(start + DIGIT_BITS));
        let mut next_counters = [0; DIGITS];
        if counters[digit.of(key(&at[0]))] as usize == at.len() {
            if let Some(next) = next {
                count(at, next, &mut next_counters, key);
            }
        } else {
            by_digit(at, other, digit, &mut counters, next.unwrap_or(digit), &mut next_counters, key);
            (at, other) = (other, at);
            is_here = is_here.other();
        }
        counters = next_counters;
    }
    if end.is_some_and(|end| end != is_here) {
        other.copy_from_slice(at);
    }
    end.unwrap_or(is_here)
}

/// Adds up how often each value of a digit occurs.
fn count<T>(from: &[T], digit: Digit, counters: &mut [u32; DIGITS], key: &impl Fn(&T) -> u64) {
    for element in from {
        counters[digit.of(key(element))] += 1;
    }
}

/// Moves the elements by one digit, which `counters` counts, and counts the next one meanwhile.
fn by_digit<T: Copy>(
    from: &[T],
    to: &mut [T],
    digit: Digit,
    counters: &mut [u32; DIGITS],
    next: Digit,
    next_counters: &mut [u32; DIGITS],
    key: &impl Fn(&T) -> u64,
) {
    let mut sum = 0;
    for counter in counters.iter_mut() {
        sum += std::mem::replace(counter, sum);
    }
    let eights = from.chunks_exact(8);
    let rest = eights.remainder();
    for eight in eights {
        // All keys first: what is read does not wait for what is written.
        let keys: [u64; 8] = std::array::from_fn(|i| key(&eight[i]));
        for (key, element) in keys.into_iter().zip(eight) {
            next_counters[next.of(key)] += 1;
            let place = &mut counters[digit.of(key)];
            to[*place as usize] = *element;
            *place += 1;
        }
    }
    for element in rest {
        next_counters[next.of(key(element))] += 1;
        let place = &mut counters[digit.of(key(element))];
        to[*place as usize] = *element;
        *place += 1;
    }
}

/// The places that are left for a chunk's elements of one bucket.
#[derive(Clone, Copy, Default)]
struct Places {
    next: usize,
    end: usize,
}

/// Moves a chunk's elements to their places.
fn move_to_buckets<T: Copy>(
    elements: &[T],
    target: &Shared<T>,
    ranges: &mut [Places; DIGITS],
    digit: Digit,
    key: &impl Fn(&T) -> u64,
) {
    for element in elements {
        let places = &mut ranges[digit.of(key(element))];
        assert!(places.next < places.end, "a key changed while its element was sorted");
        // SAFETY: the ranges of chunks and buckets do not overlap, each place of one is taken once, and nobody reads
        // before all have ended.
        unsafe { target.set(places.next, *element) };
        places.next += 1;
    }
}

/// All threads: moves the elements into buckets by the most significant of `bits`, and sorts those.
fn split<T: Copy + Send + Sync>(
    from: &mut [T],
    to: &mut [T],
    bits: Range<u32>,
    end: Option<Where>,
    key: &(impl Fn(&T) -> u64 + Sync),
) -> Where {
    // As many buckets as are wanted, or more when that saves a digit.
    let width = bits.end - bits.start;
    let digits_left = width.saturating_sub(DIGIT_BITS).div_ceil(DIGIT_BITS);
    let wanted = (from.len() / BUCKET).ilog2().clamp(1, DIGIT_BITS).max(width.saturating_sub(DIGIT_BITS * digits_left));
    let shift = bits.end - wanted.min(width);
    let digit = Digit::lowest(&(shift..bits.end));

    // Several chunks a thread, so that one which is held up does not hold up the others.
    let threads = rayon::current_num_threads();
    let chunks = if threads == 1 { 1 } else { 4 * threads };
    let chunk = from.len().div_ceil(chunks).max(READ);
    let counts: Vec<[u32; DIGITS]> = from
        .par_chunks(chunk)
        .map(|elements| {
            let mut counts = [0; DIGITS];
            count(elements, digit, &mut counts, key);
            counts
        })
        .collect();

    // Where each chunk's elements of each bucket go.
    let mut sizes = [0; DIGITS];
    let mut ranges = vec![[Places::default(); DIGITS]; counts.len()];
    let mut next = 0;
    for bucket in 0..DIGITS {
        for (counts, ranges) in counts.iter().zip(&mut ranges) {
            let end = next + counts[bucket] as usize;
            ranges[bucket] = Places { next, end };
            sizes[bucket] += counts[bucket] as usize;
            next = end;
        }
    }

    let target = Shared::new(to);
    from.par_chunks(chunk)
        .zip(ranges)
        .for_each(|(elements, mut ranges)| move_to_buckets(elements, &target, &mut ranges, digit, key));

    let mut parts = Vec::with_capacity(DIGITS);
    let (mut from, mut to) = (from, to);
    for size in sizes {
        let (from_part, from_rest) = from.split_at_mut(size);
        let (to_part, to_rest) = to.split_at_mut(size);
        parts.push((to_part, from_part));
        (from, to) = (from_rest, to_rest);
    }
    // Each digit that is left moves the elements once more, from `to` at first.
    let end = end.unwrap_or(if digits_left % 2 == 1 { Where::From } else { Where::To });
    parts.into_par_iter().for_each(|(from, to)| sort_bucket(from, to, bits.start..shift, end.other(), key));
    end
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
