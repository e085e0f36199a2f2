//! Histograms of τ (Fig. 2d-f): one panel per set, one under the other on a common axis.

use super::axis::{Axis, bounds};
use super::frame::{Entry, Frame, Layout, LegendPlace, Mark, RIGHT, entry, legend_space};
use super::picture::{BLACK, Fill, GREY, Picture, RED, Sheet, Stroke};
use super::sets::{modulation, setting, swept};
use crate::model::Parameters;
use crate::reduce::{HistogramBin, SetSummary};

/// Panels that fit a page.
const MAX_PANELS: usize = 4;
/// Sets that may fit: each panel can hold a second one, of identical contacts.
pub(super) const MAX_SETS: usize = 2 * MAX_PANELS;
const HEIGHTS: [f64; MAX_PANELS] = [160.0; MAX_PANELS];
/// Multiples of T that are marked; more would be a grey area.
const MAX_MULTIPLES: f64 = 40.0;
const BAR: Fill = Fill { ink: "#9db4d6", opacity: 1.0 };
const OUTLINE: Stroke = Stroke::solid(BLACK, 1.3);
const OVERLAY: Stroke = Stroke::dashed(RED, 2.0, (6.0, 3.5));
const MULTIPLE: Stroke = Stroke::dashed(GREY, 1.1, (3.0, 3.0));

/// A panel: a set and, if there is one, the set of identical contacts that it otherwise equals.
#[derive(Clone, Debug, PartialEq)]
struct Panel<'a> {
    /// What the set is, in symbols.
    title: String,
    /// Bins in ascending order; empty ones are left out.
    bars: Vec<&'a HistogramBin>,
    /// Those of the identical contacts, drawn as an outline.
    overlay: Option<Vec<&'a HistogramBin>>,
    /// Period T in s, whose multiples are marked.
    period: Option<f64>,
}

impl<'a> Panel<'a> {
    fn all_bars(&self) -> impl Iterator<Item = &'a HistogramBin> {
        self.bars.iter().chain(self.overlay.iter().flatten()).copied()
    }
}

/// Draws the histograms of up to 4 sets, those of identical contacts beside other contacts not counted; `None` for more
/// sets or none.
pub(super) fn histograms(sets: &[SetSummary], bins: &[HistogramBin]) -> Option<Picture> {
    let panels = panels(sets, bins);
    let (low, high) = bounds(panels.iter().flat_map(Panel::all_bars).flat_map(|bar| [bar.low, bar.high]))?;
    let layout = Layout::column(558.0, HEIGHTS.get(..panels.len())?, 12.0, RIGHT);
    let mut sheet = layout.sheet("tau-histograms");
    let margin = 0.04 * (high - low);
    for (row, panel) in panels.iter().enumerate() {
        let x = Axis::linear("Slip interval τ (s)", (low - margin).max(0.0), high + margin);
        let multiples = multiples(panel.period, &x);
        let entries = legend(panel, !multiples.is_empty());
        let y_label = if row == 0 { "Probability density (1/s)" } else { "" };
        let highest = panel.all_bars().map(|bar| bar.density).fold(0.0, f64::max);
        // The legend covers no bar.
        let top = highest * HEIGHTS[row] / (HEIGHTS[row] - legend_space(entries.len()));
        let frame = layout.frame(row, 0, x, Axis::sparse(y_label, 0.0, top));
        draw(&mut sheet, &frame, panel, &multiples);
        frame.legend(&mut sheet, LegendPlace::UpperRight, &entries);
        frame.axes(&mut sheet);
        frame.y_label(&mut sheet);
        frame.x_label(&mut sheet);
    }
    Some(sheet.finish())
}

/// A panel per set by rising frequency, as in Fig. 2. One of identical contacts goes onto the panel of the set that it
/// otherwise equals.
fn panels<'a>(sets: &[SetSummary], bins: &'a [HistogramBin]) -> Vec<Panel<'a>> {
    let bars = |set: &SetSummary| bins.iter().filter(|bin| bin.set_id == set.set_id).collect();
    let is_identical = |set: &&SetSummary| set.parameters.threshold_deviation == 0.0;
    let (identical, others): (Vec<&SetSummary>, Vec<&SetSummary>) = sets.iter().partition(is_identical);
    let is_twin = |identical: &SetSummary, other: &SetSummary| {
        identical.parameters == Parameters { threshold_deviation: 0.0, ..other.parameters.clone() }
    };
    let is_shown = |set: &&SetSummary| !is_identical(set) || !others.iter().any(|other| is_twin(set, other));
    // Sets come in the order of Δ and then T.
    let mut shown: Vec<&SetSummary> = sets.iter().filter(is_shown).collect();
    shown.sort_by(|left, right| {
        left.parameters.modulation_frequency().total_cmp(&right.parameters.modulation_frequency())
    });
    let swept = swept(&shown);
    let panel = |set: &SetSummary| {
        let settings = swept.iter().map(|&symbol| setting(&set.parameters, symbol));
        let twin = identical.iter().find(|twin| !is_identical(&set) && is_twin(twin, set));
        Panel {
            title: std::iter::once(modulation(&set.parameters)).chain(settings).collect::<Vec<_>>().join(", "),
            bars: bars(set),
            overlay: twin.map(|twin| bars(twin)),
            period: set.parameters.modulation_period,
        }
    };
    shown.into_iter().map(panel).collect()
}

