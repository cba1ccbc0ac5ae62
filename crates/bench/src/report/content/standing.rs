//! Where tumble loses, and where it wins: Pareto domination, counted.

use super::{Desk, listed, setting};
use crate::report::curve::{Curve, FLOOR, Measure, is_ours};
use crate::report::document::{Block, Section, Table, numbers, words};
use crate::report::front::{Advantage, advantage};
use crate::report::scaling::{ScalingCurve, ScalingPoint};
use crate::report::text::{amount, count, number};

/// Whose advantages are listed.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Theirs,
    Ours,
}

impl Side {
    /// Who leads and who is led, in words.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Theirs => ("another engine", "tumble"),
            Self::Ours => ("tumble", "the others"),
        }
    }
}

/// tumble's curves, and those of the others.
fn split(measure: &Measure) -> (Vec<&Curve>, Vec<&Curve>) {
    measure.curves.iter().partition(|c| is_ours(&c.engine))
}

/// Each curve of one side against all of the other.
fn advantages(measure: &Measure, side: Side) -> Vec<(&Measure, Advantage<'_>)> {
    let (ours, theirs) = split(measure);
    let (ones, others) = if side == Side::Theirs { (theirs, ours) } else { (ours, theirs) };
    if others.is_empty() {
        return Vec::new();
    }
    ones.iter().filter_map(|one| Some((measure, advantage(one, &others)?))).collect()
}

/// The three widest leads by error, as sentences.
fn widest(rows: &[(&Measure, Advantage)]) -> Vec<String> {
    let mut order: Vec<&(&Measure, Advantage)> = rows.iter().collect();
    order.sort_by(|a, b| b.1.error_factor.unwrap_or(0.0).total_cmp(&a.1.error_factor.unwrap_or(0.0)));
    let sentence = |(measure, a): &(&Measure, Advantage)| {
        let (best, times) = (a.best?, a.error_factor?);
        Some(format!(
            "{}, {}: {} has {} in {} ms; {} has {}, {} times as much.",
            measure.case,
            measure.quantity,
            setting(&a.better.curve.label, a.better.point),
            error(a.better.point.error, &measure.unit),
            number(a.better.point.ms),
            setting(&best.curve.label, best.point),
            error(best.point.error, &measure.unit),
            number(times)
        ))
    };
    order.into_iter().filter_map(sentence).take(3).collect()
}

fn factor(value: f64) -> String {
    format!("{} ×", number(value))
}

/// An error; what is below the floor is named so.
fn error(value: f64, unit: &str) -> String {
    if value <= FLOOR { format!("below {}", amount(FLOOR, unit)) } else { amount(value, unit) }
}

/// Settings that are more accurate than what the other side has in the same time.
fn more_accurate(mut rows: Vec<(&Measure, Advantage)>, side: Side) -> Table {
    let (one, others) = side.words();
    rows.sort_by(|a, b| b.1.error_factor.unwrap_or(0.0).total_cmp(&a.1.error_factor.unwrap_or(0.0)));
    let head = vec![
        words("case"),
        words("error"),
        words("the better setting"),
        numbers("ms"),
        numbers("its error"),
        words(format!("best of {others} in that time")),
        numbers("ms"),
        numbers("its error"),
        numbers("times the error"),
        numbers("times the time, for that error"),
    ];
    let cells = |(measure, a): (&Measure, Advantage)| {
        let unit = &measure.unit;
        let times = a.error_factor.map_or("–".into(), factor) + if a.overlap { ", seeds overlap" } else { "" };
        vec![
            measure.case.clone(),
            measure.quantity.clone(),
            setting(&a.better.curve.label, a.better.point),
            number(a.better.point.ms),
            error(a.better.point.error, unit),
            a.best.map_or("–".into(), |b| setting(&b.curve.label, b.point)),
            a.best.map_or("–".into(), |b| number(b.point.ms)),
            a.best.map_or("–".into(), |b| error(b.point.error, unit)),
            times,
            a.time_factor.map_or("not reached".into(), factor),
        ]
    };
    let caption = format!("More accurate and no slower: where {one} leads {others} most, the widest lead first");
    Table { caption, head, rows: rows.into_iter().map(cells).collect() }
}

