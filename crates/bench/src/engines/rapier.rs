//! The same scene in rapier, for benches and as an oracle of tests.

use super::{Engine, Facts, Means, Refusal, Setting, timed};
use rapier3d::prelude as r;
use tumble_core::{
    Accuracy, BodyHandle, CombineRule, JointBuilder, MotorModel, Params, Pose, Poses, RigidBodyType, Scene, Shape,
    Velocities, Velocity,
};

/// A scene in rapier, with sleep off.
pub struct RapierWorld {
    world: r::PhysicsWorld,
    bodies: Vec<(BodyHandle, r::RigidBodyHandle)>,
}

fn rule(rule: CombineRule) -> r::CoefficientCombineRule {
    match rule {
        CombineRule::Average => r::CoefficientCombineRule::Average,
        CombineRule::Min => r::CoefficientCombineRule::Min,
        CombineRule::Multiply => r::CoefficientCombineRule::Multiply,
        CombineRule::Max => r::CoefficientCombineRule::Max,
    }
}

/// Rapier has no dry friction in joints: a motor that wants to stand still, no stronger than that, is the same where the
/// axis has no other motor. Joints break in none of its.
fn joint(builder: &JointBuilder) -> r::GenericJoint {
    let pose = |anchor, rotation: glam::Quat| r::Pose::from_parts(anchor, rotation.normalize());
    let mut joint = r::GenericJoint {
        local_frame1: pose(builder.local_anchor1, builder.local_rotation1),
        local_frame2: pose(builder.local_anchor2, builder.local_rotation2),
        contacts_enabled: builder.contacts_enabled,
        ..r::GenericJoint::default()
    };
    if builder.coupled {
        joint.coupled_axes = r::JointAxesMask::LIN_AXES;
    }
    if let Some(softness) = builder.softness {
        joint.softness =
            r::SpringCoefficients { natural_frequency: softness.frequency, damping_ratio: softness.damping_ratio };
    }
    let axes = [
        r::JointAxis::LinX,
        r::JointAxis::LinY,
        r::JointAxis::LinZ,
        r::JointAxis::AngX,
        r::JointAxis::AngY,
        r::JointAxis::AngZ,
    ];
    for (i, axis) in axes.into_iter().enumerate() {
        if builder.locked[i] {
            joint.lock_axes(axis.into());
        }
        if let Some(limits) = builder.limits[i] {
            joint.set_limits(axis, limits);
        }
        if let Some(motor) = builder.motors[i] {
            let model = match motor.model {
                MotorModel::AccelerationBased => r::MotorModel::AccelerationBased,
                MotorModel::ForceBased => r::MotorModel::ForceBased,
            };
            joint.set_motor(axis, motor.target_pos, motor.target_vel, motor.stiffness, motor.damping);
            joint.set_motor_model(axis, model);
            joint.set_motor_max_force(axis, motor.max_force.min(f32::MAX));
        } else if builder.friction[i] > 0.0 {
            joint.set_motor(axis, 0.0, 0.0, 0.0, 1e6);
            joint.set_motor_max_force(axis, builder.friction[i]);
        }
    }
    joint
}

