//! The description of a world: bodies, colliders, gravity.

use crate::builder::{ColliderBuilder, RigidBodyBuilder, RigidBodyType};
use crate::error::{Error, Result, check};
use crate::handle::{BodyHandle, ColliderHandle, Inserted, Slots};
use crate::mass::MassProperties;
use crate::shape::Shape;
use glam::Vec3;

/// Most bodies or colliders in one scene: an index must fit beside four flags.
pub(crate) const MAX_COUNT: usize = 1 << 26;

#[derive(Debug, Clone)]
pub(crate) struct BodyEntry {
    pub(crate) builder: RigidBodyBuilder,
    pub(crate) colliders: Vec<ColliderHandle>,
}

#[derive(Debug, Clone)]
pub(crate) struct ColliderEntry {
    pub(crate) builder: ColliderBuilder,
    pub(crate) body: BodyHandle,
}

/// Bodies with colliders, and gravity. Build it, hand it to a world; later changes go through the world's editor.
#[derive(Debug, Clone)]
pub struct Scene {
    /// m/s²; (0, -9.81, 0) at first.
    pub gravity: Vec3,
    pub(crate) bodies: Slots<BodyEntry>,
    pub(crate) colliders: Slots<ColliderEntry>,
    /// The first thing refused by `insert`; told when a world is made.
    problem: Option<Error>,
}

impl Default for Scene {
    fn default() -> Self {
        Self::new()
    }
}

impl Scene {
    /// An empty scene with the Earth's gravity along -y.
    pub fn new() -> Self {
        Self { gravity: Vec3::new(0.0, -9.81, 0.0), bodies: Slots::new(), colliders: Slots::new(), problem: None }
    }

    /// Adds a body with its first collider. A bad value is remembered and refused by the world that is made of the
    /// scene; [`try_insert`](Self::try_insert) refuses at once.
    pub fn insert(&mut self, body: RigidBodyBuilder, collider: ColliderBuilder) -> Inserted {
        if let Err(error) = self.check_insert(&body, &collider) {
            self.problem.get_or_insert(error);
        }
        self.insert_unchecked(body, collider)
    }

    /// Adds a body with its first collider, or says which value is not allowed.
    pub fn try_insert(&mut self, body: RigidBodyBuilder, collider: ColliderBuilder) -> Result<Inserted> {
        self.check_insert(&body, &collider)?;
        Ok(self.insert_unchecked(body, collider))
    }

    fn check_insert(&self, body: &RigidBodyBuilder, collider: &ColliderBuilder) -> Result<()> {
        self.check_count("bodies", self.bodies.len())?;
        self.check_count("colliders", self.colliders.len())?;
        body.validate(&|| format!("body {}", self.bodies.live()))?;
        collider.validate(&|| format!("collider of body {}", self.bodies.live()))?;
        check_mass(body, std::iter::once(collider), || format!("body {}", self.bodies.live()))
    }

    fn check_count(&self, field: &'static str, count: usize) -> Result<()> {
        check(count < MAX_COUNT, || "Scene".into(), field, count + 1, "up to 67,108,864")
    }

    fn insert_unchecked(&mut self, builder: RigidBodyBuilder, collider: ColliderBuilder) -> Inserted {
        let (slot, generation) = self.bodies.insert(BodyEntry { builder, colliders: Vec::new() });
        let body = BodyHandle { slot, generation };
        Inserted { body, collider: self.attach_unchecked(body, collider) }
    }

    fn attach_unchecked(&mut self, body: BodyHandle, builder: ColliderBuilder) -> ColliderHandle {
        let (slot, generation) = self.colliders.insert(ColliderEntry { builder, body });
        let handle = ColliderHandle { slot, generation };
        if let Some(entry) = self.bodies.get_mut(body.slot, body.generation) {
            entry.colliders.push(handle);
        }
        handle
    }

