//! Refined grids: a map of cells of different size with the edge between two kinds of sets; and, along one axis, the edge
//! against another parameter, each with the band in which it lies.

use super::axis::{Axis, bounds, is_wide};
use super::frame::Layout;
use super::legend::{Mark, entry};
use super::panel::{self, Cell, Ends, Layer, Panel};
use super::picture::{Dot, Fill, Ink, Picture, Stroke};
use super::sets::axis_of;
use super::style::{BAR_WIDTH, INKS, LIGHT_GREY, Look, RADIUS, WHITE, dot};
use crate::model::Symbol;
use crate::reduce::FREQUENCY as FREQUENCY_COLUMN;
use crate::reduce::{CellRow, SetRow, ascending};
use kuva::render::color::Color;
use std::collections::{BTreeMap, HashMap};

/// Cells in which all sets fulfil the condition.
const YES: Ink = "#7fa8cf";
/// Cells in which none is.
const NO: Ink = "#f2f2f0";
/// Cells in which sets differ.
const EDGE: Ink = INKS[1];
const MARGINS: Ends = (0.8, 1.25);
const OUTLINE: Stroke = Stroke::solid(LIGHT_GREY, 0.5);

/// Draws the cells of a grid that was refined along two axes and has no third, or the edges along one; `None` for others.
pub(super) fn refined(cells: &[CellRow], sets: &[SetRow], look: &Look) -> Option<Picture> {
    if cells.iter().all(|cell| cell.y.is_some()) { map(cells, look) } else { edges(cells, sets, look) }
}

/// A parameter of a set, or the frequency.
fn value(key: &str, set: &SetRow) -> Option<f64> {
    match Symbol::from_key(key) {
        Some(symbol) => set.parameters.get(symbol).number(),
        None => set.parameters.modulation_period.map(|period| 1.0 / period),
    }
}

/// What the sets of a cell without an edge are, on either side of it; by the condition of the table.
fn words(by: &str) -> [String; 2] {
    match by.split_once(" = ") {
        Some(("periods", n)) => [format!("n = {n}"), "other n".to_owned()],
        Some((_, word)) => [word.to_owned(), format!("not {word}")],
        None => [by.to_owned(), "not so".to_owned()],
    }
}

fn map(cells: &[CellRow], look: &Look) -> Option<Picture> {
    let first = cells.first()?;
    let ((x_label, x_factor), (y_label, y_factor)) = (
        axis_of(&first.x, cells.iter().map(|cell| cell.x_high)),
        axis_of(first.y.as_deref()?, cells.iter().filter_map(|cell| cell.y_high)),
    );
    let mut boxes: BTreeMap<[u64; 2], u32> = BTreeMap::new();
    let mut placed: Vec<(Cell, &CellRow)> = Vec::new();
    for cell in cells {
        let [x, y] = [(cell.x_low, cell.x_high, x_factor), (cell.y_low?, cell.y_high?, y_factor)]
            .map(|(low, high, factor)| (factor * low, factor * high));
        *boxes.entry([x.0.to_bits(), y.0.to_bits()]).or_default() += 1;
        placed.push(((x, y), cell));
    }
    // Of several maps on top of each other, none would be seen.
    if boxes.values().any(|&count| count > 1) {
        return None;
    }
    let x_ends = bounds(placed.iter().flat_map(|((x, _), _)| [x.0, x.1]))?;
    let y_ends = bounds(placed.iter().flat_map(|((_, y), _)| [y.0, y.1]))?;
    let [yes, no] = words(&first.by);
    let patch = |ink| Mark::Patch(Fill { ink, opacity: 1.0 });
    let legend = [entry(patch(YES), yes), entry(patch(NO), no), entry(patch(EDGE), "the edge lies here")];
    let colour = |cell: &CellRow| match cell.share {
        _ if cell.differs => EDGE,
        Some(share) if share > 0.5 => YES,
        Some(_) => NO,
        None => WHITE,
    };
    let cells = placed.iter().map(|&(place, cell)| (place, Color::from(colour(cell)))).collect();
    // The finest cells are seen by their colour.
    let outlines = placed.iter().filter(|(_, cell)| !cell.differs);
    let outlines = outlines.map(|((x, y), _)| Layer::Curve(vec![(x.0, y.1), (x.0, y.0), (x.1, y.0)], OUTLINE));
    let layers = std::iter::once(Layer::Cells(cells, 0.0)).chain(outlines);
    let panel = Panel::inside(400.0, Axis::spanning(&x_label, x_ends), Axis::spanning(&y_label, y_ends), layers);
    Some(panel::draw("refined-map", look, Layout::column(560.0), &legend, vec![panel]))
}

