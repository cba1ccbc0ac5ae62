//! Constraints side by side, for the fast form of the visits (files called `_lanes`).
//!
//! Groups are as wide as what the program was built for computes at once: eight with AVX (`-C target-cpu=native`, or
//! `x86-64-v3`), else four. Lanes know nothing of each other, so the results are the same.

use super::push_lanes;
use super::resist::resists;
use super::store::Solved;
use crate::shared::Shared;
use std::ops::{Add, Mul, Sub};
use tumble_core::layout::{ConstraintHead, Impulse, ManifoldPoint, SolverBody, StepParams};
use wide::f32x4;

#[cfg(not(target_feature = "avx"))]
pub(crate) use wide::f32x4 as Lane;
#[cfg(target_feature = "avx")]
pub(crate) use wide::f32x8 as Lane;

/// Constraints side by side.
pub(crate) const LANES: usize = size_of::<Lane>() / size_of::<f32>();

/// In place of a body where a group has fewer constraints.
pub(crate) const NO_BODY: u32 = u32::MAX;

/// A vector of each.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct V3 {
    pub(crate) x: Lane,
    pub(crate) y: Lane,
    pub(crate) z: Lane,
}

impl V3 {
    pub(crate) fn new(x: Lane, y: Lane, z: Lane) -> Self {
        Self { x, y, z }
    }
    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> Lane {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
    #[inline(always)]
    pub(crate) fn cross(self, o: Self) -> Self {
        Self::new(self.y * o.z - o.y * self.z, self.z * o.x - o.z * self.x, self.x * o.y - o.x * self.y)
    }
    fn set(&mut self, lane: usize, v: [f32; 3]) {
        set(&mut self.x, lane, v[0]);
        set(&mut self.y, lane, v[1]);
        set(&mut self.z, lane, v[2]);
    }
}

impl Add for V3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl Sub for V3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl Mul<V3> for Lane {
    type Output = V3;
    #[inline(always)]
    fn mul(self, v: V3) -> V3 {
        V3::new(self * v.x, self * v.y, self * v.z)
    }
}

fn set(lanes: &mut Lane, lane: usize, value: f32) {
    lanes.as_mut_array()[lane] = value;
}

/// One point of each constraint, with its impulse. Unused lanes are zero: they push nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PointLanes {
    pub(crate) anchor: V3,
    pub(crate) adjusted_separation: Lane,
    pub(crate) normal_mass: Lane,
    pub(crate) tangent_mass: Lane,
    pub(crate) approach: Lane,
    pub(crate) deviation: Lane,
    pub(crate) total: [Lane; 3],
    pub(crate) normal: Lane,
    pub(crate) tangent: [Lane; 2],
}

/// What the points of a constraint share.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct HeadLanes {
    pub(crate) body_a: [u32; LANES],
    pub(crate) body_b: [u32; LANES],
    /// Points of each, as floats.
    pub(crate) counts: Lane,
    /// From the centre of mass of a to that of b, when the points were found.
    pub(crate) between: V3,
    pub(crate) normal: V3,
    pub(crate) tangents: [V3; 2],
    pub(crate) friction: Lane,
    pub(crate) restitution: Lane,
    pub(crate) bias_rate: Lane,
    pub(crate) mass_scale: Lane,
    pub(crate) impulse_scale: Lane,
    pub(crate) remembered: Lane,
    pub(crate) round_a: Lane,
    pub(crate) round_b: Lane,
    pub(crate) surface_velocity: [Lane; 2],
    /// Whether any of them resists rolling or twisting; what follows is only looked at if so.
    pub(crate) resists: bool,
    pub(crate) rolling_resistance: Lane,
    pub(crate) twisting_resistance: Lane,
    pub(crate) rolling_inertia: Lane,
    pub(crate) twisting_inertia: Lane,
    pub(crate) resisted: [Lane; 3],
}

