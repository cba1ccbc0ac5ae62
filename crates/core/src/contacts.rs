//! Contacts of the last step, in bulk: where bodies touch, and what they push.

use crate::edit::Editor;
use crate::handle::{BodyHandle, ColliderHandle};
use crate::layout::{
    BodyState, Collider, FoundManifold, Manifold, ManifoldMemory, ManifoldPoint, Pair, StepParams, shape_kind, tangents,
};
use glam::{Quat, Vec3};

/// The contacts of one step, all of them, in the order of (first, second) collider slot.
///
/// They are those that the step was solved with, at the places where its end finds them; so they fit the poses of the
/// same step. A contact is listed as soon as its bodies may meet within a step: one that has not pushed has impulses of
/// zero, and one that is apart a positive separation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Contacts {
    /// The step; 0 before the first.
    pub step: u64,
    /// Its length, s: an impulse divided by it is a force in N.
    pub dt: f32,
    /// One for each two colliders that touch or are about to.
    pub all: Vec<Contact>,
}

/// What two colliders have in common: one normal and up to four points. The first is the one of the lower slot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The first collider.
    pub collider_a: ColliderHandle,
    /// The second collider.
    pub collider_b: ColliderHandle,
    /// Body of the first.
    pub body_a: BodyHandle,
    /// Body of the second.
    pub body_b: BodyHandle,
    /// From the first to the second, unit, world axes: along it the step pushed.
    pub normal: Vec3,
    /// The batch that it was solved in. Batches are solved in the order of their numbers, some of which may be in no
    /// use; [`LAST_BATCH`](crate::layout::LAST_BATCH) is the one that is solved in sequence.
    pub batch: u32,
    points: [ContactPoint; 4],
    count: u32,
}

/// A point where two colliders touch.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactPoint {
    /// Midway between the surfaces, world, m.
    pub position: Vec3,
    /// Gap along the normal, m; negative where they overlap.
    pub separation: f32,
    /// What the second body was pushed along the normal, and the first against it; N s, never negative.
    ///
    /// All that was pushed in the step: the sum over its sub-steps, bounces included. Divided by [`Contacts::dt`] it is the
    /// mean force, in N: under a ball at rest m g.
    pub normal_impulse: f32,
    /// What friction pushed the second body, and the first the other way; world axes, N s, taken as the above.
    pub friction_impulse: Vec3,
}

impl Contact {
    /// The points, one to four.
    pub fn points(&self) -> &[ContactPoint] {
        &self.points[..self.count as usize]
    }

    /// What all points together pushed the second body, and the first the other way; world axes, N s, taken as
    /// [`ContactPoint::normal_impulse`] is.
    pub fn impulse(&self) -> Vec3 {
        self.points().iter().map(|p| p.normal_impulse * self.normal + p.friction_impulse).sum()
    }
}

/// What a world keeps of its last committed step.
#[doc(hidden)]
pub struct Committed<'a> {
    /// What the step was told.
    pub step: &'a StepParams,
    /// By body slot, as the step left them.
    pub states: &'a [BodyState],
    /// By collider slot.
    pub colliders: &'a [Collider],
    /// Sorted by (a, b).
    pub pairs: &'a [Pair],
    /// By slot of a pair.
    pub batch_of_slot: &'a [u32],
    /// By slot of a pair.
    pub found: &'a [FoundManifold],
    /// By slot of a pair.
    pub memory: &'a [ManifoldMemory],
}

impl Committed<'_> {
    /// The contacts; `editor` knows who was at which slot.
    pub fn contacts(&self, editor: &Editor) -> Contacts {
        let touching = self.pairs.iter().filter(|pair| self.found[pair.slot as usize].manifold.count > 0);
        let all = touching.filter_map(|pair| self.contact(pair, editor)).collect();
        Contacts { step: self.step.step.into(), dt: self.step.dt, all }
    }

    fn contact(&self, pair: &Pair, editor: &Editor) -> Option<Contact> {
        let (collider_a, body_a) = editor.collider_at(pair.a)?;
        let (collider_b, body_b) = editor.collider_at(pair.b)?;
        let slot = pair.slot as usize;
        let (found, totals) = (&self.found[slot], &self.memory[slot].totals);
        let end = |collider: u32, body: BodyHandle, rotation: [f32; 4]| End {
            collider: &self.colliders[collider as usize],
            state: &self.states[body.slot()],
            rotation_then: Quat::from_array(rotation),
        };
        let (a, b) = (end(pair.a, body_a, found.rotation_a), end(pair.b, body_b, found.rotation_b));
        let normal = Vec3::from_array(found.manifold.normal);
        let count = found.manifold.count.min(4);
        let mut points = [ContactPoint::default(); 4];
        for (i, point) in points.iter_mut().enumerate().take(count as usize) {
            *point = placed(&found.manifold, &found.manifold.points[i], &a, &b);
            let (t1, t2) = tangents(normal);
            let [pushed, x, y] = totals[i];
            point.normal_impulse = pushed;
            point.friction_impulse = x * t1 + y * t2;
        }
        let batch = self.batch_of_slot[slot];
        Some(Contact { collider_a, collider_b, body_a, body_b, normal, batch, points, count })
    }
}

/// A body's end of a contact: where it is now, and where it was when the contact was found.
struct End<'a> {
    collider: &'a Collider,
    state: &'a BodyState,
    rotation_then: Quat,
}

impl End<'_> {
    fn is_ball(&self) -> bool {
        self.collider.shape == shape_kind::BALL
    }

    /// An arm from the centre of mass, found then, as it is now. It turns with the body; on a ball, whose surface is the
    /// same all around, only with the ball's middle.
    fn arm(&self, then: Vec3) -> Vec3 {
        let now = Quat::from_array(self.state.rotation);
        if self.is_ball() {
            let middle = Vec3::from_array(self.collider.position);
            then + now * middle - self.rotation_then * middle
        } else {
            (now * self.rotation_then.conjugate()) * then
        }
    }
}

/// Where a point is now: its arms moved with their bodies since it was found.
fn placed(manifold: &Manifold, point: &ManifoldPoint, a: &End<'_>, b: &End<'_>) -> ContactPoint {
    let [center_a, center_b] = [a, b].map(|end| Vec3::from_array(end.state.position));
    let anchor = Vec3::from_array(point.anchor);
    // Both from the centre of mass of a, which keeps digits far from the world's origin.
    let at_a = a.arm(anchor);
    let at_b = (center_b - center_a) + b.arm(anchor - Vec3::from_array(manifold.between));
    let normal = Vec3::from_array(manifold.normal);
    let separation = point.separation + normal.dot(at_b - at_a);
    // Both arms ended midway between the surfaces. Of two surfaces that glide along each other, a ball's tells where they
    // touch: it is the same all around, and its lowest point stays the lowest.
    let half = 0.5 * normal.dot(at_b - at_a) * normal;
    let middle = match (a.is_ball(), b.is_ball()) {
        (false, true) => at_b - half,
        (true, false) => at_a + half,
        _ => 0.5 * (at_a + at_b),
    };
    ContactPoint { position: center_a + middle, separation, ..ContactPoint::default() }
}
