//! Hard cases: parameters that break a naive code, each run within budgets, so that none hangs.
//!
//! Each is run with an audit, the event-driven solver in Taylor steps and as a job runs it, which is on the grid. A case
//! passes if it ends as it must: the simulation reaches its end and its ledger balances, bad values are refused by
//! name, or it stops and gives the cause. Both ways must break about as many contacts; where single runs say nothing,
//! the means over many seeds must agree.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use stickslip_physics::model::{ParameterError, Parameters, Symbol, Value};
use stickslip_physics::observe::{Recording, SlipObserver};
use stickslip_physics::solver::{
    Limits, Method, Resolve, SimulationError, Solver, Summary, simulate_audited,
};

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
/// The same of the means over `SEEDS` seeds, in standard errors, where counts spread far from seed to seed: weak
/// damping lets the whole slider vibrate, a soft one breaks in pieces, and a few contacts hold it up.
const ALIKE_MEANS: f64 = 3.0;
const SEEDS: u64 = 24;

const REFUSED: &str = "refused";

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
    /// If it must not reach its end: how its outcome begins, `refused` or `stopped`, and what that contains, - for a
    /// blank and | between what may be.
    failure: Option<(&'static str, &'static str)>,
}

/// How a hard case went.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub case: String,
    pub solver: Solver,
    /// Whether it ended as it must.
    pub passed: bool,
    /// How it ended.
    pub how: String,
    /// Contacts broken.
    breaks: u64,
    /// Residual of the energy ledger, relative to the work of the drive; `None` if it failed.
    pub residual: Option<f64>,
}

impl HardCase {
    /// A case from its line in the table; `None` if that says something else.
    fn parsed(threat: &'static str, line: &'static str) -> Option<Self> {
        let mut words = line.split_whitespace();
        let mut case = Self {
            threat,
            settings: Vec::new(),
            solver: Solver::default(),
            end_time: words.next()?.parse().ok()?,
            slips: 3,
            is_chaotic: false,
            failure: None,
        };
        for word in words {
            let (key, value) = word.split_once('=').unwrap_or((word, ""));
            match key {
                "slips" if value == "all" => case.slips = u64::MAX,
                "slips" => case.slips = value.parse().ok()?,
                "chaotic" => case.is_chaotic = true,
                "dt" => case.solver = Solver::fixed_step(value.parse().ok()?),
                "tolerance" => case.solver = Solver::event_driven(value.parse().ok()?),
                REFUSED | "stopped" => case.failure = Some((key, value)),
                _ => {
                    let symbol = Symbol::from_key(key)?;
                    let value = match Parameters::default().get(symbol) {
                        Value::Count(_) => Value::Count(value.parse().ok()?),
                        _ => Value::Real(value.parse().ok()?),
                    };
                    case.settings.push((symbol, value));
                }
            }
        }
        Some(case)
    }

    /// What differs from the defaults, in words.
    pub fn name(&self) -> String {
        let words: Vec<String> = self
            .settings
            .iter()
            .map(|(symbol, value)| format!("{} = {value}", symbol.key()))
            .collect();
        if words.is_empty() {
            "defaults".to_owned()
        } else {
            words.join(", ")
        }
    }

    /// Runs it within its budgets: if it is event-driven and not refused, in Taylor steps and as a job does.
    pub fn run(&self) -> Vec<Outcome> {
        if self.solver.method != Method::EventDriven {
            return vec![self.row(self.solver, None)];
        }
        let tolerance = self.solver.tolerance;
        let in_taylor_steps = self.row(
            Solver {
                resolve: Resolve::Taylor,
                ..Solver::event_driven(tolerance)
            },
            None,
        );
        if self.failure.is_some_and(|(how, _)| how == REFUSED) {
            return vec![in_taylor_steps];
        }
        let as_a_job = self.row(self.solver, Some(&in_taylor_steps));
        vec![in_taylor_steps, as_a_job]
    }

