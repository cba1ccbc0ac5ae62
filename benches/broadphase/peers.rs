//! Parry's tree and rapier's broad phase over the same boxes, in the same pool of threads.

use crate::{Sample, Watch};
use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhLeafUpdateStatus, BvhWorkspace};
use rapier3d::prelude as r;
use tumble_core::layout;
use tumble_cpu::broadphase::{bounded, matter};

fn aabb_of(aabb: &layout::Aabb) -> Aabb {
    Aabb::new(aabb.min.into(), aabb.max.into())
}

/// Pairs of a walk over all, of which ours leaves out those that cannot push each other.
fn that_matter(pairs: &[(u32, u32)], aabbs: &[layout::Aabb]) -> u64 {
    let matters = |&&(a, b): &&(u32, u32)| matter(aabbs[a as usize].body, aabbs[b as usize].body);
    pairs.iter().filter(matters).count() as u64
}

/// Parry's tree, kept from step to step.
#[derive(Default)]
pub(crate) struct Parry {
    tree: Bvh,
    workspace: BvhWorkspace,
    leaves: Vec<(Aabb, u32, f32)>,
    statuses: Vec<BvhLeafUpdateStatus>,
}

impl Parry {
    /// Builds the tree with the strategy that parry calls the fast one, and walks it against itself in parallel.
    pub(crate) fn build(aabbs: &[layout::Aabb]) -> (Self, Sample) {
        let leaves: Vec<_> =
            aabbs.iter().enumerate().filter(|(_, a)| bounded(a)).map(|(i, a)| (i, aabb_of(a))).collect();
        let mut watch = Watch::new();
        let tree = Bvh::from_iter(BvhBuildStrategy::Binned, leaves);
        watch.lap();
        let parry = Self { tree, ..Self::default() };
        let sample = parry.walk(watch, aabbs);
        (parry, sample)
    }

    /// Moves the leaves, refits and walks.
    pub(crate) fn refit(&mut self, aabbs: &[layout::Aabb]) -> Sample {
        let mut watch = Watch::new();
        self.leaves.clear();
        let bounded = aabbs.iter().enumerate().filter(|(_, a)| bounded(a));
        self.leaves.extend(bounded.map(|(i, a)| (aabb_of(a), i as u32, 0.0)));
        self.tree.insert_or_update_batch_partially_parallel(&self.leaves, &mut self.statuses);
        self.tree.refit_parallel(&mut self.workspace);
        watch.lap();
        self.walk(watch, aabbs)
    }

    fn walk(&self, mut watch: Watch, aabbs: &[layout::Aabb]) -> Sample {
        let pairs = self.tree.traverse_bvtt_single_tree_parallel::<false>();
        watch.lap();
        watch.sample(that_matter(&pairs, aabbs), self.tree.total_memory_size() as u64)
    }
}

/// Rapier's broad phase, with the colliders that it looks at.
pub(crate) struct Rapier {
    bodies: r::RigidBodySet,
    colliders: r::ColliderSet,
    handles: Vec<r::ColliderHandle>,
    parameters: r::IntegrationParameters,
    broad_phase: r::BroadPhaseBvh,
    pairs: i64,
}

impl Rapier {
    /// Cuboids of the boxes' size. `margin`: the unit of length, which rapier's margins are shares of; the boxes lie
    /// 2 mm further out for a unit of 1, and leaves of its tree another 40 mm.
    pub(crate) fn new(aabbs: &[layout::Aabb], unit: f32) -> Self {
        let (mut bodies, mut colliders) = (r::RigidBodySet::new(), r::ColliderSet::new());
        let insert = |aabb: &layout::Aabb| {
            let aabb = aabb_of(aabb);
            let half = aabb.half_extents();
            let body = bodies.insert(r::RigidBodyBuilder::dynamic().translation(aabb.center()));
            colliders.insert_with_parent(r::ColliderBuilder::cuboid(half.x, half.y, half.z), body, &mut bodies)
        };
        let handles = aabbs.iter().map(insert).collect();
        let parameters = r::IntegrationParameters { length_unit: unit, ..r::IntegrationParameters::default() };
        Self { bodies, colliders, handles, parameters, broad_phase: r::BroadPhaseBvh::new(), pairs: 0 }
    }

    /// The first update, of an empty tree.
    pub(crate) fn first(&mut self) -> Sample {
        (self.broad_phase, self.pairs) = (r::BroadPhaseBvh::new(), 0);
        self.update()
    }

    /// Puts the colliders where the boxes are now; their sizes are taken to stay.
    pub(crate) fn place(&mut self, aabbs: &[layout::Aabb]) {
        for (handle, aabb) in self.handles.iter().zip(aabbs) {
            self.colliders[*handle].set_translation(aabb_of(aabb).center());
        }
    }

    /// Update after colliders moved: tree, new pairs and lost ones. All in one, so there is one lap.
    pub(crate) fn update(&mut self) -> Sample {
        let mut events = Vec::new();
        let mut watch = Watch::new();
        watch.lap();
        let (handles, parameters) = (&self.handles, &self.parameters);
        self.broad_phase.update(parameters, &self.colliders, &self.bodies, handles, &[], &mut events);
        watch.lap();
        for event in events {
            self.pairs += if matches!(event, r::BroadPhasePairEvent::AddPair(_)) { 1 } else { -1 };
        }
        watch.sample(self.pairs as u64, 0)
    }
}