/// Constraints of one batch.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ConstraintLanes {
    pub(crate) head: HeadLanes,
    /// Points of the constraint that has most.
    count: usize,
    points: [PointLanes; 4],
}

impl ConstraintLanes {
    /// No constraint in any lane.
    pub(crate) fn empty() -> Self {
        let head = HeadLanes { body_a: [NO_BODY; LANES], body_b: [NO_BODY; LANES], ..HeadLanes::default() };
        Self { head, ..Self::default() }
    }

    /// The head, and the points in use.
    #[inline(always)]
    pub(crate) fn split(&mut self) -> (&mut HeadLanes, &mut [PointLanes]) {
        (&mut self.head, &mut self.points[..self.count])
    }

    /// Puts a constraint's head into a lane.
    pub(crate) fn set_head(&mut self, lane: usize, from: &ConstraintHead, between: [f32; 3]) {
        self.count = self.count.max(from.count as usize);
        let head = &mut self.head;
        head.body_a[lane] = from.body_a;
        head.body_b[lane] = from.body_b;
        set(&mut head.counts, lane, from.count as f32);
        head.between.set(lane, between);
        head.normal.set(lane, from.normal);
        set(&mut head.friction, lane, from.friction);
        set(&mut head.restitution, lane, from.restitution);
        set(&mut head.bias_rate, lane, from.bias_rate);
        set(&mut head.mass_scale, lane, from.mass_scale);
        set(&mut head.impulse_scale, lane, from.impulse_scale);
        set(&mut head.remembered, lane, from.remembered);
        set(&mut head.round_a, lane, from.round_a);
        set(&mut head.round_b, lane, from.round_b);
        set(&mut head.surface_velocity[0], lane, from.surface_velocity[0]);
        set(&mut head.surface_velocity[1], lane, from.surface_velocity[1]);
        if resists(from) {
            head.resists = true;
            set(&mut head.rolling_resistance, lane, from.rolling_resistance);
            set(&mut head.twisting_resistance, lane, from.twisting_resistance);
            set(&mut head.rolling_inertia, lane, from.rolling_inertia);
            set(&mut head.twisting_inertia, lane, from.twisting_inertia);
            head.resisted.iter_mut().zip(from.resisted).for_each(|(to, from)| set(to, lane, from));
        }
    }

    /// Puts a point with what its slot remembers into a lane; masses and the other arm follow for all lanes at once.
    pub(crate) fn set_point(
        &mut self,
        lane: usize,
        point: usize,
        at: &ManifoldPoint,
        (impulse, deviation): (Impulse, f32),
    ) {
        let to = &mut self.points[point];
        to.anchor.set(lane, at.anchor);
        set(&mut to.adjusted_separation, lane, at.separation);
        set(&mut to.deviation, lane, deviation);
        set(&mut to.normal, lane, impulse.normal);
        set(&mut to.tangent[0], lane, impulse.tangent[0]);
        set(&mut to.tangent[1], lane, impulse.tangent[1]);
    }

    /// Applies the impulses of the last visit.
    #[inline(always)]
    pub(crate) fn warm_start(&self, a: &mut BodyLanes, b: &mut BodyLanes) {
        push_lanes::warm_start(&self.head, &self.points[..self.count], a, b);
    }

    /// Bounces.
    #[inline(always)]
    pub(crate) fn bounce(&mut self, a: &mut BodyLanes, b: &mut BodyLanes, step: &StepParams) {
        let (head, points) = self.split();
        for p in points {
            push_lanes::bounce(head, p, a, b, step);
        }
    }

    /// The arms of one point.
    pub(crate) fn arms(&self, point: usize) -> [V3; 2] {
        push_lanes::arms(&self.head, &self.points[point])
    }

