// What every pass of stage narrowphase binds, and how it begins and ends. Twin of crates/cpu/src/narrowphase/mod.rs.
//
// Each is one entry point `collide`, one thread a pair; those of another kind, and the one that a test drops, do
// nothing. Reads next_pairs, colliders, work_states, and with boxes found_manifolds (by slot); writes manifolds that
// have points (contact:assign left them empty); counts visited pairs, constraints and points in counters, summed per
// workgroup first.
//
// A manifold has up to four points, each midway between the surfaces, with the gap along one common normal (from a to
// b) and the features that meet there. A point is kept while its gap is below the speculative distance plus the way
// that the bodies close in the step, so that a fast body is stopped before it is through.

//#import shared/body.wgsl
//#import shared/collider.wgsl
//#import shared/control.wgsl
//#import shared/couple.wgsl
//#import shared/manifold.wgsl
//#import shared/pair.wgsl
//#import shared/recycle.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> next_pairs: array<Pair>;
@group(0) @binding(3) var<storage, read> colliders: array<Collider>;
@group(0) @binding(4) var<storage, read> work_states: array<BodyState>;
@group(0) @binding(5) var<storage, read_write> manifolds: array<Manifold>;
@group(0) @binding(6) var<storage, read> found_manifolds: array<FoundManifold>;

var<workgroup> visited: atomic<u32>;
var<workgroup> constraints: atomic<u32>;
var<workgroup> points: atomic<u32>;

// Whether this pass treats pair i.
fn is_mine(i: u32, kind: u32) -> bool {
    return i < atomicLoad(&counters[CONTROL_PAIR_COUNT]) && i != step.drop_pair
        && (next_pairs[i].kind & PAIR_MASK) == kind;
}

fn couple_of(i: u32) -> Couple {
    let ca = colliders[next_pairs[i].a];
    let cb = colliders[next_pairs[i].b];
    return place(ca, work_states[ca.body], cb, work_states[cb.body], step.speculative_distance, step.dt);
}

// Whether the shape of higher number comes first.
fn swapped(i: u32) -> bool {
    return colliders[next_pairs[i].a].shape > colliders[next_pairs[i].b].shape;
}

// The manifold that the pair's slot remembers with this step's gaps; one without points if it must be found anew.
fn recycled(i: u32, couple: Couple) -> Manifold {
    if (next_pairs[i].kind & PAIR_FRESH) != 0u {
        return Manifold();
    }
    return recycle(couple, found_manifolds[next_pairs[i].slot]);
}

// Writes and counts what invocation `local` found. To be called by all of a workgroup at once.
fn finish(i: u32, local: u32, mine: bool, manifold: Manifold) {
    if mine {
        atomicAdd(&visited, 1u);
        if manifold.count > 0u {
            manifolds[i] = manifold;
            atomicAdd(&constraints, 1u);
            atomicAdd(&points, manifold.count);
        }
    }
    workgroupBarrier();
    if local == 0u && atomicLoad(&visited) > 0u {
        atomicAdd(&counters[CONTROL_PROCESSED], atomicLoad(&visited));
        atomicAdd(&counters[CONTROL_CONSTRAINT_COUNT], atomicLoad(&constraints));
        atomicAdd(&counters[CONTROL_POINT_COUNT], atomicLoad(&points));
    }
}
