//! The buffers of a world: names, elements, sizes. Each name is that of a global in the shaders.

use crate::{Bind, Buffers, Gpu};
use bytemuck::Zeroable;
use tumble_core::layout::{
    Aabb, BodyProps, BodyState, Collider, ConstraintHead, ConstraintPoint, Control, EditRange, EditRecord,
    FoundManifold, Impulse, LEVELS, Manifold, ManifoldMemory, Pair, PoseRecord, Rest, SolverBody, StepParams,
};
use tumble_core::limits::LAST_LIMIT;
use tumble_core::{PackedScene, Plan, Result};
use wgpu::BufferUsages;

/// Words of `counters`, for passes that take a count from there.
pub(crate) mod word {
    use std::mem::offset_of;
    use tumble_core::layout::Control;

    pub(crate) const OLD_PAIR_COUNT: u32 = offset_of!(Control, old_pair_count) as u32 / 4;
    pub(crate) const PAIR_COUNT: u32 = offset_of!(Control, pair_count) as u32 / 4;
    pub(crate) const NEW_COUNT: u32 = offset_of!(Control, new_count) as u32 / 4;
    pub(crate) const DEAD_COUNT: u32 = offset_of!(Control, dead_count) as u32 / 4;
    pub(crate) const UNPLACED: u32 = offset_of!(Control, unplaced) as u32 / 4;
}

/// Bytes in `dispatch_args` where the arguments of the commit phase lie.
pub(crate) mod args {
    /// One thread a constraint of this batch.
    pub(crate) const fn batch(index: u32) -> u64 {
        16 * index as u64
    }
    /// One workgroup if batches without a dispatch of their own have constraints.
    pub(crate) const TAIL: u64 = 16 * 63;
    /// One thread a constraint.
    pub(crate) const CONSTRAINTS: u64 = 16 * 64;
    /// One thread a pair.
    pub(crate) const PAIRS: u64 = 16 * 65;
    /// One thread a pair that is gone, or new.
    pub(crate) const DEAD: u64 = 16 * 66;
    /// All.
    pub(crate) const COUNT: u64 = 67;
}

/// How many elements the arrays of a world have room for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Sizes {
    pub(crate) bodies: u32,
    pub(crate) colliders: u32,
    pub(crate) pairs: u32,
    /// Bodies if something asks for their islands, else 0.
    pub(crate) islands: u32,
    /// Ends of constraints in the last batch if it is solved by mass splitting, else 0.
    pub(crate) parts: u32,
}

impl Sizes {
    /// What the plan needs beside bodies, colliders and pairs.
    pub(crate) fn with(self, plan: &Plan) -> Self {
        let islands = if plan.islands() { self.bodies } else { 0 };
        let parts = if plan.split { 2 * self.pairs.min(LAST_LIMIT) } else { 0 };
        Self { islands, parts, ..self }
    }
}

/// Which count an array follows.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Per {
    Body,
    Collider,
    Pair,
    Island,
    Part,
}

/// Name, bytes of an element, what it follows, whether its content outlives a step.
const ARRAYS: [(&str, usize, Per, bool); 40] = [
    ("states", size_of::<BodyState>(), Per::Body, true),
    ("work_states", size_of::<BodyState>(), Per::Body, false),
    ("props", size_of::<BodyProps>(), Per::Body, true),
    ("poses", size_of::<PoseRecord>(), Per::Body, true),
    ("solver_bodies", size_of::<SolverBody>(), Per::Body, false),
    ("shares", 4, Per::Body, false),
    ("masks", 8, Per::Body, false),
    ("claims", 4, Per::Body, false),
    ("islands", 4, Per::Island, false),
    ("island_credits", 4, Per::Island, false),
    ("island_leasts", 4, Per::Island, false),
    ("island_overlaps", 4, Per::Island, false),
    ("stirs", 4, Per::Island, false),
    ("rests", size_of::<Rest>(), Per::Island, true),
    ("colliders", size_of::<Collider>(), Per::Collider, true),
    ("aabbs", size_of::<Aabb>(), Per::Collider, false),
    ("large_list", 4, Per::Collider, false),
    ("pairs", size_of::<Pair>(), Per::Pair, true),
    ("next_pairs", size_of::<Pair>(), Per::Pair, false),
    ("free_slots", 4, Per::Pair, true),
    ("batch_of_slot", 4, Per::Pair, true),
    ("slot_impulses", 4 * size_of::<Impulse>(), Per::Pair, true),
    ("slot_memory", size_of::<ManifoldMemory>(), Per::Pair, true),
    ("found_manifolds", size_of::<FoundManifold>(), Per::Pair, true),
    ("pair_keys", 8, Per::Pair, false),
    ("pair_values", 4, Per::Pair, false),
    ("dead_rank", 4, Per::Pair, false),
    ("dead_slots", 4, Per::Pair, false),
    ("fresh_rank", 4, Per::Pair, false),
    ("manifolds", size_of::<Manifold>(), Per::Pair, false),
    ("pair_batch", 4, Per::Pair, false),
    ("unplaced", 4, Per::Pair, false),
    ("batch_keys", 4, Per::Pair, false),
    ("batch_order", 4, Per::Pair, false),
    ("heads", size_of::<ConstraintHead>(), Per::Pair, false),
    ("points", 4 * size_of::<ConstraintPoint>(), Per::Pair, false),
    ("impulses", 4 * size_of::<Impulse>(), Per::Pair, false),
    ("part_bodies", 4, Per::Part, false),
    ("part_ends", 4, Per::Part, false),
    ("part_changes", 64, Per::Part, false),
];

