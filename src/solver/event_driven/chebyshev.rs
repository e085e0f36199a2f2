//! Chebyshev propagator: carries the free motion over many periods at once, by Chebyshev polynomials of the stiffness
//! matrix.
//!
//! Source: H. Tal-Ezer and R. Kosloff, J. Chem. Phys. 81, 3967 (1984), in the form for equations of second order in
//! time: D. Kosloff et al., Geophys. Prospect. 37, 383 (1989).
//!
//! With u = e^{γt/2} y the free motion obeys u'' = -A u, A = S'/m, so that
//!
//! ```text
//! u(t)  = cos(t√A) u(0) + sin(t√A)/√A u'(0)
//! u'(t) = cos(t√A) u'(0) - A sin(t√A)/√A u(0)
//! ```
//!
//! The spectrum of A lies in (0, Λ]. In x = 2A/Λ - 1 and θ = t√Λ, the Jacobi-Anger expansion gives
//!
//! ```text
//! cos(t√A)       = J_0 + 2 Σ (-1)^k J_2k(θ) T_k(x)
//! √Λ sin(t√A)/√A = s_0 + 2 Σ (-1)^k s_k T_k(x),    s_k = 2 Σ_{m>=k} J_{2m+1}(θ)
//! ```
//!
//! With A = Λ (x + 1)/2, the series of the last term follows from that of the sine. The Bessel functions vanish fast
//! beyond their argument: some θ/2 products with A carry the motion over θ, a third of what Taylor steps need, and
//! nothing is evaluated on the way. Contract: each term left out is at most a given part of the motion.

use super::chain::{Chain, State};
use super::layout::Layout;
use crate::model::simd::{Simd, Vector};
use crate::model::{LANES, Row};

/// Terms kept beyond θ, as a multiple of θ^(1/3) and in any case: J_n(θ) has fallen under 1e-17 there.
const TAIL: f64 = 12.0;
const MIN_TAIL: f64 = 10.0;

/// Two vectors: u(0) and u'(0), or what became of them.
type Pair = [Vec<Row>; 2];

/// The propagator and its work space.
#[derive(Clone, Debug)]
pub(super) struct ChebyshevPropagator {
    /// T_{k-1} and T_k, applied to u(0) and to u'(0), which T_0 leaves as they are.
    before: Pair,
    pub here: Pair,
    /// u(t) and u'(t).
    sums: Pair,
    /// Diagonal and neighbours' entries of 2A/Λ - 1.
    diagonal: Vec<Row>,
    coupling: Vec<Row>,
    bessel: Vec<f64>,
    /// Coefficients of T_k: of the cosine, of the sine over √A, of the sine times √A.
    weights: Vec<[f64; 3]>,
}

impl ChebyshevPropagator {
    pub fn new(layout: Layout) -> Self {
        let rows = || layout.filled(0.0);
        let pair = || [rows(), rows()];
        Self {
            before: pair(),
            here: pair(),
            sums: pair(),
            diagonal: rows(),
            coupling: rows(),
            bessel: Vec::new(),
            weights: Vec::new(),
        }
    }

    /// Adds the free motion `seconds` s after u(0) and u'(0), which `here` holds, to a state, y = u e^{-γt/2} and
    /// w = u' e^{-γt/2} - γ y/2, where `left` is e^{-γt/2}. `error` is the part of it that may be left out.
    #[inline(always)]
    pub fn carry<S: Simd>(&mut self, simd: S, chain: &Chain, [seconds, left, error]: [f64; 3], state: &mut State) {
        self.propagate(simd, chain, seconds, error);
        let half = 0.5 * chain.damping_rate;
        let [displaced, moved] = &self.sums;
        for (((x, v), u), rate) in state.displacement.iter_mut().zip(&mut state.velocity).zip(displaced).zip(moved) {
            for lane in 0..LANES {
                x[lane] += left * u[lane];
                v[lane] += left * (rate[lane] - half * u[lane]);
            }
        }
    }

    /// Carries u and u' over `seconds` s; `error` is the part of them that may be left out.
    #[inline(always)]
    fn propagate<S: Simd>(&mut self, simd: S, chain: &Chain, seconds: f64, error: f64) {
        let rows = self.diagonal.len();
        let shift = 0.25 * chain.damping_rate * chain.damping_rate;
        let mut widest = 0.0_f64;
        for (diagonal, coupling) in chain.diagonal.iter().zip(&chain.coupling) {
            for l in 0..LANES {
                widest = widest.max(diagonal[l] + 2.0 * coupling[l]);
            }
        }
        let scale = 2.0 / widest;
        for r in 0..rows {
            for l in 0..LANES {
                // In padding both are zero there, and zeros stay zero.
                self.diagonal[r][l] = scale * (chain.diagonal[r][l] - shift) - 1.0;
                self.coupling[r][l] = -scale * chain.coupling[r][l];
            }
        }
        self.update_weights(widest, seconds * widest.sqrt(), error);
        for pair in [&mut self.before, &mut self.sums] {
            for rows in pair {
                rows.fill(Row::filled(0.0));
            }
        }
        add_terms(simd, &self.here, &mut self.sums, self.weights[0]);
        for k in 1..self.weights.len() {
            // T_1 = x T_0, then T_{k+1} = 2x T_k - T_{k-1}, written over T_{k-1}.
            let twice = simd.splat(if k == 1 { 1.0 } else { 2.0 });
            for (here, before) in self.here.iter().zip(&mut self.before) {
                recur(simd, [&self.diagonal, &self.coupling], here, before, twice);
            }
            add_terms(simd, &self.before, &mut self.sums, self.weights[k]);
            std::mem::swap(&mut self.before, &mut self.here);
        }
    }

