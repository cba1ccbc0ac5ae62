//! A table such as a run leaves, with laws that are known: errors and times follow powers, with some noise.

use tumble_bench::record::{Kind, Outcome, Record};

/// Engines and what a step of one sub-step costs them, ms, and how their error follows the sub-steps.
const ENGINES: [(&str, &str, f64, f64); 6] = [
    ("tumble cpu", "Intel AVX2, 2 threads", 0.35, 1.3),
    ("tumble gpu", "llvmpipe (LLVM 15.0.6, 256 bits), Mesa 22.3.6", 2.6, 1.3),
    ("rapier", "Intel AVX2, 2 threads", 0.30, 0.02),
    ("box3d", "Intel AVX2, 2 threads", 0.24, -0.15),
    ("nexus", "llvmpipe (LLVM 15.0.6, 256 bits), Mesa 22.3.6", 6.0, 0.05),
    ("mujoco", "Intel AVX2, 1 thread", 9.0, 0.6),
];

/// Name, bodies, seeds, and its errors: name, unit and size at one sub-step.
type Case = (&'static str, u32, u64, &'static [(&'static str, &'static str, f64)]);

const CASES: [Case; 7] = [
    ("column 20", 20, 0, &[("deepest overlap", "m", 0.012), ("mean overlap", "m", 0.006)]),
    ("sliding box", 1, 0, &[("off the formula", "m", 0.0034)]),
    ("ratio 1000", 2, 0, &[("deepest overlap", "m", 0.11)]),
    (
        "pile 1000",
        1000,
        3,
        &[("deepest overlap", "m", 0.06), ("mean overlap", "m", 0.0031), ("residual energy", "J/kg", 4e-4)],
    ),
    ("spinning box", 1, 0, &[("rotation off", "rad", 2e-7)]),
    ("pyramid 465", 465, 3, &[("deepest overlap", "m", 0.021)]),
    ("pendulum", 1, 0, &[("energy drift", "1", 0.03)]),
];

/// A line with the columns that all lines share.
pub(crate) fn line(kind: Kind, case: &str, engine: &str) -> Record {
    let adapter = ENGINES.iter().find(|e| e.0 == engine).map_or("", |e| e.1);
    Record {
        kind,
        case: case.into(),
        engine: engine.into(),
        version: if engine.starts_with("tumble") { "0.1.0".into() } else { "0.36.1".into() },
        adapter: adapter.into(),
        bodies: 1,
        dt: 1.0 / 60.0,
        substeps: 4,
        seed: 0,
        broadphase: if engine.starts_with("tumble") { "auto".into() } else { String::new() },
        solver: if engine.starts_with("tumble") { "soft step".into() } else { String::new() },
        threads: 2,
        steps: 240,
        ms_median: None,
        ms_p95: None,
        quantity: String::new(),
        unit: String::new(),
        value: None,
        stage: String::new(),
        outcome: Outcome::Done,
        note: String::new(),
        machine: "AMD EPYC 7B13, 2 cores, Linux 6.1".into(),
        commit: "90f61b9+".into(),
        date: "2026-11-22".into(),
    }
}

/// Numbers in -1..1 that are the same in every run.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

fn case_lines(noise: &mut Noise, out: &mut Vec<Record>, (case, bodies, seeds, errors): &Case) {
    for (engine, _, cost, order) in ENGINES {
        let work = cost * (0.05 + f64::from(*bodies) / 1000.0);
        let settings = [1, 2, 4, 8, 16, 32].map(|n| (n, 1.0 / 60.0)).into_iter();
        let lengths =
            [(4, 1.0 / 30.0), (4, 1.0 / 120.0), (4, 1.0 / 240.0)].into_iter().filter(|_| *case == "column 20");
        for (substeps, dt) in settings.chain(lengths) {
            for seed in 0..(*seeds).max(1) {
                let ms = work * (0.4 + 0.6 * f64::from(substeps)) * (1.0 + 0.05 * noise.next());
                for (i, (quantity, unit, size)) in errors.iter().enumerate() {
                    let shrunk = (f64::from(substeps) / (60.0 * dt)).powf(-order);
                    let spread = if *seeds > 1 { 0.35 } else { 0.03 };
                    let mut value = size * shrunk * (1.0 + spread * noise.next());
                    if *case == "spinning box" && engine.starts_with("tumble") && substeps > 4 {
                        value = 0.0;
                    }
                    let mut r = line(Kind::Case, case, engine);
                    (r.bodies, r.dt, r.substeps, r.seed) = (*bodies, dt, substeps, seed + 1);
                    (r.ms_median, r.ms_p95) = (Some(ms), Some(ms * 1.3));
                    (r.quantity, r.unit, r.value) = (quantity.to_string(), unit.to_string(), Some(value));

                    match (*case, engine) {
                        ("pendulum", "tumble cpu" | "tumble gpu") => {
                            (r.outcome, r.value) = (Outcome::Unmodelled, None);
                            (r.ms_median, r.ms_p95) = (None, None);
                            r.note = "joints are not there yet".into();
                        }
                        ("pyramid 465", "mujoco") if substeps > 4 => {
                            (r.outcome, r.value) = (Outcome::Slow, None);
                            r.note = "given up after 120 s".into();
                        }
                        ("ratio 1000", "nexus") => {
                            (r.outcome, r.value) = (Outcome::Failed, None);
                            r.note = "a body fell through".into();
                        }
                        ("column 20", "mujoco") if i == 0 => r.note = "one step of Newton's method a sub-step".into(),
                        _ => {}
                    }
                    out.push(r);
                }
            }
        }
    }
}

