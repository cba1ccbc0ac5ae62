//! Primitives run alone, over buffers of words.

use tumble_gpu::readback::read_now;
use tumble_gpu::{BindCache, Buffers, Recorder};
use wgpu::BufferUsages;

use crate::common::gpu;

/// A storage buffer of these words.
pub(crate) fn upload(words: &[u32]) -> wgpu::Buffer {
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
    let buffer = gpu().create_buffer("test", words.len() as u64 * 4, usage).unwrap();
    gpu().queue.write_buffer(&buffer, 0, bytemuck::cast_slice(words));
    buffer
}

/// The first words of a buffer, waited for.
pub(crate) fn download(buffer: &wgpu::Buffer, words: usize) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(&read_now(gpu(), buffer, 0, words as u64 * 4).unwrap())
}

/// Records, submits and checks.
pub(crate) fn run(record: impl FnOnce(&mut Recorder)) {
    let (buffers, mut cache) = (Buffers::new(), BindCache::new());
    let mut recorder = Recorder::new(gpu(), &buffers, &mut cache, None);
    record(&mut recorder);
    recorder.submit().unwrap();
    gpu().check().unwrap();
}
