//! Descriptions of bodies and colliders, with rapier's names.

use crate::error::{Result, check};
use crate::layout::LEVELS;
use crate::shape::Shape;
use glam::{Quat, Vec3};

/// What may move a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RigidBodyType {
    /// Nothing.
    Fixed,
    /// The velocity that the user sets, and nothing else.
    KinematicVelocityBased,
    /// The poses that the user gives it, one a step.
    KinematicPositionBased,
    /// Forces, impulses and contacts.
    Dynamic,
}

/// Describes a body. Units: m, s, kg, rad.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidBodyBuilder {
    /// What may move it.
    pub body_type: RigidBodyType,
    /// Origin of the body's frame in the world, m.
    pub translation: Vec3,
    /// Body frame to world.
    pub rotation: Quat,
    /// m/s.
    pub linvel: Vec3,
    /// rad/s, world axes.
    pub angvel: Vec3,
    /// Factor on gravity.
    pub gravity_scale: f32,
    /// 1/s.
    pub linear_damping: f32,
    /// 1/s.
    pub angular_damping: f32,
    /// Whether it may be put to sleep with its island, where the world has [`Params::sleep`](crate::Params::sleep).
    pub can_sleep: bool,
    /// Along which of the world's axes it may move.
    pub enabled_translations: [bool; 3],
    /// About which of the world's axes it may turn.
    pub enabled_rotations: [bool; 3],
    /// How many times the usual sub-steps its island gets at least.
    pub substep_factor: u32,
}

const FINITE: &str = "finite numbers";
/// Beyond this a float cannot hold a position to better than half a metre.
const WORLD: &str = "finite numbers within 1e7 m of the origin";
const SPEED: &str = "finite numbers up to 1e6";

pub(crate) fn check_position(p: Vec3, what: impl FnOnce() -> String, field: &'static str) -> Result<()> {
    check(p.is_finite() && p.abs().max_element() <= 1e7, what, field, p.to_array(), WORLD)
}

pub(crate) fn check_rotation(q: Quat, what: impl FnOnce() -> String, field: &'static str) -> Result<()> {
    let length = q.length();
    check(
        q.is_finite() && (0.5..=2.0).contains(&length),
        what,
        field,
        q.to_array(),
        "a finite quaternion of length near 1 (it is normalised)",
    )
}

pub(crate) fn check_speed(v: Vec3, what: impl FnOnce() -> String, field: &'static str) -> Result<()> {
    check(v.is_finite() && v.abs().max_element() <= 1e6, what, field, v.to_array(), SPEED)
}

pub(crate) fn check_finite(v: Vec3, what: impl FnOnce() -> String, field: &'static str) -> Result<()> {
    check(v.is_finite(), what, field, v.to_array(), FINITE)
}

impl RigidBodyBuilder {
    fn new(body_type: RigidBodyType) -> Self {
        Self {
            body_type,
            translation: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            linvel: Vec3::ZERO,
            angvel: Vec3::ZERO,
            gravity_scale: 1.0,
            linear_damping: 0.0,
            angular_damping: 0.0,
            can_sleep: true,
            enabled_translations: [true; 3],
            enabled_rotations: [true; 3],
            substep_factor: 1,
        }
    }
    /// A body that never moves.
    pub fn fixed() -> Self {
        Self::new(RigidBodyType::Fixed)
    }
    /// A body moved by forces and contacts.
    pub fn dynamic() -> Self {
        Self::new(RigidBodyType::Dynamic)
    }
    /// A body that keeps the velocity it is given and pushes what it meets.
    pub fn kinematic_velocity_based() -> Self {
        Self::new(RigidBodyType::KinematicVelocityBased)
    }
    /// A body that goes where [`Editor::set_next_kinematic_pose`](crate::Editor::set_next_kinematic_pose) tells it, within
    /// the step, and pushes what it meets with the velocity that this takes. It stands still in steps for which nothing was
    /// told.
    pub fn kinematic_position_based() -> Self {
        Self::new(RigidBodyType::KinematicPositionBased)
    }
    /// Origin of the body's frame in the world, m.
    pub fn translation(mut self, translation: Vec3) -> Self {
        self.translation = translation;
        self
    }
    /// Body frame to world.
    pub fn rotation(mut self, rotation: Quat) -> Self {
        self.rotation = rotation;
        self
    }
    /// Velocity of the centre of mass, m/s.
    pub fn linvel(mut self, linvel: Vec3) -> Self {
        self.linvel = linvel;
        self
    }
    /// Angular velocity, world axes, rad/s.
    pub fn angvel(mut self, angvel: Vec3) -> Self {
        self.angvel = angvel;
        self
    }
    /// Factor on the scene's gravity; 1 at first.
    pub fn gravity_scale(mut self, scale: f32) -> Self {
        self.gravity_scale = scale;
        self
    }
    /// Share of the linear velocity lost, 1/s; 0 at first.
    pub fn linear_damping(mut self, damping: f32) -> Self {
        self.linear_damping = damping;
        self
    }
    /// Share of the angular velocity lost, 1/s; 0 at first.
    pub fn angular_damping(mut self, damping: f32) -> Self {
        self.angular_damping = damping;
        self
    }
    /// Whether it may be put to sleep; true at first. One that may not keeps all awake that it touches.
    pub fn can_sleep(mut self, can_sleep: bool) -> Self {
        self.can_sleep = can_sleep;
        self
    }

