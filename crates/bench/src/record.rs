//! The table that a run leaves: one CSV, one line a measured number, so that every point of the report is in it.

use serde::{Deserialize, Serialize};
use std::path::Path;

/// What a line is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A case: time a step against one of its errors.
    Case,
    /// Time a step against the number of bodies.
    Scaling,
    /// Time of one stage of a step.
    Stage,
    /// What the device can do, such as its copy bandwidth.
    Device,
    /// What an engine says of itself: `note` tells one way in which its setting differs from the others', or why it did
    /// not run.
    Engine,
}

/// How a measurement ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// Measured to its end.
    Done,
    /// Given up at the limit of time; its time a step stands, its error is unknown.
    Slow,
    /// What should stand has fallen: the headline tells how far, this error of what lies there means nothing.
    Fell,
    /// The engine has no means for what the case needs.
    Unmodelled,
    /// A state that is not finite, a lost contact, or an error of the engine's own: `note` says which.
    Failed,
}

/// One line of the table. Empty text and `None` stand for what does not apply.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// What the line is about.
    pub kind: Kind,
    /// Name of the case, of the scaled scene, or of the device.
    pub case: String,
    /// `tumble cpu`, `tumble gpu`, `rapier`, `box3d`, `nexus`, `mujoco`.
    pub engine: String,
    /// Version of the engine.
    pub version: String,
    /// Where it ran: adapter and driver, or instruction set and threads.
    pub adapter: String,
    /// Dynamic bodies.
    pub bodies: u32,
    /// Length of a step, s.
    pub dt: f64,
    /// Sub-steps a step.
    pub substeps: u32,
    /// Seed of the scene; 0 where it has none.
    pub seed: u64,
    /// The broad phase that was asked for, where the engine lets one choose.
    pub broadphase: String,
    /// The solver that ran, where the engine lets one choose.
    pub solver: String,
    /// Threads that the engine was given.
    pub threads: u32,
    /// Steps that were timed, after the warm-up.
    pub steps: u32,
    /// Median time of a step, ms, on the host's clock with the result waited for. Of a [`Kind::Stage`] line: the stage's.
    pub ms_median: Option<f64>,
    /// 95th percentile of the same, ms.
    pub ms_p95: Option<f64>,
    /// What `value` is: an error of the case, `floor bytes`, `copy bandwidth`.
    pub quantity: String,
    /// Unit of `value`; 1 for a ratio.
    pub unit: String,
    /// The number.
    pub value: Option<f64>,
    /// Name of the stage, of a [`Kind::Stage`] line.
    pub stage: String,
    /// How it ended.
    pub outcome: Outcome,
    /// What a reader must know of this line.
    pub note: String,
    /// Processor, cores and system.
    pub machine: String,
    /// Commit of tumble, with `+` behind it where files were changed.
    pub commit: String,
    /// Day of the run, as 2026-11-22.
    pub date: String,
}

/// Reads a table.
///
/// # Errors
/// When the file cannot be read or a line is no [`Record`]; says which.
pub fn read(path: &Path) -> Result<Vec<Record>, String> {
    let told = |error: csv::Error| format!("{}: {error}", path.display());
    let mut reader = csv::Reader::from_path(path).map_err(told)?;
    // Without a line below them, wrong columns would pass for an empty table.
    if !reader.headers().map_err(told)?.iter().any(|name| name == "commit") {
        return Err(format!("{} is not a table of this bench: it has no column \"commit\"", path.display()));
    }
    reader.into_deserialize().collect::<Result<_, _>>().map_err(told)
}

/// Writes a table. The file is replaced as a whole, so that a run that ends in the middle leaves the old one.
///
/// # Errors
/// When it cannot be written.
pub fn write(path: &Path, records: &[Record]) -> Result<(), String> {
    let told = |error: &dyn std::fmt::Display| format!("cannot write {}: {error}", path.display());
    let part = path.with_extension("csv.part");
    let mut writer = csv::Writer::from_path(&part).map_err(|e| told(&e))?;
    for record in records {
        writer.serialize(record).map_err(|e| told(&e))?;
    }
    writer.flush().map_err(|e| told(&e))?;
    drop(writer);
    std::fs::rename(&part, path).map_err(|e| told(&e))
}
