//! Which law holds contacts apart, and its numbers.

use crate::error::{Result, check};
use crate::layout::solver;
use std::fmt;

/// How velocities are made to fit the contacts. All solve the same rows in the same batches.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Solver {
    /// One sweep a sub-step; the default, and the most accurate.
    OnePass(OnePass),
    /// Soft sub-stepping, as rapier and Box3D have it: three sweeps a sub-step.
    Soft(Soft),
}

impl Default for Solver {
    fn default() -> Self {
        Self::OnePass(OnePass::default())
    }
}

impl fmt::Display for Solver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OnePass(one) if !one.memory => "one pass, no memory",
            Self::OnePass(_) => "one pass",
            Self::Soft(_) => "soft",
        })
    }
}

/// One sweep a sub-step. Impulses and gravity carry over from one sub-step to the next by the bodies' velocities alone;
/// contacts are damped springs as stiff as the sub-step allows, so that they give way by load h² / (stiffness mass); and
/// what they give way by is taken back, because the leak that damps them leads to the impulse that they remember.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnePass {
    /// Spring constant of a contact times h² over its mass, h being the length of a sub-step; 0.3 at first. Walls rock
    /// from about there on.
    pub stiffness: f32,
    /// Share of an impulse, less what is remembered of it, that leaks in a sub-step; 0.025 at first. It damps.
    pub leak: f32,
    /// Whether contacts remember what they bear. On at first. Without, they give way for good.
    pub memory: bool,
}

impl Default for OnePass {
    fn default() -> Self {
        Self { stiffness: 0.3, leak: 0.025, memory: true }
    }
}

/// Soft contacts: damped springs, and a second, rigid visit that takes out the velocity that they put in (Catto,
/// "Solver2D", 2024). They give way by load / (mass (2 pi f)²).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Soft {
    /// Natural frequency as a share of the sub-step rate. 0.125 at first (30 Hz at 4 sub-steps of 1/60 s); walls begin to
    /// rock from about there on.
    pub frequency: f32,
    /// The same for contacts with what does not move. 0.25 at first, as in rapier and Box3D.
    pub static_frequency: f32,
    /// Damping ratio. 10 at first.
    pub damping_ratio: f32,
}

impl Default for Soft {
    fn default() -> Self {
        Self { frequency: 0.125, static_frequency: 0.25, damping_ratio: 10.0 }
    }
}

/// What a spring does in a visit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Spring {
    /// Share of the overlap undone, 1/s.
    pub(crate) bias_rate: f32,
    /// Factor on the mass.
    pub(crate) mass_scale: f32,
    /// Share of the impulse that leaks.
    pub(crate) impulse_scale: f32,
}

/// The numbers of a step that follow from the solver: springs between bodies and against what does not move, and how
/// memory follows.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Law {
    pub(crate) spring: Spring,
    pub(crate) fixed: Spring,
    pub(crate) memory_gain: f32,
    pub(crate) memory_limit: f32,
    pub(crate) memory_band: f32,
}

/// How far below the largest stable rate memory follows: that is eigenvalue (1 - stiffness) / leak.
const MEMORY_SHARE: f32 = 0.05;
/// Memory never follows faster than this share of the difference in a sub-step.
const MEMORY_LIMIT: f32 = 0.02;
/// Share of the gap at which a contact that bears what it remembers stops being one.
const MEMORY_BAND: f32 = 0.9;

impl Solver {
    /// Refuses numbers that no step can run with.
    pub(crate) fn validate(&self, what: impl Fn() -> String) -> Result<()> {
        let what = &what;
        match self {
            Self::OnePass(OnePass { stiffness, leak, .. }) => {
                // From stiffness 1 on the slowest modes grow: see the study in docs/solver.md.
                check((1e-6..1.0).contains(stiffness), what, "solver.stiffness", stiffness, "1e-6 to below 1")?;
                check((1e-6..=0.5).contains(leak), what, "solver.leak", leak, "1e-6 to 0.5")
            }
            Self::Soft(Soft { frequency, static_frequency, damping_ratio }) => {
                let shares = [("solver.frequency", frequency), ("solver.static_frequency", static_frequency)];
                const SHARE: &str = "0.001 to 0.3 of the sub-step rate (above, soft contacts are unstable)";
                for (field, share) in shares {
                    check((1e-3..=0.3).contains(share), what, field, share, SHARE)?;
                }
                check((0.1..=1e3).contains(damping_ratio), what, "solver.damping_ratio", damping_ratio, "0.1 to 1000")
            }
        }
    }

    /// As the passes know it.
    pub(crate) fn code(&self) -> u32 {
        match self {
            Self::OnePass(_) => solver::ONE_PASS,
            Self::Soft(_) => solver::SOFT,
        }
    }

    /// For sub-steps of `h` seconds.
    pub(crate) fn law(&self, h: f32) -> Law {
        match *self {
            Self::OnePass(OnePass { stiffness, leak, memory }) => {
                let rate = stiffness * leak / h;
                let spring = Spring { bias_rate: rate, mass_scale: 1.0 - leak, impulse_scale: leak };
                let on = if memory { 1.0 } else { 0.0 };
                Law {
                    spring,
                    fixed: spring,
                    memory_gain: on * MEMORY_SHARE / leak,
                    memory_limit: on * MEMORY_LIMIT,
                    memory_band: on * MEMORY_BAND * h / stiffness,
                }
            }
            Self::Soft(Soft { frequency, static_frequency, damping_ratio }) => Law {
                spring: spring(frequency, damping_ratio, h),
                fixed: spring(static_frequency, damping_ratio, h),
                ..Law::default()
            },
        }
    }
}

/// A damped spring of angular frequency w = 2 pi f, `frequency` being f h, and of damping ratio z, integrated implicitly
/// over `h` (Catto, "Soft Constraints", GDC 2011; "Solver2D", 2024).
fn spring(frequency: f32, damping_ratio: f32, h: f32) -> Spring {
    let hw = std::f32::consts::TAU * frequency;
    let a1 = 2.0 * damping_ratio + hw;
    let a2 = hw * a1;
    let a3 = 1.0 / (1.0 + a2);
    Spring { bias_rate: hw / (h * a1), mass_scale: a2 * a3, impulse_scale: a3 }
}
