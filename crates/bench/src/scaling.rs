//! Time against the number of bodies, time by stage, and what the device could do.

use crate::cases::dynamic;
use crate::engines::{Contestant, Engine, Refusal, Setting};
use crate::machine::free_memory;
use crate::record::{Kind, Outcome, Record};
use crate::run::{Conditions, DT, SUBSTEPS, quantile};
use tumble_core::{Broadphase, Scene, scenes};
use tumble_gpu::Gpu;
use wgpu::BufferUsages;

/// The scene that is scaled: standing walls of 55 boxes, so that every body is in contact from the first step on.
pub const SCALED: &str = "many pyramids";
/// Steps before the timed ones.
const WARM_UP: u32 = 4;
/// Timed steps of each engine.
const STEPS: u32 = 12;
/// Bytes that all engines together hold for a body at most, as seen at 65,536 of them.
const BYTES_A_BODY: u64 = 20_000;

/// The scaled scene of about so many boxes.
pub fn scaled(bodies: usize) -> Scene {
    scenes::many_pyramids((bodies / 55).max(1), 10)
}

/// A step of each engine on so many bodies; tumble with each broad phase that matters.
pub fn scaling(bodies: usize, contestants: &[Contestant], conditions: &Conditions) -> Vec<Record> {
    let scene = scaled(bodies);
    let count = dynamic(&scene).count();
    let needed = count as u64 * BYTES_A_BODY;
    let mut lanes = Vec::new();
    let mut records = Vec::new();
    for contestant in contestants {
        let broadphases: &[Broadphase] = match contestant.name {
            "tumble cpu" => &[Broadphase::Auto, Broadphase::Grid, Broadphase::Lbvh, Broadphase::SweepAndPrune],
            _ => &[Broadphase::Auto],
        };
        for &broadphase in broadphases {
            let setting = Setting { broadphase, ..conditions.setting(DT, SUBSTEPS) };
            let solver = contestant.solver(&setting);
            let base = conditions.record(Kind::Scaling, SCALED, contestant.name);
            let record = Record { bodies: count as u32, solver, ..base };
            let made = match free_memory() {
                Some(free) if free < needed => Err(Refusal::TooMany(format!(
                    "not run: {count} bodies need some {:.0} GB of memory for all engines, {:.0} GB are free",
                    needed as f64 * 1e-9,
                    free as f64 * 1e-9
                ))),
                _ => contestant.start(&scene, count, &setting, &conditions.means),
            };
            match made {
                Ok(engine) => lanes.push(Lane { engine, record, times: Vec::new(), over: false }),
                Err(refusal) => {
                    let (outcome, note) = refusal.told();
                    records.push(Record { outcome, note, ..record });
                }
            }
        }
    }
    for round in 0..WARM_UP + STEPS {
        let many = lanes.len();
        for i in 0..many {
            lanes[(i + round as usize) % many].step(round >= WARM_UP, conditions.limit);
        }
    }
    records.extend(lanes.into_iter().flat_map(Lane::records));
    records
}

struct Lane {
    engine: Box<dyn Engine>,
    record: Record,
    /// ms.
    times: Vec<f64>,
    /// Failed, or past the limit of time.
    over: bool,
}

impl Lane {
    fn step(&mut self, timed: bool, limit: f64) {
        if self.over {
            return;
        }
        match self.engine.step(1) {
            Ok(times) => {
                let expected = times.iter().sum::<f64>() * 1e-3 * f64::from(STEPS);
                if timed {
                    self.times.extend(times);
                    if expected > limit {
                        self.over = true;
                        self.record.note =
                            format!("only {} steps: each takes {:.1} s", self.times.len(), expected / f64::from(STEPS));
                    }
                }
            }
            Err(note) => {
                self.over = true;
                self.record = Record { outcome: Outcome::Failed, note, ..self.record.clone() };
            }
        }
    }

    fn records(mut self) -> Vec<Record> {
        let facts = self.engine.facts();
        if let Err(note) = self.engine.check() {
            self.record = Record { outcome: Outcome::Failed, note, ..self.record };
        }
        let base = Record {
            version: facts.version,
            adapter: facts.adapter,
            broadphase: facts.broadphase,
            steps: self.times.len() as u32,
            ms_median: quantile(&self.times, 0.5),
            ms_p95: quantile(&self.times, 0.95),
            ..self.record
        };
        let floor = facts.floor_bytes.map(|bytes| Record {
            quantity: "floor bytes".into(),
            unit: "B".into(),
            value: Some(bytes as f64),
            ..base.clone()
        });
        // One line an engine: with the floor, where it is known.
        vec![floor.unwrap_or(base)]
    }
}

