//! Eight lanes, for x86-64 processors with AVX2.
//!
//! Nothing here is fused (FMA), which would change results.

use super::simd::{Lanes, V3};
use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub, SubAssign};
use wide::f32x4;

/// Eight numbers. What computes with them is only called where the processor has AVX2: in [`Lanes::run`].
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub(crate) struct F32x8([f32; 8]);

/// Whether the processor has AVX2.
pub(crate) fn is_there() -> bool {
    is_x86_feature_detected!("avx2")
}

impl F32x8 {
    #[inline(always)]
    fn of(register: __m256) -> Self {
        Self(bytemuck::cast(register))
    }
    #[inline(always)]
    fn register(self) -> __m256 {
        bytemuck::cast(self.0)
    }
    #[inline(always)]
    fn bits(bits: u32) -> Self {
        Self([f32::from_bits(bits); 8])
    }
}

impl Lanes for F32x8 {
    const COUNT: usize = 8;
    const ZERO: Self = Self([0.0; 8]);
    const ONE: Self = Self([1.0; 8]);
    type Indices = [u32; 8];
    type Rows = [f32x4; 8];

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 8])
    }
    #[inline(always)]
    fn as_array(&self) -> &[f32] {
        &self.0
    }
    #[inline(always)]
    fn as_mut_array(&mut self) -> &mut [f32] {
        &mut self.0
    }
    #[inline(always)]
    fn simd_eq(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_cmp_ps::<_CMP_EQ_OQ>(self.register(), o.register()) })
    }
    #[inline(always)]
    fn simd_gt(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_cmp_ps::<_CMP_GT_OQ>(self.register(), o.register()) })
    }
    #[inline(always)]
    fn simd_lt(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.register(), o.register()) })
    }
    #[inline(always)]
    fn bitselect(self, if_one: Self, if_zero: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_blendv_ps(if_zero.register(), if_one.register(), self.register()) })
    }
    #[inline(always)]
    fn any(self) -> bool {
        // SAFETY: the processor has AVX2 (`F32x8`).
        unsafe { _mm256_movemask_ps(self.register()) != 0 }
    }
    #[inline(always)]
    fn fast_min(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_min_ps(self.register(), o.register()) })
    }
    #[inline(always)]
    fn fast_max(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_max_ps(self.register(), o.register()) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self & Self::bits(0x7fff_ffff)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_sqrt_ps(self.register()) })
    }
    #[inline(always)]
    fn is_finite(self) -> Self {
        self.abs().simd_lt(Self::splat(f32::INFINITY))
    }
    #[inline(always)]
    fn columns([a, b, c, d, e, f, g, h]: [f32x4; 8]) -> [Self; 4] {
        transposed([[a, e], [b, f], [c, g], [d, h]].map(|pair| Self(bytemuck::cast(pair))))
    }
    #[inline(always)]
    fn rows(columns: [Self; 4]) -> [f32x4; 8] {
        let [[a, e], [b, f], [c, g], [d, h]] = transposed(columns).map(|pair| bytemuck::cast::<_, [f32x4; 2]>(pair.0));
        [a, b, c, d, e, f, g, h]
    }
    #[inline(always)]
    fn run<R>(work: impl FnOnce() -> R) -> R {
        #[inline(never)]
        #[target_feature(enable = "avx2")]
        fn with_avx2<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        assert!(is_there(), "eight lanes need AVX2");
        // SAFETY: by the assertion.
        unsafe { with_avx2(work) }
    }
}

/// Rows and columns exchanged, in the lower and in the upper four lanes.
#[inline(always)]
fn transposed([a, b, c, d]: [F32x8; 4]) -> [F32x8; 4] {
    let [a, b, c, d] = [a.register(), b.register(), c.register(), d.register()];
    // SAFETY: the processor has AVX2 (`F32x8`).
    unsafe {
        let (ab, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (cd, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            F32x8::of(_mm256_shuffle_ps::<0b01_00_01_00>(ab, cd)),
            F32x8::of(_mm256_shuffle_ps::<0b11_10_11_10>(ab, cd)),
            F32x8::of(_mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high)),
            F32x8::of(_mm256_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high)),
        ]
    }
}

