//! Polynomials on [0, 1], given by their coefficients: values, extremes, and first crossings of a level.
//!
//! Contract: no extreme is missed; and no crossing but one that touches the level within rounding. The first crossing
//! found is the first: an interval is dismissed only if a bound on the excursion excludes the level, or the polynomial
//! falls throughout.
//!
//! Method: `Σ_{p>=1} |c_p| w^p` bounds the excursion from the middle of an interval of half-width w. An interval where
//! the derivative keeps its sign by that bound holds no extreme; one where the second derivative does holds at most
//! one, found by Newton's method; any other is halved.

/// Largest number of coefficients that [`maximum`] takes.
pub(crate) const MAX_COEFFICIENTS: usize = 33;

/// Halvings after which an interval counts as a point: 2^-40 of a step.
const MAX_HALVINGS: u32 = 40;

/// A Newton step below this part of its argument leaves an error of the order of its square: rounding.
pub(crate) const QUADRATIC: f64 = 1e-9;

/// 1/p; 0 for p = 0.
pub(crate) const INVERSE: [f64; MAX_COEFFICIENTS] = {
    let mut inverse = [0.0; MAX_COEFFICIENTS];
    let mut p = 1;
    while p < MAX_COEFFICIENTS {
        inverse[p] = 1.0 / p as f64;
        p += 1;
    }
    inverse
};

/// `Σ c_p s^p`. Even and odd orders are summed side by side, since each sum waits for its last term.
pub(crate) fn value(coefficients: &[f64], s: f64) -> f64 {
    let square = s * s;
    let pairs = coefficients.chunks_exact(2);
    let last = pairs.remainder().first().copied().unwrap_or(0.0);
    let (even, odd) = pairs.rev().fold((last, 0.0), |(even, odd), pair| {
        (even * square + pair[0], odd * square + pair[1])
    });
    even + s * odd
}

/// `Σ p (p-1) |c_p|`: a bound on the second derivative on [0, 1]. Two sums side by side.
pub(crate) fn second_derivative_bound(coefficients: &[f64]) -> f64 {
    let mut sums = [0.0; 2];
    for (p, coefficient) in coefficients.iter().enumerate() {
        let order = p as f64;
        sums[p % 2] += order * (order - 1.0) * coefficient.abs();
    }
    sums[0] + sums[1]
}

/// The first three coefficients in the variable s - `centre`: value, slope, and half the second derivative. As in
/// [`value`], with the derivatives of both sums by s².
pub(crate) fn expanded(coefficients: &[f64], centre: f64) -> [f64; 3] {
    let square = centre * centre;
    let (pairs, rest) = coefficients.as_chunks::<2>();
    let mut sums = [rest.first().copied().unwrap_or(0.0), 0.0];
    let mut slopes = [0.0; 2];
    let mut half_curvatures = [0.0; 2];
    for pair in pairs.iter().rev() {
        for i in 0..2 {
            half_curvatures[i] = half_curvatures[i] * square + slopes[i];
            slopes[i] = slopes[i] * square + sums[i];
            sums[i] = sums[i] * square + pair[i];
        }
    }
    let along = |of: [f64; 2]| of[0] + centre * of[1];
    [
        along(sums),
        sums[1] + 2.0 * centre * along(slopes),
        slopes[0] + 3.0 * centre * slopes[1] + 4.0 * square * along(half_curvatures),
    ]
}

/// `Σ_{p>=2} |c_p|` and `Σ_{p>=2} p |c_p|`: bounds on [0, 1] for what the terms beyond the linear one add to the value
/// and to the slope.
pub(crate) fn beyond_linear(coefficients: &[f64]) -> (f64, f64) {
    let mut value_spread = 0.0;
    let mut slope_spread = 0.0;
    for c in coefficients.iter().skip(2).rev() {
        value_spread += c.abs();
        slope_spread += value_spread;
    }
    (value_spread, slope_spread + value_spread)
}

/// `Σ c_p s^p`, and its integral from 0 to s, `Σ c_p s^(p+1)/(p+1)`.
pub(crate) fn value_and_integral(coefficients: &[f64], s: f64) -> (f64, f64) {
    let square = s * s;
    let (pairs, rest) = coefficients.as_chunks::<2>();
    let last = rest.first().copied().unwrap_or(0.0);
    let mut sums = [last, 0.0];
    let mut integrals = [last * INVERSE[coefficients.len()], 0.0];
    for (pair, inverse) in pairs.iter().zip(INVERSE[1..].as_chunks::<2>().0).rev() {
        for i in 0..2 {
            sums[i] = sums[i] * square + pair[i];
            integrals[i] = integrals[i] * square + pair[i] * inverse[i];
        }
    }
    (sums[0] + s * sums[1], s * (integrals[0] + s * integrals[1]))
}

