//! Heats and their table. Oracle: engines made up here, whose times and states are known.

use glam::{Quat, Vec3};
use std::cell::RefCell;
use tumble_bench::cases::{self, Case};
use tumble_bench::engines::{self, Contestant, Engine, Facts, Make, Means, Method, Refusal, Setting};
use tumble_bench::machine::Machine;
use tumble_bench::record::{self, Kind, Outcome, Record};
use tumble_bench::report;
use tumble_bench::run::{Conditions, heats, quantile};
use tumble_core::{BodyHandle, Pose, Poses, Scene, Soft, Solver, Velocities, Velocity, measures};

thread_local! {
    /// Who stepped, in order.
    static STEPPED: RefCell<Vec<&'static str>> = const { RefCell::new(Vec::new()) };
}

/// Step i takes i / 10 ms; nothing moves.
struct MadeUp {
    name: &'static str,
    bodies: Vec<BodyHandle>,
    poses: Poses,
    velocities: Velocities,
    steps: u32,
    milliseconds: fn(u32) -> f64,
    lost: bool,
    breaks_at: u32,
}

impl MadeUp {
    fn new(name: &'static str, scene: &Scene) -> Self {
        Self {
            name,
            bodies: scene.bodies().collect(),
            poses: measures::initial_poses(scene),
            velocities: measures::initial_velocities(scene),
            steps: 0,
            milliseconds: |step| f64::from(step) / 10.0,
            lost: false,
            breaks_at: u32::MAX,
        }
    }
}

impl Engine for MadeUp {
    fn step(&mut self, count: u32) -> Result<Vec<f64>, String> {
        STEPPED.with_borrow_mut(|list| list.push(self.name));
        let first = self.steps + 1;
        self.steps += count;
        if self.steps >= self.breaks_at {
            return Err("out of order".into());
        }
        Ok((first..=self.steps).map(self.milliseconds).collect())
    }

    fn state(&mut self) -> Result<(Poses, Velocities), String> {
        Ok((self.poses.clone(), self.velocities.clone()))
    }

    fn facts(&mut self) -> Facts {
        Facts { version: "1, \"2\"\n3".into(), adapter: "none".into(), ..Facts::default() }
    }

    fn check(&mut self) -> Result<(), String> {
        if self.lost { Err("step 7: 1 lost".into()) } else { Ok(()) }
    }
}

fn good(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    Ok(Box::new(MadeUp::new("good", scene)))
}

fn other(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    Ok(Box::new(MadeUp::new("other", scene)))
}

fn losing(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    Ok(Box::new(MadeUp { lost: true, ..MadeUp::new("losing", scene) }))
}

fn breaking(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    Ok(Box::new(MadeUp { breaks_at: 100, ..MadeUp::new("breaking", scene) }))
}

fn slow(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    // The first step compiles, and is no sign of what the others take.
    Ok(Box::new(MadeUp { milliseconds: |step| if step == 1 { 1e6 } else { 500.0 }, ..MadeUp::new("slow", scene) }))
}

fn slow_to_start(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    Ok(Box::new(MadeUp { milliseconds: |step| if step == 1 { 1e6 } else { 1.0 }, ..MadeUp::new("compiling", scene) }))
}

fn infinite(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    let mut made = MadeUp::new("infinite", scene);
    let far = Pose { translation: Vec3::X * f32::INFINITY, rotation: Quat::IDENTITY };
    made.poses = Poses::collect(0, made.bodies.iter().map(|&b| (b, far)));
    Ok(Box::new(made))
}

fn not_a_number(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    let mut made = MadeUp::new("not a number", scene);
    let still = Velocity { linear: Vec3::ZERO, angular: Vec3::NAN };
    made.velocities = Velocities::collect(0, made.bodies.iter().map(|&b| (b, still)));
    Ok(Box::new(made))
}

fn unable(_: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    Err(Refusal::Unmodelled("no boxes".into()))
}

fn contestant(name: &'static str, make: Make) -> Contestant {
    Contestant { name, cost: [1.0, 1.0], most_bodies: usize::MAX, make, available: |_| Ok(()) }
}

fn conditions() -> Conditions {
    let machine = Machine { name: "a, \"machine\"".into(), commit: "abc+".into(), date: "2026-11-22".into() };
    Conditions { means: Means::default(), threads: 2, methods: Vec::new(), limit: 20.0, machine }
}

