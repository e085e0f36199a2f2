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
        let mut words = vec!["stickslip simulate".to_owned()];
        let defaults = Parameters::default();
        let parameters = Symbol::ALL.into_iter().map(|symbol| (symbol, job.parameters.get(symbol)));
        let parameters = parameters.filter(|(symbol, value)| *value != defaults.get(*symbol) && *value != Value::Null);
        words.extend(parameters.map(|(symbol, value)| format!("--set {}={value}", symbol.key())));
        // Its default is another there.
        words.push(format!("--slips {}", self.recording.slips));
        // A single job has no control.
        let defaults =
            Recording { slips: self.recording.slips, control: self.recording.control, ..Recording::default() };
        let recording = RecordingKey::ALL.into_iter().filter(|&key| self.recording.get(key) != defaults.get(key));
        words.extend(recording.map(|key| format!("--record {}={}", key.key(), self.recording.get(key))));
        let defaults = solver_settings(Solver::default());
        let settings = solver_settings(self.solver).into_iter().filter(|setting| !defaults.contains(setting));
        words.extend(settings.map(|(key, value)| format!("--set {key}={value}")));
        words.join(" ")
    }
}
