// Where broad phases leave their pairs: in any order, since they are sorted afterwards (broadphase/pairs.wgsl). Bindings 0
// to 4 are here.
//
// Past the list's end pairs are only counted. Colliders on large_list, those without end above all, are tested against
// all others one by one.

//#import shared/aabb.wgsl
//#import shared/control.wgsl
//#import shared/limits.wgsl
//#import shared/step.wgsl

const MOST_COUNTED: u32 = 0x80000000u; // the count stops before it wraps

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> aabbs: array<Aabb>;
@group(0) @binding(3) var<storage, read_write> large_list: array<u32>;
@group(0) @binding(4) var<storage, read_write> pair_keys: array<u32>;

var<workgroup> all_turns: atomic<u32>; // zero at first, like all workgroup memory

// A pair, in either order. (Keeping some back, to take places for eight at once, took 1.7 times as long on llvmpipe; many
// drivers add up additions of one to one place over a sub-group by themselves.)
fn keep_pair(i: u32, j: u32) {
    if atomicLoad(&counters[CONTROL_PAIR_COUNT]) < MOST_COUNTED {
        let place = atomicAdd(&counters[CONTROL_PAIR_COUNT], 1u);
        if place < step.pair_capacity {
            pair_keys[2u * place] = min(i, j);
            pair_keys[2u * place + 1u] = max(i, j);
        }
    }
}

fn large_count() -> u32 {
    return min(atomicLoad(&counters[CONTROL_LARGE_COUNT]), UNBOUNDED_LIMIT);
}

// Pairs of collider i, which is not on large_list, with all that are.
fn with_list(i: u32, own: Aabb) {
    let count = large_count();
    for (var k = 0u; k < count; k++) {
        let j = large_list[k];
        if meets(own, aabbs[j]) {
            keep_pair(i, j);
        }
    }
}

// Pairs of the collider at this place of large_list, if it has so many, with those behind it.
fn within_list(place: u32) {
    let count = large_count();
    if place < count {
        let i = large_list[place];
        let own = aabbs[i];
        for (var k = place + 1u; k < count; k++) {
            let j = large_list[k];
            if meets(own, aabbs[j]) {
                keep_pair(i, j);
            }
        }
    }
}

// Ends every invocation's search, which took so many turns; all invocations of a workgroup come here.
fn end_search(local: u32, turns: u32) {
    if turns > TURN_LIMIT {
        atomicMax(&counters[CONTROL_OVERFLOW], OVERFLOW_TURNS);
        atomicMax(&counters[CONTROL_NEEDED], turns);
    }
    atomicAdd(&all_turns, turns);
    workgroupBarrier();
    if local == 0u {
        atomicAdd(&counters[CONTROL_TURNS], atomicLoad(&all_turns));
    }
}
