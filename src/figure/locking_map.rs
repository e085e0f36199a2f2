//! The locking map: how many periods an interval takes and its locking index, over period and amplitude of the
//! modulation.

use super::colour_bar::{COLOUR_BAR, ColourBar, OVERLAP, shade};
use super::frame::{Layout, LegendPlace, Mark, ROW_GAP, entry};
use super::picture::{BLACK, INKS, Ink, LIGHT_GREY, Picture, Stroke};
use super::sets::{Grid, MICROMETRES, Modulations, Periods, is_modulated};
use crate::reduce::SetSummary;
use kuva::render::color::Color;
use std::f64::consts::TAU;

const LAYOUT: Layout = Layout::column(592.0, &[270.0, 270.0], ROW_GAP, COLOUR_BAR);
/// Least values of amplitude and of period that make a map.
const MIN_VALUES: usize = 8;
/// Numbers of periods that have a colour of their own: each ink, and a darker one. Larger ones share a colour.
const MAX_PERIODS: usize = 2 * INKS.len();
const LINE: Stroke = Stroke::solid(BLACK, 1.8);
/// Under the line, so that it is seen on dark cells.
const CASING: Stroke = Stroke::solid(WHITE, 4.4);
const WHITE: Ink = "#ffffff";

/// Draws the map of sets that differ in the modulation alone and fill at least half of a grid of 8 amplitudes and
/// periods or more; `None` for others. Sets without modulation do not count.
pub(super) fn locking_map(sets: &[SetSummary]) -> Option<Picture> {
    let Modulations { modulated, amplitudes, periods, .. } =
        Modulations::of(sets.iter().filter(|set| is_modulated(set)))?;
    let cells = amplitudes.len() * periods.len();
    if amplitudes.len().min(periods.len()) < MIN_VALUES || 2 * modulated.len() < cells {
        return None;
    }
    let periods = Periods::of(&periods, None);
    let amplitudes = Grid::of(amplitudes.into_iter().map(|amplitude| MICROMETRES * amplitude).collect());
    let drive_velocity = modulated[0].parameters.drive_velocity;
    let critical_amplitude = |place: f64| MICROMETRES * drive_velocity * periods.period(place) / TAU;
    let cell_colours: [fn(&SetSummary) -> Option<Color>; 2] = [
        |set| {
            let colour = colour(whole_periods(set)?);
            Some(if set.is_locked { colour } else { paler(colour) })
        },
        |set| set.locking_index.map(|index| shade(index.value)),
    ];
    let index_ticks = [0.0, 0.25, 0.5, 0.75, 1.0].map(|index| (index, index));
    let bars = [periods_bar(&modulated), ColourBar::of_shades("locking index", index_ticks)];

    let mut sheet = LAYOUT.sheet("locking-map");
    for (panel, (cell_colour, bar)) in cell_colours.into_iter().zip(bars).enumerate() {
        let frame = LAYOUT.frame(panel, 0, periods.grid.axis(periods.label), amplitudes.axis("Amplitude Δ (µm)"));
        frame.clipped(&mut sheet, |sheet| {
            sheet.rectangles(modulated.iter().filter_map(|set| {
                let period = periods.place(set.parameters.modulation_period?);
                let amplitude = MICROMETRES * set.parameters.modulation_amplitude;
                let [left, top, width, height] =
                    frame.box_of(periods.grid.cell_of(period), amplitudes.cell_of(amplitude));
                Some(([left, top, width + OVERLAP, height + OVERLAP], cell_colour(set)?))
            }));
            for stroke in [CASING, LINE] {
                let places = frame.x.evenly_placed(200);
                frame.curve(sheet, places.map(|place| (place, critical_amplitude(place))), stroke);
            }
        });
        frame.axes(&mut sheet);
        frame.y_label(&mut sheet);
        bar.draw(&mut sheet, &frame);
        if panel == 0 {
            frame.legend(&mut sheet, LegendPlace::Above, &[entry(Mark::Line(LINE), "η = 1")]);
        }
        frame.x_label(&mut sheet);
    }
    Some(sheet.finish())
}

/// The median interval in periods, rounded.
fn whole_periods(set: &SetSummary) -> Option<usize> {
    let periods = set.tau_quartiles?[1] / set.parameters.modulation_period?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a ratio of positive numbers")]
    Some(periods.round() as usize)
}

