//! Numbers and names for people, and for file names.

use std::collections::HashSet;

const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];

/// Ten to a whole power, as 10⁻³.
fn power_of_ten(exponent: i32) -> String {
    let digits = exponent.unsigned_abs().to_string();
    let sign = if exponent < 0 { "⁻" } else { "" };
    format!("10{sign}{}", digits.bytes().map(|b| SUPERSCRIPTS[usize::from(b - b'0')]).collect::<String>())
}

/// Three significant digits: 12.3, 0.00123, 1.23 × 10⁻⁵.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    // Rounded first, so that 9.996 is 10.0 and not 9.996 with the digits of a number below ten.
    let scientific = format!("{value:.2e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    match exponent {
        -3..=2 => format!("{value:.*}", (2 - exponent).unsigned_abs() as usize),
        3..=5 => grouped(value.round() as i64),
        _ => format!("{mantissa} × {}", power_of_ten(exponent)),
    }
}

/// A whole number with its thousands set apart: 12,345.
fn grouped(value: i64) -> String {
    let digits = value.unsigned_abs().to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    if value < 0 { format!("−{text}") } else { text }
}

/// A count with its thousands set apart.
pub(crate) fn count(value: u64) -> String {
    grouped(i64::try_from(value).unwrap_or(i64::MAX))
}

/// The unit's prefix that makes `value` at least 1, and what to multiply by.
fn prefix(value: f64) -> (&'static str, f64) {
    match value.abs() {
        v if v >= 0.9995 || v == 0.0 => ("", 1.0),
        v if v >= 0.9995e-3 => ("m", 1e3),
        v if v >= 0.9995e-6 => ("µ", 1e6),
        _ => ("n", 1e9),
    }
}

/// A number with its unit; metres and joules with their prefix: 1.23 mm, 45.0 µJ/kg. The unit 1 is left out.
pub(crate) fn amount(value: f64, unit: &str) -> String {
    match unit {
        "" | "1" => number(value),
        "m" | "J" | "J/kg" | "m/s" | "rad" | "s" => {
            let (letter, factor) = prefix(value);
            format!("{} {letter}{unit}", number(value * factor))
        }
        _ => format!("{} {unit}", number(value)),
    }
}

/// A tick of an axis, as short as may be: 10, 0.1, 10⁻⁴, or 10 mm.
pub(crate) fn tick(value: f64, unit: &str) -> String {
    let short = |value: f64| {
        let text = number(value);
        if text.contains('.') && !text.contains('×') {
            text.trim_end_matches('0').trim_end_matches('.').to_string()
        } else {
            text.trim_start_matches("1.00 × ").replace(".00 ×", " ×")
        }
    };
    match unit {
        "m" | "rad" | "s" => {
            let (letter, factor) = prefix(value * 1.0001);
            format!("{} {letter}{unit}", short(value * factor))
        }
        _ => short(value),
    }
}

/// Bodies as a tick: 500, 1k, 1M.
pub(crate) fn tick_count(value: f64) -> String {
    match value {
        v if v >= 0.9995e6 => format!("{}M", tick(v / 1e6, "")),
        v if v >= 0.9995e3 => format!("{}k", tick(v / 1e3, "")),
        v => tick(v, ""),
    }
}

/// A length of a step as a person writes it: 1/60 s.
pub(crate) fn step_length(dt: f64) -> String {
    let rate = (1.0 / dt).round();
    if dt > 0.0 && (1.0..=1e6).contains(&rate) && (rate * dt - 1.0).abs() < 1e-4 {
        format!("1/{rate} s")
    } else {
        format!("{} s", number(dt))
    }
}

/// Text without characters that no page, picture or table may hold.
pub(crate) fn clean(text: &str) -> String {
    let plain = |c: char| c.is_control() || ('\u{fffe}'..='\u{ffff}').contains(&c);
    text.chars().map(|c| if plain(c) { ' ' } else { c }).collect()
}

/// Escapes text for HTML and SVG, in elements and in attributes.
pub(crate) fn html(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in clean(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// Escapes text for Markdown, in tables too.
pub(crate) fn markdown(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in clean(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '\\' | '|' | '*' | '_' | '[' | ']' | '`' | '#' | '~' => out.extend(['\\', c]),
            c => out.push(c),
        }
    }
    out
}

/// Names for files and anchors: letters, digits and dashes, each given out once.
#[derive(Default)]
pub(crate) struct Slugs(HashSet<String>);

impl Slugs {
    pub(crate) fn make(&mut self, text: &str) -> String {
        let letters: String =
            text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
        let mut stem = letters.split('-').filter(|part| !part.is_empty()).collect::<Vec<_>>().join("-");
        // A file name has 255 bytes on most systems.
        stem.truncate(60);
        if stem.is_empty() {
            stem.push('x');
        }
        let mut slug = stem.clone();
        let mut number = 2;
        while !self.0.insert(slug.clone()) {
            slug = format!("{stem}-{number}");
            number += 1;
        }
        slug
    }
}
