//! What the command line may say.

use crate::asked::{Asked, size, whole};
use clap::{Parser, ValueEnum};

/// The scene, where none is named.
pub(crate) const SCENE: &str = "pile";

/// Shows a standard scene (`pile`, unless another is named) in a window, at real time, to look at it and to play with it.
/// H tells the keys. Either backend is drawn by the adapter of the window.
#[derive(Debug, Parser)]
#[command(name = "view", version)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) asked: Asked,
    /// Width and height of the window in pixels, 64x64 to 8192x8192
    #[arg(
        long,
        value_name = "WxH",
        default_value = "1280x720",
        value_parser = |text: &str| size(text, 64, 8192),
        allow_hyphen_values = true
    )]
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
