//! Time against bodies, time by stage, and the rate of the device.

use super::{Desk, listed};
use crate::record::Kind;
use crate::report::document::{Block, Column, Section, Table, numbers, words};
use crate::report::fit::power_law;
use crate::report::plot::{Bar, NARROW, Plot, PlotCurve, PlotPoint, WIDE, bars};
use crate::report::scaling::{ScalingCurve, Stages};
use crate::report::text::{count, number, tick_count};

fn plot_of(case: &str, curves: &[&ScalingCurve]) -> Plot {
    let curve = |c: &&ScalingCurve| PlotCurve {
        engine: c.engine.clone(),
        label: c.label.clone(),
        variant: c.variant,
        points: c
            .points
            .iter()
            .map(|p| PlotPoint {
                x: f64::from(p.bodies),
                y: p.ms,
                x_high: None,
                y_range: p.p95.map(|p95| (p.ms, p95)),
                tag: None,
            })
            .collect(),
    };
    Plot {
        title: format!("{case}: time against bodies"),
        x_title: "bodies".into(),
        y_title: "time a step, ms".into(),
        y_unit: String::new(),
        x_counts: true,
        floor: 0.0,
        curves: curves.iter().map(curve).collect(),
    }
}

fn by_case(curves: &[ScalingCurve]) -> Vec<(&str, Vec<&ScalingCurve>)> {
    curves.chunk_by(|a, b| a.case == b.case).map(|c| (c[0].case.as_str(), c.iter().collect())).collect()
}

pub(super) fn scaling_section(desk: &mut Desk, curves: &[ScalingCurve]) -> Result<Section, String> {
    let mut blocks = Vec::new();
    let mut figures = Vec::new();
    for (case, of_case) in by_case(curves) {
        figures.push(desk.log_figure(&format!("bodies {case}"), &plot_of(case, &of_case))?);
    }
    if figures.is_empty() {
        blocks.push(Block::Text("No time against bodies was measured.".into()));
    } else {
        blocks.push(Block::Figures(figures));
        let row = |c: &ScalingCurve| {
            let fit = power_law(c.points.iter().map(|p| (f64::from(p.bodies), p.ms)));
            let (first, last) = (c.points.first().map_or(0, |p| p.bodies), c.points.last().map_or(0, |p| p.bodies));
            vec![
                c.case.clone(),
                c.label.clone(),
                format!("{} to {}", count(u64::from(first)), count(u64::from(last))),
                fit.map_or("–".into(), |f| format!("{:.2}", f.slope)),
                fit.map_or("–".into(), |f| format!("{:.3}", f.r2)),
            ]
        };
        let head = vec![words("scene"), words("engine"), numbers("bodies"), numbers("exponent"), numbers("R²")];
        blocks.push(Block::Table(Table {
            caption: "ms ~ bodies to the exponent, by least squares to the logarithms; 1 is time in proportion".into(),
            head,
            rows: curves.iter().map(row).collect(),
        }));
    }
    for (case, of_case) in by_case(curves) {
        let mut sizes: Vec<u32> = of_case.iter().flat_map(|c| c.points.iter().map(|p| p.bodies)).collect();
        sizes.sort_unstable();
        sizes.dedup();
        let mut head = vec![numbers("bodies")];
        head.extend(of_case.iter().map(|c| numbers(c.label.clone())));
        let cell = |c: &ScalingCurve, bodies: u32| {
            c.points.iter().find(|p| p.bodies == bodies).map_or("–".into(), |p| number(p.ms))
        };
        let row = |bodies: u32| {
            std::iter::once(count(u64::from(bodies))).chain(of_case.iter().map(|c| cell(c, bodies))).collect()
        };
        blocks.push(Block::Table(Table {
            caption: format!("{case}: median ms a step"),
            head,
            rows: sizes.into_iter().map(row).collect(),
        }));
    }
    Ok(desk.section("Time against bodies", blocks))
}

fn title(s: &Stages) -> String {
    format!("{}, {} bodies", s.label, count(u64::from(s.bodies)))
}

/// All stages of a scene's steps, in the order of the first step that has them.
fn order(all: &[&Stages]) -> Vec<String> {
    let mut names = Vec::<String>::new();
    for (name, _) in all.iter().flat_map(|s| &s.stages) {
        if !names.contains(name) {
            names.push(name.clone());
        }
    }
    names
}

