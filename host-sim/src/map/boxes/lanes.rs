//! Vectors of f32 with arithmetic operators, as wide as the machine's vector instructions.

use std::ops::{Add, Div, Mul, Sub};

use pulp::Simd;

/// One vector of f32 numbers.
#[derive(Clone, Copy)]
pub(super) struct SimdLanes<S: Simd> {
    simd: S,
    numbers: S::f32s,
}

impl<S: Simd> SimdLanes<S> {
    #[inline(always)]
    fn new(simd: S, numbers: S::f32s) -> Self {
        Self { simd, numbers }
    }

    /// A vector with `x` in every SIMD lane.
    #[inline(always)]
    pub(super) fn splat(simd: S, x: f32) -> Self {
        Self::new(simd, simd.splat_f32s(x))
    }

    /// Three vectors, each with one of the numbers in every lane.
    #[inline(always)]
    pub(super) fn splat_triple(simd: S, [x, y, z]: [f32; 3]) -> [Self; 3] {
        [Self::splat(simd, x), Self::splat(simd, y), Self::splat(simd, z)]
    }

    /// A vector of zeros.
    #[inline(always)]
    pub(super) fn zero(self) -> Self {
        Self::splat(self.simd, 0.0)
    }

    /// Vector number `part` of the arrays of three axes.
    #[inline(always)]
    pub(super) fn load_part<const N: usize>(
        simd: S,
        [x, y, z]: &[[f32; N]; 3],
        part: usize,
    ) -> [Self; 3] {
        [
            Self::new(simd, S::as_simd_f32s(x).0[part]),
            Self::new(simd, S::as_simd_f32s(y).0[part]),
            Self::new(simd, S::as_simd_f32s(z).0[part]),
        ]
    }

    /// Writes the vector as vector number `part` of an array.
    #[inline(always)]
    pub(super) fn store_part(self, numbers: &mut [f32], part: usize) {
        S::as_mut_simd_f32s(numbers).0[part] = self.numbers;
    }

    /// The greater number of each lane; `other`'s if a lane of `self` is NaN.
    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.max_f32s(self.numbers, other.numbers))
    }

    /// The smaller number of each lane; `other`'s if a lane of `self` is NaN.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.min_f32s(self.numbers, other.numbers))
    }

    /// Mask of the lanes in which `self` is less than `other`.
    #[inline(always)]
    pub(super) fn is_below(self, other: Self) -> S::m32s {
        self.simd.less_than_f32s(self.numbers, other.numbers)
    }

    /// Lanes of `self` where the mask is true, lanes of `other` elsewhere.
    #[inline(always)]
    pub(super) fn select(self, mask: S::m32s, other: Self) -> Self {
        Self::new(self.simd, self.simd.select_f32s(mask, self.numbers, other.numbers))
    }
}

impl<S: Simd> Add for SimdLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.add_f32s(self.numbers, other.numbers))
    }
}

impl<S: Simd> Sub for SimdLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.sub_f32s(self.numbers, other.numbers))
    }
}

impl<S: Simd> Mul for SimdLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.mul_f32s(self.numbers, other.numbers))
    }
}

impl<S: Simd> Div for SimdLanes<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self::new(self.simd, self.simd.div_f32s(self.numbers, other.numbers))
    }
}
