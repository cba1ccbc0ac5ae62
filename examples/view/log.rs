//! What happens, told a line at a time, for scripts and tests.

use serde_json::Value;
use std::io::{self, Write};

/// Tells on standard output, if asked to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Log {
    is_on: bool,
}

impl Log {
    pub(crate) fn new(is_on: bool) -> Self {
        Self { is_on }
    }

    /// One line; what it holds is only made when somebody wants it.
    pub(crate) fn tell(&self, event: impl FnOnce() -> Value) {
        if self.is_on {
            let mut out = io::stdout().lock();
            // A reader that had enough is no reason to end.
            let _ = writeln!(out, "{}", event()).and_then(|()| out.flush());
        }
    }
}
