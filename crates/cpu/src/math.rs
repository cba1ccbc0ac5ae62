//! A few words of geometry in the order of operations that the shaders use (`shaders/shared/math.wgsl`).

use glam::{Mat3, Quat, Vec3};
pub(crate) use tumble_core::layout::tangents;
use tumble_core::layout::{SolverBody, touched};

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
pub(crate) fn scaled_axis(q: Quat) -> Vec3 {
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

/// What is left of `v` where none of three bits is set, `first` being the lowest; zero elsewhere, whatever `v` is.
pub(crate) fn unlocked(v: Vec3, word: u32, first: u32) -> Vec3 {
    let left = |axis: u32, x: f32| if word >> (first + axis) & 1 == 0 { x } else { 0.0 };
    Vec3::new(left(0, v.x), left(1, v.y), left(2, v.z))
}

/// Three bits, `first` being the lowest: 1 where they are not set.
pub(crate) fn free(word: u32, first: u32) -> Vec3 {
    unlocked(Vec3::ONE, word, first)
}

/// Whether the body does not move along some axis.
pub(crate) fn is_locked(body: &SolverBody) -> bool {
    body.touched >> touched::FIRST_LOCK != 0
}

/// What is left of a push on the body where axes are locked.
pub(crate) fn along_free(body: &SolverBody, push: Vec3) -> Vec3 {
    if is_locked(body) { unlocked(push, body.touched, touched::FIRST_LOCK) } else { push }
}

/// The inverse of the inertia of a body that is held about the locked axes of the world, from its principal moments: that
/// of the rows and columns that are left, the others zero. `free` is 0 for those and 1 for the others. Diagonal (xx, yy,
/// zz) and what is off it (xy, xz, yz).
pub(crate) fn held_inverse_inertia(rotation: Quat, inertia: Vec3, free: Vec3) -> [Vec3; 2] {
    // Over the largest moment, so that no product leaves the range of floats.
    let largest = inertia.max_element();
    let r = Mat3::from_quat(rotation);
    let i = inertia / largest;
    let entry = |row: usize, column: usize| {
        r.x_axis[row] * i.x * r.x_axis[column]
            + r.y_axis[row] * i.y * r.y_axis[column]
            + r.z_axis[row] * i.z * r.z_axis[column]
    };
    // A locked axis has a moment of its own, and no product with the others.
    let own = |axis: usize| if free[axis] > 0.0 { entry(axis, axis) } else { 1.0 };
    let d = Vec3::new(own(0), own(1), own(2));
    let products = Vec3::new(entry(0, 1), entry(0, 2), entry(1, 2));
    let o = products * Vec3::new(free.x, free.x, free.y) * Vec3::new(free.y, free.z, free.z);
    let diagonal = Vec3::new(d.y * d.z - o.z * o.z, d.x * d.z - o.y * o.y, d.x * d.y - o.x * o.x);
    let off = Vec3::new(o.y * o.z - o.x * d.z, o.x * o.z - o.y * d.y, o.x * o.y - o.z * d.x);
    let scale = 1.0 / ((d.x * diagonal.x + o.x * off.x + o.y * off.y) * largest);
    [diagonal * free * scale, off * scale]
}

/// The world-space inverse inertia of `body` times `v`.
pub(crate) fn inverse_inertia_times(body: &SolverBody, v: Vec3) -> Vec3 {
    symmetric_times([vec3(body.inverse_inertia_diagonal), vec3(body.inverse_inertia_off)], v)
}

/// The symmetric matrix with this diagonal (xx, yy, zz) and these entries off it (xy, xz, yz), times `v`.
pub(crate) fn symmetric_times([d, o]: [Vec3; 2], v: Vec3) -> Vec3 {
    Vec3::new(d.x * v.x + o.x * v.y + o.y * v.z, o.x * v.x + d.y * v.y + o.z * v.z, o.y * v.x + o.z * v.y + d.z * v.z)
}
