//! Hard cases: parameters that break a naive code, each run within budgets, so that none hangs.
//!
//! Each is run with an audit, the event-driven solver then in Taylor steps; and that solver once more as a job runs it,
//! on the grid and without a ledger. A case passes if it ends as it must: the simulation reaches its end and its ledger
//! balances, bad values are refused by name, or it stops and gives the cause. A run as a job must break about as many
//! contacts as the audited one; where single runs say nothing, the means over many seeds must agree.

use crate::model::equation::{StiffnessMatrix, stability_limit};
use crate::model::{ParameterError, Parameters, Symbol, Value};
use crate::observe::{Recording, SlipObserver};
use crate::reduce::Moments;
use crate::run::cpu;
use crate::solver::{Limits, Resolve, SimulationError, Solver, Summary, simulate, simulate_audited};
use crate::table::columns::{Table, columns};
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Contact events after which a case is given up.
const EVENT_BUDGET: u64 = 5_000_000;
/// Time on the clock after which a case is given up: far beyond what any takes.
const TIME_BUDGET: Duration = Duration::from_secs(40);
/// Largest residual of the ledger that passes, in tolerances of the event-driven solver, and of a fixed step near its
/// limit of stability. Measured at the default tolerance: 0.08 at T = 1e-5 and under 0.01 elsewhere; 6e-3.
const BALANCED_TOLERANCES: f64 = 1.0;
const BALANCED_FIXED_STEP: f64 = 2e-2;
/// Largest difference of the breaks of two runs, relative to the larger count, that passes. Seen: 0.05.
const ALIKE: f64 = 0.1;
/// The same of the means over `SEEDS` seeds, in standard errors, where counts spread far from seed to seed: weak damping
/// lets the whole slider vibrate, a soft one breaks in pieces, and a few contacts hold it up.
const ALIKE_MEANS: f64 = 3.0;
const SEEDS: u64 = 24;

/// What a case must lead to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expected {
    Ends,
    /// Parameters or solver are refused, in a message that contains this.
    Refused(&'static str),
    /// It cannot continue, and its message contains this.
    Stops(&'static str),
}

#[derive(Clone, Debug)]
pub struct HardCase {
    /// What breaks a naive code; cases that share it form a group.
    pub threat: &'static str,
    /// What differs from the defaults.
    settings: Vec<(Symbol, Value)>,
    solver: Solver,
    /// Ends at this model time in s, or after this number of slips.
    end_time: f64,
    slips: u64,
    /// Whether counts of breaks differ so far from seed to seed that only means compare.
    is_chaotic: bool,
    expected: Expected,
}

columns! {
    /// How a hard case went.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct Stability {
        threat: String = "", "what breaks a naive code";
        case: String = "", "what differs from the defaults";
        solver: String = "", "method and setting";
        passed: bool = "", "whether it ended as it must";
        outcome: String = "", "how it ended";
        simulated_seconds as "simulated_time": Option<f64> = "s", "model time";
        slips: u64 = "", "slips";
        steps: u64 = "", "steps of the solver";
        leaps: u64 = "", "of these, leaps";
        grid_steps: u64 = "", "of these, steps of the grid";
        breaks: u64 = "", "contacts broken";
        ledger_residual: Option<f64> = "",
            "residual of the energy ledger, relative to the work of the drive; null without an audit";
        cpu_seconds as "cpu_time": f64 = "s", "CPU time, with the audit if there is one";
    }
}

impl Table for Stability {
    const NAME: &'static str = "hard-cases";
    const MEANING: &'static str = "One row per hard case that is refused or takes fixed steps, else two: in Taylor steps with an audit, and as a job";
}

/// Why a case did not reach its end, in words.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error("refused: {0}")]
    Refused(String),
    #[error("stopped {0}")]
    Stopped(String),
}

impl From<ParameterError> for Failure {
    fn from(error: ParameterError) -> Self {
        Self::Refused(error.to_string())
    }
}

impl From<SimulationError> for Failure {
    fn from(error: SimulationError) -> Self {
        match error {
            SimulationError::UnstableStep { .. } | SimulationError::BadTolerance { .. } => {
                Self::Refused(error.to_string())
            }
            _ => Self::Stopped(error.to_string()),
        }
    }
}

impl HardCase {
    fn new(threat: &'static str, settings: &[(Symbol, Value)], end_time: f64) -> Self {
        let settings = settings.to_vec();
        let (solver, expected) = (Solver::default(), Expected::Ends);
        Self { threat, settings, solver, end_time, slips: 3, is_chaotic: false, expected }
    }

    fn slips(self, slips: u64) -> Self {
        Self { slips, ..self }
    }

    fn chaotic(self) -> Self {
        Self { is_chaotic: true, ..self }
    }

