//! Regimes: share of time within slips, mean friction and mean interval, along one parameter or over two.

use super::axis::Axis;
use super::colour_bar::{COLOUR_BAR, ColourBar};
use super::dependence::{Getter, label, lines, number};
use super::frame::{Cell, Frame, Layout, RIGHT, ROW_GAP};
use super::legend::{Mark, entry};
use super::picture::{Dot, Picture, Sheet, Stroke};
use super::regions::middles;
use super::sets::{Grid, distinct, modulation, swept};
use super::style::{BLACK, INKS, Look, RADIUS, REFERENCE, WHITE, curve, dot, shade};
use crate::model::Symbol;
use crate::observe::Regime;
use crate::reduce::{SetRow, Statistic};

const LINES: Layout = Layout::column(558.0, &[190.0; 3], ROW_GAP, RIGHT);
const MAP: Layout = Layout::column(490.0, &[220.0; 3], ROW_GAP, COLOUR_BAR);
/// Least values of the parameter along which lines are drawn, and of each parameter of a map.
const MIN_VALUES: usize = 4;
/// Ratio of the largest to the least value above which a scale is logarithmic.
const LOGARITHMIC: f64 = 20.0;
const BORDER: Stroke = Stroke::solid(BLACK, 1.6);

const SHARE: (&str, Getter) = ("Share of time within slips", |set| Statistic::of(set.slip_share, None));
const FRICTION: (&str, Getter) =
    ("Mean friction (N)", |set| Statistic::of(set.mean_friction, set.mean_friction_interval));
const INTERVAL: (&str, Getter) = ("Mean interval τ (s)", |set| Statistic::of(set.tau_mean, set.tau_interval));