    /// Along which of the world's axes a dynamic body may move; all at first. Along the others nothing moves it, and it has no
    /// velocity there, whatever it is given: to what pushes it so, be it a contact or a joint, it is as heavy as the world. A
    /// joint whose two bodies both do not move along some direction has no force there.
    pub fn enabled_translations(mut self, x: bool, y: bool, z: bool) -> Self {
        self.enabled_translations = [x, y, z];
        self
    }
    /// About which of the world's axes a dynamic body may turn; all at first. What holds the others is a torque without
    /// work: a box that stands askew and may turn about y alone does so with the inertia that it has about y. (rapier
    /// takes 1 / (I⁻¹)yy instead.) With an axis locked there is no gyroscopic torque: by itself, a body turns at a
    /// constant rate.
    pub fn enabled_rotations(mut self, x: bool, y: bool, z: bool) -> Self {
        self.enabled_rotations = [x, y, z];
        self
    }
    /// The centre of mass of a dynamic body stays where it is; it can turn. See
    /// [`enabled_translations`](Self::enabled_translations).
    pub fn lock_translations(self) -> Self {
        self.enabled_translations(false, false, false)
    }
    /// A dynamic body never turns. See [`enabled_rotations`](Self::enabled_rotations).
    pub fn lock_rotations(self) -> Self {
        self.enabled_rotations(false, false, false)
    }

    /// The island that a dynamic body is in (bodies that hang together by contacts and joints) gets this many times the
    /// sub-steps of [`Params::accuracy`](crate::Params::accuracy): 1, 2, 4 or 8; 1 at first. Of several in an island the
    /// highest counts. With [`Accuracy::Tolerance`](crate::Accuracy::Tolerance) it is a minimum: times an eighth of `most`.
    /// Who asks for nothing pays nothing, and gets the same bits as without.
    ///
    /// rapier's `additional_solver_iterations` adds to the iterations instead: that of 4 in a world of 4 is 2 here. (A
    /// factor keeps the lengths of sub-steps powers of two apart, so that islands can run by themselves.)
    pub fn substep_factor(mut self, factor: u32) -> Self {
        self.substep_factor = factor;
        self
    }

    /// The level of sub-steps that is meant by the factor.
    pub(crate) fn least_level(&self) -> u32 {
        if self.body_type == RigidBodyType::Dynamic { self.substep_factor.max(1).ilog2() } else { 0 }
    }

    /// [`layout::locks`](crate::layout::locks).
    pub(crate) fn locked(&self) -> u32 {
        let all = self.enabled_translations.into_iter().chain(self.enabled_rotations);
        all.enumerate().map(|(bit, enabled)| u32::from(!enabled) << bit).sum()
    }

