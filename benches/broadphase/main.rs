//! Time to find all overlapping pairs, beside parry's tree and rapier's broad phase in one run:
//! `cargo bench --bench broadphase`.
//!
//! All get the same boxes and take turns, so that a noisy machine harms all alike; times are medians, and pair counts are
//! compared. *Fresh*: everything is built anew. *Steady*: bodies fly on by a step, and what can be kept is.
//! `--quick` runs a little of everything, as a test; `--out DIR` writes `broadphase.csv` and a picture;
//! `--threads N` for another number than the machine's cores; `--fastest` shows each contestant's fastest round instead
//! of the median, for a machine that others use too; `--no-gpu` leaves the GPU out; `--most N` leaves larger crowds out, `--only NAME` those of other names.

#[path = "../../tests/common/cloud.rs"]
mod cloud;
#[cfg(feature = "gpu")]
mod on_gpu;
mod ours;
mod peers;
mod picture;

use cloud::Cloud;
use ours::Lbvh;
use peers::{Parry, Rapier};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use tumble_core::layout::Aabb;
use tumble_core::scenes::{Crowd, crowd};
use tumble_core::{Broadphase, MortonBits, Spread, Traversal};

/// Laps of one run.
pub(crate) struct Watch {
    last: Instant,
    laps: Vec<f64>,
}

impl Watch {
    pub(crate) fn new() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    /// Ends a lap: first what is built, then the search.
    pub(crate) fn lap(&mut self) {
        let now = Instant::now();
        self.laps.push((now - self.last).as_secs_f64() * 1e3);
        self.last = now;
    }

    pub(crate) fn sample(self, pairs: u64, bytes: u64) -> Sample {
        Sample { build: self.laps[0], pairs: self.laps[1], found: pairs, bytes }
    }
}

/// One run of one contestant; ms.
#[derive(Clone, Copy)]
pub(crate) struct Sample {
    build: f64,
    pairs: f64,
    found: u64,
    bytes: u64,
}

/// A contestant on one crowd.
pub(crate) struct Row {
    pub(crate) crowd: String,
    pub(crate) count: usize,
    pub(crate) what: &'static str,
    pub(crate) build: f64,
    pub(crate) pairs: f64,
    pub(crate) total: f64,
    found: u64,
    bytes: f64,
    /// Our total over parry's and rapier's of the same kind; NaN where there is none.
    over: [f64; 2],
}

fn median(times: impl Iterator<Item = f64>) -> f64 {
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    if FASTEST.load(Ordering::Relaxed) { times[0] } else { times[times.len() / 2] }
}

/// What stands for all rounds: the median, or the fastest where others use the machine too.
static FASTEST: AtomicBool = AtomicBool::new(false);

/// What runs once on the boxes of a step.
type Steady<'a> = Box<dyn FnMut(&[Aabb]) -> Sample + 'a>;

/// Name, and what runs once more.
type Contestant<'a> = (&'static str, Box<dyn FnMut() -> Sample + 'a>);

/// All take turns; the first run of each is not counted. Those far behind run once more only.
fn contest(kind: Crowd, count: usize, rounds: usize, mut contestants: Vec<Contestant>) -> Vec<Row> {
    let first: Vec<f64> = contestants.iter_mut().map(|(_, run)| run()).map(|s| s.build + s.pairs).collect();
    let fastest = first.iter().copied().fold(f64::INFINITY, f64::min);
    let mut samples = vec![Vec::new(); contestants.len()];
    for round in 0..rounds {
        for (i, (_, run)) in contestants.iter_mut().enumerate() {
            if round == 0 || first[i] < 6.0 * fastest {
                samples[i].push(run());
            }
        }
    }
    let rows = contestants.iter().zip(&samples).map(|((what, _), samples)| Row {
        crowd: kind.to_string(),
        count,
        what,
        build: median(samples.iter().map(|s| s.build)),
        pairs: median(samples.iter().map(|s| s.pairs)),
        total: median(samples.iter().map(|s| s.build + s.pairs)),
        found: samples[0].found,
        bytes: samples[0].bytes as f64 / count as f64,
        over: [f64::NAN; 2],
    });
    let mut rows: Vec<Row> = rows.collect();
    let total = |what: &str| rows.iter().find(|row| row.what.starts_with(what)).map_or(f64::NAN, |row| row.total);
    let peers = [total("parry"), total("rapier")];
    rows.iter_mut().for_each(|row| row.over = peers.map(|peer| row.total / peer));
    rows
}

