//! The locking map: how many periods an interval takes, its locking index, and the excess of the resultant length over the
//! drive alone, over period and amplitude of the modulation.

use super::axis::{Axis, bounds};
use super::colour_bar::ColourBar;
use super::frame::Layout;
use super::legend::{Mark, entry};
use super::map::Map;
use super::panel::{self, Layer, Panel, Place};
use super::picture::{Fill, Ink, Picture, Stroke};
use super::sets::{MICROMETRES, Modulations, Periods};
use super::style::{BLACK, Look, WHITE, diverging, shade};
use crate::reduce::SetRow;
use kuva::render::color::Color;
use std::f64::consts::TAU;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 280.0;
/// Least values of amplitude and of period that make a map.
const MIN_VALUES: usize = 8;
/// Numbers of periods that have a colour of their own; larger ones share one.
const MAX_PERIODS: usize = 12;
/// Share of the scale at n = 1, which is not to be taken for the ground.
const FIRST_SHADE: f64 = 0.22;
const LINE: Stroke = Stroke::solid(BLACK, 1.8);
/// Under the line, so that it is seen on dark cells.
const CASING: Stroke = Stroke::solid(WHITE, 4.4);
/// Sets without a phase.
const FREE: Ink = "#f2f2f0";

const EXCESS: &str = "resultant length of φ less that by the drive alone";
/// Least end of its scale, so that chance is pale.
const MIN_EXCESS: f64 = 0.2;

/// Draws the map of sets that differ in the modulation alone and fill at least half of a grid of 8 amplitudes and
/// periods or more; `None` for others. Sets without modulation do not count.
pub(super) fn locking_map(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let Modulations { modulated, periods, .. } =
        Modulations::of(sets.iter().filter(|set| set.parameters.modulation_period.is_some()))?;
    let periods = Periods::of(&periods, None);
    let place = |set: &SetRow| set.parameters.modulation_period.map(|period| periods.place(period));
    let map =
        Map::of(&modulated, [&place, &|set| Some(MICROMETRES * set.parameters.modulation_amplitude)], MIN_VALUES)?;
    let (x, y) = map.axes(&periods.label, "Amplitude Δ (µm)");
    let drive_velocity = modulated[0].parameters.drive_velocity;
    let critical_amplitude = |place: f64| MICROMETRES * drive_velocity * periods.period(place) / TAU;
    let lines = || {
        let places: Vec<Place> = x.evenly_placed(200).map(|place| (place, critical_amplitude(place))).collect();
        [CASING, LINE].map(|stroke| Layer::Curve(places.clone(), stroke))
    };
    let numbers = Numbers::of(&modulated);
    let colour = |set: &SetRow| Some(whole_periods(set).map_or(Color::from(FREE), |n| shade(numbers.share(n))));
    let words = map.words(whole_periods, |n| (n.to_string(), numbers.share(n)));
    let indices = ColourBar::of_axis(&Axis::linear("Locking index of τ", 0.0, 1.0), shade);
    let mut panels = vec![
        (map.coloured(colour), words, numbers.bar()),
        (map.coloured(|set| set.locking_index.map(shade)), Vec::new(), indices),
    ];
    if let Some((low, high)) = bounds(modulated.iter().filter_map(|set| set.resultant_excess)) {
        let most = MIN_EXCESS.max(-low).max(high);
        let scale = Axis::linear(EXCESS, -most, most);
        let cells = map.coloured(|set| Some(diverging(scale.place(set.resultant_excess?))));
        panels.push((cells, Vec::new(), ColourBar::of_axis(&scale, diverging)));
    }
    let panels = panels.into_iter().map(|(cells, words, bar)| {
        let inside = Layer::Inside(std::iter::once(cells).chain(lines()).collect());
        let layers = std::iter::once(inside).chain(words).collect();
        Panel { bar: Some(bar), ..Panel::new(HEIGHT, x.clone(), y.clone(), layers) }
    });
    let legend = [
        entry(Mark::Line(LINE), "η = 1; above, the drive turns back"),
        entry(Mark::Patch(Fill { ink: FREE, opacity: 1.0 }), "no phase"),
    ];
    Some(panel::draw("locking-map", look, Layout::column(WIDTH), &legend, panels.collect()))
}

/// n of τ = nT, of a set that has a phase.
fn whole_periods(set: &SetRow) -> Option<usize> {
    usize::try_from(set.periods?).ok().filter(|_| set.has_phase)
}

