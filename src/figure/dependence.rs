//! Dependence on a parameter: locking index, resultant length of the phases, mean and spread of the intervals, a line
//! for each modulation.

use super::axis::{Axis, bounds};
use super::frame::{Layout, LegendPlace, Mark, ROW_GAP, entry};
use super::picture::{INKS, Ink, Picture, Stroke};
use super::sets::{Grid, distinct, modulation, swept};
use crate::model::{BreakOn, Parameters, Symbol, Value};
use crate::reduce::{SetSummary, Statistic};

/// Between the columns stand the numbers of the right one; right of them amplitude and frequency in one line.
const LAYOUT: Layout =
    Layout { columns: 2, width: 300.0, column_gap: 92.0, heights: &[230.0; 2], row_gap: ROW_GAP, right: 270.0 };
/// Least values of a parameter that make a dependence; a rule has two.
const MIN_VALUES: usize = 3;
const MILLISECONDS: f64 = 1e3;

type Getter = fn(&SetSummary) -> Option<Statistic>;
/// The panels: in either row a share of one, and a length of time.
const PANELS: [[(&str, Getter); 2]; 2] = [
    [
        ("Locking index", |set| set.locking_index),
        ("Mean interval τ (ms)", |set| set.tau_mean.map(|tau| tau.times(MILLISECONDS))),
    ],
    [
        ("Resultant length of φ", |set| set.resultant_length),
        ("Standard deviation of τ (ms)", |set| {
            set.tau_deviation.map(|deviation| Statistic { value: MILLISECONDS * deviation, interval: None })
        }),
    ],
];

/// Draws sets in which, besides the modulation, one parameter has 3 values or more, for each of up to six
/// modulations; `None` for others.
pub(super) fn dependence(sets: &[SetSummary]) -> Option<Picture> {
    let all: Vec<&SetSummary> = sets.iter().collect();
    let [symbol] = swept(&all)[..] else { return None };
    let min_values = if symbol == Symbol::BreakOn { 2 } else { MIN_VALUES };
    let lines = lines(all.iter().copied())?;
    if lines.iter().any(|line| line.len() < min_values) {
        return None;
    }
    let x = match symbol {
        Symbol::BreakOn => Axis::categories("Contacts break on", &[BreakOn::Magnitude.word(), BreakOn::Tension.word()]),
        _ => Grid::of(distinct(&all, |parameters| number(parameters, symbol))).wider_axis(&label(symbol)),
    };
    let mut sheet = LAYOUT.sheet("dependence");
    for (row, panels) in PANELS.into_iter().enumerate() {
        for (column, (y_label, statistic)) in panels.into_iter().enumerate() {
            let ends = sets.iter().filter_map(statistic).flat_map(Statistic::ends);
            let high = if column == 0 { 1.0 } else { bounds(ends).map_or(1.0, |(_, high)| high) };
            let frame = LAYOUT.frame(row, column, x.clone(), Axis::rounded(y_label, 0.0, high));
            for (line, ink) in lines.iter().zip(INKS) {
                let points = line.iter().filter_map(|set| Some((number(&set.parameters, symbol)?, statistic(set)?)));
                frame.statistics(&mut sheet, &points.collect::<Vec<_>>(), stroke(ink), 4.0);
            }
            frame.axes(&mut sheet);
            frame.y_label(&mut sheet);
            frame.x_label(&mut sheet);
            if (row, column) == (0, 1) {
                let names = lines.iter().map(|line| modulation(&line[0].parameters));
                let entries: Vec<_> = names.zip(INKS).map(|(name, ink)| entry(Mark::Line(stroke(ink)), name)).collect();
                frame.legend(&mut sheet, LegendPlace::Beside, &entries);
            }
        }
    }
    Some(sheet.finish())
}

