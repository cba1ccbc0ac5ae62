//! Builds the step's solver bodies and constraint rows. Twin of `shaders/solver/prepare.wgsl`.

use super::PlainConstraint;
use super::resist::resists;
use super::split;
use crate::bounds::moves;
use crate::contact::NO_FEATURE;
use crate::math::{
    along_free, free, held_inverse_inertia, inverse_inertia_times, is_locked, quat, rotate, tangents, unlocked, vec3,
};
use bytemuck::Zeroable;
use glam::{Mat3, Vec3};
use tumble_core::layout::{
    BodyProps, BodyState, Collider, ConstraintHead, ConstraintPoint, Impulse, Manifold, ManifoldMemory, Pair,
    SolverBody, StepParams, locks, pair_kind, shape_kind, solver, touched,
};

/// A body as the solver moves it; what nothing may push has no mass and keeps its velocity.
pub fn prepare_body(state: &BodyState, props: &BodyProps, mask: u64, step: &StepParams) -> SolverBody {
    let mut body = SolverBody {
        linear_velocity: state.linear_velocity,
        inverse_mass: 0.0,
        angular_velocity: state.angular_velocity,
        touched: if mask != 0 { touched::CONTACT } else { 0 },
        translation: [0.0; 3],
        eigenvalue: state.eigenvalue,
        delta: [0.0, 0.0, 0.0, 1.0],
        inverse_inertia_diagonal: [0.0; 3],
        level: step.level_of(state.credit),
        inverse_inertia_off: [0.0; 3],
        parts: 0,
        linear_start: [0.0; 3],
        weight: 0.0,
        angular_start: [0.0; 3],
        weighted: 0.0,
    };
    if moves(state.flags) {
        body.inverse_mass = props.inverse_mass;
        // R diag(i) R^T, six of nine.
        let r = Mat3::from_quat(quat(state.rotation));
        let i = props.inverse_inertia;
        let entry = |row: usize, column: usize| {
            r.x_axis[row] * i[0] * r.x_axis[column]
                + r.y_axis[row] * i[1] * r.y_axis[column]
                + r.z_axis[row] * i[2] * r.z_axis[column]
        };
        body.inverse_inertia_diagonal = [entry(0, 0), entry(1, 1), entry(2, 2)];
        body.inverse_inertia_off = [entry(0, 1), entry(0, 2), entry(1, 2)];
        if props.locked != 0 {
            lock(&mut body, state, props);
        }
    }
    body
}

/// Neither velocity nor response along and about the locked axes.
fn lock(body: &mut SolverBody, state: &BodyState, props: &BodyProps) {
    body.touched |= (props.locked & locks::TRANSLATIONS) << touched::FIRST_LOCK;
    let turns = free(props.locked, locks::FIRST_ROTATION);
    body.linear_velocity = unlocked(vec3(body.linear_velocity), props.locked, 0).to_array();
    body.angular_velocity = unlocked(vec3(body.angular_velocity), props.locked, locks::FIRST_ROTATION).to_array();
    if props.locked & locks::ROTATIONS != 0 {
        let [diagonal, off] = held_inverse_inertia(quat(state.rotation), vec3(props.inertia), turns);
        body.inverse_inertia_diagonal = diagonal.to_array();
        body.inverse_inertia_off = off.to_array();
    }
}

/// What the rows of one constraint are made of.
pub struct Contact<'a> {
    /// The pair with its slot.
    pub pair: &'a Pair,
    /// Its points.
    pub manifold: &'a Manifold,
    /// Impulses that the slot remembers.
    pub stored: &'a [Impulse],
    /// What it remembers of the manifold as a whole.
    pub memory: &'a ManifoldMemory,
    /// What the impulses are scaled by, see [`scale`].
    pub scale: f32,
    /// Whether it works on parts of its bodies, see `split`.
    pub split: bool,
}

impl Contact<'_> {
    /// What it works on: these bodies, or its parts of them.
    fn bodies(&self, slots: [u32; 2], bodies: &[SolverBody]) -> [SolverBody; 2] {
        slots.map(|slot| {
            let body = &bodies[slot as usize];
            if self.split { split::part(body) } else { *body }
        })
    }
}

/// The level of sub-steps of a constraint: bodies of one island have the same.
pub fn level(a: &SolverBody, b: &SolverBody) -> u32 {
    if a.inverse_mass > 0.0 { a.level } else { b.level }
}

