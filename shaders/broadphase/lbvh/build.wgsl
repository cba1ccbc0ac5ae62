// Stage broadphase/lbvh, the tree: linear bounding volume hierarchy. Twin of crates/cpu/src/broadphase/lbvh/mod.rs.
//
//   codes      one thread a collider slot: its Morton code to keys, its number to members; one that is not in the tree
//              gets a key behind all others. Reads aabbs, counters.
//   (primitives/sort of keys and members)
//   hierarchy  one thread a leaf and an internal node: children, escapes and ends of runs. Reads keys, members; writes
//              nodes, ends, leaf_count.
//   parents    one thread an internal node, for walks by history: parents. Reads nodes.
//   leaves     one workgroup 256 leaves: their boxes as they are now, and those of 2, 4, ..., 256 of them. Reads aabbs;
//              writes nodes, pyramid.
//   pyramid_up one workgroup 256 boxes of level `level.x` of the pyramid: the next eight levels.
//   boxes      one thread an internal node: its box. Reads ends, pyramid; writes nodes.
//
// Karras, "Maximizing Parallelism in the Construction of BVHs, Octrees, and k-d Trees" (HPG 2012); equal codes are told
// apart by their places. Every node covers a run of leaves, so its box is a union of powers of two of them, which the
// pyramid has ready: no node waits for another. Escapes after Prokopenko and Lebrun-Grandié (2024).

//#import shared/aabb.wgsl
//#import shared/control.wgsl
//#import shared/math.wgsl
//#import shared/thread.wgsl
//#import shared/tree.wgsl

// Key, or upper word of a key, of what is not in the tree: above all codes.
const NOT_HERE_30: u32 = 0x40000000u;
const NOT_HERE_63: u32 = 0x80000000u;

@group(0) @binding(0) var<uniform> tree: TreeInfo;
@group(0) @binding(1) var<uniform> level: vec4<u32>;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read> aabbs: array<Aabb>;
@group(0) @binding(4) var<storage, read_write> keys: array<u32>;
@group(0) @binding(5) var<storage, read_write> members: array<u32>;
@group(0) @binding(6) var<storage, read_write> nodes: array<TreeNode>;
@group(0) @binding(7) var<storage, read_write> ends: array<u32>;
@group(0) @binding(8) var<storage, read_write> parents_of: array<u32>;
@group(0) @binding(9) var<storage, read_write> pyramid: array<Box>;
@group(0) @binding(10) var<storage, read_write> leaf_count: array<u32>;

// (lowest, highest) along each axis.
struct Box {
    x: vec2<f32>,
    y: vec2<f32>,
    z: vec2<f32>,
}

fn box_of(lowest: vec3<f32>, highest: vec3<f32>) -> Box {
    return Box(vec2<f32>(lowest.x, highest.x), vec2<f32>(lowest.y, highest.y), vec2<f32>(lowest.z, highest.z));
}

fn nothing() -> Box {
    return box_of(vec3<f32>(FAR), vec3<f32>(-FAR));
}

fn union_of(a: Box, b: Box) -> Box {
    return Box(
        vec2<f32>(min(a.x.x, b.x.x), max(a.x.y, b.x.y)),
        vec2<f32>(min(a.y.x, b.y.x), max(a.y.y, b.y.y)),
        vec2<f32>(min(a.z.x, b.z.x), max(a.z.y, b.z.y)),
    );
}

// Whether a collider belongs to the tree.
fn is_member(aabb: Aabb) -> bool {
    let fixed = (aabb.body & AABB_FIXED) != 0u;
    var wanted = true;
    if tree.members == MEMBERS_MOVING {
        wanted = !fixed;
    } else if tree.members == MEMBERS_FIXED {
        wanted = fixed;
    } else if tree.members == MEMBERS_LARGE {
        wanted = aabb.size_class > atomicLoad(&counters[CONTROL_CELL_CLASS]);
    }
    return bounded(aabb) && wanted;
}

// Turns middles into codes: lowest middle, and codes per metre, a power of two, so that the factor is exact everywhere.
struct Quantizer {
    low: vec3<f32>,
    scale: f32,
    bits: u32, // an axis
}

fn loaded(word: u32) -> vec3<f32> {
    return vec3<f32>(
        from_ordered(atomicLoad(&counters[word])),
        from_ordered(atomicLoad(&counters[word + 1u])),
        from_ordered(atomicLoad(&counters[word + 2u])),
    );
}

