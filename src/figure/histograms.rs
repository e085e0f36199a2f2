//! Histograms of τ (Fig. 2d-f): one panel per set, one under the other on a common axis.

use super::axis::{Axis, bounds, widened};
use super::frame::{Frame, Layout, OVERLAP};
use super::legend::{LegendEntry, Mark, entry};
use super::panel::{self, Layer};
use super::picture::{Anchor, Picture};
use super::style::{
    BLACK, Fill, Ink, LEGEND_TEXT, Look, Place, RED, REFERENCE, Stroke, text_width,
};
use crate::model::{Parameters, Symbol};
use crate::reduce::{HistogramBin, Values, differing};
use crate::sets::label;
use crate::sets::{FREQUENCY, SetRow};

pub(super) const NAME: &str = "tau-histograms";

/// Panels that fit a page.
const MAX_PANELS: usize = 4;
/// Sets that may fit: each panel can hold a second one, of identical contacts.
pub(super) const MAX_SETS: usize = 2 * MAX_PANELS;
const WIDTH: f64 = 558.0;
const HEIGHT: f64 = 150.0;
/// Multiples of T that are marked; more would be a grey area.
const MAX_MULTIPLES: f64 = 40.0;
/// Space in a panel for the numbers of the multiples.
const NUMBERS: f64 = 24.0;
const BAR: Fill = Fill {
    ink: Ink::new(0x9d_b4_d6),
    opacity: 1.0,
};
const OUTLINE: Stroke = Stroke::solid(BLACK, 1.3);
const OVERLAY: Stroke = Stroke::dashed(RED, 2.0, (6.0, 3.5));

/// A panel: a set and, if there is one, the set of identical contacts that it otherwise equals.
#[derive(Clone, Debug, PartialEq)]
struct HistogramPanel<'a> {
    /// What the set is, in symbols.
    title: String,
    /// Bins in ascending order; empty ones are left out.
    bars: Vec<&'a HistogramBin>,
    /// Those of the identical contacts, drawn as an outline.
    overlay: Option<Vec<&'a HistogramBin>>,
    /// Period T in s, whose multiples are marked.
    period: Option<f64>,
}

impl<'a> HistogramPanel<'a> {
    fn all_bars(&self) -> impl Iterator<Item = &'a HistogramBin> {
        self.bars
            .iter()
            .chain(self.overlay.iter().flatten())
            .copied()
    }

    /// What it shows, and the size of the sample.
    fn heading(&self) -> String {
        let count = |bars: &[&HistogramBin]| bars.iter().map(|bar| bar.count).sum::<u64>();
        let other_bars = self.overlay.as_ref();
        let overlay = other_bars.map_or_else(String::new, |bars| format!(" and {}", count(bars)));
        format!("{}: {}{overlay} intervals", self.title, count(&self.bars))
    }
}

/// Draws the histograms of up to 4 sets, those of identical contacts beside other contacts not counted; `None` for more
/// sets or none.
pub(super) fn histograms(sets: &[SetRow], bins: &[HistogramBin], look: &Look) -> Option<Picture> {
    let (factor, unit) = label("tau_mean").scale(bounds(bins.iter().map(|bin| bin.high))?.1);
    let in_unit = |bin: &HistogramBin| HistogramBin {
        low: factor * bin.low,
        high: factor * bin.high,
        density: bin.density / factor,
        ..bin.clone()
    };
    let scaled: Vec<HistogramBin> = bins.iter().map(in_unit).collect();
    let panels = panels(sets, &scaled);
    if panels.len() > MAX_PANELS {
        return None;
    }
    let all = panels.iter().flat_map(HistogramPanel::all_bars);
    let (low, high) = widened(bounds(all.flat_map(|bar| [bar.low, bar.high]))?);
    let panel = |(index, panel): (usize, &HistogramPanel<'_>)| {
        let x = Axis::linear(&format!("Slip interval τ ({unit})"), low.max(0.0), high);
        let period = factor * panel.period.unwrap_or(0.0);
        let of_period = panel.period.map(|_| x.multiples_of(period, MAX_MULTIPLES));
        let multiples = of_period.unwrap_or_default();
        let highest = panel.all_bars().map(|bar| bar.density).fold(0.0, f64::max);
        let density = format!("Probability density (1/{unit})");
        // The numbers cover no bar.
        let head = if multiples.is_empty() { 1.1 } else { 1.25 };
        let y = Axis::sparse(if index == 0 { &density } else { "" }, 0.0, head * highest);
        let bars = panel.bars.iter();
        let cells = bars.map(|bar| (((bar.low, bar.high), (0.0, bar.density)), BAR.ink));
        let outlines = outline(&panel.bars).into_iter();
        let overlay = panel.overlay.iter().flat_map(|bars| outline(bars));
        let mut inside = vec![Layer::Cells(cells.collect(), OVERLAP)];
        inside.extend(outlines.map(|line| Layer::Curve(line, OUTLINE)));
        inside.extend(overlay.map(|line| Layer::Curve(line, OVERLAY)));
        let numbered = Layer::Drawn(Box::new(move |sheet, frame| {
            draw_multiples(sheet, frame, multiples, period);
        }));
        let layers = vec![numbered, Layer::Inside(inside)];
        panel::Panel {
            heading: Some(panel.heading()),
            ..panel::Panel::new(HEIGHT, x, y, layers)
        }
    };
    let layout = Layout {
        row_gap: 10.0,
        ..Layout::column(WIDTH)
    };
    let drawn = panels.iter().enumerate().map(panel).collect();
    Some(panel::draw(NAME, look, layout, &legend(&panels), drawn))
}

