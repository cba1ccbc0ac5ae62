//! Stage `broadphase/grid`: uniform grid by counting sort. Twin of `shaders/broadphase/grid.wgsl`.
//!
//! After Le Grand, "Broad-Phase Collision Detection with CUDA" (GPU Gems 3, 2007) and Harada (GDC 2009): a collider
//! goes into the one cell that holds the middle of its box; a cell is wider than any box in it, so partners lie in
//! the 27 cells around, of which each collider looks at half. The cell's size is chosen in each step from a histogram of
//! size classes: the smallest class that leaves no more than `large_limit` bounded colliders out. Those are tested
//! against all, or go into a tree ([`Large`]).
//!
//! Cells lie in a table in one of two ways. *Wrapped*: cell (x, y, z) lies at the low bits of its coordinates, at least
//! two bits an axis, so that the 27 neighbours never fold onto each other; what folds from afar is thrown out by the
//! boxes. *Sliced*, after Harada et al., "Sliced Data Structure for Particle-Based Simulations on GPUs" (GRAPHITE 2007):
//! the domain is cut across its longest axis into slices one cell thick, and each slice has the cells of its own bounds
//! alone. Where slices would need more cells than the table has, it wraps.
//!
//! Coordinates are one multiplication, and cells are 1/16 wider than their class, which outweighs its rounding up to 2^19
//! cells from the origin; beyond, coordinates stop there, which keeps neighbours neighbours.

use super::{Boxes, CLASSES, Found, Query, Sink, bounded, center, collect, lbvh, matter};
use std::ops::Range;
use tumble_core::layout::{Aabb, StepParams};
use tumble_core::limits::SLICE_LIMIT;
use tumble_core::{MortonBits, Traversal};

/// How the grid lies in one step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Grid {
    /// Colliders of a higher size class are large.
    pub cell_class: u32,
    /// 1 / cell edge, 1/m.
    pub inverse_cell: f32,
    /// Bits of the table's index along each axis, where it wraps.
    pub bits: [u32; 3],
    /// Where it does not.
    pub slices: Option<Slices>,
}

/// A grid in slices along its longest axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Slices {
    /// The longest axis; the other two follow in cyclic order, the last one runs along rows.
    pub axis: usize,
    /// Coordinate of the first slice.
    pub first: i32,
    /// Lowest and highest cell of each slice along the other two axes; an empty slice has none.
    pub bounds: Vec<SliceBounds>,
    /// First cell of each slice; one more at the end.
    pub start: Vec<u32>,
}

/// Cells that a slice has along the axes after the slicing one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SliceBounds {
    /// Lowest coordinates.
    pub low: [i32; 2],
    /// Highest; below the lowest when the slice is empty.
    pub high: [i32; 2],
}

impl SliceBounds {
    const EMPTY: Self = Self { low: [i32::MAX; 2], high: [i32::MIN; 2] };

    /// Number of rows and of cells a row.
    fn size(&self) -> [u32; 2] {
        match self.low[0] > self.high[0] {
            true => [0; 2],
            false => std::array::from_fn(|i| (self.high[i] - self.low[i]) as u32 + 1),
        }
    }
}

/// Boxes of colliders by cell.
#[derive(Debug, Default)]
pub struct Cells {
    /// First entry of each cell; one more at the end.
    pub start: Vec<u32>,
    /// Boxes, cell by cell, in ascending order of colliders within a cell; the collider stands in `class`.
    pub entries: Vec<Aabb>,
    /// Bounded colliders outside the grid, ascending.
    pub large: Vec<u32>,
}

/// What finds the pairs of bounded colliders outside the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Large {
    /// A few of them: every collider is tested against each.
    List,
    /// A tree of them, walked so.
    Tree(Traversal),
}

/// 1 / (17/16 of the class's upper edge): a table for the mantissa, a power of two for the exponent.
pub fn inverse_cell(class: u32) -> f32 {
    const MANTISSA: [f32; 4] = [0.941_176_5, 0.752_941_2, 0.627_451, 0.537_815_15];
    let exponent = class >> 2;
    if class == 0 || exponent >= 254 {
        return 0.0;
    }
    MANTISSA[(class & 3) as usize] * f32::from_bits((254 - exponent) << 23)
}

