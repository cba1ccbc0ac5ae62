//! Stage `broadphase`: which colliders' boxes overlap.

pub mod grid;

use tumble_core::layout::{Aabb, aabb_body};

/// Whether two boxes overlap and a contact between them could push anything.
pub fn meets(a: &Aabb, b: &Aabb) -> bool {
    let apart = a.min[0] > b.max[0]
        || b.min[0] > a.max[0]
        || a.min[1] > b.max[1]
        || b.min[1] > a.max[1]
        || a.min[2] > b.max[2]
        || b.min[2] > a.max[2];
    let both = a.body & b.body & aabb_body::LIVE != 0;
    let one_moves = (a.body | b.body) & aabb_body::DYNAMIC != 0;
    !apart && both && one_moves && (a.body ^ b.body) & aabb_body::INDEX != 0
}
