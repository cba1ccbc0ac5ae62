//! A scene as flat arrays, ready for a backend's buffers. Index = handle slot.

use crate::builder::RigidBodyType;
use crate::error::Result;
use crate::handle::{BodyHandle, JointHandle};
use crate::joint::{JointAxis, MotorModel};
use crate::layout::{
    BodyProps, BodyState, Collider, Joint, JointDrive, MOST_CREDIT, body_flags, joint_bits, shape_kind,
};
use crate::mass::MassProperties;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::shape::Shape;
use bytemuck::Zeroable;
use glam::{Quat, Vec3};

/// Everything a backend needs to begin.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedScene {
    /// m/s².
    pub gravity: Vec3,
    /// By body slot; empty slots are zero.
    pub states: Vec<BodyState>,
    /// By body slot.
    pub props: Vec<BodyProps>,
    /// By collider slot; empty slots are zero.
    pub colliders: Vec<Collider>,
    /// What the scene can need.
    pub plan: Plan,
}

impl PackedScene {
    /// Packs a valid scene; else says what is not allowed.
    pub fn new(scene: &Scene) -> Result<Self> {
        scene.validate()?;
        let mut packed = Self {
            gravity: scene.gravity,
            states: vec![BodyState::zeroed(); scene.bodies.len()],
            props: vec![BodyProps::zeroed(); scene.bodies.len()],
            colliders: vec![Collider::zeroed(); scene.colliders.len()],
            plan: Plan::of(scene),
        };
        for body in scene.bodies() {
            let own = pack_body(scene, body)?;
            packed.states[body.slot()] = own.state;
            packed.props[body.slot()] = own.props;
            for (slot, collider) in own.colliders {
                packed.colliders[slot] = collider;
            }
        }
        Ok(packed)
    }
}

/// One body as a backend stores it.
pub(crate) struct PackedBody {
    pub(crate) state: BodyState,
    pub(crate) props: BodyProps,
    /// By slot.
    pub(crate) colliders: Vec<(usize, Collider)>,
}

pub(crate) fn pack_body(scene: &Scene, body: BodyHandle) -> Result<PackedBody> {
    let builder = &scene.entry(body)?.builder;
    let dynamic = builder.body_type == RigidBodyType::Dynamic;
    // What nothing pushes keeps its own frame: its mass is never used.
    let mass = if dynamic {
        scene.mass_properties(body)?
    } else {
        MassProperties {
            mass: 0.0,
            center_of_mass: Vec3::ZERO,
            principal_inertia: Vec3::ZERO,
            principal_frame: Quat::IDENTITY,
        }
    };
    let rotation = builder.rotation.normalize();
    let still = matches!(builder.body_type, RigidBodyType::Fixed | RigidBodyType::KinematicPositionBased);
    let state = BodyState {
        position: (builder.translation + rotation * mass.center_of_mass).to_array(),
        flags: body_kind(builder.body_type) | if dynamic && !builder.can_sleep { body_flags::STAYS_AWAKE } else { 0 },
        rotation: (rotation * mass.principal_frame).normalize().to_array(),
        linear_velocity: if still { [0.0; 3] } else { builder.linvel.to_array() },
        generation: body.generation(),
        angular_velocity: if still { [0.0; 3] } else { builder.angvel.to_array() },
        credit: MOST_CREDIT,
        ..BodyState::zeroed()
    };
    let inverse = |x: f32| if x > 0.0 { 1.0 / x } else { 0.0 };
    let to_principal = mass.principal_frame.inverse();
    let colliders: Vec<_> = scene
        .colliders_of(body)?
        .into_iter()
        .map(|(handle, c)| {
            let (size, shape) = c.shape.pack();
            let own = match c.shape {
                Shape::HalfSpace { normal } => Quat::from_rotation_arc(Vec3::Y, normal.normalize()),
                _ => Quat::IDENTITY,
            };
            let collider = Collider {
                size,
                shape,
                position: (to_principal * (c.translation - mass.center_of_mass)).to_array(),
                body: body.slot,
                rotation: (to_principal * c.rotation.normalize() * own).normalize().to_array(),
                friction: c.friction,
                restitution: c.restitution,
                combine: c.combine(),
                born: 0,
                surface_velocity: (to_principal * c.surface_velocity).to_array(),
                rolling_resistance: c.rolling_resistance,
                twisting_resistance: c.twisting_resistance,
                ..Collider::zeroed()
            };
            (handle.slot(), collider)
        })
        .collect();
    let reach = colliders.iter().map(|(_, collider)| reach(collider)).fold(0.0, f32::max);
    let props = BodyProps {
        inverse_inertia: mass.principal_inertia.to_array().map(inverse),
        inverse_mass: inverse(mass.mass),
        inertia: mass.principal_inertia.to_array(),
        gravity_scale: builder.gravity_scale,
        center_of_mass: mass.center_of_mass.to_array(),
        linear_damping: builder.linear_damping,
        frame: mass.principal_frame.to_array(),
        angular_damping: builder.angular_damping,
        reach,
        locked: builder.locked(),
        least_level: builder.least_level(),
    };
    Ok(PackedBody { state, props, colliders })
}

