//! The report of a run: pictures, tables and one page, made of its records and of nothing else.
//!
//! Every number is computed from the table; no sentence says how an engine did that was not counted. The opening section
//! says where tumble loses.

mod content;
mod curve;
mod document;
mod fit;
mod front;
mod html;
mod markdown;
mod names;
mod plot;
mod scaling;
mod text;

pub use content::plots;
pub use curve::{Curve, FLOOR, Measure, Point, is_ours, measures};
pub use fit::{Fit, power_law};
pub use front::{Advantage, LEAD, Setting, advantage, levels, most_accurate, quickest};
pub use plot::{Drawn, Palette, Plot, PlotCurve, PlotPoint, plot};
pub use scaling::{ScalingCurve, ScalingPoint, Stages, scaling, stages};
pub(crate) use text::number;

use crate::record::Record;
use std::path::{Path, PathBuf};

/// Pixels of a PNG for each pixel of its SVG; the overview has its own size.
const ZOOM: f32 = 1.0;

/// Writes `NAME.md`, `NAME.html`, and the pictures of both into `NAME/` as SVG and PNG, `overview` among them; returns
/// their paths. Pictures of an earlier report in `NAME/` that this one has not are removed. Both link to `NAME.csv`, the
/// table, which is expected beside them. The same records give the same bytes.
///
/// # Errors
/// When `name` is more than letters, digits, `-` and `_`, when a picture cannot be drawn, or a file cannot be written.
pub fn write(records: &[Record], folder: &Path, name: &str) -> Result<Vec<PathBuf>, String> {
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_') {
        return Err(format!("the report's name is {name:?}; it may have letters, digits, - and _ only"));
    }
    let report = content::report(records, name)?;
    let pictures = folder.join(name);
    std::fs::create_dir_all(&pictures).map_err(|e| format!("cannot make {}: {e}", pictures.display()))?;
    let mut files = vec![
        (folder.join(format!("{name}.md")), markdown::render(&report.document).into_bytes()),
        (folder.join(format!("{name}.html")), html::render(&report.document).into_bytes()),
    ];
    for (stem, svg, zoom) in report.pictures {
        files.push((folder.join(format!("{stem}.png")), plot::png(&svg, zoom)?));
        files.push((folder.join(format!("{stem}.svg")), svg.into_bytes()));
    }
    for (path, bytes) in &files {
        std::fs::write(path, bytes).map_err(|e| format!("cannot write {}: {e}", path.display()))?;
    }
    let paths: Vec<PathBuf> = files.into_iter().map(|(path, _)| path).collect();
    remove_others(&pictures, &paths)?;
    Ok(paths)
}

/// Removes the pictures in `folder` that are not among `keep`.
fn remove_others(folder: &Path, keep: &[PathBuf]) -> Result<(), String> {
    let told = |e: std::io::Error| format!("cannot tidy {}: {e}", folder.display());
    for entry in std::fs::read_dir(folder).map_err(told)? {
        let path = entry.map_err(told)?.path();
        let picture = path.extension().is_some_and(|e| e == "svg" || e == "png");
        if picture && !keep.contains(&path) {
            std::fs::remove_file(&path).map_err(told)?;
        }
    }
    Ok(())
}
