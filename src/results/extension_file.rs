//! The files that say what the tables of a directory belong to: one for each extension, written once.
//!
//! `run/extension-EEE.json` holds versions, columns, the text of the sweep and all that decides which part has which
//! job. Each holds the checksum of the file before, so the last one stands for all. `run/copies/` holds a second copy
//! of each: the first that is whole counts. Both are made exclusively. The first file decides which worker was first; a
//! worker that opens the directory writes missing copies.
//!
//! A sweep that differs from the last one in axes, conditions or bounds alone is a further extension; anything else,
//! such as another model, solver, recording or version, is refused before anything is written.

#[cfg(test)]
pub(super) mod tests;

use crate::model::{MODEL_VERSION, Parameters, RNG_SCHEME};
use crate::results::layout::{Layout, settled};
use crate::results::tables::RecordedTable;
use crate::sweep::{Extension, PLAN_VERSION, Round, Sweep};
use crate::table::checksum;
use crate::table::error::ResultsError;
use crate::table::file::{Footer, PROGRAM};
use crate::table::shown::shown_text;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Version of a directory. 7: a file for each extension in place of a manifest that is written again.
const FORMAT: u32 = 7;
const MISSING: &str = "it is missing";

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
    /// The id of a job with the model's defaults under this solver and recording: another once other things enter an
    /// id.
    identity: String,
    /// Names of the columns of each table that is recorded.
    tables: BTreeMap<String, Vec<String>>,
    part_cost: f64,
    /// The points that the extension before keeps from when this one began; all, if this is the next round of its
    /// sweep.
    kept_before: Option<Vec<RangeInclusive<u64>>>,
    round: Option<Round>,
    /// Checksum of the file before.
    before: Option<String>,
    pub sweep: String,
}

/// The format alone, read first: a newer file may have keys that are not known here.
#[derive(Deserialize)]
struct FormatNumber {
    format: u32,
}

fn columns_of(sweep: &Sweep) -> BTreeMap<String, Vec<String>> {
    let columns = |table: RecordedTable| {
        let schema = table.schema(sweep);
        let names = schema.fields().iter().map(|field| field.name().clone());
        (table.word().to_owned(), names.collect())
    };
    RecordedTable::of(sweep.recording()).map(columns).collect()
}

impl Record {
    /// That of this program for an extension which begins after these.
    pub fn new(
        extension: &Extension,
        before: &[Self],
        kept_before: Option<Vec<RangeInclusive<u64>>>,
    ) -> Self {
        let sweep = &extension.sweep;
        Self {
            format: FORMAT,
            program: PROGRAM.to_owned(),
            model_version: MODEL_VERSION,
            rng_scheme: RNG_SCHEME.to_owned(),
            plan_version: PLAN_VERSION,
            identity: sweep.job_id(&Parameters::default()),
            tables: columns_of(sweep),
            part_cost: extension.part_cost,
            kept_before,
            round: extension.round.clone(),
            before: before.last().map(|last| checksum::of_text(&last.text())),
            sweep: sweep.text().to_owned(),
        }
    }

    pub fn text(&self) -> String {
        // It always has a form as JSON: it holds texts and numbers alone.
        checksum::to_json(self).unwrap_or_default()
    }

    /// What distinguishes the parts of the extension from others in their footers: all but what follows from their
    /// columns.
    pub fn footer(&self, name: &str) -> Footer {
        let rest = Self {
            tables: BTreeMap::new(),
            sweep: String::new(),
            ..self.clone()
        };
        let rest = serde_json::to_string(&rest).unwrap_or_default();
        let footer = Footer::empty().with_sweep(name, &self.sweep);
        footer.with("extension", &rest)
    }

    /// In what it differs from that of this program for the same sweep.
    pub fn difference(&self, sweep: &Sweep) -> Vec<String> {
        let mut differences = Vec::new();
        let mut compare = |key: &str, before: &str, after: &str| {
            if before != after {
                differences.push(format!("{key}: {} -> {after}", shown_text(before)));
            }
        };
        let [model, plan] =
            [self.model_version, self.plan_version].map(|number| number.to_string());
        compare("model version", &model, &MODEL_VERSION.to_string());
        compare("random numbers", &self.rng_scheme, RNG_SCHEME);
        compare("plan version", &plan, &PLAN_VERSION.to_string());
        // Versions enter it.
        if differences.is_empty() && self.identity != sweep.job_id(&Parameters::default()) {
            let program = shown_text(&self.program);
            differences.push(format!(
                "ids of jobs: those of {program} -> others of this program"
            ));
        }
        for (name, after) in &columns_of(sweep) {
            if let Some(before) = self.tables.get(name)
                && before != after
            {
                let gone: Vec<_> = before.iter().filter(|name| !after.contains(name)).collect();
                let new: Vec<_> = after.iter().filter(|name| !before.contains(name)).collect();
                differences.push(format!(
                    "columns of {name}: without {gone:?}, with {new:?}, or in another order"
                ));
            }
        }
        differences
    }

