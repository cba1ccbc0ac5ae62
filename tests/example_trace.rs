//! Traces of `examples/run`. Oracles: the reports that they are made from, the format (events of a track lie within each
//! other or apart), and what the program's help says.

mod common;
#[path = "common/program.rs"]
mod program;
#[path = "../examples/run/trace.rs"]
mod trace;
#[expect(dead_code, reason = "this program uses a part")]
#[path = "common/worlds.rs"]
mod worlds;

use program::program;
use serde_json::Value;
use std::process::Command;
use std::time::Instant;
use trace::Trace;
use tumble::StepReport;
use tumble_core::{Capacities, Params, StageRun, StageTime, scenes};
use worlds::{SIDES, Side};

const HOST: u64 = 1;
const DEVICE: u64 = 2;

/// Nanoseconds: whole ones, so that nothing is lost to rounding.
fn nanoseconds(value: &Value) -> i64 {
    (value.as_f64().unwrap() * 1e3).round() as i64
}

/// Events of one phase.
fn events<'a>(trace: &'a Value, phase: &str) -> Vec<&'a Value> {
    trace["traceEvents"].as_array().unwrap().iter().filter(|event| event["ph"] == phase).collect()
}

fn spans(trace: &Value, track: u64) -> Vec<&Value> {
    events(trace, "X").into_iter().filter(|event| event["tid"] == track).collect()
}

/// Spans of each track are in the order of their beginnings, none takes less than no time, and each lies within those that
/// are open when it begins.
fn check_nesting(trace: &Value) {
    for track in [HOST, DEVICE] {
        let mut open: Vec<(i64, &Value)> = Vec::new();
        let mut before = 0;
        for event in spans(trace, track) {
            let begin = nanoseconds(&event["ts"]);
            let end = begin + nanoseconds(&event["dur"]);
            assert!(before <= begin && begin <= end, "{event}");
            before = begin;
            open.retain(|(end, _)| *end > begin);
            if let Some((outer, parent)) = open.last() {
                assert!(end <= *outer, "{event} ends after {parent}");
                // Stages of a device and of a step follow each other.
                assert!(
                    track == HOST && ["step", "growth"].contains(&parent["name"].as_str().unwrap()),
                    "{event} in {parent}"
                );
            }
            open.push((end, event));
        }
    }
}

/// The names of a step's spans on one track.
fn names(trace: &Value, track: u64, step: u64) -> Vec<&str> {
    let of_step = spans(trace, track).into_iter().filter(|event| event["args"]["step"] == step);
    of_step.map(|event| event["name"].as_str().unwrap()).filter(|name| *name != "step").collect()
}

fn stages(runs: &[StageRun]) -> Vec<&'static str> {
    runs.iter().map(|run| run.stage).collect()
}

fn milliseconds(runs: &[StageRun]) -> i64 {
    runs.iter().map(|run| (run.milliseconds * 1e6).round() as i64).sum()
}

