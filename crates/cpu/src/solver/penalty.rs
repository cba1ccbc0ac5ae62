//! The penalty method: a spring and a damper at each point that overlaps, pushing with what the sub-step began with, so
//! that neither points nor batches see what others did. Twin of `shaders/solver/penalty.wgsl`.

use super::jacobi::add_change;
use super::push::{apply, arms, count, relative_velocity, separation};
use crate::math::{finite, vec3};
use glam::Vec3;
use tumble_core::layout::{ConstraintHead, ConstraintPoint, Impulse, SolverBody};

/// One visit to one constraint. The head's `bias_rate` is the spring's, its `mass_scale` the share of the speed that
/// the damper takes; friction takes the same share, within the cone.
pub(super) fn visit(
    head: &ConstraintHead,
    [t1, t2]: [Vec3; 2],
    points: &mut [ConstraintPoint],
    impulses: &mut [Impulse],
    a: &mut SolverBody,
    b: &mut SolverBody,
) {
    let (mut after_a, mut after_b) = (*a, *b);
    let normal = vec3(head.normal);
    for (point, impulse) in points.iter_mut().zip(impulses) {
        let [ra, rb] = arms(head, point);
        let relative = relative_velocity(a, b, ra, rb);
        let velocity = normal.dot(relative);
        let separation = separation(head, point, a, b);
        let pull = head.bias_rate * separation + head.mass_scale * velocity;
        let sum = if separation < 0.0 { -point.normal_mass * pull } else { 0.0 };
        let press = sum.max(0.0);
        let damper = head.mass_scale * point.tangent_mass;
        let (mut x, mut y) = (-damper * t1.dot(relative), -damper * t2.dot(relative));
        let length = (x * x + y * y).sqrt();
        let most = head.friction * press;
        if length > most {
            let scale = most / length;
            x *= scale;
            y *= scale;
        }
        let push = press * normal + x * t1 + y * t2;
        // The sum too: the larger of NaN and zero is zero.
        let good = finite([sum; 3]) && finite(push.to_array());
        (impulse.normal, impulse.tangent) = if good { (press, [x, y]) } else { (0.0, [0.0; 2]) };
        if good {
            apply(&mut after_a, &mut after_b, ra, rb, push);
        }
        if good && press == 0.0 && point.total[0] == 0.0 {
            point.approach = point.approach.min(velocity);
        }
        count(point, impulse);
    }
    add_change(a, &after_a, 1.0);
    add_change(b, &after_b, 1.0);
}
