//! What a run came to: collected step by step, told as a table or as JSON.

use serde_json::{Map, Value, json};
use std::fmt::Write;
use tumble::core::Penetration;
use tumble::{BodyHandle, Params, RigidBodyType, Scene, StepReport};

/// What is told where an adapter cannot measure.
const NOT_MEASURED: &str = "n/a";

/// A run, and what it is judged by.
pub(crate) struct Outcome {
    scene: &'static str,
    /// Dynamic ones.
    bodies: usize,
    /// Fixed and kinematic ones.
    others: usize,
    joints: usize,
    pub(crate) steps: u32,
    params: Params,
    /// A step each.
    milliseconds: Vec<f64>,
    /// A stage each, in order; of each, the steps in which it was timed.
    stages: Vec<(&'static str, Vec<f64>)>,
    /// Of the last step.
    report: StepReport,
    pub(crate) penetration: Penetration,
    /// J.
    pub(crate) kinetic_energy: f64,
    pub(crate) state_hash: u64,
}

impl Outcome {
    pub(crate) fn new(name: &'static str, steps: u32, params: &Params, scene: &Scene) -> Self {
        let dynamic = |body: &BodyHandle| scene.body(*body).is_ok_and(|b| b.body_type == RigidBodyType::Dynamic);
        let bodies = scene.bodies().filter(dynamic).count();
        Self {
            scene: name,
            bodies,
            others: scene.len() - bodies,
            joints: scene.joint_count(),
            steps,
            params: *params,
            milliseconds: Vec::new(),
            stages: Vec::new(),
            report: StepReport::default(),
            penetration: Penetration::default(),
            kinetic_energy: 0.0,
            state_hash: 0,
        }
    }

    /// One step more.
    pub(crate) fn add(&mut self, milliseconds: f64, report: StepReport) {
        self.milliseconds.push(milliseconds);
        for time in &report.stages {
            let index = self.stages.iter().position(|(stage, _)| *stage == time.stage).unwrap_or_else(|| {
                self.stages.push((time.stage, Vec::new()));
                self.stages.len() - 1
            });
            self.stages[index].1.extend(time.milliseconds);
        }
        self.report = report;
    }

    /// Median of each pass that was timed; `None` for one that could not be.
    fn passes(&self) -> impl Iterator<Item = (&'static str, Option<f64>)> {
        self.stages.iter().map(|(stage, times)| (*stage, (!times.is_empty()).then(|| quantile(times, 0.5))))
    }

    /// Fields as in the README. `bodies` counts the dynamic ones; `state_hash` is 16 hexadecimal digits, since a JSON
    /// number does not hold 64 bits; `passes` is null unless the run was profiled.
    pub(crate) fn json(&self) -> Value {
        let report = &self.report;
        let passes: Map<_, _> =
            self.passes().map(|(stage, ms)| (stage.into(), ms.map_or(NOT_MEASURED.into(), Value::from))).collect();
        let passes = match (self.params.profile, passes.is_empty()) {
            (false, _) => Value::Null,
            (true, true) => NOT_MEASURED.into(),
            (true, false) => passes.into(),
        };
        let growths: Map<_, _> = report.growths.iter().map(|&(buffer, n)| (buffer.into(), n.into())).collect();
        json!({
            "scene": self.scene,
            "backend": report.backend,
            "adapter": report.adapter,
            "bodies": self.bodies,
            "steps": self.steps,
            "dt": self.params.dt,
            "accuracy": self.params.accuracy.to_string(),
            "substeps": self.params.accuracy.most(),
            "spent": report.accuracy.map(|spent| json!({
                "substeps": spent.substeps,
                "visits": spent.visits,
                "residual_m": spent.residual_m,
                "joint_residual_m": spent.joint_residual_m,
                "bodies_over": spent.bodies_over,
            })),
            "ms_per_step": {
                "median": quantile(&self.milliseconds, 0.5),
                "p95": quantile(&self.milliseconds, 0.95),
            },
            "passes": passes,
            "pairs": report.pairs,
            "contacts": report.contacts,
            "batches": report.batches,
            "penetration": { "max_m": self.penetration.max_m, "mean_m": self.penetration.mean_m },
            "kinetic_energy_j": self.kinetic_energy,
            "memory_bytes": report.memory_bytes,
            "broadphase": report.broadphase.to_string(),
            "broadphase_bytes_per_body": report.broadphase_bytes_per_body(),
            "growths": growths,
            "lost": report.lost,
            "quarantined": report.quarantined,
            "broken_joints": report.broken_joints,
            "state_hash": format!("{:016x}", self.state_hash),
        })
    }

    pub(crate) fn table(&self) -> String {
        let (report, params) = (&self.report, &self.params);
        let mut table = String::new();
        let mut row = |name: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(table, "{name:<18}{value}");
        };
        row("scene", self.scene.into());
        row("backend", format!("{} ({})", report.backend, report.adapter));
        row("bodies", format!("{} dynamic, {} others", self.bodies, self.others));
        row("steps", format!("{} of {} s, {}", self.steps, params.dt, params.accuracy));
        if let Some(spent) = report.accuracy {
            let visited = report.manifolds as usize + self.joints - report.broken_joints as usize;
            let each = f64::from(spent.visits) / visited.max(1) as f64;
            row("spent", format!("{each:.1} sub-steps on the mean, {} at most", spent.substeps));
            let (overlap, joints) = (1e3 * spent.residual_m, 1e3 * spent.joint_residual_m);
            row("left", format!("{overlap:.3} mm, joints {joints:.3} mm, {} bodies over", spent.bodies_over));
        }
        row("ms a step", {
            format!("median {:.3}, p95 {:.3}", quantile(&self.milliseconds, 0.5), quantile(&self.milliseconds, 0.95))
        });
        if params.profile {
            row("ms a pass", if self.stages.is_empty() { NOT_MEASURED.into() } else { "(median)".into() });
            for (stage, ms) in self.passes() {
                row(&format!("  {stage}"), ms.map_or(NOT_MEASURED.into(), |ms| format!("{ms:.3}")));
            }
        }
        row("broad phase", format!("{}, {:.0} bytes a body", report.broadphase, report.broadphase_bytes_per_body()));
        row("pairs", report.pairs.to_string());
        row("contacts", report.contacts.to_string());
        row("batches", report.batches.to_string());
        row("overlap", {
            let Penetration { max_m, mean_m } = self.penetration;
            format!("deepest {:.3} mm, mean {:.4} mm", max_m * 1e3, mean_m * 1e3)
        });
        row("kinetic energy", format!("{:.6} J", self.kinetic_energy));
        row("bytes held", report.memory_bytes.to_string());
        row("growths", {
            let list: Vec<_> = report.growths.iter().map(|(buffer, n)| format!("{buffer} {n}")).collect();
            if list.is_empty() { "none".into() } else { list.join(", ") }
        });
        row("lost", report.lost.to_string());
        row("quarantined", report.quarantined.to_string());
        row("broken joints", report.broken_joints.to_string());
        row("state hash", format!("{:016x}", self.state_hash));
        table
    }
}

/// The value below which a share of `p` of all lie, by linear interpolation between neighbours; NaN of none.
fn quantile(values: &[f64], p: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = p * sorted.len().saturating_sub(1) as f64;
    let (below, above) = (sorted.get(place.floor() as usize), sorted.get(place.ceil() as usize));
    below.zip(above).map_or(f64::NAN, |(below, above)| below + (above - below) * place.fract())
}