impl RapierWorld {
    /// Same dt, sub-steps and gravity; rapier's own defaults otherwise.
    ///
    /// # Panics
    /// When its threads do not start.
    pub fn new(scene: &Scene, params: &Params, threads: usize) -> Self {
        let mut world = r::PhysicsWorld { gravity: scene.gravity, ..r::PhysicsWorld::default() };
        world.integration_parameters.dt = params.dt;
        world.integration_parameters.num_solver_iterations = params.accuracy.fewest() as usize;
        world.physics_pipeline.configure_thread_pool(threads).expect("rapier's threads start");
        let mut bodies = Vec::new();
        for handle in scene.bodies() {
            let b = scene.body(handle).expect("a living body");
            let builder = match b.body_type {
                RigidBodyType::Fixed => r::RigidBodyBuilder::fixed(),
                RigidBodyType::KinematicVelocityBased => r::RigidBodyBuilder::kinematic_velocity_based(),
                RigidBodyType::KinematicPositionBased => r::RigidBodyBuilder::kinematic_position_based(),
                RigidBodyType::Dynamic => r::RigidBodyBuilder::dynamic(),
            };
            let body = world.bodies.insert(
                builder
                    .pose(r::Pose::from_parts(b.translation, b.rotation))
                    .linvel(b.linvel)
                    .angvel(b.angvel)
                    .gravity_scale(b.gravity_scale)
                    .linear_damping(b.linear_damping)
                    .angular_damping(b.angular_damping)
                    .can_sleep(false)
                    .additional_solver_iterations((b.substep_factor as usize - 1) * params.accuracy.fewest() as usize)
                    .enabled_translations(
                        b.enabled_translations[0],
                        b.enabled_translations[1],
                        b.enabled_translations[2],
                    )
                    .enabled_rotations(b.enabled_rotations[0], b.enabled_rotations[1], b.enabled_rotations[2]),
            );
            for (_, c) in scene.colliders_of(handle).expect("a living body") {
                let shape = match c.shape {
                    Shape::Ball { radius } => r::ColliderBuilder::ball(radius),
                    Shape::Cuboid { half_extents: h } => r::ColliderBuilder::cuboid(h.x, h.y, h.z),
                    Shape::HalfSpace { normal } => {
                        r::ColliderBuilder::new(r::SharedShape::halfspace(normal.normalize()))
                    }
                    _ => unreachable!("a shape that rapier is not told of"),
                };
                let collider = shape
                    .position(r::Pose::from_parts(c.translation, c.rotation))
                    .density(c.density)
                    .friction(c.friction)
                    .restitution(c.restitution)
                    .friction_combine_rule(rule(c.friction_rule))
                    .restitution_combine_rule(rule(c.restitution_rule));
                let collider = c.mass.map_or(collider.clone(), |mass| collider.mass(mass));
                world.colliders.insert_with_parent(collider, body, &mut world.bodies);
            }
            bodies.push((handle, body));
        }
        for handle in scene.joints() {
            let (builder, joined) = (scene.joint(handle).expect("living"), scene.joined(handle).expect("living"));
            let [a, b] = joined.map(|body| bodies[bodies.partition_point(|(h, _)| *h < body)].1);
            world.insert_impulse_joint(a, b, joint(builder));
        }
        Self { world, bodies }
    }

    /// One step.
    pub fn step(&mut self) {
        self.world.step();
    }

    /// All poses, in tumble's form.
    pub fn poses(&self) -> Poses {
        Poses::collect(
            0,
            self.bodies.iter().map(|&(h, b)| {
                let p = self.world.bodies[b].position();
                (h, Pose { translation: p.translation, rotation: p.rotation })
            }),
        )
    }

    /// All velocities, in tumble's form.
    pub fn velocities(&self) -> Velocities {
        Velocities::collect(
            0,
            self.bodies.iter().map(|&(h, b)| {
                let b = &self.world.bodies[b];
                (h, Velocity { linear: b.linvel(), angular: b.angvel() })
            }),
        )
    }
}

pub(super) fn make(scene: &Scene, setting: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    let params = Params { dt: setting.dt, accuracy: Accuracy::Substeps(setting.substeps), ..Params::default() };
    Ok(Box::new(Rapier { world: RapierWorld::new(scene, &params, setting.threads), threads: setting.threads }))
}

struct Rapier {
    world: RapierWorld,
    threads: usize,
}

impl Engine for Rapier {
    fn step(&mut self, count: u32) -> Result<Vec<f64>, String> {
        timed(count, || {
            self.world.step();
            Ok(())
        })
    }

    fn state(&mut self) -> Result<(Poses, Velocities), String> {
        Ok((self.world.poses(), self.world.velocities()))
    }

    fn facts(&mut self) -> Facts {
        let adapter = format!("{} threads", self.threads);
        Facts { version: rapier3d::VERSION.into(), adapter, ..Facts::default() }
    }
}
