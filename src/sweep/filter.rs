//! Conditions that drop points: `frequency < 500 and Kd * Delta < 50`.
//!
//! Their names are the keys of the parameters, `eta` and `frequency`, in SI. Without modulation `eta` and `frequency` are
//! 0 and `T` is infinite.

use super::expression::{Expression, ExpressionError};
use super::quantity::{Point, Quantity};
use super::source::hint;

#[derive(Clone, Debug)]
pub(super) struct Condition(Expression<Quantity>);

impl Condition {
    pub fn parse(text: &str) -> Result<Self, ExpressionError> {
        Expression::condition(text, &|name| match Quantity::from_key(name) {
            Some(Quantity::BREAK_ON) => {
                Err("break_on is a word and cannot be compared; choose its values on an axis".to_owned())
            }
            Some(quantity) => Ok(quantity),
            None => {
                let numbers = Quantity::all().filter(|quantity| *quantity != Quantity::BREAK_ON);
                let hint = hint(name, &numbers.map(Quantity::key).collect::<Vec<_>>());
                Err(format!("\"{name}\" is not a known quantity; {hint}"))
            }
        })
        .map(Self)
    }

    /// Whether it names a quantity of a kind.
    pub fn names(&self, is_meant: impl Fn(Quantity) -> bool) -> bool {
        self.0.names().into_iter().any(|&quantity| is_meant(quantity))
    }

    /// Whether a canonical point fulfils it.
    pub fn holds(&self, point: &Point) -> bool {
        self.0.evaluate(&|&quantity| point.number(quantity)) == 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;

    fn holds(text: &str) -> bool {
        let parameters = Parameters { modulation_amplitude: 1e-6, ..Parameters::default() };
        let point = Point { parameters, fixes_period: Some((Quantity::Frequency, 49.0)) }.canonical();
        Condition::parse(text).unwrap_or_else(|error| panic!("{text}: {error}")).holds(&point)
    }

    #[test]
    fn products_bind_before_sums_before_comparisons_before_and_before_or() {
        for (text, expected) in [
            ("1 + 2 * 3 == 7", true),
            ("(1 + 2) * 3 == 9", true),
            ("8 / 2 / 2 == 2 and 8 - 2 - 2 == 4", true),
            ("1 < 2 or 1 < 0 and 1 < 0", true),
            ("(1 < 2 or 1 < 0) and 1 < 0", false),
            ("((N) - -10) / 4. == 2e1", true),
            ("N >= 70 and N <= 70 and Ns != 19", true),
            ("Kd * Delta < 50 and Kd*Delta>39.9", true),
            ("0 / 0 != 1", false),
        ] {
            assert_eq!(holds(text), expected, "{text}");
        }
    }

    #[test]
    fn what_an_axis_set_is_compared_as_it_was_set() {
        // 1/(1/49) is not 49.
        assert!(holds("frequency == 49"));
        assert!(holds("T == 1/49"));
    }

    #[test]
    fn without_modulation_eta_and_the_frequency_are_zero() {
        let point = Point { parameters: Parameters::default(), fixes_period: Some((Quantity::Eta, 3.0)) }.canonical();
        for text in ["eta == 0", "frequency == 0", "T > 1e300"] {
            assert!(Condition::parse(text).unwrap().holds(&point), "{text}");
        }
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        for (text, position, words) in [
            ("frequency < 5OO", 13, "not a number"),
            ("freqency < 500", 1, "did you mean frequency"),
            ("frequency", 1, "comparison is needed"),
            ("T = 1", 3, "=="),
            ("1 < T < 2", 7, "a < b and b < c"),
            ("(T < 1", 7, "closing )"),
            ("T < 1)", 6, "not expected"),
            ("T < 1 T > 0", 7, "and, or"),
            ("T <", 4, "too early"),
            ("", 1, "too early"),
            ("T & 1", 3, "no meaning"),
            ("break_on == 1", 1, "cannot be compared"),
            ("(T < 1) + 1 > 2", 1, "a number is needed"),
            ("T < 1 and 3", 11, "comparison is needed"),
            ("T < 1e999", 5, "not a number"),
            ("\u{3c4} < 1", 1, "no meaning"),
        ] {
            let error = Condition::parse(text).expect_err(text);
            assert_eq!(error.position, position, "{text}: {error}");
            assert!(error.problem.contains(words), "{text}: {error}");
        }
        let deep = "(".repeat(100_000);
        assert!(Condition::parse(&deep).unwrap_err().problem.contains("more than 500"));
    }
}
