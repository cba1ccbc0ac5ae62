//! Plots with two logarithmic axes, alone and in a grid.

use super::axis::{range, ticks};
use super::canvas::{Canvas, GRID, Hang, INK, Look, MUTED, cut, sheet, text_width};
use super::{Palette, colour};
use crate::report::curve::is_ours;
use crate::report::text::{tick, tick_count};
use plotters::style::text_anchor::{HPos, VPos};

/// A point to draw, with what it may spread to.
#[derive(Debug, Clone, PartialEq)]
pub struct PlotPoint {
    /// Where it lies.
    pub x: f64,
    /// Where it lies.
    pub y: f64,
    /// End of a whisker to the right.
    pub x_high: Option<f64>,
    /// Ends of a bar through the point.
    pub y_range: Option<(f64, f64)>,
    /// What is written beside it.
    pub tag: Option<String>,
}

/// A curve to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct PlotCurve {
    /// The engine: it chooses colour and marker.
    pub engine: String,
    /// What the legend says.
    pub label: String,
    /// Number among the engine's curves: it chooses the dashes.
    pub variant: usize,
    /// In the order in which they are joined.
    pub points: Vec<PlotPoint>,
}

/// A plot, as data.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// Above it, in bold.
    pub title: String,
    /// Under the horizontal axis.
    pub x_title: String,
    /// Above the vertical axis.
    pub y_title: String,
    /// Unit of the vertical axis' ticks.
    pub y_unit: String,
    /// Whether x counts things, so that its ticks read 1k, 1M.
    pub x_counts: bool,
    /// What is smaller is drawn open, at the foot of the vertical axis.
    pub floor: f64,
    /// The curves.
    pub curves: Vec<PlotCurve>,
}

/// A point that was drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// The curve's label.
    pub label: String,
    /// In the axis' unit.
    pub x: f64,
    /// In the axis' unit.
    pub y: f64,
    /// Whether it was put at the foot of the axis, as it lies below it.
    pub at_foot: bool,
    /// Where its marker is, px from the upper left.
    pub place: (f64, f64),
}

/// Dashes by the number of a curve among its engine's.
const DASHES: [&[f64]; 4] = [&[], &[7.0, 3.0], &[2.0, 2.5], &[9.0, 3.0, 2.0, 3.0]];