    /// Adds a further collider to a body. Mass, centre of mass and inertia follow.
    pub fn attach(&mut self, body: BodyHandle, collider: ColliderBuilder) -> Result<ColliderHandle> {
        self.entry(body)?;
        self.check_count("colliders", self.colliders.len())?;
        collider.validate(&|| format!("collider of {body}"))?;
        let all = self.colliders_of(body)?;
        check_mass(&self.entry(body)?.builder, all.iter().map(|(_, c)| *c).chain([&collider]), || body.to_string())?;
        Ok(self.attach_unchecked(body, collider))
    }

    /// Removes a body and its colliders.
    pub fn remove(&mut self, body: BodyHandle) -> Result<()> {
        let entry = self.bodies.remove(body.slot, body.generation).ok_or(Error::StaleBody(body))?;
        for collider in entry.colliders {
            self.colliders.remove(collider.slot, collider.generation);
        }
        Ok(())
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.bodies.live()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of colliders.
    pub fn collider_count(&self) -> usize {
        self.colliders.live()
    }

    /// All bodies, in slot order.
    pub fn bodies(&self) -> impl Iterator<Item = BodyHandle> {
        self.bodies.iter().map(|(slot, generation, _)| BodyHandle { slot, generation })
    }

    /// How the body was described.
    pub fn body(&self, body: BodyHandle) -> Result<&RigidBodyBuilder> {
        self.entry(body).map(|e| &e.builder)
    }

    /// The body's colliders and how they were described.
    pub fn colliders_of(&self, body: BodyHandle) -> Result<Vec<(ColliderHandle, &ColliderBuilder)>> {
        let entry = self.entry(body)?;
        Ok(entry
            .colliders
            .iter()
            .filter_map(|&h| self.colliders.get(h.slot, h.generation).map(|c| (h, &c.builder)))
            .collect())
    }

    /// Mass, centre of mass and inertia of the body's colliders together.
    pub fn mass_properties(&self, body: BodyHandle) -> Result<MassProperties> {
        Ok(MassProperties::of(self.colliders_of(body)?.into_iter().map(|(_, c)| c)))
    }

    /// The first value that an [`insert`](Self::insert) should have refused, or a bad gravity.
    pub fn validate(&self) -> Result<()> {
        check(
            self.gravity.is_finite() && self.gravity.length() <= 1e6,
            || "Scene".into(),
            "gravity",
            self.gravity.to_array(),
            "finite numbers up to 1e6 m/s²",
        )?;
        self.problem.clone().map_or(Ok(()), Err)
    }

    /// The collider at this slot, and its body.
    pub(crate) fn collider_at(&self, slot: u32) -> Option<(ColliderHandle, BodyHandle)> {
        let (generation, entry) = self.colliders.at(slot)?;
        Some((ColliderHandle { slot, generation }, entry.body))
    }

    pub(crate) fn entry(&self, body: BodyHandle) -> Result<&BodyEntry> {
        self.bodies.get(body.slot, body.generation).ok_or(Error::StaleBody(body))
    }
}

/// A dynamic body must weigh something, and no more than a float can square.
fn check_mass<'a>(
    body: &RigidBodyBuilder,
    colliders: impl Iterator<Item = &'a ColliderBuilder>,
    what: impl Fn() -> String,
) -> Result<()> {
    if body.body_type != RigidBodyType::Dynamic {
        return Ok(());
    }
    let colliders: Vec<_> = colliders.collect();
    let mass = MassProperties::of(colliders.iter().copied());
    let fits = |x: f32| (1e-18..=1e18).contains(&x);
    check(
        fits(mass.mass),
        &what,
        "mass",
        mass.mass,
        "a dynamic body has a ball or cuboid and weighs 1e-18 to 1e18 kg",
    )?;
    let endless = colliders.iter().any(|c| matches!(c.shape, Shape::HalfSpace { .. }));
    check(
        !endless,
        &what,
        "shape",
        "a half-space",
        "a ball or cuboid: a half-space has no mass, and only fixed and kinematic bodies carry one",
    )?;
    let inertia = mass.principal_inertia.to_array();
    check(
        inertia.into_iter().all(|x| (1e-30..=1e30).contains(&x)),
        &what,
        "inertia",
        inertia,
        "principal moments of a dynamic body are 1e-30 to 1e30 kg m²",
    )
}
