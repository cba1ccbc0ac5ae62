//! What the command line may say; what is wrong with it, in one line.

use clap::builder::PossibleValuesParser;
use clap::{Parser, ValueEnum};
use tumble::core::scenes::{self, StandardScene};
use tumble::{Backend, Broadphase, Error, Params};

const MOST_BODIES: u32 = 5_000_000;

/// Why the program ends early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The command line asks for what cannot be.
    Argument(String),
    /// There is nothing to show it on, or the device failed.
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

/// Shows a standard scene in a window, at real time, to look at it and to play with it. H tells the keys.
#[derive(Debug, Parser)]
#[command(name = "view", version)]
pub(crate) struct Args {
    /// The scene
    #[arg(value_parser = PossibleValuesParser::new(scenes::ALL.iter().map(|s| s.name)), default_value = "pile")]
    scene: String,
    /// Dynamic bodies, 1 to 5,000,000; the scene takes as many as its form allows, never more [default: the scene's]
    #[arg(long, value_name = "N", value_parser = |text: &str| whole(text, MOST_BODIES), allow_hyphen_values = true)]
    bodies: Option<u32>,
    /// Where it runs: `auto` takes a GPU, or the CPU where there is none; `gpu` takes a software adapter too. Either is
    /// drawn by the adapter of the window
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
    /// What finds the pairs of bodies that are near each other
    #[arg(long, value_enum, default_value = "auto")]
    broadphase: BroadphaseName,
    /// Length of a step in seconds [default: 1/60]
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    dt: Option<f32>,
    /// Sub-steps a step [default: 4]
    #[arg(long, value_name = "N", value_parser = |text: &str| whole(text, 256), allow_hyphen_values = true)]
    substeps: Option<u32>,
    /// Threads of the CPU side [default: one a core]
    #[arg(long, value_name = "N", value_parser = |text: &str| whole(text, 1024), allow_hyphen_values = true)]
    threads: Option<u32>,
    /// Time each pass too, which makes the steps a little slower
    #[arg(long)]
    profile: bool,
    /// Width and height of the window in pixels, 64x64 to 8192x8192
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size, allow_hyphen_values = true)]
    pub(crate) size: (u32, u32),
    /// What bodies and dots are coloured by
    #[arg(long, value_enum, default_value = "body")]
    pub(crate) colors: Coloring,
    /// Begin with the clock stopped
    #[arg(long)]
    pub(crate) paused: bool,
    /// End after so many frames
    #[arg(long, value_name = "N", value_parser = |text: &str| whole(text, u32::MAX), allow_hyphen_values = true)]
    pub(crate) frames: Option<u32>,
    /// Tell on standard output what happens, a JSON object a line
    #[arg(long)]
    pub(crate) log_events: bool,
}

/// What bodies and dots are coloured by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Coloring {
    /// Each body has its own colour
    Body,
    /// Bodies by the load that they bear, contacts as dots and their normals as lines
    Contacts,
    /// Contacts as dots, by the batch in which they are solved
    Batches,
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

impl Args {
    /// Refused if no step can run with them.
    pub(crate) fn params(&self) -> Result<Params, Failure> {
        let mut params = Params { profile: self.profile, ..Params::default() };
        params.dt = self.dt.unwrap_or(params.dt);
        params.substeps = self.substeps.unwrap_or(params.substeps);
        params.threads = self.threads.map(|n| n as usize);
        params.broadphase = match self.broadphase {
            BroadphaseName::Auto => Broadphase::Auto,
            BroadphaseName::BruteForce => Broadphase::BruteForce,
            BroadphaseName::Grid => Broadphase::Grid,
            BroadphaseName::SlicedGrid => Broadphase::SlicedGrid,
            BroadphaseName::Lbvh => Broadphase::Lbvh,
            BroadphaseName::SweepAndPrune => Broadphase::SweepAndPrune,
        };
        params.validate()?;
        Ok(params)
    }

    pub(crate) fn backend(&self) -> Backend {
        match self.backend {
            BackendName::Auto => Backend::Auto,
            BackendName::Cpu => Backend::Cpu,
            BackendName::Gpu => Backend::Gpu,
        }
    }

    /// The scene asked for, and how many bodies it is to have.
    pub(crate) fn scene(&self) -> (&'static StandardScene, usize) {
        // The parser took no other name.
        let scene = scenes::find(&self.scene).unwrap_or(&scenes::ALL[0]);
        (scene, self.bodies.map_or(scene.default_bodies, |n| n as usize))
    }
}

/// Reads the command line. Help and version are printed here, and end the program.
pub(crate) fn parse() -> Result<Args, Failure> {
    Args::try_parse().map_err(|error| {
        if !error.use_stderr() {
            error.exit();
        }
        Failure::Argument(one_line(&error.to_string()))
    })
}

/// A whole number from 1 to `most`.
fn whole(text: &str, most: u32) -> Result<u32, String> {
    let number = text.parse().ok().filter(|n| (1..=most).contains(n));
    number.ok_or_else(|| format!("expected a whole number from 1 to {most}"))
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|n| (64..=8192).contains(n));
    let both = text.split_once('x').and_then(|(width, height)| side(width).zip(side(height)));
    both.ok_or_else(|| "expected a width and a height from 64 to 8192, such as 1280x720".to_owned())
}

/// What clap says, without its usage lines.
fn one_line(message: &str) -> String {
    let told = |part: &&str| !["Usage:", "For more information"].iter().any(|start| part.starts_with(start));
    let lines = |part: &str| part.lines().map(str::trim).collect::<Vec<_>>().join(" ");
    let parts: Vec<_> =
        message.trim_start_matches("error: ").split("\n\n").map(str::trim).filter(told).map(lines).collect();
    parts.join("; ")
}
