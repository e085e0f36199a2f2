//! A job, and the names by which results know it.
//!
//! An id is the first half of SHA-256 over the model version, the scheme of random numbers, the solver's setting, the
//! recording and the exact bits of every parameter: never over the place in a grid. Contract: pinned by a known-answer
//! test; another id means that the results are others.

use crate::model::{MODEL_VERSION, Parameters, RNG_SCHEME, Shortest, Symbol};
use crate::observe::Recording;
use crate::solver::{Resolve, Solver};
use sha2::{Digest, Sha256};
use std::fmt;

/// One point of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Number of the point in grid order, before conditions and duplicates.
    pub point: u64,
    pub parameters: Parameters,
    /// Predicted CPU time, in s.
    pub cost: f64,
}

/// Bytes of an id: 128 bits, so that ten million jobs collide with a probability of about 1e-25.
const ID_BYTES: usize = 16;

macro_rules! id {
    ($(#[$about:meta])* $Id:ident) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $Id([u8; ID_BYTES]);

        impl $Id {
            /// The 16 bytes.
            pub const fn as_bytes(&self) -> &[u8; ID_BYTES] {
                &self.0
            }
        }

        impl fmt::Display for $Id {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
            }
        }
    };
}

id! {
    /// Name of a job. Shown as 32 hexadecimal characters.
    JobId
}

id! {
    /// Name of the jobs that differ in the seed alone. Shown as 32 hexadecimal characters.
    SetId
}

/// Keys and values of the solver and the recording, as a sweep file writes them. Values read back to the same bits.
pub(super) fn settings(solver: Solver, recording: &Recording) -> impl Iterator<Item = (String, String)> {
    let (method, key, value, resolve) = match solver {
        Solver::EventDriven { tolerance, resolve } => ("event-driven", "solver.tolerance", tolerance, resolve),
        Solver::FixedStep { time_step } => ("fixed-step", "solver.dt", time_step, Resolve::Auto),
    };
    let mut solver = vec![("solver.method", method.to_owned()), (key, Shortest(value).to_string())];
    // As a later key of the recording: part of an id only where it differs from its default.
    if resolve != Resolve::Auto {
        solver.push(("solver.resolve", resolve.word().to_owned()));
    }
    solver.into_iter().map(|(key, value)| (key.to_owned(), value)).chain(recording.settings())
}

/// Gives jobs their ids: all that they share is hashed once.
#[derive(Clone, Debug)]
pub struct Identity {
    shared: Sha256,
}

impl Identity {
    /// The identity of jobs with this solver and recording.
    pub fn new(solver: Solver, recording: &Recording) -> Self {
        let mut shared = Sha256::new();
        shared.update(format!("model={MODEL_VERSION}\nrng={RNG_SCHEME}\n"));
        for (key, value) in settings(solver, recording) {
            shared.update(format!("{key}={value}\n"));
        }
        Self { shared }
    }

    /// The id of a job with these canonical parameters.
    pub fn job(&self, parameters: &Parameters) -> JobId {
        JobId(self.hash(parameters, &Symbol::ALL))
    }

    /// The id of the set that such a job belongs to.
    pub fn set(&self, parameters: &Parameters) -> SetId {
        SetId(self.hash(parameters, Symbol::ALL.split_last().map_or(&[], |(_, others)| others)))
    }

    fn hash(&self, parameters: &Parameters, symbols: &[Symbol]) -> [u8; ID_BYTES] {
        let mut hasher = self.shared.clone();
        for &symbol in symbols {
            let (kind, bits) = parameters.get(symbol).bits();
            hasher.update([kind]);
            hasher.update(bits.to_le_bytes());
        }
        let digest = hasher.finalize();
        std::array::from_fn(|byte| digest[byte])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{BreakOn, Value};
    use crate::observe::RecordingKey;
    use std::collections::HashSet;

    fn identity() -> Identity {
        Identity::new(Solver::FixedStep { time_step: 1e-6 }, &Recording::default())
    }

    #[test]
    fn ids_are_pinned() {
        // A change here orphans every result: raise MODEL_VERSION or leave the hash alone.
        assert_eq!(identity().job(&Parameters::default()).to_string(), "8c3edcbf146555e1b906e31378667201");
        assert_eq!(identity().set(&Parameters::default()).to_string(), "63ec6bdfb85d355b8b9e1913ba90294a");
    }

    #[test]
    fn every_parameter_changes_the_job_and_all_but_the_seed_the_set() {
        let ramped = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(0.01),
            turning_period: Some(0.02),
            turning_amplitude: Some(2e-6),
            ramp_time: 1.0,
            ..Parameters::default()
        };
        let mut jobs = HashSet::from([identity().job(&ramped)]);
        for symbol in Symbol::ALL {
            let mut other = ramped.clone();
            let value = match other.get(symbol) {
                Value::Count(count) => Value::Count(count + 1),
                Value::Real(real) => Value::Real(real.next_up()),
                Value::BreakOn(_) => Value::BreakOn(BreakOn::Tension),
                Value::Flag(_) | Value::Absent => panic!("all are there, none is a flag"),
            };
            other.set(symbol, value).unwrap();
            assert!(jobs.insert(identity().job(&other)), "{symbol:?}");
            let same_set = identity().set(&other) == identity().set(&ramped);
            assert_eq!(same_set, symbol == Symbol::Seed, "{symbol:?}");
        }
    }

    #[test]
    fn solver_and_recording_but_for_bounds_change_every_id() {
        let mut recordings = vec![Recording::default()];
        let bounded = Recording { max_time: Some(7.0), max_events: 7, ..Recording::default() };
        let solver = Solver::FixedStep { time_step: 1e-6 };
        let id = |recording| Identity::new(solver, recording).job(&Parameters::default());
        assert_eq!(id(&bounded), id(&Recording::default()));
        for key in
            RecordingKey::ALL.into_iter().filter(|key| !matches!(key, RecordingKey::MaxTime | RecordingKey::MaxEvents))
        {
            let before = recordings.len();
            for value in [Value::Real(7.0), Value::Real(7.0_f64.next_up()), Value::Flag(true)] {
                let mut other = Recording::default();
                recordings.extend(other.put(key, value).map(|()| other));
            }
            assert!(recordings.len() > before, "{key:?}");
        }
        let mut ids = HashSet::new();
        for time_step in [1e-6, 1e-6_f64.next_up()] {
            for recording in &recordings {
                let identity = Identity::new(Solver::FixedStep { time_step }, recording);
                assert!(ids.insert(identity.job(&Parameters::default())));
            }
        }
    }
}
