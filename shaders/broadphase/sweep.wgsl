// Stage broadphase/sweep: sort and sweep along one axis. Twin of crates/cpu/src/broadphase/sweep.rs.
//
//   begin   one thread a word: sweep_state = 0.
//   spread  one thread a collider: sums over the middles of bounded boxes and their squares, in 64ths of the domain, to
//           sweep_state: per workgroup, then once. Reads aabbs, and the domain in counters.
//   keys    one thread a collider: the axis of largest variance to sweep_state; where the box begins along it to
//           sweep_keys, the collider to sweep_order.
//   (primitives/sort of sweep_keys and sweep_order)
//   ends    one thread a place: the collider and the first place that begins behind it to sweep_places, the box's sides
//           across the axis to sweep_sides, how many extra items of work it has to sweep_offsets, all items to
//           sweep_state. Reads aabbs.
//   (primitives/scan of sweep_offsets)
//   deal    one invocation: notes an overflow when there are too many items; their dispatch to sweep_args.
//   sweep   one thread an item: pairs to pair_keys. The first items are the places', with their first candidates and
//           large_list; the rest of the candidates is dealt out to the extra ones, one each in turn, so that neighbours
//           read neighbours. One thread a collider of large_list: the pairs with those behind it.
//
// After Liu, Harada, Lee and Kim, "Real-time collision culling of a million bodies on graphics processing units"
// (SIGGRAPH Asia 2010): a collider is tested against those that begin before it ends, in items of at most SWEEP_CHUNK
// candidates, so that one long box keeps no thread busy for long.

//#import shared/pairs.wgsl
//#import shared/thread.wgsl
//#import shared/workgroup.wgsl

const MOST_PER_DIMENSION: u32 = 65535u;
const BLOCK: u32 = 32u; // candidates that are compared before any is tried
const NOWHERE: u32 = 0xffffffffu; // key of a collider that takes no part

// Words of sweep_state.
const STATE_COUNT: u32 = 0u; // bounded colliders
const STATE_AXIS: u32 = 1u;
const STATE_ITEMS: u32 = 2u; // low word, then high
const STATE_SUM: u32 = 4u; // three
const STATE_SQUARES: u32 = 8u; // three low words, then after one more three high ones
const STATE_WORDS: u32 = 16u;

@group(0) @binding(5) var<storage, read_write> sweep_state: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> sweep_keys: array<u32>;
@group(0) @binding(7) var<storage, read_write> sweep_order: array<u32>;
@group(0) @binding(8) var<storage, read_write> sweep_places: array<vec2<u32>>; // collider, end
@group(0) @binding(9) var<storage, read_write> sweep_sides: array<vec4<f32>>; // lower, upper; lower, upper
@group(0) @binding(10) var<storage, read_write> sweep_offsets: array<u32>;
@group(0) @binding(11) var<storage, read_write> sweep_args: array<u32>;

@compute @workgroup_size(256)
fn begin(@builtin(local_invocation_index) lid: u32) {
    let local = local_index(lid);
    if local < STATE_WORDS {
        atomicStore(&sweep_state[local], 0u);
    }
}

fn loaded_center(word: u32) -> vec3<f32> {
    return vec3<f32>(
        from_ordered(atomicLoad(&counters[word])),
        from_ordered(atomicLoad(&counters[word + 1u])),
        from_ordered(atomicLoad(&counters[word + 2u])),
    );
}

// Adds to a number of two words.
fn add_wide(low: u32, high: u32, value: u32) {
    let before = atomicAdd(&sweep_state[low], value);
    if before + value < before {
        atomicAdd(&sweep_state[high], 1u);
    }
}

var<workgroup> members: atomic<u32>;
var<workgroup> sums: array<atomic<u32>, 3>;
var<workgroup> squares: array<atomic<u32>, 3>;

