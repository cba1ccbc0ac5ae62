// Part of stage `motion`: what is fast does not pass what stands still. Twin of crates/cpu/src/continuous.rs, which tells
// what for.
//
//   shorten   one thread a pair: `shares`, the share of its way that each body may go, as the bits of a float between 0
//             and 1; the least of all its pairs'. `solver/prepare` puts 1 there, `motion` applies it.

//#import shared/body.wgsl
//#import shared/cast.wgsl
//#import shared/collider.wgsl
//#import shared/control.wgsl
//#import shared/math.wgsl
//#import shared/pair.wgsl
//#import shared/query.wgsl
//#import shared/thread.wgsl

@group(0) @binding(0) var<uniform> control: Control;
@group(0) @binding(1) var<storage, read> next_pairs: array<Pair>;
@group(0) @binding(2) var<storage, read> colliders: array<Collider>;
@group(0) @binding(3) var<storage, read> work_states: array<BodyState>;
@group(0) @binding(4) var<storage, read> solver_bodies: array<SolverBody>;
@group(0) @binding(5) var<storage, read_write> shares: array<atomic<u32>>;

fn stands(flags: u32) -> bool {
    return (flags & BODY_KIND) == BODY_FIXED || (flags & BODY_FROZEN) != 0u;
}

// Half the thickness of a shape, m.
fn thickness_of(collider: u32) -> f32 {
    let size = colliders[collider].size;
    return select(min_element(size), size.x, colliders[collider].shape == SHAPE_BALL);
}

fn shorten_one(mover: u32, other: u32) {
    let body = colliders[mover].body;
    let still = colliders[other].body;
    if !moves(work_states[body].flags) || !stands(work_states[still].flags) {
        return;
    }
    let way = solver_bodies[body].translation;
    let thickness = thickness_of(mover);
    let far = sqrt(dot(way, way));
    // What goes less than half its thickness keeps its middle where contacts see it.
    if !is_finite_bits(far) || far <= thickness {
        return;
    }
    let placed = PlacedShape(
        work_states[still].position + rotate(work_states[still].rotation, colliders[other].position),
        colliders[other].shape,
        multiply(work_states[still].rotation, colliders[other].rotation),
        colliders[other].size,
        0u,
    );
    let ray = QueryRay(work_states[body].position, far, way / far, 1u, vec3<f32>(), 0u);
    let distance = cast_shape(placed, ray).distance;
    // One that begins within is left to the contact.
    if distance > 0.0 && distance < far {
        let share = max(distance - 0.5 * thickness, 0.0) / far;
        atomicMin(&shares[body], bitcast<u32>(share));
    }
}

@compute @workgroup_size(256)
fn shorten(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= control.pair_count || control.stop != 0u {
        return;
    }
    let pair = next_pairs[i];
    if (pair.kind & PAIR_MASK) == PAIR_NONE {
        return; // a joint keeps them from colliding
    }
    if moves(work_states[colliders[pair.a].body].flags) {
        shorten_one(pair.a, pair.b);
    } else {
        shorten_one(pair.b, pair.a);
    }
}
