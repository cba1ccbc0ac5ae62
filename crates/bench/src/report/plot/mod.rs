//! Pictures: logarithmic plots, the overview, and bars of stages. All are drawn as SVG; [`raster`] makes pixels of them.

mod axis;
mod bars;
mod canvas;
mod log;
mod raster;

pub(crate) use bars::{Bar, bars};
pub(crate) use canvas::{Look, NARROW, WIDE};
pub(crate) use log::grid;
pub use log::{Drawn, Plot, PlotCurve, PlotPoint, plot};
pub(crate) use raster::png;

use plotters::style::RGBColor;

/// Colours that people with any of the common kinds of colour blindness tell apart (Okabe and Ito, 2008), in an order that
/// leaves the faint ones to the end. page.css brightens them on a dark ground by these very values.
const COLOURS: [RGBColor; 8] = [
    RGBColor(0x00, 0x72, 0xB2),
    RGBColor(0xD5, 0x5E, 0x00),
    RGBColor(0x00, 0x9E, 0x73),
    RGBColor(0xCC, 0x79, 0xA7),
    RGBColor(0xE6, 0x9F, 0x00),
    RGBColor(0x56, 0xB4, 0xE9),
    RGBColor(0x8A, 0x6D, 0x3B),
    RGBColor(0x4B, 0x55, 0x63),
];

/// The engines that have a colour of their own, in the order of [`COLOURS`].
const KNOWN: [&str; 7] = ["tumble cpu", "tumble gpu", "rapier", "box3d", "nexus", "mujoco", "mujoco stiff"];

/// Which engine has which colour and marker, the same in every picture of a report.
#[derive(Debug, Clone)]
pub struct Palette(Vec<(String, usize)>);

impl Palette {
    /// The palette of these engines, in any order and with repetitions.
    pub fn new<'a>(engines: impl IntoIterator<Item = &'a str>) -> Self {
        let mut all = Vec::<(String, usize)>::new();
        let mut free = KNOWN.len();
        for engine in engines {
            if all.iter().any(|(name, _)| name == engine) {
                continue;
            }
            let place = KNOWN.iter().position(|k| *k == engine).unwrap_or_else(|| {
                free += 1;
                free - 1
            });
            all.push((engine.to_string(), place));
        }
        Self(all)
    }

    /// Number of the engine's colour and marker.
    fn place(&self, engine: &str) -> usize {
        self.0.iter().find(|(name, _)| name == engine).map_or(COLOURS.len() - 1, |(_, place)| *place)
    }
}

/// The colour of a place; places beyond the last colour begin anew.
fn colour(place: usize) -> RGBColor {
    COLOURS[place % COLOURS.len()]
}
