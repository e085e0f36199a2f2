//! Edges with their intervals against the one other quantity in which rows differ, a colour for each statistic.

use super::axis::Axis;
use super::frame::Layout;
use super::legend::{Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::quantity::{axis_of, distinct};
use super::style::{BAR_WIDTH, Dot, INKS, Look, RADIUS, Stroke};
use crate::model::{Selection as _, Symbol};
use crate::reduce::{EdgeRow, Ended, FREQUENCY, Interval, ascending};
use crate::sets::{AllButSeed, column_of};

pub(super) const NAME: &str = "edges";

/// A parameter of a row, or the frequency.
fn value(key: &str, edge: &EdgeRow) -> Option<f64> {
    match Symbol::from_key(key) {
        Some(symbol) => edge.parameters.get(symbol).number(),
        None => edge.parameters.modulation_period.map(|period| 1.0 / period),
    }
}

/// `None` if nothing else differs, or more than one quantity.
pub(super) fn edges(edges: &[EdgeRow], look: &Look) -> Option<Picture> {
    let refined = edges.first()?.axis.as_str();
    let is_refined =
        |key: &str| key == refined || (key == FREQUENCY && ["T", "eta"].contains(&refined));
    let differs = |key: &str| ascending(edges.iter().filter_map(|edge| value(key, edge))).len() > 1;
    let keys = AllButSeed::SYMBOLS.iter().copied().map(column_of);
    let [key] = keys
        .filter(|key| !is_refined(key) && differs(key))
        .collect::<Vec<_>>()[..]
    else {
        return None;
    };
    let (x_label, x_factor) = axis_of(key, edges.iter().filter_map(|edge| value(key, edge)));
    let (y_label, y_factor) = axis_of(refined, edges.iter().filter_map(|edge| edge.edge));
    let place = |edge: &EdgeRow| Some((x_factor * value(key, edge)?, y_factor * edge.edge?));
    let bar = |edge: &EdgeRow| {
        let Interval { low, high } = edge.edge_interval?;
        Some((place(edge)?.0, (y_factor * low, y_factor * high)))
    };
    let places = || edges.iter().filter_map(place);
    let ends = edges
        .iter()
        .filter_map(bar)
        .flat_map(|(_, ends)| [ends.0, ends.1]);
    // What has no edge is seen over all that was searched, or where it is unclear.
    let searched = |edge: &EdgeRow| {
        let ends = (y_factor * edge.bracket_low, y_factor * edge.bracket_high);
        Some((x_factor * value(key, edge)?, ends))
    };
    let rows = edges.iter().filter_map(|edge| value(key, edge));
    let x = Axis::of_data(&x_label, rows.map(|value| x_factor * value))?;
    let y = Axis::of_data(&y_label, places().map(|place| place.1).chain(ends))?;
    let statistics = distinct(edges.iter().map(|edge| &*edge.statistic));
    let mut legend = Vec::new();
    let mut layers = Vec::new();
    let mut without_edge = Vec::new();
    for (statistic, ink) in statistics.into_iter().zip(INKS) {
        let of_it = || edges.iter().filter(|edge| edge.statistic == statistic);
        let crossed = of_it().next()?.crossed();
        let without = || of_it().filter(|edge| edge.edge.is_none());
        for ended in distinct(without().map(|edge| edge.ended.word())) {
            let is_clear = ended == Ended::NoCrossing.word();
            let stroke = Stroke::dashed(ink, 1.4, if is_clear { (6.0, 4.0) } else { (2.0, 2.0) });
            legend.push(entry(Mark::Line(stroke), format!("{crossed}: {ended}")));
            let ended_so = without().filter(|edge| edge.ended.word() == ended);
            let bars = Layer::Bars(ended_so.filter_map(searched).collect(), stroke);
            without_edge.push(bars);
        }
        let text = format!("{crossed}, 95 %");
        legend.push(entry(Mark::Bar(Dot::solid(ink, RADIUS)), text));
        let stroke = Stroke::solid(ink, BAR_WIDTH);
        layers.push(Layer::Bars(of_it().filter_map(bar).collect(), stroke));
        let dot = Dot::solid(ink, 0.7 * RADIUS);
        layers.push(Layer::Dots(of_it().filter_map(place).collect(), dot));
    }
    if !without_edge.is_empty() {
        layers.insert(0, Layer::Inside(without_edge));
    }
    let layout = Layout::column(490.0);
    let panels = vec![Panel::new(300.0, x, y, layers)];
    Some(panel::draw(NAME, look, layout, &legend, panels))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;

    fn edge(drive_velocity: f64, statistic: &str, edge: Option<f64>) -> EdgeRow {
        EdgeRow {
            parameters: Selected::new(Parameters {
                drive_velocity,
                ..Parameters::default()
            }),
            axis: "Delta".to_owned(),
            statistic: statistic.to_owned(),
            threshold: 0.5,
            edge,
            edge_interval: edge.map(|edge| Interval {
                low: 0.9 * edge,
                high: 1.1 * edge,
            }),
            ..EdgeRow::default()
        }
    }

    #[test]
    fn edges_are_drawn_against_the_other_quantity_in_a_colour_for_each_statistic() {
        let [seen, drive] = ["resultant_length", "resultant_drive"];
        let rows = [
            edge(1e-5, seen, Some(1e-6)),
            edge(1e-5, drive, Some(2e-6)),
            edge(2e-5, seen, Some(2e-6)),
            edge(2e-5, drive, None),
            EdgeRow {
                ended: Ended::UnclearEnd,
                ..edge(2e-5, seen, None)
            },
        ];
        let svg = edges(&rows, &Look::default()).unwrap().svg();
        assert!(svg.contains("Drive velocity") && svg.contains("Amplitude Δ"));
        for without in [">R, drive = 0.5: no crossing<", ">R = 0.5: unclear end<"] {
            assert!(svg.contains(without), "{without}");
        }
        assert!(svg.contains(">R = 0.5, 95 %<") && svg.contains(">R, drive = 0.5, 95 %<"));
        assert!(
            [INKS[0], INKS[1]]
                .iter()
                .all(|ink| svg.matches(&ink.to_string()).count() > 2)
        );
        assert!(
            edges(&rows[..2], &Look::default()).is_none(),
            "nothing to draw it against"
        );
        assert!(edges(&rows[3..4], &Look::default()).is_none(), "no edge");
        assert!(edges(&[], &Look::default()).is_none());
    }
}
