//! The same scene on either side, behind one face.

use tumble::World;
use tumble_core::{Params, Result, Scene, StepReport, measures};

use crate::common::gpu;

/// Where a world runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    Cpu,
    Gpu,
}

pub(crate) const SIDES: [Side; 2] = [Side::Cpu, Side::Gpu];

impl Side {
    pub(crate) fn try_world(self, scene: Scene, params: Params) -> Result<World> {
        Ok(match self {
            Side::Cpu => World::Cpu(Box::new(tumble_cpu::World::new(scene, params)?)),
            Side::Gpu => World::Gpu(Box::new(tumble_gpu::World::with_gpu(gpu().clone(), scene, params)?)),
        })
    }

    pub(crate) fn world(self, scene: &Scene, params: &Params) -> World {
        self.try_world(scene.clone(), *params).unwrap()
    }
}

/// So many steps, none waited for.
pub(crate) fn steps(world: &mut World, count: usize) {
    for _ in 0..count {
        world.step().unwrap();
    }
}

/// The exact bits of all poses and velocities, as a number.
pub(crate) fn hash(world: &mut World) -> u64 {
    measures::state_hash(&world.poses().unwrap(), &world.velocities().unwrap())
}

/// The same hook on both sides: the next step leaves out this pair.
pub(crate) fn drop_pair(world: &mut World, index: u32) {
    match world {
        World::Cpu(world) => world.drop_pair(index),
        World::Gpu(world) => world.drop_pair(index),
    }
}

/// The report, once every step has run.
pub(crate) fn report(world: &mut World) -> StepReport {
    world.sync().unwrap()
}
