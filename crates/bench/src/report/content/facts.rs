//! The run itself: where, when, with what; how to read the report; what differs; what was not measured.

use super::{Desk, listed};
use crate::record::{Kind, Outcome, Record};
use crate::report::curve::{FLOOR, unusable};
use crate::report::document::{Block, Cells, Section, Table, numbers, prose, words};
use crate::report::names::{Names, measured};
use crate::report::text::step_length;
use std::collections::BTreeSet;

/// The different values of a column, in the table's order, without the empty.
fn distinct<'a>(records: impl IntoIterator<Item = &'a Record>, of: impl Fn(&'a Record) -> String) -> Vec<String> {
    let mut seen = Vec::new();
    for record in records {
        let value = of(record);
        if !value.is_empty() && !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}

fn or_unknown(values: Vec<String>) -> String {
    if values.is_empty() { "not stated".into() } else { listed(values) }
}

pub(super) fn run(desk: &mut Desk, overview: &str) -> Section {
    let records = desk.records;
    let fact = |name: &str, of: fn(&Record) -> String| vec![name.to_string(), or_unknown(distinct(records, of))];
    let rows = vec![
        fact("machine", |r| r.machine.clone()),
        fact("date", |r| r.date.clone()),
        fact("commit", |r| r.commit.clone()),
        vec!["lines of the table".into(), records.len().to_string()],
    ];
    let mut blocks =
        vec![Block::Table(Table { caption: "Where and when".into(), head: vec![words("what"), prose("value")], rows })];
    let mixed = [distinct(records, |r| r.machine.clone()), distinct(records, |r| r.commit.clone())];
    if mixed.iter().any(|values| values.len() > 1) {
        blocks.push(Block::Text(
            "The table mixes machines or commits: times of different ones cannot be compared.".into(),
        ));
    }
    let engines = distinct(records.iter().filter(|r| measured(r)), |r| r.engine.clone());
    if !engines.is_empty() {
        let row = |engine: &String| {
            let of = |column: fn(&Record) -> String| {
                let values = distinct(records.iter().filter(|r| r.engine == *engine), column);
                if values.is_empty() { "–".into() } else { listed(values) }
            };
            vec![
                engine.clone(),
                of(|r| r.version.clone()),
                of(|r| r.adapter.clone()),
                of(|r| if r.threads == 0 { String::new() } else { r.threads.to_string() }),
                of(|r| r.solver.clone()),
                of(|r| r.broadphase.clone()),
            ]
        };
        let mut head: Vec<_> = ["engine", "version", "ran on", "threads", "solvers", "broad phases"].map(words).into();
        head[2].kind = Cells::Prose;
        let rows = engines.iter().map(row).collect();
        blocks.push(Block::Table(Table { caption: "With what".into(), head, rows }));
    }
    let links = [("The table (CSV)", format!("{}.csv", desk.name)), ("Overview (PNG)", format!("{overview}.png"))];
    let more = [("Overview (SVG)", format!("{overview}.svg"))];
    blocks.push(Block::Links(links.into_iter().chain(more).map(|(l, p)| (l.to_string(), p)).collect()));
    desk.section("The run", blocks)
}

pub(super) fn how_to_read(desk: &mut Desk) -> Section {
    let items = [
        "Down and to the left is better: less error, less time. Both axes are logarithmic.".to_string(),
        "A curve joins the settings of one engine in order of sub-steps; its ends say how many. tumble's are thicker. Each \
         engine keeps its colour and marker. In tables, n = 4 means 4 sub-steps."
            .into(),
        "Times are medians of a step on the host's clock with the result waited for; the whisker to the right ends at the \
         95th percentile. Points are medians over the seeds; the thin upright bar spans all seeds."
            .into(),
        format!(
            "An error of 0, or below {FLOOR:e} of its unit, is an open marker at the foot of the axis, and left out of fits."
        ),
        "Every error is better when smaller. Comparisons use measured points only, never a line between two.".into(),
        "No slower and more accurate: where one engine's setting takes no more time than another's best and has the \
         smaller error. Where the ranges of their seeds overlap, the table says so."
            .into(),
    ];
    desk.section("How to read this", vec![Block::List(items.into())])
}

pub(super) fn differences(desk: &mut Desk) -> Section {
    let mut blocks = Vec::new();
    let mut differs = Vec::<Vec<String>>::new();
    for r in desk.records.iter().filter(|r| r.kind == Kind::Engine && r.outcome == Outcome::Done) {
        let row = vec![r.engine.clone(), r.note.clone()];
        if !r.note.is_empty() && !differs.contains(&row) {
            differs.push(row);
        }
    }
    if !differs.is_empty() {
        // An engine's lines lie together, in the order of their first.
        let mut rows = Vec::new();
        while let Some(first) = differs.first().cloned() {
            let (same, others) = differs.into_iter().partition(|row| row[0] == first[0]);
            rows.extend::<Vec<_>>(same);
            differs = others;
        }
        let head = vec![words("engine"), prose("what differs")];
        blocks.push(Block::Table(Table { caption: "Before comparing".into(), head, rows }));
    }
    // One line a note, with the cases that it is about.
    let mut notes = Vec::<(&str, &str, Vec<String>)>::new();
    for r in desk.records.iter().filter(|r| measured(r) && r.outcome == Outcome::Done && !r.note.is_empty()) {
        let at = notes.iter().position(|(engine, note, _)| *engine == r.engine && *note == r.note);
        let at = at.unwrap_or_else(|| {
            notes.push((&r.engine, &r.note, Vec::new()));
            notes.len() - 1
        });
        if !notes[at].2.contains(&r.case) {
            notes[at].2.push(r.case.clone());
        }
    }
    if !notes.is_empty() {
        let rows = notes.into_iter().map(|(engine, note, cases)| vec![engine.into(), note.into(), listed(cases)]);
        let head = vec![words("engine"), prose("note"), prose("cases")];
        blocks.push(Block::Table(Table { caption: "Notes of the runs".into(), head, rows: rows.collect() }));
    }
    if blocks.is_empty() {
        blocks.push(Block::Text("Nothing is noted.".into()));
    }
    desk.section("What differs between the engines", blocks)
}

fn outcome(record: &Record) -> &'static str {
    match record.outcome {
        Outcome::Done => "no usable number",
        Outcome::Slow => "given up at the limit of time",
        Outcome::Unmodelled => "no means for it",
        Outcome::Failed => "failed",
    }
}

