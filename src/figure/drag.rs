//! Drag: τ on a ramp of the modulation, on the way there and on the way back, with the lines τ = nT, and τ/T in bins.

use super::axis::{Axis, bounds};
use super::font;
use super::frame::{Frame, Layout};
use super::legend::{Entry, Mark, entry};
use super::panel::{self, Ends, Layer, Panel, Place};
use super::picture::{Anchor, Dot, Fill, Ink, Picture, Sheet, Stroke};
use super::style::{GRID, INKS, LEGEND_TEXT, Look, WHITE};
use crate::reduce::{Point, RampStage, quantile};

/// Space right of the frames for the numbers of lines.
const NUMBERS: f64 = 66.0;
/// Space above the longest interval for them, over the range of intervals.
const NUMBERS_ABOVE: f64 = 0.14;
const LAYOUT: Layout = Layout { right: NUMBERS, ..Layout::column(520.0) };
/// The stages of the ramp, their names and inks.
const STAGES: [(RampStage, &str, Ink); 2] = [(RampStage::Up, "there", INKS[0]), (RampStage::Down, "back", INKS[1])];
/// Share of the intervals at either end that the axis of the medians leaves out.
const RARE: f64 = 0.02;
/// Bins of the modulation, and least intervals in one that has a median.
const BINS: u32 = 16;
const MIN_INTERVALS: usize = 8;
/// Places of the medians of the stages, from the middle of their bin in its widths.
const OFFSETS: [f64; 2] = [-0.12, 0.12];

/// A slip under a ramp, in SI.
#[derive(Clone, Copy, Debug)]
struct Slip {
    stage: usize,
    /// T or Δ at the onset.
    modulation: f64,
    period: f64,
    interval: f64,
}

/// Draws interval against period at the onset, or against amplitude if it is the amplitude alone that is ramped; `None`
/// if no slip has an interval on a ramp.
pub(super) fn drag(points: &[Point], look: &Look) -> Option<Picture> {
    let stage = |point: &Point| STAGES.iter().position(|(stage, ..)| point.ramp_stage == Some(*stage));
    let periods = bounds(points.iter().filter(|point| stage(point).is_some()).filter_map(|point| point.period));
    let is_period = periods.is_some_and(|(low, high)| high > low);
    let slip = |point: &Point| {
        let (stage, period, interval) = (stage(point)?, point.period?, point.interval?);
        Some(Slip { stage, modulation: if is_period { period } else { point.amplitude }, period, interval })
    };
    let slips: Vec<Slip> = points.iter().filter_map(slip).collect();
    let (low, high) = bounds(slips.iter().map(|slip| slip.modulation))?;
    let (shortest, longest) = bounds(slips.iter().map(|slip| slip.interval))?;
    let ratios = ratios(slips.iter());
    let [least, most] = [quantile(&ratios, RARE)?, quantile(&ratios, 1.0 - RARE)?];
    let highest = ratios.last().copied().unwrap_or(most);
    let multiples: Vec<f64> = (1..=u32::MAX).map(f64::from).take_while(|&n| n < highest + 0.5).collect();

    let label = if is_period { "Modulation period T at the onset (s)" } else { "Amplitude Δ at the onset (m)" };
    let margin = 0.03 * (high - low);
    let x = Axis::linear(label, low - margin, high + margin);
    let margin = 0.04 * (longest - shortest);
    // Above the longest is room for the numbers of lines.
    let upper = Axis::linear("Slip interval τ (s)", shortest - margin, longest + NUMBERS_ABOVE * (longest - shortest));
    let slip_entries = STAGES.map(|(_, name, ink)| entry(Mark::Dot(slip_dot(ink)), format!("slips, {name}")));
    let medians =
        STAGES.map(|(_, name, ink)| entry(Mark::Bar(Dot::solid(ink, 4.5)), format!("median and quartiles, {name}")));
    let entries: Vec<Entry> =
        slip_entries.into_iter().chain([entry(Mark::Line(GRID), "τ = nT")]).chain(medians).collect();
    let lower = Axis::linear("Median interval in periods, τ / T", least - 0.3, most + 0.3);
    // τ = nT is a curve in T, and level in Δ.
    let period = slips.first().map_or(0.0, |slip| slip.period);
    let line = |n: f64| [x.low, x.high].map(|x| (x, n * if is_period { x } else { period }));
    let lines = multiples.iter().map(|&n| Layer::Curve(line(n).into(), GRID));
    // Slip by slip, so that neither stage covers the other.
    let dots =
        slips.iter().map(|slip| Layer::Dots(vec![(slip.modulation, slip.interval)], slip_dot(STAGES[slip.stage].2)));
    let numbers: Vec<(f64, [Place; 2])> = multiples.iter().map(|&n| (n, line(n))).collect();
    let notes = vec![Layer::Drawn(Box::new(move |sheet, frame| {
        for (n, line) in numbers {
            number_line(sheet, frame, n, line);
        }
    }))];
    let levels = multiples.iter().map(|&n| Layer::Level(n, GRID));
    let lower = Panel::inside(210.0, x.clone(), lower, levels.chain(medians_of(&slips, (low, high))));
    let upper = Panel { notes, ..Panel::inside(320.0, x.clone(), upper, lines.chain(dots)) };
    Some(panel::draw("drag", look, LAYOUT, &entries, vec![upper, lower]))
}

