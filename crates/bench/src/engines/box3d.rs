//! Box3D, through the crate `boxddd`.

use super::{Engine, Facts, Means, Refusal, Setting, timed};
use boxddd::{BodyId, BodyType, BoxHull, Foundation, Quat, Sphere, Transform, Vec3};
use tumble_core::{BodyHandle, ColliderBuilder, Pose, Poses, RigidBodyType, Scene, Shape, Velocities, Velocity};

struct Box3d {
    world: boxddd::World,
    bodies: Vec<(BodyHandle, BodyId)>,
    setting: Setting,
}

fn vector(v: glam::Vec3) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

fn rotation(q: glam::Quat) -> Quat {
    Quat { v: Vec3::new(q.x, q.y, q.z), s: q.w }
}

fn back(v: Vec3) -> glam::Vec3 {
    glam::Vec3::new(v.x, v.y, v.z)
}

pub(super) fn make(scene: &Scene, setting: &Setting, _: &Means) -> Result<Box<dyn Engine>, Refusal> {
    super::without_joints(scene)?;
    build(scene, setting).map(|world| Box::new(world) as Box<dyn Engine>).map_err(|e| Refusal::Failed(e.to_string()))
}

fn build(scene: &Scene, setting: &Setting) -> boxddd::Result<Box3d> {
    let foundation = Foundation::initialize_default()?;
    let definition = foundation.world_def_builder().gravity(vector(scene.gravity)).enable_sleep(false);
    // Box3D's own scheduler.
    let definition = definition.worker_count(setting.threads as u32);
    let mut world = foundation.create_world(definition.build()?)?;
    let mut bodies = Vec::new();
    let large = super::half_space_edge(scene);
    for handle in scene.bodies() {
        let b = scene.body(handle).expect("a living body");
        let kind = match b.body_type {
            RigidBodyType::Fixed => BodyType::Static,
            RigidBodyType::KinematicVelocityBased | RigidBodyType::KinematicPositionBased => BodyType::Kinematic,
            RigidBodyType::Dynamic => BodyType::Dynamic,
        };
        let definition = foundation
            .body_def_builder()
            .body_type(kind)
            .position(b.translation.to_array())
            .rotation(rotation(b.rotation))
            .linear_velocity(vector(b.linvel))
            .angular_velocity(vector(b.angvel))
            .gravity_scale(b.gravity_scale)
            .linear_damping(b.linear_damping)
            .angular_damping(b.angular_damping)
            .enable_sleep(false)
            // Without it a box may turn by no more than a quarter turn a step, which the others do not ask.
            .allow_fast_rotation(true);
        let body = world.create_body(definition.build()?)?;
        for (_, c) in scene.colliders_of(handle).expect("a living body") {
            attach(foundation, &mut world, body, c, large)?;
        }
        bodies.push((handle, body));
    }
    Ok(Box3d { world, bodies, setting: *setting })
}

fn attach(
    foundation: &Foundation,
    world: &mut boxddd::World,
    body: BodyId,
    c: &ColliderBuilder,
    large: f32,
) -> boxddd::Result<()> {
    let volume = match c.shape {
        Shape::Ball { radius } => 4.0 / 3.0 * std::f32::consts::PI * radius.powi(3),
        Shape::Cuboid { half_extents: h } => 8.0 * h.x * h.y * h.z,
        _ => 1.0,
    };
    let density = c.mass.map_or(c.density, |mass| mass / volume);
    let definition = foundation.shape_def_builder().density(density).friction(c.friction);
    let definition = definition.restitution(c.restitution).build()?;
    match c.shape {
        Shape::Ball { radius } => {
            world.create_sphere_shape(body, &definition, &Sphere::new(vector(c.translation), radius))?;
        }
        Shape::Cuboid { half_extents: h } => {
            let at = Transform::new(vector(c.translation), rotation(c.rotation));
            world.create_hull_shape(body, &definition, &BoxHull::transformed(h.x, h.y, h.z, at)?)?;
        }
        Shape::HalfSpace { normal } => {
            let turn = c.rotation * glam::Quat::from_rotation_arc(glam::Vec3::Y, normal.normalize());
            let middle = c.translation - turn * (glam::Vec3::Y * large);
            let at = Transform::new(vector(middle), rotation(turn));
            world.create_hull_shape(body, &definition, &BoxHull::transformed(large, large, large, at)?)?;
        }
        _ => unreachable!("a shape that Box3D is not told of"),
    }
    Ok(())
}

impl Box3d {
    fn read(&self) -> boxddd::Result<(Poses, Velocities)> {
        let (mut poses, mut velocities) = (Vec::new(), Vec::new());
        for &(handle, body) in &self.bodies {
            let (p, q) = (self.world.body_position(body)?, self.world.body_rotation(body)?);
            let rotation = glam::Quat::from_xyzw(q.v.x, q.v.y, q.v.z, q.s);
            poses.push((handle, Pose { translation: glam::Vec3::new(p.x, p.y, p.z), rotation }));
            let linear = back(self.world.body_linear_velocity(body)?);
            velocities.push((handle, Velocity { linear, angular: back(self.world.body_angular_velocity(body)?) }));
        }
        Ok((Poses::collect(0, poses.into_iter()), Velocities::collect(0, velocities.into_iter())))
    }
}

impl Engine for Box3d {
    fn step(&mut self, count: u32) -> Result<Vec<f64>, String> {
        let Setting { dt, substeps, .. } = self.setting;
        timed(count, || self.world.step(dt, substeps as i32).map_err(|e| e.to_string()))
    }

    fn state(&mut self) -> Result<(Poses, Velocities), String> {
        self.read().map_err(|e| e.to_string())
    }

    fn facts(&mut self) -> Facts {
        let version = boxddd::version().map(|v| format!("{}.{}.{}", v.major, v.minor, v.revision));
        let adapter = format!("{} threads", self.setting.threads);
        Facts { version: version.unwrap_or_default(), adapter, ..Facts::default() }
    }
}
