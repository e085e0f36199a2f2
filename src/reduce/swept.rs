//! What was swept, inferred from the sets: the columns in which they differ. The first makes the axis of a figure, the second
//! its colours, the third its panels.

use super::values::{Values, is_same};
use crate::model::Symbol;
use crate::sets::{FREQUENCY, SetRow};

/// Steps that differ by less than this share are even: sweep files hold rounded numbers.
const EVEN: f64 = 0.02;
/// Ratio from which two values lie on a logarithmic axis.
const WIDE: f64 = 9.0;
/// Ratio of the ends up to which no axis is logarithmic: values would fall on one place.
const NARROW: f64 = 1.1;

/// As one of the parameters in which sets differ.
impl Values {
    /// Whether its values are spaced logarithmically.
    pub fn is_logarithmic(&self) -> bool {
        let [least, .., largest] = self.distinct[..] else {
            return false;
        };
        let is_even =
            has_even_steps(&self.distinct) && (self.distinct.len() > 2 || largest < WIDE * least);
        !self.is_worded() && is_spread(&self.distinct) && !is_even
    }

    /// Whether each of its values goes with one of another: both have few values, or both ascend.
    fn fixes(&self, other: &Self) -> bool {
        let places = self.places();
        let others = other.places();
        let mut pairs: Vec<_> = places.iter().zip(others).collect();
        pairs.sort();
        pairs.dedup();
        let is_one = pairs.windows(2).all(|pair| pair[0].0 != pair[1].0);
        is_one && (2 * self.distinct.len() <= places.len() || pairs.is_sorted_by_key(|pair| pair.1))
    }

    /// The place of the value of each set among all.
    pub fn places(&self) -> Vec<Option<usize>> {
        let place = |number: f64| {
            let mut distinct = self.distinct.iter();
            distinct.position(|&value| is_same(value, number))
        };
        let numbers = self.numbers.iter();
        numbers.map(|number| place((*number)?)).collect()
    }
}

/// The parameters in which sets differ, the seed left out.
pub fn differing<'a>(rows: &(impl Iterator<Item = &'a SetRow> + Clone)) -> Vec<Symbol> {
    let differs = |symbol: &Symbol| {
        let mut values = rows.clone().map(|row| row.parameters.get(*symbol));
        let first = values.next();
        *symbol != Symbol::Seed && values.any(|value| Some(value) != first)
    };
    Symbol::ALL.into_iter().filter(differs).collect()
}

/// What was swept, the column with most values first; the period as 1/T, η or T, whichever was swept. Left out is a column that another one determines, such as the amplitude
/// that is 0 where there is no period, or the second of two parameters that an axis moves together.
pub fn swept(rows: &[SetRow]) -> Vec<Values> {
    let column = |symbol: Symbol| {
        let names: &[&str] = if symbol == Symbol::T {
            &[FREQUENCY, "eta", "T"]
        } else {
            &[symbol.key()]
        };
        let columns = names.iter().filter_map(|name| Values::of(rows, name).ok());
        columns.min_by_key(|swept| (swept.distinct.len(), !has_even_steps(&swept.distinct)))
    };
    let symbols = differing(&rows.iter()).into_iter();
    let mut all: Vec<Values> = symbols.filter_map(column).collect();
    // A missing period counts as a value.
    let count = |swept: &Values| swept.distinct.len() + usize::from(swept.numbers.contains(&None));
    all.sort_by_key(|swept| std::cmp::Reverse(count(swept)));
    let mut kept: Vec<Values> = Vec::new();
    for swept in all {
        if !kept.iter().any(|other| other.fixes(&swept)) {
            kept.retain(|other| !swept.fixes(other));
            kept.push(swept);
        }
    }
    kept
}

/// Whether values that ascend are > 0 and so far apart that a logarithmic axis shows them.
pub fn is_spread(values: &[f64]) -> bool {
    matches!(values, [least, .., largest] if *least > 0.0 && *largest > NARROW * least)
}

/// Whether values that ascend have even steps.
pub fn has_even_steps(values: &[f64]) -> bool {
    let steps = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let mean = steps().sum::<f64>() / steps().count() as f64;
    steps().all(|step| (step - mean).abs() <= EVEN * mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;

    fn row(velocity: f64, amplitude: f64, period: Option<f64>) -> SetRow {
        let parameters = Parameters {
            drive_velocity: velocity,
            modulation_amplitude: amplitude,
            modulation_period: period,
            ..Parameters::default()
        };
        let frequency = period.map(|period| 1.0 / period);
        SetRow {
            frequency,
            eta: parameters.eta(),
            parameters: Selected::new(parameters),
            ..SetRow::default()
        }
    }

    fn names(rows: &[SetRow]) -> Vec<String> {
        swept(rows)
            .iter()
            .map(|swept| swept.name().to_owned())
            .collect()
    }

    #[test]
    fn the_period_is_there_as_what_was_swept_and_the_most_values_come_first() {
        let mut rows = vec![row(1e-4, 0.0, None)];
        rows.extend([29.0, 58.0, 116.0].map(|frequency| row(1e-4, 1e-6, Some(1.0 / frequency))));
        assert_eq!(
            names(&rows),
            ["frequency"],
            "the frequency fixes the amplitude"
        );
        rows.extend((1..6).map(|step| row(1e-4, 1e-7 * f64::from(step), Some(1.0 / 58.0))));
        assert_eq!(names(&rows), ["Delta", "frequency"]);
        let etas = [0.2, 1.0, 5.0, 25.0];
        let period =
            |eta: f64, velocity: f64| Some(std::f64::consts::TAU * 1e-6 / (eta * velocity));
        let at = |velocity: f64| etas.map(|eta| row(velocity, 1e-6, period(eta, velocity)));
        let rows: Vec<SetRow> = [1e-5, 3e-5, 1e-4].into_iter().flat_map(at).collect();
        let found = swept(&rows);
        assert_eq!(names(&rows), ["eta", "V0"]);
        assert!(
            found[0].is_logarithmic() && found[0].distinct.len() == 4 && found[1].is_logarithmic()
        );
        let even: Vec<SetRow> = (1..9)
            .map(|step| row(1e-4, 1e-6, Some(0.01 * f64::from(step))))
            .collect();
        assert_eq!(names(&even), ["T"]);
        assert!(!swept(&even)[0].is_logarithmic());
    }

    #[test]
    fn a_sample_has_all_its_parameters_and_one_axis_of_two_the_first() {
        let velocities = [3e-5, 1e-5, 9e-5, 2e-5, 7e-5];
        let sample: Vec<SetRow> = (1..)
            .zip(velocities)
            .map(|(step, velocity)| row(velocity, 1e-7 * f64::from(step), Some(0.02)))
            .collect();
        assert_eq!(names(&sample), ["V0", "Delta"]);
        let together: Vec<SetRow> = (1..6)
            .map(|step| row(1e-5 * f64::from(step), 1e-7 * f64::from(step), Some(0.02)))
            .collect();
        assert_eq!(names(&together), ["V0"]);
        assert!(swept(&together[..1]).is_empty());
    }
}
