//! Dependence on a parameter: locking index, resultant length of the phases, mean and spread of the intervals, a line
//! for each modulation, and a dashed one for what the drive alone explains.

use super::axis::{Axis, bounds};
use super::frame::Layout;
use super::legend::{Entry, Mark, entry};
use super::panel::{self, Layer, Panel, Place};
use super::picture::{Dot, Picture};
use super::sets::{Grid, ascending, modulation, parameter, swept};
use super::style::{BLACK, INKS, Look, RADIUS, WHITE, curve, dot, drive_alone};
use crate::model::{BreakOn, Parameters, Symbol, Value};
use crate::reduce::{SetRow, Statistic};

/// Of a column of panels; between columns stand the numbers of the right one.
const WIDTH: f64 = 330.0;
const COLUMN_GAP: f64 = 92.0;
const HEIGHT: f64 = 230.0;
/// Least values of a parameter that make a dependence; a rule has two.
const MIN_VALUES: usize = 3;
/// Ratio of the largest to the least value from which times are drawn on a logarithmic axis.
const WIDE: f64 = 3.0;
/// Lowest share at which an axis of shares begins, if all lie above.
const HIGH_SHARE: f64 = 0.5;
const MILLISECONDS: f64 = 1e3;

pub(super) type Getter = fn(&SetRow) -> Option<Statistic>;

/// A quantity of a panel: its label, its value, and of a share, between 0 and 1, its part by the drive alone.
type Quantity = (&'static str, Getter, Option<fn(&SetRow) -> Option<f64>>);

const QUANTITIES: [Quantity; 4] = [
    ("Mean interval τ (ms)", |set| Some(Statistic::of(set.tau_mean, set.tau_interval)?.times(MILLISECONDS)), None),
    (
        "Standard deviation of τ (ms)",
        |set| {
            let deviation = set.tau_deviation.filter(|deviation| *deviation > 0.0);
            Some(Statistic::of(deviation, None)?.times(MILLISECONDS))
        },
        None,
    ),
    (
        "Locking index",
        |set| Statistic::of(set.locking_index, set.locking_interval),
        Some(|set| set.locking_index_drive),
    ),
    (
        "Resultant length of φ",
        |set| Statistic::of(set.resultant_length, set.length_interval),
        Some(|set| set.resultant_drive),
    ),
];

/// Draws sets in which, besides the modulation, one parameter has 3 values or more, for each of up to six
/// modulations; `None` for others. Quantities that no set has get no panel.
pub(super) fn dependence(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let [symbol] = swept(&sets.iter())[..] else { return None };
    let min_values = if symbol == Symbol::BreakOn { 2 } else { MIN_VALUES };
    let lines = Lines::of(sets, symbol)?;
    if lines.lines.iter().any(|line| line.len() < min_values) {
        return None;
    }
    let x = match symbol {
        Symbol::BreakOn => Axis::categories("Contacts break on", &[BreakOn::Magnitude.word(), BreakOn::Tension.word()]),
        _ => lines.axis(),
    };
    let panel = |quantity: Quantity| {
        let mut layers = lines.layers(quantity.1, |_| false);
        for (line, ink) in lines.lines.iter().zip(INKS) {
            let alone = |set: &&SetRow| Some((number(&set.parameters, symbol)?, quantity.2?(set)?));
            layers.push(Layer::Curve(line.iter().filter_map(alone).collect(), drive_alone(ink)));
        }
        Some(Panel::new(HEIGHT, x.clone(), y_axis(quantity, sets)?, layers))
    };
    let panels: Vec<Panel<'_>> = QUANTITIES.into_iter().filter_map(panel).collect();
    if panels.is_empty() {
        return None;
    }
    let layout = Layout { columns: panels.len().min(2), column_gap: COLUMN_GAP, ..Layout::column(WIDTH) };
    let mut legend = lines.legend();
    let has_drive = sets.iter().any(|set| set.resultant_drive.is_some());
    legend.extend(has_drive.then(|| entry(Mark::Line(drive_alone(BLACK)), "by the drive alone")));
    Some(panel::draw("dependence", look, layout, &legend, panels))
}

/// Shares from 0, or from a half, to 1; times from 0, or logarithmic if they span much; `None` if no set has a value.
fn y_axis((label, value, drive): Quantity, sets: &[SetRow]) -> Option<Axis> {
    let ends = sets.iter().filter_map(value).flat_map(Statistic::ends);
    let Some(drive) = drive else {
        return Axis::of_data(label, ends.map(|end| end.max(0.0)), WIDE, 0.0);
    };
    let (low, _) = bounds(ends.chain(sets.iter().filter_map(drive)))?;
    Some(Axis::linear(label, if low > HIGH_SHARE { HIGH_SHARE } else { 0.0 }, 1.0))
}

/// Sets along a parameter: a line for each modulation.
pub(super) struct Lines<'a> {
    symbol: Symbol,
    pub(super) lines: Vec<Vec<&'a SetRow>>,
}

