//! Stable compaction: the twin of `shaders/primitives/compact.wgsl`. The plain version; the order is that of the
//! elements, so the blocks do not show.

/// Indices of the elements whose flag is not zero, in order; their `values` instead when there are some.
///
/// # Panics
/// When `values` are fewer than `flags`.
pub fn compact(flags: &[u32], values: Option<&[u32]>) -> Vec<u32> {
    let kept = (0..flags.len()).filter(|&i| flags[i] != 0);
    match values {
        None => kept.map(|i| i as u32).collect(),
        Some(values) => kept.map(|i| values[i]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::compact;

    #[test]
    fn keeps_the_order() {
        assert_eq!(compact(&[0, 1, 0, 7, u32::MAX], None), [1, 3, 4]);
        assert_eq!(compact(&[0, 1, 0, 7, u32::MAX], Some(&[9, 8, 7, 6, 5])), [8, 6, 5]);
        assert_eq!(compact(&[], None), []);
    }
}
