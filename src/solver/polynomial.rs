//! Polynomials on [0, end], given by their coefficients: values, and extremes that no wiggle escapes.
//!
//! Method: `Σ_{p>=1} |c_p| w^p` bounds the excursion from the middle of an interval of half-width w. An interval where
//! the derivative keeps its sign by that bound holds no extreme; one where the second derivative does holds at most one,
//! found by bisection; any other is halved.

/// Largest number of coefficients that [`maximum`] takes.
pub(crate) const MOST_COEFFICIENTS: usize = 33;

/// Halvings after which an interval counts as a point: 2^-40 of a step.
const DEEPEST: u32 = 40;

/// `Σ c_p s^p`.
pub(crate) fn value(coefficients: &[f64], s: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * s + c)
}

/// `Σ c_p s^p` and its derivative.
pub(crate) fn value_and_slope(coefficients: &[f64], s: f64) -> (f64, f64) {
    coefficients.iter().rev().fold((0.0, 0.0), |(value, slope), c| (value * s + c, slope * s + value))
}

/// `Σ c_p s^(p+1)/(p+1)`, the integral from 0 to s.
pub(crate) fn integral(coefficients: &[f64], s: f64) -> f64 {
    let terms = coefficients.iter().enumerate().rev();
    s * terms.fold(0.0, |sum, (p, c)| sum * s + c / (p + 1) as f64)
}

/// Where the polynomial is largest on [0, `end`], and its value there.
pub(crate) fn maximum(coefficients: &[f64], end: f64) -> (f64, f64) {
    let order = coefficients.len() - 1;
    let mut derivative = [0.0; MOST_COEFFICIENTS];
    for p in 1..=order {
        derivative[p - 1] = p as f64 * coefficients[p];
    }
    let derivative = &derivative[..order.max(1)];
    let mut best = (0.0, coefficients[0]);
    let mut offer = |s: f64| {
        let candidate = value(coefficients, s);
        if candidate > best.1 {
            best = (s, candidate);
        }
    };
    offer(end);
    if excursion(derivative, end) >= derivative[0].abs() {
        for_each_root(derivative, 0.0, end, DEEPEST, &mut offer);
    }
    best
}

/// `Σ_{p>=1} |c_p| w^p`: how far the value strays from c_0 within w.
pub(crate) fn excursion(coefficients: &[f64], width: f64) -> f64 {
    let terms = coefficients[1..].iter().rev();
    width * terms.fold(0.0, |sum, c| sum * width + c.abs())
}

/// The same polynomial in the variable s - `centre`.
pub(crate) fn shifted(coefficients: &[f64], centre: f64) -> [f64; MOST_COEFFICIENTS] {
    let mut about = [0.0; MOST_COEFFICIENTS];
    about[..coefficients.len()].copy_from_slice(coefficients);
    for p in 0..coefficients.len() {
        for q in (p..coefficients.len() - 1).rev() {
            about[q] += centre * about[q + 1];
        }
    }
    about
}

fn for_each_root(coefficients: &[f64], low: f64, high: f64, depth: u32, found: &mut impl FnMut(f64)) {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let about = shifted(coefficients, middle);
    let about = &about[..coefficients.len()];
    if about[0].abs() > excursion(about, half) {
        return;
    }
    let (mut slope_varies, mut power) = (0.0, 1.0);
    for (p, c) in about.iter().enumerate().skip(2) {
        power *= half;
        slope_varies += p as f64 * c.abs() * power;
    }
    let is_monotone = about.len() < 3 || about[1].abs() > slope_varies;
    if is_monotone {
        if let Some(root) = bisect(coefficients, low, high) {
            found(root);
        }
    } else if depth == 0 {
        found(middle);
    } else {
        for_each_root(coefficients, low, middle, depth - 1, found);
        for_each_root(coefficients, middle, high, depth - 1, found);
    }
}

fn bisect(coefficients: &[f64], mut low: f64, mut high: f64) -> Option<f64> {
    let rises = value(coefficients, high) > 0.0;
    if (value(coefficients, low) > 0.0) == rises {
        return None;
    }
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Some(middle);
        }
        if (value(coefficients, middle) > 0.0) == rises { high = middle } else { low = middle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_maximum_between_ends_that_both_fall_is_found() {
        // A narrow bump inside the interval, of which the ends show nothing.
        let coefficients = [0.0, -0.1, 0.0, 0.0, 16.0 * 0.5, -40.0 * 0.5, 24.5 * 0.5];
        let (at, most) = maximum(&coefficients, 1.0);
        let sampled = (0..=100_000).map(|i| value(&coefficients, f64::from(i) * 1e-5)).fold(f64::MIN, f64::max);
        assert!((most - sampled).abs() < 1e-9, "{most} at {at}, sampled {sampled}");
    }

    proptest! {
        #[test]
        fn no_sample_lies_above_the_maximum(
            coefficients in prop::collection::vec(-1.0_f64..1.0, 1..14), end in 0.01_f64..1.0
        ) {
            let (at, most) = maximum(&coefficients, end);
            prop_assert!((0.0..=end).contains(&at));
            for i in 0..=500 {
                prop_assert!(value(&coefficients, end * f64::from(i) / 500.0) <= most + 1e-13);
            }
        }
    }
}
