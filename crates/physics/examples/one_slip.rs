//! The first slip of the paper's slider: when it begins, how large it is, and whether its energy balances.
#![allow(clippy::print_stdout, reason = "an example")]

use stickslip_physics::model::Parameters;
use stickslip_physics::observe::{Recording, SlipObserver};
use stickslip_physics::solver::{Limits, SimulationError, Solver, simulate_audited};

fn main() -> Result<(), SimulationError> {
    let parameters = Parameters::default();
    let recording = Recording {
        slips: Some(1),
        discard: 0,
        ..Recording::default()
    };
    let limits = Limits {
        end_time: f64::INFINITY,
        events: 1_000_000,
        interrupt: None,
    };
    let mut observer = SlipObserver::new(&parameters, &recording);
    let (summary, ledger) =
        simulate_audited(&parameters, Solver::default(), limits, &mut observer)?;
    let measured = observer.into_measurements(summary);
    for slip in &measured.slips {
        println!("onset       {:.2} ms", 1e3 * slip.onset);
        println!("duration    {:.2} ms", 1e3 * slip.duration);
        println!("peak force  {:.0} N", slip.peak_force);
        println!("contacts    {} broken", slip.size);
    }
    println!(
        "energy      unbalanced {:.1e} of the work",
        ledger.residual().abs()
    );
    Ok(())
}