@compute @workgroup_size(256)
fn spread(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let local = local_index(lid);
    if i < step.collider_count && bounded(aabbs[i]) {
        let low = loaded_center(CONTROL_CENTER_MIN);
        let size = loaded_center(CONTROL_CENTER_MAX) - low;
        // The next power of two above the extent goes to the number of 64ths.
        let extent = max(max(size.x, size.y), max(size.z, 0.0));
        let exponent = clamp(bitcast<u32>(extent) >> 23u, 64u, 190u);
        let scale = bitcast<f32>((127u + 6u + 126u - exponent) << 23u);
        let place = vec3<u32>(clamp((center(aabbs[i]) - low) * scale, vec3<f32>(0.0), vec3<f32>(63.0)));
        atomicAdd(&members, 1u);
        for (var axis = 0u; axis < 3u; axis++) {
            atomicAdd(&sums[axis], place[axis]);
            atomicAdd(&squares[axis], place[axis] * place[axis]);
        }
    }
    workgroupBarrier();
    if local < 3u {
        atomicAdd(&sweep_state[STATE_SUM + local], atomicLoad(&sums[local]));
        add_wide(STATE_SQUARES + local, STATE_SQUARES + 4u + local, atomicLoad(&squares[local]));
    } else if local == 3u {
        atomicAdd(&sweep_state[STATE_COUNT], atomicLoad(&members));
    }
}

// Product in two words, low and high.
fn product(a: u32, b: u32) -> vec2<u32> {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let one = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let other = (a & 0xffffu) * (b >> 16u) + (one & 0xffffu);
    return vec2<u32>((other << 16u) | (low & 0xffffu), (a >> 16u) * (b >> 16u) + (one >> 16u) + (other >> 16u));
}

fn is_less(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}

// count^2 times the variance along an axis: below 2^64 up to 2^26 colliders.
fn variance(axis: u32) -> vec2<u32> {
    let count = atomicLoad(&sweep_state[STATE_COUNT]);
    let sum = atomicLoad(&sweep_state[STATE_SUM + axis]);
    var of_squares = product(count, atomicLoad(&sweep_state[STATE_SQUARES + axis]));
    of_squares.y += count * atomicLoad(&sweep_state[STATE_SQUARES + 4u + axis]);
    let of_sum = product(sum, sum);
    let borrow = select(0u, 1u, of_squares.x < of_sum.x);
    return vec2<u32>(of_squares.x - of_sum.x, of_squares.y - of_sum.y - borrow);
}

// The axis of largest variance, of several the first.
fn widest() -> u32 {
    let x = variance(0u);
    let y = variance(1u);
    let z = variance(2u);
    if !is_less(x, y) && !is_less(x, z) {
        return 0u;
    }
    return select(1u, 2u, is_less(y, z));
}

// An integer that is larger when the float is. Floats below the normal ones count as 0, as some GPUs have it; the boxes
// have the last word.
fn key_of(x: f32) -> u32 {
    return select(to_ordered(x), 0x80000000u, (bitcast<u32>(x) & 0x7f800000u) == 0u);
}

@compute @workgroup_size(256)
fn keys(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.collider_count {
        return;
    }
    let axis = widest();
    if i == 0u {
        atomicStore(&sweep_state[STATE_AXIS], axis);
    }
    let aabb = aabbs[i];
    sweep_keys[i] = select(NOWHERE, key_of(aabb.min[axis]), bounded(aabb));
    sweep_order[i] = i;
}

@compute @workgroup_size(256)
fn ends(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let place = invocation(wg, num, lid);
    let local = local_index(lid);
    let count = atomicLoad(&sweep_state[STATE_COUNT]);
    var items = 0u;
    if place < count {
        let axis = atomicLoad(&sweep_state[STATE_AXIS]);
        let u = (axis + 1u) % 3u;
        let v = (axis + 2u) % 3u;
        let aabb = aabbs[sweep_order[place]];
        sweep_sides[place] = vec4<f32>(aabb.min[u], aabb.max[u], aabb.min[v], aabb.max[v]);
        let last = key_of(aabb.max[axis]);
        var low = place;
        var high = count;
        while low < high { // 27 turns at most
            let middle = low + (high - low) / 2u;
            if sweep_keys[middle] <= last {
                low = middle + 1u;
            } else {
                high = middle;
            }
        }
        sweep_places[place] = vec2<u32>(sweep_order[place], low);
        items = 1u + extra_items(place, low);
    }
    if place < step.collider_count {
        sweep_offsets[place] = max(items, 1u) - 1u;
    }
    let all = workgroup_scan(local, items).total;
    if local == 0u {
        add_wide(STATE_ITEMS, STATE_ITEMS + 1u, all);
    }
}

