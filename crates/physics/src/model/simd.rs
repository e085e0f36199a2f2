//! Rows of eight doubles, and their arithmetic in registers for each set of processor features.
//!
//! Loops over contacts and over blocks run in this width, whatever the registers hold, so that the rounding of sums
//! does not depend on the processor.
//!
//! A set of features is a token type of `pulp`, of which a value exists only where the processor has them: safe code
//! cannot run a loop that the processor lacks. Contract: every operation is rounded in each lane as IEEE 754 says,
//! fused ones once, so all give the same bits.
//!
//! `fearless_simd` would need no code here, but has AVX-512 from Ice Lake on only, and its AVX2 is slower.

use pulp::{Scalar512b as Baseline, WithSimd, bytemuck};
use std::array;
use std::ops::{Deref, DerefMut};

pub(crate) const LANES: usize = 8;

/// Eight doubles in one cache line.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct Row(pub [f64; LANES]);

impl Row {
    /// The same value in every lane.
    pub const fn filled(value: f64) -> Self {
        Self([value; LANES])
    }
}

impl Deref for Row {
    type Target = [f64; LANES];

    #[inline(always)]
    fn deref(&self) -> &[f64; LANES] {
        &self.0
    }
}

impl DerefMut for Row {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64; LANES] {
        &mut self.0
    }
}

/// A set of processor features that this processor has.
pub(crate) trait Simd: pulp::Simd {
    /// Eight doubles, in whatever registers there are.
    type Vector: Vector<Simd = Self>;
    /// Whether some twenty vectors fit into the registers.
    const HAS_MANY_REGISTERS: bool = false;

    #[inline(always)]
    fn splat(self, value: f64) -> Self::Vector {
        Self::Vector::splat(self, value)
    }

    #[inline(always)]
    fn load(self, row: &Row) -> Self::Vector {
        Self::Vector::load(self, row)
    }

    /// Sets one lane by writing the whole row: reading a row after a piece of it has been written takes long.
    #[inline(always)]
    fn set(self, row: &mut Row, lane: usize, value: f64) {
        self.load(row).with(lane, value).store(row);
    }

    /// Runs a loop, compiled for these features where it is inlined.
    #[inline(always)]
    fn run<T>(self, hot_loop: impl FnOnce(Self) -> T) -> T {
        self.vectorize(HotLoop(self, hot_loop))
    }
}

/// A loop that is inlined into code compiled for the features of a token. A closure without arguments, which `pulp` takes
/// too, is not: a run on the grid takes eight times as long.
struct HotLoop<S, F>(S, F);

impl<S, T, F: FnOnce(S) -> T> WithSimd for HotLoop<S, F> {
    type Output = T;

    #[inline(always)]
    fn with_simd<Same: pulp::Simd>(self, _: Same) -> T {
        (self.1)(self.0)
    }
}

pub(crate) trait Vector: Copy {
    type Simd;
    fn splat(simd: Self::Simd, value: f64) -> Self;
    fn load(simd: Self::Simd, row: &Row) -> Self;
    fn store(self, row: &mut Row);
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    fn over(self, other: Self) -> Self;
    /// The square root.
    fn root(self) -> Self;
    /// `self * factor + addend`, rounded once.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    fn abs(self) -> Self;
    /// The larger and the smaller of each lane; either where one is not a number.
    fn larger(self, other: Self) -> Self;
    fn smaller(self, other: Self) -> Self;
    /// All lanes combined into one value, in pairs.
    #[inline(always)]
    fn reduce(self, combine: impl Fn(f64, f64) -> f64) -> f64 {
        let mut row = Row::filled(0.0);
        self.store(&mut row);
        let halves: [f64; LANES / 2] =
            array::from_fn(|lane| combine(row[lane], row[lane + LANES / 2]));
        combine(combine(halves[0], halves[2]), combine(halves[1], halves[3]))
    }
    /// The same with another value in one lane.
    fn with(self, lane: usize, value: f64) -> Self;
    /// One bit a lane: `self >= other`.
    fn reaches(self, other: Self) -> u8;
    /// Every lane moved to the next one, 0 into the first.
    fn to_next_lane(self) -> Self;
    /// Every lane moved to the one before, 0 into the last.
    fn to_lane_before(self) -> Self;
}

/// What depends on how eight lanes lie in `K` registers.
trait Registers<const K: usize>: pulp::Simd {
    fn reaches(self, left: [Self::f64s; K], right: [Self::f64s; K]) -> u8;
    fn to_next_lane(self, registers: [Self::f64s; K]) -> [Self::f64s; K];
    fn to_lane_before(self, registers: [Self::f64s; K]) -> [Self::f64s; K];
}

