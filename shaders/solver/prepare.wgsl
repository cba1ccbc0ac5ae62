// Builds the step's solver bodies and constraint rows. Twin of crates/cpu/src/solver/prepare.rs.
//
//   bodies        one thread a body: `solver_bodies` from `work_states`, `props` and `masks` (the batches it is in); all of
//                 its way in `shares`
//   constraints   one thread a constraint, in batch order: `heads` and `points` from the manifold of its pair;
//                 belts turn as in `work_states`
//   carry         the same: `impulses`, those of `slot_impulses` for points whose features stayed; `slot_memory`
//
// The masses that a point sees are as in Catto, "Iterative Dynamics with Temporal Coherence" (GDC 2005).

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/constraint.wgsl
//#import shared/control.wgsl
//#import shared/level.wgsl
//#import shared/manifold.wgsl
//#import shared/math.wgsl
//#import shared/pair.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

const NO_FEATURE: u32 = 0xffffffffu;
const NO_RADIUS: f32 = 1e30; // m: more than any

@group(0) @binding(0) var<uniform> control: Control;
@group(0) @binding(1) var<uniform> step: StepParams;
@group(0) @binding(2) var<storage, read> work_states: array<BodyState>;
@group(0) @binding(3) var<storage, read> props: array<BodyProps>;
@group(0) @binding(4) var<storage, read> masks: array<u32>;
@group(0) @binding(5) var<storage, read_write> solver_bodies: array<SolverBody>;
@group(0) @binding(6) var<storage, read> batch_order: array<u32>;
@group(0) @binding(7) var<storage, read> next_pairs: array<Pair>;
@group(0) @binding(8) var<storage, read> manifolds: array<Manifold>;
@group(0) @binding(9) var<storage, read> colliders: array<Collider>;
@group(0) @binding(10) var<storage, read> slot_impulses: array<Impulse>;
@group(0) @binding(11) var<storage, read_write> heads: array<ConstraintHead>;
@group(0) @binding(12) var<storage, read_write> points: array<ConstraintPoint>;
@group(0) @binding(13) var<storage, read_write> impulses: array<Impulse>;
@group(0) @binding(15) var<storage, read_write> shares: array<u32>;
@group(0) @binding(14) var<storage, read> slot_memory: array<ManifoldMemory>;

// Neither velocity nor response along and about the locked axes.
fn lock(i: u32, body: ptr<function, SolverBody>) {
    let locked = props[i].locked;
    let turns = three_bits(locked, LOCKED_FIRST_ROTATION);
    (*body).touched |= (locked & LOCKED_TRANSLATIONS) << TOUCHED_FIRST_LOCK;
    (*body).linear_velocity = select((*body).linear_velocity, vec3<f32>(), three_bits(locked, 0u));
    (*body).angular_velocity = select((*body).angular_velocity, vec3<f32>(), turns);
    if any(turns) {
        let held = held_inverse_inertia(work_states[i].rotation, props[i].inertia, turns);
        (*body).inverse_inertia_diagonal = vec3<f32>(held[0].x, held[1].y, held[2].z);
        (*body).inverse_inertia_off = vec3<f32>(held[0].y, held[0].z, held[1].z);
    }
}

// A body as the solver moves it; what nothing may push has no mass and keeps its velocity.
fn prepare_body(i: u32) -> SolverBody {
    var body: SolverBody;
    body.linear_velocity = work_states[i].linear_velocity;
    body.angular_velocity = work_states[i].angular_velocity;
    body.touched = select(0u, TOUCHED_CONTACT, (masks[2u * i] | masks[2u * i + 1u]) != 0u);
    body.eigenvalue = work_states[i].eigenvalue;
    body.level = level_of(step.levels, work_states[i].credit);
    body.delta = vec4<f32>(0.0, 0.0, 0.0, 1.0);
    if moves(work_states[i].flags) {
        body.inverse_mass = props[i].inverse_mass;
        // R diag(i) R^T, six of nine.
        let r = mat3_from_quat(work_states[i].rotation);
        let inertia = props[i].inverse_inertia;
        let x = r[0] * inertia.x;
        let y = r[1] * inertia.y;
        let z = r[2] * inertia.z;
        body.inverse_inertia_diagonal = x * r[0] + y * r[1] + z * r[2];
        body.inverse_inertia_off = x.xxy * r[0].yzz + y.xxy * r[1].yzz + z.xxy * r[2].yzz;
        if props[i].locked != 0u {
            lock(i, &body);
        }
    }
    return body;
}

@compute @workgroup_size(256)
fn bodies(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count || control.stop != 0u {
        return;
    }
    solver_bodies[i] = prepare_body(i);
    shares[i] = bitcast<u32>(1.0);
}

