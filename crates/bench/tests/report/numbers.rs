//! What is computed from a table. Oracle: analysis, on tables whose laws are known, and a search without cleverness.

use crate::sample;
use std::collections::BTreeSet;
use tumble_bench::record::{Kind, Outcome, Record};
use tumble_bench::report::{
    Curve, FLOOR, Palette, Point, advantage, levels, measures, most_accurate, plot, plots, power_law, quickest,
    scaling, stages,
};

fn line(engine: &str, substeps: u32, seed: u64, ms: f64, value: f64) -> Record {
    let mut r = sample::line(Kind::Case, "column", engine);
    (r.substeps, r.seed, r.ms_median, r.value) = (substeps, seed, Some(ms), Some(value));
    (r.quantity, r.unit) = ("deepest overlap".into(), "m".into());
    r
}

fn curve(engine: &str, points: &[(f64, f64)]) -> Curve {
    let point = |(i, &(ms, error)): (usize, &(f64, f64))| Point {
        substeps: 1 << i,
        dt: 1.0 / 60.0,
        seeds: 1,
        ms,
        p95: None,
        error,
        low: error,
        high: error,
    };
    let points = points.iter().enumerate().map(point).collect();
    Curve { engine: engine.into(), label: engine.into(), variant: 0, points }
}

#[test]
fn fits_recover_the_law() {
    for (slope, factor) in [(-1.0, 0.012), (-2.5, 3e-9), (0.0, 4.0), (0.4, 1e3)] {
        let law = |n: u32| factor * f64::from(n).powf(slope);
        let fit = power_law([1, 2, 4, 8, 16, 32].map(|n| (f64::from(n), law(n)))).unwrap();
        // Sums of six numbers of order ten, in double precision.
        assert!((fit.slope - slope).abs() < 1e-13, "{fit:?}");
        assert!((fit.factor / factor - 1.0).abs() < 1e-12, "{fit:?}");
        assert!((fit.r2 - 1.0).abs() < 1e-12 && fit.points == 6, "{fit:?}");
    }
    // By hand: logs (0, 0), (1, 2), (2, 1) have the slope 1/2, and explain a quarter of the variance.
    let e = std::f64::consts::E;
    let fit = power_law([(1.0, 1.0), (e, e * e), (e * e, e)]).unwrap();
    assert!((fit.slope - 0.5).abs() < 1e-14 && (fit.r2 - 0.25).abs() < 1e-14, "{fit:?}");
}

#[test]
fn fits_refuse_what_has_no_slope() {
    assert_eq!(power_law([]), None);
    assert_eq!(power_law([(1.0, 1.0), (2.0, 2.0)]), None);
    assert_eq!(power_law([(3.0, 1.0), (3.0, 2.0), (3.0, 4.0)]), None);
    let odd = [(1.0, 1.0), (2.0, 0.0), (f64::NAN, 3.0), (-4.0, 1.0), (5.0, f64::INFINITY), (2.0, 2.0)];
    assert_eq!(power_law(odd), None);
    assert_eq!(power_law(odd.into_iter().chain([(4.0, 4.0)])).unwrap().points, 3);
}

#[test]
fn points_are_medians_over_seeds() {
    let mut table: Vec<Record> =
        [(1, 2.0, 0.3), (2, 9.0, 0.1), (3, 4.0, -0.2)].map(|(s, ms, v)| line("rapier", 4, s, ms, v)).into();
    table.push(line("rapier", 1, 1, 1.0, 0.0));
    table.push(line("rapier", 1, 2, 1.5, 0.5));
    let mut failed = line("rapier", 4, 4, 100.0, 100.0);
    failed.outcome = Outcome::Failed;
    table.push(failed);
    let measure = &measures(&table)[0];
    let [first, second] = &measure.curves[0].points[..] else { panic!("{measure:?}") };
    // In order of sub-steps; of two the greater.
    assert_eq!((first.substeps, first.ms, first.error, first.low), (1, 1.5, 0.5, 0.0));
    assert_eq!((second.substeps, second.ms, second.error, second.seeds), (4, 4.0, 0.2, 3));
    assert_eq!((second.low, second.high), (0.1, 0.3));
}

