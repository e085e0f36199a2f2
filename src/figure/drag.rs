//! Drag: τ on a ramp of the modulation, as it rises and as it falls, with the lines τ = nT, and τ/T in bins.

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
/// The stages of the ramp and their large dots.
const STAGES: [(RampStage, Dot); 2] = [
    (RampStage::Up, Dot::solid(INKS[0], RADIUS)),
    (
        RampStage::Down,
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
    /// In s.
    onset: f64,
    /// T or Δ at the onset.
    x: f64,
    tau: f64,
    /// τ/T.
    ratio: f64,
}

/// The line τ = nT.
struct Multiple {
    n: f64,
    /// Where it begins and ends.
    ends: [(f64, f64); 2],
}

/// What the figure shows, in the units of the axes.
struct Ramp {
    slips: Vec<RampedSlip>,
    /// T or Δ.
    symbol: &'static str,
    x_label: String,
    tau_label: String,
    x: Ends,
    tau: Ends,
    ratio: Ends,
    /// All that may lie among the slips.
    multiples: Vec<Multiple>,
}

/// The slips on a ramp, by the period at the onset, or by the amplitude if it is the amplitude alone that is ramped;
/// `None` if none has an interval.
fn ramp(points: &[Point]) -> Option<Ramp> {
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
    let (column, symbol) = if is_period {
        ("T", "T")
    } else {
        ("Delta", "Δ")
    };
    let (x_label, x_factor) = axis_of(column, ramped().filter_map(modulation));
    let longest = bounds(ramped().filter_map(|point| point.interval))?.1;
    let (factor, unit) = label("tau_mean").scale(longest);
    let slip = |point: &Point| {
        Some(RampedSlip {
            stage: stage(point)?,
            onset: point.onset,
            x: x_factor * modulation(point)?,
            tau: factor * point.interval?,
            ratio: point.interval? / point.period?,
        })
    };
    let slips: Vec<RampedSlip> = ramped().filter_map(slip).collect();
    let x = widened(bounds(slips.iter().map(|slip| slip.x))?);
    let tau = widened(bounds(slips.iter().map(|slip| slip.tau))?);
    let ratios = ratios(slips.iter());
    let ratio = (quantile(&ratios, RARE)?, quantile(&ratios, 1.0 - RARE)?);
    let largest = *ratios.last()?;
    // τ = nT is a curve in T, and level in Δ.
    let period = ramped().find_map(|point| point.period)?;
    let period_at = |at: f64| if is_period { at / x_factor } else { period };
    let multiple = |n: f64| Multiple {
        n,
        ends: [x.0, x.1].map(|at| (at, n * factor * period_at(at))),
    };
    let whole = (1..=u32::MAX).map(f64::from);
    let multiples = whole.take_while(|n| *n < largest + 0.5).map(multiple);
    Some(Ramp {
        multiples: multiples.collect(),
        slips,
        symbol,
        x_label,
        tau_label: format!("Slip interval τ ({unit})"),
        x,
        tau,
        ratio,
    })
}

impl Ramp {
    /// Whether the modulation rises along a stage.
    fn rises(&self, stage: usize) -> bool {
        let of_stage = || self.slips.iter().filter(|slip| slip.stage == stage);
        let order = |left: &&RampedSlip, right: &&RampedSlip| left.onset.total_cmp(&right.onset);
        let first = of_stage().min_by(order);
        let last = of_stage().max_by(order);
        first
            .zip(last)
            .is_some_and(|(first, last)| last.x > first.x)
    }

    /// Where lines leave the frame, at its right or through its top, with their numbers.
    fn ends_of_lines(&self) -> Vec<(f64, (f64, f64))> {
        let (low, high) = self.tau;
        let end = |multiple: &Multiple| {
            let [(left, first), (right, last)] = multiple.ends;
            let share = ((high - first) / (last - first)).min(1.0);
            (first < high && last > low)
                .then(|| (multiple.n, (left + share * (right - left), last.min(high))))
        };
        self.multiples.iter().filter_map(end).collect()
    }

    /// Quartiles of τ/T in bins of the modulation, of both stages.
    fn quartiles(&self) -> Vec<Quartiles> {
        let Some((low, high)) = bounds(self.slips.iter().map(|slip| slip.x)) else {
            return Vec::new();
        };
        let width = (high - low) / f64::from(BINS);
        let bins = |stage: usize| (0..BINS).map(move |bin| (stage, bin));
        let of_bin = |(stage, bin): (usize, u32)| {
            let start = low + f64::from(bin) * width;
            let is_last = bin + 1 == BINS;
            let end = if is_last {
                f64::INFINITY
            } else {
                start + width
            };
            let is_in_bin =
                |slip: &&RampedSlip| slip.stage == stage && (start..end).contains(&slip.x);
            let ratios = ratios(self.slips.iter().filter(is_in_bin));
            let quartile = |share: f64| quantile(&ratios, share);
            Some(Quartiles {
                stage,
                x: start + (0.5 + OFFSETS[stage]) * width,
                first: quartile(0.25)?,
                median: quartile(0.5)?,
                third: quartile(0.75)?,
            })
            .filter(|_| ratios.len() >= MIN_INTERVALS)
        };
        let all = (0..STAGES.len()).flat_map(bins);
        all.filter_map(of_bin).collect()
    }
}

/// Of the ratios in a bin.
struct Quartiles {
    /// Its place in [`STAGES`].
    stage: usize,
    x: f64,
    first: f64,
    median: f64,
    third: f64,
}

/// Draws the intervals of slips on a ramp, and their ratios to the period; `None` if there are none.
pub(super) fn drag(points: &[Point], look: &Look) -> Option<Picture> {
    let ramp = ramp(points)?;
    let medians = [0, 1].map(|stage| {
        let direction = if ramp.rises(stage) {
            "rising"
        } else {
            "falling"
        };
        let dot = STAGES[stage].1;
        entry(Mark::Bar(dot), format!("{} {direction}", ramp.symbol))
    });
    let lines = entry(Mark::Line(GRID), "τ = nT");
    let entries: Vec<LegendEntry> = medians.into_iter().chain([lines]).collect();
    let x = Axis::linear(&ramp.x_label, ramp.x.0, ramp.x.1);
    let tau = Axis::linear(&ramp.tau_label, ramp.tau.0, ramp.tau.1);
    let lines = ramp.multiples.iter();
    let lines = lines.map(|multiple| Layer::Curve(multiple.ends.into(), GRID));
    // Slip by slip, so that neither stage covers the other.
    let dots = ramp.slips.iter().map(|slip| {
        let dot = Dot {
            radius: SLIP_RADIUS,
            ..STAGES[slip.stage].1.with_opacity(0.45)
        };
        Layer::Dots(vec![(slip.x, slip.tau)], dot)
    });
    let inside = Layer::Inside(lines.chain(dots).collect());
    let upper = vec![inside, numbers(ramp.ends_of_lines())];
    let upper = Panel::new(320.0, x.clone(), tau, upper);
    let (least, most) = ramp.ratio;
    let ratio = Axis::linear("Median and quartiles of τ / T", least - 0.3, most + 0.3);
    let levels = ramp.multiples.iter();
    let levels = levels.map(|multiple| Layer::Level(multiple.n, GRID));
    let bars = ramp.quartiles().into_iter().flat_map(|of_bin| {
        let dot = STAGES[of_bin.stage].1;
        let bar = vec![(of_bin.x, (of_bin.first, of_bin.third))];
        let median = vec![(of_bin.x, of_bin.median)];
        [
            Layer::Bars(bar, Stroke::solid(dot.ink, 2.0)),
            Layer::Dots(median, dot),
        ]
    });
    let lower = Panel::inside(210.0, x, ratio, levels.chain(bars));
    Some(panel::draw(
        NAME,
        look,
        LAYOUT,
        &entries,
        vec![upper, lower],
    ))
}

/// The numbers of lines, where these leave the frame.
fn numbers<'a>(ends_of_lines: Vec<(f64, (f64, f64))>) -> Layer<'a> {
    Layer::Drawn(Box::new(move |sheet, frame| {
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
    }))
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
        let order = [
            on(RampStage::Up, 4.0).collect::<Vec<_>>(),
            on(RampStage::Down, 3.0).rev().collect(),
        ];
        let mut points = order.concat();
        for (point, onset) in points.iter_mut().zip(0..) {
            point.onset = f64::from(onset);
        }
        let svg = drag(&points, &Look::default()).unwrap().svg();
        for text in ["n = 3", "n = 4", "T rising", "T falling", "τ / T"] {
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