// For all bounded colliders.
fn quantizer() -> Quantizer {
    let low = loaded(CONTROL_CENTER_MIN);
    let bits = select(10u, 21u, tree.words == 2u);
    let extent = max(max_element(loaded(CONTROL_CENTER_MAX) - low), 0.0);
    // The next power of two above the extent goes to the number of cells.
    let exponent = clamp(bitcast<u32>(extent) >> 23u, 64u, 190u);
    return Quantizer(low, bitcast<f32>((253u + bits - exponent) << 23u), bits);
}

fn cell_of(by: Quantizer, aabb: Aabb) -> vec3<u32> {
    let most = f32((1u << by.bits) - 1u);
    return vec3<u32>(clamp((center(aabb) - by.low) * by.scale, vec3<f32>(0.0), vec3<f32>(most)));
}

// x shifted to the left, as (upper, lower) word; by 1 to 31.
fn shifted(x: vec2<u32>, by: u32) -> vec2<u32> {
    return vec2<u32>((x.x << by) | (x.y >> (32u - by)), x.y << by);
}

// The lowest 21 bits, each three places from the last, as (upper, lower) word.
fn spread(v: u32) -> vec2<u32> {
    var x = vec2<u32>(v & 0x001f0000u, v & 0x0000ffffu);
    x = (x | shifted(x, 16u)) & vec2<u32>(0x001f0000u, 0xff0000ffu);
    x = (x | shifted(x, 8u)) & vec2<u32>(0x100f00f0u, 0x0f00f00fu);
    x = (x | shifted(x, 4u)) & vec2<u32>(0x10c30c30u, 0xc30c30c3u);
    return (x | shifted(x, 2u)) & vec2<u32>(0x12492492u, 0x49249249u);
}

// Code of a cell: x lowest.
fn code(cell: vec3<u32>) -> vec2<u32> {
    return spread(cell.x) | shifted(spread(cell.y), 1u) | shifted(spread(cell.z), 2u);
}

@compute @workgroup_size(256)
fn codes(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= tree.slots {
        return;
    }
    let here = is_member(aabbs[i]);
    let own = code(cell_of(quantizer(), aabbs[i]));
    if tree.words == 2u {
        keys[2u * i] = select(NOT_HERE_63, own.x, here);
        keys[2u * i + 1u] = select(0u, own.y, here);
    } else {
        keys[i] = select(NOT_HERE_30, own.y, here);
    }
    members[i] = i;
}

// Whether there is a leaf at this place.
fn is_leaf(place: i32) -> bool {
    if place < 0 || place >= i32(tree.slots) {
        return false;
    }
    if tree.words == 2u {
        return keys[2 * place] < NOT_HERE_63;
    }
    return keys[place] < NOT_HERE_30;
}

// Length of the prefix that the keys of leaf a and the one at place b share, places included; -1 where there is none.
fn shared_prefix(a: i32, b: i32) -> i32 {
    if !is_leaf(b) {
        return -1;
    }
    let places = 64 + i32(countLeadingZeros(u32(a) ^ u32(b)));
    if tree.words == 2u {
        let upper = keys[2 * a] ^ keys[2 * b];
        let lower = keys[2 * a + 1] ^ keys[2 * b + 1];
        let in_lower = select(32 + i32(countLeadingZeros(lower)), places, lower == 0u);
        return select(i32(countLeadingZeros(upper)), in_lower, upper == 0u);
    }
    let different = keys[a] ^ keys[b];
    return select(32 + i32(countLeadingZeros(different)), places, different == 0u);
}

// Where a walk goes on after a run that ends with leaf `last`: the right child of the node that splits there, which is a
// leaf where it is alone.
fn escape_after(last: i32) -> u32 {
    if !is_leaf(last + 1) {
        return NO_NODE;
    }
    let alone = shared_prefix(last + 1, last + 2) <= shared_prefix(last + 1, last);
    return 2u * u32(last + 1) + select(1u, 0u, alone);
}

