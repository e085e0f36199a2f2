//! The unit of a formula, by the exponents of its columns: `sqrt(Kd/M)` is in 1/s.

use crate::sweep::Expression;
use crate::table::columns::Column;

/// Base units. Energies, rates and masses are powers of these.
const BASE: [&str; 3] = ["N", "m", "s"];
type Exponents = [f64; BASE.len()];

/// Units of columns as powers of the base units.
const UNITS: [(&str, Exponents); 9] = [
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

/// The unit of a formula of these columns; empty for a pure number, and where it adds unlike units.
pub(super) fn unit_of_formula(formula: &Expression<usize>, columns: &[Column]) -> String {
    let exponents = formula.exponents(&|&place| exponents(columns[place].unit));
    exponents.map_or_else(String::new, written)
}

/// Of a unit such as `N/m`; `None` for an unknown one.
fn exponents(unit: &str) -> Option<Exponents> {
    let known = |part: &str| {
        let mut units = UNITS.iter();
        units.find(|known| known.0 == part).map(|known| known.1)
    };
    let mut parts = unit.split('/').map(known);
    let above = parts.next()??;
    parts.try_fold(above, |all, below| {
        let below = below?;
        Some(std::array::from_fn(|unit| all[unit] - below[unit]))
    })
}

/// As a fraction of products.
fn written(powers: Exponents) -> String {
    let product = |sign: f64| {
        let powers = BASE
            .iter()
            .zip(powers)
            .filter(|(_, power)| sign * power > 0.0);
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
    use super::super::values::Values;
    use crate::sets::SetRow;

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
