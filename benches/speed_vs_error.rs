//! Speed against error, every engine on the same scenes in one run: `cargo bench --bench speed_vs_error`, with
//! `--features box3d` for Box3D and `-- --python PYTHON` for nexus and MuJoCo where their wheels are installed.
//!
//! Leaves `speed_vs_error.csv` (one line a number) and the report made of it, see `tumble_bench`. What is in the table is
//! not measured again, so a run that was stopped goes on where it was. Ends with 1 when an engine's state is not finite,
//! a contact was lost, or an engine failed.

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tumble_bench::cases::{self, Case};
use tumble_bench::engines::{self, Contestant, Means, Method};
use tumble_bench::machine::Machine;
use tumble_bench::record::{self, Kind, Outcome, Record};
use tumble_bench::run::{Conditions, Heat, heats};
use tumble_bench::scaling;
use tumble_core::{GaussSeidel, Jacobi, OnePass, Penalty, Soft, Solver, scenes};
use tumble_gpu::Gpu;

const NAME: &str = "speed_vs_error";

/// Speed against error of every engine, as a table, plots and a page.
#[derive(Debug, Parser)]
#[command(name = NAME)]
struct Args {
    /// Small cases, two numbers of sub-steps: a test that takes less than two minutes
    #[arg(long)]
    quick: bool,
    /// Where the table and the report go [default: target/speed_vs_error, with --quick target/speed_vs_error_quick]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Measure all anew, whatever the table holds
    #[arg(long)]
    fresh: bool,
    /// Make the report of the table that is there, and measure nothing
    #[arg(long)]
    report: bool,
    /// Cases, by name, with commas between; `scaling` and `stages` name what has no error; `none` for no case
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    only: Vec<String>,
    /// Engines, by name, with commas between
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    engines: Vec<String>,
    /// tumble's solvers, by name, with commas between: one-pass, soft, gauss-seidel, jacobi, penalty; or within-MM, one pass
    /// with as many sub-steps as it takes to leave no more than so many millimetres of overlap. `scaling` and
    /// `stages` are measured with the first
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = solver, default_value = "one-pass,soft")]
    solvers: Vec<Method>,
    /// Numbers of sub-steps [default: 1,2,4,8,16,32]
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=256))]
    substeps: Vec<u32>,
    /// Seeds of chaotic cases at most
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// Most bodies of the scaled scene
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    most: usize,
    /// Threads of every engine on the CPU [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    threads: Option<u32>,
    /// Seconds that one engine with one setting may step in a case
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    limit: f64,
    /// Leave the GPU out
    #[arg(long)]
    no_gpu: bool,
    /// An interpreter of Python that has the wheels dimforge-nexus3d and mujoco
    #[arg(long, value_name = "FILE")]
    python: Option<PathBuf>,
    /// What cargo says to every bench
    #[arg(long, hide = true)]
    bench: bool,
}