/// Part `index` of the buffer that holds the numbers 0 to 63, as the uniform `name`.
pub(crate) fn index_part<'a>(name: &'a str, buffers: &'a Buffers, index: u32) -> Result<Bind<'a>> {
    Ok(Bind::part(name, buffers.buffer("indices")?, 256 * index as u64, 16))
}

/// Where the numbers of a level's step lie in `level_steps`, bytes.
pub(crate) fn level_offset(step: &StepParams) -> u64 {
    256 * u64::from(step.level)
}

/// Those numbers as the uniform `step`.
pub(crate) fn level_part<'a>(buffers: &'a Buffers, step: &StepParams) -> Result<Bind<'a>> {
    Ok(Bind::part("step", buffers.buffer("level_steps")?, level_offset(step), size_of::<StepParams>() as u64))
}

fn count(per: Per, sizes: &Sizes) -> u64 {
    u64::from(match per {
        Per::Body => sizes.bodies,
        Per::Collider => sizes.colliders,
        Per::Pair => sizes.pairs,
        Per::Island => sizes.islands,
        Per::Part => sizes.parts,
    })
}

/// Creates every buffer and loads the scene.
pub(crate) fn create(gpu: &Gpu, packed: &PackedScene, sizes: &Sizes, edits: u32) -> Result<Buffers> {
    let mut buffers = Buffers::new();
    let (storage, uniform) = (BufferUsages::STORAGE, BufferUsages::UNIFORM);
    for (name, bytes, per, _) in ARRAYS {
        let extra = if name == "poses" { BufferUsages::VERTEX } else { BufferUsages::empty() };
        buffers.create(gpu, name, bytes as u64, count(per, sizes), storage | extra)?;
    }
    buffers.create(gpu, "control", size_of::<Control>() as u64, 1, storage | uniform)?;
    buffers.alias("counters", "control");
    buffers.create(gpu, "step", size_of::<StepParams>() as u64, 1, uniform)?;
    buffers.create(gpu, "level_steps", 256, LEVELS.into(), uniform)?;
    buffers.create(gpu, "part_count", 4, 1, storage)?;
    buffers.create(gpu, "apart", 8, 1, storage)?;
    buffers.create(gpu, "joined", 8, 1, storage)?;
    buffers.create(gpu, "class_histogram", 4, 1024, storage)?;
    buffers.create(gpu, "dispatch_args", 16, args::COUNT, storage | BufferUsages::INDIRECT)?;
    buffers.create(gpu, "edit_records", size_of::<EditRecord>() as u64, edits.into(), storage)?;
    buffers.create(gpu, "edit_ranges", size_of::<EditRange>() as u64, edits.into(), storage)?;
    buffers.create(gpu, "indices", 256, 64, uniform)?;
    crate::joint::create(gpu, &mut buffers)?;
    let indices: Vec<u32> = (0..64 * 64).map(|i| if i % 64 == 0 { i / 64 } else { 0 }).collect();
    let write = |name: &str, bytes: &[u8]| -> Result<()> {
        gpu.queue.write_buffer(buffers.buffer(name)?, 0, bytes);
        Ok(())
    };
    write("indices", bytemuck::cast_slice(&indices))?;
    write("states", bytemuck::cast_slice(&packed.states))?;
    write("props", bytemuck::cast_slice(&packed.props))?;
    write("colliders", bytemuck::cast_slice(&packed.colliders))?;
    // Lowest slots on top of the stack.
    let free: Vec<u32> = (0..sizes.pairs).rev().collect();
    write("free_slots", bytemuck::cast_slice(&free))?;
    let control = Control { free_count: sizes.pairs, ..Control::zeroed() };
    write("control", bytemuck::bytes_of(&control))?;
    Ok(buffers)
}

/// Makes room; what outlives a step is kept. The free list is not: see [`write_free`].
pub(crate) fn grow(gpu: &Gpu, buffers: &mut Buffers, sizes: &Sizes) -> Result<()> {
    ARRAYS.iter().try_for_each(|(name, _, per, lasting)| buffers.grow(gpu, name, count(*per, sizes), *lasting))
}

/// Puts the slots from `old` on below those that were on the free list.
pub(crate) fn write_free(gpu: &Gpu, buffers: &Buffers, was: &[u32], old: u32, sizes: &Sizes) -> Result<u32> {
    let mut free: Vec<u32> = (old..sizes.pairs).rev().collect();
    free.extend_from_slice(was);
    gpu.queue.write_buffer(buffers.buffer("free_slots")?, 0, bytemuck::cast_slice(&free));
    Ok(free.len() as u32)
}
