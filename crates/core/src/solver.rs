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
    /// Projected Gauss-Seidel with Baumgarte stabilisation, as Bullet and ODE have it. For comparison.
    GaussSeidel(GaussSeidel),
    /// Jacobi iterations with mass splitting. For comparison.
    Jacobi(Jacobi),
    /// A spring and a damper at each point, integrated explicitly. For comparison.
    Penalty(Penalty),
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
            Self::GaussSeidel(_) => "Gauss-Seidel",
            Self::Jacobi(_) => "Jacobi",
            Self::Penalty(_) => "penalty",
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

/// Projected Gauss-Seidel on velocities: each sub-step integrates velocities, applies the impulses of the last
/// sub-step, visits every contact `iterations` times, and integrates positions (Catto, "Iterative Dynamics with
/// Temporal Coherence", GDC 2005; "Fast and Simple Physics using Sequential Impulses", GDC 2006). Overlap is undone by
/// a velocity that the contacts are given beside (Baumgarte, 1972), which stays in the bodies as energy.
///
/// Iterations and share are Bullet's, which runs them once a step: that is `Accuracy::Substeps(1)`. Bad, then, at tall
/// stacks and large ratios of mass, where the iterations end long before the load has passed all contacts: a column of
/// 20 falls. With sub-steps it is accurate, at many times the cost of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussSeidel {
    /// Visits to every contact in a sub-step. 10 at first.
    pub iterations: u32,
    /// Share of the overlap beyond `slop` undone in a sub-step. 0.2 at first. `Params::max_push_speed` bounds it.
    pub baumgarte: f32,
    /// Overlap left alone, m. 0.001 at first. With none, as in Bullet, what undoes overlap shakes stacks.
    pub slop: f32,
}

impl Default for GaussSeidel {
    fn default() -> Self {
        Self { iterations: 10, baumgarte: 0.2, slop: 0.001 }
    }
}

/// Jacobi iterations: all contacts see the velocities that the iteration began with. Each body is split into as many
/// parts as it has contacts, one for each to push, and takes the mean of their velocities (Tonge, Benevolenski and
/// Voroshilov, "Mass Splitting for Jitter-Free Parallel Rigid Body Simulation", SIGGRAPH 2012). Points of one contact
/// are visited in turn. Everything else is as in [`GaussSeidel`].
///
/// It shows Jacobi's result, not its speed: velocities are summed batch by batch, so that they are the same bits for
/// any number of threads, and so it pays for batches that it could do without. Bad at all that [`GaussSeidel`] is bad
/// at, and more so: a push is shared among the parts, and passes one contact an iteration. A box under one of 100 times
/// its mass is thrown out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jacobi {
    /// Visits to every contact in a sub-step. 10 at first.
    pub iterations: u32,
    /// Share of the overlap beyond `slop` undone in a sub-step. 0.2 at first. `Params::max_push_speed` bounds it.
    pub baumgarte: f32,
    /// Overlap left alone, m. 0.001 at first.
    pub slop: f32,
}

impl Default for Jacobi {
    fn default() -> Self {
        let GaussSeidel { iterations, baumgarte, slop } = GaussSeidel::default();
        Self { iterations, baumgarte, slop }
    }
}

/// The penalty method: where surfaces overlap, a spring and a damper push with what the sub-step began with, all
/// contacts at once (Harada, "Real-Time Rigid Body Simulation on GPUs", GPU Gems 3, chapter 29). Friction is viscous,
/// within Coulomb's cone. Nothing is remembered; batches only order the sums.
///
/// Bad at loads: a point gives way by load h² / (stiffness_share mass), mass being what the point sees and h the
/// sub-step. Friction creeps, a blow lasts some sub-steps, a pile does not come to rest, and overlap that a scene
/// begins with comes back as speed: `Params::max_push_speed` does not bound it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Penalty {
    /// Spring constant of a point times h² over the mass that it sees. 0.1 at first.
    pub stiffness_share: f32,
    /// Damping ratio of a point by itself. 0.5 at first, and no more than (1 - stiffness_share) / (4
    /// sqrt(stiffness_share)). One point alone is stable up to four times that share and damping together; the rest is
    /// for bodies with several.
    pub damping_ratio: f32,
}

