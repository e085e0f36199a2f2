//! A row in registers: the arithmetic of the hot loops, once in plain Rust and once for each set of processor features.
//!
//! A set of features is a token type, of which a value exists only where the processor has them: safe code cannot run a
//! loop that the processor lacks. Contract: every operation is rounded in each lane as IEEE 754 says, fused ones once,
//! so all give the same bits.
//!
//! Tokens and intrinsics are those of `pulp`, which cost 0.3 % of the time against intrinsics in `unsafe` blocks of our
//! own. `fearless_simd` needs no trait here, but has AVX-512 from Ice Lake on only, and AVX2 takes 10 to 17 % more
//! time.

use crate::model::{LANES, Row};

/// A set of processor features that this processor has.
pub(super) trait Simd: Copy {
    /// Eight doubles, in whatever registers there are.
    type Vector: Vector;
    /// Whether some twenty vectors fit into the registers.
    const HAS_MANY_REGISTERS: bool = false;
    fn splat(self, value: f64) -> Self::Vector;
    fn load(self, row: &Row) -> Self::Vector;
    /// Runs a loop, compiled for these features where it is inlined.
    fn run<T>(self, hot_loop: impl FnOnce(Self) -> T) -> T;
}

/// Eight doubles.
pub(super) trait Vector: Copy {
    fn store(self, row: &mut Row);
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    /// `self * factor + addend`, rounded once.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    fn abs(self) -> Self;
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
pub(super) struct Baseline;

impl Simd for Baseline {
    type Vector = Row;

    #[inline(always)]
    fn splat(self, value: f64) -> Row {
        Row::filled(value)
    }

    #[inline(always)]
    fn load(self, row: &Row) -> Row {
        *row
    }

    #[inline(always)]
    fn run<T>(self, hot_loop: impl FnOnce(Self) -> T) -> T {
        hot_loop(self)
    }
}

#[inline(always)]
fn lanes(value: impl Fn(usize) -> f64) -> Row {
    Row(std::array::from_fn(value))
}

impl Vector for Row {
    #[inline(always)]
    fn store(self, row: &mut Row) {
        *row = self;
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        lanes(|l| self[l] + other[l])
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        lanes(|l| self[l] - other[l])
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        lanes(|l| self[l] * other[l])
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        lanes(|l| self[l].mul_add(factor[l], addend[l]))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        lanes(|l| self[l].abs())
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        lanes(|l| if self[l] > other[l] { self[l] } else { other[l] })
    }

    #[inline(always)]
    fn reaches(self, other: Self) -> u8 {
        (0..LANES).fold(0, |bits, l| bits | (u8::from(self[l] >= other[l]) << l))
    }

    #[inline(always)]
    fn to_next_lane(self) -> Self {
        lanes(|l| if l > 0 { self[l - 1] } else { 0.0 })
    }

    #[inline(always)]
    fn to_lane_before(self) -> Self {
        lanes(|l| if l + 1 < LANES { self[l + 1] } else { 0.0 })
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use pulp::x86::{V3 as Avx2, V4 as Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Avx2, Avx512, Row, Simd, Vector};
    use pulp::{NullaryFnOnce, cast, f64x4, f64x8};

    /// A loop that is inlined into code compiled for the features of a token.
    struct HotLoop<S, F>(S, F);

    impl<S, T, F: FnOnce(S) -> T> NullaryFnOnce for HotLoop<S, F> {
        type Output = T;

        #[inline(always)]
        fn call(self) -> T {
            (self.1)(self.0)
        }
    }

    impl Simd for Avx2 {
        type Vector = Two;

        #[inline(always)]
        fn splat(self, value: f64) -> Two {
            let half = self.splat_f64x4(value);
            Two(self, half, half)
        }

        #[inline(always)]
        fn load(self, row: &Row) -> Two {
            let [low, high] = cast!(row.0);
            Two(self, low, high)
        }

        #[inline(always)]
        fn run<T>(self, hot_loop: impl FnOnce(Self) -> T) -> T {
            self.vectorize(HotLoop(self, hot_loop))
        }
    }

    /// Two registers of four doubles, by AVX2 and FMA.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Two(Avx2, f64x4, f64x4);

    impl Two {
        #[inline(always)]
        fn zip(self, other: Self, combine: impl Fn(Avx2, f64x4, f64x4) -> f64x4) -> Self {
            let simd = self.0;
            Self(simd, combine(simd, self.1, other.1), combine(simd, self.2, other.2))
        }
    }

    impl Vector for Two {
        #[inline(always)]
        fn store(self, row: &mut Row) {
            row.0 = cast!([self.1, self.2]);
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            self.zip(other, Avx2::add_f64x4)
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            self.zip(other, Avx2::sub_f64x4)
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            self.zip(other, Avx2::mul_f64x4)
        }

        #[inline(always)]
        fn mul_add(self, factor: Self, addend: Self) -> Self {
            let simd = self.0;
            Self(simd, simd.mul_add_f64x4(self.1, factor.1, addend.1), simd.mul_add_f64x4(self.2, factor.2, addend.2))
        }

        #[inline(always)]
        fn abs(self) -> Self {
            Self(self.0, self.0.abs_f64x4(self.1), self.0.abs_f64x4(self.2))
        }

        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            self.zip(other, Avx2::max_f64x4)
        }

        #[inline(always)]
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "four bits each")]
        fn reaches(self, other: Self) -> u8 {
            let bits = |a, b| self.0.avx._mm256_movemask_pd(cast!(self.0.cmp_ge_f64x4(a, b)));
            (bits(self.1, other.1) | (bits(self.2, other.2) << 4)) as u8
        }

