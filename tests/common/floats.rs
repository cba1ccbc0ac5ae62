//! How far two sides are apart, by field.

use std::collections::BTreeMap;
use std::fmt;

/// Compares fields and remembers the largest difference of each.
#[derive(Default)]
pub(crate) struct Floats(BTreeMap<&'static str, (f32, f32)>);

impl Floats {
    /// In every element, a field's numbers agree within `tolerance` of the largest of them (or of 1, if that is more);
    /// what is not finite on one side is not on the other.
    pub(crate) fn check<T, const N: usize>(
        &mut self,
        what: &str,
        (name, tolerance): (&'static str, f32),
        (cpu, gpu): (&[T], &[T]),
        field: impl Fn(&T) -> [f32; N],
    ) {
        assert_eq!(cpu.len(), gpu.len(), "{what}: {name}");
        let worst = self.0.entry(name).or_insert((0.0, tolerance));
        for (i, (cpu, gpu)) in cpu.iter().zip(gpu).enumerate() {
            let (cpu, gpu) = (field(cpu), field(gpu));
            let scale = cpu.iter().filter(|x| x.is_finite()).fold(1.0f32, |most, x| most.max(x.abs()));
            for (c, g) in cpu.iter().zip(&gpu) {
                assert_eq!(c.is_finite(), g.is_finite(), "{what}: {name} of {i}: {cpu:?} and {gpu:?}");
                let error = if c.is_finite() { (c - g).abs() / scale } else { 0.0 };
                assert!(error <= tolerance, "{what}: {name} of {i}: {cpu:?} and {gpu:?}: {error:e}");
                worst.0 = worst.0.max(error);
            }
        }
    }
}

impl fmt::Display for Floats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, (error, tolerance)) in &self.0 {
            writeln!(f, "{name:>24} {error:9.2e} of {tolerance:7.0e}")?;
        }
        Ok(())
    }
}
