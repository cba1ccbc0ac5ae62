//! Joints with a formula, linkages, and a car. Joined bodies do not collide.

use super::joints::{anchor, join};
use super::{add_floor, ball, cuboid, dynamic};
use crate::builder::RigidBodyBuilder;
use crate::error::Result;
use crate::handle::{BodyHandle, JointHandle};
use crate::joint::{JointAxis, JointBuilder, MotorModel};
use crate::scene::Scene;
use glam::{Quat, Vec3};

/// Mass of [`on_joint`]'s cube, kg.
pub const CUBE_MASS: f32 = 2.0;
/// Its moment of inertia about any axis through its middle, kg m²: m (0.2 m)² / 6.
pub const CUBE_INERTIA: f32 = CUBE_MASS * 0.04 / 6.0;

/// A cube of 0.2 m and [`CUBE_MASS`] at `pose`, on a joint whose first body stands still at the origin.
///
/// # Errors
/// When the joint is refused.
pub fn on_joint(joint: JointBuilder, body: RigidBodyBuilder) -> Result<(Scene, BodyHandle, JointHandle)> {
    let mut scene = Scene::new();
    let fixed = anchor(&mut scene, Vec3::ZERO);
    let body = scene.insert(body, cuboid(Vec3::splat(0.1)).mass(CUBE_MASS)).body;
    let joint = scene.insert_joint(fixed, body, joint)?;
    Ok((scene, body, joint))
}

/// A rod of `length` x 0.02 x 0.02 m, on a hinge about z at one end, let go `angle` (rad) from hanging straight down: for
/// small angles its period is 2 pi sqrt(2 length / 3 g), but for the rod's thickness. Hands back the rod and the hinge.
pub fn pendulum(length: f32, angle: f32) -> (Scene, BodyHandle, JointHandle) {
    let mut scene = Scene::new();
    let fixed = anchor(&mut scene, Vec3::ZERO);
    let turn = Quat::from_rotation_z(angle);
    let rod = cuboid(Vec3::new(0.01, 0.5 * length, 0.01));
    let body = scene.insert(dynamic(turn * Vec3::Y * (-0.5 * length)).rotation(turn), rod).body;
    let joint = join(&mut scene, fixed, body, JointBuilder::revolute(Vec3::Z), Vec3::ZERO);
    (scene, body, joint)
}

/// A cube of 0.2 m and [`CUBE_MASS`] on a slider that falls by `angle` (rad) towards +x, with dry friction `friction` (N): it
/// slides with g sin(angle) - friction / mass. The coordinate grows downwards.
pub fn slider_on_slope(angle: f32, friction: f32) -> (Scene, BodyHandle, JointHandle) {
    let mut scene = Scene::new();
    let fixed = anchor(&mut scene, Vec3::ZERO);
    let body = scene.insert(RigidBodyBuilder::dynamic(), cuboid(Vec3::splat(0.1)).mass(CUBE_MASS)).body;
    let (sin, cos) = angle.sin_cos();
    let slider = JointBuilder::prismatic(Vec3::new(cos, -sin, 0.0)).friction(JointAxis::LinX, friction);
    let joint = join(&mut scene, fixed, body, slider, Vec3::ZERO);
    (scene, body, joint)
}

/// A top: a plate of 0.4 x 0.1 x 0.4 m, its middle `arm` (m) from a ball joint at the origin, leaning by `lean` (rad) from
/// upright about z, that spins about its axis with `spin` and goes round with `round` (rad/s, about y). Hands back the
/// plate.
pub fn heavy_top(arm: f32, lean: f32, spin: f32, round: f32) -> (Scene, BodyHandle) {
    let mut scene = Scene::new();
    let fixed = anchor(&mut scene, Vec3::ZERO);
    let turn = Quat::from_rotation_z(lean);
    let axis = turn * Vec3::Y;
    let about = axis * spin + (Vec3::Y - axis * axis.y) * round;
    let body = dynamic(axis * arm).rotation(turn).angvel(about).linvel(about.cross(axis * arm));
    let body = scene.insert(body, cuboid(Vec3::new(0.2, 0.05, 0.2))).body;
    join(&mut scene, fixed, body, JointBuilder::spherical(), Vec3::ZERO);
    (scene, body)
}

/// Two shafts whose axes meet at an angle of `bend` (rad), each on a hinge, and a universal joint between them where they
/// meet. A motor turns the first one with `speed` (rad/s), which it has from the start.
#[derive(Debug, Clone)]
pub struct Cardan {
    /// Its bodies and joints.
    pub scene: Scene,
    /// First shaft, along x.
    pub first: BodyHandle,
    /// Second shaft, along x turned by `bend` about y.
    pub second: BodyHandle,
    /// The hinge of the first shaft: its angle a.
    pub first_hinge: JointHandle,
    /// The hinge of the second one: its angle b, tan b = tan a cos(bend).
    pub second_hinge: JointHandle,
}

