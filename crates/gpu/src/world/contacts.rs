//! Contacts in bulk: see `tumble_core::contacts`.

use super::World;
use crate::readback::read_parts;
use bytemuck::pod_collect_to_vec;
use tumble_core::Result;
use tumble_core::contacts::{Committed, Contacts};
use tumble_core::layout::{BodyState, Collider, FoundManifold, Impulse, Pair};

impl World {
    /// Waits for all submitted steps; all contacts of the last one, in one download, none before the first. Edits that
    /// no step has applied are not seen: a body that was removed since has its contacts still.
    ///
    /// # Errors
    /// As for [`World::step`].
    pub fn contacts(&mut self) -> Result<Contacts> {
        self.run_waiting()?;
        self.take_statuses(0)?;
        let pairs = u64::from(self.last.old_pair_count);
        // Slots come from a stack with the lowest on top, so as many were ever taken as there were pairs at most.
        let slots = if pairs == 0 { 0 } else { u64::from(self.most_pairs) };
        let part = |name: &str, count: u64, bytes: usize| Ok((self.buffers.buffer(name)?, 0, count * bytes as u64));
        let run = self.watch.begin("readback");
        let bytes = read_parts(
            &self.gpu,
            [
                part("states", u64::from(self.sizes.bodies), size_of::<BodyState>())?,
                part("colliders", u64::from(self.sizes.colliders), size_of::<Collider>())?,
                part("pairs", pairs, size_of::<Pair>())?,
                part("batch_of_slot", slots, 4)?,
                part("found_manifolds", slots, size_of::<FoundManifold>())?,
                part("slot_impulses", slots, 4 * size_of::<Impulse>())?,
            ],
        )?;
        self.watch.end(run);
        let [states, colliders, pairs, batch_of_slot, found, impulses] = &bytes;
        let committed = Committed {
            step: &self.last_step,
            states: &pod_collect_to_vec::<u8, BodyState>(states),
            colliders: &pod_collect_to_vec::<u8, Collider>(colliders),
            pairs: &pod_collect_to_vec::<u8, Pair>(pairs),
            batch_of_slot: &pod_collect_to_vec::<u8, u32>(batch_of_slot),
            found: &pod_collect_to_vec::<u8, FoundManifold>(found),
            impulses: &pod_collect_to_vec::<u8, Impulse>(impulses),
        };
        Ok(committed.contacts(&self.editor))
    }
}