/// The trace has every run of every report, in order, and the counters. Buffers grow in one of the steps.
#[test]
fn every_stage_of_every_report() {
    for side in SIDES {
        let capacities = Capacities { pairs: Some(100), ..Capacities::default() };
        let params = Params { profile: true, capacities, ..Params::default() };
        let mut world = side.world(&scenes::pile(60), &params);
        let mut trace = Trace::new("pile");
        let mut reports = Vec::new();
        for _ in 0..40 {
            let begin = Instant::now();
            world.step().unwrap();
            let report = world.sync().unwrap();
            trace.add(begin, begin.elapsed().as_secs_f64() * 1e3, &report);
            reports.push(report);
        }
        let json: Value = serde_json::from_str(&trace.json()).unwrap();
        check_nesting(&json);
        assert_eq!(spans(&json, HOST).iter().filter(|event| event["name"] == "step").count(), 40);
        let mut grown = 0;
        for report in &reports {
            assert_eq!(names(&json, HOST, report.step), stages(&report.host_runs));
            assert_eq!(names(&json, DEVICE, report.step), stages(&report.device_runs));
            let told =
                events(&json, "X").into_iter().filter(|e| e["args"]["step"] == report.step && e["name"] != "step");
            let told: i64 = told.map(|event| nanoseconds(&event["dur"])).sum();
            let runs = report.host_runs.len() + report.device_runs.len();
            let expected = milliseconds(&report.host_runs) + milliseconds(&report.device_runs);
            // Each end may be rounded otherwise.
            assert!((told - expected).abs() <= runs as i64, "{told} {expected}");
            assert!(report.host_runs.iter().chain(&report.device_runs).all(|run| run.milliseconds >= 0.0));
            assert!(expected > 0);
            grown += report.host_runs.iter().filter(|run| run.stage == "growth").count();

            let host = stages(&report.host_runs);
            if side == Side::Cpu {
                let order =
                    ["edit", "bounds", "broadphase", "contact", "narrowphase", "batch", "prepare", "solver", "motion"];
                assert!(host.ends_with(&order), "{host:?}");
                let last = &report.host_runs[host.len() - order.len()..];
                assert_eq!(StageTime::sums(last), report.stages);
            } else {
                assert!(
                    host.windows(3).any(|w| w == ["upload", "record", "submit"]) && host.contains(&"wait"),
                    "{host:?}"
                );
                assert_eq!(StageTime::sums(&report.device_runs), report.stages);
                let device = stages(&report.device_runs);
                let order = [
                    "edit",
                    "bounds",
                    "broadphase",
                    "contact",
                    "narrowphase",
                    "batch",
                    "prepare",
                    "solver",
                    "contact",
                    "motion",
                ];
                assert!(device.is_empty() || device == order, "{device:?}");
            }
        }
        assert!(grown >= 1 && reports[39].growths_of("pairs") >= 1, "{side:?}");
        let counters = events(&json, "C");
        let of = |name: &str| {
            counters.iter().filter(|e| e["name"] == name).map(|e| e["args"][name].as_u64().unwrap()).collect::<Vec<_>>()
        };
        assert_eq!(of("pairs"), reports.iter().map(|r| u64::from(r.pairs)).collect::<Vec<_>>());
        assert_eq!(of("contacts"), reports.iter().map(|r| u64::from(r.contacts)).collect::<Vec<_>>());
        assert_eq!(counters.len(), 3 * 40);
        assert_eq!(json["otherData"]["adapter"], reports[0].adapter);
    }
}

/// Without profiling nothing is noted.
#[test]
fn off_means_off() {
    for side in SIDES {
        let mut world = side.world(&scenes::column(2), &Params::default());
        world.step().unwrap();
        world.poses().unwrap();
        let report = world.sync().unwrap();
        assert!(report.stages.is_empty() && report.host_runs.is_empty() && report.device_runs.is_empty(), "{side:?}");
    }
}

/// Who polls a world that does not step fills no memory.
#[test]
fn polling_is_bounded() {
    let mut world = Side::Gpu.world(&scenes::column(1), &Params { profile: true, ..Params::default() });
    world.step().unwrap();
    for _ in 0..2500 {
        world.sync().unwrap();
        world.try_poses().unwrap();
    }
    let before = world.sync().unwrap().host_runs.len();
    for _ in 0..2500 {
        world.sync().unwrap();
    }
    assert!(world.sync().unwrap().host_runs.len() <= 4096, "{before}");
    world.step().unwrap();
    assert!(world.sync().unwrap().host_runs.len() < 20);
}

