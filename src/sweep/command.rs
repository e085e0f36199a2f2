//! A job as a command line, so that one that fails can be looked at alone.

use super::grid::Sweep;
use super::job::{Job, solver_settings};
use crate::model::{Parameters, Symbol, Value};
use crate::observe::{Recording, RecordingKey};
use crate::solver::Solver;

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
                _ => words.push(format!("--record {}={value}", key.key())),
            }
        }
        let defaults = solver_settings(Solver::default());
        let settings = solver_settings(self.solver).into_iter().filter(|setting| !defaults.contains(setting));
        words.extend(settings.map(|(key, value)| format!("--set {key}={value}")));
        words.join(" ")
    }
}
