//! Stage `broadphase/grid`: uniform grid by counting sort. Twin of `shaders/broadphase/grid.wgsl`.
//!
//! After Le Grand, "Broad-Phase Collision Detection with CUDA" (GPU Gems 3, 2007) and Harada (GDC 2009): a collider
//! goes into the one cell that holds the middle of its box; a cell is wider than any box in it, so partners lie in
//! the 27 cells around. The cell's size is chosen in each step from a histogram of size classes: the smallest class
//! that leaves no more than `large_limit` colliders out. Those, half-spaces among them, are tested against all.
//!
//! The table wraps: cell (x, y, z) lies at the low bits of its coordinates, at least two bits an axis, so that the 27
//! neighbours never fold onto each other; what folds from afar is thrown out by the boxes. Coordinates are one
//! multiplication, and cells are 1/16 wider than their class, which outweighs its rounding up to 2^19 cells from the
//! origin; beyond, coordinates stop there, which keeps neighbours neighbours.

use super::meets;
use crate::bounds::{FAR, size_class};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use tumble_core::layout::{Aabb, StepParams, aabb_body};
use tumble_core::limits::{CELL_LOOP_LIMIT, LARGE_LOOP_LIMIT};

/// Classes that a float's exponent and two mantissa bits can tell apart.
pub const CLASSES: usize = 1024;

/// How the grid lies in one step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Grid {
    /// Colliders of a higher size class are large.
    pub cell_class: u32,
    /// 1 / cell edge, 1/m.
    pub inverse_cell: f32,
    /// Bits of the table's index along each axis.
    pub bits: [u32; 3],
}

/// What the grid found.
#[derive(Debug, Default)]
pub struct Found {
    /// (a, b) with a < b, sorted; worth nothing when there are more than were asked for.
    pub pairs: Vec<[u32; 2]>,
    /// How many there are.
    pub count: u64,
    /// Most candidates that one collider had to look at.
    pub most_candidates: u32,
}

/// Lists of colliders by cell.
#[derive(Debug, Default)]
pub struct Cells {
    /// First entry of each cell; one more at the end.
    pub start: Vec<u32>,
    /// Colliders, cell by cell, in ascending order within a cell.
    pub entries: Vec<u32>,
    /// Colliders outside the grid, ascending.
    pub large: Vec<u32>,
}

/// Whether the collider counts for the choice of the grid: it lives and has an end.
fn bounded(aabb: &Aabb) -> bool {
    aabb.body & aabb_body::LIVE != 0 && aabb.class < size_class(FAR)
}

