// Stage `sleep`: which islands sleep, and who wakes. Twin of crates/cpu/src/sleep.rs; the CPU side keeps those asleep in
// lists of their own (crates/cpu/src/world/asleep.rs), here they stay in the arrays and the solver leaves them out.
//
// Each body remembers a pose and how long no point of its surface has been farther than `sleep_distance` from its place
// there. An island falls asleep when all its bodies have rested for `sleep_time`, none must stay awake, and nothing
// kinematic that moves touches it or is joined to it; it wakes as a whole, before anything is solved.
//
// After the edits, before the boxes:
//   begin      one thread a body: nobody has stirred yet. Writes stirs
//   edited     one thread a range of edits: marks bodies, and islands of sleepers. Reads edit_ranges, edit_records, states,
//              rests; writes stirs. Only with edits
//   beside     one thread a pair of the last step: marks islands that lie beside an edited body. Reads pairs, colliders,
//              states, rests; writes stirs. Only with edits
//   pull       one thread a pair of bodies with joints between them: marks islands that one holds which is edited or
//              moves. Reads joined, work_states, rests; writes stirs. Only with joints
//   wake       one thread a body: those of marked islands wake. Reads rests; writes work_states, stirs
// After the narrow phase:
//   touch      one thread a pair: marks islands that something touches which moves. Reads next_pairs, manifolds, aabbs,
//              work_states, rests; writes stirs
//   wake       again
//   show       one thread a collider: those of bodies that woke can be pushed. Reads work_states; writes aabbs
//   hide       one thread a pair: those of which no end can be pushed are left out of the rest of the step. Reads aabbs;
//              writes next_pairs, manifolds
// After the commit of the states (these return when the step stopped):
//   rest       one thread a body: how long it has rested; keeps its island busy if that is too short. Reads states,
//              props, islands; writes rests, stirs
//   settle     one thread a body: falls asleep with its island, unless that is busy. Reads islands; writes states, rests
// In place of all that, when nothing is awake:
//   pass_time  one invocation: the number of the step goes up

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/control.wgsl
//#import shared/edit.wgsl
//#import shared/manifold.wgsl
//#import shared/math.wgsl
//#import shared/pair.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

const NO_ISLAND: u32 = 0xffffffffu;

// Bits of `stirs`: of a body,
const STIRRED: u32 = 1u; // edited or woken: its rest begins anew
const EDITED: u32 = 2u;
const DRIVEN: u32 = 4u; // something kinematic that moves touches it, or a joint holds it to one
// and of an island, at the body that is its label.
const MARKED: u32 = 8u; // it wakes
const BUSY: u32 = 16u; // it stays awake

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read_write> states: array<BodyState>;
@group(0) @binding(3) var<storage, read_write> work_states: array<BodyState>;
@group(0) @binding(4) var<storage, read> props: array<BodyProps>;
@group(0) @binding(5) var<storage, read> colliders: array<Collider>;
@group(0) @binding(6) var<storage, read_write> aabbs: array<Aabb>;
@group(0) @binding(7) var<storage, read> pairs: array<Pair>;
@group(0) @binding(8) var<storage, read_write> next_pairs: array<Pair>;
@group(0) @binding(9) var<storage, read_write> manifolds: array<Manifold>;
@group(0) @binding(10) var<storage, read> islands: array<u32>;
@group(0) @binding(11) var<storage, read_write> rests: array<Rest>;
@group(0) @binding(12) var<storage, read_write> stirs: array<atomic<u32>>;
@group(0) @binding(13) var<storage, read> edit_records: array<EditRecord>;
@group(0) @binding(14) var<storage, read> edit_ranges: array<EditRange>;
@group(0) @binding(15) var<storage, read> joined: array<vec2<u32>>; // their number, then pairs of bodies

var<workgroup> counted: array<atomic<u32>, 4>;

fn is_asleep(flags: u32) -> bool {
    return (flags & BODY_ASLEEP) != 0u;
}

// Whether the body is one that nothing pushes, and moves.
fn drives(state: BodyState) -> bool {
    return (state.flags & (BODY_KIND | BODY_FROZEN)) == BODY_KINEMATIC
        && (any(state.linear_velocity != vec3<f32>()) || any(state.angular_velocity != vec3<f32>()));
}