// Items of a place beyond its first.
fn extra_items(place: u32, end: u32) -> u32 {
    let candidates = max(end, place + 1u) - place - 1u;
    return max((candidates + SWEEP_CHUNK - 1u) / SWEEP_CHUNK, 1u) - 1u;
}

@compute @workgroup_size(256)
fn deal(@builtin(local_invocation_index) lid: u32) {
    if local_index(lid) != 0u {
        return;
    }
    var items = atomicLoad(&sweep_state[STATE_ITEMS]);
    if atomicLoad(&counters[CONTROL_STOP]) != 0u {
        items = 0u;
    } else if items > SWEEP_ITEM_LIMIT || atomicLoad(&sweep_state[STATE_ITEMS + 1u]) != 0u {
        let needed = select(items, 0xffffffffu, atomicLoad(&sweep_state[STATE_ITEMS + 1u]) != 0u);
        atomicMax(&counters[CONTROL_OVERFLOW], OVERFLOW_SWEEP);
        atomicMax(&counters[CONTROL_NEEDED], needed);
        items = 0u;
    }
    // Some of them have a collider of large_list as well.
    let threads = max(items, large_count());
    let groups = (threads + WORKGROUP - 1u) / WORKGROUP;
    let y = max((groups + MOST_PER_DIMENSION - 1u) / MOST_PER_DIMENSION, 1u);
    sweep_args[0] = (groups + y - 1u) / y;
    sweep_args[1] = y;
    sweep_args[2] = 1u;
}

@compute @workgroup_size(256)
fn sweep(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let item = invocation(wg, num, lid);
    var turns = 0u;
    within_list(item);
    if item < atomicLoad(&sweep_state[STATE_ITEMS]) {
        turns = look_at(item);
    }
    end_search(local_index(lid), turns);
}

// Pairs of one item of work; returns how many candidates it had, SWEEP_CHUNK at most.
fn look_at(item: u32) -> u32 {
    let count = atomicLoad(&sweep_state[STATE_COUNT]);
    var place = item;
    var first = place + 1u;
    var stride = 1u;
    var end = 0u;
    if item < count {
        end = min(sweep_places[place].y, first + SWEEP_CHUNK);
    } else {
        let extra = item - count;
        place = place_of(extra, count);
        end = sweep_places[place].y;
        first = place + 1u + SWEEP_CHUNK + extra - sweep_offsets[place];
        stride = extra_items(place, end);
    }
    let i = sweep_places[place].x;
    let own = aabbs[i];
    if item < count {
        with_list(i, own);
    }
    let sides = sweep_sides[place];
    var turns = 0u;
    for (var k = first; k < end; k += BLOCK * stride) {
        // The other two axes reject most, without a branch; what is left is tried afterwards.
        var near = 0u;
        for (var bit = 0u; bit < BLOCK && k + bit * stride < end; bit++) {
            let others = sweep_sides[k + bit * stride];
            let apart = any(others.xz > sides.yw) || any(sides.xz > others.yw);
            near |= select(1u, 0u, apart) << bit;
            turns += 1u;
        }
        while near != 0u { // BLOCK turns at most
            let j = sweep_places[k + firstTrailingBit(near) * stride].x;
            near &= near - 1u;
            if meets(own, aabbs[j]) {
                keep_pair(i, j);
            }
        }
    }
    return turns;
}

// The last place that has no more than so many extra items before it.
fn place_of(extra: u32, count: u32) -> u32 {
    var low = 0u;
    var high = count;
    while low < high { // 27 turns at most
        let middle = low + (high - low) / 2u;
        if sweep_offsets[middle] <= extra {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low - 1u;
}
