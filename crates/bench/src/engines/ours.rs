//! tumble itself, on both sides.

use super::{Engine, Facts, Means, Refusal, Setting, timed};
use tumble::prelude::*;
use tumble_core::{Scene, StageTime, Velocities};

/// Position, rotation, both velocities.
const BYTES_A_BODY: u64 = 4 * (3 + 4 + 3 + 3);
/// Normal and friction impulses.
const BYTES_A_POINT: u64 = 4 * 3;

struct Ours {
    world: World,
    asked: Setting,
    /// A report of some step that lost something.
    lost: Option<String>,
}

pub(super) fn has_gpu(means: &Means) -> Result<(), String> {
    means.gpu.as_ref().map(|_| ()).ok_or_else(|| "there is no adapter".into())
}

fn params(setting: &Setting) -> Params {
    Params {
        dt: setting.dt,
        accuracy: setting.method.accuracy(setting.substeps),
        threads: Some(setting.threads),
        broadphase: setting.broadphase,
        solver: setting.method.solver,
        profile: setting.profile,
        ..Params::default()
    }
}

pub(super) fn cpu(scene: &Scene, setting: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    let world = World::new(scene.clone(), params(setting), Backend::Cpu);
    let world = world.map_err(|error| Refusal::Failed(error.to_string()))?;
    Ok(Box::new(Ours { world, asked: *setting, lost: None }))
}

pub(super) fn gpu(scene: &Scene, setting: &Setting, means: &Means) -> Result<Box<dyn Engine>, Refusal> {
    let gpu = means.gpu.clone().ok_or_else(|| Refusal::Failed("there is no adapter".into()))?;
    let world = tumble_gpu::World::with_gpu(gpu, scene.clone(), params(setting));
    let world = world.map_err(|error| Refusal::Failed(error.to_string()))?;
    Ok(Box::new(Ours { world: World::Gpu(Box::new(world)), asked: *setting, lost: None }))
}

impl Engine for Ours {
    fn step(&mut self, count: u32) -> Result<Vec<f64>, String> {
        let Self { world, lost, .. } = self;
        timed(count, || {
            world.step().map_err(|e| e.to_string())?;
            let report = world.sync().map_err(|e| e.to_string())?;
            if lost.is_none() && (report.lost > 0 || report.quarantined > 0) {
                *lost =
                    Some(format!("step {}: {} lost, {} in quarantine", report.step, report.lost, report.quarantined));
            }
            Ok(())
        })
    }

    fn state(&mut self) -> Result<(Poses, Velocities), String> {
        let poses = self.world.poses().map_err(|e| e.to_string())?;
        Ok((poses, self.world.velocities().map_err(|e| e.to_string())?))
    }

    fn facts(&mut self) -> Facts {
        let report = self.world.sync().unwrap_or_default();
        Facts {
            version: env!("CARGO_PKG_VERSION").into(),
            adapter: report.adapter,
            broadphase: self.asked.broadphase.to_string(),
            solver: self.asked.method.to_string(),
            differs: Vec::new(),
            floor_bytes: Some(
                2 * (BYTES_A_BODY * u64::from(report.bodies) + BYTES_A_POINT * u64::from(report.contacts)),
            ),
        }
    }

    fn check(&mut self) -> Result<(), String> {
        self.lost.clone().map_or(Ok(()), Err)
    }

    fn stages(&mut self) -> Vec<StageTime> {
        self.world.sync().map(|report| report.stages).unwrap_or_default()
    }
}
