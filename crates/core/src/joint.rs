//! Descriptions of joints, with rapier's names.

use crate::builder::{check_position, check_rotation};
use crate::error::{Result, check};
use glam::{Quat, Vec3};

/// An axis of a joint: of its frame on the first body. Along, or about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum JointAxis {
    /// Along x, m. Of a coupled joint: the distance of the anchors.
    LinX = 0,
    /// Along y, m.
    LinY = 1,
    /// Along z, m.
    LinZ = 2,
    /// About x, rad.
    AngX = 3,
    /// About y, rad.
    AngY = 4,
    /// About z, rad.
    AngZ = 5,
}

impl JointAxis {
    /// All six.
    pub const ALL: [Self; 6] = [Self::LinX, Self::LinY, Self::LinZ, Self::AngX, Self::AngY, Self::AngZ];
}

/// What a motor's stiffness and damping mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum MotorModel {
    /// Stiffness in 1/s² and damping in 1/s: they are multiplied by the mass that the motor moves.
    #[default]
    AccelerationBased,
    /// Stiffness in N/m or N m/rad, damping in N s/m or N m s/rad.
    ForceBased,
}

/// A motor on one axis: a damped spring towards a target, no stronger than `max_force`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMotor {
    /// m or rad.
    pub target_pos: f32,
    /// m/s or rad/s.
    pub target_vel: f32,
    /// See [`MotorModel`].
    pub stiffness: f32,
    /// See [`MotorModel`].
    pub damping: f32,
    /// N or N m; infinite at first.
    pub max_force: f32,
    /// What stiffness and damping mean.
    pub model: MotorModel,
}

/// A joint gives way like a damped spring of this frequency, by the masses that it joins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSoftness {
    /// Hz.
    pub frequency: f32,
    /// Of critical damping.
    pub damping_ratio: f32,
}

/// Describes a joint between two bodies. Units: m, rad, N, N m, s.
///
/// Each body has a frame, in which the joint lies: an anchor and a rotation. Where the second frame lies in the first
/// one are the joint's six coordinates; each axis is locked, free, or limited, and may have a motor and friction.
///
/// About the axes, the coordinates are: with one axis that is not locked, the angle about it, in (-π, π]; with two, the
/// angle about the first one, fixed to the first body, and that about the second one, fixed to the second body (a
/// universal joint); with three, the rotation vector.
#[derive(Debug, Clone, PartialEq)]
pub struct JointBuilder {
    /// In the first body's own frame, m.
    pub local_anchor1: Vec3,
    /// In the second body's own frame, m.
    pub local_anchor2: Vec3,
    /// Joint frame to the first body's own frame.
    pub local_rotation1: Quat,
    /// Joint frame to the second body's own frame.
    pub local_rotation2: Quat,
    /// By [`JointAxis`].
    pub locked: [bool; 6],
    /// By [`JointAxis`]; m or rad.
    pub limits: [Option<[f32; 2]>; 6],
    /// By [`JointAxis`].
    pub motors: [Option<JointMotor>; 6],
    /// By [`JointAxis`]: the largest force of dry friction, N or N m.
    pub friction: [f32; 6],
    /// Whether `LinX` is the distance of the anchors, and the other axes along are free.
    pub coupled: bool,
    /// Whether the joined bodies collide.
    pub contacts_enabled: bool,
    /// How locked axes give way; rigid at first.
    pub softness: Option<JointSoftness>,
    /// Force at which the joint breaks, N; infinite at first.
    pub break_force: f32,
    /// Torque at which the joint breaks, N m; infinite at first.
    pub break_torque: f32,
}

use JointAxis::{AngX, AngY, AngZ, LinX, LinY, LinZ};

impl JointBuilder {
    /// A joint that locks these axes; the others are free.
    pub fn generic(locked: &[JointAxis]) -> Self {
        let mut joint = Self {
            local_anchor1: Vec3::ZERO,
            local_anchor2: Vec3::ZERO,
            local_rotation1: Quat::IDENTITY,
            local_rotation2: Quat::IDENTITY,
            locked: [false; 6],
            limits: [None; 6],
            motors: [None; 6],
            friction: [0.0; 6],
            coupled: false,
            contacts_enabled: true,
            softness: None,
            break_force: f32::INFINITY,
            break_torque: f32::INFINITY,
        };
        locked.iter().for_each(|&axis| joint.locked[axis as usize] = true);
        joint
    }

    /// Nothing moves.
    pub fn fixed() -> Self {
        Self::generic(&JointAxis::ALL)
    }

    /// A ball in its socket: turns freely.
    pub fn spherical() -> Self {
        Self::generic(&[LinX, LinY, LinZ])
    }

    /// A hinge: turns about `axis` of both bodies, which becomes `AngX`.
    pub fn revolute(axis: Vec3) -> Self {
        Self::generic(&[LinX, LinY, LinZ, AngY, AngZ]).local_axis1(axis).local_axis2(axis)
    }

