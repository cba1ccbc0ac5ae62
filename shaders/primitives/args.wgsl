// Dispatch arguments from a count that only the GPU knows. One invocation a job, one workgroup for all.
//
// Reads word `jobs[j].word` of `counts`, writes (x, y, 1, 0) to element j of `args`: ceil(min(count, limit) / each)
// workgroups, over two dimensions when one is too small. The host makes the same split for counts that it knows.

//#import shared/thread.wgsl

const MOST_PER_DIMENSION: u32 = 65535u;
const MOST_JOBS: u32 = 16u;

struct Job {
    word: u32,
    limit: u32, // the count is taken to be no more than this
    each: u32, // elements that one workgroup does
    unused: u32,
}

struct Jobs {
    count: vec4<u32>, // x: how many jobs
    jobs: array<Job, MOST_JOBS>,
}

@group(0) @binding(0) var<uniform> jobs: Jobs;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> args: array<vec4<u32>>;

@compute @workgroup_size(256)
fn arguments(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let j = invocation(wg, num, lid);
    if j >= jobs.count.x {
        return;
    }
    let job = jobs.jobs[j];
    let count = min(counts[job.word], job.limit);
    let groups = count / job.each + select(0u, 1u, count % job.each != 0u);
    let y = max(groups / MOST_PER_DIMENSION + select(0u, 1u, groups % MOST_PER_DIMENSION != 0u), 1u);
    let x = groups / y + select(0u, 1u, groups % y != 0u);
    args[j] = vec4<u32>(x, y, 1u, 0u);
}