/// A joint as a backend stores it.
pub(crate) fn pack_joint(scene: &Scene, handle: JointHandle) -> Result<Joint> {
    let entry = scene.joint_entry(handle)?;
    let builder = &entry.builder;
    // In the principal frames, as everything that the solver sees.
    let placed = |body: BodyHandle, anchor: Vec3, rotation: Quat| -> Result<([f32; 3], [f32; 4])> {
        let dynamic = scene.body(body)?.body_type == RigidBodyType::Dynamic;
        let (center, frame) = match dynamic {
            true => scene.mass_properties(body).map(|mass| (mass.center_of_mass, mass.principal_frame))?,
            false => (Vec3::ZERO, Quat::IDENTITY),
        };
        let to_principal = frame.inverse();
        let rotation = (to_principal * rotation.normalize()).normalize();
        Ok(((to_principal * (anchor - center)).to_array(), rotation.to_array()))
    };
    let [body1, body2] = entry.bodies;
    let (anchor_a, rotation_a) = placed(body1, builder.local_anchor1, builder.local_rotation1)?;
    let (anchor_b, rotation_b) = placed(body2, builder.local_anchor2, builder.local_rotation2)?;
    let (mut axes, mut flags) = (0, joint_bits::ALIVE);
    let is_held = |body: BodyHandle| {
        scene.body(body).is_ok_and(|body| body.body_type == RigidBodyType::Dynamic && body.locked() != 0)
    };
    if is_held(body1) || is_held(body2) {
        flags |= joint_bits::HELD;
    }
    let mut drives = [JointDrive::zeroed(); 6];
    for axis in JointAxis::ALL.map(|axis| axis as usize) {
        let drive = &mut drives[axis];
        let mut set = |first: u32| axes |= 1 << (first + axis as u32);
        if builder.locked[axis] {
            set(joint_bits::LOCKED);
            continue;
        }
        drive.friction = builder.friction[axis];
        if let Some([low, high]) = builder.limits[axis] {
            // A distance is never below 0: a limit there would hold anchors that pass through each other.
            let is_no_limit = builder.coupled && low <= 0.0 && low < high;
            (drive.low, drive.high) = (if is_no_limit { NO_LIMIT } else { low }, high);
            set(joint_bits::LIMITED);
        }
        if let Some(motor) = builder.motors[axis] {
            drive.target_pos = motor.target_pos;
            drive.target_vel = motor.target_vel;
            drive.stiffness = motor.stiffness;
            drive.damping = motor.damping;
            drive.max_force = motor.max_force.min(MOST_FORCE);
            set(joint_bits::MOTOR);
            if motor.model == MotorModel::ForceBased {
                flags |= 1 << (joint_bits::FORCE_BASED + axis as u32);
            }
        }
        if builder.limits[axis].is_some() || builder.motors[axis].is_some() || drive.friction > 0.0 {
            set(joint_bits::DRIVEN);
        }
    }
    let soft = builder.softness;
    flags |= if builder.coupled { joint_bits::COUPLED } else { 0 };
    flags |= if soft.is_some() { joint_bits::SOFT } else { 0 };
    flags |= if builder.contacts_enabled { 0 } else { joint_bits::APART };
    Ok(Joint {
        rotation_a,
        rotation_b,
        anchor_a,
        body_a: body1.slot,
        anchor_b,
        body_b: body2.slot,
        axes,
        flags,
        generation: handle.generation,
        frequency: soft.map_or(0.0, |soft| std::f32::consts::TAU * soft.frequency),
        damping_ratio: soft.map_or(0.0, |soft| soft.damping_ratio),
        break_force: builder.break_force.min(MOST_FORCE),
        break_torque: builder.break_torque.min(MOST_FORCE),
        pad_a: 0,
        drives,
    })
}

/// In place of no lowest coordinate, m: no speed reaches it, and what is computed from it stays finite.
const NO_LIMIT: f32 = -1e12;

/// In place of an infinite force, N: shaders may assume that floats are finite.
const MOST_FORCE: f32 = 1e30;

/// How far the collider's surface is from the body's centre of mass at most, m.
fn reach(collider: &Collider) -> f32 {
    let size = Vec3::from_array(collider.size);
    let own = match collider.shape {
        shape_kind::BALL => size.x,
        shape_kind::CUBOID => size.length(),
        _ => 0.0, // without end: on bodies that never turn
    };
    Vec3::from_array(collider.position).length() + own
}

fn body_kind(body_type: RigidBodyType) -> u32 {
    match body_type {
        RigidBodyType::Fixed => body_flags::FIXED,
        RigidBodyType::KinematicVelocityBased => body_flags::KINEMATIC,
        RigidBodyType::KinematicPositionBased => body_flags::KINEMATIC | body_flags::POSED,
        RigidBodyType::Dynamic => body_flags::DYNAMIC,
    }
}
