// Stage broadphase/grid: uniform grid by counting sort. Twin of crates/cpu/src/broadphase/grid.rs.
//
//   choose        one workgroup, four size classes an invocation: cell size and table bits, to counters. Reads
//                 class_histogram.
//   clear         one thread a cell: cells = 0; one a slice: slice_bounds empty.
//   (where the grid is to lie in slices:
//   bound_slices  one thread a collider: rows and columns that its slice has, to slice_bounds.
//   size_slices   one thread a slice: its cells, to slice_start and in sum to counters.
//   primitives/scan of slice_start)
//   count         one thread a collider: colliders a cell to cells, the others to large_list, or to large_tree's care.
//   (primitives/scan of cells)
//   scatter       one thread a collider: its box to cell_boxes, in no order within a cell; cells then has the ends.
//   pairs         one thread an entry of cell_boxes: the pairs with those behind it in its cell and those of half of the
//                 cells around, and with large_list. Reads aabbs; writes pair_keys.
//
// After Le Grand, "Broad-Phase Collision Detection with CUDA" (GPU Gems 3, 2007), Harada (GDC 2009), and for the slices
// Harada et al., "Sliced Data Structure for Particle-Based Simulations on GPUs" (GRAPHITE 2007). A collider goes into the
// one cell that holds the middle of its box; a cell is wider than any box in it. The smallest size class is taken that
// leaves no more than `large_limit` colliders out. The table wraps: cell (x, y, z) lies at the low bits of its
// coordinates, at least two bits an axis, so that the 27 neighbours never fold onto each other; what folds from afar is
// thrown out by the boxes. Or it is cut across the longest axis into slices, each with the cells of its own bounds; where
// these would need more cells than the table has, it wraps.

//#import shared/pairs.wgsl
//#import shared/thread.wgsl
//#import shared/workgroup.wgsl

// Words of counters: the sums of the upper and the lower part of the slices' sizes.
const SLICE_UPPER: u32 = 109u;
const SLICE_LOWER: u32 = 110u;
const LOWER_BITS: u32 = 12u;

// Flags of CONTROL_CELL_BITS beside the bits: the slices' axis from bit 24 on, and whether there are slices.
const SLICED: u32 = 0x04000000u;

@group(0) @binding(5) var<storage, read> class_histogram: array<u32>;
@group(0) @binding(6) var<storage, read_write> cells: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read_write> cell_boxes: array<Aabb>;
@group(0) @binding(8) var<storage, read_write> slice_bounds: array<atomic<i32>>;
@group(0) @binding(9) var<storage, read_write> slice_start: array<u32>;
@group(0) @binding(10) var<uniform> grid_options: GridOptions;

struct GridOptions {
    slices: u32, // room for slices; 0 where the grid wraps
    large_tree: u32, // 1 where colliders larger than a cell go into a tree
    unused_a: u32,
    unused_b: u32,
}

// How the grid lies in one step.
struct Grid {
    cell_class: u32, // colliders of a higher size class are large
    inverse_cell: f32, // 1/m
    bits: vec3<u32>, // of the table's index along each axis, where it wraps
    sliced: bool,
    axis: u32, // of the slices
    first: i32, // coordinate of the first slice
    slices: u32,
}

fn loaded_center(word: u32) -> vec3<f32> {
    return vec3<f32>(
        from_ordered(atomicLoad(&counters[word])),
        from_ordered(atomicLoad(&counters[word + 1u])),
        from_ordered(atomicLoad(&counters[word + 2u])),
    );
}

fn decided() -> Grid {
    let bits = atomicLoad(&counters[CONTROL_CELL_BITS]);
    var grid: Grid;
    grid.cell_class = atomicLoad(&counters[CONTROL_CELL_CLASS]);
    grid.inverse_cell = bitcast<f32>(atomicLoad(&counters[CONTROL_INVERSE_CELL]));
    grid.bits = (vec3<u32>(bits) >> vec3<u32>(0u, 8u, 16u)) & vec3<u32>(255u);
    if (bits & SLICED) != 0u {
        grid.axis = (bits >> 24u) & 3u;
        grid.first = coordinates(loaded_center(CONTROL_CENTER_MIN), grid.inverse_cell)[grid.axis];
        let last = coordinates(loaded_center(CONTROL_CENTER_MAX), grid.inverse_cell)[grid.axis];
        grid.slices = u32(last - grid.first) + 1u;
        // Whether all their cells fit the table.
        let lower = atomicLoad(&counters[SLICE_LOWER]);
        let upper = atomicLoad(&counters[SLICE_UPPER]) + (lower >> LOWER_BITS);
        let room = 1u << step.cell_table_bits;
        let rest = lower & ((1u << LOWER_BITS) - 1u);
        let room_upper = room >> LOWER_BITS;
        let room_rest = room & ((1u << LOWER_BITS) - 1u);
        grid.sliced = upper < room_upper || (upper == room_upper && rest <= room_rest);
    }
    return grid;
}