@compute @workgroup_size(256)
fn begin(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count {
        atomicStore(&stirs[i], select(0u, STIRRED | MARKED, step.wake_all != 0u));
    }
}

// Marks the island of a body that slept when the last step was done.
fn mark(body: u32) {
    if is_asleep(states[body].flags) {
        atomicOr(&stirs[rests[body].island], MARKED);
    }
}

@compute @workgroup_size(256)
fn edited(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.edit_ranges {
        return;
    }
    let first = edit_ranges[i].first;
    if edit_records[first].op < EDIT_COLLIDER {
        let body = edit_records[first].target_slot;
        atomicOr(&stirs[body], STIRRED | EDITED);
        mark(body);
    }
}

@compute @workgroup_size(256)
fn beside(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= atomicLoad(&counters[CONTROL_OLD_PAIR_COUNT]) {
        return;
    }
    let a = colliders[pairs[i].a].body;
    let b = colliders[pairs[i].b].body;
    if ((atomicLoad(&stirs[a]) | atomicLoad(&stirs[b])) & EDITED) != 0u {
        mark(a);
        mark(b);
    }
}

@compute @workgroup_size(256)
fn pull(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < joined[0].x {
        let pair = joined[1u + i];
        pulled(pair.x, pair.y);
        pulled(pair.y, pair.x);
    }
}

// Whether the first body is disturbed by the second, which a joint holds to it.
fn pulled(body: u32, partner: u32) {
    let own = work_states[body].flags;
    if (own & (BODY_KIND | BODY_FROZEN)) != BODY_DYNAMIC {
        return;
    }
    let other = work_states[partner];
    let driven = drives(other);
    if driven {
        atomicOr(&stirs[body], DRIVEN);
    }
    let moving = driven || moves(other.flags) || (atomicLoad(&stirs[partner]) & EDITED) != 0u;
    if moving && is_asleep(own) {
        atomicOr(&stirs[rests[body].island], MARKED);
    }
}

@compute @workgroup_size(256)
fn wake(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count || !is_asleep(work_states[i].flags) {
        return;
    }
    if (atomicLoad(&stirs[rests[i].island]) & MARKED) != 0u {
        work_states[i].flags &= ~BODY_ASLEEP;
        atomicOr(&stirs[i], STIRRED);
    }
}

@compute @workgroup_size(256)
fn touch(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= atomicLoad(&counters[CONTROL_PAIR_COUNT]) || i >= step.pair_capacity || manifolds[i].count == 0u {
        return;
    }
    let a = aabbs[next_pairs[i].a].body;
    let b = aabbs[next_pairs[i].b].body;
    touched(a, b);
    touched(b, a);
}

// Flagged as in `Aabb`: whether the first is disturbed by the second.
fn touched(own: u32, other: u32) {
    if (own & (AABB_DYNAMIC | AABB_ASLEEP)) == 0u || (other & AABB_ASLEEP) != 0u {
        return;
    }
    let body = own & AABB_INDEX;
    let partner = other & AABB_INDEX;
    let driven = drives(work_states[partner]);
    if driven {
        atomicOr(&stirs[body], DRIVEN);
    }
    let moving = driven || (other & AABB_DYNAMIC) != 0u || (atomicLoad(&stirs[partner]) & EDITED) != 0u;
    if moving && (own & AABB_ASLEEP) != 0u {
        atomicOr(&stirs[rests[body].island], MARKED);
    }
}

@compute @workgroup_size(256)
fn show(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.collider_count {
        return;
    }
    let body = aabbs[i].body;
    if (body & AABB_ASLEEP) != 0u && !is_asleep(work_states[body & AABB_INDEX].flags) {
        aabbs[i].body = (body & ~AABB_ASLEEP) | AABB_DYNAMIC;
    }
}

