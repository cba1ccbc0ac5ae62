//! Four constraints side by side, for the fast form of the visits (`soft_lanes`). The plain form is `soft`.

use crate::shared::Shared;
use std::ops::{Add, Mul, Sub};
use tumble_core::layout::{ConstraintHead, Impulse, ManifoldPoint};
use wide::f32x4;

/// Constraints side by side.
pub(crate) const LANES: usize = 4;

/// In place of a body where a group has fewer than four constraints.
pub(crate) const NO_BODY: u32 = u32::MAX;

/// Four vectors.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct V3 {
    pub(crate) x: f32x4,
    pub(crate) y: f32x4,
    pub(crate) z: f32x4,
}

impl V3 {
    pub(crate) fn new(x: f32x4, y: f32x4, z: f32x4) -> Self {
        Self { x, y, z }
    }
    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> f32x4 {
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

impl Mul<V3> for f32x4 {
    type Output = V3;
    #[inline(always)]
    fn mul(self, v: V3) -> V3 {
        V3::new(self * v.x, self * v.y, self * v.z)
    }
}

fn set(lanes: &mut f32x4, lane: usize, value: f32) {
    lanes.as_mut_array()[lane] = value;
}

/// One point of each of four constraints, with its impulse. Unused lanes are zero: they push nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PointLanes {
    pub(crate) anchor_a: V3,
    pub(crate) anchor_b: V3,
    pub(crate) adjusted_separation: f32x4,
    pub(crate) normal_mass: f32x4,
    pub(crate) tangent_mass: f32x4,
    pub(crate) approach: f32x4,
    pub(crate) max_impulse: f32x4,
    pub(crate) normal: f32x4,
    pub(crate) tangent: [f32x4; 2],
}

/// Four constraints of one batch.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ConstraintLanes {
    pub(crate) body_a: [u32; LANES],
    pub(crate) body_b: [u32; LANES],
    /// Points of the constraint that has most.
    pub(crate) count: usize,
    /// Points of each, as floats.
    pub(crate) counts: f32x4,
    /// From the centre of mass of a to that of b, when the points were found.
    pub(crate) between: V3,
    pub(crate) normal: V3,
    pub(crate) tangents: [V3; 2],
    pub(crate) friction: f32x4,
    pub(crate) restitution: f32x4,
    pub(crate) bias_rate: f32x4,
    pub(crate) mass_scale: f32x4,
    pub(crate) impulse_scale: f32x4,
    pub(crate) points: [PointLanes; 4],
}

impl ConstraintLanes {
    /// No constraint in any lane.
    pub(crate) fn empty() -> Self {
        Self { body_a: [NO_BODY; LANES], body_b: [NO_BODY; LANES], ..Self::default() }
    }

    /// Puts a constraint's head into a lane.
    pub(crate) fn set_head(&mut self, lane: usize, head: &ConstraintHead, between: [f32; 3]) {
        self.body_a[lane] = head.body_a;
        self.body_b[lane] = head.body_b;
        self.count = self.count.max(head.count as usize);
        set(&mut self.counts, lane, head.count as f32);
        self.between.set(lane, between);
        self.normal.set(lane, head.normal);
        set(&mut self.friction, lane, head.friction);
        set(&mut self.restitution, lane, head.restitution);
        set(&mut self.bias_rate, lane, head.bias_rate);
        set(&mut self.mass_scale, lane, head.mass_scale);
        set(&mut self.impulse_scale, lane, head.impulse_scale);
    }

    /// Puts a point with its impulse into a lane; masses and the other arm follow for all lanes at once.
    pub(crate) fn set_point(&mut self, lane: usize, point: usize, at: &ManifoldPoint, impulse: &Impulse) {
        let to = &mut self.points[point];
        to.anchor_a.set(lane, at.anchor);
        set(&mut to.adjusted_separation, lane, at.separation);
        set(&mut to.normal, lane, impulse.normal);
        set(&mut to.tangent[0], lane, impulse.tangent[0]);
        set(&mut to.tangent[1], lane, impulse.tangent[1]);
    }

    /// The accumulated impulse of one point of one lane.
    pub(crate) fn impulse(&self, lane: usize, point: usize) -> (f32, [f32; 2]) {
        let p = &self.points[point];
        let at = |l: &f32x4| l.as_array()[lane];
        (at(&p.normal), [at(&p.tangent[0]), at(&p.tangent[1])])
    }
}

/// Four bodies. Rows 0 and 1 of [`SolverBody`](tumble_core::layout::SolverBody) change in a visit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BodyLanes {
    pub(crate) linear: V3,
    pub(crate) inverse_mass: f32x4,
    pub(crate) angular: V3,
    /// The field beside the angular velocity, carried along.
    touched: f32x4,
    pub(crate) translation: V3,
    pub(crate) delta: [f32x4; 4],
    pub(crate) inertia_diagonal: V3,
    pub(crate) inertia_off: V3,
}

/// Number of `f32x4` that make one [`SolverBody`](tumble_core::layout::SolverBody).
const ROWS: usize = 6;

impl BodyLanes {
    /// Loads four bodies by `read`, which gives element i of the bodies seen as rows; without their change of pose when
    /// `moved` is false.
    #[inline(always)]
    pub(crate) fn gather(read: impl Fn(usize) -> f32x4, index: [u32; LANES], moved: bool) -> Self {
        let one = |i: u32, r: usize| if i == NO_BODY { f32x4::ZERO } else { read(ROWS * i as usize + r) };
        let row = |r: usize| f32x4::transpose([one(index[0], r), one(index[1], r), one(index[2], r), one(index[3], r)]);
        let [vx, vy, vz, inverse_mass] = row(0);
        let [wx, wy, wz, touched] = row(1);
        let zero = [f32x4::ZERO; 4];
        let ([tx, ty, tz, _], delta) = if moved { (row(2), row(3)) } else { (zero, zero) };
        let [dx, dy, dz, _] = row(4);
        let [ox, oy, oz, _] = row(5);
        Self {
            linear: V3::new(vx, vy, vz),
            inverse_mass,
            angular: V3::new(wx, wy, wz),
            touched,
            translation: V3::new(tx, ty, tz),
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
        let linear = f32x4::transpose([self.linear.x, self.linear.y, self.linear.z, self.inverse_mass]);
        let angular = f32x4::transpose([self.angular.x, self.angular.y, self.angular.z, self.touched]);
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
        let t = f32x4::splat(2.0) * b.cross(r);
        r + w * t + b.cross(t)
    }
}
