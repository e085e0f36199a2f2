//! The unit of a formula, by the dimensions of its columns: `sqrt(Kd/M)` is in 1/s. A formula has one if its value
//! changes by a power of the size of each base unit; a sum of a time and a length does not.

use crate::sweep::Expression;
use crate::table::columns::Column;

/// Base units. Energies, rates and masses are powers of these.
const BASE: [&str; 3] = ["N", "m", "s"];

type Powers = [f64; BASE.len()];

/// Units of columns as powers of the base units.
const UNITS: [(&str, Powers); 8] = [
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

/// The unit of a formula of numbers from these columns; empty for a pure number, or if there is none.
pub(super) fn unit_of_formula(formula: &Expression<usize>, columns: &[Column]) -> &'static str {
    let powers = powers_of_formula(formula, columns);
    let unit = powers.map_or_else(String::new, written);
    // A few bytes for each formula that somebody types.
    unit.leak()
}

fn powers_of_formula(formula: &Expression<usize>, columns: &[Column]) -> Option<Powers> {
    let names = formula.names();
    let units: Option<Vec<Powers>> = names
        .iter()
        .map(|&&place| powers_of_unit(columns[place].unit))
        .collect();
    let units = units?;
    let value = |scales: [f64; BASE.len()]| {
        formula.evaluate(&|place| {
            // Values that nothing but a common unit makes alike.
            let index = names.iter().position(|known| *known == place).unwrap_or(0);
            let plain = 1.0 + libm::sqrt(2.0 + *place as f64);
            let powers = units[index].iter().zip(scales);
            powers.fold(plain, |value, (power, scale)| {
                value * libm::pow(scale, *power)
            })
        })
    };
    let plain = value([1.0; BASE.len()]);
    let mut powers = [0.0; BASE.len()];
    for (base, power) in powers.iter_mut().enumerate() {
        let mut scales = [1.0; BASE.len()];
        scales[base] = FACTOR;
        let halves = 2.0 * libm::log(value(scales) / plain) / libm::log(FACTOR);
        if (halves - halves.round()).abs() > ROUNDING || halves.is_nan() {
            return None;
        }
        *power = 0.5 * halves.round();
    }
    Some(powers)
}

/// Of a unit such as `N/m`.
fn powers_of_unit(unit: &str) -> Option<Powers> {
    let mut powers = [0.0; BASE.len()];
    for (place, part) in unit.split('/').filter(|part| !part.is_empty()).enumerate() {
        let known = UNITS.iter().find(|known| known.0 == part)?.1;
        let sign = if place == 0 { 1.0 } else { -1.0 };
        for (power, part) in powers.iter_mut().zip(known) {
            *power += sign * part;
        }
    }
    Some(powers)
}

/// As a fraction of products.
fn written(powers: Powers) -> String {
    let product = |sign: f64| {
        let powers = powers.map(|power| sign * power);
        let present = BASE.iter().zip(powers).filter(|(_, power)| *power > 0.0);
        let factors: Vec<String> = present
            .map(|(base, power)| match power {
                1.0 => (*base).to_owned(),
                2.0 => format!("{base}²"),
                3.0 => format!("{base}³"),
                power => format!("{base}^{power}"),
            })
            .collect();
        factors
    };
    let above = product(1.0).join(" ");
    let below = product(-1.0);
    match &below[..] {
        [] => above,
        _ if above.is_empty() => format!("1/{}", below.join("/")),
        _ => format!("{above}/{}", below.join("/")),
    }
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
            assert_eq!(values.column.unit, unit, "{formula}");
        }
    }
}
