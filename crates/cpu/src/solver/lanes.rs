//! Constraints side by side, for the fast form of the visits (files called `_lanes`), as many as `simd` takes at once.

use super::push_lanes;
use super::resist::resists;
use super::simd::{Lanes, V3};
use super::store::Solved;
use crate::shared::Shared;
use tumble_core::layout::{ConstraintHead, Impulse, ManifoldPoint, SolverBody, StepParams, touched};
use wide::f32x4;

/// In place of a body where a group has fewer constraints.
pub(crate) const NO_BODY: u32 = u32::MAX;

fn set<L: Lanes>(lanes: &mut L, lane: usize, value: f32) {
    lanes.as_mut_array()[lane] = value;
}

/// One point of each constraint, with its impulse. Unused lanes are zero: they push nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PointLanes<L> {
    pub(crate) anchor: V3<L>,
    pub(crate) adjusted_separation: L,
    pub(crate) normal_mass: L,
    pub(crate) tangent_mass: L,
    pub(crate) approach: L,
    pub(crate) deviation: L,
    pub(crate) total: [L; 3],
    pub(crate) normal: L,
    pub(crate) tangent: [L; 2],
}

/// What the points of a constraint share.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct HeadLanes<L: Lanes> {
    pub(crate) body_a: L::Indices,
    pub(crate) body_b: L::Indices,
    /// Points of each, as floats.
    pub(crate) counts: L,
    /// From the centre of mass of a to that of b, when the points were found.
    pub(crate) between: V3<L>,
    pub(crate) normal: V3<L>,
    pub(crate) tangents: [V3<L>; 2],
    pub(crate) friction: L,
    pub(crate) restitution: L,
    pub(crate) bias_rate: L,
    pub(crate) mass_scale: L,
    pub(crate) impulse_scale: L,
    pub(crate) remembered: L,
    pub(crate) round_a: L,
    pub(crate) round_b: L,
    pub(crate) surface_velocity: [L; 2],
    /// Whether any of them resists rolling or twisting; what follows is only looked at if so.
    pub(crate) resists: bool,
    pub(crate) rolling_resistance: L,
    pub(crate) twisting_resistance: L,
    pub(crate) rolling_inertia: L,
    pub(crate) twisting_inertia: L,
    pub(crate) resisted: [L; 3],
}

/// Constraints of one batch.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ConstraintLanes<L: Lanes> {
    pub(crate) head: HeadLanes<L>,
    /// Points of the constraint that has most.
    count: usize,
    points: [PointLanes<L>; 4],
}

impl<L: Lanes> ConstraintLanes<L> {
    /// No constraint in any lane.
    pub(crate) fn empty() -> Self {
        let mut empty = Self::default();
        empty.head.body_a.as_mut().fill(NO_BODY);
        empty.head.body_b.as_mut().fill(NO_BODY);
        empty
    }

    /// The head, and the points in use.
    #[inline(always)]
    pub(crate) fn split(&mut self) -> (&mut HeadLanes<L>, &mut [PointLanes<L>]) {
        (&mut self.head, &mut self.points[..self.count])
    }

