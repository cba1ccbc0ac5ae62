//! How many constraints one operation works on: what the files called `_lanes` are written in.
//!
//! Four everywhere; eight where the processor has AVX2 (`avx2`), which is seen when the program runs. Lanes know nothing
//! of each other, and no operation is contracted with the next, so either gives the same bits.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub, SubAssign};
use wide::f32x4;

/// A number of each constraint of a group, in the words of the crate `wide`.
///
/// Comparisons give masks: lanes of all ones or all zeros.
///
/// A type may need instructions that the program was not built for. What computes with it must therefore be inlined into
/// the `work` of a [`Lanes::run`], by `#[inline(always)]` on the whole way: what is not runs many times as slow.
/// Loading, storing and looking at single lanes works anywhere.
pub(crate) trait Lanes:
    Copy
    + Debug
    + Default
    + Send
    + Sync
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + SubAssign
    + Mul<Output = Self>
    + Mul<V3<Self>, Output = V3<Self>>
    + Div<Output = Self>
    + Neg<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + Not<Output = Self>
{
    /// Constraints side by side.
    const COUNT: usize;
    const ZERO: Self;
    const ONE: Self;
    /// An index for each lane.
    type Indices: Copy + Debug + Default + Send + Sync + AsRef<[u32]> + AsMut<[u32]>;
    /// Four numbers of each lane.
    type Rows: Default + AsRef<[f32x4]> + AsMut<[f32x4]>;

    fn splat(value: f32) -> Self;
    fn as_array(&self) -> &[f32];
    fn as_mut_array(&mut self) -> &mut [f32];
    fn simd_eq(self, o: Self) -> Self;
    fn simd_gt(self, o: Self) -> Self;
    fn simd_lt(self, o: Self) -> Self;
    /// Where this mask is set the first, elsewhere the second.
    fn bitselect(self, if_one: Self, if_zero: Self) -> Self;
    /// Whether this mask is set anywhere.
    fn any(self) -> bool;
    fn fast_min(self, o: Self) -> Self;
    fn fast_max(self, o: Self) -> Self;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    fn is_finite(self) -> Self;
    /// The four numbers of each lane, as four of all lanes.
    fn columns(rows: Self::Rows) -> [Self; 4];
    /// The way back.
    fn rows(columns: [Self; 4]) -> Self::Rows;
    /// Calls `work` as a function of its own, compiled for processors that compute with this type.
    fn run<R>(work: impl FnOnce() -> R) -> R;
}

impl Lanes for f32x4 {
    const COUNT: usize = 4;
    const ZERO: Self = Self::ZERO;
    const ONE: Self = Self::ONE;
    type Indices = [u32; 4];
    type Rows = [f32x4; 4];

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self::splat(value)
    }
    #[inline(always)]
    fn as_array(&self) -> &[f32] {
        self.as_array()
    }
    #[inline(always)]
    fn as_mut_array(&mut self) -> &mut [f32] {
        self.as_mut_array()
    }
    #[inline(always)]
    fn simd_eq(self, o: Self) -> Self {
        self.simd_eq(o)
    }
    #[inline(always)]
    fn simd_gt(self, o: Self) -> Self {
        self.simd_gt(o)
    }
    #[inline(always)]
    fn simd_lt(self, o: Self) -> Self {
        self.simd_lt(o)
    }
    #[inline(always)]
    fn bitselect(self, if_one: Self, if_zero: Self) -> Self {
        self.bitselect(if_one, if_zero)
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.any()
    }
    #[inline(always)]
    fn fast_min(self, o: Self) -> Self {
        self.fast_min(o)
    }
    #[inline(always)]
    fn fast_max(self, o: Self) -> Self {
        self.fast_max(o)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.abs()
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    #[inline(always)]
    fn is_finite(self) -> Self {
        self.is_finite()
    }
    #[inline(always)]
    fn columns(rows: [f32x4; 4]) -> [Self; 4] {
        f32x4::transpose(rows)
    }
    #[inline(always)]
    fn rows(columns: [Self; 4]) -> [f32x4; 4] {
        f32x4::transpose(columns)
    }
    #[inline(never)]
    fn run<R>(work: impl FnOnce() -> R) -> R {
        work()
    }
}

/// A vector of each.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct V3<L> {
    pub(crate) x: L,
    pub(crate) y: L,
    pub(crate) z: L,
}

impl<L: Lanes> V3<L> {
    #[inline(always)]
    pub(crate) fn new(x: L, y: L, z: L) -> Self {
        Self { x, y, z }
    }
    #[inline(always)]
    pub(crate) fn dot(self, o: Self) -> L {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
    #[inline(always)]
    pub(crate) fn cross(self, o: Self) -> Self {
        Self::new(self.y * o.z - o.y * self.z, self.z * o.x - o.z * self.x, self.x * o.y - o.x * self.y)
    }
    pub(crate) fn set(&mut self, lane: usize, v: [f32; 3]) {
        self.x.as_mut_array()[lane] = v[0];
        self.y.as_mut_array()[lane] = v[1];
        self.z.as_mut_array()[lane] = v[2];
    }
    /// Each times its factor.
    #[inline(always)]
    pub(crate) fn scaled(self, factor: L) -> Self {
        Self::new(factor * self.x, factor * self.y, factor * self.z)
    }
}

impl<L: Lanes> Add for V3<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<L: Lanes> Sub for V3<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<L: Lanes> Div<L> for V3<L> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: L) -> Self {
        Self::new(self.x / o, self.y / o, self.z / o)
    }
}

impl Mul<V3<f32x4>> for f32x4 {
    type Output = V3<f32x4>;
    #[inline(always)]
    fn mul(self, v: V3<f32x4>) -> V3<f32x4> {
        v.scaled(self)
    }
}
