//! The study: every solver at several settings, in one run, on one thread, interleaved; what each costs and how far it errs.
//!
//! Under each drive: the first breaks against the tightest tolerance there is; the energy ledger; and an ensemble of slips
//! that is timed and whose distributions are held against a reference ensemble of other seeds. Under the first drive more
//! realisations, not timed, make the ensembles large enough to show a bias of some parts in a thousand. A fixed step at low
//! velocity would take hours for its slips: it is timed over a short stretch, and its cost per slip follows from the steps
//! in one.

use super::breaks::{BreakErrors, Comparison, Reference};
use super::cpu::{self, Cost};
use super::distance::{Distances, deviation, distances, mean};
use super::{AccuracyError, NO_LIMITS, drive_in_words, failed};
use crate::model::{Parameters, Symbol};
use crate::observe::{Recording, Slip, SlipObserver};
use crate::solver::{Solver, Summary, TOLERANCES, simulate, simulate_audited};
use crate::table::columns::{Cell, Field, Kind, Selected, Selection, Table, columns, fields};
use rayon::prelude::*;
use std::ops::Range;

/// Amplitude and frequency of the modulated drive, in m and Hz: those of Fig. 2f.
const MODULATION: (f64, f64) = (1e-6, 58.0);
/// Slips discarded as start-up.
const DISCARD: u64 = 5;
/// Slips that are audited.
const AUDITED_SLIPS: u64 = 2;
/// Tolerance of the reference ensemble.
const ENSEMBLE_TOLERANCE: f64 = 1e-10;
/// Seeds of the reference ensemble begin here, far from those of the methods: the samples are independent.
const REFERENCE_SEEDS: u64 = 1_000_000;
/// The reference ensemble has so many times the seeds of a method, so that its own error matters less.
const REFERENCE_SHARE: u64 = 2;

/// What to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// Drive velocities, in m/s.
    pub velocities: Vec<f64>,
    /// Solvers and their settings.
    pub solvers: Vec<Solver>,
    /// Realisations of each ensemble, all timed.
    pub seeds: u64,
    /// Under the first drive so many times as many, the others not timed.
    pub first_drive_multiple: u64,
    /// Slips of each realisation, past start-up.
    pub slips: u64,
    /// Number K of first breaks whose times are compared: few enough that the coarsest fixed step has not gone its own way.
    pub breaks: usize,
    /// Breaks over which trajectories are followed to see how far they stay together.
    pub followed_breaks: usize,
    /// Lowest drive velocity at which a fixed step runs its ensemble, and its breaks, in m/s.
    pub fixed_step_slips_from: f64,
    /// See [`Study::fixed_step_slips_from`].
    pub fixed_step_breaks_from: f64,
    /// Steps over which a fixed step is timed below that velocity.
    pub timed_steps: u64,
}

impl Study {
    /// The full study: minutes.
    #[must_use]
    pub fn full() -> Self {
        Self {
            velocities: vec![1e-4, 1e-5, 1e-6],
            solvers: solvers(&[4e-6, 2e-6, 1e-6, 5e-7], &[1e-3, 1e-4, 1e-6, 1e-8, 1e-10]),
            seeds: 8,
            first_drive_multiple: 8,
            slips: 100,
            breaks: 100,
            followed_breaks: 30_000,
            fixed_step_slips_from: 1e-4,
            fixed_step_breaks_from: 1e-6,
            timed_steps: 3_000_000,
        }
    }

    /// A quick one: a minute.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            seeds: 2,
            first_drive_multiple: 1,
            slips: 12,
            followed_breaks: 10_000,
            fixed_step_breaks_from: 1e-4,
            timed_steps: 300_000,
            ..Self::full()
        }
    }

    /// The drives under which every solver runs, with seed 0.
    fn drives(&self) -> Vec<Parameters> {
        let (amplitude, frequency) = MODULATION;
        let plain = |&drive_velocity: &f64| Parameters { drive_velocity, ..Parameters::default() };
        let modulated = |parameters: &Parameters| Parameters {
            modulation_amplitude: amplitude,
            modulation_period: Some(1.0 / frequency),
            ..parameters.clone()
        };
        self.velocities.iter().map(plain).flat_map(|parameters| [parameters.clone(), modulated(&parameters)]).collect()
    }
}

