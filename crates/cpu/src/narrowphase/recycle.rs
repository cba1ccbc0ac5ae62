//! A contact that hardly moved is not found anew: its normal, arms and features stay, only the gaps follow the bodies.
//! Twin of `shaders/shared/recycle.wgsl`.
//!
//! This saves the search, and it is what keeps tall stacks of soft contacts up, in rapier 0.36 as here: arms that are
//! found anew in each step follow a lean, and the weight on them makes it grow (a column of 25 boxes on 30 Hz contacts
//! falls within 600 steps without it). Only manifolds of four points are kept: in heaps, where fewer are the rule, old
//! points would hide new ones (200 boxes in a pit rest 25 % deeper).

use super::Couple;
use crate::math::{rotate, rotate_back, vec3};
use glam::Quat;
use tumble_core::layout::{FoundManifold, Manifold};

/// Share of the smaller collider's least half extent that the two may move against each other.
pub const SHARE: f32 = 0.05;
/// Square of the sine of half the angle that either body may turn: 11.5 degrees.
const TURN: f32 = 0.01;

/// The manifold found earlier with this step's gaps, if the two have hardly moved against each other since.
pub fn recycle(couple: &Couple, found: &FoundManifold) -> Option<Manifold> {
    let mut manifold = found.manifold;
    if manifold.count < 4 {
        return None;
    }
    let (qa, qb) = (couple.a.body_rotation, couple.b.body_rotation);
    let (qa0, qb0) = (Quat::from_array(found.rotation_a), Quat::from_array(found.rotation_b));
    // Turns since then, in the world's axes.
    let (da, db) = (qa * qa0.conjugate(), qb * qb0.conjugate());
    if da.xyz().length_squared() > TURN || db.xyz().length_squared() > TURN {
        return None;
    }
    let (now, then) = (couple.b.center, vec3(manifold.between));
    let drift = (rotate_back(da, now) - then).length();
    let twist = 2.0 * (da.conjugate() * db).xyz().length();
    let arm = couple.a.size.max_element().max(couple.b.size.max_element());
    if drift + twist * arm > couple.recycle_distance() {
        return None;
    }
    let normal = vec3(manifold.normal);
    for point in &mut manifold.points[..found.manifold.count as usize] {
        let ra = vec3(point.anchor);
        let rb = ra - then;
        let moved = (now - then) + (rotate(db, rb) - rb) - (rotate(da, ra) - ra);
        point.separation += normal.dot(moved);
    }
    manifold.recycled = 1;
    Some(manifold)
}
