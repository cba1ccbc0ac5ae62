// Stage edit: the records of a step are applied to the working copy of the states. Twin of crates/cpu/src/edit.rs.
//
//   begin  one thread an element of the longest of its arrays: copies the committed states and clears what a step
//          counts. Reads states; writes work_states, masks, claims, class_histogram, counters.
//   apply  one thread a range of records, those of one body or collider. Reads edit_ranges and edit_records; writes
//          work_states, props, colliders. Does nothing once a step has stopped: properties and colliders outlive it.
//
// Writes to properties and colliders are absolute, so that a step that is run again finds what it would have found.

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/control.wgsl
//#import shared/edit.wgsl
//#import shared/math.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

const CONTROL_WORDS: u32 = 136u;
const CLASSES: u32 = 1024u;
const NO_CLAIM: u32 = 0xffffffffu;
const LONGEST_RANGE: u32 = 50000u; // turns of one loop
const STATE_LIMIT: f32 = 1e9; // m/s², rad/s²: as for velocities in bounds.wgsl

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<uniform> control: Control;
@group(0) @binding(2) var<storage, read> states: array<BodyState>;
@group(0) @binding(3) var<storage, read_write> work_states: array<BodyState>;
@group(0) @binding(4) var<storage, read_write> props: array<BodyProps>;
@group(0) @binding(5) var<storage, read_write> colliders: array<Collider>;
@group(0) @binding(6) var<storage, read> edit_records: array<EditRecord>;
@group(0) @binding(7) var<storage, read> edit_ranges: array<EditRange>;
@group(0) @binding(8) var<storage, read_write> masks: array<u32>;
@group(0) @binding(9) var<storage, read_write> claims: array<u32>;
@group(0) @binding(10) var<storage, read_write> class_histogram: array<u32>;
@group(0) @binding(11) var<storage, read_write> counters: array<u32>;

@compute @workgroup_size(256)
fn begin(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count {
        var state = states[i];
        if (state.flags & BODY_POSED) != 0u {
            // What is moved by poses stands still until it is given one.
            state.linear_velocity = vec3<f32>();
            state.angular_velocity = vec3<f32>();
        }
        work_states[i] = state;
        masks[2u * i] = 0u;
        masks[2u * i + 1u] = 0u;
        claims[i] = NO_CLAIM;
    }
    if i < CLASSES {
        class_histogram[i] = 0u;
    }
    if i >= CONTROL_PAIR_COUNT && i < CONTROL_WORDS {
        let is_minimum = i >= CONTROL_CENTER_MIN && i < CONTROL_CENTER_MIN + 3u;
        counters[i] = select(0u, 0xffffffffu, is_minimum);
    }
}

@compute @workgroup_size(256)
fn apply(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.edit_ranges || control.stop != 0u {
        return;
    }
    let range = edit_ranges[i];
    for (var k = 0u; k < min(range.count, LONGEST_RANGE); k++) {
        let record = edit_records[range.first + k];
        let slot = record.target_slot;
        if record.op >= EDIT_COLLIDER {
            colliders[slot] = apply_to_collider(record);
        } else {
            var state = work_states[slot];
            var own_props = props[slot];
            apply_to_body(record, &state, &own_props);
            work_states[slot] = state;
            props[slot] = own_props;
        }
    }
}

fn apply_to_collider(record: EditRecord) -> Collider {
    var collider: Collider;
    collider.size = xyz(record.data[0]);
    collider.shape = record.data[0].w;
    collider.position = xyz(record.data[1]);
    collider.body = record.data[1].w;
    collider.rotation = xyzw(record.data[2]);
    collider.friction = bitcast<f32>(record.data[3].x);
    collider.restitution = bitcast<f32>(record.data[3].y);
    collider.combine = record.data[3].z;
    collider.born = step.step;
    collider.surface_velocity = xyz(record.data[4]);
    collider.rolling_resistance = bitcast<f32>(record.data[4].w);
    collider.twisting_resistance = bitcast<f32>(record.data[5].x);
    return collider;
}