/// Length of this step's sub-steps over that of those that the impulses between two bodies are from.
pub fn scale(a: &BodyState, b: &BodyState, h: f32) -> f32 {
    let was = a.h.max(b.h);
    if was == h || was == 0.0 { 1.0 } else { h / was }
}

/// One constraint's head, points and impulses.
pub fn prepare_constraint(
    contact: &Contact<'_>,
    colliders: &[Collider],
    bodies: &[SolverBody],
    states: &[BodyState],
    step: &StepParams,
) -> PlainConstraint {
    let manifold = contact.manifold;
    let head = prepare_head(contact, colliders, bodies, states, step);
    let [a, b] = &contact.bodies([head.body_a, head.body_b], bodies);
    let mut points = [ConstraintPoint::zeroed(); 4];
    let mut impulses = [Impulse { normal: 0.0, tangent: [0.0; 2], feature: NO_FEATURE }; 4];
    let normal = vec3(manifold.normal);
    let (t1, t2) = tangents(normal);
    let between = vec3(manifold.between);
    for i in 0..manifold.count as usize {
        let ra = vec3(manifold.points[i].anchor);
        let rb = ra - between;
        let along = |u: Vec3, v: Vec3| response(a, b, ra, rb, u, v);
        let (k11, k12, k22) = (along(t1, t1), along(t1, t2), along(t2, t2));
        // The stiffest direction's mass serves all: friction stays isotropic and never overshoots.
        let stiffest = 0.5 * (k11 + k22) + (0.25 * (k11 - k22) * (k11 - k22) + k12 * k12).sqrt();
        let dv = point_velocity(b, rb) - point_velocity(a, ra);
        points[i] = ConstraintPoint {
            anchor: ra.to_array(),
            adjusted_separation: manifold.points[i].separation - (normal.dot(rb - ra) - (head.round_b - head.round_a)),
            normal_mass: inverse(along(normal, normal)),
            tangent_mass: inverse(stiffest),
            approach: normal.dot(dv),
            deviation: 0.0,
            total: [0.0; 3],
            pad_b: 0,
        };
        (impulses[i], points[i].deviation) = carry(contact, i);
    }
    (head, points, impulses)
}

/// What the points of a constraint share.
pub(super) fn prepare_head(
    contact: &Contact<'_>,
    colliders: &[Collider],
    bodies: &[SolverBody],
    states: &[BodyState],
    step: &StepParams,
) -> ConstraintHead {
    let (pair, manifold) = (contact.pair, contact.manifold);
    let (ca, cb) = (&colliders[pair.a as usize], &colliders[pair.b as usize]);
    let soft = bodies[ca.body as usize].inverse_mass > 0.0 && bodies[cb.body as usize].inverse_mass > 0.0;
    let (bias_rate, mass_scale, impulse_scale) = if soft {
        (step.bias_rate, step.mass_scale, step.impulse_scale)
    } else {
        (step.static_bias_rate, step.static_mass_scale, step.static_impulse_scale)
    };
    let mut head = ConstraintHead {
        normal: manifold.normal,
        friction: combined(ca.combine & 3, cb.combine & 3, ca.friction, cb.friction),
        body_a: ca.body,
        body_b: cb.body,
        slot: pair.slot,
        count: manifold.count,
        restitution: combined(ca.combine >> 2 & 3, cb.combine >> 2 & 3, ca.restitution, cb.restitution),
        bias_rate,
        mass_scale,
        impulse_scale,
        remembered: remembered(contact),
        round_a: round(ca, manifold),
        round_b: -round(cb, manifold),
        between: manifold.between,
        level: level(&bodies[ca.body as usize], &bodies[cb.body as usize]),
        ..ConstraintHead::zeroed()
    };
    head.rolling_resistance = ca.rolling_resistance.max(cb.rolling_resistance);
    head.twisting_resistance = ca.twisting_resistance.max(cb.twisting_resistance);
    if resists(&head) {
        let lever = lever(ca, cb);
        head.rolling_resistance *= lever;
        head.twisting_resistance *= lever;
        let [a, b] = &contact.bodies([ca.body, cb.body], bodies);
        let normal = vec3(manifold.normal);
        let (t1, t2) = tangents(normal);
        let about = |u: Vec3, v: Vec3| v.dot(inverse_inertia_times(a, u) + inverse_inertia_times(b, u));
        let (k11, k12, k22) = (about(t1, t1), about(t1, t2), about(t2, t2));
        // As for friction: isotropic, and never too far.
        let slightest = 0.5 * (k11 + k22) + (0.25 * (k11 - k22) * (k11 - k22) + k12 * k12).sqrt();
        head.rolling_inertia = inverse(slightest);
        head.twisting_inertia = inverse(about(normal, normal));
        // Solvers that do not resist must not go on with what others left.
        let none = is_fresh(contact) || step.solver > solver::SOFT;
        head.resisted = if none { [0.0; 3] } else { contact.memory.resisted.map(|r| contact.scale * r) };
    }
    if ca.surface_velocity != [0.0; 3] || cb.surface_velocity != [0.0; 3] {
        let (t1, t2) = tangents(vec3(manifold.normal));
        let of = |c: &Collider| rotate(quat(states[c.body as usize].rotation), vec3(c.surface_velocity));
        let velocity = of(cb) - of(ca);
        head.surface_velocity = [t1.dot(velocity), t2.dot(velocity)];
    }
    head
}

