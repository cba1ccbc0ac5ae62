//! Where tumble loses, and where it wins: Pareto domination, counted.

use super::{Desk, listed, setting};
use crate::report::curve::{Curve, FLOOR, Measure, is_ours};
use crate::report::document::{Block, Section, Table, numbers, words};
use crate::report::front::{Advantage, advantage};
use crate::report::scaling::{ScalingCurve, ScalingPoint};
use crate::report::text::{amount, count, number};
use std::cmp::Ordering;

/// Whose advantages a table lists.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Theirs,
    Ours,
}

/// One side's greatest advantage in one error of one case, against one engine's curve or against all of tumble.
struct Row<'a> {
    measure: &'a Measure,
    against: String,
    advantage: Advantage<'a>,
}

/// By error at equal time, then by time at equal error.
fn order(a: &Advantage, b: &Advantage) -> Ordering {
    let key = |a: &Advantage| (a.error_factor.unwrap_or(0.0), a.time_factor.unwrap_or(f64::INFINITY));
    let (a, b) = (key(a), key(b));
    a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
}

fn split(measure: &Measure) -> (Vec<&Curve>, Vec<&Curve>) {
    measure.curves.iter().partition(|c| is_ours(&c.engine))
}

/// Theirs over all of tumble, one for each curve of theirs; or tumble's best over each of theirs.
fn advantages(measure: &Measure, side: Side) -> Vec<Row<'_>> {
    let (ours, theirs) = split(measure);
    if ours.is_empty() {
        return Vec::new();
    }
    let row = |against: &str, advantage| Row { measure, against: against.to_string(), advantage };
    match side {
        Side::Theirs => theirs.iter().filter_map(|one| Some(row("tumble", advantage(one, &ours)?))).collect(),
        Side::Ours => theirs
            .iter()
            .filter_map(|other| {
                let all = ours.iter().filter_map(|one| advantage(one, &[other]));
                Some(row(&other.label, all.max_by(order)?))
            })
            .collect(),
    }
}

fn factor(value: f64) -> String {
    format!("{} ×", number(value))
}

/// An error; what is below the floor is named so.
fn error(value: f64, unit: &str) -> String {
    if value <= FLOOR { format!("below {}", amount(FLOOR, unit)) } else { amount(value, unit) }
}

fn table(caption: &str, side: Side, mut rows: Vec<Row>) -> Table {
    rows.sort_by(|a, b| order(&b.advantage, &a.advantage));
    let other = if side == Side::Theirs { "tumble" } else { "the other" };
    let head = vec![
        words("case"),
        words("error"),
        words("the better setting"),
        numbers("ms"),
        numbers("its error"),
        words(format!("{other}'s best in that time")),
        numbers("ms"),
        numbers("its error"),
        numbers("times the error"),
        numbers("times the time, for that error"),
    ];
    let cells = |row: Row| {
        let (a, unit) = (row.advantage, &row.measure.unit);
        let best = match a.best {
            Some(best) => setting(&best.curve.label, best.point),
            None => format!("{}: nothing so quick", row.against),
        };
        let times = a.error_factor.map(|f| factor(f) + if a.overlap { ", seeds overlap" } else { "" });
        vec![
            row.measure.case.clone(),
            row.measure.quantity.clone(),
            setting(&a.better.curve.label, a.better.point),
            number(a.better.point.ms),
            error(a.better.point.error, unit),
            best,
            a.best.map_or("–".into(), |b| number(b.point.ms)),
            a.best.map_or("–".into(), |b| error(b.point.error, unit)),
            times.unwrap_or("–".into()),
            a.time_factor.map_or("not reached".into(), factor),
        ]
    };
    Table { caption: caption.into(), head, rows: rows.into_iter().map(cells).collect() }
}

/// The names of the measures that a question is answered with yes, each case once with its errors.
fn named<'a>(measures: &'a [Measure], yes: impl Fn(&'a Measure) -> bool) -> Option<String> {
    let all: Vec<String> = measures.iter().filter(|m| yes(m)).map(|m| format!("{} ({})", m.case, m.quantity)).collect();
    (!all.is_empty()).then(|| listed(all))
}

