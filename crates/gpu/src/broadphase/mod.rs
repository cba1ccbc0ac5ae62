//! Stage `broadphase`: which colliders' boxes overlap. Every broad phase leaves its pairs in `pair_keys`, in any order;
//! the gate and the sort behind it are the same for all.

mod brute_force;
mod grid;
pub(crate) mod lbvh;
mod sweep;

use crate::primitives::{Count, Sort, SortOptions};
use crate::store::{Sizes, word};
use crate::{Bind, Buffers, Gpu, Pass, Pipelines, Recorder};
use brute_force::BruteForce;
use grid::Grid;
use lbvh::Lbvh;
use std::sync::Arc;
use sweep::Sweep;
use tumble_core::edit::{Editor, Stale};
use tumble_core::layout::StepParams;
use tumble_core::{Broadphase as Which, MortonBits, Params, Result, Traversal};

/// What decides which passes a broad phase has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Choice {
    /// Never `Auto`.
    pub(crate) which: Which,
    traversal: Traversal,
    bits: MortonBits,
    /// Whether colliders larger than the grid's cells have a tree.
    pub(crate) large_tree: bool,
    /// Most bounded colliders of fixed bodies.
    fixed: u32,
}

impl Choice {
    /// For a scene as edited so far.
    pub(crate) fn new(params: &Params, editor: &Editor) -> Self {
        Self {
            which: params.broadphase.resolve(editor.spread()),
            traversal: params.traversal,
            bits: params.morton_bits,
            large_tree: editor.spread().is_wide(),
            fixed: editor.plan().fixed,
        }
    }
}

/// The broad phase of a world.
pub(crate) struct Broadphase {
    kind: Kind,
    gate: Arc<Pass>,
    sort: Sort,
}

enum Kind {
    BruteForce(BruteForce),
    Grid(Box<Grid>),
    Lbvh(Box<Lbvh>),
    Sweep(Box<Sweep>),
}

impl Broadphase {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes, choice: &Choice) -> Result<Self> {
        let kind = match choice.which {
            Which::BruteForce => Kind::BruteForce(BruteForce::new(gpu, pipelines)?),
            Which::Lbvh => Kind::Lbvh(Box::new(Lbvh::new(gpu, pipelines, sizes, choice)?)),
            Which::SweepAndPrune => Kind::Sweep(Box::new(Sweep::new(gpu, pipelines, sizes)?)),
            _ => Kind::Grid(Box::new(Grid::new(gpu, pipelines, sizes, choice)?)),
        };
        let bits = 32 - sizes.colliders.saturating_sub(1).leading_zeros();
        let by_pair = SortOptions { capacity: sizes.pairs, count: Count::Word(word::PAIR_COUNT), bits: vec![bits; 2] };
        Ok(Self {
            kind,
            gate: pipelines.pass(gpu, "broadphase/pairs", "gate")?,
            sort: Sort::new(gpu, pipelines, by_pair)?,
        })
    }

    /// Bytes of all that is the broad phase's own, the sort of the pairs excepted.
    pub(crate) fn bytes(&self) -> u64 {
        match &self.kind {
            Kind::BruteForce(_) => 0,
            Kind::Grid(grid) => grid.bytes(),
            Kind::Lbvh(lbvh) => lbvh.bytes(),
            Kind::Sweep(sweep) => sweep.bytes(),
        }
    }

    /// Bytes of the sort of the pairs.
    pub(crate) fn sort_bytes(&self) -> u64 {
        self.sort.bytes()
    }

    /// Tells it what it must know on the host before the step is submitted.
    pub(crate) fn prepare(&mut self, gpu: &Gpu, step: &StepParams, stale: Stale) -> Result<()> {
        match &mut self.kind {
            Kind::BruteForce(_) => Ok(()),
            Kind::Grid(grid) => grid.prepare(gpu, step),
            Kind::Lbvh(lbvh) => lbvh.prepare(gpu, step, stale),
            Kind::Sweep(sweep) => sweep.prepare(gpu, step),
        }
    }

    /// The search for partners took so many turns in this step, over a tree of so many leaves.
    pub(crate) fn walked(&mut self, step: u32, turns: u32) {
        if let Kind::Lbvh(lbvh) = &mut self.kind {
            lbvh.walked(step, turns);
        }
    }

    pub(crate) fn record(&self, recorder: &mut Recorder, buffers: &Buffers, step: &StepParams) -> Result<()> {
        recorder.stage("broadphase");
        match &self.kind {
            Kind::BruteForce(brute_force) => brute_force.record(recorder, step)?,
            Kind::Grid(grid) => grid.record(recorder, step)?,
            Kind::Lbvh(lbvh) => lbvh.record(recorder, step)?,
            Kind::Sweep(sweep) => sweep.record(recorder, step)?,
        }
        recorder.dispatch(&self.gate, &[], 1)?;
        let (keys, values) = (buffers.buffer("pair_keys")?, buffers.buffer("pair_values")?);
        self.sort.record(recorder, keys, values, Some(buffers.buffer("counters")?))
    }
}

/// Those of `all` that the pass has.
fn those_of<'a>(pass: &Pass, all: &[Bind<'a>]) -> Vec<Bind<'a>> {
    let has = |bind: &&Bind| pass.bindings.iter().any(|binding| binding.name == bind.name);
    all.iter().filter(has).cloned().collect()
}
