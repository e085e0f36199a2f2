//! φ against η (Fig. 3e): the density of slips, the backbone of Eq. 2, and the mean of each column.

use super::axis::{Axis, angle_bounds, bounds};
use super::beside::{Beside, Other};
use super::frame::{Cell, Ends, Layout, OVERLAP};
use super::hues::ColourBar;
use super::legend::{LegendEntry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::style::{
    BAR_WIDTH, BLACK, BLUE, Dot, Fill, Look, Place, RADIUS, RED, REFERENCE, Stroke, WHITE,
    cell_shade,
};
use crate::model::theory::{minimum_phase, minimum_phase_asymptote};
use crate::reduce::{BackboneBin, Point};
use crate::sets::label;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

pub(super) const NAME: &str = "phi-eta";

const WIDTH: f64 = 580.0;
const HEIGHT: f64 = 390.0;
const AVERAGE: Dot = Dot::solid(BLUE, RADIUS);
/// Around it, so that it is seen on dark cells.
const EDGE: Dot = Dot::solid(WHITE, RADIUS + 1.3);
const ASYMPTOTE: Stroke = Stroke::solid(RED, 2.4);
const EXACT: Stroke = Stroke::dashed(RED, 1.6, (7.0, 4.0));
const CURVE_POINTS: usize = 400;
/// Bins of the averages in a decade.
const BINS: f64 = 4.0;
/// Columns of the density in a decade.
const COLUMNS: f64 = 20.0;
/// Largest ratio of a column's edge to the η of its slips: half a column. A wider one would show phases where none were
/// measured.
const WIDEST: f64 = 1.06;
const COLUMNS_IN_WORDS: &str = "columns hold slips within a twentieth of a decade of η";
/// Least ratio of the ends of the axis of η, so that it has numbers also where there is one η.
const NARROWEST: f64 = 2.0;
/// Rows of the density in half a turn.
const ROWS: f64 = 36.0;

/// Slips at neighbouring η.
struct DensityColumn {
    /// Least and largest η of its slips.
    values: Ends,
    /// Halfway to the neighbours' slips.
    edges: Ends,
    slips: Vec<Place>,
}

/// The mean phase of slips about an η, in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AveragePhase {
    eta: f64,
    mean: f64,
    interval: Ends,
}

impl AveragePhase {
    fn place(&self) -> Place {
        (self.eta, self.mean)
    }

    fn bar(&self) -> (f64, Ends) {
        (self.eta, self.interval)
    }
}

/// Draws phase against η; `None` without any phase. Phases lie as measured, in the turn that ends shortly past Φ_max;
/// the axes hold them all.
pub(super) fn phase_eta(
    points: &[Point],
    bins: &[BackboneBin],
    beside: &Beside,
    look: &Look,
) -> Option<Picture> {
    let slips = phases(points);
    let means_of = |other: &Other| averages(&other.bins, &columns(&phases(&other.points), BINS));
    let of_others: Vec<_> = beside.others.iter().map(means_of).collect();
    let averages = averages(bins, &columns(&slips, BINS));
    let columns = columns(&slips, COLUMNS);
    let cells: Vec<(Cell, f64)> = columns.iter().flat_map(cells).collect();
    let (least, most) = bounds(cells.iter().map(|cell| cell.1))?;
    let shades = Axis::logarithmic("density (1/rad)", least, most.max(10.0 * least));
    let etas = of_others.iter().flatten().map(|average| average.eta);
    let ends = [columns.first()?.edges.0, columns.last()?.edges.1];
    let (low, high) = bounds(etas.chain(ends))?;
    let x = axis_of_eta(low, high);
    let has_curves = x.high > 1.0;
    let entries = [
        (
            !averages.is_empty(),
            Mark::Bar(AVERAGE),
            "mean in ¼ decade of η, 95 %",
        ),
        (has_curves, Mark::Line(ASYMPTOTE), "−2√(π/η)"),
        (has_curves, Mark::Line(EXACT), "φₘᵢₙ of Eq. 2"),
        (x.contains(1.0), Mark::Line(REFERENCE), "η = 1"),
    ];
    let shown = entries.into_iter().filter(|(is_shown, ..)| *is_shown);
    let mut entries: Vec<LegendEntry> = shown.map(|(_, mark, text)| entry(mark, text)).collect();
    let angles = of_others.iter().flatten().map(|average| average.mean);
    let (low, high) = angle_bounds(slips.iter().map(|slip| slip.1).chain(angles));
    let curve = |phase: fn(f64) -> Option<f64>| {
        let etas = x.evenly_placed(CURVE_POINTS).into_iter();
        let modulated = etas.filter(|&eta| eta >= 1.0);
        modulated
            .filter_map(|eta| Some((eta, phase(eta)?)))
            .collect()
    };
    let coloured = cells
        .iter()
        .map(|&(cell, density)| (cell, cell_shade(shades.place(density))));
    let mut layers = vec![Layer::Cells(coloured.collect(), OVERLAP)];
    let means = || averages.iter().map(AveragePhase::place).collect();
    let bars = averages.iter().map(AveragePhase::bar);
    layers.extend([
        Layer::Upright(1.0, REFERENCE),
        Layer::Curve(curve(|eta| Some(minimum_phase_asymptote(eta))), ASYMPTOTE),
        Layer::Curve(curve(minimum_phase), EXACT),
        Layer::Bars(bars.collect(), Stroke::solid(BLUE, BAR_WIDTH)),
        Layer::Dots(means(), EDGE),
        Layer::Dots(means(), AVERAGE),
    ]);
    let own = Mark::Patch(Fill {
        ink: cell_shade(1.0),
        opacity: 1.0,
    });
    entries.extend(beside.entries(Some(own), |other| !of_others[other].is_empty()));
    for (number, averages) in of_others.iter().enumerate() {
        let bars = averages.iter().map(AveragePhase::bar).collect();
        let places = averages.iter().map(AveragePhase::place).collect();
        layers.push(Layer::Bars(bars, Stroke::solid(BLACK, BAR_WIDTH)));
        layers.push(Layer::Hollow(places, number, BLACK));
    }
    let bar = Some(ColourBar::of_axis(&shades, cell_shade));
    let panel = Panel {
        bar,
        ..Panel::inside(HEIGHT, x, Axis::angle("Phase φ (rad)", low, high), layers)
    };
    let layout = Layout::column(WIDTH);
    let look = look.with_note(COLUMNS_IN_WORDS);
    Some(panel::draw(NAME, &look, layout, &entries, vec![panel]))
}

