//! Curves out of lines: a point is the median over the seeds, a curve joins an engine's points in order of sub-steps.

use super::names::Names;
use crate::record::{Kind, Outcome, Record};
use std::collections::BTreeMap;

/// An error below this many of its unit counts as none: it is drawn at the foot of its axis and left out of fits.
pub const FLOOR: f64 = 1e-9;

/// One setting of an engine: medians over the seeds, so that each number is one that was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Sub-steps a step.
    pub substeps: u32,
    /// Length of a step, s.
    pub dt: f64,
    /// Runs that the medians are over.
    pub seeds: usize,
    /// Median time of a step, ms.
    pub ms: f64,
    /// 95th percentile of the same, ms.
    pub p95: Option<f64>,
    /// The error, in its unit; never negative.
    pub error: f64,
    /// Least error of any seed.
    pub low: f64,
    /// Greatest error of any seed.
    pub high: f64,
}

/// The points of one engine, solver and, where it matters, broad phase.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// The engine, as in the table.
    pub engine: String,
    /// What a reader sees: the engine, and what sets this curve apart from its others.
    pub label: String,
    /// Number of this curve among those of its engine; it chooses the dashes.
    pub variant: usize,
    /// In order of sub-steps; of [`Measure::lengths`], from the longest step to the shortest.
    pub points: Vec<Point>,
}

/// One error of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct Measure {
    /// Name of the case.
    pub case: String,
    /// Name of the error.
    pub quantity: String,
    /// Its unit.
    pub unit: String,
    /// Whether it is the first error of its case in the table.
    pub headline: bool,
    /// The case's usual length of a step, s.
    pub dt: f64,
    /// One curve an engine, over sub-steps at `dt`.
    pub curves: Vec<Curve>,
    /// The same over lengths of a step, at equal sub-steps; empty where only one length was measured.
    pub lengths: Vec<Curve>,
}

/// Whether an engine is tumble, on whichever side.
pub fn is_ours(engine: &str) -> bool {
    engine.starts_with("tumble")
}

/// The median; of an even count the greater of the two in the middle, which is a number of the table.
pub(crate) fn median(numbers: &mut [f64]) -> Option<f64> {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied()
}

/// A time that can be drawn, ms.
pub(crate) fn usable_time(record: &Record) -> Option<f64> {
    record.ms_median.filter(|ms| ms.is_finite() && *ms > 0.0)
}

/// Why a line of a case gives no point; `None` when it does.
pub(crate) fn unusable(record: &Record) -> Option<String> {
    if record.outcome != Outcome::Done {
        return Some(record.note.clone());
    }
    let reason = match (usable_time(record), record.value) {
        (None, _) => match record.ms_median {
            Some(ms) => format!("a time of {ms} ms cannot be drawn"),
            None => "no time".to_string(),
        },
        (_, None) => "no value".to_string(),
        (_, Some(value)) if !value.is_finite() => format!("the value is {value}"),
        _ => return None,
    };
    Some(reason)
}

/// Whether two lengths of a step are the same one; an engine may hold them in single precision.
pub(crate) fn same_dt(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() <= 1e-5 * a.abs().max(b.abs())
}

/// The length of a step that most lines have; the first of equals.
fn usual_dt(lines: &[&Record]) -> f64 {
    let count = |dt: f64| lines.iter().filter(|r| same_dt(r.dt, dt)).count();
    lines.iter().map(|r| r.dt).rev().max_by_key(|&dt| count(dt)).unwrap_or(0.0)
}

fn point(lines: &[&Record]) -> Option<Point> {
    let mut times: Vec<f64> = lines.iter().filter_map(|r| usable_time(r)).collect();
    let mut tails: Vec<f64> = lines.iter().filter_map(|r| r.ms_p95).filter(|ms| ms.is_finite()).collect();
    let mut errors: Vec<f64> = lines.iter().filter_map(|r| r.value).map(f64::abs).collect();
    let error = median(&mut errors)?;
    Some(Point {
        substeps: lines[0].substeps,
        dt: lines[0].dt,
        seeds: lines.len(),
        ms: median(&mut times)?,
        p95: median(&mut tails),
        error,
        low: errors[0],
        high: *errors.last()?,
    })
}

/// Points of lines of one label and length of a step, in order of sub-steps.
fn points(lines: &[&Record]) -> Vec<Point> {
    let mut settings = BTreeMap::<u32, Vec<&Record>>::new();
    for line in lines {
        settings.entry(line.substeps).or_default().push(line);
    }
    settings.values().filter_map(|lines| point(lines)).collect()
}

/// Points over lengths of a step: for each number of sub-steps that was run at several, the longest step first.
fn over_lengths(lines: &[&Record]) -> Vec<Point> {
    let mut found = Vec::new();
    let mut settings: Vec<u32> = lines.iter().map(|r| r.substeps).collect();
    settings.sort_unstable();
    settings.dedup();
    for substeps in settings {
        let mut groups = Vec::<Vec<&Record>>::new();
        for &line in lines.iter().filter(|r| r.substeps == substeps) {
            match groups.iter_mut().find(|g| same_dt(g[0].dt, line.dt)) {
                Some(group) => group.push(line),
                None => groups.push(vec![line]),
            }
        }
        if groups.len() > 1 && groups.len() > found.len() {
            found = groups.iter().filter_map(|g| point(g)).collect();
        }
    }
    found.sort_by(|a, b| b.dt.total_cmp(&a.dt));
    found
}

/// Every error of every case, in the table's order.
pub fn measures(records: &[Record]) -> Vec<Measure> {
    let names = Names::new(records);
    let mut groups = Vec::<Vec<&Record>>::new();
    for record in records.iter().filter(|r| r.kind == Kind::Case && !r.quantity.is_empty()) {
        let same = |r: &Record| r.case == record.case && r.quantity == record.quantity && r.unit == record.unit;
        match groups.iter_mut().find(|g| same(g[0])) {
            Some(group) => group.push(record),
            None => groups.push(vec![record]),
        }
    }
    let mut cases = Vec::<&str>::new();
    for group in &groups {
        if !cases.contains(&group[0].case.as_str()) {
            cases.push(&group[0].case);
        }
    }
    // The errors of one case lie together, wherever the table has them.
    groups.sort_by_key(|g| cases.iter().position(|c| *c == g[0].case));
    let mut seen = "";
    let mut all = Vec::new();
    for group in &groups {
        let first = group[0];
        let headline = all.is_empty() || seen != first.case;
        seen = &first.case;
        let usable: Vec<&Record> = group.iter().copied().filter(|r| unusable(r).is_none()).collect();
        let dt = usual_dt(if usable.is_empty() { group } else { &usable });
        let (mut curves, mut lengths) = (Vec::new(), Vec::new());
        for name in names.all() {
            let of_label: Vec<&Record> = usable.iter().copied().filter(|r| names.label(r) == name.label).collect();
            let curve = |points| Curve {
                engine: name.engine.clone(),
                label: name.label.clone(),
                variant: name.variant,
                points,
            };
            let at_dt: Vec<&Record> = of_label.iter().copied().filter(|r| same_dt(r.dt, dt)).collect();
            curves.push(curve(points(&at_dt)));
            lengths.push(curve(over_lengths(&of_label)));
        }
        for list in [&mut curves, &mut lengths] {
            list.retain(|c: &Curve| !c.points.is_empty());
        }
        all.push(Measure {
            case: first.case.clone(),
            quantity: first.quantity.clone(),
            unit: first.unit.clone(),
            headline,
            dt,
            curves,
            lengths,
        });
    }
    all
}
