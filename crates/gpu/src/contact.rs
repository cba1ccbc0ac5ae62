//! Stage `contact`: slots of pairs, and what outlives the step. Host side of `shaders/contact.wgsl`.

use crate::primitives::{Args, Count, Job, Scan, ScanOptions};
use crate::store::{Sizes, args, word};
use crate::{Buffers, Gpu, Pass, Pipelines, Recorder};
use std::sync::Arc;
use tumble_core::Result;

pub(crate) struct Contact {
    find_old: Arc<Pass>,
    find_new: Arc<Pass>,
    list_dead: Arc<Pass>,
    assign: Arc<Pass>,
    commit_pairs: Arc<Pass>,
    commit_found: Arc<Pass>,
    commit_free: Arc<Pass>,
    commit_counts: Arc<Pass>,
    scan_dead: Scan,
    scan_fresh: Scan,
    /// One thread an old pair, then one thread a pair.
    args: Args,
}

impl Contact {
    pub(crate) fn new(gpu: &Gpu, pipelines: &mut Pipelines, sizes: &Sizes) -> Result<Self> {
        let mut pass = |entry| pipelines.pass(gpu, "contact", entry);
        let [find_old, find_new, list_dead, assign] =
            [pass("find_old")?, pass("find_new")?, pass("list_dead")?, pass("assign")?];
        let [commit_pairs, commit_found] = [pass("commit_pairs")?, pass("commit_found")?];
        let [commit_free, commit_counts] = [pass("commit_free")?, pass("commit_counts")?];
        let scan = |count, total| ScanOptions { capacity: sizes.pairs, count: Count::Word(count), total: Some(total) };
        let jobs = [Job::new(word::OLD_PAIR_COUNT, sizes.pairs, 256), Job::new(word::PAIR_COUNT, sizes.pairs, 256)];
        Ok(Self {
            find_old,
            find_new,
            list_dead,
            assign,
            commit_pairs,
            commit_found,
            commit_free,
            commit_counts,
            scan_dead: Scan::new(gpu, pipelines, scan(word::OLD_PAIR_COUNT, word::DEAD_COUNT))?,
            scan_fresh: Scan::new(gpu, pipelines, scan(word::PAIR_COUNT, word::NEW_COUNT))?,
            args: Args::new(gpu, pipelines, &jobs)?,
        })
    }

    /// Arguments for one thread a pair.
    pub(crate) fn a_pair(&self) -> (&wgpu::Buffer, u64) {
        (self.args.buffer(), 16)
    }

    pub(crate) fn record_match(&self, recorder: &mut Recorder, buffers: &Buffers) -> Result<()> {
        recorder.stage("contact");
        let counters = buffers.buffer("counters")?;
        self.args.record(recorder, counters)?;
        let (old, new) = ((self.args.buffer(), 0), self.a_pair());
        recorder.dispatch_indirect(&self.find_old, &[], old.0, old.1)?;
        self.scan_dead.record(recorder, buffers.buffer("dead_rank")?, Some(counters))?;
        recorder.dispatch_indirect(&self.find_new, &[], new.0, new.1)?;
        self.scan_fresh.record(recorder, buffers.buffer("fresh_rank")?, Some(counters))?;
        recorder.dispatch_indirect(&self.list_dead, &[], old.0, old.1)?;
        recorder.dispatch_indirect(&self.assign, &[], new.0, new.1)
    }

    pub(crate) fn record_commit(&self, recorder: &mut Recorder, buffers: &Buffers) -> Result<()> {
        recorder.stage("contact");
        let own = buffers.buffer("dispatch_args")?;
        recorder.dispatch_indirect(&self.commit_pairs, &[], own, args::PAIRS)?;
        recorder.dispatch_indirect(&self.commit_found, &[], own, args::PAIRS)?;
        recorder.dispatch_indirect(&self.commit_free, &[], own, args::DEAD)
    }

    /// The counters that outlive the step: the last pass of it.
    pub(crate) fn record_counts(&self, recorder: &mut Recorder) -> Result<()> {
        recorder.dispatch(&self.commit_counts, &[], 1)
    }
}
