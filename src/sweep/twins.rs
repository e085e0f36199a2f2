//! Twins: two values of a quantity that agree in twelve digits but not in all, such as 30 and 29.999999999999996. Both
//! would be sets with the same realisations, counted twice where rows are grouped by a column.

use super::axes::Axis;
use super::grid::Sweep;
use super::quantity::Quantity;
use crate::model::{Symbol, Value};
use crate::table::value::Shortest;
use std::collections::BTreeSet;

/// Largest relative distance of twins: half of what two values with twelve digits differ by.
const CLOSE: f64 = 5e-13;
const PERIOD: Quantity = Quantity::Parameter(Symbol::T);

fn are_twins(a: f64, b: f64) -> bool {
    a != b && (a - b).abs() <= CLOSE * a.abs().max(b.abs())
}

/// What is wrong with a value of a quantity, and its twin to be written in its place.
fn problem(quantity: Quantity, value: f64, twin: f64) -> String {
    let key = quantity.key();
    let [value, twin] = [value, twin].map(Shortest);
    format!(
        "{key} = {value}: agrees with {twin} in twelve digits but not in all, so both would be sets of the same \
         realisations; write {key} = {twin}"
    )
}

impl Sweep {
    /// What is wrong with twins among the values of an axis; the shorter of the two is to be written.
    pub(super) fn twins(&self) -> Option<(Quantity, String)> {
        let is_set = |quantity: &Quantity| *quantity != PERIOD || self.fixes_period_by().is_none();
        Quantity::all().filter(is_set).find_map(|quantity| {
            let values = self.reals(quantity);
            let pair = values.windows(2).find(|pair| are_twins(pair[0], pair[1]))?;
            let mut pair = [pair[0], pair[1]];
            pair.sort_by_key(|value| Shortest(*value).to_string().len());
            Some((quantity, problem(quantity, pair[1], pair[0])))
        })
    }

    /// What is wrong with a value whose twin an earlier sweep of a directory has.
    pub fn twin_of(&self, earlier: &Self) -> Option<String> {
        let is_mixed = self.fixes_period_by() != earlier.fixes_period_by();
        let quantities = Quantity::all().filter(|quantity| is_mixed || *quantity != PERIOD);
        quantities.into_iter().find_map(|quantity| {
            let known = earlier.reals(quantity);
            self.reals(quantity).into_iter().find_map(|value| {
                let at = known.partition_point(|other| *other < value);
                let around = &known[at.saturating_sub(1)..known.len().min(at + 1)];
                let twin = around.iter().find(|other| are_twins(value, **other))?;
                (!around.contains(&value)).then(|| problem(quantity, value, *twin))
            })
        })
    }

    fn fixes_period_by(&self) -> Option<Quantity> {
        let mut quantities = self.axes.iter().flat_map(Axis::quantities);
        quantities.find(|quantity| matches!(quantity, Quantity::Eta | Quantity::Frequency))
    }

    /// The values of a quantity, each once, ascending, also of the period where another quantity fixes it; empty for whole
    /// numbers and words.
    fn reals(&self, quantity: Quantity) -> Vec<f64> {
        let of_axes = self.axes.iter().find_map(|axis| axis.values_of(quantity));
        let values = match (of_axes, quantity) {
            (Some(values), _) => values.to_vec(),
            (None, PERIOD) if self.fixes_period_by().is_some() => {
                let points = self.points_of_one_seed();
                let periods = points.filter_map(|point| point.parameters.modulation_period);
                let bits: BTreeSet<u64> = periods.map(f64::to_bits).collect();
                return bits.into_iter().map(f64::from_bits).collect();
            }
            (None, Quantity::Parameter(symbol)) => vec![self.base.get(symbol)],
            (None, _) => Vec::new(),
        };
        let real = |value| match value {
            Value::Real(real) => Some(real),
            _ => None,
        };
        let mut reals: Vec<f64> = values.into_iter().filter_map(real).collect();
        reals.sort_unstable_by(f64::total_cmp);
        reals.dedup();
        reals
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::value::Kind;
    use std::path::Path;

    fn read(axes: &str) -> Result<Sweep, String> {
        let text = format!("name = \"a\"\n[axes]\n{axes}\n");
        Sweep::parse(&text, Path::new("a.toml")).map_err(|error| error.to_string())
    }

    fn twin(axes: &str, earlier: &str) -> Option<String> {
        read(axes).unwrap().twin_of(&read(earlier).unwrap())
    }

    /// Axes without which a value of this quantity has no effect.
    fn beside(quantity: Quantity) -> &'static str {
        match quantity {
            Quantity::Parameter(Symbol::Delta) => "T = [0.03]",
            Quantity::Parameter(Symbol::T) | Quantity::Eta | Quantity::Frequency => {
                "Delta = [1e-6]"
            }
            Quantity::Parameter(Symbol::TTo | Symbol::DeltaTo) => {
                "Delta = [1e-6]\nT = [0.03]\nramp_time = [0.1]"
            }
            Quantity::Parameter(Symbol::RampTime) => "Delta = [1e-6]\nT = [0.03]\nT_to = [0.02]",
            Quantity::Parameter(_) => "",
        }
    }

