//! Mean friction over the amplitude of the modulated force: small perturbations do not change it, large ones lower it.

use super::axis::{Axis, bounds};
use super::frame::{Frame, LEGEND, LegendPlace, Mark};
use super::picture::{BLACK, Dot, GREY, INKS, LIGHT_GREY, Picture, Sheet, Stroke};
use super::sets::{distinct, frequency, swept};
use crate::reduce::{SetSummary, Statistic};

const SIZE: (f64, f64) = (840.0, 460.0);
/// Least amplitudes, zero included, and most periods of the figure.
const LEAST_AMPLITUDES: usize = 5;
const MOST_PERIODS: usize = 3;
/// Where the paper finds a significant reduction to begin, as a share of the peak force.
const REDUCTION: (f64, f64) = (0.2, 0.3);
const FREE: Stroke = Stroke::dashed(GREY, 1.4, (6.0, 4.0));

/// Draws sets that differ in the modulation alone, with 5 amplitudes or more and at most
/// 3 periods; `None` for others. Forces are told over those at Δ = 0, or in N if there is no such set.
pub fn friction(sets: &[SetSummary]) -> Option<Picture> {
    let amplitudes = distinct(sets, |parameters| Some(parameters.modulation_amplitude));
    let periods = distinct(sets, |parameters| parameters.modulation_period);
    let all: Vec<&SetSummary> = sets.iter().collect();
    let fits = amplitudes.len() >= LEAST_AMPLITUDES && (1..=MOST_PERIODS).contains(&periods.len());
    if !fits || !swept(&all).is_empty() {
        return None;
    }
    let scale = Scale::of(sets);
    let frame = frame(sets, &scale)?;
    let mut sheet = Sheet::new("friction", SIZE);
    let mut entries = Vec::new();
    if scale.is_relative {
        frame.clipped(&mut sheet, |sheet| {
            frame.stripe(sheet, REDUCTION.0, REDUCTION.1, LIGHT_GREY, 0.4);
            frame.curve(sheet, [(frame.x.low, 1.0), (frame.x.high, 1.0)], FREE);
        });
    }
    let modulated = periods.iter().zip(INKS).map(|(&period, ink)| (Some(period), ink, frequency(period)));
    let free = scale.is_relative.then(|| (None, BLACK, "Δ = 0".to_owned()));
    for (period, ink, name) in modulated.chain(free) {
        let such = sets.iter().filter(|set| set.parameters.modulation_period == period);
        let mut points: Vec<(f64, Statistic)> = such.filter_map(|set| scale.point(set)).collect();
        points.sort_by(|left, right| left.0.total_cmp(&right.0));
        let values = || points.iter().map(|&(x, friction)| (x, friction.value));
        frame.clipped(&mut sheet, |sheet| {
            frame.curve(sheet, values(), Stroke::solid(ink, 1.4));
            for &(x, friction) in &points {
                frame.error_bar(sheet, x, friction.interval, ink);
            }
        });
        let dot = Dot { ink, radius: 4.5, opacity: 1.0 };
        frame.points(&mut sheet, values(), dot);
        entries.push((Mark::Dot(dot), name));
    }
    if scale.is_relative {
        entries.push((Mark::Patch(LIGHT_GREY, 0.4), "paper's threshold".to_owned()));
    }
    frame.axes(&mut sheet, true);
    frame.x_label(&mut sheet);
    frame.y_label(&mut sheet);
    frame.legend(&mut sheet, LegendPlace::Beside, &entries);
    Some(sheet.finish())
}

/// In what forces are told: in the peak force and the mean friction at Δ = 0, or in N.
struct Scale {
    peak: f64,
    mean: f64,
    is_relative: bool,
}

impl Scale {
    fn of(sets: &[SetSummary]) -> Self {
        let free = sets.iter().find(|set| set.parameters.modulation_period.is_none());
        match free.and_then(|set| Some((set.peak_force?, set.mean_friction?.value))) {
            Some((peak, mean)) => Self { peak, mean, is_relative: true },
            None => Self { peak: 1.0, mean: 1.0, is_relative: false },
        }
    }

    /// `K_d` Δ and the mean friction of a set.
    fn point(&self, set: &SetSummary) -> Option<(f64, Statistic)> {
        let force = set.parameters.drive_stiffness * set.parameters.modulation_amplitude;
        Some((force / self.peak, set.mean_friction?.times(1.0 / self.mean)))
    }
}

fn frame(sets: &[SetSummary], scale: &Scale) -> Option<Frame> {
    let (x_label, y_label) = if scale.is_relative {
        ("Force amplitude ΔFₛ / peak force Fₘ at Δ = 0", "Mean friction over that at Δ = 0")
    } else {
        ("Force amplitude ΔFₛ (N)", "Mean friction (N)")
    };
    let points = || sets.iter().filter_map(|set| scale.point(set));
    let (_, widest) = bounds(points().map(|point| point.0))?;
    let (least, most) = bounds(points().flat_map(|point| point.1.ends()))?;
    let x = Axis::linear(x_label, -0.02 * widest, 1.04 * widest);
    Some(Frame::filling(SIZE, LEGEND, x, Axis::around(y_label, least, most)))
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