    /// A slider: moves along `axis` of both bodies, which becomes `LinX`.
    pub fn prismatic(axis: Vec3) -> Self {
        Self::generic(&[LinY, LinZ, AngX, AngY, AngZ]).local_axis1(axis).local_axis2(axis)
    }

    /// A universal joint (cardan): turns about `axis1` of the first body (`AngX`) and about `axis2` of the second one
    /// (`AngY`), which must be at right angles when it is made.
    pub fn universal(axis1: Vec3, axis2: Vec3) -> Self {
        let frame = |x: Vec3, y: Vec3| {
            let x = x.normalize_or_zero();
            let y = (y - x * x.dot(y)).normalize_or_zero();
            if x == Vec3::ZERO || y == Vec3::ZERO {
                // No axis, or parallel ones: `validate` refuses it.
                return NO_ROTATION;
            }
            Quat::from_mat3(&glam::Mat3::from_cols(x, y, x.cross(y)))
        };
        let mut joint = Self::generic(&[LinX, LinY, LinZ, AngZ]);
        (joint.local_rotation1, joint.local_rotation2) = (frame(axis1, axis2), frame(axis1, axis2));
        joint
    }

    /// A rope: the anchors are no farther apart than `max_distance`, m.
    pub fn rope(max_distance: f32) -> Self {
        let joint = Self { coupled: true, ..Self::generic(&[]) };
        joint.limits(LinX, [0.0, max_distance])
    }

    /// A spring between the anchors: `rest_length` in m, `stiffness` in N/m, `damping` in N s/m.
    pub fn spring(rest_length: f32, stiffness: f32, damping: f32) -> Self {
        let joint = Self { coupled: true, ..Self::generic(&[]) };
        joint.set_motor(LinX, rest_length, 0.0, stiffness, damping).motor_model(LinX, MotorModel::ForceBased)
    }

    /// A rod: the anchors stay this far apart, m.
    pub fn distance(distance: f32) -> Self {
        let joint = Self { coupled: true, ..Self::generic(&[]) };
        joint.limits(LinX, [distance, distance])
    }

    /// In the first body's own frame, m.
    pub fn local_anchor1(mut self, anchor: Vec3) -> Self {
        self.local_anchor1 = anchor;
        self
    }

    /// In the second body's own frame, m.
    pub fn local_anchor2(mut self, anchor: Vec3) -> Self {
        self.local_anchor2 = anchor;
        self
    }

    /// The joint's x axis in the first body's own frame; the other two at right angles, somehow.
    pub fn local_axis1(mut self, axis: Vec3) -> Self {
        self.local_rotation1 = rotation_to(axis);
        self
    }

    /// The joint's x axis in the second body's own frame.
    pub fn local_axis2(mut self, axis: Vec3) -> Self {
        self.local_rotation2 = rotation_to(axis);
        self
    }

    /// Joint frame to the first body's own frame.
    pub fn local_rotation1(mut self, rotation: Quat) -> Self {
        self.local_rotation1 = rotation;
        self
    }

    /// Joint frame to the second body's own frame.
    pub fn local_rotation2(mut self, rotation: Quat) -> Self {
        self.local_rotation2 = rotation;
        self
    }

    /// Locks further axes.
    pub fn locked_axes(mut self, axes: &[JointAxis]) -> Self {
        axes.iter().for_each(|&axis| self.locked[axis as usize] = true);
        self
    }

    /// Keeps the coordinate between two values, m or rad. Angles lie within -π and π. Equal limits lock the axis there.
    pub fn limits(mut self, axis: JointAxis, limits: [f32; 2]) -> Self {
        self.limits[axis as usize] = Some(limits);
        self
    }

    /// A motor that takes the axis to a velocity, m/s or rad/s; `factor` is its damping.
    pub fn motor_velocity(self, axis: JointAxis, target_vel: f32, factor: f32) -> Self {
        let target_pos = self.motors[axis as usize].map_or(0.0, |motor| motor.target_pos);
        self.set_motor(axis, target_pos, target_vel, 0.0, factor)
    }

    /// A motor that takes the axis to a coordinate, m or rad.
    pub fn motor_position(self, axis: JointAxis, target_pos: f32, stiffness: f32, damping: f32) -> Self {
        self.set_motor(axis, target_pos, 0.0, stiffness, damping)
    }

    /// A motor that does both.
    pub fn set_motor(
        mut self,
        axis: JointAxis,
        target_pos: f32,
        target_vel: f32,
        stiffness: f32,
        damping: f32,
    ) -> Self {
        let was = self.motors[axis as usize];
        let (max_force, model) = was.map_or((f32::INFINITY, MotorModel::default()), |m| (m.max_force, m.model));
        self.motors[axis as usize] = Some(JointMotor { target_pos, target_vel, stiffness, damping, max_force, model });
        self
    }

    /// The motor's largest force, N or N m; of one that was set before.
    pub fn motor_max_force(mut self, axis: JointAxis, max_force: f32) -> Self {
        if let Some(motor) = &mut self.motors[axis as usize] {
            motor.max_force = max_force;
        }
        self
    }