/// A rectangle, px.
#[derive(Clone, Copy)]
struct Frame {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

impl Frame {
    fn meets(&self, other: &Frame) -> bool {
        self.left < other.right && other.left < self.right && self.top < other.bottom && other.top < self.bottom
    }
}

/// Draws a plot, wide or narrow; gives the SVG and the points in it, in the order of their curves.
///
/// # Errors
/// When the plotting library fails.
pub fn plot(plot: &Plot, palette: &Palette, narrow: bool) -> Result<(String, Vec<Drawn>), String> {
    let look = if narrow { super::NARROW } else { super::WIDE };
    let entries: Vec<&PlotCurve> = plot.curves.iter().collect();
    let rows = legend_rows(&entries, look.font, look.width - 12.0);
    let title = look.font * 1.7;
    let height = look.height + rows as f64 * look.font * 1.45;
    sheet(look.width, height, |area| {
        let canvas = Canvas { area, font: look.font };
        canvas.text(
            &cut(&plot.title, look.font * 1.08, look.width - 12.0),
            (6.0, 4.0),
            Hang(HPos::Left, VPos::Top),
            INK,
            true,
        )?;
        legend(&canvas, &entries, palette, (6.0, title + 4.0), look.width - 12.0)?;
        let top = title + 4.0 + rows as f64 * look.font * 1.45;
        panel(&canvas, plot, palette, Frame { left: 0.0, top, right: look.width, bottom: height })
    })
}

/// Several plots in a grid under one legend.
pub(crate) fn grid(
    plots: &[Plot],
    palette: &Palette,
    columns: usize,
    look: Look,
) -> Result<(String, Vec<Drawn>), String> {
    let mut entries = Vec::<&PlotCurve>::new();
    for curve in plots.iter().flat_map(|p| &p.curves) {
        if !entries.iter().any(|e| e.label == curve.label) {
            entries.push(curve);
        }
    }
    sheet(look.width, look.height, |area| {
        let canvas = Canvas { area, font: look.font };
        let inner = look.width - 24.0;
        legend(&canvas, &entries, palette, (12.0, 12.0), inner)?;
        let top = 18.0 + legend_rows(&entries, look.font, inner) as f64 * look.font * 1.45;
        let columns = columns.min(plots.len()).max(1);
        let rows = plots.len().div_ceil(columns).max(1);
        let (w, h) = (look.width / columns as f64, (look.height - top) / rows as f64);
        let mut drawn = Vec::new();
        for (i, plot) in plots.iter().enumerate() {
            let (x, y) = ((i % columns) as f64 * w, top + (i / columns) as f64 * h);
            let title = look.font * 1.7;
            canvas.text(
                &cut(&plot.title, look.font * 1.08, w - 24.0),
                (x + 12.0, y + 4.0),
                Hang(HPos::Left, VPos::Top),
                INK,
                true,
            )?;
            let frame = Frame { left: x + 6.0, top: y + title, right: x + w - 6.0, bottom: y + h };
            drawn.extend(panel(&canvas, plot, palette, frame)?);
        }
        Ok(drawn)
    })
}

fn entry_width(curve: &PlotCurve, font: f64) -> f64 {
    text_width(&curve.label, font) + 38.0
}

/// Places of the entries of a legend: their left ends and rows.
fn legend_places(entries: &[&PlotCurve], font: f64, width: f64) -> Vec<(f64, usize)> {
    let (mut x, mut row) = (0.0, 0);
    let mut places = Vec::new();
    for entry in entries {
        let wide = entry_width(entry, font);
        if x > 0.0 && x + wide > width {
            (x, row) = (0.0, row + 1);
        }
        places.push((x, row));
        x += wide;
    }
    places
}

fn legend_rows(entries: &[&PlotCurve], font: f64, width: f64) -> usize {
    legend_places(entries, font, width).last().map_or(0, |(_, row)| row + 1)
}

fn legend(
    canvas: &Canvas,
    entries: &[&PlotCurve],
    palette: &Palette,
    from: (f64, f64),
    width: f64,
) -> Result<(), String> {
    for (entry, (x, row)) in entries.iter().zip(legend_places(entries, canvas.font, width)) {
        let (x, y) = (from.0 + x, from.1 + (row as f64 + 0.6) * canvas.font * 1.45);
        let place = palette.place(&entry.engine);
        let dashes = DASHES[entry.variant % DASHES.len()];
        canvas.dashed(&[(x, y), (x + 24.0, y)], colour(place), stroke(&entry.engine), dashes)?;
        canvas.marker((x + 12.0, y), place, radius(&entry.engine, canvas.font), false)?;
        let text = cut(&entry.label, canvas.font, width - 30.0);
        canvas.text(&text, (x + 29.0, y), Hang(HPos::Left, VPos::Center), INK, false)?;
    }
    Ok(())
}

fn stroke(engine: &str) -> f64 {
    if is_ours(engine) { 3.0 } else { 1.6 }
}

fn radius(engine: &str, font: f64) -> f64 {
    font * if is_ours(engine) { 0.32 } else { 0.27 }
}

/// Axes and curves within a frame.
fn panel(canvas: &Canvas, plot: &Plot, palette: &Palette, frame: Frame) -> Result<Vec<Drawn>, String> {
    let font = canvas.font;
    let points = || plot.curves.iter().flat_map(|c| &c.points);
    let xs = range(points().flat_map(|p| [Some(p.x), p.x_high]).flatten());
    let heights = points().flat_map(|p| [Some(p.y), p.y_range.map(|r| r.0), p.y_range.map(|r| r.1)]).flatten();
    let above = range(heights.filter(|y| *y > plot.floor));
    let Some(xs) = xs else {
        let middle = ((frame.left + frame.right) / 2.0, (frame.top + frame.bottom) / 2.0);
        canvas.text("nothing was measured", middle, Hang(HPos::Center, VPos::Center), MUTED, false)?;
        return Ok(Vec::new());
    };
    // Where all errors are below the floor, there is only the foot.
    let (low, high) = above.unwrap_or((plot.floor, plot.floor * 10.0));
    let is_low = |p: &PlotPoint| p.y <= plot.floor;
    let any_low = points().any(is_low);
    let y_ticks = ticks(low, high, ((frame.bottom - frame.top) / (font * 3.2)).clamp(3.0, 8.0) as usize);
    let labels: Vec<String> = y_ticks.iter().map(|v| tick(*v, &plot.y_unit)).collect();
    let wide = labels.iter().map(|l| text_width(l, font)).fold(font * 2.0, f64::max);
    let (left, right) = (frame.left + wide + 12.0, frame.right - font * 1.3);
    let (top, foot) = (frame.top + font * 2.5, frame.bottom - font * 3.6);
    // The foot lies under the axis, so that what is there is not taken for the axis' least value.
    let bottom = if any_low { foot - font * 1.6 } else { foot };
    let map = |v: f64, (low, high): (f64, f64), from: f64, to: f64| {
        from + (to - from) * ((v.ln() - low.ln()) / (high.ln() - low.ln())).clamp(0.0, 1.0)
    };
    let to_x = |x: f64| map(x, xs, left, right);
    let to_y = |y: f64| if y <= plot.floor { foot } else { map(y, (low, high), bottom, top) };

    for (value, label) in y_ticks.iter().zip(&labels) {
        let y = to_y(*value);
        canvas.line(&[(left, y), (right, y)], GRID, 1.0)?;
        canvas.text(label, (left - 6.0, y), Hang(HPos::Right, VPos::Center), INK, false)?;
    }
    for value in ticks(xs.0, xs.1, ((right - left) / (font * 4.0)).clamp(2.0, 8.0) as usize) {
        let x = to_x(value);
        canvas.line(&[(x, top), (x, foot)], GRID, 1.0)?;
        let label = if plot.x_counts { tick_count(value) } else { tick(value, "") };
        canvas.text(&label, (x, foot + font * 0.55), Hang(HPos::Center, VPos::Top), INK, false)?;
    }
    canvas.line(&[(left, top), (left, bottom)], MUTED, 1.0)?;
    canvas.dashed(&[(left, foot), (right, foot)], MUTED, 1.0, if any_low { &[2.0, 2.0] } else { &[] })?;
    if any_low {
        canvas.text("0", (left - 6.0, foot), Hang(HPos::Right, VPos::Center), INK, false)?;
    }
    let y_title = cut(&plot.y_title, font, frame.right - frame.left - 12.0);
    canvas.text(&y_title, (frame.left + 6.0, frame.top + font * 0.7), Hang(HPos::Left, VPos::Top), MUTED, false)?;
    let x_title = cut(&plot.x_title, font, right - frame.left - 6.0);
    canvas.text(&x_title, (right, foot + font * 2.0), Hang(HPos::Right, VPos::Top), MUTED, false)?;

    let (mut drawn, mut ends, mut paths) = (Vec::new(), Vec::new(), Vec::new());
    // tumble's curves last, so that nothing covers them.
    let mut order: Vec<&PlotCurve> = plot.curves.iter().collect();
    order.sort_by_key(|c| is_ours(&c.engine));
    for curve in order {
        let place = palette.place(&curve.engine);
        let places: Vec<(f64, f64)> = curve.points.iter().map(|p| (to_x(p.x), to_y(p.y))).collect();
        for (point, at) in curve.points.iter().zip(&places) {
            if let Some(end) = point.x_high.filter(|end| *end > point.x) {
                canvas.line(&[*at, (to_x(end), at.1)], colour(place), 0.75)?;
            }
            if let Some((least, most)) = point.y_range.filter(|(least, most)| least < most) {
                canvas.line(&[(at.0, to_y(least)), (at.0, to_y(most))], colour(place), 0.75)?;
            }
        }
        canvas.dashed(&places, colour(place), stroke(&curve.engine), DASHES[curve.variant % DASHES.len()])?;
        for (point, at) in curve.points.iter().zip(&places) {
            canvas.marker(*at, place, radius(&curve.engine, font), is_low(point))?;
            drawn.push(Drawn {
                label: curve.label.clone(),
                x: point.x,
                y: point.y,
                at_foot: is_low(point),
                place: *at,
            });
        }
        paths.push(places.clone());
        ends.extend(curve.points.iter().zip(&places).filter_map(|(p, at)| Some((*at, p.tag.as_deref()?))));
    }
    let lines: Vec<Frame> =
        paths.iter().flat_map(|path| path.windows(2)).flat_map(|w| along(w[0], w[1], font)).collect();
    let mut taken: Vec<Frame> = drawn.iter().map(|d| around(d.place, font * 0.3, font * 0.3)).collect();
    for (at, tag) in ends {
        let (half, tall) = (text_width(tag, font) / 2.0, font * 0.45);
        let (dx, dy) = (half + font * 0.45, tall + font * 0.4);
        let beside = [(0.0, -dy), (0.0, dy), (dx, 0.0), (-dx, 0.0), (dx, -dy), (-dx, -dy), (dx, dy), (-dx, dy)];
        let boxes = beside.map(|(x, y)| around((at.0 + x, at.1 + y), half, tall));
        let inside = |b: &Frame| b.left > left && b.right < frame.right && b.bottom < foot;
        let clear = |b: &&Frame| inside(b) && !taken.iter().any(|t| t.meets(b));
        let quite = |b: &&Frame| clear(b) && !lines.iter().any(|l| l.meets(b));
        // Where there is no free place, the neighbours' tags tell enough: curves are joined in order.
        if let Some(&free) = boxes.iter().find(quite).or_else(|| boxes.iter().find(clear)) {
            let middle = ((free.left + free.right) / 2.0, (free.top + free.bottom) / 2.0);
            canvas.text(tag, middle, Hang(HPos::Center, VPos::Center), MUTED, false)?;
            taken.push(free);
        }
    }
    Ok(drawn)
}

/// Small frames along a line, near enough to each other that no text fits between two.
fn along(from: (f64, f64), to: (f64, f64), font: f64) -> impl Iterator<Item = Frame> {
    let parts = ((to.0 - from.0).hypot(to.1 - from.1) / (0.3 * font)).ceil().max(1.0);
    (0..=parts as usize).map(move |i| {
        let s = i as f64 / parts;
        around((from.0 + (to.0 - from.0) * s, from.1 + (to.1 - from.1) * s), 1.0, 1.0)
    })
}

fn around(at: (f64, f64), half: f64, tall: f64) -> Frame {
    Frame { left: at.0 - half, top: at.1 - tall, right: at.0 + half, bottom: at.1 + tall }
}
