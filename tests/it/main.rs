//! Tests of the library from outside and of the built program, in one binary: `cargo test --release --test it NAME`.
#![allow(
    clippy::tests_outside_test_module,
    clippy::unwrap_used,
    reason = "integration tests"
)]

mod accuracy;
mod bad_input;
mod batch;
mod controls;
mod damage;
mod deaths;
mod export;
mod failures;
mod figures;
mod first_steps;
mod fuzz;
mod golden;
mod kills;
mod measured;
mod moved;
mod outputs;
mod program;
mod pulses;
mod report;
mod rounds;
mod runs;
mod sharing;
mod show;
mod simulate;
mod traces;
mod unreadable;
