//! What a step did.

use crate::accuracy::Spent;
use crate::handle::JointHandle;
use crate::layout::{Control, QUARANTINE_NAMES, StepParams};
use crate::params::Broadphase;
use crate::topology::Topology;
use std::fmt;

/// Time of one stage in one step.
#[derive(Debug, Clone, PartialEq)]
pub struct StageTime {
    /// The stage's name: its folder of shaders, its file, its label.
    pub stage: &'static str,
    /// ms; `None` where the adapter has no timestamps.
    pub milliseconds: Option<f64>,
}

/// One run of a stage in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageRun {
    /// The stage's name, or that of something else that the host did; see [`StepReport::host_runs`].
    pub stage: &'static str,
    /// When it began, ms; from when on, the list that it is in says.
    pub begin: f64,
    /// How long it took, ms.
    pub milliseconds: f64,
}

impl StageTime {
    /// Time of each stage, in the order of their first runs.
    pub fn sums(runs: &[StageRun]) -> Vec<Self> {
        let mut times: Vec<Self> = Vec::new();
        for run in runs {
            match times.iter_mut().find(|time| time.stage == run.stage) {
                Some(time) => time.milliseconds = time.milliseconds.map(|sum| sum + run.milliseconds),
                None => times.push(Self { stage: run.stage, milliseconds: Some(run.milliseconds) }),
            }
        }
        times
    }
}

/// Overlap of all touching pairs; see [`measures`](crate::measures).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Penetration {
    /// Deepest, m.
    pub max_m: f64,
    /// Mean over overlapping pairs, m.
    pub mean_m: f64,
}

/// How joints were solved, see [`JointSolver`](crate::JointSolver).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct JointsSolved {
    /// Joints that were solved directly.
    pub direct: u32,
    /// Islands of those.
    pub islands: u32,
    /// Joints that were solved by Gauss-Seidel.
    pub gauss_seidel: u32,
    /// Islands that fell back to it, being too large to be solved directly.
    pub too_large: u32,
}

impl JointsSolved {
    /// What the topology says.
    #[doc(hidden)]
    pub fn of(topology: &Topology) -> Self {
        let (direct, islands) = (topology.direct_joints(), topology.islands.len() as u32);
        Self { direct, islands, gauss_seidel: topology.joint_count() - direct, too_large: topology.too_large }
    }
}

/// What one step found and did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepReport {
    /// Number of the step, from 1; 0 before the first.
    pub step: u64,
    /// `cpu` or `gpu`.
    pub backend: &'static str,
    /// The adapter and driver, or the instruction set, lanes and threads of the CPU side.
    pub adapter: String,
    /// Bodies in the scene.
    pub bodies: u32,
    /// Pairs of overlapping bounding boxes.
    pub pairs: u32,
    /// Manifolds with points.
    pub manifolds: u32,
    /// Contact points.
    pub contacts: u32,
    /// Batches in use, the last one excluded.
    pub batches: u32,
    /// Rounds that placing new constraints took.
    pub batch_rounds: u32,
    /// Constraints solved in sequence in the last batch.
    pub last_batch: u32,
    /// Found minus processed, over pairs and constraints: zero, or something was lost.
    pub lost: u64,
    /// Bodies asleep when the step was done. Their pairs, manifolds and contacts are counted above.
    pub asleep: u32,
    /// Islands awake, where the world has [`Params::sleep`](crate::Params::sleep) or
    /// [`Accuracy::Tolerance`](crate::Accuracy::Tolerance); else 0.
    pub islands: u32,
    /// Islands asleep.
    pub islands_asleep: u32,
    /// What accuracy on demand spent and left; `None` without [`Accuracy::Tolerance`](crate::Accuracy::Tolerance).
    pub accuracy: Option<Spent>,
    /// Bodies in quarantine, all told.
    pub quarantined: u32,
    /// Slots of bodies newly quarantined in this step, the first few.
    pub newly_quarantined: Vec<u32>,
    /// How the step's joints were solved.
    pub joints: JointsSolved,
    /// Joints that are broken, all told; [`Joints`](crate::Joints) tells which.
    pub broken_joints: u32,
    /// Joints that broke in this step, the first few. Each is named in one step alone: who must not miss any asks for the
    /// report of each step, or for all joints in bulk.
    pub newly_broken: Vec<JointHandle>,
    /// How often each buffer grew since the world was made.
    pub growths: Vec<(&'static str, u32)>,
    /// Bytes that the world holds.
    pub memory_bytes: u64,
    /// The broad phase that ran, never `Auto`.
    pub broadphase: Broadphase,
    /// Bytes of them that are the broad phase's own: cells or trees, the pair list not counted.
    pub broadphase_bytes: u64,
    /// Turns that the search for partners took, over all colliders, modulo 2^32: cells' entries or trees' nodes.
    pub broadphase_turns: u32,
    /// Milliseconds a stage, when profiling.
    pub stages: Vec<StageTime>,
    /// What the host did since the last call of `step` began, in ms from there, in the order of the beginnings; when
    /// profiling. On the CPU side its stages, and `growth` of buffers between two attempts. On a GPU `growth`,
    /// `pipelines` (their making), `upload`, `record` and `submit` of the commands, `wait` for earlier steps or all of them,
    /// and `readback` of results. Those that begin within another lie within it.
    pub host_runs: Vec<StageRun>,
    /// The stages of the last submission that was timed, by the device's clock: ms since the first of them began; when
    /// profiling on a GPU that has timestamps. That clock has no known relation to the host's.
    pub device_runs: Vec<StageRun>,
}

