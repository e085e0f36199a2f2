//! What figures write of the values of a column.

use super::sets::{ETA, FREQUENCY, parameter, three_digits};
use crate::model::Symbol;
use crate::reduce::{self, Values};
use crate::table::columns::Column;

/// Its label on an axis, with the unit.
pub(super) fn axis_label(values: &Values) -> String {
    match &*values.column.name {
        reduce::FREQUENCY => FREQUENCY.to_owned(),
        "eta" => ETA.to_owned(),
        name => Symbol::from_key(name).map_or_else(|| with_unit(values.label().what, &values.column), parameter),
    }
}

/// The same with the symbol alone.
pub(super) fn short_label(values: &Values) -> String {
    with_unit(values.label().symbol, &values.column)
}

fn with_unit(label: String, column: &Column) -> String {
    if column.unit.is_empty() { label } else { format!("{label} ({})", column.unit) }
}

/// The symbol of a column and one of its values.
pub(super) fn setting(values: &Values, value: f64) -> String {
    let word = values.word(value).map_or_else(|| three_digits(value), str::to_owned);
    format!("{} = {word} {}", values.label().symbol, values.column.unit).trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_have_symbols_and_units() {
        let label = |name: &str| axis_label(&Values::of(&[], name).unwrap());
        assert_eq!(label("V0"), "Drive velocity V₀ (m/s)");
        assert_eq!(label("tau_mean"), "Mean interval (s)");
        assert_eq!(label("mean_friction"), "Mean friction (N)");
        assert_eq!(label("Delta"), "Amplitude of the modulation Δ (m)");
        assert_eq!((label("eta"), label("frequency")), (ETA.to_owned(), "Modulation frequency 1/T (Hz)".to_owned()));
        let short = |name: &str| short_label(&Values::of(&[], name).unwrap());
        assert_eq!(["Delta", "tau_mean", "rayleigh_p"].map(short), ["Δ (m)", "⟨τ⟩ (s)", "rayleigh p"]);
    }
}
