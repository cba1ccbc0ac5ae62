// Which piece of work an invocation has. Workgroups are of 256 invocations in one dimension, dispatches of two
// dimensions, since one holds 65,535 workgroups at most; a dispatch may be a few workgroups too large, so every pass
// compares its index with its count.
//
// PERMUTE is for tests only: results must not depend on the order of invocations and workgroups, and some drivers
// hardly vary it. 0 leaves the order as it is, 1 reverses it over the whole dispatch, 2 shuffles it.

override PERMUTE: u32 = 0u;

const WORKGROUP: u32 = 256u;

// Place of the workgroup in the dispatch, from @builtin(workgroup_id) and @builtin(num_workgroups).
fn workgroup_index(wg: vec3<u32>, num: vec3<u32>) -> u32 {
    let index = wg.y * num.x + wg.x;
    if PERMUTE == 1u {
        return num.x * num.y - 1u - index;
    }
    if PERMUTE == 2u {
        // The first half takes the even places, the second half the odd ones.
        let half = (num.x * num.y + 1u) / 2u;
        return select(2u * (index - half) + 1u, 2u * index, index < half);
    }
    return index;
}

// Place of the invocation in its workgroup, from @builtin(local_invocation_index).
fn local_index(lid: u32) -> u32 {
    if PERMUTE == 1u {
        return WORKGROUP - 1u - lid;
    }
    if PERMUTE == 2u {
        return reverseBits(lid) >> 24u;
    }
    return lid;
}

// Place of the invocation in the whole dispatch.
fn invocation(wg: vec3<u32>, num: vec3<u32>, lid: u32) -> u32 {
    return workgroup_index(wg, num) * WORKGROUP + local_index(lid);
}
