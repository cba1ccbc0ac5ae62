// The radix sort's `scatter` with sub-group operations, for devices that have them; all else is as in primitives/sort.
//
// One workgroup a block of 3,072 elements. Each sub-group takes 12 consecutive elements for each of its invocations, a
// row of neighbours at a time, and ranks them by warp-level multi-split: one ballot for each bit of the digit tells an
// invocation which others have its digit. Up to 8 columns of counters; where sub-groups are so small that there are
// more than 8, they take turns at a column.
//
// Nothing is assumed about the size of sub-groups, nor about which invocations make one: sub-groups take their part of
// the block in the order in which they arrive. That order, and the one in which invocations are numbered, has no part
// in the result. After Ashkiani, Davidson, Meyer and Owens, "GPU Multisplit" (2016).

//#import shared/sort.wgsl

const COLUMNS: u32 = 8u;
const MOST_BITS: u32 = 8u;

var<workgroup> arrivals: atomic<u32>; // invocations so far, and sub-groups so far from bit 16 on; zero at first
var<workgroup> arrived: u32;

// Where an invocation stands.
struct Lane {
    first: u32, // its first element in the block
    step: u32, // from each of its elements to the next
    column: u32,
    is_its_turn: bool,
    lower: vec4<u32>, // the invocations of the sub-group before it, a bit each
}

fn lower_lanes(id: u32) -> vec4<u32> {
    var lower = vec4<u32>();
    for (var k = 0u; k < 4u; k++) {
        if id >= 32u * (k + 1u) {
            lower[k] = 0xffffffffu;
        } else if id > 32u * k {
            lower[k] = (1u << (id - 32u * k)) - 1u;
        }
    }
    return lower;
}

fn bits_in(lanes: vec4<u32>) -> u32 {
    let bits = countOneBits(lanes);
    return bits.x + bits.y + bits.z + bits.w;
}

fn lowest_lane(lanes: vec4<u32>) -> u32 {
    if lanes.x != 0u {
        return firstTrailingBit(lanes.x);
    }
    if lanes.y != 0u {
        return 32u + firstTrailingBit(lanes.y);
    }
    if lanes.z != 0u {
        return 64u + firstTrailingBit(lanes.z);
    }
    return 96u + firstTrailingBit(lanes.w);
}

// Counts a row of elements. Returns the digit and, from bit 16 on, how many of it came before in the column. All
// invocations at once; what it returns out of turn is of no use.
fn rank_row(row: u32, begin: u32, count: u32, lane: Lane) -> u32 {
    let element = begin + lane.first + row * lane.step;
    let digit = digits_of(element, vec4<u32>(load(element, params.word, count)), count).x;
    var same = subgroupBallot(true);
    for (var bit = 0u; bit < min(countOneBits(params.mask), MOST_BITS); bit++) {
        let is_set = ((digit >> bit) & 1u) == 1u;
        let votes = subgroupBallot(is_set);
        same &= select(~votes, votes, is_set);
    }
    let before = bits_in(same & lane.lower);
    var base = 0u;
    if lane.is_its_turn && before == 0u {
        let at = lane.column * DIGITS + digit;
        base = staged[at];
        staged[at] = base + bits_in(same);
    }
    base = subgroupShuffle(base, lowest_lane(same));
    workgroupBarrier(); // another invocation may have the digit in the next row
    return digit | ((base + before) << 16u);
}

fn rank_four(first: u32, begin: u32, count: u32, lane: Lane) -> vec4<u32> {
    let x = rank_row(first, begin, count, lane);
    let y = rank_row(first + 1u, begin, count, lane);
    let z = rank_row(first + 2u, begin, count, lane);
    let w = rank_row(first + 3u, begin, count, lane);
    return vec4<u32>(x, y, z, w);
}

// Places in the sorted block, from what rank_four returned and the scanned counters.
fn places(ranked: vec4<u32>, column: u32) -> vec4<u32> {
    let at = column * DIGITS + (ranked & vec4<u32>(0xffu));
    return vec4<u32>(staged[at.x], staged[at.y], staged[at.z], staged[at.w]) + (ranked >> vec4<u32>(16u));
}

@compute @workgroup_size(256)
fn scatter(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
    @builtin(subgroup_invocation_id) id: u32,
) {
    let count = elements();
    let blocks = blocks_of(count);
    let block = workgroup_index(wg, num);
    let local = local_index(lid);

    let size = subgroupAdd(1u);
    let number = subgroupExclusiveAdd(1u);
    var before = 0u;
    if number == 0u {
        before = atomicAdd(&arrivals, size | (1u << 16u));
    }
    before = subgroupBroadcastFirst(before);
    workgroupBarrier();
    if local == 0u {
        arrived = atomicLoad(&arrivals);
    }
    let turns = ((workgroupUniformLoad(&arrived) >> 16u) + COLUMNS - 1u) / COLUMNS;
    let subgroup = before >> 16u;
    var lane: Lane;
    lane.first = (before & 0xffffu) * 12u + number;
    lane.step = size;
    lane.column = subgroup / turns;
    lane.lower = lower_lanes(id);

    // Counters are zero at first, like all workgroup memory.
    var ranked: Twelve;
    for (var turn = 0u; turn < min(turns, 32u); turn++) {
        lane.is_its_turn = subgroup % turns == turn;
        let a = rank_four(0u, block * BLOCK, count, lane);
        let b = rank_four(4u, block * BLOCK, count, lane);
        let c = rank_four(8u, block * BLOCK, count, lane);
        if lane.is_its_turn {
            ranked = Twelve(a, b, c);
        }
    }

    // Scan the counters, digit by digit, one an invocation, and column by column within a digit.
    var sum = 0u;
    for (var column = 0u; column < COLUMNS; column++) {
        let at = column * DIGITS + local;
        let value = staged[at];
        staged[at] = sum;
        sum += value;
    }
    let start = workgroup_scan(local, sum).before;
    for (var column = 0u; column < COLUMNS; column++) {
        staged[column * DIGITS + local] += start;
    }
    if local < params.radix && block < blocks {
        digit_offset[local] = histogram[local * blocks + block] - start;
    }
    workgroupBarrier();
    let a = places(ranked.a, lane.column);
    let b = places(ranked.b, lane.column);
    let c = places(ranked.c, lane.column);
    workgroupBarrier();

    // Hand each place to the invocation that moves the element.
    let numbers = vec4<u32>(lane.first) + vec4<u32>(0u, 1u, 2u, 3u) * lane.step;
    stage_four(numbers, a);
    stage_four(numbers + 4u * lane.step, b);
    stage_four(numbers + 8u * lane.step, c);
    workgroupBarrier();
    var ranks: Twelve;
    ranks.a = neighbours(4u * local);
    ranks.b = neighbours(4u * (local + WORKGROUP));
    ranks.c = neighbours(4u * (local + 2u * WORKGROUP));
    workgroupBarrier();
    move_block(block, local, count, ranks, load_twelve(block, local, params.word, count));
}

fn neighbours(first: u32) -> vec4<u32> {
    return vec4<u32>(staged[first], staged[first + 1u], staged[first + 2u], staged[first + 3u]);
}
