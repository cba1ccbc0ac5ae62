//! A few words of geometry in the order of operations that the shaders use (`shaders/shared/math.wgsl`).

use glam::{Quat, Vec3};
use tumble_core::layout::SolverBody;
pub(crate) use tumble_core::layout::tangents;

pub(crate) fn vec3(v: [f32; 3]) -> Vec3 {
    Vec3::from_array(v)
}

pub(crate) fn quat(q: [f32; 4]) -> Quat {
    Quat::from_array(q)
}

/// Finite by its bits, as the shaders must ask it: WGSL may assume that floats are.
pub(crate) fn finite(v: [f32; 3]) -> bool {
    v.iter().all(|x| x.to_bits() & 0x7f80_0000 != 0x7f80_0000)
}

/// Rotates `v` by `q` (v + 2 b x (b x v + w v)).
pub(crate) fn rotate(q: Quat, v: Vec3) -> Vec3 {
    let b = Vec3::new(q.x, q.y, q.z);
    let t = 2.0 * b.cross(v);
    v + q.w * t + b.cross(t)
}

/// Rotates `v` by the inverse of `q`.
pub(crate) fn rotate_back(q: Quat, v: Vec3) -> Vec3 {
    rotate(q.conjugate(), v)
}

/// The turn of a unit quaternion as its axis times its angle, of no more than pi, rad. The tangent of a sixteenth of it is
/// found by halves, and the angle from that by the arc tangent's series: within a few last bits, and the same on every
/// machine.
pub(crate) fn rotation_vector(q: Quat) -> Vec3 {
    let axis = if q.w < 0.0 { -vec3([q.x, q.y, q.z]) } else { vec3([q.x, q.y, q.z]) };
    let sine = axis.dot(axis);
    // Each scale times the length of `axis` is a tangent: of a quarter, an eighth, a sixteenth of the angle.
    let quarter = 1.0 / (1.0 + q.w.abs());
    let eighth = quarter / (1.0 + (1.0 + sine * quarter * quarter).sqrt());
    let sixteenth = eighth / (1.0 + (1.0 + sine * eighth * eighth).sqrt());
    let s = sine * sixteenth * sixteenth;
    let series = 1.0 - s * (1.0 / 3.0 - s * (1.0 / 5.0 - s * (1.0 / 7.0 - s * (1.0 / 9.0 - s * (1.0 / 11.0)))));
    axis * (16.0 * sixteenth * series)
}

/// The world-space inverse inertia of `body` times `v`.
pub(crate) fn inverse_inertia_times(body: &SolverBody, v: Vec3) -> Vec3 {
    let [xx, yy, zz] = body.inverse_inertia_diagonal;
    let [xy, xz, yz] = body.inverse_inertia_off;
    Vec3::new(xx * v.x + xy * v.y + xz * v.z, xy * v.x + yy * v.y + yz * v.z, xz * v.x + yz * v.y + zz * v.z)
}