    pub(crate) fn validate(&self, what: &impl Fn() -> String) -> Result<()> {
        check_position(self.translation, what, "translation")?;
        check_rotation(self.rotation, what, "rotation")?;
        check_speed(self.linvel, what, "linvel")?;
        check_speed(self.angvel, what, "angvel")?;
        let scale = self.gravity_scale;
        check(scale.is_finite() && scale.abs() <= 1e6, what, "gravity_scale", scale, "finite numbers up to 1e6")?;
        let factor = self.substep_factor;
        let is_level = factor.is_power_of_two() && factor.ilog2() < LEVELS;
        check(is_level, what, "substep_factor", factor, "1, 2, 4 or 8")?;
        const DAMPING: &str = "finite numbers from 0 to 1e6, 1/s";
        let damps = |d: f32| (0.0..=1e6).contains(&d);
        check(damps(self.linear_damping), what, "linear_damping", self.linear_damping, DAMPING)?;
        check(damps(self.angular_damping), what, "angular_damping", self.angular_damping, DAMPING)
    }
}

/// How the coefficients of two touching colliders become one. The stronger rule of the two colliders holds, in
/// the order `Max`, `Multiply`, `Min`, `Average`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[repr(u32)]
pub enum CombineRule {
    /// Half the sum.
    #[default]
    Average = 0,
    /// The smaller.
    Min = 1,
    /// The product.
    Multiply = 2,
    /// The larger.
    Max = 3,
}

/// Describes a collider. Units: m, kg.
#[derive(Debug, Clone, PartialEq)]
pub struct ColliderBuilder {
    /// Form.
    pub shape: Shape,
    /// Origin in the body's frame, m.
    pub translation: Vec3,
    /// Collider frame to body frame.
    pub rotation: Quat,
    /// kg/m³, where `mass` is not given.
    pub density: f32,
    /// kg.
    pub mass: Option<f32>,
    /// Coulomb coefficient.
    pub friction: f32,
    /// 0 to 1.
    pub restitution: f32,
    /// Largest rolling torque over normal force and radius.
    pub rolling_resistance: f32,
    /// Largest torque about the normal over normal force and radius.
    pub twisting_resistance: f32,
    /// Of the surface against the body, in the body's frame, m/s.
    pub surface_velocity: Vec3,
    /// How friction combines.
    pub friction_rule: CombineRule,
    /// How restitution combines.
    pub restitution_rule: CombineRule,
}

