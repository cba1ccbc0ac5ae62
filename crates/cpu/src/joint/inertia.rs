//! The inertia of bodies with the geometric stiffness of their joints. Twin of `shaders/joint/inertia.wgsl`.

use super::rows::Body;
use crate::math::{free, held_inverse_inertia, rotate, vec3};
use glam::{Mat3, Quat, Vec3};
use tumble_core::layout::{BodyProps, Joint, SolverBody, locks};

/// Share of the geometric stiffness that joints add to the inertia.
pub const STIFFENING: f32 = 2.0;

impl Body {
    /// The solver's body with this inertia. What contacts will add again to its angular velocity is what their torques do
    /// to the new inertia: that of a light body may have changed a hundredfold.
    pub fn put_inertia(&self, body: &mut SolverBody) {
        let before = unheld(inverse_inertia_of(body));
        let carried = vec3(body.angular_velocity) - vec3(body.angular_start);
        if before.determinant() > 0.0 && carried != Vec3::ZERO {
            let carried = self.inverse_inertia * (before.inverse() * carried);
            body.angular_start = (vec3(body.angular_velocity) - carried).to_array();
        }
        let i = self.inverse_inertia;
        body.inverse_inertia_diagonal = [i.x_axis.x, i.y_axis.y, i.z_axis.z];
        body.inverse_inertia_off = [i.x_axis.y, i.x_axis.z, i.y_axis.z];
    }
}

/// As the solver has it.
pub fn inverse_inertia_of(body: &SolverBody) -> Mat3 {
    let [xx, yy, zz] = body.inverse_inertia_diagonal;
    let [xy, xz, yz] = body.inverse_inertia_off;
    Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
}

/// The matrix with ones on the diagonal for rows and columns that are zero: what is held about an axis can be inverted.
fn unheld(mut m: Mat3) -> Mat3 {
    for axis in 0..3 {
        let moment = &mut m.col_mut(axis)[axis];
        *moment = if *moment == 0.0 { 1.0 } else { *moment };
    }
    m
}

/// Geometric stiffness of a joint at one of its bodies, as inertia over a sub-step: what a force at an arm does when the
/// arm turns.
pub fn stiffening(arm: Vec3, impulse: Vec3, h: f32) -> Mat3 {
    let (pull, square) = (arm.dot(impulse), arm.dot(arm));
    if pull <= 0.0 || square == 0.0 {
        return Mat3::ZERO;
    }
    let outer = Mat3::from_cols(arm * arm.x, arm * arm.y, arm * arm.z);
    (Mat3::IDENTITY - outer * (1.0 / square)) * (STIFFENING * h * pull)
}

/// The inertia of a body in the world with that of all its joints, inverted; zero where nothing turns it. Of one that is
/// held about axes, the rows and columns of the others alone are inverted.
pub fn inverse_inertia(rotation: Quat, props: &BodyProps, stiffening: Mat3) -> Mat3 {
    let r = Mat3::from_quat(rotation);
    if props.locked & locks::ROTATIONS != 0 {
        let free = free(props.locked, locks::FIRST_ROTATION);
        if stiffening == Mat3::ZERO {
            let [d, o] = held_inverse_inertia(rotation, vec3(props.inertia), free);
            return Mat3::from_cols_array(&[d.x, o.x, o.y, o.x, d.y, o.z, o.y, o.z, d.z]);
        }
        let left =
            |m: Mat3| Mat3::from_cols(free * m.x_axis * free.x, free * m.y_axis * free.y, free * m.z_axis * free.z);
        let inertia = r * Mat3::from_diagonal(vec3(props.inertia)) * r.transpose() + stiffening;
        return left(unheld(left(inertia)).inverse());
    }
    let i = if stiffening == Mat3::ZERO || vec3(props.inverse_inertia) == Vec3::ZERO {
        r * Mat3::from_diagonal(vec3(props.inverse_inertia)) * r.transpose()
    } else {
        (r * Mat3::from_diagonal(vec3(props.inertia)) * r.transpose() + stiffening).inverse()
    };
    // As it is kept.
    let (xy, xz, yz) = (i.x_axis.y, i.x_axis.z, i.y_axis.z);
    Mat3::from_cols_array(&[i.x_axis.x, xy, xz, xy, i.y_axis.y, yz, xz, yz, i.z_axis.z])
}

/// The arm of a joint at a body, from its centre of mass to its own anchor, m.
pub fn own_arm(joint: &Joint, second: bool, rotation: Quat) -> Vec3 {
    rotate(rotation, vec3(if second { joint.anchor_b } else { joint.anchor_a }))
}
