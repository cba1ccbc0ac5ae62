// Stable compaction: what has a flag that is not zero, in order and without gaps, by
//
//   count_kept     how many each block of 2,048 elements keeps, to `sums`;
//   (primitives/scan of `sums`: where each block's go; the sum of all is how many there are)
//   write_indices  writes the indices of those kept to `kept`, or
//   write_values   writes their `values`.
//
// One workgroup a block, 8 elements an invocation. Reads `flags`. After Billeter, Olsson and Assarsson, "Efficient
// Stream Compaction on Wide SIMD Many-Core Architectures" (2009).

//#import shared/thread.wgsl
//#import shared/workgroup.wgsl

const NO_WORD: u32 = 0xffffffffu;
const EACH: u32 = 8u; // neighbours that an invocation ranks
const BLOCK: u32 = 2048u; // elements a workgroup

struct CompactParams {
    count: u32, // number of elements, if count_word is NO_WORD
    count_word: u32, // else the word of `counts` that has it
    capacity: u32, // at most so many elements
    unused: u32,
}

@group(0) @binding(0) var<uniform> params: CompactParams;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read> values: array<u32>;
@group(0) @binding(4) var<storage, read_write> sums: array<u32>;
@group(0) @binding(5) var<storage, read_write> kept: array<u32>;

// Flags of the block, in rows of 8 and a gap against bank conflicts; then the elements that it keeps.
var<workgroup> rows: array<u32, 2304>;

fn elements() -> u32 {
    var count = params.count;
    if params.count_word != NO_WORD {
        count = counts[params.count_word];
    }
    return min(count, params.capacity);
}

fn is_kept(element: u32, count: u32) -> u32 {
    if element < count {
        return select(0u, 1u, flags[element] != 0u);
    }
    return 0u;
}

@compute @workgroup_size(256)
fn count_kept(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let count = elements();
    let block = workgroup_index(wg, num);
    let local = local_index(lid);
    var sum = 0u;
    for (var k = local; k < BLOCK; k += WORKGROUP) {
        sum += is_kept(block * BLOCK + k, count);
    }
    let total = workgroup_scan(local, sum).total;
    if local == 0u && block * BLOCK < count {
        sums[block] = total;
    }
}

// Fills `rows` with the numbers in the block of those kept, and returns how many. For all invocations at once.
fn gather(start: u32, local: u32, count: u32) -> u32 {
    for (var k = local; k < BLOCK; k += WORKGROUP) {
        rows[k + k / EACH] = is_kept(start + k, count);
    }
    workgroupBarrier();
    var flagged = 0u; // a bit each
    for (var k = 0u; k < EACH; k++) {
        flagged |= rows[(EACH + 1u) * local + k] << k;
    }
    let scanned = workgroup_scan(local, countOneBits(flagged));
    var place = scanned.before;
    for (var k = 0u; k < EACH; k++) {
        if ((flagged >> k) & 1u) == 1u {
            rows[place] = EACH * local + k;
            place += 1u;
        }
    }
    workgroupBarrier();
    return scanned.total;
}

@compute @workgroup_size(256)
fn write_indices(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let start = workgroup_index(wg, num) * BLOCK;
    let local = local_index(lid);
    let total = gather(start, local, elements());
    for (var place = local; place < total; place += WORKGROUP) {
        kept[sums[start / BLOCK] + place] = start + rows[place];
    }
}

@compute @workgroup_size(256)
fn write_values(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let start = workgroup_index(wg, num) * BLOCK;
    let local = local_index(lid);
    let total = gather(start, local, elements());
    for (var place = local; place < total; place += WORKGROUP) {
        kept[sums[start / BLOCK] + place] = values[start + rows[place]];
    }
}
