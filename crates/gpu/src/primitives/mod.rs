//! Scan, compaction and sort, and dispatch arguments from counts that only the GPU knows. Each works alone, on a user's
//! buffers.

mod args;
mod compact;
mod scan;
mod sort;

pub use args::{Args, Job};
pub use compact::{Compact, CompactOptions};
pub use scan::{Scan, ScanOptions};
pub use sort::{Ranking, Sort, SortOptions};

/// Stands for "no word" in the shaders.
const NO_WORD: u32 = u32::MAX;

/// Where parts of a uniform buffer may begin, bytes: wgpu's default limit.
const UNIFORM_STEP: u64 = 256;

/// Where the number of elements comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Count {
    /// The host says it, here or later; dispatches are direct.
    Host(u32),
    /// It is this word of the `counts` buffer when the pass runs; dispatches are indirect. More than the capacity
    /// counts as the capacity.
    Word(u32),
}

impl Count {
    /// (count, count_word) as the shaders want them.
    fn words(self) -> (u32, u32) {
        match self {
            Self::Host(count) => (count, NO_WORD),
            Self::Word(word) => (0, word),
        }
    }
}