/// Cell coordinate along one axis.
fn coordinate(x: f32, inverse_cell: f32) -> i32 {
    (x * inverse_cell).floor().clamp(-524_288.0, 524_287.0) as i32
}

/// Chooses cell size and table from the size classes and the middles' range. The table wraps.
pub fn choose(boxes: &Boxes, step: &StepParams) -> Grid {
    let mut above = 0;
    let mut cell_class = 0;
    for class in (0..CLASSES).rev() {
        above += boxes.classes[class];
        if above > step.large_limit {
            cell_class = class as u32;
            break;
        }
    }
    let inverse_cell = inverse_cell(cell_class);
    let mut cells = [0u32; 3];
    if cell_class != 0 {
        cells = std::array::from_fn(|i| {
            (coordinate(boxes.high[i], inverse_cell) - coordinate(boxes.low[i], inverse_cell)) as u32 + 1
        });
    }
    Grid { cell_class, inverse_cell, bits: split_bits(cells, step.cell_table_bits), slices: None }
}

/// Shares the table's bits among the axes: two each, then one at a time to the axis that folds most.
pub fn split_bits(cells: [u32; 3], table_bits: u32) -> [u32; 3] {
    let mut bits = [2u32; 3];
    for _ in 6..table_bits {
        let fold: [u32; 3] = std::array::from_fn(|i| (cells[i] - u32::from(cells[i] > 0)) >> bits[i]);
        let axis = if fold[0] >= fold[1] && fold[0] >= fold[2] {
            0
        } else if fold[1] >= fold[2] {
            1
        } else {
            2
        };
        bits[axis] += 1;
    }
    bits
}

/// The same grid in slices, where they fit the table.
pub fn slice(grid: &Grid, boxes: &Boxes, step: &StepParams) -> Grid {
    let room = 1u64 << step.cell_table_bits;
    let low = boxes.low.map(|x| coordinate(x, grid.inverse_cell));
    let high = boxes.high.map(|x| coordinate(x, grid.inverse_cell));
    let extent: [u32; 3] = std::array::from_fn(|i| high[i].wrapping_sub(low[i]) as u32);
    let axis = if extent[0] >= extent[1] && extent[0] >= extent[2] {
        0
    } else if extent[1] >= extent[2] {
        1
    } else {
        2
    };
    if grid.cell_class == 0 || u64::from(extent[axis]) >= room.min(SLICE_LIMIT.into()) {
        return grid.clone();
    }
    let mut slices =
        Slices { axis, first: low[axis], bounds: vec![SliceBounds::EMPTY; extent[axis] as usize + 1], start: vec![0] };
    for aabb in boxes.aabbs.iter().filter(|a| grid.holds(a)) {
        let [s, row, column] = slices.turned(grid.cell(aabb));
        let bounds = &mut slices.bounds[(s - slices.first) as usize];
        for (i, x) in [row, column].into_iter().enumerate() {
            bounds.low[i] = bounds.low[i].min(x);
            bounds.high[i] = bounds.high[i].max(x);
        }
    }
    let mut total = 0u64;
    for bounds in &slices.bounds {
        let [rows, columns] = bounds.size().map(u64::from);
        total += (rows * columns).min(room + 1);
        if total > room {
            return grid.clone();
        }
        slices.start.push(total as u32);
    }
    Grid { slices: Some(slices), ..grid.clone() }
}

impl Slices {
    /// A cell's coordinates as slice, row, place in the row.
    fn turned(&self, cell: [i32; 3]) -> [i32; 3] {
        std::array::from_fn(|i| cell[(self.axis + i) % 3])
    }

    /// Place of a cell that its slice has.
    fn index(&self, cell: [i32; 3]) -> usize {
        let [s, row, column] = self.turned(cell);
        let slice = (s - self.first) as usize;
        let SliceBounds { low, .. } = self.bounds[slice];
        let columns = self.bounds[slice].size()[1];
        (self.start[slice] + (row - low[0]) as u32 * columns + (column - low[1]) as u32) as usize
    }