    /// Runs it with this solver, and compares it with another run, if there is one.
    fn row(&self, solver: Solver, other: Option<&Outcome>) -> Outcome {
        let outcome = |passed, how: &str, breaks, residual| Outcome {
            case: self.name(),
            solver,
            passed,
            how: how.to_owned(),
            breaks,
            residual,
        };
        match self.simulate(solver, self.parameters()) {
            Ok((summary, residual)) => {
                let is_balanced = residual.abs() <= self.max_residual();
                let is_alike = other.is_none_or(|other| {
                    if self.is_chaotic {
                        self.means_are_alike()
                    } else {
                        are_alike(other.breaks, summary.breaks)
                    }
                });
                let how = match (is_balanced, is_alike) {
                    (true, true) => "done",
                    (false, _) => "done, but energy does not balance",
                    (_, false) => "done, but with too many or too few breaks",
                };
                outcome(
                    self.failure.is_none() && is_balanced && is_alike,
                    how,
                    summary.breaks,
                    Some(residual),
                )
            }
            Err(how) => {
                let is_as_expected = |(begin, words): (&str, &str)| {
                    let mut allowed = words.split('|').map(|words| words.replace('-', " "));
                    how.starts_with(begin) && allowed.any(|words| how.contains(&words))
                };
                outcome(self.failure.is_some_and(is_as_expected), &how, 0, None)
            }
        }
    }

    /// Whether the breaks on the grid and in Taylor steps have the same mean over seeds.
    fn means_are_alike(&self) -> bool {
        if self.solver.method != Method::EventDriven {
            return true;
        }
        let tolerance = self.solver.tolerance;
        let breaks = [Resolve::Grid, Resolve::Taylor].map(|resolve| {
            let solver = Solver {
                resolve,
                ..Solver::event_driven(tolerance)
            };
            let runs = (1..=SEEDS).map(|seed| {
                let parameters = self
                    .parameters()
                    .map(|parameters| Parameters { seed, ..parameters });
                self.simulate(solver, parameters)
                    .map(|(summary, _)| summary.breaks as f64)
            });
            runs.collect::<Result<Vec<f64>, _>>()
        });
        let [Ok(grid), Ok(taylor)] = breaks else {
            return false;
        };
        let [(left, left_spread), (right, right_spread)] = [grid, taylor].map(|breaks| {
            let mean = breaks.iter().sum::<f64>() / SEEDS as f64;
            let squares = breaks
                .iter()
                .map(|breaks| (breaks - mean) * (breaks - mean))
                .sum::<f64>();
            (mean, (squares / (SEEDS - 1) as f64).sqrt())
        });
        (left - right).abs()
            <= ALIKE_MEANS * left_spread.hypot(right_spread) / (SEEDS as f64).sqrt()
    }

    /// Largest residual of the ledger that passes.
    fn max_residual(&self) -> f64 {
        if self.solver.method == Method::EventDriven {
            BALANCED_TOLERANCES * self.solver.tolerance
        } else {
            BALANCED_FIXED_STEP
        }
    }

    fn parameters(&self) -> Result<Parameters, ParameterError> {
        let mut parameters = Parameters::default();
        for &(symbol, value) in &self.settings {
            parameters.set(symbol, value)?;
        }
        parameters.validated()
    }

    /// Summary and residual of the ledger; or how it failed, in words.
    fn simulate(
        &self,
        solver: Solver,
        parameters: Result<Parameters, ParameterError>,
    ) -> Result<(Summary, f64), String> {
        let parameters = parameters.map_err(|error| format!("{REFUSED}: {error}"))?;
        let recording = Recording {
            slips: Some(self.slips),
            discard: 0,
            ..Recording::default()
        };
        let mut observer = SlipObserver::new(&parameters, &recording);
        interrupted_after(TIME_BUDGET, |interrupt| {
            let limits = Limits {
                end_time: self.end_time,
                events: EVENT_BUDGET,
                interrupt: Some(interrupt),
            };
            let audited = simulate_audited(&parameters, solver, limits, &mut observer);
            audited.map(|(summary, ledger)| (summary, ledger.residual()))
        })
        .map_err(|error| match error {
            SimulationError::BadSetting { .. } => {
                format!("{REFUSED}: {error}")
            }
            _ => format!("stopped {error}"),
        })
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

const TABLE: &str = include_str!("table.txt");

/// Every case, group by group.
pub fn hard_cases() -> Vec<HardCase> {
    let (mut cases, mut threat) = (Vec::new(), "");
    for line in TABLE
        .lines()
        .filter(|line| !line.trim().is_empty() && !line.trim_start().starts_with('#'))
    {
        if line.starts_with(' ') {
            cases.push(HardCase::parsed(threat, line).expect(line));
        } else {
            threat = line;
        }
    }
    cases
}
