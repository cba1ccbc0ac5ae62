//! Stage `broadphase/grid`: uniform grid. Host side of `shaders/broadphase/grid.wgsl`.

use super::lbvh::{Scratch, Tree, TreeOptions};
use super::{Choice, those_of};
use crate::primitives::{Count, Scan, ScanOptions};
use crate::store::Sizes;
use crate::{Bind, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::layout::{Aabb, StepParams, tree_members};
use tumble_core::{Broadphase, MortonBits, Result, limits};
use wgpu::BufferUsages;

pub(crate) struct Grid {
    choose: Arc<Pass>,
    clear: Arc<Pass>,
    count: Arc<Pass>,
    scatter: Arc<Pass>,
    pairs: Arc<Pass>,
    scan_cells: Scan,
    slices: Option<Slices>,
    large: Option<Large>,
    cells: wgpu::Buffer,
    cell_boxes: wgpu::Buffer,
    slice_bounds: wgpu::Buffer,
    slice_start: wgpu::Buffer,
    options: wgpu::Buffer,
}

/// What a grid in slices has beside.
struct Slices {
    bound: Arc<Pass>,
    size: Arc<Pass>,
    scan: Scan,
    room: u32,
}

/// The tree of colliders larger than a cell.
struct Large {
    scratch: Scratch,
    tree: Tree,
}

impl Grid {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes, choice: &Choice) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "broadphase/grid", entry);
        let [choose, clear, count, scatter] = [pass("choose")?, pass("clear")?, pass("count")?, pass("scatter")?];
        let pairs = pass("pairs")?;
        let host = |capacity| ScanOptions { capacity, count: Count::Host(0), total: None };
        let cell_count = (1 << limits::cell_table_bits(sizes.colliders)) + 1;
        let slices = match choice.which {
            Broadphase::SlicedGrid => {
                let room = (cell_count - 1).min(limits::SLICE_LIMIT);
                let [bound, size] = [pass("bound_slices")?, pass("size_slices")?];
                Some(Slices { bound, size, scan: Scan::new(gpu, pipelines, host(room))?, room })
            }
            _ => None,
        };
        let large = match choice.large_tree {
            true => {
                let options = TreeOptions {
                    capacity: limits::large_limit(sizes.colliders, true),
                    members: tree_members::LARGE,
                    bits: MortonBits::Bits30,
                    traversal: choice.traversal,
                };
                let scratch = Scratch::new(gpu, pipelines, sizes.colliders, options.bits)?;
                Some(Large { scratch, tree: Tree::new(gpu, pipelines, &options)? })
            }
            false => None,
        };
        let room = slices.as_ref().map_or(0, |slices| slices.room);
        let storage = |name, bytes| gpu.create_buffer(name, bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let options = gpu.create_buffer("grid options", 16, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
        gpu.queue.write_buffer(&options, 0, bytemuck::cast_slice(&[room, u32::from(choice.large_tree), 0, 0]));
        Ok(Self {
            choose,
            clear,
            count,
            scatter,
            pairs,
            scan_cells: Scan::new(gpu, pipelines, host(cell_count))?,
            slices,
            large,
            cells: storage("cells", 4 * u64::from(cell_count))?,
            cell_boxes: storage("cell boxes", size_of::<Aabb>() as u64 * u64::from(sizes.colliders.max(1)))?,
            slice_bounds: storage("slice bounds", 16 * u64::from(room))?,
            slice_start: storage("slice start", 4 * u64::from(room))?,
            options,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        let own = [&self.cells, &self.cell_boxes, &self.slice_bounds, &self.slice_start];
        own.iter().map(|buffer| buffer.size()).sum::<u64>()
            + self.large.as_ref().map_or(0, |large| large.scratch.bytes() + large.tree.bytes())
    }

    /// Tells scans and sorts how long their arrays are in this step.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, step: &StepParams) -> Result<()> {
        self.scan_cells.set_count(gpu, (1 << step.cell_table_bits) + 1)?;
        if let Some(slices) = &mut self.slices {
            slices.scan.set_count(gpu, slices.room)?;
        }
        match &mut self.large {
            Some(large) => {
                large.tree.prepare(gpu, step.collider_count);
                large.scratch.prepare(gpu, step.collider_count)
            }
            None => Ok(()),
        }
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        let own = [
            Bind::new("cells", &self.cells),
            Bind::new("cell_boxes", &self.cell_boxes),
            Bind::new("slice_bounds", &self.slice_bounds),
            Bind::new("slice_start", &self.slice_start),
            Bind::new("grid_options", &self.options),
        ];
        let colliders = step.collider_count.div_ceil(256);
        let cells = (1u32 << step.cell_table_bits) + 1;
        let run = |recorder: &mut Recorder, pass, groups| recorder.dispatch(pass, &those_of(pass, &own), groups);
        run(recorder, &self.choose, 1)?;
        run(recorder, &self.clear, cells.div_ceil(256))?;
        if let Some(slices) = &self.slices {
            run(recorder, &slices.bound, colliders)?;
            run(recorder, &slices.size, slices.room.div_ceil(256))?;
            slices.scan.record(recorder, &self.slice_start, None)?;
        }
        run(recorder, &self.count, colliders)?;
        self.scan_cells.record(recorder, &self.cells, None)?;
        run(recorder, &self.scatter, colliders)?;
        run(recorder, &self.pairs, colliders)?;
        if let Some(Large { scratch, tree }) = &self.large {
            tree.record_build(recorder, scratch)?;
            tree.record_refit(recorder)?;
            tree.record_pairs(recorder)?;
            tree.record_across(recorder)?;
        }
        Ok(())
    }
}
