//! Triggering: how much earlier slips come after a pulse, against where in the cycle it begins, a panel for each
//! amplitude; and the share of triggered slips against the amplitude. Both beside the drive alone.

use super::axis::{Axis, bounds, widened};
use super::frame::{Ends, LEFT, Layout};
use super::legend::{Entry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::quantity::axis_of;
use super::style::{
    BAR_WIDTH, BLACK, Dot, INKS, Ink, Look, RADIUS, REFERENCE, Stroke, drive_alone,
};
use crate::model::Symbol;
use crate::reduce::{Mean, Pulses, TriggerRow, ascending};
use crate::sets::{Digits, label};

pub(super) const NAME: &str = "triggering";

const WIDTH: f64 = 290.0;
const HEIGHT: f64 = 230.0;
const COLUMNS: usize = 2;
const GAP: f64 = 20.0;
/// Panels of amplitudes, at most.
const MAX_AMPLITUDES: usize = 5;
/// Bins of the place in the cycle.
const BINS: u32 = 10;

/// Means at some places: as seen, with their intervals, and by the drive alone.
struct Series {
    ink: Ink,
    means: Vec<(f64, [Mean; 3])>,
}

impl Series {
    fn bars(&self) -> impl Iterator<Item = (f64, Ends)> + '_ {
        let means = self.means.iter();
        means
            .filter_map(|&(x, [(_, interval), ..])| interval.map(|ends| (x, (ends.low, ends.high))))
    }

    fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let bars = self.bars().flat_map(|(_, (low, high))| [low, high]);
        let means = self.means.iter();
        let means = means.flat_map(|(_, [seen, by_drive, _])| [seen.0, by_drive.0]);
        means.chain(bars)
    }

    fn layers<'a>(self) -> [Layer<'a>; 3] {
        let places = |which: usize| {
            let means = self.means.iter();
            means.map(|(x, means)| (*x, means[which].0)).collect()
        };
        let bars = self.bars().collect();
        let by_drive = match self.means[..] {
            // A curve through one point is none.
            [(_, [_, (value, _), _])] => Layer::Level(value, drive_alone(self.ink)),
            _ => Layer::Curve(places(1), drive_alone(self.ink)),
        };
        [
            by_drive,
            Layer::Bars(bars, Stroke::solid(self.ink, BAR_WIDTH)),
            Layer::Dots(places(0), Dot::solid(self.ink, RADIUS)),
        ]
    }
}

/// `None` if no job says what its pulse did, or they differ in more than where it begins, amplitude and period.
pub(super) fn triggering(rows: &[TriggerRow], look: &Look) -> Option<Picture> {
    let all = Pulses::of(rows);
    let value = |pulses: &Pulses<'_>, symbol| pulses.parameters.get(symbol).number();
    let values = |symbol| ascending(all.iter().filter_map(|pulses| value(pulses, symbol)));
    let amplitudes = values(Symbol::Delta);
    // High frequencies first.
    let periods = values(Symbol::T);
    let control = |pulses: &Pulses<'_>| pulses.parameters.without_modulation();
    let mut pairs = all.iter().zip(all.iter().skip(1));
    let is_one = values(Symbol::PulseCycles).len() == 1
        && pairs.all(|(one, next)| control(one) == control(next));
    if !is_one || periods.len() > INKS.len() || amplitudes.len() > MAX_AMPLITUDES {
        return None;
    }
    let of = |amplitude: f64, period: f64| {
        all.iter().find(|pulses| {
            let own = [Symbol::Delta, Symbol::T].map(|symbol| value(pulses, symbol));
            own == [Some(amplitude), Some(period)]
        })
    };
    let inks = || periods.iter().copied().zip(INKS);
    let responses = |amplitude: f64| {
        let series = inks().map(|(period, ink)| {
            let bins = (0..BINS).filter_map(|bin| {
                let [low, high] = [bin, bin + 1].map(|edge| f64::from(edge) / f64::from(BINS));
                let pulses = of(amplitude, period)?.between(low, high);
                Some((0.5 * (low + high), pulses.advances()?))
            });
            let means = bins.collect();
            Series { ink, means }
        });
        series.collect::<Vec<_>>()
    };
    let responses: Vec<Vec<Series>> = amplitudes.iter().map(|&each| responses(each)).collect();
    let (low, high) = widened(bounds(responses.iter().flatten().flat_map(Series::values))?);
    let advance = Axis::linear("Advance / ⟨τ⟩", low, high);
    let place = Axis::linear("Place in the cycle p", 0.0, 1.0);
    let amplitude = label(Symbol::Delta.key());
    let panel = |(series, value): (Vec<Series>, &f64)| {
        let layers = series.into_iter().flat_map(Series::layers);
        let layers = [Layer::Level(0.0, REFERENCE)].into_iter().chain(layers);
        let mut panel = Panel::inside(HEIGHT, place.clone(), advance.clone(), layers);
        panel.heading = Some(amplitude.setting(*value, Digits::THREE));
        panel
    };
    let mut panels: Vec<Panel<'_>> = responses.into_iter().zip(&amplitudes).map(panel).collect();
    let (x_label, factor) = axis_of(Symbol::Delta.key(), amplitudes.iter().copied());
    let shares = inks().map(|(period, ink)| {
        let places = amplitudes.iter();
        let shares = places.filter_map(|&amplitude| {
            let means = of(amplitude, period)?.triggered()?;
            Some((factor * amplitude, means))
        });
        let means = shares.collect();
        Series { ink, means }
    });
    let shares: Vec<Series> = shares.collect();
    let most = shares.iter().flat_map(Series::values).fold(0.0, f64::max);
    let x = Axis::of_data(&x_label, amplitudes.iter().map(|value| factor * value))?;
    let y = Axis::linear("Share of triggered slips", 0.0, 1.05 * most.max(0.01));
    let mut last = Panel::inside(HEIGHT, x, y, shares.into_iter().flat_map(Series::layers));
    last.heading = Some("within the pulse, later without it".to_owned());
    panels.push(last);
    let frequency = label("frequency");
    let legend = inks().map(|(period, ink)| {
        let text = frequency.setting(1.0 / period, Digits::THREE);
        entry(Mark::Bar(Dot::solid(ink, RADIUS)), text)
    });
    let drive = entry(Mark::Line(drive_alone(BLACK)), "by the drive alone");
    let legend: Vec<Entry> = legend.chain([drive]).collect();
    let layout = Layout {
        columns: COLUMNS.min(panels.len()),
        column_gap: LEFT + GAP,
        ..Layout::column(WIDTH)
    };
    let look = look.with_note("bars: 95 % over seeds");
    Some(panel::draw(NAME, &look, layout, &legend, panels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drive_alone_is_drawn_for_one_amplitude_too() {
        for amplitudes in 1..4 {
            let mean = |value: f64| (value, None);
            let means = [mean(0.4), mean(0.1), mean(0.3)];
            let series = Series {
                ink: INKS[0],
                means: (0..amplitudes)
                    .map(|number| (f64::from(number), means))
                    .collect(),
            };
            match &series.layers()[0] {
                Layer::Level(value, _) => assert_eq!((*value, amplitudes), (0.1, 1)),
                Layer::Curve(places, _) => assert!(places.len() > 1, "no line"),
                _ => panic!("the drive alone is a line"),
            }
        }
    }
}
