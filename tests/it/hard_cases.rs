//! Hard cases: every one ends as it must, and says so.

use stickslip::accuracy::{HardCase, hard_cases};
use stickslip::model::{Change, Parameters};
use stickslip::observe::ContactLog;
use stickslip::solver::{Limits, SimulationError, Solver, simulate};

#[track_caller]
fn all_pass(threat: &str) {
    let cases = hard_cases();
    let rows: Vec<_> = cases.iter().filter(|case| case.threat.starts_with(threat)).flat_map(HardCase::run).collect();
    assert!(!rows.is_empty(), "no case {threat}");
    for row in rows {
        assert!(row.passed, "{row:?}");
    }
}

#[test]
fn long_runs() {
    all_pass("long runs");
}

#[test]
fn ties() {
    all_pass("ties");
}

#[test]
fn reattachment() {
    all_pass("very short and very long reattachment");
}

#[test]
fn wide_thresholds() {
    all_pass("thresholds");
}

#[test]
fn damping() {
    all_pass("no damping");
}

#[test]
fn drives() {
    all_pass("slow and fast drive");
}

#[test]
fn sizes() {
    all_pass("sizes");
}

#[test]
fn limits_of_stability() {
    all_pass("the limit of stability");
}

#[test]
fn values_beyond_what_doubles_resolve() {
    all_pass("values beyond what doubles resolve");
}

#[test]
fn values_that_make_no_sense() {
    all_pass("values that make no sense");
}

#[test]
fn a_strong_modulation_breaks_contacts_in_reverse() {
    let parameters = Parameters { modulation_amplitude: 1e-4, modulation_period: Some(0.02), ..Parameters::default() };
    let mut log = ContactLog::default();
    let limits = Limits { end_time: 0.03, events: 1_000_000, interrupt: None };
    simulate(&parameters, Solver::default(), limits, &mut log).unwrap();
    let breaks = || log.events.iter().filter(|event| event.change == Change::Break);
    for event in breaks() {
        assert!((event.force.abs() / event.threshold - 1.0).abs() < 1e-5, "{event:?}");
    }
    assert!(breaks().any(|event| event.force < 0.0) && breaks().any(|event| event.force > 0.0));
}

#[test]
fn a_run_over_its_event_budget_says_when_and_why() {
    for solver in [Solver::default(), Solver::FixedStep { time_step: 1e-6 }] {
        let limits = Limits { end_time: 1.0, events: 500, interrupt: None };
        let error = simulate(&Parameters::default(), solver, limits, &mut ContactLog::default()).unwrap_err();
        assert!(matches!(error, SimulationError::EventBudget { time, events: 500 } if time > 0.06), "{error}");
    }
}
