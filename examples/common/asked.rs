//! What both programs may be told: a scene and how it runs; and what is wrong with a command line, in one line.

use clap::builder::PossibleValuesParser;
use clap::{Parser, ValueEnum};
use tumble::core::scenes::{self, StandardScene};
use tumble::{Accuracy, Backend, Broadphase, Error, Params};

const MOST_BODIES: u32 = 5_000_000;
/// What the process holds at most for each body, as seen with 100,000 of them: on the CPU side, contacts included, and
/// of the scene alone.
const BYTES_A_BODY: u64 = 6000;
const BYTES_A_BODY_OF_SCENE: u64 = 1000;

/// Why the program ends early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line asks for what cannot be.
    Argument(String),
    /// What was asked for failed.
    Run(String),
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Invalid { .. } => Self::Argument(error.to_string()),
            _ => Self::Run(error.to_string()),
        }
    }
}

/// A scene and how it runs.
#[derive(Debug, clap::Args)]
pub(crate) struct Asked {
    /// The scene
    #[arg(value_parser = PossibleValuesParser::new(scenes::ALL.iter().map(|s| s.name)))]
    scene: Option<String>,
    /// Dynamic bodies, 1 to 5,000,000; the scene takes as many as its form allows, never more [default: the scene's]
    #[arg(long, value_name = "N", value_parser = |text: &str| whole(text, MOST_BODIES), allow_hyphen_values = true)]
    bodies: Option<u32>,
    /// Where it runs: `auto` takes a GPU, or the CPU where there is none; `gpu` takes a software adapter too
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
    /// What finds the pairs of bodies that are near each other
    #[arg(long, value_enum, default_value = "auto")]
    broadphase: BroadphaseName,
    /// Length of a step in seconds [default: 1/60]
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    dt: Option<f32>,
    /// Sub-steps a step; with a tolerance, the most that an island may take: a multiple of 8 [default: 8, or 32]
    #[arg(long, value_name = "N", value_parser = |text: &str| whole(text, 256), allow_hyphen_values = true)]
    substeps: Option<u32>,
    /// Overlap that may be left, in metres: each island takes the sub-steps that it needs [default: all take the same]
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    tolerance: Option<f32>,
    /// Separation of joints that may be left, in metres, as for --tolerance [default: the same as that; each of the two
    /// takes the other's value where it is left out]
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    joint_tolerance: Option<f32>,
    /// Threads of the CPU side [default: one a core]
    #[arg(long, value_name = "N", value_parser = |text: &str| whole(text, 1024), allow_hyphen_values = true)]
    threads: Option<u32>,
    /// Time each pass too, which makes the steps a little slower
    #[arg(long)]
    profile: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum BackendName {
    Auto,
    Cpu,
    Gpu,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum BroadphaseName {
    Auto,
    BruteForce,
    Grid,
    SlicedGrid,
    Lbvh,
    SweepAndPrune,
}

impl Asked {
    /// Refused if no step can run with them.
    pub(crate) fn params(&self) -> Result<Params, Failure> {
        let mut params = Params { profile: self.profile, ..Params::default() };
        params.dt = self.dt.unwrap_or(params.dt);
        params.accuracy = self.accuracy().unwrap_or(params.accuracy);
        params.threads = self.threads.map(|n| n as usize);
        params.broadphase = match self.broadphase {
            BroadphaseName::Auto => Broadphase::Auto,
            BroadphaseName::BruteForce => Broadphase::BruteForce,
            BroadphaseName::Grid => Broadphase::Grid,
            BroadphaseName::SlicedGrid => Broadphase::SlicedGrid,
            BroadphaseName::Lbvh => Broadphase::Lbvh,
            BroadphaseName::SweepAndPrune => Broadphase::SweepAndPrune,
        };
        if let (None, Some(joint)) = (self.tolerance, self.joint_tolerance) {
            // Of the two that take its value, the one that was given is named where it is not allowed.
            let accuracy = Accuracy::Tolerance { penetration: 1e-3, joint, most: 32 };
            Params { accuracy, ..params }.validate()?;
        }
        params.validate()?;
        Ok(params)
    }

    fn accuracy(&self) -> Option<Accuracy> {
        let tolerances = (self.tolerance.or(self.joint_tolerance), self.joint_tolerance.or(self.tolerance));
        match tolerances {
            (Some(penetration), Some(joint)) => {
                Some(Accuracy::Tolerance { penetration, joint, most: self.substeps.unwrap_or(32) })
            }
            _ => self.substeps.map(Accuracy::Substeps),
        }
    }

    pub(crate) fn backend(&self) -> Backend {
        match self.backend {
            BackendName::Auto => Backend::Auto,
            BackendName::Cpu => Backend::Cpu,
            BackendName::Gpu => Backend::Gpu,
        }
    }

    /// The scene asked for, or else this one, and how many bodies it is to have.
    pub(crate) fn scene(&self, or: Option<&str>) -> Result<(&'static StandardScene, usize), Failure> {
        let Some(scene) = self.scene.as_deref().or(or).and_then(scenes::find) else {
            let names: Vec<_> = scenes::ALL.iter().map(|s| s.name).collect();
            return Err(Failure::Argument(format!("no scene is named; there are {}", names.join(", "))));
        };
        let bodies = self.bodies.map_or(scene.default_bodies, |n| n as usize);
        let bytes = if self.backend == BackendName::Gpu { BYTES_A_BODY_OF_SCENE } else { BYTES_A_BODY };
        let needed = bodies as u64 * bytes;
        match free_memory() {
            Some(free) if needed > free => Err(Failure::Argument(format!(
                "{bodies} bodies need some {:.1} GB of memory, and {:.1} GB are free; ask for fewer with --bodies",
                needed as f64 * 1e-9,
                free as f64 * 1e-9
            ))),
            _ => Ok((scene, bodies)),
        }
    }
}

/// Reads the command line. Help and version are printed here, and end the program.
pub(crate) fn parse<A: Parser>() -> Result<A, Failure> {
    A::try_parse().map_err(|error| {
        if !error.use_stderr() {
            error.exit();
        }
        Failure::Argument(one_line(&error.to_string()))
    })
}

/// A whole number from 1 to `most`.
pub(crate) fn whole(text: &str, most: u32) -> Result<u32, String> {
    let number = text.parse().ok().filter(|n| (1..=most).contains(n));
    number.ok_or_else(|| format!("expected a whole number from 1 to {most}"))
}

/// Width and height in pixels, with an `x` between them, each from `least` to `most`.
pub(crate) fn size(text: &str, least: u32, most: u32) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|n| (least..=most).contains(n));
    let both = text.split_once('x').and_then(|(width, height)| side(width).zip(side(height)));
    both.ok_or_else(|| format!("expected width and height in pixels as in 1280x720, each {least} to {most}"))
}

/// What clap says, without its usage lines.
fn one_line(message: &str) -> String {
    let told = |part: &&str| !["Usage:", "For more information"].iter().any(|start| part.starts_with(start));
    let lines = |part: &str| part.lines().map(str::trim).collect::<Vec<_>>().join(" ");
    let parts: Vec<_> =
        message.trim_start_matches("error: ").split("\n\n").map(str::trim).filter(told).map(lines).collect();
    parts.join("; ")
}

/// Bytes that the system can give without swapping, where it tells (Linux).
pub(crate) fn free_memory() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = told.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}