// Coefficient of two colliders by the stronger of their rules (`CombineRule`).
fn combined(rule_a: u32, rule_b: u32, a: f32, b: f32) -> f32 {
    switch max(rule_a, rule_b) {
        case 0u: {
            return 0.5 * (a + b);
        }
        case 1u: {
            return min(a, b);
        }
        case 2u: {
            return a * b;
        }
        default: {
            return max(a, b);
        }
    }
}

fn inverse_inertia_times(body: SolverBody, v: vec3<f32>) -> vec3<f32> {
    return symmetric_times(body.inverse_inertia_diagonal, body.inverse_inertia_off, v);
}

// Change of relative velocity along `v` by a unit impulse along `u`.
fn response(
    a: SolverBody,
    b: SolverBody,
    ra: vec3<f32>,
    rb: vec3<f32>,
    u: vec3<f32>,
    v: vec3<f32>,
) -> f32 {
    let turn_a = cross(inverse_inertia_times(a, cross(ra, u)), ra);
    let turn_b = cross(inverse_inertia_times(b, cross(rb, u)), rb);
    var moved = (a.inverse_mass + b.inverse_mass) * dot(u, v);
    if is_locked(a.touched | b.touched) {
        moved = a.inverse_mass * dot(along_free(a.touched, u), v) + b.inverse_mass * dot(along_free(b.touched, u), v);
    }
    return moved + dot(v, turn_a + turn_b);
}

fn point_velocity(body: SolverBody, r: vec3<f32>) -> vec3<f32> {
    return body.linear_velocity + cross(body.angular_velocity, r);
}

fn inverse(x: f32) -> f32 {
    if x > 0.0 {
        return 1.0 / x;
    }
    return 0.0;
}

// Length of this step's sub-steps over that of those that the impulses between two bodies are from.
fn scale_of(body_a: u32, body_b: u32, h: f32) -> f32 {
    let was = max(work_states[body_a].h, work_states[body_b].h);
    if was == h || was == 0.0 {
        return 1.0;
    }
    return h / was;
}

// Part of an arm that does not turn with its body: from the centre of a ball to midway between the surfaces, m.
fn round_part(collider: u32, separation: f32) -> f32 {
    if colliders[collider].shape == SHAPE_BALL {
        return colliders[collider].size.x + 0.5 * separation;
    }
    return 0.0;
}

// The radius that resistance is a share of: that of the smaller ball; where there is none, the smallest half extent.
fn lever(a: u32, b: u32) -> f32 {
    let ball = colliders[a].shape == SHAPE_BALL || colliders[b].shape == SHAPE_BALL;
    return min(radius_of(a, ball), radius_of(b, ball));
}

fn radius_of(collider: u32, ball: bool) -> f32 {
    let size = colliders[collider].size;
    if colliders[collider].shape == SHAPE_BALL {
        return size.x;
    }
    if colliders[collider].shape == SHAPE_CUBOID && !ball {
        return min(min(size.x, size.y), size.z);
    }
    return NO_RADIUS;
}

// Change of relative angular velocity about `v` by a unit angular impulse about `u`.
fn turning(a: SolverBody, b: SolverBody, u: vec3<f32>, v: vec3<f32>) -> f32 {
    return dot(v, inverse_inertia_times(a, u) + inverse_inertia_times(b, u));
}