/// From `low` to `high`, or wider.
fn axis_of_eta(low: f64, high: f64) -> Axis {
    let margin = (NARROWEST * low / high).sqrt().max(1.0);
    Axis::logarithmic(&label("eta").axis(""), low / margin, high * margin)
}

/// η and phase of slips under modulation.
fn phases(points: &[Point]) -> Vec<Place> {
    let place = |point: &Point| Some((point.eta, point.phase?)).filter(|_| point.eta > 0.0);
    points.iter().filter_map(place).collect()
}

/// The middle of the η of each column's slips, their mean phase in rad, and its interval, unless that is the whole turn.
fn averages(bins: &[BackboneBin], columns: &[DensityColumn]) -> Vec<AveragePhase> {
    let average = |bin: &BackboneBin| {
        let is_of_bin =
            |column: &&DensityColumn| (bin.eta_low..bin.eta_high).contains(&column.values.0);
        let (low, high) = columns.iter().find(is_of_bin)?.values;
        let ends = bin.phase_mean_low.zip(bin.phase_mean_high);
        let known = ends.filter(|(low, high)| high - low < 0.999 * TAU);
        Some(AveragePhase {
            eta: (low * high).sqrt(),
            mean: bin.phase_mean?,
            interval: known?,
        })
    };
    bins.iter().filter_map(average).collect()
}

/// Cells of a column, and their densities in 1/rad.
fn cells(column: &DensityColumn) -> Vec<(Cell, f64)> {
    let height = PI / ROWS;
    let mut counts: BTreeMap<i64, u32> = BTreeMap::new();
    for (_, phase) in &column.slips {
        #[expect(clippy::cast_possible_truncation, reason = "a few rows")]
        let row = (phase / height).floor() as i64;
        *counts.entry(row).or_default() += 1;
    }
    let of_one = 1.0 / (column.slips.len() as f64 * height);
    let edge = |row: i64| row as f64 * height;
    let cell = |(row, count)| {
        (
            (column.edges, (edge(row), edge(row + 1))),
            f64::from(count) * of_one,
        )
    };
    counts.into_iter().map(cell).collect()
}