    fn solver(self, solver: Solver) -> Self {
        Self { solver, ..self }
    }

    fn refused(self, words: &'static str) -> Self {
        Self { expected: Expected::Refused(words), ..self }
    }

    fn stops(self, words: &'static str) -> Self {
        Self { expected: Expected::Stops(words), ..self }
    }

    /// What differs from the defaults, in words.
    pub fn name(&self) -> String {
        let words: Vec<String> =
            self.settings.iter().map(|(symbol, value)| format!("{} = {value}", symbol.key())).collect();
        if words.is_empty() { "defaults".to_owned() } else { words.join(", ") }
    }

    /// Runs it within its budgets: with an audit, and, if it is event-driven and not refused, as a job.
    pub fn run(&self) -> Vec<Stability> {
        let Solver::EventDriven { tolerance, .. } = self.solver else { return vec![self.row(self.solver, None)] };
        let audited = self.row(Solver::EventDriven { tolerance, resolve: Resolve::Taylor }, None);
        if matches!(self.expected, Expected::Refused(_)) {
            return vec![audited];
        }
        let as_a_job = self.row(self.solver, Some(&audited));
        vec![audited, as_a_job]
    }

    /// Runs it with this solver: with an audit, or held against the run that had one.
    fn row(&self, solver: Solver, audited: Option<&Stability>) -> Stability {
        let (cpu_seconds, ended) = cpu::timed(|| self.simulate(solver, self.parameters(), audited.is_none()));
        let row = Stability {
            threat: self.threat.to_owned(),
            case: self.name(),
            solver: super::solver_in_words(solver),
            cpu_seconds,
            ..Stability::default()
        };
        match ended {
            Ok((summary, slips, residual)) => {
                let is_balanced = residual.is_none_or(|residual| residual.abs() <= self.max_residual());
                let is_alike = audited.is_none_or(|audited| {
                    if self.is_chaotic { self.means_are_alike() } else { are_alike(audited.breaks, summary.breaks) }
                });
                let outcome = match (is_balanced, is_alike) {
                    (true, true) => "done",
                    (false, _) => "done, but energy does not balance",
                    (_, false) => "done, but with too many or too few breaks",
                };
                Stability {
                    passed: self.expected == Expected::Ends && is_balanced && is_alike,
                    outcome: outcome.to_owned(),
                    simulated_seconds: Some(summary.end_time),
                    ledger_residual: residual,
                    slips,
                    steps: summary.steps,
                    leaps: summary.leaps,
                    grid_steps: summary.grid_steps,
                    breaks: summary.breaks,
                    ..row
                }
            }
            Err(failure) => {
                let passed = match (self.expected, &failure) {
                    (Expected::Stops(words), Failure::Stopped(message))
                    | (Expected::Refused(words), Failure::Refused(message)) => message.contains(words),
                    _ => false,
                };
                Stability { passed, outcome: failure.to_string(), ..row }
            }
        }
    }

    /// Whether the breaks on the grid and in Taylor steps have the same mean over seeds.
    fn means_are_alike(&self) -> bool {
        let Solver::EventDriven { tolerance, .. } = self.solver else { return true };
        let breaks = [Resolve::Grid, Resolve::Taylor].map(|resolve| {
            let solver = Solver::EventDriven { tolerance, resolve };
            let runs = (1..=SEEDS).map(|seed| {
                let parameters = self.parameters().map(|parameters| Parameters { seed, ..parameters });
                self.simulate(solver, parameters, false).map(|(summary, ..)| summary.breaks as f64)
            });
            runs.collect::<Result<Vec<f64>, _>>()
        });
        let [Ok(grid), Ok(taylor)] = breaks else { return false };
        let moments = [grid, taylor].map(|breaks| {
            let mut moments = Moments::default();
            moments.extend(breaks);
            moments
        });
        let [Some((left, left_spread)), Some((right, right_spread))] =
            moments.map(|moments| moments.mean().zip(moments.deviation()))
        else {
            return false;
        };
        (left - right).abs() <= ALIKE_MEANS * left_spread.hypot(right_spread) / (SEEDS as f64).sqrt()
    }

    /// Largest residual of the ledger that passes.
    fn max_residual(&self) -> f64 {
        match self.solver {
            Solver::EventDriven { tolerance, .. } => BALANCED_TOLERANCES * tolerance,
            Solver::FixedStep { .. } => BALANCED_FIXED_STEP,
        }
    }

    fn parameters(&self) -> Result<Parameters, ParameterError> {
        let mut parameters = Parameters::default();
        for &(symbol, value) in &self.settings {
            parameters.set(symbol, value)?;
        }
        parameters.validated()
    }

