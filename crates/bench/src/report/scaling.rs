//! Time against the number of bodies, against what the device could do, and by stage.

use super::curve::{median, same_dt, usable_time};
use super::names::Names;
use crate::record::{Kind, Outcome, Record};

/// One number of bodies.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalingPoint {
    /// Dynamic bodies.
    pub bodies: u32,
    /// Median time of a step, ms.
    pub ms: f64,
    /// 95th percentile of the same, ms.
    pub p95: Option<f64>,
    /// What any solver must move in a step, B.
    pub floor_bytes: Option<f64>,
    /// Share of the device's copy bandwidth at which those bytes were moved, 0 to 1.
    pub bandwidth_share: Option<f64>,
}

/// One engine on one scene.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalingCurve {
    /// Name of the scene.
    pub case: String,
    /// The engine.
    pub engine: String,
    /// What a reader sees.
    pub label: String,
    /// Number of this curve among those of its engine.
    pub variant: usize,
    /// In order of bodies.
    pub points: Vec<ScalingPoint>,
}

/// The median copy bandwidth of the device that a line ran on, GB/s: the device is the one of the line's adapter, else the
/// one of its engine.
fn bandwidth(records: &[Record], line: &Record) -> Option<f64> {
    let of = |same: &dyn Fn(&Record) -> bool| {
        let devices = records.iter().filter(|r| r.kind == Kind::Device && r.quantity == "copy bandwidth" && same(r));
        median(&mut devices.filter_map(|r| r.value).filter(|v| v.is_finite() && *v > 0.0).collect::<Vec<_>>())
    };
    let on_adapter = |r: &Record| !line.adapter.is_empty() && (r.adapter == line.adapter || r.case == line.adapter);
    of(&on_adapter).or_else(|| of(&|r| r.engine == line.engine))
}

/// Every curve of time against bodies, scene by scene.
pub fn scaling(records: &[Record]) -> Vec<ScalingCurve> {
    let names = Names::new(records);
    let lines: Vec<&Record> = records.iter().filter(|r| r.kind == Kind::Scaling).collect();
    let mut cases = Vec::<&str>::new();
    for line in &lines {
        if !cases.contains(&line.case.as_str()) {
            cases.push(&line.case);
        }
    }
    let mut curves = Vec::new();
    for case in cases {
        for name in names.all() {
            let of_curve: Vec<&Record> =
                lines.iter().copied().filter(|r| r.case == case && names.label(r) == name.label).collect();
            let mut sizes: Vec<u32> = of_curve.iter().map(|r| r.bodies).filter(|b| *b > 0).collect();
            sizes.sort_unstable();
            sizes.dedup();
            let points: Vec<ScalingPoint> = sizes
                .into_iter()
                .filter_map(|bodies| {
                    let here: Vec<&Record> = of_curve.iter().copied().filter(|r| r.bodies == bodies).collect();
                    point(records, &here)
                })
                .collect();
            if !points.is_empty() {
                curves.push(ScalingCurve {
                    case: case.to_string(),
                    engine: name.engine.clone(),
                    label: name.label.clone(),
                    variant: name.variant,
                    points,
                });
            }
        }
    }
    curves
}

fn point(records: &[Record], lines: &[&Record]) -> Option<ScalingPoint> {
    // A run given up at the limit of time has a time a step all the same.
    let timed = |r: &&&Record| matches!(r.outcome, Outcome::Done | Outcome::Slow);
    let positive = |v: &f64| v.is_finite() && *v > 0.0;
    let ms = median(&mut lines.iter().filter(timed).filter_map(|r| usable_time(r)).collect::<Vec<_>>())?;
    let p95 = median(&mut lines.iter().filter(timed).filter_map(|r| r.ms_p95).filter(positive).collect::<Vec<_>>());
    let floors = lines.iter().filter(|r| r.quantity == "floor bytes").filter_map(|r| r.value).filter(positive);
    let floor_bytes = median(&mut floors.collect::<Vec<_>>());
    let rate = floor_bytes.map(|bytes| bytes / (ms * 1e-3));
    let share = rate.zip(bandwidth(records, lines[0])).map(|(rate, gigabytes)| rate / (gigabytes * 1e9));
    Some(ScalingPoint { bodies: lines[0].bodies, ms, p95, floor_bytes, bandwidth_share: share })
}

/// A step by its stages.
#[derive(Debug, Clone, PartialEq)]
pub struct Stages {
    /// Name of the scene.
    pub case: String,
    /// What a reader sees of the engine.
    pub label: String,
    /// Dynamic bodies.
    pub bodies: u32,
    /// Name and median time of each stage, ms, in the order of the step; no time where it could not be measured.
    pub stages: Vec<(String, Option<f64>)>,
    /// Median time of the whole step, ms.
    pub step: Option<f64>,
}

impl Stages {
    /// The stages' times together, ms.
    pub fn timed(&self) -> f64 {
        self.stages.iter().filter_map(|s| s.1).sum()
    }

    /// What of the step no stage accounts for, ms; `None` where the step was not timed, 0 where the stages' medians add up
    /// to more than the step's.
    pub fn rest(&self) -> Option<f64> {
        self.step.map(|step| (step - self.timed()).max(0.0))
    }
}

/// Every step by stages, in the table's order. The whole step's time is that of a [`Kind::Stage`] line whose stage is
/// `step`, else that of the [`Kind::Scaling`] or [`Kind::Case`] lines with the same settings.
pub fn stages(records: &[Record]) -> Vec<Stages> {
    let names = Names::new(records);
    let alike = |a: &Record, b: &Record| {
        a.case == b.case
            && a.engine == b.engine
            && a.bodies == b.bodies
            && a.substeps == b.substeps
            && same_dt(a.dt, b.dt)
            && a.solver == b.solver
            && a.broadphase == b.broadphase
    };
    let mut groups = Vec::<Vec<&Record>>::new();
    for line in records.iter().filter(|r| r.kind == Kind::Stage) {
        match groups.iter_mut().find(|g| alike(g[0], line)) {
            Some(group) => group.push(line),
            None => groups.push(vec![line]),
        }
    }
    let mut all = Vec::new();
    for group in groups {
        let first = group[0];
        let time = |stage: &str| {
            let of = group.iter().filter(|r| r.stage == stage && r.outcome == Outcome::Done);
            median(&mut of.filter_map(|r| r.ms_median).filter(|ms| ms.is_finite() && *ms >= 0.0).collect::<Vec<_>>())
        };
        let mut order = Vec::<&str>::new();
        for line in &group {
            if line.stage != "step" && !line.stage.is_empty() && !order.contains(&line.stage.as_str()) {
                order.push(&line.stage);
            }
        }
        let whole = |kind: Kind| {
            let same = records.iter().filter(|r| r.kind == kind && alike(r, first));
            median(&mut same.filter_map(usable_time).collect::<Vec<_>>())
        };
        all.push(Stages {
            case: first.case.clone(),
            label: names.label(first),
            bodies: first.bodies,
            stages: order.into_iter().map(|stage| (stage.to_string(), time(stage))).collect(),
            step: time("step").filter(|ms| *ms > 0.0).or_else(|| whole(Kind::Scaling)).or_else(|| whole(Kind::Case)),
        });
    }
    all
}
