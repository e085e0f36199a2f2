//! A job, and the names by which results know it.
//!
//! An id is the first half of SHA-256 over the model version, the scheme of random numbers, and all of solver,
//! recording and parameters that is not at its default, parameters with their exact bits: never over the place in a
//! grid. So keys that are added later change no id. Contract: pinned by known-answer tests, and so are the defaults.

use super::measured::Measured;
use crate::model::{MODEL_VERSION, Parameters, RNG_SCHEME, Symbol, Value};
use crate::observe::{Recording, RecordingKey};
use crate::solver::{Solver, SolverKey};
use crate::table::checksum::hexadecimal;
use sha2::{Digest, Sha256};
use std::iter;

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

/// Keys and values of the solver, as a sweep file writes them: they read back to the same bits.
pub(super) fn solver_settings(solver: Solver) -> Vec<(&'static str, String)> {
    let keys = solver.method.settings().iter();
    iter::once(&SolverKey::Method)
        .chain(keys)
        .map(|key| (key.key(), solver.get(*key).to_string()))
        .collect()
}

/// Keys and values of the solver and the recording. The longest time, the budget of events and the controls count as
/// the default: they change no job that ends by itself.
pub(super) fn settings(
    solver: Solver,
    recording: &Recording,
) -> impl Iterator<Item = (String, String)> + use<> {
    let default = Recording::default();
    let recording = Recording {
        max_time: default.max_time,
        max_events: default.max_events,
        control: default.control,
        ..*recording
    };
    let settings = solver_settings(solver).into_iter();
    let solver = settings.map(|(key, value)| (format!("solver.{key}"), value));
    let record = RecordingKey::ALL.map(|key| {
        let value = recording.get(key).to_string();
        (format!("record.{}", key.key()), value)
    });
    solver.chain(record)
}

/// Of the model, and of its random numbers, as ids have them.
pub const VERSIONS: (u32, &str) = (MODEL_VERSION, RNG_SCHEME);

/// Gives jobs their ids, of 32 hexadecimal characters: all that they share is hashed once.
#[derive(Clone, Debug)]
pub struct Identity {
    shared: Sha256,
}

impl Identity {
    /// Of jobs of this version of the model and scheme of random numbers; if they were measured, of what was read.
    pub fn new(
        (model_version, rng_scheme): (u32, &str),
        solver: Solver,
        recording: &Recording,
        measured: Option<&Measured>,
    ) -> Self {
        let mut shared = Sha256::new();
        shared.update(format!("model={model_version}\nrng={rng_scheme}\n"));
        let defaults: Vec<_> = settings(Solver::default(), &Recording::default()).collect();
        let others = settings(solver, recording).filter(|setting| !defaults.contains(setting));
        for (key, value) in others {
            shared.update(format!("{key}={value}\n"));
        }
        if let Some(measured) = measured {
            shared.update(format!("measured={}\n", measured.rows));
        }
        Self { shared }
    }