pub(super) fn losses(desk: &mut Desk, measures: &[Measure], curves: &[ScalingCurve]) -> Section {
    let compared = measures.iter().filter(|m| !split(m).0.is_empty() && !split(m).1.is_empty()).count();
    let rows: Vec<Row> = measures.iter().flat_map(|m| advantages(m, Side::Theirs)).collect();
    let mut blocks = Vec::new();
    if let Some(names) = named(measures, |m| split(m).0.is_empty() && !split(m).1.is_empty()) {
        blocks.push(Block::Text(format!("tumble has no value at all, where another engine has one, in: {names}.")));
    }
    let mut lost: Vec<(&str, &str)> = rows
        .iter()
        .filter(|r| r.advantage.best.is_some())
        .map(|r| (r.measure.case.as_str(), r.measure.quantity.as_str()))
        .collect();
    lost.dedup();
    let quicker = rows.iter().filter(|r| r.advantage.best.is_none()).count();
    blocks.push(Block::Text(match (compared, rows.len()) {
        (0, _) => "No case has both tumble and another engine, so nothing can be compared.".into(),
        (_, 0) => format!("Nowhere among the {} compared.", errors(compared)),
        _ => format!(
            "In {} of the {} compared, another engine has a setting that is no slower than tumble's best of equal time \
             and more accurate. {} below {} only quicker than tumble's quickest.",
            lost.len(),
            errors(compared),
            quicker,
            if quicker == 1 { "is" } else { "are" }
        ),
    }));
    if !rows.is_empty() {
        blocks.push(Block::Table(table(
            "For each engine the setting by which it leads tumble most, the widest lead first",
            Side::Theirs,
            rows,
        )));
    }
    if let Some(names) = named(measures, |m| split(m).1.is_empty() && !split(m).0.is_empty()) {
        blocks.push(Block::Text(format!("Not compared, as no other engine has a value: {names}.")));
    }
    blocks.extend(sizes("Bodies at which another engine is quicker than tumble", curves, Side::Theirs));
    desk.section("Where tumble loses", blocks)
}

pub(super) fn wins(desk: &mut Desk, measures: &[Measure], curves: &[ScalingCurve]) -> Section {
    let rows: Vec<Row> = measures.iter().flat_map(|m| advantages(m, Side::Ours)).collect();
    let mut blocks = Vec::new();
    if rows.is_empty() {
        blocks.push(Block::Text("No setting of tumble leads another engine in any case.".into()));
    } else {
        let caption = "For each engine the setting by which tumble leads it most, the widest lead first";
        blocks.push(Block::Table(table(caption, Side::Ours, rows)));
    }
    blocks.extend(sizes("Bodies at which tumble is quicker than another engine", curves, Side::Ours));
    desk.section("Where tumble wins", blocks)
}

fn errors(n: usize) -> String {
    if n == 1 { "1 error of a case".into() } else { format!("{n} errors of cases") }
}

/// Scene by scene and engine by engine, the number of bodies at which a side's lead in time is greatest.
fn sizes(caption: &str, curves: &[ScalingCurve], side: Side) -> Option<Block> {
    let mut found = Vec::new();
    for theirs in curves.iter().filter(|c| !is_ours(&c.engine)) {
        let ours_at = |bodies: u32| {
            let ours = curves.iter().filter(|c| is_ours(&c.engine) && c.case == theirs.case);
            ours.flat_map(|c| c.points.iter().filter(|p| p.bodies == bodies).map(move |p| (c, p)))
                .min_by(|a, b| a.1.ms.total_cmp(&b.1.ms))
        };
        let both: Vec<(&ScalingPoint, (&ScalingCurve, &ScalingPoint))> =
            theirs.points.iter().filter_map(|p| Some((p, ours_at(p.bodies)?))).collect();
        let lead = |their: &ScalingPoint, our: &ScalingPoint| match side {
            Side::Theirs => our.ms / their.ms,
            Side::Ours => their.ms / our.ms,
        };
        let leads: Vec<_> = both.iter().filter(|(t, (_, o))| lead(t, o) > 1.0).collect();
        if let Some((their, (curve, our))) = leads.iter().max_by(|a, b| lead(a.0, a.1.1).total_cmp(&lead(b.0, b.1.1))) {
            let cells = vec![
                theirs.case.clone(),
                theirs.label.clone(),
                format!("{} of {}", leads.len(), both.len()),
                count(u64::from(their.bodies)),
                number(their.ms),
                curve.label.clone(),
                number(our.ms),
                factor(lead(their, our)),
            ];
            found.push((lead(their, our), cells));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let head = vec![
        words("scene"),
        words("engine"),
        numbers("at sizes"),
        numbers("bodies, at the widest"),
        numbers("ms"),
        words("tumble's quickest"),
        numbers("ms"),
        numbers("factor"),
    ];
    let rows: Vec<Vec<String>> = found.into_iter().map(|(_, cells)| cells).collect();
    (!rows.is_empty()).then(|| Block::Table(Table { caption: caption.into(), head, rows }))
}
