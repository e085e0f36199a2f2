//! The overview of a sweep: what was found of the sets, over what was swept.

use super::beside::Beside;
use super::chart::{Chart, ChartRows, MAX_COLUMNS};
use super::picture::Picture;
use super::quantity::{Quantity, belongs_to_all};
use super::style::Look;
use crate::observe::Regime;
use crate::reduce::swept;
use crate::sets::SetRow;

pub(super) const NAME: &str = "overview";

/// What is shown: intervals, friction, time within slips, phases.
const QUANTITIES: [&str; 5] = [
    "tau_mean",
    "tau_sd",
    "mean_friction",
    "slip_share",
    "resultant_length",
];

/// Draws what was found of the sets over the swept parameter with the most values; the second gives colours, the third
/// panels. A single set is a dot over its velocity. `None` if nothing was found.
pub(super) fn overview(
    own: &[SetRow],
    control: Option<&SetRow>,
    beside: &Beside,
    look: &Look,
) -> Option<Picture> {
    let swept = swept(own);
    let (all, others) = beside.with_others(own.to_vec());
    let rows = &all[..];
    let quantity = |place: usize, option| Quantity::of(rows, option, swept.get(place)?.name()).ok();
    let x = quantity(0, "x").or_else(|| Quantity::of(rows, "x", "V0").ok())?;
    let shown = |y: &Quantity<'_>| -> Vec<usize> {
        (0..own.len())
            .filter(|&set| x.has(set) && y.has(set))
            .collect()
    };
    let is_plain = own.iter().all(|row| row.regime == Some(Regime::StickSlip));
    let ys: Vec<Quantity<'_>> = QUANTITIES
        .into_iter()
        .filter(|name| !is_plain || *name != "slip_share")
        .filter_map(|name| Quantity::of(rows, "y", name).ok())
        .filter(|y| !shown(y).is_empty())
        .collect();
    // No panel is to be empty.
    let fills_panels = |place: &usize| {
        let places = swept[*place].places();
        let mut values = places.clone();
        values.retain(|value| value.is_some() || !belongs_to_all(&swept[*place]));
        values.sort();
        values.dedup();
        let has_all = |y: &Quantity<'_>| {
            let sets = shown(y);
            let is_shown = |value: &Option<usize>| sets.iter().any(|&set| places[set] == *value);
            values.iter().all(is_shown)
        };
        values.len() <= MAX_COLUMNS && ys.iter().all(has_all)
    };
    let mut candidates = [2, 1].into_iter().filter(|_| swept.len() > 2);
    let of_panels = candidates.find(fills_panels);
    let colour = quantity(if of_panels == Some(1) { 2 } else { 1 }, "colour");
    let panels = of_panels.map(|place| swept[place].clone());
    Chart {
        of: "sets",
        rows: ChartRows {
            sets: rows,
            control,
            swept: &swept,
            beside,
            others,
        },
        x,
        ys,
        colour,
        panels,
    }
    .draw(NAME, look)
    .ok()
}

#[cfg(test)]
mod tests {
    use super::super::quantity::tests::set;
    use super::super::style::REFERENCE;
    use super::*;

    /// Sets with this spread of thresholds in N, under a modulation of this amplitude in m.
    fn spread(deviation: f64, amplitude: f64) -> SetRow {
        let mut set = set(amplitude, 0.02, 4.0);
        set.parameters.all.threshold_deviation = deviation;
        set
    }

    fn overview_of(sets: &[SetRow]) -> String {
        overview(sets, None, &Beside::default(), &Look::default())
            .unwrap()
            .svg()
    }

    #[test]
    fn an_overview_has_the_longest_axis_the_next_as_colours_and_the_third_as_panels() {
        let mut sets: Vec<SetRow> = [0.0, 0.0137, 0.137]
            .iter()
            .flat_map(|&dfs| [spread(dfs, 0.0), spread(dfs, 1e-6)])
            .collect();
        let svg = overview_of(&sets);
        for text in ["(c) Mean friction ⟨F", "Δ = 0", "Δ = 1 µm", "0.05"] {
            assert!(svg.contains(&format!(">{text}<")), "{text}");
        }
        assert!(
            svg.contains("Δfₛ (N)<")
                && !svg.contains("Share of time")
                && !svg.contains("by the drive alone")
        );
        let mut larger = sets.clone();
        for set in &mut larger {
            set.parameters.all.blocks = 9;
        }
        sets.extend(larger);
        let svg = overview_of(&sets);
        assert!(svg.contains(">N = 9<") && svg.contains(">N = 70<") && svg.contains(">Δ = 1 µm<"));
        for set in &mut sets {
            set.resultant_drive = Some(0.6);
        }
        let with = overview_of(&sets);
        assert!(with.contains(">by the drive alone<"));
        // A mark of few dashes, and curves of many.
        assert!(with.matches("<path").count() - svg.matches("<path").count() > 30);
        assert!(
            overview_of(&sets[..1]).contains("Drive velocity V₀"),
            "a single set"
        );
        assert!(overview(&[], None, &Beside::default(), &Look::default()).is_none());
    }

    #[test]
    fn sets_without_modulation_are_levels_over_the_frequency_and_the_first_amplitude() {
        let mut sets: Vec<SetRow> = [0.01, 0.02, 0.04]
            .map(|period| set(1e-6, period, 4.0))
            .to_vec();
        let dashes = |svg: &str| {
            svg.matches(&format!(r#"stroke="{}""#, REFERENCE.ink))
                .count()
        };
        let without = overview_of(&sets);
        sets.push(set(0.0, 1.0, 0.1));
        let with = overview_of(&sets);
        assert!(
            with.contains(">Δ = 0<")
                && !without.contains(">Δ = 0<")
                && dashes(&with) > dashes(&without) + 30
        );
        assert!(with.contains(">Modulation frequency 1/T (Hz)<") && !with.contains("not shown"));
        let amplitudes: Vec<SetRow> = (0..5)
            .map(|step| set(1e-6 * f64::from(step), 0.02, 4.0))
            .collect();
        let svg = overview_of(&amplitudes);
        assert!(svg.contains(">Amplitude Δ (µm)<") && svg.contains("of the peak force"));
    }

    #[test]
    fn sets_that_slide_are_open_circles_and_counted_where_there_is_no_interval() {
        let mut sets: Vec<SetRow> = (1..6)
            .map(|step| spread(0.01 * f64::from(step), 0.0))
            .collect();
        assert!(!overview_of(&sets).contains("slide"));
        for set in &mut sets[3..] {
            (set.regime, set.tau_mean, set.tau_deviation) = (Some(Regime::Sliding), None, None);
        }
        let svg = overview_of(&sets);
        assert!(
            svg.contains("2 of 5 sets slide: no")
                && svg.contains(">sliding<")
                && svg.contains("Share of time")
        );
        assert!(!svg.contains("not shown"));
    }
}