/// The number of each lane.
const NUMBERS: Row = Row([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

/// Eight doubles in `K` registers.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<S: pulp::Simd, const K: usize>(S, [S::f64s; K]);

/// Operations of the registers, lane by lane. Loops, since closures may be compiled without the features of the token.
macro_rules! lanewise {
    ($($name:ident($($other:ident),*) = $operation:ident;)*) => {$(
        #[inline(always)]
        fn $name(mut self $(, $other: Self)*) -> Self {
            for k in 0..K {
                self.1[k] = self.0.$operation(self.1[k] $(, $other.1[k])*);
            }
            self
        }
    )*};
}

impl<S: Registers<K>, const K: usize> Vector for Lanes<S, K> {
    type Simd = S;

    lanewise! {
        plus(other) = add_f64s;
        minus(other) = sub_f64s;
        times(other) = mul_f64s;
        over(other) = div_f64s;
        larger(other) = max_f64s;
        smaller(other) = min_f64s;
        root() = sqrt_f64s;
        abs() = abs_f64s;
        mul_add(factor, addend) = mul_add_f64s;
    }

    #[inline(always)]
    fn splat(simd: S, value: f64) -> Self {
        Self(simd, [simd.splat_f64s(value); K])
    }

    #[inline(always)]
    fn load(simd: S, row: &Row) -> Self {
        let (registers, _) = S::as_simd_f64s(&row.0);
        let mut lanes = [registers[0]; K];
        lanes.copy_from_slice(registers);
        Self(simd, lanes)
    }

    #[inline(always)]
    fn store(self, row: &mut Row) {
        let (registers, _) = S::as_mut_simd_f64s(&mut row.0);
        registers.copy_from_slice(&self.1);
    }

    #[inline(always)]
    fn with(mut self, lane: usize, value: f64) -> Self {
        let simd = self.0;
        let chosen = self.0.splat_f64s(lane as f64);
        let value = self.0.splat_f64s(value);
        let numbers = Self::load(simd, &NUMBERS);
        for k in 0..K {
            self.1[k] = simd.select_f64s(simd.equal_f64s(numbers.1[k], chosen), value, self.1[k]);
        }
        self
    }

    #[inline(always)]
    fn reaches(self, other: Self) -> u8 {
        self.0.reaches(self.1, other.1)
    }

    #[inline(always)]
    fn to_next_lane(self) -> Self {
        Self(self.0, self.0.to_next_lane(self.1))
    }

    #[inline(always)]
    fn to_lane_before(self) -> Self {
        Self(self.0, self.0.to_lane_before(self.1))
    }
}

impl Simd for Baseline {
    type Vector = Lanes<Self, 1>;

    #[inline(always)]
    fn set(self, row: &mut Row, lane: usize, value: f64) {
        row[lane] = value;
    }
}

impl Registers<1> for Baseline {
    #[inline(always)]
    fn reaches(self, [left]: [Self::f64s; 1], [right]: [Self::f64s; 1]) -> u8 {
        let (left, right): ([f64; LANES], [f64; LANES]) =
            (bytemuck::cast(left), bytemuck::cast(right));
        (0..LANES).fold(0, |bits, l| bits | (u8::from(left[l] >= right[l]) << l))
    }

    #[inline(always)]
    fn to_next_lane(self, registers: [Self::f64s; 1]) -> [Self::f64s; 1] {
        let lanes: [f64; LANES] = bytemuck::cast(registers);
        bytemuck::cast(array::from_fn::<_, LANES, _>(|l| {
            if l > 0 { lanes[l - 1] } else { 0.0 }
        }))
    }

    #[inline(always)]
    fn to_lane_before(self, registers: [Self::f64s; 1]) -> [Self::f64s; 1] {
        let lanes: [f64; LANES] = bytemuck::cast(registers);
        bytemuck::cast(array::from_fn::<_, LANES, _>(|l| {
            if l + 1 < LANES { lanes[l + 1] } else { 0.0 }
        }))
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Lanes, Registers, Simd};
    use pulp::cast;
    use pulp::x86::{V3 as Avx2, V4 as Avx512};

    impl Simd for Avx2 {
        type Vector = Lanes<Self, 2>;
    }

    impl Registers<2> for Avx2 {
        #[inline(always)]
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "four bits each"
        )]
        fn reaches(self, left: [Self::f64s; 2], right: [Self::f64s; 2]) -> u8 {
            let bits = |k: usize| {
                self.avx
                    ._mm256_movemask_pd(cast!(self.cmp_ge_f64x4(left[k], right[k])))
            };
            (bits(0) | (bits(1) << 4)) as u8
        }

        #[inline(always)]
        fn to_next_lane(self, registers: [Self::f64s; 2]) -> [Self::f64s; 2] {
            let avx = self.avx;
            let [low, high] = registers.map(|register| cast!(register));
            // 0 0 l0 l1 and l2 l3 h0 h1, each then shifted by one against the register itself.
            let before_low = avx._mm256_permute2f128_pd::<0x08>(low, low);
            let before_high = avx._mm256_permute2f128_pd::<0x21>(low, high);
            [(before_low, low), (before_high, high)]
                .map(|(before, register)| cast!(avx._mm256_shuffle_pd::<0b0101>(before, register)))
        }

        #[inline(always)]
        fn to_lane_before(self, registers: [Self::f64s; 2]) -> [Self::f64s; 2] {
            let avx = self.avx;
            let [low, high] = registers.map(|register| cast!(register));
            // l2 l3 h0 h1 and h2 h3 0 0.
            let after_low = avx._mm256_permute2f128_pd::<0x21>(low, high);
            let after_high = avx._mm256_permute2f128_pd::<0x81>(high, high);
            [(low, after_low), (high, after_high)]
                .map(|(register, after)| cast!(avx._mm256_shuffle_pd::<0b0101>(register, after)))
        }
    }

    impl Simd for Avx512 {
        type Vector = Lanes<Self, 1>;
        const HAS_MANY_REGISTERS: bool = true;
    }

    impl Registers<1> for Avx512 {
        #[inline(always)]
        fn reaches(self, [left]: [Self::f64s; 1], [right]: [Self::f64s; 1]) -> u8 {
            self.cmp_ge_f64x8(left, right).0
        }

        #[inline(always)]
        fn to_next_lane(self, [register]: [Self::f64s; 1]) -> [Self::f64s; 1] {
            [cast!(self.avx512f._mm512_alignr_epi64::<7>(
                cast!(register),
                self.avx512f._mm512_setzero_si512()
            ))]
        }

        #[inline(always)]
        fn to_lane_before(self, [register]: [Self::f64s; 1]) -> [Self::f64s; 1] {
            [cast!(self.avx512f._mm512_alignr_epi64::<1>(
                self.avx512f._mm512_setzero_si512(),
                cast!(register)
            ))]
        }
    }
}
