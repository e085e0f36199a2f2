//! A job as a command line, so that one that fails can be looked at alone.

use super::grid::Sweep;
use super::job::Job;
use crate::model::{Parameters, Symbol, Value};
use crate::observe::{Recording, RecordingKey};
use crate::solver::{Resolve, Solver};

impl Sweep {
    /// The `stickslip simulate` command that does what a job of this sweep does: what differs from the defaults, in digits
    /// that read back to the same bits.
    pub fn command(&self, job: &Job) -> String {
        let (defaults, mut words) = (Parameters::default(), vec!["stickslip simulate".to_owned()]);
        for symbol in Symbol::ALL {
            let value = job.parameters.get(symbol);
            if value != defaults.get(symbol) && value != Value::Null {
                words.push(format!("--set {}={value}", symbol.key()));
            }
        }
        // A single job has no control.
        for key in RecordingKey::ALL.into_iter().filter(|&key| key != RecordingKey::Control) {
            let value = self.recording.get(key);
            match key {
                // Its default is another there.
                RecordingKey::Slips => words.push(format!("--slips {value}")),
                _ if value == Recording::default().get(key) => {}
                RecordingKey::MaxTime => words.push(format!("--time {value}")),
                _ => words.push(format!("--record {}={value}", key.key())),
            }
        }
        match self.solver {
            solver if solver == Solver::default() => {}
            Solver::EventDriven { tolerance, resolve } => {
                words.push(format!("--tolerance {}", Value::Real(tolerance)));
                if resolve != Resolve::Auto {
                    words.push(format!("--resolve {}", resolve.word()));
                }
            }
            Solver::FixedStep { time_step } => {
                words.push(format!("--solver fixed-step --dt {}", Value::Real(time_step)));
            }
        }
        words.join(" ")
    }
}