    /// What the solver leaves of the constraint of one lane.
    pub(crate) fn solved(&self, lane: usize) -> Solved {
        let at = |l: &Lane| l.as_array()[lane];
        let points = &self.points;
        Solved {
            impulses: std::array::from_fn(|k| (at(&points[k].normal), points[k].tangent.each_ref().map(at))),
            totals: std::array::from_fn(|k| points[k].total.each_ref().map(at)),
            remembered: at(&self.head.remembered),
            resisted: self.head.resisted.each_ref().map(at),
            deviations: std::array::from_fn(|k| at(&points[k].deviation)),
        }
    }
}

/// What a constraint adds to a body's weights.
pub(crate) struct Weights {
    pub(crate) weight: Lane,
    pub(crate) weighted: Lane,
}

/// A body of each constraint. Rows 0 and 1 of [`SolverBody`] change in a visit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyLanes {
    pub(crate) linear: V3,
    pub(crate) inverse_mass: Lane,
    pub(crate) angular: V3,
    /// The field beside the angular velocity, carried along.
    touched: Lane,
    pub(crate) translation: V3,
    pub(crate) eigenvalue: Lane,
    pub(crate) delta: [Lane; 4],
    pub(crate) inertia_diagonal: V3,
    pub(crate) inertia_off: V3,
}

/// Number of `f32x4` that make one [`SolverBody`].
pub(crate) const ROWS: usize = size_of::<SolverBody>() / 16;
/// Row of the linear start with the weight; the next one has the angular start with what is weighted.
pub(crate) const START: usize = 6;

/// A row of each body, as its four numbers of all bodies.
#[cfg(not(target_feature = "avx"))]
#[inline(always)]
fn columns(rows: [f32x4; LANES]) -> [Lane; 4] {
    f32x4::transpose(rows)
}

/// The way back.
#[cfg(not(target_feature = "avx"))]
#[inline(always)]
fn rows(columns: [Lane; 4]) -> [f32x4; LANES] {
    f32x4::transpose(columns)
}

/// A row of each body, as its four numbers of all bodies.
#[cfg(target_feature = "avx")]
#[inline(always)]
fn columns([a, b, c, d, e, f, g, h]: [f32x4; LANES]) -> [Lane; 4] {
    let ([a, b, c, d], [e, f, g, h]) = (f32x4::transpose([a, b, c, d]), f32x4::transpose([e, f, g, h]));
    [bytemuck::cast([a, e]), bytemuck::cast([b, f]), bytemuck::cast([c, g]), bytemuck::cast([d, h])]
}

/// The way back.
#[cfg(target_feature = "avx")]
#[inline(always)]
fn rows([x, y, z, w]: [Lane; 4]) -> [f32x4; LANES] {
    let half = |column: Lane| -> [f32x4; 2] { bytemuck::cast(column) };
    let ([a, e], [b, f], [c, g], [d, h]) = (half(x), half(y), half(z), half(w));
    let ([a, b, c, d], [e, f, g, h]) = (f32x4::transpose([a, b, c, d]), f32x4::transpose([e, f, g, h]));
    [a, b, c, d, e, f, g, h]
}

impl BodyLanes {
    /// Loads bodies by `read`, which gives element i of the bodies seen as rows; without their change of pose when
    /// `moved` is false.
    #[inline(always)]
    pub(crate) fn gather(read: impl Fn(usize) -> f32x4, index: [u32; LANES], moved: bool) -> Self {
        let row = |r: usize| {
            let mut rows = [f32x4::ZERO; LANES];
            for (row, &i) in rows.iter_mut().zip(&index) {
                if i != NO_BODY {
                    *row = read(ROWS * i as usize + r);
                }
            }
            columns(rows)
        };
        let [vx, vy, vz, inverse_mass] = row(0);
        let [wx, wy, wz, touched] = row(1);
        let zero = [Lane::ZERO; 4];
        let ([tx, ty, tz, eigenvalue], delta) = if moved { (row(2), row(3)) } else { (zero, zero) };
        let [dx, dy, dz, _] = row(4);
        let [ox, oy, oz, _] = row(5);
        Self {
            linear: V3::new(vx, vy, vz),
            inverse_mass,
            angular: V3::new(wx, wy, wz),
            touched,
            translation: V3::new(tx, ty, tz),
            eigenvalue,
            delta,
            inertia_diagonal: V3::new(dx, dy, dz),
            inertia_off: V3::new(ox, oy, oz),
        }
    }