@compute @workgroup_size(256)
fn hide(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < atomicLoad(&counters[CONTROL_PAIR_COUNT]) && i < step.pair_capacity {
        if ((aabbs[next_pairs[i].a].body | aabbs[next_pairs[i].b].body) & AABB_DYNAMIC) == 0u {
            next_pairs[i].kind |= PAIR_ASLEEP;
            if manifolds[i].count > 0u {
                manifolds[i].count = 0u;
                atomicAdd(&counted[0], 1u);
            }
        }
    }
    workgroupBarrier();
    if lid == 0u {
        let found = atomicLoad(&counted[0]);
        if found != 0u {
            atomicSub(&counters[CONTROL_CONSTRAINT_COUNT], found);
            atomicAdd(&counters[CONTROL_MANIFOLDS_ASLEEP], found);
        }
    }
}

@compute @workgroup_size(256)
fn rest(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.body_count || atomicLoad(&counters[CONTROL_STOP]) != 0u {
        return;
    }
    let state = states[i];
    let stirred = atomicLoad(&stirs[i]);
    if moves(state.flags) {
        var own = rests[i];
        let turn = multiply(state.rotation, conjugate(own.rotation));
        // A point at the end of an arm moves by twice the arm times the sine of half the angle at most.
        let strayed = length(state.position - own.position) + 2.0 * props[i].reach * length(turn.xyz);
        if (stirred & STIRRED) == 0u && strayed <= step.sleep_distance {
            own.time += step.dt;
        } else {
            own = Rest(state.position, 0.0, state.rotation, 0u, 0u, 0u, 0u);
        }
        rests[i] = own;
    }
    let label = islands[i];
    if label != NO_ISLAND {
        let rested = moves(state.flags) && (state.flags & BODY_STAYS_AWAKE) == 0u && (stirred & DRIVEN) == 0u
            && rests[i].time >= step.sleep_time;
        if !rested {
            atomicOr(&stirs[label], BUSY);
        }
    }
}

@compute @workgroup_size(256)
fn settle(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i < step.body_count && atomicLoad(&counters[CONTROL_STOP]) == 0u {
        let label = islands[i];
        if label != NO_ISLAND && (atomicLoad(&stirs[label]) & BUSY) == 0u
            && atomicLoad(&counters[CONTROL_ISLANDS_OPEN]) == 0u {
            states[i].flags |= BODY_ASLEEP;
            states[i].linear_velocity = vec3<f32>();
            states[i].angular_velocity = vec3<f32>();
            rests[i].island = label;
            atomicAdd(&counted[3], select(0u, 1u, label == i));
        }
        let state = states[i];
        if is_asleep(state.flags) {
            atomicAdd(&counted[0], 1u);
            atomicAdd(&counted[1], select(0u, 1u, rests[i].island == i));
        } else if moves(state.flags) || drives(state) {
            atomicAdd(&counted[2], 1u);
        }
    }
    workgroupBarrier();
    if lid == 0u {
        atomicAdd(&counters[CONTROL_ASLEEP], atomicLoad(&counted[0]));
        atomicAdd(&counters[CONTROL_ISLANDS_ASLEEP], atomicLoad(&counted[1]));
        atomicAdd(&counters[CONTROL_AWAKE], atomicLoad(&counted[2]));
        atomicSub(&counters[CONTROL_ISLANDS], atomicLoad(&counted[3]));
    }
}

@compute @workgroup_size(256)
fn pass_time(@builtin(local_invocation_index) lid: u32) {
    if atomicLoad(&counters[CONTROL_STOP]) != 0u {
        return;
    }
    // What the step found anew, which is nothing; the other numbers stay.
    if lid < QUARANTINE_NAMES {
        atomicStore(&counters[CONTROL_QUARANTINED + lid], 0u);
    }
    if lid < BREAK_NAMES {
        atomicStore(&counters[CONTROL_NEWLY_BROKEN + lid], 0u);
    }
    if lid == 0u {
        atomicStore(&counters[CONTROL_STEP], step.step);
        atomicStore(&counters[CONTROL_NEW_COUNT], 0u);
        atomicStore(&counters[CONTROL_DEAD_COUNT], 0u);
        atomicStore(&counters[CONTROL_ROUNDS], 0u);
        atomicStore(&counters[CONTROL_TURNS], 0u);
    }
}
