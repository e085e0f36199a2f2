//! Sets compared: in what they differ, what each is called, and the grid on which they lie.

use super::axis::Axis;
use crate::model::{Parameters, Symbol, Value};
use crate::reduce::{FREQUENCY, SetRow, Swept, has_even_steps, is_spread};
use crate::sets::{Digits, label, symbol_of};

/// T, or 1/T if its steps are even and those of T are not.
pub(super) fn period_column(sets: &[SetRow]) -> &'static str {
    let is_even =
        |column| Swept::of(sets, column).is_ok_and(|swept| has_even_steps(&swept.distinct));
    if !is_even("T") && is_even(FREQUENCY) {
        FREQUENCY
    } else {
        "T"
    }
}

/// A parameter and its value, in symbols.
fn setting(parameters: &Parameters, symbol: Symbol) -> String {
    match parameters.get(symbol) {
        Value::Real(real) => label(symbol.key()).setting(real, Digits::THREE),
        value => format!("{} = {value}", symbol_of(symbol)),
    }
}

/// Of a column with these values: the label of its axis, and the factor to its unit.
pub(super) fn axis_of(column: &str, values: impl Iterator<Item = f64>) -> (String, f64) {
    let label = label(column);
    let (factor, unit) = label.scale(values.fold(0.0, f64::max));
    (label.axis(unit), factor)
}

