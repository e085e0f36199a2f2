//! What a directory belongs to: manifest and copies of sweep files hold the same texts, so either restores the other.

use super::{Problem, Remedy};
use crate::results::commit::alone;
use crate::results::error::{ErrorKind, ResultsError};
use crate::results::handle::Results;
use crate::results::layout::{Layout, TableFile};
use crate::results::manifest::{Manifest, WRITER, parse, read_text, refuse};
use crate::results::missing::no_results;
use crate::results::tables;
use crate::table::checksum;
use crate::table::file::footer;
use std::path::Path;

/// Opens a directory whose manifest or sweep files may be damaged, from what is whole; what is not is a problem.
///
/// # Errors
/// When it is no results directory, belongs to another version of the program, or cannot be restored.
pub(super) fn salvage<'a>(layout: &Layout<'a>, problems: &mut Vec<Problem>) -> Result<Results<'a>, ResultsError> {
    let (manifest, texts) = texts(layout, problems)?;
    let sweeps = parse(layout, &texts)?;
    let first = sweeps.first().ok_or_else(|| no_results(layout))?;
    if let Some(manifest) = &manifest {
        refuse(layout, &manifest.difference(&Manifest::new(first)), "use the program that wrote it")?;
    }
    let current = manifest.map_or(sweeps.len() - 1, |manifest| manifest.current);
    Ok(Results::new(layout, sweeps, current))
}

/// Writes the manifest and the copies of the sweep files again.
///
/// # Errors
/// When they cannot be written.
pub(super) fn restore_manifest(results: &Results<'_>) -> Result<(), ResultsError> {
    let sweeps = results.sweeps();
    let mut manifest = Manifest::new(&sweeps[0]);
    manifest.sweeps = sweeps.iter().map(|sweep| sweep.text().to_owned()).collect();
    manifest.current = results.current();
    let _alone = alone(results.layout(), WRITER)?;
    manifest.write(results.layout())
}

/// The manifest, if it is to be believed, and the texts of all sweeps.
fn texts(layout: &Layout<'_>, problems: &mut Vec<Problem>) -> Result<(Option<Manifest>, Vec<String>), ResultsError> {
    let copies = copies(layout)?;
    let damaged = match Manifest::read(layout) {
        Ok(Some(manifest)) => match foreign(layout, &manifest, &copies) {
            None => {
                for (extension, text) in manifest.sweeps.iter().enumerate() {
                    if copies.get(extension) != Some(text) {
                        let path = layout.sweep(extension);
                        let is_there = layout.storage.exists(&path)?;
                        let problem =
                            if is_there { "it is not the text that the manifest has" } else { "it is missing" };
                        problems.push(Problem::of_file(path, problem, Remedy::Manifest));
                    }
                }
                let texts = manifest.sweeps.clone();
                return Ok((Some(manifest), texts));
            }
            Some(problem) => problem,
        },
        Ok(None) if copies.is_empty() => return Err(no_results(layout)),
        Ok(None) => "it is missing".to_owned(),
        Err(error) if error.kind == ErrorKind::Damaged => error.problem,
        Err(error) => return Err(error),
    };
    // Nothing else says what a damaged copy was, and nothing may be guessed.
    for (extension, text) in copies.iter().enumerate() {
        if text_in_tables(layout, extension).is_some_and(|found| found != *text) {
            let problem = "it and the manifest are both damaged; restore one of them from a backup";
            return Err(ResultsError::damaged(&layout.sweep(extension), problem));
        }
    }
    if copies.is_empty() {
        let problem = format!("{damaged}, and so are the copies of the sweep files; restore one of them from a backup");
        return Err(ResultsError::damaged(&layout.manifest(), problem));
    }
    problems.push(Problem::of_file(layout.manifest(), damaged, Remedy::Manifest));
    Ok((None, copies))
}

/// The copies of sweep files, as far as they can be read.
fn copies(layout: &Layout<'_>) -> Result<Vec<String>, ResultsError> {
    let mut copies = Vec::new();
    loop {
        let path = layout.sweep(copies.len());
        if !layout.storage.exists(&path)? {
            return Ok(copies);
        }
        match read_text(layout, &path) {
            Err(error) if error.kind == ErrorKind::Damaged => copies.push(String::new()),
            text => copies.push(text?),
        }
    }
}

/// In what a whole manifest belongs to other tables: their files have another sweep, that of the copy.
fn foreign(layout: &Layout<'_>, manifest: &Manifest, copies: &[String]) -> Option<String> {
    let is_in_tables = |extension: usize, text: &String| {
        manifest.sweeps.get(extension) != Some(text) && text_in_tables(layout, extension).as_ref() == Some(text)
    };
    let extension = copies.iter().enumerate().position(|(extension, text)| is_in_tables(extension, text))?;
    Some(format!("it does not belong to these tables: their sweep {extension} is another"))
}

/// The sweep in the first whole file with parts of an extension.
fn text_in_tables(layout: &Layout<'_>, extension: usize) -> Option<String> {
    let is_of_extension = |path: &Path| TableFile::of_path(path).is_some_and(|file| file.extension == extension);
    let jobs = layout.dataset(tables::JOBS).ok()?;
    let is_whole = |path: &Path| checksum::check(layout.storage, path).is_ok();
    let whole = jobs.files().iter().find(|path| is_of_extension(path) && is_whole(path))?;
    footer(layout.storage, whole).ok()?.remove("sweep")
}
