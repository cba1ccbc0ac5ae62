// What sweeps over constraints share: their buffers, and which constraint an invocation has. No pass; imported by
// `solver/passes` and `solver/classic`.

//#import shared/body.wgsl
//#import shared/constraint.wgsl
//#import shared/control.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

struct BatchIndex {
    index: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

@group(0) @binding(0) var<uniform> control: Control;
@group(0) @binding(1) var<uniform> step: StepParams;
@group(0) @binding(2) var<uniform> batch: BatchIndex;
@group(0) @binding(3) var<storage, read_write> heads: array<ConstraintHead>;
@group(0) @binding(4) var<storage, read_write> points: array<ConstraintPoint>;
@group(0) @binding(5) var<storage, read_write> impulses: array<Impulse>;
@group(0) @binding(6) var<storage, read_write> solver_bodies: array<SolverBody>;

const SOLVER_WORKGROUP: u32 = 64u;
const TURN: u32 = 128u; // constraints of the last batch that one thread visits in a row

fn start_of(index: u32) -> u32 {
    return control.batch_start[index / 4u][index % 4u];
}

// Constraint of an invocation of the batch's dispatch, or NONE. Workgroups are smaller here than `invocation` takes
// them to be.
const NONE: u32 = 0xffffffffu;

fn constraint_of(wg: vec3<u32>, num: vec3<u32>, lid: u32) -> u32 {
    var local = lid;
    if PERMUTE == 1u {
        local = SOLVER_WORKGROUP - 1u - lid;
    } else if PERMUTE == 2u {
        local = reverseBits(lid) >> 26u;
    }
    let c = start_of(batch.index) + workgroup_index(wg, num) * SOLVER_WORKGROUP + local;
    if c < start_of(batch.index + 1u) && control.stop == 0u && is_of_level(c) {
        return c;
    }
    return NONE;
}

// Whether constraint c is one of those that this sweep is for.
fn is_of_level(c: u32) -> bool {
    return heads[c].level == step.level;
}
