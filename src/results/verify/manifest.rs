//! What a directory belongs to: manifest and copies of sweep files hold the same texts, so either restores the other.

use super::{Problem, Remedy};
use crate::results::commit::alone;
use crate::results::error::{ErrorKind, ResultsError};
use crate::results::handle::{Results, is_fresh};
use crate::results::layout::Layout;
use crate::results::manifest::{Manifest, WRITER, parse, read_text, refuse};
use crate::results::tables;
use crate::sweep::{Extension, Part, Round};
use crate::table::checksum;
use crate::table::file::{DatasetError, footer};
use crate::table::storage::StorageError;
use std::path::PathBuf;

/// Opens a directory whose manifest or sweep files may be damaged, from what is whole; what is not is a problem.
pub(super) fn salvage<'a>(layout: &Layout<'a>, problems: &mut Vec<Problem>) -> Result<Results<'a>, ResultsError> {
    let extensions = match whole_or_copies(layout, problems)? {
        Texts::Manifest(manifest) => {
            let extensions = manifest.extensions(layout)?;
            refuse(layout, &manifest.difference(&Manifest::new(&extensions)), "use the program that wrote it")?;
            extensions
        }
        Texts::Copies(texts) => begin_again(layout, &texts)?,
    };
    Ok(Results::new(layout, extensions))
}

/// The extensions of these sweeps: an earlier one keeps what is committed of it, as no later run added to that.
fn begin_again(layout: &Layout<'_>, texts: &[String]) -> Result<Vec<Extension>, ResultsError> {
    let mut extensions = Vec::new();
    for (number, text) in texts.iter().enumerate() {
        let sweep = parse(layout, number, text)?;
        let extension = if number > 0 && sweep.rounds().is_some() {
            Extension::next_round(&sweep, &extensions, round(layout, number)?)
        } else {
            Extension::new(&sweep, &extensions)
        };
        extensions.push(extension);
        if number + 1 < texts.len() {
            let results = Results::new(layout, extensions.clone());
            let (done, committed) = (results.done_parts()?, results.committed_parts()?);
            let is_kept = |part: &Part| done.has(part) || committed.get(part).is_some();
            extensions[number].kept = Some(results.plan().ranges(number, is_kept));
        }
    }
    Ok(extensions)
}

/// The copy of a round.
fn round(layout: &Layout<'_>, extension: usize) -> Result<Round, ResultsError> {
    let path = layout.round(extension);
    let text = read_text(layout, &path)?;
    checksum::from_json(&text).map_err(|problem| ResultsError::damaged(&path, problem))
}

/// Writes the manifest and the copies of the sweep files again.
pub(super) fn restore_manifest(results: &Results<'_>) -> Result<(), ResultsError> {
    let _alone = alone(results.layout(), WRITER)?;
    Manifest::new(results.extensions()).write(results.layout())
}

/// What says which sweeps a directory has.
enum Texts {
    Manifest(Manifest),
    /// The copies of the sweep files, if the manifest is not to be believed.
    Copies(Vec<String>),
}

/// The manifest if it is to be believed, else the copies; what is damaged is a problem.
fn whole_or_copies(layout: &Layout<'_>, problems: &mut Vec<Problem>) -> Result<Texts, ResultsError> {
    let copies = copies(layout)?;
    let damaged = match Manifest::read(layout) {
        Ok(Some(manifest)) => match foreign(layout, &manifest, &copies)? {
            None => {
                for (extension, record) in manifest.extensions.iter().enumerate() {
                    if copies.get(extension) != Some(&record.sweep) {
                        let path = layout.sweep(extension);
                        let is_there = layout.storage.exists(&path)?;
                        let problem =
                            if is_there { "it is not the text that the manifest has" } else { "it is missing" };
                        problems.push(problem_with(layout, path, problem)?);
                    }
                    if let Some(expected) = record.round_text(layout, extension)? {
                        let path = layout.round(extension);
                        match read_text(layout, &path) {
                            Ok(text) if text == expected => {}
                            Err(error) if error.kind != ErrorKind::Damaged => return Err(error),
                            _ => {
                                problems.push(problem_with(layout, path, "it is not the round that the manifest has")?);
                            }
                        }
                    }
                }
                return Ok(Texts::Manifest(manifest));
            }
            Some(problem) => problem,
        },
        // A run that begins here has written the copy first.
        Ok(None) if copies.is_empty() || is_fresh(layout)? => return Err(layout.no_results()),
        Ok(None) => "it is missing".to_owned(),
        Err(error) if error.kind == ErrorKind::Damaged => error.problem,
        Err(error) => return Err(error),
    };
    // Nothing else says what a damaged copy was, and nothing may be guessed.
    for (extension, text) in copies.iter().enumerate() {
        if text_in_tables(layout, extension)?.is_some_and(|found| found != *text) {
            let problem = "it and the manifest are both damaged; restore one of them from a backup";
            return Err(ResultsError::damaged(&layout.sweep(extension), problem));
        }
    }
    if copies.is_empty() {
        let problem = format!("{damaged}, and so are the copies of the sweep files; restore one of them from a backup");
        return Err(ResultsError::damaged(&layout.manifest(), problem));
    }
    problems.push(problem_with(layout, layout.manifest(), damaged)?);
    Ok(Texts::Copies(copies))
}

/// A manifest or a copy of a sweep file that is to be written again. What is no file, such as a folder, has to give way.
fn problem_with(layout: &Layout<'_>, path: PathBuf, problem: impl Into<String>) -> Result<Problem, StorageError> {
    let moved = match layout.storage.length(&path) {
        Err(error) if error.is_no_file() => vec![path.clone()],
        Err(error) if error.is_missing() => Vec::new(),
        length => length.map(|_| Vec::new())?,
    };
    Ok(Problem { moved, ..Problem::of_file(path, problem, Remedy::Manifest) })
}

/// The copies of sweep files, as far as they can be read.
fn copies(layout: &Layout<'_>) -> Result<Vec<String>, ResultsError> {
    let read = |path: PathBuf| match read_text(layout, &path) {
        Err(error) if error.kind == ErrorKind::Damaged => Ok(String::new()),
        text => text,
    };
    layout.sweeps()?.into_iter().map(read).collect()
}

/// In what a whole manifest belongs to other tables: their files have another sweep, that of the copy.
fn foreign(layout: &Layout<'_>, manifest: &Manifest, copies: &[String]) -> Result<Option<String>, DatasetError> {
    for (extension, text) in copies.iter().enumerate() {
        let in_manifest = manifest.extensions.get(extension).map(|record| &record.sweep);
        if in_manifest != Some(text) && text_in_tables(layout, extension)?.as_ref() == Some(text) {
            return Ok(Some(format!("it does not belong to these tables: their sweep {extension} is another")));
        }
    }
    Ok(None)
}

/// The sweep in the first whole file with parts of an extension.
fn text_in_tables(layout: &Layout<'_>, extension: usize) -> Result<Option<String>, DatasetError> {
    let folder = layout.table(tables::JOBS);
    for file in layout.table_files(tables::JOBS)?.filter(|file| file.extension == extension) {
        match footer(layout.storage, &folder.join(file.to_string())) {
            Ok((_, mut texts)) => return Ok(texts.remove("sweep")),
            Err(error) => error.damage().map(drop)?,
        }
    }
    Ok(None)
}
