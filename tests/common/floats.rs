//! How far two sides are apart, by field.

use std::collections::BTreeMap;
use std::fmt;

/// Compares fields and remembers the largest difference of each.
#[derive(Default)]
pub(crate) struct Floats(BTreeMap<&'static str, (f32, f32)>);

impl Floats {
    /// Every number of a field agrees within `tolerance` of the largest that the CPU has there (or of 1, if that is
    /// more); what is not finite on one side is not on the other.
    pub(crate) fn check<'a, T, const N: usize>(
        &mut self,
        what: &str,
        (name, tolerance): (&'static str, f32),
        (cpu, gpu): (&'a [T], &'a [T]),
        field: impl Fn(&'a T) -> [f32; N],
    ) {
        assert_eq!(cpu.len(), gpu.len(), "{what}: {name}");
        let largest = cpu.iter().flat_map(&field).filter(|x| x.is_finite()).fold(1.0, |most: f32, x| most.max(x.abs()));
        let entry = self.0.entry(name).or_insert((0.0, tolerance));
        for (i, (cpu, gpu)) in cpu.iter().zip(gpu).enumerate() {
            for (cpu, gpu) in field(cpu).into_iter().zip(field(gpu)) {
                assert_eq!(cpu.is_finite(), gpu.is_finite(), "{what}: {name} of {i}: {cpu} and {gpu}");
                if cpu.is_finite() {
                    let error = (cpu - gpu).abs() / largest;
                    assert!(error <= tolerance, "{what}: {name} of {i}: {cpu} and {gpu}, largest {largest}: {error:e}");
                    entry.0 = entry.0.max(error);
                }
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