/// The largest or the least value of a function, and where it has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extreme {
    pub at: f64,
    pub value: f64,
}

/// Where the polynomial is largest on [`first`, `last`].
pub(crate) fn maximum(coefficients: &[f64], first: f64, last: f64) -> Extreme {
    let at = |s: f64| Extreme {
        at: s,
        value: value(coefficients, s),
    };
    let mut best = at(first);
    let mut offer = |s: f64| {
        let candidate = at(s);
        if candidate.value > best.value {
            best = candidate;
        }
    };
    offer(last);
    for_each_turn(coefficients, first, last, &mut offer);
    best
}

/// Where the derivative changes its sign on [`first`, `last`], in order. Nowhere, if a coefficient is not finite:
/// halving would not end before its last depth.
pub(crate) fn for_each_turn(
    coefficients: &[f64],
    first: f64,
    last: f64,
    found: &mut impl FnMut(f64),
) {
    let order = coefficients.len() - 1;
    let mut derivative = [0.0; MAX_COEFFICIENTS];
    for p in 1..=order {
        derivative[p - 1] = p as f64 * coefficients[p];
    }
    // Nor is a sum that overflows.
    if !derivative
        .iter()
        .map(|coefficient| coefficient.abs())
        .sum::<f64>()
        .is_finite()
    {
        return;
    }
    for_each_root(
        &derivative[..order.max(1)],
        first,
        last,
        MAX_HALVINGS,
        found,
    );
}

/// The same polynomial in the variable r, which runs from -1 to 1 as s does from `low` to `high`.
fn rescaled(coefficients: &[f64], low: f64, high: f64) -> [f64; MAX_COEFFICIENTS] {
    let half = 0.5 * (high - low);
    let centre = 0.5 * (low + high);
    let mut about = [0.0; MAX_COEFFICIENTS];
    about[..coefficients.len()].copy_from_slice(coefficients);
    for p in 0..coefficients.len() {
        for q in (p..coefficients.len() - 1).rev() {
            about[q] += centre * about[q + 1];
        }
    }
    let mut power = 1.0;
    for coefficient in &mut about[..coefficients.len()] {
        *coefficient *= power;
        power *= half;
    }
    about
}

fn for_each_root(
    coefficients: &[f64],
    low: f64,
    high: f64,
    depth: u32,
    found: &mut impl FnMut(f64),
) {
    let middle = 0.5 * (low + high);
    let about = &rescaled(coefficients, low, high)[..coefficients.len()];
    let (value_spread, slope_spread) = beyond_linear(about);
    let slope = about.get(1).map_or(0.0, |c| c.abs());
    if about[0].abs() > slope + value_spread {
        return;
    }
    if about.len() < 3 || slope > slope_spread {
        if let Some(root) = root_between(coefficients, low, high) {
            found(root);
        }
    } else if depth == 0 {
        found(middle);
    } else {
        for_each_root(coefficients, low, middle, depth - 1, found);
        for_each_root(coefficients, middle, high, depth - 1, found);
    }
}

/// The root of a polynomial that is monotone on [low, high], if it has one there.
fn root_between(coefficients: &[f64], low: f64, high: f64) -> Option<f64> {
    let rises = value(coefficients, high) > 0.0;
    if (value(coefficients, low) > 0.0) == rises {
        return None;
    }
    let sign = if rises { 1.0 } else { -1.0 };
    Some(rising_root(low, high, 0.5 * (low + high), QUADRATIC, |s| {
        let [value, slope, _] = expanded(coefficients, s);
        newton_step(s, sign * value, sign * slope)
    }))
}

/// A step of third order below this part of its argument leaves an error of the order of its cube: rounding, unless the
/// slope vanishes within a thousandth.
pub(crate) const CUBIC: f64 = 1e-7;

/// The value of a function, and where Newton's step from s leads.
pub(crate) fn newton_step(s: f64, value: f64, slope: f64) -> (f64, f64) {
    (value, s - value / slope)
}

/// The value of a polynomial, and where Halley's step from s leads.
pub(crate) fn halley_step(coefficients: &[f64], s: f64) -> (f64, f64) {
    let [value, slope, half_curvature] = expanded(coefficients, s);
    let next = s - value * slope / (slope * slope - value * half_curvature);
    (value, next)
}