/// Draws sets in which, besides the modulation, only V0 or the reattachment delay differs, or any one parameter if not
/// all sets are stick-slip; `None` for others.
pub(super) fn regimes(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let [symbol] = swept(&sets.iter())[..] else { return None };
    let is_plain = sets.iter().all(|set| set.regime == Some(Regime::StickSlip));
    let values = distinct(sets.iter(), |parameters| number(parameters, symbol));
    if values.len() < MIN_VALUES || (is_plain && !matches!(symbol, Symbol::V0 | Symbol::TauR)) {
        return None;
    }
    let lines = lines(sets.iter())?;
    let x = Grid::of(values).wider_axis(&label(symbol));
    let names = lines.iter().map(|line| modulation(&line[0].parameters));
    let mut entries: Vec<_> = names.zip(INKS).map(|(name, ink)| entry(Mark::Dot(dot(ink)), name)).collect();
    if sets.iter().any(|set| set.regime == Some(Regime::Sliding)) {
        entries.push(entry(Mark::Ring(BLACK, RADIUS), "sliding"));
    }
    let [mixed, sliding] = Regime::MIN_SHARES;
    entries.push(entry(Mark::Line(REFERENCE), format!("mixed above {mixed}, sliding above {sliding}")));
    let (page, mut sheet) = LINES.page("regimes", look, &entries);
    for (row, (y_label, statistic)) in [SHARE, FRICTION, INTERVAL].into_iter().enumerate() {
        let y = match row {
            0 => Axis::linear(y_label, -0.03, 1.03),
            _ => Axis::of_data(y_label, sets.iter().filter_map(statistic).flat_map(Statistic::ends), LOGARITHMIC, 0.0)?,
        };
        let frame = page.frame(row, 0, x.clone(), y);
        if row == 0 {
            for share in Regime::MIN_SHARES {
                frame.level(&mut sheet, share, REFERENCE);
            }
        }
        for (line, ink) in lines.iter().zip(INKS) {
            let point = |set: &&SetRow| Some((number(&set.parameters, symbol)?, statistic(set)?));
            frame.statistics(&mut sheet, &line.iter().filter_map(point).collect::<Vec<_>>(), curve(ink), RADIUS);
            let sliding = line.iter().filter(|set| set.regime == Some(Regime::Sliding)).filter_map(point);
            frame.points(&mut sheet, sliding.map(|(x, y)| (x, y.value)), Dot::solid(WHITE, RADIUS - 1.6));
        }
        frame.axes(&mut sheet);
    }
    Some(sheet.finish())
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
    let grids = [horizontal, vertical].map(|symbol| distinct(sets.iter(), |parameters| number(parameters, symbol)));
    let is_grid = grids.iter().all(|values| values.len() >= MIN_VALUES)
        && 2 * sets.len() >= grids[0].len() * grids[1].len()
        && lines(sets.iter()).is_some_and(|lines| lines.len() == 1);
    if !is_grid {
        return None;
    }
    let [columns, rows] = grids.map(Grid::of);
    let cell = |set: &SetRow| {
        let place = |symbol, grid: &Grid| Some(grid.index_of(number(&set.parameters, symbol)?));
        Some((place(horizontal, &columns)?, place(vertical, &rows)?))
    };
    let ends = |(column, row)| (columns.cell(column), rows.cell(row));
    let cells: Vec<(&SetRow, Cell)> = sets.iter().filter_map(|set| Some((set, ends(cell(set)?)))).collect();
    let (page, mut sheet) = MAP.page(
        "regime-map",
        look,
        &[entry(Mark::Line(BORDER), "borders of stick-slip, mixed, sliding; no slips where white")],
    );
    for (row, (bar_label, statistic)) in [SHARE, FRICTION, INTERVAL].into_iter().enumerate() {
        let values = sets.iter().filter_map(statistic).map(|statistic| statistic.value);
        let shades = if row == 0 {
            Axis::linear(bar_label, 0.0, 1.0)
        } else {
            Axis::of_data(bar_label, values, LOGARITHMIC, 0.0)?
        };
        let frame = page.frame(row, 0, columns.axis(&label(horizontal)), rows.axis(&label(vertical)));
        frame.clipped(&mut sheet, |sheet| {
            let colour = |set| Some(shade(shades.place(statistic(set)?.value)));
            frame.cells(sheet, cells.iter().filter_map(|&(set, cell)| Some((cell, colour(set)?))));
            borders(sheet, &frame, &cells);
        });
        if row == 0 {
            let regime = |set: &SetRow| Regime::ALL.iter().position(|regime| set.regime == Some(*regime));
            let numbers = sets.iter().filter_map(|set| Some((cell(set)?, regime(set)?))).collect();
            for (middle, index) in middles(&numbers) {
                let share = if Regime::ALL[index] == Regime::StickSlip { 0.0 } else { 1.0 };
                frame.name_cell(&mut sheet, ends(middle), Regime::ALL[index].word(), share);
            }
        }
        frame.axes(&mut sheet);
        ColourBar::of_axis(bar_label, &shades).draw(&mut sheet, &frame);
    }
    Some(sheet.finish())
}

/// Lines between neighbouring cells of different regimes.
fn borders(sheet: &mut Sheet, frame: &Frame, cells: &[(&SetRow, Cell)]) {
    for (index, &(set, (x, y))) in cells.iter().enumerate() {
        for &(_, (other_x, other_y)) in cells[index + 1..].iter().filter(|(other, _)| other.regime != set.regime) {
            let meets = |a: (f64, f64), b: (f64, f64)| {
                [(a.1, b.0), (b.1, a.0)].into_iter().find(|(end, start)| (end / start - 1.0).abs() < 1e-9)
            };
            if x == other_x
                && let Some((edge, _)) = meets(y, other_y)
            {
                frame.curve(sheet, [(x.0, edge), (x.1, edge)], BORDER);
            } else if y == other_y
                && let Some((edge, _)) = meets(x, other_x)
            {
                frame.curve(sheet, [(edge, y.0), (edge, y.1)], BORDER);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
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
