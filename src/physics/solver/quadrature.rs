//! Gauss-Legendre quadrature on [0, 1]: n nodes integrate polynomials of degree 2n - 1 exactly.

use std::f64::consts::PI;

/// Largest number of nodes of a rule.
pub(super) const MAX_NODES: usize = 33;
/// Newton's method doubles the correct digits of a node each time, and starts with two.
const NEWTON_STEPS: usize = 6;

/// The rules of 1 to [`MAX_NODES`] nodes.
#[derive(Clone, Debug)]
pub(super) struct Quadrature {
    rules: Vec<Vec<(f64, f64)>>,
}

impl Quadrature {
    pub fn new() -> Self {
        Self {
            rules: (1..=MAX_NODES).map(rule).collect(),
        }
    }

    /// Nodes in (0, 1) and weights, which sum to 1, of the rule with `count` nodes, limited to 1 to [`MAX_NODES`].
    pub fn nodes(&self, count: usize) -> &[(f64, f64)] {
        &self.rules[count.clamp(1, MAX_NODES) - 1]
    }
}

/// Roots of the Legendre polynomial by Newton's method, with the weights 2/((1 - z²) P'(z)²), moved to [0, 1].
fn rule(count: usize) -> Vec<(f64, f64)> {
    let order = count as f64;
    let node = |i: usize| {
        let mut z = libm::cos(PI * (i as f64 + 0.75) / (order + 0.5));
        let mut slope = 1.0;
        for _ in 0..NEWTON_STEPS {
            let mut before = 1.0;
            let mut value = z;
            for k in 2..=count {
                let k = k as f64;
                (before, value) = (
                    value,
                    ((2.0 * k - 1.0) * z * value - (k - 1.0) * before) / k,
                );
            }
            slope = order * (before - z * value) / (1.0 - z * z);
            z -= value / slope;
        }
        (0.5 * (1.0 - z), 1.0 / ((1.0 - z * z) * slope * slope))
    };
    (0..count).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_is_exact_up_to_twice_its_nodes_less_one() {
        let quadrature = Quadrature::new();
        for count in 1..=MAX_NODES {
            for degree in 0..2 * count {
                let terms = quadrature
                    .nodes(count)
                    .iter()
                    .map(|(s, weight)| weight * s.powi(i32::try_from(degree).unwrap()));
                let error = terms.sum::<f64>() * (degree + 1) as f64 - 1.0;
                // Rounding, times the degree by which the integral is scaled.
                assert!(
                    error.abs() < 1e-15 * (degree + 4) as f64,
                    "{count} nodes, degree {degree}: {error:e}"
                );
            }
        }
    }
}
