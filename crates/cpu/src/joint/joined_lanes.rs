//! What joints of batches in lanes are told in: symmetric matrices, rotations, and bodies between two joints, several at a time.

use crate::shared::Shared;
use crate::solver::lanes::BodyLanes;
use crate::solver::simd::{Lanes, V3};
use wide::f32x4;

/// A symmetric matrix of each.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Symmetric<L> {
    /// xx, yy, zz.
    pub(super) diagonal: V3<L>,
    /// xy, xz, yz.
    pub(super) off: V3<L>,
}

impl<L: Lanes> Symmetric<L> {
    #[inline(always)]
    pub(super) fn plus(self, o: Self) -> Self {
        Self { diagonal: self.diagonal + o.diagonal, off: self.off + o.off }
    }

    #[inline(always)]
    pub(super) fn times(self, v: V3<L>) -> V3<L> {
        let (d, o) = (self.diagonal, self.off);
        V3::new(d.x * v.x + o.x * v.y + o.y * v.z, o.x * v.x + d.y * v.y + o.z * v.z, o.y * v.x + o.z * v.y + d.z * v.z)
    }

    /// Cofactors, and the determinant.
    #[inline(always)]
    fn cofactors(self) -> (Self, L) {
        let (d, o) = (self.diagonal, self.off);
        let diagonal = V3::new(d.y * d.z - o.z * o.z, d.x * d.z - o.y * o.y, d.x * d.y - o.x * o.x);
        let off = V3::new(o.y * o.z - o.x * d.z, o.x * o.z - o.y * d.y, o.x * o.y - o.z * d.x);
        (Self { diagonal, off }, d.x * diagonal.x + o.x * off.x + o.y * off.y)
    }

    #[inline(always)]
    pub(super) fn inverse(self) -> Self {
        let (cofactors, determinant) = self.cofactors();
        let over = L::ONE / determinant;
        Self { diagonal: over * cofactors.diagonal, off: over * cofactors.off }
    }

    /// The inverse times `v`, and where there is one.
    #[inline(always)]
    pub(super) fn solve(self, v: V3<L>) -> (V3<L>, L) {
        let (cofactors, determinant) = self.cofactors();
        (cofactors.times(v) / determinant, determinant.simd_gt(L::ZERO))
    }

    /// Where the mask is set this, elsewhere the other.
    #[inline(always)]
    pub(super) fn where_set(self, mask: L, o: Self) -> Self {
        Self { diagonal: choose(mask, self.diagonal, o.diagonal), off: choose(mask, self.off, o.off) }
    }

    /// Turned from a body's principal frame, of which these are the axes.
    #[inline(always)]
    pub(super) fn of_axes(axes: [V3<L>; 3], d: V3<L>) -> Self {
        let [x, y, z] = axes;
        let (dx, dy, dz) = (d.x * x, d.y * y, d.z * z);
        Self {
            diagonal: V3::new(
                dx.x * x.x + dy.x * y.x + dz.x * z.x,
                dx.y * x.y + dy.y * y.y + dz.y * z.y,
                dx.z * x.z + dy.z * y.z + dz.z * z.z,
            ),
            off: V3::new(
                dx.x * x.y + dy.x * y.y + dz.x * z.y,
                dx.x * x.z + dy.x * y.z + dz.x * z.z,
                dx.y * x.z + dy.y * y.z + dz.y * z.z,
            ),
        }
    }
}

/// Where the mask is set the first, elsewhere the second.
#[inline(always)]
pub(super) fn choose<L: Lanes>(mask: L, a: V3<L>, b: V3<L>) -> V3<L> {
    V3::new(mask.bitselect(a.x, b.x), mask.bitselect(a.y, b.y), mask.bitselect(a.z, b.z))
}

#[inline(always)]
pub(super) fn length<L: Lanes>(v: V3<L>) -> L {
    v.dot(v).sqrt()
}

