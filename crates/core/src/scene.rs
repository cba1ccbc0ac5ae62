//! The description of a world: bodies, colliders, gravity.

use crate::builder::{ColliderBuilder, RigidBodyBuilder, RigidBodyType};
use crate::error::{Error, Result, check};
use crate::handle::{BodyHandle, ColliderHandle, Inserted, JointHandle, Slots};
use crate::joint::JointBuilder;
use crate::mass::MassProperties;
use crate::shape::Shape;
use glam::Vec3;

/// Most bodies or colliders in one scene: an index must fit beside four flags.
pub(crate) const MAX_COUNT: usize = 1 << 26;

#[derive(Debug, Clone)]
pub(crate) struct BodyEntry {
    pub(crate) builder: RigidBodyBuilder,
    pub(crate) colliders: Vec<ColliderHandle>,
    pub(crate) joints: Vec<JointHandle>,
}

#[derive(Debug, Clone)]
pub(crate) struct ColliderEntry {
    pub(crate) builder: ColliderBuilder,
    pub(crate) body: BodyHandle,
}

#[derive(Debug, Clone)]
pub(crate) struct JointEntry {
    pub(crate) builder: JointBuilder,
    pub(crate) bodies: [BodyHandle; 2],
}

/// Bodies with colliders, joints between them, and gravity. Build it, hand it to a world; later changes go through the world's editor.
#[derive(Debug, Clone)]
pub struct Scene {
    /// m/s²; (0, -9.81, 0) at first.
    pub gravity: Vec3,
    pub(crate) bodies: Slots<BodyEntry>,
    pub(crate) colliders: Slots<ColliderEntry>,
    pub(crate) joints: Slots<JointEntry>,
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
        Self {
            gravity: Vec3::new(0.0, -9.81, 0.0),
            bodies: Slots::new(),
            colliders: Slots::new(),
            joints: Slots::new(),
            problem: None,
        }
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
        let (slot, generation) = self.bodies.insert(BodyEntry { builder, colliders: Vec::new(), joints: Vec::new() });
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

    /// Joins two bodies.
    ///
    /// # Errors
    /// [`Error::Invalid`] names the value that is not allowed: bodies that are one, or that nothing moves;
    /// axes, limits, motors. [`Error::StaleBody`] for bodies that are no more.
    pub fn insert_joint(&mut self, body1: BodyHandle, body2: BodyHandle, joint: JointBuilder) -> Result<JointHandle> {
        self.check_count("joints", self.joints.len())?;
        let what = || format!("joint {} between {body1} and {body2}", self.joints.live());
        let kinds = [self.entry(body1)?.builder.body_type, self.entry(body2)?.builder.body_type];
        check(body1 != body2, what, "bodies", body1, "two different bodies")?;
        let any = kinds.contains(&RigidBodyType::Dynamic);
        check(
            any,
            what,
            "bodies",
            format!("{kinds:?}"),
            "at least one dynamic body: nothing else is moved by a joint",
        )?;
        joint.validate(&what)?;
        let (slot, generation) = self.joints.insert(JointEntry { builder: joint, bodies: [body1, body2] });
        let handle = JointHandle { slot, generation };
        for body in [body1, body2] {
            if let Some(entry) = self.bodies.get_mut(body.slot, body.generation) {
                entry.joints.push(handle);
            }
        }
        Ok(handle)
    }

    /// Removes a joint.
    pub fn remove_joint(&mut self, joint: JointHandle) -> Result<()> {
        let entry = self.joints.remove(joint.slot, joint.generation).ok_or(Error::StaleJoint(joint))?;
        for body in entry.bodies {
            if let Some(entry) = self.bodies.get_mut(body.slot, body.generation) {
                entry.joints.retain(|&other| other != joint);
            }
        }
        Ok(())
    }

    /// Describes a joint anew.
    pub fn set_joint(&mut self, joint: JointHandle, builder: JointBuilder) -> Result<()> {
        self.joint_entry(joint)?;
        builder.validate(&|| joint.to_string())?;
        if let Some(entry) = self.joints.get_mut(joint.slot, joint.generation) {
            entry.builder = builder;
        }
        Ok(())
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints.live()
    }

    /// All joints, in slot order.
    pub fn joints(&self) -> impl Iterator<Item = JointHandle> {
        self.joints.iter().map(|(slot, generation, _)| JointHandle { slot, generation })
    }

    /// How the joint was described.
    pub fn joint(&self, joint: JointHandle) -> Result<&JointBuilder> {
        self.joint_entry(joint).map(|entry| &entry.builder)
    }

    /// The bodies that it joins.
    pub fn joined(&self, joint: JointHandle) -> Result<[BodyHandle; 2]> {
        self.joint_entry(joint).map(|entry| entry.bodies)
    }

    /// The body's joints.
    pub fn joints_of(&self, body: BodyHandle) -> Result<&[JointHandle]> {
        self.entry(body).map(|entry| entry.joints.as_slice())
    }

    pub(crate) fn joint_entry(&self, joint: JointHandle) -> Result<&JointEntry> {
        self.joints.get(joint.slot, joint.generation).ok_or(Error::StaleJoint(joint))
    }

    /// Removes a body with its colliders and joints.
    pub fn remove(&mut self, body: BodyHandle) -> Result<()> {
        let entry = self.bodies.remove(body.slot, body.generation).ok_or(Error::StaleBody(body))?;
        for joint in entry.joints {
            self.remove_joint(joint)?;
        }
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
