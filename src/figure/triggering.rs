//! Triggering: how much earlier slips come after a pulse, against where in the cycle it begins, a panel for each
//! amplitude; and the share of triggered slips against the amplitude. Both beside the drive alone.

use super::axis::{Axis, bounds, widened};
use super::common;
use super::frame::{Ends, LEFT, Layout};
use super::legend::{LegendEntry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::quantity::axis_of;
use super::style::{
    BAR_WIDTH, BLACK, Dot, INKS, Look, RADIUS, REFERENCE, SHAPES, Stroke, drive_alone,
};
use crate::model::{Parameters, Symbol};
use crate::reduce::{Interval, PulseRow, ascending};
use crate::sets::{Digits, label};

pub(super) const NAME: &str = "triggering";

const WIDTH: f64 = 290.0;
const HEIGHT: f64 = 230.0;
const COLUMNS: usize = 2;
const GAP: f64 = 20.0;
/// Panels of amplitudes, at most.
const MAX_AMPLITUDES: usize = 5;
/// A mean at some place: as seen, and by the drive alone.
struct Mean {
    x: f64,
    seen: f64,
    interval: Option<Interval>,
    by_drive: f64,
}

impl Mean {
    fn bar(&self) -> Option<(f64, Ends)> {
        self.interval.map(|ends| (self.x, (ends.low, ends.high)))
    }
}

struct DelayCurve {
    dot: Dot,
    means: Vec<Mean>,
}

impl DelayCurve {
    fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let bars = self.means.iter().filter_map(Mean::bar);
        let ends = bars.flat_map(|(_, (low, high))| [low, high]);
        let means = self.means.iter();
        let values = means.flat_map(|mean| [mean.seen, mean.by_drive]);
        values.chain(ends)
    }

    fn layers<'a>(self) -> [Layer<'a>; 3] {
        let means = || self.means.iter();
        let bars = means().filter_map(Mean::bar).collect();
        // One point makes no curve.
        let by_drive = if let [mean] = &self.means[..] {
            Layer::Level(mean.by_drive, drive_alone(self.dot.ink))
        } else {
            let places = means().map(|mean| (mean.x, mean.by_drive));
            Layer::Curve(places.collect(), drive_alone(self.dot.ink))
        };
        let dots = means().map(|mean| (mean.x, mean.seen)).collect();
        [
            by_drive,
            Layer::Bars(bars, Stroke::solid(self.dot.ink, BAR_WIDTH)),
            Layer::Dots(dots, self.dot),
        ]
    }
}

