//! One simulation: the shear force over time (Fig. 1d), and under it the space-time map of attached contacts (Fig. 4b,
//! d).

use super::FigureError;
use super::axis::{Axis, bounds};
use super::colour_bar::{COLOUR_BAR, ColourBar, OVERLAP, shade};
use super::frame::{Frame, Layout, RIGHT, ROW_GAP};
use super::picture::{BLACK, Picture, Stroke, snapped};
use kuva::render::color::Color;

const NAME: &str = "simulation";
/// Of the panels and all that stands right of them.
const WIDTH: f64 = 684.0;
const TRACE_HEIGHT: f64 = 230.0;
const MAP_HEIGHT: f64 = 260.0;
const MILLIMETRES: f64 = 1e3;
const TRACE: Stroke = Stroke::solid(BLACK, 1.3);
/// Colours that an eye can distinguish.
const LEVELS: f64 = 100.0;

/// Fractions of attached contacts over time and blocks.
#[derive(Clone, Copy, Debug)]
pub struct AttachedMap<'a> {
    /// Instants in s, evenly spaced, ascending.
    pub times: &'a [f64],
    /// Blocks.
    pub blocks: usize,
    /// Attached contacts over contacts, for every block at the first instant, then at the second, ...
    pub fractions: &'a [f64],
    /// Length of the slider, in m.
    pub length: f64,
}

/// Draws shear force in N against time in s, the map, or the map under the force.
///
/// # Errors
/// When what is given has fewer than two instants, or the map does not have one fraction per instant and block.
pub fn simulation(trace: Option<&[(f64, f64)]>, map: Option<AttachedMap<'_>>) -> Result<Picture, FigureError> {
    let empty = |what| FigureError::Empty { figure: NAME, what };
    if map.is_some_and(|map| map.times.len() < 2 || map.fractions.len() != map.times.len() * map.blocks) {
        return Err(empty("fractions for every instant and block"));
    }
    let instants = trace.into_iter().flatten().map(|sample| sample.0);
    let instants = instants.chain(map.iter().flat_map(|map| map.times).copied());
    let (first, last) =
        bounds(instants).filter(|(first, last)| last > first).ok_or_else(|| empty("instants of the simulation"))?;
    let x = || Axis::linear("Time t (s)", first, last);

    let heights: Vec<f64> = trace.map(|_| TRACE_HEIGHT).into_iter().chain(map.map(|_| MAP_HEIGHT)).collect();
    let right = if map.is_some() { COLOUR_BAR } else { RIGHT };
    let layout = Layout::column(WIDTH - right, &heights, ROW_GAP, right);
    let mut sheet = layout.sheet(NAME);
    if let Some(trace) = trace {
        let (least, most) = bounds(trace.iter().map(|sample| sample.1)).unwrap_or((0.0, 0.0));
        let frame = layout.frame(0, 0, x(), Axis::rounded("Shear force Fₛ (N)", least.min(0.0), most));
        frame.clipped(&mut sheet, |sheet| frame.curve(sheet, thinned(trace, frame.width), TRACE));
        frame.axes(&mut sheet);
        frame.y_label(&mut sheet);
        frame.x_label(&mut sheet);
    }
    if let Some(map) = map {
        let y = Axis::linear("Position x (mm)", 0.0, map.length * MILLIMETRES);
        let frame = layout.frame(heights.len() - 1, 0, x(), y);
        frame.clipped(&mut sheet, |sheet| sheet.rectangles(cells(&frame, &map)));
        frame.axes(&mut sheet);
        frame.y_label(&mut sheet);
        // As in Fig. 4: bright where all are attached.
        let ticks = [0.0, 25.0, 50.0, 75.0, 100.0].map(|percent: f64| (1.0 - percent / 100.0, percent));
        ColourBar::of_shades("detached contacts (%)", ticks).draw(&mut sheet, &frame);
        frame.x_label(&mut sheet);
    }
    Ok(sheet.finish())
}