    /// Summary, slips and, with an audit, residual of the ledger.
    fn simulate(
        &self,
        solver: Solver,
        parameters: Result<Parameters, ParameterError>,
        has_audit: bool,
    ) -> Result<(Summary, u64, Option<f64>), Failure> {
        let parameters = parameters?;
        let recording = Recording { slips: self.slips, discard: 0, ..Recording::default() };
        let mut observer = SlipObserver::new(&parameters, &recording);
        let (summary, residual) = interrupted_after(TIME_BUDGET, |interrupt| {
            let limits = Limits { end_time: self.end_time, events: EVENT_BUDGET, interrupt: Some(interrupt) };
            if has_audit {
                let audited = simulate_audited(&parameters, solver, limits, &mut observer);
                audited.map(|(summary, ledger)| (summary, Some(ledger.residual())))
            } else {
                simulate(&parameters, solver, limits, &mut observer).map(|summary| (summary, None))
            }
        })?;
        Ok((summary, observer.into_rows().0.len() as u64, residual))
    }
}

/// Whether counts of breaks may be those of two runs.
fn are_alike(left: u64, right: u64) -> bool {
    left.abs_diff(right) as f64 <= ALIKE * left.max(right) as f64
}

/// Runs `body` with a flag that is set once the time is over.
fn interrupted_after<T>(time: Duration, body: impl FnOnce(&AtomicBool) -> T) -> T {
    let interrupt = AtomicBool::new(false);
    let (done, ended) = channel::<()>();
    std::thread::scope(|scope| {
        let flag = &interrupt;
        scope.spawn(move || {
            // The other end is dropped when the body is over.
            if ended.recv_timeout(time) == Err(RecvTimeoutError::Timeout) {
                flag.store(true, Ordering::Relaxed);
            }
        });
        let result = body(flag);
        drop(done);
        result
    })
}