/// See [`Cardan`].
pub fn cardan(bend: f32, speed: f32) -> Cardan {
    let mut scene = Scene::new();
    scene.gravity = Vec3::ZERO;
    let fixed = anchor(&mut scene, Vec3::ZERO);
    let shaft = || cuboid(Vec3::new(0.2, 0.03, 0.03));
    let turn = Quat::from_rotation_y(bend);
    let out = turn * Vec3::X;
    let begin = dynamic(Vec3::X * -0.3).angvel(Vec3::X * speed);
    let first = scene.insert(begin, shaft()).body;
    // At angle zero the second shaft turns by cos(bend) of the first.
    let follow = dynamic(out * 0.3).rotation(turn).angvel(out * (speed * bend.cos()));
    let second = scene.insert(follow, shaft()).body;
    let hinge = JointBuilder::revolute(Vec3::X);
    let driven = hinge.clone().motor_velocity(JointAxis::AngX, speed, 1e4);
    let first_hinge = join(&mut scene, fixed, first, driven, Vec3::X * -0.3);
    let bent = hinge.local_axis1(out);
    let second_hinge = join(&mut scene, fixed, second, with_frame(bent, turn), out * 0.3);
    join(&mut scene, first, second, JointBuilder::universal(Vec3::Y, Vec3::Z), Vec3::ZERO);
    Cardan { scene, first, second, first_hinge, second_hinge }
}

/// A joint whose first frame is `turn`, so that its angles are zero at the start.
fn with_frame(joint: JointBuilder, turn: Quat) -> JointBuilder {
    joint.local_rotation1(turn).local_rotation2(Quat::IDENTITY)
}

/// Lengths of a [`FourBar`], m: ground, crank, coupler, rocker. The crank goes round (Grashof).
pub const FOUR_BAR: [f32; 4] = [1.0, 0.3, 0.9, 0.7];

/// A linkage of four bars on four hinges about z: a crank at the origin that a motor turns, a coupler, and a rocker at
/// (1, 0, 0). Crank angle a and rocker angle b, both from +x, obey Freudenstein's equation
/// K1 cos b - K2 cos a + K3 = cos(a - b) with K1 = g / a', K2 = g / c, K3 = (a'^2 - b'^2 + c^2 + g^2) / (2 a' c), the
/// lengths g, a', b', c being [`FOUR_BAR`].
#[derive(Debug, Clone, Copy)]
pub struct FourBar {
    /// Its own x axis points along it, away from the ground.
    pub crank: BodyHandle,
    /// From crank to rocker.
    pub coupler: BodyHandle,
    /// Its own x axis points along it, away from the ground.
    pub rocker: BodyHandle,
    /// The hinge with the motor.
    pub motor: JointHandle,
}

/// One [`FourBar`], the motor at `speed` (rad/s), with which the linkage begins.
pub fn four_bar(speed: f32) -> (Scene, FourBar) {
    let mut scene = Scene::new();
    let linkage = add_four_bar(&mut scene, Vec3::ZERO, speed);
    (scene, linkage)
}

/// So many [`FourBar`]s side by side, at 3 to 6 rad/s.
pub fn four_bars(count: usize) -> Scene {
    let mut scene = Scene::new();
    for i in 0..count {
        add_four_bar(&mut scene, Vec3::new(0.0, 1.0, 0.3 * i as f32), 3.0 + (i % 4) as f32);
    }
    scene
}

