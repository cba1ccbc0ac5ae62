//! Buffers by name, that can grow.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};

use tumble_core::{Error, Result};
use wgpu::BufferUsages;

use crate::device::Gpu;

/// Generations are given out once in the process, so that those of two sets never meet in one cache.
static NEXT_GENERATION: AtomicU64 = AtomicU64::new(1);

/// The buffers of one world, each under the name that the shaders give it.
#[derive(Debug, Default)]
pub struct Buffers {
    named: HashMap<&'static str, Named>,
    aliases: HashMap<&'static str, &'static str>,
    generation: u64,
}

#[derive(Debug)]
struct Named {
    buffer: wgpu::Buffer,
    element_bytes: u64,
    capacity: u64,
    usages: BufferUsages,
    generation: u64,
}

impl Buffers {
    /// None yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates the buffer `name`, zeroed, with room for `capacity` elements (at least one) of `element_bytes` bytes. It
    /// can always be copied from and to, beside `usages`. One of the same name is replaced.
    ///
    /// # Errors
    /// [`Error::Limits`] when the adapter allows no array of that size, [`Error::OutOfMemory`], [`Error::Gpu`] and
    /// [`Error::DeviceLost`] as for [`Gpu::create_buffer`].
    pub fn create(
        &mut self,
        gpu: &Gpu,
        name: &'static str,
        element_bytes: u64,
        capacity: u64,
        usages: BufferUsages,
    ) -> Result<()> {
        let capacity = capacity.max(1);
        let usages = usages | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let buffer = gpu.create_buffer(name, element_bytes.saturating_mul(capacity), usages)?;
        self.insert(name, Named { buffer, element_bytes, capacity, usages, generation: 0 });
        Ok(())
    }

    /// Makes room for `capacity` elements in `name`, in a new buffer with the old content (`keep`) or zeroed. Does
    /// nothing when there is room already. The old buffer lives on for the steps that still use it.
    ///
    /// # Errors
    /// [`Error::Capacity`] when the adapter allows no array of that size; otherwise as for [`Buffers::create`], and the
    /// old buffer stays.
    pub fn grow(&mut self, gpu: &Gpu, name: &'static str, capacity: u64, keep: bool) -> Result<()> {
        let old = self.get(name)?;
        if capacity <= old.capacity {
            return Ok(());
        }
        let limits = gpu.device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / old.element_bytes.max(1);
        if capacity > most {
            return Err(Error::Capacity { buffer: name, needed: capacity, capacity: most });
        }
        let (old_buffer, element_bytes, usages) = (old.buffer.clone(), old.element_bytes, old.usages);
        let buffer = gpu.create_buffer(name, element_bytes * capacity, usages)?;
        if keep {
            gpu.scoped(&format!("copy of buffer `{name}`"), || {
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                encoder.copy_buffer_to_buffer(&old_buffer, 0, &buffer, 0, old_buffer.size());
                gpu.queue.submit([encoder.finish()]);
            })?;
        }
        self.insert(name, Named { buffer, element_bytes, capacity, usages, generation: 0 });
        Ok(())
    }

    /// Lets `alias` name the buffer `name` too, for a shader that sees the same bytes as something else.
    pub fn alias(&mut self, alias: &'static str, name: &'static str) {
        self.aliases.insert(alias, name);
    }

    fn insert(&mut self, name: &'static str, named: Named) {
        self.generation = NEXT_GENERATION.fetch_add(1, Ordering::Relaxed);
        self.named.insert(name, Named { generation: self.generation, ..named });
    }

    fn get(&self, name: &str) -> Result<&Named> {
        let name = self.aliases.get(name).copied().unwrap_or(name);
        let missing = || Error::Gpu { what: format!("buffer `{name}`"), message: "it was never created".into() };
        self.named.get(name).ok_or_else(missing)
    }

    /// The buffer of this name.
    ///
    /// # Errors
    /// [`Error::Gpu`] when there is none.
    pub fn buffer(&self, name: &str) -> Result<&wgpu::Buffer> {
        Ok(&self.get(name)?.buffer)
    }

    /// Elements that the buffer of this name has room for; 0 when there is none.
    pub fn capacity(&self, name: &str) -> u64 {
        self.named.get(name).map_or(0, |named| named.capacity)
    }

    /// A number that changes when the buffer of this name is replaced; 0 when there is none.
    pub fn generation_of(&self, name: &str) -> u64 {
        self.named.get(name).map_or(0, |named| named.generation)
    }

    /// A number that changes when any buffer of the set is created or replaced.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Bytes of all buffers.
    pub fn bytes(&self) -> u64 {
        self.named.values().map(|named| named.buffer.size()).sum()
    }
}
