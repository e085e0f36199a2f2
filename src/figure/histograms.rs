//! Histograms of τ (Fig. 2d-f): one panel per set, one under the other on a common axis.

use super::FigureError;
use super::axis::{Axis, bounds};
use super::frame::{ABOVE, Frame, LEFT, LegendPlace, Mark, RIGHT, UNDER, legend_space};
use super::picture::{BLACK, GREY, Ink, Picture, RED, Sheet, Stroke};

const WIDTH: f64 = 660.0;
const PANEL_HEIGHT: f64 = 160.0;
const GAP: f64 = 12.0;
/// Panels that fit a page.
pub const MOST_PANELS: usize = 4;
/// Multiples of T that are marked; more would be a grey area.
const MOST_MULTIPLES: f64 = 40.0;
const BAR_INK: Ink = "#9db4d6";
const OUTLINE: Stroke = Stroke::solid(BLACK, 1.3);
const OVERLAY: Stroke = Stroke::dashed(RED, 2.0, (6.0, 3.5));
const MULTIPLE: Stroke = Stroke::dashed(GREY, 1.1, (3.0, 3.0));

/// A bar: from, to, in s, and its height in 1/s.
pub type Bar = (f64, f64, f64);

/// A panel of histograms.
#[derive(Clone, Debug, PartialEq)]
pub struct HistogramPanel {
    /// What the set is, in symbols.
    pub title: String,
    /// Bars in ascending order; empty ones may be left out.
    pub bars: Vec<Bar>,
    /// Bars of a set to compare with, drawn as a red dashed outline, and what that is.
    pub overlay: Option<(String, Vec<Bar>)>,
    /// Period T, in s, whose multiples are marked.
    pub period: Option<f64>,
}

/// Draws up to [`MOST_PANELS`] histograms; further panels are left out.
///
/// # Errors
/// When no panel has a bar.
pub fn histograms(panels: &[HistogramPanel]) -> Result<Picture, FigureError> {
    const NAME: &str = "tau-histograms";
    let panels = &panels[..panels.len().min(MOST_PANELS)];
    let all_bars = |panel: &HistogramPanel| {
        let overlay = panel.overlay.as_ref().map_or(&[][..], |(_, bars)| bars);
        panel.bars.iter().chain(overlay).copied().collect::<Vec<_>>()
    };
    let edges = panels.iter().flat_map(all_bars).flat_map(|(low, high, _)| [low, high]);
    let (low, high) = bounds(edges).ok_or(FigureError::Empty { figure: NAME, what: "intervals" })?;
    let count = panels.len() as f64;
    let mut sheet = Sheet::new(NAME, (WIDTH, ABOVE + count * PANEL_HEIGHT + (count - 1.0) * GAP + UNDER));
    let margin = 0.04 * (high - low);
    for (index, panel) in panels.iter().enumerate() {
        let highest = all_bars(panel).iter().map(|bar| bar.2).fold(0.0, f64::max);
        let x = Axis::linear("Slip interval τ (s)", (low - margin).max(0.0), high + margin);
        let multiples = multiples(panel.period, &x);
        let rows = 1 + usize::from(panel.overlay.is_some()) + usize::from(!multiples.is_empty());
        let frame = Frame {
            left: LEFT,
            top: ABOVE + index as f64 * (PANEL_HEIGHT + GAP),
            width: WIDTH - LEFT - RIGHT,
            height: PANEL_HEIGHT,
            x,
            // The legend covers no bar.
            y: Axis::few(
                "Probability density (1/s)",
                0.0,
                highest * PANEL_HEIGHT / (PANEL_HEIGHT - legend_space(rows)),
            ),
        };
        draw(&mut sheet, &frame, panel, &multiples);
        let is_last = index + 1 == panels.len();
        frame.axes(&mut sheet, is_last);
        if index == 0 {
            frame.y_label(&mut sheet);
        }
        if is_last {
            frame.x_label(&mut sheet);
        }
    }
    Ok(sheet.finish())
}

/// The multiples of a period on an axis, unless they are too many.
fn multiples(period: Option<f64>, axis: &Axis) -> Vec<f64> {
    let Some(period) = period.filter(|period| (axis.high - axis.low) / period <= MOST_MULTIPLES) else {
        return Vec::new();
    };
    let first = (axis.low / period).ceil();
    let multiples = (0..).map(|step| (first + f64::from(step)) * period);
    multiples.take_while(|&multiple| multiple <= axis.high).collect()
}

fn draw(sheet: &mut Sheet, frame: &Frame, panel: &HistogramPanel, multiples: &[f64]) {
    frame.clipped(sheet, |sheet| {
        for &multiple in multiples {
            frame.curve(sheet, [(multiple, 0.0), (multiple, frame.y.high)], MULTIPLE);
        }
        for &(low, high, density) in &panel.bars {
            let (left, top) = (frame.x_of(low), frame.y_of(density));
            sheet.rectangle((left, top), (frame.x_of(high) - left, frame.y_of(0.0) - top), BAR_INK, 1.0);
        }
        for line in outline(&panel.bars) {
            frame.curve(sheet, line, OUTLINE);
        }
        for line in panel.overlay.iter().flat_map(|(_, bars)| outline(bars)) {
            frame.curve(sheet, line, OVERLAY);
        }
    });
    let mut entries = vec![(Mark::Patch(BAR_INK, 1.0), panel.title.clone())];
    entries.extend(panel.overlay.iter().map(|(text, _)| (Mark::Line(OVERLAY), text.clone())));
    if !multiples.is_empty() {
        entries.push((Mark::Line(MULTIPLE), "τ = nT".to_owned()));
    }
    frame.legend(sheet, LegendPlace::UpperRight, &entries);
}

/// The upper edge of bars, down to zero where some are left out.
fn outline(bars: &[Bar]) -> Vec<Vec<(f64, f64)>> {
    // Edges of neighbours differ by rounding only.
    let are_neighbours = |left: &Bar, right: &Bar| right.0 - left.1 < 0.01 * (left.1 - left.0);
    bars.chunk_by(are_neighbours)
        .map(|run| {
            let (first, last) = (run[0], run[run.len() - 1]);
            let tops = run.iter().flat_map(|&(low, high, density)| [(low, density), (high, density)]);
            std::iter::once((first.0, 0.0)).chain(tops).chain([(last.1, 0.0)]).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let bars = [(0.1, 0.2, 3.0), (0.2 + 1e-17, 0.3, 4.0), (0.5, 0.6, 1.0)];
        let outlines = outline(&bars);
        assert_eq!(outlines.len(), 2);
        assert_eq!(outlines[1], [(0.5, 0.0), (0.5, 1.0), (0.6, 1.0), (0.6, 0.0)]);
        assert_eq!(outlines[0].len(), 6);
    }
}
