// Stage broadphase/grid: uniform grid by counting sort. Twin of crates/cpu/src/broadphase/grid.rs.
//
//   choose      one workgroup, four size classes an invocation: cell size and table bits, to counters. Reads
//               class_histogram.
//   clear       one thread a cell: cell_start, cell_cursor = 0.
//   count       one thread a collider: colliders a cell to cell_start, the others to large_list. Reads aabbs.
//   (primitives/scan of cell_start)
//   scatter     one thread a collider: cell_entries, in no order within a cell.
//   pair_count  one thread a collider: how many pairs it owns, to partner_offset. In the grid it owns those with higher
//               ones of the 27 cells around and with every large one; a large one those with higher large ones.
//   (primitives/scan of partner_offset, total to PAIR_COUNT)
//   gate        one invocation: raises the stop flag when a bound was passed; no pairs then.
//   pair_fill   one thread a collider: its pairs, lower collider first, to pair_keys.
//   (primitives/sort of pair_keys)
//
// After Le Grand, "Broad-Phase Collision Detection with CUDA" (GPU Gems 3, 2007) and Harada (GDC 2009): a collider goes
// into the one cell that holds the middle of its box; a cell is wider than any box in it. The smallest size class is
// taken that leaves no more than `large_limit` colliders out. The table wraps: cell (x, y, z) lies at the low bits of
// its coordinates, at least two bits an axis, so that the 27 neighbours never fold onto each other; what folds from
// afar is thrown out by the boxes.

//#import shared/aabb.wgsl
//#import shared/control.wgsl
//#import shared/step.wgsl
//#import shared/thread.wgsl
//#import shared/workgroup.wgsl

// Most candidates around one collider, and most large colliders: together one invocation's turns.
const CELL_LOOP_LIMIT: u32 = 50000u;
const LARGE_LOOP_LIMIT: u32 = 8192u;

@group(0) @binding(0) var<uniform> step: StepParams;
@group(0) @binding(1) var<uniform> control: Control;
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read> class_histogram: array<u32>;
@group(0) @binding(4) var<storage, read> aabbs: array<Aabb>;
@group(0) @binding(5) var<storage, read_write> cell_start: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read_write> cell_cursor: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> cell_entries: array<u32>;
@group(0) @binding(8) var<storage, read_write> large_list: array<u32>;
@group(0) @binding(9) var<storage, read_write> partner_offset: array<u32>;
@group(0) @binding(10) var<storage, read_write> pair_keys: array<u32>;

// How the grid lies in one step.
struct Grid {
    cell_class: u32, // colliders of a higher size class are large
    inverse_cell: f32, // 1/m
    bits: vec3<u32>, // of the table's index along each axis
}

fn unpack(cell_class: u32, inverse_cell: u32, bits: u32) -> Grid {
    return Grid(cell_class, bitcast<f32>(inverse_cell), (vec3<u32>(bits) >> vec3<u32>(0u, 8u, 16u)) & vec3<u32>(255u));
}

// For passes that bind `control`.
fn decided() -> Grid {
    return unpack(control.cell_class, control.inverse_cell, control.cell_bits);
}

// For passes that bind `counters`.
fn decided_in_counters() -> Grid {
    return unpack(
        atomicLoad(&counters[CONTROL_CELL_CLASS]),
        atomicLoad(&counters[CONTROL_INVERSE_CELL]),
        atomicLoad(&counters[CONTROL_CELL_BITS]),
    );
}

// Whether the collider goes into the grid.
fn holds(grid: Grid, aabb: Aabb) -> bool {
    return (aabb.body & AABB_LIVE) != 0u && aabb.size_class <= grid.cell_class;
}

// Cell coordinate along one axis: one multiplication. Cells are 1/16 wider than their class, which outweighs its
// rounding up to 2^19 cells from the origin; beyond, coordinates stop there, which keeps neighbours neighbours.
fn coordinate(x: f32, inverse_cell: f32) -> i32 {
    return i32(clamp(floor(x * inverse_cell), -524288.0, 524287.0));
}

fn coordinates(middle: vec3<f32>, inverse_cell: f32) -> vec3<i32> {
    return vec3<i32>(
        coordinate(middle.x, inverse_cell),
        coordinate(middle.y, inverse_cell),
        coordinate(middle.z, inverse_cell),
    );
}