#[test]
fn curves_part_by_solver_and_by_broadphase_only_where_they_differ() {
    let mut table = vec![line("tumble cpu", 1, 1, 1.0, 0.1), line("tumble cpu", 1, 1, 2.0, 0.01)];
    table[1].solver = "another".into();
    table.push(line("rapier", 1, 1, 1.0, 0.1));
    table.push(line("box3d", 1, 1, 1.0, 0.1));
    table.push(line("box3d", 1, 1, 1.0, 0.1));
    (table[3].broadphase, table[4].broadphase) = ("grid".into(), "tree".into());
    // Another broad phase at another setting is the engine's own choice, not another curve.
    table.push(line("rapier", 2, 1, 1.0, 0.1));
    table[5].broadphase = "tree".into();
    // A broad phase that was asked for, beside the engine's own choice.
    table.push(line("nexus", 1, 1, 1.0, 0.1));
    table.push(line("nexus", 1, 1, 1.0, 0.1));
    (table[6].broadphase, table[7].broadphase) = ("auto".into(), "grid".into());
    let labels: Vec<String> = measures(&table)[0].curves.iter().map(|c| c.label.clone()).collect();
    let ours = ["tumble cpu, soft step", "tumble cpu, another"];
    assert_eq!(labels, [ours.as_slice(), &["rapier", "box3d, grid", "box3d, tree", "nexus", "nexus, grid"]].concat());
}

#[test]
fn headline_is_the_first_error_of_a_case() {
    let all = measures(&sample::table());
    let heads: Vec<(&str, &str)> =
        all.iter().filter(|m| m.headline).map(|m| (m.case.as_str(), m.quantity.as_str())).collect();
    assert_eq!(heads[0], ("column 20", "deepest overlap"));
    assert_eq!(heads.len(), 7);
    assert_eq!(all.iter().filter(|m| m.case == "pile 1000").count(), 3);
    // Lengths of a step, the longest first; only this case has them.
    let lengths: Vec<f64> = all[0].lengths[0].points.iter().map(|p| (1.0 / p.dt).round()).collect();
    assert_eq!(lengths, [30.0, 60.0, 120.0, 240.0]);
    assert!(all.iter().all(|m| m.lengths.is_empty() == (m.case != "column 20")));
}

