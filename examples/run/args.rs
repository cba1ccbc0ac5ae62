//! What the command line may say.

use crate::asked::{Asked, Failure, free_memory, size, whole};
use clap::Parser;
use std::path::PathBuf;
use tumble::Params;

const MOST_STEPS: u32 = 10_000_000;
/// What drawing holds for each pixel at most: four samples of colour and depth, and copies on the way to a file.
const BYTES_A_PIXEL: u64 = 60;

/// Runs a standard scene, and tells what a step costs and how good its result is.
///
/// Every step is waited for. All steps count, the first ones too: there is no warm-up. Times are on the host's clock;
/// median and 95th percentile are over all steps.
#[derive(Debug, Parser)]
#[command(name = "run", version)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) asked: Asked,
    /// Steps, 1 to 10,000,000
    #[arg(
        long,
        value_name = "N",
        default_value = "300",
        value_parser = |text: &str| whole(text, MOST_STEPS),
        allow_hyphen_values = true
    )]
    pub(crate) steps: u32,
    /// Write the same as the table to this file, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write a trace of the last 10,000 steps to this file, for https://ui.perfetto.dev or chrome://tracing; times each
    /// pass as `--profile` does
    #[arg(long, value_name = "FILE")]
    pub(crate) trace: Option<PathBuf>,
    /// Write a picture of the last state to this file, as PNG
    #[arg(long, value_name = "FILE")]
    pub(crate) png: Option<PathBuf>,
    /// Write pictures to this folder, as PNG: `frame_0000.png` shows the state before the first step, the next ones the
    /// first state at or after each further 1/30 s of simulated time (every state where a step is longer). The camera
    /// stays where it sees the first state. Files of those names are replaced
    #[arg(long, value_name = "DIR")]
    pub(crate) frames: Option<PathBuf>,
    /// Width and height of pictures, pixels, 1 to 8192 each
    #[arg(
        long,
        value_name = "WxH",
        default_value = "1280x720",
        value_parser = |text: &str| size(text, 1, 8192),
        allow_hyphen_values = true
    )]
    size: (u32, u32),
    /// Name the scenes and end
    #[arg(long)]
    pub(crate) list: bool,
}

impl Args {
    /// Refused if no step can run with them.
    pub(crate) fn params(&self) -> Result<Params, Failure> {
        let params = self.asked.params()?;
        Ok(Params { profile: params.profile || self.trace.is_some(), ..params })
    }

    /// Width and height of pictures, where any are wanted.
    pub(crate) fn picture_size(&self) -> Result<Option<(u32, u32)>, Failure> {
        if self.png.is_none() && self.frames.is_none() {
            return Ok(None);
        }
        let (width, height) = self.size;
        let needed = u64::from(width) * u64::from(height) * BYTES_A_PIXEL;
        match free_memory() {
            Some(free) if needed > free => Err(Failure::Argument(format!(
                "a picture of {width}x{height} pixels needs some {:.1} GB of memory, and {:.1} GB are free; ask for a \
                 smaller one with --size",
                needed as f64 * 1e-9,
                free as f64 * 1e-9
            ))),
            _ => Ok(Some(self.size)),
        }
    }
}