fn column() -> &'static Case {
    cases::ALL.iter().find(|case| case.name == "column 10").expect("a column")
}

/// One line of `column 10` (300 steps) for each.
fn run(contestants: &[Contestant]) -> Vec<Record> {
    let heats = heats(&[column()], contestants, &[4], &[], 3, &conditions());
    assert_eq!(heats.len(), 1, "a scene without chaos has one seed");
    let records = heats[0].run(&conditions(), &mut |_| {});
    records.into_iter().filter(|r| r.quantity == "sink").collect()
}

#[test]
fn every_end_is_told_for_what_it_is() {
    let records = run(&[
        contestant("good", good),
        contestant("losing", losing),
        contestant("breaking", breaking),
        contestant("slow", slow),
        contestant("compiling", slow_to_start),
        contestant("infinite", infinite),
        contestant("not a number", not_a_number),
        contestant("unable", unable),
        Contestant { most_bodies: 9, ..contestant("small", good) },
    ]);
    let of = |name: &str| records.iter().find(|r| r.engine == name).unwrap_or_else(|| panic!("no line of {name}"));
    for (name, outcome, value, note) in [
        ("good", Outcome::Done, Some(0.0), ""),
        ("compiling", Outcome::Done, Some(0.0), ""),
        ("losing", Outcome::Failed, None, "step 7: 1 lost"),
        ("breaking", Outcome::Failed, None, "out of order"),
        ("infinite", Outcome::Failed, None, "its state is not finite"),
        ("not a number", Outcome::Failed, None, "its state is not finite"),
        ("slow", Outcome::Slow, None, "given up: 300 steps would take 150 s, the limit is 20 s"),
        ("unable", Outcome::Unmodelled, None, "no boxes"),
        ("small", Outcome::Slow, None, "not run: more than 9 bodies"),
    ] {
        let r = of(name);
        assert_eq!((r.outcome, r.value), (outcome, value), "{name}: {}", r.note);
        assert!(r.note.contains(note), "{name}: {}", r.note);
    }
    assert_eq!(of("slow").ms_median, Some(500.0), "what it took so far stands");
}

fn fallen(scene: &Scene, _: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    let mut made = MadeUp::new("fallen", scene);
    let below = Pose { translation: Vec3::Y * 0.5, rotation: Quat::IDENTITY };
    made.poses = Poses::collect(0, made.bodies.iter().map(|&b| (b, below)));
    Ok(Box::new(made))
}

/// The top of a column of ten came down by 9 m, and nothing else is told of it.
#[test]
fn of_what_fell_only_the_headline_is_told() {
    let heats = heats(&[column()], &[contestant("fallen", fallen)], &[4], &[], 1, &conditions());
    let records = heats[0].run(&conditions(), &mut |_| {});
    assert_eq!((records[0].outcome, records[0].value), (Outcome::Done, Some(9.0)));
    assert!(records.len() > 2);
    for r in &records[1..] {
        assert_eq!((r.outcome, r.value), (Outcome::Fell, None), "{}", r.quantity);
    }
}

/// Steps 151 to 300 of 300, which take 15.1 to 30 ms: a median of 22.55 and a p95 of 29.255.
#[test]
fn the_second_half_is_timed() {
    let records = run(&[contestant("good", good)]);
    let good = &records[0];
    assert_eq!(good.steps, 150);
    assert!((good.ms_median.unwrap() - 22.55).abs() < 1e-9);
    assert!((good.ms_p95.unwrap() - 29.255).abs() < 1e-9);
    assert_eq!((good.bodies, good.substeps, good.threads), (10, 4, 2));
}

#[test]
fn engines_take_turns_and_none_is_always_first() {
    STEPPED.with_borrow_mut(Vec::clear);
    run(&[contestant("good", good), contestant("other", other)]);
    let order = STEPPED.with_borrow(Vec::clone);
    // The first one changes from round to round (o g | g o | o g ...), so that of 20 rounds 21 turns are left.
    let turns: Vec<_> = order.chunk_by(|a, b| a == b).map(|turn| turn[0]).collect();
    assert_eq!(turns.len(), 21, "{turns:?}");
    assert_eq!(order.iter().filter(|&&name| name == "good").count() * 2, order.len(), "both as often");
}

