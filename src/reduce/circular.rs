//! Circular statistics: mean direction and resultant length, and what each job adds to a length: the jackknife over jobs, to
//! first order.

use super::sequence::{Estimate, add};
use std::f64::consts::TAU;

/// The unit vector of an angle in rad.
pub(super) fn unit(angle: f64) -> [f64; 2] {
    [libm::cos(angle), libm::sin(angle)]
}

/// The unit vector along a vector; along x if that has no length.
pub(super) fn heading([x, y]: [f64; 2]) -> [f64; 2] {
    let length = libm::hypot(x, y);
    if length > 0.0 {
        [x / length, y / length]
    } else {
        [1.0, 0.0]
    }
}

/// A sum of vectors, or of numbers as vectors along x, and of their weights.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    pub(super) vector: [f64; 2],
    pub(super) weight: f64,
}

impl Sum {
    pub(super) fn push(&mut self, vector: [f64; 2], weight: f64) {
        add(&mut self.vector, &vector);
        self.weight += weight;
    }

    pub(super) fn of_all(sums: &[Self]) -> Self {
        let mut total = Self::default();
        for sum in sums {
            total.push(sum.vector, sum.weight);
        }
        total
    }

    /// Length of the mean; `None` without values.
    pub(super) fn length(&self) -> Option<f64> {
        let [x, y] = self.vector;
        (self.weight > 0.0).then(|| libm::hypot(x, y) / self.weight)
    }

    /// What each of these adds to the length of their mean, times their number.
    pub(super) fn added(sums: &[Self]) -> Vec<f64> {
        let total = Self::of_all(sums);
        let length = libm::hypot(total.vector[0], total.vector[1]);
        let [x, y] = heading(total.vector);
        let of_one = |sum: &Self| {
            let along = x * sum.vector[0] + y * sum.vector[1];
            sums.len() as f64 * (along - length / total.weight * sum.weight) / total.weight
        };
        sums.iter().map(of_one).collect()
    }
}

impl Estimate<2> {
    /// Resultant length |<exp(iφ)>| of unit vectors, 0 to 1; `None` without any.
    pub(super) fn resultant_length(&self) -> Option<f64> {
        self.mean().map(|[x, y]| libm::hypot(x, y).min(1.0))
    }

    /// Mean direction, in rad, as the representative in (`top` - 2π, `top`]; `None` without unit vectors.
    pub(super) fn direction(&self, top: f64) -> Option<f64> {
        self.mean().map(|[x, y]| wrap(libm::atan2(y, x), top))
    }
}

/// The representative of an angle in (`top` - 2π, `top`], in rad.
pub fn wrap(angle: f64, top: f64) -> f64 {
    let wrapped = angle - TAU * ((angle - top) / TAU).ceil();
    // Rounding may end just outside.
    if wrapped <= top - TAU {
        wrapped + TAU
    } else {
        wrapped.min(top)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sequence::Sequences;
    use super::*;
    use std::f64::consts::PI;

    fn of(angles: &[f64]) -> Estimate<2> {
        Sequences::of([angles.iter().map(|&angle| unit(angle))]).estimate()
    }

    #[test]
    fn opposite_angles_cancel_and_equal_angles_add() {
        assert!(of(&[0.0, PI]).resultant_length().unwrap() < 1e-15);
        let equal = of(&[-3.0; 7]);
        assert!((equal.resultant_length().unwrap() - 1.0).abs() < 1e-15);
        assert!((equal.direction(PI).unwrap() + 3.0).abs() < 1e-15);
        assert!((equal.direction(-4.0).unwrap() + 3.0 + TAU).abs() < 1e-14);
        assert_eq!(of(&[]).resultant_length(), None);
    }

    #[test]
    fn mean_direction_does_not_jump_at_the_seam() {
        let seam = of(&[PI - 0.1, -PI + 0.1, PI - 0.2, -PI + 0.2]);
        assert!((seam.direction(1.5 * PI).unwrap() - PI).abs() < 1e-14);
    }

    #[test]
    fn wrapped_angles_lie_in_the_half_open_window() {
        for top in [PI, 0.1, -2.0] {
            for step in -1000..1000 {
                let angle = f64::from(step) * 0.1 * PI;
                let wrapped = wrap(angle, top);
                assert!(
                    wrapped > top - TAU && wrapped <= top,
                    "{angle} -> {wrapped}"
                );
                assert!((libm::sin(angle) - libm::sin(wrapped)).abs() < 1e-12);
            }
        }
        assert_eq!(wrap(PI, PI), PI);
        assert_eq!(wrap(-PI, PI), PI);
    }
}
