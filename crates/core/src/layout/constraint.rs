use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// What the points of one constraint share. 112 bytes. Constraints lie in batch order.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ConstraintHead {
    /// From a to b, world axes, unit; held for the step.
    pub normal: [f32; 3],
    /// Combined Coulomb coefficient.
    pub friction: f32,
    /// First body.
    pub body_a: u32,
    /// Second body.
    pub body_b: u32,
    /// Where the impulses come from and go to.
    pub slot: u32,
    /// Points in use.
    pub count: u32,
    /// Combined restitution.
    pub restitution: f32,
    /// Spring: share of the overlap undone, 1/s.
    pub bias_rate: f32,
    /// Spring: factor on the mass.
    pub mass_scale: f32,
    /// Spring: share of the impulse that leaks.
    pub impulse_scale: f32,
    /// One pass: what the points bear in the long run, on the mean, N s. Follows their impulses.
    pub remembered: f32,
    /// Part of the first body's arm along the normal that does not turn with it, because it is a ball there, m.
    pub round_a: f32,
    /// The same of the second body's.
    pub round_b: f32,
    /// Largest rolling torque over normal force, m; 0 where nothing resists.
    pub rolling_resistance: f32,
    /// From the centre of mass of a to that of b when the points were found, world axes, m.
    pub between: [f32; 3],
    /// Largest torque about the normal over normal force, m; 0 where nothing resists.
    pub twisting_resistance: f32,
    /// Angular impulse against twisting (about the normal) and rolling (about the two tangents); lasts from step to
    /// step, N m s.
    pub resisted: [f32; 3],
    /// Inertia that rolling sees about its slightest axis, kg m²; 0 where nothing resists.
    pub rolling_inertia: f32,
    /// Velocity of b's surface against its body less that of a's, along the two tangents, m/s; held for the step.
    pub surface_velocity: [f32; 2],
    /// Inertia that twisting sees, kg m²; 0 where nothing resists.
    pub twisting_inertia: f32,
    /// Level of sub-steps, that of its moving bodies.
    pub level: u32,
}

/// One contact point as the solver sees it. 48 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct ConstraintPoint {
    /// From the centre of mass of a, world axes at the start of the step, m. Less [`ConstraintHead::between`], that is
    /// from the centre of mass of b.
    pub anchor: [f32; 3],
    /// Separation less the normal part of the arms' difference that turns with the bodies, so that the current one is this
    /// plus the moved arms' share, m.
    pub adjusted_separation: f32,
    /// Mass seen along the normal, kg.
    pub normal_mass: f32,
    /// Mass seen by friction in its stiffest direction, kg.
    pub tangent_mass: f32,
    /// Lowest normal velocity before the first push of the step, m/s.
    pub approach: f32,
    /// One pass: what this point bears in the long run more than the mean, N s.
    pub deviation: f32,
    /// All that was pushed in the step, along the normal and the two tangents, N s.
    pub total: [f32; 3],
    /// Unused.
    pub pad_b: u32,
}

/// Accumulated impulse of one point; lasts from step to step. 16 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Impulse {
    /// N s, never negative.
    pub normal: f32,
    /// Along the two tangents that [`tangents`] gives, N s.
    pub tangent: [f32; 2],
    /// Feature that it belongs to.
    pub feature: u32,
}

/// What a slot remembers of its manifold beside the impulses that carry over. 80 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
pub struct ManifoldMemory {
    /// Sum over the points of [`ConstraintHead::remembered`], N s. Means nothing where the slot has no contact.
    pub remembered: f32,
    /// [`ConstraintHead::resisted`].
    pub resisted: [f32; 3],
    /// [`ConstraintPoint::deviation`] of the points.
    pub deviations: [f32; 4],
    /// [`ConstraintPoint::total`] of the points in the last step.
    pub totals: [[f32; 3]; 4],
}

/// Two unit vectors that make a frame with `n`. They jump where |n.x| passes 0.577, far from the axes along which
/// contacts mostly lie, so that a resting contact keeps its frame.
pub fn tangents(n: Vec3) -> (Vec3, Vec3) {
    let t = if n.x.abs() < 0.577_350_3 { Vec3::new(0.0, n.z, -n.y) } else { Vec3::new(n.y, -n.x, 0.0) };
    let t = t.normalize();
    (t, n.cross(t))
}
