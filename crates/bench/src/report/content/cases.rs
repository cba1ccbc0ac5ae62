//! Case by case: plots, who reaches which error first, who has which error in rapier's time, and fits.

use super::{Desk, listed, setting};
use crate::cases;
use crate::report::curve::{Curve, FLOOR, Measure, Point, is_ours, same_dt};
use crate::report::document::{Block, Column, Section, Table, numbers, words};
use crate::report::fit::{Fit, power_law};
use crate::report::front::{levels, most_accurate, quickest};
use crate::report::plot::{Plot, PlotCurve, PlotPoint};
use crate::report::text::{amount, number, step_length};

/// An exponent of sub-steps nearer to zero than this is called flat: 32 times the sub-steps then change the error by less
/// than a factor of 1.42.
const FLAT: f64 = 0.1;

/// The sub-steps that rapier has when it is not told otherwise.
const USUAL_SUBSTEPS: u32 = 4;

/// The plot of each error of each case over sub-steps, in the order of `measures`.
pub fn plots(measures: &[Measure]) -> Vec<(&Measure, Plot)> {
    let plot = |m: &Measure| {
        let tag = |p: &Point| p.substeps.to_string();
        let title = if m.headline { m.case.clone() } else { format!("{}: {}", m.case, m.quantity) };
        plot_of(m, title, &m.curves, "time a step", 1.0, tag)
    };
    measures.iter().map(|m| (m, plot(m))).collect()
}

/// The plot over lengths of a step, at equal sub-steps: time is that of as much simulated time as the usual step's.
fn plot_of_lengths(measure: &Measure) -> Plot {
    let usual = step_length(measure.dt);
    let title = format!("{}: by length of a step", measure.case);
    let tag = |p: &Point| step_length(p.dt).trim_end_matches(" s").to_string();
    plot_of(measure, title, &measure.lengths, &format!("time a simulated {usual}"), measure.dt, tag)
}

/// `dt` is the simulated time that the axis is for, and 1 where it is for a step.
fn plot_of(
    measure: &Measure,
    title: String,
    curves: &[Curve],
    time: &str,
    dt: f64,
    tag: impl Fn(&Point) -> String,
) -> Plot {
    let scale = |p: &Point| if dt == 1.0 { 1.0 } else { dt / p.dt };
    let curve = |c: &Curve| PlotCurve {
        engine: c.engine.clone(),
        label: c.label.clone(),
        variant: c.variant,
        points: c
            .points
            .iter()
            .enumerate()
            .map(|(i, p)| PlotPoint {
                x: p.ms * scale(p),
                y: p.error,
                x_high: p.p95.map(|ms| ms * scale(p)),
                y_range: Some((p.low, p.high)),
                tag: (i == 0 || i + 1 == c.points.len()).then(|| tag(p)),
            })
            .collect(),
    };
    // Ticks of the short units bear them.
    let unit = if matches!(measure.unit.as_str(), "m" | "rad" | "s" | "1" | "") { "" } else { &measure.unit };
    let y_title = if unit.is_empty() { measure.quantity.clone() } else { format!("{}, {unit}", measure.quantity) };
    Plot {
        title,
        x_title: format!("{time}, ms"),
        y_title,
        y_unit: measure.unit.clone(),
        x_counts: false,
        floor: FLOOR,
        curves: curves.iter().map(curve).collect(),
    }
}

pub(super) fn sections(desk: &mut Desk, measures: &[Measure]) -> Result<Vec<Section>, String> {
    let mut blocks = Vec::new();
    if measures.is_empty() {
        blocks.push(Block::Text("The table has no line of a case.".into()));
    }
    let mut all = vec![desk.section("Case by case", blocks)];
    for of_case in measures.chunk_by(|a, b| a.case == b.case) {
        let id = desk.anchors.make(&format!("case-{}", of_case[0].case));
        let title = of_case[0].case.clone();
        let mut blocks = Vec::new();
        // What the case shows stands with the cases, not in the table.
        blocks.extend(cases::ALL.iter().find(|c| c.name == title).map(|c| Block::Text(sentence(c.about))));
        blocks.extend(case(desk, of_case)?);
        all.push(Section { id, title, sub: true, blocks });
    }
    Ok(all)
}

/// With a capital letter and a full stop.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| format!("{}{}.", first.to_uppercase(), letters.as_str()))
}