    /// Puts a constraint's head into a lane.
    pub(crate) fn set_head(&mut self, lane: usize, from: &ConstraintHead, between: [f32; 3]) {
        self.count = self.count.max(from.count as usize);
        let head = &mut self.head;
        head.body_a.as_mut()[lane] = from.body_a;
        head.body_b.as_mut()[lane] = from.body_b;
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
    pub(crate) fn warm_start(&self, a: &mut BodyLanes<L>, b: &mut BodyLanes<L>) {
        push_lanes::warm_start(&self.head, &self.points[..self.count], a, b);
    }

    /// Bounces.
    #[inline(always)]
    pub(crate) fn bounce(&mut self, a: &mut BodyLanes<L>, b: &mut BodyLanes<L>, step: &StepParams) {
        let (head, points) = self.split();
        for p in points {
            push_lanes::bounce(head, p, a, b, step);
        }
    }

    /// The arms of one point.
    #[inline(always)]
    pub(crate) fn arms(&self, point: usize) -> [V3<L>; 2] {
        push_lanes::arms(&self.head, &self.points[point])
    }

    /// What the solver leaves of the constraint of one lane.
    pub(crate) fn solved(&self, lane: usize) -> Solved {
        let at = |l: &L| l.as_array()[lane];
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
pub(crate) struct Weights<L> {
    pub(crate) weight: L,
    pub(crate) weighted: L,
}

/// A body of each constraint. Rows 0 and 1 of [`SolverBody`] change in a visit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyLanes<L> {
    pub(crate) linear: V3<L>,
    pub(crate) inverse_mass: L,
    /// Whether any of them has a locked axis.
    locks: bool,
    pub(crate) angular: V3<L>,
    /// The field beside the angular velocity, as it was loaded.
    touched: L,
    pub(crate) translation: V3<L>,
    pub(crate) eigenvalue: L,
    pub(crate) delta: [L; 4],
    pub(crate) inertia_diagonal: V3<L>,
    pub(crate) inertia_off: V3<L>,
}

/// Number of `f32x4` that make one [`SolverBody`].
pub(crate) const ROWS: usize = size_of::<SolverBody>() / 16;
/// Row of the linear start with the weight; the next one has the angular start with what is weighted.
pub(crate) const START: usize = 6;

/// All of a body, in rows.
pub(crate) type BodyRows = [f32x4; ROWS];

/// Most lanes there are.
const MOST: usize = 8;

/// In place of the rows where there is no body.
static NO_ROWS: BodyRows = [f32x4::ZERO; ROWS];

/// Row `r` of each body, as its four numbers of all bodies.
#[inline(always)]
pub(crate) fn columns<L: Lanes>(read: &impl Fn(usize) -> f32x4, index: L::Indices, r: usize) -> [L; 4] {
    let mut rows = L::Rows::default();
    for (row, &i) in rows.as_mut().iter_mut().zip(index.as_ref()) {
        if i != NO_BODY {
            *row = read(ROWS * i as usize + r);
        }
    }
    L::columns(rows)
}

/// A body of each lane: looked up once for all its rows.
pub(crate) struct Places<'a>([&'a BodyRows; MOST]);

impl<'a> Places<'a> {
    #[inline(always)]
    pub(crate) fn new<L: Lanes>(body: impl Fn(usize) -> &'a BodyRows, index: L::Indices) -> Self {
        let mut places = [&NO_ROWS; MOST];
        for (place, &i) in places.iter_mut().zip(index.as_ref()) {
            if i != NO_BODY {
                *place = body(i as usize);
            }
        }
        Self(places)
    }

    /// Row `r` of each body, as its four numbers of all bodies.
    #[inline(always)]
    pub(crate) fn columns<L: Lanes>(&self, r: usize) -> [L; 4] {
        let mut rows = L::Rows::default();
        for (row, place) in rows.as_mut().iter_mut().zip(&self.0) {
            *row = place[r];
        }
        L::columns(rows)
    }
}

/// Bodies of which any of these translations (`locks`) is locked.
#[inline(always)]
fn locked<L: Lanes>(touched: L, locks: u32) -> L {
    (touched & L::splat(f32::from_bits(locks << touched::FIRST_LOCK))).simd_gt(L::ZERO)
}

