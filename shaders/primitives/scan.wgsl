// Exclusive scan of u32, in place: reduce, then scan; no workgroup waits for another.
//
// `reduce` writes the sum of each block of 2,048 elements to `sums`, `scan_sums` scans those, `scan_blocks` scans each
// block and adds what came before it. One workgroup a block, 8 consecutive elements an invocation; `scan_sums` is one
// workgroup that goes through the array bound as its `data` 2,048 elements at a time, and enough for a short array.
//
// Reads and writes `data`. The number of elements is `elements()`; the sum of all goes to a word of `counts`. After
// Merrill and Grimshaw, "Parallel Scan for Stream Architectures" (2009).

//#import shared/thread.wgsl
//#import shared/workgroup.wgsl

const NO_WORD: u32 = 0xffffffffu;
const EACH: u32 = 8u; // elements an invocation
const BLOCK: u32 = 2048u; // elements a workgroup

struct ScanParams {
    count: u32, // how many, if count_word is NO_WORD
    count_word: u32, // else the word of `counts` that says it
    per: u32, // the array has `times` elements for each `per` of them, the last ones rounded up
    times: u32,
    units: u32, // at most so many times `times` elements
    total_word: u32, // word of `counts` where the sum of all goes, unless NO_WORD
    unused_a: u32,
    unused_b: u32,
}

@group(0) @binding(0) var<uniform> params: ScanParams;
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> data: array<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<u32>;

var<workgroup> shared_count: u32;

fn elements() -> u32 {
    var count = params.count;
    if params.count_word != NO_WORD {
        count = counts[params.count_word];
    }
    let units = count / params.per + select(0u, 1u, count % params.per != 0u);
    return min(units, params.units) * params.times;
}

// The 8 elements of one invocation: sum of those before each, and the sum of all.
struct Eight {
    before: array<u32, EACH>,
    sum: u32,
}

fn load(first: u32, count: u32) -> Eight {
    var eight: Eight;
    for (var k = 0u; k < EACH; k++) {
        eight.before[k] = eight.sum;
        if first + k < count {
            eight.sum += data[first + k];
        }
    }
    return eight;
}

fn store(first: u32, count: u32, start: u32, eight: Eight) {
    var parts = eight;
    for (var k = 0u; k < EACH; k++) {
        if first + k < count {
            data[first + k] = start + parts.before[k];
        }
    }
}

@compute @workgroup_size(256)
fn reduce(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let count = elements();
    let block = workgroup_index(wg, num);
    let local = local_index(lid);
    let scanned = workgroup_scan(local, load(block * BLOCK + local * EACH, count).sum);
    if local == 0u && block * BLOCK < count {
        sums[block] = scanned.total;
    }
}

@compute @workgroup_size(256)
fn scan_sums(@builtin(local_invocation_index) lid: u32) {
    let local = local_index(lid);
    if local == 0u {
        shared_count = elements();
    }
    let count = workgroupUniformLoad(&shared_count);
    var carry = 0u;
    for (var start = 0u; start < count; start += BLOCK) {
        let first = start + local * EACH;
        let eight = load(first, count);
        let scanned = workgroup_scan(local, eight.sum);
        store(first, count, carry + scanned.before, eight);
        carry += scanned.total;
    }
    if local == 0u && params.total_word != NO_WORD {
        counts[params.total_word] = carry;
    }
}

@compute @workgroup_size(256)
fn scan_blocks(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let count = elements();
    let block = workgroup_index(wg, num);
    let local = local_index(lid);
    let first = block * BLOCK + local * EACH;
    let eight = load(first, count);
    let scanned = workgroup_scan(local, eight.sum);
    if first < count {
        store(first, count, sums[block] + scanned.before, eight);
    }
}