fn print(rows: &[Row]) {
    println!(
        "  {:<22} {:>10} {:>10} {:>10}   {:>8} {:>8} {:>9} {:>9}",
        "ms", "build", "pairs", "both", "x parry", "x rapier", "B/body", "pairs"
    );
    for row in rows {
        println!(
            "  {:<22} {:10.3} {:10.3} {:10.3}   {:8.2} {:8.2} {:9.0} {:9}",
            row.what, row.build, row.pairs, row.total, row.over[0], row.over[1], row.bytes, row.found
        );
    }
}

/// Name of the row of what `Broadphase::Auto` stands for.
fn row_name(spread: &Spread, rows: &[Row]) -> &'static str {
    let kept = rows.iter().any(|row| row.what == "lbvh, refitted");
    match (Broadphase::Auto.resolve(spread), spread.is_wide()) {
        (Broadphase::BruteForce, _) => "brute force",
        (Broadphase::Grid, true) => "grid, tree",
        (Broadphase::Grid, false) => "grid, list",
        (Broadphase::SlicedGrid, true) => "sliced, tree",
        (Broadphase::SlicedGrid, false) => "sliced, list",
        (Broadphase::SweepAndPrune, _) => "sweep",
        _ if kept => "lbvh, refitted",
        _ => "lbvh",
    }
}

/// Everything built anew.
fn fresh(kind: Crowd, count: usize, aabbs: &[Aabb], cloud: &Cloud, rounds: usize) -> Vec<Row> {
    let step = &cloud.step;
    let mut rapier = Rapier::new(aabbs, 1e-6);
    let tree = |bits, traversal| move || Lbvh::build(aabbs, bits, traversal).1;
    let mut contestants: Vec<Contestant> = vec![
        ("grid, list", Box::new(|| ours::grid(aabbs, step, false, false))),
        ("grid, tree", Box::new(|| ours::grid(aabbs, step, false, true))),
        ("sliced, list", Box::new(|| ours::grid(aabbs, step, true, false))),
        ("sliced, tree", Box::new(|| ours::grid(aabbs, step, true, true))),
        ("lbvh", Box::new(tree(MortonBits::Bits30, Traversal::Escape))),
        ("lbvh, history", Box::new(tree(MortonBits::Bits30, Traversal::History))),
        ("lbvh, stack", Box::new(tree(MortonBits::Bits30, Traversal::Stack))),
        ("lbvh, 63 bits", Box::new(tree(MortonBits::Bits63, Traversal::Escape))),
        ("sweep", Box::new(|| ours::sweep(aabbs))),
        ("parry bvh", Box::new(|| Parry::build(aabbs).1)),
        ("rapier, first update", Box::new(|| rapier.first())),
    ];
    if count <= 10_000 {
        contestants.insert(0, ("brute force", Box::new(|| ours::brute_force(aabbs))));
    }
    let rows = contest(kind, count, rounds, contestants);
    let found = rows[0].found;
    for row in &rows {
        // Rapier's boxes are rounded otherwise, and it takes fixed ones for moving here.
        let rapier = row.what.starts_with("rapier");
        let too_long = row.what == "sweep" && row.found == 0;
        let same = if rapier { row.found >= found } else { row.found == found || too_long };
        assert!(same, "{kind} of {count}: {} finds {} pairs, others {found}", row.what, row.found);
    }
    rows
}

