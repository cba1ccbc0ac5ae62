//! The engines, behind one face: the same scene, the same dt, sub-steps and threads; sleep off; everything else as each
//! engine has it at first. How they differ is told by [`DIFFERS`] and by what an engine says of itself.

#[cfg(feature = "box3d")]
mod box3d;
mod ours;
mod rapier;
mod script;

pub use rapier::RapierWorld;

use crate::record::Outcome;
use crate::report::is_ours;
use std::fmt;
use std::path::PathBuf;
use std::time::Instant;
use tumble_core::{Accuracy, Broadphase, Params, Poses, Scene, Solver, StageTime, Velocities};
use tumble_gpu::Gpu;

/// What every engine is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// Length of a step, s.
    pub dt: f32,
    /// Sub-steps a step.
    pub substeps: u32,
    /// Threads, where it runs on the CPU.
    pub threads: usize,
    /// tumble's broad phase; the others have their own.
    pub broadphase: Broadphase,
    /// How tumble solves; the others have ways of their own.
    pub method: Method,
    /// Times the stages too, where the engine can.
    pub profile: bool,
}

/// How tumble solves.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Method {
    /// The solver.
    pub solver: Solver,
    /// Overlap that may be left, m: then the setting's sub-steps are the most that an island may take, and must be a
    /// multiple of 8.
    pub tolerance: Option<f32>,
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.tolerance {
            Some(tolerance) => write!(f, "{} within {} mm", self.solver, (1e6 * f64::from(tolerance)).round() / 1e3),
            None => self.solver.fmt(f),
        }
    }
}

impl Method {
    /// As the world is told, with so many sub-steps.
    pub fn accuracy(&self, substeps: u32) -> Accuracy {
        match self.tolerance {
            Some(tolerance) => Accuracy::Tolerance { penetration: tolerance, joint: tolerance, most: substeps },
            None => Accuracy::Substeps(substeps),
        }
    }

    /// Whether there is such an accuracy.
    pub fn fits(&self, substeps: u32) -> bool {
        Params { accuracy: self.accuracy(substeps), ..Params::default() }.validate().is_ok()
    }
}

/// What engines run on, besides the CPU.
#[derive(Debug, Clone, Default)]
pub struct Means {
    /// The device that tumble's GPU side runs on.
    pub gpu: Option<Gpu>,
    /// An interpreter that has the wheels of nexus and MuJoCo.
    pub python: Option<PathBuf>,
    /// Its processes that wait for their next scene.
    idle: script::Idle,
}

impl Means {
    /// Of a device and an interpreter.
    pub fn new(gpu: Option<Gpu>, python: Option<PathBuf>) -> Self {
        Self { gpu, python, idle: script::Idle::default() }
    }
}

/// What an engine says of itself.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Facts {
    /// Its version.
    pub version: String,
    /// Where it runs.
    pub adapter: String,
    /// The broad phase that was asked for; empty where there is no choice.
    pub broadphase: String,
    /// The solver that ran; empty where there is no choice.
    pub solver: String,
    /// How its setting differs from the others'.
    pub differs: Vec<String>,
    /// Bytes that any solver would have to move in the last step: positions, rotations and velocities of all bodies and
    /// the impulses of all contact points, once in and once out. Not told by the peers.
    pub floor_bytes: Option<u64>,
}

/// Why an engine does not run a scene.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// It has no means for what the scene needs.
    Unmodelled(String),
    /// The scene is too large for it, or for the machine.
    TooMany(String),
    /// It is not there, or it failed.
    Failed(String),
}

impl Refusal {
    /// As the table has it: how the measurement ended, and the note.
    pub fn told(self) -> (Outcome, String) {
        match self {
            Self::Unmodelled(what) => (Outcome::Unmodelled, what),
            Self::TooMany(what) => (Outcome::Slow, what),
            Self::Failed(what) => (Outcome::Failed, what),
        }
    }
}

/// A scene in some engine.
pub trait Engine {
    /// Runs so many steps; the milliseconds of each on the host's clock, its result waited for.
    ///
    /// # Errors
    /// What the engine says.
    fn step(&mut self, count: u32) -> Result<Vec<f64>, String>;

    /// Poses and velocities after the last step.
    ///
    /// # Errors
    /// What the engine says.
    fn state(&mut self) -> Result<(Poses, Velocities), String>;

    /// What it says of itself, after at least one step.
    fn facts(&mut self) -> Facts;

    /// Whether the steps so far kept what the engine promises.
    ///
    /// # Errors
    /// What it lost.
    fn check(&mut self) -> Result<(), String> {
        Ok(())
    }

    /// Stages of the last step, where they were timed.
    fn stages(&mut self) -> Vec<StageTime> {
        Vec::new()
    }
}

/// Makes a scene in an engine.
pub type Make = fn(&Scene, &Setting, &Means) -> Result<Box<dyn Engine>, Refusal>;

