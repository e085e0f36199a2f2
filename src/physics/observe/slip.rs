//! Slips and precursors: what a row of each holds.

use super::drops::Drops;
use crate::columns::columns;
use crate::model::Drive;
use crate::model::theory::eta;
use crate::solver::Spent;
use crate::value::floored;
use std::f64::consts::TAU;

columns! {
    /// The cycle of the modulation in force at an onset.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Modulation {
        period as "T_onset": Option<f64> = "s",
            "period of the modulation at the onset, T unless ramped; null without modulation";
        amplitude as "Delta_onset": f64 = "m",
            "amplitude of the modulation at the onset, Delta unless ramped; 0 without modulation";
    }
}

impl Modulation {
    pub(super) fn of(drive: &Drive) -> Self {
        Self {
            period: (drive.period > 0.0).then_some(drive.period),
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
    /// One slip: a rupture that breaks contacts at every block and lets go of at least half of those that held, and a tenth
    /// of all.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Slip {
        number as "slip": u64 = "", "number of the slip within its job, from 0 past start-up";
        onset: f64 = "s", "time of the largest shear force since the previous slip's end";
        interval: Option<f64> = "s", "time since the previous onset";
        modulation: Modulation;
        periods: Option<u64> = "", "interval in periods T_onset, rounded; null without modulation";
        phase: Option<f64> = "rad", "phase of the onset against the modulation";
        peak_force: f64 = "N", "shear force at the onset";
        drop: f64 = "N", "peak force minus the least shear force during the slip";
        nucleation: f64 = "s", "time of the first break";
        nucleation_block: u64 = "", "block of the first break, from 1 at the trailing edge";
        duration: f64 = "s", "from the first to the last break";
        size: u64 = "", "breaks in the rupture";
        attached_before: f64 = "", "fraction of the contacts that are attached before the first break";
        least_attached: f64 = "", "least fraction of the contacts that are attached during the rupture";
        distance as "slip_distance": f64 = "m", "mean distance that the blocks move, from the first to the last break";
        edge_distance: f64 = "m", "distance that the driven edge moves in that time";
        onset_cut: bool = "", "whether the shear force still rose when the rupture reached the leading edge";
        front_speed: Option<f64> = "m/s", "speed of the rupture front";
        precursors: u64 = "", "precursors since the previous slip";
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
