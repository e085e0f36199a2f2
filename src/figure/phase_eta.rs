//! φ against η (Fig. 3e): the density of slips, the backbone of Eq. 2, and averages over sets that have a phase.

use super::axis::{Axis, angle_bounds, bounds};
use super::frame::{Cell, Ends, Layout, OVERLAP, Place};
use super::hues::ColourBar;
use super::legend::{Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::quantity::Grid;
use super::style::{BAR_WIDTH, BLUE, Dot, Look, RADIUS, RED, REFERENCE, Stroke, WHITE, dot, shade};
use crate::model::theory::{minimum_phase, minimum_phase_asymptote};
use crate::reduce::{BackboneBin, Point, SetRow};
use crate::sets::label;
use std::collections::BTreeMap;
use std::f64::consts::PI;

pub(super) const NAME: &str = "phi-eta";

const WIDTH: f64 = 580.0;
const HEIGHT: f64 = 390.0;
const AVERAGE: Dot = dot(BLUE);
/// Around it, so that it is seen on dark cells.
const EDGE: Dot = Dot::solid(WHITE, RADIUS + 1.3);
const ASYMPTOTE: Stroke = Stroke::solid(RED, 2.4);
const EXACT: Stroke = Stroke::dashed(RED, 1.6, (7.0, 4.0));
const CURVE_POINTS: usize = 400;
/// Most values of η that have a column each; more are put into columns, this many a decade.
const MAX_COLUMNS: usize = 60;
const COLUMNS_PER_DECADE: f64 = 10.0;
/// Largest ratio of a column's edge to its η. A wider column would show phases of one η far from the curves at that η.
const WIDEST: f64 = 1.5;
/// Rows of the density in half a turn.
const ROWS: f64 = 36.0;
/// Least density shown, in 1/rad: a quarter of that of phases spread over the whole turn.
const FAINTEST: f64 = 0.25 / (2.0 * PI);

/// Draws phase against η; `None` without any phase. Phases lie as measured, in the turn that ends shortly past Φ_max;
/// the axes hold them all.
pub(super) fn phase_eta(
    points: &[Point],
    bins: &[BackboneBin],
    sets: &[SetRow],
    look: &Look,
) -> Option<Picture> {
    let slips: Vec<Place> = points
        .iter()
        .filter_map(|point| Some((point.eta, point.phase?)).filter(|_| point.eta > 0.0))
        .collect();
    let (shades, cells) = density(&slips);
    let (low, high) = bounds(cells.iter().flat_map(|cell| [cell.0.0.0, cell.0.0.1]))?;
    let averages = averages(bins, sets);
    let of_bins = "mean of all sets with a phase in a bin of η, 95 %";
    let entries = [
        entry(Mark::Bar(AVERAGE), of_bins),
        entry(Mark::Line(ASYMPTOTE), "−2√(π/η)"),
        entry(Mark::Line(EXACT), "φₘᵢₙ of Eq. 2"),
        entry(Mark::Line(REFERENCE), "η = 1"),
    ];
    let x = Axis::logarithmic(&label("eta").axis(""), low, high).with_enough_numbers();
    let (low, high) = angle_bounds(slips.iter().map(|slip| slip.1));
    let curve = |phase: fn(f64) -> Option<f64>| {
        let etas = x.evenly_placed(CURVE_POINTS).into_iter();
        let modulated = etas.filter(|&eta| eta >= 1.0);
        modulated
            .filter_map(|eta| Some((eta, phase(eta)?)))
            .collect()
    };
    let coloured = cells
        .iter()
        .map(|&(cell, density)| (cell, shade(shades.place(density))));
    let mut layers = vec![Layer::Cells(coloured.collect(), OVERLAP)];
    let means = || averages.iter().map(|&(eta, mean, _)| (eta, mean)).collect();
    let bars = averages
        .iter()
        .filter_map(|&(eta, _, ends)| Some((eta, ends?)));
    layers.extend([
        Layer::Upright(1.0, REFERENCE),
        Layer::Curve(curve(|eta| Some(minimum_phase_asymptote(eta))), ASYMPTOTE),
        Layer::Curve(curve(minimum_phase), EXACT),
        Layer::Bars(bars.collect(), Stroke::solid(BLUE, BAR_WIDTH)),
        Layer::Dots(means(), EDGE),
        Layer::Dots(means(), AVERAGE),
    ]);
    let bar = Some(ColourBar::of_axis(&shades, shade));
    let panel = Panel {
        bar,
        ..Panel::inside(HEIGHT, x, Axis::angle("Phase φ (rad)", low, high), layers)
    };
    let layout = Layout::column(WIDTH);
    Some(panel::draw(NAME, look, layout, &entries, vec![panel]))
}

/// Mean η of the sets of each bin that have a phase, the mean of these phases in rad, and the ends of its interval.
fn averages(bins: &[BackboneBin], sets: &[SetRow]) -> Vec<(f64, f64, Option<Ends>)> {
    let average = |bin: &BackboneBin| {
        let within = |eta: &f64| (bin.eta_low..bin.eta_high).contains(eta);
        let phased = sets
            .iter()
            .filter(|set| set.has_phase)
            .map(|set| set.parameters.eta())
            .filter(within);
        let (count, sum) = phased.fold((0.0, 0.0), |(count, sum), eta| {
            (count + 1.0, sum + libm::log(eta))
        });
        let eta = if count > 0.0 {
            libm::exp(sum / count)
        } else {
            bin.eta_centre
        };
        Some((
            eta,
            bin.set_phase_mean?,
            bin.set_phase_mean_low.zip(bin.set_phase_mean_high),
        ))
    };
    bins.iter().filter_map(average).collect()
}

/// How slips at each η are spread over the phase: the scale of densities in 1/rad, and cells with theirs.
fn density(slips: &[Place]) -> (Axis, Vec<(Cell, f64)>) {
    let columns = columns(slips.iter().map(|slip| slip.0));
    let height = PI / ROWS;
    let mut counts: Vec<BTreeMap<i64, u32>> = vec![BTreeMap::new(); columns.len()];
    for &(eta, phase) in slips {
        let column = columns
            .partition_point(|column| column.1 <= eta)
            .min(columns.len() - 1);
        #[expect(clippy::cast_possible_truncation, reason = "a few rows")]
        let row = (phase / height).floor() as i64;
        *counts[column].entry(row).or_default() += 1;
    }
    let cells: Vec<(Cell, f64)> = columns
        .iter()
        .zip(&counts)
        .flat_map(|(&column, counts)| {
            let slips = f64::from(counts.values().sum::<u32>());
            counts.iter().map(move |(&row, &count)| {
                let ends = (row as f64 * height, (row + 1) as f64 * height);
                ((column, ends), f64::from(count) / (slips * height))
            })
        })
        .collect();
    let most = cells
        .iter()
        .map(|cell| cell.1)
        .fold(10.0 * FAINTEST, f64::max);
    (Axis::logarithmic("density (1/rad)", FAINTEST, most), cells)
}

/// Ends of the columns along η: one for each value if these are few, else evenly spaced.
fn columns(etas: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
    /// Values that differ by rounding alone are one.
    const SAME: f64 = 1.0 + 1e-9;
    let mut values: Vec<f64> = etas.filter(|eta| *eta > 0.0).collect();
    values.sort_by(f64::total_cmp);
    values.dedup_by(|next, value| *next <= *value * SAME);
    if values.len() <= MAX_COLUMNS {
        let cells = Grid::logarithmic_cells(values.clone())
            .into_iter()
            .zip(values);
        let clipped = |((low, high), eta): ((f64, f64), f64)| {
            let low = low.max(eta / WIDEST);
            let high = high.min(eta * WIDEST);
            // None reaches over η = 1, where the load begins to fall in each period.
            let least = if eta > SAME { 1.0 } else { 0.0 };
            let most = if eta * SAME < 1.0 { 1.0 } else { f64::INFINITY };
            (low.max(least), high.min(most))
        };
        return cells.map(clipped).collect();
    }
    #[expect(clippy::cast_possible_truncation, reason = "a few decades")]
    let column = |eta: f64| (libm::log10(eta) * COLUMNS_PER_DECADE).floor() as i32;
    let first = column(values[0]);
    let last = column(values[values.len() - 1]);
    let edge = |column: i32| libm::exp10(f64::from(column) / COLUMNS_PER_DECADE);
    (first..=last)
        .map(|column| (edge(column), edge(column + 1)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::quantity::tests::set;
    use super::*;

    #[test]
    fn columns_hold_every_slip_and_are_those_of_a_grid_where_there_is_one() {
        let grid = columns([1.0, 2.0, 4.0, 2.0, 4.0 * (1.0 + 1e-13)].into_iter());
        assert_eq!(grid.len(), 3);
        assert!(
            (grid[1].0 - 2.0_f64.sqrt()).abs() < 1e-12
                && (grid[1].1 - 8.0_f64.sqrt()).abs() < 1e-12
        );
        let etas: Vec<f64> = (0..1000).map(|step| 0.2 * 1.008_f64.powi(step)).collect();
        let sample = columns(etas.iter().copied());
        assert!(
            sample.len() < 50 && sample[0].0 <= etas[0] && sample[sample.len() - 1].1 > etas[999]
        );
        assert!(sample.windows(2).all(|pair| pair[0].1 == pair[1].0));
        let [low, high] = [[0.5, 1.09], [0.9, 2.0]].map(|etas| columns(etas.into_iter()));
        assert_eq!(
            (low[1].0, high[0].1),
            (1.0, 1.0),
            "no column reaches over η = 1"
        );
    }

    #[test]
    fn the_density_of_a_column_integrates_to_one() {
        let point = |step: u32| {
            (
                if step.is_multiple_of(3) { 2.0 } else { 8.0 },
                1e-3 * f64::from(step % 700) - 0.5,
            )
        };
        let (_, cells) = density(&(0..3000).map(point).collect::<Vec<_>>());
        for eta in [2.0, 8.0] {
            let column = cells.iter().filter(|((x, _), _)| (x.0..x.1).contains(&eta));
            let integral: f64 = column.map(|((_, y), density)| density * (y.1 - y.0)).sum();
            assert!((integral - 1.0).abs() < 1e-12, "{integral}");
        }
    }

    #[test]
    fn means_lie_at_the_eta_of_the_sets_that_they_are_of() {
        let sets = [set(1e-6, 0.02, 4.0), set(1e-6, 0.021, 4.0)];
        let etas = [0, 1].map(|index| sets[index].parameters.eta());
        let bin = BackboneBin {
            eta_low: 2.0,
            eta_high: 5.0,
            eta_centre: 3.5,
            set_phase_mean: Some(-1.0),
            ..BackboneBin::default()
        };
        let found = averages(&[bin], &sets);
        assert!((found[0].0 - (etas[0] * etas[1]).sqrt()).abs() < 1e-9);
        assert_eq!(averages(&[bin], &[])[0].0, 3.5);
    }
}