        #[inline(always)]
        fn to_next_lane(self) -> Self {
            let (avx, low, high) = (self.0.avx, cast!(self.1), cast!(self.2));
            // 0 0 l0 l1 and l2 l3 h0 h1, each then shifted by one against the register itself.
            let before_low = avx._mm256_permute2f128_pd::<0x08>(low, low);
            let before_high = avx._mm256_permute2f128_pd::<0x21>(low, high);
            let shifted = |before, register| cast!(avx._mm256_shuffle_pd::<0b0101>(before, register));
            Self(self.0, shifted(before_low, low), shifted(before_high, high))
        }

        #[inline(always)]
        fn to_lane_before(self) -> Self {
            let (avx, low, high) = (self.0.avx, cast!(self.1), cast!(self.2));
            // l2 l3 h0 h1 and h2 h3 0 0.
            let after_low = avx._mm256_permute2f128_pd::<0x21>(low, high);
            let after_high = avx._mm256_permute2f128_pd::<0x81>(high, high);
            let shifted = |register, after| cast!(avx._mm256_shuffle_pd::<0b0101>(register, after));
            Self(self.0, shifted(low, after_low), shifted(high, after_high))
        }
    }

    impl Simd for Avx512 {
        type Vector = One;
        const HAS_MANY_REGISTERS: bool = true;

        #[inline(always)]
        fn splat(self, value: f64) -> One {
            One(self, self.splat_f64x8(value))
        }

        #[inline(always)]
        fn load(self, row: &Row) -> One {
            One(self, cast!(row.0))
        }

        #[inline(always)]
        fn run<T>(self, hot_loop: impl FnOnce(Self) -> T) -> T {
            self.vectorize(HotLoop(self, hot_loop))
        }
    }

    /// One register of eight doubles, by AVX-512.
    #[derive(Clone, Copy)]
    pub(in super::super) struct One(Avx512, f64x8);

    impl Vector for One {
        #[inline(always)]
        fn store(self, row: &mut Row) {
            row.0 = cast!(self.1);
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            Self(self.0, self.0.add_f64x8(self.1, other.1))
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            Self(self.0, self.0.sub_f64x8(self.1, other.1))
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            Self(self.0, self.0.mul_f64x8(self.1, other.1))
        }

        #[inline(always)]
        fn mul_add(self, factor: Self, addend: Self) -> Self {
            Self(self.0, self.0.mul_add_f64x8(self.1, factor.1, addend.1))
        }

        #[inline(always)]
        fn abs(self) -> Self {
            Self(self.0, self.0.abs_f64x8(self.1))
        }

        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            Self(self.0, self.0.max_f64x8(self.1, other.1))
        }

        #[inline(always)]
        fn reaches(self, other: Self) -> u8 {
            self.0.cmp_ge_f64x8(self.1, other.1).0
        }

        #[inline(always)]
        fn to_next_lane(self) -> Self {
            let avx512 = self.0.avx512f;
            let lanes = avx512._mm512_alignr_epi64::<7>(cast!(self.1), avx512._mm512_setzero_si512());
            Self(self.0, cast!(lanes))
        }

        #[inline(always)]
        fn to_lane_before(self) -> Self {
            let avx512 = self.0.avx512f;
            let lanes = avx512._mm512_alignr_epi64::<1>(avx512._mm512_setzero_si512(), cast!(self.1));
            Self(self.0, cast!(lanes))
        }
    }
}
