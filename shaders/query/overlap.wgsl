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
//#import shared/math.wgsl
//#import shared/query.wgsl
//#import shared/thread.wgsl
//#import shared/tree.wgsl

// Added to the cosines between the axes of two boxes.
const PARALLEL: f32 = 1e-6;

// Most turns of one walk: with UNBOUNDED_LIMIT below what every driver allows the loops of one invocation.
const TURN_LIMIT: u32 = 50000u;

// Most colliders without end.
const UNBOUNDED_LIMIT: u32 = 8192u;

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

fn cuboids_overlap(a: PlacedShape, b: PlacedShape) -> bool {
    let to_a = transpose(mat3_from_quat(a.rotation));
    let between = to_a * (b.position - a.position);
    // Axes of b in a's frame.
    let axes_of_b = to_a * mat3_from_quat(b.rotation);
    var axes = array<vec3<f32>, 3>(axes_of_b[0], axes_of_b[1], axes_of_b[2]);
    let allowance = vec3<f32>(PARALLEL);
    var cosines = array<vec3<f32>, 3>(abs(axes[0]) + allowance, abs(axes[1]) + allowance, abs(axes[2]) + allowance);
    let reach = a.size + cosines[0] * b.size.x + cosines[1] * b.size.y + cosines[2] * b.size.z;
    if any(abs(between) > reach) {
        return false;
    }
    for (var j = 0u; j < 3u; j++) {
        if abs(dot(between, axes[j])) > dot(a.size, cosines[j]) + b.size[j] {
            return false;
        }
    }
    for (var i = 0u; i < 3u; i++) {
        let i1 = (i + 1u) % 3u;
        let i2 = (i + 2u) % 3u;
        for (var j = 0u; j < 3u; j++) {
            let j1 = (j + 1u) % 3u;
            let j2 = (j + 2u) % 3u;
            let reach_a = a.size[i1] * cosines[j][i2] + a.size[i2] * cosines[j][i1];
            let reach_b = b.size[j1] * cosines[j2][i] + b.size[j2] * cosines[j1][i];
            let apart = between[i2] * axes[j][i1] - between[i1] * axes[j][i2];
            if abs(apart) > reach_a + reach_b {
                return false;
            }
        }
    }
    return true;
}
