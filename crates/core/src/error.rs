//! What can go wrong, said to the person who reads it: what, where, the value, what is allowed, what to do.

use crate::handle::{BodyHandle, ColliderHandle, JointHandle};

/// The result of everything here that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Every way in which the library refuses or fails.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value that came in is not allowed.
    #[error("{what}: {field} is {value}; allowed: {allowed}")]
    Invalid {
        /// The thing that has the field, for example `body 3` or `Params`.
        what: String,
        /// The field's name.
        field: &'static str,
        /// The value that was refused.
        value: String,
        /// What would have been accepted.
        allowed: &'static str,
    },
    /// A handle whose body was removed, or that belongs to another scene.
    #[error("{0} names no living body: it was removed, or belongs to another scene")]
    StaleBody(BodyHandle),
    /// A handle whose collider was removed, or that belongs to another scene.
    #[error("{0} names no living collider: it was removed, or belongs to another scene")]
    StaleCollider(ColliderHandle),
    /// A handle whose joint was removed, or that belongs to another scene.
    #[error("{0} names no living joint: it was removed, alone or with one of its bodies, or belongs to another scene")]
    StaleJoint(JointHandle),
    /// More elements than a buffer holds, and growth is forbidden or impossible.
    #[error(
        "buffer `{buffer}` needs room for {needed} elements and has room for {capacity}; {} (the last good state is \
         still readable)",
        advice(buffer)
    )]
    Capacity {
        /// The buffer's name.
        buffer: &'static str,
        /// Elements that the step counted.
        needed: u64,
        /// Elements that it can hold.
        capacity: u64,
    },
    /// No adapter answered.
    #[error(
        "no GPU adapter was found ({detail}); install a Vulkan driver (Debian: `apt-get install mesa-vulkan-drivers` for the software one), or choose `Backend::Cpu`"
    )]
    NoAdapter {
        /// What was asked for, and what the driver said.
        detail: String,
    },
    /// The backend was left out of this build.
    #[error("this build has no {backend} backend; enable the cargo feature `{backend}` of `tumble`")]
    NotBuilt {
        /// `cpu` or `gpu`.
        backend: &'static str,
    },
    /// The adapter's limits are too small for the scene.
    #[error(
        "adapter `{adapter}`: {limit} is {available} and the scene needs {needed}; make the scene smaller or take another adapter"
    )]
    Limits {
        /// The adapter's name.
        adapter: String,
        /// The limit's name in wgpu.
        limit: &'static str,
        /// What the scene needs.
        needed: u64,
        /// What the adapter has.
        available: u64,
    },
    /// A buffer could not be created.
    #[error("out of memory: buffer `{buffer}` of {bytes} bytes could not be created")]
    OutOfMemory {
        /// The buffer's name.
        buffer: String,
        /// Its size in bytes.
        bytes: u64,
    },
    /// The device went away; poses fetched before are still readable.
    #[error(
        "the GPU device was lost ({reason}); the poses fetched last are still readable; build a new World to go on"
    )]
    DeviceLost {
        /// What the driver said.
        reason: String,
    },
    /// The driver refused something that should be valid: a defect here or there.
    #[error("the GPU refused {what}: {message}")]
    Gpu {
        /// What was being made or run.
        what: String,
        /// The driver's words.
        message: String,
    },
}

/// Refuses `value` unless `ok`, naming where it came from.
pub(crate) fn check(
    ok: bool,
    what: impl FnOnce() -> String,
    field: &'static str,
    value: impl std::fmt::Debug,
    allowed: &'static str,
) -> Result<()> {
    if ok { Ok(()) } else { Err(Error::Invalid { what: what(), field, value: format!("{value:?}"), allowed }) }
}

fn advice(buffer: &str) -> &'static str {
    match buffer {
        "partners" => "too many colliders lie around one place: spread them out",
        "query" => "one query meets too many nodes of the tree: make it smaller, or ask it in parts",
        "query_found" => "ask for fewer overlaps at once",
        "half-spaces" => "every collider is tested against each of them: use fewer, or large cuboids",
        "last batch" => {
            "too many contacts on bodies that touch more than 63 others: split those bodies or spread the others out"
        }
        _ => "allow growth in `Params::capacities`, raise its `pairs` or `max_array_bytes`, or make the scene smaller",
    }
}
