//! What each way of batching takes and leaves: `cargo bench --bench batch`.
//!
//! Standard scenes after 60 steps, on both sides: batches, rounds, constraints in the last batch, milliseconds of the
//! stages `batch` and `solver`, dispatches a step. All worlds of a scene and a side live at once and step by turns, so
//! that a noisy machine harms all alike; times are lower quartiles, and told as ratios to the default's too.
//! `persistent, unfused` gives every batch a dispatch of its own. Beside them the scheme of the talk as it was, with
//! timing played by random numbers; see `raw.rs`. Then what the order of the batches does to the errors of a few cases
//! of `speed_vs_error`, on the CPU.
//!
//! `--quick` runs one small iteration of everything, as a test; `--only TEXT` takes the scenes and cases whose name
//! holds the text; `--no-gpu` leaves out the GPU; `--csv FILE` writes the table.

mod raw;

use std::fmt::Write;
use tumble::{Accuracy, Batching, OnePass, Params, Scene, Soft, Solver, World, cpu, gpu};
use tumble_bench::cases;
use tumble_bench::run::quantile;
use tumble_core::scenes;

/// A way of batching.
#[derive(Clone, Copy, PartialEq)]
struct Way {
    batching: Batching,
    static_last: bool,
    /// Whether small late batches share a dispatch.
    fused: bool,
}

const FUSED: Way = Way { batching: Batching::Persistent, static_last: false, fused: true };
const WAYS: [Way; 7] = [
    FUSED,
    Way { fused: false, ..FUSED },
    Way { static_last: true, ..FUSED },
    Way { batching: Batching::LowestFree, ..FUSED },
    Way { batching: Batching::LowestFree, static_last: true, ..FUSED },
    Way { batching: Batching::WriteAndVerify, ..FUSED },
    Way { batching: Batching::WriteAndVerify, static_last: true, ..FUSED },
];
/// Cases that tell what the order does to errors.
const CASES: [&str; 4] = ["column 20", "ratio 100", "pyramid 20", "pile 1000"];

impl Way {
    fn name(&self) -> String {
        let last = if self.static_last { ", static last" } else { "" };
        let fused = if self.fused { "" } else { ", unfused" };
        format!("{}{last}{fused}", self.batching)
    }

    fn params(&self) -> Params {
        Params { batching: self.batching, static_contacts_last: self.static_last, ..Params::default() }
    }
}

/// A line of the table.
struct Row {
    /// Scene or case.
    case: String,
    side: &'static str,
    way: String,
    quantity: String,
    unit: &'static str,
    value: f64,
}

/// Rows that share scene, side and way.
fn rows(case: &str, side: &'static str, way: &str, values: &[(&str, &'static str, f64)]) -> Vec<Row> {
    let row = |&(quantity, unit, value): &(&str, &'static str, f64)| {
        let (case, way, quantity) = (case.to_owned(), way.to_owned(), quantity.to_owned());
        Row { case, side, way, quantity, unit, value }
    };
    values.iter().map(row).collect()
}

/// A quarter of all steps took less: other processes make times longer, never shorter.
fn lower_quartile(times: &[f64]) -> f64 {
    quantile(times, 0.25).unwrap_or(f64::NAN)
}

struct Lane {
    way: Way,
    world: World,
    steps: f64,
    batches: f64,
    rounds: f64,
    last: f64,
    constraints: f64,
    dispatches: f64,
    batch_ms: Vec<f64>,
    solver_ms: Vec<f64>,
}

impl Lane {
    fn new(way: Way, world: World) -> Self {
        let (batch_ms, solver_ms) = (Vec::new(), Vec::new());
        let [steps, batches, rounds, last, constraints, dispatches] = [0.0; 6];
        Self { way, world, steps, batches, rounds, last, constraints, dispatches, batch_ms, solver_ms }
    }

    fn step(&mut self, measured: bool) {
        self.world.step().expect("step");
        let report = self.world.sync().expect("report");
        if !measured {
            return;
        }
        self.steps += 1.0;
        self.batches += f64::from(report.batches);
        self.rounds += f64::from(report.batch_rounds);
        self.last += f64::from(report.last_batch);
        self.constraints += f64::from(report.manifolds);
        if let World::Gpu(world) = &self.world {
            self.dispatches += f64::from(world.dispatches());
        }
        for stage in report.stages {
            match stage.stage {
                "batch" => self.batch_ms.extend(stage.milliseconds),
                "solver" => self.solver_ms.extend(stage.milliseconds),
                _ => {}
            }
        }
    }
}

