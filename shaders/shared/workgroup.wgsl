// A scan within one workgroup of 256 invocations, 1 KiB of workgroup memory. To be called by all of them at once.
//
// 16 invocations scan 16 values each, then everyone adds up the 16 sums: 3 barriers, where the usual doubling takes 16
// and software adapters pay dearly for each.

//#import shared/thread.wgsl

const ROW: u32 = 16u;

// Rows of 16 and a gap, so that invocations which walk along rows side by side meet no bank conflict.
var<workgroup> scan_scratch: array<u32, 272>;

struct WorkgroupScan {
    before: u32, // sum of the values of lower local indices
    total: u32, // sum of all
}

fn workgroup_scan(local: u32, value: u32) -> WorkgroupScan {
    let row = local / ROW;
    scan_scratch[local + row] = value;
    workgroupBarrier();
    if local < ROW {
        var sum = 0u;
        for (var k = 0u; k < ROW; k++) {
            sum += scan_scratch[local * (ROW + 1u) + k];
            scan_scratch[local * (ROW + 1u) + k] = sum;
        }
    }
    workgroupBarrier();
    var before = scan_scratch[local + row] - value;
    var total = 0u;
    for (var r = 0u; r < ROW; r++) {
        let sum = scan_scratch[r * (ROW + 1u) + ROW - 1u];
        before += select(0u, sum, r < row);
        total += sum;
    }
    workgroupBarrier(); // before the scratch is used again
    return WorkgroupScan(before, total);
}
