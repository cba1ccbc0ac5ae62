// Stable radix sort of keys of 1 to 4 words with one value each: one digit of 4 bits, least significant first, by
//
//   count_digits   how often each digit occurs in each block of 1,024 elements, to `histogram`, digit by digit;
//   (primitives/scan of `histogram`: where each block's elements of each digit go)
//   scatter        ranks the elements of a block and moves them there;
//   copy           moves everything back if the number of digits was odd.
//
// One workgroup a block, 4 consecutive elements an invocation. Reads `keys_in` (element i's words from i * words on)
// and `values_in`, writes `keys_out` and `values_out`. After Satish, Harris and Garland, "Designing Efficient Sorting
// Algorithms for Manycore GPUs" (2009), and Harada and Howes, "Introduction to GPU Radix Sort" (2011).

//#import shared/thread.wgsl
//#import shared/workgroup.wgsl

const NO_WORD: u32 = 0xffffffffu;
const DIGITS: u32 = 16u;
const EACH: u32 = 4u; // elements an invocation
const BLOCK: u32 = 1024u; // elements a workgroup
const COUNTERS: u32 = 8u; // words of counters an invocation, two counters a word

struct SortParams {
    count: u32, // number of elements, if count_word is NO_WORD
    count_word: u32, // else the word of `counts` that has it
    capacity: u32, // at most so many elements
    words: u32, // words of a key
    word: u32, // the one that has the digit
    shift: u32, // the digit's lowest bit
    mask: u32, // its bits, once shifted
    unused: u32,
}

@group(0) @binding(0) var<uniform> params: SortParams;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read> values_in: array<u32>;
@group(0) @binding(4) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(5) var<storage, read_write> values_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> histogram: array<u32>;

var<workgroup> digit_count: array<atomic<u32>, DIGITS>; // zero at first, like all workgroup memory
var<workgroup> counters: array<u32, 2048>; // 8 x 256: counter words of all invocations, word by word
var<workgroup> order: array<u32, BLOCK>; // which element comes at which place of the sorted block

fn elements() -> u32 {
    var count = params.count;
    if params.count_word != NO_WORD {
        count = counts[params.count_word];
    }
    return min(count, params.capacity);
}

fn blocks_of(count: u32) -> u32 {
    return (count + BLOCK - 1u) / BLOCK;
}

fn digit_of(element: u32) -> u32 {
    return (keys_in[element * params.words + params.word] >> params.shift) & params.mask;
}

fn move_element(from_place: u32, to_place: u32) {
    for (var w = 0u; w < params.words; w++) {
        keys_out[to_place * params.words + w] = keys_in[from_place * params.words + w];
    }
    values_out[to_place] = values_in[from_place];
}

@compute @workgroup_size(256)
fn count_digits(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let count = elements();
    let block = workgroup_index(wg, num);
    let local = local_index(lid);
    for (var k = 0u; k < EACH; k++) {
        let element = block * BLOCK + k * WORKGROUP + local;
        if element < count {
            atomicAdd(&digit_count[digit_of(element)], 1u);
        }
    }
    workgroupBarrier();
    if local < DIGITS && block < blocks_of(count) {
        histogram[local * blocks_of(count) + block] = atomicLoad(&digit_count[local]);
    }
}

// Counters of digits 0 to 7 are the lower halves of the 8 words, those of 8 to 15 the upper ones. A block has 1,024
// elements, so that no sum of a lower half reaches the upper one.
fn half_of(word: u32, digit: u32) -> u32 {
    return select(word & 0xffffu, word >> 16u, digit >= COUNTERS);
}

// Place in the sorted block of the first element of this digit that an invocation has, from the scanned counters.
fn place(digit: u32, local: u32, lower_total: u32) -> u32 {
    let before = half_of(counters[(digit % COUNTERS) * WORKGROUP + local], digit);
    return before + select(0u, lower_total, digit >= COUNTERS);
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
    let first = block * BLOCK + local * EACH;

    // Count this invocation's digits, and rank each of its elements among those of the same digit.
    for (var w = 0u; w < COUNTERS; w++) {
        counters[w * WORKGROUP + local] = 0u;
    }
    var digits: array<u32, EACH>;
    var ranks: array<u32, EACH>;
    for (var k = 0u; k < EACH; k++) {
        if first + k < count {
            let digit = digit_of(first + k);
            let counter = (digit % COUNTERS) * WORKGROUP + local;
            digits[k] = digit;
            ranks[k] = half_of(counters[counter], digit);
            counters[counter] += select(1u, 0x10000u, digit >= COUNTERS);
        }
    }
    workgroupBarrier();

    // Scan all counters, word by word and invocation by invocation within a word: 8 consecutive ones an invocation.
    var sum = 0u;
    for (var k = 0u; k < COUNTERS; k++) {
        sum += counters[local * COUNTERS + k];
    }
    let scanned = workgroup_scan(local, sum);
    var before = scanned.before;
    for (var k = 0u; k < COUNTERS; k++) {
        let value = counters[local * COUNTERS + k];
        counters[local * COUNTERS + k] = before;
        before += value;
    }
    workgroupBarrier();

    let lower_total = scanned.total & 0xffffu;
    for (var k = 0u; k < EACH; k++) {
        if first + k < count {
            order[place(digits[k], local, lower_total) + ranks[k]] = local * EACH + k;
        }
    }
    workgroupBarrier();

    // Move the elements in their new order, so that neighbours write to neighbouring places.
    for (var k = 0u; k < EACH; k++) {
        let sorted = k * WORKGROUP + local;
        if block * BLOCK + sorted < count {
            let element = block * BLOCK + order[sorted];
            let digit = digit_of(element);
            move_element(element, histogram[digit * blocks + block] + sorted - place(digit, 0u, lower_total));
        }
    }
}

@compute @workgroup_size(256)
fn copy(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let count = elements();
    let block = workgroup_index(wg, num);
    for (var k = 0u; k < EACH; k++) {
        let element = block * BLOCK + k * WORKGROUP + local_index(lid);
        if element < count {
            move_element(element, element);
        }
    }
}
