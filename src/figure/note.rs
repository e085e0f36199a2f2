//! The small print of figures: what the parameters of their rows have in common.

use crate::model::{Parameters, Symbol, Value};
use crate::sets::setting;

/// What some parameters have in common, in symbols, but those left out; of the modulation, what those with one have.
pub(super) fn common<'a>(all: impl Iterator<Item = &'a Parameters>, left_out: &[Symbol]) -> String {
    let all: Vec<&Parameters> = all.collect();
    let mut modulated = all.clone();
    modulated.retain(|parameters| parameters.modulation_amplitude > 0.0);
    // What is off, or enters nothing that figures show, is left out, and the default of what the paper has no symbol
    // for.
    let shown = |symbol: Symbol| {
        let is_of_modulation = matches!(symbol, Symbol::Delta | Symbol::T);
        let those = if is_of_modulation && !modulated.is_empty() {
            &modulated
        } else {
            &all
        };
        let value = those.first()?.get(symbol);
        let is_shown = !matches!(symbol, Symbol::Seed | Symbol::FN | Symbol::L)
            && !left_out.contains(&symbol)
            && value != Value::Null
            && (value != Parameters::default().get(symbol)
                || !symbol.description().symbol.is_empty())
            && those
                .iter()
                .all(|parameters| parameters.get(symbol) == value);
        is_shown.then(|| setting(symbol, value, value.number().as_slice()))?
    };
    let all = Symbol::ALL.into_iter().filter_map(shown);
    all.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::quantity::tests::set;
    use crate::sets::symbol_of;

    #[test]
    fn small_print_has_what_all_have_in_common_and_symbols_have_their_subscripts() {
        let mut other = set(1e-6, 0.02, 4.0).parameters.all;
        other.blocks = 9;
        let all = [set(1e-6, 0.02, 4.0).parameters.all, other];
        let found = common(all.iter(), &[]).replace('\u{a0}', " ");
        assert!(
            found.starts_with("Nₛ = 20, M = 11.5 kg, K = 10⁸ N/m, K_d = 4·10⁷ N/m"),
            "{found}"
        );
        assert!(
            found.contains("Δfₛ = 0.0069 N") && found.contains("Δ = 1 µm, T = 20 ms"),
            "{found}"
        );
        assert!(
            !found.contains("N = ") && !found.contains("seed") && common([].iter(), &[]).is_empty()
        );
        let symbols = [Symbol::RampTime, Symbol::Seed, Symbol::TauR, Symbol::V0].map(symbol_of);
        assert_eq!(symbols, ["ramp time", "seed", "τᵣ", "V₀"]);
    }

    #[test]
    fn what_modulated_sets_have_in_common_is_said_beside_their_controls() {
        let sets = [0.0, 1e-6, 1e-6].map(|amplitude| set(amplitude, 0.02, 4.0));
        let found = common(sets.iter().map(|set| &*set.parameters), &[]);
        let found = found.replace('\u{a0}', " ");
        assert!(found.contains("Δ = 1 µm"), "{found}");
    }
}
