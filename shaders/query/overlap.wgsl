// Stage query: what shapes overlap. Twin of `overlaps` in crates/cpu/src/query/mod.rs and shapes.rs there. One thread a
// shape:
//
//   count  how many colliders it overlaps, to query_offsets; tells a walk that was cut short in query_status
//   (primitives/scan of query_offsets, total to QUERY_TOTAL)
//   fill   their slots, in the order of the walk, to query_found from its offset on, as far as there is room
//
// Both read volumes, nodes and leaf_count (the tree over all bounded colliders), query_shapes and query_unbounded.
//
// Two boxes by separating axes: Gottschalk, Lin and Manocha, "OBBTree" (SIGGRAPH 1996), with the allowance for parallel
// edges of Ericson, "Real-Time Collision Detection" (2005), 4.4.1.

//#import shared/collider.wgsl
//#import shared/limits.wgsl
//#import shared/math.wgsl
//#import shared/query.wgsl
//#import shared/thread.wgsl
//#import shared/tree.wgsl

// Added to the cosines between the axes of two boxes.
const PARALLEL: f32 = 1e-6;

@group(0) @binding(0) var<uniform> query_info: QueryInfo;
@group(0) @binding(1) var<storage, read> volumes: array<QueryVolume>;
@group(0) @binding(2) var<storage, read> nodes: array<TreeNode>;
@group(0) @binding(3) var<storage, read> query_shapes: array<PlacedShape>;
@group(0) @binding(4) var<storage, read> query_unbounded: array<u32>;
@group(0) @binding(5) var<storage, read_write> query_status: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> query_offsets: array<u32>;
@group(0) @binding(7) var<storage, read_write> query_found: array<u32>;
@group(0) @binding(8) var<storage, read> leaf_count: array<u32>;

// The shape of this invocation, how many it has found, and from where on it writes them.
var<private> volume: QueryVolume;
var<private> found: u32;
var<private> place: u32;

@compute @workgroup_size(256)
fn count(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= query_info.count {
        return;
    }
    volume = volumes[i];
    let turns = search(false);
    if turns > TURN_LIMIT {
        atomicMax(&query_status[QUERY_TURNS], turns);
    }
    query_offsets[i] = found;
}

@compute @workgroup_size(256)
fn fill(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= query_info.count {
        return;
    }
    volume = volumes[i];
    place = query_offsets[i];
    _ = search(true);
}

// Returns the turns that it took; more than TURN_LIMIT when it was cut short.
fn search(write: bool) -> u32 {
    let unbounded = min(atomicLoad(&query_status[QUERY_UNBOUNDED]), UNBOUNDED_LIMIT);
    for (var k = 0u; k < unbounded; k++) {
        offer(query_unbounded[k], write);
    }
    var next = root_of(leaf_count[0]);
    var turns = 0u;
    while next != NO_NODE && turns <= TURN_LIMIT {
        turns += 1u;
        let node = nodes[next];
        if any(volume.min > node.max) || any(node.min > volume.max) {
            next = node.escape;
        } else if (next & 1u) == 0u {
            offer(node.child, write);
            next = node.escape;
        } else {
            next = node.child;
        }
    }
    return turns;
}

fn offer(collider: u32, write: bool) {
    if overlaps(volume.placed, query_shapes[collider]) {
        if write && place + found < query_info.capacity {
            query_found[place + found] = collider;
        }
        found += 1u;
    }
}

// Whether a ball or cuboid overlaps or touches any shape.
fn overlaps(a: PlacedShape, b: PlacedShape) -> bool {
    let between = a.position - b.position;
    if b.shape == SHAPE_HALFSPACE {
        let normal = rotate(b.rotation, vec3<f32>(0.0, 1.0, 0.0));
        return dot(normal, between) <= extent(a, normal);
    }
    if a.shape == SHAPE_BALL && b.shape == SHAPE_BALL {
        let reach = a.size.x + b.size.x;
        return dot(between, between) <= reach * reach;
    }
    if a.shape == SHAPE_BALL {
        return ball_overlaps_cuboid(a, b);
    }
    if b.shape == SHAPE_BALL {
        return ball_overlaps_cuboid(b, a);
    }
    return cuboids_overlap(a, b);
}

// How far the shape reaches along a unit vector.
fn extent(shape: PlacedShape, normal: vec3<f32>) -> f32 {
    if shape.shape == SHAPE_BALL {
        return shape.size.x;
    }
    return dot(abs(rotate_back(shape.rotation, normal)), shape.size);
}

fn ball_overlaps_cuboid(ball: PlacedShape, cuboid: PlacedShape) -> bool {
    let local = rotate_back(cuboid.rotation, ball.position - cuboid.position);
    let out = local - min(max(local, -cuboid.size), cuboid.size);
    return dot(out, out) <= ball.size.x * ball.size.x;
}

// No loops: some drivers count a turn of each within a walk's every turn, and end the walk after so many.
fn cuboids_overlap(a: PlacedShape, b: PlacedShape) -> bool {
    let to_a = transpose(mat3_from_quat(a.rotation));
    let between = to_a * (b.position - a.position);
    // Axes of b in a's frame, and those of a in b's.
    let axes = to_a * mat3_from_quat(b.rotation);
    let rows = transpose(axes);
    let allowance = vec3<f32>(PARALLEL);
    let x = abs(rows[0]) + allowance;
    let y = abs(rows[1]) + allowance;
    let z = abs(rows[2]) + allowance;
    let along_a = vec3<f32>(dot(x, b.size), dot(y, b.size), dot(z, b.size)) + a.size;
    let along_b = x * a.size.x + y * a.size.y + z * a.size.z + b.size;
    if any(abs(between) > along_a) || any(abs(rows[0] * between.x + rows[1] * between.y + rows[2] * between.z) > along_b) {
        return false;
    }
    // An axis of a across each of b.
    let apart_x = abs(between.z * rows[1] - between.y * rows[2]);
    let apart_y = abs(between.x * rows[2] - between.z * rows[0]);
    let apart_z = abs(between.y * rows[0] - between.x * rows[1]);
    return !any(apart_x > a.size.y * z + a.size.z * y + across(b.size, x))
        && !any(apart_y > a.size.z * x + a.size.x * z + across(b.size, y))
        && !any(apart_z > a.size.x * y + a.size.y * x + across(b.size, z));
}

// How far a box reaches across an axis and each of its own, from the cosines between that axis and its own.
fn across(size: vec3<f32>, cosines: vec3<f32>) -> vec3<f32> {
    return size.yzx * cosines.zxy + size.zxy * cosines.yzx;
}
