//! The staircase: the interval in periods over the period of the modulation, on whole numbers where it is locked, and the
//! locking index under it.

use super::axis::{Axis, bounds, logarithmic_bounds};
use super::frame::{ABOVE, Frame, LEFT, LEGEND, LegendPlace, Mark, UNDER};
use super::picture::{Dot, GREY, INKS, Ink, LIGHT_GREY, Picture, Sheet, Stroke};
use super::sets::{Periods, amplitude, distinct, swept};
use crate::reduce::SetSummary;

const WIDTH: f64 = 840.0;
/// Of the intervals and of the locking index.
const HEIGHTS: [f64; 2] = [330.0, 170.0];
/// Between the panels, where the lower one's label stands.
const GAP: f64 = 52.0;
/// Least values of the period that make a staircase.
const LEAST_PERIODS: usize = 24;
/// Amplitudes that are told apart.
const MOST_AMPLITUDES: usize = 3;
/// From this ratio on, τ/T is drawn on a logarithmic axis.
const WIDE: f64 = 6.0;
/// Whole numbers whose lines do not merge.
const MOST_LINES: f64 = 10.0;
const WHOLE: Stroke = Stroke::solid(LIGHT_GREY, 1.0);
const FREE: Stroke = Stroke::dashed(GREY, 1.6, (6.0, 4.0));
const BAND: f64 = 0.3;

/// Draws the staircase of sets that differ in the modulation alone, with 24 periods or more and at most
/// 3 amplitudes; `None` for others. Periods are told over τ₀ if there is a set without modulation.
pub fn staircase(sets: &[SetSummary]) -> Option<Picture> {
    let modulated: Vec<&SetSummary> = sets.iter().filter(|set| set.parameters.modulation_period.is_some()).collect();
    let amplitudes = distinct(modulated.iter().copied(), |parameters| Some(parameters.modulation_amplitude));
    let periods = distinct(modulated.iter().copied(), |parameters| parameters.modulation_period);
    let all: Vec<&SetSummary> = sets.iter().collect();
    if periods.len() < LEAST_PERIODS || amplitudes.len() > MOST_AMPLITUDES || !swept(&all).is_empty() {
        return None;
    }
    let free = sets.iter().find(|set| set.parameters.modulation_period.is_none());
    let free = free.and_then(|set| set.tau_mean).map(|tau| tau.value);
    let periods = Periods::of(&periods, free);
    let x = periods.grid.axis(periods.label);
    let whole_periods = modulated.iter().filter_map(|set| quartiles(set)).flatten();
    let frames = frames(&x, whole_periods)?;

    let mut sheet = Sheet::new("staircase", (WIDTH, ABOVE + HEIGHTS[0] + GAP + HEIGHTS[1] + UNDER));
    frames[0].clipped(&mut sheet, |sheet| {
        let y = &frames[0].y;
        let lines = (1..).map(f64::from).skip_while(|&n| n < y.low).take_while(|&n| n <= y.high.min(MOST_LINES));
        lines.for_each(|n| frames[0].curve(sheet, [(x.low, n), (x.high, n)], WHOLE));
        if let Some(free) = free {
            frames[0].curve(sheet, x.even(200).map(|place| (place, free / periods.period(place))), FREE);
        }
    });
    let mut entries = Vec::new();
    for (&height, ink) in amplitudes.iter().zip(INKS) {
        let such = modulated.iter().filter(|set| set.parameters.modulation_amplitude == height);
        let places: Vec<(f64, &SetSummary)> =
            such.filter_map(|set| Some((periods.place(set.parameters.modulation_period?), *set))).collect();
        draw(&mut sheet, &frames, &periods, &places, ink);
        entries.push((Mark::Dot(dot(ink)), amplitude(height)));
    }
    entries.push((Mark::Patch(GREY, BAND), "25 to 75 % of slips".to_owned()));
    entries.push((Mark::Line(WHOLE), "τ = nT".to_owned()));
    if free.is_some() {
        entries.push((Mark::Line(FREE), "τ₀ / T, Δ = 0".to_owned()));
    }
    for (panel, frame) in frames.iter().enumerate() {
        frame.axes(&mut sheet, panel == 1);
        frame.y_label(&mut sheet);
    }
    frames[1].x_label(&mut sheet);
    frames[0].legend(&mut sheet, LegendPlace::Beside, &entries);
    Some(sheet.finish())
}