/// Root of a function that rises through zero once between `low` and `high`, sought from `first`: steps of Newton or
/// Halley, bisection where they leave the bracket. A step that is `small` beside the bracket is the last. Returns the
/// last iterate, never a stale end of the bracket.
#[inline]
pub(crate) fn rising_root(
    mut low: f64,
    mut high: f64,
    first: f64,
    small: f64,
    value_and_step: impl Fn(f64) -> (f64, f64),
) -> f64 {
    // Strictly inside, or steps might alternate between the ends for ever.
    let inside = |s: f64, low: f64, high: f64| {
        if s > low && s < high {
            s
        } else {
            0.5 * (low + high)
        }
    };
    let mut s = inside(first, low, high);
    loop {
        let (value, step) = value_and_step(s);
        if value >= 0.0 {
            high = s;
        } else {
            low = s;
        }
        let is_small = (step - s).abs() <= small * high.abs().max(low.abs());
        if is_small && (low..=high).contains(&step) {
            return step;
        }
        let next = inside(step, low, high);
        if next <= low || next >= high {
            return next;
        }
        s = next;
    }
}

/// First s in [`from`, `end`], within [0, 1], at which the polynomial leaves the open interval between two levels. The
/// coefficients are changed.
pub(crate) fn first_exit(
    coefficients: &mut [f64],
    [lower, upper]: [f64; 2],
    from: f64,
    end: f64,
) -> Option<f64> {
    let start = coefficients[0];
    let slope = coefficients[1];
    let (value_spread, slope_spread) = beyond_linear(coefficients);
    let mut first = None;
    if start + slope.max(0.0) + value_spread >= upper {
        coefficients[0] = start - upper;
        first = first_reach(coefficients, slope_spread, from, end);
    }
    if start + slope.min(0.0) - value_spread <= lower {
        coefficients[0] = start - lower;
        for coefficient in &mut *coefficients {
            *coefficient = -*coefficient;
        }
        first = first_reach(coefficients, slope_spread, from, first.unwrap_or(end)).or(first);
    }
    first
}

/// First s in [`from`, `end`] at which the polynomial is not below zero. What is beyond its linear term changes the
/// slope by at most `slope_spread`.
fn first_reach(coefficients: &[f64], slope_spread: f64, from: f64, end: f64) -> Option<f64> {
    let [here, slope, half_curvature] = if from > 0.0 {
        expanded(coefficients, from)
    } else {
        [coefficients[0], coefficients[1], coefficients[2]]
    };
    if here >= 0.0 {
        return Some(from);
    }
    if coefficients[1].abs() > slope_spread {
        // Start where the parabola crosses.
        let guess = from
            - 2.0 * here
                / (slope
                    + (slope * slope - 4.0 * here * half_curvature)
                        .max(0.0)
                        .sqrt());
        return if slope > 0.0 {
            rise(coefficients, from, end, guess)
        } else {
            None
        };
    }
    first_in(coefficients, from, end, MAX_HALVINGS)
}

fn first_in(coefficients: &[f64], low: f64, high: f64, depth: u32) -> Option<f64> {
    let middle = 0.5 * (low + high);
    let half = 0.5 * (high - low);
    let about = &rescaled(coefficients, low, high)[..coefficients.len()];
    let (value_spread, slope_spread) = beyond_linear(about);
    let slope = about[1];
    if about[0] + slope.abs() + value_spread < 0.0 {
        return None;
    }
    if slope.abs() > slope_spread {
        // It may start at or above the level only if the interval before ended there.
        if value(about, -1.0) >= 0.0 {
            return Some(low);
        }
        let root = if slope > 0.0 {
            rise(about, -1.0, 1.0, -about[0] / slope)
        } else {
            None
        };
        return root.map(|r| (middle + half * r).clamp(low, high));
    }
    if depth == 0 {
        return (about[0] >= 0.0).then_some(middle);
    }
    first_in(coefficients, low, middle, depth - 1)
        .or_else(|| first_in(coefficients, middle, high, depth - 1))
}