const fn slip_dot(ink: Ink) -> Dot {
    Dot { ink, radius: 2.0, opacity: 0.45 }
}

/// The number of a line τ = nT where it leaves the frame: at its right edge, or in it, under the upper edge.
fn number_line(sheet: &mut Sheet, frame: &Frame, n: f64, [(left, start), (right, end)]: [Place; 2]) {
    let (text, top) = (format!("n = {n}"), frame.y.high);
    if frame.y.contains(end) {
        let place = (frame.x_of(right) + 6.0, frame.y_of(end));
        sheet.centred_text(place, &text, LEGEND_TEXT, Anchor::Start);
    } else if end > top && start < top {
        let x = frame.x_of(left + (right - left) * (top - start) / (end - start)).max(frame.left + 26.0) - 18.0;
        let (y, size, width) = (frame.top + 16.0, f64::from(LEGEND_TEXT), font::width(&text, LEGEND_TEXT));
        // The ground that it needs to be read.
        let ground = [x - 0.5 * width - 2.0, y - 0.6 * size, width + 4.0, 1.2 * size];
        sheet.rectangle(ground, Fill { ink: WHITE, opacity: 0.8 });
        sheet.centred_text((x, y), &text, LEGEND_TEXT, Anchor::Middle);
    }
}

/// Medians and quartiles of τ/T in bins of the modulation, of both stages.
fn medians_of<'a>(slips: &[Slip], (low, high): Ends) -> Vec<Layer<'a>> {
    let width = (high - low) / f64::from(BINS);
    let mut layers = Vec::new();
    for (stage, (_, _, ink)) in STAGES.into_iter().enumerate() {
        for bin in 0..BINS {
            let start = low + f64::from(bin) * width;
            let end = if bin + 1 == BINS { f64::INFINITY } else { start + width };
            let is_within = |slip: &&Slip| slip.stage == stage && (start..end).contains(&slip.modulation);
            let ratios = ratios(slips.iter().filter(is_within));
            let [Some(first), Some(median), Some(third)] = [0.25, 0.5, 0.75].map(|share| quantile(&ratios, share))
            else {
                continue;
            };
            if ratios.len() >= MIN_INTERVALS {
                let x = start + (0.5 + OFFSETS[stage]) * width;
                layers.push(Layer::Curve(vec![(x, first), (x, third)], Stroke::solid(ink, 2.0)));
                layers.push(Layer::Dots(vec![(x, median)], Dot::solid(ink, 4.5)));
            }
        }
    }
    layers
}

/// τ/T of some slips, ascending.
fn ratios<'a>(slips: impl Iterator<Item = &'a Slip>) -> Vec<f64> {
    let mut ratios: Vec<f64> = slips.map(|slip| slip.interval / slip.period).collect();
    ratios.sort_by(f64::total_cmp);
    ratios
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(ramp_stage: Option<RampStage>, period: f64, n: f64) -> Point {
        Point {
            drive_velocity: 1e-4,
            amplitude: 1e-6,
            period: Some(period),
            eta: 2.0,
            ramp_stage,
            onset: 1.0,
            interval: Some(n * period),
            periods: Some(4),
            phase: Some(-0.5),
            has_phase: true,
        }
    }

    #[test]
    fn both_stages_of_the_ramp_are_drawn_and_what_comes_after_is_not() {
        let on = |stage, n| (0..200).map(move |step| point(Some(stage), 0.03 + 5e-5 * f64::from(step), n));
        let points: Vec<Point> = on(RampStage::Up, 4.0).chain(on(RampStage::Down, 3.0)).collect();
        let svg = drag(&points, &Look::default()).unwrap().svg();
        for text in ["n = 3", "n = 4", "there", "back", "τ / T"] {
            assert!(svg.contains(text), "{text}");
        }
        let after: Vec<Point> = on(RampStage::After, 4.0).chain([point(None, 0.03, 4.0)]).collect();
        assert!(drag(&after, &Look::default()).is_none());
    }

    #[test]
    fn a_ramp_of_the_amplitude_alone_is_drawn_over_the_amplitude() {
        let ramped = |step: u32| Point { amplitude: 1e-8 * f64::from(step), ..point(Some(RampStage::Up), 0.03, 4.0) };
        let svg = drag(&(0..100).map(ramped).collect::<Vec<_>>(), &Look::default()).unwrap().svg();
        assert!(svg.contains("Amplitude Δ at the onset"));
    }
}
