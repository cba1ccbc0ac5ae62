//! What may be asked of a world: see `query`.

use super::World;
use crate::query::{Asker, Query};
use tumble_core::{Nearest, NearestQuery, OverlapShape, Overlaps, Ray, RayHit, Result};

impl World {
    /// Waits for all submitted steps; the first collider that each ray meets, or none, in the order of the rays.
    ///
    /// # Errors
    /// [`Error::Invalid`](tumble_core::Error::Invalid) names the ray and the field.
    /// [`Error::Capacity`](tumble_core::Error::Capacity) when a ray meets more nodes of the tree than a loop may. As
    /// for [`World::step`].
    pub fn cast_rays(&mut self, rays: &[Ray]) -> Result<Vec<Option<RayHit>>> {
        self.asker()?.cast_rays(rays)
    }

    /// Waits for all submitted steps; whether each ray meets any collider. Cheaper than [`World::cast_rays`].
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn cast_rays_any(&mut self, rays: &[Ray]) -> Result<Vec<bool>> {
        self.asker()?.cast_rays_any(rays)
    }

    /// Waits for all submitted steps; the colliders that each shape overlaps.
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn overlaps(&mut self, shapes: &[OverlapShape]) -> Result<Overlaps> {
        self.asker()?.overlaps(shapes)
    }

    /// Waits for all submitted steps; the collider nearest to each point, or none.
    ///
    /// # Errors
    /// As for [`World::cast_rays`].
    pub fn nearest(&mut self, points: &[NearestQuery]) -> Result<Vec<Option<Nearest>>> {
        self.asker()?.nearest(points)
    }

    /// Readies queries about the state after all submitted steps.
    fn asker(&mut self) -> Result<Asker<'_>> {
        self.run_waiting()?;
        self.take_statuses(0)?;
        let room = self.sizes.colliders;
        // Slots of edits that no step has taken are empty.
        let colliders = room.min(self.editor.collider_slots() as u32);
        let query = match self.query.take() {
            Some(query) if query.fits(room) => query,
            _ => Query::new(&self.gpu, &mut self.pipelines, room, self.params.morton_bits)?,
        };
        let query = self.query.insert(query);
        let (gpu, pipelines) = (&self.gpu, &mut self.pipelines);
        query.refresh(gpu, pipelines, &self.buffers, self.submitted, colliders)?;
        Ok(Asker { gpu, pipelines, query, editor: &self.editor })
    }
}