@compute @workgroup_size(256)
fn hierarchy(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let place = invocation(wg, num, lid);
    let here = i32(place);
    if place == 0u && !is_leaf(0) {
        leaf_count[0] = 0u;
    }
    if place >= tree.slots || !is_leaf(here) {
        return;
    }
    nodes[2u * place].child = members[place];
    nodes[2u * place].escape = escape_after(here);
    if !is_leaf(here + 1) {
        leaf_count[0] = place + 1u;
        return;
    }
    // The run goes to the side of the neighbour that shares more, as far as more is shared than with the other one.
    let way = select(-1, 1, shared_prefix(here, here + 1) > shared_prefix(here, here - 1));
    let least = shared_prefix(here, here - way);
    var reach = 2;
    while shared_prefix(here, here + reach * way) > least {
        reach *= 2;
    }
    var length = 0;
    for (var stride = reach / 2; stride > 0; stride /= 2) {
        if shared_prefix(here, here + (length + stride) * way) > least {
            length += stride;
        }
    }
    let end = here + length * way;
    // It splits where the prefix of all ends.
    let whole = shared_prefix(here, end);
    var split = 0;
    var stride = length;
    while stride > 1 {
        stride = (stride + 1) / 2;
        if shared_prefix(here, here + (split + stride) * way) > whole {
            split += stride;
        }
    }
    split = here + split * way + min(way, 0);
    nodes[2u * place + 1u].child = 2u * u32(split) + select(1u, 0u, split == min(here, end));
    nodes[2u * place + 1u].escape = escape_after(max(here, end));
    ends[place] = u32(end);
}

@compute @workgroup_size(256)
fn parents(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i + 1u >= leaf_count[0] {
        return;
    }
    let left = nodes[2u * i + 1u].child;
    parents_of[left] = 2u * i + 1u;
    parents_of[nodes[left].escape] = 2u * i + 1u;
}

// Where a level of the pyramid begins: level 1 has boxes of two leaves.
fn level_start(of_level: u32) -> u32 {
    return tree.capacity - (tree.capacity >> (of_level - 1u));
}

var<workgroup> row: array<Box, 256>;

// The eight levels above `below` of the boxes in `row`, which are those from `first` on, 256 of them.
fn build_up(local: u32, below: u32, first: u32) {
    for (var k = 1u; k <= 8u; k++) {
        workgroupBarrier();
        let count = 256u >> k;
        var sum = nothing();
        if local < count {
            sum = union_of(row[2u * local], row[2u * local + 1u]);
        }
        workgroupBarrier();
        if local < count {
            row[local] = sum;
            let place = (first >> k) + local;
            if place < (tree.capacity >> (below + k)) {
                pyramid[level_start(below + k) + place] = sum;
            }
        }
    }
}

@compute @workgroup_size(256)
fn leaves(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let local = local_index(lid);
    let first = workgroup_index(wg, num) * WORKGROUP;
    let place = first + local;
    row[local] = nothing();
    if place < leaf_count[0] {
        let aabb = aabbs[nodes[2u * place].child];
        nodes[2u * place].min = aabb.min;
        nodes[2u * place].max = aabb.max;
        row[local] = box_of(aabb.min, aabb.max);
    }
    build_up(local, 0u, first);
}

@compute @workgroup_size(256)
fn pyramid_up(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let local = local_index(lid);
    let first = workgroup_index(wg, num) * WORKGROUP;
    let below = level.x;
    row[local] = nothing();
    if first + local < (tree.capacity >> below) {
        row[local] = pyramid[level_start(below) + first + local];
    }
    build_up(local, below, first);
}

// Box of leaves `from_place` to `to_place`, the last one excluded.
fn covered(from_place: u32, to_place: u32) -> Box {
    var first = from_place;
    var last = to_place;
    var sum = nothing();
    for (var k = 0u; k < 32u && first < last; k++) {
        if (first & 1u) == 1u {
            sum = union_of(sum, box_at(k, first));
            first += 1u;
        }
        if (last & 1u) == 1u {
            last -= 1u;
            sum = union_of(sum, box_at(k, last));
        }
        first >>= 1u;
        last >>= 1u;
    }
    return sum;
}

fn box_at(of_level: u32, place: u32) -> Box {
    if of_level == 0u {
        return box_of(nodes[2u * place].min, nodes[2u * place].max);
    }
    return pyramid[level_start(of_level) + place];
}

@compute @workgroup_size(256)
fn boxes(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i + 1u >= leaf_count[0] {
        return;
    }
    let end = ends[i];
    let own = covered(min(i, end), max(i, end) + 1u);
    nodes[2u * i + 1u].min = vec3<f32>(own.x.x, own.y.x, own.z.x);
    nodes[2u * i + 1u].max = vec3<f32>(own.x.y, own.y.y, own.z.y);
}
