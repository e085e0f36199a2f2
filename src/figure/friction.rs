//! Mean friction over the amplitude of the modulated force: small perturbations do not change it, large ones lower it.

use super::axis::{Axis, bounds};
use super::frame::{Frame, LEGEND, LegendPlace, Mark};
use super::picture::{BLACK, Dot, GREY, INKS, LIGHT_GREY, Picture, Sheet, Stroke};
use super::sets::{distinct, frequency, swept};
use crate::reduce::{Estimate, SetSummary};

const SIZE: (f64, f64) = (840.0, 460.0);
/// Least amplitudes, zero included, and most periods of the figure.
const LEAST_AMPLITUDES: usize = 5;
const MOST_PERIODS: usize = 3;
/// Where the paper finds a significant reduction to begin, as a share of the peak force.
const REDUCTION: (f64, f64) = (0.2, 0.3);
const FREE: Stroke = Stroke::dashed(GREY, 1.4, (6.0, 4.0));

/// Draws sets that differ in the modulation alone, with [`LEAST_AMPLITUDES`] amplitudes or more and at most
/// [`MOST_PERIODS`] periods; `None` for others. Forces are told over those at Δ = 0, or in N if there is no such set.
pub fn friction(sets: &[SetSummary]) -> Option<Picture> {
    let amplitudes = distinct(sets, |parameters| Some(parameters.modulation_amplitude));
    let periods = distinct(sets, |parameters| parameters.modulation_period);
    let all: Vec<&SetSummary> = sets.iter().collect();
    let fits = amplitudes.len() >= LEAST_AMPLITUDES && (1..=MOST_PERIODS).contains(&periods.len());
    if !fits || !swept(&all).is_empty() {
        return None;
    }
    let free = sets.iter().find(|set| set.parameters.modulation_period.is_none());
    let free = free.and_then(|set| Some((set.peak_force?, set.mean_friction?)));
    let (peak, mean) = free.map_or((1.0, 1.0), |(peak, friction)| (peak, friction.value));
    let (x_label, y_label) = match free {
        Some(_) => ("Force amplitude ΔFₛ / peak force Fₘ at Δ = 0", "Mean friction over that at Δ = 0"),
        None => ("Force amplitude ΔFₛ (N)", "Mean friction (N)"),
    };
    let over = |estimate: Estimate| Estimate {
        value: estimate.value / mean,
        interval: estimate.interval.map(|(low, high)| (low / mean, high / mean)),
    };
    let point = |set: &SetSummary| {
        let force = set.parameters.drive_stiffness * set.parameters.modulation_amplitude;
        Some((force / peak, over(set.mean_friction?)))
    };
    let (_, high) = bounds(sets.iter().filter_map(point).map(|point| point.0))?;
    let ends = |(_, friction): (f64, Estimate)| {
        let (low, high) = friction.interval.unwrap_or((friction.value, friction.value));
        [low, friction.value, high]
    };
    let (least, most) = bounds(sets.iter().filter_map(point).flat_map(ends))?;
    let frame = Frame::filling(
        SIZE,
        LEGEND,
        Axis::linear(x_label, -0.02 * high, 1.04 * high),
        Axis::around(y_label, least, most),
    );

    let mut sheet = Sheet::new("friction", SIZE);
    let mut entries = Vec::new();
    if free.is_some() {
        frame.clipped(&mut sheet, |sheet| {
            frame.stripe(sheet, REDUCTION.0, REDUCTION.1, LIGHT_GREY, 0.4);
            frame.curve(sheet, [(frame.x.low, 1.0), (frame.x.high, 1.0)], FREE);
        });
    }
    let mut draw = |sheet: &mut Sheet, period: Option<f64>, ink| {
        let such = sets.iter().filter(|set| set.parameters.modulation_period == period);
        let mut points: Vec<(f64, Estimate)> = such.filter_map(point).collect();
        points.sort_by(|left, right| left.0.total_cmp(&right.0));
        let dot = Dot { ink, radius: 4.5, opacity: 1.0 };
        frame.clipped(sheet, |sheet| {
            frame.curve(sheet, points.iter().map(|&(x, friction)| (x, friction.value)), Stroke::solid(ink, 1.4));
            for &(x, friction) in &points {
                frame.error_bar(sheet, x, friction.interval, ink);
            }
        });
        frame.points(sheet, points.iter().map(|&(x, friction)| (x, friction.value)), dot);
        let name = period.map_or_else(|| "Δ = 0".to_owned(), frequency);
        entries.push((Mark::Dot(dot), name));
    };
    periods.iter().zip(INKS).for_each(|(&period, ink)| draw(&mut sheet, Some(period), ink));
    if free.is_some() {
        draw(&mut sheet, None, BLACK);
        entries.push((Mark::Patch(LIGHT_GREY, 0.4), "paper's threshold".to_owned()));
    }
    frame.axes(&mut sheet, true);
    frame.x_label(&mut sheet);
    frame.y_label(&mut sheet);
    frame.legend(&mut sheet, LegendPlace::Beside, &entries);
    Some(sheet.finish())
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;

    #[test]
    fn forces_are_told_over_those_without_modulation_if_these_are_known() {
        let mut sets: Vec<SetSummary> = (1..=5).map(|step| set(1e-6 * f64::from(step), 0.02, 4.0)).collect();
        assert!(friction(&sets).unwrap().svg().contains(">Mean friction (N)<"));
        sets.push(set(0.0, 1.0, 1.0));
        let svg = friction(&sets).unwrap().svg();
        assert!(svg.contains(">Mean friction over that at Δ = 0<") && svg.contains(">1/T = 50 Hz<"));
        assert!(friction(&sets[2..]).is_none(), "four amplitudes");
        sets.extend([0.03, 0.04, 0.05].map(|period| set(1e-6, period, 4.0)));
        assert!(friction(&sets).is_none(), "four periods");
    }
}
