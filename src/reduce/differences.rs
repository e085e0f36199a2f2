//! Directories side by side: the parameters that some of them hold constant, and not all at one value.

use crate::model::{Parameters, Symbol, Value};
use crate::sets::{is_same, setting};

/// A parameter, not the seed, in which directories differ beside what they vary.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    pub symbol: Symbol,
    /// The constant of each directory; `None` where it varies or is not known.
    pub constants: Vec<Option<Value>>,
}

impl Difference {
    /// All of some directories, given the parameters of the sets of each. What a directory does not know is no
    /// difference to it.
    pub fn all(directories: &[Vec<&Parameters>]) -> Vec<Self> {
        let difference = |symbol: Symbol| {
            let of = |sets: &Vec<&Parameters>| Held::of(sets, symbol);
            let held: Vec<Option<Held>> = directories.iter().map(of).collect();
            let mut known = held.iter().flatten();
            let first = known.next()?;
            let differs = known.any(|other| !other.is_same(first));
            let constant = |held: Option<Held>| held?.0;
            let constants = held.into_iter().map(constant).collect();
            differs.then_some(Self { symbol, constants })
        };
        let symbols = Symbol::ALL.into_iter();
        let all_but_seed = symbols.filter(|symbol| *symbol != Symbol::Seed);
        all_but_seed.filter_map(difference).collect()
    }

    /// Whether each directory holds it constant.
    pub fn is_constant(&self) -> bool {
        self.constants.iter().all(Option::is_some)
    }

    /// Whether it is of the drive: statistics at different ones are rarely meant to be compared.
    pub const fn is_of_drive(&self) -> bool {
        matches!(self.symbol, Symbol::V0 | Symbol::Delta | Symbol::T)
    }

    /// What a directory holds of these, as figures write it; empty if it holds none.
    pub fn settings(all: &[Self], directory: usize) -> String {
        let setting = |difference: &Self| {
            let constants = difference.constants.iter().flatten();
            let beside: Vec<f64> = constants.filter_map(|value| value.number()).collect();
            setting(difference.symbol, difference.constants[directory]?, &beside)
        };
        let settings: Vec<String> = all.iter().filter_map(setting).collect();
        settings.join(", ")
    }
}

/// What a directory holds of a parameter that it knows: a constant, or several values.
struct Held(Option<Value>);

impl Held {
    fn of(sets: &[&Parameters], symbol: Symbol) -> Option<Self> {
        // Sets without modulation stand beside any, as their control.
        let is_control =
            |set: &Parameters| symbol.is_of_modulation() && set.modulation_amplitude == 0.0;
        let all_are_controls = sets.iter().all(|set| is_control(set));
        let known = sets.iter().filter(|set| !set.unknown.contains(&symbol));
        let decisive = known.filter(|set| all_are_controls || !is_control(set));
        let mut values = decisive.map(|set| set.get(symbol));
        let first = values.next()?;
        let is_constant = values.all(|value| is_same_value(first, value));
        Some(Self(is_constant.then_some(first)))
    }

    fn is_same(&self, other: &Self) -> bool {
        match (self.0, other.0) {
            (Some(value), Some(other)) => is_same_value(value, other),
            (value, other) => value == other,
        }
    }
}

/// Whether two values are the same up to rounding.
fn is_same_value(value: Value, other: Value) -> bool {
    match (value.number(), other.number()) {
        (Some(value), Some(other)) => is_same(value, other),
        _ => value == other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(velocity: f64, amplitude: f64) -> Parameters {
        Parameters {
            drive_velocity: velocity,
            modulation_amplitude: amplitude,
            modulation_period: (amplitude > 0.0).then_some(0.02),
            ..Parameters::default()
        }
    }

    fn said(directories: &[&[Parameters]]) -> Vec<String> {
        let sets: Vec<Vec<&Parameters>> = directories
            .iter()
            .map(|sets| sets.iter().collect())
            .collect();
        let all = Difference::all(&sets);
        let said = (0..directories.len()).map(|place| Difference::settings(&all, place));
        said.map(|said| said.replace('\u{a0}', " ")).collect()
    }

    #[test]
    fn constants_that_differ_are_said_and_what_both_vary_or_one_does_not_know_is_not() {
        let sweep = [at(1e-4, 1e-6), at(2e-4, 1e-6)];
        assert_eq!(said(&[&sweep, &sweep[1..]]), ["", "V₀ = 2·10⁻⁴ m/s"]);
        assert_eq!(said(&[&sweep, &sweep]), ["", ""]);
        assert_eq!(
            said(&[&sweep[..1], &[at(1e-4, 0.0)]]),
            ["Δ = 1 µm, T = 20 ms", "Δ = 0"]
        );
        let with_control = [at(1e-4, 0.0), at(1e-4, 1e-6)];
        assert_eq!(said(&[&with_control, &sweep[..1]]), ["", ""]);
        assert_eq!(
            said(&[&with_control, &[at(1e-4, 3e-7)]]),
            ["Δ = 1 µm", "Δ = 0.3 µm"]
        );
        let mut soft = at(1e-4, 1e-6);
        soft.drive_stiffness = 1002.0;
        soft.contacts_per_block = 5;
        let mut measured = soft.clone();
        measured.unknown = vec![Symbol::Ns];
        assert_eq!(
            said(&[&sweep[..1], &[measured], &[soft]]),
            [
                "Nₛ = 20, K_d = 4·10⁷ N/m",
                "K_d = 1002 N/m",
                "Nₛ = 5, K_d = 1002 N/m"
            ]
        );
    }

    #[test]
    fn rounding_is_no_difference() {
        let period = |period| Parameters {
            modulation_period: Some(period),
            ..at(1e-4, 1e-6)
        };
        assert_eq!(
            said(&[&[period(1.0 / 58.0)], &[period(0.017_241_379_310_3)]]),
            ["", ""]
        );
        assert_eq!(
            said(&[&[period(0.017_24)], &[period(0.017_25)]]),
            ["T = 17.24 ms", "T = 17.25 ms"]
        );
    }
}