struct Settings {
    warm_up: usize,
    rounds: usize,
    steps_a_round: usize,
}

fn compare(name: &str, scene: &Scene, device: Option<&gpu::Gpu>, settings: &Settings) -> Vec<Row> {
    let side = if device.is_some() { "gpu" } else { "cpu" };
    let start = |way: &Way| {
        let params = Params { profile: true, ..way.params() };
        let world = match device {
            Some(device) => {
                let world = gpu::World::with_gpu(device.clone(), scene.clone(), params);
                let mut world = world.expect("the scene is valid");
                if !way.fused {
                    world.fuse_below(1);
                }
                World::Gpu(Box::new(world))
            }
            None => World::Cpu(Box::new(cpu::World::new(scene.clone(), params).expect("the scene is valid"))),
        };
        Lane::new(*way, world)
    };
    // Without dispatches there is nothing to fuse.
    let mut lanes: Vec<_> = WAYS.iter().filter(|way| way.fused || device.is_some()).map(start).collect();
    for lane in &mut lanes {
        (0..settings.warm_up).for_each(|_| lane.step(false));
    }
    let count = lanes.len();
    for round in 0..settings.rounds {
        for i in 0..count {
            // Nobody comes first every time.
            let lane = &mut lanes[(i + round) % count];
            (0..settings.steps_a_round).for_each(|_| lane.step(true));
        }
    }
    println!("{name}, {side}:");
    println!(
        "  {:<30} {:>7} {:>7} {:>5} {:>12} {:>11} {:>9} {:>7} {:>10} {:>7}",
        "way", "batches", "rounds", "last", "constraints", "dispatches", "batch ms", "ratio", "solver ms", "ratio"
    );
    let mut base = None;
    let mut all = Vec::new();
    for lane in lanes {
        let mean = |sum: f64| sum / lane.steps;
        let (batch, solver) = (lower_quartile(&lane.batch_ms), lower_quartile(&lane.solver_ms));
        let (batch_base, solver_base) = *base.get_or_insert((batch, solver));
        let values = [
            ("batches", "1", mean(lane.batches)),
            ("rounds", "1", mean(lane.rounds)),
            ("last batch", "constraints", mean(lane.last)),
            ("constraints", "1", mean(lane.constraints)),
            ("dispatches", "1", mean(lane.dispatches)),
            ("stage batch", "ms", batch),
            ("stage batch to default", "ratio", batch / batch_base),
            ("stage solver", "ms", solver),
            ("stage solver to default", "ratio", solver / solver_base),
        ];
        let v = values.map(|(_, _, value)| value);
        println!(
            "  {:<30} {:7.1} {:7.1} {:5.0} {:12.0} {:11.0} {:9.3} {:7.2} {:10.3} {:7.2}",
            lane.way.name(),
            v[0],
            v[1],
            v[2],
            v[3],
            v[4],
            v[5],
            v[6],
            v[7],
            v[8]
        );
        all.extend(rows(name, side, &lane.way.name(), &values));
    }
    all
}

/// The talk's scheme on the constraints that the scene has after the warm-up.
fn raw(name: &str, scene: &Scene, settings: &Settings) -> Vec<Row> {
    let mut world = cpu::World::new(scene.clone(), Params::default()).expect("the scene is valid");
    (0..settings.warm_up).for_each(|_| world.step().expect("step"));
    let graph = raw::Graph::of(&mut world);
    let all: Vec<_> = (0..10).map(|seed| graph.batch(seed)).collect();
    let range = |of: fn(&raw::Batched) -> usize| {
        let values = all.iter().map(of);
        (values.clone().min().unwrap_or(0), values.max().unwrap_or(0))
    };
    let (batches, rounds) = (range(|b| b.batches), range(|b| b.rounds));
    let moved = raw::share_elsewhere(&all);
    println!("{name}, the talk's scheme, 10 runs on the same {} constraints:", graph.len());
    println!(
        "  {} to {} batches in {} to {} rounds; {:.0} % of the constraints are in another batch in the next run",
        batches.0,
        batches.1,
        rounds.0,
        rounds.1,
        100.0 * moved
    );
    let values = [
        ("fewest batches", "1", batches.0 as f64),
        ("most batches", "1", batches.1 as f64),
        ("fewest rounds", "1", rounds.0 as f64),
        ("most rounds", "1", rounds.1 as f64),
        ("in another batch in the next run", "ratio", moved),
    ];
    rows(name, "simulated", "last writer wins", &values)
}

