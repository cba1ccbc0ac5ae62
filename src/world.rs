//! One face for the CPU and the GPU world.

use tumble_core::{
    Contacts, Editor, Joints, Nearest, NearestQuery, OverlapShape, Overlaps, Params, Poses, Ray, RayHit, Result, Scene,
    StepReport, Velocities,
};

/// Where a world runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Backend {
    /// A real GPU if there is one, else the CPU side; never a software adapter, which is slower than the CPU side.
    #[default]
    Auto,
    /// The CPU side.
    Cpu,
    /// The best adapter there is, a software one too.
    Gpu,
}

/// A simulation, on whichever side it runs; [`StepReport::backend`] and [`StepReport::adapter`] name it.
pub enum World {
    /// On the CPU.
    #[cfg(feature = "cpu")]
    Cpu(Box<tumble_cpu::World>),
    /// On a GPU.
    #[cfg(feature = "gpu")]
    Gpu(Box<tumble_gpu::World>),
}

/// Calls the same method on whichever side there is.
macro_rules! either {
    ($self:ident, $world:ident => $call:expr) => {
        match $self {
            #[cfg(feature = "cpu")]
            World::Cpu($world) => $call,
            #[cfg(feature = "gpu")]
            World::Gpu($world) => $call,
        }
    };
}

impl World {
    /// Loads a scene. Bad values in it are named here at the latest.
    pub fn new(scene: Scene, params: Params, backend: Backend) -> Result<Self> {
        match backend {
            Backend::Cpu => Self::cpu(scene, params),
            Backend::Gpu => Self::gpu(scene, params),
            Backend::Auto => Self::auto(scene, params),
        }
    }

    #[cfg(feature = "cpu")]
    fn cpu(scene: Scene, params: Params) -> Result<Self> {
        Ok(Self::Cpu(Box::new(tumble_cpu::World::new(scene, params)?)))
    }

    #[cfg(not(feature = "cpu"))]
    fn cpu(_: Scene, _: Params) -> Result<Self> {
        Err(tumble_core::Error::NotBuilt { backend: "cpu" })
    }

    #[cfg(feature = "gpu")]
    fn gpu(scene: Scene, params: Params) -> Result<Self> {
        Ok(Self::Gpu(Box::new(tumble_gpu::World::new(scene, params)?)))
    }

    #[cfg(not(feature = "gpu"))]
    fn gpu(_: Scene, _: Params) -> Result<Self> {
        Err(tumble_core::Error::NotBuilt { backend: "gpu" })
    }

    #[cfg(all(feature = "cpu", feature = "gpu"))]
    fn auto(scene: Scene, params: Params) -> Result<Self> {
        match tumble_gpu::Gpu::hardware() {
            Ok(Some(gpu)) => Ok(Self::Gpu(Box::new(tumble_gpu::World::with_gpu(gpu, scene, params)?))),
            Ok(None) => Self::cpu(scene, params),
            // There is one, and it does not open: the report says why the CPU runs instead.
            Err(error) => {
                let mut world = tumble_cpu::World::new(scene, params)?;
                world.note(&error.to_string());
                Ok(Self::Cpu(Box::new(world)))
            }
        }
    }

    #[cfg(not(all(feature = "cpu", feature = "gpu")))]
    fn auto(scene: Scene, params: Params) -> Result<Self> {
        if cfg!(feature = "cpu") { Self::cpu(scene, params) } else { Self::gpu(scene, params) }
    }

    /// Runs one step. On a GPU this submits, and waits only when three steps are in flight.
    pub fn step(&mut self) -> Result<()> {
        either!(self, world => world.step())
    }

    /// Waits for all submitted steps; the last one's report.
    pub fn sync(&mut self) -> Result<StepReport> {
        either!(self, world => world.sync())
    }

    /// Waits for all submitted steps; the pose of every body, in one download.
    pub fn poses(&mut self) -> Result<Poses> {
        either!(self, world => world.poses())
    }

    /// The newest poses that are there without waiting; `None` before the first have come.
    pub fn try_poses(&mut self) -> Result<Option<Poses>> {
        either!(self, world => world.try_poses())
    }

    /// Waits for all submitted steps; the velocity of every body, in one download.
    pub fn velocities(&mut self) -> Result<Velocities> {
        either!(self, world => world.velocities())
    }

    /// Waits for all submitted steps; the contacts of the last one with what they pushed, in one download. None before
    /// the first step. Edits are seen once a step has applied them: a body that was removed since has its contacts
    /// still.
    ///
    /// ```
    /// use tumble::prelude::*;
    ///
    /// # fn main() -> Result<()> {
    /// let mut scene = Scene::new();
    /// scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    /// let ball = RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, 0.5, 0.0));
    /// let ball = scene.insert(ball, ColliderBuilder::ball(0.5).density(1000.0));
    /// let mut world = World::new(scene, Params::default(), Backend::Auto)?;
    /// for _ in 0..60 {
    ///     world.step()?;
    /// }
    /// let contacts = world.contacts()?;
    /// let on_ball = contacts.all.iter().filter(|contact| contact.body_b == ball.body);
    /// let force: Vec3 = on_ball.map(|contact| contact.impulse() / contacts.dt).sum();
    ///
    /// let weight = 1000.0 * 4.0 / 3.0 * std::f32::consts::PI * 0.5f32.powi(3) * 9.81;
    /// assert!((force - weight * Vec3::Y).length() < 1e-3 * weight);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`Error::Capacity`](crate::Error::Capacity) when a step wants for room. What a device may refuse.
    pub fn contacts(&mut self) -> Result<Contacts> {
        either!(self, world => world.contacts())
    }

