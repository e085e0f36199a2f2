//! Stick-slip friction of a slider held by breakable contacts: parameter sweeps of the model of Capozza et al.,
//! "Stabilizing stick-slip friction", PRL 107, 024301 (2011).
//!
//! A sweep file has jobs, and a job has slips:
//!
//! ```
//! use std::path::Path;
//! use std::sync::atomic::AtomicBool;
//! use stickslip::observe::measure;
//! use stickslip::sweep::Sweep;
//!
//! let text = "
//! name = \"two-velocities\"
//! [axes]
//! V0   = [1e-5, 1e-4]
//! seed = { count = 3 }
//! [record]
//! slips = 4
//! ";
//! let sweep = Sweep::parse(text, Path::new("two-velocities.toml"))?;
//! assert_eq!(sweep.jobs_of_grid().count(), 6);
//!
//! let job = sweep.jobs_of_grid().next().expect("there are six");
//! let stop = AtomicBool::new(false);
//! let measured = measure(&job.parameters, sweep.recording(), sweep.solver(), &stop)?;
//! assert_eq!(measured.slips.len(), 4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Ids, tables, JSON and exit codes are stable; this interface is not, as other programs use the command line or Python.
//!
//! ```text
//! sweep file -> plan -> jobs -> measurements -> tables -> reduced data -> figures, report
//!     sweep/             run/   physics/        results/   reduce/         figure/  report/
//!                                 solver/       table/     sets/
//!                                 observe/
//!                                 model/
//! ```
//!
//! Imports run one way: `physics` <- `table` <- `sets` <- `sweep` <- `results` <- `reduce` <- `rounds` <- `run`;
//! `reduce` <- `figure`; `run`, `figure` <- `report`. `physics/` is a separate crate, on which other programs can
//! depend: model, solvers and measurements, with the columns of their rows; it knows no file. `sets` describes the
//! columns of a parameter set. `single_job` runs one job with all its records, `measured` reads slips of an experiment
//! in place of jobs. `accuracy` compares the solvers, from the model to figures. `cli` is the command line, the only
//! code that prints; `python/` makes a Python module of the library.
//!
//! | word | meaning |
//! |---|---|
//! | parameters | all that defines one realisation of the model, seed included ([`model::Parameters`]) |
//! | contact event | a contact breaks or attaches ([`model::ContactEvent`]) |
//! | segment | a stretch of time without a contact event ([`solver::Segment`]) |
//! | rupture | a run of breaks without a gap longer than the wave crossing time |
//! | slip, precursor | a rupture of all blocks that releases many contacts; any other of enough breaks ([`observe::Slip`]) |
//! | recording | what a job measures, and when it ends ([`observe::Recording`]) |
//! | sweep | a sweep file, parsed: parameters, axes, recording, solver |
//! | job | one point of a sweep, known by a hash of parameters, solver and recording |
//! | set | all jobs that differ in the seed alone |
//! | round | points of an adaptive sweep that run together: an extension ([`rounds`]) |
//! | extension | a sweep in a results directory; it owns its jobs except those that earlier extensions have done |
//! | part | consecutive jobs of an extension, committed together |
//! | outline | a part without its jobs: where they lie, and their sums |
//! | worker | a process that works on a results directory, beside others |
//! | claim | which worker runs a part, reduces or decides a round |
//! | shard | a share of the parts, run into a separate directory |

mod accuracy;
pub mod cli;
#[cfg(test)]
mod documented;
pub mod figure;
pub mod measured;
pub mod reduce;
mod report;
pub mod results;
pub mod rounds;
pub mod run;
pub mod sets;
pub mod single_job;
pub mod sweep;
pub mod table;

pub use stickslip_physics::{model, observe, solver};