/// What some parameters have in common, in symbols.
pub(super) fn common<'a>(all: impl Iterator<Item = &'a Parameters>) -> String {
    let all: Vec<&Parameters> = all.collect();
    let Some(first) = all.first() else {
        return String::new();
    };
    // What is off, or enters nothing that figures show, is left out, and the default of what the paper has no symbol for.
    let is_shown = |symbol: &Symbol| {
        let value = first.get(*symbol);
        !matches!(symbol, Symbol::Seed | Symbol::FN | Symbol::L)
            && value != Value::Null
            && (value != Parameters::default().get(*symbol)
                || !symbol.description().symbol.is_empty())
            && all
                .iter()
                .all(|parameters| parameters.get(*symbol) == value)
    };
    let settings = Symbol::ALL
        .into_iter()
        .filter(is_shown)
        .map(|symbol| setting(first, symbol));
    // Lines are not broken within one.
    settings
        .map(|setting| setting.replace(' ', "\u{a0}"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// Values of a swept quantity and how they are spaced.
pub(super) struct Grid {
    /// Ascending.
    values: Vec<f64>,
    is_linear: bool,
}

impl Grid {
    /// Linear if the steps are even, or a value is not > 0, or all are close, else logarithmic. `values` ascend.
    pub(super) fn of(values: Vec<f64>) -> Self {
        let is_linear = has_even_steps(&values) || !is_spread(&values);
        Self { values, is_linear }
    }

    /// The cells around `values` > 0 that ascend, spaced logarithmically.
    pub(super) fn logarithmic_cells(values: Vec<f64>) -> Vec<(f64, f64)> {
        let grid = Self {
            values,
            is_linear: false,
        };
        (0..grid.values.len())
            .map(|index| grid.cell(index))
            .collect()
    }

    /// An axis for cells: it ends half a step beyond the values.
    pub(super) fn axis(&self, label: &str) -> Axis {
        let low = self.cell(0).0;
        let high = self.cell(self.values.len() - 1).1;
        if self.is_linear {
            Axis::linear(label, low, high)
        } else {
            Axis::logarithmic(label, low, high)
        }
    }

    /// The ends of the cell around the value with this index: halfway to its neighbours.
    pub(super) fn cell(&self, index: usize) -> (f64, f64) {
        let at = |index: usize| {
            if self.is_linear {
                self.values[index]
            } else {
                libm::log(self.values[index])
            }
        };
        let last = self.values.len() - 1;
        let alone = if last == 0 { 1.0 } else { 0.0 };
        let below = if index > 0 {
            at(index) - at(index - 1)
        } else {
            at(1.min(last)) - at(0) + alone
        };
        let above = if index < last {
            at(index + 1) - at(index)
        } else {
            below
        };
        let low = at(index) - 0.5 * below;
        let high = at(index) + 0.5 * above;
        if self.is_linear {
            (low, high)
        } else {
            (libm::exp(low), libm::exp(high))
        }
    }

    pub(super) fn count(&self) -> usize {
        self.values.len()
    }

    /// The index of a value of the grid.
    pub(super) fn index_of(&self, value: f64) -> usize {
        self.values
            .partition_point(|&other| other < value)
            .min(self.values.len() - 1)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::model::Selected;
    use crate::observe::Regime;
    use crate::reduce::Interval;

    /// A set at Δ in m and T in s that locks to `periods` of T.
    pub(in crate::figure) fn set(amplitude: f64, period: f64, periods: f64) -> SetRow {
        let tau = periods * period;
        let interval = |value: f64| {
            Some(Interval {
                low: 0.9 * value,
                high: 1.1 * value,
            })
        };
        let of_modulated = |value: f64| (amplitude > 0.0).then_some(value);
        let locking_index = of_modulated(0.8);
        let resultant_length = of_modulated(0.7);
        let mean_friction = 280.0 - 1e7 * amplitude;
        let parameters = Parameters {
            modulation_amplitude: amplitude,
            modulation_period: Some(period),
            ..Parameters::default()
        };
        SetRow {
            set_id: format!("{amplitude:e} {period:e}"),
            frequency: of_modulated(1.0 / period),
            eta: if amplitude > 0.0 {
                parameters.eta()
            } else {
                0.0
            },
            parameters: Selected::new(parameters.validated().unwrap()),
            tau_mean: Some(tau),
            tau_interval: interval(tau),
            tau_deviation: Some(0.1 * tau),
            tau_25: Some(0.98 * tau),
            tau_50: Some(tau),
            tau_75: Some(1.02 * tau),
            periods: (0..100_u32)
                .find(|&n| (f64::from(n) - periods).abs() <= 0.5)
                .map(u64::from),
            has_phase: amplitude > 0.0,
            locking_index,
            locking_interval: locking_index.and_then(interval),
            resultant_length,
            length_interval: resultant_length.and_then(interval),
            peak_force_mean: Some(480.0),
            mean_friction: Some(mean_friction),
            mean_friction_interval: interval(mean_friction),
            regime: Some(Regime::StickSlip),
            slip_share: Some(0.05),
            ..SetRow::default()
        }
    }

    #[test]
    fn small_print_has_what_all_have_in_common_and_symbols_have_their_subscripts() {
        let mut other = set(1e-6, 0.02, 4.0).parameters.parameters;
        other.blocks = 9;
        let all = [set(1e-6, 0.02, 4.0).parameters.parameters, other];
        let found = common(all.iter()).replace('\u{a0}', " ");
        assert!(
            found.starts_with("Nₛ = 20, M = 11.5 kg, K = 10⁸ N/m, K_d = 4·10⁷ N/m"),
            "{found}"
        );
        assert!(
            found.contains("Δfₛ = 0.0069 N") && found.contains("Δ = 1 µm, T = 20 ms"),
            "{found}"
        );
        assert!(!found.contains("N = ") && !found.contains("seed") && common([].iter()).is_empty());
        let symbols = [Symbol::RampTime, Symbol::Seed, Symbol::TauR, Symbol::V0].map(symbol_of);
        assert_eq!(symbols, ["ramp time", "seed", "τᵣ", "V₀"]);
    }

    #[test]
    fn cells_meet_and_lie_around_their_values() {
        for values in [
            vec![1.0, 2.0, 3.0, 4.0],
            vec![0.1, 0.2, 0.4, 3.0],
            vec![0.0, 1.0, 5.0],
        ] {
            let grid = Grid::of(values.clone());
            for index in 0..values.len() {
                let (low, high) = grid.cell(index);
                assert!(low < values[index] && values[index] < high, "{values:?}");
                assert_eq!(grid.index_of(values[index]), index);
                if index > 0 {
                    assert!(
                        (grid.cell(index - 1).1 / low - 1.0).abs() < 1e-12,
                        "{values:?}"
                    );
                }
            }
        }
        assert!(
            Grid::of(vec![7.0]).axis("").ticks.len() < 9,
            "a single value"
        );
    }

    #[test]
    fn what_was_swept_in_even_steps_becomes_the_axis() {
        let sets = |periods: [f64; 4]| periods.map(|period| set(1e-6, period, 4.0));
        assert_eq!(
            period_column(&sets([0.1, 0.05, 1.0 / 30.0, 0.025])),
            FREQUENCY
        );
        assert_eq!(period_column(&sets([0.1, 0.2, 0.4, 0.8])), "T");
    }
}
