//! Who reaches which error in which time.

use super::curve::{Curve, FLOOR, Point};

/// A point and the curve that it is on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting<'a> {
    /// The curve.
    pub curve: &'a Curve,
    /// The point.
    pub point: &'a Point,
}

/// Where one engine has the better of others: at `better` it is no slower than `best` and more accurate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Advantage<'a> {
    /// The setting that is not reached.
    pub better: Setting<'a>,
    /// The most accurate of the others in no more time; `None` where none is so quick.
    pub best: Option<Setting<'a>>,
    /// How many times the error of `best` is that of `better`; errors below [`FLOOR`] count as [`FLOOR`].
    pub error_factor: Option<f64>,
    /// The quickest of the others with an error no greater; `None` where none of them reaches it.
    pub reached: Option<Setting<'a>>,
    /// How many times as long `reached` takes.
    pub time_factor: Option<f64>,
    /// Whether the errors of the seeds of `better` and `best` overlap, so that other seeds might say otherwise.
    pub overlap: bool,
}

/// An error for comparisons: what is below the floor is all the same.
fn floored(error: f64) -> f64 {
    error.max(FLOOR)
}

fn settings<'a>(curves: impl IntoIterator<Item = &'a Curve>) -> impl Iterator<Item = Setting<'a>> {
    curves.into_iter().flat_map(|curve| curve.points.iter().map(move |point| Setting { curve, point }))
}

/// The quickest setting with an error of at most `level`.
pub fn quickest<'a>(curves: impl IntoIterator<Item = &'a Curve>, level: f64) -> Option<Setting<'a>> {
    settings(curves)
        .filter(|s| floored(s.point.error) <= floored(level))
        .min_by(|a, b| a.point.ms.total_cmp(&b.point.ms))
}

/// The most accurate setting of at most `ms` a step; of equals the quickest.
pub fn most_accurate<'a>(curves: impl IntoIterator<Item = &'a Curve>, ms: f64) -> Option<Setting<'a>> {
    let errors = |a: &Setting, b: &Setting| floored(a.point.error).total_cmp(&floored(b.point.error));
    settings(curves).filter(|s| s.point.ms <= ms).min_by(|a, b| errors(a, b).then(a.point.ms.total_cmp(&b.point.ms)))
}

/// Where `one` has the greatest advantage over all of `others`, by error at equal time and then by time at equal error;
/// `None` where `others` reach each of its points: no slower, and no less accurate.
pub fn advantage<'a>(one: &'a Curve, others: &[&'a Curve]) -> Option<Advantage<'a>> {
    let at = |point: &'a Point| {
        let best = most_accurate(others.iter().copied(), point.ms);
        let factor = best.map(|b| floored(b.point.error) / floored(point.error));
        let reached = quickest(others.iter().copied(), point.error);
        let time = reached.map(|q| q.point.ms / point.ms);
        // Reached in that time: no advantage.
        if factor.is_some_and(|f| f <= 1.0) {
            return None;
        }
        let overlap = best.is_some_and(|b| point.high >= b.point.low);
        let better = Setting { curve: one, point };
        Some(Advantage { better, best, error_factor: factor, reached, time_factor: time, overlap })
    };
    let rank = |a: &Advantage| (a.error_factor.unwrap_or(0.0), a.time_factor.unwrap_or(f64::INFINITY));
    one.points.iter().filter_map(at).max_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    })
}

/// Levels of error to compare at, from the greatest: decades where the errors span three or more, else half decades. Each
/// level is reached by something, and at most twelve are given, the smallest.
pub fn levels(curves: &[Curve]) -> Vec<f64> {
    let errors: Vec<f64> = settings(curves).map(|s| floored(s.point.error)).collect();
    let (Some(least), Some(most)) =
        (errors.iter().copied().min_by(f64::total_cmp), errors.iter().copied().max_by(f64::total_cmp))
    else {
        return Vec::new();
    };
    let per_decade = if (most / least).log10() >= 3.0 { 1.0 } else { 2.0 };
    // A level that equals an error to rounding is that error's.
    let step = |error: f64| (error.log10() * per_decade - 1e-9).ceil() as i32;
    let (first, last) = (step(least), step(most));
    (first..=last.min(first + 11)).rev().map(|k| 10f64.powf(f64::from(k) / per_decade)).collect()
}