fn center(aabb: &Aabb) -> [f32; 3] {
    std::array::from_fn(|i| 0.5 * (aabb.min[i] + aabb.max[i]))
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

/// Chooses cell size and table from the size classes and the middles' range.
pub fn choose(aabbs: &[Aabb], step: &StepParams) -> Grid {
    let mut histogram = vec![0u32; CLASSES];
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for aabb in aabbs.iter().filter(|a| bounded(a)) {
        histogram[aabb.class as usize] += 1;
        let c = center(aabb);
        for i in 0..3 {
            low[i] = low[i].min(c[i]);
            high[i] = high[i].max(c[i]);
        }
    }
    let mut above = 0;
    let mut cell_class = 0;
    for class in (0..CLASSES).rev() {
        above += histogram[class];
        if above > step.large_limit {
            cell_class = class as u32;
            break;
        }
    }
    let inverse_cell = inverse_cell(cell_class);
    let mut cells = [0u32; 3];
    if cell_class != 0 {
        cells =
            std::array::from_fn(|i| (coordinate(high[i], inverse_cell) - coordinate(low[i], inverse_cell)) as u32 + 1);
    }
    Grid { cell_class, inverse_cell, bits: split_bits(cells, step.cell_table_bits) }
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

impl Grid {
    /// Whether the collider goes into the grid.
    pub fn holds(&self, aabb: &Aabb) -> bool {
        aabb.body & aabb_body::LIVE != 0 && aabb.class <= self.cell_class
    }

    /// Cell coordinates of the middle of a box.
    pub fn cell(&self, aabb: &Aabb) -> [i32; 3] {
        center(aabb).map(|x| coordinate(x, self.inverse_cell))
    }

    /// Place in the table.
    pub fn index(&self, cell: [i32; 3]) -> usize {
        let low = |x: i32, bits: u32| x as u32 & ((1 << bits) - 1);
        let [bx, by, bz] = self.bits;
        (low(cell[0], bx) | low(cell[1], by) << bx | low(cell[2], bz) << (bx + by)) as usize
    }
}

/// Sorts the colliders into cells: count, scan, scatter.
pub fn fill(grid: &Grid, aabbs: &[Aabb], step: &StepParams) -> Cells {
    let mut start = vec![0u32; (1 << step.cell_table_bits) + 1];
    let mut large = Vec::new();
    for (i, aabb) in aabbs.iter().enumerate() {
        if grid.holds(aabb) {
            start[grid.index(grid.cell(aabb))] += 1;
        } else if aabb.body & aabb_body::LIVE != 0 {
            large.push(i as u32);
        }
    }
    let total = crate::primitives::exclusive_scan(&mut start);
    let mut entries = vec![0u32; total as usize];
    let mut cursor = start.clone();
    for (i, aabb) in aabbs.iter().enumerate().filter(|(_, a)| grid.holds(a)) {
        let at = &mut cursor[grid.index(grid.cell(aabb))];
        entries[*at as usize] = i as u32;
        *at += 1;
    }
    Cells { start, entries, large }
}

/// All pairs. The shader counts, scans, fills and sorts; here each collider lists its partners of higher index in
/// order, which is the same list.
pub fn find_pairs(grid: &Grid, cells: &Cells, aabbs: &[Aabb]) -> Found {
    find_pairs_up_to(grid, cells, aabbs, u32::MAX)
}

/// The same for a list that has room for `most`: beyond, pairs are counted and not kept.
pub fn find_pairs_up_to(grid: &Grid, cells: &Cells, aabbs: &[Aabb], most: u32) -> Found {
    const CHUNK: usize = 256;
    let count = AtomicU64::new(0);
    let chunks: Vec<(Vec<[u32; 2]>, u32)> = (0..aabbs.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut pairs = Vec::with_capacity(CHUNK * 6);
            let mut candidates = 0;
            for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(aabbs.len()) {
                let before = pairs.len();
                candidates = candidates.max(partners(grid, cells, aabbs, i as u32, &mut pairs));
                let own = (pairs.len() - before) as u64;
                if count.fetch_add(own, Ordering::Relaxed) + own > most.into() {
                    pairs = Vec::new();
                }
            }
            (pairs, candidates)
        })
        .collect();
    let most_candidates = chunks.iter().map(|c| c.1).max().unwrap_or(0);
    let mut pairs = Vec::with_capacity(chunks.iter().map(|c| c.0.len()).sum());
    for (chunk, _) in &chunks {
        pairs.extend_from_slice(chunk);
    }
    Found { pairs, count: count.into_inner(), most_candidates }
}

/// Appends the partners of `i` that have a higher index, in order; returns how many candidates its cells held.
fn partners(grid: &Grid, cells: &Cells, aabbs: &[Aabb], i: u32, pairs: &mut Vec<[u32; 2]>) -> u32 {
    let own = &aabbs[i as usize];
    if own.body & aabb_body::LIVE == 0 {
        return 0;
    }
    let first = pairs.len();
    let mut candidates = 0;
    let mut offer = |j: u32| {
        if j > i && meets(own, &aabbs[j as usize]) {
            pairs.push([i, j]);
        }
    };
    cells.large.iter().for_each(|&j| offer(j));
    if grid.holds(own) {
        let [x, y, z] = grid.cell(own);
        for neighbour in 0..27 {
            let cell = [x + neighbour % 3 - 1, y + neighbour / 3 % 3 - 1, z + neighbour / 9 - 1];
            let index = grid.index(cell);
            let range = cells.start[index] as usize..cells.start[index + 1] as usize;
            candidates += range.len() as u32;
            if candidates <= CELL_LOOP_LIMIT {
                cells.entries[range].iter().for_each(|&j| offer(j));
            }
        }
    } else {
        ((i + 1)..aabbs.len() as u32).filter(|&j| grid.holds(&aabbs[j as usize])).for_each(&mut offer);
    }
    pairs[first..].sort_unstable();
    candidates
}

/// How many candidates, or colliders outside the grid, there are where a shader's loop over them would come near its
/// bound; nothing where none does.
pub fn too_crowded(found: &Found, cells: &Cells) -> Option<u32> {
    let large = cells.large.len() as u32;
    let candidates = (found.most_candidates > CELL_LOOP_LIMIT).then_some(found.most_candidates);
    candidates.max((large > LARGE_LOOP_LIMIT).then_some(large))
}
