//! What one thread solves: an island, or as many of one plan as go side by side.

use super::island::{Island, Scene};
use super::island_lanes::IslandLanes;
use super::{Part, level_of, plan};
use crate::shared::Shared;
#[cfg(target_arch = "x86_64")]
use crate::solver::avx2::{self, F32x8};
use crate::solver::simd::Lanes;
use std::fmt::Debug;
use std::sync::{Arc, Mutex};
use tumble_core::JointSet;
use tumble_core::layout::{JointIsland, JointState, SolverBody, StepParams};
use wide::f32x4;

/// Islands that one thread solves.
pub(super) trait Unit: Debug + Send {
    /// A part of a sub-step, of the islands at the step's level.
    fn run(
        &mut self,
        part: Part,
        scene: &Scene<'_>,
        states: &[JointState],
        bodies: &Shared<'_, SolverBody>,
        step: &StepParams,
    );

    /// What lasts of the joints that this step's level solved, by slot; `states` is what lasted before.
    fn store(&mut self, scene: &Scene<'_>, states: &[JointState], step: &StepParams) -> Vec<(u32, JointState)>;
}

/// An island by itself.
#[derive(Debug)]
struct Alone {
    info: JointIsland,
    island: Island,
    /// Whether it is solved at the level of sub-steps that runs.
    runs: bool,
}

impl Unit for Alone {
    fn run(
        &mut self,
        part: Part,
        scene: &Scene<'_>,
        states: &[JointState],
        bodies: &Shared<'_, SolverBody>,
        step: &StepParams,
    ) {
        if part == Part::Begin {
            self.runs = level_of(scene, &self.info, bodies) == Some(step.level);
        }
        match part {
            _ if !self.runs => {}
            Part::Begin => self.island.begin(scene, &self.info, states, bodies, step),
            Part::Solve => self.island.solve(scene, bodies, step),
            _ => self.island.relax(scene, bodies, step),
        }
    }

    fn store(&mut self, scene: &Scene<'_>, _: &[JointState], _: &StepParams) -> Vec<(u32, JointState)> {
        let first = self.info.first_joint as usize;
        let slots = &scene.set.topology.joints[first..][..self.info.joint_count as usize];
        if self.runs { slots.iter().copied().zip(self.island.states(scene.set)).collect() } else { Vec::new() }
    }
}

/// All islands: those of one plan by so many abreast, 8, 4 or 1; what has no neighbour by itself.
pub(super) fn units(set: &JointSet, abreast: usize) -> Vec<Mutex<Box<dyn Unit>>> {
    let mut units: Vec<Box<dyn Unit>> = Vec::new();
    for alike in plan::plans(set) {
        let infos: Vec<JointIsland> = alike.islands.iter().map(|&island| set.topology.islands[island]).collect();
        for (infos, slots) in infos.chunks(abreast).zip(alike.slots.chunks(abreast)) {
            let plan = &alike.plan;
            match infos.len() {
                1 => {
                    let island = Island::new(Arc::clone(plan), slots[0].clone());
                    units.push(Box::new(Alone { info: infos[0], island, runs: false }));
                }
                2..=4 => units.push(Box::new(IslandLanes::<f32x4>::new(plan, infos.to_vec(), slots))),
                #[cfg(target_arch = "x86_64")]
                _ => units.push(Box::new(IslandLanes::<F32x8>::new(plan, infos.to_vec(), slots))),
                #[cfg(not(target_arch = "x86_64"))]
                _ => unreachable!("no more than four abreast"),
            }
        }
    }
    units.into_iter().map(Mutex::new).collect()
}

/// The most islands that this processor solves abreast.
pub(super) fn most_abreast() -> usize {
    #[cfg(target_arch = "x86_64")]
    if avx2::is_there() {
        return F32x8::COUNT;
    }
    f32x4::COUNT
}
