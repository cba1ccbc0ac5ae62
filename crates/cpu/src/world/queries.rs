//! What may be asked of a world: see `query`.

use super::World;
use crate::query;
use tumble_core::{Editor, Nearest, NearestQuery, OverlapShape, Overlaps, Ray, RayHit, Result};

impl World {
    /// The first collider that each ray meets, or none; in the order of the rays.
    ///
    /// # Errors
    /// [`Error::Invalid`](tumble_core::Error::Invalid) names the ray and the field.
    /// [`Error::Capacity`](tumble_core::Error::Capacity) when a ray meets more nodes of the tree than a shader's loop
    /// may, or when the last step did not run for want of room: its edits are half applied.
    pub fn cast_rays(&mut self, rays: &[Ray]) -> Result<Vec<Option<RayHit>>> {
        self.ask(|queries, editor| queries.cast_rays(rays, editor))
    }

    /// Whether each ray meets any collider; cheaper than [`World::cast_rays`].
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn cast_rays_any(&mut self, rays: &[Ray]) -> Result<Vec<bool>> {
        self.ask(|queries, _| queries.cast_rays_any(rays))
    }

    /// The colliders that each shape overlaps.
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn overlaps(&mut self, shapes: &[OverlapShape]) -> Result<Overlaps> {
        self.ask(|queries, editor| queries.overlaps(shapes, editor))
    }

    /// The collider nearest to each point, or none.
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn nearest(&mut self, points: &[NearestQuery]) -> Result<Vec<Option<Nearest>>> {
        self.ask(|queries, editor| queries.nearest(points, editor))
    }

    /// Asks about the state after the last step.
    fn ask<T: Send>(&mut self, ask: impl FnOnce(&query::Cached, &Editor) -> Result<T> + Send) -> Result<T> {
        self.failed.clone().map_or(Ok(()), Err)?;
        let (kept, editor, queries) = (&self.kept, &self.editor, &mut self.queries);
        self.pool.install(|| {
            queries.refresh(kept.control.step, &kept.colliders, &kept.states, self.params.morton_bits);
            ask(queries, editor)
        })
    }
}