fn apply_to_body(record: EditRecord, state: ptr<function, BodyState>, own_props: ptr<function, BodyProps>) {
    let a = xyz(record.data[0]);
    let b = xyz(record.data[1]);
    switch record.op {
        case EDIT_SPAWN: {
            *state = BodyState();
            (*state).flags = record.kind;
            (*state).generation = record.generation;
            *own_props = read_props(record);
        }
        case EDIT_PROPS: {
            if record.kind == 1u {
                *own_props = read_props(record);
                return;
            }
            let old_com = xyz(record.data[5]);
            let old_frame = xyzw(record.data[6]);
            let position = (*state).position;
            let own = multiply((*state).rotation, conjugate(old_frame));
            *own_props = read_props(record);
            let moved = position + rotate(own, (*own_props).center_of_mass - old_com);
            let angular = (*state).angular_velocity;
            (*state).linear_velocity = (*state).linear_velocity + cross(angular, moved - position);
            (*state).position = moved;
            (*state).rotation = unit(multiply(own, (*own_props).frame));
        }
        case EDIT_REMOVE: {
            (*state).flags = BODY_NONE;
        }
        case EDIT_POSE: {
            let own = xyzw(record.data[1]);
            if is_finite3(a) && is_finite4(own) {
                (*state).position = a + rotate(own, (*own_props).center_of_mass);
                (*state).rotation = unit(multiply(own, (*own_props).frame));
            } else {
                (*state).flags |= BODY_FROZEN;
            }
        }
        case EDIT_VELOCITY: {
            (*state).linear_velocity = a;
            (*state).angular_velocity = b;
        }
        case EDIT_IMPULSE: {
            push(state, *own_props, a, b);
        }
        case EDIT_IMPULSE_AT: {
            push(state, *own_props, a, cross(b - (*state).position, a));
        }
        case EDIT_FORCE: {
            pull(state, *own_props, a, b);
        }
        case EDIT_FORCE_AT: {
            pull(state, *own_props, a, cross(b - (*state).position, a));
        }
        case EDIT_WAKE: {}
        case EDIT_NEXT_POSE: {
            let own = xyzw(record.data[1]);
            let position = a + rotate(own, (*own_props).center_of_mass);
            let turn = multiply(unit(multiply(own, (*own_props).frame)), conjugate((*state).rotation));
            (*state).linear_velocity = (position - (*state).position) / step.dt;
            (*state).angular_velocity = scaled_axis(turn) / step.dt;
        }
        default: {
            (*state).flags |= BODY_FROZEN;
            (*state).linear_velocity = vec3<f32>();
            (*state).angular_velocity = vec3<f32>();
        }
    }
}

// Adds an impulse and an angular impulse. (Along locked axes velocities are taken away before they are looked at.)
fn push(state: ptr<function, BodyState>, own_props: BodyProps, impulse: vec3<f32>, angular: vec3<f32>) {
    let q = (*state).rotation;
    let linear = (*state).linear_velocity + own_props.inverse_mass * impulse;
    var turn = rotate(q, own_props.inverse_inertia * rotate_back(q, angular));
    if (own_props.locked & LOCKED_ROTATIONS) != 0u {
        let locked = three_bits(own_props.locked, LOCKED_FIRST_ROTATION);
        turn = held_inverse_inertia(q, own_props.inertia, locked) * angular;
    }
    (*state).linear_velocity = linear;
    (*state).angular_velocity = (*state).angular_velocity + turn;
}

// Adds a force and a torque for the step. What would make the body explode within the step puts it in quarantine before
// it meets others.
fn pull(state: ptr<function, BodyState>, own_props: BodyProps, force: vec3<f32>, torque: vec3<f32>) {
    (*state).force = (*state).force + force;
    (*state).torque = (*state).torque + torque;
    let linear = (*state).force * own_props.inverse_mass;
    let angular = own_props.inverse_inertia * rotate_back((*state).rotation, (*state).torque);
    if !small(linear) || !small(angular) {
        (*state).flags |= BODY_FROZEN;
    }
}

// Whether an acceleration is none that only an explosion has.
fn small(v: vec3<f32>) -> bool {
    return is_finite3(v) && max_element(abs(v)) <= STATE_LIMIT;
}

fn read_props(record: EditRecord) -> BodyProps {
    var read: BodyProps;
    read.inverse_inertia = xyz(record.data[0]);
    read.inverse_mass = bitcast<f32>(record.data[0].w);
    read.inertia = xyz(record.data[1]);
    read.gravity_scale = bitcast<f32>(record.data[1].w);
    read.center_of_mass = xyz(record.data[2]);
    read.linear_damping = bitcast<f32>(record.data[2].w);
    read.frame = xyzw(record.data[3]);
    read.angular_damping = bitcast<f32>(record.data[4].x);
    read.reach = bitcast<f32>(record.data[4].y);
    read.locked = record.data[4].z;
    read.least_level = record.data[4].w;
    return read;
}

fn xyz(words: vec4<u32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(words.xyz);
}

fn xyzw(words: vec4<u32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(words);
}