/// The GPU's track says so where the adapter measures nothing; the CPU side has none.
#[test]
fn tracks_have_names() {
    let device = [StageRun { stage: "edit", begin: 0.0, milliseconds: 0.05 }].to_vec();
    for (backend, device_runs, expected) in [
        ("cpu", vec![], vec!["host"]),
        ("gpu", vec![], vec!["host", "GPU: n/a, the adapter has no timestamps"]),
        ("gpu", device, vec!["host", "GPU"]),
    ] {
        let mut trace = Trace::new("pile");
        trace.add(Instant::now(), 1.0, &StepReport { backend, device_runs, ..StepReport::default() });
        let json: Value = serde_json::from_str(&trace.json()).unwrap();
        let names = events(&json, "M").into_iter().filter(|event| event["name"] == "thread_name");
        assert_eq!(names.map(|event| event["args"]["name"].as_str().unwrap()).collect::<Vec<_>>(), expected);
    }
}

/// Where the device's stages are drawn: after a submission from 0.1 to 0.3 ms and a wait from there to 0.9 ms.
#[test]
fn the_device_is_drawn_where_it_can_have_been() {
    for (took, begins) in [(0.2, 300_000), (0.6, 300_000), (0.7, 200_000), (0.8, 100_000), (5.0, 100_000)] {
        let run = |stage, begin, milliseconds| StageRun { stage, begin, milliseconds };
        let mut trace = Trace::new("pile");
        let host_runs = vec![run("submit", 0.1, 0.2), run("wait", 0.3, 0.6)];
        let device_runs = vec![run("edit", 0.0, 0.5 * took), run("solver", 0.5 * took, 0.5 * took)];
        trace.add(Instant::now(), 1.0, &StepReport { backend: "gpu", host_runs, device_runs, ..StepReport::default() });
        let json: Value = serde_json::from_str(&trace.json()).unwrap();
        assert_eq!(nanoseconds(&spans(&json, DEVICE)[0]["ts"]), begins, "{took}");
    }
}

/// The program writes it, over what was there; of a long run the end.
#[test]
fn the_program_writes_the_last_steps() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trace.json");
    std::fs::write(&file, "x".repeat(20_000_000)).unwrap();
    let arguments = ["column", "--bodies", "1", "--steps", "10020", "--threads", "1", "--backend", "cpu", "--trace"];
    let output = Command::new(program("run")).args(arguments).arg(&file).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let json: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    check_nesting(&json);
    let steps: Vec<_> = spans(&json, HOST).into_iter().filter(|event| event["name"] == "step").collect();
    assert_eq!(
        (steps.len(), &steps[0]["args"]["step"], &steps[9999]["args"]["step"]),
        (10_000, &21.into(), &10_020.into())
    );
    assert_eq!(json["otherData"]["earlier steps left out"], 20);
    assert!(String::from_utf8_lossy(&output.stdout).contains("ms a pass"));
    let help = Command::new(program("run")).arg("--help").output().unwrap();
    assert!(String::from_utf8_lossy(&help.stdout).contains("last 10,000 steps"));
}

/// As `--json`: a bad path costs no run and touches nothing, a full disk takes no result away.
#[test]
fn a_file_that_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none").join("trace.json");
    let run = |path: &std::path::Path, steps: &str| {
        Command::new(program("run"))
            .args(["column", "--backend", "cpu", "--steps", steps, "--trace"])
            .arg(path)
            .output()
            .unwrap()
    };
    let output = run(&missing, "10000000");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("cannot write"));
    // What is there stays when the run fails.
    let file = folder.path().join("trace.json");
    std::fs::write(&file, "old").unwrap();
    let arguments = ["column", "--bodies", "0", "--trace"];
    assert_eq!(Command::new(program("run")).args(arguments).arg(&file).status().unwrap().code(), Some(2));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "old");
    if cfg!(target_os = "linux") {
        let output = run("/dev/full".as_ref(), "2");
        assert_eq!(output.status.code(), Some(1));
        assert!(String::from_utf8_lossy(&output.stderr).contains("cannot write /dev/full"));
        assert!(String::from_utf8_lossy(&output.stdout).contains("state hash"));
    }
}