#[test]
fn work_adds_up_to_the_whole() {
    let all = [contestant("good", good), contestant("slow", slow), contestant("unable", unable)];
    for heat in heats(&[column()], &all, &[1, 8], &[], 1, &conditions()) {
        let mut told = 0.0;
        heat.run(&conditions(), &mut |work| told += work);
        assert!((told / heat.work() - 1.0).abs() < 1e-9, "{told} of {}", heat.work());
    }
}

#[test]
fn settings_are_those_asked_for() {
    let named = |name: &str| cases::ALL.iter().find(|case| case.name == name).expect("a case");
    let chosen = [named("sliding box"), named("pile 1000")];
    let heats = heats(&chosen, &[contestant("good", good)], &[1, 4], &[1.0 / 120.0], 2, &conditions());
    let told: Vec<_> = heats.iter().map(|h| (h.case.name, h.seed, h.entries.len())).collect();
    // Another dt only where there is a formula; seeds only where there is chaos.
    assert_eq!(told, [("sliding box", 0, 3), ("pile 1000", 1, 2), ("pile 1000", 2, 2)]);
    assert_eq!(heats[0].entries[2].1.dt, 1.0 / 120.0);
}

/// tumble runs with each method that the setting allows, and its lines say which, even where it did not start; the others run once.
#[test]
fn each_solver_runs() {
    let soft = Method { solver: Solver::Soft(Soft::default()), ..Method::default() };
    // With sub-steps that are no multiple of 8 there is none.
    let within = Method { tolerance: Some(1e-3), ..Method::default() };
    let conditions = Conditions { methods: vec![Method::default(), soft, within], ..conditions() };
    let all = [
        contestant("tumble cpu", good),
        Contestant { most_bodies: 9, ..contestant("tumble gpu", good) },
        contestant("other", other),
    ];
    let heats = heats(&[column()], &all, &[4], &[], 1, &conditions);
    let records = heats[0].run(&conditions, &mut |_| {});
    let lines: Vec<_> = records.iter().filter(|r| r.quantity == "sink").collect();
    let told: Vec<_> = lines.iter().map(|r| (r.engine.as_str(), r.solver.as_str())).collect();
    let both = |engine| [(engine, "one pass"), (engine, "soft")];
    let [cpu, gpu] = [both("tumble cpu"), both("tumble gpu")];
    assert_eq!(told, [cpu[0], cpu[1], gpu[0], gpu[1], ("other", "")]);
    let labels: Vec<_> = report::measures(&records)[0].curves.iter().map(|c| c.label.clone()).collect();
    assert_eq!(labels, ["tumble cpu, one pass", "tumble cpu, soft", "other"]);
}

#[test]
fn a_table_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("t.csv");
    let records = run(&[contestant("good", good), contestant("unable", unable)]);
    record::write(&path, &records).expect("written");
    assert_eq!(record::read(&path).expect("read"), records);
    std::fs::write(&path, "kind,case\ncase,x\n").expect("written");
    let error = record::read(&path).expect_err("a table of other columns");
    assert!(error.contains("t.csv") && error.contains("commit"), "{error}");
    std::fs::write(&path, "kind,case,commit\ncase,x,y\n").expect("written");
    let error = record::read(&path).expect_err("a line that lacks columns");
    assert!(error.contains("t.csv") && error.contains("engine"), "{error}");
    assert!(record::write(&folder.path().join("none/t.csv"), &records).is_err());
    assert!(record::read(&folder.path().join("none.csv")).is_err());
}

#[test]
fn quantiles_lie_between_neighbours() {
    assert_eq!(quantile(&[], 0.5), None);
    assert_eq!(quantile(&[3.0], 0.95), Some(3.0));
    assert_eq!(quantile(&[4.0, 1.0, 2.0], 0.5), Some(2.0));
    assert_eq!(quantile(&[1.0, 2.0], 0.25), Some(1.25));
}

/// The peers run the same scene as tumble: one second of a column, all close to where it stands (oracle: rest).
#[test]
fn engines_at_hand_hold_up_a_column() {
    let means = Means::default();
    let at_hand = engines::ALL.iter().filter(|c| (c.available)(&means).is_ok()).copied().collect::<Vec<_>>();
    assert!(at_hand.len() >= 2, "tumble's CPU side and rapier need nothing");
    for r in run(&at_hand) {
        // 26 mm is what the soft contacts of all of them give at 4 sub-steps.
        assert!(r.outcome == Outcome::Done && r.value.is_some_and(|sink| (0.0..0.05).contains(&sink)), "{r:?}");
        assert_eq!(r.kind, Kind::Case);
    }
}
