//! Free motion over many periods at once, by Chebyshev polynomials of the stiffness matrix.
//!
//! With u = e^{γt/2} y the free motion obeys u'' = -A u, A = S'/m, so that
//!
//! ```text
//! u(t)  = cos(t√A) u(0) + sin(t√A)/√A u'(0)
//! u'(t) = cos(t√A) u'(0) - A sin(t√A)/√A u(0)
//! ```
//!
//! The spectrum of A lies in (0, Λ]. In x = 2A/Λ - 1 and θ = t√Λ, the Jacobi-Anger expansion gives
//! cos(t√A) = J_0 + 2 Σ (-1)^k J_2k(θ) T_k(x) and √Λ sin(t√A)/√A = s_0 + 2 Σ (-1)^k s_k T_k(x) with
//! s_k = 2 Σ_{m>=k} J_{2m+1}(θ). The Bessel functions vanish fast beyond their argument: some θ/2 products with A carry the
//! motion over θ, a third of what Taylor steps need, and nothing is evaluated on the way. Contract: errors of rounding
//! only.

use super::lanes::{LANES, Layout, Row};
use super::taylor::Chain;
use super::vector::Vector;

/// Terms kept beyond θ, as a multiple of θ^(1/3) and in any case: J_n(θ) has fallen under 1e-17 there.
const TAIL: f64 = 12.0;
const LEAST_TAIL: f64 = 10.0;

/// Work space of the recurrence.
#[derive(Clone, Debug)]
pub(super) struct Glide {
    rows: usize,
    /// T_{k-1} and T_k applied to u(0) and to u'(0).
    before: [Vec<Row>; 2],
    here: [Vec<Row>; 2],
    /// Sums with the coefficients of the cosine and of the sine, for u(0) and u'(0).
    cosine: [Vec<Row>; 2],
    sine: [Vec<Row>; 2],
    /// Diagonal and neighbours' entries of 2A/Λ - 1.
    diagonal: Vec<Row>,
    coupling: Vec<Row>,
    bessel: Vec<f64>,
}

impl Glide {
    pub fn new(rows: usize) -> Self {
        let rows_of = || vec![Row::filled(0.0); rows];
        let pair = || [rows_of(), rows_of()];
        Self {
            rows,
            before: pair(),
            here: pair(),
            cosine: pair(),
            sine: pair(),
            diagonal: rows_of(),
            coupling: rows_of(),
            bessel: Vec::new(),
        }
    }

    /// Takes u(0) and u'(0), one entry a block.
    pub fn start(&mut self, layout: Layout, displacement: &[f64], velocity: &[f64]) {
        layout.fold(displacement, &mut self.here[0]);
        layout.fold(velocity, &mut self.here[1]);
    }

    /// Tells u(t) and u'(t) after [`advance`], one entry a block.
    pub fn end(&self, layout: Layout, displacement: &mut [f64], velocity: &mut [f64]) {
        layout.unfold(&self.cosine[0], displacement);
        layout.unfold(&self.cosine[1], velocity);
    }
}

/// Carries u and u' over so many seconds.
#[inline(always)]
pub(super) fn advance<V: Vector>(chain: &Chain, seconds: f64, glide: &mut Glide) {
    let rows = glide.rows;
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
            glide.diagonal[r][l] = scale * (chain.diagonal[r][l] - shift) - 1.0;
            glide.coupling[r][l] = -scale * chain.coupling[r][l];
        }
    }
    let root = widest.sqrt();
    bessel(seconds * root, &mut glide.bessel);
    let terms = glide.bessel.len() / 2;
    // s_k √Λ⁻¹ in place of the odd Bessel functions, from the far end.
    let mut sum = 0.0;
    for k in (0..terms).rev() {
        sum += 2.0 * glide.bessel[2 * k + 1];
        glide.bessel[2 * k + 1] = sum / root;
    }
    for which in 0..2 {
        let (even, odd) = (glide.bessel[0], glide.bessel[1]);
        for r in 0..rows {
            let start = glide.here[which][r];
            glide.cosine[which][r] = Row(start.map(|x| even * x));
            glide.sine[which][r] = Row(start.map(|x| odd * x));
            glide.before[which][r] = Row::filled(0.0);
        }
    }
    for k in 1..terms {
        let sign = if k % 2 == 0 { 2.0 } else { -2.0 };
        let weights = [V::splat(sign * glide.bessel[2 * k]), V::splat(sign * glide.bessel[2 * k + 1])];
        // T_1 = x T_0, then T_{k+1} = 2x T_k - T_{k-1}, written over T_{k-1}.
        let twice = V::splat(if k == 1 { 1.0 } else { 2.0 });
        for which in 0..2 {
            recur::<V>(
                [&glide.diagonal, &glide.coupling],
                &glide.here[which],
                &mut glide.before[which],
                twice,
                [&mut glide.cosine[which], &mut glide.sine[which]],
                weights,
            );
        }
        std::mem::swap(&mut glide.before, &mut glide.here);
    }
    finish::<V>(chain, shift, glide);
}