/// Bodies fly on by `STEPS` steps in each round; a sample is the mean of those.
fn steady(kind: Crowd, count: usize, cloud: &mut Cloud, rounds: usize) -> Vec<Row> {
    const STEPS: usize = 4;
    let first = cloud.boxes();
    let frames: Vec<Vec<Aabb>> = (0..STEPS * (rounds + 1))
        .map(|_| {
            cloud.fly(1.0);
            cloud.boxes()
        })
        .collect();
    let (mut lbvh, _) = Lbvh::build(&first, MortonBits::Bits30, Traversal::Escape);
    let (mut anew, _) = Lbvh::build(&first, MortonBits::Bits30, Traversal::Escape);
    let (mut parry, _) = Parry::build(&first);
    let mut rapier = Rapier::new(&first, 1.0);
    rapier.first();
    let (step, turns) = (cloud.step, std::cell::Cell::new(0));
    let mut runs: Vec<(&'static str, Steady)> = vec![
        ("grid, list", Box::new(move |f| ours::grid(f, &step, false, false))),
        ("grid, tree", Box::new(move |f| ours::grid(f, &step, false, true))),
        ("sliced, list", Box::new(move |f| ours::grid(f, &step, true, false))),
        ("sliced, tree", Box::new(move |f| ours::grid(f, &step, true, true))),
        ("sweep", Box::new(ours::sweep)),
        ("lbvh, built anew", Box::new(|f| anew.refit(f, true).0)),
        (
            "lbvh, refitted",
            Box::new(|f| {
                let (sample, walked) = lbvh.refit(f, false);
                turns.set(walked);
                sample
            }),
        ),
        ("parry bvh, refitted", Box::new(|f| parry.refit(f))),
        (
            "rapier, update",
            Box::new(|f| {
                rapier.place(f);
                rapier.update()
            }),
        ),
    ];
    if count <= 10_000 {
        runs.insert(0, ("brute force", Box::new(ours::brute_force)));
    }
    let contestants = runs.iter_mut().map(|(what, run)| {
        let mut round = frames.chunks(STEPS);
        let run: Box<dyn FnMut() -> Sample> = Box::new(move || {
            let samples: Vec<Sample> = round.next().expect("a round").iter().map(|f| run(f)).collect();
            let mean = |part: fn(&Sample) -> f64| samples.iter().map(part).sum::<f64>() / STEPS as f64;
            Sample { build: mean(|s| s.build), pairs: mean(|s| s.pairs), ..samples[STEPS - 1] }
        });
        (*what, run)
    });
    let rows = contest(kind, count, rounds, contestants.collect());
    let row = |what| rows.iter().find(|row: &&Row| row.what == what).expect("a row");
    let (anew, refitted) = (row("lbvh, built anew"), row("lbvh, refitted"));
    let a_turn = refitted.pairs / f64::from(turns.get());
    let build = (anew.build - refitted.build) / a_turn / count as f64;
    println!(
        "  a build takes as long as {build:.0} turns a leaf; walks take {:.0}",
        f64::from(turns.get()) / count as f64
    );
    rows
}

struct Settings {
    threads: usize,
    quick: bool,
    most: usize,
    /// Crowds whose names begin so.
    only: String,
}

impl Settings {
    /// Enough rounds to take a median of, and no more time than a coffee.
    fn rounds(&self, count: usize) -> usize {
        if self.quick { 1 } else { (300_000 / count.max(1)).clamp(3, 25) }
    }
}

/// What the rule says, and how much longer that takes than the best of ours.
struct Choice {
    crowd: String,
    count: usize,
    spread: Spread,
    auto: &'static str,
    best: &'static str,
    /// Time of the chosen over that of the best.
    regret: f64,
}

fn judge(kind: Crowd, count: usize, spread: Spread, rows: &[Row]) -> Choice {
    let auto = row_name(&spread, rows);
    let kept = if rows.iter().any(|row| row.what == "lbvh, refitted") { "lbvh, refitted" } else { "lbvh" };
    let choices = ["brute force", "grid, list", "grid, tree", "sliced, list", "sliced, tree", kept, "sweep"];
    let best = rows.iter().filter(|row| choices.contains(&row.what)).min_by(|a, b| a.total.total_cmp(&b.total));
    let best = best.expect("a row");
    let chosen = rows.iter().find(|row| row.what == auto).map_or(f64::NAN, |row| row.total);
    Choice { crowd: kind.to_string(), count, spread, auto, best: best.what, regret: chosen / best.total }
}

