// What the passes of the radix sort share: parameters, buffers, and the move of a ranked block.

//#import shared/thread.wgsl
//#import shared/workgroup.wgsl

const NO_WORD: u32 = 0xffffffffu;
const DIGITS: u32 = 256u; // most values of a digit
const BLOCK: u32 = 3072u; // elements a workgroup, 12 an invocation

struct SortParams {
    count: u32, // number of elements, if count_word is NO_WORD
    count_word: u32, // else the word of `counts` that has it
    capacity: u32, // at most so many elements
    words: u32, // words of a key
    word: u32, // the one that has the digit
    shift: u32, // the digit's lowest bit
    mask: u32, // its bits, once shifted
    radix: u32, // rows of the histogram, more than `mask`
}

@group(0) @binding(0) var<uniform> params: SortParams;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read> values_in: array<u32>;
@group(0) @binding(4) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(5) var<storage, read_write> values_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> histogram: array<u32>;

var<workgroup> staged: array<u32, BLOCK>; // counters at first, then one word of each element
var<workgroup> digit_offset: array<u32, DIGITS>; // from a place in the sorted block to the place in the whole array

// One number for each of 12 elements of an invocation. In variables of their own, since an array that a loop indexes
// may end up in memory.
struct Twelve {
    a: vec4<u32>,
    b: vec4<u32>,
    c: vec4<u32>,
}

fn elements() -> u32 {
    var count = params.count;
    if params.count_word != NO_WORD {
        count = counts[params.count_word];
    }
    return min(count, params.capacity);
}

fn blocks_of(count: u32) -> u32 {
    return count / BLOCK + select(0u, 1u, count % BLOCK != 0u);
}

fn digit_in(key_word: u32) -> u32 {
    return (key_word >> params.shift) & params.mask;
}

// Elements past the end have the largest digit, and come last in their block.
fn digit_of(element: u32, count: u32) -> u32 {
    if element < count {
        return digit_in(keys_in[element * params.words + params.word]);
    }
    return params.mask;
}

// Fills `digit_offset`: where the block's elements of each digit go, from the scanned histogram, less where they begin
// in the sorted block. How many there are is the step to the histogram's next element. For all invocations at once.
fn find_offsets(block: u32, local: u32, count: u32) {
    let blocks = blocks_of(count);
    var start = 0u;
    var size = 0u;
    if local < params.radix && block < blocks {
        let entry = local * blocks + block;
        start = histogram[entry];
        size = count - start;
        if entry + 1u < params.radix * blocks {
            size = histogram[entry + 1u] - start;
        }
    }
    let scanned = workgroup_scan(local, size);
    digit_offset[local] = start - scanned.before;
}

// Word `word` of a key, or the value when the key has no such word.
fn stage_one(element: u32, rank: u32, word: u32, count: u32) {
    if element < count {
        if word < params.words {
            staged[rank] = keys_in[element * params.words + word];
        } else {
            staged[rank] = values_in[element];
        }
    }
}

fn stage_four(first: u32, ranks: vec4<u32>, word: u32, count: u32) {
    stage_one(first, ranks.x, word, count);
    stage_one(first + WORKGROUP, ranks.y, word, count);
    stage_one(first + 2u * WORKGROUP, ranks.z, word, count);
    stage_one(first + 3u * WORKGROUP, ranks.w, word, count);
}

fn target_of(place: u32) -> u32 {
    return digit_offset[digit_in(staged[place])] + place;
}

fn targets_of_four(first: u32) -> vec4<u32> {
    return vec4<u32>(
        target_of(first),
        target_of(first + WORKGROUP),
        target_of(first + 2u * WORKGROUP),
        target_of(first + 3u * WORKGROUP),
    );
}

fn write_one(place: u32, target_place: u32, word: u32, size: u32) {
    if place < size {
        if word < params.words {
            keys_out[target_place * params.words + word] = staged[place];
        } else {
            values_out[target_place] = staged[place];
        }
    }
}

fn write_four(first: u32, targets: vec4<u32>, word: u32, size: u32) {
    write_one(first, targets.x, word, size);
    write_one(first + WORKGROUP, targets.y, word, size);
    write_one(first + 2u * WORKGROUP, targets.z, word, size);
    write_one(first + 3u * WORKGROUP, targets.w, word, size);
}

// Moves the elements of a block, word by word through workgroup memory, so that invocations side by side read
// neighbours and write runs of neighbours. `ranks.a.x` is the place in the sorted block of the block's element `local`,
// `ranks.a.y` that of element `local` + 256, and so on. For all invocations at once, with `staged` free.
fn move_block(block: u32, local: u32, count: u32, ranks: Twelve) {
    let begin = block * BLOCK;
    let size = select(0u, count - begin, begin < count);
    let from_place = begin + local;
    let four = 4u * WORKGROUP;
    var targets: Twelve;
    for (var w = 0u; w <= params.words; w++) {
        // The word with the digit comes first, as it says where the others go; the values come last.
        let turned = params.word + w;
        let word = select(select(turned, turned - params.words, turned >= params.words), w, w == params.words);
        stage_four(from_place, ranks.a, word, count);
        stage_four(from_place + four, ranks.b, word, count);
        stage_four(from_place + 2u * four, ranks.c, word, count);
        workgroupBarrier();
        if w == 0u {
            targets = Twelve(targets_of_four(local), targets_of_four(local + four), targets_of_four(local + 2u * four));
        }
        write_four(local, targets.a, word, size);
        write_four(local + four, targets.b, word, size);
        write_four(local + 2u * four, targets.c, word, size);
        workgroupBarrier();
    }
}
