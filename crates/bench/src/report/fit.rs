//! Power laws by least squares.

/// `y = factor * x^slope`, fitted to the logarithms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// The exponent.
    pub slope: f64,
    /// y at x = 1.
    pub factor: f64,
    /// Share of the variance of log y that the law explains, 0 to 1; 1 where y does not vary.
    pub r2: f64,
    /// Points that went in.
    pub points: usize,
}

/// A fit of points (x, y). Those that are not positive and finite are left out; `None` for fewer than three, or where all
/// x are equal.
pub fn power_law(points: impl IntoIterator<Item = (f64, f64)>) -> Option<Fit> {
    let usable = |v: f64| v.is_finite() && v > 0.0;
    let logs: Vec<(f64, f64)> =
        points.into_iter().filter(|&(x, y)| usable(x) && usable(y)).map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    if logs.len() < 3 {
        return None;
    }
    let (mean_x, mean_y) = (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let sum = |f: fn(f64, f64) -> f64| logs.iter().map(|p| f(p.0 - mean_x, p.1 - mean_y)).sum::<f64>();
    let (xx, xy, yy) = (sum(|x, _| x * x), sum(|x, y| x * y), sum(|_, y| y * y));
    // Times of one machine differ by more than a part in 10^9 where they differ at all.
    if xx <= n * 1e-18 {
        return None;
    }
    let slope = xy / xx;
    let r2 = if yy <= n * 1e-18 { 1.0 } else { (xy * xy / (xx * yy)).clamp(0.0, 1.0) };
    Some(Fit { slope, factor: (mean_y - slope * mean_x).exp(), r2, points: logs.len() })
}
