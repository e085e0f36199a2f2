//! A row in registers: the arithmetic of the hot loops, once in plain Rust and once for each set of processor features.
//!
//! Contract: every operation is rounded in each lane as IEEE 754 says, fused ones once, so all give the same bits.

use crate::model::{LANES, Row};

/// Eight doubles, in whatever registers a set of processor features has.
pub(super) trait Vector: Copy {
    /// Whether some twenty vectors fit into the registers.
    const HAS_MANY_REGISTERS: bool = false;
    fn splat(value: f64) -> Self;
    fn load(row: &Row) -> Self;
    fn store(self, row: &mut Row);
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    /// `self * factor + addend`, rounded once.
    fn fused(self, factor: Self, addend: Self) -> Self;
    fn magnitude(self) -> Self;
    /// The larger of each lane; `other` where one is not a number.
    fn larger(self, other: Self) -> Self;
    /// One bit a lane: `self >= other`.
    fn reaches(self, other: Self) -> u8;
    /// Whether no lane exceeds that of `bound` or is not a number.
    #[inline(always)]
    fn within(self, bound: Self) -> bool {
        bound.reaches(self) == u8::MAX
    }
    /// Every lane moved to the next one, 0 into the first.
    fn to_next_lane(self) -> Self;
    /// Every lane moved to the one before, 0 into the last.
    fn to_lane_before(self) -> Self;
}

/// Plain Rust, for any processor.
#[derive(Clone, Copy)]
pub(super) struct Plain(Row);

impl Plain {
    #[inline(always)]
    fn zip(self, other: Self, combine: impl Fn(f64, f64) -> f64) -> Self {
        Self(Row(std::array::from_fn(|l| combine(self.0[l], other.0[l]))))
    }
}

