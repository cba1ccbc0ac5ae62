//! A scene on both sides of tumble and in rapier, in one run, and what is left of it in the end. tumble with its default
//! number of sub-steps unless a case says otherwise, rapier with its own.

use rayon::prelude::*;
use tumble::prelude::*;
use tumble_bench::engines::RapierWorld;
use tumble_bench::hard_cases::{Ask, By, Case, RAPIER_SUBSTEPS};
use tumble_core::{Accuracy, measures};

use crate::common;

/// tumble's default.
pub(crate) const SUBSTEPS: u32 = 8;
/// The default, by its name.
pub(crate) const USUAL: Accuracy = Accuracy::Substeps(SUBSTEPS);
/// As many as each island needs for a tenth of a millimetre, 32 at most.
pub(crate) const ON_DEMAND: Accuracy = Accuracy::Tolerance { penetration: 1e-4, joint: 1e-4, most: 32 };

/// As a case of the table tells it.
pub(crate) fn named(accuracy: Accuracy) -> String {
    match accuracy {
        Accuracy::Tolerance { most, .. } => format!("on demand up to {most}"),
        _ => accuracy.to_string(),
    }
}

/// Our side with this accuracy, on one thread.
pub(crate) fn params(accuracy: Accuracy) -> Params {
    Params { threads: Some(1), accuracy, ..Params::default() }
}

/// A scene on our side of this name.
pub(crate) fn ours(by: By, scene: Scene, params: Params) -> World {
    if by == By::Cpu {
        return World::new(scene, params, Backend::Cpu).expect("valid");
    }
    World::Gpu(Box::new(tumble_gpu::World::with_gpu(common::gpu().clone(), scene, params).expect("valid")))
}

/// An engine with a scene in it.
pub(crate) enum Any {
    Ours(World),
    Rapier(Box<RapierWorld>),
}

impl Any {
    pub(crate) fn new(by: By, scene: &Scene, params: Params) -> Self {
        if by == By::Rapier {
            let usual = Params { accuracy: Accuracy::Substeps(RAPIER_SUBSTEPS), ..params };
            return Self::Rapier(Box::new(RapierWorld::new(scene, &usual, 1)));
        }
        Self::Ours(ours(by, scene.clone(), params))
    }

    pub(crate) fn steps(&mut self, count: usize) {
        for _ in 0..count {
            match self {
                Self::Ours(world) => world.step().expect("step"),
                Self::Rapier(world) => world.step(),
            }
        }
    }

    pub(crate) fn state(&mut self) -> (Poses, Velocities) {
        match self {
            Self::Ours(world) => (world.poses().expect("poses"), world.velocities().expect("velocities")),
            Self::Rapier(world) => (world.poses(), world.velocities()),
        }
    }
}

/// The sub-steps that this engine takes where tumble takes `ours`.
pub(crate) fn substeps(by: By, ours: u32) -> u32 {
    if by == By::Rapier { RAPIER_SUBSTEPS } else { ours }
}

/// What became of a scene; of one that fell, no other number has a meaning, and all are not numbers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct End {
    /// When some body had sunk or gone aside by more than the limit, s; infinite when it stands.
    pub(crate) fell: f64,
    /// Of the body that sank most, and of the one that went most to the side, mm.
    pub(crate) sink: f64,
    pub(crate) drift: f64,
    /// Overlap, mean of ten looks in the last second, mm.
    pub(crate) deepest: f64,
    pub(crate) mean: f64,
    /// Fastest body in the end, mm/s.
    pub(crate) fastest: f64,
    /// Kinetic energy a kilogram of moving mass, mean of ten looks in the last second, mJ/kg.
    pub(crate) energy: f64,
}

impl End {
    fn fallen(step: usize) -> Self {
        let nan = f64::NAN;
        let fell = step as f64 / 60.0;
        Self { fell, sink: nan, drift: nan, deepest: nan, mean: nan, fastest: nan, energy: nan }
    }
}

/// Looks between which a fall may go unseen, steps.
const LOOK: usize = 15;

/// Runs for `steps`, or until it falls: until a body has sunk or gone aside by `limit` (m).
pub(crate) fn run(scene: &Scene, by: By, params: Params, steps: usize, limit: f64) -> End {
    let moving: Vec<_> =
        scene.bodies().filter(|b| scene.body(*b).expect("living").body_type == RigidBodyType::Dynamic).collect();
    let mass: f64 = moving.iter().map(|b| f64::from(scene.mass_properties(*b).expect("living").mass)).sum();
    let starts = measures::initial_poses(scene);
    let mut world = Any::new(by, scene, params);
    let moved = |poses: &Poses| {
        let ways = moving.iter().map(|b| (poses[*b].translation - starts[*b].translation).as_dvec3());
        ways.fold((0.0f64, 0.0f64), |(sink, drift), way| (sink.max(-way.y), drift.max(way.x.hypot(way.z))))
    };
    // The scene runs to its last second, watched; then ten looks.
    for step in (LOOK..=steps - 60).step_by(LOOK) {
        world.steps(LOOK);
        if limit.is_finite() {
            let (sink, drift) = moved(&world.state().0);
            if sink.max(drift) > limit {
                return End::fallen(step);
            }
        }
    }
    world.steps((steps - 60) % LOOK);
    let (mut deepest, mut mean, mut energy) = (0.0, 0.0, 0.0);
    for _ in 0..10 {
        world.steps(6);
        let (poses, velocities) = world.state();
        let overlap = measures::penetration(scene, &poses);
        deepest += 100.0 * overlap.max_m;
        mean += 100.0 * overlap.mean_m;
        energy += 100.0 * measures::kinetic_energy(scene, &poses, &velocities) / mass;
    }
    let (poses, velocities) = world.state();
    if let Any::Ours(world) = &mut world {
        let report = world.sync().expect("report");
        assert!(report.lost == 0 && report.quarantined == 0, "{report}");
    }
    let (sink, drift) = moved(&poses);
    let fastest = moving.iter().map(|b| f64::from(velocities[*b].linear.length())).fold(0.0, f64::max);
    if sink.max(drift) > limit {
        return End::fallen(steps - 1);
    }
    End { fell: f64::INFINITY, sink: 1e3 * sink, drift: 1e3 * drift, deepest, mean, fastest: 1e3 * fastest, energy }
}