    /// The id of a job, or of a set, by these of its canonical parameters.
    pub fn id(&self, parameters: &Parameters, symbols: &[Symbol]) -> String {
        let mut hasher = self.shared.clone();
        let defaults = Parameters::default();
        for &symbol in symbols {
            let value = parameters.get(symbol);
            if value != defaults.get(symbol) {
                hasher.update(symbol.key());
                hasher.update("=");
                match value {
                    Value::Real(real) => hasher.update(real.to_bits().to_le_bytes()),
                    Value::Count(count) => hasher.update(count.to_le_bytes()),
                    other => hasher.update(other.to_string()),
                }
                hasher.update("\n");
            }
        }
        hexadecimal(&hasher.finalize()[..ID_BYTES])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{BreakOn, Selection};
    use crate::sets::AllButSeed;
    use std::collections::HashSet;

    fn of(solver: Solver, recording: &Recording) -> Identity {
        Identity::new(VERSIONS, solver, recording, None)
    }

    fn identity() -> Identity {
        of(Solver::fixed_step(1e-6), &Recording::default())
    }

    #[test]
    fn ids_are_pinned() {
        // A change here orphans every result: raise FORMAT of results directories with it, or leave the hash alone.
        let modulated = Parameters {
            drive_velocity: 2e-4,
            modulation_amplitude: 1e-6,
            modulation_period: Some(0.01),
            seed: 3,
            ..Parameters::default()
        };
        let default = of(Solver::default(), &Recording::default());
        assert_eq!(
            default.id(&Parameters::default(), &Symbol::ALL),
            "2c170cc0b36cc42ee95cf55769f6ce90"
        );
        assert_eq!(
            identity().id(&modulated, &Symbol::ALL),
            "a222cc3c059a14192ba1a6f92a7b4939"
        );
        assert_eq!(
            identity().id(&modulated, AllButSeed::SYMBOLS),
            "3732eed4518ef4d6b2f14de8a7a287d1"
        );
    }

    #[test]
    fn defaults_are_pinned() {
        // What is at its default is no part of an id: with another default an id would name another job. Change one,
        // and raise MODEL_VERSION; what is added is added here alone.
        let defaults = Parameters::default();
        let parameters =
            Symbol::ALL.map(|symbol| format!("{}={}", symbol.key(), defaults.get(symbol)));
        let settings = settings(Solver::default(), &Recording::default())
            .map(|(key, value)| format!("{key}={value}"));
        let defaults: Vec<String> = parameters.into_iter().chain(settings).collect();
        assert_eq!(
            (MODEL_VERSION, defaults.join(" ").as_str()),
            (
                8,
                "N=70 Ns=20 M=11.5 K=1e8 Kd=4e7 ki=5e6 fs=1.37 dfs=0.0069 tau_r=0.005 gamma=6462 \
                V0=1e-4 Delta=0 T=none T_to=none Delta_to=none ramp_time=0 \
                pulse_start=none pulse_cycles=none FN=4000 L=0.15 break_on=magnitude seed=0 \
                solver.method=event-driven solver.tolerance=0.001 solver.resolve=auto record.slips=40 record.time=none record.discard=5 \
                record.max_time=none record.max_events=1000000000 record.precursor_size=none record.precursors=false \
                record.drop_size=none record.energies=false record.control=false record.give_up_after=none"
            )
        );
    }

    #[test]
    fn every_parameter_changes_the_job_and_all_but_the_seed_the_set() {
        let ramped = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(0.01),
            turning_period: Some(0.02),
            turning_amplitude: Some(2e-6),
            ramp_time: 1.0,
            pulse_start: Some(1.0),
            pulse_cycles: Some(1),
            ..Parameters::default()
        };
        let mut jobs = HashSet::from([identity().id(&ramped, &Symbol::ALL)]);
        for symbol in Symbol::ALL {
            let mut other = ramped.clone();
            let value = match other.get(symbol) {
                Value::Count(count) => Value::Count(count + 1),
                Value::Real(real) => Value::Real(real.next_up()),
                Value::Text(_) => Value::Text(BreakOn::Tension.word()),
                Value::Flag(_) | Value::Null => panic!("all are there, none is a flag"),
            };
            other.set(symbol, value).unwrap();
            assert!(
                jobs.insert(identity().id(&other, &Symbol::ALL)),
                "{symbol:?}"
            );
            let same_set = identity().id(&other, AllButSeed::SYMBOLS)
                == identity().id(&ramped, AllButSeed::SYMBOLS);
            assert_eq!(same_set, symbol == Symbol::Seed, "{symbol:?}");
        }
    }

    #[test]
    fn solver_and_recording_but_for_bounds_change_every_id() {
        let mut recordings = vec![Recording::default()];
        let bounded = Recording {
            max_time: Some(7.0),
            max_events: 7,
            control: true,
            ..Recording::default()
        };
        let solver = Solver::fixed_step(1e-6);
        let id = |recording| of(solver, recording).id(&Parameters::default(), &Symbol::ALL);
        assert_eq!(id(&bounded), id(&Recording::default()));
        for key in RecordingKey::ALL.into_iter().filter(|key| {
            !matches!(
                key,
                RecordingKey::MaxTime | RecordingKey::MaxEvents | RecordingKey::Control
            )
        }) {
            let before = recordings.len();
            for value in [
                Value::Real(7.0),
                Value::Real(7.0_f64.next_up()),
                Value::Flag(true),
            ] {
                let mut other = Recording::default();
                recordings.extend(other.put(key, value).map(|()| other));
            }
            assert!(recordings.len() > before, "{key:?}");
        }
        let mut ids = HashSet::new();
        for time_step in [1e-6, 1e-6_f64.next_up()] {
            for recording in &recordings {
                let identity = of(Solver::fixed_step(time_step), recording);
                assert!(ids.insert(identity.id(&Parameters::default(), &Symbol::ALL)));
            }
        }
    }
}
