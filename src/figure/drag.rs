//! Drag: τ on a ramp of the modulation, on the way there and on the way back, with the lines τ = nT, and τ/T in bins.

use super::FigureError;
use super::axis::{Axis, bounds};
use super::frame::{ABOVE, Frame, LEFT, LEGEND, LegendPlace, Mark, UNDER};
use super::picture::{Anchor, Dot, INKS, Ink, LIGHT_GREY, Picture, Sheet, Stroke};
use crate::reduce::{Point, RampStage, quantile};

const PANEL: (f64, f64) = (540.0, 330.0);
const LOWER_HEIGHT: f64 = 230.0;
const GAP: f64 = 42.0;
/// What either stage of the ramp is called, and its ink.
const STAGES: [(RampStage, &str, Ink); 2] =
    [(RampStage::Up, "way there", INKS[0]), (RampStage::Down, "way back", INKS[1])];
const LINE: Stroke = Stroke::solid(LIGHT_GREY, 1.4);
/// Share of the intervals at either end that the axis of the medians leaves out.
const RARE: f64 = 0.02;
/// Bins of the modulation, and least intervals in one that has a median.
const BINS: u32 = 16;
const LEAST_INTERVALS: usize = 8;
/// Distance of the medians of the two ways from the middle of their bin, in its widths.
const ASIDE: f64 = 0.12;

/// A slip under a ramp, in SI.
#[derive(Clone, Copy, Debug)]
struct Slip {
    stage: RampStage,
    /// T or Δ at the onset.
    modulation: f64,
    period: f64,
    interval: f64,
}

/// Draws interval against period at the onset, or against amplitude if it is the amplitude alone that is ramped.
///
/// # Errors
/// When no point lies on a ramp.
pub fn drag(points: &[Point]) -> Result<Picture, FigureError> {
    const NAME: &str = "drag";
    let on_ramp = || points.iter().filter(|point| matches!(point.ramp_stage, Some(RampStage::Up | RampStage::Down)));
    let empty = FigureError::Empty { figure: NAME, what: "intervals on a ramp of the modulation" };
    let periods = bounds(on_ramp().filter_map(|point| point.period));
    let is_period = periods.is_some_and(|(low, high)| high > low);
    let slips: Vec<Slip> = on_ramp()
        .filter_map(|point| {
            let (stage, period, interval) = (point.ramp_stage?, point.period?, point.interval?);
            Some(Slip { stage, modulation: if is_period { period } else { point.amplitude }, period, interval })
        })
        .collect();
    let (Some((low, high)), Some((shortest, longest))) =
        (bounds(slips.iter().map(|slip| slip.modulation)), bounds(slips.iter().map(|slip| slip.interval)))
    else {
        return Err(empty);
    };
    let label = if is_period { "Modulation period T at the onset (s)" } else { "Amplitude Δ at the onset (m)" };
    let margin = 0.03 * (high - low);
    let x = Axis::linear(label, low - margin, high + margin);
    let mut ratios: Vec<f64> = slips.iter().map(|slip| slip.interval / slip.period).collect();
    ratios.sort_by(f64::total_cmp);
    let [Some(least), Some(most)] = [RARE, 1.0 - RARE].map(|share| quantile(&ratios, share)) else { return Err(empty) };

    let mut sheet = Sheet::new(NAME, (LEFT + PANEL.0 + LEGEND, ABOVE + PANEL.1 + GAP + LOWER_HEIGHT + UNDER));
    let span = 0.04 * (longest - shortest);
    let upper = Frame {
        left: LEFT,
        top: ABOVE,
        width: PANEL.0,
        height: PANEL.1,
        x: x.clone(),
        y: Axis::linear("Slip interval τ (s)", shortest - span, longest + span),
    };
    let lower = Frame {
        top: ABOVE + PANEL.1 + GAP,
        height: LOWER_HEIGHT,
        x,
        y: Axis::linear("Median interval in periods, τ/T", least - 0.3, most + 0.3),
        ..upper
    };
    let highest = ratios.last().copied().unwrap_or(most);
    let multiples = || (1..).map(f64::from).take_while(|&n| n < highest + 0.5);
    draw_intervals(&mut sheet, &upper, &slips, multiples(), is_period);
    draw_medians(&mut sheet, &lower, &slips, multiples(), (low, high));
    lower.x_label(&mut sheet);
    let mut entries: Vec<_> = STAGES.map(|(_, name, ink)| (Mark::Dot(slip_dot(ink)), format!("slips, {name}"))).into();
    entries.extend(STAGES.map(|(_, name, ink)| (Mark::Line(quartiles(ink)), format!("quartiles, {name}"))));
    entries.push((Mark::Line(LINE), "τ = nT".to_owned()));
    lower.legend(&mut sheet, LegendPlace::Beside, &entries);
    Ok(sheet.finish())
}

