//! Scan, compaction and sort: the twins of `shaders/primitives`. Integer passes: both sides give the same output.

mod compact;
mod scan;
mod sort;
mod sort_by;

pub use compact::compact;
pub use scan::exclusive_scan;
pub use sort::{DIGIT_BITS, digits, radix_sort};
pub use sort_by::radix_sort_by;
