//! Generational handles. A slot is reused after a removal, with another generation, so that a handle kept too
//! long is an error and never someone else's body.

use std::fmt;

/// Names a body for as long as it lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyHandle {
    pub(crate) slot: u32,
    pub(crate) generation: u32,
}

/// Names a collider for as long as it lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ColliderHandle {
    pub(crate) slot: u32,
    pub(crate) generation: u32,
}

/// Names a joint for as long as it lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JointHandle {
    pub(crate) slot: u32,
    pub(crate) generation: u32,
}

/// What [`Scene::insert`](crate::Scene::insert) hands back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Inserted {
    /// The new body.
    pub body: BodyHandle,
    /// Its first collider.
    pub collider: ColliderHandle,
}

impl BodyHandle {
    /// The index of the body in every per-body array, the renderer's pose buffer included.
    pub fn slot(self) -> usize {
        self.slot as usize
    }
    /// How often the slot was taken before.
    pub fn generation(self) -> u32 {
        self.generation
    }
}

impl ColliderHandle {
    /// The index of the collider in every per-collider array.
    pub fn slot(self) -> usize {
        self.slot as usize
    }
}

impl JointHandle {
    /// The index of the joint in every per-joint array.
    pub fn slot(self) -> usize {
        self.slot as usize
    }
    /// How often the slot was taken before.
    pub fn generation(self) -> u32 {
        self.generation
    }
}

impl fmt::Display for JointHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "joint {} (generation {})", self.slot, self.generation)
    }
}

impl fmt::Display for BodyHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "body {} (generation {})", self.slot, self.generation)
    }
}

impl fmt::Display for ColliderHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "collider {} (generation {})", self.slot, self.generation)
    }
}

/// Slots with generations: values keep their index while they live.
#[derive(Debug, Clone)]
pub(crate) struct Slots<T> {
    entries: Vec<(u32, Option<T>)>,
    free: Vec<u32>,
}

impl<T> Slots<T> {
    pub(crate) fn new() -> Self {
        Self { entries: Vec::new(), free: Vec::new() }
    }

    pub(crate) fn insert(&mut self, value: T) -> (u32, u32) {
        if let Some(slot) = self.free.pop() {
            let entry = &mut self.entries[slot as usize];
            entry.1 = Some(value);
            return (slot, entry.0);
        }
        self.entries.push((0, Some(value)));
        (self.entries.len() as u32 - 1, 0)
    }
    pub(crate) fn get(&self, slot: u32, generation: u32) -> Option<&T> {
        self.entries.get(slot as usize).filter(|e| e.0 == generation).and_then(|e| e.1.as_ref())
    }
    /// What lives at this slot, with its generation.
    pub(crate) fn at(&self, slot: u32) -> Option<(u32, &T)> {
        self.entries.get(slot as usize).and_then(|e| e.1.as_ref().map(|value| (e.0, value)))
    }
    pub(crate) fn get_mut(&mut self, slot: u32, generation: u32) -> Option<&mut T> {
        self.entries.get_mut(slot as usize).filter(|e| e.0 == generation).and_then(|e| e.1.as_mut())
    }
    pub(crate) fn remove(&mut self, slot: u32, generation: u32) -> Option<T> {
        let entry = self.entries.get_mut(slot as usize).filter(|e| e.0 == generation)?;
        let value = entry.1.take()?;
        entry.0 = entry.0.wrapping_add(1);
        self.free.push(slot);
        Some(value)
    }
    /// Number of slots, empty ones included.
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }
    /// Number of living values.
    pub(crate) fn live(&self) -> usize {
        self.entries.len() - self.free.len()
    }
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, u32, &T)> {
        self.entries.iter().enumerate().filter_map(|(i, e)| e.1.as_ref().map(|v| (i as u32, e.0, v)))
    }
}