/// One term of the recurrence and of both sums.
#[inline(always)]
fn recur<V: Vector>(
    [diagonal, coupling]: [&[Row]; 2],
    terms: &[Row],
    next: &mut [Row],
    twice: V,
    [cosine, sine]: [&mut [Row]; 2],
    [even, odd]: [V; 2],
) {
    let last = terms.len() - 1;
    let mut before = V::load(&terms[last]).to_next_lane();
    let mut here = V::load(&terms[0]);
    let last_after = here.to_lane_before();
    let sums = cosine[..last].iter_mut().zip(&mut sine[..last]);
    let stencil = diagonal[..last].iter().zip(&coupling[..last]);
    for (((next, sums), stencil), after) in next[..last].iter_mut().zip(sums).zip(stencil).zip(&terms[1..]) {
        let after = V::load(after);
        add_term::<V>(before.plus(after), here, stencil, next, twice, sums, [even, odd]);
        (before, here) = (here, after);
    }
    let stencil = (&diagonal[last], &coupling[last]);
    let sums = (&mut cosine[last], &mut sine[last]);
    add_term::<V>(before.plus(last_after), here, stencil, &mut next[last], twice, sums, [even, odd]);
}

#[inline(always)]
fn add_term<V: Vector>(
    around: V,
    here: V,
    (diagonal, coupling): (&Row, &Row),
    next: &mut Row,
    twice: V,
    (cosine, sine): (&mut Row, &mut Row),
    [even, odd]: [V; 2],
) {
    let product = here.fused(V::load(diagonal), around.times(V::load(coupling)));
    let term = product.fused(twice, V::splat(0.0).minus(V::load(next)));
    term.store(next);
    term.fused(even, V::load(cosine)).store(cosine);
    term.fused(odd, V::load(sine)).store(sine);
}

/// u = cos u(0) + sin u'(0) and u' = cos u'(0) - A sin u(0), into `cosine`.
#[inline(always)]
fn finish<V: Vector>(chain: &Chain, shift: f64, glide: &mut Glide) {
    let rows = glide.rows;
    let [displaced, moved] = &glide.sine;
    let mut before = V::load(&displaced[rows - 1]).to_next_lane();
    let mut here = V::load(&displaced[0]);
    let end = here.to_lane_before();
    for r in 0..rows {
        let after = if r + 1 < rows { V::load(&displaced[r + 1]) } else { end };
        let diagonal = V::splat(shift).minus(V::load(&chain.diagonal[r]));
        let pulled = before.plus(after).fused(V::load(&chain.coupling[r]), V::load(&glide.cosine[1][r]));
        here.fused(diagonal, pulled).store(&mut glide.cosine[1][r]);
        V::load(&glide.cosine[0][r]).plus(V::load(&moved[r])).store(&mut glide.cosine[0][r]);
        (before, here) = (here, after);
    }
}

/// J_0(θ), J_1(θ), ... in pairs as far as they matter, by Miller's backward recurrence.
fn bessel(argument: f64, values: &mut Vec<f64>) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of terms")]
    let pairs = (0.5 * (argument + TAIL * libm::cbrt(argument) + LEAST_TAIL)).ceil() as usize + 1;
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
