//! The φ-η backbone: phases pooled in logarithmic bins of η (Fig. 3e).

use super::estimate::{Estimate, Units, length};
use super::set::{FinishedSet, top_of_phases};
use crate::model::theory::{minimum_phase, minimum_phase_asymptote};
use crate::table::columns::{Class, columns};
use crate::table::tables;
use crate::table::value::floored;
use serde::Serialize;
use std::collections::BTreeMap;

/// Bins per decade. Their edges are 10^(k/4), so that one lies on η = 1, where locking begins.
const BINS_PER_DECADE: i32 = 4;

columns! {
    /// A bin of η that holds at least one slip. `None` where there is nothing to average.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
    pub struct BackboneBin {
        eta_low: f64 = "", "lower edge of the bin, included";
        eta_high: f64 = "", "upper edge, excluded";
        eta_centre: f64 = "", "geometric centre";
        sets: u64 = "", "parameter sets, of two slips or more";
        phased_sets: u64 = "", "of these, sets that have a phase (`has_phase`)";
        slips: u64 = "", "slips of all sets";
        phase_mean: Option<f64> = "rad", "circular mean of the phase of all slips";
        phase_mean_low: Option<f64> = "rad",
            "lower end of its 95 % confidence interval, for these sets; the whole turn if no direction is excluded", "", Class::Low;
        phase_mean_high: Option<f64> = "rad", "upper end", "", Class::High;
        resultant_length: Option<f64> = "", "|<exp(i phi)>| of all slips";
        set_phase_mean: Option<f64> = "rad", "circular mean over the sets that have a phase of their mean phase";
        set_phase_mean_low: Option<f64> = "rad", "lower end of its 95 % confidence interval, for these sets", "", Class::Low;
        set_phase_mean_high: Option<f64> = "rad", "upper end", "", Class::High;
        phase_minimum as "phi_min": Option<f64> = "rad", "least phase of Eq. 2 at the centre; null for eta < 1";
        asymptote: f64 = "rad", "-2 sqrt(pi / eta) at the centre";
    }
}

tables! { BackboneBin = "backbone", "One row per bin of eta that holds slips, four bins per decade"; }

#[derive(Clone, Debug, Default)]
pub(super) struct Backbone {
    bins: BTreeMap<i32, Bin>,
}

#[derive(Clone, Debug, Default)]
struct Bin {
    sets: u64,
    phases: Units,
    slips: u64,
    /// Mean phases of the sets that have one.
    means: Units,
    phased_sets: u64,
}

fn edge(bin: i32) -> f64 {
    libm::exp10(f64::from(bin) / f64::from(BINS_PER_DECADE))
}

fn bin_of(eta: f64) -> i32 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the logarithm of a double is small"
    )]
    let bin = (libm::log10(eta) * f64::from(BINS_PER_DECADE)).floor() as i32;
    // The logarithm rounds; the edges decide.
    let mut near = bin - 1..=bin + 1;
    near.rfind(|bin| edge(*bin) <= eta).unwrap_or(bin)
}

impl Backbone {
    /// Adds a set. Left out are sets without modulation, which have no phase, with a ramp, which have no single η, and
    /// with a single slip, whose phase has no interval.
    pub(super) fn push(&mut self, set: &FinishedSet) {
        let [slips, ..] = set.phases.total();
        if set.row.parameters.ramp_time > 0.0 || slips < 2.0 {
            return;
        }
        let bin = self.bins.entry(bin_of(set.row.eta)).or_default();
        bin.sets += 1;
        bin.slips += floored(slips) as u64;
        bin.phases.merge(&set.phases);
        if set.row.has_phase
            && let Some((phase, _)) = set.phases.direction(top_of_phases(set.row.eta), 0.0)
        {
            bin.phased_sets += 1;
            bin.means.push_angle(&phase);
        }
    }