const fn slip_dot(ink: Ink) -> Dot {
    Dot { ink, radius: 2.0, opacity: 0.45 }
}

const fn quartiles(ink: Ink) -> Stroke {
    Stroke::solid(ink, 2.0)
}

/// Slips over the lines τ = nT, which are curves in T and level in Δ.
fn draw_intervals(
    sheet: &mut Sheet,
    frame: &Frame,
    slips: &[Slip],
    multiples: impl Iterator<Item = f64>,
    is_period: bool,
) {
    let period = slips.first().map_or(0.0, |slip| slip.period);
    let ends = [frame.x.low, frame.x.high];
    let mut labels = Vec::new();
    frame.clipped(sheet, |sheet| {
        for n in multiples {
            let line = ends.map(|end| (end, n * if is_period { end } else { period }));
            frame.curve(sheet, line, LINE);
            labels.push((n, line));
        }
        // Slip by slip, so that neither way covers the other.
        for slip in slips {
            for (_, _, ink) in STAGES.iter().filter(|(stage, ..)| *stage == slip.stage) {
                frame.points(sheet, [(slip.modulation, slip.interval)], slip_dot(ink));
            }
        }
    });
    frame.axes(sheet, false);
    frame.y_label(sheet);
    // Where a line leaves the frame, at its right or upper edge.
    for (n, [(left, start), (right, end)]) in labels {
        let top = frame.y.high;
        let text = format!("n = {n}");
        if frame.y.holds(end) {
            sheet.text((frame.x_of(right) + 6.0, frame.y_of(end) + 5.0), &text, 14, Anchor::Start);
        } else if end > top && start < top {
            let x = left + (right - left) * (top - start) / (end - start);
            sheet.text((frame.x_of(x), frame.y_of(top) - 5.0), &text, 14, Anchor::Middle);
        }
    }
}

/// Medians and quartiles of τ/T, bin by bin, of both ways.
fn draw_medians(
    sheet: &mut Sheet,
    frame: &Frame,
    slips: &[Slip],
    multiples: impl Iterator<Item = f64>,
    (low, high): (f64, f64),
) {
    let width = (high - low) / f64::from(BINS);
    frame.clipped(sheet, |sheet| {
        for n in multiples {
            frame.curve(sheet, [(frame.x.low, n), (frame.x.high, n)], LINE);
        }
        for ((stage, _, ink), side) in STAGES.into_iter().zip([-ASIDE, ASIDE]) {
            for bin in 0..BINS {
                let start = low + f64::from(bin) * width;
                let is_last = bin + 1 == BINS;
                let within = |slip: &&Slip| {
                    slip.stage == stage && slip.modulation >= start && (is_last || slip.modulation < start + width)
                };
                let mut ratios: Vec<f64> =
                    slips.iter().filter(within).map(|slip| slip.interval / slip.period).collect();
                ratios.sort_by(f64::total_cmp);
                let [first, median, third] = [0.25, 0.5, 0.75].map(|share| quantile(&ratios, share));
                if let (Some(first), Some(median), Some(third)) = (first, median, third)
                    && ratios.len() >= LEAST_INTERVALS
                {
                    let x = start + (0.5 + side) * width;
                    frame.curve(sheet, [(x, first), (x, third)], quartiles(ink));
                    frame.points(sheet, [(x, median)], Dot { ink, radius: 4.5, opacity: 1.0 });
                }
            }
        }
    });
    frame.axes(sheet, true);
    frame.y_label(sheet);
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
            is_locked: true,
        }
    }

    #[test]
    fn both_stages_are_drawn_and_what_comes_after_is_not() {
        let on = |stage, n| (0..200).map(move |step| point(Some(stage), 0.03 + 5e-5 * f64::from(step), n));
        let points: Vec<Point> = on(RampStage::Up, 4.0).chain(on(RampStage::Down, 3.0)).collect();
        let svg = drag(&points).unwrap().svg();
        for text in ["n = 3", "n = 4", "way there", "way back", "τ/T"] {
            assert!(svg.contains(text), "{text}");
        }
        let after: Vec<Point> = on(RampStage::After, 4.0).chain([point(None, 0.03, 4.0)]).collect();
        assert!(matches!(drag(&after), Err(FigureError::Empty { .. })));
    }

    #[test]
    fn a_ramp_of_the_amplitude_alone_is_drawn_over_the_amplitude() {
        let ramped = |step: u32| Point { amplitude: 1e-8 * f64::from(step), ..point(Some(RampStage::Up), 0.03, 4.0) };
        let svg = drag(&(0..100).map(ramped).collect::<Vec<_>>()).unwrap().svg();
        assert!(svg.contains("Amplitude Δ at the onset"));
    }
}
