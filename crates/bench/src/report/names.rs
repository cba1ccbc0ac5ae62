//! What a curve is called, and what sets the curves of one engine apart.

use crate::record::{Kind, Record};
use std::collections::{BTreeSet, HashMap};

/// A label, in the order in which the table brings them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Name {
    pub(crate) engine: String,
    pub(crate) label: String,
    /// Number among the labels of this engine.
    pub(crate) variant: usize,
}

/// All labels of a table.
pub(crate) struct Names {
    /// Engines of which more than one solver ran.
    many_solvers: BTreeSet<String>,
    /// Kind, case, engine and solver of which two broad phases ran with all else equal.
    many_broadphases: BTreeSet<(Kind, String, String, String)>,
    names: Vec<Name>,
}

/// Whether a line is of an engine's work, and not of a device or a remark.
pub(crate) fn measured(record: &Record) -> bool {
    matches!(record.kind, Kind::Case | Kind::Scaling | Kind::Stage)
}

impl Names {
    pub(crate) fn new(records: &[Record]) -> Self {
        let mut solvers = HashMap::<&str, &str>::new();
        let mut many_solvers = BTreeSet::new();
        let mut settings = HashMap::new();
        let mut many_broadphases = BTreeSet::new();
        for r in records.iter().filter(|r| measured(r)) {
            if !r.solver.is_empty() && *solvers.entry(&r.engine).or_insert(&r.solver) != r.solver {
                many_solvers.insert(r.engine.clone());
            }
            let setting = (
                (r.kind, &r.case, &r.engine, &r.solver),
                (r.bodies, r.dt.to_bits(), r.substeps, r.seed, &r.quantity, &r.stage),
            );
            if *settings.entry(setting).or_insert(&r.broadphase) != &r.broadphase {
                many_broadphases.insert((r.kind, r.case.clone(), r.engine.clone(), r.solver.clone()));
            }
        }
        let mut all = Self { many_solvers, many_broadphases, names: Vec::new() };
        for r in records.iter().filter(|r| measured(r)) {
            let label = all.label(r);
            if !all.names.iter().any(|n| n.label == label) {
                let variant = all.names.iter().filter(|n| n.engine == r.engine).count();
                all.names.push(Name { engine: r.engine.clone(), label, variant });
            }
        }
        all
    }

    /// The engine, its solver where several ran, its broad phase where it alone tells two lines apart.
    pub(crate) fn label(&self, record: &Record) -> String {
        let mut label = if record.engine.is_empty() { "(no engine)".to_string() } else { record.engine.clone() };
        if self.many_solvers.contains(&record.engine) && !record.solver.is_empty() {
            label += &format!(", {}", record.solver);
        }
        let key = (record.kind, record.case.clone(), record.engine.clone(), record.solver.clone());
        // What the engine chooses by itself needs no word.
        let plain = ["", "auto"].contains(&record.broadphase.as_str());
        if self.many_broadphases.contains(&key) && !plain {
            label += &format!(", {}", record.broadphase);
        }
        label
    }

    pub(crate) fn all(&self) -> &[Name] {
        &self.names
    }
}
