//! The world that is shown, and its clock.

use crate::clock::Clock;
use crate::grab::Grab;
use std::time::Instant;
use tumble::core::glam::Vec3;
use tumble::core::measures;
use tumble::core::scenes::StandardScene;
use tumble::{
    Backend, BodyHandle, ColliderBuilder, Params, Result, RigidBodyBuilder, RigidBodyType, Shape, StepReport, World,
};
use tumble_draw::PoseUpload;

/// Share of the newest value in a running mean.
const NEWEST: f64 = 0.1;
/// Bodies up to which the energy is told; it needs all poses and velocities on the host.
const MOST_FOR_ENERGY: u32 = 20_000;
/// Seconds from one look at the energy to the next.
const ENERGY_EVERY: f64 = 0.5;

/// What is shown.
pub(crate) struct Simulation {
    pub(crate) standard: &'static StandardScene,
    bodies: usize,
    backend: Backend,
    device: wgpu::Device,
    queue: wgpu::Queue,
    pub(crate) world: World,
    upload: PoseUpload,
    clock: Clock,
    pub(crate) is_paused: bool,
    /// Steps asked for one by one.
    pub(crate) single_steps: u32,
    /// Why it stands still; the last good state is shown.
    pub(crate) error: Option<String>,
    pub(crate) report: StepReport,
    /// Running mean.
    pub(crate) milliseconds: Option<f64>,
    /// Kinetic, J, and when it was looked at.
    energy: Option<(Instant, f64)>,
    /// Rises when bodies come or go.
    pub(crate) revision: u64,
    /// Radius of a middling body, m.
    pub(crate) size: f32,
}

/// What is thrown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Projectile {
    Cuboid,
    Ball,
}

impl Simulation {
    /// `backend` is one of the two sides; the GPU side runs on this device.
    pub(crate) fn new(
        (standard, bodies): (&'static StandardScene, usize),
        params: Params,
        backend: Backend,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
    ) -> Result<Self> {
        let world = load((standard, bodies), params, backend, device, queue)?;
        Ok(Self {
            standard,
            bodies,
            backend,
            device: device.clone(),
            queue: queue.clone(),
            size: middling_size(&world),
            world,
            upload: PoseUpload::new(device, queue),
            clock: Clock::default(),
            is_paused: false,
            single_steps: 0,
            error: None,
            report: StepReport::default(),
            milliseconds: None,
            energy: None,
            revision: 0,
        })
    }

    /// Back to the scene's begin, with the parameters as they are now.
    pub(crate) fn reset(&mut self) {
        let params = *self.world.params();
        match load((self.standard, self.bodies), params, self.backend, &self.device, &self.queue) {
            Ok(world) => {
                self.world = world;
                self.error = None;
                self.report = StepReport::default();
                self.energy = None;
                self.clock = Clock::default();
                self.revision += 1;
            }
            Err(error) => self.fail(&error),
        }
    }

    /// Runs the steps that are due after `elapsed` seconds, pulling what is held to its target.
    pub(crate) fn advance(&mut self, elapsed: f64, held: Option<(Grab, Vec3)>) {
        let steps = if self.is_paused {
            self.clock.stop();
            std::mem::take(&mut self.single_steps)
        } else {
            self.single_steps = 0;
            self.clock.steps(elapsed, f64::from(self.world.params().dt))
        };
        if steps == 0 {
            return;
        }
        self.error = None;
        let begin = Instant::now();
        match self.run(steps, held) {
            Ok(report) => {
                let each = begin.elapsed().as_secs_f64() * 1e3 / f64::from(steps);
                self.milliseconds = Some(self.milliseconds.map_or(each, |mean| mean + NEWEST * (each - mean)));
                self.report = report;
            }
            Err(error) => self.fail(&error),
        }
    }

    /// All steps of a frame, and their end: what a step takes is what the world was busy.
    fn run(&mut self, steps: u32, held: Option<(Grab, Vec3)>) -> Result<StepReport> {
        for _ in 0..steps {
            if let Some((grab, target)) = held {
                grab.pull(&mut self.world, target)?;
            }
            self.world.step()?;
        }
        self.world.sync()
    }

    /// Stands still and says why.
    pub(crate) fn fail(&mut self, error: &dyn std::fmt::Display) {
        self.error = Some(error.to_string());
        self.is_paused = true;
    }

    /// Real time by simulated time; `None` when it stands still or nobody knows yet.
    pub(crate) fn slowness(&self) -> Option<f64> {
        if self.is_paused { None } else { self.clock.slowness() }
    }

    /// Kinetic energy, J; looked at now and then, and not with very many bodies.
    pub(crate) fn energy(&mut self) -> Option<f64> {
        let is_stale = |(at, _): &(Instant, f64)| self.is_paused || at.elapsed().as_secs_f64() > ENERGY_EVERY;
        if self.report.bodies > MOST_FOR_ENERGY || self.error.is_some() {
            return None;
        }
        if self.energy.as_ref().is_none_or(is_stale) {
            let (poses, velocities) = (self.world.poses().ok()?, self.world.velocities().ok()?);
            self.energy = Some((Instant::now(), measures::kinetic_energy(self.world.scene(), &poses, &velocities)));
        }
        self.energy.map(|(_, energy)| energy)
    }

    /// Where the bodies are, for the renderer: the world's own buffer on the GPU side.
    pub(crate) fn poses(&mut self) -> Result<wgpu::Buffer> {
        match &mut self.world {
            World::Gpu(world) => Ok(world.pose_buffer()?.0.clone()),
            World::Cpu(world) => {
                let poses = world.poses()?;
                self.upload.write(world.scene(), &poses).cloned()
            }
        }
    }

    /// A body of middling size with this velocity; it is there after the next step.
    pub(crate) fn throw(&mut self, what: Projectile, from: Vec3, velocity: Vec3) -> Result<BodyHandle> {
        let collider = match what {
            Projectile::Cuboid => ColliderBuilder::cuboid(self.size, self.size, self.size),
            Projectile::Ball => ColliderBuilder::ball(self.size),
        };
        let body = RigidBodyBuilder::dynamic().translation(from).linvel(velocity);
        let inserted = self.world.edit().insert(body, collider.density(1000.0).friction(0.6))?;
        self.revision += 1;
        Ok(inserted.body)
    }
}

fn load(
    (standard, bodies): (&StandardScene, usize),
    params: Params,
    backend: Backend,
    device: &wgpu::Device,
    queue: &wgpu::Queue,
) -> Result<World> {
    let scene = (standard.build)(bodies);
    match backend {
        Backend::Gpu => {
            let world = tumble::gpu::World::with_device(device.clone(), queue.clone(), scene, params)?;
            Ok(World::Gpu(Box::new(world)))
        }
        _ => World::new(scene, params, Backend::Cpu),
    }
}

/// The median over the colliders of dynamic bodies: a ball's radius, a box's mean half extent.
fn middling_size(world: &World) -> f32 {
    let scene = world.scene();
    let dynamic = scene.bodies().filter(|body| scene.body(*body).is_ok_and(|b| b.body_type == RigidBodyType::Dynamic));
    let colliders = dynamic.filter_map(|body| scene.colliders_of(body).ok()).flatten();
    let mut sizes: Vec<f32> = colliders
        .filter_map(|(_, collider)| match collider.shape {
            Shape::Ball { radius } => Some(radius),
            Shape::Cuboid { half_extents } => Some(half_extents.element_sum() / 3.0),
            _ => None,
        })
        .collect();
    sizes.sort_by(f32::total_cmp);
    sizes.get(sizes.len() / 2).copied().unwrap_or(0.5)
}
