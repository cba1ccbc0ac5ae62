//! Stage `broadphase`: which colliders' boxes overlap.

pub(crate) mod grid;