    #[test]
    fn twins_of_any_quantity_and_axis_are_refused_at_its_line_with_the_value_to_write() {
        let mut tried = 0;
        for quantity in Quantity::all() {
            let key = quantity.key();
            if matches!(quantity, Quantity::Parameter(symbol) if symbol.description().kind != Kind::Real)
            {
                continue;
            }
            tried += 1;
            let value = 0.007_f64;
            let beside = beside(quantity);
            let twin = value.next_up();
            for list in [
                format!("{key} = [{value}, 0.008, {twin}]"),
                format!("{key} = {{ linear = [{value}, {twin}], points = 2 }}"),
                format!("{key} = {{ log = [{value}, {twin}], points = 2 }}"),
                format!("zip = [{{ {key} = [{value}, {twin}], N = [70, 71] }}]"),
                format!("sobol = {{ {key} = {{ linear = [{value}, {twin}] }}, points = 8 }}"),
            ] {
                let problem = read(&format!("{list}\n{beside}")).unwrap_err();
                let is_repeated = problem.contains("repeats row");
                let names_both = problem.contains(&format!(
                    "a.toml:3: {key} = {twin}: agrees with {value} in twelve digits"
                ));
                assert!(is_repeated || names_both, "{list}: {problem}");
            }
        }
        assert!(tried > 15, "{tried}");
    }

    #[test]
    fn values_that_differ_in_the_twelfth_digit_are_two() {
        for list in [
            "[0.3, 0.300000000001]",
            "[9.99999999999e-5, 1e-4]",
            "[2e-4, 2.00000000001e-4]",
        ] {
            read(&format!("V0 = {list}")).unwrap();
        }
        read("V0 = { linear = [1e-4, 1.0000001e-4], points = 10001 }").unwrap();
    }

    #[test]
    fn a_twin_of_a_value_of_the_directory_is_found_whatever_set_it() {
        let frequency = "frequency = [10, 30]\nDelta = [1e-6]\nseed = { count = 3 }";
        let found = twin(
            "frequency = [29.999999999999996]\nDelta = [2e-6]",
            frequency,
        )
        .unwrap();
        assert!(found.ends_with("write frequency = 30"), "{found}");
        assert_eq!(
            twin("frequency = [30, 30.0000001]\nDelta = [1e-6]", frequency),
            None
        );
        // The default of the model, and a value of an axis that is gone.
        assert!(twin("Kd = [4.000000000000001e7]", "V0 = [1e-4]").is_some());
        assert!(twin("V0 = [1e-4]", "Kd = [4.000000000000001e7]").is_some());
        // Periods by other means, whatever the seeds.
        let seeds = "Delta = [1e-6]\nseed = { first = 7, count = 2 }";
        let period = |period: f64| format!("T = [{period:?}]\n{seeds}");
        let thirtieth = 1.0 / 30.0_f64;
        assert!(twin(&period(thirtieth.next_up()), frequency).is_some());
        assert_eq!(twin(&period(thirtieth), frequency), None);
        let own = twin(frequency, &period(thirtieth.next_up())).unwrap();
        assert!(
            own.ends_with(&format!("write T = {}", thirtieth.next_up())),
            "{own}"
        );
        let eta = "eta = [0.5, 2]\nV0 = [1e-4, 2e-4]\nDelta = [1e-6]";
        let parameters = read(eta).unwrap().jobs().last().unwrap().parameters;
        let of_eta = parameters.modulation_period.unwrap();
        let axes = |period: f64| format!("T = [{period:?}]\nV0 = [2e-4]\nDelta = [1e-6]");
        assert!(twin(&axes(of_eta.next_down()), eta).is_some());
        assert!(twin(eta, &axes(of_eta.next_down())).is_some());
        let doubled = eta.replace("[0.5, 2]", "[2, 2.000000000000001]");
        assert!(read(&doubled).unwrap_err().contains("write eta = 2"));
        assert_eq!(twin(&axes(of_eta), eta), None);
    }
}
