// Stage broadphase: the end of every broad phase. Then primitives/sort of pair_keys makes the list what the CPU has.
//
//   gate  one invocation: raises the stop flag when a bound was passed; no pairs then. Reads and writes counters.

//#import shared/control.wgsl
//#import shared/limits.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;

@compute @workgroup_size(256)
fn gate(@builtin(local_invocation_index) lid: u32) {
    if local_index(lid) != 0u {
        return;
    }
    if atomicLoad(&counters[CONTROL_STOP]) == 0u {
        let pairs = atomicLoad(&counters[CONTROL_PAIR_COUNT]);
        let listed = atomicLoad(&counters[CONTROL_LARGE_COUNT]);
        if listed > UNBOUNDED_LIMIT {
            stop(OVERFLOW_UNBOUNDED, listed);
        } else if atomicLoad(&counters[CONTROL_OVERFLOW]) != OVERFLOW_NONE {
            atomicStore(&counters[CONTROL_STOP], 1u); // needed was written where it was found
        } else if pairs > step.pair_capacity {
            stop(OVERFLOW_PAIRS, pairs);
        }
    }
    if atomicLoad(&counters[CONTROL_STOP]) != 0u {
        atomicStore(&counters[CONTROL_PAIR_COUNT], 0u);
    }
}

fn stop(bound: u32, needed: u32) {
    atomicStore(&counters[CONTROL_STOP], 1u);
    atomicStore(&counters[CONTROL_OVERFLOW], bound);
    atomicStore(&counters[CONTROL_NEEDED], needed);
}