/// Why a line has nothing to show; `None` when it has.
fn missing(record: &Record) -> Option<String> {
    match record.kind {
        Kind::Case => unusable(record),
        // A time that could not be taken is said where the times are.
        _ => (record.outcome != Outcome::Done).then(|| record.note.clone()),
    }
}

pub(super) fn not_measured(desk: &mut Desk) -> Section {
    let names = Names::new(desk.records);
    let mut rows = Vec::<(Vec<String>, String, BTreeSet<(u32, String)>, usize)>::new();
    for r in desk.records {
        let Some(why) = missing(r) else { continue };
        let case = if r.kind == Kind::Engine { "everything".to_string() } else { r.case.clone() };
        let of = vec![case, names.label(r), outcome(r).to_string()];
        let setting = match r.kind {
            Kind::Engine => (0, "all".into()),
            Kind::Case => (r.substeps, format!("{} × {}", r.substeps, step_length(r.dt))),
            _ => (r.bodies, format!("{} bodies", r.bodies)),
        };
        match rows.iter_mut().find(|row| row.0 == of && row.1 == why) {
            Some(row) => {
                row.2.insert(setting);
                row.3 += 1;
            }
            None => rows.push((of, why, BTreeSet::from([setting]), 1)),
        }
    }
    let mut blocks = Vec::new();
    if rows.is_empty() {
        blocks.push(Block::Text(if desk.records.is_empty() {
            "Everything: the table is empty.".into()
        } else {
            "Every line of the table has its number.".into()
        }));
    } else {
        let row = |(of, why, settings, lines): (Vec<String>, String, BTreeSet<(u32, String)>, usize)| {
            let mut cells = of;
            cells.push(if why.is_empty() { "not said".into() } else { why });
            cells.push(listed(settings.into_iter().map(|(_, text)| text)));
            cells.push(lines.to_string());
            cells
        };
        let head =
            vec![words("case"), words("engine"), words("outcome"), prose("why"), prose("settings"), numbers("lines")];
        let caption = "What has no point in the plots".to_string();
        blocks.push(Block::Table(Table { caption, head, rows: rows.into_iter().map(row).collect() }));
    }
    desk.section("Not measured, and why", blocks)
}
