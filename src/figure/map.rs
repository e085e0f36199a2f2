//! Maps: sets on a grid of two quantities, each a cell whose colour shows a statistic. The locking map lies over period
//! and amplitude of the modulation, a regime map over two other parameters.

use super::axis::{Axis, bounds, is_wide};
use super::frame::{Cell, Ends, Layout, OVERLAP};
use super::hues::ColourBar;
use super::legend::{LegendEntry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::{Anchor, Picture};
use super::quantity::{CellGrid, Quantity};
use super::style::{
    BLACK, Dot, Fill, HALF_DIGIT, Ink, LEGEND_TEXT, Look, Place, Stroke, WHITE, cell_shade,
    diverging,
};
use crate::model::Symbol;
use crate::observe::Regime;
use crate::reduce::{Values, ascending, differing, has_even_steps};
use crate::sets::{FREQUENCY, SetRow, is_same};
use crate::table::columns::Class;
use std::f64::consts::TAU;

pub(super) const LOCKING: &str = "locking-map";
pub(super) const REGIMES: &str = "regime-map";
/// Numbers of periods that have a colour each; larger numbers share one.
const MAX_PERIODS: f64 = 12.0;
/// Least end of the scale of the excess, so that chance is pale.
const MIN_EXCESS: f64 = 0.2;
const LINE: Stroke = Stroke::solid(BLACK, 1.8);
/// Under the line, so that it is seen on dark cells.
const CASING: Stroke = Stroke::solid(WHITE, 4.4);
/// Marks of regimes: the ink of their middle, and their name; radii of a mark and of its middle.
const MARKS: [(Regime, Ink, &str); 2] = [
    (Regime::Mixed, BLACK, "mixed"),
    (Regime::Sliding, WHITE, "sliding"),
];
const MARK: f64 = 2.4;
const HOLE: f64 = 1.5;
/// Where a panel has no value, or one that is not significant.
const UNCLEAR: Fill = Fill {
    ink: Ink::new(0xd2_d2_d0),
    opacity: 1.0,
};

/// A column and a row of a map.
type Position = (usize, usize);

/// What a map lies over, and what it shows.
struct MapFigure<'a> {
    name: &'static str,
    sets: &'a [SetRow],
    /// Columns of the axes, and least number of values along either.
    axes: [&'static str; 2],
    min_values: usize,
    /// Those of its panels.
    columns: [&'static str; 3],
    width: f64,
    height: f64,
    legend: Vec<LegendEntry>,
}

/// Draws the map of sets in which amplitude and period of the modulation alone differ, and fill at least half of a grid of
/// 8 values or more; `None` for others. Sets without modulation do not count.
pub(super) fn locking(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let [Symbol::Delta, Symbol::T] = differing(&sets.iter())[..] else {
        return None;
    };
    let mut modulated = sets.iter();
    let first = modulated.find(|set| set.parameters.modulation_period.is_some())?;
    let velocity = first.parameters.drive_velocity;
    let figure = MapFigure {
        name: LOCKING,
        sets,
        axes: [period_column(sets), "Delta"],
        min_values: 8,
        columns: ["periods", "locking_index", "resultant_excess"],
        width: 560.0,
        height: 280.0,
        legend: vec![
            entry(
                Mark::Line(LINE),
                "η = 1; above, the load falls in each period",
            ),
            entry(
                Mark::Patch(UNCLEAR),
                "(a) no preferred phase; (c) 0 within the interval of the excess",
            ),
        ],
    };
    figure.draw(look, |map| {
        let amplitude = |place| map.y.factor * velocity * map.x.period(place) / TAU;
        let along_x = map.x_axis.evenly_placed(200).into_iter();
        let places: Vec<Place> = along_x.map(|place| (place, amplitude(place))).collect();
        let lines = [CASING, LINE].map(|stroke| Layer::Curve(places.clone(), stroke));
        lines.into()
    })
}

/// The same of two other parameters, of 4 values or more, with a mark of what does not stick. The drive velocity is the x
/// axis wherever it is one.
pub(super) fn regimes(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let axes = match differing(&sets.iter())[..] {
        [first, Symbol::V0] => [Symbol::V0, first],
        [first, second] if ![first, second].contains(&Symbol::T) => [first, second],
        _ => return None,
    };
    let mut legend = Vec::new();
    for ((regime, ink, name), share) in MARKS.into_iter().zip(Regime::MIN_SHARES) {
        if sets.iter().any(|set| set.regime == Some(regime)) {
            let mark = Mark::Ring(BLACK, ink, MARK, HOLE);
            legend.push(entry(mark, format!("{name}, share of {share} or more")));
        }
    }
    if sets.iter().any(|set| set.tau_mean.is_none()) {
        legend.push(entry(Mark::Patch(UNCLEAR), "(c) no intervals"));
    }
    let figure = MapFigure {
        name: REGIMES,
        sets,
        axes: axes.map(Symbol::key),
        min_values: 4,
        columns: ["slip_share", "mean_friction", "tau_mean"],
        width: 490.0,
        height: 220.0,
        legend,
    };
    figure.draw(look, |map| {
        let mut marks = Vec::new();
        for (regime, ink, _) in MARKS {
            let drawn = map.sets.iter().map(|set| set.0);
            let of_it = drawn.filter(|&set| sets[set].regime == Some(regime));
            let place = |set| map.x.number(set).zip(map.y.number(set));
            let places: Vec<Place> = of_it.filter_map(place).collect();
            marks.push(Layer::Dots(places.clone(), Dot::solid(BLACK, MARK)));
            marks.push(Layer::Dots(places, Dot::solid(ink, HOLE)));
        }
        marks
    })
}

impl MapFigure<'_> {
    fn quantity(&self, column: &str) -> Option<Quantity<'_>> {
        Quantity::of(self.sets, "map", column).ok()
    }

    /// Draws a panel for each of its columns that has values, under these lines.
    fn draw(
        &self,
        look: &Look,
        lines: impl Fn(&Map<'_>) -> Vec<Layer<'static>>,
    ) -> Option<Picture> {
        let [x, y] = self.axes.map(|column| self.quantity(column));
        let map = Map::of(x?, y?, self.min_values)?;
        let panel = |column: &&str| self.panel(&map, column, lines(&map));
        let panels = self.columns.iter().filter_map(panel).collect();
        let layout = Layout::column(self.width);
        Some(panel::draw(self.name, look, layout, &self.legend, panels))
    }

    /// The cells of a column, under lines, and their scale; `None` if it has no value.
    fn panel(
        &self,
        map: &Map<'_>,
        column: &str,
        lines: Vec<Layer<'static>>,
    ) -> Option<Panel<'static>> {
        let quantity = self.quantity(column)?;
        let class = quantity.column.column.class;
        let is_of_periods = class == Class::Category;
        let is_excess = class == Class::Excess;
        let holds_zero = |(low, high): Ends| low <= 0.0 && high >= 0.0;
        let is_unclear = |set: usize| {
            (is_of_periods && !self.sets[set].has_phase)
                || (is_excess && quantity.interval(set).is_some_and(holds_zero))
        };
        let number = |set: usize| quantity.number(set).filter(|_| !is_unclear(set));
        let most = if is_of_periods {
            MAX_PERIODS + 1.0
        } else {
            f64::INFINITY
        };
        let all = 0..self.sets.len();
        let ends = bounds(all.filter_map(number).map(|n| n.min(most)));
        let label = quantity.axis_label();
        let scale = scale_of(class, &label, ends)?;
        let colour = if is_excess { diverging } else { cell_shade };
        let mut bar = ColourBar::of_axis(&scale, colour);
        if is_of_periods {
            mark_periods(&mut bar, &scale, ends.unwrap_or_default());
        }
        let ink = |set| number(set).map_or(UNCLEAR.ink, |n| colour(scale.place(n)));
        let drawn = map.sets.iter();
        let cells = drawn.map(|&(set, position)| (map.cell(position), ink(set)));
        let heading = Some(std::mem::take(&mut bar.label));
        let cells = Layer::Cells(cells.collect(), OVERLAP);
        let numbers = is_of_periods.then(|| map.numbers(&number, &scale));
        let layers = std::iter::once(cells).chain(lines).chain(numbers);
        Some(Panel {
            heading,
            bar: Some(bar),
            ..Panel::inside(self.height, map.x_axis.clone(), map.y_axis.clone(), layers)
        })
    }
}