fn case(desk: &mut Desk, measures: &[Measure]) -> Result<Vec<Block>, String> {
    let mut figures = Vec::new();
    let mut missing = Vec::new();
    for (measure, plot) in plots(measures) {
        if plot.curves.is_empty() {
            missing.push(measure.quantity.clone());
            continue;
        }
        let slug = if measure.headline { measure.case.clone() } else { plot.title.clone() };
        figures.push(desk.log_figure(&slug, &plot)?);
        if measure.lengths.iter().any(|c| !c.points.is_empty()) {
            let plot = plot_of_lengths(measure);
            let slug = format!("{} {} by length of a step", measure.case, measure.quantity);
            figures.push(desk.log_figure(&slug, &plot)?);
        }
    }
    let mut blocks = Vec::new();
    if !figures.is_empty() {
        blocks.push(Block::Figures(figures));
    }
    if !missing.is_empty() {
        let text = format!("No engine has a value of: {}. The last section says why.", listed(missing));
        blocks.push(Block::Text(text));
    }
    blocks.extend(in_rapiers_time(measures));
    blocks.extend(measures.iter().filter(|m| m.headline).filter_map(front));
    blocks.extend(fits(measures));
    blocks.extend(measures.iter().filter_map(lengths));
    Ok(blocks)
}

fn error(value: f64, unit: &str) -> String {
    if value <= FLOOR { format!("below {}", amount(FLOOR, unit)) } else { amount(value, unit) }
}

/// At each level of error the quickest setting, and tumble's beside it.
fn front(measure: &Measure) -> Option<Block> {
    let ours: Vec<&Curve> = measure.curves.iter().filter(|c| is_ours(&c.engine)).collect();
    let row = |level: f64| {
        let first = quickest(&measure.curves, level)?;
        let best = quickest(ours.iter().copied(), level);
        Some(vec![
            amount(level, &measure.unit),
            setting(&first.curve.label, first.point),
            number(first.point.ms),
            best.map_or("not reached".into(), |b| setting(&b.curve.label, b.point)),
            best.map_or("–".into(), |b| number(b.point.ms)),
            best.map_or("–".into(), |b| format!("{} ×", number(b.point.ms / first.point.ms))),
        ])
    };
    let rows: Vec<Vec<String>> = levels(&measure.curves).into_iter().filter_map(row).collect();
    let head = vec![
        numbers("error of at most"),
        words("quickest"),
        numbers("ms"),
        words("tumble's quickest"),
        numbers("ms"),
        numbers("to the quickest"),
    ];
    let caption = format!("{}: who reaches it first", measure.quantity);
    (!rows.is_empty()).then_some(Block::Table(Table { caption, head, rows }))
}

/// What each curve reaches in the time that rapier takes with its own settings.
fn in_rapiers_time(measures: &[Measure]) -> Option<Block> {
    let usual = |m: &Measure| {
        let rapier = m.curves.iter().find(|c| c.engine == "rapier")?;
        rapier.points.iter().find(|p| p.substeps == USUAL_SUBSTEPS).map(|p| p.ms)
    };
    // The errors of one case come from the same runs, so that any of them has the time.
    let budget = measures.iter().find_map(usual)?;
    let mut labels = Vec::<&str>::new();
    for curve in measures.iter().flat_map(|m| &m.curves) {
        if !labels.contains(&curve.label.as_str()) {
            labels.push(&curve.label);
        }
    }
    let cell = |label: &str, m: &Measure| {
        let curve = m.curves.iter().find(|c| c.label == label);
        let best = most_accurate(curve, budget);
        match (best, curve) {
            (Some(b), _) => {
                format!("{} (n = {}, {} ms)", error(b.point.error, &m.unit), b.point.substeps, number(b.point.ms))
            }
            (None, Some(c)) => {
                let least = c.points.iter().map(|p| p.ms).fold(f64::INFINITY, f64::min);
                format!("not so quick: {} ms at least", number(least))
            }
            (None, None) => "–".into(),
        }
    };
    let head: Vec<Column> =
        std::iter::once(words("engine")).chain(measures.iter().map(|m| words(m.quantity.clone()))).collect();
    let row = |label: &&str| {
        std::iter::once(label.to_string()).chain(measures.iter().map(|m| cell(label, m))).collect::<Vec<_>>()
    };
    let caption =
        format!("Least error within {} ms, the time of rapier at its usual {USUAL_SUBSTEPS} sub-steps", number(budget));
    Some(Block::Table(Table { caption, head, rows: labels.iter().map(row).collect() }))
}

/// Points that a fit may use: those above the floor.
fn above(curve: &Curve) -> impl Iterator<Item = &Point> {
    curve.points.iter().filter(|p| p.error > FLOOR)
}

/// How the error follows the sub-steps, as error ~ n^-p.
fn order(curve: &Curve) -> Option<Fit> {
    power_law(above(curve).map(|p| (f64::from(p.substeps), p.error)))
}

