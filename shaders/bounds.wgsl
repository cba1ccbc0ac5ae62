// Stage bounds: checks every body's state, then gives each collider a box that holds it for the whole step. Twin of
// crates/cpu/src/bounds.rs.
//
//   quarantine       one thread a body: one whose state is not finite (or past STATE_LIMIT) stands still at the pose
//                    that it had when the last step committed. Reads states; writes work_states, names it in counters.
//   collider_bounds  one thread a collider. Reads colliders, work_states, props; writes aabbs, counts size classes in
//                    class_histogram, and the range of the boxes' middles in counters: per workgroup, then once; those
//                    without end go to large_list, in no order.
//
// The box is swept by the body's predicted motion (velocity, gravity and force over the step, and the arc of its
// rotation) and widened by half the speculative distance, so that boxes overlap wherever a contact may be needed.

//#import shared/aabb.wgsl
//#import shared/body.wgsl
//#import shared/control.wgsl
//#import shared/math.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

// Beyond this a velocity (m/s, rad/s) or position (m) is taken for what it is: an explosion.
const STATE_LIMIT: f32 = 1e9;

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<storage, read> states: array<BodyState>;
@group(0) @binding(2) var<storage, read_write> work_states: array<BodyState>;
@group(0) @binding(3) var<storage, read> props: array<BodyProps>;
@group(0) @binding(4) var<storage, read> colliders: array<Collider>;
@group(0) @binding(5) var<storage, read_write> aabbs: array<Aabb>;
@group(0) @binding(6) var<storage, read_write> class_histogram: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(8) var<storage, read_write> large_list: array<u32>;

var<workgroup> classes: array<atomic<u32>, CLASSES>;
var<workgroup> low: array<atomic<u32>, 3>; // complements, so that zero is where a minimum begins
var<workgroup> high: array<atomic<u32>, 3>;

@compute @workgroup_size(256)
fn quarantine(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count {
        return;
    }
    var state = work_states[i];
    if (state.flags & BODY_KIND) == BODY_NONE {
        return;
    }
    let pose_good = small(state.position) && is_finite4(state.rotation);
    let good = pose_good && small(state.linear_velocity) && small(state.angular_velocity)
        && is_finite3(state.force) && is_finite3(state.torque);
    if !pose_good {
        state.position = states[i].position;
        state.rotation = states[i].rotation;
    }
    let frozen_before = (states[i].flags & BODY_FROZEN) != 0u && states[i].generation == state.generation;
    if !good {
        state.flags |= BODY_FROZEN;
    }
    if (state.flags & BODY_FROZEN) != 0u {
        state.linear_velocity = vec3<f32>();
        state.angular_velocity = vec3<f32>();
        state.force = vec3<f32>();
        state.torque = vec3<f32>();
        work_states[i] = state;
        if !frozen_before {
            // Of those that share a place, the highest slot.
            atomicMax(&counters[CONTROL_QUARANTINED + i % QUARANTINE_NAMES], i + 1u);
        }
    }
}

fn small(v: vec3<f32>) -> bool {
    return is_finite3(v) && max_element(abs(v)) <= STATE_LIMIT;
}

@compute @workgroup_size(256)
fn collider_bounds(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let local = local_index(lid);
    if i < step.collider_count {
        let aabb = bounds_of(colliders[i]);
        aabbs[i] = aabb;
        if bounded(aabb) {
            let middle = center(aabb);
            atomicAdd(&classes[aabb.size_class], 1u);
            for (var axis = 0u; axis < 3u; axis++) {
                let place = to_ordered(middle[axis]);
                atomicMax(&low[axis], ~place);
                atomicMax(&high[axis], place);
            }
        } else if (aabb.body & AABB_LIVE) != 0u {
            large_list[atomicAdd(&counters[CONTROL_LARGE_COUNT], 1u)] = i;
        }
    }
    workgroupBarrier();
    for (var k = local; k < CLASSES; k += WORKGROUP) {
        let found = atomicLoad(&classes[k]);
        if found != 0u {
            atomicAdd(&class_histogram[k], found);
        }
    }
    if local < 3u {
        atomicMin(&counters[CONTROL_CENTER_MIN + local], ~atomicLoad(&low[local]));
        atomicMax(&counters[CONTROL_CENTER_MAX + local], atomicLoad(&high[local]));
    }
}

// The box of one collider over the step.
fn bounds_of(collider: Collider) -> Aabb {
    let state = work_states[collider.body];
    if collider.shape == SHAPE_NONE || (state.flags & BODY_KIND) == BODY_NONE {
        return Aabb(vec3<f32>(FAR), 0u, vec3<f32>(-FAR), 0u);
    }
    let dynamic = moves(state.flags);
    let fixed = (state.flags & BODY_KIND) == BODY_FIXED;
    let asleep = (state.flags & BODY_ASLEEP) != 0u;
    let body = collider.body | AABB_LIVE | select(0u, AABB_DYNAMIC, dynamic) | select(0u, AABB_FIXED, fixed)
        | select(0u, AABB_ASLEEP, asleep);
    let offset = rotate(state.rotation, collider.position);
    let middle = state.position + offset;
    let orientation = multiply(state.rotation, collider.rotation);
    if collider.shape == SHAPE_HALFSPACE {
        return halfspace_bounds(middle, rotate(orientation, vec3<f32>(0.0, 1.0, 0.0)), body);
    }
    var extent = vec3<f32>(collider.size.x);
    var reach = length(offset);
    if collider.shape != SHAPE_BALL {
        let size = collider.size;
        let m = mat3_from_quat(orientation);
        extent = abs(m[0]) * size.x + abs(m[1]) * size.y + abs(m[2]) * size.z;
        reach = length(offset) + length(size);
    }
    var acceleration = vec3<f32>();
    if dynamic {
        let own = props[collider.body];
        acceleration = step.gravity * own.gravity_scale + state.force * own.inverse_mass;
    }
    // Where it ends lies between the two.
    let straight = state.linear_velocity * step.dt;
    let sweep = (state.linear_velocity + acceleration * step.dt) * step.dt;
    let arc = min(length(state.angular_velocity) * step.dt, 2.0) * reach;
    let margin = extent + vec3<f32>(arc + 0.5 * step.speculative_distance);
    let lowest = min(min(middle - margin, middle - margin + straight), middle - margin + sweep);
    let highest = max(max(middle + margin, middle + margin + straight), middle + margin + sweep);
    return Aabb(lowest, body, highest, size_class(max_element(highest - lowest)));
}

// What a rotation's rounding leaves of the other two components when a normal is meant to be an axis, and the room that
// such a tilt needs 10 km away, m.
const TILT: f32 = 1e-6;
const TILT_MARGIN: f32 = 0.01;

// A half-space has a tight box only when its normal is an axis; else it meets every box, and the narrow phase
// decides. (A slanted test would be a sum of products, which a driver may fuse: sides would disagree.)
fn halfspace_bounds(middle: vec3<f32>, normal: vec3<f32>, body: u32) -> Aabb {
    var lowest = vec3<f32>(-FAR);
    var highest = vec3<f32>(FAR);
    let margin = 0.5 * step.speculative_distance + TILT_MARGIN;
    for (var axis = 0u; axis < 3u; axis++) {
        let u = normal[(axis + 1u) % 3u];
        let v = normal[(axis + 2u) % 3u];
        if abs(u) > TILT || abs(v) > TILT {
            continue;
        }
        if normal[axis] > 0.0 {
            highest[axis] = middle[axis] + margin;
        } else {
            lowest[axis] = middle[axis] - margin;
        }
    }
    return Aabb(lowest, body, highest, size_class(FAR));
}