/// The least and the largest of the samples of each column of a figure: no peak is lost.
fn thinned(trace: &[(f64, f64)], width: f64) -> Vec<(f64, f64)> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the width of a figure")]
    let columns = (2.0 * width) as usize;
    let samples = trace.len().div_ceil(columns).max(1);
    if samples <= 4 {
        return trace.to_vec();
    }
    let extremes = |column: &[(f64, f64)]| {
        let by_force = |left: &&(f64, f64), right: &&(f64, f64)| left.1.total_cmp(&right.1);
        let (least, most) = (column.iter().min_by(by_force).copied(), column.iter().max_by(by_force).copied());
        let mut pair: Vec<(f64, f64)> = least.into_iter().chain(most).collect();
        pair.sort_by(|left, right| left.0.total_cmp(&right.0));
        pair
    };
    trace.chunks(samples).flat_map(extremes).collect()
}

/// Rectangles of the map: averages over the instants of a column one unit wide, equal neighbours joined.
fn cells(frame: &Frame, map: &AttachedMap<'_>) -> Vec<([f64; 4], Color)> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the width of a figure")]
    let columns = (frame.width as usize).min(map.times.len());
    let instants = map.times.len();
    // Half a spacing on both sides of an instant belongs to it.
    let spacing = (map.times[instants - 1] - map.times[0]) / (instants - 1) as f64;
    let start_of = |column: usize| column * instants / columns;
    let left_of =
        |column: usize| snapped(frame.x_of(map.times[0] + (start_of(column) as f64 - 0.5) * spacing).max(frame.left));
    let top_of = |block: usize| snapped(frame.top + frame.height * (1.0 - block as f64 / map.blocks as f64));
    let level = |block: usize, column: usize| {
        let span = start_of(column)..start_of(column + 1);
        let count = span.len() as f64;
        let sum: f64 = span.map(|instant| map.fractions[instant * map.blocks + block]).sum();
        (sum / count * LEVELS).round()
    };
    let mut cells = Vec::new();
    for block in 0..map.blocks {
        let levels: Vec<f64> = (0..columns).map(|column| level(block, column)).collect();
        let (top, bottom) = (top_of(block + 1), top_of(block));
        let mut column = 0;
        for run in levels.chunk_by(|left, right| left == right) {
            let (left, right) = (left_of(column), left_of(column + run.len()));
            cells.push(([left, top, right - left + OVERLAP, bottom - top + OVERLAP], shade(run[0] / LEVELS)));
            column += run.len();
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_trace_keeps_every_peak() {
        let mut trace: Vec<(f64, f64)> = (0..1_000_000).map(|step| (f64::from(step), 1.0)).collect();
        trace[123_456].1 = 9.0;
        trace[654_321].1 = -9.0;
        let thin = thinned(&trace, 600.0);
        assert!(thin.len() < 5000);
        assert!(thin.contains(&(123_456.0, 9.0)) && thin.contains(&(654_321.0, -9.0)));
        assert!(thin.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn a_map_of_the_wrong_size_is_refused() {
        let map = AttachedMap { times: &[0.0, 1.0], blocks: 3, fractions: &[1.0; 5], length: 0.15 };
        let trace = [(0.0, 1.0), (1.0, 2.0)];
        assert!(simulation(Some(&trace), Some(map)).is_err());
        assert!(simulation(Some(&trace), Some(AttachedMap { fractions: &[1.0; 6], ..map })).is_ok());
        assert!(simulation(Some(&trace[..1]), None).is_err());
        assert!(simulation(None, None).is_err());
    }

    #[test]
    fn the_requested_panels_are_drawn_and_labelled_once() {
        let trace = [(0.0, 1.0), (1.0, 2.0)];
        let map = AttachedMap { times: &[0.0, 1.0], blocks: 3, fractions: &[1.0; 6], length: 0.15 };
        let (force, position, bar) = (">Shear force Fₛ (N)<", ">Position x (mm)<", ">detached contacts (%)<");
        let panels =
            [(true, false, vec![force]), (false, true, vec![position, bar]), (true, true, vec![force, position, bar])];
        for (has_trace, has_map, labels) in panels {
            let svg = simulation(has_trace.then_some(&trace[..]), has_map.then_some(map)).unwrap().svg();
            for label in [force, position, bar] {
                assert_eq!(svg.matches(label).count(), usize::from(labels.contains(&label)), "{label}");
            }
            assert_eq!(svg.matches(">Time t (s)<").count(), 1);
        }
    }
}