impl Add for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_add_ps(self.register(), o.register()) })
    }
}

impl AddAssign for F32x8 {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl Sub for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_sub_ps(self.register(), o.register()) })
    }
}

impl SubAssign for F32x8 {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl Mul for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_mul_ps(self.register(), o.register()) })
    }
}

impl Mul<V3<F32x8>> for F32x8 {
    type Output = V3<F32x8>;
    #[inline(always)]
    fn mul(self, v: V3<F32x8>) -> V3<F32x8> {
        v.scaled(self)
    }
}

impl Div for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_div_ps(self.register(), o.register()) })
    }
}

impl Neg for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_xor_ps(self.register(), Self::splat(-0.0).register()) })
    }
}

impl BitAnd for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_and_ps(self.register(), o.register()) })
    }
}

impl BitOr for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_or_ps(self.register(), o.register()) })
    }
}

impl Not for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        // SAFETY: the processor has AVX2 (`F32x8`).
        Self::of(unsafe { _mm256_xor_ps(self.register(), Self::bits(u32::MAX).register()) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What each operation gives, lane by lane, NaN being NaN.
    fn results<L: Lanes>(a: &[f32], b: &[f32]) -> Vec<Vec<u32>> {
        let from = |values: &[f32]| {
            let mut lanes = L::ZERO;
            lanes.as_mut_array().copy_from_slice(values);
            lanes
        };
        let (a, b) = (from(a), from(b));
        let (mut sum, mut difference) = (a, a);
        sum += b;
        difference -= b;
        let masks = [a.simd_eq(b), a.simd_gt(b), a.simd_lt(b), a.is_finite()];
        let chosen = masks.map(|mask| mask.bitselect(a, b));
        let inside = masks.map(|mask| (!mask & a) | (mask & b));
        // Of each mask, one lane alone at a time.
        let any = masks.map(|mask| {
            let mut any = L::ZERO;
            for lane in 0..L::COUNT {
                let mut only = L::ZERO;
                only.as_mut_array()[lane] = mask.as_array()[lane];
                any.as_mut_array()[lane] = f32::from(u8::from(only.any()));
            }
            any
        });
        let numbers =
            [sum, difference, a + b, a - b, a * b, a / b, -a, a.abs(), a.sqrt(), a.fast_min(b), a.fast_max(b)];
        let bits = |x: &f32| if x.is_nan() { f32::NAN.to_bits() } else { x.to_bits() };
        let all =
            [&numbers[..], &masks, &chosen, &inside, &any, &L::columns(L::rows([a, b, L::ZERO, L::ONE]))].concat();
        all.iter().map(|lanes| lanes.as_array().iter().map(bits).collect()).collect()
    }

    /// Oracle: four lanes. Every value meets every other.
    #[test]
    fn each_operation_is_that_of_four_lanes() {
        let odd = [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX, -f32::MAX, f32::MIN_POSITIVE, 1e-41, -1e-41];
        let values = [&odd[..], &[0.0, -0.0, 1.0, -1.0, 0.1, 3e7, -2.5, 1.0 + f32::EPSILON]].concat();
        for shift in 0..values.len() {
            let mut others = values.clone();
            others.rotate_left(shift);
            for (a, b) in values.chunks(8).zip(others.chunks(8)).filter(|_| is_there()) {
                let (low, high) = (results::<f32x4>(&a[..4], &b[..4]), results::<f32x4>(&a[4..], &b[4..]));
                let four: Vec<_> = low.into_iter().zip(high).map(|(low, high)| [low, high].concat()).collect();
                assert_eq!(F32x8::run(|| results::<F32x8>(a, b)), four, "{a:?} {b:?}");
            }
        }
    }
}