#[test]
fn every_plotted_point_is_in_the_table_and_none_is_left_out() {
    let table = sample::table();
    let palette = Palette::new(table.iter().map(|r| r.engine.as_str()));
    let all = measures(&table);
    for (measure, drawing) in plots(&all) {
        let of = |r: &&Record| {
            r.kind == Kind::Case
                && r.case == measure.case
                && r.quantity == measure.quantity
                && r.outcome == Outcome::Done
        };
        let lines: Vec<&Record> = table.iter().filter(of).filter(|r| (r.dt - measure.dt).abs() < 1e-9).collect();
        let settings: BTreeSet<(&str, u32)> = lines.iter().map(|r| (r.engine.as_str(), r.substeps)).collect();
        for narrow in [false, true] {
            let (svg, drawn) = plot(&drawing, &palette, narrow).unwrap();
            assert_eq!(drawn.len(), settings.len(), "{} {}", measure.case, measure.quantity);
            for point in &drawn {
                let mut of_engine = lines.iter().filter(|r| r.engine == point.label);
                assert!(of_engine.clone().any(|r| r.ms_median == Some(point.x)), "{point:?}");
                assert!(of_engine.any(|r| r.value == Some(point.y)), "{point:?}");
                assert_eq!(point.at_foot, point.y <= FLOOR);
            }
            // In the picture: a marker each, and one a curve in the legend. An open circle is drawn as two.
            let markers = svg.matches("<circle").count() + svg.matches("<polygon").count();
            let rings = drawn.iter().filter(|d| d.at_foot && d.label == "tumble cpu").count();
            assert_eq!(markers, drawn.len() + rings + drawing.curves.len());
            // Places follow the logarithm: any two points give the scale for all.
            let above: Vec<_> = drawn.iter().filter(|d| !d.at_foot).collect();
            let by = |f: &dyn Fn(&tumble_bench::report::Drawn) -> f64| {
                let least = above.iter().min_by(|a, b| f(a).total_cmp(&f(b))).copied();
                least.zip(above.iter().max_by(|a, b| f(a).total_cmp(&f(b))).copied())
            };
            let ((l, r), (b, t)) = (by(&|d| d.x).unwrap(), by(&|d| d.y).unwrap());
            for d in &above {
                let x = (d.x / l.x).ln() / (r.x / l.x).ln();
                let y = (d.y / b.y).ln() / (t.y / b.y).ln();
                assert!((l.place.0 + x * (r.place.0 - l.place.0) - d.place.0).abs() < 1e-6, "{d:?}");
                assert!((b.place.1 + y * (t.place.1 - b.place.1) - d.place.1).abs() < 1e-6, "{d:?}");
            }
            // To the right is slower, up is worse, and the foot is below all.
            assert!(r.place.0 > l.place.0 && t.place.1 < b.place.1);
            assert!(drawn.iter().filter(|d| d.at_foot).all(|d| above.iter().all(|a| a.place.1 < d.place.1)));
        }
    }
}

#[test]
fn domination_on_cases_made_by_hand() {
    let ours = curve("tumble cpu", &[(1.0, 0.1), (2.0, 0.05), (4.0, 0.02)]);
    // Never better: at each of its points tumble is as quick and as accurate.
    assert_eq!(advantage(&curve("a", &[(1.0, 0.1), (3.0, 0.06)]), &[&ours]), None);
    // Better at 2 ms by a factor of 5, which tumble never reaches.
    let b = curve("b", &[(1.5, 0.2), (2.0, 0.01), (8.0, 0.009)]);
    let found = advantage(&b, &[&ours]).unwrap();
    assert_eq!((found.better.point.ms, found.best.unwrap().point.ms), (2.0, 2.0));
    assert!((found.error_factor.unwrap() - 5.0).abs() < 1e-12);
    assert_eq!((found.reached, found.time_factor), (None, None));
    // Quicker than anything of tumble's, which needs four times as long.
    let c = curve("c", &[(0.25, 0.1)]);
    let found = advantage(&c, &[&ours]).unwrap();
    assert_eq!((found.best, found.error_factor, found.time_factor), (None, None, Some(4.0)));
    // The other way around: tumble leads c by five at its last point.
    let found = advantage(&ours, &[&c]).unwrap();
    assert!((found.error_factor.unwrap() - 5.0).abs() < 1e-12 && found.better.point.ms == 4.0);
    // Below the floor all is the same.
    let zero = curve("zero", &[(1.0, 0.0)]);
    assert_eq!(advantage(&zero, &[&curve("tiny", &[(1.0, 1e-12)])]), None);
    assert!(advantage(&zero, &[&ours]).is_some());
    assert_eq!(advantage(&zero, &[]).unwrap().best, None);
}

/// Against a search over all pairs.
#[test]
fn domination_agrees_with_a_search_over_all_pairs() {
    for measure in &measures(&sample::table()) {
        for one in &measure.curves {
            for other in measure.curves.iter().filter(|c| *c != one) {
                let floored = |p: &Point| p.error.max(FLOOR);
                let dominates = |a: &Point, b: &Point| a.ms <= b.ms && floored(a) <= floored(b);
                let free = one.points.iter().any(|p| !other.points.iter().any(|q| dominates(q, p)));
                assert_eq!(advantage(one, &[other]).is_some(), free, "{} over {}", one.label, other.label);
            }
        }
    }
}

