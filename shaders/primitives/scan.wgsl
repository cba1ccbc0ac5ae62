// Exclusive scan of u32, in place: reduce, then scan; no workgroup waits for another.
//
// `reduce` writes the sum of each block of 2,048 elements to `sums`, `scan_sums` scans those, `scan_blocks` scans each
// block and adds what came before it. One workgroup a block; `scan_sums` is one workgroup that goes through the array
// bound as its `data` 2,048 elements at a time, and enough for a short array. An invocation scans 8 neighbours, and
// reads and writes elements far apart, so that invocations side by side meet in memory: workgroup memory swaps the two.
//
// Reads and writes `data`. The number of elements is `elements()`; the sum of all goes to a word of `counts`. After
// Merrill and Grimshaw, "Parallel Scan for Stream Architectures" (2009).

//#import shared/thread.wgsl
//#import shared/workgroup.wgsl

const NO_WORD: u32 = 0xffffffffu;
const EACH: u32 = 8u; // neighbours that an invocation scans
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

// Rows of 8 and a gap, so that invocations side by side meet no bank conflict.
var<workgroup> rows: array<u32, 2304>;

fn slot(element: u32) -> u32 {
    return element + element / EACH;
}

// Fills `rows` with a block's elements, zero past the end. For all invocations at once.
fn load(start: u32, local: u32, count: u32) {
    for (var k = local; k < BLOCK; k += WORKGROUP) {
        var value = 0u;
        if start + k < count {
            value = data[start + k];
        }
        rows[slot(k)] = value;
    }
    workgroupBarrier();
}

// Scans `rows` and returns the sum of all. For all invocations at once.
fn scan_rows(local: u32, start: u32) -> u32 {
    let base = (EACH + 1u) * local;
    var sum = 0u;
    for (var k = 0u; k < EACH; k++) {
        sum += rows[base + k];
    }
    let scanned = workgroup_scan(local, sum);
    var before = start + scanned.before;
    for (var k = 0u; k < EACH; k++) {
        let value = rows[base + k];
        rows[base + k] = before;
        before += value;
    }
    workgroupBarrier();
    return scanned.total;
}

// Writes `rows` back. An invocation reads what it will load next, so that no barrier is needed after it.
fn store(start: u32, local: u32, count: u32) {
    for (var k = local; k < BLOCK; k += WORKGROUP) {
        if start + k < count {
            data[start + k] = rows[slot(k)];
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
    var sum = 0u;
    for (var k = local; k < BLOCK; k += WORKGROUP) {
        if block * BLOCK + k < count {
            sum += data[block * BLOCK + k];
        }
    }
    let total = workgroup_scan(local, sum).total;
    if local == 0u && block * BLOCK < count {
        sums[block] = total;
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
        load(start, local, count);
        carry += scan_rows(local, carry);
        store(start, local, count);
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
    let start = block * BLOCK;
    var before = 0u;
    if start < count {
        before = sums[block];
    }
    load(start, local, count);
    scan_rows(local, before);
    store(start, local, count);
}
