//! Regimes: share of time within slips, mean friction and mean interval over two parameters.

use super::axis::{Axis, DECADES};
use super::colour_bar::ColourBar;
use super::frame::Layout;
use super::legend::{Mark, entry};
use super::map::Map;
use super::panel::{self, Layer, Panel};
use super::picture::{Picture, Stroke};
use super::sets::axis_of;
use super::style::{BLACK, Look, shade};
use crate::model::Symbol;
use crate::observe::Regime;
use crate::reduce::{SetRow, differing};

/// Least values of each parameter.
const MIN_VALUES: usize = 4;
const BORDER: Stroke = Stroke::solid(BLACK, 1.6);

type Getter = fn(&SetRow) -> Option<f64>;

/// Column, and its value of a set.
const QUANTITIES: [(&str, Getter); 3] = [
    ("slip_share", |set| set.slip_share),
    ("mean_friction", |set| set.mean_friction),
    ("tau_mean", |set| set.tau_mean),
];

/// Draws maps of sets in which two parameters alone differ, and that fill at least half of a grid of 4 by
/// 4 values or more; `None` for others.
pub(super) fn regime_map(sets: &[SetRow], look: &Look) -> Option<Picture> {
    // The drive velocity is the x axis wherever it is one.
    let [horizontal, vertical] = match differing(&sets.iter())[..] {
        [first, Symbol::V0] => [Symbol::V0, first],
        [first, second] if ![first, second].contains(&Symbol::T) => [first, second],
        _ => return None,
    };
    let values = |symbol: Symbol| sets.iter().filter_map(move |set| set.parameters.get(symbol).number());
    let axes = [horizontal, vertical].map(|symbol| axis_of(symbol.key(), values(symbol)));
    let [x, y] = [(horizontal, axes[0].1), (vertical, axes[1].1)]
        .map(|(symbol, factor)| move |set: &SetRow| Some(factor * set.parameters.get(symbol).number()?));
    let map = Map::of(&sets.iter().collect::<Vec<_>>(), [&x, &y], MIN_VALUES)?;
    let panel = |(column, value): (&'static str, Getter)| {
        let is_share = column == "slip_share";
        let (name, factor) = axis_of(column, sets.iter().filter_map(value));
        let value = |set: &SetRow| Some(factor * value(set)?);
        let shades = if is_share {
            Axis::linear(&name, 0.0, 1.0)
        } else {
            Axis::of_data(&name, sets.iter().filter_map(value), DECADES, 0.0)?
        };
        let cells = map.coloured(|set| Some(shade(shades.place(value(set)?))));
        let borders = map.borders(|set| set.regime, BORDER);
        let mut layers = vec![Layer::Inside(std::iter::once(cells).chain(borders).collect())];
        if is_share {
            let regime = |set: &SetRow| Regime::ALL.iter().position(|regime| set.regime == Some(*regime));
            let word = |index: usize| {
                let share = if Regime::ALL[index] == Regime::StickSlip { 0.0 } else { 1.0 };
                (Regime::ALL[index].word().to_owned(), share)
            };
            layers.extend(map.words(regime, word));
        }
        let (x, y) = map.axes(&axes[0].0, &axes[1].0);
        Some(Panel { bar: Some(ColourBar::of_axis(&shades, shade)), ..Panel::new(220.0, x, y, layers) })
    };
    let panels: Option<Vec<Panel<'_>>> = QUANTITIES.into_iter().map(panel).collect();
    let legend = [entry(Mark::Line(BORDER), "borders of stick-slip, mixed, sliding; no slips where white")];
    Some(panel::draw("regime-map", look, Layout::column(490.0), &legend, panels?))
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;
    use crate::model::Parameters;
    use crate::model::selected::Selected;

    fn at(velocity: f64, delay: f64, share: f64) -> SetRow {
        let plain = set(0.0, 1.0, 1e-5 / velocity);
        let parameters =
            Parameters { drive_velocity: velocity, reattachment_time: delay, ..plain.parameters.parameters.clone() };
        let regime = Some(Regime::at(share));
        let is_sliding = regime == Some(Regime::Sliding);
        let tau_mean = plain.tau_mean.filter(|_| !is_sliding);
        SetRow { parameters: Selected::new(parameters), slip_share: Some(share), regime, tau_mean, ..plain }
    }

    #[test]
    fn two_parameters_make_a_map_with_lines_between_regimes() {
        let grid = |shares: fn(u32, u32) -> f64| -> Vec<SetRow> {
            (0..4)
                .flat_map(|row| {
                    (0..5).map(move |column| {
                        at(1e-5 * f64::from(1 << column), 1e-3 * f64::from(1 << row), shares(row, column))
                    })
                })
                .collect()
        };
        let map =
            |sets: &[SetRow]| regime_map(sets, &Look::default()).unwrap().svg().matches("stroke-width=\"1.6\"").count();
        let without = map(&grid(|_, _| 0.05));
        assert_eq!(map(&grid(|_, column| if column < 3 { 0.05 } else { 1.0 })), without + 3 * 4);
        assert!(regime_map(&grid(|_, _| 0.05)[..9], &Look::default()).is_none(), "two rows");
    }
}
