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

use super::lanes::{LANES, Row, flat, flat_mut, ghost_after, ghost_before};
use super::taylor::Chain;

/// Terms kept beyond θ, as a multiple of θ^(1/3) and in any case: J_n(θ) has fallen under 1e-17 there.
const TAIL: f64 = 12.0;
const LEAST_TAIL: f64 = 10.0;

/// Work space: vectors of the recurrence with a ghost row before and after.
#[derive(Clone, Debug)]
pub(super) struct Glide {
    rows: usize,
    /// T_{k-1} and T_k applied to u(0) and to u'(0).
    before: [Vec<Row>; 2],
    here: [Vec<Row>; 2],
    /// Sums with the coefficients of the cosine and of the sine, for u(0) and u'(0).
    cosine: [Vec<Row>; 2],
    sine: [Vec<Row>; 2],
    /// Diagonal and coupling of 2A/Λ - 1.
    diagonal: Vec<Row>,
    coupling: Vec<Row>,
    bessel: Vec<f64>,
}

impl Glide {
    pub fn new(rows: usize) -> Self {
        let ghosted = || [vec![Row::filled(0.0); rows + 2], vec![Row::filled(0.0); rows + 2]];
        let plain = || vec![Row::filled(0.0); rows];
        Self {
            rows,
            before: ghosted(),
            here: ghosted(),
            cosine: [plain(), plain()],
            sine: [plain(), plain()],
            diagonal: plain(),
            coupling: plain(),
            bessel: Vec::new(),
        }
    }

    /// Where u(0) and u'(0) of a block are put before [`advance`].
    pub fn start(&mut self, row: usize, lane: usize, displacement: f64, velocity: f64) {
        self.here[0][row + 1][lane] = displacement;
        self.here[1][row + 1][lane] = velocity;
    }

    /// u(t) and u'(t) of a block after [`advance`].
    pub fn end(&self, row: usize, lane: usize) -> (f64, f64) {
        (self.cosine[0][row][lane], self.cosine[1][row][lane])
    }
}

/// Carries u and u' over so many seconds.
#[inline(always)]
pub(super) fn advance(chain: &Chain, seconds: f64, glide: &mut Glide) {
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
            glide.coupling[r][l] = scale * chain.coupling[r][l];
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
        close(&mut glide.here[which]);
        let (even, odd) = (glide.bessel[0], glide.bessel[1]);
        for r in 0..rows {
            let start = glide.here[which][r + 1];
            glide.cosine[which][r] = Row(start.map(|x| even * x));
            glide.sine[which][r] = Row(start.map(|x| odd * x));
        }
    }
    for k in 1..terms {
        let sign = if k % 2 == 0 { 2.0 } else { -2.0 };
        let (even, odd) = (sign * glide.bessel[2 * k], sign * glide.bessel[2 * k + 1]);
        // T_1 = x T_0, then T_{k+1} = 2x T_k - T_{k-1}, written over T_{k-1}.
        let (twice, keep) = if k == 1 { (1.0, 0.0) } else { (2.0, 1.0) };
        for which in 0..2 {
            recur(
                [&glide.diagonal, &glide.coupling],
                &glide.here[which],
                &mut glide.before[which],
                [twice, keep],
                [&mut glide.cosine[which], &mut glide.sine[which]],
                [even, odd],
            );
            close(&mut glide.before[which]);
        }
        std::mem::swap(&mut glide.before, &mut glide.here);
    }
    finish(chain, shift, glide);
}

/// One term of the recurrence and of both sums.
#[inline(always)]
fn recur(
    [diagonal, coupling]: [&[Row]; 2],
    here: &[Row],
    next: &mut [Row],
    [twice, keep]: [f64; 2],
    [cosine, sine]: [&mut [Row]; 2],
    [even, odd]: [f64; 2],
) {
    let entries = diagonal.len() * LANES;
    let (diagonal, coupling) = (&flat(diagonal)[..entries], &flat(coupling)[..entries]);
    let (left, middle, right) = (&flat(here)[..entries], &flat(&here[1..])[..entries], &flat(&here[2..])[..entries]);
    let next = &mut flat_mut(&mut next[1..])[..entries];
    let (cosine, sine) = (&mut flat_mut(cosine)[..entries], &mut flat_mut(sine)[..entries]);
    for i in 0..entries {
        let product = diagonal[i] * middle[i] - coupling[i] * (left[i] + right[i]);
        let term = twice * product - keep * next[i];
        next[i] = term;
        cosine[i] += even * term;
        sine[i] += odd * term;
    }
}

/// u = cos u(0) + sin u'(0) and u' = cos u'(0) - A sin u(0), into `cosine`.
#[inline(always)]
fn finish(chain: &Chain, shift: f64, glide: &mut Glide) {
    let rows = glide.rows;
    for r in 0..rows {
        glide.here[0][r + 1] = glide.sine[0][r];
    }
    close(&mut glide.here[0]);
    for r in 0..rows {
        let (left, middle, right) = (glide.here[0][r], glide.here[0][r + 1], glide.here[0][r + 2]);
        for l in 0..LANES {
            let stiff = (chain.diagonal[r][l] - shift) * middle[l] - chain.coupling[r][l] * (left[l] + right[l]);
            glide.cosine[1][r][l] -= stiff;
            glide.cosine[0][r][l] += glide.sine[1][r][l];
        }
    }
}

/// Fills the ghost rows.
#[inline(always)]
fn close(rows: &mut [Row]) {
    let last = rows.len() - 2;
    rows[0] = ghost_before(&rows[last]);
    rows[last + 1] = ghost_after(&rows[1]);
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
