//! Bars of a step's stages, each bar one whole.

use super::canvas::{Canvas, Hang, INK, MUTED, cut, sheet, text_width};
use super::{COLOURS, Look};
use plotters::style::text_anchor::{HPos, VPos};
use plotters::style::{RGBColor, WHITE};

/// One bar: parts of one step.
pub(crate) struct Bar {
    /// Above it.
    pub(crate) title: String,
    /// Parts as number of the stage in the legend, and share of the whole.
    pub(crate) parts: Vec<(usize, f64)>,
}

/// What no timer covered.
const REST: RGBColor = RGBColor(0xC8, 0xC8, 0xC8);

fn colour(stage: usize, stages: usize) -> RGBColor {
    if stage == stages { REST } else { COLOURS[stage % COLOURS.len()] }
}

/// On a bright part; not the ink, which a page turns bright on a dark ground.
const DARK: RGBColor = RGBColor(0x11, 0x11, 0x11);

/// White or dark, whichever is read more easily on this colour.
fn on(ground: RGBColor) -> RGBColor {
    let light = 0.299 * f64::from(ground.0) + 0.587 * f64::from(ground.1) + 0.114 * f64::from(ground.2);
    if light > 140.0 { DARK } else { WHITE }
}

/// Bars with the stages' numbers in them and a legend of numbers below; what is numbered one past the last stage is what no
/// timer covered.
pub(crate) fn bars(title: &str, bars: &[Bar], stages: &[String], look: Look) -> Result<String, String> {
    let font = look.font;
    let inner = look.width - 12.0;
    let rest = bars.iter().flat_map(|b| &b.parts).any(|p| p.0 == stages.len());
    let mut entries: Vec<String> = stages.iter().enumerate().map(|(i, name)| format!("{} {name}", i + 1)).collect();
    if rest {
        entries.push("not timed".into());
    }
    let mut places = Vec::new();
    let (mut x, mut row) = (0.0, 0);
    for entry in &entries {
        let wide = (text_width(entry, font) + 30.0).min(inner);
        if x > 0.0 && x + wide > inner {
            (x, row) = (0.0, row + 1);
        }
        places.push((x, row));
        x += wide;
    }
    let top = font * 2.2;
    let bar = font * 3.7;
    let legend = top + bar * bars.len() as f64 + font * 0.4;
    let height = legend + (row as f64 + 1.0) * font * 1.5 + 6.0;
    let (svg, ()) = sheet(look.width, height, |area| {
        let canvas = Canvas { area, font };
        canvas.text(&cut(title, font * 1.08, inner), (6.0, 4.0), Hang(HPos::Left, VPos::Top), INK, true)?;
        for (i, one) in bars.iter().enumerate() {
            let y = top + i as f64 * bar;
            canvas.text(&cut(&one.title, font, inner), (6.0, y), Hang(HPos::Left, VPos::Top), MUTED, false)?;
            let (from, to) = (y + font * 1.3, y + font * 3.0);
            let whole = one.parts.iter().map(|p| p.1).sum::<f64>().max(f64::MIN_POSITIVE);
            let mut done = 0.0;
            for &(stage, share) in &one.parts {
                let (left, right) = (6.0 + inner * done / whole, 6.0 + inner * (done + share) / whole);
                done += share;
                let ground = colour(stage, stages.len());
                canvas.rectangle((left, from), ((right - 1.0).max(left + 0.25), to), ground)?;
                let number = (stage + 1).to_string();
                if stage < stages.len() && right - left > text_width(&number, font) + 4.0 {
                    let middle = ((left + right - 1.0) / 2.0, (from + to) / 2.0);
                    canvas.text(&number, middle, Hang(HPos::Center, VPos::Center), on(ground), false)?;
                }
            }
        }
        for (i, (entry, (x, row))) in entries.iter().zip(&places).enumerate() {
            let (x, y) = (6.0 + x, legend + (*row as f64 + 0.7) * font * 1.5);
            let half = font * 0.38;
            canvas.rectangle((x, y - half), (x + 2.0 * half, y + half), colour(i, stages.len()))?;
            let text = cut(entry, font, inner - 20.0);
            canvas.text(&text, (x + 2.0 * half + 5.0, y), Hang(HPos::Left, VPos::Center), INK, false)?;
        }
        Ok(())
    })?;
    Ok(svg)
}
