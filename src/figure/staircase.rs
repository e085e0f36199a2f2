//! The staircase: the interval in periods over the period of the modulation, on whole numbers where slips keep to it,
//! and the locking index under it, with its part by the drive alone.

use super::axis::Axis;
use super::frame::Layout;
use super::legend::{Entry, Mark, entry};
use super::panel::{self, Layer, Panel, Place};
use super::picture::{Dot, Fill, Ink, Picture, Stroke};
use super::sets::{Grid, Modulations, Periods};
use super::style::{BLACK, GREY, GRID, INKS, Look, REFERENCE, drive_alone};
use crate::reduce::{SetRow, ascending};
use crate::sweep::label;

/// Least values of the period that make a staircase.
const MIN_PERIODS: usize = 24;
/// Amplitudes that are easily distinguished.
const MAX_AMPLITUDES: usize = 3;
/// From this ratio on, τ/T is drawn on a logarithmic axis.
const WIDE: f64 = 6.0;
/// Whole numbers whose lines do not merge.
const MAX_LINES: f64 = 10.0;
/// Opacity of the boxes from quartile to quartile.
const BOX: f64 = 0.3;

/// Draws the staircase of sets that differ in the modulation alone, with 24 periods or more and at most
/// 3 amplitudes; `None` for others. Periods are in units of τ₀ if there is a set without modulation.
pub(super) fn staircase(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let sets = Modulations::of(sets.iter())?;
    if sets.periods.len() < MIN_PERIODS || sets.amplitudes.len() > MAX_AMPLITUDES {
        return None;
    }
    let free = sets.free.and_then(|set| set.tau_mean);
    let periods = Periods::of(&sets.periods, free);
    let grid = Grid::of(ascending(sets.periods.iter().map(|&period| periods.place(period))));
    let x = grid.axis(&periods.label);
    let ratios = sets.modulated.iter().filter_map(|set| quartiles(set)).flatten();
    let y = Axis::of_data("Slip interval τ / T, median", ratios, WIDE, f64::INFINITY)?;
    let mut entries: Vec<Entry> = sets
        .amplitudes
        .iter()
        .zip(INKS)
        .map(|(&height, ink)| entry(Mark::Dot(dot(ink)), label("Delta").setting(height)))
        .collect();
    entries.push(entry(Mark::Patch(Fill { ink: GREY, opacity: BOX }), "25 to 75 % of slips"));
    entries.push(entry(Mark::Line(GRID), "τ = nT"));
    entries.extend(free.map(|_| entry(Mark::Line(REFERENCE), "τ₀ / T, Δ = 0")));
    let has_drive = sets.modulated.iter().any(|set| set.locking_index_drive.is_some());
    entries.extend(has_drive.then(|| entry(Mark::Line(drive_alone(BLACK)), "by the drive alone")));
    let whole = (1..).map(f64::from).skip_while(|&n| n < y.low).take_while(|&n| n <= y.high.min(MAX_LINES));
    let mut background: Vec<Layer<'_>> = whole.map(|n| Layer::Level(n, GRID)).collect();
    background.extend(free.map(|free| {
        Layer::Curve(x.evenly_placed(200).map(|place| (place, free / periods.period(place))).collect(), REFERENCE)
    }));
    let (mut ratios, mut indices) = (vec![Layer::Inside(background)], Vec::new());
    for (&height, ink) in sets.amplitudes.iter().zip(INKS) {
        let of_height = sets.modulated.iter().filter(|set| set.parameters.modulation_amplitude == height);
        let mut places: Vec<(f64, &SetRow)> =
            of_height.filter_map(|set| Some((periods.place(set.parameters.modulation_period?), *set))).collect();
        places.sort_by(|left, right| left.0.total_cmp(&right.0));
        let quartiles = || places.iter().filter_map(|(place, set)| Some((*place, quartiles(set)?)));
        let boxes = quartiles().map(|(place, [low, _, high])| (grid.cell_of(place), (low, high)));
        ratios.push(Layer::Inside(vec![Layer::Boxes(boxes.collect(), Fill { ink, opacity: BOX })]));
        ratios.push(Layer::Dots(quartiles().map(|(place, [_, median, _])| (place, median)).collect(), dot(ink)));
        let values = |value: fn(&SetRow) -> Option<f64>| -> Vec<Place> {
            places.iter().filter_map(|(place, set)| Some((*place, value(set)?))).collect()
        };
        indices.push(Layer::Dots(values(|set| set.locking_index), dot(ink)));
        indices.push(Layer::Curve(values(|set| set.locking_index), Stroke::solid(ink, 1.2)));
        indices.push(Layer::Curve(values(|set| set.locking_index_drive), drive_alone(ink)));
    }
    let lower = Panel::new(200.0, x.clone(), Axis::sparse("Locking index of τ", 0.0, 1.0), indices);
    Some(panel::draw("staircase", look, Layout::column(558.0), &entries, vec![Panel::new(310.0, x, y, ratios), lower]))
}

const fn dot(ink: Ink) -> Dot {
    Dot::solid(ink, 3.0)
}

fn quartiles(set: &SetRow) -> Option<[f64; 3]> {
    let period = set.parameters.modulation_period?;
    Some([set.tau_25?, set.tau_50?, set.tau_75?].map(|tau| tau / period))
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;

    #[test]
    fn many_periods_and_few_amplitudes_make_a_staircase() {
        let steps = |amplitude: f64, count: u32| -> Vec<SetRow> {
            (1..=count).map(|step| set(amplitude, 0.01 * f64::from(step), (12.0 / f64::from(step)).ceil())).collect()
        };
        let mut sets = steps(1e-6, 24);
        let svg = staircase(&sets, &Look::default()).unwrap().svg();
        assert!(svg.contains(">Period of the modulation T (ms)<") && svg.contains(">Δ = 1 µm<"));
        assert!(!svg.contains("by the drive alone"));
        for set in &mut sets {
            set.locking_index_drive = Some(0.4);
        }
        let with = staircase(&sets, &Look::default()).unwrap().svg();
        assert!(with.contains(">by the drive alone<"));
        // A mark of few dashes, and a curve of many.
        assert!(with.matches("<path").count() - svg.matches("<path").count() > 40);
        sets.push(set(0.0, 0.11, 1.0));
        let svg = staircase(&sets, &Look::default()).unwrap().svg();
        assert!(svg.contains(">Period of the modulation T / τ₀<") && svg.contains(">τ₀ / T, Δ = 0<"));
        assert!(staircase(&steps(1e-6, 23), &Look::default()).is_none());
        let amplitudes = (1..=4).flat_map(|amplitude| steps(1e-7 * f64::from(amplitude), 24));
        assert!(staircase(&amplitudes.collect::<Vec<_>>(), &Look::default()).is_none());
    }
}
