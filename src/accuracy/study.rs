//! The study: every solver at several settings, in one run, on one thread, interleaved; cost and errors of each.
//!
//! The event-driven solver counts as two methods, by how it resolves motion. At each set of parameters: the first
//! breaks against the tightest tolerance there is; and an ensemble of slips that is timed and whose distributions are
//! compared with a reference ensemble of other seeds. At the first set more realisations, not timed, make the ensembles
//! large enough to show a bias of some parts in a thousand. A fixed step at low velocity would take hours for its
//! slips: it is timed over a short stretch, and its cost per slip follows from the steps of an interval.

use super::comparison::{Bias, BreakComparison, BreakErrors, Reference, Sample};
use super::{BiasRow, Cost, Findings, MethodRow, SolverColumns, set_in_words};
use crate::model::{Parameters, Selected};
use crate::observe::{Measurements, Recording, Slip, SlipObserver, measure};
use crate::run::limits;
use crate::solver::{Limits, Observer, Resolve, Solver, Summary, simulate_audited};
use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

/// Of the modulated drive, that of Fig. 2f, in m.
const AMPLITUDE: f64 = 1e-6;
/// In Hz.
const FREQUENCY: f64 = 58.0;
const DISCARD: u64 = 5;
/// Tolerance of the reference of break times, the tightest that there is.
const TIGHTEST_TOLERANCE: f64 = 1e-12;
const ENSEMBLE_TOLERANCE: f64 = 1e-10;
/// Seeds of the reference ensemble are so far from those of the methods: the samples are independent.
const REFERENCE_SEEDS: u64 = 1_000_000;
/// Jobs that keep an energy ledger at each set.
const AUDITED_JOBS: u64 = 3;
/// Seeds of the reference ensemble for each one of a method: more, so that its own error matters less.
const REFERENCE_SHARE: u64 = 2;

#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// Sets of parameters, with seed 0.
    pub sets: Vec<Parameters>,
    pub solvers: Vec<Solver>,
    /// The one of them that the verdict is about.
    pub own: Solver,
    /// Slips that the sweep records of each set; none without a sweep.
    pub slips_of_sets: Vec<u64>,
    pub first_seed: u64,
    /// Realisations of each ensemble, each timed once, in turn with those of the other solvers.
    pub seeds: u64,
    /// Multiple of these realisations at the first set; those beyond them are not timed.
    pub first_set_multiple: u64,
    /// Slips of each realisation, past start-up.
    pub slips: u64,
    /// Number K of first breaks whose times are compared: few enough that the coarsest fixed step has not gone its own
    /// way.
    pub breaks: usize,
    /// Lowest drive velocity at which a fixed step runs its ensemble, and its breaks, in m/s.
    pub fixed_step_slips_from: f64,
    pub fixed_step_breaks_from: f64,
    /// Steps over which a fixed step is timed below that velocity.
    pub timed_steps: u64,
}

impl Study {
    /// The full study, which takes minutes.
    pub fn full() -> Self {
        Self {
            sets: [1e-4, 1e-5, 1e-6]
                .into_iter()
                .flat_map(plain_and_modulated)
                .collect(),
            solvers: solvers(
                &[4e-6, 2e-6, 1e-6, 5e-7].map(Solver::fixed_step),
                &[1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7],
                &[1e-3, 1e-4, 1e-6, 1e-8, 1e-10],
            ),
            own: event_driven(Resolve::Grid, 1e-3),
            slips_of_sets: Vec::new(),
            first_seed: 0,
            seeds: 8,
            first_set_multiple: 8,
            slips: 100,
            breaks: 100,
            fixed_step_slips_from: 1e-4,
            fixed_step_breaks_from: 1e-6,
            timed_steps: 3_000_000,
        }
    }

    /// A quick one, which takes a minute.
    pub fn quick() -> Self {
        Self {
            seeds: 4,
            first_set_multiple: 1,
            slips: 6,
            fixed_step_breaks_from: 1e-4,
            timed_steps: 300_000,
            ..Self::full()
        }
    }

