//! Runs the cases: all engines and settings of a case take turns, so that a noisy machine harms all alike.

use crate::cases::{self, Case, Run};
use crate::engines::{Contestant, Engine, Facts, Means, Method, Setting};
use crate::machine::Machine;
use crate::record::{Kind, Outcome, Record};
use crate::report::is_ours;
use glam::Vec3;
use tumble_core::{Broadphase, Poses, Scene, Velocities};

/// Turns of a heat. The first half is the warm-up: bodies fall, caches fill, buffers grow, pipelines are compiled.
const ROUNDS: u64 = 20;
/// s.
pub const DT: f64 = 1.0 / 60.0;
/// Sub-steps where dt is varied, and where nothing is.
pub const SUBSTEPS: u32 = 4;

/// What all runs have in common.
#[derive(Debug, Clone)]
pub struct Conditions {
    /// What engines run on.
    pub means: Means,
    /// Threads of every engine on the CPU.
    pub threads: usize,
    /// tumble's methods: each runs every case. What has no error is measured with the first.
    pub methods: Vec<Method>,
    /// Seconds that one engine with one setting may step in one heat; past them it is given up as slow.
    pub limit: f64,
    /// Where it runs.
    pub machine: Machine,
}

impl Conditions {
    /// A line of the table with everything that the conditions tell, and no measurement.
    pub fn record(&self, kind: Kind, case: &str, engine: &str) -> Record {
        Record {
            kind,
            case: case.into(),
            engine: engine.into(),
            version: String::new(),
            adapter: String::new(),
            bodies: 0,
            dt: DT,
            substeps: SUBSTEPS,
            seed: 0,
            broadphase: String::new(),
            solver: String::new(),
            threads: self.threads as u32,
            steps: 0,
            ms_median: None,
            ms_p95: None,
            quantity: String::new(),
            unit: String::new(),
            value: None,
            stage: String::new(),
            outcome: Outcome::Done,
            note: String::new(),
            machine: self.machine.name.clone(),
            commit: self.machine.commit.clone(),
            date: self.machine.date.clone(),
        }
    }

    /// A setting as all engines get it.
    pub fn setting(&self, dt: f64, substeps: u32) -> Setting {
        let (dt, threads) = (dt as f32, self.threads);
        let method = self.methods.first().copied().unwrap_or_default();
        Setting { dt, substeps, threads, broadphase: Broadphase::Auto, method, profile: false }
    }

    /// The setting with each method that the engine can run with.
    fn with_methods(&self, contestant: &Contestant, setting: Setting) -> Vec<Setting> {
        let choice = if is_ours(contestant.name) { &self.methods[..] } else { &[] };
        match choice {
            [] => vec![setting],
            methods => methods
                .iter()
                .filter(|method| method.fits(setting.substeps))
                .map(|&method| Setting { method, ..setting })
                .collect(),
        }
    }
}

/// One scene, and who runs it how: what is measured in turns, and written to the table together.
pub struct Heat {
    /// The case.
    pub case: &'static Case,
    /// The scene's seed.
    pub seed: u64,
    /// Engines and settings.
    pub entries: Vec<(Contestant, Setting)>,
}