/// Quaternions x y z w.
#[inline(always)]
pub(super) fn product<L: Lanes>([ax, ay, az, aw]: [L; 4], [bx, by, bz, bw]: [L; 4]) -> [L; 4] {
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

#[inline(always)]
pub(super) fn normalized<L: Lanes>([x, y, z, w]: [L; 4]) -> [L; 4] {
    let over = L::ONE / (x * x + y * y + z * z + w * w).sqrt();
    [over * x, over * y, over * z, over * w]
}

#[inline(always)]
pub(super) fn rotate<L: Lanes>([x, y, z, w]: [L; 4], v: V3<L>) -> V3<L> {
    let b = V3::new(x, y, z);
    let t = L::splat(2.0) * b.cross(v);
    v + w * t + b.cross(t)
}

/// The axes of a rotation.
#[inline(always)]
pub(super) fn axes<L: Lanes>([x, y, z, w]: [L; 4]) -> [V3<L>; 3] {
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, xy, xz) = (x * x2, x * y2, x * z2);
    let (yy, yz, zz) = (y * y2, y * z2, z * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    [
        V3::new(L::ONE - (yy + zz), xy + wz, xz - wy),
        V3::new(xy - wz, L::ONE - (xx + zz), yz + wx),
        V3::new(xz + wy, yz - wx, L::ONE - (xx + yy)),
    ]
}

/// A body of each joint, and the velocities that it came with.
pub(super) struct Held<L: Lanes> {
    index: L::Indices,
    pub(super) body: BodyLanes<L>,
    before: [V3<L>; 2],
    /// 1/kg along each axis.
    pub(super) inverse_masses: V3<L>,
}

impl<L: Lanes> Held<L> {
    /// Loads bodies; without their change of pose when `moved` is false.
    ///
    /// # Safety
    /// No other thread writes any of them meanwhile.
    #[inline(always)]
    pub(super) unsafe fn gather(bodies: &Shared<'_, f32x4>, index: L::Indices, moved: bool) -> Self {
        // SAFETY: the caller's promise.
        let body = BodyLanes::gather(|i| unsafe { bodies.chunk(i) }, index, moved);
        let mass = body.inverse_mass;
        let inverse_masses = body.along_free(V3::new(mass, mass, mass));
        Self { index, body, before: [body.linear, body.angular], inverse_masses }
    }

    /// The two bodies of each joint, as [`Held::gather`].
    ///
    /// # Safety
    /// As for that.
    #[inline(always)]
    pub(super) unsafe fn gather_both(bodies: &Shared<'_, f32x4>, [a, b]: [L::Indices; 2], moved: bool) -> [Self; 2] {
        // SAFETY: the caller's promise.
        unsafe { [Self::gather(bodies, a, moved), Self::gather(bodies, b, moved)] }
    }

    /// Stores both, as [`Held::put`].
    ///
    /// # Safety
    /// As for that.
    #[inline(always)]
    pub(super) unsafe fn put_both(bodies: &Shared<'_, f32x4>, a: Self, b: Self) {
        // SAFETY: the caller's promise.
        unsafe { a.put(bodies) };
        // SAFETY: the caller's promise.
        unsafe { b.put(bodies) };
    }

    #[inline(always)]
    pub(super) fn inertia(&self) -> Symmetric<L> {
        Symmetric { diagonal: self.body.inertia_diagonal, off: self.body.inertia_off }
    }

    /// Gives it an impulse and a turn; `sign` is -1 for the first body of a joint.
    #[inline(always)]
    pub(super) fn push(&mut self, sign: f32, impulse: V3<L>, turn: V3<L>) {
        let (sign, m) = (L::splat(sign), self.inverse_masses);
        let along = V3::new(m.x * impulse.x, m.y * impulse.y, m.z * impulse.z);
        self.body.linear = self.body.linear + sign * along;
        self.body.angular = self.body.angular + sign * self.body.inverse_inertia_times(turn);
    }

    /// Stores the velocities; what joints add to them is no load of contacts.
    ///
    /// # Safety
    /// No other thread touches any of those bodies that can be pushed meanwhile.
    #[inline(always)]
    pub(super) unsafe fn put(self, bodies: &Shared<'_, f32x4>) {
        // SAFETY: the caller's promise.
        unsafe { self.body.scatter_with_start(bodies, self.index, self.before) };
    }
}