    /// The coefficients for a spectrum up to Λ and θ = t√Λ, as far as they exceed `error`.
    fn update_weights(&mut self, widest: f64, angle: f64, error: f64) {
        bessel(angle, &mut self.bessel);
        let (pairs, _) = self.bessel.as_chunks::<2>();
        let terms = pairs.iter().rposition(|pair| pair[0].abs().max(pair[1].abs()) > error).map_or(1, |last| last + 1);
        self.weights.clear();
        self.weights.resize(terms + 1, [0.0; 3]);
        let mut sum = 0.0;
        for (k, [even, odd]) in pairs.iter().enumerate().rev() {
            sum += 2.0 * odd;
            if k < terms {
                let twice = [1.0, -2.0, 2.0][if k == 0 { 0 } else { 2 - k % 2 }];
                self.weights[k] = [twice * even, twice * sum / widest.sqrt(), 0.0];
            }
        }
        // (x + 1) Λ/2 times the sine's series, with x T_0 = T_1 and x T_k = (T_{k-1} + T_{k+1})/2.
        for k in 0..terms {
            let below = match k {
                0 => 0.0,
                1 => 2.0 * self.weights[0][1],
                _ => self.weights[k - 1][1],
            };
            let [_, here, _] = self.weights[k];
            self.weights[k][2] = 0.5 * widest * (here + 0.5 * (below + self.weights[k + 1][1]));
        }
        self.weights.truncate(terms);
    }
}

/// `twice` x times one term, minus the term before it, which `next` holds.
#[inline(always)]
fn recur<S: Simd>(simd: S, [diagonal, coupling]: [&[Row]; 2], terms: &[Row], next: &mut [Row], twice: S::Vector) {
    let last = terms.len() - 1;
    let mut before = simd.load(&terms[last]).to_next_lane();
    let mut here = simd.load(&terms[0]);
    let last_after = here.to_lane_before();
    for (((next, diagonal), coupling), after) in
        next[..last].iter_mut().zip(&diagonal[..last]).zip(&coupling[..last]).zip(&terms[1..])
    {
        let after = simd.load(after);
        let product = here.mul_add(simd.load(diagonal), before.plus(after).times(simd.load(coupling)));
        product.mul_add(twice, simd.splat(0.0).minus(simd.load(next))).store(next);
        (before, here) = (here, after);
    }
    let product = here.mul_add(simd.load(&diagonal[last]), before.plus(last_after).times(simd.load(&coupling[last])));
    product.mul_add(twice, simd.splat(0.0).minus(simd.load(&next[last]))).store(&mut next[last]);
}

/// Adds T_k, applied to u(0) and to u'(0), to u(t) and u'(t).
#[inline(always)]
fn add_terms<S: Simd>(simd: S, [displaced, moved]: &Pair, sums: &mut Pair, [cosine, sine, rooted]: [f64; 3]) {
    let (cosine, sine, rooted) = (simd.splat(cosine), simd.splat(sine), simd.splat(-rooted));
    let [displacement, velocity] = sums;
    for (((displaced, moved), x), v) in displaced.iter().zip(moved).zip(displacement).zip(velocity) {
        let (displaced, moved) = (simd.load(displaced), simd.load(moved));
        displaced.mul_add(cosine, moved.mul_add(sine, simd.load(x))).store(x);
        moved.mul_add(cosine, displaced.mul_add(rooted, simd.load(v))).store(v);
    }
}

/// J_0(θ), J_1(θ), ... in pairs as far as they matter, by Miller's backward recurrence.
fn bessel(argument: f64, values: &mut Vec<f64>) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of terms")]
    let pairs = (0.5 * (argument + TAIL * libm::cbrt(argument) + MIN_TAIL)).ceil() as usize + 1;
    values.clear();
    values.resize(2 * pairs, 0.0);
    let twice_inverse = 2.0 / argument;
    let (mut above, mut here) = (0.0, 1e-280);
    // J_0 + 2 (J_2 + J_4 + ...) = 1.
    let mut norm = 0.0;
    for n in (0..2 * pairs).rev() {
        values[n] = here;
        if n % 2 == 0 {
            norm += if n == 0 { here } else { 2.0 * here };
        }
        let below = n as f64 * twice_inverse * here - above;
        (above, here) = (here, below);
    }
    let inverse = 1.0 / norm;
    for value in values {
        *value *= inverse;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bessel_functions_are_those_of_the_library() {
        let mut values = Vec::new();
        for argument in [0.01, 1.0, 7.5, 60.0, 1234.5] {
            bessel(argument, &mut values);
            assert!(values[values.len() - 1].abs() < 1e-17, "the tail at {argument} is {:e}", values[values.len() - 1]);
            for (n, value) in values.iter().enumerate() {
                let expected = libm::jn(i32::try_from(n).unwrap(), argument);
                assert!((value - expected).abs() < 1e-14, "J_{n}({argument}) = {value}, not {expected}");
            }
        }
    }
}
