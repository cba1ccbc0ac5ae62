//! A trace of the run in Chrome's trace event format, made from what each step reports: what the host did, what the device
//! did, and counters. (The feature `tracing` is for programs that bring their own subscriber. Were it used here, a
//! dev-dependency would turn it on for tests and benches too, and it knows nothing of the device.)
//!
//! The device's clock has no known relation to the host's. Its stages are drawn from the end of the submission that they
//! came with, or as much earlier as makes them end before the host had waited for their end, but never from before the
//! submission began. So they are late or early by no more than the submission and the time that the device was idle.

use serde_json::{Value, json};
use std::collections::VecDeque;
use std::fmt::Write;
use std::time::Instant;
use tumble::StepReport;
use tumble::core::StageRun;

/// Steps that are kept, some 20 MB of a file: the last ones.
const MOST_STEPS: usize = 10_000;

const HOST: u32 = 1;
const DEVICE: u32 = 2;

/// What is drawn of one step. Times in ms since the first step began.
struct Step {
    number: u64,
    begin: f64,
    milliseconds: f64,
    pairs: u32,
    contacts: u32,
    host: Vec<StageRun>,
    device: Vec<StageRun>,
}

impl Step {
    /// When the device's stages are taken to begin.
    fn device_begin(&self) -> f64 {
        let end = |run: &StageRun| run.begin + run.milliseconds;
        let last = |stage: &str| self.host.iter().rfind(|run| run.stage == stage);
        let (submit, took) = (last("submit"), self.device.last().map_or(0.0, end));
        let heard = last("wait").map_or(self.milliseconds, end);
        self.begin + submit.map_or(0.0, |submit| end(submit).min(heard - took).max(submit.begin))
    }
}

/// The last steps of a run.
pub(crate) struct Trace {
    scene: &'static str,
    zero: Option<Instant>,
    steps: VecDeque<Step>,
    forgotten: u64,
    backend: &'static str,
    adapter: String,
}

impl Trace {
    pub(crate) fn new(scene: &'static str) -> Self {
        Self { scene, zero: None, steps: VecDeque::new(), forgotten: 0, backend: "", adapter: String::new() }
    }

    /// One step more, that began then.
    pub(crate) fn add(&mut self, begin: Instant, milliseconds: f64, report: &StepReport) {
        let zero = *self.zero.get_or_insert(begin);
        self.backend = report.backend;
        self.adapter.clone_from(&report.adapter);
        if self.steps.len() == MOST_STEPS {
            self.steps.pop_front();
            self.forgotten += 1;
        }
        self.steps.push_back(Step {
            number: report.step,
            begin: (begin - zero).as_secs_f64() * 1e3,
            milliseconds,
            pairs: report.pairs,
            contacts: report.contacts,
            host: report.host_runs.clone(),
            device: report.device_runs.clone(),
        });
    }

    /// The whole trace, one event a line.
    pub(crate) fn json(&self) -> String {
        let mut text = String::from("{\"displayTimeUnit\":\"ms\",\"otherData\":");
        let other = json!({
            "scene": self.scene,
            "adapter": self.adapter,
            "steps": self.steps.len(),
            "earlier steps left out": self.forgotten,
            "device clock": "stages of the GPU are drawn from the end of their submission on, or so that they end before the wait for them does",
        });
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "{other},\"traceEvents\":[\n{}",
            self.name("process_name", HOST, &format!("tumble: {}", self.scene))
        );
        let mut push = |event: Value| {
            let _ = write!(text, ",\n{event}");
        };
        push(self.name("thread_name", HOST, "host"));
        if self.backend == "gpu" {
            let timed = self.steps.iter().any(|step| !step.device.is_empty());
            push(self.name(
                "thread_name",
                DEVICE,
                if timed { "GPU" } else { "GPU: n/a, the adapter has no timestamps" },
            ));
        }
        for step in &self.steps {
            let args = json!({ "step": step.number });
            push(span("step", HOST, step.begin, step.milliseconds, &args));
            for run in &step.host {
                push(span(run.stage, HOST, step.begin + run.begin, run.milliseconds, &args));
            }
            let begin = step.device_begin();
            for run in &step.device {
                push(span(run.stage, DEVICE, begin + run.begin, run.milliseconds, &args));
            }
            for (name, value) in [
                ("pairs", json!(step.pairs)),
                ("contacts", json!(step.contacts)),
                ("ms a step", json!(step.milliseconds)),
            ] {
                push(
                    json!({ "name": name, "ph": "C", "pid": 1, "ts": microseconds(nanoseconds(step.begin)), "args": { name: value } }),
                );
            }
        }
        text.push_str("\n]}\n");
        text
    }

    /// How a viewer calls the process or a track.
    fn name(&self, what: &str, track: u32, name: &str) -> Value {
        json!({ "name": what, "ph": "M", "pid": 1, "tid": track, "args": { "name": name } })
    }
}

/// Begin and end are rounded alike, so that what lies within another still does.
fn span(name: &str, track: u32, begin: f64, milliseconds: f64, args: &Value) -> Value {
    let (begin, end) = (nanoseconds(begin), nanoseconds(begin + milliseconds));
    json!({
        "name": name,
        "ph": "X",
        "pid": 1,
        "tid": track,
        "ts": microseconds(begin),
        "dur": microseconds(end - begin),
        "args": args,
    })
}

fn nanoseconds(milliseconds: f64) -> u64 {
    (milliseconds * 1e6).round() as u64
}

/// The format's unit.
fn microseconds(nanoseconds: u64) -> f64 {
    nanoseconds as f64 / 1e3
}