/// A panel per set by rising frequency, as in Fig. 2. One of identical contacts goes onto the panel of the set that it
/// otherwise equals.
fn panels<'a>(sets: &[SetRow], bins: &'a [HistogramBin]) -> Vec<HistogramPanel<'a>> {
    let bars = |set: &SetRow| bins.iter().filter(|bin| bin.set_id == set.set_id).collect();
    let is_identical = |set: &&SetRow| set.parameters.threshold_deviation == 0.0;
    let (identical, others): (Vec<&SetRow>, Vec<&SetRow>) = sets.iter().partition(is_identical);
    let is_twin = |identical: &SetRow, other: &SetRow| {
        *identical.parameters
            == Parameters {
                threshold_deviation: 0.0,
                ..other.parameters.all.clone()
            }
    };
    let is_shown =
        |set: &&SetRow| !is_identical(set) || !others.iter().any(|other| is_twin(set, other));
    // Sets come in the order of Δ and then T.
    let mut shown: Vec<&SetRow> = sets.iter().filter(is_shown).collect();
    let frequency = |set: &SetRow| set.parameters.modulation_frequency();
    shown.sort_by(|left, right| frequency(left).total_cmp(&frequency(right)));
    let mut others = differing(&shown.iter().copied());
    others.retain(|symbol| !matches!(symbol, Symbol::Delta | Symbol::T));
    let of_modulation = [Symbol::Delta.key(), FREQUENCY].into_iter();
    let names = of_modulation.chain(others.into_iter().map(Symbol::key));
    let columns: Vec<Values> = names
        .filter_map(|name| Values::of(sets, name).ok())
        .collect();
    let title = |set: &SetRow| {
        let place = sets.iter().position(|other| std::ptr::eq(other, set));
        let setting = |values: &Values| Some(values.setting(values.numbers[place?]?));
        columns
            .iter()
            .filter_map(setting)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let panel = |set: &SetRow| {
        let twin = identical
            .iter()
            .find(|twin| !is_identical(&set) && is_twin(twin, set));
        HistogramPanel {
            title: title(set),
            bars: bars(set),
            overlay: twin.map(|twin| bars(twin)),
            // A ramp has many.
            period: (set.parameters.modulation_period).filter(|_| set.parameters.ramp_time == 0.0),
        }
    };
    shown
        .into_iter()
        .map(panel)
        .filter(|panel| panel.all_bars().next().is_some())
        .collect()
}

