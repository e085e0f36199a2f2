//! Dependence on a parameter: locking index, resultant length of the phases, mean and spread of the intervals, a line
//! for each modulation.

use super::axis::{Axis, bounds};
use super::frame::{Frame, Layout, RIGHT, ROW_GAP};
use super::legend::{Mark, entry};
use super::picture::{Picture, Sheet};
use super::sets::{Grid, distinct, modulation, parameter, swept};
use super::style::{INKS, Look, RADIUS, curve, dot};
use crate::model::{BreakOn, Parameters, Symbol, Value};
use crate::reduce::{SetRow, Statistic};

/// Of a column of panels; between columns stand the numbers of the right one.
const WIDTH: f64 = 330.0;
const COLUMN_GAP: f64 = 92.0;
const HEIGHTS: [f64; 2] = [230.0; 2];
/// Least values of a parameter that make a dependence; a rule has two.
const MIN_VALUES: usize = 3;
/// Ratio of the largest to the least value from which times are drawn on a logarithmic axis.
const WIDE: f64 = 3.0;
/// Lowest share at which an axis of shares begins, if all lie above.
const HIGH_SHARE: f64 = 0.5;
const MILLISECONDS: f64 = 1e3;

pub(super) type Getter = fn(&SetRow) -> Option<Statistic>;

/// A quantity of a panel: its label, its value, and whether it lies between 0 and 1.
type Quantity = (&'static str, Getter, bool);

const QUANTITIES: [Quantity; 4] = [
    ("Mean interval τ (ms)", |set| Some(Statistic::of(set.tau_mean, set.tau_interval)?.times(MILLISECONDS)), false),
    (
        "Standard deviation of τ (ms)",
        |set| {
            let deviation = set.tau_deviation.filter(|deviation| *deviation > 0.0);
            Some(Statistic::of(deviation, None)?.times(MILLISECONDS))
        },
        false,
    ),
    ("Locking index", |set| Statistic::of(set.locking_index, set.locking_interval), true),
    ("Resultant length of φ", |set| Statistic::of(set.resultant_length, set.length_interval), true),
];

/// Draws sets in which, besides the modulation, one parameter has 3 values or more, for each of up to six
/// modulations; `None` for others. Quantities that no set has get no panel.
pub(super) fn dependence(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let [symbol] = swept(&sets.iter())[..] else { return None };
    let min_values = if symbol == Symbol::BreakOn { 2 } else { MIN_VALUES };
    let lines = lines(sets.iter())?;
    if lines.iter().any(|line| line.len() < min_values) {
        return None;
    }
    let x = match symbol {
        Symbol::BreakOn => Axis::categories("Contacts break on", &[BreakOn::Magnitude.word(), BreakOn::Tension.word()]),
        _ => Grid::of(distinct(sets.iter(), |parameters| number(parameters, symbol))).wider_axis(&label(symbol)),
    };
    let present: Vec<Quantity> =
        QUANTITIES.into_iter().filter(|quantity| sets.iter().any(|set| quantity.1(set).is_some())).collect();
    if present.is_empty() {
        return None;
    }
    let names = lines.iter().map(|line| modulation(&line[0].parameters));
    let entries: Vec<_> = names.zip(INKS).map(|(name, ink)| entry(Mark::Dot(dot(ink)), name)).collect();
    let columns = present.len().min(2);
    let heights = HEIGHTS.get(..present.len().div_ceil(2))?;
    let layout = Layout { columns, column_gap: COLUMN_GAP, ..Layout::column(WIDTH, heights, ROW_GAP, RIGHT) };
    let (page, mut sheet) = layout.page("dependence", look, &entries);
    for (index, quantity) in present.into_iter().enumerate() {
        let frame = page.frame(index / columns, index % columns, x.clone(), y_axis(quantity, sets)?);
        draw(&mut sheet, &frame, &lines, symbol, quantity.1);
        frame.axes(&mut sheet);
    }
    Some(sheet.finish())
}

/// Shares from 0, or from a half, to 1; times from 0, or logarithmic if they span much.
fn y_axis((label, value, is_share): Quantity, sets: &[SetRow]) -> Option<Axis> {
    let ends = sets.iter().filter_map(value).flat_map(Statistic::ends);
    if !is_share {
        return Axis::of_data(label, ends.map(|end| end.max(0.0)), WIDE, 0.0);
    }
    let (low, _) = bounds(ends)?;
    Some(Axis::linear(label, if low > HIGH_SHARE { HIGH_SHARE } else { 0.0 }, 1.0))
}

fn draw(sheet: &mut Sheet, frame: &Frame, lines: &[Vec<&SetRow>], symbol: Symbol, value: Getter) {
    for (line, ink) in lines.iter().zip(INKS) {
        let points = line.iter().filter_map(|set| Some((number(&set.parameters, symbol)?, value(set)?)));
        frame.statistics(sheet, &points.collect::<Vec<_>>(), curve(ink), RADIUS);
    }
}

/// The sets of each modulation, in their order, if there are enough inks.
pub(super) fn lines<'a>(sets: impl Iterator<Item = &'a SetRow>) -> Option<Vec<Vec<&'a SetRow>>> {
    let modulation = |set: &SetRow| (set.parameters.modulation_amplitude, set.parameters.modulation_period);
    let mut lines: Vec<Vec<&SetRow>> = Vec::new();
    for set in sets {
        match lines.iter_mut().find(|line| modulation(line[0]) == modulation(set)) {
            Some(line) => line.push(set),
            None => lines.push(vec![set]),
        }
    }
    (lines.len() <= INKS.len()).then_some(lines)
}

