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
use tumble_core::layout::{JointIsland, JointState, SolverBody, StepParams, joint_bits};
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

/// All islands: those of one plan by so many abreast, 8, 4 or 1; by itself what has no neighbour, and what has bodies with
/// locked axes, which lanes do not know. Eight at once take no longer than four do.
pub(super) fn units(set: &JointSet, abreast: usize) -> Vec<Mutex<Box<dyn Unit>>> {
    let mut units: Vec<Box<dyn Unit>> = Vec::new();
    for alike in plan::plans(set) {
        let is_held = alike.plan.kinds.iter().any(|[_, flags]| flags & joint_bits::HELD != 0);
        let abreast = if is_held { 1 } else { abreast };
        let infos: Vec<JointIsland> = alike.islands.iter().map(|&island| set.topology.islands[island]).collect();
        for (infos, slots) in infos.chunks(abreast).zip(alike.slots.chunks(abreast)) {
            let plan = &alike.plan;
            match infos.len() {
                1 => {
                    let island = Island::new(Arc::clone(plan), slots[0].clone());
                    units.push(Box::new(Alone { info: infos[0], island, runs: false }));
                }
                #[cfg(target_arch = "x86_64")]
                _ if abreast > f32x4::COUNT => {
                    units.push(Box::new(IslandLanes::<F32x8>::new(plan, infos.to_vec(), slots)))
                }
                _ => units.push(Box::new(IslandLanes::<f32x4>::new(plan, infos.to_vec(), slots))),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::World;
    use glam::{Quat, Vec3};
    use tumble_core::{
        Accuracy, BodyHandle, ColliderBuilder, JointAxis, JointBuilder, MotorModel, Params, RigidBodyBuilder, Scene,
        Sleep, scenes,
    };

    fn block(scene: &mut Scene, at: Vec3, turn: Quat, held: bool) -> BodyHandle {
        let body = RigidBodyBuilder::dynamic().translation(at).rotation(turn).angvel(turn * Vec3::new(0.3, 0.2, 0.5));
        let body = if held { body.enabled_translations(true, true, false) } else { body };
        scene.insert(body, ColliderBuilder::cuboid(0.2, 0.1, 0.15).density(200.0)).body
    }

    /// Of each kind, eleven pairs of blocks that hang from a fixed body, all turned differently; some break, some are held in a
    /// plane.
    fn kinds() -> Scene {
        let mut scene = Scene::new();
        let kinds = [
            JointBuilder::fixed(),
            JointBuilder::fixed().softness(5.0, 0.5),
            JointBuilder::spherical(),
            JointBuilder::spherical().limits(JointAxis::AngX, [-0.1, 0.2]).limits(JointAxis::AngY, [-0.3, 0.1]),
            JointBuilder::spherical().limits(JointAxis::AngX, [0.1, 0.1]).friction(JointAxis::AngZ, 0.5),
            JointBuilder::revolute(Vec3::new(1.0, 1.0, 0.2)).motor_velocity(JointAxis::AngX, 5.0, 2.0),
            JointBuilder::revolute(Vec3::Z).limits(JointAxis::AngX, [-0.5, 0.01]).friction(JointAxis::AngX, 0.5),
            JointBuilder::revolute(Vec3::Z)
                .motor_position(JointAxis::AngX, 4.0, 100.0, 10.0)
                .motor_max_force(JointAxis::AngX, 20.0)
                .motor_model(JointAxis::AngX, MotorModel::ForceBased),
            JointBuilder::prismatic(Vec3::new(1.0, -0.2, 0.0)).limits(JointAxis::LinX, [-0.01, 0.02]),
            JointBuilder::prismatic(Vec3::new(0.2, -1.0, 0.0)).friction(JointAxis::LinX, 30.0),
            JointBuilder::rope(0.4),
            JointBuilder::distance(0.5),
            JointBuilder::spring(0.3, 500.0, 20.0),
            JointBuilder::universal(Vec3::X, Vec3::Y),
            JointBuilder::universal(Vec3::X, Vec3::Z).limits(JointAxis::AngX, [-0.05, 0.05]),
        ];
        for (i, kind) in kinds.into_iter().enumerate() {
            for copy in 0..11 {
                let at = Vec3::new(3.0 * i as f32, 0.0, 3.0 * copy as f32);
                let turn = Quat::from_scaled_axis(Vec3::new(0.3, 0.7, -0.2) * copy as f32);
                let place = |x: f32, z: f32| at + turn * Vec3::new(x, 0.0, z);
                let anchor = scene.insert(RigidBodyBuilder::fixed().translation(at), ColliderBuilder::ball(0.01)).body;
                let hanging = block(&mut scene, place(0.4, 0.1), turn, copy % 5 == 3);
                let below = block(&mut scene, place(0.8, 0.1), turn, false);
                let most = if copy % 5 == 2 { 60.0 } else { 1e9 };
                let kind = kind.clone().breakable(most, most).local_anchor2(Vec3::new(-0.4, 0.0, -0.1));
                scene.insert_joint(anchor, hanging, kind.clone().local_rotation1(turn)).unwrap();
                let kind = kind.local_anchor1(Vec3::new(0.2, 0.0, 0.0)).local_anchor2(Vec3::new(-0.2, 0.0, 0.0));
                scene.insert_joint(hanging, below, kind).unwrap();
            }
        }
        scene
    }

    /// Oracle: the plain form, one island after the other. Zeros may differ in their sign. What is broken gives nothing. In
    /// eleven copies no group of four or eight is full at the end; islands that sleep, or have more sub-steps, share groups with others.
    #[test]
    fn abreast_or_alone() {
        let params = |accuracy| Params { accuracy, threads: Some(2), ..Params::default() };
        let mut lazy = params(Accuracy::Tolerance { penetration: 1e-3, joint: 1e-3, most: 16 });
        lazy.sleep = Some(Sleep { time: 0.3, ..Sleep::default() });
        let all = [
            ("kinds", kinds(), params(Accuracy::Substeps(2)), 90),
            ("figures", scenes::ragdolls(13), params(Accuracy::Substeps(1)), 120),
            ("lazy figures", scenes::ragdolls(13), lazy, 240),
        ];
        for (name, scene, params, steps) in all {
            let widths = [1, f32x4::COUNT, most_abreast()];
            let mut worlds = widths.map(|abreast| {
                let mut world = World::new(scene.clone(), params).unwrap();
                world.joints_mut().abreast = abreast;
                world
            });
            let mut asleep = 0;
            let mut broken = vec![false; scene.joints().count()];
            for step in 0..steps {
                let [alone, abreast @ ..] = worlds.each_mut().map(|world| {
                    world.step().unwrap();
                    let report = world.sync().unwrap();
                    asleep = asleep.max(report.asleep);
                    let states = world.joints_mut().states.clone();
                    (world.poses().unwrap(), world.velocities().unwrap(), states, report.broken_joints)
                });
                assert_eq!(alone.2.len(), broken.len());
                for (joint, was_broken) in alone.2.iter().zip(&mut broken) {
                    assert!(!*was_broken || (joint.impulse, joint.torque) == ([0.0; 3], [0.0; 3]), "{name}: {joint:?}");
                    *was_broken = joint.broken != 0;
                }
                for other in abreast {
                    for (joint, (alone, other)) in alone.2.iter().zip(&other.2).enumerate() {
                        assert_eq!(alone, other, "{name}, step {step}, joint {joint}");
                    }
                    assert_eq!(alone.3, other.3, "{name}, step {step}");
                    for body in scene.bodies() {
                        assert_eq!(alone.0[body], other.0[body], "{name}, step {step}, {body}");
                        assert_eq!(
                            alone.1.get(body).unwrap(),
                            other.1.get(body).unwrap(),
                            "{name}, step {step}, {body}"
                        );
                    }
                }
            }
            let broken = worlds[0].sync().unwrap().broken_joints;
            println!("{name}: {broken} broken, at most {asleep} asleep");
            assert_eq!(name == "kinds", broken > 0, "{name}");
            assert_eq!(name == "lazy figures", asleep > 0, "{name}");
        }
    }
}
