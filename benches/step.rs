//! Milliseconds a step, and the overlap that they leave, beside rapier in one run: `cargo bench --bench step`.
//!
//! Every scene first runs to rest (warm-up), then the engines take turns, so that a noisy machine harms all alike.
//! `--quick` runs one iteration of everything, as a test; `--out DIR` writes `step.csv` and a picture, `step.svg`;
//! `--profile` adds the CPU side's time by stage.

use std::time::Instant;
use tumble::prelude::*;
use tumble_bench::engines::RapierWorld;
use tumble_core::{Accuracy, Penetration, measures, scenes};

struct Settings {
    warm_up: usize,
    rounds: usize,
    steps_a_round: usize,
    threads: usize,
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn timed(times: &mut Vec<f64>, count: usize, mut step: impl FnMut()) {
    for _ in 0..count {
        let begin = Instant::now();
        step();
        times.push(begin.elapsed().as_secs_f64() * 1e3);
    }
}

/// One engine on one scene.
struct Row {
    scene: String,
    engine: &'static str,
    /// Median, ms a step.
    ms: f64,
    /// Over rapier's in the same run.
    ratio: f64,
    overlap: Penetration,
}

impl Row {
    fn new(name: &str, engine: &'static str, ms: f64, base: f64, scene: &Scene, poses: &Poses) -> Self {
        let overlap = measures::penetration(scene, poses);
        let row = Self { scene: name.into(), engine, ms, ratio: ms / base, overlap };
        println!(
            "  {engine:<14} {ms:9.3} ms/step {:7.2} x rapier   overlap max {:8.3} mm mean {:7.4} mm",
            row.ratio,
            overlap.max_m * 1e3,
            overlap.mean_m * 1e3
        );
        row
    }
}

/// rapier's default.
const RAPIER_SUBSTEPS: u32 = 4;

/// Each engine with its own default number of sub-steps.
fn compare(name: &str, scene: &Scene, settings: &Settings, gpu: bool) -> Vec<Row> {
    let params = Params { threads: Some(settings.threads), ..Params::default() };
    let usual = Params { accuracy: Accuracy::Substeps(RAPIER_SUBSTEPS), ..params };
    let mut theirs = RapierWorld::new(scene, &usual, settings.threads);
    let mut ours = tumble::cpu::World::new(scene.clone(), params).expect("the scene is valid");
    let mut ours_gpu = gpu.then(|| World::new(scene.clone(), params, Backend::Gpu).expect("an adapter"));
    for _ in 0..settings.warm_up {
        theirs.step();
        ours.step().expect("step");
        if let Some(world) = &mut ours_gpu {
            world.step().expect("step");
        }
    }
    let (mut t, mut o, mut g) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..settings.rounds {
        timed(&mut t, settings.steps_a_round, || theirs.step());
        timed(&mut o, settings.steps_a_round, || ours.step().expect("step"));
        if let Some(world) = &mut ours_gpu {
            timed(&mut g, settings.steps_a_round, || {
                world.step().expect("step");
                world.sync().expect("sync");
            });
        }
    }
    let report = ours.sync().expect("report");
    println!("{name}: {} bodies, {} contacts, {} batches", report.bodies, report.contacts, report.batches);
    let base = median(t);
    let mut rows = vec![Row::new(name, "rapier 0.36", base, base, scene, &theirs.poses())];
    rows.push(Row::new(name, "tumble cpu", median(o), base, scene, &ours.poses().expect("poses")));
    if let Some(world) = &mut ours_gpu {
        let adapter = world.sync().expect("report").adapter;
        println!("  on {adapter}");
        rows.push(Row::new(name, "tumble gpu", median(g), base, scene, &world.poses().expect("poses")));
    }
    rows
}

fn csv(rows: &[Row]) -> String {
    let mut text = String::from("scene,engine,ms_per_step,ratio_to_rapier,overlap_max_mm,overlap_mean_mm\n");
    for r in rows {
        let (max, mean) = (r.overlap.max_m * 1e3, r.overlap.mean_m * 1e3);
        text += &format!("{},{},{:.4},{:.4},{max:.4},{mean:.4}\n", r.scene, r.engine, r.ms, r.ratio);
    }
    text
}

/// Bars of ms a step, a row each.
fn svg(rows: &[Row]) -> String {
    let most = rows.iter().map(|r| r.ms).fold(0.0, f64::max);
    let height = 22 * rows.len() + 40;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"760\" height=\"{height}\" font-family=\"sans-serif\" \
         font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"10\" y=\"20\" font-weight=\"bold\">Milliseconds a step, and mean overlap left</text>\n"
    );
    for (i, r) in rows.iter().enumerate() {
        let (y, width) = (36 + 22 * i, 360.0 * r.ms / most);
        let color = match r.engine {
            "tumble cpu" => "#2b7bba",
            "tumble gpu" => "#7bbf6a",
            _ => "#b0b0b0",
        };
        text += &format!(
            "<text x=\"10\" y=\"{}\">{}, {}</text>\n<rect x=\"210\" y=\"{y}\" width=\"{width:.1}\" height=\"16\" \
             fill=\"{color}\"/>\n<text x=\"{:.1}\" y=\"{}\">{:.2} ms, {:.2} mm</text>\n",
            y + 13,
            r.scene,
            r.engine,
            216.0 + width,
            y + 13,
            r.ms,
            r.overlap.mean_m * 1e3
        );
    }
    text + "</svg>\n"
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let has = |flag: &str| arguments.iter().any(|a| a == flag);
    let quick = has("--quick");
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let settings = if quick {
        Settings { warm_up: 1, rounds: 1, steps_a_round: 1, threads }
    } else {
        Settings { warm_up: 120, rounds: 12, steps_a_round: 10, threads }
    };
    let ours = Params::default().accuracy;
    println!(
        "{threads} threads, dt 1/60 s, sub-steps: rapier {RAPIER_SUBSTEPS}, tumble {ours}; {} warm-up steps",
        settings.warm_up
    );
    let gpu = !has("--no-gpu");
    let (base, count) = if quick { (10, 64) } else { (100, 4096) };
    let mut rows = compare("pyramid", &scenes::pyramid(base), &settings, gpu);
    rows.extend(compare("pile", &scenes::pile(count), &settings, gpu));
    rows.extend(compare("balls", &scenes::balls(count), &settings, gpu));
    let walls = if quick { 2 } else { 196 };
    rows.extend(compare("many_pyramids", &scenes::many_pyramids(walls, 10), &settings, gpu));
    if let Some(at) = arguments.iter().position(|a| a == "--out") {
        let folder = arguments.get(at + 1).expect("--out wants a folder");
        std::fs::create_dir_all(folder).expect("the folder can be made");
        std::fs::write(format!("{folder}/step.csv"), csv(&rows)).expect("step.csv can be written");
        std::fs::write(format!("{folder}/step.svg"), svg(&rows)).expect("step.svg can be written");
    }
    if has("--profile") {
        let params = Params { threads: Some(threads), profile: true, ..Params::default() };
        for (name, scene) in [("pyramid", scenes::pyramid(base)), ("pile", scenes::pile(count))] {
            let mut world = tumble::cpu::World::new(scene, params).expect("the scene is valid");
            for _ in 0..settings.warm_up {
                world.step().expect("step");
            }
            println!("{name}:");
            for stage in world.sync().expect("report").stages {
                println!("  {:<12} {:8.3} ms", stage.stage, stage.milliseconds.unwrap_or(f64::NAN));
            }
        }
    }
}
