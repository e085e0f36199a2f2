//! Dependence on a parameter: locking index, resultant length of the phases, mean and spread of the intervals, a line for
//! each modulation.

use super::axis::{Axis, bounds};
use super::frame::{ABOVE, Frame, LEFT, LegendPlace, Mark, UNDER};
use super::picture::{Dot, INKS, Ink, Picture, Sheet, Stroke};
use super::sets::{Grid, distinct, modulation, swept};
use crate::model::{BreakOn, Parameters, Symbol, Value};
use crate::reduce::{SetSummary, Statistic};

const PANEL: (f64, f64) = (300.0, 230.0);
/// Between two columns, for the numbers of the right one.
const COLUMN_GAP: f64 = 92.0;
const ROW_GAP: f64 = 52.0;
/// Right of the panels, for amplitude and frequency in one line.
const MODULATIONS: f64 = 270.0;
/// Least values of a parameter that make a dependence; a rule has two.
const LEAST: usize = 3;
const MILLISECONDS: f64 = 1e3;

type Getter = fn(&SetSummary) -> Option<Statistic>;
/// The panels, row by row.
const PANELS: [(&str, Getter); 4] = [
    ("Locking index", |set| set.locking_index),
    ("Mean interval τ (ms)", |set| set.tau_mean.map(|tau| tau.times(MILLISECONDS))),
    ("Resultant length of φ", |set| set.resultant_length),
    ("Standard deviation of τ (ms)", |set| {
        set.tau_deviation.map(|deviation| Statistic { value: MILLISECONDS * deviation, interval: None })
    }),
];

/// Draws sets in which, besides the modulation, one parameter has 3 values or more, for each of up to six
/// modulations; `None` for others.
pub fn dependence(sets: &[SetSummary]) -> Option<Picture> {
    let all: Vec<&SetSummary> = sets.iter().collect();
    let [symbol] = swept(&all)[..] else { return None };
    let values = distinct(sets, |parameters| number(parameters, symbol));
    let least = if symbol == Symbol::BreakOn { 2 } else { LEAST };
    let lines = lines(sets)?;
    if lines.iter().any(|line| line.len() < least) {
        return None;
    }
    let x = match symbol {
        Symbol::BreakOn => Axis::words("Contacts break on", &[BreakOn::Magnitude.word(), BreakOn::Tension.word()]),
        _ => Grid::of(values).wider_axis(&label(symbol)),
    };
    let (rows, columns) = (PANELS.len() / 2, 2.0);
    let size = (
        LEFT + columns * PANEL.0 + COLUMN_GAP + MODULATIONS,
        ABOVE + rows as f64 * (PANEL.1 + ROW_GAP) - ROW_GAP + UNDER,
    );
    let mut sheet = Sheet::new("dependence", size);
    for (index, (y_label, statistic)) in PANELS.into_iter().enumerate() {
        let (row, column) = (index / 2, index % 2);
        let ends = sets.iter().filter_map(statistic).flat_map(Statistic::ends);
        // Shares of one, and lengths of time from zero on.
        let high = if column == 0 { 1.0 } else { bounds(ends).map_or(1.0, |(_, high)| high) };
        let frame = Frame {
            left: LEFT + column as f64 * (PANEL.0 + COLUMN_GAP),
            top: ABOVE + row as f64 * (PANEL.1 + ROW_GAP),
            width: PANEL.0,
            height: PANEL.1,
            x: x.clone(),
            y: Axis::around(y_label, 0.0, high),
        };
        for (line, ink) in lines.iter().zip(INKS) {
            let points = line.iter().filter_map(|set| Some((number(&set.parameters, symbol)?, statistic(set)?)));
            draw(&mut sheet, &frame, &points.collect::<Vec<_>>(), ink);
        }
        frame.axes(&mut sheet, row + 1 == rows);
        frame.y_label(&mut sheet);
        if row + 1 == rows {
            frame.x_label(&mut sheet);
        }
        if index == 1 {
            let entry =
                |(line, ink): (&Vec<&SetSummary>, Ink)| (Mark::Line(stroke(ink)), modulation(&line[0].parameters));
            frame.legend(&mut sheet, LegendPlace::Beside, &lines.iter().zip(INKS).map(entry).collect::<Vec<_>>());
        }
    }
    Some(sheet.finish())
}

/// The sets of each modulation, as they come, if there are no more than inks.
fn lines(sets: &[SetSummary]) -> Option<Vec<Vec<&SetSummary>>> {
    let modulation = |set: &SetSummary| (set.parameters.modulation_amplitude, set.parameters.modulation_period);
    let mut lines: Vec<Vec<&SetSummary>> = Vec::new();
    for set in sets {
        match lines.iter().position(|line| modulation(line[0]) == modulation(set)) {
            Some(line) => lines[line].push(set),
            None if lines.len() == INKS.len() => return None,
            None => lines.push(vec![set]),
        }
    }
    Some(lines)
}

/// Where a parameter stands on the axis: its value, the spread of thresholds over their mean, the place of a rule.
fn number(parameters: &Parameters, symbol: Symbol) -> Option<f64> {
    match (symbol, parameters.get(symbol)) {
        (Symbol::Dfs, _) => Some(parameters.threshold_deviation / parameters.mean_threshold),
        (_, Value::Real(real)) => Some(real),
        (_, Value::Count(count)) => Some(count as f64),
        (_, Value::BreakOn(rule)) => Some(if rule == BreakOn::Magnitude { 0.0 } else { 1.0 }),
        (_, Value::Flag(_) | Value::Absent) => None,
    }
}

fn label(symbol: Symbol) -> String {
    let (name, unit) = match symbol {
        Symbol::N => ("Blocks N", ""),
        Symbol::Ns => ("Contacts per block Nₛ", ""),
        Symbol::M => ("Slider mass M", "kg"),
        Symbol::K => ("Slider stiffness K", "N/m"),
        Symbol::Kd => ("Drive stiffness Kd", "N/m"),
        Symbol::SmallK => ("Contact stiffness k", "N/m"),
        Symbol::Fs => ("Contact threshold fₛ", "N"),
        Symbol::Dfs => ("Spread of thresholds Δfₛ / fₛ", ""),
        Symbol::TauR => ("Reattachment delay τᵣ", "s"),
        Symbol::Gamma => ("Damping rate γ", "1/s"),
        Symbol::V0 => ("Drive velocity V₀", "m/s"),
        other => (other.key(), other.description().unit),
    };
    if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") }
}

const fn stroke(ink: Ink) -> Stroke {
    Stroke::solid(ink, 1.6)
}

fn draw(sheet: &mut Sheet, frame: &Frame, points: &[(f64, Statistic)], ink: Ink) {
    let values = || points.iter().map(|&(x, statistic)| (x, statistic.value));
    frame.clipped(sheet, |sheet| {
        frame.curve(sheet, values(), stroke(ink));
        for &(x, statistic) in points {
            frame.error_bar(sheet, x, statistic.interval, ink);
        }
    });
    frame.points(sheet, values(), Dot { ink, radius: 4.0, opacity: 1.0 });
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
    fn the_rule_of_breaking_is_told_in_words() {
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
