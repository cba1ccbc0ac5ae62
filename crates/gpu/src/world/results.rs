//! What a world hands out in bulk: poses, velocities, contacts, joints.

use super::{World, pose_bytes, read_control};
use crate::readback::{read_now, read_parts};
use bytemuck::pod_collect_to_vec;
use tumble_core::contacts::{Committed, Contacts};
use tumble_core::layout::{BodyState, Collider, FoundManifold, JointState, ManifoldMemory, Pair, PoseRecord};
use tumble_core::{Error, Joints, Poses, Result, Velocities};

impl World {
    /// Waits for all submitted steps; the pose of every body, in one download.
    ///
    /// # Errors
    /// As for [`World::step`]; once that was told, the last good poses.
    pub fn poses(&mut self) -> Result<Poses> {
        self.take_statuses(0)?;
        let run = self.watch.begin("readback");
        let bytes = read_now(&self.gpu, self.buffers.buffer("poses")?, 0, pose_bytes(&self.sizes))?;
        self.watch.end(run);
        Ok(self.poses_of(self.last.step, &bytes))
    }

    /// The newest poses that have arrived, without waiting; `None` before the first have. Each call asks for new ones.
    /// Those that arrived before the device was lost stay.
    ///
    /// # Errors
    /// As for [`World::step`].
    pub fn try_poses(&mut self) -> Result<Option<Poses>> {
        match self.fetch_poses() {
            Err(Error::DeviceLost { .. }) if self.newest_poses.is_some() => {}
            done => done?,
        }
        Ok(self.newest_poses.clone())
    }

    /// Takes what poses have arrived and asks for new ones.
    fn fetch_poses(&mut self) -> Result<()> {
        if let Some(bytes) = self.pose_copies.try_take(&self.gpu)? {
            let control = self.step_copies.wait_take(&self.gpu)?.unwrap_or_default();
            self.newest_poses = Some(self.poses_of(read_control(&control).step, &bytes));
        }
        if self.submitted > 0 && !self.pose_copies.is_full() {
            let (poses, control) = (self.buffers.buffer("poses")?, self.buffers.buffer("control")?);
            let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
            self.pose_copies.copy(&mut encoder, poses, 0);
            self.step_copies.copy(&mut encoder, control, 0);
            let index = self.gpu.scoped("a copy of the poses", || self.gpu.queue.submit([encoder.finish()]))?;
            self.pose_copies.submitted(&index);
            self.step_copies.submitted(&index);
        }
        Ok(())
    }

    /// Waits for all submitted steps; the velocity of every body, in one download.
    ///
    /// # Errors
    /// As for [`World::poses`].
    pub fn velocities(&mut self) -> Result<Velocities> {
        self.take_statuses(0)?;
        let bytes = u64::from(self.sizes.bodies) * size_of::<BodyState>() as u64;
        let run = self.watch.begin("readback");
        let bytes = read_now(&self.gpu, self.buffers.buffer("states")?, 0, bytes)?;
        self.watch.end(run);
        Ok(Velocities::from_states(self.last.step.into(), &pod_collect_to_vec::<u8, BodyState>(&bytes)))
    }

    fn poses_of(&self, step: u32, bytes: &[u8]) -> Poses {
        Poses::from_records(step.into(), &pod_collect_to_vec::<u8, PoseRecord>(bytes))
    }

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
                part("slot_memory", slots, size_of::<ManifoldMemory>())?,
            ],
        )?;
        self.watch.end(run);
        let [states, colliders, pairs, batch_of_slot, found, memory] = &bytes;
        let committed = Committed {
            step: &self.last_step,
            states: &pod_collect_to_vec::<u8, BodyState>(states),
            colliders: &pod_collect_to_vec::<u8, Collider>(colliders),
            pairs: &pod_collect_to_vec::<u8, Pair>(pairs),
            batch_of_slot: &pod_collect_to_vec::<u8, u32>(batch_of_slot),
            found: &pod_collect_to_vec::<u8, FoundManifold>(found),
            memory: &pod_collect_to_vec::<u8, ManifoldMemory>(memory),
        };
        Ok(committed.contacts(&self.editor))
    }

    /// Waits for all submitted steps; all joints after the last one, in one download, none before the first. Edits that no
    /// step has applied are not seen: a joint that was removed since is there still.
    ///
    /// # Errors
    /// As for [`World::step`].
    pub fn joints(&mut self) -> Result<Joints> {
        self.run_waiting()?;
        self.take_statuses(0)?;
        let bodies = u64::from(self.sizes.bodies) * size_of::<BodyState>() as u64;
        let joints = self.last_joints.joints.len() as u64 * size_of::<JointState>() as u64;
        let run = self.watch.begin("readback");
        let parts = [(self.buffers.buffer("states")?, 0, bodies), (self.buffers.buffer("joint_states")?, 0, joints)];
        let [bodies, states] = read_parts(&self.gpu, parts)?;
        self.watch.end(run);
        let bodies = pod_collect_to_vec::<u8, BodyState>(&bodies);
        let states = pod_collect_to_vec::<u8, JointState>(&states);
        Ok(Joints::read(self.last.step.into(), &self.last_joints, &bodies, &states))
    }
}
