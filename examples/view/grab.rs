//! Takes a body by a point and pulls that point to where the cursor is.

use tumble::core::MassProperties;
use tumble::core::glam::{DMat3, DVec3, Vec3};
use tumble::{BodyHandle, Pose, Ray, Result, RigidBodyType, Shape, Velocity, World};

/// Angular frequency of the spring, rad/s: within 1 % of the way after a third of a second.
const STIFFNESS: f64 = 20.0;
/// Rate at which a held body stops turning, 1/s.
const TURNING: f64 = 4.0;
/// Fastest that pulling turns a body, rad/s: a short arm would spin it like a top.
const FASTEST_TURN: f64 = 10.0;
/// Fastest that the point is pulled, m/s: faster bodies pass through thin ones.
const FASTEST: f64 = 30.0;
/// Fixed bodies that a pick looks through: a picture shows walls before the scene as glass.
const WALLS: usize = 8;

/// A body held by a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grab {
    pub(crate) body: BodyHandle,
    /// The point in the body's own frame, m.
    point: Vec3,
    /// Of the point when it was taken, along the view, m.
    depth: f32,
}

/// What pulls a body for one step, world axes.
#[derive(Debug, Clone, Copy)]
struct Pull {
    /// N, at the centre of mass.
    force: Vec3,
    /// N m.
    torque: Vec3,
}

impl Grab {
    /// Takes the dynamic body that the ray meets first. It is looked for behind fixed boxes too, not behind half-spaces.
    /// `forward` is the camera's view.
    pub(crate) fn pick(world: &mut World, origin: Vec3, direction: Vec3, forward: Vec3) -> Result<Option<Self>> {
        let mut ray = Ray::new(origin, direction);
        for _ in 0..WALLS {
            let Some(hit) = world.cast_rays(&[ray])?[0] else { return Ok(None) };
            let point = ray.point_at(hit.time_of_impact);
            match world.scene().body(hit.body)?.body_type {
                RigidBodyType::Dynamic => {
                    let pose = *world.poses()?.get(hit.body)?;
                    let local = pose.rotation.inverse() * (point - pose.translation);
                    let depth = (point - origin).dot(forward);
                    return Ok(Some(Self { body: hit.body, point: local, depth }));
                }
                RigidBodyType::Fixed => {
                    let colliders = world.scene().colliders_of(hit.body)?;
                    let shape = colliders.iter().find(|(handle, _)| *handle == hit.collider).map(|(_, c)| c.shape);
                    if matches!(shape, None | Some(Shape::HalfSpace { .. })) {
                        return Ok(None);
                    }
                }
                RigidBodyType::KinematicVelocityBased | RigidBodyType::KinematicPositionBased => return Ok(None),
            }
            // From inside the wall, on to its far side.
            let on = 1e-4 * (point - origin).length().max(1e-3);
            ray = Ray { origin: point + direction.normalize() * on, solid: false, ..ray };
        }
        Ok(None)
    }

    /// Where the cursor's ray has the depth of the point when it was taken.
    pub(crate) fn target(&self, origin: Vec3, direction: Vec3, forward: Vec3) -> Vec3 {
        origin + direction * (self.depth / direction.dot(forward).max(1e-6))
    }

    /// Where the point is now.
    pub(crate) fn point(&self, world: &mut World) -> Result<Vec3> {
        let poses = world.poses()?;
        let pose = poses.get(self.body)?;
        Ok(pose.translation + pose.rotation * self.point)
    }

    /// Pulls for the coming step.
    pub(crate) fn pull(&self, world: &mut World, target: Vec3) -> Result<()> {
        let (pose, velocity) = (*world.poses()?.get(self.body)?, *world.velocities()?.get(self.body)?);
        let scene = world.scene();
        let gravity = scene.gravity * scene.body(self.body)?.gravity_scale;
        let mass = scene.mass_properties(self.body)?;
        let dt = f64::from(world.params().dt);
        let pull = self.pull_of(&mass, &pose, &velocity, gravity.as_dvec3(), dt, target.as_dvec3());
        world.edit().add_force(self.body, pull.force)?;
        world.edit().add_torque(self.body, pull.torque)
    }

    /// A critically damped spring, integrated implicitly over the step h: with the point x from its target and at
    /// velocity v, the step shall end at
    ///
    /// ```text
    /// v' = (v - h w² x) / (1 + h w)²
    /// ```
    ///
    /// The impulse at the point that does so is J = K⁻¹ (v' - v - h g), where K = 1/m - [r] I⁻¹ [r] tells what an impulse
    /// at the arm r does to the velocity there. It turns the body too; that turning is damped and bounded, and what the
    /// bound takes from the point's velocity is made up for at the centre of mass:
    ///
    /// ```text
    /// turn' = bounded((turn + I⁻¹ (r x J)) / (1 + h c))
    /// force = m (v' - turn' x r - velocity - h g) / h        torque = I (turn' - turn) / h
    /// ```
    ///
    /// Mass thus drops out: a body of 1 g goes the same way as one of 10 t, and none sags under its weight. As forces and
    /// not impulses, so that they act in every sub-step as gravity does.
    fn pull_of(
        &self,
        mass: &MassProperties,
        pose: &Pose,
        velocity: &Velocity,
        gravity: DVec3,
        h: f64,
        target: DVec3,
    ) -> Pull {
        let rotation = pose.rotation.as_dquat().normalize();
        let principal = DMat3::from_quat((rotation * mass.principal_frame.as_dquat()).normalize());
        let moments = mass.principal_inertia.as_dvec3();
        let inertia = principal * DMat3::from_diagonal(moments) * principal.transpose();
        let inverse_inertia = principal * DMat3::from_diagonal(1.0 / moments) * principal.transpose();
        let arm = rotation * (self.point - mass.center_of_mass).as_dvec3();
        let point = pose.translation.as_dvec3() + rotation * self.point.as_dvec3();
        let (linear, turning) = (velocity.linear.as_dvec3(), velocity.angular.as_dvec3());

        let at_point = linear + turning.cross(arm);
        let wanted = (at_point - h * STIFFNESS.powi(2) * (point - target)) / (1.0 + h * STIFFNESS).powi(2);
        let wanted = wanted.clamp_length_max(FASTEST);
        let cross = DMat3::from_cols(
            DVec3::new(0.0, arm.z, -arm.y),
            DVec3::new(-arm.z, 0.0, arm.x),
            DVec3::new(arm.y, -arm.x, 0.0),
        );
        let mass = f64::from(mass.mass);
        let response = DMat3::from_diagonal(DVec3::splat(1.0 / mass)) - cross * inverse_inertia * cross;
        let impulse = response.inverse() * (wanted - at_point - h * gravity);
        let turned = (turning + inverse_inertia * arm.cross(impulse)) / (1.0 + h * TURNING);
        let turned = turned.clamp_length_max(FASTEST_TURN);
        let force = mass * (wanted - turned.cross(arm) - linear - h * gravity) / h;
        Pull { force: force.as_vec3(), torque: (inertia * (turned - turning) / h).as_vec3() }
    }
}