fn legend(panels: &[HistogramPanel<'_>]) -> Vec<LegendEntry> {
    let has_overlay = panels.iter().any(|panel| panel.overlay.is_some());
    let overlay = has_overlay.then(|| entry(Mark::Line(OVERLAY), "identical contacts, Δfₛ = 0"));
    let has_period = panels.iter().any(|panel| panel.period.is_some());
    let multiples = has_period.then(|| entry(Mark::Line(REFERENCE), "τ = nT"));
    [entry(Mark::Patch(BAR), "all slips")]
        .into_iter()
        .chain(overlay)
        .chain(multiples)
        .collect()
}

/// The multiples of a period, with the numbers for which there is room.
fn draw_multiples(sheet: &mut Picture, frame: &Frame, multiples: Vec<f64>, period: f64) {
    let mut free = f64::NEG_INFINITY;
    for multiple in multiples {
        let x = frame.x_of(multiple);
        let n = format!("{}", (multiple / period).round());
        let half = 0.5 * text_width(&n, LEGEND_TEXT);
        // Before the first number, where there is room.
        let is_led = free == f64::NEG_INFINITY
            && x - half - text_width("n = ", LEGEND_TEXT) > frame.left + 4.0;
        let lead = if is_led { "n = " } else { "" };
        let mut top = frame.top;
        if x - half > free.max(frame.left + 4.0) && x + half < frame.right() - 4.0 {
            top += NUMBERS - 2.0;
            let place = (x + half, frame.top + 0.5 * NUMBERS + 1.0);
            sheet.centred_text(place, &format!("{lead}{n}"), LEGEND_TEXT, Anchor::End);
            free = x + half + 4.0;
        }
        sheet.line(vec![(x, frame.bottom()), (x, top)], REFERENCE);
    }
}

/// The upper edge of bars, down to zero where some are left out.
fn outline(bars: &[&HistogramBin]) -> Vec<Vec<Place>> {
    // Edges of neighbours differ by rounding only.
    let are_neighbours = |left: &&HistogramBin, right: &&HistogramBin| {
        right.low - left.high < 0.01 * (left.high - left.low)
    };
    bars.chunk_by(are_neighbours)
        .map(|run| {
            let first = run[0];
            let last = run[run.len() - 1];
            let tops = run
                .iter()
                .flat_map(|bar| [(bar.low, bar.density), (bar.high, bar.density)]);
            std::iter::once((first.low, 0.0))
                .chain(tops)
                .chain([(last.high, 0.0)])
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Selected;

    fn set(id: &str, deviation: f64, frequency: Option<f64>) -> SetRow {
        let parameters = Parameters {
            threshold_deviation: deviation,
            modulation_amplitude: frequency.map_or(0.0, |_| 1e-6),
            modulation_period: frequency.map(|frequency| 1.0 / frequency),
            ..Parameters::default()
        };
        SetRow {
            set_id: id.to_owned(),
            frequency,
            parameters: Selected::new(parameters),
            ..SetRow::default()
        }
    }

    fn bin(id: &str, low: f64, high: f64, density: f64) -> HistogramBin {
        HistogramBin {
            set_id: id.to_owned(),
            low,
            high,
            count: 1,
            density,
        }
    }

    #[test]
    fn sets_become_the_panels_of_fig_2() {
        let sets = [
            set("identical", 0.0, None),
            set("still", 6.9e-3, None),
            set("58", 6.9e-3, Some(58.0)),
            set("29", 6.9e-3, Some(29.0)),
        ];
        let bins = [("identical", 0.1), ("still", 0.2), ("29", 0.3), ("58", 0.4)]
            .map(|(id, low)| bin(id, low, low + 0.01, 100.0));
        let panels = panels(&sets, &bins);
        assert_eq!(panels.len(), 3);
        assert_eq!(panels[0].bars, [&bins[1]]);
        assert_eq!(panels[0].overlay, Some(vec![&bins[0]]));
        assert_eq!(panels[1].title, "Δ = 1 µm, 1/T = 29 Hz");
        assert_eq!(
            (panels[2].period, panels[2].overlay.as_ref()),
            (Some(1.0 / 58.0), None)
        );
        let svg = histograms(&sets, &bins, &Look::default()).unwrap().svg();
        for text in [
            "(a)",
            "(c)",
            "Δ = 0: 1 and 1 intervals",
            "Δ = 1 µm, 1/T = 58 Hz: 1 intervals",
            "τ = nT",
        ] {
            assert!(svg.contains(&format!(">{text}<")), "{text}");
        }
        assert!(
            histograms(&sets, &[], &Look::default()).is_none()
                && histograms(&[], &[], &Look::default()).is_none()
        );
        let five = [1.0, 2.0, 3.0, 4.0, 5.0].map(|frequency| set("58", 6.9e-3, Some(frequency)));
        assert!(
            histograms(&five[..4], &bins, &Look::default()).is_some()
                && histograms(&five, &bins, &Look::default()).is_none()
        );
    }

    #[test]
    fn multiples_of_the_period_are_marked_unless_they_would_fill_the_panel() {
        let axis = Axis::linear("", 0.09, 0.21);
        let marked = axis.multiples_of(0.05, MAX_MULTIPLES);
        assert_eq!(marked.len(), 3);
        assert!((marked[0] - 0.1).abs() < 1e-15 && (marked[2] - 0.2).abs() < 1e-15);
        assert!(axis.multiples_of(0.001, MAX_MULTIPLES).is_empty());
    }

    #[test]
    fn outlines_go_down_where_bars_are_missing() {
        let bars = [(0.1, 0.2, 3.0), (0.2 + 1e-17, 0.3, 4.0), (0.5, 0.6, 1.0)]
            .map(|(low, high, density)| bin("", low, high, density));
        let outlines = outline(&bars.iter().collect::<Vec<_>>());
        assert_eq!(outlines.len(), 2);
        assert_eq!(
            outlines[1],
            [(0.5, 0.0), (0.5, 1.0), (0.6, 1.0), (0.6, 0.0)]
        );
        assert_eq!(outlines[0].len(), 6);
    }
}