fn solvers(time_steps: &[f64], tolerances: &[f64]) -> Vec<Solver> {
    let fixed = time_steps.iter().map(|&time_step| Solver::FixedStep { time_step });
    fixed.chain(tolerances.iter().map(|&tolerance| Solver::EventDriven { tolerance })).collect()
}

/// The drive under which solvers run.
#[derive(Clone, Debug, PartialEq)]
pub struct Driven;

impl Selection for Driven {
    const SYMBOLS: &'static [Symbol] = &[Symbol::V0, Symbol::Delta, Symbol::T];
}

columns! {
    /// One solver under one drive. Costs are those of its cheapest realisation per step: other work on the machine can only
    /// add to them. Errors of break times and the ledger are left out where they would take too long.
    #[derive(Clone, Debug, PartialEq)]
    pub struct MethodRow {
        parameters: Selected<Driven>;
        solver: Solver;
        cost: Cost;
        cost_spread as "cpu_spread": f64 = "",
            "CPU time per step of the dearest realisation over that of the cheapest, which the costs are";
        break_times: BreakErrors;
        ledger_residual: Option<f64> = "", "residual of the energy ledger, relative to the work of the drive";
    }
}

impl Table for MethodRow {
    const NAME: &'static str = "methods";
    const MEANING: &'static str = "One row per drive and solver setting";
}

/// A quantity of slips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Interval τ, in s.
    Interval,
    /// Phase φ, in rad.
    Phase,
    /// Stress drop, in N.
    Drop,
    /// Shear force at the onset, in N.
    PeakForce,
    /// Time from the first to the last break, in s.
    Duration,
    /// Speed of the rupture front, in m/s.
    FrontSpeed,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Interval, Self::Phase, Self::Drop, Self::PeakForce, Self::Duration, Self::FrontSpeed];

    /// Its name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Interval => "interval",
            Self::Phase => "phase",
            Self::Drop => "drop",
            Self::PeakForce => "peak_force",
            Self::Duration => "duration",
            Self::FrontSpeed => "front_speed",
        }
    }

    fn of(self, slip: &Slip) -> Option<f64> {
        match self {
            Self::Interval => slip.interval,
            Self::Phase => slip.phase,
            Self::Drop => Some(slip.drop),
            Self::PeakForce => Some(slip.peak_force),
            Self::Duration => Some(slip.duration),
            Self::FrontSpeed => slip.front_speed,
        }
    }
}

fields! {
    Quantity: Text, |quantity| quantity.name(), |name| Quantity::ALL.into_iter().find(|quantity| quantity.name() == name);
}

columns! {
    /// A distribution of one solver under one drive against that of the reference ensemble.
    #[derive(Clone, Debug, PartialEq)]
    pub struct DistanceRow {
        parameters: Selected<Driven>;
        solver: Solver;
        quantity: Quantity = "", "interval, phase, drop, peak_force, duration or front_speed";
        slips: u64 = "", "size of the sample";
        reference_slips: u64 = "", "size of the reference sample";
        mean: f64 = "", "mean";
        reference_mean: f64 = "", "mean of the reference";
        deviation: f64 = "", "standard deviation";
        reference_deviation: f64 = "", "standard deviation of the reference";
        distances: Distances;
    }
}

impl Table for DistanceRow {
    const NAME: &'static str = "distances";
    const MEANING: &'static str = "One row per drive, solver setting and quantity; means, deviations, their biases and w1 are \
                                   in its unit, that of the column of this name in `slips`";
}

/// All that a study finds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Drive by drive, solver by solver.
    pub methods: Vec<MethodRow>,
    /// Likewise, quantity by quantity.
    pub distances: Vec<DistanceRow>,
}

impl Findings {
    /// How far a distribution is from the reference, for the solver and drive of a row.
    #[must_use]
    pub fn distances_of(&self, row: &MethodRow, quantity: Quantity) -> Option<&Distances> {
        let same = |other: &&DistanceRow| {
            other.quantity == quantity && other.parameters == row.parameters && other.solver == row.solver
        };
        self.distances.iter().find(same).map(|row| &row.distances)
    }
}