/// The multiples of a period on an axis, unless they are too many.
fn multiples(period: Option<f64>, axis: &Axis) -> Vec<f64> {
    let Some(period) = period.filter(|period| (axis.high - axis.low) / period <= MAX_MULTIPLES) else {
        return Vec::new();
    };
    let first = (axis.low / period).ceil();
    let multiples = (0..).map(|step| (first + f64::from(step)) * period);
    multiples.take_while(|&multiple| multiple <= axis.high).collect()
}

fn legend(panel: &Panel<'_>, has_multiples: bool) -> Vec<Entry> {
    let overlay = panel.overlay.as_ref().map(|_| entry(Mark::Line(OVERLAY), "identical contacts"));
    let multiples = has_multiples.then(|| entry(Mark::Line(MULTIPLE), "τ = nT"));
    [entry(Mark::Patch(BAR), panel.title.as_str())].into_iter().chain(overlay).chain(multiples).collect()
}

fn draw(sheet: &mut Sheet, frame: &Frame, panel: &Panel<'_>, multiples: &[f64]) {
    frame.clipped(sheet, |sheet| {
        for &multiple in multiples {
            frame.curve(sheet, [(multiple, 0.0), (multiple, frame.y.high)], MULTIPLE);
        }
        for bar in &panel.bars {
            let (left, top) = (frame.x_of(bar.low), frame.y_of(bar.density));
            sheet.rectangle([left, top, frame.x_of(bar.high) - left, frame.y_of(0.0) - top], BAR);
        }
        for line in outline(&panel.bars) {
            frame.curve(sheet, line, OUTLINE);
        }
        for line in panel.overlay.iter().flat_map(|bars| outline(bars)) {
            frame.curve(sheet, line, OVERLAY);
        }
    });
}

/// The upper edge of bars, down to zero where some are left out.
fn outline(bars: &[&HistogramBin]) -> Vec<Vec<(f64, f64)>> {
    // Edges of neighbours differ by rounding only.
    let are_neighbours =
        |left: &&HistogramBin, right: &&HistogramBin| right.low - left.high < 0.01 * (left.high - left.low);
    bars.chunk_by(are_neighbours)
        .map(|run| {
            let (first, last) = (run[0], run[run.len() - 1]);
            let tops = run.iter().flat_map(|bar| [(bar.low, bar.density), (bar.high, bar.density)]);
            std::iter::once((first.low, 0.0)).chain(tops).chain([(last.high, 0.0)]).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(id: &str, deviation: f64, frequency: Option<f64>) -> SetSummary {
        let parameters = Parameters {
            threshold_deviation: deviation,
            modulation_amplitude: frequency.map_or(0.0, |_| 1e-6),
            modulation_period: frequency.map(|frequency| 1.0 / frequency),
            ..Parameters::default()
        };
        SetSummary { set_id: id.to_owned(), parameters, ..SetSummary::default() }
    }

    fn bin(id: &str, low: f64, high: f64, density: f64) -> HistogramBin {
        HistogramBin { set_id: id.to_owned(), low, high, count: 1, density }
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
        assert_eq!((panels[2].period, panels[2].overlay.as_ref()), (Some(1.0 / 58.0), None));
        assert!(histograms(&sets, &bins).is_some());
        assert!(histograms(&sets, &[]).is_none() && histograms(&[], &[]).is_none());
        let five = [1.0, 2.0, 3.0, 4.0, 5.0].map(|frequency| set("58", 6.9e-3, Some(frequency)));
        assert!(histograms(&five[..4], &bins).is_some() && histograms(&five, &bins).is_none());
    }

    #[test]
    fn multiples_of_the_period_are_marked_unless_they_would_fill_the_panel() {
        let axis = Axis::linear("", 0.09, 0.21);
        let marked = multiples(Some(0.05), &axis);
        assert_eq!(marked.len(), 3);
        assert!((marked[0] - 0.1).abs() < 1e-15 && (marked[2] - 0.2).abs() < 1e-15);
        assert!(multiples(Some(0.001), &axis).is_empty() && multiples(None, &axis).is_empty());
    }

    #[test]
    fn outlines_go_down_where_bars_are_missing() {
        let bars = [(0.1, 0.2, 3.0), (0.2 + 1e-17, 0.3, 4.0), (0.5, 0.6, 1.0)]
            .map(|(low, high, density)| bin("", low, high, density));
        let outlines = outline(&bars.iter().collect::<Vec<_>>());
        assert_eq!(outlines.len(), 2);
        assert_eq!(outlines[1], [(0.5, 0.0), (0.5, 1.0), (0.6, 1.0), (0.6, 0.0)]);
        assert_eq!(outlines[0].len(), 6);
    }
}