/// The root of a polynomial that rises from below zero throughout [low, high], sought from `first`; `None` if it stays
/// below.
fn rise(coefficients: &[f64], low: f64, high: f64, first: f64) -> Option<f64> {
    (value(coefficients, high) >= 0.0)
        .then(|| rising_root(low, high, first, CUBIC, |s| halley_step(coefficients, s)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn turns_of_what_is_not_finite_end_at_once() {
        for bad in [f64::NAN, f64::INFINITY, f64::MAX] {
            let coefficients = [1.0, bad, -bad, bad, 0.5 * bad];
            for_each_turn(&coefficients, 0.0, 1.0, &mut |_| {
                panic!("there is no turn to find")
            });
        }
    }

    #[test]
    fn a_maximum_between_ends_that_both_fall_is_found() {
        // A narrow bump inside the interval, of which the ends show nothing.
        let coefficients = [0.0, -0.1, 0.0, 0.0, 16.0 * 0.5, -40.0 * 0.5, 24.5 * 0.5];
        let Extreme { at, value: largest } = maximum(&coefficients, 0.0, 1.0);
        let sampled = (0..=100_000)
            .map(|i| value(&coefficients, f64::from(i) * 1e-5))
            .fold(f64::MIN, f64::max);
        assert!(
            (largest - sampled).abs() < 1e-9,
            "{largest} at {at}, sampled {sampled}"
        );
    }

    #[test]
    fn newton_does_not_alternate_between_the_ends_for_ever() {
        // The arc tangent sends 1.39 to -1.39 and back.
        let swing = 1.391_745_200_270_735;
        let root = rising_root(-2.0, 2.0, swing, QUADRATIC, |s| {
            newton_step(s, libm::atan(s), 1.0 / (1.0 + s * s))
        });
        assert!(root.abs() < 1e-9, "{root}");
    }

    #[test]
    fn a_bump_that_just_reaches_the_level_is_not_missed() {
        // -(s - 0.3)² + 1e-10: above zero for 2e-5 of the step only.
        let coefficients = [-0.09 + 1e-10, 0.6, -1.0];
        let reached = first_exit(
            &mut coefficients.clone(),
            [f64::NEG_INFINITY, 0.0],
            0.0,
            1.0,
        )
        .unwrap();
        assert!((reached - (0.3 - 1e-5)).abs() < 1e-9, "{reached}");
        assert_eq!(
            first_exit(
                &mut [-0.09 - 1e-10, 0.6, -1.0],
                [f64::NEG_INFINITY, 0.0],
                0.0,
                1.0
            ),
            None
        );
        // The same from above, past its foot.
        let reached = first_exit(
            &mut coefficients.map(|c| -c),
            [0.0, f64::INFINITY],
            0.2,
            1.0,
        )
        .unwrap();
        assert!((reached - (0.3 - 1e-5)).abs() < 1e-9, "{reached}");
    }

    proptest! {
        #[test]
        fn no_sample_lies_above_the_maximum(
            coefficients in prop::collection::vec(-1.0_f64..1.0, 1..14), first in 0.0_f64..0.9, length in 0.01_f64..0.1
        ) {
            let last = first + length;
            let Extreme { at, value: largest } = maximum(&coefficients, first, last);
            prop_assert!((first..=last).contains(&at));
            for i in 0..=500 {
                prop_assert!(value(&coefficients, first + length * f64::from(i) / 500.0) <= largest + 1e-13);
            }
        }

        #[test]
        fn the_first_crossing_of_a_polynomial_is_the_first(
            coefficients in prop::collection::vec(-1.0_f64..1.0, 2..14),
            from in 0.0_f64..0.5,
            length in 0.05_f64..0.5,
            levels in (0.001_f64..1.0, 0.001_f64..1.0),
        ) {
            let start = value(&coefficients, from);
            let lower = start - levels.0;
            let upper = start + levels.1;
            let found = first_exit(&mut coefficients.clone(), [lower, upper], from, from + length);
            let until = found.unwrap_or(from + length);
            for i in 0..400 {
                let s = from + (until - from) * (1.0 - 1e-9) * f64::from(i) / 400.0;
                let here = value(&coefficients, s);
                prop_assert!(here < upper + 1e-12 && here > lower - 1e-12, "missed at {}", s);
            }
            if let Some(s) = found {
                let here = value(&coefficients, s);
                prop_assert!((here - upper).abs().min((here - lower).abs()) < 1e-12);
            }
        }
    }

    #[test]
    fn a_constant_never_crosses() {
        let constant = [0.391_297_004_391_785, 0.0];
        for level in [0.001, 0.05] {
            let levels = [constant[0] - level, constant[0] + level];
            assert_eq!(first_exit(&mut constant.to_vec(), levels, 0.0, 0.05), None);
        }
    }
}