    /// Waits for all submitted steps; all joints after the last one, in one download: where they are, what they bear, and
    /// which are broken. None before the first step. Edits are seen once a step has applied them.
    ///
    /// ```
    /// use tumble::prelude::*;
    ///
    /// # fn main() -> Result<()> {
    /// let mut scene = Scene::new();
    /// let post = scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.1)).body;
    /// let below = RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, -1.0, 0.0));
    /// let ball = scene.insert(below, ColliderBuilder::ball(0.1).density(1000.0)).body;
    /// let hinge = JointBuilder::revolute(Vec3::Z).local_anchor2(Vec3::Y);
    /// let hinge = scene.insert_joint(post, ball, hinge)?;
    /// let mut world = World::new(scene, Params::default(), Backend::Auto)?;
    /// for _ in 0..30 {
    ///     world.step()?;
    /// }
    /// let joints = world.joints()?;
    /// let (force, angle) = (joints[hinge].force, joints[hinge].coordinate(JointAxis::AngX));
    ///
    /// let weight = 1000.0 * 4.0 / 3.0 * std::f32::consts::PI * 0.1f32.powi(3) * 9.81;
    /// assert!((force - weight * Vec3::Y).length() < 1e-3 * weight);
    /// assert!(angle.abs() < 1e-4 && joints[hinge].separation < 1e-4);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`Error::Capacity`](crate::Error::Capacity) when a step wants for room. What a device may refuse.
    pub fn joints(&mut self) -> Result<Joints> {
        either!(self, world => world.joints())
    }

    /// The first collider that each ray meets, or none; in the order of the rays. Where two are met at the same time, the
    /// one of the lower slot. Like all queries it waits for all submitted steps and shows the state after them: edits are
    /// seen once a step has applied them. Ask many at once: a batch shares one tree over all colliders, which is built
    /// at the first query after a step.
    ///
    /// ```
    /// use tumble::prelude::*;
    ///
    /// # fn main() -> Result<()> {
    /// let mut scene = Scene::new();
    /// scene.insert(RigidBodyBuilder::fixed(), ColliderBuilder::halfspace(Vec3::Y));
    /// let ball = RigidBodyBuilder::dynamic().translation(Vec3::new(0.0, 3.0, 0.0));
    /// let ball = scene.insert(ball, ColliderBuilder::ball(0.5));
    /// let mut world = World::new(scene, Params::default(), Backend::Auto)?;
    ///
    /// let hits = world.cast_rays(&[Ray::new(Vec3::new(0.0, 9.0, 0.0), -Vec3::Y)])?;
    /// let near = world.nearest(&[NearestQuery::new(Vec3::new(0.0, 4.0, 0.0))])?;
    /// let overlaps = world.overlaps(&[OverlapShape::Ball { center: Vec3::ZERO, radius: 2.0 }])?;
    /// println!("{:?} {:?} {:?}", hits[0], near[0], &overlaps[0]);
    ///
    /// let hit = hits[0].unwrap();
    /// assert_eq!((hit.body, hit.collider, hit.normal), (ball.body, ball.collider, Vec3::Y));
    /// assert!((hit.time_of_impact - 5.5).abs() < 1e-5);
    /// assert!((near[0].unwrap().distance - 0.5).abs() < 1e-5);
    /// assert_eq!(overlaps[0].len(), 1, "the half-space");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) names the ray and the field. [`Error::Capacity`](crate::Error::Capacity)
    /// when one ray meets too many nodes of the tree, or when a step wants for room. What a device may refuse.
    pub fn cast_rays(&mut self, rays: &[Ray]) -> Result<Vec<Option<RayHit>>> {
        either!(self, world => world.cast_rays(rays))
    }

    /// Whether each ray meets any collider: cheaper than [`cast_rays`](Self::cast_rays), for lines of sight.
    ///
    /// # Errors
    /// As for [`cast_rays`](Self::cast_rays).
    pub fn cast_rays_any(&mut self, rays: &[Ray]) -> Result<Vec<bool>> {
        either!(self, world => world.cast_rays_any(rays))
    }

    /// The colliders that each shape overlaps or touches, tested exactly, by collider slot.
    ///
    /// # Errors
    /// As for [`cast_rays`](Self::cast_rays).
    pub fn overlaps(&mut self, shapes: &[OverlapShape]) -> Result<Overlaps> {
        either!(self, world => world.overlaps(shapes))
    }

    /// The collider nearest to each point, or none. Colliders are solid: one that holds the point is at distance 0.
    ///
    /// # Errors
    /// As for [`cast_rays`](Self::cast_rays).
    pub fn nearest(&mut self, points: &[NearestQuery]) -> Result<Vec<Option<Nearest>>> {
        either!(self, world => world.nearest(points))
    }

    /// Edits for the next step: insert, remove, set, push. None of them waits or rebuilds the world.
    pub fn edit(&mut self) -> &mut Editor {
        either!(self, world => world.edit())
    }

    /// The scene as edited so far; poses in it are those at insertion.
    pub fn scene(&self) -> &Scene {
        either!(self, world => world.scene())
    }

    /// Parameters in force.
    pub fn params(&self) -> &Params {
        either!(self, world => world.params())
    }

    /// Parameters from the next step on.
    pub fn set_params(&mut self, params: Params) -> Result<()> {
        either!(self, world => world.set_params(params))
    }
}