    /// The same at other sets, with tolerances of the event-driven solver and this one instead.
    pub fn at(self, sets: Vec<Parameters>, solver: Solver) -> Self {
        let mut in_fixed_steps = Vec::new();
        let mut on_the_grid = vec![1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
        let mut in_taylor_steps = vec![1e-3, 1e-4, 1e-6, 1e-8];
        let tolerance = solver.tolerance;
        let own = if solver.time_step.is_some() {
            in_fixed_steps.push(solver);
            solver
        } else if solver.resolve.takes_grid(tolerance) {
            on_the_grid.push(tolerance);
            event_driven(Resolve::Grid, tolerance)
        } else {
            in_taylor_steps.push(tolerance);
            event_driven(Resolve::Taylor, tolerance)
        };
        for tolerances in [&mut on_the_grid, &mut in_taylor_steps] {
            tolerances.sort_by(|a, b| b.total_cmp(a));
            tolerances.dedup();
        }
        Self {
            sets,
            solvers: solvers(&in_fixed_steps, &on_the_grid, &in_taylor_steps),
            own,
            first_set_multiple: 1,
            ..self
        }
    }
}

/// The defaults at a drive velocity in m/s, without and with modulation.
fn plain_and_modulated(drive_velocity: f64) -> [Parameters; 2] {
    let plain = Parameters {
        drive_velocity,
        ..Parameters::default()
    };
    let modulated = Parameters {
        modulation_amplitude: AMPLITUDE,
        modulation_period: Some(1.0 / FREQUENCY),
        ..plain.clone()
    };
    [plain, modulated]
}

fn solvers(in_fixed_steps: &[Solver], on_the_grid: &[f64], in_taylor_steps: &[f64]) -> Vec<Solver> {
    let fixed = in_fixed_steps.iter().copied();
    let resolved = |resolve| move |&tolerance: &f64| event_driven(resolve, tolerance);
    let grid = on_the_grid.iter().map(resolved(Resolve::Grid));
    let taylor = in_taylor_steps.iter().map(resolved(Resolve::Taylor));
    fixed.chain(grid).chain(taylor).collect()
}

const fn event_driven(resolve: Resolve, tolerance: f64) -> Solver {
    Solver {
        resolve,
        ..Solver::event_driven(tolerance)
    }
}

/// A quantity of slips whose distributions are compared.
type SlipQuantity = (&'static str, fn(&Slip) -> Option<f64>);

/// By their columns in the table of slips.
const QUANTITIES: [SlipQuantity; 6] = [
    ("interval", |slip| slip.interval),
    ("phase", |slip| slip.phase),
    ("drop", |slip| Some(slip.drop)),
    ("peak_force", |slip| Some(slip.peak_force)),
    ("duration", |slip| Some(slip.duration)),
    ("front_speed", |slip| slip.front_speed),
];

/// Slips and cost of one solver, seed by seed.
#[derive(Clone, Debug, Default)]
struct Ensemble {
    slips: Vec<Slip>,
    slips_seen: u64,
    end_time: f64,
    steps: u64,
    /// CPU time per step of each realisation that was timed, in s.
    per_step: Vec<f64>,
}

impl Ensemble {
    fn add(&mut self, cpu_seconds: f64, summary: &Summary, slips: Vec<Slip>) {
        self.per_step.push(cpu_seconds / summary.steps as f64);
        self.end_time += summary.end_time;
        self.steps += summary.steps;
        self.slips_seen += if slips.is_empty() {
            0
        } else {
            DISCARD + slips.len() as u64
        };
        self.slips.extend(slips);
    }

    /// The cost, by the CPU time per step of the fastest realisation. If none of its slips was timed, the cost of a
    /// slip follows from the steps in a mean interval (in s).
    fn cost(&self, mean_interval: f64) -> Cost {
        let per_step = self.per_step.iter().copied().fold(f64::INFINITY, f64::min);
        let steps = self.steps as f64;
        let steps_per_slip = if self.slips_seen > 0 {
            steps / self.slips_seen as f64
        } else {
            mean_interval * steps / self.end_time
        };
        Cost {
            per_simulated_second: per_step * steps / self.end_time,
            per_slip: per_step * steps_per_slip,
            per_step,
            steps_per_slip,
            timed_slips: self.slips_seen,
        }
    }
}

impl Study {
    /// Runs it; `report` gets a line before each stage.
    pub fn run(&self, report: &mut dyn FnMut(&str)) -> Result<Findings> {
        let mut findings = Findings::default();
        for (set, parameters) in self.sets.iter().enumerate() {
            report(&format!("{}: first breaks", set_in_words(parameters)));
            let first = self.first_seed;
            let of_first = parameters.with_seed(first);
            let mut first_breaks = Reference::new(&of_first, self.breaks);
            let tightest = event_driven(Resolve::Taylor, TIGHTEST_TOLERANCE);
            simulated(&of_first, tightest, &mut first_breaks)?;
            let mut errors = Vec::new();
            for &solver in &self.solvers {
                errors.push(self.break_times(&of_first, solver, &first_breaks)?);
            }
            report("timed ensembles");
            let ensembles = self.ensembles(parameters)?;
            let seeds = self.seeds * if set == 0 { self.first_set_multiple } else { 1 };
            report("reference ensemble, and realisations that are not timed");
            let reference = event_driven(Resolve::Taylor, ENSEMBLE_TOLERANCE);
            let begin = first + REFERENCE_SEEDS;
            let others = begin..begin + REFERENCE_SHARE * seeds;
            let reference = self.slips_of(parameters, reference, others)?;
            if reference.is_empty() {
                let case = set_in_words(parameters);
                bail!(
                    "{case}: no slips; the study compares slips, so choose parameters at which the slider does not just slide"
                );
            }
            let intervals: Vec<f64> = reference.iter().filter_map(|slip| slip.interval).collect();
            let mean_interval = intervals.iter().sum::<f64>() / intervals.len() as f64;
            let with_errors = ensembles.into_iter().zip(errors);
            for (&solver, (mut ensemble, break_times)) in self.solvers.iter().zip(with_errors) {
                findings.methods.push(MethodRow {
                    parameters: Selected::new(parameters.clone()),
                    case: set_in_words(parameters),
                    solver: solver.into(),
                    cost: ensemble.cost(mean_interval),
                    break_times,
                    unbalanced: (solver == self.own)
                        .then(|| self.unbalanced(parameters, solver))
                        .transpose()?,
                });
                if !self.is_stretch_only(parameters, solver) {
                    let untimed = first + self.seeds..first + seeds;
                    let slips = self.slips_of(parameters, solver, untimed)?;
                    ensemble.slips.extend(slips);
                }
                let biases = bias_rows(parameters, solver, &ensemble.slips, &reference);
                findings.biases.extend(biases);
            }
        }
        Ok(findings)
    }

    /// What a job records; of a solver whose slips would take too long, over a stretch of time.
    fn recording(&self, parameters: &Parameters, solver: Solver) -> Recording {
        let is_stretch = self.is_stretch_only(parameters, solver);
        let stretch = solver.time_step.filter(|_| is_stretch);
        Recording {
            slips: Some(self.slips),
            discard: DISCARD,
            max_time: stretch.map(|time_step| time_step * self.timed_steps as f64),
            ..Recording::default()
        }
    }

    /// Slips of these seeds; not timed, so on all threads of the pool.
    fn slips_of(
        &self,
        parameters: &Parameters,
        solver: Solver,
        seeds: Range<u64>,
    ) -> Result<Vec<Slip>> {
        let slips = |seed: u64| {
            let recording = self.recording(parameters, solver);
            let (_, measured) = measured(&parameters.with_seed(seed), solver, &recording)?;
            Ok(measured.slips)
        };
        let slips: Result<Vec<_>> = seeds.into_par_iter().map(slips).collect();
        Ok(slips?.concat())
    }

    fn break_times(
        &self,
        parameters: &Parameters,
        solver: Solver,
        reference: &Reference,
    ) -> Result<BreakErrors> {
        let takes_too_long = parameters.drive_velocity < self.fixed_step_breaks_from;
        if takes_too_long && solver.time_step.is_some() {
            return Ok(BreakErrors::default());
        }
        let mut comparison = BreakComparison::new(reference);
        simulated(parameters, solver, &mut comparison)?;
        Ok(comparison.errors())
    }

    /// The largest residual of the energy ledger over a few jobs.
    fn unbalanced(&self, parameters: &Parameters, solver: Solver) -> Result<f64> {
        let mut largest: f64 = 0.0;
        for seed in self.first_seed..self.first_seed + AUDITED_JOBS {
            let job = parameters.with_seed(seed);
            let recording = self.recording(&job, solver);
            let limits = Limits {
                end_time: recording.max_time.unwrap_or(f64::INFINITY),
                events: recording.max_events,
                interrupt: None,
            };
            let mut observer = SlipObserver::new(&job, &recording);
            let (_, ledger) = simulate_audited(&job, solver, limits, &mut observer)
                .with_context(|| in_words(&job, solver))?;
            largest = largest.max(ledger.residual().abs());
        }
        Ok(largest)
    }

    /// Whether slips of this solver would take too long.
    fn is_stretch_only(&self, parameters: &Parameters, solver: Solver) -> bool {
        solver.time_step.is_some() && parameters.drive_velocity < self.fixed_step_slips_from
    }

    /// Seed by seed, every solver in turn, so that whatever slows the machine down slows down all.
    fn ensembles(&self, parameters: &Parameters) -> Result<Vec<Ensemble>> {
        let mut ensembles = vec![Ensemble::default(); self.solvers.len()];
        for seed in self.first_seed..self.first_seed + self.seeds {
            let parameters = parameters.with_seed(seed);
            for (&solver, ensemble) in self.solvers.iter().zip(&mut ensembles) {
                let is_stretch = self.is_stretch_only(&parameters, solver);
                let recording = self.recording(&parameters, solver);
                let (cpu_seconds, measured) = measured(&parameters, solver, &recording)?;
                // The few slips of a stretch are no sample.
                let slips = if is_stretch {
                    Vec::new()
                } else {
                    measured.slips
                };
                ensemble.add(cpu_seconds, &measured.summary, slips);
            }
        }
        Ok(ensembles)
    }
}

/// Observers end these simulations, none of which comes near the largest number of events.
fn simulated(
    parameters: &Parameters,
    solver: Solver,
    observer: &mut dyn Observer,
) -> Result<Summary> {
    Recording::default()
        .simulate(parameters, solver, &AtomicBool::new(false), observer)
        .with_context(|| in_words(parameters, solver))
}

/// CPU time in s, and what a sweep would measure.
fn measured(
    parameters: &Parameters,
    solver: Solver,
    recording: &Recording,
) -> Result<(f64, Measurements)> {
    let (cpu_seconds, outcome) =
        limits::timed(|| measure(parameters, recording, solver, &AtomicBool::new(false)));
    let measured = outcome.with_context(|| in_words(parameters, solver))?;
    Ok((cpu_seconds, measured))
}

fn in_words(parameters: &Parameters, solver: Solver) -> String {
    format!(
        "{}, seed {}, {}",
        set_in_words(parameters),
        parameters.seed,
        SolverColumns::from(solver)
    )
}

/// The slips of one ensemble beside those of the reference, by all quantities that there are.
fn bias_rows(
    parameters: &Parameters,
    solver: Solver,
    slips: &[Slip],
    reference: &[Slip],
) -> Vec<BiasRow> {
    let sample = |slips: &[Slip], value: fn(&Slip) -> Option<f64>| {
        // A realisation begins with its slip 0.
        let realisations = slips.chunk_by(|_, next| next.number > 0);
        let values = realisations.map(|slips| slips.iter().filter_map(value).collect());
        Sample::of(values.collect())
    };
    let row = |(quantity, value): SlipQuantity| {
        let found = sample(slips, value)?;
        let reference = sample(reference, value)?;
        Some(BiasRow {
            parameters: Selected::new(parameters.clone()),
            case: set_in_words(parameters),
            solver: solver.into(),
            quantity: quantity.to_owned(),
            slips: found.count as u64,
            reference_slips: reference.count as u64,
            mean: found.mean.value,
            reference_mean: reference.mean.value,
            deviation: found.deviation.value,
            reference_deviation: reference.deviation.value,
            bias: Bias::of(&found, &reference),
        })
    };
    QUANTITIES.into_iter().filter_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_study_distinguishes_a_coarse_step_from_the_grid_and_that_from_a_tight_tolerance() {
        let study = Study {
            sets: plain_and_modulated(1e-4).into(),
            solvers: solvers(&[Solver::fixed_step(4e-6)], &[1e-4], &[1e-8]),
            seeds: 1,
            first_set_multiple: 3,
            slips: 4,
            breaks: 50,
            ..Study::quick()
        };
        let findings = study.run(&mut |_| {}).unwrap();
        assert_eq!(findings.methods.len(), 6);
        for rows in findings.methods.chunks(3) {
            let [coarse, grid, tight] = [0, 1, 2].map(|row| rows[row].break_times);
            assert!(coarse.median > Some(1e-7), "{coarse:?}");
            // Seen: 1e-8 s and 2e-14 s.
            assert!(
                grid.median > Some(1e-10) && grid.median < Some(1e-7) && grid.missing == Some(0),
                "{grid:?}"
            );
            assert!(
                tight.median < Some(1e-12) && tight.missing == Some(0),
                "{tight:?}"
            );
            for row in rows {
                assert!(
                    row.cost.per_slip > 0.0 && row.cost.timed_slips == 9,
                    "{row:?}"
                );
            }
        }
        // All quantities of all solvers, but no phase where there is no modulation.
        assert_eq!(findings.biases.len(), 3 * 5 + 3 * 6);
        for row in &findings.biases {
            let seeds = if row.parameters.modulation_period.is_none() {
                3
            } else {
                1
            };
            assert_eq!(
                (row.slips, row.reference_slips),
                (4 * seeds, 8 * seeds),
                "{row:?}"
            );
        }
    }

    #[test]
    fn the_slips_of_a_stretch_are_no_sample() {
        let study = Study {
            sets: plain_and_modulated(1e-4).into(),
            solvers: vec![Solver::fixed_step(4e-6)],
            seeds: 1,
            slips: 4,
            fixed_step_slips_from: 1.0,
            fixed_step_breaks_from: 1.0,
            // 1.2 s, or some ten slips.
            timed_steps: 300_000,
            ..Study::quick()
        };
        let findings = study.run(&mut |_| {}).unwrap();
        assert!(findings.biases.is_empty(), "{:?}", findings.biases);
        for row in &findings.methods {
            assert_eq!(row.cost.timed_slips, 0);
            assert!(
                row.cost.steps_per_slip > 2e4 && row.cost.steps_per_slip < 4e4,
                "{row:?}"
            );
        }
    }

    #[test]
    fn the_cost_of_a_stretch_is_extrapolated_by_the_steps_of_an_interval() {
        let mut ensemble = Ensemble::default();
        let summary = Summary {
            end_time: 0.5,
            steps: 500_000,
            ..Summary::default()
        };
        ensemble.add(0.1, &summary, Vec::new());
        let cost = ensemble.cost(10.0);
        assert_eq!((cost.steps_per_slip, cost.timed_slips), (1e7, 0));
        assert!(
            (cost.per_slip - 2.0).abs() < 1e-12 && (cost.per_simulated_second - 0.2).abs() < 1e-12
        );
        // Others that other work has slowed down change nothing.
        ensemble.add(0.3, &summary, Vec::new());
        ensemble.add(0.2, &summary, Vec::new());
        assert!((ensemble.cost(10.0).per_slip - 2.0).abs() < 1e-12);
    }
}