/// A number of an [`End`].
#[derive(Clone, Copy)]
pub(crate) struct Quantity {
    name: &'static str,
    unit: &'static str,
    of: fn(&End) -> f64,
    /// What counts as none.
    floor: f64,
}

const fn quantity(name: &'static str, unit: &'static str, of: fn(&End) -> f64, floor: f64) -> Quantity {
    Quantity { name, unit, of, floor }
}

pub(crate) const SINK: Quantity = quantity("sink", "mm", |e| e.sink, 0.1);
pub(crate) const DRIFT: Quantity = quantity("sideways drift", "mm", |e| e.drift, 0.1);
pub(crate) const DEEPEST: Quantity = quantity("deepest overlap", "mm", |e| e.deepest, 0.1);
pub(crate) const MEAN: Quantity = quantity("mean overlap", "mm", |e| e.mean, 0.1);
pub(crate) const FASTEST: Quantity = quantity("fastest body", "mm/s", |e| e.fastest, 1.0);
/// The floor is that of a body at 1 mm/s.
pub(crate) const ENERGY: Quantity = quantity("residual energy", "mJ/kg", |e| e.energy, 5e-4);

/// What is held of a number: no more than this share of rapier's, or than that many of its units.
#[derive(Clone, Copy)]
pub(crate) struct Held(pub(crate) Quantity, pub(crate) f64, pub(crate) f64);

/// A number that is told.
pub(crate) fn told(quantity: Quantity) -> Held {
    Held(quantity, 0.0, f64::INFINITY)
}

/// What is run, and how long.
pub(crate) struct Plan<'a> {
    /// One, or the same with other seeds: medians are told.
    pub(crate) scenes: &'a [Scene],
    /// tumble's.
    pub(crate) params: Params,
    pub(crate) steps: usize,
    /// Beyond this sink or drift it has fallen, m; infinite for what falls anyway.
    pub(crate) limit: f64,
    pub(crate) by: &'a [By],
    /// Whether tumble's must stand.
    pub(crate) stands: bool,
}

/// Runs it and records all numbers. Hands back what does not hold, for an assertion once all of a test's rows are there.
#[must_use]
pub(crate) fn compare(case: &Case, plan: &Plan, held: &[Held]) -> Vec<String> {
    let one = |by: By| {
        let run = |scene: &Scene| run(scene, by, plan.params, plan.steps, plan.limit);
        // One device for all: the GPU's worlds run in turn.
        let ends: Vec<End> = if by == By::Gpu {
            plan.scenes.iter().map(run).collect()
        } else {
            plan.scenes.par_iter().map(run).collect()
        };
        (by, ends)
    };
    let all: Vec<(By, Vec<End>)> = plan.by.iter().map(|&by| one(by)).collect();
    let median = |ends: &[End], of: fn(&End) -> f64| {
        let mut values: Vec<f64> = ends.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let n = |by| substeps(by, plan.params.accuracy.most());
    let mut missed = Vec::new();
    if plan.limit.is_finite() {
        let time = plan.steps as f64 / 60.0;
        for (by, ends) in &all {
            let ask = if *by == By::Rapier { Ask::Said } else { Ask::AtLeast(time) };
            let stands = case.row(*by, n(*by), "stands for", "s", median(ends, |e| e.fell), ask);
            if plan.stands && !stands {
                missed.push(format!("{by:?}: fell"));
            }
        }
    }
    for Held(Quantity { name, unit, of, floor }, share, most) in held {
        let value = |by| all.iter().find(|(b, _)| *b == by).map_or(f64::NAN, |(_, ends)| median(ends, *of));
        let theirs = value(By::Rapier);
        if By::OURS.into_iter().all(|by| value(by).is_nan()) {
            // Both have fallen, as the time that they stood has told.
            continue;
        }
        for &by in plan.by {
            let ours = value(by);
            case.row(by, n(by), name, unit, ours, Ask::Beside(*floor));
            // Where rapier's fell, its number is none and the other bound counts.
            let limit = (share * theirs).max(*most);
            // What is no number holds nothing.
            let holds = ours <= limit;
            if by != By::Rapier && plan.stands && !holds {
                missed.push(format!("{by:?}: {name} {ours} {unit}, more than {limit}"));
            }
        }
    }
    missed.iter().map(|text| format!("{}: {text}", case.name())).collect()
}

/// Panics with all that does not hold.
#[track_caller]
pub(crate) fn all_hold(missed: impl IntoIterator<Item = Vec<String>>) {
    let missed: Vec<String> = missed.into_iter().flatten().collect();
    assert!(missed.is_empty(), "{missed:#?}");
}