/// What a way leaves of a case, on the CPU.
fn errors(case: &cases::Case, solver: Solver, substeps: u32, quick: bool) -> Vec<Row> {
    let params = Params { solver, accuracy: Accuracy::Substeps(substeps), ..Params::default() };
    let name = format!("{}, {solver}, {substeps} sub-steps", case.name);
    let steps = if quick { 2 } else { (case.seconds / f64::from(params.dt)).round() as usize };
    println!("{name}, cpu, errors after {steps} steps, mean of {} seeds:", case.seeds);
    let mut all = Vec::new();
    for way in WAYS.iter().filter(|way| way.fused) {
        // Of the seeds, where chaos makes one run say little: the mean.
        let mut values: Vec<_> = case.errors.iter().map(|error| (error.name, error.unit, 0.0)).collect();
        let mut fell = false;
        for seed in 0..case.seeds {
            let scene = (case.scene)(seed);
            let params = Params { solver, accuracy: Accuracy::Substeps(substeps), ..way.params() };
            let mut world = cpu::World::new(scene.clone(), params).expect("the scene is valid");
            (0..steps).for_each(|_| world.step().expect("step"));
            let poses = world.poses().expect("poses");
            let velocities = world.velocities().expect("velocities");
            let (scene, seconds) = (&scene, steps as f64 * f64::from(params.dt));
            let run = cases::Run { scene, poses: &poses, velocities: &velocities, track: &[], seconds };
            fell |= (case.fell)(&run);
            for (value, error) in values.iter_mut().zip(case.errors) {
                value.2 += (error.of)(&run) / case.seeds as f64;
            }
        }
        let mut told = String::new();
        for (name, unit, value) in &values {
            write!(told, "  {name} {value:.3e} {unit}").expect("a string has room");
        }
        println!("  {:<30}{told}{}", way.name(), if fell { "  FELL" } else { "" });
        all.extend(rows(&name, "cpu", &way.name(), &values));
    }
    all
}

fn csv(rows: &[Row]) -> String {
    let mut text = String::from("case,side,way,quantity,unit,value\n");
    for Row { case, side, way, quantity, unit, value } in rows {
        writeln!(text, "\"{case}\",{side},\"{way}\",{quantity},{unit},{value:.6e}").expect("a string has room");
    }
    text
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let has = |flag: &str| arguments.iter().any(|a| a == flag);
    let after = |flag: &str| {
        let at = arguments.iter().position(|a| a == flag)?;
        Some(arguments.get(at + 1).unwrap_or_else(|| panic!("{flag} wants a word behind it")).as_str())
    };
    let quick = has("--quick");
    let wanted = |name: &str| after("--only").is_none_or(|text| name.contains(text));
    let settings = match quick {
        true => Settings { warm_up: 1, rounds: 1, steps_a_round: 1 },
        false => Settings { warm_up: 60, rounds: 6, steps_a_round: 3 },
    };
    let device = (!has("--no-gpu")).then(|| gpu::Gpu::any().expect("an adapter"));
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let Params { solver, accuracy, .. } = Params::default();
    let substeps = accuracy.fewest();
    println!(
        "{threads} threads, dt 1/60 s, {substeps} sub-steps, {solver}, {} warm-up steps; ratios are to the default's",
        settings.warm_up
    );
    if let Some(device) = &device {
        println!("gpu: {}", device.info.name);
    }
    let scenes = match quick {
        true => vec![("pyramid", scenes::pyramid(10)), ("hub", scenes::hub(100))],
        false => vec![
            ("pyramid", scenes::pyramid(100)),
            ("pile", scenes::pile(4096)),
            ("balls", scenes::balls(4096)),
            ("many_pyramids", scenes::many_pyramids(196, 10)),
            ("hub", scenes::hub(500)),
        ],
    };
    let mut all = Vec::new();
    for (name, scene) in scenes.iter().filter(|(name, _)| wanted(name)) {
        all.extend(compare(name, scene, None, &settings));
        if let Some(device) = &device {
            all.extend(compare(name, scene, Some(device), &settings));
        }
        all.extend(raw(name, scene, &settings));
    }
    for case in cases::ALL.iter().filter(|case| CASES.contains(&case.name) && wanted(case.name)) {
        all.extend(errors(case, Solver::OnePass(OnePass::default()), substeps, quick));
        all.extend(errors(case, Solver::Soft(Soft::default()), 4, quick));
    }
    if let Some(file) = after("--csv") {
        std::fs::write(file, csv(&all)).unwrap_or_else(|error| panic!("{file} cannot be written: {error}"));
    }
}
