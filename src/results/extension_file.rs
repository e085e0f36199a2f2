//! The files that say what the tables of a directory belong to: one for each extension, written once.
//!
//! `run/extension-EEE.json` holds versions, columns, the text of the sweep and all that decides which part has which job.
//! Each holds the checksum of the one before, so the last one stands for all. The footers of an extension's parts hold the
//! same, so a file that is lost is made again from any of them.
//!
//! A sweep that differs from the last one in axes, conditions or bounds alone is a further extension; anything else, such
//! as another model, solver, recording or version, is refused before anything is written.

#[cfg(test)]
pub(super) mod tests;

use crate::model::{MODEL_VERSION, Parameters, RNG_SCHEME};
use crate::results::layout::{Layout, settled};
use crate::results::tables::{JOBS, recorded_schema, tables_of};
use crate::sweep::{Extension, PLAN_VERSION, Round, Sweep};
use crate::table::checksum;
use crate::table::error::ResultsError;
use crate::table::file::{Footer, PROGRAM};
use crate::table::shown::shown_text;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

/// Version of a directory. 7: a file for each extension in place of a manifest that is written again.
const FORMAT: u32 = 7;
/// What programs before this format have in its place.
const OLD_MANIFEST: &str = "manifest.json";
const MISSING: &str = "it is missing";
/// Keys of a footer.
const SWEEP: &str = "sweep";
const EXTENSION: &str = "extension";

/// What the file of an extension says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Record {
    format: u32,
    /// The program that began the extension; any with the same versions below may continue.
    program: String,
    model_version: u32,
    rng_scheme: String,
    plan_version: u32,
    /// The id of a job with the model's defaults under this solver and recording: another once other things enter an id.
    identity: String,
    /// Names of the columns of each table that is recorded.
    tables: BTreeMap<String, Vec<String>>,
    part_cost: f64,
    /// The points that the extension before keeps from when this one began; all, if this is the next round of its sweep.
    kept_before: Option<Vec<RangeInclusive<u64>>>,
    /// Of a sweep that decides for itself.
    round: Option<Round>,
    /// Checksum of the file before.
    before: Option<String>,
    /// The text of the sweep file.
    pub sweep: String,
}

/// The format alone, read first: a newer file may have keys that are not known here.
#[derive(Deserialize)]
struct Format {
    format: u32,
}

/// Names of the columns of each table of a sweep.
fn columns_of(sweep: &Sweep) -> BTreeMap<String, Vec<String>> {
    let columns = |table: &str| {
        let schema = recorded_schema(table, sweep.recording());
        (
            table.to_owned(),
            schema
                .fields()
                .iter()
                .map(|field| field.name().clone())
                .collect(),
        )
    };
    tables_of(sweep.recording()).map(columns).collect()
}

impl Record {
    /// That of this program for an extension which begins after these.
    pub fn new(
        Extension {
            sweep,
            part_cost,
            round,
            ..
        }: &Extension,
        before: &[Self],
        kept_before: Option<Vec<RangeInclusive<u64>>>,
    ) -> Self {
        Self {
            format: FORMAT,
            program: PROGRAM.to_owned(),
            model_version: MODEL_VERSION,
            rng_scheme: RNG_SCHEME.to_owned(),
            plan_version: PLAN_VERSION,
            identity: sweep.job_id(&Parameters::default()),
            tables: columns_of(sweep),
            part_cost: *part_cost,
            kept_before,
            round: round.clone(),
            before: before.last().map(|last| checksum::of_text(&last.text())),
            sweep: sweep.text().to_owned(),
        }
    }

    /// The text of the file.
    pub fn text(&self) -> String {
        // It always has a form as JSON: it holds texts and numbers alone.
        checksum::to_json(self).unwrap_or_default()
    }

    /// What the footers of the extension's parts hold: all but what follows from their columns.
    pub fn footer(&self, name: &str) -> Footer {
        let rest = Self {
            tables: BTreeMap::new(),
            sweep: String::new(),
            ..self.clone()
        };
        let footer = Footer::default().with_sweep(name, &self.sweep);
        footer.with(EXTENSION, &serde_json::to_string(&rest).unwrap_or_default())
    }

    /// What a footer with these texts says; `None` if it is not one of this program's.
    pub fn of_footer(texts: &BTreeMap<String, String>) -> Option<Self> {
        let rest: Self = serde_json::from_str(texts.get(EXTENSION)?).ok()?;
        let sweep = texts.get(SWEEP)?;
        let parsed = Sweep::parse_stored(sweep, Path::new("the sweep of a footer")).ok()?;
        (rest.format == FORMAT).then(|| Self {
            tables: columns_of(&parsed),
            sweep: sweep.clone(),
            ..rest
        })
    }

    /// In what it differs from that of this program for the same sweep.
    pub fn difference(&self, sweep: &Sweep) -> Vec<String> {
        let versions = [
            (
                "model version",
                self.model_version.to_string(),
                MODEL_VERSION.to_string(),
            ),
            (
                "random numbers",
                self.rng_scheme.clone(),
                RNG_SCHEME.to_owned(),
            ),
            (
                "plan version",
                self.plan_version.to_string(),
                PLAN_VERSION.to_string(),
            ),
        ];
        let mut differences: Vec<String> = versions
            .into_iter()
            .filter(|(_, before, after)| before != after)
            .map(|(key, before, after)| format!("{key}: {} -> {after}", shown_text(&before)))
            .collect();
        // Versions enter it.
        if differences.is_empty() && self.identity != sweep.job_id(&Parameters::default()) {
            differences.push(format!(
                "ids of jobs: those of {} -> others of this program",
                shown_text(&self.program)
            ));
        }
        for (name, after) in &columns_of(sweep) {
            let Some(before) = self.tables.get(name) else {
                continue;
            };
            let missing = |of: &[String], from: &[String]| -> Vec<String> {
                of.iter()
                    .filter(|column| !from.contains(column))
                    .cloned()
                    .collect()
            };
            let (gone, new) = (missing(before, after), missing(after, before));
            if before != after {
                differences.push(format!(
                    "columns of {name}: without {gone:?}, with {new:?}, or in another order"
                ));
            }
        }
        differences
    }

