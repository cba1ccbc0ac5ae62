//! Scan and sort: the twins of `shaders/primitives`. Integer passes: both sides give the same output.

mod scan;
mod sort;

pub use scan::exclusive_scan;
pub use sort::{DIGIT_BITS, digits, radix_sort};
