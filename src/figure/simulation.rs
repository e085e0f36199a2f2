//! One simulation: the modulation and the shear force over time (Fig. 1d), and under them the space-time map of
//! detached contacts (Fig. 4b, d) with the onsets of slips.

use super::axis::{Axis, bounds, widened};
use super::frame::{Cell, Layout, OVERLAP};
use super::hues::ColourBar;
use super::legend::{Mark, entry};
use super::note::common;
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::style::{BLACK, BLUE, GRID, INKS, Ink, Look, Place, RED, REFERENCE, Stroke, shade};
use crate::model::Parameters;
use crate::observe::MapRow;
use crate::sets::label;
use crate::table::value::floored;
use anyhow::{Result, anyhow};
use std::f64::consts::TAU;

const NAME: &str = "simulation";
const MEASURED: &str = "trace";
/// Width of the panels without a map, and beside the colour bar of one.
const WIDTHS: [f64; 2] = [658.0, 588.0];
const MICROMETRES: f64 = 1e6;
const MILLIMETRES: f64 = 1e3;
const TRACE: Stroke = Stroke::solid(BLACK, 1.3);
const MODULATION: Stroke = Stroke::solid(BLUE, 1.6);
/// Onsets of slips of start-up, and of those that are recorded.
const ONSETS: [(Stroke, &str); 2] = [
    (Stroke::solid(INKS[4], 1.6), "onset of a slip of start-up"),
    (Stroke::solid(RED, 1.6), "onset of a slip"),
];
/// Colours that an eye can distinguish.
const LEVELS: f64 = 100.0;
/// Periods whose peaks are marked, and that are drawn at all; more would be a grey area.
const MAX_PEAKS: f64 = 25.0;
const MAX_PERIODS: f64 = 80.0;
/// Onsets that are lines from edge to edge; more are marks at the upper edge.
const MAX_LINES: usize = 5;
const POINTS_PER_PERIOD: f64 = 40.0;

/// What the panels have in common.
struct Shared<'a> {
    parameters: &'a Parameters,
    time: Axis,
    /// From s to the unit of the time axis.
    factor: f64,
    first: f64,
    last: f64,
    /// Peaks of the modulation, on the time axis.
    peaks: Vec<f64>,
    /// Onsets of slips, on the time axis.
    onsets: Vec<(f64, Stroke)>,
    width: f64,
}

/// Draws what is given: the shear force in N against time in s, the map, instant by instant, or the map under the
/// force; above them the modulation. Onsets of slips, of start-up and recorded, are marked in all panels.
pub fn simulation(
    parameters: &Parameters,
    trace: Option<&[(f64, f64)]>,
    map: Option<&[MapRow]>,
    onsets: [&[f64]; 2],
) -> Result<Picture> {
    let of_all = common(std::iter::once(parameters), &[]);
    let look = Look::default().with_note(&format!("{of_all}, seed {}", parameters.seed));
    draw(NAME, &look, parameters, trace, map, onsets)
}

/// Draws the measured force in N against time in s, under the modulation that is known, with the onsets of slips.
pub fn measured_trace(
    look: &Look,
    parameters: &Parameters,
    trace: &[(f64, f64)],
    onsets: &[f64],
) -> Result<Picture> {
    draw(MEASURED, look, parameters, Some(trace), None, [&[], onsets])
}

fn draw(
    name: &'static str,
    look: &Look,
    parameters: &Parameters,
    trace: Option<&[(f64, f64)]>,
    map: Option<&[MapRow]>,
    onsets: [&[f64]; 2],
) -> Result<Picture> {
    let of_trace = trace.into_iter().flatten().map(|sample| sample.0);
    let instants = of_trace.chain(map.into_iter().flatten().map(|cell| cell.time));
    let (first, last) = bounds(instants)
        .filter(|(first, last)| last > first)
        .ok_or_else(|| anyhow!("figure {name}: there are fewer than two instants to draw"))?;
    let (factor, unit) = label("tau_mean").scale(last);
    let time = Axis::linear(&format!("Time t ({unit})"), factor * first, factor * last);
    // A ramped modulation is not drawn, nor one that is too fast.
    let is_drawn =
        |period: &f64| parameters.ramp_time == 0.0 && (last - first) / period <= MAX_PERIODS;
    let period = parameters.modulation_period.filter(is_drawn);
    let peaks = period.map(|period| time.multiples_of(factor * period, MAX_PEAKS));
    let mut legend = Vec::new();
    let mut marks = Vec::new();
    for (onsets, (stroke, word)) in onsets.into_iter().zip(ONSETS) {
        let within = onsets.iter().filter(|onset| (first..=last).contains(onset));
        let shown: Vec<(f64, Stroke)> = within.map(|onset| (factor * onset, stroke)).collect();
        legend.extend((!shown.is_empty()).then(|| entry(Mark::Line(stroke), word)));
        marks.extend(shown);
    }
    let shared = Shared {
        parameters,
        time,
        factor,
        first,
        last,
        peaks: peaks.unwrap_or_default(),
        onsets: marks,
        width: WIDTHS[usize::from(map.is_some())],
    };
    if !shared.peaks.is_empty() {
        legend.push(entry(Mark::Line(REFERENCE), "peaks of the modulation"));
    }
    let modulation = period.map(|period| shared.modulation(period));
    let force = trace.map(|trace| shared.force(trace));
    let contacts = map.map(|map| shared.contacts(map));
    let panels = [modulation, force, contacts].into_iter().flatten();
    let layout = Layout::column(shared.width);
    Ok(panel::draw(name, look, layout, &legend, panels.collect()))
}