impl Vector for Plain {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(Row::filled(value))
    }

    #[inline(always)]
    fn load(row: &Row) -> Self {
        Self(*row)
    }

    #[inline(always)]
    fn store(self, row: &mut Row) {
        *row = self.0;
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }

    #[inline(always)]
    fn fused(self, factor: Self, addend: Self) -> Self {
        Self(Row(std::array::from_fn(|l| self.0[l].mul_add(factor.0[l], addend.0[l]))))
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        Self(Row(self.0.map(f64::abs)))
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn reaches(self, other: Self) -> u8 {
        (0..LANES).fold(0, |bits, l| bits | (u8::from(self.0[l] >= other.0[l]) << l))
    }

    #[inline(always)]
    fn to_next_lane(self) -> Self {
        Self(Row(std::array::from_fn(|l| if l > 0 { self.0[l - 1] } else { 0.0 })))
    }

    #[inline(always)]
    fn to_lane_before(self) -> Self {
        Self(Row(std::array::from_fn(|l| if l + 1 < LANES { self.0[l + 1] } else { 0.0 })))
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Row, Vector};
    use std::arch::x86_64::{
        __m256d, __m512d, _CMP_GE_OQ, _mm256_add_pd, _mm256_andnot_pd, _mm256_cmp_pd, _mm256_fmadd_pd, _mm256_load_pd,
        _mm256_max_pd, _mm256_movemask_pd, _mm256_mul_pd, _mm256_permute2f128_pd, _mm256_set1_pd, _mm256_shuffle_pd,
        _mm256_store_pd, _mm256_sub_pd, _mm512_abs_pd, _mm512_add_pd, _mm512_alignr_epi64, _mm512_castpd_si512,
        _mm512_castsi512_pd, _mm512_cmp_pd_mask, _mm512_fmadd_pd, _mm512_load_pd, _mm512_max_pd, _mm512_mul_pd,
        _mm512_set1_pd, _mm512_setzero_si512, _mm512_store_pd, _mm512_sub_pd,
    };

    /// Two registers of four doubles: AVX2 and FMA.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Avx2(__m256d, __m256d);

    /// One register of eight doubles: AVX-512F.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Avx512(__m512d);

    // SAFETY of both implementations: they run only within the loops that `Kernels::available` hands out, once it has
    // found the processor to have these features. Rows are aligned to 64 bytes.

    impl Vector for Avx2 {
        #[inline(always)]
        fn splat(value: f64) -> Self {
            unsafe { Self(_mm256_set1_pd(value), _mm256_set1_pd(value)) }
        }

        #[inline(always)]
        fn load(row: &Row) -> Self {
            let first = row.0.as_ptr();
            unsafe { Self(_mm256_load_pd(first), _mm256_load_pd(first.add(4))) }
        }

        #[inline(always)]
        fn store(self, row: &mut Row) {
            let first = row.0.as_mut_ptr();
            unsafe {
                _mm256_store_pd(first, self.0);
                _mm256_store_pd(first.add(4), self.1);
            }
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            unsafe { Self(_mm256_add_pd(self.0, other.0), _mm256_add_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            unsafe { Self(_mm256_sub_pd(self.0, other.0), _mm256_sub_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            unsafe { Self(_mm256_mul_pd(self.0, other.0), _mm256_mul_pd(self.1, other.1)) }
        }

        #[inline(always)]
        fn fused(self, factor: Self, addend: Self) -> Self {
            unsafe { Self(_mm256_fmadd_pd(self.0, factor.0, addend.0), _mm256_fmadd_pd(self.1, factor.1, addend.1)) }
        }

        #[inline(always)]
        fn magnitude(self) -> Self {
            unsafe {
                let sign = _mm256_set1_pd(-0.0);
                Self(_mm256_andnot_pd(sign, self.0), _mm256_andnot_pd(sign, self.1))
            }
        }

        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            unsafe { Self(_mm256_max_pd(self.0, other.0), _mm256_max_pd(self.1, other.1)) }
        }

        #[inline(always)]
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "four bits each")]
        fn reaches(self, other: Self) -> u8 {
            unsafe {
                let low = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GE_OQ>(self.0, other.0));
                let high = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_GE_OQ>(self.1, other.1));
                (low | (high << 4)) as u8
            }
        }

        #[inline(always)]
        fn to_next_lane(self) -> Self {
            unsafe {
                // 0 0 l0 l1 and l2 l3 h0 h1, each then shifted by one against the register itself.
                let low = _mm256_permute2f128_pd::<0x08>(self.0, self.0);
                let high = _mm256_permute2f128_pd::<0x21>(self.0, self.1);
                Self(_mm256_shuffle_pd::<0b0101>(low, self.0), _mm256_shuffle_pd::<0b0101>(high, self.1))
            }
        }

        #[inline(always)]
        fn to_lane_before(self) -> Self {
            unsafe {
                // l2 l3 h0 h1 and h2 h3 0 0.
                let low = _mm256_permute2f128_pd::<0x21>(self.0, self.1);
                let high = _mm256_permute2f128_pd::<0x81>(self.1, self.1);
                Self(_mm256_shuffle_pd::<0b0101>(self.0, low), _mm256_shuffle_pd::<0b0101>(self.1, high))
            }
        }
    }

    impl Vector for Avx512 {
        const HAS_MANY_REGISTERS: bool = true;

        #[inline(always)]
        fn splat(value: f64) -> Self {
            unsafe { Self(_mm512_set1_pd(value)) }
        }

        #[inline(always)]
        fn load(row: &Row) -> Self {
            unsafe { Self(_mm512_load_pd(row.0.as_ptr())) }
        }

        #[inline(always)]
        fn store(self, row: &mut Row) {
            unsafe { _mm512_store_pd(row.0.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            unsafe { Self(_mm512_add_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            unsafe { Self(_mm512_sub_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            unsafe { Self(_mm512_mul_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn fused(self, factor: Self, addend: Self) -> Self {
            unsafe { Self(_mm512_fmadd_pd(self.0, factor.0, addend.0)) }
        }

        #[inline(always)]
        fn magnitude(self) -> Self {
            unsafe { Self(_mm512_abs_pd(self.0)) }
        }

        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            unsafe { Self(_mm512_max_pd(self.0, other.0)) }
        }

        #[inline(always)]
        fn reaches(self, other: Self) -> u8 {
            unsafe { _mm512_cmp_pd_mask::<_CMP_GE_OQ>(self.0, other.0) }
        }

        #[inline(always)]
        fn to_next_lane(self) -> Self {
            unsafe {
                let lanes = _mm512_castpd_si512(self.0);
                Self(_mm512_castsi512_pd(_mm512_alignr_epi64::<7>(lanes, _mm512_setzero_si512())))
            }
        }

        #[inline(always)]
        fn to_lane_before(self) -> Self {
            unsafe {
                let lanes = _mm512_castpd_si512(self.0);
                Self(_mm512_castsi512_pd(_mm512_alignr_epi64::<1>(_mm512_setzero_si512(), lanes)))
            }
        }
    }
}