/// Slips in columns along η.
fn columns(slips: &[Place], per_decade: f64) -> Vec<DensityColumn> {
    let mut bins: BTreeMap<i32, Vec<Place>> = BTreeMap::new();
    for &slip in slips {
        #[expect(clippy::cast_possible_truncation, reason = "a few decades")]
        let bin = (libm::log10(slip.0) * per_decade).floor() as i32;
        bins.entry(bin).or_default().push(slip);
    }
    // An η that no axis can show has no column.
    let bounded = |slips: Vec<Place>| Some((bounds(slips.iter().map(|slip| slip.0))?, slips));
    let filled = bins.into_values().filter_map(bounded);
    let (values, bins): (Vec<Ends>, Vec<_>) = filled.unzip();
    let column = |(index, slips): (usize, Vec<Place>)| {
        let (low, high) = values[index];
        let before = (index > 0).then(|| (low / values[index - 1].1).sqrt());
        let after = values.get(index + 1).map(|next| (next.0 / high).sqrt());
        let nearest = before.into_iter().chain(after).fold(WIDEST, f64::min);
        // None reaches over η = 1, where the load begins to fall in each period.
        let side: fn(f64, f64) -> f64 = if low < 1.0 { f64::min } else { f64::max };
        DensityColumn {
            values: (low, high),
            edges: (side(low / nearest, 1.0), side(high * nearest, 1.0)),
            slips,
        }
    };
    bins.into_iter().enumerate().map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_bins_of_eta_around_their_slips() {
        let at =
            |etas: &[f64]| columns(&etas.iter().map(|&eta| (eta, 0.0)).collect::<Vec<_>>(), 4.0);
        let grid = at(&[2.0, 4.0, 8.0, 4.0 * (1.0 + 1e-13)]);
        let middles: Vec<f64> = grid
            .iter()
            .map(|column| (column.edges.0 * column.edges.1).sqrt())
            .collect();
        assert_eq!(grid[1].slips.len(), 2);
        assert!(
            middles
                .iter()
                .zip([2.0, 4.0, 8.0])
                .all(|(middle, eta)| (middle - eta).abs() < 1e-9),
            "{middles:?}"
        );
        let pair = at(&[0.9, 0.95, 1.0, 1.2]);
        assert_eq!((pair.len(), pair[1].edges.0), (2, 1.0));
    }

    #[test]
    fn a_column_of_one_eta_is_narrow() {
        let at = |eta: f64| [(eta, -0.5), (eta, -0.4)];
        let slips: Vec<Place> = [2.0, 4.0, 8.0].into_iter().flat_map(at).collect();
        for (column, eta) in columns(&slips, COLUMNS).iter().zip([2.0, 4.0, 8.0]) {
            assert_eq!(column.values, (eta, eta));
            assert_eq!(column.edges, (eta / WIDEST, eta * WIDEST));
        }
    }

    #[test]
    fn the_axis_of_one_eta_has_numbers() {
        for eta in [0.037, 0.5, 1.0, 3.64, 9.1, 130.0, 1e4] {
            let axis = axis_of_eta(eta / WIDEST, eta * WIDEST);
            assert!(axis.ticks.len() >= 2, "{eta}: {:?}", axis.ticks);
        }
        let wide = axis_of_eta(0.2, 1000.0);
        assert_eq!((wide.low, wide.high), (0.2, 1000.0));
    }

    #[test]
    fn the_density_of_a_column_integrates_to_one_and_begins_at_its_least_phase() {
        for (eta, lowest) in [(0.5, -3.0), (1.0, -4.6), (2.0, -2.2), (30.0, -0.6)] {
            let slips = (0..3000).map(|step| (eta, lowest * 1e-3 * f64::from(step % 1001)));
            let columns = columns(&slips.collect::<Vec<_>>(), 4.0);
            let cells = cells(&columns[0]);
            let mass = cells.iter().map(|((_, y), density)| (y.1 - y.0) * density);
            assert!((mass.sum::<f64>() - 1.0).abs() < 1e-9, "{eta}");
            let (low, high) = cells[0].0.1;
            assert!(low <= lowest && lowest < high, "{eta}");
        }
    }

    #[test]
    fn the_mean_of_all_slips_of_a_column_lies_in_its_middle_unless_it_has_no_direction() {
        let columns = columns(&[(2.0, -1.0), (3.0, -1.1), (20.0, 0.0)], 4.0);
        let bin = |eta_low, half| BackboneBin {
            eta_low,
            eta_high: 2.0 * eta_low,
            phase_mean: Some(-1.0),
            phase_mean_low: Some(-1.0 - half),
            phase_mean_high: Some(-1.0 + half),
            ..BackboneBin::default()
        };
        let found = averages(&[bin(1.8, 0.1), bin(18.0, PI)], &columns);
        let expected = AveragePhase {
            eta: 6.0_f64.sqrt(),
            mean: -1.0,
            interval: (-1.1, -0.9),
        };
        assert_eq!(found, [expected]);
    }
}
