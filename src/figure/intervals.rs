//! τ against T (Fig. 3c): slips, and the lines τ = nT on which locked intervals fall.

use super::FigureError;
use super::axis::{Axis, bounds, logarithmic_bounds};
use super::frame::{Frame, LEGEND, LegendPlace, Mark};
use super::picture::{BLACK, Dot, GREY, INKS, Picture, Sheet, Stroke};
use crate::reduce::Point;
use std::collections::BTreeMap;

const SIZE: (f64, f64) = (840.0, 500.0);
const ANY_SLIP: Dot = Dot { ink: GREY, radius: 1.8, opacity: 0.4 };
const LOCKED_SLIP: Dot = Dot { ink: BLACK, radius: 1.8, opacity: 0.4 };
/// Least ratio of n between two lines: closer ones would merge.
const APART: f64 = 1.4;

/// Draws interval against period, both logarithmic, with the lines τ = nT of the most frequent n. Locked slips of such an n
/// have the colour of its line.
///
/// # Errors
/// When no point has both an interval and a period.
pub fn intervals(points: &[Point]) -> Result<Picture, FigureError> {
    const NAME: &str = "tau-T";
    let empty = || FigureError::Empty { figure: NAME, what: "intervals under modulation" };
    let slips: Vec<(f64, f64, bool)> =
        points.iter().filter_map(|point| Some((point.period?, point.interval?, point.is_locked))).collect();
    let (low, high) = logarithmic_bounds(slips.iter().map(|slip| slip.0)).ok_or_else(empty)?;
    let x = Axis::logarithmic("Modulation period T (s)", low, high);
    let (low, high) = logarithmic_bounds(slips.iter().map(|slip| slip.1)).ok_or_else(empty)?;
    let frame = Frame::filling(SIZE, LEGEND, x, Axis::logarithmic("Slip interval τ (s)", low, high));
    let mut sheet = Sheet::new(NAME, SIZE);
    let lines = frequent_periods(points);
    let stroke = |index: usize| Stroke::solid(INKS[index], 1.6);

    frame.clipped(&mut sheet, |sheet| {
        for (index, &n) in lines.iter().enumerate() {
            // Only where there are slips with this n, and a little further.
            let such = points.iter().filter(|point| point.periods == Some(n)).filter_map(|point| point.period);
            if let Some((first, last)) = bounds(such) {
                let ends = [first / 1.25, last * 1.25];
                frame.curve(sheet, ends.map(|period| (period, n as f64 * period)), stroke(index));
            }
        }
        for (locked, dot) in [(false, ANY_SLIP), (true, LOCKED_SLIP)] {
            frame.points(sheet, slips.iter().filter(|slip| slip.2 == locked).map(|slip| (slip.0, slip.1)), dot);
        }
        for (index, &n) in lines.iter().enumerate() {
            let such = points.iter().filter(|point| point.is_locked && point.periods == Some(n));
            let dot = Dot { ink: INKS[index], opacity: 1.0, ..LOCKED_SLIP };
            frame.points(sheet, such.filter_map(|point| Some((point.period?, point.interval?))), dot);
        }
    });
    frame.axes(&mut sheet, true);
    frame.x_label(&mut sheet);
    frame.y_label(&mut sheet);
    let mut entries = vec![
        (Mark::Dot(LOCKED_SLIP), "slips of locked sets".to_owned()),
        (Mark::Dot(ANY_SLIP), "other slips".to_owned()),
    ];
    entries.extend(lines.iter().enumerate().map(|(index, n)| {
        (Mark::Line(stroke(index)), if *n == 1 { "τ = T".to_owned() } else { format!("τ = {n} T") })
    }));
    frame.legend(&mut sheet, LegendPlace::Beside, &entries);
    Ok(sheet.finish())
}

/// The n of the most slips, locked ones if there are any, not too close to each other; ascending.
fn frequent_periods(points: &[Point]) -> Vec<u64> {
    let count = |only_locked: bool| {
        let mut counts: BTreeMap<u64, u64> = BTreeMap::new();
        let such = points.iter().filter(|point| point.is_locked || !only_locked);
        such.filter_map(|point| point.periods).filter(|&n| n > 0).for_each(|n| *counts.entry(n).or_default() += 1);
        counts
    };
    let counts = Some(count(true)).filter(|counts| !counts.is_empty()).unwrap_or_else(|| count(false));
    let mut by_count: Vec<(u64, u64)> = counts.into_iter().collect();
    by_count.sort_by_key(|&(n, count)| (std::cmp::Reverse(count), n));
    let mut chosen: Vec<u64> = Vec::new();
    for (n, _) in by_count {
        let is_apart = |other: &u64| (n.max(*other) as f64) >= APART * n.min(*other) as f64;
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
        assert!(matches!(intervals(&[still]), Err(FigureError::Empty { .. })));
    }
}