// Place in the table.
fn index_of(grid: Grid, cell: vec3<i32>) -> u32 {
    let low = vec3<u32>(cell) & ((vec3<u32>(1u) << grid.bits) - vec3<u32>(1u));
    return low.x | (low.y << grid.bits.x) | (low.z << (grid.bits.x + grid.bits.y));
}

// 1 / (17/16 of the class's upper edge): a table for the mantissa, a power of two for the exponent.
fn inverse_cell_of(cell_class: u32) -> f32 {
    let exponent = cell_class >> 2u;
    if cell_class == 0u || exponent >= 254u {
        return 0.0;
    }
    var mantissa = array<f32, 4>(0.94117647, 0.7529412, 0.627451, 0.53781515);
    return mantissa[cell_class & 3u] * bitcast<f32>((254u - exponent) << 23u);
}

// Shares the table's bits among the axes: two each, then one at a time to the axis that folds most.
fn split_bits(cells: vec3<u32>, table_bits: u32) -> vec3<u32> {
    var bits = vec3<u32>(2u);
    for (var k = 6u; k < table_bits; k++) {
        let fold = (cells - min(cells, vec3<u32>(1u))) >> bits;
        if fold.x >= fold.y && fold.x >= fold.z {
            bits.x += 1u;
        } else if fold.y >= fold.z {
            bits.y += 1u;
        } else {
            bits.z += 1u;
        }
    }
    return bits;
}

fn loaded_center(word: u32) -> vec3<f32> {
    return vec3<f32>(
        from_ordered(atomicLoad(&counters[word])),
        from_ordered(atomicLoad(&counters[word + 1u])),
        from_ordered(atomicLoad(&counters[word + 2u])),
    );
}

var<workgroup> chosen: u32;

@compute @workgroup_size(256)
fn choose(@builtin(local_invocation_index) lid: u32) {
    // The highest class that has more than `large_limit` colliders in it and above. Invocation 0 has the top four.
    let local = local_index(lid);
    let top = CLASSES - 1u - 4u * local;
    var sum = 0u;
    for (var k = 0u; k < 4u; k++) {
        sum += class_histogram[top - k];
    }
    var above = workgroup_scan(local, sum).before;
    for (var k = 0u; k < 4u; k++) {
        let with_this = above + class_histogram[top - k];
        if above <= step.large_limit && with_this > step.large_limit {
            chosen = top - k;
        }
        above = with_this;
    }
    workgroupBarrier();
    if local == 0u {
        let cell_class = chosen;
        let inverse_cell = inverse_cell_of(cell_class);
        var cells = vec3<u32>(0u);
        if cell_class != 0u {
            let lowest = coordinates(loaded_center(CONTROL_CENTER_MIN), inverse_cell);
            let highest = coordinates(loaded_center(CONTROL_CENTER_MAX), inverse_cell);
            cells = vec3<u32>(highest - lowest) + vec3<u32>(1u);
        }
        let bits = split_bits(cells, step.cell_table_bits);
        atomicStore(&counters[CONTROL_CELL_CLASS], cell_class);
        atomicStore(&counters[CONTROL_INVERSE_CELL], bitcast<u32>(inverse_cell));
        atomicStore(&counters[CONTROL_CELL_BITS], bits.x | (bits.y << 8u) | (bits.z << 16u));
    }
}

@compute @workgroup_size(256)
fn clear(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i <= (1u << step.cell_table_bits) {
        atomicStore(&cell_start[i], 0u);
        atomicStore(&cell_cursor[i], 0u);
    }
}

@compute @workgroup_size(256)
fn count(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.collider_count {
        return;
    }
    let aabb = aabbs[i];
    let grid = decided_in_counters();
    if holds(grid, aabb) {
        atomicAdd(&cell_start[index_of(grid, coordinates(center(aabb), grid.inverse_cell))], 1u);
    } else if (aabb.body & AABB_LIVE) != 0u {
        large_list[atomicAdd(&counters[CONTROL_LARGE_COUNT], 1u)] = i;
    }
}