#[test]
fn levels_and_who_reaches_them() {
    let slow = curve("slow", &[(10.0, 2e-5), (20.0, 1e-5)]);
    let quick = curve("quick", &[(1.0, 0.9), (2.0, 0.1), (3.0, 0.15)]);
    let both = [slow, quick];
    let decades = levels(&both);
    assert_eq!(decades.len(), 6);
    assert!(decades.iter().zip([1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5]).all(|(a, b)| (a / b - 1.0).abs() < 1e-9));
    let first = |level| quickest(&both, level).map(|s| (s.curve.label.as_str(), s.point.ms));
    assert_eq!(first(1.0), Some(("quick", 1.0)));
    assert_eq!(first(0.1), Some(("quick", 2.0)));
    assert_eq!(first(1e-2), Some(("slow", 10.0)));
    assert_eq!(first(1e-6), None);
    assert_eq!(most_accurate(&both, 3.5).map(|s| s.point.ms), Some(2.0));
    assert_eq!(most_accurate(&both, 0.5), None);
    // Two decades are looked at in halves.
    let halves = levels(&[curve("a", &[(1.0, 0.9), (2.0, 0.02)])]);
    assert_eq!(halves.len(), 4);
    assert!((halves[1] / 10f64.powf(-0.5) - 1.0).abs() < 1e-12);
    assert_eq!(levels(&[]), Vec::<f64>::new());
}

#[test]
fn rate_is_floor_bytes_over_time_and_bandwidth() {
    let mut size = sample::line(Kind::Scaling, "pile", "tumble gpu");
    (size.bodies, size.ms_median) = (1_000_000, Some(2.0));
    let mut floor = size.clone();
    // The bytes may be on a line of their own.
    (floor.ms_median, floor.quantity, floor.value) = (None, "floor bytes".into(), Some(160e6));
    let mut device = sample::line(Kind::Device, "a card", "tumble gpu");
    (device.quantity, device.value) = ("copy bandwidth".into(), Some(800.0));
    let point = scaling(&[size.clone(), floor.clone(), device.clone()])[0].points[0].clone();
    // 160 MB in 2 ms are 80 GB/s, a tenth of 800.
    assert_eq!((point.bodies, point.ms, point.floor_bytes), (1_000_000, 2.0, Some(160e6)));
    assert!((point.bandwidth_share.unwrap() - 0.1).abs() < 1e-12);
    // Another adapter's bandwidth is not this one's.
    (device.adapter, device.engine) = ("another card".into(), "tool".into());
    assert_eq!(scaling(&[size, floor, device])[0].points[0].bandwidth_share, None);
}

#[test]
fn what_no_timer_covered_is_the_rest_of_the_step() {
    let stage = |name: &str, ms: f64| {
        let mut r = sample::line(Kind::Stage, "pile", "tumble cpu");
        (r.bodies, r.stage, r.ms_median) = (1000, name.into(), Some(ms));
        r
    };
    let mut table = vec![stage("solver", 3.0), stage("bounds", 1.0)];
    assert_eq!(stages(&table)[0].rest(), None);
    let mut whole = sample::line(Kind::Scaling, "pile", "tumble cpu");
    (whole.bodies, whole.ms_median) = (1000, Some(5.0));
    table.push(whole);
    let found = stages(&table);
    assert_eq!((found.len(), found[0].timed(), found[0].rest()), (1, 4.0, Some(1.0)));
    assert_eq!(found[0].stages[0].0, "solver", "in the table's order");
    // A line of its own says it better.
    table.push(stage("step", 4.5));
    assert_eq!((stages(&table)[0].rest(), stages(&table)[0].stages.len()), (Some(0.5), 2));
}
