//! τ/T against T (Fig. 3b, c): slips, and the whole numbers n on which they fall.

use super::Beside;
use super::axis::{Axis, logarithmic_bounds};
use super::beside::Other;
use super::frame::Layout;
use super::hues::Hues;
use super::legend::{LegendEntry, Mark, entry};
use super::panel::{self, Layer, MeanPlace, Panel};
use super::picture::Picture;
use super::quantity::axis_of;
use super::style::{DARK_GREY, Dot, GREY, GRID, LIGHT_GREY, Look, Place, WHITE};
use crate::reduce::{Point, SetRow, ascending, is_same};
use crate::sets::{Digits, label};

pub(super) const NAME: &str = "tau-T";

const RADIUS: f64 = 1.8;
/// Slips of sets without a preferred phase are rings, which no colour of a scale resembles.
const OTHER: Dot = Dot::solid(LIGHT_GREY, 2.2);
const HOLE: Dot = Dot::solid(WHITE, 1.2);
/// Whole numbers whose lines can be distinguished.
const LINES: u32 = 12;

/// Draws intervals in periods against the period, all of them, and under them those of few periods with the lines
/// τ = nT; `None` without intervals at two periods or more. Slips of sets with a phase have the colour of their V0, or
/// of their Δ at a common V0.
pub(super) fn intervals(points: &[Point], beside: &Beside, look: &Look) -> Option<Picture> {
    let place = |point: &Point| {
        let period = point.period?;
        let interval = point.interval?;
        Some((period, interval / period))
    };
    let mut slips: Vec<(&Point, Place)> = points
        .iter()
        .filter_map(|point| Some((point, place(point)?)))
        .collect();
    if ascending(slips.iter().map(|slip| slip.1.0)).len() < 2 {
        return None;
    }
    let (x_label, factor) = axis_of("T", slips.iter().map(|slip| slip.1.0));
    for slip in &mut slips {
        slip.1.0 *= factor;
    }
    let mean = |set: &SetRow| {
        let period = set.parameters.modulation_period?;
        let ends = set.tau_interval?;
        let ends = (ends.low / period, ends.high / period);
        Some((factor * period, set.tau_mean? / period, ends))
    };
    let of_other = |other: &Other| other.sets.iter().filter_map(mean).collect();
    let means: Vec<Vec<MeanPlace>> = beside.others.iter().map(of_other).collect();
    let of_others = means.iter().flatten().map(|mean| (mean.0, mean.1));
    let all: Vec<Place> = slips.iter().map(|slip| slip.1).chain(of_others).collect();
    let (low, high) = logarithmic_bounds(all.iter().map(|place| place.0))?;
    let x = Axis::logarithmic(&x_label, low, high);
    let (low, high) = logarithmic_bounds(all.iter().map(|place| place.1))?;
    let all = Axis::logarithmic("Slip interval in periods, τ / T: all slips", low, high);
    let mut few = Axis::linear("τ / T: up to 12 periods", 0.0, f64::from(LINES) + 0.5);
    few.ticks = (0..=LINES).map(|n| (f64::from(n), n.to_string())).collect();
    few.minor.clear();

    let (phased, unphased): (Vec<&(&Point, Place)>, Vec<_>) =
        slips.iter().partition(|slip| slip.0.has_phase);
    let velocities = ascending(slips.iter().map(|slip| slip.0.drive_velocity));
    let amplitudes = ascending(slips.iter().map(|slip| slip.0.amplitude));
    let has_both = velocities.len() > 1 && amplitudes.len() > 1;
    let (column, values, of): (_, _, fn(&Point) -> f64) = if velocities.len() > 1 {
        ("V0", velocities, |point| point.drive_velocity)
    } else {
        ("Delta", amplitudes, |point| point.amplitude)
    };
    let colour = label(column);
    let (to_unit, unit) = colour.scale(values.iter().copied().fold(0.0, f64::max));
    let value = |point: &Point| to_unit * of(point);
    // The same colours whatever has a phase.
    let digits = Digits::THREE.distinguishing(&values);
    let hues = values.iter().map(|value| to_unit * value);
    let hues = Hues::of(&colour.short(&unit), hues, |value| {
        colour.setting(value / to_unit, digits)
    });
    let is_shown = |shown| phased.iter().any(|slip| is_same(value(slip.0), shown));
    let mut entries: Vec<LegendEntry> =
        hues.entries(|value| Dot::solid(hues.ink(value), 3.0), is_shown);
    if hues.bar().is_some() {
        let dot = Dot::solid(hues.ink(f64::INFINITY), RADIUS);
        entries.push(entry(
            Mark::Dot(dot),
            "slips of sets with a preferred phase",
        ));
    }
    if !unphased.is_empty() {
        let ring = Mark::Ring(GREY, WHITE, 1.5 * OTHER.radius, 1.5 * HOLE.radius);
        entries.push(entry(ring, "slips of sets without a preferred phase"));
    }
    entries.push(entry(Mark::Line(GRID), "τ = nT"));
    let own = Mark::Dot(Dot::solid(DARK_GREY, RADIUS));
    entries.extend(beside.entries(Some(own), |other| !means[other].is_empty()));
    let panels = [(180.0, all, 1), (340.0, few, LINES)].map(|(height, y, lines)| {
        let mut layers: Vec<Layer<'_>> = (1..=lines)
            .map(|n| Layer::Level(f64::from(n), GRID))
            .collect();
        for dot in [OTHER, HOLE] {
            let places = unphased.iter().map(|slip| slip.1);
            layers.push(Layer::Dots(places.collect(), dot));
        }
        layers.extend(phased.iter().map(|&&(point, place)| {
            let dot = Dot::solid(hues.ink(value(point)), RADIUS);
            Layer::Dots(vec![place], dot.with_opacity(0.8))
        }));
        layers.extend(panel::hollow_marks(&means));
        Panel {
            bar: hues.bar(),
            ..Panel::inside(height, x.clone(), y, layers)
        }
    });
    let note = "pooled: sets that differ in Δ";
    let noted = look.with_note(if has_both { note } else { "" });
    let layout = Layout::column(560.0);
    Some(panel::draw(NAME, &noted, layout, &entries, panels.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(n: u64, has_phase: bool) -> Point {
        Point {
            drive_velocity: 1e-4,
            amplitude: 1e-6,
            period: Some(0.01),
            eta: 20.0,
            ramp_stage: None,
            onset: 1.0,
            interval: Some(n as f64 * 0.01),
            periods: Some(n),
            phase: Some(-0.5),
            has_phase,
        }
    }

    #[test]
    fn every_colour_is_explained() {
        let mut points = vec![point(1, true), point(4, true), point(7, false)];
        points[1].period = Some(0.02);
        let texts = |points: &[Point], texts: &[&str]| {
            let svg = intervals(points, &Beside::default(), &Look::default())
                .unwrap()
                .svg();
            texts.iter().all(|text| svg.contains(&format!(">{text}<")))
        };
        assert!(texts(
            &points,
            &[
                "Δ = 1 µm",
                "slips of sets without a preferred phase",
                "τ = nT",
                "4",
                "12"
            ]
        ));
        let mut amplitudes = points.clone();
        amplitudes[1].amplitude = 3e-7;
        assert!(texts(&amplitudes, &["Δ = 0.3 µm", "Δ = 1 µm"]));
        let first = points[0];
        points.extend((1..9).map(|step| Point {
            drive_velocity: 1e-6 * f64::from(1 << step),
            ..first
        }));
        assert!(texts(
            &points,
            &[
                "V₀ (m/s)",
                "slips of sets with a preferred phase",
                "slips of sets without a preferred phase"
            ]
        ));
    }

    #[test]
    fn without_two_periods_there_is_nothing_to_draw() {
        let still = Point {
            period: None,
            periods: None,
            ..point(1, false)
        };
        assert!(
            intervals(
                &[still, point(1, true)],
                &Beside::default(),
                &Look::default()
            )
            .is_none()
        );
    }
}