/// Settings that are quicker than anything that the other side has.
fn only_quicker(mut rows: Vec<(&Measure, Advantage)>, side: Side) -> Table {
    let (one, others) = side.words();
    let key = |a: &Advantage| a.time_factor.unwrap_or(f64::INFINITY);
    rows.sort_by(|a, b| key(&b.1).total_cmp(&key(&a.1)));
    let head = vec![
        words("case"),
        words("error"),
        words("the quicker setting"),
        numbers("ms"),
        numbers("its error"),
        words(format!("quickest of {others} to reach that")),
        numbers("ms"),
        numbers("times the time"),
    ];
    let cells = |(measure, a): (&Measure, Advantage)| {
        vec![
            measure.case.clone(),
            measure.quantity.clone(),
            setting(&a.better.curve.label, a.better.point),
            number(a.better.point.ms),
            error(a.better.point.error, &measure.unit),
            a.reached.map_or("none".into(), |r| setting(&r.curve.label, r.point)),
            a.reached.map_or("–".into(), |r| number(r.point.ms)),
            a.time_factor.map_or("not reached".into(), factor),
        ]
    };
    let caption = format!("Quicker than every setting of {others}: where {one} leads by time alone");
    Table { caption, head, rows: rows.into_iter().map(cells).collect() }
}

/// The names of the measures that a question is answered with yes.
fn named<'a>(measures: &'a [Measure], yes: impl Fn(&'a Measure) -> bool) -> Option<String> {
    let all: Vec<String> = measures.iter().filter(|m| yes(m)).map(|m| format!("{} ({})", m.case, m.quantity)).collect();
    (!all.is_empty()).then(|| listed(all))
}

/// How often a side leads, and by what.
fn standing(measures: &[Measure], curves: &[ScalingCurve], side: Side) -> Vec<Block> {
    let (one, others) = side.words();
    let compared = measures.iter().filter(|m| !split(m).0.is_empty() && !split(m).1.is_empty()).count();
    let rows: Vec<(&Measure, Advantage)> = measures.iter().flat_map(|m| advantages(m, side)).collect();
    let (accurate, quick): (Vec<_>, Vec<_>) = rows.into_iter().partition(|(_, a)| a.best.is_some());
    let mut led: Vec<(&str, &str)> = accurate.iter().map(|(m, _)| (m.case.as_str(), m.quantity.as_str())).collect();
    led.dedup();
    let mut blocks = vec![Block::Text(if compared == 0 {
        "No case has both tumble and another engine, so nothing can be compared.".into()
    } else {
        format!(
            "{} of {compared} errors of cases in which both were measured, {one} has a setting that is no slower than the \
             best of {others} in that time, and more accurate.",
            if led.is_empty() { "In none".to_string() } else { format!("In {}", led.len()) }
        )
    })];
    if !accurate.is_empty() {
        blocks.push(Block::List(widest(&accurate)));
        blocks.push(Block::Table(more_accurate(accurate, side)));
    }
    if !quick.is_empty() {
        blocks.push(Block::Table(only_quicker(quick, side)));
    }
    blocks.extend(sizes(curves, side));
    blocks
}

pub(super) fn losses(desk: &mut Desk, measures: &[Measure], curves: &[ScalingCurve]) -> Section {
    let mut blocks = Vec::new();
    if let Some(names) = named(measures, |m| split(m).0.is_empty() && !split(m).1.is_empty()) {
        blocks.push(Block::Text(format!("tumble has no value at all, where another engine has one, in: {names}.")));
    }
    blocks.extend(standing(measures, curves, Side::Theirs));
    if let Some(names) = named(measures, |m| split(m).1.is_empty() && !split(m).0.is_empty()) {
        blocks.push(Block::Text(format!("Not compared, as no other engine has a value: {names}.")));
    }
    desk.section("Where tumble loses", blocks)
}

pub(super) fn wins(desk: &mut Desk, measures: &[Measure], curves: &[ScalingCurve]) -> Section {
    let blocks = standing(measures, curves, Side::Ours);
    desk.section("Where tumble wins", blocks)
}

/// Scene by scene and engine by engine, the number of bodies at which a side's lead in time is greatest.
fn sizes(curves: &[ScalingCurve], side: Side) -> Option<Block> {
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
        numbers("bodies, at the widest lead"),
        numbers("its ms"),
        words("tumble's quickest"),
        numbers("ms"),
        numbers("factor"),
    ];
    let caption = match side {
        Side::Theirs => "Numbers of bodies at which another engine is quicker than tumble",
        Side::Ours => "Numbers of bodies at which tumble is quicker than another engine",
    };
    let rows: Vec<Vec<String>> = found.into_iter().map(|(_, cells)| cells).collect();
    (!rows.is_empty()).then(|| Block::Table(Table { caption: caption.into(), head, rows }))
}
