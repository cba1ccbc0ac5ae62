//! Matrices and rotations of islands side by side, in the order of operations that the plain form has, so that each lane
//! has its bits.

use super::inertia::STIFFENING;
use crate::solver::simd::{Lanes, V3};

/// The first where the mask is set, elsewhere the second.
#[inline(always)]
pub(super) fn select<L: Lanes>(mask: L, if_one: V3<L>, if_zero: V3<L>) -> V3<L> {
    V3::new(
        mask.bitselect(if_one.x, if_zero.x),
        mask.bitselect(if_one.y, if_zero.y),
        mask.bitselect(if_one.z, if_zero.z),
    )
}

/// What is left of a vector where the mask is set; zero elsewhere.
#[inline(always)]
pub(super) fn masked<L: Lanes>(mask: L, v: V3<L>) -> V3<L> {
    V3::new(mask & v.x, mask & v.y, mask & v.z)
}

/// One vector in all lanes.
#[inline(always)]
pub(super) fn splat<L: Lanes>(v: glam::Vec3) -> V3<L> {
    V3::new(L::splat(v.x), L::splat(v.y), L::splat(v.z))
}

/// The lanes that are not zero.
#[inline(always)]
pub(super) fn is_some<L: Lanes>(v: V3<L>) -> L {
    !(v.x.simd_eq(L::ZERO) & v.y.simd_eq(L::ZERO) & v.z.simd_eq(L::ZERO))
}

#[inline(always)]
pub(super) fn length<L: Lanes>(v: V3<L>) -> L {
    v.dot(v).sqrt()
}

/// One number of a vector.
#[inline(always)]
pub(super) fn at<L: Lanes>(v: &V3<L>, row: usize) -> L {
    match row {
        0 => v.x,
        1 => v.y,
        _ => v.z,
    }
}

/// Sets one number of a vector.
#[inline(always)]
pub(super) fn put<L: Lanes>(v: &mut V3<L>, row: usize, value: L) {
    match row {
        0 => v.x = value,
        1 => v.y = value,
        _ => v.z = value,
    }
}

/// A matrix of each, by columns.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct M3<L>(pub(super) [V3<L>; 3]);

impl<L: Lanes> M3<L> {
    #[inline(always)]
    pub(super) fn identity() -> Self {
        Self::diagonal(splat(glam::Vec3::ONE))
    }
    #[inline(always)]
    pub(super) fn diagonal(v: V3<L>) -> Self {
        let zero = L::ZERO;
        Self([V3::new(v.x, zero, zero), V3::new(zero, v.y, zero), V3::new(zero, zero, v.z)])
    }
    /// xx, yy, zz and xy, xz, yz.
    #[inline(always)]
    pub(super) fn symmetric(d: V3<L>, o: V3<L>) -> Self {
        Self([V3::new(d.x, o.x, o.y), V3::new(o.x, d.y, o.z), V3::new(o.y, o.z, d.z)])
    }
    #[inline(always)]
    pub(super) fn transpose(self) -> Self {
        let [a, b, c] = self.0;
        Self([V3::new(a.x, b.x, c.x), V3::new(a.y, b.y, c.y), V3::new(a.z, b.z, c.z)])
    }
    #[inline(always)]
    pub(super) fn times(self, v: V3<L>) -> V3<L> {
        let [a, b, c] = self.0;
        v.x * a + v.y * b + v.z * c
    }
    /// The transposed matrix times a vector.
    #[inline(always)]
    pub(super) fn back(self, v: V3<L>) -> V3<L> {
        let [a, b, c] = self.0;
        V3::new(a.dot(v), b.dot(v), c.dot(v))
    }
    #[inline(always)]
    pub(super) fn matrix(self, o: Self) -> Self {
        let [a, b, c] = o.0;
        Self([self.times(a), self.times(b), self.times(c)])
    }
    /// The transposed matrix times another.
    #[inline(always)]
    pub(super) fn back_matrix(self, o: Self) -> Self {
        let [a, b, c] = o.0;
        Self([self.back(a), self.back(b), self.back(c)])
    }
    #[inline(always)]
    pub(super) fn scaled(self, factor: L) -> Self {
        let [a, b, c] = self.0;
        Self([factor * a, factor * b, factor * c])
    }
    #[inline(always)]
    pub(super) fn plus(self, o: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, o.0);
        Self([a + d, b + e, c + f])
    }
    #[inline(always)]
    pub(super) fn minus(self, o: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, o.0);
        Self([a - d, b - e, c - f])
    }
    #[inline(always)]
    pub(super) fn determinant(self) -> L {
        let [a, b, c] = self.0;
        a.dot(b.cross(c))
    }
    #[inline(always)]
    pub(super) fn inverse(self) -> Self {
        let [a, b, c] = self.0;
        let (x, y, z) = (b.cross(c), c.cross(a), a.cross(b));
        let share = L::ONE / a.dot(x);
        Self([share * x, share * y, share * z]).transpose()
    }
}

