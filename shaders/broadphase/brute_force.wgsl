// Stage broadphase/brute_force: every bounded collider against every other. Twin of
// crates/cpu/src/broadphase/brute_force.rs. For tiny worlds.
//
//   pairs  one thread a collider and 256 others: those of a higher index, to pair_keys. Reads aabbs, large_list.

//#import shared/pairs.wgsl
//#import shared/thread.wgsl


const OTHERS: u32 = 256u;

@compute @workgroup_size(256)
fn pairs(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let place = invocation(wg, num, lid);
    let tiles = (step.collider_count + OTHERS - 1u) / OTHERS;
    let i = place / max(tiles, 1u);
    let first = place % max(tiles, 1u) * OTHERS;
    if i < step.collider_count && atomicLoad(&counters[CONTROL_STOP]) == 0u {
        let own = aabbs[i];
        if first == 0u {
            within_list(i);
        }
        if bounded(own) {
            if first == 0u {
                with_list(i, own);
            }
            for (var j = max(first, i + 1u); j < min(first + OTHERS, step.collider_count); j++) {
                let other = aabbs[j];
                if bounded(other) && meets(own, other) {
                    keep_pair(i, j);
                }
            }
        }
    }
    end_search(local_index(lid), 0u);
}