/// Where a parameter stands on the axis: its value, the spread of thresholds over their mean, the place of a rule.
pub(super) fn number(parameters: &Parameters, symbol: Symbol) -> Option<f64> {
    match (symbol, parameters.get(symbol)) {
        (Symbol::Dfs, _) => Some(parameters.threshold_deviation / parameters.mean_threshold),
        (_, Value::Real(real)) => Some(real),
        (_, Value::Count(count)) => Some(count as f64),
        (_, Value::Text(word)) => Some(if word == BreakOn::Magnitude.word() { 0.0 } else { 1.0 }),
        (_, Value::Flag(_) | Value::Null) => None,
    }
}

pub(super) fn label(symbol: Symbol) -> String {
    if symbol == Symbol::Dfs { "Spread of thresholds Δfₛ / fₛ".to_owned() } else { parameter(symbol) }
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;
    use crate::model::selected::Selected;

    fn spread(deviation: f64, amplitude: f64) -> SetRow {
        let plain = set(amplitude, 0.02, 4.0);
        SetRow {
            parameters: Selected::new(Parameters {
                threshold_deviation: deviation,
                ..plain.parameters.parameters.clone()
            }),
            ..plain
        }
    }

    #[test]
    fn one_swept_parameter_becomes_the_axis_and_each_modulation_a_line() {
        let sets: Vec<SetRow> =
            [0.0, 0.0137, 0.137].iter().flat_map(|&dfs| [spread(dfs, 0.0), spread(dfs, 1e-6)]).collect();
        assert_eq!(number(&sets[5].parameters, Symbol::Dfs), Some(0.137 / 1.37));
        let svg = dependence(&sets, &Look::default()).unwrap().svg();
        for text in ["Spread of thresholds Δfₛ / fₛ", "(c) Locking index", "Δ = 0", "Δ = 1 µm, 1/T = 50 Hz"] {
            assert!(svg.contains(&format!(">{text}<")), "{text}");
        }
        assert!(dependence(&sets[..4], &Look::default()).is_none(), "two values");
        assert!(dependence(&sets[..5], &Look::default()).is_none(), "two values of one modulation");
        assert!(
            dependence(&[set(0.0, 1.0, 1.0), set(1e-6, 0.1, 1.0), set(1e-6, 0.2, 1.0)], &Look::default()).is_none()
        );
        let mut two = sets;
        two[0].parameters.parameters.blocks = 9;
        assert!(dependence(&two, &Look::default()).is_none(), "two parameters");
        let many = (0..7).flat_map(|step| [0.0, 0.0137, 0.137].map(|dfs| spread(dfs, 1e-6 + 1e-7 * f64::from(step))));
        assert!(dependence(&many.collect::<Vec<_>>(), &Look::default()).is_none(), "seven modulations");
    }

    #[test]
    fn quantities_without_values_get_no_panel_and_sets_without_slips_no_figure() {
        let slides = |set: SetRow| SetRow { tau_mean: None, tau_deviation: None, resultant_length: None, ..set };
        let mut sets = [0.0, 0.0137, 0.137].map(|dfs| slides(spread(dfs, 1e-6)));
        let svg = dependence(&sets, &Look::default()).unwrap().svg();
        assert!(svg.contains("Locking index") && !svg.contains("Mean interval"));
        for set in &mut sets {
            set.locking_index = None;
        }
        assert!(dependence(&sets, &Look::default()).is_none());
    }

    #[test]
    fn the_breaking_rule_is_an_axis_of_words() {
        let tension = |amplitude| {
            let plain = set(amplitude, 0.02, 4.0);
            SetRow {
                parameters: Selected::new(Parameters {
                    break_on: BreakOn::Tension,
                    ..plain.parameters.parameters.clone()
                }),
                ..plain
            }
        };
        let svg = dependence(&[set(1e-6, 0.02, 4.0), tension(1e-6)], &Look::default()).unwrap().svg();
        assert!(svg.contains(">magnitude<") && svg.contains(">tension<"));
    }

    #[test]
    fn error_bars_are_those_of_the_data() {
        let mut sets: Vec<SetRow> = [0.0, 0.01, 0.02].map(|dfs| spread(dfs, 1e-6)).to_vec();
        let lines = |sets: &[SetRow]| dependence(sets, &Look::default()).unwrap().svg().matches("<path").count();
        let with = lines(&sets);
        for set in &mut sets {
            set.locking_interval = None;
        }
        assert_eq!(with - lines(&sets), 3);
    }
}
