//! The files of `stickslip simulate`: tables and pictures, checked before anything runs.

use super::super::exit::UsageError;
use super::super::output::replace;
use super::super::plot::format_of;
use super::{Arguments, Panel};
use crate::figure::{Picture, simulation};
use crate::model::Parameters;
use crate::observe::{MapRow, Slip};
use crate::simulate::Records;
use crate::sweep::Sweep;
use crate::table::columns::Table;
use crate::table::file::{Footer, TableWriter};
use crate::table::shown::shown;
use crate::table::storage::{Disk, Storage};
use anyhow::{Result, anyhow};
use std::path::Path;

/// Refuses what could not be written, before anything runs.
pub(super) fn check_outputs(arguments: &Arguments, sweep: &Sweep, parameters: &Parameters) -> Result<()> {
    let recording = sweep.recording();
    arguments.request().check(parameters, recording).map_err(|error| UsageError(format!("--{error}")))?;
    if !(arguments.plot.from >= 0.0 && arguments.plot.from.is_finite()) {
        return Err(UsageError(format!("--from {}: must be a finite number >= 0, in s", arguments.plot.from)).into());
    }
    let longest = recording.max_time.unwrap_or(f64::INFINITY);
    if arguments.plot.from >= longest {
        let problem = format!("--from {}: must lie before the end, {longest} s", arguments.plot.from);
        return Err(UsageError(problem).into());
    }
    if let Some(until) = arguments.plot.until.filter(|until| !(*until > arguments.plot.from && until.is_finite())) {
        let problem =
            format!("--until {until}: must be a finite number > {}, the first instant, in s", arguments.plot.from);
        return Err(UsageError(problem).into());
    }
    for path in &arguments.plot.files {
        format_of(path).map_err(|error| UsageError(format!("--plot {error}")))?;
    }
    let tables = [
        ("--trace", &arguments.tables.trace),
        ("--map", &arguments.tables.map),
        ("--profile", &arguments.tables.profile),
        ("--contacts", &arguments.tables.contacts),
        ("--slip-table", &arguments.tables.slip_table),
    ];
    let tables = tables.into_iter().filter_map(|(flag, path)| Some((flag, path.as_ref()?)));
    let mut paths = Vec::new();
    for (flag, path) in tables.chain(arguments.plot.files.iter().map(|path| ("--plot", path))) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // A device is not to be replaced by a file.
        if !folder.is_dir() || (path.exists() && !path.is_file()) {
            let path = shown(path);
            let problem = format!("{flag} {path}: cannot be written; its folder must exist, and it must be a file");
            return Err(UsageError(problem).into());
        }
        if paths.contains(&path) {
            let problem = format!("{flag} {}: another flag writes this file, too; give each its own", shown(path));
            return Err(UsageError(problem).into());
        }
        paths.push(path);
    }
    Ok(())
}

/// Writes a table, if it was asked for.
pub(super) fn write_table<R: Table>(path: Option<&Path>, footer: &Footer, rows: impl Iterator<Item = R>) -> Result<()> {
    let Some(path) = path else { return Ok(()) };
    replace(path, |draft| {
        let mut writer = TableWriter::new(Disk.create(draft)?, footer)?;
        for row in rows {
            writer.push(&row)?;
        }
        writer.finish()?;
        Ok(())
    })
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
    let last = trace.last().map(|row| row.time).or(map.last().map(|row| row.time)).unwrap_or(0.0);
    if arguments.plot.from >= last {
        let from = arguments.plot.from;
        let problem =
            format!("--from {from}: the simulation ended at {last} s; take an earlier instant, or a longer --time");
        return Err(UsageError(problem).into());
    }
    let picture = draw(arguments, parameters, recorded, slips)?;
    for path in &arguments.plot.files {
        let bytes = picture.encoded(format_of(path)?)?;
        replace(path, |draft| Ok(std::fs::write(draft, &bytes)?))?;
    }
    Ok(())
}

fn draw(arguments: &Arguments, parameters: &Parameters, recorded: &Records, slips: &[Slip]) -> Result<Picture> {
    let Records { trace, map, .. } = recorded;
    // The sample at an end is shown, however its time is rounded.
    let slack = 1e-6 * arguments.tables.sample;
    let shown = arguments.plot.from - slack..=arguments.plot.until.unwrap_or(f64::INFINITY) + slack;
    let samples: Vec<(f64, f64)> =
        trace.iter().filter(|row| shown.contains(&row.time)).map(|row| (row.time, row.force)).collect();
    let cells: Vec<MapRow> = map.iter().filter(|row| shown.contains(&row.time)).copied().collect();
    let onsets: Vec<f64> = slips.iter().map(|slip| slip.onset).collect();
    let trace = arguments.plot.draws(Panel::Force).then_some(&*samples);
    simulation(parameters, trace, arguments.plot.draws(Panel::Map).then_some(&*cells), &onsets)
        .map_err(|error| anyhow!(UsageError(format!("--from {}: {error}", arguments.plot.from))))
}