    /// Cells from `column - 1` to `column + 1` of a row that its slice may or may not have.
    fn row(&self, s: i32, row: i32, column: i32) -> Range<usize> {
        let slice = s.wrapping_sub(self.first) as usize;
        let Some(&bounds) = self.bounds.get(slice) else { return 0..0 };
        let SliceBounds { low, high } = bounds;
        let (from, to) = ((column - 1).max(low[1]), (column + 1).min(high[1]));
        if row < low[0] || row > high[0] || from > to {
            return 0..0;
        }
        let first = self.start[slice] + (row - low[0]) as u32 * bounds.size()[1];
        (first + (from - low[1]) as u32) as usize..(first + (to - low[1]) as u32) as usize + 1
    }
}

impl Grid {
    /// Whether the collider goes into the grid.
    pub fn holds(&self, aabb: &Aabb) -> bool {
        bounded(aabb) && aabb.class <= self.cell_class
    }

    /// Cell coordinates of the middle of a box.
    pub fn cell(&self, aabb: &Aabb) -> [i32; 3] {
        center(aabb).map(|x| coordinate(x, self.inverse_cell))
    }

    /// Place in the table of a cell that is in it.
    pub fn index(&self, cell: [i32; 3]) -> usize {
        match &self.slices {
            Some(slices) => slices.index(cell),
            None => self.wrapped(cell),
        }
    }

    fn wrapped(&self, cell: [i32; 3]) -> usize {
        let low = |x: i32, bits: u32| x as u32 & ((1 << bits) - 1);
        let [bx, by, bz] = self.bits;
        (low(cell[0], bx) | low(cell[1], by) << bx | low(cell[2], bz) << (bx + by)) as usize
    }

    /// Number of cells of the table in use.
    fn table(&self, step: &StepParams) -> usize {
        match &self.slices {
            Some(slices) => slices.start[slices.start.len() - 1] as usize,
            None => 1 << step.cell_table_bits,
        }
    }

    /// Half of the cells around this one, as ranges of neighbours in the table: what lies behind it in its own row, and
    /// the four rows after that, three cells of each. With every cell's, each pair of neighbours comes once.
    fn ahead(&self, cell: [i32; 3], mut visit: impl FnMut(Range<usize>)) {
        const ROWS: [[i32; 2]; 4] = [[0, 1], [1, -1], [1, 0], [1, 1]];
        if let Some(slices) = &self.slices {
            let [s, row, column] = slices.turned(cell);
            let own = slices.row(s, row, column);
            let index = slices.index(cell);
            visit(index + 1..own.end);
            ROWS.iter().for_each(|[ds, dr]| visit(slices.row(s + ds, row + dr, column)));
            return;
        }
        let [x, y, z] = cell;
        let next = self.wrapped([x + 1, y, z]);
        visit(next..next + 1);
        for [dz, dy] in ROWS {
            let [a, b, c] = [x - 1, x, x + 1].map(|x| self.wrapped([x, y + dy, z + dz]));
            if a + 2 == c {
                visit(a..c + 1);
            } else {
                // The row's end is its beginning.
                [a, b, c].into_iter().for_each(|place| visit(place..place + 1));
            }
        }
    }
}

/// Sorts the colliders into cells: count, scan, scatter.
pub fn fill(grid: &Grid, boxes: &Boxes, step: &StepParams) -> Cells {
    let mut cells = Cells { start: vec![0u32; grid.table(step) + 1], ..Cells::default() };
    let mut place = Vec::with_capacity(boxes.aabbs.len());
    for (i, aabb) in boxes.aabbs.iter().enumerate() {
        if grid.holds(aabb) {
            let index = grid.index(grid.cell(aabb)) as u32;
            cells.start[index as usize] += 1;
            place.push([i as u32, index]);
        } else if bounded(aabb) {
            cells.large.push(i as u32);
        }
    }
    crate::primitives::exclusive_scan(&mut cells.start);
    let mut cursor = cells.start.clone();
    cells.entries = vec![bytemuck::Zeroable::zeroed(); place.len()];
    for [i, index] in place {
        let at = &mut cursor[index as usize];
        cells.entries[*at as usize] = Aabb { class: i, ..boxes.aabbs[i as usize] };
        *at += 1;
    }
    cells
}

impl Cells {
    /// Bytes of all arrays.
    pub fn bytes(&self) -> u64 {
        (4 * self.start.len() + size_of::<Aabb>() * self.entries.len() + 4 * self.large.len()) as u64
    }