    /// Reads the file of an extension, which the folder lists.
    pub fn read(layout: &Layout<'_>, number: usize) -> Result<Self, ResultsError> {
        let path = layout.extension(number);
        let read = || match layout.storage.read(&path) {
            Err(error) if error.is_missing() => Ok(None),
            bytes => bytes.map(Some).map_err(ResultsError::of_reading),
        };
        let damaged = |problem: String| ResultsError::damaged(&path, problem);
        let bytes = settled(read)?.ok_or_else(|| damaged(MISSING.to_owned()))?;
        let text = String::from_utf8(bytes).map_err(|error| damaged(error.to_string()))?;
        let Format { format } =
            serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        if format != FORMAT {
            return Err(other_format(&path, format));
        }
        let record: Self = checksum::from_json(&text).map_err(damaged)?;
        record
            .check(number)
            .map_err(|problem| damaged(problem.to_owned()))?;
        Ok(record)
    }

    /// Looks whether a program can have written this as the file of the extension with this number.
    fn check(&self, number: usize) -> Result<(), &'static str> {
        let is_ordered = |ranges: &Vec<RangeInclusive<u64>>| {
            ranges.iter().all(|range| range.start() <= range.end())
                && ranges
                    .windows(2)
                    .all(|pair| pair[0].end() < pair[1].start())
        };
        let ranges = self
            .kept_before
            .iter()
            .chain(self.round.iter().map(|round| &round.points));
        match () {
            () if self.before.is_some() != (number > 0) => Err("it is that of another extension"),
            () if !(self.part_cost.is_finite() && self.part_cost >= 0.0) => {
                Err("the cost of a part makes no sense")
            }
            () if !ranges.into_iter().all(is_ordered) => Err("its points are not in order"),
            () => Ok(()),
        }
    }

    /// Whether it is that of the extension after these.
    pub fn follows(&self, before: &[Self]) -> bool {
        self.before == before.last().map(|last| checksum::of_text(&last.text()))
    }
}

fn other_format(path: &Path, format: u32) -> ResultsError {
    let problem = format!(
        "has format {format}, this program knows {FORMAT}; use the program that wrote it, or choose another directory \
         with --out"
    );
    ResultsError::refused(path, problem)
}

/// All records of a directory, in order; none if there is none.
pub(super) fn read(layout: &Layout<'_>) -> Result<Vec<Record>, ResultsError> {
    let listed = layout.listed_extensions()?;
    if listed.is_empty() {
        refuse_old(layout)?;
        // In this order: whoever has parts there has had its extension there before.
        let has_parts = !layout.parts_in(&layout.table(JOBS))?.is_empty();
        match (has_parts, layout.listed_extensions()?.is_empty()) {
            (true, true) => return Err(ResultsError::damaged(&layout.extension(0), MISSING)),
            (_, false) => return read(layout),
            (false, true) => (),
        }
    }
    let mut records: Vec<Record> = Vec::with_capacity(listed.len());
    for number in 0..listed.last().map_or(0, |last| last + 1) {
        if !listed.contains(&number) {
            return Err(ResultsError::damaged(&layout.extension(number), MISSING));
        }
        let record = Record::read(layout, number)?;
        if !record.follows(&records) {
            let problem =
                "it does not follow the file before it: one of the two is of another directory";
            return Err(ResultsError::damaged(&layout.extension(number), problem));
        }
        records.push(record);
    }
    Ok(records)
}

/// Refuses a directory of a program before this format.
pub(super) fn refuse_old(layout: &Layout<'_>) -> Result<(), ResultsError> {
    let old = layout.run().join(OLD_MANIFEST);
    if layout.storage.exists(&old)? {
        let format = layout
            .storage
            .read(&old)
            .ok()
            .and_then(|text| serde_json::from_slice::<Format>(&text).ok());
        return Err(other_format(
            &old,
            format.map_or(FORMAT - 1, |Format { format }| format),
        ));
    }
    Ok(())
}

/// The extensions that these records say.
pub(super) fn extensions(
    layout: &Layout<'_>,
    records: &[Record],
) -> Result<Vec<Extension>, ResultsError> {
    let mut extensions: Vec<Extension> = Vec::with_capacity(records.len());
    for (number, record) in records.iter().enumerate() {
        // Rounds of one sweep follow each other.
        let sweep = match extensions.last() {
            Some(Extension { sweep, .. }) if sweep.text() == record.sweep => sweep.clone(),
            _ => {
                let path = layout.extension(number);
                let sweep = Sweep::parse_stored(&record.sweep, &path);
                let sweep = sweep.map_err(|error| ResultsError::damaged(&path, error))?;
                sweep.with_ids_of(record.model_version, &record.rng_scheme)
            }
        };
        if sweep.rounds().is_some() != record.round.is_some() {
            let problem = "its sweep has rounds where it decides nothing, or none where it does";
            return Err(ResultsError::damaged(&layout.extension(number), problem));
        }
        if let Some(last) = extensions.last_mut() {
            last.kept.clone_from(&record.kept_before);
        }
        extensions.push(Extension {
            sweep,
            part_cost: record.part_cost,
            kept: None,
            round: record.round.clone(),
        });
    }
    Ok(extensions)
}
