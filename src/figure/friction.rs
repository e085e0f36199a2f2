//! Mean friction over the amplitude of the modulated force: small perturbations do not change it, large ones lower it.

use super::axis::{Axis, bounds};
use super::frame::Layout;
use super::legend::{Entry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::sets::{Modulations, frequency};
use super::style::{BLACK, INKS, Look, RADIUS, REFERENCE, STRIPE, curve, dot};
use crate::reduce::{SetRow, Statistic};

/// Least amplitudes, zero included, and most periods of the figure.
const MIN_AMPLITUDES: usize = 5;
const MAX_PERIODS: usize = 3;
/// Where the paper finds a significant reduction to begin, as a share of the peak force.
const REDUCTION: (f64, f64) = (0.2, 0.3);
/// Draws sets that differ in the modulation alone, with 5 amplitudes or more and at most
/// 3 periods; `None` for others. Forces are in units of those at Δ = 0, or in N if there is no such set.
pub(super) fn friction(sets: &[SetRow], look: &Look) -> Option<Picture> {
    let Modulations { free, amplitudes, periods, .. } = Modulations::of(sets.iter())?;
    let amplitudes = amplitudes.len() + usize::from(free.is_some());
    if amplitudes < MIN_AMPLITUDES || !(1..=MAX_PERIODS).contains(&periods.len()) {
        return None;
    }
    let units = free.and_then(|set| Some((set.peak_force_mean?, set.mean_friction?)));
    let (peak_force, mean_friction) = units.unwrap_or((1.0, 1.0));
    let point = |set: &SetRow| {
        let force = set.parameters.drive_stiffness * set.parameters.modulation_amplitude;
        let friction = Statistic::of(set.mean_friction, set.mean_friction_interval)?;
        Some((force / peak_force, friction.times(1.0 / mean_friction)))
    };
    let points = || sets.iter().filter_map(point);
    let (_, widest) = bounds(points().map(|point| point.0))?;
    let (least, most) = bounds(points().flat_map(|point| point.1.ends()))?;
    let (x_label, y_label) = if units.is_some() {
        ("Amplitude ΔFₛ = Kd Δ of the force / peak force Fₘ at Δ = 0", "Mean friction ⟨Fₛ⟩ / mean friction at Δ = 0")
    } else {
        ("Amplitude ΔFₛ = Kd Δ of the force (N)", "Mean friction ⟨Fₛ⟩ (N)")
    };
    let x = Axis::linear(x_label, -0.02 * widest, 1.04 * widest);
    let modulated = periods.iter().zip(INKS).map(|(&period, ink)| (Some(period), ink, frequency(period)));
    let lines: Vec<_> = modulated.chain(units.map(|_| (None, BLACK, "Δ = 0".to_owned()))).collect();
    let mut entries: Vec<Entry> = lines.iter().map(|(_, ink, name)| entry(Mark::Bar(dot(ink)), name)).collect();
    entries.extend(units.map(|_| entry(Mark::Patch(STRIPE), "0.2 to 0.3: reduction begins, according to the paper")));
    let mut layers = Vec::new();
    if units.is_some() {
        layers.push(Layer::Inside(vec![Layer::Stripe(REDUCTION, STRIPE), Layer::Level(1.0, REFERENCE)]));
    }
    for (period, ink, _) in lines {
        let of_period = sets.iter().filter(|set| set.parameters.modulation_period == period);
        let mut points: Vec<(f64, Statistic)> = of_period.filter_map(point).collect();
        points.sort_by(|left, right| left.0.total_cmp(&right.0));
        layers.extend(Layer::statistics(&points, curve(ink), RADIUS));
    }
    let panel = Panel::new(340.0, x, Axis::rounded(y_label, least.min(0.0), most), layers);
    Some(panel::draw("friction", look, Layout::column(558.0), &entries, vec![panel]))
}

#[cfg(test)]
mod tests {
    use super::super::sets::tests::set;
    use super::*;

    #[test]
    fn forces_are_in_units_of_those_without_modulation_if_these_are_known() {
        let mut sets: Vec<SetRow> = (1..=5).map(|step| set(1e-6 * f64::from(step), 0.02, 4.0)).collect();
        assert!(friction(&sets, &Look::default()).unwrap().svg().contains(">Mean friction ⟨Fₛ⟩ (N)<"));
        sets.push(set(0.0, 1.0, 1.0));
        let svg = friction(&sets, &Look::default()).unwrap().svg();
        assert!(svg.contains(">Mean friction ⟨Fₛ⟩ / mean friction at Δ = 0<") && svg.contains(">1/T = 50 Hz<"));
        assert!(friction(&sets[2..], &Look::default()).is_none(), "four amplitudes");
        sets.extend([0.03, 0.04, 0.05].map(|period| set(1e-6, period, 4.0)));
        assert!(friction(&sets, &Look::default()).is_none(), "four periods");
    }
}