/// Time of each stage of a settled scene, for the engines that tell.
pub fn stages(
    name: &str,
    scene: &Scene,
    warm_up: u32,
    steps: u32,
    contestants: &[Contestant],
    conditions: &Conditions,
) -> Vec<Record> {
    let mut records = Vec::new();
    for contestant in contestants.iter().filter(|c| c.name.starts_with("tumble")) {
        let setting = Setting { profile: true, ..conditions.setting(DT, SUBSTEPS) };
        let (bodies, solver) = (dynamic(scene).count() as u32, contestant.solver(&setting));
        let record = Record { bodies, solver, ..conditions.record(Kind::Stage, name, contestant.name) };
        match staged(scene, &setting, warm_up, steps, contestant, conditions, &record) {
            Ok(lines) => records.extend(lines),
            Err(note) => records.push(Record { outcome: Outcome::Failed, note, ..record }),
        }
    }
    records
}

fn staged(
    scene: &Scene,
    setting: &Setting,
    warm_up: u32,
    steps: u32,
    contestant: &Contestant,
    conditions: &Conditions,
    record: &Record,
) -> Result<Vec<Record>, String> {
    let made = contestant.start(scene, dynamic(scene).count(), setting, &conditions.means);
    let mut engine = made.map_err(|refusal| refusal.told().1)?;
    engine.step(warm_up)?;
    let mut whole = Vec::new();
    // A stage each, in order.
    let mut times: Vec<(&str, Vec<f64>)> = Vec::new();
    for _ in 0..steps {
        whole.extend(engine.step(1)?);
        for stage in engine.stages() {
            let at = times.iter().position(|(name, _)| *name == stage.stage).unwrap_or_else(|| {
                times.push((stage.stage, Vec::new()));
                times.len() - 1
            });
            times[at].1.extend(stage.milliseconds);
        }
    }
    let facts = engine.facts();
    let base = Record {
        version: facts.version,
        adapter: facts.adapter,
        broadphase: facts.broadphase,
        solver: facts.solver,
        steps,
        ..record.clone()
    };
    let line = |stage: &str, times: &[f64]| Record {
        stage: stage.into(),
        ms_median: quantile(times, 0.5),
        ms_p95: quantile(times, 0.95),
        note: if times.is_empty() { "n/a: the adapter has no timestamps".into() } else { String::new() },
        ..base.clone()
    };
    // The whole step comes first, under a name that no stage has.
    Ok(std::iter::once(line("step", &whole)).chain(times.iter().map(|(name, times)| line(name, times))).collect())
}

/// Bytes a second, read and written, that the device copies from buffer to buffer.
pub fn copy_rate(gpu: &Gpu, bytes: u64, rounds: usize) -> Result<f64, String> {
    const COPIES: u64 = 8;
    let buffer = || gpu.create_buffer("copied", bytes, BufferUsages::COPY_SRC | BufferUsages::COPY_DST);
    let (from, to) = (buffer().map_err(|e| e.to_string())?, buffer().map_err(|e| e.to_string())?);
    let mut seconds = Vec::new();
    for _ in 0..=rounds {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for _ in 0..COPIES {
            encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes);
        }
        let begin = std::time::Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.wait().map_err(|e| e.to_string())?;
        seconds.push(begin.elapsed().as_secs_f64());
    }
    // The first one touches the memory.
    Ok((2 * bytes * COPIES) as f64 / quantile(&seconds[1..], 0.5).unwrap_or(f64::NAN))
}

/// The device's line.
pub fn device(gpu: &Gpu, bytes: u64, conditions: &Conditions) -> Record {
    let base = Record {
        adapter: format!("{} ({})", gpu.info.name, gpu.info.driver_info),
        quantity: "copy bandwidth".into(),
        unit: "GB/s".into(),
        ..conditions.record(Kind::Device, "device", "tumble gpu")
    };
    match copy_rate(gpu, bytes, 5) {
        Ok(rate) => Record { value: Some(rate * 1e-9), ..base },
        Err(note) => Record { outcome: Outcome::Failed, note, ..base },
    }
}
