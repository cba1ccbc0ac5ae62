//! Stable radix sort, least significant digit first: the twin of `shaders/primitives/sort.wgsl`.
//!
//! The plain version, one block: what a block does there, this does for the whole array. A stable sort has one
//! result, so the blocks do not show.

use super::exclusive_scan;

/// Most bits of one digit: up to 256 counters a pass, as on the GPU.
pub const DIGIT_BITS: u32 = 8;

/// The digits that keys of `bits.len()` words have, least significant first, as (word, shift, bits of the digit).
/// The last word is the least significant one; no digit spans two words, and those of a word share its bits evenly.
pub fn digits(bits: &[u32]) -> Vec<(u32, u32, u32)> {
    let mut digits = Vec::new();
    for (word, &used) in bits.iter().enumerate().rev() {
        let (mut shift, used) = (0, used.min(32));
        for left in (1..=used.div_ceil(DIGIT_BITS)).rev() {
            let width = (used - shift).div_ceil(left);
            digits.push((word as u32, shift, width));
            shift += width;
        }
    }
    digits
}

/// Sorts `values` by `keys`, both in place; elements of equal keys keep their order.
///
/// Element i has the words `keys[i * words ..][..words]`, the most significant one first, and of word w only the
/// lowest `bits[w]` bits count (0 to 32). The other bits move with the element.
///
/// # Panics
/// When `bits` has not `words` entries, or `keys` has not `words` words for each value.
pub fn radix_sort(keys: &mut Vec<u32>, words: usize, bits: &[u32], values: &mut Vec<u32>) {
    assert_eq!(bits.len(), words, "one entry of bits for each word of a key");
    assert_eq!(keys.len(), values.len() * words, "as many words as values need");
    let mut sorted_keys = vec![0; keys.len()];
    let mut sorted_values = vec![0; values.len()];
    for (word, shift, width) in digits(bits) {
        let digit = |keys: &[u32], i: usize| ((keys[i * words + word as usize] >> shift) & ((1 << width) - 1)) as usize;
        let mut offsets = [0u32; 1 << DIGIT_BITS];
        for i in 0..values.len() {
            offsets[digit(keys, i)] += 1;
        }
        exclusive_scan(&mut offsets);
        for i in 0..values.len() {
            let offset = &mut offsets[digit(keys, i)];
            let to = *offset as usize;
            *offset += 1;
            sorted_keys[to * words..][..words].copy_from_slice(&keys[i * words..][..words]);
            sorted_values[to] = values[i];
        }
        std::mem::swap(keys, &mut sorted_keys);
        std::mem::swap(values, &mut sorted_values);
    }
}

#[cfg(test)]
mod tests {
    use super::{digits, radix_sort};

    #[test]
    fn digits_stay_within_words() {
        assert_eq!(digits(&[2, 17]), [(1, 0, 6), (1, 6, 6), (1, 12, 5), (0, 0, 2)]);
        assert_eq!(digits(&[32]), [(0, 0, 8), (0, 8, 8), (0, 16, 8), (0, 24, 8)]);
        assert_eq!(digits(&[9]), [(0, 0, 5), (0, 5, 4)]);
        assert_eq!(digits(&[0, 0]), []);
    }

    #[test]
    fn sorts_by_the_bits_that_count_and_keeps_the_order_of_equals() {
        let mut keys = vec![1, 0xf2, 0, 0x13, 1, 0x02, 0, 0x03];
        let mut values = vec![10, 11, 12, 13];
        radix_sort(&mut keys, 2, &[1, 4], &mut values);
        assert_eq!(values, [11, 13, 10, 12]);
        assert_eq!(keys, [0, 0x13, 0, 0x03, 1, 0xf2, 1, 0x02]);
    }
}
