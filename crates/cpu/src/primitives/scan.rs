//! Exclusive scan: the twin of `shaders/primitives/scan.wgsl`. The plain version; the sum of integers does not depend
//! on the order, so there are no blocks here.

/// Replaces each element by the sum of those before it, and returns the sum of all. Sums wrap at 2^32, as on the GPU.
pub fn exclusive_scan(data: &mut [u32]) -> u32 {
    let mut sum = 0u32;
    for element in data {
        let value = *element;
        *element = sum;
        sum = sum.wrapping_add(value);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::exclusive_scan;

    #[test]
    fn sums_those_before() {
        let mut data = [3, 0, 5, u32::MAX, 2];
        assert_eq!(exclusive_scan(&mut data), 9);
        assert_eq!(data, [0, 3, 3, 8, 7]);
        assert_eq!(exclusive_scan(&mut []), 0);
    }
}
