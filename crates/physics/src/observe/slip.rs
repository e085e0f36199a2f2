//! Slips and precursors: what a row of each holds, and the phase φ of an onset against the modulation.

use super::drops::Drops;
use crate::columns::columns;
use crate::model::Drive;
use crate::model::theory::{eta, load_maximum_phase};
use crate::solver::Spent;
use crate::value::floored;
use std::f64::consts::{PI, TAU};

columns! {
    /// The cycle of the modulation in force at an onset.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Modulation {
        period as "T_onset": Option<f64> = "s",
            "period of the modulation at the onset, T unless ramped; null without modulation, and with a pulse",
            "T" "Period at the onset";
        amplitude as "Delta_onset": f64 = "m",
            "amplitude of the modulation at the onset, Delta unless ramped; 0 without modulation, or outside its pulse",
            "Δ" "Amplitude at the onset";
    }
}

impl Modulation {
    pub(super) fn of(drive: &Drive) -> Self {
        Self {
            period: (drive.period > 0.0 && drive.pulse().is_none()).then_some(drive.period),
            amplitude: drive.amplitude,
        }
    }

    /// η at the onset, under a drive at this velocity in m/s; 0 without modulation.
    pub fn eta(&self, drive_velocity: f64) -> f64 {
        self.period.map_or(0.0, |period| {
            eta(TAU / period, self.amplitude, drive_velocity)
        })
    }

    /// Number n of periods nearest to an interval in s; `None` without modulation.
    pub fn periods(&self, interval: f64) -> Option<u64> {
        self.period
            .map(|period| floored((interval / period).round()) as u64)
    }
}

columns! {
    /// What the drive put in from the previous slip's last break to the slip's own, and where it was lost; not in
    /// tables unless recorded.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Energies {
        work as "drive_work": Option<f64> = "J", "work of the drive since the last break of the previous slip; not there unless the sweep records energies, as what follows";
        damping as "damping_loss": Option<f64> = "J", "loss in damping in that time";
        broken as "break_loss": Option<f64> = "J", "energy of the contacts that broke in that time";
    }
}

impl Energies {
    pub(super) fn between(start: Spent, end: Spent) -> Self {
        Self {
            work: Some(end.work - start.work),
            damping: Some(end.damping - start.damping),
            broken: Some(end.broken - start.broken),
        }
    }
}

columns! {
    /// One slip: a rupture that breaks contacts at every block and lets go of at least half of those that held, and a
    /// tenth of all.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Slip {
        number as "slip": u64 = "", "number of the slip within its job, from 0 past start-up",
            "slip" "Number of the slip within its job";
        onset: f64 = "s", "time of the largest shear force since the previous slip's end", "t" "Time of the onset";
        interval: Option<f64> = "s", "time since the previous onset", "τ" "Interval";
        modulation: Modulation;
        periods: Option<u64> = "", "interval in periods T_onset, rounded; null without modulation", "n" "Interval in periods";
        phase: Option<f64> = "rad", "phase of the onset against the modulation", "φ" "Phase of the onset";
        peak_force: f64 = "N", "shear force at the onset", "F" "Shear force at the onset";
        drop: f64 = "N", "peak force minus the least shear force during the slip", "ΔF" "Force drop";
        nucleation: f64 = "s", "time of the first break";
        nucleation_block: u64 = "", "block of the first break, from 1 at the trailing edge";
        duration: f64 = "s", "from the first to the last break", "duration" "Duration of the slip";
        size: u64 = "", "breaks in the rupture", "size" "Breaks in the slip";
        attached_before: f64 = "", "fraction of the contacts that are attached before the first break";
        least_attached: f64 = "", "least fraction of the contacts that are attached during the rupture";
        distance as "slip_distance": f64 = "m", "mean distance that the blocks move, from the first to the last break",
            "distance" "Slip distance";
        edge_distance: f64 = "m", "distance that the driven edge moves in that time";
        onset_cut: bool = "", "whether the shear force still rose when the rupture reached the leading edge";
        front_speed: Option<f64> = "m/s", "speed of the rupture front", "speed" "Speed of the rupture front";
        precursors: u64 = "", "precursors since the previous slip", "precursors" "Precursors before the slip";
        largest_precursor: u64 = "", "breaks in the largest of them; 0 if there is none";
        slow_front_speed: Option<f64> = "m/s",
            "advance of the reach through these precursors; null for fewer than two";
        energies: Energies;
        drops: Drops;
    }
}

columns! {
    /// One precursor: a rupture of at least the precursor size that is no slip.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Precursor {
        slip: u64 = "", "number of the slip that it precedes";
        precursor: u64 = "", "number of the precursor before that slip, from 0";
        onset: f64 = "s", "time of the largest shear force since the previous rupture of at least this size";
        interval: Option<f64> = "s", "time since the onset of the previous precursor of the same slip";
        modulation: Modulation;
        nucleation: f64 = "s", "time of the first break";
        nucleation_block: u64 = "", "block of the first break, from 1 at the trailing edge";
        duration: f64 = "s", "from the first to the last break";
        size: u64 = "", "breaks in the rupture";
        extent: u64 = "", "distinct blocks with a break";
        length: f64 = "m", "the same times the length of a block, L/N";
        reach: u64 = "", "the furthest of them, from 1";
        front_speed: Option<f64> = "m/s", "speed of the rupture front";
    }
}

/// How far past Φ_max the window reaches, in rad, for η >= 1: a slip that inertia lets start a hair after the load's
/// maximum stays there and does not jump to the bottom. For η > 1.014 the window so moved still holds φ_min (which lies
/// 1.3 rad above Φ_max - 2π at η = 1.1 and further for larger η), so no slip above it is placed a turn too high.
pub const OVERSHOOT: f64 = 0.5;

/// Shift of a time from the nearest maximum of the modulation, 2π (t - m T)/T, in rad. Wrapped to (Φ_max - 2π, Φ_max]
/// plus [`OVERSHOOT`] for η >= 1, to (-π, π] below.
pub fn phase(time: f64, period: f64, eta: f64) -> f64 {
    let top = load_maximum_phase(eta).map_or(PI, |maximum| maximum + OVERSHOOT);
    let turns = time / period;
    let phase = TAU * (turns - turns.round());
    if phase > top {
        phase - TAU
    } else if phase <= top - TAU {
        phase + TAU
    } else {
        phase
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn slips_just_before_a_peak_have_a_small_negative_phase() {
        assert!((phase(0.99, 1.0, 100.0) + 0.01 * TAU).abs() < 1e-12);
        assert!((phase(7.25, 1.0, 0.5) - PI / 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_slip_a_hair_after_the_largest_load_does_not_jump_down() {
        let maximum = load_maximum_phase(20.0).unwrap();
        assert!((phase((maximum + 0.4) / TAU, 1.0, 20.0) - maximum - 0.4).abs() < 1e-12);
        assert!(phase((maximum + 0.6) / TAU, 1.0, 20.0) < -5.0);
    }

    proptest! {
        #[test]
        fn every_phase_lies_in_its_window(turns in 0.0_f64..1e4, eta in 0.01_f64..1e3) {
            let top = load_maximum_phase(eta).map_or(PI, |maximum| maximum + OVERSHOOT);
            let phase = phase(turns, 1.0, eta);
            prop_assert!(phase <= top && phase > top - TAU);
            let away = (phase / TAU - turns).rem_euclid(1.0);
            prop_assert!(away.min(1.0 - away) < 1e-9);
        }
    }
}