/// The colour of a number of periods, which colour-blind readers, too, can distinguish from its neighbours.
fn colour(periods: usize) -> Color {
    match periods {
        0 => Color::from(WHITE),
        1..=MAX_PERIODS => {
            let ink = Color::from(INKS[(periods - 1) % INKS.len()]);
            if periods <= INKS.len() { ink } else { darker(ink) }
        }
        _ => Color::from(LIGHT_GREY),
    }
}

/// Halfway to black.
fn darker(ink: Color) -> Color {
    map_parts(ink, |part| part / 2)
}

/// Most of the way to white.
fn paler(ink: Color) -> Color {
    map_parts(ink, |part| 255 - (255 - part) / 4)
}

fn map_parts(ink: Color, change: impl Fn(u8) -> u8) -> Color {
    match ink {
        Color::Rgb(red, green, blue) => Color::Rgb(change(red), change(green), change(blue)),
        other => other,
    }
}

/// The colours from the least number of periods to the largest that occur.
fn periods_bar(sets: &[&SetSummary]) -> ColourBar {
    let present = || sets.iter().filter_map(|set| whole_periods(set)).map(|periods| periods.min(MAX_PERIODS + 1));
    let (first, last) = (present().min().unwrap_or(0), present().max().unwrap_or(0));
    let count = (last - first + 1) as f64;
    let number = |periods: usize| if periods > MAX_PERIODS { format!(">{MAX_PERIODS}") } else { periods.to_string() };
    ColourBar {
        label: "τ / T (pale: not locked)",
        colours: (first..=last).map(colour).collect(),
        ticks: (first..=last).map(|periods| (((periods - first) as f64 + 0.5) / count, number(periods))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;
    use crate::model::Parameters;

    fn grid(amplitudes: u32, periods: u32) -> Vec<SetSummary> {
        let row = |row: u32| {
            (1..=periods).map(move |column| set(1e-7 * f64::from(row), 0.01 * f64::from(column), f64::from(column)))
        };
        (1..=amplitudes).flat_map(row).collect()
    }

    #[test]
    fn only_a_grid_of_modulations_becomes_a_map() {
        let mut sets = grid(8, 9);
        assert!(locking_map(&sets).is_some());
        assert!(locking_map(&sets[..30]).is_none(), "four amplitudes");
        assert!(locking_map(&grid(9, 7)).is_none());
        sets.push(set(0.0, 1.0, 1.0));
        assert!(locking_map(&sets).is_some(), "a set without modulation lies on no grid");
        sets[3].parameters = Parameters { drive_velocity: 1e-5, ..sets[3].parameters.clone() };
        assert!(locking_map(&sets).is_none(), "two velocities");
    }

    #[test]
    fn a_diagonal_is_no_grid() {
        let sets: Vec<SetSummary> =
            (1..=20).map(|step| set(1e-7 * f64::from(step), 0.01 * f64::from(step), 3.0)).collect();
        assert!(locking_map(&sets).is_none());
    }

    #[test]
    fn each_number_of_periods_has_its_colour_and_its_pale_colour() {
        let hex = |colour: Color| format!("{colour:?}");
        let pale = (1..=MAX_PERIODS + 1).map(|periods| hex(paler(colour(periods))));
        let all: std::collections::BTreeSet<String> =
            (0..=MAX_PERIODS + 1).map(|periods| hex(colour(periods))).chain(pale).collect();
        assert_eq!(all.len(), 2 * MAX_PERIODS + 3);
        assert_eq!(hex(colour(13)), hex(colour(40)));
        assert_eq!(whole_periods(&set(1e-6, 0.02, 3.02)), Some(3));
    }

    #[test]
    fn sets_that_are_not_locked_are_pale() {
        let mut sets = grid(8, 8);
        let is_drawn = |sets: &[SetSummary], pale: bool| {
            let ink = if pale { paler(colour(1)) } else { colour(1) };
            let mut hex = String::new();
            ink.write_svg(&mut hex);
            // Besides the colour bar.
            locking_map(sets).unwrap().svg().matches(&hex).count() > usize::from(!pale)
        };
        assert!(is_drawn(&sets, false) && !is_drawn(&sets, true));
        for set in &mut sets {
            set.is_locked = false;
        }
        assert!(!is_drawn(&sets, false) && is_drawn(&sets, true));
    }
}