impl ColliderBuilder {
    /// Any shape.
    pub fn new(shape: Shape) -> Self {
        Self {
            shape,
            translation: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            density: 1.0,
            mass: None,
            friction: 0.5,
            restitution: 0.0,
            rolling_resistance: 0.0,
            twisting_resistance: 0.0,
            surface_velocity: Vec3::ZERO,
            friction_rule: CombineRule::Average,
            restitution_rule: CombineRule::Average,
        }
    }
    /// A ball of radius `radius`, m.
    pub fn ball(radius: f32) -> Self {
        Self::new(Shape::Ball { radius })
    }
    /// A box of half extents `hx`, `hy`, `hz`, m.
    pub fn cuboid(hx: f32, hy: f32, hz: f32) -> Self {
        Self::new(Shape::Cuboid { half_extents: Vec3::new(hx, hy, hz) })
    }
    /// Everything below the plane through the collider's origin with outward normal `normal`.
    pub fn halfspace(normal: Vec3) -> Self {
        Self::new(Shape::HalfSpace { normal })
    }
    /// Origin of the collider in the body's frame, m.
    pub fn translation(mut self, translation: Vec3) -> Self {
        self.translation = translation;
        self
    }
    /// Collider frame to body frame.
    pub fn rotation(mut self, rotation: Quat) -> Self {
        self.rotation = rotation;
        self
    }
    /// kg/m³; 1 at first.
    pub fn density(mut self, density: f32) -> Self {
        self.density = density;
        self.mass = None;
        self
    }
    /// kg, in place of a density.
    pub fn mass(mut self, mass: f32) -> Self {
        self.mass = Some(mass);
        self
    }
    /// Coulomb coefficient, the same in all directions; 0.5 at first. Friction that depends on the direction is left out
    /// on purpose: every point would carry an ellipse in the frame of one of the two surfaces, and whose it is, is no
    /// property of a collider. For belts and tracks there is [`surface_velocity`](Self::surface_velocity).
    pub fn friction(mut self, friction: f32) -> Self {
        self.friction = friction;
        self
    }
    /// 0 (stays) to 1 (bounces back as fast as it came); 0 at first.
    pub fn restitution(mut self, restitution: f32) -> Self {
        self.restitution = restitution;
        self
    }
    /// How hard it is to roll: the largest rolling torque is this times the radius times the normal force; 0 at first. A
    /// ball of mass m that rolls on a plane loses 5/7 `resistance` g of its speed each second, and rests on slopes up to
    /// atan(`resistance`).
    ///
    /// The radius is the ball's, of two balls the smaller one's; where no ball takes part, the smallest half extent of
    /// the boxes. Of the two colliders' coefficients the larger counts, since sand slows whatever rolls over it.
    ///
    /// `rollingResistance` of Box2D 3 and Box3D is dimensionless too, and the larger of the two counts as well; they take
    /// the larger radius, and a quarter of its inner radius for a hull. MuJoCo's rolling friction is a length: this times
    /// the radius.
    ///
    /// [`Solver::OnePass`](crate::Solver::OnePass) and [`Solver::Soft`](crate::Solver::Soft) have it; the other solvers do
    /// not resist.
    pub fn rolling_resistance(mut self, resistance: f32) -> Self {
        self.rolling_resistance = resistance;
        self
    }
    /// How hard it is to turn about the normal of a contact, beside what friction does at the points: the largest torque
    /// is this times the radius times the normal force; 0 at first. Radius and the larger coefficient as for
    /// [`rolling_resistance`](Self::rolling_resistance). A ball touches at one point, where friction has no arm: only
    /// this ends its spin. MuJoCo's torsional friction is a length: this times the radius.
    pub fn twisting_resistance(mut self, resistance: f32) -> Self {
        self.twisting_resistance = resistance;
        self
    }
    /// Velocity of the surface against its body, as of a conveyor belt, in the body's frame, m/s; zero at first. Its part
    /// along the contact is what friction pulls the other body to; nothing moves by it.
    pub fn surface_velocity(mut self, velocity: Vec3) -> Self {
        self.surface_velocity = velocity;
        self
    }
    /// How friction combines with that of the other collider.
    pub fn friction_combine_rule(mut self, rule: CombineRule) -> Self {
        self.friction_rule = rule;
        self
    }
    /// How restitution combines with that of the other collider.
    pub fn restitution_combine_rule(mut self, rule: CombineRule) -> Self {
        self.restitution_rule = rule;
        self
    }

    pub(crate) fn validate(&self, what: &impl Fn() -> String) -> Result<()> {
        self.shape.validate(what)?;
        check_position(self.translation, what, "translation")?;
        check_rotation(self.rotation, what, "rotation")?;
        const POSITIVE: &str = "a finite number above 0, up to 1e12";
        let positive = |x: f32| x > 0.0 && x <= 1e12;
        match self.mass {
            Some(mass) => check(positive(mass), what, "mass", mass, POSITIVE)?,
            None => check(positive(self.density), what, "density", self.density, POSITIVE)?,
        }
        check((0.0..=1e6).contains(&self.friction), what, "friction", self.friction, "a finite number from 0 to 1e6")?;
        check((0.0..=1.0).contains(&self.restitution), what, "restitution", self.restitution, "0 to 1")?;
        for (field, resistance) in
            [("rolling_resistance", self.rolling_resistance), ("twisting_resistance", self.twisting_resistance)]
        {
            const RESISTANCE: &str = "a finite number from 0 to 1e6 (seldom above 1: it is a share of the radius)";
            check((0.0..=1e6).contains(&resistance), what, field, resistance, RESISTANCE)?;
        }
        check_speed(self.surface_velocity, what, "surface_velocity")
    }

    /// `combine` of [`layout::Collider`](crate::layout::Collider).
    pub(crate) fn combine(&self) -> u32 {
        self.friction_rule as u32 | (self.restitution_rule as u32) << 2
    }
}