/// Slips and cost of one solver so far.
#[derive(Clone, Debug, Default)]
struct Ensemble {
    slips: Vec<Slip>,
    slips_seen: u64,
    summary: Summary,
    /// CPU time per step of each realisation, in s.
    per_step: Vec<f64>,
}

impl Ensemble {
    fn add(&mut self, cpu_seconds: f64, summary: &Summary, slips: Vec<Slip>) {
        self.per_step.push(cpu_seconds / summary.steps as f64);
        self.summary.end_time += summary.end_time;
        self.summary.steps += summary.steps;
        self.slips_seen += if slips.is_empty() { 0 } else { DISCARD + slips.len() as u64 };
        self.slips.extend(slips);
    }

    /// CPU time per step of the cheapest realisation, in s.
    fn least_per_step(&self) -> f64 {
        self.per_step.iter().fold(f64::INFINITY, |least, &cost| least.min(cost))
    }

    /// That of the dearest over that of the cheapest.
    fn spread(&self) -> f64 {
        self.per_step.iter().fold(0.0_f64, |most, &cost| most.max(cost)) / self.least_per_step()
    }

    /// Costs, at those of a step in the cheapest realisation; where there are no slips, those per slip follow from the mean
    /// interval in s.
    fn cost(&self, mean_interval: f64) -> Cost {
        let cpu_seconds = self.least_per_step() * self.summary.steps as f64;
        let cost = Cost::of(cpu_seconds, &self.summary, self.slips_seen);
        if self.slips_seen > 0 {
            cost
        } else {
            cost.extrapolated(mean_interval * self.summary.steps as f64 / self.summary.end_time)
        }
    }
}

impl Study {
    /// Runs it. `tell` hears in words what comes next.
    ///
    /// # Errors
    /// When a simulation cannot go on.
    pub fn run(&self, tell: &mut dyn FnMut(&str)) -> Result<Findings, AccuracyError> {
        let mut findings = Findings::default();
        for (index, parameters) in self.drives().iter().enumerate() {
            tell(&format!("{}: first breaks and energy ledgers", drive_in_words(parameters)));
            let mut first_breaks = Reference::new(parameters, self.followed_breaks);
            let tightest = Solver::EventDriven { tolerance: *TOLERANCES.start() };
            simulate(parameters, tightest, NO_LIMITS, &mut first_breaks).map_err(failed(
                drive_in_words,
                parameters,
                tightest,
            ))?;
            let mut checks = Vec::new();
            for &solver in &self.solvers {
                let break_times = self.break_times(parameters, solver, &first_breaks)?;
                checks.push((break_times, self.ledger_residual(parameters, solver)?));
            }
            tell("timed ensembles");
            let mut ensembles = self.ensembles(parameters)?;
            let seeds = self.seeds * if index == 0 { self.first_drive_multiple } else { 1 };
            tell("reference ensemble, and what the others have more than their timed realisations");
            let reference = Solver::EventDriven { tolerance: ENSEMBLE_TOLERANCE };
            let others = REFERENCE_SEEDS..REFERENCE_SEEDS + REFERENCE_SHARE * seeds;
            let reference = self.slips_of(parameters, reference, others)?;
            for (&solver, ensemble) in self.solvers.iter().zip(&mut ensembles) {
                if !self.is_stretch_only(parameters, solver) {
                    ensemble.slips.extend(self.slips_of(parameters, solver, self.seeds..seeds)?);
                }
            }
            let mean_interval = mean(&sample(&reference, Quantity::Interval));
            for ((&solver, ensemble), (break_times, ledger_residual)) in self.solvers.iter().zip(&ensembles).zip(checks)
            {
                findings.methods.push(MethodRow {
                    parameters: Selected::new(parameters.clone()),
                    solver,
                    cost: ensemble.cost(mean_interval),
                    cost_spread: ensemble.spread(),
                    break_times,
                    ledger_residual,
                });
            }
            let pairs: Vec<_> = self.solvers.iter().zip(&ensembles).collect();
            let compared = pairs.into_par_iter().enumerate().flat_map_iter(|(row, (&solver, ensemble))| {
                let key = index * self.solvers.len() + row;
                distance_rows(parameters, solver, &ensemble.slips, &reference, key as u64)
            });
            findings.distances.extend(compared.collect::<Vec<_>>());
        }
        Ok(findings)
    }