impl Shared<'_> {
    /// A panel with these layers around the peaks of the modulation and the onsets.
    fn panel<'l>(
        &self,
        height: f64,
        y: Axis,
        under: Option<Layer<'l>>,
        over: impl IntoIterator<Item = Layer<'l>>,
    ) -> Panel<'l> {
        let times = self.peaks.iter();
        let peaks = times.map(|&peak| Layer::Upright(peak, REFERENCE));
        // Many lines would cover the slips.
        let are_marks = self.onsets.len() > MAX_LINES;
        let length = if are_marks { 0.07 } else { 1.0 } * (y.high - y.low);
        let ends = [y.high, y.high - length];
        let onset = |&(at, stroke)| Layer::Curve(ends.map(|end| (at, end)).into(), stroke);
        let onsets = self.onsets.iter().map(onset);
        let layers = under.into_iter().chain(peaks).chain(onsets).chain(over);
        Panel::inside(height, self.time.clone(), y, layers)
    }

    fn modulation(&self, period: f64) -> Panel<'static> {
        let amplitude = MICROMETRES * self.parameters.modulation_amplitude;
        let end = 1.2 * amplitude;
        let mut y = Axis::sparse("Modulation Δ cos(2πt/T) (µm)", -end, end);
        y.minor.clear();
        let points = floored(POINTS_PER_PERIOD * (self.last - self.first) / period) + 2;
        let phase = |time: f64| TAU * time / (self.factor * period);
        let times = self.time.evenly_placed(points).into_iter();
        let curve = times.map(|time| (time, amplitude * libm::cos(phase(time))));
        let curve = Layer::Curve(curve.collect(), MODULATION);
        self.panel(64.0, y, Some(Layer::Level(0.0, GRID)), [curve])
    }

    fn force(&self, trace: &[Place]) -> Panel<'static> {
        let ends = bounds(trace.iter().map(|sample| sample.1));
        let (low, high) = widened(ends.unwrap_or((0.0, 0.0)));
        let y = Axis::linear("Shear force F_S (N)", low, high);
        let samples = thinned(trace, self.width).into_iter();
        let places = samples.map(|(time, force)| (self.factor * time, force));
        let force = Layer::Curve(places.collect(), TRACE);
        self.panel(230.0, y, None, [force])
    }

    fn contacts(&self, map: &[MapRow]) -> Panel<'static> {
        let Self { factor, first, .. } = *self;
        let length = self.parameters.slider_length * MILLIMETRES;
        let y = Axis::linear("Position x (mm), trailing edge at 0", 0.0, length);
        let unscaled = cells(map, self.parameters.blocks, first, length, self.width).into_iter();
        let scaled = unscaled
            .map(|(((left, right), y), colour)| (((factor * left, factor * right), y), colour));
        let cells = Layer::Cells(scaled.collect(), OVERLAP);
        let percent = Axis::linear("detached (%)", 0.0, 100.0);
        Panel {
            bar: Some(ColourBar::of_axis(&percent, shade)),
            ..self.panel(260.0, y, Some(cells), [])
        }
    }
}

/// The least and the largest of the samples of each column of a figure: no peak is lost.
fn thinned(trace: &[Place], width: f64) -> Vec<Place> {
    let columns = floored(2.0 * width);
    let samples = trace.len().div_ceil(columns).max(1);
    if samples <= 4 {
        return trace.to_vec();
    }
    let extremes = |column: &[(f64, f64)]| {
        let by_force = |left: &&(f64, f64), right: &&(f64, f64)| left.1.total_cmp(&right.1);
        let least = column.iter().min_by(by_force).copied();
        let most = column.iter().max_by(by_force).copied();
        let mut pair: Vec<(f64, f64)> = least.into_iter().chain(most).collect();
        pair.sort_by(|left, right| left.0.total_cmp(&right.0));
        pair
    };
    trace.chunks(samples).flat_map(extremes).collect()
}

