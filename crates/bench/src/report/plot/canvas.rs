//! A sheet to draw on, in pixels with fractions, and the parts that all pictures share.

use plotters::coord::Shift;
use plotters::element::{Circle, PathElement, Polygon, Rectangle};
use plotters::prelude::{DrawingArea, IntoDrawingArea, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, IntoTextStyle, RGBColor, ShapeStyle, WHITE};

/// Text and axes.
pub(super) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
/// What matters less.
pub(super) const MUTED: RGBColor = RGBColor(0x66, 0x66, 0x66);
/// Lines of the grid.
pub(super) const GRID: RGBColor = RGBColor(0xE4, 0xE4, 0xE4);

/// Plotters draws at whole units; this many make a pixel.
pub(super) const UNITS: f64 = 4.0;

/// Size of a picture and of its text, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Look {
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) font: f64,
}

/// For a column of a wide screen, and for files.
pub(crate) const WIDE: Look = Look { width: 560.0, height: 400.0, font: 13.0 };
/// For a phone: at 272 px, what a window of 320 px with a scroll bar leaves it, its text is still above 12 px.
pub(crate) const NARROW: Look = Look { width: 300.0, height: 300.0, font: 13.5 };

/// How text hangs on its point.
#[derive(Clone, Copy)]
pub(super) struct Hang(pub(super) HPos, pub(super) VPos);

/// A drawing area in pixels.
pub(super) struct Canvas<'a, 'b> {
    pub(super) area: &'a DrawingArea<SVGBackend<'b>, Shift>,
    pub(super) font: f64,
}

pub(super) fn told(error: impl std::fmt::Display) -> String {
    format!("cannot draw a picture: {error}")
}

pub(super) fn units(px: f64) -> i32 {
    (px * UNITS).round() as i32
}

pub(super) fn at((x, y): (f64, f64)) -> (i32, i32) {
    (units(x), units(y))
}

/// Draws on an empty sheet of `look`'s size and returns the SVG, with what `draw` returned.
pub(super) fn sheet<T>(
    width: f64,
    height: f64,
    draw: impl FnOnce(&DrawingArea<SVGBackend, Shift>) -> Result<T, String>,
) -> Result<(String, T), String> {
    let mut svg = String::new();
    let (w, h) = (units(width), units(height));
    let area = SVGBackend::with_string(&mut svg, (w.unsigned_abs(), h.unsigned_abs())).into_drawing_area();
    area.fill(&WHITE).map_err(told)?;
    let drawn = draw(&area)?;
    area.present().map_err(told)?;
    drop(area);
    // The sheet is finer than pixels only within: it is shown at its size.
    let (fine, shown) = (format!("width=\"{w}\" height=\"{h}\""), format!("width=\"{width}\" height=\"{height}\""));
    // A third of the attributes say what holds anyway.
    Ok((svg.replacen(&fine, &shown, 1).replace(" opacity=\"1\"", ""), drawn))
}

/// What a line of text takes, px: after the widths of DejaVu Sans, a wide font, since a page's font is not known here. A
/// test in a browser looks.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let em = |c: char| match c {
        'm' | 'w' | 'M' | 'W' => 0.98,
        'i' | 'j' | 'l' | 'f' | 't' | 'r' | ' ' | '.' | ',' | ':' | '/' | '(' | ')' => 0.41,
        'a'..='z' | '0'..='9' => 0.64,
        '!'..='~' => 0.78,
        // Letters of the world: as wide as they are high at most.
        _ => 1.0,
    };
    text.chars().map(em).sum::<f64>() * size
}

/// The text, cut where it would pass `width`.
pub(super) fn cut(text: &str, size: f64, width: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_string();
    }
    let mut kept = String::new();
    for c in text.chars() {
        if text_width(&kept, size) + 1.4 * size > width {
            break;
        }
        kept.push(c);
    }
    kept + "…"
}

impl Canvas<'_, '_> {
    pub(super) fn text(
        &self,
        text: &str,
        place: (f64, f64),
        hang: Hang,
        color: RGBColor,
        bold: bool,
    ) -> Result<(), String> {
        // The SVG backend divides sizes by 1.24.
        let size = self.font * UNITS * 1.24;
        let style = if bold { FontStyle::Bold } else { FontStyle::Normal };
        let style = ("sans-serif", size, style).into_text_style(self.area).color(&color);
        let style = style.pos(Pos::new(hang.0, hang.1));
        self.area.draw_text(&super::super::text::clean(text), &style, at(place)).map_err(told)
    }

