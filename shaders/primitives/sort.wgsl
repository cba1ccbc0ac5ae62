// Stable radix sort of keys of 1 to 4 words with one value each: one digit of up to 8 bits, least significant first, by
//
//   count_digits   how often each digit occurs in each block of 3,072 elements, to `histogram`, digit by digit;
//   (primitives/scan of `histogram`: where each block's elements of each digit go)
//   scatter        ranks the elements of a block and moves them there;
//   copy           moves everything back if the number of digits was odd.
//
// One workgroup a block, 12 elements an invocation. Reads `keys_in` (element i's words from i * words on) and
// `values_in`, writes `keys_out` and `values_out`. `scatter` ranks the 192 elements of
// each of 16 columns one after the other; primitives/sort_subgroup has another way. After Satish, Harris and Garland, "Designing Efficient
// Sorting Algorithms for Manycore GPUs" (2009), and Harada and Howes, "Introduction to GPU Radix Sort" (2011).

//#import shared/sort.wgsl

const COPIES: u32 = 4u; // of the counters of count_digits, so that equal digits wait less for one another
const COLUMNS: u32 = 16u; // of a block
const COLUMN_WORDS: u32 = 48u; // four elements a word
const FOURS: u32 = 2304u; // where these words begin in `staged`, behind the counters

var<workgroup> digit_count: array<atomic<u32>, 1024>; // COPIES * DIGITS; zero at first, like all workgroup memory

@compute @workgroup_size(256)
fn count_digits(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let count = elements();
    let blocks = blocks_of(count);
    let block = workgroup_index(wg, num);
    let local = local_index(lid);
    let copy_start = (local % COPIES) * DIGITS;
    for (var k = local; k < BLOCK; k += WORKGROUP) {
        let element = block * BLOCK + k;
        if element < count {
            let digit = (keys_in[element * params.words + params.word] >> params.shift) & params.mask;
            atomicAdd(&digit_count[copy_start + digit], 1u);
        }
    }
    workgroupBarrier();
    if local < params.radix && block < blocks {
        var sum = 0u;
        for (var k = 0u; k < COPIES; k++) {
            sum += atomicLoad(&digit_count[k * DIGITS + local]);
        }
        histogram[local * blocks + block] = sum;
    }
}

// Counters lie in `staged`, one for each digit and each column of 192 elements, digit by digit, two a word: those of
// digits 0 to 127 are the lower parts of the words, those of 128 to 255 the upper ones. A block has 3,072 elements, so
// that no sum of a lower part reaches the upper one. A gap after each 8 words avoids bank conflicts.
fn counter(digit: u32, column: u32) -> u32 {
    let index = (digit & 127u) * COLUMNS + column;
    return index + index / 8u;
}

fn part_of(counter_word: u32, digit: u32) -> u32 {
    return (counter_word >> (16u * (digit >> 7u))) & 0xffffu;
}

// Counts one element, and returns how many of its digit came before it in its column.
fn take(digit: u32, column: u32) -> u32 {
    let at = counter(digit, column);
    let before = staged[at];
    staged[at] = before + (1u << (16u * (digit >> 7u)));
    return part_of(before, digit);
}

// Place in the sorted block of a column's first element of this digit, from the scanned counters.
fn place(digit: u32, column: u32, lower_total: u32) -> u32 {
    return part_of(staged[counter(digit, column)], digit) + select(0u, lower_total, digit > 127u);
}

// Places of the four elements whose ranks in their column are the bytes of word `four`.
fn places(four: u32, digits: vec4<u32>, lower_total: u32) -> vec4<u32> {
    let column = four / COLUMN_WORDS;
    let first = vec4<u32>(
        place(digits.x, column, lower_total),
        place(digits.y, column, lower_total),
        place(digits.z, column, lower_total),
        place(digits.w, column, lower_total),
    );
    let ranks = (vec4<u32>(staged[FOURS + four]) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(0xffu);
    return first + ranks;
}

fn packed(bytes: vec4<u32>) -> u32 {
    return bytes.x | (bytes.y << 8u) | (bytes.z << 16u) | (bytes.w << 24u);
}

@compute @workgroup_size(256)
fn scatter(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let count = elements();
    let blocks = blocks_of(count);
    let block = workgroup_index(wg, num);
    let local = local_index(lid);
    let keys = load_twelve(block, local, params.word, count);
    let first = block * BLOCK + 4u * local;
    let digits = Twelve(
        digits_of(first, keys.a, count),
        digits_of(first + 4u * WORKGROUP, keys.b, count),
        digits_of(first + 8u * WORKGROUP, keys.c, count),
    );
    staged[FOURS + local] = packed(digits.a);
    staged[FOURS + WORKGROUP + local] = packed(digits.b);
    staged[FOURS + 2u * WORKGROUP + local] = packed(digits.c);
    workgroupBarrier();

    // One invocation a column ranks its elements, one after the other: each digit gives way to its rank.
    if local < COLUMNS {
        let begin = FOURS + local * COLUMN_WORDS;
        for (var at = begin; at < begin + COLUMN_WORDS; at++) {
            let four = staged[at];
            var ranks = take(four & 0xffu, local);
            ranks |= take((four >> 8u) & 0xffu, local) << 8u;
            ranks |= take((four >> 16u) & 0xffu, local) << 16u;
            staged[at] = ranks | (take(four >> 24u, local) << 24u);
        }
    }
    workgroupBarrier();

    // Scan all counters: 8 consecutive ones an invocation.
    let base = 9u * local;
    let low = vec4<u32>(staged[base], staged[base + 1u], staged[base + 2u], staged[base + 3u]);
    let high = vec4<u32>(staged[base + 4u], staged[base + 5u], staged[base + 6u], staged[base + 7u]);
    let low_sum = low.x + low.y + low.z + low.w;
    let scanned = workgroup_scan(local, low_sum + high.x + high.y + high.z + high.w);
    let low_before = scanned.before + vec4<u32>(0u, low.x, low.x + low.y, low.x + low.y + low.z);
    let high_before = scanned.before + low_sum + vec4<u32>(0u, high.x, high.x + high.y, high.x + high.y + high.z);
    stage_four(vec4<u32>(base, base + 1u, base + 2u, base + 3u), low_before);
    stage_four(vec4<u32>(base + 4u, base + 5u, base + 6u, base + 7u), high_before);
    workgroupBarrier();

    let lower_total = scanned.total & 0xffffu;
    if local < params.radix && block < blocks {
        digit_offset[local] = histogram[local * blocks + block] - place(local, 0u, lower_total);
    }
    let ranks = Twelve(
        places(local, digits.a, lower_total),
        places(local + WORKGROUP, digits.b, lower_total),
        places(local + 2u * WORKGROUP, digits.c, lower_total),
    );
    workgroupBarrier();
    move_block(block, local, count, ranks, keys);
}

@compute @workgroup_size(256)
fn copy(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let end = min(elements(), (workgroup_index(wg, num) + 1u) * BLOCK);
    for (var k = local_index(lid); k < BLOCK; k += WORKGROUP) {
        let element = workgroup_index(wg, num) * BLOCK + k;
        if element < end {
            for (var w = 0u; w < params.words; w++) {
                keys_out[element * params.words + w] = keys_in[element * params.words + w];
            }
            values_out[element] = values_in[element];
        }
    }
}
