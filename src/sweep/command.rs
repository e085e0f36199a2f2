//! A job as a command line, so that one that fails can be looked at alone.

use super::job::Job;
use super::plan::Sweep;
use crate::model::{Parameters, Symbol, Value};
use crate::observe::Recording;
use crate::solver::Solver;

impl Sweep {
    /// The `stickslip simulate` command that does what a job of this sweep does: what differs from the defaults, in digits
    /// that read back to the same bits.
    #[must_use]
    pub fn command(&self, job: &Job) -> String {
        let (defaults, mut words) = (Parameters::default(), vec!["stickslip simulate".to_owned()]);
        for symbol in Symbol::ALL {
            let value = job.parameters.get(symbol);
            if value != defaults.get(symbol) && value != Value::Absent {
                words.push(format!("--set {}={value}", symbol.key()));
            }
        }
        let (recording, usual) = (&self.recording, Recording::default());
        words.push(format!("--slips {}", recording.slips));
        if recording.discard != usual.discard {
            words.push(format!("--discard {}", recording.discard));
        }
        if let Some(time) = recording.max_time {
            words.push(format!("--time {}", Value::Real(time)));
        }
        if recording.max_events != usual.max_events {
            words.push(format!("--max-events {}", recording.max_events));
        }
        if let Some(size) = recording.precursor_size {
            words.push(format!("--precursor-size {size}"));
        }
        if let Some(size) = recording.drop_size {
            words.push(format!("--drop-size {}", Value::Real(size)));
        }
        match self.solver {
            solver if solver == Solver::default() => {}
            Solver::EventDriven { tolerance } => words.push(format!("--tolerance {}", Value::Real(tolerance))),
            Solver::FixedStep { time_step } => {
                words.push(format!("--solver fixed-step --dt {}", Value::Real(time_step)));
            }
        }
        words.join(" ")
    }
}