/// The numbers of periods that occur, as shades.
struct Numbers {
    first: usize,
    last: usize,
}

impl Numbers {
    fn of(sets: &[&SetRow]) -> Self {
        let present = || sets.iter().filter_map(|set| whole_periods(set)).map(|n| n.min(MAX_PERIODS + 1));
        let first = present().min().unwrap_or(0);
        Self { first, last: present().max().unwrap_or(first) }
    }

    fn share(&self, n: usize) -> f64 {
        let steps = (self.last - self.first).max(1) as f64;
        FIRST_SHADE + (1.0 - FIRST_SHADE) * (n.min(MAX_PERIODS + 1).max(self.first) - self.first) as f64 / steps
    }

    /// The colours from the least number of periods to the largest that occur.
    fn bar(&self) -> ColourBar {
        let count = (self.last - self.first + 1) as f64;
        let number = |n: usize| if n > MAX_PERIODS { format!(">{MAX_PERIODS}") } else { n.to_string() };
        let all = self.first..=self.last;
        ColourBar {
            label: "n = τ / T".to_owned(),
            colours: all.clone().map(|n| shade(self.share(n))).collect(),
            ticks: all.map(|n| (((n - self.first) as f64 + 0.5) / count, number(n))).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;
    use crate::model::Parameters;

    fn grid(amplitudes: u32, periods: u32) -> Vec<SetRow> {
        let row = |row: u32| {
            (1..=periods).map(move |column| set(1e-7 * f64::from(row), 0.01 * f64::from(column), f64::from(column)))
        };
        (1..=amplitudes).flat_map(row).collect()
    }

    #[test]
    fn only_a_grid_of_modulations_becomes_a_map() {
        let mut sets = grid(8, 9);
        assert!(locking_map(&sets, &Look::default()).is_some());
        assert!(locking_map(&sets[..30], &Look::default()).is_none(), "four amplitudes");
        assert!(locking_map(&grid(9, 7), &Look::default()).is_none());
        sets.push(set(0.0, 1.0, 1.0));
        assert!(locking_map(&sets, &Look::default()).is_some(), "a set without modulation lies on no grid");
        sets[3].parameters.parameters = Parameters { drive_velocity: 1e-5, ..sets[3].parameters.parameters.clone() };
        assert!(locking_map(&sets, &Look::default()).is_none(), "two velocities");
    }

    #[test]
    fn a_diagonal_is_no_grid() {
        let sets: Vec<SetRow> = (1..=20).map(|step| set(1e-7 * f64::from(step), 0.01 * f64::from(step), 3.0)).collect();
        assert!(locking_map(&sets, &Look::default()).is_none());
    }

    #[test]
    fn shades_grow_with_the_number_and_large_ones_share_one() {
        let sets = [1.0, 5.0, 40.0].map(|n| set(1e-6, 0.02, n));
        let numbers = Numbers::of(&sets.iter().collect::<Vec<_>>());
        let shares: Vec<f64> = (1..=MAX_PERIODS + 1).map(|n| numbers.share(n)).collect();
        assert!(shares.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(shares[0] == FIRST_SHADE && (numbers.share(40) - 1.0).abs() < 1e-12);
        assert_eq!(numbers.bar().ticks.last().unwrap().1, ">12");
    }

    #[test]
    fn what_the_slider_adds_is_a_panel_where_there_are_controls_and_nothing_is_pale() {
        let mut sets = grid(8, 8);
        let drawn = |sets: &[SetRow]| locking_map(sets, &Look::default()).unwrap().svg();
        assert!(!drawn(&sets).contains(EXCESS));
        for (set, excess) in sets.iter_mut().zip([-0.5, 0.0, 0.5].into_iter().cycle()) {
            set.resultant_excess = Some(excess);
        }
        let svg = drawn(&sets);
        assert!(svg.contains(EXCESS));
        for share in [0.0, 0.5, 1.0] {
            assert!(svg.matches(&diverging(share).to_svg_string()).count() > 20, "{share}");
        }
    }

    #[test]
    fn sets_without_a_phase_are_as_pale_as_the_ground() {
        let mut sets = grid(8, 8);
        let free = |sets: &[SetRow]| locking_map(sets, &Look::default()).unwrap().svg().matches(FREE).count();
        let none = free(&sets);
        for set in &mut sets {
            set.has_phase = false;
        }
        assert_eq!(free(&sets) - none, 64);
    }
}