/// T, or 1/T if its steps are even and those of T are not.
fn period_column(sets: &[SetRow]) -> &'static str {
    let is_even =
        |column| Values::of(sets, column).is_ok_and(|swept| has_even_steps(&swept.distinct));
    if !is_even("T") && is_even(FREQUENCY) {
        FREQUENCY
    } else {
        "T"
    }
}

/// The scale of the colours of a column, whose values lie between these ends.
fn scale_of(class: Class, label: &str, ends: Option<(f64, f64)>) -> Option<Axis> {
    Some(match class {
        Class::Category => {
            let (first, last) = ends.unwrap_or_default();
            Axis::linear(
                "Median interval in periods, n",
                first,
                last.max(first + 1.0),
            )
        }
        Class::Excess => {
            let (low, high) = ends?;
            let most = MIN_EXCESS.max(-low).max(high);
            Axis::linear(label, -most, most)
        }
        Class::Share => Axis::linear(label, 0.0, 1.0),
        _ => {
            let ends = ends?;
            let from_zero = (ends.0.min(0.0), ends.1);
            Axis::spanning(label, if is_wide(ends) { ends } else { from_zero })
        }
    })
}

/// Gives a colour bar one block and one tick for each number of periods between these ends.
fn mark_periods(bar: &mut ColourBar, scale: &Axis, (first, last): (f64, f64)) {
    let all = || {
        (0..=u32::MAX)
            .map(|step| first + f64::from(step))
            .take_while(|&n| n <= last)
    };
    let text = |n: f64| {
        if n > MAX_PERIODS {
            format!(">{MAX_PERIODS}")
        } else {
            n.to_string()
        }
    };
    bar.colours = all().map(|n| cell_shade(scale.place(n))).collect();
    bar.ticks = all()
        .map(|n| ((n - first + 0.5) / (last - first + 1.0), text(n)))
        .collect();
}