/// Every case, group by group.
pub fn hard_cases() -> Vec<HardCase> {
    use crate::table::value::Value::{Count, Real};
    use Symbol::{Delta, Dfs, FN, Fs, Gamma, K, Kd, Ki, L, M, N, Ns, Seed, T, TauR, V0};
    let case = HardCase::new;
    let mut cases = Vec::new();

    let long = "long runs, far from the origin";
    cases.push(case(long, &[(V0, Real(1e-4))], 12.0).slips(u64::MAX));
    cases.push(case(long, &[(N, Count(2)), (Ns, Count(2)), (V0, Real(1e-3))], 100.0).slips(u64::MAX));

    let ties = "ties: all contacts of a block break at once";
    cases.push(case(ties, &[(Dfs, Real(0.0))], 1.0));
    cases.push(case(ties, &[(Dfs, Real(0.0)), (N, Count(1))], 1.0).slips(50));
    cases.push(case(ties, &[(Dfs, Real(0.0)), (N, Count(8)), (Delta, Real(1e-6)), (T, Real(0.02))], 1.0).slips(20));

    let reattachment = "very short and very long reattachment";
    cases.push(case(reattachment, &[(TauR, Real(1e-6))], 0.12));
    cases.push(case(reattachment, &[(TauR, Real(1e-6)), (Dfs, Real(0.0))], 0.12));
    cases.push(case(reattachment, &[(TauR, Real(10.0))], 30.0));
    cases.push(case(reattachment, &[(TauR, Real(10.0)), (V0, Real(1e-6))], 60.0).chaotic());

    let wide = "thresholds that could be drawn negative";
    cases.extend([0.411, 1.37].map(|spread| case(wide, &[(Dfs, Real(spread))], 0.5)));

    let damping = "no damping, overdamping";
    cases.push(case(damping, &[(Gamma, Real(0.0))], 0.3).chaotic());
    cases.push(case(damping, &[(Gamma, Real(0.0)), (N, Count(1))], 0.3));
    cases.push(case(damping, &[(Gamma, Real(1.0))], 0.3).chaotic());
    cases.push(case(damping, &[(Gamma, Real(1e7))], 0.3));
    cases.push(case(damping, &[(Gamma, Real(1e7)), (V0, Real(1e-6))], 10.0));

    let drive = "slow and fast drive, weak and strong modulation, resonance";
    let modulated = |amplitude: f64, period: f64| [(Delta, Real(amplitude)), (T, Real(period))];
    cases.push(case(drive, &[(V0, Real(1e-8))], 1e4));
    cases.push(case(drive, &[(V0, Real(1e-2))], 0.05));
    cases.push(case(drive, &[(V0, Real(1e-8)), (Delta, Real(1e-6)), (T, Real(100.0))], 1e4));
    cases.push(case(drive, &modulated(1e-9, 0.02), 0.5));
    cases.push(case(drive, &modulated(1e-4, 0.02), 0.2));
    cases.push(case(drive, &modulated(1e-4, 1.0), 1.0));
    cases.push(case(drive, &modulated(1e-6, 1e-5), 0.2));
    cases.push(case(drive, &modulated(1e-9, 1e-5), 0.5));
    cases.push(case(drive, &modulated(1e-6, 100.0), 0.5));
    for blocks in [1, 2, 8] {
        let [amplitude, period] = modulated(1e-6, 2e-4);
        cases.push(case(drive, &[amplitude, period, (V0, Real(2e-6)), (N, Count(blocks))], 0.7).slips(u64::MAX));
    }
    for (index, gamma) in [(0, 10.0), (0, 0.0), (69, 10.0)] {
        let [amplitude, period] = modulated(1e-8, resonant_period(index));
        cases.push(case(drive, &[amplitude, period, (Gamma, Real(gamma))], 0.2));
    }

    let sizes = "sizes: lanes, stiffness, growth of cost";
    cases.extend([1, 2, 7, 8, 9, 64].map(|blocks| case(sizes, &[(N, Count(blocks))], 0.5)));
    cases.push(case(sizes, &[(N, Count(1000))], 0.3).slips(1));
    cases.push(case(sizes, &[(Ns, Count(1))], 0.1));
    cases.push(case(sizes, &[(Ns, Count(1000))], 1.0));
    cases.push(case(sizes, &[(K, Real(1e10))], 2.0));
    cases.push(case(sizes, &[(K, Real(1e6))], 0.3).chaotic());

    let stability = "the limit of stability";
    let limit = stability_limit(&Parameters::default());
    let step = |time_step: f64| case(stability, &[], 0.15).solver(Solver::FixedStep { time_step });
    cases.push(step(0.99 * limit));
    for setting in [(Dfs, Real(0.0)), (TauR, Real(1e-6)), (Gamma, Real(1e7))] {
        cases.push(case(stability, &[setting], 0.15).solver(Solver::FixedStep { time_step: 1e-6 }));
    }
    for time_step in [1.01 * limit, 0.0, -1e-6, f64::NAN, f64::INFINITY] {
        cases.push(step(time_step).refused("dt"));
    }
    for tolerance in [0.0, -1e-6, f64::NAN, 1.0] {
        cases.push(case(stability, &[], 0.15).solver(Solver::event_driven(tolerance)).refused("tolerance"));
    }

    let extreme = "values beyond what doubles resolve";
    for (symbol, value) in [(K, 1e30), (Kd, 1e30), (Ki, 1e30), (Gamma, 1e30), (M, 1e-30)] {
        cases.push(case(extreme, &[(symbol, Real(value))], 1.0).stops("too short"));
    }
    cases.push(case(extreme, &modulated(1e300, 1.0), 1.0).stops("not finite"));
    cases.push(case(extreme, &modulated(1e-6, 1e-300), 1.0).stops("not finite"));
    // Over before the solver first looks at the state.
    cases.push(
        case(extreme, &modulated(1e308, 1e-3), 0.01).solver(Solver::FixedStep { time_step: 4e-6 }).stops("not finite"),
    );
    cases.push(case(extreme, &[(M, Real(1e10))], 1.0));
    cases.push(case(extreme, &[(V0, Real(1e-300))], 1.0));
    cases.push(case(extreme, &[(TauR, Real(1e-300))], 0.2));
    cases.push(case(extreme, &[(Fs, Real(1e300))], 1.0));
    cases.push(case(extreme, &[(Fs, Real(1e308)), (Dfs, Real(1e308))], 1.0).stops("not finite"));
    cases.push(case(extreme, &[(M, Real(1e308)), (K, Real(1e308))], 1.0).stops("too short"));

    let bad = "values that make no sense";
    let mut refuse = |symbol: Symbol, value: Value| {
        cases.push(case(bad, &[(symbol, value)], 0.1).refused(symbol.key()));
    };
    for symbol in [M, K, Kd, Ki, Fs, Dfs, TauR, Gamma, V0, Delta, T, FN, L] {
        for value in [f64::NAN, f64::INFINITY, -1.0] {
            refuse(symbol, Real(value));
        }
    }
    for symbol in [M, K, Kd, Ki, Fs, TauR, V0, T, FN, L] {
        refuse(symbol, Real(0.0));
    }
    for (symbol, count) in [(N, 0), (N, u64::MAX), (Ns, 0), (Ns, u64::MAX), (Seed, u64::MAX)] {
        refuse(symbol, Count(count));
    }
    cases
}

/// Period of the mode with this index of the intact slider, in s.
fn resonant_period(index: usize) -> f64 {
    let parameters = Parameters::default();
    let squared = StiffnessMatrix::intact(&parameters).eigenvalue(index) / parameters.block_mass();
    TAU / squared.sqrt()
}