    pub(super) fn finish(self) -> Vec<BackboneBin> {
        let row = |(index, bin): (i32, Bin)| {
            let eta_low = edge(index);
            let eta_high = edge(index + 1);
            let eta_centre = (eta_low * eta_high).sqrt();
            let top = top_of_phases(eta_centre);
            let [phases, means] = [&bin.phases, &bin.means].map(|units| units.direction(top, 0.0));
            let value = |found: &Option<(Estimate, _)>| {
                found.as_ref().map(|(direction, _)| direction.value)
            };
            let interval = phases.as_ref().and_then(|(_, interval)| *interval);
            let means_interval = means.as_ref().and_then(|(_, interval)| *interval);
            BackboneBin {
                eta_low,
                eta_high,
                eta_centre,
                sets: bin.sets,
                phased_sets: bin.phased_sets,
                slips: bin.slips,
                phase_mean: value(&phases),
                phase_mean_low: interval.map(|interval| interval.low),
                phase_mean_high: interval.map(|interval| interval.high),
                resultant_length: length(bin.phases.total()),
                set_phase_mean: value(&means),
                set_phase_mean_low: means_interval.map(|interval| interval.low),
                set_phase_mean_high: means_interval.map(|interval| interval.high),
                phase_minimum: minimum_phase(eta_centre),
                asymptote: minimum_phase_asymptote(eta_centre),
            }
        };
        self.bins.into_iter().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::estimate::tests::Draws;
    use super::super::set::SetSlips;
    use super::super::set::tests::{jobs, slip};
    use super::*;

    #[test]
    fn eta_of_one_begins_a_bin() {
        assert_eq!((bin_of(1.0), bin_of(1.0_f64.next_down())), (0, -1));
        for bin in -20..20 {
            assert_eq!(bin_of(edge(bin)), bin);
            assert_eq!(bin_of(edge(bin).next_down()), bin - 1);
        }
    }

    #[test]
    fn blue_dots_average_sets_that_have_a_phase_and_each_set_counts_once() {
        let mut backbone = Backbone::default();
        let mut push = |period: f64, phases: &[f64]| {
            let jobs = jobs(1e-6, period);
            let mut set = SetSlips::default();
            for &phase in phases {
                set.push(0, &slip(None, Some(phase)));
            }
            backbone.push(&set.finish(&jobs));
        };
        // All in the bin 5.6 to 10; the third is all over the circle.
        push(0.01, &[-1.0; 20]);
        push(0.009, &[-0.6; 60]);
        push(0.0095, &[-4.0, -2.0, 0.0, 2.0]);
        let bins = backbone.finish();
        assert_eq!(bins.len(), 1);
        assert_eq!(
            (bins[0].sets, bins[0].phased_sets, bins[0].slips),
            (3, 2, 84)
        );
        assert!((bins[0].set_phase_mean.unwrap() + 0.8).abs() < 1e-12);
        assert!(bins[0].phase_mean.unwrap() > -0.8);
        assert!((bins[0].eta_centre - 10_f64.powf(0.875)).abs() < 1e-12);
    }

    /// The bin of sets of these phases, each of the jobs of some seeds.
    fn bin(sets: &[(u64, &[f64])]) -> BackboneBin {
        let mut backbone = Backbone::default();
        for &(seed, phases) in sets {
            let jobs = jobs(1e-6, 0.01);
            let mut set = SetSlips::default();
            for &phase in phases {
                set.push(seed, &slip(None, Some(phase)));
            }
            backbone.push(&set.finish(&jobs));
        }
        backbone.finish()[0]
    }

    fn width(bin: &BackboneBin) -> f64 {
        bin.phase_mean_high.unwrap() - bin.phase_mean_low.unwrap()
    }

    #[test]
    fn variances_add_over_sets_of_other_seeds_and_single_slips_do_not_count() {
        let mut draws = Draws::new(2);
        let mut job = || {
            (0..15)
                .map(|_| -0.9 + 0.1 * draws.normal())
                .collect::<Vec<f64>>()
        };
        let jobs: Vec<Vec<f64>> = (0..8).map(|_| job()).collect();
        let sets = |copies: u64| -> Vec<(u64, &[f64])> {
            let seeds = (0..8 * copies).zip(jobs.iter().cycle());
            seeds.map(|(seed, job)| (seed, job.as_slice())).collect()
        };
        let eight = bin(&sets(1));
        let more = bin(&sets(4));
        // Half as wide, and less with more degrees of freedom.
        let ratio = width(&more) / width(&eight);
        assert!((0.485..0.5).contains(&ratio), "{ratio}");
        // One slip says nothing about the spread.
        let with_single = bin(&[(0, &jobs[0]), (1, &[-0.9])]);
        assert_eq!((with_single.sets, with_single.slips), (1, 15));
    }

    #[test]
    fn sets_that_are_the_same_for_a_seed_tell_no_more_than_one_of_them() {
        let mut draws = Draws::new(1);
        let phases: Vec<f64> = (0..40).map(|_| -0.9 + 0.1 * draws.normal()).collect();
        let one = bin(&[(0, &phases)]);
        let six = bin(&[(0, phases.as_slice()); 6]);
        assert!(
            (width(&six) / width(&one) - 1.0).abs() < 1e-9,
            "{}",
            width(&six) / width(&one)
        );
        // So do means of sets.
        let of_sets =
            |bin: &BackboneBin| bin.set_phase_mean_high.unwrap() - bin.set_phase_mean_low.unwrap();
        assert!(
            (of_sets(&six) / of_sets(&one) - 1.0).abs() < 1e-9
                && (of_sets(&one) / width(&one) - 1.0).abs() < 0.05
        );
    }

    #[test]
    fn the_interval_of_sets_with_seeds_in_common_covers() {
        // Twelve sets of two seeds with 15 slips, whose phases have a correlation of 0.8 from set to set, slip by slip.
        const REPETITIONS: u64 = 600;
        let holds = |repetition: u64| {
            let mut draws = Draws::new(repetition);
            let mut backbone = Backbone::default();
            let shared: Vec<f64> = (0..30).map(|_| draws.normal()).collect();
            for _ in 0..12 {
                let jobs = jobs(1e-6, 0.01);
                let mut set = SetSlips::default();
                for (seed, of_seed) in (0..).zip(shared.chunks(15)) {
                    for shared in of_seed {
                        let phase =
                            0.3 * (0.8_f64.sqrt() * shared + 0.2_f64.sqrt() * draws.normal()) - 0.9;
                        set.push(seed, &slip(None, Some(phase)));
                    }
                }
                backbone.push(&set.finish(&jobs));
            }
            let bin = backbone.finish()[0];
            let holds =
                |low: Option<f64>, high: Option<f64>| low.unwrap() <= -0.9 && -0.9 <= high.unwrap();
            [
                holds(bin.phase_mean_low, bin.phase_mean_high),
                holds(bin.set_phase_mean_low, bin.set_phase_mean_high),
            ]
        };
        let all: Vec<[bool; 2]> = (0..REPETITIONS).map(holds).collect();
        for of in [0, 1] {
            let found =
                100.0 * all.iter().filter(|held| held[of]).count() as f64 / REPETITIONS as f64;
            // Standard error 0.9. Sets that count as independent would hold it in half of the repetitions.
            assert!((93.0..98.5).contains(&found), "{of}: {found}");
        }
    }
}