fn on_cpu(settings: &Settings) -> (Vec<Row>, Vec<Row>, Vec<Choice>) {
    let (mut fresh_rows, mut steady_rows, mut choices) = (Vec::new(), Vec::new(), Vec::new());
    let thousand = if settings.quick { 10 } else { 1000 };
    let mut cases: Vec<(Crowd, usize)> = [1, 10, 100, 1000].map(|k| (Crowd::Uniform, k * thousand)).into();
    cases.extend([1.0, 3.0, 10.0, 30.0, 100.0, 1000.0].map(|ratio| (Crowd::Ratio(ratio), 100 * thousand)));
    let others = [Crowd::Clustered, Crowd::Line, Crowd::Plane, Crowd::Fast, Crowd::Far, Crowd::Liu];
    cases.extend(others.map(|kind| (kind, 100 * thousand)));
    cases.extend([(Crowd::OnePoint, thousand), (Crowd::Ratio(10.0), thousand), (Crowd::Ratio(1000.0), 10 * thousand)]);
    cases.extend([30, 60, 125, 250, 500].map(|count| (Crowd::Uniform, count)));
    cases.extend([60, 250].map(|count| (Crowd::Ratio(1000.0), count)));
    let wanted =
        |(kind, count): &(Crowd, usize)| *count <= settings.most && kind.to_string().starts_with(&settings.only);
    for (kind, count) in cases.into_iter().filter(wanted) {
        let scene = crowd(kind, count);
        let mut cloud = Cloud::new(&scene);
        let aabbs = cloud.boxes();
        let rounds = settings.rounds(count);
        let rows = fresh(kind, count, &aabbs, &cloud, rounds);
        println!("{kind}, {count} bodies, fresh, {rounds} rounds");
        print(&rows);
        let steady = match count <= 100 * thousand {
            true => steady(kind, count, &mut cloud, rounds.min(6)),
            false => Vec::new(),
        };
        if !steady.is_empty() {
            println!("{kind}, {count} bodies, steady");
            print(&steady);
        }
        // A world keeps what it can.
        let judged = if steady.is_empty() { &rows } else { &steady };
        let choice = judge(kind, count, Spread::of(&scene), judged);
        println!("  auto: {}, {:.2} of the best ({}); {:?}", choice.auto, choice.regret, choice.best, choice.spread);
        steady_rows.extend(steady);
        fresh_rows.extend(rows);
        choices.push(choice);
    }
    (fresh_rows, steady_rows, choices)
}

fn csv(fresh: &[Row], steady: &[Row], choices: &[Choice]) -> String {
    let mut text =
        String::from("kind,crowd,bodies,what,build_ms,pairs_ms,both_ms,over_parry,over_rapier,bytes_a_body,pairs\n");
    for (kind, rows) in [("fresh", fresh), ("steady", steady)] {
        for row in rows {
            let Row { crowd, count, what, build, pairs, total, found, bytes, over: [parry, rapier] } = row;
            text += &format!(
                "{kind},{crowd},{count},\"{what}\",{build:.4},{pairs:.4},{total:.4},{parry:.3},{rapier:.3},{bytes:.0},{found}\n"
            );
        }
    }
    text += "\nrule,crowd,bodies,auto,best,over_best,size_ratio,abreast\n";
    for Choice { crowd, count, auto, best, regret, spread } in choices {
        let Spread { size_ratio, abreast, .. } = spread;
        text += &format!("rule,{crowd},{count},\"{auto}\",\"{best}\",{regret:.3},{size_ratio:.2},{abreast:.1}\n");
    }
    text
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let has = |flag: &str| arguments.iter().any(|a| a == flag);
    let value = |flag: &str| arguments.iter().position(|a| a == flag).and_then(|at| arguments.get(at + 1));
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let threads = value("--threads").map_or(threads, |n| n.parse().expect("--threads wants a number"));
    FASTEST.store(has("--fastest"), Ordering::Relaxed);
    let most = value("--most").map_or(usize::MAX, |n| n.parse().expect("--most wants a number of bodies"));
    let only = value("--only").cloned().unwrap_or_default();
    let settings = Settings { threads, quick: has("--quick"), most, only };
    println!("{} threads, ours and theirs", settings.threads);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(settings.threads).build().expect("threads start");
    let (fresh, steady, choices) = pool.install(|| on_cpu(&settings));
    #[cfg(feature = "gpu")]
    let gpu = if has("--no-gpu") { String::new() } else { on_gpu::on_gpu(settings.quick) };
    #[cfg(not(feature = "gpu"))]
    let gpu = String::new();
    if has("--out") {
        let folder = value("--out").expect("--out wants a folder");
        std::fs::create_dir_all(folder).expect("the folder can be made");
        let write = |name: &str, text: String| {
            std::fs::write(format!("{folder}/{name}"), text).unwrap_or_else(|error| panic!("{name}: {error}"));
        };
        write("broadphase.csv", csv(&fresh, &steady, &choices) + &gpu);
        write("broadphase.svg", picture::svg(&fresh));
    }
}
