//! Stage `query`: what rays hit, what shapes overlap, what is nearest to points. Twin of `shaders/query/*.wgsl`. It is no
//! part of a step: it runs when asked, over the committed states.
//!
//! Every bounded collider goes into one tree by its box; half-spaces are tested one by one. A leaf answers only where its
//! own box is met, and no nearer than that box: so the answer is that of testing every leaf, whatever the tree looks
//! like and in whichever order it is walked.

pub mod shapes;
mod walk;

use crate::bounds::{FAR, size_class};
use crate::broadphase::{Boxes, lbvh, overlaps};
use crate::math::{quat, rotate, vec3};
use bytemuck::Zeroable;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use tumble_core::layout::{
    Aabb, BodyState, Collider, NO_COLLIDER, PlacedShape, QueryAnswer, QueryPoint, QueryRay, QueryVolume, TreeNode,
    aabb_body, body_flags, root_of, shape_kind, tree_members,
};
use tumble_core::limits::TURN_LIMIT;
use tumble_core::query::{self, Nearest, NearestQuery, OverlapShape, Overlaps, Ray, RayHit};
use tumble_core::{Editor, MortonBits, Result};

/// What rounding may take from a box, of its largest coordinate.
const ROUNDING: f32 = 1e-6;

/// Where every collider is, and a tree over them.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// By collider slot; of no shape where there is none.
    pub placed: Vec<PlacedShape>,
    /// Colliders without end, ascending.
    pub unbounded: Vec<u32>,
    /// Over all bounded colliders.
    pub tree: lbvh::Tree,
}

/// A collider's shape in the world.
pub fn place(collider: &Collider, state: &BodyState) -> PlacedShape {
    let live = collider.shape != shape_kind::NONE && state.flags & body_flags::KIND != body_flags::NONE;
    if !live {
        return PlacedShape::zeroed();
    }
    let rotation = quat(state.rotation);
    PlacedShape {
        position: (vec3(state.position) + rotate(rotation, vec3(collider.position))).to_array(),
        shape: collider.shape,
        rotation: (rotation * quat(collider.rotation)).to_array(),
        size: collider.size,
        pad_a: 0,
    }
}

/// The box of a placed shape, and a little more for rounding.
pub fn tight_bounds(placed: &PlacedShape, body: u32) -> Aabb {
    let extent = match placed.shape {
        shape_kind::NONE => return Aabb { min: [FAR; 3], body: 0, max: [-FAR; 3], class: 0 },
        shape_kind::HALFSPACE => {
            let body = body | aabb_body::LIVE;
            return Aabb { min: [-FAR; 3], body, max: [FAR; 3], class: size_class(FAR) };
        }
        shape_kind::BALL => Vec3::splat(placed.size[0]),
        _ => {
            let size = vec3(placed.size);
            let m = Mat3::from_quat(quat(placed.rotation));
            m.x_axis.abs() * size.x + m.y_axis.abs() * size.y + m.z_axis.abs() * size.z
        }
    };
    let center = vec3(placed.position);
    let extent = extent + Vec3::splat(ROUNDING * (center.abs() + extent).max_element());
    let (min, max) = (center - extent, center + extent);
    let class = size_class((max - min).max_element());
    Aabb { min: min.to_array(), body: body | aabb_body::LIVE, max: max.to_array(), class }
}

/// How far along the ray a node's box begins; `None` when the ray misses it.
fn entry(node: &TreeNode, ray: &QueryRay) -> Option<f32> {
    let (origin, inverse) = (vec3(ray.origin), vec3(ray.inverse));
    let low = (vec3(node.min) - origin) * inverse;
    let high = (vec3(node.max) - origin) * inverse;
    let near = low.min(high).max_element().max(0.0);
    let far = low.max(high).min_element();
    (near <= far).then_some(near)
}

/// Square of a point's distance to a node's box.
fn gap(node: &TreeNode, point: Vec3) -> f32 {
    let out = (vec3(node.min) - point).max(point - vec3(node.max)).max(Vec3::ZERO);
    out.dot(out)
}

const NOTHING: QueryAnswer =
    QueryAnswer { vector: [0.0; 3], distance: 0.0, collider: NO_COLLIDER, pad_a: 0, pad_b: 0, pad_c: 0 };

/// Whether a collider at `key` is better than the best so far.
fn is_better(key: f32, collider: u32, best: f32, holder: u32) -> bool {
    key < best || (key == best && collider < holder)
}

impl Snapshot {
    /// Places all colliders and builds the tree.
    pub fn new(colliders: &[Collider], states: &[BodyState], bits: MortonBits) -> Self {
        let placed: Vec<PlacedShape> =
            colliders.par_iter().with_min_len(512).map(|c| place(c, &states[c.body as usize])).collect();
        let aabbs: Vec<Aabb> =
            placed.par_iter().zip(colliders).with_min_len(512).map(|(p, c)| tight_bounds(p, c.body)).collect();
        let boxes = Boxes::new(&aabbs);
        let tree = lbvh::Tree::new(&boxes, bits, tree_members::ALL);
        let unbounded = boxes.unbounded;
        Self { placed, unbounded, tree }
    }

    /// The first collider that the ray meets, the lower slot where two are as near; and the turns that it took.
    pub fn closest(&self, ray: &QueryRay) -> (QueryAnswer, u32) {
        let mut best = QueryAnswer { distance: ray.max_distance, ..NOTHING };
        let mut offer = |collider: u32, key: f32, best_key: &mut f32| {
            let Some(hit) = shapes::cast(&self.placed[collider as usize], ray) else { return };
            let distance = hit.distance.max(key);
            if is_better(distance, collider, best.distance, best.collider) {
                best = QueryAnswer { vector: hit.normal.to_array(), distance, collider, ..NOTHING };
                *best_key = distance;
            }
        };
        let mut best_key = ray.max_distance;
        self.unbounded.iter().for_each(|&i| offer(i, 0.0, &mut best_key));
        let turns = walk::nearest_first(&self.tree, |node| entry(node, ray), best_key, offer);
        (best, turns)
    }

