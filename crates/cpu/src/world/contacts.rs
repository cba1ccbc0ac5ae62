//! Contacts and joints in bulk: see `tumble_core::contacts` and `tumble_core::joints`.

use super::{World, asleep};
use tumble_core::contacts::{Committed, Contacts};
use tumble_core::{Joints, Result};

impl World {
    /// All contacts of the last step, none before the first. Edits that no step has applied are not seen: a body that
    /// was removed since has its contacts still.
    ///
    /// # Errors
    /// [`Error::Capacity`](tumble_core::Error::Capacity) when the last step did not run for want of room: its edits are
    /// half applied.
    pub fn contacts(&mut self) -> Result<Contacts> {
        self.failed.clone().map_or(Ok(()), Err)?;
        let kept = &self.kept;
        let pairs = asleep::merged(&kept.pairs, &kept.asleep.pairs);
        let committed = Committed {
            step: &self.last_step,
            states: &kept.states,
            colliders: &kept.colliders,
            pairs: &pairs,
            batch_of_slot: &kept.batch_of_slot,
            found: &kept.found,
            memory: &kept.memory,
        };
        Ok(committed.contacts(&self.editor))
    }

    /// All joints after the last step, none before the first. Edits that no step has applied are not seen: a joint that was
    /// removed since is there still.
    ///
    /// # Errors
    /// None that a user can cause.
    pub fn joints(&mut self) -> Result<Joints> {
        let kept = &self.kept;
        Ok(Joints::read(kept.control.step.into(), &kept.joint_set, &kept.states, &kept.joints.states))
    }

    /// The solver's joints.
    #[cfg(test)]
    pub(crate) fn joints_mut(&mut self) -> &mut crate::joint::Joints {
        &mut self.kept.joints
    }
}
