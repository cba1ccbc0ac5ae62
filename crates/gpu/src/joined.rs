//! Pairs of bodies that joints keep from colliding, and that have joints between them, as the passes of several stages
//! look them up.

use crate::{Buffers, Gpu};
use std::sync::Arc;
use tumble_core::{Result, Topology};

/// The lists on the device.
#[derive(Default)]
pub(crate) struct Joined {
    /// Whose they are.
    uploaded: Option<Arc<Topology>>,
}

impl Joined {
    /// Puts the lists of a step that is about to be submitted on the device, unless those are there. Steps that are run
    /// again come with lists of their own. Each begins with its number.
    pub(crate) fn upload(&mut self, gpu: &Gpu, buffers: &mut Buffers, topology: &Arc<Topology>) -> Result<()> {
        if self.uploaded.as_ref().is_some_and(|uploaded| Arc::ptr_eq(uploaded, topology)) {
            return Ok(());
        }
        for (name, list) in [("apart", &topology.apart), ("joined", &topology.joined)] {
            let mut all = vec![[list.len() as u32, 0]];
            all.extend(list);
            buffers.grow(gpu, name, all.len() as u64, false)?;
            gpu.queue.write_buffer(buffers.buffer(name)?, 0, bytemuck::cast_slice(&all));
        }
        self.uploaded = Some(topology.clone());
        Ok(())
    }
}
