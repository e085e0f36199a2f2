//! Triggering: how much earlier slips come after a pulse, against where in the cycle it begins, a panel for each
//! amplitude; and the share of triggered slips against the amplitude. Both beside the drive alone.

use super::axis::{Axis, bounds, widened};
use super::frame::{Ends, LEFT, Layout, Place};
use super::legend::{Entry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::quantity::axis_of;
use super::style::{
    BAR_WIDTH, BLACK, Dot, INKS, Ink, Look, RADIUS, REFERENCE, Stroke, drive_alone,
};
use crate::model::Symbol;
use crate::reduce::{Interval, Pulses, TriggerRow, ascending};
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

/// Means at some places, with their intervals, and those of the drive alone.
struct Series {
    ink: Ink,
    dots: Vec<Place>,
    bars: Vec<(f64, Ends)>,
    by_drive: Vec<Place>,
}

impl Series {
    fn new(ink: Ink) -> Self {
        Self {
            ink,
            dots: Vec::new(),
            bars: Vec::new(),
            by_drive: Vec::new(),
        }
    }

    /// Adds the means over some pulses of what is seen and what the drive alone gives.
    fn add(
        &mut self,
        x: f64,
        pulses: &Pulses<'_>,
        seen: impl Fn(&TriggerRow) -> Option<f64>,
        by_drive: impl Fn(&TriggerRow) -> Option<f64>,
    ) {
        let (mean, interval) = pulses.mean(seen);
        self.dots.extend(mean.map(|mean| (x, mean)));
        self.bars
            .extend(interval.map(|Interval { low, high }| (x, (low, high))));
        let (mean, _) = pulses.mean(by_drive);
        self.by_drive.extend(mean.map(|mean| (x, mean)));
    }

    fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let bars = self.bars.iter().flat_map(|(_, (low, high))| [*low, *high]);
        let dots = self.dots.iter().chain(&self.by_drive);
        dots.map(|(_, value)| *value).chain(bars)
    }

    fn layers<'a>(self) -> [Layer<'a>; 3] {
        [
            Layer::Curve(self.by_drive, drive_alone(self.ink)),
            Layer::Bars(self.bars, Stroke::solid(self.ink, BAR_WIDTH)),
            Layer::Dots(self.dots, Dot::solid(self.ink, RADIUS)),
        ]
    }
}

/// `None` if no job says what its pulse did, or they differ in the velocity or in the number of periods.
pub(super) fn triggering(rows: &[TriggerRow], look: &Look) -> Option<Picture> {
    let all = Pulses::of(rows);
    let value = |pulses: &Pulses<'_>, symbol| pulses.rows[0].parameters.get(symbol).number();
    let values = |symbol| ascending(all.iter().filter_map(|pulses| value(pulses, symbol)));
    let amplitudes = values(Symbol::Delta);
    let periods = values(Symbol::T);
    let is_one = values(Symbol::V0).len() == 1 && values(Symbol::PulseCycles).len() == 1;
    if !is_one || periods.len() > INKS.len() || amplitudes.len() > MAX_AMPLITUDES {
        return None;
    }
    let of = |amplitude: f64, period: f64| {
        let is_of = |pulses: &&Pulses<'_>| {
            value(pulses, Symbol::Delta) == Some(amplitude)
                && value(pulses, Symbol::T) == Some(period)
        };
        all.iter().find(is_of)
    };
    // High frequencies first, as their periods ascend.
    let inks = || periods.iter().copied().zip(INKS);
    let responses = |amplitude: f64| {
        let series = inks().map(|(period, ink)| {
            let mut series = Series::new(ink);
            for bin in 0..BINS {
                let ends = [bin, bin + 1].map(|edge| f64::from(edge) / f64::from(BINS));
                let pulses = of(amplitude, period).map(|pulses| pulses.between(ends[0], ends[1]));
                let relative =
                    |seconds: Option<f64>, row: &TriggerRow| Some(seconds? / row.tau_control?);
                if let Some(pulses) = pulses {
                    series.add(
                        0.5 * (ends[0] + ends[1]),
                        &pulses,
                        |row| relative(row.advance, row),
                        |row| relative(row.advance_drive, row),
                    );
                }
            }
            series
        });
        series.collect::<Vec<_>>()
    };
    let panels: Vec<Vec<Series>> = amplitudes.iter().map(|&each| responses(each)).collect();
    let (low, high) = widened(bounds(panels.iter().flatten().flat_map(Series::values))?);
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
    let mut panels: Vec<Panel<'_>> = panels.into_iter().zip(&amplitudes).map(panel).collect();
    let (x_label, factor) = axis_of(Symbol::Delta.key(), amplitudes.iter().copied());
    let share = |is_so: Option<bool>| is_so.map(|is_so| f64::from(u8::from(is_so)));
    let shares = inks().map(|(period, ink)| {
        let mut series = Series::new(ink);
        for &amplitude in &amplitudes {
            if let Some(pulses) = of(amplitude, period) {
                series.add(
                    factor * amplitude,
                    pulses,
                    |row| share(row.triggered),
                    |row| share(row.triggered_drive),
                );
            }
        }
        series
    });
    let shares: Vec<Series> = shares.collect();
    let most = shares.iter().flat_map(Series::values).fold(0.0, f64::max);
    let x = Axis::of_data(&x_label, amplitudes.iter().map(|value| factor * value))?;
    let y = Axis::linear("Share of triggered slips", 0.0, 1.05 * most.max(0.01));
    let mut last = Panel::inside(HEIGHT, x, y, shares.into_iter().flat_map(Series::layers));
    last.heading = Some("slips within the pulse that would have come later".to_owned());
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