/// The edges along one axis against the one other quantity in which sets differ.
fn edges(cells: &[CellRow], sets: &[SetRow], look: &Look) -> Option<Picture> {
    let by_id: HashMap<&str, &SetRow> = sets.iter().map(|set| (set.set_id.as_str(), set)).collect();
    let at_edges = cells.iter().filter(|cell| cell.differs);
    let bands: Vec<(&CellRow, &SetRow)> =
        at_edges.filter_map(|cell| Some((cell, *by_id.get(cell.set_id.as_deref()?)?))).collect();
    let refined = &cells.first()?.x;
    let is_refined =
        |key: &str| key == refined || (key == FREQUENCY_COLUMN && ["T", "eta"].contains(&refined.as_str()));
    let differs = |key: &str| ascending(bands.iter().filter_map(|(_, set)| value(key, set))).len() > 1;
    let parameters = Symbol::ALL.into_iter().filter(|symbol| !matches!(symbol, Symbol::T | Symbol::Seed));
    let keys = parameters.map(Symbol::key).chain([FREQUENCY_COLUMN]);
    let [key] = keys.filter(|key| !is_refined(key) && differs(key)).collect::<Vec<_>>()[..] else { return None };
    let ((x_label, x_factor), (y_label, y_factor)) = (
        axis_of(key, bands.iter().filter_map(|(_, set)| value(key, set))),
        axis_of(refined, bands.iter().map(|(cell, _)| cell.x_high)),
    );
    let points: Vec<(f64, f64, f64)> = bands
        .iter()
        .filter_map(|(cell, set)| Some((x_factor * value(key, set)?, y_factor * cell.x_low, y_factor * cell.x_high)))
        .collect();
    let (x_ends, y_ends) =
        (bounds(points.iter().map(|point| point.0))?, bounds(points.iter().flat_map(|point| [point.1, point.2]))?);
    let [yes, _] = words(&cells[0].by);
    let legend = [entry(Mark::Bar(dot(INKS[0])), format!("edge of {yes}, and the band in which it lies"))];
    let scale = |label: &str, ends: Ends, narrow: fn(&str, Ends) -> Axis| {
        let wide = || Axis::logarithmic(label, MARGINS.0 * ends.0, MARGINS.1 * ends.1);
        if is_wide(ends) { wide() } else { narrow(label, ends) }
    };
    let x = scale(&x_label, x_ends, |label, (low, high)| {
        let margin = 0.05 * (high - low);
        Axis::linear(label, low - margin, high + margin)
    });
    let y = scale(&y_label, y_ends, |label, (low, high)| Axis::rounded(label, low, high));
    let middles = points.iter().map(|&(x, low, high)| (x, y.middle(low, high))).collect();
    let bands = points.iter().map(|&(x, low, high)| (x, (low, high))).collect();
    let layers = vec![
        Layer::Bars(bands, Stroke::solid(INKS[0], BAR_WIDTH)),
        Layer::Dots(middles, Dot::solid(INKS[0], 0.7 * RADIUS)),
    ];
    Some(panel::draw("refined-edge", look, Layout::column(490.0), &legend, vec![Panel::new(300.0, x, y, layers)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;
    use crate::model::selected::Selected;

    fn cell(x: (f64, f64), y: Option<(f64, f64)>, differs: bool) -> CellRow {
        CellRow {
            set_id: Some(format!("{}", x.0)),
            x: "Delta".to_owned(),
            x_low: x.0,
            x_high: x.1,
            y: y.map(|_| "V0".to_owned()),
            y_low: y.map(|y| y.0),
            y_high: y.map(|y| y.1),
            differs,
            share: Some(f64::from(u8::from(x.0 > 1e-6))),
            by: "resultant_length > 0.5".to_owned(),
            ..CellRow::default()
        }
    }

    #[test]
    fn cells_are_drawn_as_large_as_they_are_and_maps_on_top_of_each_other_are_not() {
        let cells = [
            cell((1e-6, 2e-6), Some((1e-5, 2e-5)), true),
            cell((2e-6, 3e-6), Some((1e-5, 2e-5)), false),
            cell((1e-6, 3e-6), Some((2e-5, 4e-5)), false),
        ];
        let svg = refined(&cells, &[], &Look::default()).unwrap().svg();
        assert_eq!(svg.matches(EDGE).count(), 2, "one cell and the legend");
        let twice: Vec<CellRow> = cells.iter().chain(&cells).cloned().collect();
        assert!(refined(&twice, &[], &Look::default()).is_none());
    }

    #[test]
    fn edges_along_one_axis_are_drawn_against_the_other_quantity() {
        let set = |name: f64, drive_velocity| SetRow {
            set_id: format!("{name}"),
            parameters: Selected::new(Parameters { drive_velocity, ..Parameters::default() }),
            ..SetRow::default()
        };
        let cells =
            [cell((1e-6, 1.1e-6), None, true), cell((2e-6, 2.1e-6), None, true), cell((3e-6, 4e-6), None, false)];
        let sets = [set(1e-6, 1e-5), set(2e-6, 2e-5), set(3e-6, 2e-5)];
        let svg = refined(&cells, &sets, &Look::default()).unwrap().svg();
        assert!(svg.contains("Drive velocity") && svg.contains("Amplitude Δ"));
        assert!(refined(&cells, &sets[..1], &Look::default()).is_none(), "nothing to draw it against");
        assert!(refined(&[], &sets, &Look::default()).is_none());
    }
}
