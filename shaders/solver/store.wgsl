// Impulses go back to the slots that outlive the step. Twin of crates/cpu/src/solver/store.rs.
//
// One thread a constraint: reads `heads`, `points` and `impulses`, writes all four of its slot in `slot_impulses`; places beyond
// the points in use are given the feature of no point. What the manifold remembers goes to `slot_memory`.

//#import shared/constraint.wgsl
//#import shared/control.wgsl
//#import shared/thread.wgsl

const NO_FEATURE: u32 = 0xffffffffu;

@group(0) @binding(0) var<uniform> control: Control;
@group(0) @binding(1) var<storage, read> heads: array<ConstraintHead>;
@group(0) @binding(2) var<storage, read> impulses: array<Impulse>;
@group(0) @binding(3) var<storage, read_write> slot_impulses: array<Impulse>;
@group(0) @binding(5) var<storage, read> points: array<ConstraintPoint>;
@group(0) @binding(4) var<storage, read_write> slot_memory: array<ManifoldMemory>;

@compute @workgroup_size(256)
fn store(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let c = invocation(wg, num, lid);
    if c >= control.solved || control.stop != 0u {
        return;
    }
    let slot = heads[c].slot;
    let count = heads[c].count;
    var memory: ManifoldMemory;
    memory.remembered = heads[c].remembered * f32(count);
    let resisted = heads[c].resisted;
    memory.resisted = array<f32, 3>(resisted.x, resisted.y, resisted.z);
    for (var i = 0u; i < min(count, 4u); i++) {
        let total = points[4u * c + i].total;
        memory.deviations[i] = points[4u * c + i].deviation;
        memory.totals[i] = array<f32, 3>(total.x, total.y, total.z);
    }
    slot_memory[slot] = memory;
    for (var i = 0u; i < 4u; i++) {
        var impulse: Impulse;
        impulse.feature = NO_FEATURE;
        if i < count {
            impulse = impulses[4u * c + i];
        }
        slot_impulses[4u * slot + i] = impulse;
    }
}
