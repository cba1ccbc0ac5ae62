//! Room: buffers grow when a step was found to need more, and the steps that stopped run again.

use super::{World, pose_bytes};
use crate::Gpu;
use crate::readback::{Readback, read_now};
use crate::stages::Stages;
use crate::store::{self, Sizes};
use tumble_core::layout::{Control, overflow};
use tumble_core::limits::{self, Room};
use tumble_core::{Capacities, Error, Params, Result};

impl World {
    /// A step raised the flag: it and all behind it must run again, in a larger buffer.
    pub(super) fn stopped(&mut self, status: Control) -> Result<()> {
        while self.statuses.in_flight() > 0 {
            self.statuses.wait_take(&self.gpu)?;
        }
        self.waiting.append(&mut self.flying);
        self.last = Control { stop: status.stop, overflow: status.overflow, needed: status.needed, ..self.last };
        self.run_waiting()
    }

    /// Makes the room that the first waiting step needs, and submits all that wait.
    pub(super) fn run_waiting(&mut self) -> Result<()> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let run = self.watch.begin("growth");
        self.grow_pairs()?;
        self.watch.end(run);
        while let Some(record) = self.waiting.pop_front() {
            self.submit(record)?;
        }
        Ok(())
    }

    fn grow_pairs(&mut self) -> Result<()> {
        let needed = u64::from(self.last.needed);
        let (buffer, capacity) = match self.last.overflow {
            overflow::PAIRS => ("pairs", self.sizes.pairs),
            overflow::LAST_BATCH => ("last batch", limits::LAST_LIMIT),
            overflow::UNBOUNDED => ("half-spaces", limits::UNBOUNDED_LIMIT),
            overflow::SWEEP => ("sweep", limits::SWEEP_ITEM_LIMIT),
            _ => ("partners", limits::TURN_LIMIT),
        };
        let error = Error::Capacity { buffer, needed, capacity: capacity.into() };
        if buffer != "pairs" {
            return Err(error);
        }
        let room = limits::more(buffer, needed, capacity, limits::BYTES_A_PAIR, &within(&self.gpu, &self.params))?;
        let old = self.sizes.pairs;
        let control = self.buffers.buffer("control")?;
        let free_count: u32 = bytemuck::pod_read_unaligned(&read_now(&self.gpu, control, 20, 4)?);
        let free = read_now(&self.gpu, self.buffers.buffer("free_slots")?, 0, 4 * u64::from(free_count))?;
        let sizes = Sizes { pairs: room, ..self.sizes };
        // On an error some arrays are larger than they must be, and the world is as good as before.
        store::grow(&self.gpu, &mut self.buffers, &sizes)
            .map_err(|e| if matches!(e, Error::Capacity { .. }) { error } else { e })?;
        self.stages = Stages::new(&self.gpu, &mut self.pipelines, &sizes, &self.built)?;
        self.sizes = sizes;
        let free = store::write_free(&self.gpu, &self.buffers, &bytemuck::pod_collect_to_vec(&free), old, &sizes)?;
        let control = self.buffers.buffer("control")?;
        self.gpu.queue.write_buffer(control, 0, bytemuck::cast_slice(&[0u32; 3]));
        self.gpu.queue.write_buffer(control, 20, bytemuck::bytes_of(&free));
        self.last.stop = 0;
        self.count_growth("pairs");
        Ok(())
    }

    /// Makes room for the edits and what they brought.
    pub(super) fn make_room(&mut self, needed: Room) -> Result<()> {
        let Sizes { bodies, colliders, .. } = self.sizes;
        let room = Room { bodies, colliders, edits: self.edit_room };
        let (room, grown) = room.grown(&needed, &within(&self.gpu, &self.params))?;
        if grown.is_empty() {
            return Ok(());
        }
        let run = self.watch.begin("growth");
        if room.edits > self.edit_room {
            for buffer in ["edit_records", "edit_ranges"] {
                self.buffers.grow(&self.gpu, buffer, room.edits.into(), false)?;
            }
            self.edit_room = room.edits;
        }
        if (room.bodies, room.colliders) != (bodies, colliders) {
            self.grow_scene(Sizes { bodies: room.bodies, colliders: room.colliders, ..self.sizes })?;
        }
        self.watch.end(run);
        grown.into_iter().for_each(|buffer| self.count_growth(buffer));
        Ok(())
    }

    fn grow_scene(&mut self, sizes: Sizes) -> Result<()> {
        self.take_statuses(0)?;
        let islands = if self.built.plan.islands() { sizes.bodies } else { 0 };
        let sizes = Sizes { pairs: self.sizes.pairs, islands, ..sizes };
        store::grow(&self.gpu, &mut self.buffers, &sizes)?;
        self.stages = Stages::new(&self.gpu, &mut self.pipelines, &sizes, &self.built)?;
        self.pose_copies = Readback::new(&self.gpu, "pose copy", pose_bytes(&sizes), 1)?;
        self.step_copies = Readback::new(&self.gpu, "step copy", size_of::<Control>() as u64, 1)?;
        self.sizes = sizes;
        Ok(())
    }

    fn count_growth(&mut self, buffer: &'static str) {
        match self.growths.iter_mut().find(|(name, _)| *name == buffer) {
            Some((_, count)) => *count += 1,
            None => self.growths.push((buffer, 1)),
        }
    }
}

/// The capacities that the user allows and the device has.
pub(super) fn within(gpu: &Gpu, params: &Params) -> Capacities {
    let limits = gpu.device.limits();
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    Capacities { max_array_bytes: params.capacities.max_array_bytes.min(most), ..params.capacities }
}