fn add_four_bar(scene: &mut Scene, at: Vec3, speed: f32) -> FourBar {
    let [ground, a, b, c] = FOUR_BAR;
    // The crank begins upright; where the coupler meets the rocker: two circles.
    let (tip, foot) = (Vec3::Y * a, Vec3::X * ground);
    let way = foot - tip;
    let distance = way.length();
    let along = (b * b - c * c + distance * distance) / (2.0 * distance);
    let up = (b * b - along * along).sqrt();
    let unit = way / distance;
    let knee = tip + unit * along + Vec3::new(-unit.y, unit.x, 0.0) * up;
    // The knee goes round with the rocker and with the coupler: two equations for their speeds.
    let (tip_velocity, coupler_way, rocker_way) = (Vec3::Z.cross(tip) * speed, knee - tip, knee - foot);
    let sine = Vec3::Z.cross(rocker_way).dot(coupler_way);
    let rocker_speed = tip_velocity.dot(coupler_way) / sine;
    let coupler_speed = tip_velocity.dot(rocker_way) / sine;
    let mut bar = |from: Vec3, way: Vec3, velocity: Vec3, spin: f32| {
        let half = Vec3::new(0.5 * way.length() - 0.03, 0.02, 0.02);
        let turn = Quat::from_rotation_arc(Vec3::X, way.normalize());
        let about = Vec3::Z * spin;
        let middle = dynamic(at + from + 0.5 * way).linvel(velocity + about.cross(0.5 * way));
        scene.insert(middle.angvel(about).rotation(turn), cuboid(half)).body
    };
    let crank = bar(Vec3::ZERO, tip, Vec3::ZERO, speed);
    let coupler = bar(tip, coupler_way, tip_velocity, coupler_speed);
    let rocker = bar(foot, rocker_way, Vec3::ZERO, rocker_speed);
    let fixed = anchor(scene, at);
    let hinge = JointBuilder::revolute(Vec3::Z);
    let driven = hinge.clone().motor_velocity(JointAxis::AngX, speed, 1e6);
    let motor = join(scene, fixed, crank, driven, at);
    join(scene, crank, coupler, hinge.clone(), at + tip);
    join(scene, coupler, rocker, hinge.clone(), at + knee);
    join(scene, fixed, rocker, hinge, at + foot);
    FourBar { crank, coupler, rocker, motor }
}

/// Bodies of a car.
pub const CAR_BODIES: usize = 9;

/// A car of 1,000 kg on a floor with bumps: chassis, four hubs on sliders with springs (natural frequency of the car on
/// them 2 Hz, a third of critical damping, 0.12 m either way), four wheels on hinges whose motors drive to 15 rad/s with
/// at most 150 N m each. It drives along +x. Hands back the chassis.
pub fn car() -> (Scene, BodyHandle) {
    let mut scene = bumpy_floor();
    let chassis = add_car(&mut scene, 0.0);
    (scene, chassis)
}

/// So many [`car`]s side by side.
pub fn cars(count: usize) -> Scene {
    let mut scene = bumpy_floor();
    for i in 0..count {
        add_car(&mut scene, 3.0 * i as f32);
    }
    scene
}

/// Ten sills across the way, 8 cm high, from x = 6 on.
fn bumpy_floor() -> Scene {
    let mut scene = Scene::new();
    add_floor(&mut scene, 1.0, 0.0);
    for i in 0..10 {
        let edge = RigidBodyBuilder::fixed()
            .translation(Vec3::new(6.0 + 2.3 * i as f32, -0.062, 0.0))
            .rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_4));
        scene.insert(edge, cuboid(Vec3::new(0.1, 0.1, 500.0)));
    }
    scene
}

fn add_car(scene: &mut Scene, z: f32) -> BodyHandle {
    const RADIUS: f32 = 0.35;
    const OMEGA: f32 = 2.0 * std::f32::consts::TAU;
    let chassis_mass = 800.0;
    let chassis =
        scene.insert(dynamic(Vec3::new(0.0, 0.75, z)), cuboid(Vec3::new(1.5, 0.2, 0.5)).mass(chassis_mass)).body;
    let stiffness = 0.25 * chassis_mass * OMEGA * OMEGA;
    let damping = 2.0 / 3.0 * 0.25 * chassis_mass * OMEGA;
    // The springs bear the car where it begins.
    let sag = -9.81 / (OMEGA * OMEGA);
    for (x, side) in [(1.1f32, -1.0f32), (1.1, 1.0), (-1.1, -1.0), (-1.1, 1.0)] {
        let at = Vec3::new(x, RADIUS, z + 0.9 * side);
        let inner = Vec3::new(x, RADIUS, z + 0.4 * side);
        let hub = scene.insert(dynamic(inner), cuboid(Vec3::splat(0.08)).mass(20.0)).body;
        let wheel = scene.insert(dynamic(at), ball(RADIUS).mass(30.0).friction(1.0)).body;
        let slider = JointBuilder::prismatic(Vec3::Y)
            .limits(JointAxis::LinX, [-0.12, 0.12])
            .motor_position(JointAxis::LinX, sag, stiffness, damping)
            .motor_model(JointAxis::LinX, MotorModel::ForceBased);
        join(scene, chassis, hub, slider, inner);
        // About -z, so that it rolls along +x.
        let axle = JointBuilder::revolute(Vec3::NEG_Z)
            .motor_velocity(JointAxis::AngX, 15.0, 100.0)
            .motor_model(JointAxis::AngX, MotorModel::ForceBased)
            .motor_max_force(JointAxis::AngX, 150.0);
        join(scene, hub, wheel, axle, at);
    }
    chassis
}
