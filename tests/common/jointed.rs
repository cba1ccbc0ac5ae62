//! Scenes with joints, watched step by step: how far joints come apart, and what energy they gain.

use crate::beside::Any;
use tumble::prelude::*;
use tumble_bench::hard_cases::{Ask, By, Case};
use tumble_core::{Accuracy, JointSolver, measures};

/// Sides of tumble that joints are tested on.
pub(crate) const SIDES: &[By] = &By::OURS;
/// Where a GPU in software would take too long.
pub(crate) const CPU: &[By] = &[By::Cpu];
/// The same, and rapier.
pub(crate) const BESIDE: &[By] = &By::ALL;
/// Sub-steps of cases with joints: those that rapier takes of itself.
pub(crate) const JOINT_SUBSTEPS: u32 = 4;

/// So many sub-steps, on one thread.
pub(crate) fn params(substeps: u32) -> Params {
    Params { threads: Some(1), accuracy: Accuracy::Substeps(substeps), ..Params::default() }
}

/// What was seen of a scene with joints.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Watched {
    /// Largest separation of a joint, mm.
    pub(crate) apart: f64,
    /// The same in the second half of the run, mm.
    pub(crate) late: f64,
    /// Largest angle about locked axes and beyond limits, rad.
    pub(crate) angle: f64,
    /// Most energy above that of the start, as a height of the whole mass, mm.
    pub(crate) gained: f64,
    /// Deepest overlap in the second half, looked at ten times, mm.
    pub(crate) deepest: f64,
    /// Kinetic energy a kilogram of moving mass, mean of the last second, mJ/kg.
    pub(crate) resting: f64,
}

/// J.
pub(crate) fn energy(scene: &Scene, poses: &Poses, velocities: &Velocities) -> [f64; 2] {
    [measures::kinetic_energy(scene, poses, velocities), measures::potential_energy(scene, poses)]
}

/// Runs a scene. What is not finite is not small: it is infinite here.
pub(crate) fn watch(scene: &Scene, by: By, params: Params, steps: usize) -> Watched {
    let mut world = Any::new(by, scene, params);
    let (poses, velocities) = (measures::initial_poses(scene), measures::initial_velocities(scene));
    let start: f64 = energy(scene, &poses, &velocities).iter().sum();
    let mass: f64 = scene.bodies().map(|b| f64::from(scene.mass_properties(b).expect("living").mass)).sum();
    let larger = |a: f64, b: f64| if b.is_nan() { f64::INFINITY } else { a.max(b) };
    let mut seen = Watched::default();
    // Looking at large scenes takes longer than stepping.
    let every = if scene.len() > 150 { 5 } else { 1 };
    for step in (every..=steps).step_by(every) {
        world.steps(every);
        let (poses, velocities) = world.state();
        let error = measures::joint_error(scene, &poses);
        let [kinetic, potential] = energy(scene, &poses, &velocities);
        seen.apart = larger(seen.apart, 1e3 * error.max_m);
        seen.angle = larger(seen.angle, error.max_rad);
        seen.gained = larger(seen.gained, 1e3 * (kinetic + potential - start) / (9.81 * mass));
        if 2 * step > steps {
            seen.late = larger(seen.late, 1e3 * error.max_m);
            if step % (steps / 20).next_multiple_of(every) == 0 {
                seen.deepest = larger(seen.deepest, 1e3 * measures::penetration(scene, &poses).max_m);
            }
        }
        if step + 60 > steps {
            seen.resting += 1e3 * kinetic / mass * every as f64 / 60.0;
        }
    }
    seen
}

/// A world of ours, its steps, and the coordinates of a joint after each.
pub(crate) fn coordinates(world: &mut World, joint: JointHandle) -> [f64; 6] {
    let poses = world.poses().expect("poses");
    measures::joint_coordinates(world.scene(), &poses, joint).expect("a joint of the scene")
}

/// With Gauss-Seidel alone.
pub(crate) fn gauss_seidel(substeps: u32) -> Params {
    Params { joints: JointSolver::GaussSeidel, ..params(substeps) }
}

/// Records a number, and says what does not hold of it on one of our sides.
pub(crate) fn row(
    case: &Case,
    by: By,
    substeps: u32,
    quantity: &str,
    unit: &str,
    value: f64,
    ask: Ask,
) -> Result<(), String> {
    let ask = if by == By::Rapier && !matches!(ask, Ask::Beside(_)) { Ask::Said } else { ask };
    if case.row(by, substeps, quantity, unit, value, ask) {
        return Ok(());
    }
    Err(format!("{}: {by:?}: {quantity}: {value} {unit} for {ask:?}", case.name()))
}

/// What does not hold of our sides, told at once.
#[track_caller]
pub(crate) fn all_held(held: Vec<Result<(), String>>) {
    let missed: Vec<String> = held.into_iter().filter_map(Result::err).collect();
    assert!(missed.is_empty(), "{missed:#?}");
}