    fn recording(&self) -> Recording {
        Recording { slips: self.slips, discard: DISCARD, ..Recording::default() }
    }

    /// Slips of these seeds; not timed, so on all threads.
    fn slips_of(&self, parameters: &Parameters, solver: Solver, seeds: Range<u64>) -> Result<Vec<Slip>, AccuracyError> {
        let realisation = |seed: u64| {
            let parameters = Parameters { seed, ..parameters.clone() };
            let mut observer = SlipObserver::new(&parameters, &self.recording());
            simulate(&parameters, solver, NO_LIMITS, &mut observer).map_err(failed(
                drive_in_words,
                &parameters,
                solver,
            ))?;
            Ok(observer.into_rows().0)
        };
        let slips: Vec<Vec<Slip>> = seeds.into_par_iter().map(realisation).collect::<Result<_, AccuracyError>>()?;
        Ok(slips.concat())
    }

    fn break_times(
        &self,
        parameters: &Parameters,
        solver: Solver,
        reference: &Reference,
    ) -> Result<BreakErrors, AccuracyError> {
        let takes_too_long = parameters.drive_velocity < self.fixed_step_breaks_from;
        if takes_too_long && matches!(solver, Solver::FixedStep { .. }) {
            return Ok(BreakErrors::default());
        }
        let mut comparison = Comparison::new(reference, self.breaks);
        simulate(parameters, solver, NO_LIMITS, &mut comparison).map_err(failed(drive_in_words, parameters, solver))?;
        Ok(comparison.errors())
    }

    fn ledger_residual(&self, parameters: &Parameters, solver: Solver) -> Result<Option<f64>, AccuracyError> {
        if self.is_stretch_only(parameters, solver) {
            return Ok(None);
        }
        let recording = Recording { slips: AUDITED_SLIPS, discard: 0, ..Recording::default() };
        let mut observer = SlipObserver::new(parameters, &recording);
        let (_, ledger) = simulate_audited(parameters, solver, NO_LIMITS, &mut observer).map_err(failed(
            drive_in_words,
            parameters,
            solver,
        ))?;
        Ok(Some(ledger.residual()))
    }

    /// Whether slips of this solver would take too long.
    fn is_stretch_only(&self, parameters: &Parameters, solver: Solver) -> bool {
        matches!(solver, Solver::FixedStep { .. }) && parameters.drive_velocity < self.fixed_step_slips_from
    }

    /// Seed by seed, every solver in turn, so that whatever slows the machine down slows down all.
    fn ensembles(&self, parameters: &Parameters) -> Result<Vec<Ensemble>, AccuracyError> {
        let mut ensembles = vec![Ensemble::default(); self.solvers.len()];
        for seed in 0..self.seeds {
            let parameters = Parameters { seed, ..parameters.clone() };
            for (&solver, ensemble) in self.solvers.iter().zip(&mut ensembles) {
                let is_stretch = self.is_stretch_only(&parameters, solver);
                let mut limits = NO_LIMITS;
                if is_stretch && let Solver::FixedStep { time_step } = solver {
                    limits.end_time = time_step * self.timed_steps as f64;
                }
                let mut observer = SlipObserver::new(&parameters, &self.recording());
                let (cpu_seconds, summary) = cpu::timed(|| simulate(&parameters, solver, limits, &mut observer));
                let summary = summary.map_err(failed(drive_in_words, &parameters, solver))?;
                // The few slips of a stretch are no sample.
                let slips = if is_stretch { Vec::new() } else { observer.into_rows().0 };
                ensemble.add(cpu_seconds, &summary, slips);
            }
        }
        Ok(ensembles)
    }
}

