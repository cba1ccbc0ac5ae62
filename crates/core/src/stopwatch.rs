//! Where the host's time goes within a step: runs of stages on its clock when profiling, and spans of the `tracing` crate
//! with the feature of that name. Without the feature there is no code of it, and a stopwatch that is off looks at no
//! clock.

use crate::report::StageRun;
use std::time::Instant;

/// Runs that are kept at most between two steps: who polls a world that stands still fills no memory.
const MOST_RUNS: usize = 4096;

/// Notes when stages run, from the beginning of a step on. Worlds hold one.
#[derive(Debug, Default)]
pub struct Stopwatch {
    /// When the step began; `None` while off.
    zero: Option<Instant>,
    runs: Vec<StageRun>,
}

/// A stage that runs.
#[derive(Debug)]
pub struct Running {
    index: Option<usize>,
    _span: Span,
}

/// A span of the `tracing` crate, target `tumble`, that this thread is in until it is dropped; nothing without the
/// feature.
#[derive(Debug)]
pub struct Span {
    #[cfg(feature = "tracing")]
    entered: tracing::span::EnteredSpan,
}

impl Stopwatch {
    /// A step begins: earlier runs are forgotten.
    pub fn start(&mut self, on: bool) {
        self.zero = on.then(Instant::now);
        self.runs.clear();
    }

    /// A stage begins.
    pub fn begin(&mut self, stage: &'static str) -> Running {
        let span = Span::enter(stage);
        let zero = self.zero.filter(|_| self.runs.len() < MOST_RUNS);
        let index = zero.map(|zero| {
            self.runs.push(StageRun { stage, begin: milliseconds(zero), milliseconds: 0.0 });
            self.runs.len() - 1
        });
        Running { index, _span: span }
    }

    /// It ends.
    pub fn end(&mut self, running: Running) {
        if let Some((zero, run)) = self.zero.zip(running.index.and_then(|index| self.runs.get_mut(index))) {
            run.milliseconds = milliseconds(zero) - run.begin;
        }
    }

    /// It ends, and another begins.
    pub fn next(&mut self, running: Running, stage: &'static str) -> Running {
        self.end(running);
        self.begin(stage)
    }

    /// Runs since the step began, in the order in which they began.
    pub fn runs(&self) -> &[StageRun] {
        &self.runs
    }
}

fn milliseconds(zero: Instant) -> f64 {
    zero.elapsed().as_secs_f64() * 1e3
}

#[cfg(not(feature = "tracing"))]
impl Span {
    /// Nothing.
    pub fn enter(_: &'static str) -> Self {
        Self {}
    }

    /// Nothing.
    pub fn enter_again(&self) -> Self {
        Self {}
    }
}

#[cfg(feature = "tracing")]
impl Span {
    /// A span of this name, which must be one of those below.
    pub fn enter(name: &'static str) -> Self {
        // A span's name is a part of its place in the code.
        macro_rules! of {
            ($($known:literal),*) => {
                match name {
                    $($known => tracing::info_span!(target: "tumble", $known),)*
                    _ => tracing::info_span!(target: "tumble", "other", name),
                }
            };
        }
        #[rustfmt::skip]
        let span = of!(
            "step", "edit", "bounds", "broadphase", "contact", "narrowphase", "batch", "prepare", "solver", "motion",
            "growth", "pipelines", "upload", "record", "submit", "wait", "readback"
        );
        Self { entered: span.entered() }
    }

    /// The same span on another thread: what runs there is within it too.
    pub fn enter_again(&self) -> Self {
        Self { entered: tracing::Span::clone(&self.entered).entered() }
    }
}