/// Cells of the map on axes of this time and length: averages over the instants of a column one unit wide, equal
/// neighbours joined.
fn cells(map: &[MapRow], blocks: usize, first: f64, length: f64, width: f64) -> Vec<(Cell, Ink)> {
    let instants = map.len() / blocks;
    let time = |instant: usize| map[instant * blocks].time;
    let columns = floored(width).min(instants);
    // Half a spacing on both sides of an instant belongs to it.
    let spacing = (time(instants - 1) - time(0)) / (instants - 1) as f64;
    let start_of = |column: usize| column * instants / columns;
    let left_of = |column: usize| (time(0) + (start_of(column) as f64 - 0.5) * spacing).max(first);
    let bottom_of = |block: usize| length * block as f64 / blocks as f64;
    let level = |block: usize, column: usize| {
        let span = start_of(column)..start_of(column + 1);
        let count = span.len() as f64;
        let sum: f64 = span
            .map(|instant| map[instant * blocks + block].attached_fraction)
            .sum();
        (sum / count * LEVELS).round()
    };
    let mut cells = Vec::new();
    for block in 0..blocks {
        let levels: Vec<f64> = (0..columns).map(|column| level(block, column)).collect();
        let mut column = 0;
        for run in levels.chunk_by(|left, right| left == right) {
            let times = (left_of(column), left_of(column + run.len()));
            cells.push((
                (times, (bottom_of(block), bottom_of(block + 1))),
                shade(1.0 - run[0] / LEVELS),
            ));
            column += run.len();
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_trace_keeps_every_peak() {
        let mut trace: Vec<(f64, f64)> =
            (0..1_000_000).map(|step| (f64::from(step), 1.0)).collect();
        trace[123_456].1 = 9.0;
        trace[654_321].1 = -9.0;
        let thin = thinned(&trace, 600.0);
        assert!(thin.len() < 5000);
        assert!(thin.contains(&(123_456.0, 9.0)) && thin.contains(&(654_321.0, -9.0)));
        assert!(thin.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    /// Of three blocks at two instants.
    fn map() -> Vec<MapRow> {
        let cell = |cell: u32| MapRow {
            time: f64::from(cell / 3),
            block: u64::from(cell % 3) + 1,
            attached_fraction: 1.0,
        };
        (0..6).map(cell).collect()
    }

    const FORCE: &[(f64, f64)] = &[(0.0, 1.0), (1.0, 2.0)];

    fn drawn(
        trace: Option<&[(f64, f64)]>,
        map: Option<&[MapRow]>,
        period: Option<f64>,
    ) -> Option<String> {
        let amplitude = if period.is_some() { 1e-6 } else { 0.0 };
        let parameters = Parameters {
            blocks: 3,
            modulation_amplitude: amplitude,
            modulation_period: period,
            ..Parameters::default()
        };
        Some(
            simulation(&parameters, trace, map, [&[0.25], &[0.5, 2.0]])
                .ok()?
                .svg(),
        )
    }

    #[test]
    fn fewer_than_two_instants_are_refused() {
        assert!(drawn(Some(FORCE), Some(&map()), None).is_some());
        assert!(
            drawn(Some(&FORCE[..1]), None, None).is_none() && drawn(None, None, None).is_none()
        );
    }

    #[test]
    fn the_requested_panels_are_drawn_and_labelled_once() {
        let force = "Shear force F<";
        let position = "Position x (mm), trailing edge at 0<";
        let bar = ">detached (%)<";
        let panels = [
            (true, false, vec![force]),
            (false, true, vec![position, bar]),
            (true, true, vec![force, position, bar]),
        ];
        for (has_trace, has_map, labels) in panels {
            let svg = drawn(
                has_trace.then_some(FORCE),
                has_map.then_some(&map()[..]),
                None,
            )
            .unwrap();
            for label in [force, position, bar] {
                assert_eq!(
                    svg.matches(label).count(),
                    usize::from(labels.contains(&label)),
                    "{label}"
                );
            }
            assert_eq!(svg.matches(">Time t (s)<").count(), 1);
        }
    }

    #[test]
    fn the_modulation_and_the_onsets_that_are_shown_are_drawn() {
        let modulated = drawn(None, Some(&map()), Some(0.25)).unwrap();
        assert!(
            modulated.contains("Modulation Δ cos(2πt/T) (µm)")
                && modulated.contains("peaks of the modulation")
        );
        let still = drawn(None, Some(&map()), None).unwrap();
        assert!(!still.contains("Modulation") && still.contains("onset of a slip"));
        let both = drawn(Some(FORCE), Some(&map()), None).unwrap();
        for (Stroke { ink, .. }, name) in ONSETS {
            assert!(both.contains(&format!(">{name}<")));
            let count = both.matches(&ink.to_string()).count();
            assert_eq!(count, 3, "{name}: in the legend and both panels");
        }
        assert!(
            !drawn(None, Some(&map()), Some(1e-3))
                .unwrap()
                .contains("Modulation"),
            "a thousand periods"
        );
        assert_eq!(
            Axis::linear("", 0.3, 1.0).multiples_of(0.25, MAX_PEAKS),
            [0.5, 0.75, 1.0]
        );
    }
}
