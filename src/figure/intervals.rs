//! τ against T (Fig. 3c): slips, and the lines τ = nT on which locked intervals fall.

use super::axis::{Axis, bounds, logarithmic_bounds};
use super::frame::{LEGEND, Layout, LegendPlace, Mark, entry};
use super::picture::{Dot, INKS, Ink, Picture, Stroke};
use super::scatter::Scatter;
use crate::reduce::Point;
use std::collections::BTreeMap;

const LAYOUT: Layout = Layout::column(542.0, &[398.0], 0.0, LEGEND);
const RADIUS: f64 = 1.8;
/// Least ratio of n between two lines: closer ones would merge.
const MIN_RATIO: f64 = 1.4;

/// Draws interval against period, both logarithmic, with the lines τ = nT of the most frequent n; `None` without any
/// interval under modulation. Locked slips of these n have the colour of their line.
pub(super) fn intervals(points: &[Point]) -> Option<Picture> {
    let place = |point: &Point| Some((point.period?, point.interval?));
    let slips = Scatter::new(points, RADIUS, 0.4, place);
    let (low, high) = logarithmic_bounds(slips.xs())?;
    let x = Axis::logarithmic("Modulation period T (s)", low, high);
    let (low, high) = logarithmic_bounds(slips.ys())?;
    let frame = LAYOUT.frame(0, 0, x, Axis::logarithmic("Slip interval τ (s)", low, high));
    let mut sheet = LAYOUT.sheet("tau-T");
    let lines: Vec<(u64, Ink)> = frequent_periods(points).into_iter().zip(INKS).collect();
    let stroke = |ink| Stroke::solid(ink, 1.6);

    frame.clipped(&mut sheet, |sheet| {
        let of = |n| points.iter().filter(move |point| point.periods == Some(n));
        for &(n, ink) in &lines {
            // Only where there are slips with this n, and a little further.
            if let Some((first, last)) = bounds(of(n).filter_map(|point| point.period)) {
                let ends = [first / 1.25, last * 1.25];
                frame.curve(sheet, ends.map(|period| (period, n as f64 * period)), stroke(ink));
            }
        }
        slips.draw(sheet, &frame);
        for &(n, ink) in &lines {
            frame.points(sheet, of(n).filter(|point| point.is_locked).filter_map(place), Dot::solid(ink, RADIUS));
        }
    });
    frame.axes(&mut sheet);
    frame.x_label(&mut sheet);
    frame.y_label(&mut sheet);
    let mut entries = slips.legend().to_vec();
    entries.extend(lines.iter().map(|&(n, ink)| {
        entry(Mark::Line(stroke(ink)), if n == 1 { "τ = T".to_owned() } else { format!("τ = {n} T") })
    }));
    frame.legend(&mut sheet, LegendPlace::Beside, &entries);
    Some(sheet.finish())
}

/// The n of the most slips, locked ones if there are any, not too close to each other; ascending, at most one per ink.
fn frequent_periods(points: &[Point]) -> Vec<u64> {
    let has_locked = points.iter().any(|point| point.is_locked && point.periods.is_some_and(|n| n > 0));
    let mut counts: BTreeMap<u64, u64> = BTreeMap::new();
    for point in points.iter().filter(|point| point.is_locked || !has_locked) {
        if let Some(n) = point.periods.filter(|&n| n > 0) {
            *counts.entry(n).or_default() += 1;
        }
    }
    let mut by_count: Vec<(u64, u64)> = counts.into_iter().collect();
    by_count.sort_by_key(|&(n, count)| (std::cmp::Reverse(count), n));
    let mut chosen: Vec<u64> = Vec::new();
    for (n, _) in by_count {
        let is_apart = |other: &u64| (n.max(*other) as f64) >= MIN_RATIO * n.min(*other) as f64;
        if chosen.len() < INKS.len() && chosen.iter().all(is_apart) {
            chosen.push(n);
        }
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(n: u64, is_locked: bool) -> Point {
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
            is_locked,
        }
    }

    #[test]
    fn lines_are_those_of_the_most_locked_slips_and_do_not_merge() {
        let mut points = vec![point(4, true); 10];
        points.extend(vec![point(5, true); 8]);
        points.extend(vec![point(8, true); 6]);
        points.extend(vec![point(1, true); 2]);
        points.extend(vec![point(30, false); 50]);
        assert_eq!(frequent_periods(&points), [1, 4, 8]);
        assert_eq!(frequent_periods(&points[26..]), [30]);
    }

    #[test]
    fn without_modulation_there_is_nothing_to_draw() {
        let still = Point { period: None, periods: None, ..point(1, false) };
        assert!(intervals(&[still]).is_none());
    }
}