    /// What stiffness and damping of the motor mean; of one that was set before.
    pub fn motor_model(mut self, axis: JointAxis, model: MotorModel) -> Self {
        if let Some(motor) = &mut self.motors[axis as usize] {
            motor.model = model;
        }
        self
    }

    /// Dry friction on an axis: the largest force, N or N m.
    pub fn friction(mut self, axis: JointAxis, max_force: f32) -> Self {
        self.friction[axis as usize] = max_force;
        self
    }

    /// Whether the joined bodies collide; true at first, as in rapier.
    pub fn contacts_enabled(mut self, enabled: bool) -> Self {
        self.contacts_enabled = enabled;
        self
    }

    /// Locked axes give way like a damped spring of `frequency` Hz and this share of critical damping.
    pub fn softness(mut self, frequency: f32, damping_ratio: f32) -> Self {
        self.softness = Some(JointSoftness { frequency, damping_ratio });
        self
    }

    /// The joint breaks, for good, in a step in which its force (N) or torque (N m) is larger.
    pub fn breakable(mut self, force: f32, torque: f32) -> Self {
        (self.break_force, self.break_torque) = (force, torque);
        self
    }

    pub(crate) fn validate(&self, what: &impl Fn() -> String) -> Result<()> {
        check_position(self.local_anchor1, what, "local_anchor1")?;
        check_position(self.local_anchor2, what, "local_anchor2")?;
        const AXES: &str =
            "a rotation; a joint's axes must be finite, not zero, and those of a universal joint not parallel";
        for (field, rotation) in [("local_axis1", self.local_rotation1), ("local_axis2", self.local_rotation2)] {
            let fits = rotation.is_finite() && (0.5..=2.0).contains(&rotation.length());
            check(fits, what, field, rotation.to_array(), AXES)?;
            check_rotation(rotation, what, field)?;
        }
        for (axis, limits) in JointAxis::ALL.iter().zip(self.limits) {
            let Some([low, high]) = limits else { continue };
            let most = if (*axis as usize) < 3 { 1e7 } else { std::f32::consts::PI };
            let fits = low >= -most && high <= most && low <= high;
            const LIMITS: &str = "[low, high] with low <= high: m within 1e7, rad within -π and π";
            check(fits, what, "limits", (axis, [low, high]), LIMITS)?;
        }
        for (axis, motor) in JointAxis::ALL.iter().zip(self.motors) {
            let Some(JointMotor { target_pos, target_vel, stiffness, damping, max_force, .. }) = motor else {
                continue;
            };
            const MOTOR: &str = "finite targets up to 1e6; stiffness and damping from 0 to 1e12; max_force from 0 on";
            let targets = target_pos.abs() <= 1e6 && target_vel.abs() <= 1e6;
            let strengths = (0.0..=1e12).contains(&stiffness) && (0.0..=1e12).contains(&damping) && max_force >= 0.0;
            check(targets && strengths, what, "motor", (axis, motor), MOTOR)?;
        }
        for (axis, friction) in JointAxis::ALL.iter().zip(self.friction) {
            let fits = (0.0..=1e12).contains(&friction);
            check(fits, what, "friction", (axis, friction), "a finite force from 0 to 1e12 N or N m")?;
        }
        if let Some(JointSoftness { frequency, damping_ratio }) = self.softness {
            check((1e-3..=1e6).contains(&frequency), what, "softness.frequency", frequency, "0.001 to 1e6 Hz")?;
            check((0.0..=1e6).contains(&damping_ratio), what, "softness.damping_ratio", damping_ratio, "0 to 1e6")?;
        }
        const BREAK: &str = "a number above 0, or infinity for a joint that does not break";
        check(self.break_force > 0.0, what, "break_force", self.break_force, BREAK)?;
        check(self.break_torque > 0.0, what, "break_torque", self.break_torque, BREAK)?;
        if self.coupled {
            let along = [LinX, LinY, LinZ].map(|axis| self.locked[axis as usize]);
            let others = [LinY, LinZ].iter().any(|&axis| self.has(axis));
            const COUPLED: &str = "limits, motor and friction of LinX alone: the anchors' distance is one coordinate";
            check(along == [false; 3] && !others, what, "coupled axes", along, COUPLED)?;
        }
        let any = JointAxis::ALL.iter().any(|&axis| self.locked[axis as usize] || self.has(axis));
        check(any, what, "axes", "all free", "at least one axis that is locked, limited, driven or rubs")
    }

    /// Whether the axis has limits, a motor or friction.
    fn has(&self, axis: JointAxis) -> bool {
        let axis = axis as usize;
        self.limits[axis].is_some() || self.motors[axis].is_some() || self.friction[axis] > 0.0
    }
}

const NO_ROTATION: Quat = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);

/// The rotation that takes x to `axis`; no rotation for what is none, which `validate` refuses.
fn rotation_to(axis: Vec3) -> Quat {
    let unit = axis.normalize_or_zero();
    if unit == Vec3::ZERO { NO_ROTATION } else { Quat::from_rotation_arc(Vec3::X, unit) }
}
