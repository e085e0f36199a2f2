//! Triggering: the mean advance of slips by a pulse against where in the control's interval it begins, a panel for each
//! amplitude; and the share of triggered slips against the amplitude. What the drive alone does is dashed
//! ([`Quantity`] finds it by the class of a column), and so is no advance.

use super::chart::{Chart, ChartParts};
use super::frame::{LEFT, Layout};
use super::legend::{Mark, entry};
use super::note::common;
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::quantity::Quantity;
use super::style::{INKS, Look, REFERENCE};
use crate::model::Parameters;
use crate::reduce::{PulseRow, Values};
use crate::sets::FREQUENCY;

pub(super) const NAME: &str = "triggering";

const WIDTH: f64 = 290.0;
const HEIGHT: f64 = 230.0;
const COLUMNS: usize = 2;
const GAP: f64 = 20.0;
/// Panels of amplitudes, at most.
const MAX_AMPLITUDES: usize = 5;
/// Where in the control's interval the pulses of a row begin.
const PLACE: &str = "(place_low + place_high) / 2";

/// `None` without pulses, if they differ in more than where they begin, amplitude and period, or in too many of these.
pub(super) fn triggering(rows: &[PulseRow], look: &Look) -> Option<Picture> {
    let (whole, tenths): (Vec<PulseRow>, Vec<PulseRow>) = rows
        .iter()
        .cloned()
        .partition(PulseRow::is_of_whole_interval);
    let in_common = |row: &PulseRow| Parameters {
        pulse_cycles: row.pulse().pulse_cycles,
        ..row.pulse().without_modulation()
    };
    let is_one = whole
        .windows(2)
        .all(|pair| in_common(&pair[0]) == in_common(&pair[1]));
    let amplitudes = Values::of(&whole, "Delta").ok()?;
    let periods = Values::of(&whole, "T").ok()?;
    if !is_one || periods.distinct.len() > INKS.len() || amplitudes.distinct.len() > MAX_AMPLITUDES
    {
        return None;
    }
    let advances = parts_of(&tenths, [PLACE, "advance_mean"], Some("Delta"))?;
    let shares = parts_of(&whole, ["Delta", "triggered_share"], None)?;
    let no_advance = || Layer::Level(0.0, REFERENCE);
    let mut panels = advances.panels;
    for panel in &mut panels {
        panel.layers.insert(0, no_advance());
        let heading = || amplitudes.setting(*amplitudes.distinct.first()?).into();
        panel.heading = panel.heading.take().or_else(heading);
    }
    panels.extend(shares.panels.into_iter().map(|panel| Panel {
        heading: Some("within the pulse, later without it".to_owned()),
        ..panel
    }));
    for panel in &mut panels {
        panel.height = HEIGHT;
    }
    let mut legend = advances.legend;
    legend.push(entry(Mark::Line(REFERENCE), "no advance"));
    let layout = Layout {
        columns: COLUMNS.min(panels.len()),
        column_gap: LEFT + GAP,
        ..Layout::column(WIDTH)
    };
    let pulses: Vec<Parameters> = whole.iter().map(PulseRow::pulse).collect();
    let shared = common(pulses.iter(), &[]);
    let noted = look.with_note(&format!("{shared}; bars: 95 % over seeds"));
    Some(panel::draw(NAME, &noted, layout, &legend, panels))
}

/// A series for each frequency: advances over the interval, with a panel for each value of a column; else shares from 0 on.
fn parts_of(rows: &[PulseRow], [x, y]: [&str; 2], panels: Option<&str>) -> Option<ChartParts> {
    let series = [Values::of(rows, FREQUENCY).ok()?];
    let mut x = Quantity::of(rows, "x", x).ok()?;
    let mut y = Quantity::of(rows, "y", y).ok()?;
    y.is_log = false;
    y.holds_bars = true;
    if panels.is_some() {
        x.limits = (Some(0.0), Some(1.0));
        x.label = Some("Elapsed fraction of the interval p");
    } else {
        y.limits = (Some(0.0), None);
    }
    let chart = Chart {
        panels: panels.and_then(|name| Values::of(rows, name).ok()),
        ..Chart::of_series("pulses", &series, x, y)
    };
    chart.parts().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Selected;

    #[test]
    fn what_the_drive_alone_explains_is_drawn_for_one_amplitude_too() {
        let row = |place: u32, amplitude: f64| {
            let place_low = 0.1 * f64::from(place);
            let parameters = Parameters {
                modulation_amplitude: amplitude,
                modulation_period: Some(0.02),
                pulse_start: Some(1.0),
                pulse_cycles: Some(1),
                ..Parameters::default()
            };
            PulseRow {
                parameters: Selected::new(parameters),
                place_low,
                place_high: if place == 0 { 1.0 } else { place_low + 0.1 },
                jobs: 10,
                advance_mean: Some(0.2),
                advance_drive: Some(0.1),
                triggered_share: 0.4,
                triggered_drive: 0.1,
                ..PulseRow::default()
            }
        };
        for amplitudes in 1..4 {
            let of =
                |amplitude: u32| (0..5).map(move |place| row(place, 1e-6 * f64::from(amplitude)));
            let rows: Vec<PulseRow> = (1..=amplitudes).flat_map(of).collect();
            let svg = triggering(&rows, &Look::default()).unwrap().svg();
            for text in [
                "1/T = 50 Hz",
                "by the drive alone",
                "no advance",
                "Δ = 1 µm",
                "Elapsed fraction of the interval p",
            ] {
                assert!(svg.contains(&format!(">{text}<")), "{amplitudes} {text}");
            }
            assert_eq!(svg.matches(">Δ = ").count(), amplitudes as usize);
        }
        let mut longer = [row(0, 1e-6), row(0, 2e-6)];
        longer[1].parameters.all.pulse_cycles = Some(2);
        assert!(triggering(&longer, &Look::default()).is_none());
        assert!(triggering(&[], &Look::default()).is_none());
    }
}