/// More than any, m.
const NO_RADIUS: f32 = 1e30;

/// The radius that resistance is a share of: that of the smaller ball; where there is none, the smallest half extent.
fn lever(a: &Collider, b: &Collider) -> f32 {
    let ball = a.shape == shape_kind::BALL || b.shape == shape_kind::BALL;
    let of = |c: &Collider| match c.shape {
        shape_kind::BALL => c.size[0],
        shape_kind::CUBOID if !ball => c.size[0].min(c.size[1]).min(c.size[2]),
        _ => NO_RADIUS,
    };
    of(a).min(of(b))
}

/// Part of an arm that does not turn with its body: from the centre of a ball to midway between the surfaces, m.
fn round(collider: &Collider, manifold: &Manifold) -> f32 {
    if collider.shape == shape_kind::BALL { collider.size[0] + 0.5 * manifold.points[0].separation } else { 0.0 }
}

/// What the slot remembers, shared among the points; nothing where it had no contact.
fn remembered(contact: &Contact<'_>) -> f32 {
    if is_fresh(contact) { 0.0 } else { contact.scale * (contact.memory.remembered / contact.manifold.count as f32) }
}

/// Whether the slot had no contact of this pair before.
fn is_fresh(contact: &Contact<'_>) -> bool {
    contact.pair.kind & pair_kind::FRESH != 0 || contact.stored[0].feature == NO_FEATURE
}

/// What the slot remembers of a point whose feature stayed: its impulse, and what it bears more than the mean.
pub(super) fn carry(contact: &Contact<'_>, point: usize) -> (Impulse, f32) {
    let feature = contact.manifold.features[point];
    let fresh = contact.pair.kind & pair_kind::FRESH != 0;
    match contact.stored.iter().rposition(|s| !fresh && s.feature == feature) {
        Some(k) => {
            let stored = &contact.stored[k];
            let (normal, tangent) = (contact.scale * stored.normal, stored.tangent.map(|t| contact.scale * t));
            (Impulse { normal, tangent, feature }, contact.scale * contact.memory.deviations[k])
        }
        None => (Impulse { normal: 0.0, tangent: [0.0; 2], feature }, 0.0),
    }
}

/// Coefficient of two colliders by the stronger of their rules (`CombineRule`).
fn combined(rule_a: u32, rule_b: u32, a: f32, b: f32) -> f32 {
    match rule_a.max(rule_b) {
        0 => 0.5 * (a + b),
        1 => a.min(b),
        2 => a * b,
        _ => a.max(b),
    }
}

/// Change of relative velocity along `v` by a unit impulse along `u`.
fn response(a: &SolverBody, b: &SolverBody, ra: Vec3, rb: Vec3, u: Vec3, v: Vec3) -> f32 {
    let turn_a = inverse_inertia_times(a, ra.cross(u)).cross(ra);
    let turn_b = inverse_inertia_times(b, rb.cross(u)).cross(rb);
    let along = |body: &SolverBody| body.inverse_mass * along_free(body, u).dot(v);
    let moved =
        if is_locked(a) || is_locked(b) { along(a) + along(b) } else { (a.inverse_mass + b.inverse_mass) * u.dot(v) };
    moved + v.dot(turn_a + turn_b)
}

fn point_velocity(body: &SolverBody, r: Vec3) -> Vec3 {
    vec3(body.linear_velocity) + vec3(body.angular_velocity).cross(r)
}

fn inverse(x: f32) -> f32 {
    if x > 0.0 { 1.0 / x } else { 0.0 }
}
