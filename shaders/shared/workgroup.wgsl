// A scan within one workgroup of 256 invocations, 1 KiB of workgroup memory. To be called by all of them at once.

//#import shared/thread.wgsl

var<workgroup> scan_scratch: array<u32, WORKGROUP>;

struct WorkgroupScan {
    before: u32, // sum of the values of lower local indices
    total: u32, // sum of all
}

// Hillis and Steele: in round k every place adds the one 2^k below it.
fn workgroup_scan(local: u32, value: u32) -> WorkgroupScan {
    var sum = value;
    scan_scratch[local] = sum;
    workgroupBarrier();
    for (var reach = 1u; reach < WORKGROUP; reach = reach * 2u) {
        let below = select(0u, scan_scratch[max(local, reach) - reach], local >= reach);
        workgroupBarrier();
        sum += below;
        scan_scratch[local] = sum;
        workgroupBarrier();
    }
    let total = scan_scratch[WORKGROUP - 1u];
    workgroupBarrier(); // before the scratch is used again
    return WorkgroupScan(sum - value, total);
}
