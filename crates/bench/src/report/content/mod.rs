//! What the report says, computed from the records.

mod cases;
mod facts;
mod standing;
mod steps;

pub use cases::plots;

use super::curve::{Point, measures};
use super::document::{Block, Document, Figure, Section};
use super::names::measured;
use super::plot::{Look, Palette, Plot, grid, plot};
use super::text::{Slugs, amount};
use super::{ZOOM, scaling, stages};
use crate::record::Record;

/// Pictures of the overview, at most.
const OVERVIEW: usize = 6;

/// The document, and every picture as path without its ending, SVG, and pixels a pixel.
pub(super) struct Report {
    pub(super) document: Document,
    pub(super) pictures: Vec<(String, String, f32)>,
}

/// What the sections share.
struct Desk<'a> {
    records: &'a [Record],
    name: &'a str,
    palette: Palette,
    /// Names of pictures.
    files: Slugs,
    /// Names of anchors.
    anchors: Slugs,
    pictures: Vec<(String, String, f32)>,
}

impl Desk<'_> {
    fn section(&mut self, title: &str, blocks: Vec<Block>) -> Section {
        Section { id: self.anchors.make(title), title: title.to_string(), sub: false, blocks }
    }

    /// Keeps a picture's files and gives the figure.
    fn figure(&mut self, slug: &str, alt: String, wide: String, narrow: String) -> Figure {
        let stem = format!("{}/{}", self.name, self.files.make(slug));
        self.pictures.push((stem.clone(), wide.clone(), ZOOM));
        Figure { stem, alt, wide, narrow }
    }

    fn log_figure(&mut self, slug: &str, drawn: &Plot) -> Result<Figure, String> {
        let (wide, _) = plot(drawn, &self.palette, false)?;
        let (narrow, _) = plot(drawn, &self.palette, true)?;
        Ok(self.figure(slug, told(drawn), wide, narrow))
    }
}

/// The plot in words.
fn told(plot: &Plot) -> String {
    let mut text = format!("{}: {} against {}.", plot.title, plot.y_title, plot.x_title);
    for curve in &plot.curves {
        if let (Some(first), Some(last)) = (curve.points.first(), curve.points.last()) {
            let y = |v: f64| amount(v, &plot.y_unit);
            text += &format!(" {}: {} to {}.", curve.label, y(first.y), y(last.y));
        }
    }
    text
}

/// A setting in few words: engine and sub-steps.
fn setting(label: &str, point: &Point) -> String {
    format!("{label}, n = {}", point.substeps)
}

/// Names of a list, with commas.
fn listed(names: impl IntoIterator<Item = String>) -> String {
    names.into_iter().collect::<Vec<_>>().join(", ")
}

pub(super) fn report(records: &[Record], name: &str) -> Result<Report, String> {
    let palette = Palette::new(records.iter().filter(|r| measured(r)).map(|r| r.engine.as_str()));
    let mut desk =
        Desk { records, name, palette, files: Slugs::default(), anchors: Slugs::default(), pictures: Vec::new() };
    let measures = measures(records);
    let curves = scaling(records);
    let stages = stages(records);

    let overview: Vec<Plot> =
        plots(&measures).into_iter().filter(|(m, p)| m.headline && !p.curves.is_empty()).map(|(_, p)| p).collect();
    let overview = &overview[..overview.len().min(OVERVIEW)];
    let stem = format!("{name}/{}", desk.files.make("overview"));
    let look = Look { width: 1200.0, height: 800.0, font: 17.0 };
    let columns = if overview.len() == 4 { 2 } else { 3 };
    let (svg, _) = grid(overview, &desk.palette, columns, look)?;
    desk.pictures.push((stem.clone(), svg, 1.0));

    let mut sections = vec![
        facts::run(&mut desk, &stem),
        standing::losses(&mut desk, &measures, &curves),
        standing::wins(&mut desk, &measures, &curves),
        facts::how_to_read(&mut desk),
    ];
    sections.extend(cases::sections(&mut desk, &measures)?);
    sections.push(cases::orders(&mut desk, &measures));
    sections.push(steps::scaling_section(&mut desk, &curves)?);
    sections.push(steps::stage_section(&mut desk, &stages)?);
    sections.push(steps::rate_section(&mut desk, &curves));
    sections.push(facts::differences(&mut desk));
    sections.push(facts::not_measured(&mut desk));
    let lead = if records.is_empty() {
        "The table of this report is empty: nothing was measured.".to_string()
    } else {
        "What accuracy a millisecond buys: tumble and other engines on the same scenes, each at several numbers of \
         sub-steps. Every number is computed from one table."
            .to_string()
    };
    let document = Document { title: "Speed against error".into(), lead, sections };
    Ok(Report { document, pictures: desk.pictures })
}