@compute @workgroup_size(256)
fn constraints(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = invocation(wg, num, lid);
    if c >= control.solved || control.stop != 0u {
        return;
    }
    let index = batch_order[c];
    let pair = next_pairs[index];
    let body_a = colliders[pair.a].body;
    let body_b = colliders[pair.b].body;
    var a = solver_bodies[body_a];
    var b = solver_bodies[body_b];
    if (step.batching & BATCHING_SPLIT_LAST) != 0u && c >= control.batch_start[LAST_BATCH / 4u][LAST_BATCH % 4u] {
        a = last_part(a);
        b = last_part(b);
    }
    let normal = manifolds[index].normal;
    let count = manifolds[index].count;
    let t = tangents(normal);
    let between = manifolds[index].between;
    let round_a = round_part(pair.a, manifolds[index].points[0].separation);
    let round_b = -round_part(pair.b, manifolds[index].points[0].separation);
    for (var i = 0u; i < min(count, 4u); i++) {
        let point = manifolds[index].points[i];
        let ra = point.anchor;
        let rb = ra - between;
        let k11 = response(a, b, ra, rb, t[0], t[0]);
        let k12 = response(a, b, ra, rb, t[0], t[1]);
        let k22 = response(a, b, ra, rb, t[1], t[1]);
        // The stiffest direction's mass serves all: friction stays isotropic and never overshoots.
        let stiffest = 0.5 * (k11 + k22) + sqrt(0.25 * (k11 - k22) * (k11 - k22) + k12 * k12);
        let dv = point_velocity(b, rb) - point_velocity(a, ra);
        points[4u * c + i] = ConstraintPoint(
            ra,
            point.separation - (dot(normal, rb - ra) - (round_b - round_a)),
            inverse(response(a, b, ra, rb, normal, normal)),
            inverse(stiffest),
            dot(normal, dv),
            0.0,
            vec3<f32>(),
            0u,
        );
    }
    var head: ConstraintHead;
    head.normal = normal;
    head.friction = combined(
        colliders[pair.a].combine & 3u,
        colliders[pair.b].combine & 3u,
        colliders[pair.a].friction,
        colliders[pair.b].friction,
    );
    head.body_a = body_a;
    head.body_b = body_b;
    head.slot = pair.slot;
    head.count = count;
    head.restitution = combined(
        (colliders[pair.a].combine >> 2u) & 3u,
        (colliders[pair.b].combine >> 2u) & 3u,
        colliders[pair.a].restitution,
        colliders[pair.b].restitution,
    );
    head.level = select(b.level, a.level, a.inverse_mass > 0.0);
    // Until `carry`, which has no room for the states.
    head.remembered = scale_of(body_a, body_b, h_of(step.h, head.level));
    if a.inverse_mass > 0.0 && b.inverse_mass > 0.0 {
        head.bias_rate = step.bias_rate * f32(1u << head.level);
        head.mass_scale = step.mass_scale;
        head.impulse_scale = step.impulse_scale;
    } else {
        head.bias_rate = step.static_bias_rate * f32(1u << head.level);
        head.mass_scale = step.static_mass_scale;
        head.impulse_scale = step.static_impulse_scale;
    }
    head.round_a = round_a;
    head.round_b = round_b;
    head.between = between;
    head.rolling_resistance = max(colliders[pair.a].rolling_resistance, colliders[pair.b].rolling_resistance);
    head.twisting_resistance = max(colliders[pair.a].twisting_resistance, colliders[pair.b].twisting_resistance);
    if resists(head) {
        let radius = lever(pair.a, pair.b);
        head.rolling_resistance *= radius;
        head.twisting_resistance *= radius;
        let k11 = turning(a, b, t[0], t[0]);
        let k12 = turning(a, b, t[0], t[1]);
        let k22 = turning(a, b, t[1], t[1]);
        // As for friction: isotropic, and never too far.
        let slightest = 0.5 * (k11 + k22) + sqrt(0.25 * (k11 - k22) * (k11 - k22) + k12 * k12);
        head.rolling_inertia = inverse(slightest);
        head.twisting_inertia = inverse(turning(a, b, normal, normal));
    }
    let belt_a = colliders[pair.a].surface_velocity;
    let belt_b = colliders[pair.b].surface_velocity;
    if any(belt_a != vec3<f32>()) || any(belt_b != vec3<f32>()) {
        let velocity = rotate(work_states[body_b].rotation, belt_b) - rotate(work_states[body_a].rotation, belt_a);
        head.surface_velocity = vec2<f32>(dot(t[0], velocity), dot(t[1], velocity));
    }
    heads[c] = head;
}

@compute @workgroup_size(256)
fn carry(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = invocation(wg, num, lid);
    if c >= control.solved || control.stop != 0u {
        return;
    }
    let index = batch_order[c];
    let first = 4u * next_pairs[index].slot;
    let fresh = (next_pairs[index].kind & PAIR_FRESH) != 0u;
    let stored = vec4<u32>(
        slot_impulses[first].feature,
        slot_impulses[first + 1u].feature,
        slot_impulses[first + 2u].feature,
        slot_impulses[first + 3u].feature,
    );
    let scale = heads[c].remembered;
    var remembered = 0.0;
    if !fresh && stored.x != NO_FEATURE {
        let slot = next_pairs[index].slot;
        remembered = scale * (slot_memory[slot].remembered / f32(manifolds[index].count));
        // Solvers that do not resist must not go on with what others left.
        if step.solver <= SOLVER_SOFT {
            let resisted = slot_memory[slot].resisted;
            heads[c].resisted = scale * vec3<f32>(resisted[0], resisted[1], resisted[2]);
        }
    }
    heads[c].remembered = remembered;
    for (var i = 0u; i < min(manifolds[index].count, 4u); i++) {
        var impulse: Impulse;
        impulse.feature = manifolds[index].features[i];
        let same = stored == vec4<u32>(impulse.feature);
        if !fresh && any(same) {
            // The last that is the same, though no two should be.
            let k = select(select(select(0u, 1u, same.y), 2u, same.z), 3u, same.w);
            let kept = slot_impulses[first + k];
            impulse.normal = scale * kept.normal;
            impulse.tangent = array<f32, 2>(scale * kept.tangent[0], scale * kept.tangent[1]);
            points[4u * c + i].deviation = scale * slot_memory[next_pairs[index].slot].deviations[k];
        }
        impulses[4u * c + i] = impulse;
    }
}