/// The sets of each modulation, in their order, if there are enough inks.
pub(super) fn lines<'a>(sets: impl Iterator<Item = &'a SetSummary>) -> Option<Vec<Vec<&'a SetSummary>>> {
    let modulation = |set: &SetSummary| (set.parameters.modulation_amplitude, set.parameters.modulation_period);
    let mut lines: Vec<Vec<&SetSummary>> = Vec::new();
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
        (_, Value::BreakOn(rule)) => Some(if rule == BreakOn::Magnitude { 0.0 } else { 1.0 }),
        (_, Value::Flag(_) | Value::Absent) => None,
    }
}

pub(super) fn label(symbol: Symbol) -> String {
    let unit = if symbol == Symbol::Dfs { "" } else { symbol.description().unit };
    let name = match symbol {
        Symbol::N => "Blocks N",
        Symbol::Ns => "Contacts per block Nₛ",
        Symbol::M => "Slider mass M",
        Symbol::K => "Slider stiffness K",
        Symbol::Kd => "Drive stiffness Kd",
        Symbol::SmallK => "Contact stiffness k",
        Symbol::Fs => "Contact threshold fₛ",
        Symbol::Dfs => "Spread of thresholds Δfₛ / fₛ",
        Symbol::TauR => "Reattachment delay τᵣ",
        Symbol::Gamma => "Damping rate γ",
        Symbol::V0 => "Drive velocity V₀",
        other => other.key(),
    };
    if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") }
}

const fn stroke(ink: Ink) -> Stroke {
    Stroke::solid(ink, 1.6)
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;

    fn spread(deviation: f64, amplitude: f64) -> SetSummary {
        let plain = set(amplitude, 0.02, 4.0);
        SetSummary { parameters: Parameters { threshold_deviation: deviation, ..plain.parameters.clone() }, ..plain }
    }

    #[test]
    fn one_swept_parameter_becomes_the_axis_and_each_modulation_a_line() {
        let sets: Vec<SetSummary> =
            [0.0, 0.0137, 0.137].iter().flat_map(|&dfs| [spread(dfs, 0.0), spread(dfs, 1e-6)]).collect();
        assert_eq!(number(&sets[5].parameters, Symbol::Dfs), Some(0.137 / 1.37));
        let svg = dependence(&sets).unwrap().svg();
        for text in ["Spread of thresholds Δfₛ / fₛ", "Locking index", "Δ = 0", "Δ = 1 µm, 1/T = 50 Hz"] {
            assert!(svg.contains(&format!(">{text}<")), "{text}");
        }
        assert!(dependence(&sets[..4]).is_none(), "two values");
        assert!(dependence(&sets[..5]).is_none(), "two values of one modulation");
        assert!(dependence(&[set(0.0, 1.0, 1.0), set(1e-6, 0.1, 1.0), set(1e-6, 0.2, 1.0)]).is_none());
        let mut two = sets;
        two[0].parameters.blocks = 9;
        assert!(dependence(&two).is_none(), "two parameters");
        let many = (0..7).flat_map(|step| [0.0, 0.0137, 0.137].map(|dfs| spread(dfs, 1e-6 + 1e-7 * f64::from(step))));
        assert!(dependence(&many.collect::<Vec<_>>()).is_none(), "seven modulations");
    }

    #[test]
    fn the_breaking_rule_is_an_axis_of_words() {
        let tension = |amplitude| {
            let plain = set(amplitude, 0.02, 4.0);
            SetSummary { parameters: Parameters { break_on: BreakOn::Tension, ..plain.parameters.clone() }, ..plain }
        };
        let svg = dependence(&[set(1e-6, 0.02, 4.0), tension(1e-6)]).unwrap().svg();
        assert!(svg.contains(">magnitude<") && svg.contains(">tension<"));
    }

    #[test]
    fn error_bars_are_those_of_the_data() {
        let mut sets: Vec<SetSummary> = [0.0, 0.01, 0.02].map(|dfs| spread(dfs, 1e-6)).to_vec();
        let lines = |sets: &[SetSummary]| dependence(sets).unwrap().svg().matches("<path").count();
        let with = lines(&sets);
        for set in &mut sets {
            set.locking_index = set.locking_index.map(|index| Statistic { interval: None, ..index });
        }
        assert_eq!(with - lines(&sets), 3);
    }
}