impl<'a> Lines<'a> {
    /// `None` for more modulations than there are inks.
    pub(super) fn of(sets: &'a [SetRow], symbol: Symbol) -> Option<Self> {
        let modulation = |set: &SetRow| (set.parameters.modulation_amplitude, set.parameters.modulation_period);
        let mut lines: Vec<Vec<&SetRow>> = Vec::new();
        for set in sets {
            match lines.iter_mut().find(|line| modulation(line[0]) == modulation(set)) {
                Some(line) => line.push(set),
                None => lines.push(vec![set]),
            }
        }
        (lines.len() <= INKS.len()).then_some(Self { symbol, lines })
    }

    pub(super) fn axis(&self) -> Axis {
        let values = self.lines.iter().flatten().filter_map(|set| number(&set.parameters, self.symbol));
        Grid::of(ascending(values)).wider_axis(&label(self.symbol))
    }

    pub(super) fn legend(&self) -> Vec<Entry> {
        let names = self.lines.iter().map(|line| modulation(&line[0].parameters));
        names.zip(INKS).map(|(name, ink)| entry(Mark::Dot(dot(ink)), name)).collect()
    }

    /// A statistic of all sets, some of them as open circles.
    pub(super) fn layers<'l>(&self, value: Getter, is_open: fn(&SetRow) -> bool) -> Vec<Layer<'l>> {
        let place = |set: &&SetRow| Some((number(&set.parameters, self.symbol)?, value(set)?));
        let mut layers = Vec::new();
        for (line, ink) in self.lines.iter().zip(INKS) {
            layers.extend(Layer::statistics(&line.iter().filter_map(place).collect::<Vec<_>>(), curve(ink), RADIUS));
            let open = line.iter().filter(|set| is_open(set)).filter_map(place);
            let open: Vec<Place> = open.map(|(x, statistic)| (x, statistic.value)).collect();
            layers.push(Layer::Dots(open, Dot::solid(WHITE, RADIUS - 1.6)));
        }
        layers
    }
}

/// Where a parameter stands on the axis: its value, the spread of thresholds over their mean, the place of a rule.
pub(super) fn number(parameters: &Parameters, symbol: Symbol) -> Option<f64> {
    match (symbol, parameters.get(symbol)) {
        (Symbol::Dfs, _) => Some(parameters.threshold_deviation / parameters.mean_threshold),
        (_, Value::Text(word)) => Some(if word == BreakOn::Magnitude.word() { 0.0 } else { 1.0 }),
        (_, value) => value.number(),
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
    fn what_the_drive_alone_explains_is_dashed_and_inside_the_frame() {
        let mut sets = [0.0, 0.0137, 0.137].map(|dfs| spread(dfs, 1e-6));
        let drawn = |sets: &[SetRow]| dependence(sets, &Look::default()).unwrap().svg();
        let lines = |svg: &str| svg.matches("<path").count();
        let without = drawn(&sets);
        for set in &mut sets {
            set.resultant_drive = Some(0.6);
        }
        let with = drawn(&sets);
        assert!(with.contains(">by the drive alone<") && !without.contains("by the drive alone"));
        // A mark of few dashes, and a curve of many.
        assert!(lines(&with) - lines(&without) > 30);
        let low = |sets: &[SetRow]| y_axis(QUANTITIES[3], sets).unwrap().low;
        assert_eq!(low(&sets), HIGH_SHARE);
        for set in &mut sets {
            set.resultant_drive = Some(0.1);
        }
        assert_eq!(low(&sets), 0.0);
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
