//! Edges with their intervals against the one other quantity in which rows differ, a colour for each statistic.

use super::chart::Chart;
use super::frame::Layout;
use super::legend::{LegendEntry, Mark, entry};
use super::panel::Layer;
use super::picture::Picture;
use super::quantity::{Quantity, distinct};
use super::style::{Look, Stroke};
use crate::model::Selection as _;
use crate::reduce::{EdgeRow, Ended, Values};
use crate::sets::FREQUENCY;
use crate::sets::{AllButSeed, column_of, label};

pub(super) const NAME: &str = "edges";
const HEIGHT: f64 = 300.0;

/// `None` if nothing else differs, or more than one quantity.
pub(super) fn edges(edges: &[EdgeRow], look: &Look) -> Option<Picture> {
    let refined = edges.first()?.axis.as_str();
    let is_refined =
        |key: &str| key == refined || (key == FREQUENCY && ["T", "eta"].contains(&refined));
    let keys = AllButSeed::SYMBOLS.iter().copied().map(column_of);
    let others = keys.filter(|key| !is_refined(key));
    let values = others.filter_map(|key| Values::of(edges, key).ok());
    let differing = values.filter(|values| values.distinct.len() > 1);
    let [x] = <[Values; 1]>::try_from(differing.collect::<Vec<_>>()).ok()?;
    let y = Values {
        label: label(refined),
        ..Values::of(edges, "edge").ok()?
    };
    let mut y = Quantity::of_values("y", y);
    y.holds_bars = true;
    let crossed: Vec<String> = edges.iter().map(EdgeRow::crossed).collect();
    let crossed = Values::of_words("statistic", &crossed);
    let directions = edges.iter().map(|edge| match edge.rises {
        Some(false) => "falls at the edge".to_owned(),
        _ => "rises at the edge".to_owned(),
    });
    let rises = Values::of_words("rises", &directions.collect::<Vec<_>>());
    let has = |direction| edges.iter().any(|edge| edge.rises == Some(direction));
    let is_both = has(true) && has(false);
    let mut series = vec![crossed];
    series.extend(Some(rises).filter(|_| is_both));
    let chart = Chart::of_series("edges", &series, Quantity::of_values("x", x), y);
    let mut parts = chart.parts().ok()?;
    let all: Vec<usize> = (0..edges.len()).collect();
    let searched = without_edge(edges, &chart);
    for panel in &mut parts.panels {
        panel.height = HEIGHT;
        panel.x = chart.x.axis(&all).ok()?;
    }
    let (explained, bars): (Vec<LegendEntry>, Vec<Layer<'_>>) = searched.into_iter().unzip();
    parts.legend.extend(explained);
    if let Some(Layer::Inside(layers)) = parts.panels[0].layers.first_mut() {
        layers.splice(..0, bars);
    }
    let noted = look.with_note("bars: 95 %");
    let layout = Layout::column(490.0);
    Some(parts.draw(NAME, &noted, layout))
}

/// What has no edge is seen over all that was searched, or where it is unclear.
fn without_edge(edges: &[EdgeRow], chart: &Chart<'_>) -> Vec<(LegendEntry, Layer<'static>)> {
    let factor = chart.ys[0].factor;
    let text = |edge: &EdgeRow| format!("{}: {}", edge.crossed(), edge.ended.word());
    let without = || {
        edges
            .iter()
            .enumerate()
            .filter(|(_, edge)| edge.edge.is_none())
    };
    let texts: Vec<String> = without().map(|(_, edge)| text(edge)).collect();
    let of_text = |shown: &str| {
        let own = || without().filter(|(_, edge)| text(edge) == shown);
        let (first, edge) = own().next()?;
        let colour = chart.colour.as_ref()?;
        let ink = colour.hues().ok()?.ink(colour.number(first)?);
        let dashes = match edge.ended {
            Ended::NoCrossing => (6.0, 4.0),
            _ => (2.0, 2.0),
        };
        let ends = |edge: &EdgeRow| (factor * edge.bracket_low, factor * edge.bracket_high);
        let bars = own().filter_map(|(place, edge)| Some((chart.x.number(place)?, ends(edge))));
        let stroke = Stroke::dashed(ink, 1.4, dashes);
        let bars = Layer::Bars(bars.collect(), stroke);
        Some((entry(Mark::Line(stroke), shown), bars))
    };
    let shown = distinct(texts.iter().map(String::as_str)).into_iter();
    shown.filter_map(of_text).collect()
}

#[cfg(test)]
mod tests {
    use super::super::style::{BLACK, INKS};
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;
    use crate::table::columns::Interval;

    fn edge(drive_velocity: f64, statistic: &str, edge: Option<f64>) -> EdgeRow {
        EdgeRow {
            parameters: Selected::new(Parameters {
                drive_velocity,
                ..Parameters::default()
            }),
            axis: "Delta".to_owned(),
            statistic: statistic.to_owned(),
            threshold: 0.5,
            bracket_low: 1e-6,
            bracket_high: 2e-6,
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
        let mut both = rows.clone();
        both[0].rises = Some(true);
        both[1].rises = Some(true);
        both[2].rises = Some(false);
        let of_both = edges(&both, &Look::default()).unwrap().svg();
        for direction in [">rises at the edge<", ">falls at the edge<"] {
            assert!(of_both.contains(direction), "{direction}");
        }
        let falling = both.map(|edge| EdgeRow {
            rises: edge.edge.map(|_| false),
            ..edge
        });
        let of_falling = edges(&falling, &Look::default()).unwrap().svg();
        assert!(
            !of_falling.contains("at the edge"),
            "all fall, or have no edge"
        );
        assert!(svg.contains("Drive velocity") && svg.contains("Amplitude Δ"));
        for without in [">R, drive = 0.5: no crossing<", ">R = 0.5: unclear end<"] {
            assert!(svg.contains(without), "{without}");
        }
        assert!(svg.contains(">R = 0.5<") && svg.contains(">R, drive = 0.5<"));
        let dashes = |svg: &str| svg.matches(r#"stroke-width="1.4"#).count();
        let nothing_searched = rows.clone().map(|edge| EdgeRow {
            bracket_high: edge.bracket_low,
            ..edge
        });
        let legend_alone = edges(&nothing_searched, &Look::default()).unwrap().svg();
        assert!(
            dashes(&svg) > dashes(&legend_alone),
            "what was searched is drawn"
        );
        assert!(!svg.contains("at the edge"), "all have one direction");
        assert!(
            [BLACK, INKS[0]]
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