/// The solver of this name, as it is at first.
fn solver(name: &str) -> Result<Method, String> {
    let within = name.strip_prefix("within-").and_then(|mm| mm.parse::<f32>().ok());
    let solver = match name {
        _ if within.is_some() => Solver::default(),
        "one-pass" => Solver::OnePass(OnePass::default()),
        "soft" => Solver::Soft(Soft::default()),
        "gauss-seidel" => Solver::GaussSeidel(GaussSeidel::default()),
        "jacobi" => Solver::Jacobi(Jacobi::default()),
        "penalty" => Solver::Penalty(Penalty::default()),
        _ => {
            return Err(
                "there are one-pass, soft, gauss-seidel, jacobi, penalty and within-MM, such as within-1".into()
            );
        }
    };
    let method = Method { solver, tolerance: within.map(|mm| 1e-3 * mm) };
    if !method.fits(8) {
        return Err("0.001 to 1000 mm may be left".into());
    }
    Ok(method)
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The table so far, and where it is kept.
struct Table {
    path: PathBuf,
    records: Vec<Record>,
}

impl Table {
    fn open(args: &Args, folder: &Path, machine: &Machine) -> Result<Self, String> {
        std::fs::create_dir_all(folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
        let path = folder.join(NAME).with_extension("csv");
        if args.report && !path.exists() {
            return Err(format!("there is no table {}; measure first, without --report", path.display()));
        }
        let records = if path.exists() && !args.fresh { record::read(&path)? } else { Vec::new() };
        let other = records.iter().find(|r| r.commit != machine.commit || r.machine != machine.name);
        if let (Some(other), false) = (other, args.report) {
            return Err(format!(
                "{} was measured at commit {} on {}, this is commit {} on {}; take another folder with --out, or begin \
                 anew with --fresh",
                path.display(),
                other.commit,
                other.machine,
                machine.commit,
                machine.name
            ));
        }
        Ok(Self { path, records })
    }

    /// Puts these in, in the place of older ones of the same, and saves the table.
    fn put(&mut self, new: Vec<Record>) -> Result<(), String> {
        let same = |r: &Record| (r.kind, r.case.clone(), r.engine.clone(), r.seed, r.note.clone());
        let key = |r: &Record| match r.kind {
            // An engine's remarks are told apart by what they say, everything else by what was measured.
            Kind::Engine => same(r),
            Kind::Scaling => (r.kind, r.case.clone(), String::new(), u64::from(r.bodies), String::new()),
            _ => (r.kind, r.case.clone(), r.engine.clone(), r.seed, String::new()),
        };
        let keys: HashSet<_> = new.iter().map(&key).collect();
        self.records.retain(|r| !keys.contains(&key(r)));
        let mut seen = HashSet::new();
        self.records.extend(new.into_iter().filter(|r| r.kind != Kind::Engine || seen.insert(same(r))));
        record::write(&self.path, &self.records)
    }

    fn has(&self, heat: &Heat) -> bool {
        heat.entries.iter().all(|(contestant, setting)| {
            self.records.iter().any(|r| {
                r.kind == Kind::Case
                    && r.case == heat.case.name
                    && r.seed == heat.seed
                    && r.engine == contestant.name
                    && ["", &r.solver].contains(&contestant.solver(setting).as_str())
                    && r.substeps == setting.substeps
                    && r.dt == f64::from(setting.dt)
            })
        })
    }
}

fn run(args: &Args) -> Result<bool, String> {
    let machine = Machine::this();
    let default = if args.quick { "target/speed_vs_error_quick" } else { "target/speed_vs_error" };
    let folder = args.out.clone().unwrap_or_else(|| default.into());
    let mut table = Table::open(args, &folder, &machine)?;
    if !args.report {
        measure(args, machine, &mut table)?;
    }
    let written = tumble_bench::report::write(&table.records, &folder, NAME)?;
    for path in written.iter().filter(|path| path.extension().is_some_and(|kind| kind == "html" || kind == "md")) {
        println!("wrote {}", path.display());
    }
    println!("wrote {}", table.path.display());
    let failed: Vec<_> = table.records.iter().filter(|r| r.outcome == Outcome::Failed).collect();
    for r in &failed {
        eprintln!("FAILED: {} on {} at {} sub-steps, dt {}: {}", r.engine, r.case, r.substeps, r.dt, r.note);
    }
    Ok(failed.is_empty())
}

fn measure(args: &Args, machine: Machine, table: &mut Table) -> Result<(), String> {
    let gpu = if args.no_gpu { None } else { Gpu::any().map_err(|error| eprintln!("no GPU side: {error}")).ok() };
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let threads = args.threads.map_or(threads, |n| n as usize);
    let limit = if args.quick { 3.0 } else { args.limit };
    let (means, methods) = (Means::new(gpu, args.python.clone()), args.solvers.clone());
    let conditions = Conditions { means, threads, methods, limit, machine };
    let contestants = contestants(args, &conditions, table)?;
    let all = heats(
        &chosen(args)?,
        &contestants,
        &substeps(args),
        if args.quick { &[] } else { &[1.0 / 30.0, 1.0 / 120.0, 1.0 / 240.0] },
        if args.quick { 1 } else { args.seeds },
        &conditions,
    );
    let left: Vec<_> = all.iter().filter(|heat| !table.has(heat)).collect();
    if left.len() < all.len() {
        println!("{} of {} heats are in the table already", all.len() - left.len(), all.len());
    }
    let total: f64 = left.iter().map(|heat| heat.work()).sum();
    let bar = ProgressBar::new(total as u64).with_style(
        ProgressStyle::with_template("{bar:40} {percent} %, {eta} left, {msg}").map_err(|error| error.to_string())?,
    );
    let mut done = 0.0;
    for heat in left {
        bar.set_message(heat.case.name);
        let records = heat.run(&conditions, &mut |work| {
            done += work;
            bar.set_position(done as u64);
        });
        bar.suspend(|| print(heat.case, heat.seed, &records));
        table.put(records)?;
    }
    bar.finish_and_clear();
    if wants(args, "scaling") {
        let sizes: &[usize] = if args.quick { &[1000] } else { &[1000, 4000, 16_000, 64_000, 256_000, 1_000_000] };
        for &bodies in sizes.iter().filter(|&&n| n <= args.most) {
            let there = |r: &Record| r.kind == Kind::Scaling && r.bodies as usize == bodies / 55 * 55;
            if !table.records.iter().any(there) {
                let records = scaling::scaling(bodies, &contestants, &conditions);
                for r in &records {
                    let (ms, broadphase) = (r.ms_median.unwrap_or(f64::NAN), &r.broadphase);
                    println!("{} of {}: {:<12} {broadphase:<16} {ms:10.3} ms {}", r.case, r.bodies, r.engine, r.note);
                }
                table.put(records)?;
            }
        }
    }
    if wants(args, "stages") && !table.records.iter().any(|r| r.kind == Kind::Stage) {
        let (wall, heap) = if args.quick { (10, 100) } else { (100, 4000) };
        let (warm_up, steps) = if args.quick { (2, 2) } else { (120, 40) };
        for (name, scene) in
            [("pyramid", scenes::pyramid(wall)), ("pile", scenes::pile(heap)), ("balls", scenes::balls(heap))]
        {
            table.put(scaling::stages(name, &scene, warm_up, steps, &contestants, &conditions))?;
        }
        if let Some(gpu) = &conditions.means.gpu {
            let bytes = if args.quick { 1 << 20 } else { 64 << 20 };
            table.put(vec![scaling::device(gpu, bytes, &conditions)])?;
        }
    }
    Ok(())
}

fn substeps(args: &Args) -> Vec<u32> {
    match (args.substeps.is_empty(), args.quick) {
        (false, _) => args.substeps.clone(),
        (true, true) => vec![1, 4],
        (true, false) => vec![1, 2, 4, 8, 16, 32],
    }
}

/// Whether a part of the run that is no case was asked for.
fn wants(args: &Args, part: &str) -> bool {
    args.only.is_empty() || args.only.iter().any(|name| name == part)
}

fn chosen(args: &Args) -> Result<Vec<&'static Case>, String> {
    const PARTS: [&str; 3] = ["scaling", "stages", "none"];
    for name in &args.only {
        if !PARTS.contains(&name.as_str()) && !cases::ALL.iter().any(|case| case.name == name) {
            let names: Vec<_> = cases::ALL.iter().map(|case| case.name).chain(PARTS).collect();
            return Err(format!("--only: there is no case \"{name}\"; there are {}", names.join(", ")));
        }
    }
    let small = |case: &&Case| !args.quick || cases::dynamic(&(case.scene)(1)).count() <= 250;
    let named = |case: &&Case| args.only.is_empty() || args.only.iter().any(|name| name == case.name);
    Ok(cases::ALL.iter().filter(named).filter(small).collect())
}

/// The engines that run; what does not is told on the screen and in the table.
fn contestants(args: &Args, conditions: &Conditions, table: &mut Table) -> Result<Vec<Contestant>, String> {
    for name in &args.engines {
        if !engines::ALL.iter().any(|contestant| contestant.name == name) {
            let names: Vec<_> = engines::ALL.iter().map(|contestant| contestant.name).collect();
            return Err(format!("--engines: there is no engine \"{name}\" here; there are {}", names.join(", ")));
        }
    }
    let mut notes = Vec::new();
    let mut note = |engine: &str, note: String, outcome: Outcome| {
        notes.push(Record { outcome, note, ..conditions.record(Kind::Engine, "", engine) });
    };
    for (engine, text) in engines::DIFFERS {
        note(engine, (*text).into(), Outcome::Done);
    }
    let mut contestants = Vec::new();
    for contestant in engines::ALL {
        if !args.engines.is_empty() && !args.engines.iter().any(|name| name == contestant.name) {
            continue;
        }
        match (contestant.available)(&conditions.means) {
            Ok(()) => contestants.push(*contestant),
            Err(why) => {
                println!("{} does not run: {why}", contestant.name);
                note(contestant.name, format!("not run: {why}"), Outcome::Unmodelled);
            }
        }
    }
    table.put(notes)?;
    Ok(contestants)
}

fn print(case: &Case, seed: u64, records: &[Record]) {
    println!("{}{}: {}", case.name, if seed > 0 { format!(", seed {seed}") } else { String::new() }, case.about);
    let headline = case.errors.first().map_or("", |error| error.name);
    for r in records.iter().filter(|r| r.quantity == headline && r.kind == Kind::Case) {
        let ms = |time: Option<f64>| time.map_or_else(|| "-".into(), |ms| format!("{ms:.3}"));
        let (median, p95) = (ms(r.ms_median), ms(r.ms_p95));
        let value = r.value.map_or_else(|| r.note.clone(), |v| format!("{:11.4e} {} {}", v, r.unit, r.quantity));
        println!(
            "  {:<12} {:<12} dt 1/{:<4.0} {:>3} sub-steps {median:>9} ms (p95 {p95:>9})  {value}",
            r.engine,
            r.solver,
            1.0 / r.dt,
            r.substeps
        );
    }
}