fn scaling_lines(noise: &mut Noise, out: &mut Vec<Record>) {
    for (engine, _, cost, _) in ENGINES.into_iter().filter(|e| e.0 != "mujoco") {
        for bodies in [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000] {
            let growth = if engine == "tumble gpu" { 0.97 } else { 1.06 };
            let ms = cost * (f64::from(bodies) / 1000.0).powf(growth) * (1.0 + 0.04 * noise.next());
            let mut r = line(Kind::Scaling, "pile of balls", engine);
            (r.bodies, r.ms_median, r.ms_p95) = (bodies, Some(ms), Some(ms * 1.2));
            if ms > 1000.0 {
                r.outcome = Outcome::Slow;
                r.note = "fewer steps than asked for, at the limit of time".into();
            }
            if engine.starts_with("tumble") {
                (r.quantity, r.unit) = ("floor bytes".into(), "B".into());
                r.value = Some(f64::from(bodies) * 176.0);
            }
            out.push(r);
        }
    }
}

fn stage_lines(out: &mut Vec<Record>) {
    let stages = [
        ("edit", 0.4),
        ("bounds", 3.0),
        ("broadphase/grid", 16.0),
        ("contact", 6.0),
        ("narrowphase/ball_ball", 11.0),
        ("batch", 9.0),
        ("solver/prepare", 5.0),
        ("solver/sweep", 31.0),
        ("solver/restitution", 1.5),
        ("motion", 4.0),
    ];
    for (engine, bodies) in
        [("tumble cpu", 10_000), ("tumble cpu", 100_000), ("tumble gpu", 10_000), ("tumble gpu", 100_000)]
    {
        let whole = out.iter().find(|r| r.kind == Kind::Scaling && r.engine == engine && r.bodies == bodies);
        let whole = whole.and_then(|r| r.ms_median).unwrap_or(1.0);
        for (stage, share) in stages {
            let mut r = line(Kind::Stage, "pile of balls", engine);
            (r.bodies, r.stage) = (bodies, stage.into());
            let untimed = engine == "tumble gpu" && bodies == 100_000;
            r.ms_median = (!untimed).then_some(whole * share / 100.0);
            out.push(r);
        }
    }
}

/// The whole table.
pub(crate) fn table() -> Vec<Record> {
    let mut noise = Noise(7);
    let mut out = Vec::new();
    for case in &CASES {
        case_lines(&mut noise, &mut out, case);
    }
    scaling_lines(&mut noise, &mut out);
    stage_lines(&mut out);
    remark_lines(&mut out);
    let mut device = line(Kind::Device, "llvmpipe (LLVM 15.0.6, 256 bits), Mesa 22.3.6", "tumble gpu");
    (device.quantity, device.unit, device.value) = ("copy bandwidth".into(), "GB/s".into(), Some(9.4));
    out.push(device);
    out
}

/// What engines say of themselves.
fn remark_lines(out: &mut Vec<Record>) {
    for (engine, note) in [
        ("all", "Same shapes, masses and friction; sleep off; nothing tuned."),
        ("rapier", "Two relaxation sweeps a sub-step; contacts at 30 Hz; sleep off."),
        ("mujoco", "A global Newton solver; contacts are soft by its solref and solimp, at their defaults."),
    ] {
        let mut r = line(Kind::Engine, "", engine);
        r.note = note.into();
        out.push(r);
    }
    let mut r = line(Kind::Engine, "", "mujoco stiff");
    (r.outcome, r.note) = (Outcome::Unmodelled, "not run: the wheel is not installed".into());
    out.push(r);
}
