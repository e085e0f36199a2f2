//! The files of `stickslip simulate`: tables and pictures, checked before anything runs.

use super::super::exit::UsageError;
use super::super::plot::picture_file;
use super::super::signals;
use super::{Arguments, Panel, PlotFlags};
use crate::figure::simulation;
use crate::model::Parameters;
use crate::observe::{MapRow, Slip};
use crate::results::destination::{Destination, Kind};
use crate::simulate::Records;
use crate::sweep::Sweep;
use crate::table::columns::Table;
use crate::table::file::{Footer, TableWriter};
use crate::table::shown::shown;
use anyhow::Result;
use std::borrow::Cow;
use std::path::Path;

/// What could not be written is refused before anything runs.
pub(super) fn check_outputs(
    arguments: &Arguments,
    sweep: &Sweep,
    parameters: &Parameters,
) -> Result<()> {
    check_times(arguments, sweep, parameters).map_err(UsageError)?;
    let tables = &arguments.tables;
    let tables = [
        &tables.trace,
        &tables.map,
        &tables.profile,
        &tables.contacts,
        &tables.slip_table,
    ];
    let mut all = Vec::new();
    for table in tables.into_iter().flatten() {
        if table.exists() && !table.is_file() {
            return Err(UsageError(format!("{}: must be a file", shown(table))).into());
        }
        all.push(Destination::new(table, Kind::PARQUET)?);
    }
    for file in &arguments.plot.files {
        all.push(picture_file(file)?.0);
    }
    Ok(Destination::refuse_same(&all)?)
}

fn check_times(
    arguments: &Arguments,
    sweep: &Sweep,
    parameters: &Parameters,
) -> Result<(), String> {
    let PlotFlags { from, until, .. } = &arguments.plot;
    let longest = sweep.recording().max_time.unwrap_or(f64::INFINITY);
    arguments
        .request()
        .check(parameters, sweep.recording())
        .map_err(|error| format!("--{error}"))?;
    if !(*from >= 0.0 && from.is_finite()) {
        return Err(format!("--from {from}: must be a finite number >= 0, in s"));
    }
    if *from >= longest {
        return Err(format!(
            "--from {from}: must lie before the end, {longest} s"
        ));
    }
    if let Some(until) = until.filter(|until| !(until > from && until.is_finite())) {
        return Err(format!(
            "--until {until}: must be a finite number > {from}, the first instant, in s"
        ));
    }
    Ok(())
}

/// What the tables of a job have in common.
pub(super) struct Tables<'a> {
    pub footer: &'a Footer,
    pub left_out: &'a [Cow<'static, str>],
}

impl Tables<'_> {
    /// Writes a table, if it was asked for.
    pub fn write<R: Table>(
        &self,
        path: Option<&Path>,
        rows: impl Iterator<Item = R>,
    ) -> Result<()> {
        let Some(path) = path else { return Ok(()) };
        Destination::new(path, Kind::PARQUET)?.write(signals::catch, |file| {
            let mut writer = TableWriter::without(self.left_out, file, self.footer)?;
            for row in rows {
                writer.push(&row)?;
            }
            Ok(writer.finish()?)
        })
    }
}

/// Draws the plot into each file that was asked for.
pub(super) fn write_pictures(
    arguments: &Arguments,
    parameters: &Parameters,
    recorded: &Records,
    slips: &[Slip],
) -> Result<()> {
    if arguments.plot.files.is_empty() {
        return Ok(());
    }
    let Records { trace, map, .. } = recorded;
    let last = trace
        .last()
        .map(|row| row.time)
        .or(map.last().map(|row| row.time))
        .unwrap_or(0.0);
    if arguments.plot.from >= last {
        let problem = format!(
            "the simulation ended at {last} s; take an earlier instant, or a longer --time"
        );
        return Err(UsageError(format!("--from {}: {problem}", arguments.plot.from)).into());
    }
    // The sample at an end is shown, however its time is rounded.
    let slack = 1e-6 * arguments.tables.sample;
    let shown = arguments.plot.from - slack..=arguments.plot.until.unwrap_or(f64::INFINITY) + slack;
    let samples: Vec<(f64, f64)> = trace
        .iter()
        .filter(|row| shown.contains(&row.time))
        .map(|row| (row.time, row.force))
        .collect();
    let cells: Vec<MapRow> = map
        .iter()
        .filter(|row| shown.contains(&row.time))
        .copied()
        .collect();
    let onsets: Vec<f64> = slips.iter().map(|slip| slip.onset).collect();
    let trace = arguments.plot.draws(Panel::Force).then_some(&*samples);
    let picture = simulation(
        parameters,
        trace,
        arguments.plot.draws(Panel::Map).then_some(&*cells),
        &onsets,
    )
    .map_err(|error| UsageError(format!("--from {}: {error}", arguments.plot.from)))?;
    for path in &arguments.plot.files {
        let (destination, format) = picture_file(path)?;
        let bytes = picture.encoded(format)?;
        destination.write(signals::catch, |mut file| Ok(file.write(&bytes)?))?;
    }
    Ok(())
}