/// A quaternion of each.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Q<L> {
    pub(super) imaginary: V3<L>,
    pub(super) w: L,
}

impl<L: Lanes> Q<L> {
    #[inline(always)]
    pub(super) fn new([x, y, z, w]: [L; 4]) -> Self {
        Self { imaginary: V3::new(x, y, z), w }
    }
    pub(super) fn set(&mut self, lane: usize, q: [f32; 4]) {
        self.imaginary.set(lane, [q[0], q[1], q[2]]);
        self.w.as_mut_array()[lane] = q[3];
    }
    #[inline(always)]
    pub(super) fn conjugate(self) -> Self {
        let b = self.imaginary;
        Self { imaginary: V3::new(-b.x, -b.y, -b.z), w: self.w }
    }
    #[inline(always)]
    pub(super) fn times(self, o: Self) -> Self {
        let (a, b) = (self.imaginary, o.imaginary);
        Self {
            imaginary: V3::new(
                (self.w * b.x + a.x * o.w) + (a.y * b.z - a.z * b.y),
                (self.w * b.y - a.x * b.z) + (a.y * o.w + a.z * b.x),
                (self.w * b.z + a.x * b.y) + (a.z * o.w - a.y * b.x),
            ),
            w: (self.w * o.w - a.x * b.x) + (-(a.y * b.y) - a.z * b.z),
        }
    }
    #[inline(always)]
    pub(super) fn normalized(self) -> Self {
        let b = self.imaginary;
        let length = ((b.x * b.x + b.z * b.z) + (b.y * b.y + self.w * self.w)).sqrt();
        Self { imaginary: b / length, w: self.w / length }
    }
    #[inline(always)]
    pub(super) fn rotate(self, v: V3<L>) -> V3<L> {
        let b = self.imaginary;
        let t = L::splat(2.0) * b.cross(v);
        v + self.w * t + b.cross(t)
    }
    #[inline(always)]
    pub(super) fn matrix(self) -> M3<L> {
        let (V3 { x, y, z }, w) = (self.imaginary, self.w);
        let (x2, y2, z2) = (x + x, y + y, z + z);
        let (xx, xy, xz) = (x * x2, x * y2, x * z2);
        let (yy, yz, zz) = (y * y2, y * z2, z * z2);
        let (wx, wy, wz) = (w * x2, w * y2, w * z2);
        M3([
            V3::new(L::ONE - (yy + zz), xy + wz, xz - wy),
            V3::new(xy - wz, L::ONE - (xx + zz), yz + wx),
            V3::new(xz + wy, yz - wx, L::ONE - (xx + yy)),
        ])
    }
}

/// See [`stiffening`](super::rows::stiffening).
#[inline(always)]
pub(super) fn stiffening<L: Lanes>(arm: V3<L>, impulse: V3<L>, h: f32) -> M3<L> {
    let (pull, square) = (arm.dot(impulse), arm.dot(arm));
    let pulls = pull.simd_gt(L::ZERO) & square.simd_gt(L::ZERO);
    let outer = M3([arm.x * arm, arm.y * arm, arm.z * arm]).scaled(L::ONE / square);
    let stiff = M3::identity().minus(outer).scaled(L::splat(STIFFENING * h) * pull);
    let [x, y, z] = stiff.0;
    M3([masked(pulls, x), masked(pulls, y), masked(pulls, z)])
}

/// See [`inverse_inertia`](super::rows::inverse_inertia).
#[inline(always)]
pub(super) fn inverse_inertia<L: Lanes>(r: &M3<L>, [inertia, inverse]: &[V3<L>; 2], more: M3<L>) -> M3<L> {
    let plain = r.matrix(M3::diagonal(*inverse)).matrix(r.transpose());
    let stiff = r.matrix(M3::diagonal(*inertia)).matrix(r.transpose()).plus(more).inverse();
    let [a, b, c] = more.0;
    let is_stiff = (is_some(a) | is_some(b) | is_some(c)) & is_some(*inverse);
    let ([a, b, c], [d, e, f]) = (stiff.0, plain.0);
    let [x, y, z] = [select(is_stiff, a, d), select(is_stiff, b, e), select(is_stiff, c, f)];
    M3::symmetric(V3::new(x.x, y.y, z.z), V3::new(x.y, x.z, y.z))
}