/// `None` without pulses, or if they differ in more than where they begin, amplitude and period.
pub(super) fn triggering(rows: &[PulseRow], look: &Look) -> Option<Picture> {
    let whole = || rows.iter().filter(|row| row.is_of_whole_cycle());
    let value = |row: &PulseRow, symbol| row.pulse().get(symbol).number();
    let values = |symbol| ascending(whole().filter_map(|row| value(row, symbol)));
    let amplitudes = values(Symbol::Delta);
    // By frequency, as elsewhere.
    let periods: Vec<f64> = values(Symbol::T).into_iter().rev().collect();
    let control = |row: &PulseRow| row.pulse().without_modulation();
    let mut pairs = whole().zip(whole().skip(1));
    let is_one = values(Symbol::PulseCycles).len() == 1
        && pairs.all(|(one, next)| control(one) == control(next));
    if !is_one || periods.len() > INKS.len() || amplitudes.len() > MAX_AMPLITUDES {
        return None;
    }
    let is_of = |row: &&PulseRow, amplitude: f64, period: f64| {
        let own = [Symbol::Delta, Symbol::T].map(|symbol| value(row, symbol));
        own == [Some(amplitude), Some(period)]
    };
    let marks = || {
        let shaped = INKS.into_iter().zip(SHAPES);
        let dots = shaped.map(|(ink, shape)| Dot::solid(ink, RADIUS).with_shape(shape));
        periods.iter().copied().zip(dots)
    };
    let responses = |amplitude: f64| {
        let series = marks().map(|(period, dot)| {
            let own = rows.iter().filter(|row| is_of(row, amplitude, period));
            let parts = own.filter(|row| !row.is_of_whole_cycle());
            let of_parts = parts.filter_map(|row| {
                Some(Mean {
                    x: 0.5 * (row.place_low + row.place_high),
                    seen: row.advance_mean?,
                    interval: row.advance_interval,
                    by_drive: row.advance_drive?,
                })
            });
            let means = of_parts.collect();
            DelayCurve { dot, means }
        });
        series.collect::<Vec<_>>()
    };
    let responses: Vec<Vec<DelayCurve>> = amplitudes.iter().map(|&each| responses(each)).collect();
    let (low, high) = widened(bounds(
        responses.iter().flatten().flat_map(DelayCurve::values),
    )?);
    let advance = Axis::linear("Advance / ⟨τ⟩", low, high);
    let place = Axis::linear("Place in the cycle p", 0.0, 1.0);
    let amplitude = label(Symbol::Delta.key());
    let panel = |(series, value): (Vec<DelayCurve>, &f64)| {
        let layers = series.into_iter().flat_map(DelayCurve::layers);
        let layers = [Layer::Level(0.0, REFERENCE)].into_iter().chain(layers);
        let mut panel = Panel::inside(HEIGHT, place.clone(), advance.clone(), layers);
        panel.heading = Some(amplitude.setting(*value, Digits::THREE));
        panel
    };
    let mut panels: Vec<Panel<'_>> = responses.into_iter().zip(&amplitudes).map(panel).collect();
    let (x_label, factor) = axis_of(Symbol::Delta.key(), amplitudes.iter().copied());
    let shares = marks().map(|(period, dot)| {
        let places = amplitudes.iter();
        let shares = places.filter_map(|&amplitude| {
            let row = whole().find(|row| is_of(row, amplitude, period))?;
            Some(Mean {
                x: factor * amplitude,
                seen: row.triggered_share,
                interval: row.triggered_interval,
                by_drive: row.triggered_drive,
            })
        });
        let means = shares.collect();
        DelayCurve { dot, means }
    });
    let curves: Vec<DelayCurve> = shares.collect();
    let most = curves
        .iter()
        .flat_map(DelayCurve::values)
        .fold(0.0, f64::max);
    let x = Axis::of_data(&x_label, amplitudes.iter().map(|value| factor * value))?;
    let y = Axis::linear("Share of triggered slips", 0.0, 1.05 * most.max(0.01));
    let mut last = Panel::inside(
        HEIGHT,
        x,
        y,
        curves.into_iter().flat_map(DelayCurve::layers),
    );
    last.heading = Some("within the pulse, later without it".to_owned());
    panels.push(last);
    let frequency = label("frequency");
    let periods = marks().map(|(period, dot)| {
        let text = frequency.setting(1.0 / period, Digits::THREE);
        entry(Mark::Bar(dot), text)
    });
    let drive = entry(Mark::Line(drive_alone(BLACK)), "by the drive alone");
    let zero = entry(Mark::Line(REFERENCE), "no advance");
    let legend: Vec<LegendEntry> = periods.chain([drive, zero]).collect();
    let layout = Layout {
        columns: COLUMNS.min(panels.len()),
        column_gap: LEFT + GAP,
        ..Layout::column(WIDTH)
    };
    let pulses: Vec<Parameters> = whole().map(PulseRow::pulse).collect();
    let shared = common(pulses.iter(), &[]);
    let noted = look.with_note(&format!("{shared}; bars: 95 % over seeds"));
    Some(panel::draw(NAME, &noted, layout, &legend, panels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drive_alone_is_drawn_for_one_amplitude_too() {
        for amplitudes in 1..4 {
            let mean = |place| Mean {
                x: f64::from(place),
                seen: 0.4,
                interval: None,
                by_drive: 0.1,
            };
            let series = DelayCurve {
                dot: Dot::solid(INKS[0], RADIUS),
                means: (0..amplitudes).map(mean).collect(),
            };
            match &series.layers()[0] {
                Layer::Level(value, _) => assert_eq!((*value, amplitudes), (0.1, 1)),
                Layer::Curve(places, _) => assert!(places.len() > 1, "no line"),
                _ => panic!("the drive alone is a line"),
            }
        }
    }
}
