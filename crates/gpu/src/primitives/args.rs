//! Dispatch arguments from counts in a buffer: the host side of `shaders/primitives/args.wgsl`.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use tumble_core::{Error, Result};
use wgpu::BufferUsages;

use crate::device::Gpu;
use crate::pipelines::{Pass, Pipelines};
use crate::recorder::{Bind, Recorder};

/// Most jobs of one [`Args`].
const MOST_JOBS: usize = 16;

/// One dispatch to be sized.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct Job {
    /// Word of `counts` that holds the number of elements.
    pub word: u32,
    /// The number is taken to be no more than this.
    pub limit: u32,
    /// Elements that one workgroup does, not 0.
    pub each: u32,
    /// Unused.
    pub unused: u32,
}

impl Job {
    /// Workgroups for the number in `word`, `limit` at most, `each` elements a workgroup.
    pub fn new(word: u32, limit: u32, each: u32) -> Self {
        Self { word, limit, each, unused: 0 }
    }
}

/// Sizes up to 16 dispatches by one small dispatch.
#[derive(Debug)]
pub struct Args {
    pass: Arc<Pass>,
    jobs: wgpu::Buffer,
    args: wgpu::Buffer,
}

impl Args {
    /// Arguments for `jobs`, 1 to 16 of them.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of jobs or for 0 elements a workgroup; as for [`Pipelines::pass`] and
    /// [`Gpu::create_buffer`].
    pub fn new(gpu: &Gpu, pipelines: &mut Pipelines, jobs: &[Job]) -> Result<Self> {
        let invalid = |field, value, allowed| Error::Invalid { what: "Args".into(), field, value, allowed };
        if jobs.is_empty() || jobs.len() > MOST_JOBS {
            return Err(invalid("jobs", jobs.len().to_string(), "1 to 16 of them"));
        }
        if jobs.iter().any(|job| job.each == 0) {
            return Err(invalid("each", "0".into(), "1 and more"));
        }
        let mut padded = [Job { each: 1, ..Job::zeroed() }; MOST_JOBS];
        padded[..jobs.len()].copy_from_slice(jobs);
        let mut words = vec![jobs.len() as u32, 0, 0, 0];
        words.extend_from_slice(bytemuck::cast_slice(&padded));
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let uniform = gpu.create_buffer("args jobs", words.len() as u64 * 4, uniform)?;
        gpu.queue.write_buffer(&uniform, 0, bytemuck::cast_slice(&words));
        let usages = BufferUsages::INDIRECT | BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let args = gpu.create_buffer("args", jobs.len() as u64 * 16, usages)?;
        Ok(Self { pass: pipelines.pass(gpu, "primitives/args", "arguments")?, jobs: uniform, args })
    }

    /// Records the pass that reads `counts` and writes the arguments.
    ///
    /// # Errors
    /// As for [`Recorder::dispatch`].
    pub fn record(&self, recorder: &mut Recorder, counts: &wgpu::Buffer) -> Result<()> {
        let binds = [Bind::new("jobs", &self.jobs), Bind::new("counts", counts), Bind::new("args", &self.args)];
        recorder.dispatch(&self.pass, &binds, 1)
    }

    /// The buffer of arguments; those of job j lie from byte 16 j on.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.args
    }
}
