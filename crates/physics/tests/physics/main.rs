//! The physics from outside, in one binary: `cargo test --release -p stickslip-physics --test physics NAME`.
#![allow(
    clippy::tests_outside_test_module,
    clippy::unwrap_used,
    reason = "integration tests"
)]

mod deterministic_rows;
mod differential;
mod drops;
mod energy_ledger;
mod equation_of_motion;
mod examples;
mod grid;
mod grid_hard_cases;
mod hard_cases;
mod ramp;
mod regimes;
mod statistics;
