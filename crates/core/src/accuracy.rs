//! How many sub-steps a step takes: as told, or as many as each island needs.

use crate::error::{Result, check};
use crate::layout::{Control, LEVELS, StepParams};
use crate::limits::STATUS_DELAY;
use std::collections::VecDeque;
use std::fmt;

/// How accurate a step is to be. Collisions are found once a step, contacts are solved once a sub-step; what contacts give
/// way by falls with the square of a sub-step's length.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Accuracy {
    /// This many sub-steps for everything, 1 to 256.
    Substeps(u32),
    /// As many as it takes, for each island by itself (bodies that hang together by contacts and joints). The overlap
    /// that a step leaves is measured at the beginning of the next one, and the separation of joints at its end: an island
    /// with more than the tolerance of either gets twice the sub-steps, step after step up to the cap; one with less than
    /// an eighth of both half as many, after 16 such steps.
    /// The bodies that a world begins with get all at first, so that structures are built with care. A number of sub-steps
    /// that no island took is first run three steps after one wants it, when a GPU has told. What was spent and what is
    /// left: [`StepReport::accuracy`](crate::StepReport::accuracy).
    ///
    /// Less time than [`Accuracy::Substeps`] where most is at rest, more while heaps fall: what is thrown at a heap overlaps
    /// for a while whatever is spent.
    Tolerance {
        /// Deepest overlap that may be left, m; 1e-6 to 1.
        penetration: f32,
        /// Widest separation that rigid locked axes of a joint may be left with, m; 1e-6 to 1. Angles are not measured.
        joint: f32,
        /// Most sub-steps that any island gets; a multiple of 8, 8 to 256. Islands take all of them, a half, a quarter or
        /// an eighth.
        most: u32,
    },
}

impl Default for Accuracy {
    /// 8 sub-steps: one sweep each, they take the time of 4 soft sub-steps.
    fn default() -> Self {
        Self::Substeps(8)
    }
}

impl fmt::Display for Accuracy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Substeps(1) => write!(f, "1 sub-step"),
            Self::Substeps(n) => write!(f, "{n} sub-steps"),
            Self::Tolerance { penetration, joint, most } => {
                // To a thousandth of a millimetre, the least there may be: 0.1 is no f32.
                let mm = |tolerance: &f32| (1e6 * f64::from(*tolerance)).round() / 1e3;
                write!(f, "{} mm, joints {} mm, {most} sub-steps at most", mm(penetration), mm(joint))
            }
        }
    }
}

impl Accuracy {
    pub(crate) fn validate(&self, what: impl Fn() -> String) -> Result<()> {
        let what = &what;
        match *self {
            Self::Substeps(n) => check((1..=256).contains(&n), what, "accuracy.substeps", n, "1 to 256"),
            Self::Tolerance { penetration, joint, most } => {
                check((1e-6..=1.0).contains(&penetration), what, "accuracy.penetration", penetration, "1e-6 to 1 m")?;
                check((1e-6..=1.0).contains(&joint), what, "accuracy.joint", joint, "1e-6 to 1 m")?;
                let even = most.is_multiple_of(1 << (LEVELS - 1));
                check(even && (1..=256).contains(&most), what, "accuracy.most", most, "a multiple of 8, 8 to 256")
            }
        }
    }

    /// Sub-steps of level 0, the lowest.
    pub fn fewest(&self) -> u32 {
        match *self {
            Self::Substeps(n) => n,
            Self::Tolerance { most, .. } => most >> (LEVELS - 1),
        }
    }

    /// Most sub-steps that anything gets.
    pub fn most(&self) -> u32 {
        match *self {
            Self::Substeps(n) | Self::Tolerance { most: n, .. } => n,
        }
    }

    /// Overlap that may be left, m; below zero where none is measured.
    pub(crate) fn tolerance(&self) -> f32 {
        match *self {
            Self::Substeps(_) => -1.0,
            Self::Tolerance { penetration, .. } => penetration,
        }
    }

    /// [`StepParams::joint_scale`].
    pub(crate) fn joint_scale(&self) -> f32 {
        match *self {
            Self::Substeps(_) => 0.0,
            Self::Tolerance { penetration, joint, .. } => penetration / joint,
        }
    }

    /// Whether it asks which bodies hang together.
    pub fn is_by_island(&self) -> bool {
        matches!(self, Self::Tolerance { .. })
    }
}

/// What accuracy on demand spent and left, with [`Accuracy::Tolerance`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spent {
    /// Most sub-steps that an island took.
    pub substeps: u32,
    /// Visits to contacts and joints in the step: its constraints and its joints that are not broken, each times the
    /// sub-steps of its island. Modulo 2^32.
    pub visits: u32,
    /// Deepest overlap that the step before left, m, of those awake.
    pub residual_m: f32,
    /// Widest separation of joints that the step before left, m, of those awake.
    pub joint_residual_m: f32,
    /// Bodies of islands that it left with more than either tolerance.
    pub bodies_over: u32,
}

/// Levels of sub-steps that the last few steps wanted.
#[doc(hidden)]
#[derive(Debug, Default)]
pub struct WantedLevels(VecDeque<(u32, u32)>);

impl WantedLevels {
    /// Takes down what a step that committed wanted.
    pub fn push(&mut self, control: &Control) {
        self.0.push_back((control.step, control.levels_wanted));
        if self.0.len() > 2 * STATUS_DELAY as usize {
            self.0.pop_front();
        }
    }

    /// Those that this step runs: what the one wanted whose report a GPU has by then, so that no decision hangs on what has
    /// arrived, and what bodies ask for. The first steps run the highest, which new worlds want.
    pub fn of(&self, step: &StepParams, asked: u32) -> u32 {
        let known = self.0.iter().find(|(number, _)| number + STATUS_DELAY == step.step);
        let levels = known.map_or(1 << (LEVELS - 1), |(_, levels)| *levels).max(1);
        asked | if step.tolerance < 0.0 { 1 } else { levels }
    }
}