/// An engine that can be asked for.
#[derive(Clone, Copy)]
pub struct Contestant {
    /// As in the table.
    pub name: &'static str,
    /// Milliseconds that a step of one body takes, roughly, for the progress bar: without sub-steps, and a sub-step.
    pub cost: [f64; 2],
    /// Bodies that it is given at most: with more, its scene alone takes minutes to load.
    pub most_bodies: usize,
    /// Makes it.
    pub make: Make,
    /// Whether these means let it run; otherwise why not.
    pub available: fn(&Means) -> Result<(), String>,
}

/// All engines that this program was built with.
pub const ALL: &[Contestant] = &[
    Contestant {
        name: "tumble cpu",
        cost: [6e-4, 1.5e-4],
        most_bodies: usize::MAX,
        make: ours::cpu,
        available: |_| Ok(()),
    },
    Contestant {
        name: "tumble gpu",
        cost: [2e-3, 1.5e-3],
        most_bodies: usize::MAX,
        make: ours::gpu,
        available: ours::has_gpu,
    },
    Contestant {
        name: "rapier",
        cost: [6e-4, 1.5e-4],
        most_bodies: usize::MAX,
        make: rapier::make,
        available: |_| Ok(()),
    },
    #[cfg(feature = "box3d")]
    Contestant {
        name: "box3d",
        cost: [4e-4, 1.5e-4],
        most_bodies: usize::MAX,
        make: box3d::make,
        available: |_| Ok(()),
    },
    Contestant {
        name: "nexus",
        cost: [4e-3, 2e-3],
        most_bodies: 6000,
        make: script::nexus,
        available: script::has_nexus,
    },
    Contestant {
        name: "mujoco",
        cost: [0.0, 1e-2],
        most_bodies: 1000,
        make: script::mujoco,
        available: script::has_mujoco,
    },
    Contestant {
        name: "mujoco stiff",
        cost: [0.0, 1e-2],
        most_bodies: 1000,
        make: script::stiff_mujoco,
        available: script::has_mujoco,
    },
];

impl Contestant {
    /// The solver that it is to run with, as in the table; empty where there is no choice.
    pub fn solver(&self, setting: &Setting) -> String {
        if is_ours(self.name) { setting.method.to_string() } else { String::new() }
    }

    /// Makes the scene in the engine, if it may have so many bodies.
    ///
    /// # Errors
    /// Why it does not run.
    pub fn start(
        &self,
        scene: &Scene,
        bodies: usize,
        setting: &Setting,
        means: &Means,
    ) -> Result<Box<dyn Engine>, Refusal> {
        if bodies > self.most_bodies {
            return Err(Refusal::TooMany(format!(
                "not run: more than {} bodies take minutes to load",
                self.most_bodies
            )));
        }
        (self.make)(scene, setting, means)
    }
}

/// Differences that hold for a whole engine, whatever the scene: engine, and what a reader must know.
pub const DIFFERS: &[(&str, &str)] = &[
    ("all", "Same shapes, masses, friction coefficients, dt, sub-steps and threads; sleep off; nothing tuned."),
    (
        "tumble gpu",
        "Every step is waited for (submit, run, status read back), as a caller would who needs each result.",
    ),
    (
        "rapier",
        "Version 0.36 with its feature `parallel` and f32; its defaults, among them contact softness of 30 Hz, damping \
         5 and friction in the second pass of a sub-step.",
    ),
    ("box3d", "C code built at -O2 with its SIMD, by the crate boxddd; its defaults. Half-spaces are large boxes."),
    (
        "mujoco",
        "One global solve a step (Newton), f64; no sub-steps: with n sub-steps it runs n whole steps of dt/n. Its contacts \
         are as soft as its default time constant of 0.02 s makes them, however small the step; `mujoco stiff` has the \
         shortest that it allows, two of its steps.",
    ),
];

/// Refuses a scene with joints, for engines that are not told of them.
fn without_joints(scene: &Scene) -> Result<(), Refusal> {
    if scene.joint_count() == 0 { Ok(()) } else { Err(Refusal::Unmodelled("joints".into())) }
}

/// Half the edge of a box that stands for a half-space in an engine without them, m: it reaches well past every body.
fn half_space_edge(scene: &Scene) -> f32 {
    let far = scene.bodies().filter_map(|b| scene.body(b).ok()).map(|b| b.translation.abs().max_element());
    far.fold(0.0, f32::max) * 1.5 + 100.0
}

/// Runs `step` so many times; ms of each.
fn timed(count: u32, mut step: impl FnMut() -> Result<(), String>) -> Result<Vec<f64>, String> {
    (0..count)
        .map(|_| {
            let begin = Instant::now();
            step().map(|()| begin.elapsed().as_secs_f64() * 1e3)
        })
        .collect()
}