    /// Whether the ray meets any collider; and the turns that it took.
    pub fn any(&self, ray: &QueryRay) -> (bool, u32) {
        let mut met = false;
        let mut offer = |collider: u32, key: f32, best_key: &mut f32| {
            let hit = shapes::cast(&self.placed[collider as usize], ray);
            if hit.is_some_and(|hit| hit.distance.max(key) <= ray.max_distance) {
                met = true;
                // Nothing is nearer than that: the walk ends.
                *best_key = -1.0;
            }
        };
        let mut best_key = ray.max_distance;
        self.unbounded.iter().for_each(|&i| offer(i, 0.0, &mut best_key));
        let turns = walk::nearest_first(&self.tree, |node| entry(node, ray), best_key, offer);
        (met, turns)
    }

    /// The collider nearest to the point, the lower slot where two are as near; and the turns that it took.
    pub fn nearest(&self, query: &QueryPoint) -> (QueryAnswer, u32) {
        let point = vec3(query.point);
        let (mut best, mut square) = (NOTHING, query.max_squared);
        let mut offer = |collider: u32, key: f32, best_key: &mut f32| {
            let (nearest, own) = shapes::project(&self.placed[collider as usize], point);
            let own = own.max(key);
            if is_better(own, collider, square, best.collider) {
                best = QueryAnswer { vector: nearest.to_array(), distance: own.sqrt(), collider, ..NOTHING };
                square = own;
                *best_key = own;
            }
        };
        let mut best_key = query.max_squared;
        self.unbounded.iter().for_each(|&i| offer(i, 0.0, &mut best_key));
        let turns = walk::nearest_first(&self.tree, |node| Some(gap(node, point)), best_key, offer);
        (best, turns)
    }

    /// Appends the colliders that the shape overlaps to `found`, in the order of the walk; returns the turns that it took.
    pub fn overlaps(&self, volume: &QueryVolume, found: &mut Vec<u32>) -> u32 {
        let mut offer = |collider: u32| {
            if shapes::overlaps(&volume.placed, &self.placed[collider as usize]) {
                found.push(collider);
            }
        };
        self.unbounded.iter().for_each(|&i| offer(i));
        let (mut next, mut turns) = (root_of(self.tree.count()), 0);
        while next < NO_COLLIDER && turns <= TURN_LIMIT {
            turns += 1;
            let node = &self.tree.nodes[next as usize];
            if !overlaps(volume.min, volume.max, node.min, node.max) {
                next = node.escape;
            } else if next % 2 == 0 {
                offer(node.child);
                next = node.escape;
            } else {
                next = node.child;
            }
        }
        turns
    }
}

/// A snapshot, and the step that it shows.
#[derive(Debug, Default)]
pub(crate) struct Cached {
    of_step: Option<u32>,
    snapshot: Snapshot,
}

impl Cached {
    /// The snapshot of the state after this step, made anew if there is none yet.
    pub(crate) fn refresh(&mut self, step: u32, colliders: &[Collider], states: &[BodyState], bits: MortonBits) {
        if self.of_step != Some(step) {
            self.snapshot = Snapshot::new(colliders, states, bits);
            self.of_step = Some(step);
        }
    }

    /// Bytes of what it keeps.
    pub(crate) fn bytes(&self) -> u64 {
        let slots = size_of::<PlacedShape>() * self.snapshot.placed.len() + 4 * self.snapshot.unbounded.len();
        slots as u64 + self.snapshot.tree.bytes()
    }

    /// Asks all at once, in parallel; answers are in the order of the queries.
    fn ask<Q: Sync, A: Send>(&self, queries: &[Q], one: impl Fn(&Q) -> (A, u32) + Sync + Send) -> Result<Vec<A>> {
        let (answers, turns): (Vec<A>, Vec<u32>) = queries.par_iter().with_min_len(16).map(one).unzip();
        let most = turns.into_iter().max().unwrap_or(0);
        query::check_bounds(most, self.snapshot.unbounded.len() as u32)?;
        Ok(answers)
    }

    pub(crate) fn cast_rays(&self, rays: &[Ray], editor: &Editor) -> Result<Vec<Option<RayHit>>> {
        let answers = self.ask(&query::pack_rays(rays)?, |ray| self.snapshot.closest(ray))?;
        Ok(answers.iter().zip(rays).map(|(answer, ray)| query::ray_hit(answer, ray, editor)).collect())
    }

    pub(crate) fn cast_rays_any(&self, rays: &[Ray]) -> Result<Vec<bool>> {
        self.ask(&query::pack_rays(rays)?, |ray| self.snapshot.any(ray))
    }

    pub(crate) fn overlaps(&self, shapes: &[OverlapShape], editor: &Editor) -> Result<Overlaps> {
        let lists = self.ask(&query::pack_shapes(shapes)?, |volume| {
            let mut found = Vec::new();
            let turns = self.snapshot.overlaps(volume, &mut found);
            (found, turns)
        })?;
        let mut all = Overlaps::default();
        lists.into_iter().for_each(|mut list| all.push(&mut list, editor));
        Ok(all)
    }

    pub(crate) fn nearest(&self, points: &[NearestQuery], editor: &Editor) -> Result<Vec<Option<Nearest>>> {
        let answers = self.ask(&query::pack_points(points)?, |point| self.snapshot.nearest(point))?;
        Ok(answers.iter().map(|answer| query::nearest(answer, editor)).collect())
    }
}
