//! Measured slips, from a table of another library.

use crate::errors::Error;
use crate::run::reduce_and_draw;
use crate::watched::watched;
use pyo3::prelude::*;
use std::path::PathBuf;
use stickslip::figure::draw_drop_size;
use stickslip::measured::{Experiment, Given, NoPlateau, Request, Sources, TraceRequest};
use stickslip::results::layout::Layout;
use stickslip::run::{Options, Shard};
use stickslip::sweep::Job;
use stickslip::table::storage::Disk;

/// A key, its column or value, and its unit, if that is not of SI.
type KeyFromUnit = (String, String, Option<String>);

/// Reads a stream of Arrow's own format into a results directory; returns what was read, with headings.
#[pyfunction]
pub fn measured(
    py: Python<'_>,
    stream: &[u8],
    columns: Vec<KeyFromUnit>,
    set: Vec<KeyFromUnit>,
    trace: Option<(String, usize)>,
    out: PathBuf,
) -> PyResult<Vec<(String, String)>> {
    let request = trace.map(|(drop_size, smooth)| TraceRequest::new(&drop_size, smooth));
    let experiment = read(stream, &columns, &set, request.transpose()).map_err(|error| {
        let refused = error.downcast_ref::<NoPlateau>();
        let figure =
            refused.map(|refused| draw_drop_size(&Layout::new(&Disk, &out), &refused.sizes));
        match figure.transpose() {
            Ok(_) => Error::Sweep(format!("{error:#}")),
            Err(failed) => failed.into(),
        }
    })?;
    let sweep = &experiment.sweep;
    watched(
        py,
        |stop, _| {
            let layout = Layout::new(&Disk, &out);
            let options = Options {
                threads: None,
                stop,
                retry_failed: false,
                shard: Shard::default(),
                walltime: None,
            };
            stickslip::run::join(&layout, sweep, options, |joined| -> Result<(), Error> {
                let kernel = |job: &Job, _: &_| Ok(experiment.measurements(job));
                let report = joined.run(&kernel, &mut |_| ())?;
                if report.jobs_left == 0 && !report.stopped {
                    joined.reduce(|| reduce_and_draw(&layout, sweep.name()))?;
                    let sizes = experiment.drop_sizes.as_ref();
                    sizes
                        .map(|sizes| draw_drop_size(&layout, sizes))
                        .transpose()?;
                }
                Ok(())
            })
        },
        |()| (),
        |_| Ok(()),
    )?;
    Ok(experiment.read)
}

fn read(
    stream: &[u8],
    columns: &[KeyFromUnit],
    set: &[KeyFromUnit],
    trace: anyhow::Result<Option<TraceRequest>>,
) -> anyhow::Result<Experiment> {
    let trace = trace?;
    let given = |(key, from, unit): &KeyFromUnit| Given::new(key, from, unit.as_deref());
    let all =
        |given_all: &[KeyFromUnit]| given_all.iter().map(given).collect::<anyhow::Result<_>>();
    let request = Request {
        sources: Sources::new(all(columns)?, all(set)?, trace.is_some())?,
        options: format!("columns={columns:?}, set={set:?}, trace={trace:?}"),
        trace,
        ..Request::default()
    };
    Experiment::read_stream(stream.to_vec(), &request)
}