fn reading(p: f64) -> &'static str {
    match p {
        p if p.abs() < FLAT => "flat",
        p if p > 0.0 => "falls",
        _ => "grows",
    }
}

/// A small number with its sign, as 1.02 or −0.31.
fn exponent(value: f64) -> String {
    let text = format!("{value:.2}");
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        return "0.00".into();
    }
    text.replace('-', "−")
}

fn fits(measures: &[Measure]) -> Option<Block> {
    let mut rows = Vec::new();
    for measure in measures {
        for curve in &measure.curves {
            let by_time = power_law(above(curve).map(|p| (p.ms, p.error)));
            let by_substeps = order(curve);
            let none = || "–".to_string();
            let used = above(curve).count();
            let left_out = curve.points.len() - used;
            rows.push(vec![
                measure.quantity.clone(),
                curve.label.clone(),
                by_substeps.map_or_else(none, |f| exponent(-f.slope)),
                by_substeps.map_or_else(none, |f| format!("{:.2}", f.r2)),
                by_substeps.map_or_else(none, |f| reading(-f.slope).to_string()),
                by_time.map_or_else(none, |f| exponent(f.slope)),
                by_time.map_or_else(none, |f| format!("{:.2}", f.r2)),
                if left_out == 0 { used.to_string() } else { format!("{used}, and {left_out} at 0") },
            ]);
        }
    }
    let head = vec![
        words("error"),
        words("engine"),
        numbers("order p in sub-steps"),
        numbers("R²"),
        words("with more sub-steps it"),
        numbers("d log error / d log ms"),
        numbers("R²"),
        numbers("points"),
    ];
    let caption =
        "Fits by least squares to the logarithms: error ~ n⁻ᵖ over n sub-steps, and error against time".to_string();
    (!rows.is_empty()).then_some(Block::Table(Table { caption, head, rows }))
}

/// The points over lengths of a step.
fn lengths(measure: &Measure) -> Option<Block> {
    let mut rows = Vec::new();
    for curve in &measure.lengths {
        for p in &curve.points {
            rows.push(vec![
                curve.label.clone(),
                p.substeps.to_string(),
                step_length(p.dt),
                number(p.ms),
                number(p.ms * measure.dt / p.dt),
                error(p.error, &measure.unit),
            ]);
        }
    }
    let head = vec![
        words("engine"),
        numbers("sub-steps"),
        numbers("step"),
        numbers("ms a step"),
        numbers(format!("ms a simulated {}", step_length(measure.dt))),
        numbers(measure.quantity.clone()),
    ];
    let caption = format!("{} at other lengths of a step", measure.quantity);
    (!rows.is_empty()).then_some(Block::Table(Table { caption, head, rows }))
}

/// The order of every curve in the headline error of every case, on one sheet.
pub(super) fn orders(desk: &mut Desk, measures: &[Measure]) -> Section {
    let mut labels = Vec::<&str>::new();
    for curve in measures.iter().flat_map(|m| &m.curves) {
        if !labels.contains(&curve.label.as_str()) {
            labels.push(&curve.label);
        }
    }
    let cell = |m: &Measure, label: &str| {
        let fit = m.curves.iter().find(|c| c.label == label).and_then(order);
        fit.map_or("–".into(), |f| match reading(-f.slope) {
            "falls" => exponent(-f.slope),
            other => format!("{} ({other})", exponent(-f.slope)),
        })
    };
    let rows: Vec<Vec<String>> = measures
        .iter()
        .filter(|m| m.headline)
        .map(|m| {
            let first = [m.case.clone(), m.quantity.clone()];
            first.into_iter().chain(labels.iter().map(|l| cell(m, l))).collect()
        })
        .collect();
    let mut blocks = vec![Block::Text(format!(
        "The order p of error ~ n⁻ᵖ over n sub-steps, of each case's first error. 1 is what halves the error with twice \
         the sub-steps; within ±{FLAT} it is called flat, below that the error grows. – stands where fewer than three \
         points lie above {FLOOR:e} of the unit."
    ))];
    if rows.is_empty() || labels.is_empty() {
        blocks.push(Block::Text("No case has points to fit.".into()));
    } else {
        let mut head = vec![words("case"), words("error")];
        head.extend(labels.iter().map(|l| numbers(*l)));
        blocks.push(Block::Table(Table { caption: "Order in sub-steps".into(), head, rows }));
    }
    let equal = measures.iter().filter(|m| m.headline).all(|m| measures.first().is_some_and(|f| same_dt(f.dt, m.dt)));
    if let (true, Some(first)) = (equal, measures.first()) {
        blocks.push(Block::Text(format!("All at steps of {}.", step_length(first.dt))));
    }
    desk.section("What more sub-steps buy", blocks)
}
