//! Cost of the solvers: time per step of the fixed step, time per stretch of model time of the event-driven solver.
//!
//! `cargo bench` prints the time of each run; `items` are steps of the fixed step.
#![allow(missing_docs, reason = "a benchmark")]

use divan::Bencher;
use divan::counter::ItemsCount;
use stickslip::model::Parameters;
use stickslip::observe::{Recording, SlipObserver};
use stickslip::solver::{Limits, Solver, simulate};

fn main() {
    divan::main();
}

/// Model time of a run, in s: through loading and several slips at the default parameters.
const STRETCH: f64 = 0.6;
/// The fixed step, in s: below the limit of stability of both sizes.
const STEP: f64 = 1e-7;
/// Steps of a run of the fixed step.
const STEPS: u64 = 100_000;

fn run(parameters: &Parameters, solver: Solver, end_time: f64) -> u64 {
    let limits = Limits {
        end_time,
        events: u64::MAX,
        interrupt: None,
    };
    let mut observer = SlipObserver::new(
        parameters,
        &Recording {
            slips: Some(u64::MAX),
            ..Recording::default()
        },
    );
    simulate(parameters, solver, limits, &mut observer)
        .expect("the simulation must not fail")
        .steps
}

/// Time per step = time / items. The drive is fast, so that slips are under way.
#[divan::bench(args = [70, 1000])]
fn fixed_step(bencher: Bencher<'_, '_>, blocks: usize) {
    let parameters = Parameters {
        blocks,
        drive_velocity: 1e-3,
        ..Parameters::default()
    };
    let steps = run(&parameters, Solver::fixed_step(STEP), STEP * STEPS as f64);
    bencher
        .counter(ItemsCount::new(steps))
        .bench(|| run(&parameters, Solver::fixed_step(STEP), STEP * STEPS as f64));
}

/// The same physics by both solvers: 0.6 s at V0 = 1e-4 m/s.
#[divan::bench(args = [1e-3, 1e-4, 1e-6, 1e-8, 1e-10])]
fn event_driven(bencher: Bencher<'_, '_>, tolerance: f64) {
    let parameters = Parameters::default();
    bencher.bench(|| run(&parameters, Solver::event_driven(tolerance), STRETCH));
}

#[divan::bench(args = [1e-6])]
fn fixed_step_for_comparison(bencher: Bencher<'_, '_>, time_step: f64) {
    let parameters = Parameters::default();
    bencher.bench(|| run(&parameters, Solver::fixed_step(time_step), STRETCH));
}