/// The frames of the intervals and of the locking index.
fn frames(x: &Axis, whole_periods: impl Iterator<Item = f64> + Clone) -> Option<[Frame; 2]> {
    let label = "Slip interval τ / T, median";
    let (low, high) = bounds(whole_periods.clone())?;
    let intervals = if high > WIDE * low {
        let (low, high) = logarithmic_bounds(whole_periods)?;
        Axis::logarithmic(label, low, high)
    } else {
        Axis::around(label, low, high)
    };
    let frame = |top, height, y| Frame { left: LEFT, top, width: WIDTH - LEFT - LEGEND, height, x: x.clone(), y };
    let below = ABOVE + HEIGHTS[0] + GAP;
    Some([frame(ABOVE, HEIGHTS[0], intervals), frame(below, HEIGHTS[1], Axis::few("Locking index", 0.0, 1.0))])
}

/// One amplitude: sets at their places.
fn draw(sheet: &mut Sheet, frames: &[Frame; 2], periods: &Periods, places: &[(f64, &SetSummary)], ink: Ink) {
    frames[0].clipped(sheet, |sheet| {
        for (place, set) in places {
            if let Some([low, _, high]) = quartiles(set) {
                let [left, top, width, height] = frames[0].box_of(periods.grid.cell_of(*place), (low, high));
                sheet.rectangle((left, top), (width, height), ink, BAND);
            }
        }
    });
    let medians = places.iter().filter_map(|(place, set)| Some((*place, quartiles(set)?[1])));
    frames[0].points(sheet, medians, dot(ink));
    let mut indices: Vec<(f64, f64)> =
        places.iter().filter_map(|(place, set)| Some((*place, set.locking_index?.value))).collect();
    indices.sort_by(|left, right| left.0.total_cmp(&right.0));
    frames[1].points(sheet, indices.iter().copied(), dot(ink));
    frames[1].curve(sheet, indices, Stroke::solid(ink, 1.2));
}

const fn dot(ink: Ink) -> Dot {
    Dot { ink, radius: 3.0, opacity: 1.0 }
}

/// Quartiles of τ/T.
fn quartiles(set: &SetSummary) -> Option<[f64; 3]> {
    let period = set.parameters.modulation_period?;
    Some(set.tau_quartiles?.map(|tau| tau / period))
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;

    #[test]
    fn many_periods_and_few_amplitudes_make_a_staircase() {
        let steps = |amplitude: f64, count: u32| -> Vec<SetSummary> {
            (1..=count).map(|step| set(amplitude, 0.01 * f64::from(step), (12.0 / f64::from(step)).ceil())).collect()
        };
        let mut sets = steps(1e-6, 24);
        let svg = staircase(&sets).unwrap().svg();
        assert!(svg.contains(">Modulation period T (s)<") && svg.contains(">Δ = 1 µm<"));
        sets.push(set(0.0, 0.11, 1.0));
        let svg = staircase(&sets).unwrap().svg();
        assert!(svg.contains(">Modulation period T / τ₀<") && svg.contains(">τ₀ / T, Δ = 0<"));
        assert!(staircase(&steps(1e-6, 23)).is_none());
        let amplitudes = (1..=4).flat_map(|amplitude| steps(1e-7 * f64::from(amplitude), 24));
        assert!(staircase(&amplitudes.collect::<Vec<_>>()).is_none());
    }
}