@compute @workgroup_size(256)
fn scatter(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.collider_count {
        return;
    }
    let aabb = aabbs[i];
    let grid = decided();
    if holds(grid, aabb) {
        let cell = index_of(grid, coordinates(center(aabb), grid.inverse_cell));
        cell_entries[atomicLoad(&cell_start[cell]) + atomicAdd(&cell_cursor[cell], 1u)] = i;
    }
}

struct Partners {
    count: u32, // pairs that the collider owns
    candidates: u32, // colliders in the cells around it
}

// The pairs that collider i owns, counted; with `fill` also written, from `first` on. Turns: 27, and the two limits.
fn partners(i: u32, grid: Grid, large_count: u32, first: u32, fill: bool) -> Partners {
    let own = aabbs[i];
    var found = Partners(0u, 0u);
    if (own.body & AABB_LIVE) == 0u {
        return found;
    }
    let held = holds(grid, own);
    for (var k = 0u; k < min(large_count, LARGE_LOOP_LIMIT); k++) {
        let j = large_list[k];
        if (held || j > i) && meets(own, aabbs[j]) {
            if fill {
                write_pair(first + found.count, i, j);
            }
            found.count += 1u;
        }
    }
    if !held {
        return found;
    }
    let middle = coordinates(center(own), grid.inverse_cell);
    for (var neighbour = 0; neighbour < 27; neighbour++) {
        let way = vec3<i32>(neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1);
        let cell = index_of(grid, middle + way);
        let start = atomicLoad(&cell_start[cell]);
        let here = atomicLoad(&cell_start[cell + 1u]) - start;
        found.candidates += here;
        if found.candidates > CELL_LOOP_LIMIT {
            continue; // counted only: the step will stop
        }
        for (var k = 0u; k < here; k++) {
            let j = cell_entries[start + k];
            if j > i && meets(own, aabbs[j]) {
                if fill {
                    write_pair(first + found.count, i, j);
                }
                found.count += 1u;
            }
        }
    }
    return found;
}

fn write_pair(place: u32, i: u32, j: u32) {
    if place < step.pair_capacity {
        pair_keys[2u * place] = min(i, j);
        pair_keys[2u * place + 1u] = max(i, j);
    }
}

@compute @workgroup_size(256)
fn pair_count(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.collider_count {
        return;
    }
    var found = Partners(0u, 0u);
    if atomicLoad(&counters[CONTROL_STOP]) == 0u {
        found = partners(i, decided_in_counters(), atomicLoad(&counters[CONTROL_LARGE_COUNT]), 0u, false);
        if found.candidates > CELL_LOOP_LIMIT {
            atomicMax(&counters[CONTROL_OVERFLOW], OVERFLOW_TURNS);
            atomicMax(&counters[CONTROL_NEEDED], found.candidates);
        }
    }
    partner_offset[i] = found.count;
}

@compute @workgroup_size(256)
fn gate(@builtin(local_invocation_index) lid: u32) {
    if local_index(lid) != 0u {
        return;
    }
    if atomicLoad(&counters[CONTROL_STOP]) == 0u {
        let pairs = atomicLoad(&counters[CONTROL_PAIR_COUNT]);
        let large = atomicLoad(&counters[CONTROL_LARGE_COUNT]);
        if large > LARGE_LOOP_LIMIT {
            atomicMax(&counters[CONTROL_OVERFLOW], OVERFLOW_TURNS);
            atomicMax(&counters[CONTROL_NEEDED], large);
        }
        if atomicLoad(&counters[CONTROL_OVERFLOW]) != OVERFLOW_NONE {
            atomicStore(&counters[CONTROL_STOP], 1u);
        } else if pairs > step.pair_capacity {
            atomicStore(&counters[CONTROL_STOP], 1u);
            atomicStore(&counters[CONTROL_OVERFLOW], OVERFLOW_PAIRS);
            atomicStore(&counters[CONTROL_NEEDED], pairs);
        }
    }
    if atomicLoad(&counters[CONTROL_STOP]) != 0u {
        atomicStore(&counters[CONTROL_PAIR_COUNT], 0u);
    }
}

@compute @workgroup_size(256)
fn pair_fill(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    if i >= step.collider_count || control.pair_count == 0u {
        return;
    }
    _ = partners(i, decided(), control.large_count, partner_offset[i], true);
}