/// The distributions of one ensemble against those of the reference, of all quantities that there are.
fn distance_rows(
    parameters: &Parameters,
    solver: Solver,
    slips: &[Slip],
    reference: &[Slip],
    key: u64,
) -> Vec<DistanceRow> {
    let row = |(place, quantity): (u64, Quantity)| {
        let (sample, reference) = (sample(slips, quantity), sample(reference, quantity));
        let key = key * Quantity::ALL.len() as u64 + place;
        Some(DistanceRow {
            parameters: Selected::new(parameters.clone()),
            solver,
            quantity,
            slips: sample.len() as u64,
            reference_slips: reference.len() as u64,
            mean: mean(&sample),
            reference_mean: mean(&reference),
            deviation: deviation(&sample),
            reference_deviation: deviation(&reference),
            distances: distances(&sample, &reference, key)?,
        })
    };
    (0..).zip(Quantity::ALL).filter_map(row).collect()
}

fn sample(slips: &[Slip], quantity: Quantity) -> Vec<f64> {
    slips.iter().filter_map(|slip| quantity.of(slip)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_study_tells_a_coarse_step_from_a_tight_tolerance() {
        let (coarse, tight) = (Solver::FixedStep { time_step: 4e-6 }, Solver::EventDriven { tolerance: 1e-8 });
        let study = Study {
            velocities: vec![1e-4],
            solvers: vec![coarse, tight],
            seeds: 1,
            first_drive_multiple: 3,
            slips: 4,
            breaks: 50,
            followed_breaks: 400,
            ..Study::quick()
        };
        let findings = study.run(&mut |_| {}).unwrap();
        assert_eq!(findings.methods.len(), 4);
        for pair in findings.methods.chunks(2) {
            let (coarse, tight) = (&pair[0], &pair[1]);
            let (late, close) = (coarse.break_times, tight.break_times);
            assert!(
                late.median > Some(1e-7) && close.median < Some(1e-9) && close.missing == Some(0),
                "{late:?} {close:?}"
            );
            assert!(coarse.ledger_residual.unwrap().abs() > 1e-4 && tight.ledger_residual.unwrap().abs() < 1e-8);
            for row in pair {
                assert!(row.cost.per_slip > 0.0 && row.cost.timed_slips == 9, "{row:?}");
            }
        }
        // All quantities of both solvers, but no phase where there is no modulation.
        assert_eq!(findings.distances.len(), 2 * 5 + 2 * 6);
        for row in &findings.distances {
            let seeds = if row.parameters.modulation_period.is_none() { 3 } else { 1 };
            assert_eq!((row.slips, row.reference_slips), (4 * seeds, 8 * seeds), "{row:?}");
        }
    }

    #[test]
    fn the_slips_of_a_stretch_are_no_sample() {
        let study = Study {
            velocities: vec![1e-4],
            solvers: vec![Solver::FixedStep { time_step: 4e-6 }],
            seeds: 1,
            slips: 4,
            followed_breaks: 400,
            fixed_step_slips_from: 1.0,
            fixed_step_breaks_from: 1.0,
            // 1.2 s, or some ten slips.
            timed_steps: 300_000,
            ..Study::quick()
        };
        let findings = study.run(&mut |_| {}).unwrap();
        assert!(findings.distances.is_empty(), "{:?}", findings.distances);
        for row in &findings.methods {
            assert_eq!(row.cost.timed_slips, 0);
            assert!(row.cost.steps_per_slip > 2e4 && row.cost.steps_per_slip < 4e4, "{row:?}");
        }
    }

    #[test]
    fn the_cost_of_a_stretch_is_extrapolated_by_the_steps_of_an_interval() {
        let mut ensemble = Ensemble::default();
        let summary = Summary { end_time: 0.5, steps: 500_000, ..Summary::default() };
        ensemble.add(0.1, &summary, Vec::new());
        let cost = ensemble.cost(10.0);
        assert_eq!((cost.steps_per_slip, cost.timed_slips), (1e7, 0));
        assert!((cost.per_slip - 2.0).abs() < 1e-12 && (cost.per_simulated_second - 0.2).abs() < 1e-12);
        // Another realisation that other work has slowed down changes nothing but the spread.
        ensemble.add(0.3, &summary, Vec::new());
        assert!((ensemble.cost(10.0).per_slip - 2.0).abs() < 1e-12);
        assert!((ensemble.spread() - 3.0).abs() < 1e-12);
    }
}