    /// Reads a file of an extension, which the folder lists.
    fn read(layout: &Layout<'_>, path: &Path, number: usize) -> Result<Self, ResultsError> {
        let read = || match layout.storage.read(path) {
            Err(error) if error.is_missing() => Ok(None),
            bytes => bytes.map(Some).map_err(ResultsError::of_reading),
        };
        let damaged = |problem: String| ResultsError::damaged(path, problem);
        let bytes = settled(read)?.ok_or_else(|| damaged(MISSING.to_owned()))?;
        let text = String::from_utf8(bytes).map_err(|error| damaged(error.to_string()))?;
        // First: in a damaged text, the format may be what is damaged.
        let text = checksum::checked(&text).map_err(|problem| damaged(problem.to_owned()))?;
        let unreadable = |error: serde_json::Error| damaged(error.to_string());
        let FormatNumber { format } = serde_json::from_str(&text).map_err(unreadable)?;
        if format != FORMAT {
            let problem = format!(
                "has format {format}, this program knows {FORMAT}; use the program that wrote it, or choose another \
                 directory with --out"
            );
            return Err(ResultsError::refused(path, problem));
        }
        let record: Self = serde_json::from_str(&text).map_err(unreadable)?;
        if record.before.is_some() != (number > 0) {
            return Err(damaged("it is that of another extension".to_owned()));
        }
        Ok(record)
    }

    /// Whether it is that of the extension after this one.
    fn follows(&self, before: &Self) -> bool {
        self.before == Some(checksum::of_text(&before.text()))
    }
}

#[derive(Default)]
pub(super) struct Records {
    /// In order; none if there is no file.
    pub records: Vec<Record>,
    /// Files that are damaged or lost and whose copies are whole, with what is wrong with them.
    pub unsound: Vec<(PathBuf, String)>,
}

/// Reads the files of all extensions, the last first: it says which of the copies before it count.
pub(super) fn read(layout: &Layout<'_>) -> Result<Records, ResultsError> {
    let listed = layout.listed_extensions()?;
    let count = listed.last_key_value().map_or(0, |(last, _)| last + 1);
    let mut found = Records::default();
    for number in (0..count).rev() {
        let files = listed.get(&number).map_or(&[][..], Vec::as_slice);
        let next = found.records.last();
        let record = first_whole(layout, number, files, next, &mut found.unsound)?;
        found.records.push(record);
    }
    found.records.reverse();
    Ok(found)
}

/// The record of the extension before another, from the first of its files that is whole.
fn first_whole(
    layout: &Layout<'_>,
    number: usize,
    files: &[PathBuf],
    next: Option<&Record>,
    unsound: &mut Vec<(PathBuf, String)>,
) -> Result<Record, ResultsError> {
    let mut problems: Vec<(PathBuf, String)> = Vec::new();
    let mut whole: Option<Record> = None;
    let first = layout.extension(number);
    if !files.contains(&first) {
        problems.push((first, MISSING.to_owned()));
    }
    for path in files {
        match Record::read(layout, path, number) {
            Ok(record) if next.is_some_and(|next| !next.follows(&record)) => {
                let problem =
                    "the file after it does not follow it: one of the two is of another directory";
                problems.push((path.clone(), problem.to_owned()));
            }
            Ok(record) if whole.as_ref().is_some_and(|whole| *whole != record) => {
                let problem = "it and its copy in the other folder are whole and not the same: one is of another directory; \
                               remove that one";
                return Err(ResultsError::damaged(path, problem));
            }
            Ok(record) => whole = Some(record),
            Err(error) => problems.push(error.damage()?),
        }
    }
    let Some(whole) = whole else {
        let (path, problem) = problems.swap_remove(0);
        let problem = format!(
            "{problem}; its copy in run/copies is damaged or lost, too: restore one of the two from a backup"
        );
        return Err(ResultsError::damaged(&path, problem));
    };
    unsound.extend(problems);
    Ok(whole)
}

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
                let sweep = Sweep::parse_stored(&record.sweep, &path)
                    .map_err(|error| ResultsError::damaged(&path, error))?;
                sweep.with_ids_of(record.model_version, &record.rng_scheme)
            }
        };
        if sweep.rounds().is_some() != record.round.is_some() {
            let problem = "its sweep is adaptive and the file has no round, or the other way round";
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