impl Default for Penalty {
    fn default() -> Self {
        Self { stiffness_share: 0.1, damping_ratio: 0.5 }
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
    pub(crate) iterations: u32,
    pub(crate) slop: f32,
}

/// How far below the largest stable rate memory follows: that is eigenvalue (1 - stiffness) / leak.
const MEMORY_SHARE: f32 = 0.05;
/// Memory never follows faster than this share of the difference in a sub-step.
const MEMORY_LIMIT: f32 = 0.02;
/// In sub-steps shorter than this, s, memory follows more slowly, by the root of their share of it: what sways near buckling
/// is driven by memory that is quick beside its damper (docs/solver.md).
const MEMORY_SUBSTEP: f32 = 1.0 / 480.0;
/// Share of the gap at which a contact that bears what it remembers stops being one.
const MEMORY_BAND: f32 = 0.9;

/// Factor on the rates of memory in sub-steps of `h` seconds.
pub(crate) fn memory_pace(h: f32) -> f32 {
    (h / MEMORY_SUBSTEP).min(1.0).sqrt()
}

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
            Self::GaussSeidel(GaussSeidel { iterations, baumgarte, slop })
            | Self::Jacobi(Jacobi { iterations, baumgarte, slop }) => {
                check((1..=256).contains(iterations), what, "solver.iterations", iterations, "1 to 256")?;
                check((0.0..=1.0).contains(baumgarte), what, "solver.baumgarte", baumgarte, "0 to 1")?;
                check((0.0..=1.0).contains(slop), what, "solver.slop", slop, "0 to 1 m")
            }
            Self::Penalty(Penalty { stiffness_share, damping_ratio }) => {
                let share = *stiffness_share;
                check((1e-6..1.0).contains(&share), what, "solver.stiffness_share", share, "1e-6 to below 1")?;
                const RATIO: &str =
                    "0 to (1 - stiffness_share) / (4 sqrt(stiffness_share)) (above, contacts gain energy)";
                let most = (1.0 - share) / (4.0 * share.sqrt());
                check((0.0..=most).contains(damping_ratio), what, "solver.damping_ratio", damping_ratio, RATIO)
            }
        }
    }

    /// As the passes know it.
    pub(crate) fn code(&self) -> u32 {
        match self {
            Self::OnePass(_) => solver::ONE_PASS,
            Self::Soft(_) => solver::SOFT,
            Self::GaussSeidel(_) => solver::GAUSS_SEIDEL,
            Self::Jacobi(_) => solver::JACOBI,
            Self::Penalty(_) => solver::PENALTY,
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
                    // Last the factor that levels of sub-steps change: so they round as a world of their sub-steps does.
                    memory_gain: on * MEMORY_SHARE / leak * memory_pace(h),
                    memory_limit: on * MEMORY_LIMIT * memory_pace(h),
                    memory_band: on * MEMORY_BAND * h / stiffness,
                    ..Law::default()
                }
            }
            Self::Soft(Soft { frequency, static_frequency, damping_ratio }) => Law {
                spring: spring(frequency, damping_ratio, h),
                fixed: spring(static_frequency, damping_ratio, h),
                ..Law::default()
            },
            Self::GaussSeidel(GaussSeidel { iterations, baumgarte, slop })
            | Self::Jacobi(Jacobi { iterations, baumgarte, slop }) => {
                let spring = Spring { bias_rate: baumgarte / h, mass_scale: 1.0, impulse_scale: 0.0 };
                Law { spring, fixed: spring, iterations, slop, ..Law::default() }
            }
            Self::Penalty(Penalty { stiffness_share, damping_ratio }) => {
                // Over a sub-step the damper takes this share of the speed.
                let damping = 2.0 * damping_ratio * stiffness_share.sqrt();
                let spring = Spring { bias_rate: stiffness_share / h, mass_scale: damping, impulse_scale: 0.0 };
                Law { spring, fixed: spring, ..Law::default() }
            }
        }
    }
}

/// A damped spring of angular frequency w = 2 pi f, `frequency` being f h, and of damping ratio z, integrated
/// implicitly over `h` (Catto, "Soft Constraints", GDC 2011; "Solver2D", 2024).
fn spring(frequency: f32, damping_ratio: f32, h: f32) -> Spring {
    let hw = std::f32::consts::TAU * frequency;
    let a1 = 2.0 * damping_ratio + hw;
    let a2 = hw * a1;
    let a3 = 1.0 / (1.0 + a2);
    Spring { bias_rate: hw / (h * a1), mass_scale: a2 * a3, impulse_scale: a3 }
}