/// The grid of a map.
struct Map<'a> {
    x: Quantity<'a>,
    y: Quantity<'a>,
    columns: CellGrid,
    rows: CellGrid,
    x_axis: Axis,
    y_axis: Axis,
    /// Those that lie on the grid, by their number.
    sets: Vec<(usize, Position)>,
}

impl<'a> Map<'a> {
    /// `None` for fewer values of either quantity than `min_values`, or if less than half of their grid is filled.
    fn of(x: Quantity<'a>, y: Quantity<'a>, min_values: usize) -> Option<Self> {
        let places = x.column.places().into_iter().zip(y.column.places());
        let position =
            |(set, (column, row)): (usize, (Option<_>, Option<_>))| Some((set, (column?, row?)));
        let sets: Vec<(usize, Position)> = places.enumerate().filter_map(position).collect();
        let counts = [&x, &y].map(|asked| asked.column.distinct.len());
        let is_grid = counts.iter().all(|count| *count >= min_values)
            && 2 * sets.len() >= counts[0] * counts[1];
        if !is_grid {
            return None;
        }
        let [columns, rows] = [&x, &y].map(|asked| CellGrid::of(asked.distinct().collect()));
        Some(Self {
            x_axis: columns.axis(&x.axis_label()),
            y_axis: rows.axis(&y.axis_label()),
            x,
            y,
            columns,
            rows,
            sets,
        })
    }

    fn cell(&self, (column, row): Position) -> Cell {
        (self.columns.cell(column), self.rows.cell(row))
    }

