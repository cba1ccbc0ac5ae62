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

// One number for each of 12 elements of an invocation: those of a are neighbours, as are those of b and of c. In
// variables of their own, since an array that a loop indexes may end up in memory.
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

// Elements past the end have the largest digit, and come last in their block.
fn digits_of(first: u32, words: vec4<u32>, count: u32) -> vec4<u32> {
    let digits = (words >> vec4<u32>(params.shift)) & vec4<u32>(params.mask);
    let element = vec4<u32>(first, first + 1u, first + 2u, first + 3u);
    return select(vec4<u32>(params.mask), digits, element < vec4<u32>(count));
}

// Word `word` of a key, or the value when a key has no such word.
fn load(element: u32, word: u32, count: u32) -> u32 {
    if element >= count {
        return 0u;
    }
    if word < params.words {
        return keys_in[element * params.words + word];
    }
    return values_in[element];
}

fn load_four(first: u32, word: u32, count: u32) -> vec4<u32> {
    return vec4<u32>(
        load(first, word, count),
        load(first + 1u, word, count),
        load(first + 2u, word, count),
        load(first + 3u, word, count),
    );
}

// One word of the elements that an invocation ranks: `local` and three more, and the same 1,024 and 2,048 further on.
fn load_twelve(block: u32, local: u32, word: u32, count: u32) -> Twelve {
    let first = block * BLOCK + 4u * local;
    return Twelve(
        load_four(first, word, count),
        load_four(first + 4u * WORKGROUP, word, count),
        load_four(first + 8u * WORKGROUP, word, count),
    );
}

fn stage_four(ranks: vec4<u32>, words: vec4<u32>) {
    staged[ranks.x] = words.x;
    staged[ranks.y] = words.y;
    staged[ranks.z] = words.z;
    staged[ranks.w] = words.w;
}

fn staged_four(first: u32) -> vec4<u32> {
    return vec4<u32>(
        staged[first],
        staged[first + WORKGROUP],
        staged[first + 2u * WORKGROUP],
        staged[first + 3u * WORKGROUP],
    );
}

fn targets_of(first: u32, words: vec4<u32>) -> vec4<u32> {
    let digits = (words >> vec4<u32>(params.shift)) & vec4<u32>(params.mask);
    return vec4<u32>(
        digit_offset[digits.x] + first,
        digit_offset[digits.y] + first + WORKGROUP,
        digit_offset[digits.z] + first + 2u * WORKGROUP,
        digit_offset[digits.w] + first + 3u * WORKGROUP,
    );
}

fn write(place: u32, size: u32, target_place: u32, word: u32, what: u32) {
    if place < size {
        if word < params.words {
            keys_out[target_place * params.words + word] = what;
        } else {
            values_out[target_place] = what;
        }
    }
}

fn write_four(first: u32, size: u32, targets: vec4<u32>, word: u32, words: vec4<u32>) {
    write(first, size, targets.x, word, words.x);
    write(first + WORKGROUP, size, targets.y, word, words.y);
    write(first + 2u * WORKGROUP, size, targets.z, word, words.z);
    write(first + 3u * WORKGROUP, size, targets.w, word, words.w);
}

// Moves the elements of a block, word by word through workgroup memory, so that invocations side by side write runs of
// neighbours. `ranks` are the places in the sorted block of the elements of load_twelve, `keys` their words with the
// digit. For all invocations at once, with `staged` free and `digit_offset` filled.
fn move_block(block: u32, local: u32, count: u32, ranks: Twelve, keys: Twelve) {
    let begin = block * BLOCK;
    let size = select(0u, count - begin, begin < count);
    let four = 4u * WORKGROUP;
    var words = keys;
    var targets: Twelve;
    for (var w = 0u; w <= params.words; w++) {
        // The word with the digit comes first, as it says where the others go; the values come last.
        let turned = params.word + w;
        let word = select(select(turned, turned - params.words, turned >= params.words), w, w == params.words);
        if w > 0u {
            words = load_twelve(block, local, word, count);
        }
        stage_four(ranks.a, words.a);
        stage_four(ranks.b, words.b);
        stage_four(ranks.c, words.c);
        workgroupBarrier();
        words = Twelve(staged_four(local), staged_four(local + four), staged_four(local + 2u * four));
        if w == 0u {
            targets.a = targets_of(local, words.a);
            targets.b = targets_of(local + four, words.b);
            targets.c = targets_of(local + 2u * four, words.c);
        }
        write_four(local, size, targets.a, word, words.a);
        write_four(local + four, size, targets.b, word, words.b);
        write_four(local + 2u * four, size, targets.c, word, words.c);
        workgroupBarrier();
    }
}
