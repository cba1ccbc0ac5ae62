// Stage query: where every collider is when the last step has committed. Twin of `Snapshot::new` in
// crates/cpu/src/query/mod.rs.
//
//   bounds  one thread a collider. Reads colliders, states; writes query_shapes (of no shape where there is none) and
//           query_aabbs, tight but for rounding; the range of the boxes' middles to counters, per workgroup, then once;
//           lists those without end in query_unbounded, in no order, and counts them in query_status.

//#import shared/aabb.wgsl
//#import shared/body.wgsl
//#import shared/control.wgsl
//#import shared/math.wgsl
//#import shared/query.wgsl
//#import shared/thread.wgsl

// What rounding may take from a box, of its largest coordinate.
const ROUNDING: f32 = 1e-6;

@group(0) @binding(0) var<uniform> query_info: QueryInfo;
@group(0) @binding(1) var<storage, read> states: array<BodyState>;
@group(0) @binding(2) var<storage, read> colliders: array<Collider>;
@group(0) @binding(3) var<storage, read_write> query_shapes: array<PlacedShape>;
@group(0) @binding(4) var<storage, read_write> query_aabbs: array<Aabb>;
@group(0) @binding(5) var<storage, read_write> query_unbounded: array<u32>;
@group(0) @binding(6) var<storage, read_write> query_status: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> counters: array<atomic<u32>>;

var<workgroup> low: array<atomic<u32>, 3>; // complements, so that zero is where a minimum begins
var<workgroup> high: array<atomic<u32>, 3>;

@compute @workgroup_size(256)
fn bounds(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let local = local_index(lid);
    if i < query_info.collider_count {
        let collider = colliders[i];
        let placed = place(collider);
        let aabb = tight_bounds(placed, collider.body);
        query_shapes[i] = placed;
        query_aabbs[i] = aabb;
        if placed.shape == SHAPE_HALFSPACE {
            query_unbounded[atomicAdd(&query_status[QUERY_UNBOUNDED], 1u)] = i;
        } else if placed.shape != SHAPE_NONE {
            let middle = center(aabb);
            for (var axis = 0u; axis < 3u; axis++) {
                let place_along = to_ordered(middle[axis]);
                atomicMax(&low[axis], ~place_along);
                atomicMax(&high[axis], place_along);
            }
        }
    }
    workgroupBarrier();
    if local < 3u {
        atomicMin(&counters[CONTROL_CENTER_MIN + local], ~atomicLoad(&low[local]));
        atomicMax(&counters[CONTROL_CENTER_MAX + local], atomicLoad(&high[local]));
    }
}

// A collider's shape in the world.
fn place(collider: Collider) -> PlacedShape {
    let state = states[collider.body];
    if collider.shape == SHAPE_NONE || (state.flags & BODY_KIND) == BODY_NONE {
        return PlacedShape();
    }
    return PlacedShape(
        state.position + rotate(state.rotation, collider.position),
        collider.shape,
        multiply(state.rotation, collider.rotation),
        collider.size,
        0u,
    );
}

fn tight_bounds(placed: PlacedShape, body: u32) -> Aabb {
    if placed.shape == SHAPE_NONE {
        return Aabb(vec3<f32>(FAR), 0u, vec3<f32>(-FAR), 0u);
    }
    if placed.shape == SHAPE_HALFSPACE {
        return Aabb(vec3<f32>(-FAR), body | AABB_LIVE, vec3<f32>(FAR), size_class(FAR));
    }
    var extent = vec3<f32>(placed.size.x);
    if placed.shape == SHAPE_CUBOID {
        let m = mat3_from_quat(placed.rotation);
        extent = abs(m[0]) * placed.size.x + abs(m[1]) * placed.size.y + abs(m[2]) * placed.size.z;
    }
    extent += vec3<f32>(ROUNDING * max_element(abs(placed.position) + extent));
    let lowest = placed.position - extent;
    let highest = placed.position + extent;
    return Aabb(lowest, body | AABB_LIVE, highest, size_class(max_element(highest - lowest)));
}