    /// Each number of periods in the midst of its cells, if these are enough.
    fn numbers(&self, number: &impl Fn(usize) -> Option<f64>, scale: &Axis) -> Layer<'static> {
        const FEWEST: usize = 12;
        let known = self
            .sets
            .iter()
            .filter_map(|&(set, position)| Some((number(set)?, position)));
        let known: Vec<(f64, Position)> = known.collect();
        let mut numbers = Vec::new();
        for n in ascending(known.iter().map(|one| one.0).filter(|n| *n <= MAX_PERIODS)) {
            let own = known
                .iter()
                .filter(|one| is_same(one.0, n))
                .map(|one| one.1);
            let own: Vec<Position> = own.collect();
            let count = own.len();
            let columns: usize = own.iter().map(|one| one.0).sum();
            let rows: usize = own.iter().map(|one| one.1).sum();
            // From the centroid, in whole numbers.
            let distance = |&(column, row): &Position| {
                let [across, along] =
                    [(column, columns), (row, rows)].map(|(own, sum)| (count * own).abs_diff(sum));
                across.pow(2) + along.pow(2)
            };
            let middle = own.iter().copied().min_by_key(distance);
            if let Some((column, row)) = middle.filter(|_| count >= FEWEST) {
                let place = (self.columns.value(column), self.rows.value(row));
                let ink = if scale.place(n) > 0.5 { WHITE } else { BLACK };
                numbers.push((place, n.to_string(), ink));
            }
        }
        Layer::Drawn(Box::new(move |sheet, frame| {
            for (place, text, ink) in numbers {
                let (x, y) = frame.place(place);
                let base = (x, y + HALF_DIGIT * f64::from(LEGEND_TEXT));
                sheet.coloured_text(base, &text, LEGEND_TEXT, Anchor::Middle, Some(ink));
            }
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::quantity::tests::set;
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;
    use crate::table::columns::Interval;

    fn grid(amplitudes: u32, periods: u32) -> Vec<SetRow> {
        let row = |row: u32| {
            (1..=periods).map(move |column| {
                set(
                    1e-7 * f64::from(row),
                    0.01 * f64::from(column),
                    f64::from(column),
                )
            })
        };
        (1..=amplitudes).flat_map(row).collect()
    }

    #[test]
    fn only_a_grid_of_modulations_becomes_a_map() {
        let mut sets = grid(8, 9);
        assert!(locking(&sets, &Look::default()).is_some());
        assert!(
            locking(&sets[..30], &Look::default()).is_none(),
            "four amplitudes"
        );
        assert!(locking(&grid(9, 7), &Look::default()).is_none());
        sets.push(set(0.0, 1.0, 1.0));
        assert!(
            locking(&sets, &Look::default()).is_some(),
            "a set without modulation lies on no grid"
        );
        sets[3].parameters.all = Parameters {
            drive_velocity: 1e-5,
            ..sets[3].parameters.all.clone()
        };
        assert!(locking(&sets, &Look::default()).is_none(), "two velocities");
    }

    #[test]
    fn a_diagonal_is_no_grid() {
        let sets: Vec<SetRow> = (1..=20)
            .map(|step| set(1e-7 * f64::from(step), 0.01 * f64::from(step), 3.0))
            .collect();
        assert!(locking(&sets, &Look::default()).is_none());
    }

    #[test]
    fn large_numbers_of_periods_share_a_colour() {
        let mut sets = grid(8, 8);
        let bar = |sets: &[SetRow]| {
            locking(sets, &Look::default())
                .unwrap()
                .svg()
                .contains(">&gt;12<")
        };
        assert!(!bar(&sets));
        sets[0].periods = Some(40);
        assert!(bar(&sets));
    }

    #[test]
    fn what_the_slider_adds_is_a_panel_where_there_are_controls_and_nothing_is_pale() {
        let mut sets = grid(8, 8);
        let drawn = |sets: &[SetRow]| locking(sets, &Look::default()).unwrap().svg();
        assert!(!drawn(&sets).contains("Excess of the resultant"));
        for (set, excess) in sets.iter_mut().zip([-0.5, 0.0, 0.5].into_iter().cycle()) {
            set.resultant_excess = Some(excess);
        }
        let svg = drawn(&sets);
        assert!(svg.contains("Excess of the resultant"));
        for share in [0.0, 0.5, 1.0] {
            assert!(
                svg.matches(&diverging(share).to_string()).count() > 20,
                "{share}"
            );
        }
    }

    #[test]
    fn an_excess_whose_interval_holds_zero_is_not_coloured() {
        let mut sets = grid(8, 8);
        for (set, low) in sets.iter_mut().zip([-0.3, 0.1].into_iter().cycle()) {
            set.resultant_excess = Some(0.5);
            set.resultant_excess_interval = Some(Interval { low, high: 0.9 });
        }
        let svg = locking(&sets, &Look::default()).unwrap().svg();
        let coloured = svg.matches(&diverging(1.0).to_string()).count();
        assert!((32..40).contains(&coloured), "{coloured}");
        assert!(svg.matches(&UNCLEAR.ink.to_string()).count() >= 32);
    }

    #[test]
    fn sets_without_a_phase_are_as_pale_as_the_ground() {
        let mut sets = grid(8, 8);
        let free = |sets: &[SetRow]| {
            locking(sets, &Look::default())
                .unwrap()
                .svg()
                .matches(&UNCLEAR.ink.to_string())
                .count()
        };
        let none = free(&sets);
        for set in &mut sets {
            set.has_phase = false;
        }
        assert_eq!(free(&sets) - none, 64);
    }

    fn at(velocity: f64, delay: f64, share: f64) -> SetRow {
        let plain = set(0.0, 1.0, 1e-5 / velocity);
        let parameters = Parameters {
            drive_velocity: velocity,
            reattachment_time: delay,
            ..plain.parameters.all.clone()
        };
        let regime = Some(Regime::at(share));
        let is_sliding = regime == Some(Regime::Sliding);
        let tau_mean = plain.tau_mean.filter(|_| !is_sliding);
        SetRow {
            parameters: Selected::new(parameters),
            slip_share: Some(share),
            regime,
            tau_mean,
            ..plain
        }
    }

    #[test]
    fn two_parameters_make_a_map_with_a_mark_of_each_set_that_slides() {
        let grid = |shares: fn(u32, u32) -> f64| -> Vec<SetRow> {
            (0..4)
                .flat_map(|row| {
                    (0..5).map(move |column| {
                        at(
                            1e-5 * f64::from(1 << column),
                            1e-3 * f64::from(1 << row),
                            shares(row, column),
                        )
                    })
                })
                .collect()
        };
        let drawn = |sets: &[SetRow]| {
            regimes(sets, &Look::default())
                .unwrap()
                .svg()
                .matches("<circle")
                .count()
        };
        let svg = regimes(
            &grid(|row, _| if row < 2 { 0.05 } else { 1.0 }),
            &Look::default(),
        );
        let svg = svg.unwrap().svg();
        for text in [
            "Share of time within slips",
            "Mean interval ⟨τ⟩ (s)",
            "sliding, share of 0.95 or more",
        ] {
            assert!(svg.contains(&format!(">{text}<")), "{text}");
        }
        assert!(!svg.contains("mixed, "), "no set is mixed");
        assert_eq!(drawn(&grid(|_, _| 0.05)), 0);
        // Two discs each, of eight sets in three panels and of the legend.
        let sliding = grid(|_, column| if column < 3 { 0.05 } else { 1.0 });
        assert_eq!(drawn(&sliding), 2 * (3 * 8 + 1));
        assert!(
            regimes(&grid(|_, _| 0.05)[..9], &Look::default()).is_none(),
            "two rows"
        );
    }

    #[test]
    fn what_was_swept_in_even_steps_becomes_the_axis() {
        let sets = |periods: [f64; 4]| periods.map(|period| set(1e-6, period, 4.0));
        assert_eq!(
            period_column(&sets([0.1, 0.05, 1.0 / 30.0, 0.025])),
            FREQUENCY
        );
        assert_eq!(period_column(&sets([0.1, 0.2, 0.4, 0.8])), "T");
    }
}
