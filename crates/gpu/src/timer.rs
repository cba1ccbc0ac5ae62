//! Time of each stage, measured on the device.

use std::collections::VecDeque;

use tumble_core::{Result, StageRun};
use wgpu::{BufferUsages, CommandEncoder, QuerySet, SubmissionIndex};

use crate::device::Gpu;
use crate::readback::Readback;

/// Stages of one submission that can be timed; later ones are not.
const MOST_STAGES: u32 = 1024;
/// Submissions whose times are on their way at once; one more is not timed.
const IN_FLIGHT: usize = 4;

/// Times the stages of submissions, each between two timestamps around a compute pass of its own.
#[derive(Debug)]
pub struct Timer {
    queries: QuerySet,
    resolved: wgpu::Buffer,
    readback: Readback,
    nanoseconds_per_tick: f64,
    running: Vec<&'static str>,
    flying: VecDeque<Vec<&'static str>>,
}

impl Timer {
    /// A timer, or `None` when the device has no timestamps.
    ///
    /// # Errors
    /// As for [`Gpu::create_buffer`].
    pub fn new(gpu: &Gpu) -> Result<Option<Self>> {
        if !gpu.has_timestamps() {
            return Ok(None);
        }
        let count = 2 * MOST_STAGES;
        let bytes = u64::from(count) * 8;
        let descriptor = wgpu::QuerySetDescriptor { label: Some("timer"), ty: wgpu::QueryType::Timestamp, count };
        Ok(Some(Self {
            queries: gpu.scoped("timestamps", || gpu.device.create_query_set(&descriptor))?,
            resolved: gpu.create_buffer("timer", bytes, BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC)?,
            readback: Readback::new(gpu, "timer", bytes, IN_FLIGHT)?,
            nanoseconds_per_tick: f64::from(gpu.queue.get_timestamp_period()),
            running: Vec::new(),
            flying: VecDeque::new(),
        }))
    }

    /// Begins a submission; false when too many are in flight for it to be timed.
    pub(crate) fn start(&mut self) -> bool {
        self.running.clear();
        !self.readback.is_full()
    }

    /// What a compute pass of this stage is to write; `None` when there is no room left.
    pub(crate) fn stage(&mut self, stage: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let first = 2 * self.running.len() as u32;
        if first >= 2 * MOST_STAGES {
            return None;
        }
        self.running.push(stage);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    pub(crate) fn finish(&mut self, encoder: &mut CommandEncoder) {
        if self.running.is_empty() {
            return;
        }
        encoder.resolve_query_set(&self.queries, 0..2 * self.running.len() as u32, &self.resolved, 0);
        if self.readback.copy(encoder, &self.resolved, 0) {
            self.flying.push_back(std::mem::take(&mut self.running));
        }
    }

    pub(crate) fn submitted(&mut self, index: &SubmissionIndex) {
        self.readback.submitted(index);
    }

    /// Runs of the stages of the oldest submission that was timed and not yet taken, in ms since the first of them began;
    /// `None` when it has not arrived and `wait` is false, or when there is none.
    ///
    /// # Errors
    /// As for [`Readback::try_take`] and [`Readback::wait_take`].
    pub fn take(&mut self, gpu: &Gpu, wait: bool) -> Result<Option<Vec<StageRun>>> {
        let bytes = if wait { self.readback.wait_take(gpu) } else { self.readback.try_take(gpu) };
        let bytes = match bytes {
            Ok(Some(bytes)) => bytes,
            Ok(None) => return Ok(None),
            Err(error) => {
                self.flying.pop_front();
                return Err(error);
            }
        };
        let stages = self.flying.pop_front().unwrap_or_default();
        Ok(Some(runs(&stages, &bytemuck::pod_collect_to_vec(&bytes), self.nanoseconds_per_tick)))
    }
}

/// A run from the two timestamps around each.
fn runs(stages: &[&'static str], ticks: &[u64], nanoseconds_per_tick: f64) -> Vec<StageRun> {
    let first = ticks.first().copied().unwrap_or_default();
    // A driver that sets its clock back does not make times negative.
    let milliseconds = |ticks: u64, since: u64| ticks.saturating_sub(since) as f64 * nanoseconds_per_tick * 1e-6;
    let run = |(stage, span): (&&'static str, &[u64])| StageRun {
        stage,
        begin: milliseconds(span[0], first),
        milliseconds: milliseconds(span[1], span[0]),
    };
    stages.iter().zip(ticks.chunks_exact(2)).map(run).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_core::StageTime;

    #[test]
    fn runs_in_their_order_and_their_sums() {
        let ticks = [1_000_000, 2_000_000, 2_000_000, 5_000_000, 5_000_000, 9_000_000];
        let runs = runs(&["a", "b", "a"], &ticks, 0.5);
        let expected = [("a", 0.0, 0.5), ("b", 0.5, 1.5), ("a", 2.0, 2.0)];
        assert_eq!(runs, expected.map(|(stage, begin, milliseconds)| StageRun { stage, begin, milliseconds }));
        let expected = [("a", 2.5), ("b", 1.5)].map(|(stage, ms)| StageTime { stage, milliseconds: Some(ms) });
        assert_eq!(StageTime::sums(&runs), expected);
    }
}
