//! One period of modulation before the slider would slip: how much earlier its next slip comes.
#![allow(clippy::print_stdout, reason = "an example")]

use std::error::Error;
use std::sync::atomic::AtomicBool;
use stickslip_physics::model::Parameters;
use stickslip_physics::observe::{Recording, measure};
use stickslip_physics::solver::Solver;

fn main() -> Result<(), Box<dyn Error>> {
    let pulsed = Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(1.0 / 58.0),
        pulse_start: Some(0.18),
        ..Parameters::default()
    };
    let recording = Recording {
        slips: Some(3),
        discard: 0,
        ..Recording::default()
    };
    let onsets = |parameters: &Parameters| {
        let stop = AtomicBool::new(false);
        let measured = measure(parameters, &recording, Solver::default(), &stop)?;
        Ok::<Vec<f64>, Box<dyn Error>>(measured.slips.iter().map(|slip| slip.onset).collect())
    };
    let control = onsets(&pulsed.without_modulation().validated()?)?;
    let advanced = onsets(&pulsed.validated()?)?;
    for (number, (free, onset)) in control.iter().zip(&advanced).enumerate() {
        println!(
            "slip {number}: {:.2} ms, {:.2} ms earlier than in the control",
            1e3 * onset,
            1e3 * (free - onset)
        );
    }
    Ok(())
}
