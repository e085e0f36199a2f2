//! τ/T against T (Fig. 3b, c): slips, and the whole numbers n on which they fall.

use super::chart::{Chart, ChartRows};
use super::frame::Layout;
use super::picture::Picture;
use super::quantity::Quantity;
use super::style::Look;
use crate::reduce::{Point, Values};

pub(super) const NAME: &str = "tau-T";

/// The heights of the panels of all intervals, and of those of few periods.
const HEIGHTS: [f64; 2] = [180.0, 340.0];
const FEW_PERIODS: u32 = 10;

/// Draws intervals in periods against the period, all of them, and under them those of few periods; `None` without
/// intervals at two periods or more. Slips of sets with a phase have the colour of their V0, or of their Δ at a common V0.
pub(super) fn intervals(points: &[Point], look: &Look) -> Option<Picture> {
    let mut points = points.to_vec();
    points.retain(|point| point.period.is_some() && point.interval.is_some());
    // Those with a phase lie over the others.
    points.sort_by_key(|point| point.has_phase);
    let mut x = Quantity::of(&points, "x", "T").ok()?;
    x.is_log = true;
    if x.column.distinct.len() < 2 {
        return None;
    }
    let in_periods = |is_log, label| {
        let quantity = Quantity::of(&points, "y", "interval/T").ok()?;
        Some(Quantity {
            is_log,
            label: Some(label),
            ..quantity
        })
    };
    let all = in_periods(true, "Slip interval in periods, τ / T: all slips")?;
    let few = Quantity {
        limits: (Some(0.0), Some(f64::from(FEW_PERIODS) + 0.5)),
        ..in_periods(false, "τ / T: up to 10 periods")?
    };
    let velocities = Values::of(&points, "V0").ok()?;
    let amplitudes = Values::of(&points, "Delta").ok()?;
    let has_velocities = velocities.distinct.len() > 1;
    let pooled = if has_velocities && amplitudes.distinct.len() > 1 {
        "pooled: sets that differ in Δ"
    } else {
        ""
    };
    let mut shown = if has_velocities {
        velocities
    } else {
        amplitudes
    };
    for (number, point) in shown.numbers.iter_mut().zip(&points) {
        *number = number.filter(|_| point.has_phase);
    }
    let colour = Quantity {
        without: "no preferred phase".to_owned(),
        ..Quantity::of_values("colour", shown)
    };
    let chart = Chart {
        of: "slips",
        rows: ChartRows::in_series(&[]),
        x,
        ys: vec![all, few],
        colour: Some(colour),
        panels: None,
    };
    let mut parts = chart.parts().ok()?;
    for (panel, height) in parts.panels.iter_mut().zip(HEIGHTS) {
        panel.height = height;
    }
    let numbers = 0..=FEW_PERIODS;
    parts.panels[1].y.ticks = numbers.map(|n| (f64::from(n), n.to_string())).collect();
    parts.panels[0].bar = parts.bar.take();
    let noted = look.with_note(pooled);
    let layout = Layout::column(560.0);
    Some(parts.draw(NAME, &noted, layout))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(n: u64, has_phase: bool) -> Point {
        Point {
            drive_velocity: 1e-4,
            amplitude: 1e-6,
            period: Some(0.01),
            interval: Some(n as f64 * 0.01),
            periods: Some(n),
            phase: Some(-0.5),
            has_phase,
            ..Point::default()
        }
    }

    #[test]
    fn every_colour_is_explained() {
        let mut points = vec![point(1, true), point(4, true), point(7, false)];
        points[1].period = Some(0.02);
        let texts = |points: &[Point], texts: &[&str]| {
            let svg = intervals(points, &Look::default()).unwrap().svg();
            texts.iter().all(|text| svg.contains(&format!(">{text}<")))
        };
        assert!(texts(
            &points,
            &["Δ = 1 µm", "no preferred phase", "τ = nT", "4", "10"]
        ));
        let mut amplitudes = points.clone();
        amplitudes[1].amplitude = 3e-7;
        assert!(texts(&amplitudes, &["Δ = 0.3 µm", "Δ = 1 µm"]));
        let first = points[0];
        points.extend((1..9).map(|step| Point {
            drive_velocity: 1e-6 * f64::from(1 << step),
            ..first
        }));
        assert!(texts(&points, &["V₀ (m/s)", "no preferred phase"]));
    }

    #[test]
    fn without_two_periods_there_is_nothing_to_draw() {
        let still = Point {
            period: None,
            periods: None,
            ..point(1, false)
        };
        assert!(intervals(&[still, point(1, true)], &Look::default()).is_none());
    }
}