    pub(super) fn line(&self, points: &[(f64, f64)], color: RGBColor, width: f64) -> Result<(), String> {
        let style = ShapeStyle { color: color.to_rgba(), filled: false, stroke_width: units(width).unsigned_abs() };
        let points: Vec<(i32, i32)> = points.iter().copied().map(at).collect();
        self.area.draw(&PathElement::new(points, style)).map_err(told)
    }

    pub(super) fn rectangle(&self, from: (f64, f64), to: (f64, f64), color: RGBColor) -> Result<(), String> {
        self.area.draw(&Rectangle::new([at(from), at(to)], color.filled())).map_err(told)
    }

    /// A line with gaps: `dashes` are lengths of line and gap by turns, px; empty for a whole line.
    pub(super) fn dashed(
        &self,
        points: &[(f64, f64)],
        color: RGBColor,
        width: f64,
        dashes: &[f64],
    ) -> Result<(), String> {
        if dashes.is_empty() {
            return self.line(points, color, width);
        }
        let (mut dash, mut left) = (0, dashes[0]);
        for pair in points.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            let length = (to.0 - from.0).hypot(to.1 - from.1);
            let on = |s: f64| (from.0 + (to.0 - from.0) * s / length, from.1 + (to.1 - from.1) * s / length);
            let mut done = 0.0;
            while done < length {
                let end = (done + left).min(length);
                if dash % 2 == 0 {
                    self.line(&[on(done), on(end)], color, width)?;
                }
                left -= end - done;
                done = end;
                if left <= 1e-9 {
                    dash = (dash + 1) % dashes.len();
                    left = dashes[dash];
                }
            }
        }
        Ok(())
    }

    /// The marker of an engine's place: its shape is as telling as its colour.
    pub(super) fn marker(&self, place: (f64, f64), kind: usize, r: f64, open: bool) -> Result<(), String> {
        let color = super::colour(kind);
        let (x, y) = place;
        let around = |offsets: &[(f64, f64)]| -> Vec<(f64, f64)> {
            offsets.iter().map(|(dx, dy)| (x + dx * r, y + dy * r)).collect()
        };
        let corners = match kind % 6 {
            0 => Vec::new(),
            1 => around(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
            2 => around(&[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)]),
            3 => around(&[(0.0, -1.3), (1.1, 0.0), (0.0, 1.3), (-1.1, 0.0)]),
            4 => around(&[(0.0, 1.2), (-1.1, -0.8), (1.1, -0.8)]),
            _ => around(
                &[(-0.4, -1.2), (0.4, -1.2), (0.4, -0.4), (1.2, -0.4), (1.2, 0.4), (0.4, 0.4), (0.4, 1.2)]
                    .into_iter()
                    .chain([(-0.4, 1.2), (-0.4, 0.4), (-1.2, 0.4), (-1.2, -0.4), (-0.4, -0.4)])
                    .collect::<Vec<_>>(),
            ),
        };
        match (corners.is_empty(), open) {
            (true, true) => {
                // Twice the circle, so that the ground covers the curve within.
                let ring =
                    ShapeStyle { color: color.to_rgba(), filled: false, stroke_width: units(1.5).unsigned_abs() };
                self.area.draw(&Circle::new(at(place), units(r), WHITE.filled())).map_err(told)?;
                self.area.draw(&Circle::new(at(place), units(r), ring)).map_err(told)
            }
            (true, false) => self.area.draw(&Circle::new(at(place), units(r), color.filled())).map_err(told),
            (false, _) => {
                let ground = if open { WHITE } else { color };
                let fine: Vec<(i32, i32)> = corners.iter().copied().map(at).collect();
                self.area.draw(&Polygon::new(fine, ground.filled())).map_err(told)?;
                if open {
                    let closed: Vec<(f64, f64)> = corners.iter().chain(corners.first()).copied().collect();
                    self.line(&closed, color, 1.5)?;
                }
                Ok(())
            }
        }
    }
}
