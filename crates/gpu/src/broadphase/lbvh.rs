//! Stage `broadphase/lbvh`: linear bounding volume hierarchy. Host side of `shaders/broadphase/lbvh/*.wgsl`.

use super::{Choice, those_of};
use crate::primitives::{Count, Sort, SortOptions};
use crate::store::Sizes;
use crate::{Bind, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::edit::Stale;
use tumble_core::layout::{StepParams, TreeInfo, TreeNode, tree_members};
use tumble_core::limits::STATUS_DELAY;
use tumble_core::wear::Wear;
use tumble_core::{MortonBits, Result, Traversal};
use wgpu::BufferUsages;

/// Levels of the pyramid that one dispatch makes.
const LEVELS: u32 = 8;

/// A tree of what moves, and one of what is fixed.
pub(crate) struct Lbvh {
    scratch: Scratch,
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
        let options =
            |members, capacity| TreeOptions { capacity, members, bits: choice.bits, traversal: choice.traversal };
        Ok(Self {
            scratch: Scratch::new(gpu, pipelines, sizes.colliders, choice.bits)?,
            moving: Tree::new(gpu, pipelines, &options(tree_members::MOVING, sizes.colliders))?,
            fixed: match choice.fixed {
                0 => None,
                count => Some(Tree::new(gpu, pipelines, &options(tree_members::FIXED, count))?),
            },
            wear: Wear::default(),
            margins: None,
            build: Stale::default(),
            leaves: sizes.colliders,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.scratch.bytes() + self.moving.bytes() + self.fixed.as_ref().map_or(0, Tree::bytes)
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
        self.moving.prepare(gpu, step.collider_count);
        if let Some(tree) = &mut self.fixed {
            tree.prepare(gpu, step.collider_count);
        }
        self.scratch.prepare(gpu, step.collider_count)
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, _step: &StepParams) -> Result<()> {
        if let Some(fixed) = self.fixed.as_ref().filter(|_| self.build.fixed) {
            fixed.record_build(recorder, &self.scratch)?;
            fixed.record_refit(recorder)?;
        }
        if self.build.moving {
            self.moving.record_build(recorder, &self.scratch)?;
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
    /// Leaves at most.
    pub(crate) capacity: u32,
    /// Of `tree_members`.
    pub(crate) members: u32,
    pub(crate) bits: MortonBits,
    pub(crate) traversal: Traversal,
}

/// What a build needs and a walk does not; trees that are built one after the other share it.
pub(crate) struct Scratch {
    sort: Sort,
    keys: wgpu::Buffer,
    members: wgpu::Buffer,
}

impl Scratch {
    /// For so many collider slots at most.
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, slots: u32, bits: MortonBits) -> Result<Self> {
        let (slots, bits) = (slots.max(1), key_bits(bits));
        let each = |name, bytes| {
            gpu.create_buffer(name, bytes * u64::from(slots), BufferUsages::STORAGE | BufferUsages::COPY_SRC)
        };
        Ok(Self {
            keys: each("tree keys", 4 * bits.len() as u64)?,
            members: each("tree members", 4)?,
            sort: Sort::new(gpu, pipelines, SortOptions { capacity: slots, count: Count::Host(0), bits })?,
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.keys.size() + self.members.size() + self.sort.bytes()
    }

    /// Tells how many slots there are, for what is submitted from now on.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, slots: u32) -> Result<()> {
        self.sort.set_count(gpu, slots)
    }
}

/// Bits of each word of a key: what is not in the tree has the bit above all codes.
fn key_bits(bits: MortonBits) -> Vec<u32> {
    if bits == MortonBits::Bits63 { vec![32, 32] } else { vec![31] }
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
    info: TreeInfo,
    params: wgpu::Buffer,
    levels: wgpu::Buffer,
    nodes: wgpu::Buffer,
    ends: wgpu::Buffer,
    parents_of: wgpu::Buffer,
    pyramid: wgpu::Buffer,
    leaf_count: wgpu::Buffer,
}

impl Tree {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, options: &TreeOptions) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "broadphase/lbvh/walk", entry);
        let history = options.traversal == Traversal::History;
        let (pairs, across) = match options.traversal {
            Traversal::History => (pass("pairs_by_history")?, pass("across_by_history")?),
            Traversal::Stack => (pass("pairs_with_stack")?, pass("across_with_stack")?),
            _ => (pass("pairs_by_escapes")?, pass("across_by_escapes")?),
        };
        let mut pass = |entry| pipelines.pass(gpu, "broadphase/lbvh/build", entry);
        let [codes, hierarchy, leaves] = [pass("codes")?, pass("hierarchy")?, pass("leaves")?];
        let [pyramid_up, boxes] = [pass("pyramid_up")?, pass("boxes")?];
        let parents = if history { Some(pass("parents")?) } else { None };
        let leaves_at_most = options.capacity.max(1);
        let capacity = leaves_at_most.next_power_of_two();
        let words = key_bits(options.bits).len() as u32;
        let info = TreeInfo { slots: 0, members: options.members, words, capacity };
        let each = |name, bytes: u64| {
            gpu.create_buffer(name, bytes * u64::from(leaves_at_most), BufferUsages::STORAGE | BufferUsages::COPY_SRC)
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
            nodes: each("tree nodes", 2 * size_of::<TreeNode>() as u64)?,
            ends: each("tree ends", 4)?,
            parents_of: if history { each("tree parents", 8)? } else { gpu.create_buffer("no parents", 4, storage)? },
            pyramid: gpu.create_buffer("tree pyramid", 24 * u64::from(capacity), storage)?,
            leaf_count: gpu.create_buffer("tree leaf count", 4, storage)?,
            info,
        })
    }

    /// Bytes of all arrays.
    pub(crate) fn bytes(&self) -> u64 {
        let own = [&self.nodes, &self.ends, &self.parents_of, &self.pyramid];
        own.iter().map(|buffer| buffer.size()).sum()
    }

    /// What a walk needs: the nodes, and how many leaves there are.
    pub(crate) fn walk_binds(&self) -> [Bind<'_>; 2] {
        [Bind::new("nodes", &self.nodes), Bind::new("leaf_count", &self.leaf_count)]
    }

    /// Tells how many slots there are, for what is submitted from now on.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, slots: u32) {
        self.info.slots = slots;
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&self.info));
    }

    fn run(&self, recorder: &mut Recorder, pass: &Pass, level: u32, groups: u32) -> Result<()> {
        recorder.dispatch(pass, &those_of(pass, &self.binds(level)), groups)
    }

    fn binds(&self, level: u32) -> [Bind<'_>; 7] {
        [
            Bind::new("tree", &self.params),
            Bind::part("level", &self.levels, 256 * u64::from(level), 16),
            Bind::new("nodes", &self.nodes),
            Bind::new("ends", &self.ends),
            Bind::new("parents_of", &self.parents_of),
            Bind::new("pyramid", &self.pyramid),
            Bind::new("leaf_count", &self.leaf_count),
        ]
    }

    /// Workgroups for a thread a collider slot.
    fn by_slot(&self) -> u32 {
        self.info.slots.div_ceil(256)
    }

    /// Workgroups for a thread a leaf.
    fn by_leaf(&self) -> u32 {
        self.info.slots.min(self.info.capacity).div_ceil(256)
    }

    /// Who is in it, in which order, and how the nodes hang together.
    pub(crate) fn record_build(&self, recorder: &mut Recorder, scratch: &Scratch) -> Result<()> {
        let [keys, members] = [Bind::new("keys", &scratch.keys), Bind::new("members", &scratch.members)];
        let own: Vec<_> = self.binds(0).into_iter().chain([keys, members]).collect();
        recorder.dispatch(&self.codes, &those_of(&self.codes, &own), self.by_slot())?;
        scratch.sort.record(recorder, &scratch.keys, &scratch.members, None)?;
        recorder.dispatch(&self.hierarchy, &those_of(&self.hierarchy, &own), self.by_leaf())?;
        match &self.parents {
            Some(parents) => self.run(recorder, parents, 0, self.by_leaf()),
            None => Ok(()),
        }
    }

    /// Boxes of all nodes.
    pub(crate) fn record_refit(&self, recorder: &mut Recorder) -> Result<()> {
        let leaves = self.info.slots.min(self.info.capacity);
        self.run(recorder, &self.leaves, 0, self.by_leaf())?;
        let mut level = 1;
        while leaves >> (LEVELS * level) > 1 {
            let boxes = leaves.div_ceil(1 << (LEVELS * level));
            self.run(recorder, &self.pyramid_up, level, boxes.div_ceil(256))?;
            level += 1;
        }
        self.run(recorder, &self.boxes, 0, self.by_leaf())
    }

    /// Pairs of its leaves with each other, and with `large_list`.
    pub(crate) fn record_pairs(&self, recorder: &mut Recorder) -> Result<()> {
        self.run(recorder, &self.pairs, 0, self.by_slot())
    }

    /// Pairs of its leaves with colliders that are not in it.
    pub(crate) fn record_across(&self, recorder: &mut Recorder) -> Result<()> {
        self.run(recorder, &self.across, 0, self.by_slot())
    }
}