impl<L: Lanes> BodyLanes<L> {
    /// Loads bodies by `body`, which gives the rows of one; without their change of pose when `moved` is false.
    #[inline(always)]
    pub(crate) fn gather<'a>(body: impl Fn(usize) -> &'a BodyRows, index: L::Indices, moved: bool) -> Self {
        let (places, zero) = (Places::new::<L>(body, index), [L::ZERO; 4]);
        let [vx, vy, vz, inverse_mass] = places.columns(0);
        let [wx, wy, wz, touched] = places.columns(1);
        let [tx, ty, tz, eigenvalue] = if moved { places.columns(2) } else { zero };
        let delta = if moved { places.columns(3) } else { zero };
        let [dx, dy, dz, _] = places.columns(4);
        let [ox, oy, oz, _] = places.columns(5);
        Self {
            linear: V3::new(vx, vy, vz),
            inverse_mass,
            locks: locked::<L>(touched, 7).any(),
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
    pub(crate) unsafe fn scatter(self, bodies: &Shared<'_, f32x4>, index: L::Indices) {
        let linear = L::rows([self.linear.x, self.linear.y, self.linear.z, self.inverse_mass]);
        let angular = L::rows([self.angular.x, self.angular.y, self.angular.z, self.touched]);
        for (lane, &body) in index.as_ref().iter().enumerate() {
            if self.inverse_mass.as_array()[lane] > 0.0 {
                // SAFETY: the caller's promise.
                let rows: &mut BodyRows = unsafe { bodies.chunk_mut(body as usize) };
                (rows[0], rows[1]) = (linear.as_ref()[lane], angular.as_ref()[lane]);
            }
        }
    }

    /// Stores the velocities as [`BodyLanes::scatter`], and counts by how much they are others than `before` to what the
    /// sub-step began with.
    ///
    /// # Safety
    /// As for that.
    #[inline(always)]
    pub(crate) unsafe fn scatter_with_start(
        self,
        bodies: &Shared<'_, f32x4>,
        index: L::Indices,
        [linear, angular]: [V3<L>; 2],
    ) {
        let (more, turn) = (self.linear - linear, self.angular - angular);
        let (more, turn) = (L::rows([more.x, more.y, more.z, L::ZERO]), L::rows([turn.x, turn.y, turn.z, L::ZERO]));
        let linear = L::rows([self.linear.x, self.linear.y, self.linear.z, self.inverse_mass]);
        let angular = L::rows([self.angular.x, self.angular.y, self.angular.z, self.touched]);
        for (lane, &body) in index.as_ref().iter().enumerate() {
            if self.inverse_mass.as_array()[lane] > 0.0 {
                // SAFETY: the caller's promise.
                let rows: &mut BodyRows = unsafe { bodies.chunk_mut(body as usize) };
                (rows[0], rows[1]) = (linear.as_ref()[lane], angular.as_ref()[lane]);
                rows[START] += more.as_ref()[lane];
                rows[START + 1] += turn.as_ref()[lane];
            }
        }
    }

    /// Adds to the weights of those that can be pushed.
    ///
    /// # Safety
    /// As for [`BodyLanes::scatter`].
    #[inline(always)]
    pub(crate) unsafe fn weigh(&self, bodies: &Shared<'_, f32x4>, index: L::Indices, weights: Weights<L>) {
        for (lane, &body) in index.as_ref().iter().enumerate() {
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
    #[inline(always)]
    pub(crate) unsafe fn start_after(
        &self,
        bodies: &Shared<'_, f32x4>,
        index: L::Indices,
        sign: f32,
        r: V3<L>,
        push: V3<L>,
    ) {
        let linear = self.inverse_mass * self.along_free(push);
        let angular = self.inverse_inertia_times(r.cross(push));
        for (lane, &body) in index.as_ref().iter().enumerate() {
            if self.inverse_mass.as_array()[lane] > 0.0 {
                let row = ROWS * body as usize + START;
                for (row, change) in [(row, linear), (row + 1, angular)] {
                    let at = |v: L| sign * v.as_array()[lane];
                    // SAFETY: the caller's promise.
                    let start = unsafe { bodies.get(row) };
                    let more = f32x4::new([at(change.x), at(change.y), at(change.z), 0.0]);
                    // SAFETY: the caller's promise.
                    unsafe { bodies.set(row, start + more) };
                }
            }
        }
    }

    /// What is left of a push where axes are locked.
    #[inline(always)]
    pub(crate) fn along_free(&self, push: V3<L>) -> V3<L> {
        if !self.locks {
            return push;
        }
        let along = |axis: u32, push: L| !locked(self.touched, 1 << axis) & push;
        V3::new(along(0, push.x), along(1, push.y), along(2, push.z))
    }

    /// What `of_locked` gives for bodies with a locked axis, here or in `other`; `plain` for the others.
    #[inline(always)]
    pub(crate) fn if_locked(&self, other: &Self, plain: L, of_locked: impl FnOnce() -> L) -> L {
        if !self.locks && !other.locks {
            return plain;
        }
        (locked(self.touched, 7) | locked(other.touched, 7)).bitselect(of_locked(), plain)
    }

    #[inline(always)]
    pub(crate) fn inverse_inertia_times(&self, v: V3<L>) -> V3<L> {
        let (d, o) = (self.inertia_diagonal, self.inertia_off);
        V3::new(d.x * v.x + o.x * v.y + o.y * v.z, o.x * v.x + d.y * v.y + o.z * v.z, o.y * v.x + o.z * v.y + d.z * v.z)
    }

    #[inline(always)]
    pub(crate) fn velocity_at(&self, r: V3<L>) -> V3<L> {
        self.linear + self.angular.cross(r)
    }

    /// `r` turned by the body's change of rotation.
    #[inline(always)]
    pub(crate) fn turned(&self, r: V3<L>) -> V3<L> {
        let [x, y, z, w] = self.delta;
        let b = V3::new(x, y, z);
        let t = L::splat(2.0) * b.cross(r);
        r + w * t + b.cross(t)
    }
}