impl StepReport {
    /// The part that the counters of a committed step tell.
    pub fn from_control(control: &Control) -> Self {
        let lost = (control.pair_count - control.processed.min(control.pair_count)) as u64
            + (control.constraint_count - control.solved.min(control.constraint_count)) as u64;
        Self {
            step: control.step as u64,
            pairs: control.pair_count,
            manifolds: control.constraint_count + control.manifolds_asleep,
            contacts: control.point_count,
            batches: control.batch_count,
            batch_rounds: control.rounds,
            last_batch: control.last_count,
            broadphase_turns: control.turns,
            lost,
            asleep: control.asleep,
            islands: control.islands,
            islands_asleep: control.islands_asleep,
            quarantined: control.frozen_count,
            broken_joints: control.broken_joints,
            newly_quarantined: control.quarantined[..QUARANTINE_NAMES]
                .iter()
                .filter(|&&s| s != 0)
                .map(|s| s - 1)
                .collect(),
            ..Self::default()
        }
    }

    /// What accuracy on demand spent, by the counters and what the step was told.
    pub fn spent(control: &Control, step: &StepParams) -> Option<Spent> {
        (step.tolerance >= 0.0).then(|| Spent {
            substeps: control.levels_used.checked_ilog2().map_or(0, |level| step.substeps << level),
            visits: control.visits,
            residual_m: f32::from_bits(control.residual),
            joint_residual_m: f32::from_bits(control.joint_residual),
            bodies_over: control.bodies_over,
        })
    }

    /// Bytes of the broad phase for each body.
    pub fn broadphase_bytes_per_body(&self) -> f64 {
        self.broadphase_bytes as f64 / f64::from(self.bodies.max(1))
    }

    /// How often `buffer` grew.
    pub fn growths_of(&self, buffer: &str) -> u32 {
        self.growths.iter().find(|(name, _)| *name == buffer).map_or(0, |(_, n)| *n)
    }
}

impl fmt::Display for StepReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "step {} on {} ({}): {} bodies, {} pairs, {} contacts in {} manifolds, {} batches (+{} in sequence)",
            self.step,
            self.backend,
            self.adapter,
            self.bodies,
            self.pairs,
            self.contacts,
            self.manifolds,
            self.batches,
            self.last_batch
        )?;
        write!(f, ", {} ({:.0} bytes a body)", self.broadphase, self.broadphase_bytes_per_body())?;
        if self.lost > 0 {
            write!(f, "; LOST {}", self.lost)?;
        }
        if self.quarantined > 0 {
            write!(f, "; {} in quarantine (new: {:?})", self.quarantined, self.newly_quarantined)?;
        }
        let JointsSolved { direct, islands, gauss_seidel, too_large } = self.joints;
        if direct + gauss_seidel > 0 {
            write!(f, "; joints: {direct} directly in {islands} islands, {gauss_seidel} by Gauss-Seidel")?;
            write!(f, " ({too_large} islands too large)")?;
        }
        if self.broken_joints > 0 {
            write!(f, "; {} joints broken (new:", self.broken_joints)?;
            self.newly_broken.iter().try_for_each(|joint| write!(f, " {joint}"))?;
            write!(f, ")")?;
        }
        if self.islands_asleep > 0 {
            write!(f, "; asleep: {} bodies in {} islands", self.asleep, self.islands_asleep)?;
        }
        if let Some(Spent { substeps, residual_m, joint_residual_m, bodies_over, .. }) = self.accuracy {
            let (overlap, joints) = (1e3 * residual_m, 1e3 * joint_residual_m);
            write!(f, "; up to {substeps} sub-steps, {overlap:.3} mm left, joints {joints:.3} mm")?;
            if bodies_over > 0 {
                write!(f, " ({bodies_over} bodies over the tolerances)")?;
            }
        }
        for (buffer, n) in &self.growths {
            write!(f, "; `{buffer}` grew {n} times")?;
        }
        Ok(())
    }
}