// Whether the collider goes into the grid.
fn holds(grid: Grid, aabb: Aabb) -> bool {
    return bounded(aabb) && aabb.size_class <= grid.cell_class;
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

fn cell_of(grid: Grid, aabb: Aabb) -> vec3<i32> {
    return coordinates(center(aabb), grid.inverse_cell);
}

// Place in the wrapped table.
fn wrapped(grid: Grid, cell: vec3<i32>) -> u32 {
    let low = vec3<u32>(cell) & ((vec3<u32>(1u) << grid.bits) - vec3<u32>(1u));
    return low.x | (low.y << grid.bits.x) | (low.z << (grid.bits.x + grid.bits.y));
}

// A cell's coordinates as slice, row, place in the row.
fn turned(grid: Grid, cell: vec3<i32>) -> vec3<i32> {
    return vec3<i32>(cell[grid.axis], cell[(grid.axis + 1u) % 3u], cell[(grid.axis + 2u) % 3u]);
}

// Lowest row and column of a slice, highest row and column; below the lowest when it is empty.
fn bounds_of_slice(slice: u32) -> vec4<i32> {
    return vec4<i32>(
        atomicLoad(&slice_bounds[4u * slice]),
        atomicLoad(&slice_bounds[4u * slice + 1u]),
        atomicLoad(&slice_bounds[4u * slice + 2u]),
        atomicLoad(&slice_bounds[4u * slice + 3u]),
    );
}

// Place in the table of a cell that is in it.
fn index_of(grid: Grid, cell: vec3<i32>) -> u32 {
    if !grid.sliced {
        return wrapped(grid, cell);
    }
    let place = turned(grid, cell);
    let slice = u32(place.x - grid.first);
    let bounds = bounds_of_slice(slice);
    let columns = u32(bounds.w - bounds.y) + 1u;
    return slice_start[slice] + u32(place.y - bounds.x) * columns + u32(place.z - bounds.y);
}

// Places (from, to) of the cells from column - 1 to column + 1 of a row that its slice may or may not have.
fn row_of_slice(grid: Grid, s: i32, row: i32, column: i32) -> vec2<u32> {
    let slice = u32(s - grid.first);
    if slice >= grid.slices {
        return vec2<u32>(0u);
    }
    let bounds = bounds_of_slice(slice);
    let low = max(column - 1, bounds.y);
    let high = min(column + 1, bounds.w);
    if row < bounds.x || row > bounds.z || low > high {
        return vec2<u32>(0u);
    }
    let first = slice_start[slice] + u32(row - bounds.x) * (u32(bounds.w - bounds.y) + 1u);
    return vec2<u32>(first + u32(low - bounds.y), first + u32(high - bounds.y) + 1u);
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

// The slices' axis, the longest one, and the flag that there are any; 0 where there are too many.
fn slices_along(extent: vec3<u32>) -> u32 {
    var axis = 2u;
    if extent.x >= extent.y && extent.x >= extent.z {
        axis = 0u;
    } else if extent.y >= extent.z {
        axis = 1u;
    }
    let room = min(grid_options.slices, 1u << step.cell_table_bits);
    return select(0u, SLICED | (axis << 24u), extent[axis] < room);
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
        var extent = vec3<u32>(0u);
        var flags = 0u;
        if cell_class != 0u {
            let lowest = coordinates(loaded_center(CONTROL_CENTER_MIN), inverse_cell);
            let highest = coordinates(loaded_center(CONTROL_CENTER_MAX), inverse_cell);
            extent = vec3<u32>(highest - lowest) + vec3<u32>(1u);
            flags = slices_along(extent - vec3<u32>(1u));
        }
        let bits = split_bits(extent, step.cell_table_bits);
        atomicStore(&counters[CONTROL_CELL_CLASS], cell_class);
        atomicStore(&counters[CONTROL_INVERSE_CELL], bitcast<u32>(inverse_cell));
        atomicStore(&counters[CONTROL_CELL_BITS], bits.x | (bits.y << 8u) | (bits.z << 16u) | flags);
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
        atomicStore(&cells[i], 0u);
    }
    if i < grid_options.slices {
        slice_start[i] = 0u;
        for (var k = 0u; k < 4u; k++) {
            atomicStore(&slice_bounds[4u * i + k], select(-0x7fffffff, 0x7fffffff, k < 2u));
        }
    }
}

@compute @workgroup_size(256)
fn bound_slices(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let i = invocation(wg, num, lid);
    let grid = decided();
    if i >= step.collider_count || grid.slices == 0u || !holds(grid, aabbs[i]) {
        return;
    }
    let place = turned(grid, cell_of(grid, aabbs[i]));
    let slice = 4u * u32(place.x - grid.first);
    atomicMin(&slice_bounds[slice], place.y);
    atomicMin(&slice_bounds[slice + 1u], place.z);
    atomicMax(&slice_bounds[slice + 2u], place.y);
    atomicMax(&slice_bounds[slice + 3u], place.z);
}

@compute @workgroup_size(256)
fn size_slices(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let slice = invocation(wg, num, lid);
    if slice >= grid_options.slices {
        return;
    }
    let bounds = bounds_of_slice(slice);
    if bounds.z < bounds.x {
        return;
    }
    let room = 1u << step.cell_table_bits;
    let rows = u32(bounds.z - bounds.x) + 1u;
    let columns = u32(bounds.w - bounds.y) + 1u;
    // As many as there is room for, and one more where there is not enough.
    let size = select(min(rows * columns, room + 1u), room + 1u, rows > room || columns > (room + 1u) / rows + 1u);
    slice_start[slice] = size;
    atomicAdd(&counters[SLICE_UPPER], size >> LOWER_BITS);
    atomicAdd(&counters[SLICE_LOWER], size & ((1u << LOWER_BITS) - 1u));
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
    let grid = decided();
    if holds(grid, aabb) {
        atomicAdd(&cells[index_of(grid, cell_of(grid, aabb))], 1u);
    } else if bounded(aabb) && grid_options.large_tree == 0u {
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
    var aabb = aabbs[i];
    let grid = decided();
    if holds(grid, aabb) {
        let place = atomicAdd(&cells[index_of(grid, cell_of(grid, aabb))], 1u);
        aabb.size_class = i;
        cell_boxes[place] = aabb;
    }
}

// First entry of a cell, once all are scattered.
fn start_of(cell: u32) -> u32 {
    if cell == 0u {
        return 0u;
    }
    return atomicLoad(&cells[cell - 1u]);
}

// Pairs of an entry with those of `first` to `last`, unless there are too many; returns how many there were.
fn look(own: Aabb, first: u32, last: u32, before: u32) -> u32 {
    let turns = last - first;
    if before + turns <= TURN_LIMIT {
        for (var k = first; k < last; k++) {
            if meets(own, cell_boxes[k]) {
                keep_pair(own.size_class, cell_boxes[k].size_class);
            }
        }
    }
    return before + turns;
}

fn look_at_cells(own: Aabb, from_cell: u32, to_cell: u32, before: u32) -> u32 {
    if from_cell >= to_cell {
        return before;
    }
    return look(own, start_of(from_cell), start_of(to_cell), before);
}

// The pairs of entry k with those behind it in its cell and those of half of the cells around: what lies behind it in its
// own row, and the four rows after that, three cells of each. Returns how many there were to look at.
fn partners(grid: Grid, k: u32) -> u32 {
    let own = cell_boxes[k];
    let cell = cell_of(grid, own);
    let index = index_of(grid, cell);
    var turns = look(own, k + 1u, start_of(index + 1u), 0u);
    if grid.sliced {
        let place = turned(grid, cell);
        turns = look_at_cells(own, index + 1u, row_of_slice(grid, place.x, place.y, place.z).y, turns);
        for (var r = 0; r < 4; r++) {
            let way = row(r);
            turns = look_row(own, row_of_slice(grid, place.x + way.x, place.y + way.y, place.z), turns);
        }
        return turns;
    }
    let next = wrapped(grid, cell + vec3<i32>(1, 0, 0));
    turns = look_at_cells(own, next, next + 1u, turns);
    for (var r = 0; r < 4; r++) {
        let way = row(r);
        let middle = cell + vec3<i32>(0, way.y, way.x);
        let a = wrapped(grid, middle - vec3<i32>(1, 0, 0));
        let b = wrapped(grid, middle);
        let c = wrapped(grid, middle + vec3<i32>(1, 0, 0));
        if a + 2u == c {
            turns = look_at_cells(own, a, c + 1u, turns);
        } else {
            // The row's end is its beginning.
            turns = look_at_cells(own, a, a + 1u, turns);
            turns = look_at_cells(own, b, b + 1u, turns);
            turns = look_at_cells(own, c, c + 1u, turns);
        }
    }
    return turns;
}

fn look_row(own: Aabb, places: vec2<u32>, before: u32) -> u32 {
    return look_at_cells(own, places.x, places.y, before);
}

// Slice and row of the four rows ahead: (0, 1), (1, -1), (1, 0), (1, 1).
fn row(r: i32) -> vec2<i32> {
    return vec2<i32>(min(r, 1), select(r - 2, 1, r == 0));
}

@compute @workgroup_size(256)
fn pairs(
    @builtin(workgroup_id) wg: vec3<u32>,
    @builtin(num_workgroups) num: vec3<u32>,
    @builtin(local_invocation_index) lid: u32,
) {
    let k = invocation(wg, num, lid);
    var turns = 0u;
    if atomicLoad(&counters[CONTROL_STOP]) == 0u {
        let grid = decided();
        within_list(k);
        // The last cell that is scattered ends where the entries end.
        if k < atomicLoad(&cells[(1u << step.cell_table_bits) - 1u]) {
            let i = cell_boxes[k].size_class;
            with_list(i, cell_boxes[k]);
            turns = partners(grid, k);
        }
    }
    end_search(local_index(lid), turns);
}
