//! Milliseconds a step, and the overlap that they leave, beside rapier in one run: `cargo bench --bench step`.
//!
//! Every scene first runs to rest (warm-up), then the engines take turns, so that a noisy machine harms all alike.
//! `--quick` runs one iteration of everything, as a test.

#[path = "../tests/common/rapier.rs"]
mod rapier;

use rapier::RapierWorld;
use std::time::Instant;
use tumble::prelude::*;
use tumble_core::{measures, scenes};

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

fn row(engine: &str, times: Vec<f64>, base: f64, scene: &Scene, poses: &tumble_core::Poses) {
    let overlap = measures::penetration(scene, poses);
    let ms = median(times);
    println!(
        "  {engine:<14} {ms:9.3} ms/step {:7.2} x rapier   overlap max {:8.3} mm mean {:7.4} mm",
        ms / base,
        overlap.max_m * 1e3,
        overlap.mean_m * 1e3
    );
}

fn compare(name: &str, scene: &Scene, settings: &Settings, gpu: bool) {
    let params = Params { threads: Some(settings.threads), ..Params::default() };
    let mut theirs = RapierWorld::new(scene, &params, settings.threads);
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
    let base = median(t.clone());
    row("rapier 0.36", t, base, scene, &theirs.poses());
    row("tumble cpu", o, base, scene, &ours.poses().expect("poses"));
    if let Some(world) = &mut ours_gpu {
        row("tumble gpu", g, base, scene, &world.poses().expect("poses"));
    }
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
    println!("{threads} threads, dt 1/60 s, 4 sub-steps, {} warm-up steps", settings.warm_up);
    let gpu = !has("--no-gpu");
    let (base, count) = if quick { (10, 64) } else { (100, 4096) };
    compare("pyramid", &scenes::pyramid(base), &settings, gpu);
    compare("pile", &scenes::pile(count), &settings, gpu);
    compare("balls", &scenes::balls(count), &settings, gpu);
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
