// Stage query: the first collider along rays, and the nearest one to points. Twin of `closest`, `any` and `nearest` in
// crates/cpu/src/query/mod.rs and of crates/cpu/src/query/walk.rs. One thread a query:
//
//   ray      the first collider that it meets, the lower slot where two are as near, to query_answers
//   ray_any  whether it meets any, to query_met
//   point    the collider nearest to it, the lower slot where two are as near, to query_answers
//
// All read rays or query_points, nodes and leaf_count (the tree over all bounded colliders), query_shapes and query_unbounded, and tell
// a walk that was cut short in query_status. A leaf answers only where its own box is met, and no nearer than that box:
// neither the tree's form nor the order of the walk shows.
//
// Boxes by slabs: Kay and Kajiya, "Ray Tracing Complex Scenes" (SIGGRAPH 1986).

//#import shared/cast.wgsl
//#import shared/limits.wgsl
//#import shared/math.wgsl
//#import shared/project.wgsl
//#import shared/query.wgsl
//#import shared/thread.wgsl
//#import shared/tree.wgsl

// Nodes kept for later, and one more; where there is no room for one, its subtree is walked by escapes at once.
const STACK: u32 = 32u;

// What an invocation looks for.
const RAY: u32 = 0u;
const RAY_ANY: u32 = 1u;
const POINT: u32 = 2u;

@group(0) @binding(0) var<uniform> query_info: QueryInfo;
@group(0) @binding(1) var<storage, read> rays: array<QueryRay>;
@group(0) @binding(2) var<storage, read> query_points: array<QueryPoint>;
@group(0) @binding(3) var<storage, read> nodes: array<TreeNode>;
@group(0) @binding(4) var<storage, read> query_shapes: array<PlacedShape>;
@group(0) @binding(5) var<storage, read> query_unbounded: array<u32>;
@group(0) @binding(6) var<storage, read_write> query_status: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> query_answers: array<QueryAnswer>;
@group(0) @binding(8) var<storage, read_write> query_met: array<u32>;
@group(0) @binding(9) var<storage, read> leaf_count: array<u32>;

// Of this invocation: the query, the best answer so far, and its key: a ray's distance, the square of a point's.
var<private> kind: u32;
var<private> own_ray: QueryRay;
var<private> own_point: vec3<f32>;
var<private> best: QueryAnswer;
var<private> best_key: f32;

@compute @workgroup_size(256)
fn ray(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= query_info.count {
        return;
    }
    own_ray = rays[i];
    search(RAY, own_ray.max_distance);
    query_answers[i] = best;
}

@compute @workgroup_size(256)
fn ray_any(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= query_info.count {
        return;
    }
    own_ray = rays[i];
    search(RAY_ANY, own_ray.max_distance);
    query_met[i] = select(1u, 0u, best.collider == NO_COLLIDER);
}

@compute @workgroup_size(256)
fn point(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= query_info.count {
        return;
    }
    own_point = query_points[i].point;
    search(POINT, query_points[i].max_squared);
    best.distance = sqrt(best_key);
    query_answers[i] = best;
}

fn search(what: u32, most: f32) {
    kind = what;
    best_key = most;
    best = QueryAnswer(vec3<f32>(), most, NO_COLLIDER, 0u, 0u, 0u);
    let unbounded = min(atomicLoad(&query_status[QUERY_UNBOUNDED]), UNBOUNDED_LIMIT);
    for (var k = 0u; k < unbounded; k++) {
        offer(query_unbounded[k], 0.0);
    }
    let turns = nearest_first(root_of(leaf_count[0]));
    if turns > TURN_LIMIT {
        atomicMax(&query_status[QUERY_TURNS], turns);
    }
}

// How far along the ray a node's box begins, MISSED where it does not; or the square of the point's distance to it.
// No more than that of what is below the node.
fn key_of(node: u32) -> f32 {
    if kind == POINT {
        let out = max(max(nodes[node].min - own_point, own_point - nodes[node].max), vec3<f32>());
        return dot(out, out);
    }
    let low = (nodes[node].min - own_ray.origin) * own_ray.inverse;
    let high = (nodes[node].max - own_ray.origin) * own_ray.inverse;
    let near = max(max_element(min(low, high)), 0.0);
    let far = min_element(max(low, high));
    return select(MISSED, near, near <= far);
}

// Looks at a collider whose leaf has this key.
fn offer(collider: u32, leaf_key: f32) {
    var found = Hit(0.0, vec3<f32>());
    if kind == POINT {
        let projected = project(query_shapes[collider], own_point);
        found = Hit(projected.square, projected.nearest);
    } else {
        found = cast_shape(query_shapes[collider], own_ray);
    }
    let key = max(found.distance, leaf_key);
    if key < best_key || (key == best_key && collider < best.collider) {
        best = QueryAnswer(found.normal, key, collider, 0u, 0u, 0u);
        // Nothing is nearer than -1: the walk ends.
        best_key = select(key, -1.0, kind == RAY_ANY);
    }
}

// Offers the colliders of all leaves whose key is no more than best_key, nearer children first. Returns the turns that
// it took; more than TURN_LIMIT when it was cut short. It is one loop: some drivers count a turn of a loop within it at
// every turn, entered or not, and end both after so many.
fn nearest_first(root: u32) -> u32 {
    if root == NO_NODE {
        return 0u;
    }
    var later: array<u32, STACK>;
    var keys: array<f32, STACK>;
    var depth = 0u;
    var next = root;
    var own = key_of(root);
    // While a subtree is walked by escapes: where that ends. The node to go on from is then on top of the stack.
    var escaping = false;
    var end = NO_NODE;
    var turns = 0u;
    while turns <= TURN_LIMIT {
        turns += 1u;
        let is_leaf = (next & 1u) == 0u;
        // The best may have come down since the node was kept.
        let enters = own <= best_key;
        if enters && is_leaf {
            offer(nodes[next].child, own);
        }
        if escaping {
            next = select(nodes[next].escape, nodes[next].child, enters && !is_leaf);
            if next != end {
                own = key_of(next);
                continue;
            }
            escaping = false;
        } else if enters && !is_leaf {
            var near = nodes[next].child;
            var far = nodes[near].escape;
            var near_key = key_of(near);
            var far_key = key_of(far);
            if far_key < near_key {
                let left = near;
                let left_key = near_key;
                near = far;
                near_key = far_key;
                far = left;
                far_key = left_key;
            }
            if far_key <= best_key && depth == STACK - 1u {
                // The last place is the nearer child's.
                later[depth] = near;
                keys[depth] = near_key;
                depth += 1u;
                escaping = true;
                end = nodes[far].escape;
                next = far;
                own = far_key;
                continue;
            }
            if far_key <= best_key {
                later[depth] = far;
                keys[depth] = far_key;
                depth += 1u;
            }
            if near_key <= best_key {
                next = near;
                own = near_key;
                continue;
            }
        }
        if depth == 0u {
            break;
        }
        depth -= 1u;
        next = later[depth];
        own = keys[depth];
    }
    return turns;
}
