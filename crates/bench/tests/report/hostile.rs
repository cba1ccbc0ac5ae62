//! Tables that no run should leave. Oracle: no panic, XML that parses, and a report that says what is missing.

use crate::sample;
use std::path::Path;
use tumble_bench::record::{Kind, Outcome, Record};
use tumble_bench::report;

const NAMES: [&str; 6] = [
    "<script>alert(1)</script>",
    "a | b \\| c",
    "\"quoted' & <b>bold",
    "Ünïcode 山 🎲 \u{202e}",
    "{{body}} [x](http://example.com) *y* _z_ `q`",
    "a\nnew\tline\u{0}\u{7}",
];

/// Every name in every text column.
pub(crate) fn records() -> Vec<Record> {
    let mut out = Vec::new();
    for name in NAMES {
        for kind in [Kind::Case, Kind::Scaling, Kind::Stage, Kind::Device, Kind::Engine] {
            for (n, engine) in [(1, "tumble cpu"), (2, "rapier"), (4, name), (8, name)] {
                let mut r = sample::line(kind, name, engine);
                (r.substeps, r.bodies) = (n, 1000 * n);
                (r.ms_median, r.value) = (Some(f64::from(n)), Some(0.1 / f64::from(n)));
                (r.quantity, r.unit, r.stage) = (name.into(), name.into(), name.into());
                (r.note, r.machine, r.commit, r.date) = (name.into(), name.into(), name.into(), name.into());
                (r.version, r.adapter, r.solver, r.broadphase) = (name.into(), name.into(), name.into(), name.into());
                out.push(r);
            }
        }
    }
    let mut failed = out[0].clone();
    failed.outcome = Outcome::Failed;
    out.push(failed);
    let long = "a very long name that goes on ".repeat(20);
    let mut r = sample::line(Kind::Case, &long, &long);
    (r.ms_median, r.value, r.quantity, r.unit) = (Some(1.0), Some(1.0), long.clone(), "m".into());
    out.push(r);
    out
}

/// Markdown and HTML.
fn texts(records: &[Record]) -> (String, String) {
    let folder = tempfile::tempdir().unwrap();
    let paths = report::write(records, folder.path(), "speed_vs_error").unwrap();
    let read = |end: &str| {
        let path: &Path = paths.iter().find(|p| p.to_string_lossy().ends_with(end)).unwrap();
        std::fs::read_to_string(path).unwrap()
    };
    (read(".md"), read(".html"))
}

#[test]
fn no_records() {
    let (md, html) = texts(&[]);
    for text in [&md, &html] {
        for said in ["nothing was measured", "nothing can be compared", "no line of a case", "No time by stage"] {
            assert!(text.contains(said), "{said:?} is missing");
        }
    }
}

#[test]
fn one_record() {
    let mut r = sample::line(Kind::Case, "column 20", "tumble cpu");
    (r.ms_median, r.value, r.quantity, r.unit) = (Some(1.5), Some(0.012), "deepest overlap".into(), "m".into());
    let (md, html) = texts(&[r]);
    for text in [&md, &html] {
        assert!(text.contains("no other engine has a value: column 20"));
        assert!(text.contains("12.0 mm"));
    }
}

#[test]
fn only_failures() {
    let records: Vec<Record> = [Outcome::Slow, Outcome::Unmodelled, Outcome::Failed]
        .into_iter()
        .map(|outcome| {
            let mut r = sample::line(Kind::Case, "column 20", "rapier");
            (r.outcome, r.quantity, r.unit) = (outcome, "deepest overlap".into(), "m".into());
            r.note = format!("why {outcome:?}");
            r
        })
        .collect();
    let (md, _) = texts(&records);
    assert!(md.contains("No engine has a value of: deepest overlap"));
    for why in ["why Slow", "why Unmodelled", "why Failed"] {
        assert!(md.contains(why));
    }
    assert!(!md.contains("!["), "there is nothing to draw");
}

#[test]
fn numbers_that_are_none() {
    let odd = [
        (Some(f64::NAN), Some(1.0), "a time of NaN ms"),
        (Some(f64::INFINITY), Some(1.0), "a time of inf ms"),
        (Some(0.0), Some(1.0), "a time of 0 ms"),
        (Some(-2.0), Some(1.0), "a time of -2 ms"),
        (Some(1.0), Some(f64::NAN), "the value is NaN"),
        (Some(1.0), Some(f64::NEG_INFINITY), "the value is -inf"),
        (Some(1.0), None, "no value"),
        (None, Some(1.0), "no time"),
    ];
    let record = |ms, value| {
        let mut r = sample::line(Kind::Case, "column 20", "rapier");
        (r.ms_median, r.ms_p95, r.value) = (ms, ms, value);
        (r.quantity, r.unit) = ("deepest overlap".into(), "m".into());
        r
    };
    let mut records: Vec<Record> = odd.iter().map(|(ms, value, _)| record(*ms, *value)).collect();
    assert!(report::measures(&records)[0].curves.is_empty());
    // Ends of what a double holds, and signs, can be drawn.
    for value in [f64::MIN_POSITIVE, 5e-324, f64::MAX, -0.25, 0.0] {
        records.push(record(Some(2.0), Some(value)));
    }
    records.push(record(Some(f64::MAX), Some(1.0)));
    records.push(record(Some(5e-324), Some(1.0)));
    let rates = [(Kind::Scaling, 0), (Kind::Scaling, u32::MAX), (Kind::Stage, 5), (Kind::Device, 0)];
    for (kind, bodies) in rates {
        for value in [0.0, -1.0, f64::NAN, f64::MAX] {
            let mut r = record(Some(value), Some(value));
            (r.kind, r.bodies, r.dt, r.stage) = (kind, bodies, value, "solver".into());
            r.quantity = if kind == Kind::Device { "copy bandwidth".into() } else { "floor bytes".into() };
            records.push(r);
        }
    }
    let (md, _) = texts(&records);
    for (_, _, why) in odd {
        assert!(md.contains(why), "{why:?} is missing");
    }
}

#[test]
fn hostile_names_are_escaped() {
    let (md, html) = texts(&records());
    for raw in ["<script", "<b>", "javascript:"] {
        assert!(!html.contains(raw), "{raw} reached the page");
        assert!(!md.contains(raw), "{raw} reached the Markdown");
    }
    assert!(html.contains("&lt;script&gt;alert(1)&lt;/script&gt;"));
    assert!(html.contains("{{body}}"), "a name is not a part of the page's frame");
    assert!(!md.contains("[x](http"), "a name is no link");
    // Each row of a Markdown table has as many cells as its head.
    let cells = |line: &str| line.replace("\\\\", "").replace("\\|", "").matches('|').count();
    let lines: Vec<&str> = md.lines().collect();
    for pair in lines.windows(2).filter(|p| p.iter().all(|l| l.starts_with('|'))) {
        assert_eq!(cells(pair[0]), cells(pair[1]), "{}\n{}", pair[0], pair[1]);
    }
}

#[test]
fn a_name_that_is_a_path_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["", "../x", "a b", "ü"] {
        let error = report::write(&[], folder.path(), name).unwrap_err();
        assert!(error.contains("letters, digits"), "{error}");
    }
}
