//! Part of stage `motion`: what is fast does not pass what stands still. Twin of `shaders/continuous.wgsl`.
//!
//! Contacts are found once a step, from where the bodies are then. One that turns while it flies, or that is longer than
//! what it meets is thick, may leave the plane of its contact on the wrong side. So the way of its centre of mass is held
//! against the fixed shapes of its pairs: where it would enter one, it ends before. The next step finds the overlap that
//! is left, on the right side, and takes the velocity. (A bound on the way alone, not a time of impact: Catto, "Continuous
//! Collision", GDC 2013, stops at the first touch.)

use crate::bounds::moves;
use crate::math::{finite, vec3};
use crate::query::place;
use crate::query::shapes::cast;
use glam::Vec3;
use tumble_core::layout::{BodyState, Collider, Pair, QueryRay, SolverBody, body_flags, pair_kind, shape_kind};

/// Which body of the pair must not go all of its way in this step, and the share that it may go.
pub fn share(pair: &Pair, colliders: &[Collider], states: &[BodyState], bodies: &[SolverBody]) -> Option<(u32, f32)> {
    if pair.kind & pair_kind::MASK == pair_kind::NONE {
        // A joint keeps them from colliding.
        return None;
    }
    let (a, b) = (&colliders[pair.a as usize], &colliders[pair.b as usize]);
    let (mover, other) = if moves(states[a.body as usize].flags) { (a, b) } else { (b, a) };
    let (state, still) = (&states[mover.body as usize], &states[other.body as usize]);
    if !moves(state.flags) || !stands(still.flags) {
        return None;
    }
    let (way, thickness) = (vec3(bodies[mover.body as usize].translation), thickness(mover));
    let length = way.length();
    // What goes less than half its thickness keeps its middle where contacts see it.
    if !finite([length; 3]) || length <= thickness {
        return None;
    }
    let direction = way / length;
    let ray = QueryRay {
        origin: state.position,
        max_distance: length,
        direction: direction.to_array(),
        solid: 1,
        inverse: Vec3::ZERO.to_array(),
        pad_a: 0,
    };
    let distance = cast(&place(other, still), &ray)?.distance;
    // One that begins within is left to the contact.
    let enters = distance > 0.0 && distance < length;
    enters.then(|| (mover.body, (distance - 0.5 * thickness).max(0.0) / length))
}

fn stands(flags: u32) -> bool {
    flags & body_flags::KIND == body_flags::FIXED || flags & body_flags::FROZEN != 0
}

/// Half the thickness of a shape, m.
fn thickness(collider: &Collider) -> f32 {
    match collider.shape {
        shape_kind::BALL => collider.size[0],
        _ => vec3(collider.size).min_element(),
    }
}
