// Stable radix sort of keys of 1 to 4 words with one value each: one digit of up to 8 bits, least significant first, by
//
//   count_digits   how often each digit occurs in each block of 3,072 elements, to `histogram`, digit by digit;
//   (primitives/scan of `histogram`: where each block's elements of each digit go)
//   scatter        ranks the elements of a block and moves them there;
//   copy           moves everything back if the number of digits was odd.
//
// One workgroup a block, 12 elements an invocation. Reads `keys_in` (element i's words from i * words on) and
// `values_in`, writes `keys_out` and `values_out`. `scatter` sorts its block by half a digit at a time, with counters
// for each invocation; primitives/sort_subgroup has another. After Satish, Harris and Garland, "Designing Efficient
// Sorting Algorithms for Manycore GPUs" (2009), and Harada and Howes, "Introduction to GPU Radix Sort" (2011).

//#import shared/sort.wgsl

const COPIES: u32 = 4u; // of the counters of count_digits, so that equal digits wait less for one another
const HALF_BITS: u32 = 4u;
const HALF_MASK: u32 = 15u;

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
            atomicAdd(&digit_count[copy_start + digit_of(element, count)], 1u);
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

// Counts one half digit in fields of 4 bits, 8 a word, and returns how many there were before. An invocation has 12
// elements, so that no field overflows.
fn take(fields: ptr<function, vec2<u32>>, half: u32) -> u32 {
    let shift = 4u * (half & 7u);
    let one = 1u << shift;
    let is_upper = half >= 8u;
    let before = (select((*fields).x, (*fields).y, is_upper) >> shift) & 15u;
    *fields += select(vec2<u32>(one, 0u), vec2<u32>(0u, one), is_upper);
    return before;
}

fn take_four(fields: ptr<function, vec2<u32>>, halves: vec4<u32>) -> vec4<u32> {
    let x = take(fields, halves.x);
    let y = take(fields, halves.y);
    let z = take(fields, halves.z);
    let w = take(fields, halves.w);
    return vec4<u32>(x, y, z, w);
}

// Counters of the block lie in `staged`, 8 words an invocation, two counters a word: half digits 0 to 7 are the lower
// parts of words 0 to 7, those of 8 to 15 the upper ones. A block has 3,072 elements, so that no sum of a lower part
// reaches the upper one. A gap after each 8 words avoids bank conflicts.
fn counter(word: u32, local: u32) -> u32 {
    return 288u * word + local + local / 8u;
}

// Place in the sorted block of the first element of this half digit that an invocation has.
fn place(half: u32, local: u32, lower_total: u32) -> u32 {
    let upper = half >> 3u;
    return ((staged[counter(half & 7u, local)] >> (16u * upper)) & 0xffffu) + upper * lower_total;
}

fn places(halves: vec4<u32>, local: u32, lower_total: u32) -> vec4<u32> {
    return vec4<u32>(
        place(halves.x, local, lower_total),
        place(halves.y, local, lower_total),
        place(halves.z, local, lower_total),
        place(halves.w, local, lower_total),
    );
}

// Places of 12 consecutive elements an invocation in the block sorted by these half digits. For all invocations at
// once; `staged` is free before and after.
fn rank_halves(local: u32, halves: Twelve) -> Twelve {
    var fields = vec2<u32>();
    var ranks: Twelve;
    ranks.a = take_four(&fields, halves.a);
    ranks.b = take_four(&fields, halves.b);
    ranks.c = take_four(&fields, halves.c);
    for (var word = 0u; word < 8u; word++) {
        let pair = (fields >> vec2<u32>(4u * word)) & vec2<u32>(15u);
        staged[counter(word, local)] = pair.x | (pair.y << 16u);
    }
    workgroupBarrier();

    // Scan all counters, word by word and invocation by invocation within a word: 8 consecutive ones an invocation.
    var sum = 0u;
    for (var k = 0u; k < 8u; k++) {
        sum += staged[9u * local + k];
    }
    let scanned = workgroup_scan(local, sum);
    var before = scanned.before;
    for (var k = 0u; k < 8u; k++) {
        let value = staged[9u * local + k];
        staged[9u * local + k] = before;
        before += value;
    }
    workgroupBarrier();

    let lower_total = scanned.total & 0xffffu;
    ranks.a += places(halves.a, local, lower_total);
    ranks.b += places(halves.b, local, lower_total);
    ranks.c += places(halves.c, local, lower_total);
    workgroupBarrier();
    return ranks;
}

fn store_four(at: vec4<u32>, what: vec4<u32>) {
    staged[at.x] = what.x;
    staged[at.y] = what.y;
    staged[at.z] = what.z;
    staged[at.w] = what.w;
}

fn load_four(first: u32, step: u32) -> vec4<u32> {
    return vec4<u32>(staged[first], staged[first + step], staged[first + 2u * step], staged[first + 3u * step]);
}

// The four bytes of a word.
fn bytes_of(word: u32) -> vec4<u32> {
    return (vec4<u32>(word) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(0xffu);
}

@compute @workgroup_size(256)
fn scatter(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let count = elements();
    let block = workgroup_index(wg, num);
    let local = local_index(lid);
    find_offsets(block, local, count);

    // The digits of 4 neighbours make a word; an invocation reads words far apart and then has 3 that are neighbours.
    for (var four = local; four < BLOCK / 4u; four += WORKGROUP) {
        let element = block * BLOCK + 4u * four;
        var word = digit_of(element, count);
        word |= digit_of(element + 1u, count) << 8u;
        word |= digit_of(element + 2u, count) << 16u;
        word |= digit_of(element + 3u, count) << 24u;
        staged[four] = word;
    }
    workgroupBarrier();
    let digits = Twelve(bytes_of(staged[3u * local]), bytes_of(staged[3u * local + 1u]), bytes_of(staged[3u * local + 2u]));
    workgroupBarrier();

    let half = vec4<u32>(HALF_MASK);
    var ranks = rank_halves(local, Twelve(digits.a & half, digits.b & half, digits.c & half));
    // 12 bits of the number in the block, and the digit's upper half.
    let number = 12u * local + vec4<u32>(0u, 1u, 2u, 3u);
    let bits = vec4<u32>(HALF_BITS);
    let up = vec4<u32>(12u);
    var items = Twelve(
        number | ((digits.a >> bits) << up),
        (number + 4u) | ((digits.b >> bits) << up),
        (number + 8u) | ((digits.c >> bits) << up),
    );
    if params.mask > HALF_MASK {
        store_four(ranks.a, items.a);
        store_four(ranks.b, items.b);
        store_four(ranks.c, items.c);
        workgroupBarrier();
        items = Twelve(load_four(12u * local, 1u), load_four(12u * local + 4u, 1u), load_four(12u * local + 8u, 1u));
        workgroupBarrier();
        ranks = rank_halves(local, Twelve(items.a >> up, items.b >> up, items.c >> up));
    }
    let low = vec4<u32>(0xfffu);
    store_four(items.a & low, ranks.a);
    store_four(items.b & low, ranks.b);
    store_four(items.c & low, ranks.c);
    workgroupBarrier();
    ranks = Twelve(
        load_four(local, WORKGROUP),
        load_four(local + 4u * WORKGROUP, WORKGROUP),
        load_four(local + 8u * WORKGROUP, WORKGROUP),
    );
    workgroupBarrier();
    move_block(block, local, count, ranks);
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
