//! Ranges and ticks of logarithmic axes.

/// The range that holds these numbers with some air, never less than a factor of four; numbers that are not positive and
/// finite are passed over. `None` where none is left.
pub(super) fn range(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    let usable = values.into_iter().filter(|v| v.is_finite() && *v > 0.0);
    let (low, high) = usable.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if high == 0.0 {
        return None;
    }
    let (low, high) = (low.ln(), high.ln());
    let air = ((high - low) * 0.07).max((4f64.ln() - (high - low)) / 2.0);
    // No number of a measurement comes near these ends; the axis stays finite all the same.
    Some(((low - air).exp().max(1e-300), (high + air).exp().min(1e300)))
}

/// At most `most` ticks within `low..=high`, on round numbers.
pub(super) fn ticks(low: f64, high: f64, most: usize) -> Vec<f64> {
    let within = |mantissas: &[f64], every: i32| -> Vec<f64> {
        let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
        (first..=last)
            .filter(|k| k.rem_euclid(every) == 0)
            .flat_map(|k| mantissas.iter().map(move |m| decimal(*m, k)))
            .filter(|v| (low..=high).contains(v))
            .collect()
    };
    let finest = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0];
    let choices: [(&[f64], i32); 9] = [
        (&finest, 1),
        (&[1.0, 2.0, 3.0, 5.0, 7.0], 1),
        (&[1.0, 2.0, 5.0], 1),
        (&[1.0, 3.0], 1),
        (&[1.0], 1),
        (&[1.0], 2),
        (&[1.0], 3),
        (&[1.0], 6),
        (&[1.0], 100),
    ];
    choices.iter().map(|(m, k)| within(m, *k)).find(|t| t.len() <= most).unwrap_or_default()
}

/// `mantissa` times ten to `exponent`, rounded once, so that 1e-3 is the number that 0.001 is.
fn decimal(mantissa: f64, exponent: i32) -> f64 {
    format!("{mantissa}e{exponent}").parse().unwrap_or(0.0)
}
