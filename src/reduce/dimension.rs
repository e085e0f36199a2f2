//! The unit of a formula, by the dimensions of its columns: `sqrt(Kd/M)` is in 1/s. A formula has one if its value
//! changes by a power of the size of each base unit; a sum of a time and a length does not.

use crate::sweep::Expression;
use crate::table::columns::Column;

/// Base units. Energies, rates and masses are powers of these.
const BASE: [&str; 3] = ["N", "m", "s"];

/// Units of columns as powers of the base units.
const UNITS: [(&str, [f64; BASE.len()]); 9] = [
    ("", [0.0, 0.0, 0.0]),
    ("1", [0.0, 0.0, 0.0]),
    ("rad", [0.0, 0.0, 0.0]),
    ("N", [1.0, 0.0, 0.0]),
    ("m", [0.0, 1.0, 0.0]),
    ("s", [0.0, 0.0, 1.0]),
    ("Hz", [0.0, 0.0, -1.0]),
    ("J", [1.0, 1.0, 0.0]),
    ("kg", [1.0, -1.0, 2.0]),
];

/// By which the base units are made smaller, one at a time.
const FACTOR: f64 = 4.0;
/// Multiples of a half up to rounding.
const ROUNDING: f64 = 1e-9;

/// The unit of a formula of these columns; empty for a pure number, and where the dimensions do not agree.
pub(super) fn unit_of_formula(formula: &Expression<usize>, columns: &[Column]) -> &'static str {
    let value = |scaled: Option<usize>| {
        formula.evaluate(&|&place| {
            // Values that nothing but a common unit makes alike.
            let plain = 1.0 + libm::sqrt(2.0 + place as f64);
            let power = scaled.map_or(0.0, |base| power(columns[place].unit, base));
            plain * libm::pow(FACTOR, power)
        })
    };
    let power = |base: usize| {
        let halves = 2.0 * libm::log(value(Some(base)) / value(None)) / libm::log(FACTOR);
        let is_power = (halves - halves.round()).abs() < ROUNDING;
        is_power.then(|| 0.5 * halves.round())
    };
    let powers: Option<Vec<f64>> = (0..BASE.len()).map(power).collect();
    // A few bytes for each formula that somebody types.
    powers.map_or("", |powers| written(&powers).leak())
}

/// The power of a base unit in a unit such as `N/m`; NaN for an unknown one.
fn power(unit: &str, base: usize) -> f64 {
    let power = |part: &str| {
        let known = UNITS.iter().find(|known| known.0 == part);
        known.map_or(f64::NAN, |known| known.1[base])
    };
    let mut powers = unit.split('/').map(power);
    let above = powers.next().unwrap_or(0.0);
    above - powers.sum::<f64>()
}

/// As a fraction of products.
fn written(powers: &[f64]) -> String {
    let product = |sign: f64| {
        let powers = BASE
            .iter()
            .zip(powers)
            .filter(|(_, power)| sign * *power > 0.0);
        let factors = powers.map(|(base, power)| match power.abs() {
            1.0 => (*base).to_owned(),
            2.0 => format!("{base}²"),
            power => format!("{base}^{power}"),
        });
        factors.collect::<Vec<_>>()
    };
    let mut parts = vec![product(1.0).join(" ")];
    parts.extend(product(-1.0));
    if parts[0].is_empty() && parts.len() > 1 {
        "1".clone_into(&mut parts[0]);
    }
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::super::SetRow;
    use super::super::Values;

    #[test]
    fn a_formula_has_the_unit_of_its_dimension() {
        for (formula, unit) in [
            ("Kd*Delta", "N"),
            ("sqrt(Kd / M)", "1/s"),
            ("2*(tau_mean - T)", "s"),
            ("V0*V0", "m²/s²"),
            ("tau_sd/tau_mean", ""),
            ("frequency*T + 1", ""),
            ("drop_mean/tau_mean", "N/s"),
            ("mean_friction*V0", "N m/s"),
            ("Delta/T/T", "m/s²"),
            ("sqrt(Delta)", "m^0.5"),
            ("1/(V0*T)", "1/m"),
            ("1/(Kd*T)", "m/N/s"),
            ("tau_mean + Delta", ""),
            ("sqrt(tau_mean + 1)", ""),
        ] {
            let values = Values::of::<SetRow>(&[], formula).unwrap();
            assert_eq!(values.label.unit, unit, "{formula}");
        }
    }
}