    /// Panics unless every collider of the grid stands once, in its own cell, and the others are large ones.
    pub fn assert_well_formed(&self, grid: &Grid, boxes: &Boxes) {
        let cell_of = |i: u32| match &boxes.aabbs[i as usize] {
            aabb if grid.holds(aabb) => tumble_core::validate::Place::Cell(grid.index(grid.cell(aabb))),
            aabb if bounded(aabb) => tumble_core::validate::Place::Large,
            _ => tumble_core::validate::Place::None,
        };
        let entries: Vec<u32> = self.entries.iter().map(|entry| entry.class).collect();
        let checked =
            tumble_core::validate::cells(&self.start, &entries, &self.large, boxes.aabbs.len() as u32, cell_of);
        checked.unwrap_or_else(|error| panic!("{error}"));
    }
}

/// All pairs; beyond `most` they are counted and not kept.
pub fn find_pairs(grid: &Grid, cells: &Cells, boxes: &Boxes, large: Large, most: u32) -> Found {
    match large {
        Large::List => {
            let mut list = [&boxes.unbounded[..], &cells.large[..]].concat();
            list.sort_unstable();
            collect(boxes, &list, cells.entries.len(), most, |range, sink| {
                let mut ahead = Ahead::default();
                for k in range {
                    sink.with_list(boxes, &list, cells.entries[k].class);
                    let candidates = partners(grid, cells, &mut ahead, k, sink);
                    sink.took(candidates);
                }
            })
        }
        Large::Tree(traversal) => {
            let mut tree = lbvh::Tree::of_members(boxes, &cells.large, MortonBits::Bits30);
            if traversal == Traversal::History {
                tree.link_parents();
            }
            let held = cells.entries.len();
            collect(boxes, &boxes.unbounded, held + cells.large.len(), most, |range, sink| {
                let mut ahead = Ahead::default();
                for k in range {
                    let i = if k < held { cells.entries[k].class } else { tree.members[k - held] };
                    sink.with_list(boxes, &boxes.unbounded, i);
                    if k < held {
                        let candidates = partners(grid, cells, &mut ahead, k, sink);
                        sink.took(candidates);
                        let turns = tree.partners_of(boxes, i, traversal, sink);
                        sink.took(turns);
                    } else {
                        let turns = tree.partners_after(k - held, boxes, traversal, sink);
                        sink.took(turns);
                    }
                }
            })
        }
    }
}

/// Ranges of entries in the cells ahead of one cell; those of neighbours in the table are one.
#[derive(Default)]
struct Ahead {
    cell: [i32; 3],
    /// End of the cell itself.
    end: usize,
    ranges: [Range<usize>; 13],
    count: usize,
}

impl Ahead {
    /// Of this cell. Entries come cell by cell, so it often is the one of before.
    fn turn_to(&mut self, grid: &Grid, cells: &Cells, cell: [i32; 3]) {
        if self.end > 0 && self.cell == cell {
            return;
        }
        self.cell = cell;
        self.end = cells.start[grid.index(cell) + 1] as usize;
        self.count = 0;
        grid.ahead(cell, |range| {
            if !range.is_empty() {
                let entries = cells.start[range.start] as usize..cells.start[range.end] as usize;
                self.ranges[self.count] = entries.clone();
                self.count += usize::from(!entries.is_empty());
            }
        });
    }
}

/// Pairs of entry `k` with those behind it in its own cell and those of the cells ahead; returns how many there were to
/// look at.
#[inline]
fn partners(grid: &Grid, cells: &Cells, ahead: &mut Ahead, k: usize, sink: &mut Sink) -> u32 {
    let own = &cells.entries[k];
    ahead.turn_to(grid, cells, grid.cell(own));
    let query = Query::new(own);
    let mut candidates = 0;
    let mut visit = |range: Range<usize>| {
        candidates += range.len() as u32;
        for other in &cells.entries[range] {
            if query.overlaps(other) && matter(own.body, other.body) {
                sink.push(own.class, other.class);
            }
        }
    };
    visit(k + 1..ahead.end);
    ahead.ranges[..ahead.count].iter().cloned().for_each(visit);
    candidates
}