/// The heats of these cases, with sub-steps as given and, where the case asks for it, other lengths of a step.
pub fn heats(
    cases: &[&'static Case],
    contestants: &[Contestant],
    substeps: &[u32],
    dts: &[f64],
    most_seeds: u64,
    conditions: &Conditions,
) -> Vec<Heat> {
    let mut heats = Vec::new();
    for case in cases {
        let mut settings: Vec<Setting> = substeps.iter().map(|&n| conditions.setting(DT, n)).collect();
        if case.vary_dt {
            settings.extend(dts.iter().map(|&dt| conditions.setting(dt, SUBSTEPS)));
        }
        for seed in 1..=case.seeds.min(most_seeds) {
            let all = |&s: &Setting| contestants.iter().map(move |c| (*c, conditions.with_methods(c, s)));
            let entries = settings.iter().flat_map(all).flat_map(|(c, all)| all.into_iter().map(move |s| (c, s)));
            let entries = entries.collect();
            heats.push(Heat { case, seed: if case.seeds > 1 { seed } else { 0 }, entries });
        }
    }
    heats
}

/// One engine with one setting in one heat.
struct Lane {
    contestant: Contestant,
    setting: Setting,
    engine: Option<Box<dyn Engine>>,
    total: u64,
    done: u64,
    /// ms, of the timed half.
    times: Vec<f64>,
    /// s, without the first step.
    spent: f64,
    track: Vec<Vec3>,
    facts: Facts,
    end: Option<(Poses, Velocities)>,
    outcome: Outcome,
    note: String,
}

impl Heat {
    /// Steps of all entries together, weighted by what they roughly cost, for a progress bar.
    pub fn work(&self) -> f64 {
        let bodies = cases::dynamic(&(self.case.scene)(self.seed)).count() as f64;
        self.entries.iter().map(|(c, s)| self.steps(s) as f64 * bodies * weight(c, s)).sum()
    }

    fn steps(&self, setting: &Setting) -> u64 {
        (self.case.seconds / f64::from(setting.dt)).round() as u64
    }

    /// Runs it. `progress` is told of work done, in the unit of [`Heat::work`].
    pub fn run(&self, conditions: &Conditions, progress: &mut dyn FnMut(f64)) -> Vec<Record> {
        let scene = (self.case.scene)(self.seed);
        let bodies = cases::dynamic(&scene).count();
        let mut lanes: Vec<Lane> = self.entries.iter().map(|(c, s)| self.lane(c, s, &scene, conditions)).collect();
        for round in 1..=ROUNDS {
            let count = lanes.len();
            for i in 0..count {
                // Nobody comes first every time.
                let lane = &mut lanes[(i + round as usize) % count];
                let (before, goal) = (lane.total * (round - 1) / ROUNDS, lane.total * round / ROUNDS);
                lane.advance(goal, round > ROUNDS / 2, self.case.track, &scene, conditions.limit);
                // What has given up is through with its share too.
                progress((goal - before) as f64 * bodies as f64 * weight(&lane.contestant, &lane.setting));
            }
        }
        lanes.into_iter().flat_map(|lane| self.records(lane, &scene, bodies, conditions)).collect()
    }

    fn lane(&self, contestant: &Contestant, setting: &Setting, scene: &Scene, conditions: &Conditions) -> Lane {
        let bodies = cases::dynamic(scene).count();
        let (engine, outcome, note) = match contestant.start(scene, bodies, setting, &conditions.means) {
            Ok(engine) => (Some(engine), Outcome::Done, String::new()),
            Err(refusal) => {
                let (outcome, note) = refusal.told();
                (None, outcome, note)
            }
        };
        Lane {
            contestant: *contestant,
            setting: *setting,
            engine,
            total: self.steps(setting),
            done: 0,
            times: Vec::new(),
            spent: 0.0,
            track: Vec::new(),
            facts: Facts::default(),
            end: None,
            outcome,
            note,
        }
    }

    /// A line for each error of the case, without a value where the lane came to no end; and what the engine says of
    /// itself.
    fn records(&self, lane: Lane, scene: &Scene, bodies: usize, conditions: &Conditions) -> Vec<Record> {
        let base = Record {
            version: lane.facts.version.clone(),
            adapter: lane.facts.adapter.clone(),
            bodies: bodies as u32,
            dt: f64::from(lane.setting.dt),
            substeps: lane.setting.substeps,
            seed: self.seed,
            broadphase: lane.facts.broadphase.clone(),
            solver: Some(lane.facts.solver.clone())
                .filter(|told| !told.is_empty())
                .unwrap_or_else(|| lane.contestant.solver(&lane.setting)),
            steps: lane.times.len() as u32,
            ms_median: quantile(&lane.times, 0.5),
            ms_p95: quantile(&lane.times, 0.95),
            outcome: lane.outcome,
            note: lane.note.clone(),
            ..conditions.record(Kind::Case, self.case.name, lane.contestant.name)
        };
        let run = lane.end.as_ref().map(|(poses, velocities)| Run {
            scene,
            poses,
            velocities,
            track: &lane.track,
            seconds: lane.total as f64 * f64::from(lane.setting.dt),
        });
        let fell = run.as_ref().is_some_and(self.case.fell);
        let line = |(place, error): (usize, &cases::Error)| {
            let value = run.as_ref().map(|run| (error.of)(run)).filter(|value| value.is_finite());
            let (value, outcome, note) = match (&run, value) {
                (Some(_), None) => (None, Outcome::Failed, "its error is not finite"),
                (Some(_), Some(_)) if fell && place > 0 => (None, Outcome::Fell, "what should stand has fallen"),
                (_, value) => (value, base.outcome, base.note.as_str()),
            };
            let (quantity, unit) = (error.name.into(), error.unit.into());
            Record { quantity, unit, value, outcome, note: note.into(), ..base.clone() }
        };
        let told =
            |note: &String| Record { note: note.clone(), ..conditions.record(Kind::Engine, "", lane.contestant.name) };
        self.case.errors.iter().enumerate().map(line).chain(lane.facts.differs.iter().map(told)).collect()
    }
}

impl Lane {
    /// Steps until `goal`, and gives up where that is no use.
    fn advance(&mut self, goal: u64, timed: bool, track: bool, scene: &Scene, limit: f64) {
        while self.done < goal {
            let Some(engine) = &mut self.engine else { return };
            // The first step alone: it compiles and allocates.
            let chunk = if track || self.done == 0 { 1 } else { goal - self.done };
            // Small bites while it is unknown what a step takes, and none that takes much of the limit.
            let pace = self.spent / self.done.saturating_sub(1).max(1) as f64;
            let bite = if self.done < 8 { 2 } else { (0.1 * limit / pace) as u64 };
            let chunk = chunk.min(bite.max(1));
            match engine.step(chunk as u32) {
                Ok(times) => {
                    if self.done > 0 {
                        self.spent += times.iter().sum::<f64>() * 1e-3;
                    }
                    if timed {
                        self.times.extend(times);
                    }
                }
                Err(error) => return self.fail(format!("step {}: {error}", self.done + 1)),
            }
            self.done += chunk;
            if track {
                match self.engine.as_mut().map(|engine| engine.state()) {
                    Some(Ok((poses, _))) => {
                        let place = cases::dynamic(scene).next().and_then(|b| Some(poses.get(b).ok()?.translation));
                        self.track.push(place.unwrap_or(Vec3::NAN));
                    }
                    Some(Err(error)) => return self.fail(error),
                    None => {}
                }
            }
            let expected = self.spent / (self.done - 1).max(1) as f64 * self.total as f64;
            if expected > limit && self.done > 3 && self.done < self.total {
                return self.give_up(expected, limit);
            }
        }
        if self.done == self.total && self.end.is_none() {
            self.finish();
        }
    }

    fn finish(&mut self) {
        let Some(engine) = &mut self.engine else { return };
        self.facts = engine.facts();
        if let Err(lost) = engine.check() {
            return self.fail(lost);
        }
        match engine.state() {
            Ok((poses, velocities)) => {
                let finite = poses.iter().all(|p| p.translation.is_finite() && p.rotation.is_finite())
                    && velocities.iter().all(|v| v.linear.is_finite() && v.angular.is_finite());
                if !finite {
                    return self.fail("its state is not finite".into());
                }
                self.end = Some((poses, velocities));
            }
            Err(error) => return self.fail(error),
        }
        self.engine = None;
    }

    fn fail(&mut self, note: String) {
        self.facts = self.engine.as_mut().map(|engine| engine.facts()).unwrap_or_default();
        self.engine = None;
        (self.outcome, self.note) = (Outcome::Failed, note);
    }

    /// What it took so far stands as its time a step.
    fn give_up(&mut self, expected: f64, limit: f64) {
        self.facts = self.engine.as_mut().map(|engine| engine.facts()).unwrap_or_default();
        self.engine = None;
        if self.times.is_empty() {
            self.times = vec![self.spent / (self.done - 1).max(1) as f64 * 1e3];
        }
        self.outcome = Outcome::Slow;
        self.note = format!("given up: {} steps would take {expected:.0} s, the limit is {limit:.0} s", self.total);
    }
}

fn weight(contestant: &Contestant, setting: &Setting) -> f64 {
    contestant.cost[0] + contestant.cost[1] * f64::from(setting.substeps)
}

/// The value below which a share of `p` of all lie, by linear interpolation between neighbours; nothing of none.
pub fn quantile(values: &[f64], p: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = p * sorted.len().checked_sub(1)? as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(below + (above - below) * place.fract())
}
