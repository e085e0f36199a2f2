//! Regimes: share of time within slips, mean friction and mean interval, along one parameter or over two.

use super::axis::{Axis, DECADES};
use super::colour_bar::ColourBar;
use super::dependence::{Getter, Lines, label, number};
use super::frame::Layout;
use super::legend::{Mark, entry};
use super::map::Map;
use super::panel::{self, Layer, Panel};
use super::picture::{Picture, Stroke};
use super::sets::{ascending, swept};
use super::style::{BLACK, Look, RADIUS, REFERENCE, shade};
use crate::model::Symbol;
use crate::observe::Regime;
use crate::reduce::{SetRow, Statistic};

/// Least values of the parameter along which lines are drawn, and of each parameter of a map.
const MIN_VALUES: usize = 4;
const BORDER: Stroke = Stroke::solid(BLACK, 1.6);

const SHARE: &str = "Share of time within slips";
const QUANTITIES: [(&str, Getter); 3] = [
    (SHARE, |set| Statistic::of(set.slip_share, None)),
    ("Mean friction (N)", |set| Statistic::of(set.mean_friction, set.mean_friction_interval)),
    ("Mean interval τ (s)", |set| Statistic::of(set.tau_mean, set.tau_interval)),
];

/// Draws sets in which, besides the modulation, only V0 or the reattachment delay differs, or any one parameter if not
/// all sets are stick-slip; `None` for others.
pub(super) fn regimes(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let [symbol] = swept(&sets.iter())[..] else { return None };
    let is_plain = sets.iter().all(|set| set.regime == Some(Regime::StickSlip));
    let values = ascending(sets.iter().filter_map(|set| number(&set.parameters, symbol)));
    if values.len() < MIN_VALUES || (is_plain && !matches!(symbol, Symbol::V0 | Symbol::TauR)) {
        return None;
    }
    let lines = Lines::of(sets, symbol)?;
    let is_sliding = |set: &SetRow| set.regime == Some(Regime::Sliding);
    let mut entries = lines.legend();
    if sets.iter().any(is_sliding) {
        entries.push(entry(Mark::Ring(BLACK, RADIUS, RADIUS - 1.6), "sliding"));
    }
    let [mixed, sliding] = Regime::MIN_SHARES;
    entries.push(entry(Mark::Line(REFERENCE), format!("mixed above {mixed}, sliding above {sliding}")));
    let panel = |(label, statistic): (&str, Getter)| {
        let ends = sets.iter().filter_map(statistic).flat_map(Statistic::ends);
        let (y, levels) = match label {
            SHARE => (Axis::linear(label, -0.03, 1.03), &Regime::MIN_SHARES[..]),
            _ => (Axis::of_data(label, ends, DECADES, 0.0)?, &[][..]),
        };
        let levels = levels.iter().map(|&share| Layer::Level(share, REFERENCE));
        Some(Panel::new(190.0, lines.axis(), y, levels.chain(lines.layers(statistic, is_sliding)).collect()))
    };
    let panels: Option<Vec<Panel<'_>>> = QUANTITIES.into_iter().map(panel).collect();
    Some(panel::draw("regimes", look, Layout::column(558.0), &entries, panels?))
}

/// Draws maps of sets in which two parameters besides the modulation differ, and that fill at least half of a grid of 4 by
/// 4 values or more; `None` for others.
pub(super) fn regime_map(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let swept = swept(&sets.iter());
    // The drive velocity is the x axis wherever it is one.
    let [horizontal, vertical] = match swept[..] {
        [first, Symbol::V0] => [Symbol::V0, first],
        [first, second] => [first, second],
        _ => return None,
    };
    let [x, y] = [horizontal, vertical].map(|symbol| move |set: &SetRow| number(&set.parameters, symbol));
    let map = Map::of(&sets.iter().collect::<Vec<_>>(), [&x, &y], MIN_VALUES)?;
    if Lines::of(sets, horizontal)?.lines.len() > 1 {
        return None;
    }
    let panel = |(name, statistic): (&'static str, Getter)| {
        let values = sets.iter().filter_map(statistic).map(|statistic| statistic.value);
        let shades = match name {
            SHARE => Axis::linear(name, 0.0, 1.0),
            _ => Axis::of_data(name, values, DECADES, 0.0)?,
        };
        let cells = map.coloured(|set| Some(shade(shades.place(statistic(set)?.value))));
        let borders = map.borders(|set| set.regime, BORDER);
        let mut layers = vec![Layer::Inside(std::iter::once(cells).chain(borders).collect())];
        if name == SHARE {
            let regime = |set: &SetRow| Regime::ALL.iter().position(|regime| set.regime == Some(*regime));
            let word = |index: usize| {
                let share = if Regime::ALL[index] == Regime::StickSlip { 0.0 } else { 1.0 };
                (Regime::ALL[index].word().to_owned(), share)
            };
            layers.extend(map.words(regime, word));
        }
        let (x, y) = map.axes(&label(horizontal), &label(vertical));
        Some(Panel { bar: Some(ColourBar::of_axis(name, &shades, shade)), ..Panel::new(220.0, x, y, layers) })
    };
    let panels: Option<Vec<Panel<'_>>> = QUANTITIES.into_iter().map(panel).collect();
    let legend = [entry(Mark::Line(BORDER), "borders of stick-slip, mixed, sliding; no slips where white")];
    Some(panel::draw("regime-map", look, Layout::column(490.0), &legend, panels?))
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::super::style::WHITE;
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
    fn a_sweep_of_the_velocity_shows_its_regimes_with_sliding_as_open_circles() {
        let sets: Vec<SetRow> = [0.05, 0.1, 0.3, 0.7, 1.0]
            .iter()
            .zip(1..)
            .map(|(&share, step)| at(1e-5 * f64::from(1 << step), 0.005, share))
            .collect();
        let svg = regimes(&sets, &Look::default()).unwrap().svg();
        for text in
            ["Drive velocity V₀ (m/s)", "Share of time within slips", "Mean friction (N)", "Mean interval τ (s)"]
        {
            assert!(svg.contains(&format!("{text}<")), "{text}");
        }
        assert_eq!(
            svg.matches(&format!("fill=\"{WHITE}\"")).count(),
            regimes(&sets[..4], &Look::default()).unwrap().svg().matches(&format!("fill=\"{WHITE}\"")).count() + 3
        );
        assert!(regimes(&sets[..3], &Look::default()).is_none(), "three values");
        let sizes: Vec<SetRow> = (1..=5)
            .map(|blocks| {
                let plain = set(0.0, 1.0, 1.0);
                SetRow {
                    parameters: Selected::new(Parameters { blocks, ..plain.parameters.parameters.clone() }),
                    ..plain
                }
            })
            .collect();
        assert!(regimes(&sizes, &Look::default()).is_none(), "nothing but stick-slip, and the drive is one");
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
