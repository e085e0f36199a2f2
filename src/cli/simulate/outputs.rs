//! The files of `stickslip simulate`: tables and pictures, checked before anything runs.

use super::super::exit::UsageError;
use super::super::output::replace;
use super::super::plot::format_of;
use super::{Arguments, Panel, PlotFlags};
use crate::figure::simulation;
use crate::model::Parameters;
use crate::observe::{MapRow, Slip};
use crate::simulate::Records;
use crate::sweep::Sweep;
use crate::table::columns::Table;
use crate::table::file::{Footer, TableWriter};
use crate::table::shown::shown;
use crate::table::storage::{Disk, Storage};
use anyhow::Result;
use std::borrow::Cow;
use std::path::Path;

/// What could not be written is refused before anything runs.
pub(super) fn check_outputs(
    arguments: &Arguments,
    sweep: &Sweep,
    parameters: &Parameters,
) -> Result<(), String> {
    let Arguments {
        tables,
        plot: PlotFlags {
            files, from, until, ..
        },
        ..
    } = arguments;
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
    files
        .iter()
        .try_for_each(|path| format_of(path).map(drop))
        .map_err(|error| format!("--plot {error}"))?;
    let tables = [
        ("--trace", &tables.trace),
        ("--map", &tables.map),
        ("--profile", &tables.profile),
        ("--contacts", &tables.contacts),
        ("--slip-table", &tables.slip_table),
    ];
    let tables = tables
        .into_iter()
        .filter_map(|(flag, path)| Some((flag, path.as_ref()?)));
    let mut paths = Vec::new();
    for (flag, path) in tables.chain(files.iter().map(|path| ("--plot", path))) {
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let flag = format!("{flag} {}", shown(path));
        // A device is not to be replaced by a file.
        if !folder.is_dir() || (path.exists() && !path.is_file()) {
            return Err(format!(
                "{flag}: cannot be written; its folder must exist, and it must be a file"
            ));
        }
        if paths.contains(&path) {
            return Err(format!(
                "{flag}: another flag writes this file, too; give each its own"
            ));
        }
        paths.push(path);
    }
    Ok(())
}

/// Writes a table, if it was asked for.
pub(super) fn write_table<R: Table>(
    path: Option<&Path>,
    footer: &Footer,
    left_out: &[Cow<'static, str>],
    rows: impl Iterator<Item = R>,
) -> Result<()> {
    let Some(path) = path else { return Ok(()) };
    replace(path, |draft| {
        let mut writer = TableWriter::without(left_out, Disk.create(draft)?, footer)?;
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
        let bytes = picture.encoded(format_of(path)?)?;
        replace(path, |draft| Ok(std::fs::write(draft, &bytes)?))?;
    }
    Ok(())
}