pub(super) fn stage_section(desk: &mut Desk, stages: &[Stages]) -> Result<Section, String> {
    let mut blocks = Vec::new();
    if stages.is_empty() {
        blocks.push(Block::Text("No time by stage was measured.".into()));
    }
    let mut cases = Vec::<&str>::new();
    for s in stages {
        if !cases.contains(&s.case.as_str()) {
            cases.push(&s.case);
        }
    }
    let (mut figures, mut tables) = (Vec::new(), Vec::new());
    for case in cases {
        let here: Vec<&Stages> = stages.iter().filter(|s| s.case == case).collect();
        let names = order(&here);
        let (timed, untimed): (Vec<&Stages>, Vec<&Stages>) = here.iter().partition(|s| s.timed() > 0.0);
        if !timed.is_empty() {
            let bar = |s: &&Stages| {
                let whole = s.timed() + s.rest().unwrap_or(0.0);
                let place = |name: &str| names.iter().position(|n| n == name).unwrap_or(0);
                let mut parts: Vec<(usize, f64)> =
                    s.stages.iter().filter_map(|(name, ms)| Some((place(name), (*ms)? / whole))).collect();
                parts.extend(s.rest().filter(|ms| *ms > 0.0).map(|ms| (names.len(), ms / whole)));
                let step = s.step.map_or("step not timed".into(), |ms| format!("{} ms", number(ms)));
                Bar { title: format!("{}, {} bodies: {step}", s.label, tick_count(f64::from(s.bodies))), parts }
            };
            let drawn: Vec<Bar> = timed.iter().map(bar).collect();
            let heading = format!("{case}: time by stage");
            let wide = bars(&heading, &drawn, &names, WIDE)?;
            let narrow = bars(&heading, &drawn, &names, NARROW)?;
            let alt = format!("{heading}, as shares of {}.", listed(timed.iter().map(|s| title(s))));
            figures.push(desk.figure(&format!("stages {case}"), alt, wide, narrow));
            tables.push(Block::Table(table(case, &names, &timed)));
        }
        if !untimed.is_empty() {
            tables.push(Block::Text(format!(
                "{case}: the table has no time of any stage of {}. An adapter without timestamps gives none.",
                listed(untimed.iter().map(|s| title(s)))
            )));
        }
    }
    if !figures.is_empty() {
        blocks.push(Block::Text(
            "Each bar is one step. Not timed is what the median step takes beyond the sum of its stages' medians: \
             submission, waiting, read-back, and what lies between two stages."
                .into(),
        ));
        blocks.push(Block::Figures(figures));
    }
    blocks.append(&mut tables);
    Ok(desk.section("Time by stage", blocks))
}

fn table(case: &str, names: &[String], steps: &[&Stages]) -> Table {
    let head: Vec<Column> =
        [words("stage")].into_iter().chain(steps.iter().map(|s| numbers(title(s) + ", ms"))).collect();
    let with_share = |ms: Option<f64>, s: &Stages| match (ms, s.step) {
        (None, _) => "n/a".to_string(),
        (Some(ms), Some(step)) => format!("{} ({:.1} %)", number(ms), 100.0 * ms / step),
        (Some(ms), None) => number(ms),
    };
    let row = |i: usize, name: &String| {
        let time = |s: &Stages| s.stages.iter().find(|(n, _)| n == name).map(|(_, ms)| *ms);
        let cells = steps.iter().map(|s| time(s).map_or("–".into(), |ms| with_share(ms, s)));
        std::iter::once(format!("{} {name}", i + 1)).chain(cells).collect::<Vec<_>>()
    };
    let mut rows: Vec<Vec<String>> = names.iter().enumerate().map(|(i, name)| row(i, name)).collect();
    let whole = |name: &str, time: &dyn Fn(&Stages) -> Option<f64>| {
        let cells = steps.iter().map(|s| time(s).map_or("–".into(), |ms| with_share(Some(ms), s)));
        std::iter::once(name.to_string()).chain(cells).collect::<Vec<_>>()
    };
    rows.push(whole("not timed", &|s| s.rest()));
    rows.push(whole("step", &|s| s.step));
    Table { caption: format!("{case}: median ms by stage, and share of the median step"), head, rows }
}

pub(super) fn rate_section(desk: &mut Desk, curves: &[ScalingCurve]) -> Section {
    let mut blocks = vec![Block::Text(
        "Floor bytes are what any solver must move once in and once out in a step. Divided by the time of a step they are \
         a rate; the share is that rate over what the device copies in a second. A step that only moved those bytes would \
         have 100 %."
            .into(),
    )];
    let mut rows = Vec::new();
    for curve in curves {
        for point in &curve.points {
            let Some(bytes) = point.floor_bytes else { continue };
            rows.push(vec![
                curve.case.clone(),
                curve.label.clone(),
                count(u64::from(point.bodies)),
                number(bytes / 1e6),
                number(bytes / f64::from(point.bodies)),
                number(point.ms),
                number(bytes / (point.ms * 1e-3) / 1e9),
                point.bandwidth_share.map_or("n/a".into(), |s| format!("{} %", number(100.0 * s))),
            ]);
        }
    }
    let devices: Vec<Vec<String>> = desk
        .records
        .iter()
        .filter(|r| r.kind == Kind::Device)
        .map(|r| {
            let value = r.value.filter(|v| v.is_finite());
            let unit = if r.unit == "1" { "" } else { &r.unit };
            let device = [&r.case, &r.adapter].into_iter().find(|t| !t.is_empty()).cloned().unwrap_or_default();
            vec![
                device,
                r.engine.clone(),
                r.quantity.clone(),
                value.map_or("n/a".into(), |v| format!("{} {unit}", number(v)).trim().to_string()),
            ]
        })
        .collect();
    if devices.is_empty() {
        blocks.push(Block::Text("No copy bandwidth of a device was measured, so no share can be given.".into()));
    } else {
        let head = vec![words("device"), words("measured through"), words("what"), numbers("value")];
        blocks.push(Block::Table(Table { caption: "Devices".into(), head, rows: devices }));
    }
    if rows.is_empty() {
        blocks.push(Block::Text("No line has floor bytes.".into()));
    } else {
        let head = vec![
            words("scene"),
            words("engine"),
            numbers("bodies"),
            numbers("floor, MB"),
            numbers("B a body"),
            numbers("ms"),
            numbers("GB/s"),
            numbers("of copy bandwidth"),
        ];
        blocks.push(Block::Table(Table { caption: "Rate of a step".into(), head, rows }));
    }
    desk.section("How near to the device's bandwidth", blocks)
}