    /// Stores the velocities of those that can be pushed.
    ///
    /// # Safety
    /// No other thread touches any of those bodies meanwhile.
    #[inline(always)]
    pub(crate) unsafe fn scatter(self, bodies: &Shared<'_, f32x4>, index: [u32; LANES]) {
        let linear = rows([self.linear.x, self.linear.y, self.linear.z, self.inverse_mass]);
        let angular = rows([self.angular.x, self.angular.y, self.angular.z, self.touched]);
        for lane in 0..LANES {
            if self.inverse_mass.as_array()[lane] > 0.0 {
                let row = ROWS * index[lane] as usize;
                // SAFETY: the caller's promise.
                unsafe { bodies.set(row, linear[lane]) };
                // SAFETY: the caller's promise.
                unsafe { bodies.set(row + 1, angular[lane]) };
            }
        }
    }

    /// Adds to the weights of those that can be pushed.
    ///
    /// # Safety
    /// As for [`BodyLanes::scatter`].
    #[inline(always)]
    pub(crate) unsafe fn weigh(&self, bodies: &Shared<'_, f32x4>, index: [u32; LANES], weights: Weights) {
        for (lane, body) in index.into_iter().enumerate() {
            if self.inverse_mass.as_array()[lane] > 0.0 {
                let row = ROWS * body as usize + START;
                for (row, more) in [(row, weights.weight), (row + 1, weights.weighted)] {
                    // SAFETY: the caller's promise.
                    let mut start = unsafe { bodies.get(row) };
                    start.as_mut_array()[3] += more.as_array()[lane];
                    // SAFETY: the caller's promise.
                    unsafe { bodies.set(row, start) };
                }
            }
        }
    }

    /// Counts what `push` at `r` does to those that can be pushed to what the sub-step began with; `sign` is -1 for the
    /// first body of a pair.
    ///
    /// # Safety
    /// As for [`BodyLanes::scatter`].
    pub(crate) unsafe fn start_after(
        &self,
        bodies: &Shared<'_, f32x4>,
        index: [u32; LANES],
        sign: f32,
        r: V3,
        push: V3,
    ) {
        let linear = self.inverse_mass * push;
        let angular = self.inverse_inertia_times(r.cross(push));
        for (lane, body) in index.into_iter().enumerate() {
            if self.inverse_mass.as_array()[lane] > 0.0 {
                let row = ROWS * body as usize + START;
                for (row, change) in [(row, linear), (row + 1, angular)] {
                    let at = |v: Lane| sign * v.as_array()[lane];
                    // SAFETY: the caller's promise.
                    let start = unsafe { bodies.get(row) };
                    let more = f32x4::new([at(change.x), at(change.y), at(change.z), 0.0]);
                    // SAFETY: the caller's promise.
                    unsafe { bodies.set(row, start + more) };
                }
            }
        }
    }

    #[inline(always)]
    pub(crate) fn inverse_inertia_times(&self, v: V3) -> V3 {
        let (d, o) = (self.inertia_diagonal, self.inertia_off);
        V3::new(d.x * v.x + o.x * v.y + o.y * v.z, o.x * v.x + d.y * v.y + o.z * v.z, o.y * v.x + o.z * v.y + d.z * v.z)
    }

    #[inline(always)]
    pub(crate) fn velocity_at(&self, r: V3) -> V3 {
        self.linear + self.angular.cross(r)
    }

    /// `r` turned by the body's change of rotation.
    #[inline(always)]
    pub(crate) fn turned(&self, r: V3) -> V3 {
        let [x, y, z, w] = self.delta;
        let b = V3::new(x, y, z);
        let t = Lane::splat(2.0) * b.cross(r);
        r + w * t + b.cross(t)
    }
}
