//! Drag: τ on a ramp of the modulation, on the way there and on the way back, with the lines τ = nT, and τ/T in bins.

use super::axis::{Axis, bounds, widened};
use super::frame::{Ends, Layout};
use super::legend::{LegendEntry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::{Anchor, Picture};
use super::quantity::axis_of;
use super::style::{
    Dot, Fill, GRID, INKS, LEGEND_TEXT, Look, RADIUS, SQUARE, Stroke, WHITE, text_width,
};
use crate::reduce::{Point, RampStage, quantile};
use crate::sets::label;

pub(super) const NAME: &str = "drag";

/// Space right of the frames for the numbers of lines.
const NUMBERS: f64 = 66.0;
/// Middle of the numbers of lines that leave through the top, below it.
const BELOW_TOP: f64 = 14.0;
const LAYOUT: Layout = Layout {
    right: NUMBERS,
    ..Layout::column(520.0)
};
/// The stages of the ramp, their names and large dots.
const STAGES: [(RampStage, &str, Dot); 2] = [
    (RampStage::Up, "there", Dot::solid(INKS[0], RADIUS)),
    (
        RampStage::Down,
        "back",
        Dot::solid(INKS[1], RADIUS).with_shape(Some(SQUARE)),
    ),
];
/// Of the dot of a slip.
const SLIP_RADIUS: f64 = 2.0;
/// Share of the intervals at either end that the axis of the medians leaves out.
const RARE: f64 = 0.02;
/// Bins of the modulation, and least intervals in one that has a median.
const BINS: u32 = 16;
const MIN_INTERVALS: usize = 8;
/// Places of the medians of the stages, from the middle of their bin in its widths.
const OFFSETS: [f64; 2] = [-0.12, 0.12];

/// A slip under a ramp, in the units of the axes.
struct RampedSlip {
    /// Its place in [`STAGES`].
    stage: usize,
    /// T or Δ at the onset.
    x: f64,
    tau: f64,
    /// τ/T.
    ratio: f64,
}

/// Draws interval against period at the onset, or against amplitude if it is the amplitude alone that is ramped; `None`
/// if no slip has an interval on a ramp.
pub(super) fn drag(points: &[Point], look: &Look) -> Option<Picture> {
    let stage = |point: &Point| {
        let mut stages = STAGES.iter();
        stages.position(|(stage, ..)| point.ramp_stage == Some(*stage))
    };
    let is_ramped = |point: &&Point| stage(point).is_some() && point.interval.is_some();
    let ramped = || points.iter().filter(is_ramped);
    let periods = bounds(ramped().filter_map(|point| point.period));
    let is_period = periods.is_some_and(|(low, high)| high > low);
    let amplitude = |point: &Point| Some(point.amplitude).filter(|_| !is_period);
    let modulation = |point: &Point| amplitude(point).or(point.period);
    let column = if is_period { "T" } else { "Delta" };
    let (x_label, x_factor) = axis_of(column, ramped().filter_map(modulation));
    let longest = bounds(ramped().filter_map(|point| point.interval))?.1;
    let (factor, unit) = label("tau_mean").scale(longest);
    let slip = |point: &Point| {
        Some(RampedSlip {
            stage: stage(point)?,
            x: x_factor * modulation(point)?,
            tau: factor * point.interval?,
            ratio: point.interval? / point.period?,
        })
    };
    let slips: Vec<RampedSlip> = ramped().filter_map(slip).collect();
    let ends = bounds(slips.iter().map(|slip| slip.x))?;
    let taus = widened(bounds(slips.iter().map(|slip| slip.tau))?);
    let ratios = ratios(slips.iter());
    let [least, most] = [quantile(&ratios, RARE)?, quantile(&ratios, 1.0 - RARE)?];
    let largest = *ratios.last()?;
    let whole = (1..=u32::MAX).map(f64::from);
    let multiples = || whole.clone().take_while(|&n| n < largest + 0.5);

    let (low, high) = widened(ends);
    let x = Axis::linear(&x_label, low, high);
    let medians = STAGES.map(|(_, name, dot)| entry(Mark::Bar(dot), name));
    let lines = entry(Mark::Line(GRID), "τ = nT");
    let entries: Vec<LegendEntry> = medians.into_iter().chain([lines]).collect();
    // τ = nT is a curve in T, and level in Δ.
    let period = ramped().find_map(|point| point.period)?;
    let period_at = |at: f64| if is_period { at / x_factor } else { period };
    let line = |n: f64| [low, high].map(|at| (at, n * factor * period_at(at)));
    // Slip by slip, so that neither stage covers the other.
    let dots = slips.iter().map(|slip| {
        let dot = Dot {
            radius: SLIP_RADIUS,
            ..STAGES[slip.stage].2.with_opacity(0.45)
        };
        Layer::Dots(vec![(slip.x, slip.tau)], dot)
    });
    // Where lines leave the frame: at its right, or through its top.
    let end = |n: f64| {
        let [(_, first), (right, last)] = line(n);
        let share = ((taus.1 - first) / (last - first)).min(1.0);
        (first < taus.1 && last > taus.0)
            .then(|| (n, (low + share * (right - low), last.min(taus.1))))
    };
    let ends_of_lines: Vec<_> = multiples().filter_map(end).collect();
    let numbers = Layer::Drawn(Box::new(move |sheet, frame| {
        for (n, end) in ends_of_lines {
            let (x, y) = frame.place(end);
            let left = x + 6.0;
            let middle = y.max(frame.top + BELOW_TOP);
            let text = format!("n = {n}");
            // No line strikes it through.
            let height = f64::from(LEGEND_TEXT);
            let ground = [
                left,
                middle - 0.5 * height,
                text_width(&text, LEGEND_TEXT),
                height,
            ];
            sheet.rectangle(
                ground,
                Fill {
                    ink: WHITE,
                    opacity: 1.0,
                },
            );
            sheet.centred_text((left, middle), &text, LEGEND_TEXT, Anchor::Start);
        }
    }));
    let lines = multiples().map(|n| Layer::Curve(line(n).into(), GRID));
    let lines = Layer::Inside(lines.chain(dots).collect());
    let tau = Axis::linear(&format!("Slip interval τ ({unit})"), taus.0, taus.1);
    let upper = Panel::new(320.0, x.clone(), tau, vec![lines, numbers]);
    let ratio = Axis::linear("Median and quartiles of τ / T", least - 0.3, most + 0.3);
    let levels = multiples().map(|n| Layer::Level(n, GRID));
    let lower = Panel::inside(210.0, x, ratio, levels.chain(medians_of(&slips, ends)));
    let panels = vec![upper, lower];
    Some(panel::draw(NAME, look, LAYOUT, &entries, panels))
}

/// Medians and quartiles of τ/T in bins of the modulation, of both stages.
fn medians_of<'a>(slips: &[RampedSlip], (low, high): Ends) -> Vec<Layer<'a>> {
    let width = (high - low) / f64::from(BINS);
    let mut layers = Vec::new();
    for (stage, (_, _, dot)) in STAGES.into_iter().enumerate() {
        for bin in 0..BINS {
            let start = low + f64::from(bin) * width;
            let is_last = bin + 1 == BINS;
            let end = if is_last {
                f64::INFINITY
            } else {
                start + width
            };
            let is_in_bin =
                |slip: &&RampedSlip| slip.stage == stage && (start..end).contains(&slip.x);
            let of_bin = ratios(slips.iter().filter(is_in_bin));
            let quartiles = [0.25, 0.5, 0.75].map(|share| quantile(&of_bin, share));
            if let [Some(first), Some(median), Some(third)] = quartiles
                && of_bin.len() >= MIN_INTERVALS
            {
                let x = start + (0.5 + OFFSETS[stage]) * width;
                let stroke = Stroke::solid(dot.ink, 2.0);
                layers.push(Layer::Bars(vec![(x, (first, third))], stroke));
                layers.push(Layer::Dots(vec![(x, median)], dot));
            }
        }
    }
    layers
}

/// τ/T of some slips, ascending.
fn ratios<'a>(slips: impl Iterator<Item = &'a RampedSlip>) -> Vec<f64> {
    let mut ratios: Vec<f64> = slips.map(|slip| slip.ratio).collect();
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
            ramp_stage,
            interval: Some(n * period),
            periods: Some(4),
            ..Point::default()
        }
    }

    #[test]
    fn both_stages_of_the_ramp_are_drawn_and_what_comes_after_is_not() {
        let on = |stage, n| {
            (0..200).map(move |step| point(Some(stage), 0.03 + 5e-5 * f64::from(step), n))
        };
        let points: Vec<Point> = on(RampStage::Up, 4.0)
            .chain(on(RampStage::Down, 3.0))
            .collect();
        let svg = drag(&points, &Look::default()).unwrap().svg();
        for text in ["n = 3", "n = 4", "there", "back", "τ / T"] {
            assert!(svg.contains(text), "{text}");
        }
        let after: Vec<Point> = on(RampStage::After, 4.0)
            .chain([point(None, 0.03, 4.0)])
            .collect();
        assert!(drag(&after, &Look::default()).is_none());
    }

    #[test]
    fn a_ramp_of_the_amplitude_alone_is_drawn_over_the_amplitude() {
        let ramped = |step: u32| Point {
            amplitude: 1e-8 * f64::from(step),
            ..point(Some(RampStage::Up), 0.03, 4.0)
        };
        let svg = drag(&(0..100).map(ramped).collect::<Vec<_>>(), &Look::default())
            .unwrap()
            .svg();
        assert!(svg.contains(">Amplitude Δ (µm)<"));
    }
}
