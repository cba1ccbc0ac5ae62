//! Stage `broadphase/lbvh`: linear bounding volume hierarchy. Host side of `shaders/broadphase/lbvh.wgsl`.

use super::{Choice, those_of};
use crate::primitives::{Count, Sort, SortOptions};
use crate::store::Sizes;
use crate::{Bind, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::edit::Stale;
use tumble_core::layout::{StepParams, TreeInfo, TreeNode, tree_members};
use tumble_core::wear::Wear;
use tumble_core::{MortonBits, Result, Traversal};
use wgpu::BufferUsages;

/// Steps after which a status has come back: no decision looks at a later one.
const STATUS_DELAY: u32 = 3;
/// Levels of the pyramid that one dispatch makes.
const LEVELS: u32 = 8;

/// A tree of what moves, and one of what is fixed.
pub(crate) struct Lbvh {
    moving: Tree,
    fixed: Option<Tree>,
    wear: Wear,
    /// The margins of the fixed tree's boxes; `None` before it is built.
    margins: Option<[u32; 2]>,
    build: Stale,
    leaves: u32,
}

impl Lbvh {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes, choice: &Choice) -> Result<Self> {
        let options = |members| TreeOptions {
            capacity: sizes.colliders,
            members,
            bits: choice.bits,
            traversal: choice.traversal,
        };
        Ok(Self {
            moving: Tree::new(gpu, pipelines, &options(tree_members::MOVING))?,
            fixed: match choice.fixed {
                true => Some(Tree::new(gpu, pipelines, &options(tree_members::FIXED))?),
                false => None,
            },
            wear: Wear::default(),
            margins: None,
            build: Stale::default(),
            leaves: sizes.colliders,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.moving.bytes() + self.fixed.as_ref().map_or(0, Tree::bytes)
    }

    pub(crate) fn walked(&mut self, step: u32, turns: u32) {
        self.wear.walked(step, turns);
    }

    /// Decides what is built anew in this step.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, step: &StepParams, stale: Stale) -> Result<()> {
        let margins = [step.dt, step.speculative_distance].map(f32::to_bits);
        let first = self.margins.is_none();
        let other = self.margins.replace(margins) != Some(margins);
        let due = self.wear.is_due(step.step.saturating_sub(STATUS_DELAY), self.leaves);
        self.build = Stale { moving: first || stale.moving || due, fixed: other || stale.fixed };
        if self.build.moving {
            self.wear.built(step.step);
            self.leaves = step.collider_count;
        }
        self.moving.prepare(gpu, step.collider_count)?;
        match &mut self.fixed {
            Some(tree) => tree.prepare(gpu, step.collider_count),
            None => Ok(()),
        }
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, _step: &StepParams) -> Result<()> {
        if let Some(fixed) = self.fixed.as_ref().filter(|_| self.build.fixed) {
            fixed.record_build(recorder)?;
            fixed.record_refit(recorder)?;
        }
        if self.build.moving {
            self.moving.record_build(recorder)?;
        }
        self.moving.record_refit(recorder)?;
        self.moving.record_pairs(recorder)?;
        match &self.fixed {
            Some(fixed) => fixed.record_across(recorder),
            None => Ok(()),
        }
    }
}

/// What a [`Tree`] is to be.
pub(crate) struct TreeOptions {
    /// Collider slots at most.
    pub(crate) capacity: u32,
    /// Of `tree_members`.
    pub(crate) members: u32,
    pub(crate) bits: MortonBits,
    pub(crate) traversal: Traversal,
}

/// A tree over some of the colliders of `aabbs`.
pub(crate) struct Tree {
    codes: Arc<Pass>,
    hierarchy: Arc<Pass>,
    parents: Option<Arc<Pass>>,
    leaves: Arc<Pass>,
    pyramid_up: Arc<Pass>,
    boxes: Arc<Pass>,
    pairs: Arc<Pass>,
    across: Arc<Pass>,
    sort: Sort,
    info: TreeInfo,
    params: wgpu::Buffer,
    levels: wgpu::Buffer,
    keys: wgpu::Buffer,
    members: wgpu::Buffer,
    nodes: wgpu::Buffer,
    ends: wgpu::Buffer,
    parents_of: wgpu::Buffer,
    pyramid: wgpu::Buffer,
    leaf_count: wgpu::Buffer,
}

impl Tree {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, options: &TreeOptions) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "broadphase/lbvh", entry);
        let history = options.traversal == Traversal::History;
        let (pairs, across) = match options.traversal {
            Traversal::History => (pass("pairs_by_history")?, pass("across_by_history")?),
            Traversal::Stack => (pass("pairs_with_stack")?, pass("across_with_stack")?),
            _ => (pass("pairs_by_escapes")?, pass("across_by_escapes")?),
        };
        let [codes, hierarchy, leaves] = [pass("codes")?, pass("hierarchy")?, pass("leaves")?];
        let [pyramid_up, boxes] = [pass("pyramid_up")?, pass("boxes")?];
        let parents = if history { Some(pass("parents")?) } else { None };
        let slots = options.capacity.max(1);
        let capacity = slots.next_power_of_two();
        // What is not in the tree has the bit above all codes.
        let bits = if options.bits == MortonBits::Bits63 { vec![32, 32] } else { vec![31] };
        let info = TreeInfo { slots, members: options.members, words: bits.len() as u32, capacity };
        let each = |name, bytes: u64| {
            gpu.create_buffer(name, bytes * u64::from(slots), BufferUsages::STORAGE | BufferUsages::COPY_SRC)
        };
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let levels = gpu.create_buffer("tree levels", 5 * 256, uniform)?;
        for k in 0..5u32 {
            gpu.queue.write_buffer(&levels, 256 * u64::from(k), bytemuck::cast_slice(&[k * LEVELS, 0, 0, 0]));
        }
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        Ok(Self {
            codes,
            hierarchy,
            parents,
            leaves,
            pyramid_up,
            boxes,
            pairs,
            across,
            params: gpu.create_buffer("tree", size_of::<TreeInfo>() as u64, uniform)?,
            levels,
            keys: each("tree keys", 4 * bits.len() as u64)?,
            members: each("tree members", 4)?,
            nodes: each("tree nodes", 2 * size_of::<TreeNode>() as u64)?,
            ends: each("tree ends", 4)?,
            parents_of: if history { each("tree parents", 8)? } else { gpu.create_buffer("no parents", 4, storage)? },
            pyramid: gpu.create_buffer("tree pyramid", 24 * u64::from(capacity), storage)?,
            leaf_count: gpu.create_buffer("tree leaf count", 4, storage)?,
            sort: Sort::new(gpu, pipelines, SortOptions { capacity: slots, count: Count::Host(0), bits })?,
            info,
        })
    }

    /// Bytes of all arrays, and of the sort's scratch.
    pub(crate) fn bytes(&self) -> u64 {
        let own = [&self.keys, &self.members, &self.nodes, &self.ends, &self.parents_of, &self.pyramid];
        own.iter().map(|buffer| buffer.size()).sum::<u64>() + self.sort.bytes()
    }

    /// What a walk needs: the nodes, and how many leaves there are.
    pub(crate) fn binds(&self) -> [Bind<'_>; 2] {
        [Bind::new("nodes", &self.nodes), Bind::new("leaf_count", &self.leaf_count)]
    }

    /// Tells how many slots there are, for what is submitted from now on.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, slots: u32) -> Result<()> {
        self.info.slots = slots;
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&self.info));
        self.sort.set_count(gpu, slots)
    }

    fn run(&self, recorder: &mut Recorder, pass: &Pass, level: u32, groups: u32) -> Result<()> {
        let own = [
            Bind::new("tree", &self.params),
            Bind::part("level", &self.levels, 256 * u64::from(level), 16),
            Bind::new("keys", &self.keys),
            Bind::new("members", &self.members),
            Bind::new("nodes", &self.nodes),
            Bind::new("ends", &self.ends),
            Bind::new("parents_of", &self.parents_of),
            Bind::new("pyramid", &self.pyramid),
            Bind::new("leaf_count", &self.leaf_count),
        ];
        recorder.dispatch(pass, &those_of(pass, &own), groups)
    }

    fn groups(&self) -> u32 {
        self.info.slots.div_ceil(256)
    }

    /// Who is in it, in which order, and how the nodes hang together.
    pub(crate) fn record_build(&self, recorder: &mut Recorder) -> Result<()> {
        self.run(recorder, &self.codes, 0, self.groups())?;
        self.sort.record(recorder, &self.keys, &self.members, None)?;
        self.run(recorder, &self.hierarchy, 0, self.groups())?;
        match &self.parents {
            Some(parents) => self.run(recorder, parents, 0, self.groups()),
            None => Ok(()),
        }
    }

    /// Boxes of all nodes.
    pub(crate) fn record_refit(&self, recorder: &mut Recorder) -> Result<()> {
        self.run(recorder, &self.leaves, 0, self.groups())?;
        let mut level = 1;
        while self.info.slots >> (LEVELS * level) > 1 {
            let boxes = self.info.slots.div_ceil(1 << (LEVELS * level));
            self.run(recorder, &self.pyramid_up, level, boxes.div_ceil(256))?;
            level += 1;
        }
        self.run(recorder, &self.boxes, 0, self.groups())
    }

    /// Pairs of its leaves with each other, and with `large_list`.
    pub(crate) fn record_pairs(&self, recorder: &mut Recorder) -> Result<()> {
        self.run(recorder, &self.pairs, 0, self.groups())
    }

    /// Pairs of its leaves with colliders that are not in it.
    pub(crate) fn record_across(&self, recorder: &mut Recorder) -> Result<()> {
        self.run(recorder, &self.across, 0, self.groups())
    }
}
