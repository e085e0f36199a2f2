//! Sums of a job, and what each job adds to the length of their mean: the jackknife over jobs, to first order.

use super::circular::heading;
use super::sequence::add;

/// A sum of vectors, or of numbers as such, and of their weights.
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

    /// Of the mean; `None` of nothing.
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
