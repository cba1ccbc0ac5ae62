//! Stage `sleep`: who falls asleep and who wakes. Host side of `shaders/sleep.wgsl`.

use crate::primitives::{Args, Job};
use crate::store::{Sizes, word};
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;
use tumble_core::layout::StepParams;

pub(crate) struct Sleep {
    begin: Arc<Pass>,
    edited: Arc<Pass>,
    beside: Arc<Pass>,
    pull: Arc<Pass>,
    wake: Arc<Pass>,
    touch: Arc<Pass>,
    show: Arc<Pass>,
    hide: Arc<Pass>,
    rest: Arc<Pass>,
    settle: Arc<Pass>,
    pass_time: Arc<Pass>,
    /// One thread an old pair.
    args: Args,
}

impl Sleep {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "sleep", entry);
        let [begin, edited, beside, pull, wake, touch] =
            [pass("begin")?, pass("edited")?, pass("beside")?, pass("pull")?, pass("wake")?, pass("touch")?];
        let [show, hide, rest, settle, pass_time] =
            [pass("show")?, pass("hide")?, pass("rest")?, pass("settle")?, pass("pass_time")?];
        let args = Args::new(gpu, pipelines, &[Job::new(word::OLD_PAIR_COUNT, sizes.pairs, 256)])?;
        Ok(Self { begin, edited, beside, pull, wake, touch, show, hide, rest, settle, pass_time, args })
    }

    /// After the edits: who wakes by them, or by joints. `joined`: number of pairs of bodies with joints between them.
    pub(crate) fn record_edits(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers,
        step: &StepParams,
        joined: u32,
    ) -> Result<()> {
        recorder.stage("sleep");
        let by_body = step.body_count.div_ceil(256);
        recorder.dispatch(&self.begin, &[], by_body)?;
        if step.edit_ranges > 0 {
            recorder.dispatch(&self.edited, &[], step.edit_ranges.div_ceil(256))?;
            self.args.record(recorder, buffers.buffer("counters")?)?;
            recorder.dispatch_indirect(&self.beside, &[], self.args.buffer(), 0)?;
        }
        recorder.dispatch(&self.pull, &[], joined.div_ceil(256))?;
        if step.edit_ranges > 0 || step.wake_all != 0 || joined > 0 {
            recorder.dispatch(&self.wake, &[], by_body)?;
        }
        Ok(())
    }

    /// After the narrow phase: who wakes by touch, and who is left out. `a_pair`: arguments for
    /// one thread a pair.
    pub(crate) fn record_touch(
        &self,
        recorder: &mut Recorder,
        step: &StepParams,
        a_pair: (&wgpu::Buffer, u64),
    ) -> Result<()> {
        recorder.stage("sleep");
        recorder.dispatch_indirect(&self.touch, &[], a_pair.0, a_pair.1)?;
        recorder.dispatch(&self.wake, &[], step.body_count.div_ceil(256))?;
        recorder.dispatch(&self.show, &[], step.collider_count.div_ceil(256))?;
        recorder.dispatch_indirect(&self.hide, &[], a_pair.0, a_pair.1)
    }

    /// After the commit of the states: who falls asleep.
    pub(crate) fn record_settle(&self, recorder: &mut Recorder, step: &StepParams) -> Result<()> {
        recorder.stage("sleep");
        recorder.dispatch(&self.rest, &[], step.body_count.div_ceil(256))?;
        recorder.dispatch(&self.settle, &[], step.body_count.div_ceil(256))
    }

    /// All of a step in which nothing is awake.
    pub(crate) fn record_pass_time(&self, recorder: &mut Recorder) -> Result<()> {
        recorder.stage("sleep");
        recorder.dispatch(&self.pass_time, &[], 1)
    }
}
