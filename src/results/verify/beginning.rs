//! What a directory belongs to: manifest and copies of sweep files hold the same texts, so either restores the other.

use super::{Problem, Remedy};
use crate::results::layout::{Layout, name_of};
use crate::results::manifest::{Directory, DirectoryError, Manifest, read_alone, read_text};
use crate::results::tables;
use crate::sweep::Sweep;
use crate::table::checksum;
use crate::table::file::{files, footer};
use crate::table::storage::{Storage, StorageError};
use std::path::Path;

/// Reads the sweeps of a directory, from where they are whole; what is not is a problem.
///
/// # Errors
/// When it is no results directory, belongs to another version of the program, or cannot be restored.
pub(super) fn read(
    storage: &dyn Storage,
    root: &Path,
    problems: &mut Vec<Problem>,
) -> Result<Directory, DirectoryError> {
    let layout = Layout::new(root);
    let (manifest, texts) = texts(storage, &layout, problems)?;
    let mut sweeps = Vec::with_capacity(texts.len());
    for (epoch, text) in texts.iter().enumerate() {
        sweeps.push(Sweep::parse(text, &layout.sweep(epoch))?);
    }
    let Some(first) = sweeps.first() else { return Err(DirectoryError::NoResults(root.to_owned())) };
    if let Some(manifest) = &manifest {
        let differences = manifest.difference(&Manifest::new(first));
        if !differences.is_empty() {
            return Err(DirectoryError::Changed { path: root.to_owned(), differences });
        }
    }
    let current = manifest.map_or(sweeps.len() - 1, |manifest| manifest.current);
    Ok(Directory::new(layout, sweeps, current))
}

/// Writes manifest and copies anew.
///
/// # Errors
/// When they cannot be written.
pub(super) fn restore(storage: &dyn Storage, directory: &Directory) -> Result<(), DirectoryError> {
    let sweeps = directory.sweeps();
    let mut manifest = Manifest::new(&sweeps[0]);
    manifest.sweeps = sweeps.iter().map(|sweep| sweep.text().to_owned()).collect();
    manifest.current = directory.current();
    directory.write(storage, &manifest)
}

/// The manifest, if it is to be believed, and the texts of all sweeps.
fn texts(
    storage: &dyn Storage,
    layout: &Layout,
    problems: &mut Vec<Problem>,
) -> Result<(Option<Manifest>, Vec<String>), DirectoryError> {
    let copies = copies(storage, layout)?;
    let damaged = match read_alone(storage, layout) {
        Ok(Some(manifest)) => match foreign(storage, layout, &manifest, &copies) {
            None => {
                for (epoch, text) in manifest.sweeps.iter().enumerate() {
                    if copies.get(epoch) != Some(text) {
                        let path = layout.sweep(epoch);
                        let problem =
                            if path.exists() { "it is not the text that the manifest has" } else { "it is missing" };
                        problems.push(Problem::of_file(path, problem, Remedy::Beginning));
                    }
                }
                let texts = manifest.sweeps.clone();
                return Ok((Some(manifest), texts));
            }
            Some(problem) => problem,
        },
        Ok(None) if copies.is_empty() => return Err(DirectoryError::NoResults(layout.root().to_owned())),
        Ok(None) => "it is missing".to_owned(),
        Err(DirectoryError::Damaged { problem, .. }) => problem,
        Err(error) => return Err(error),
    };
    // Nothing else tells what a damaged copy was, and nothing may be guessed.
    for (epoch, text) in copies.iter().enumerate() {
        if part_texts(storage, layout, epoch).is_some_and(|told| told != *text) {
            return Err(DirectoryError::Damaged {
                path: layout.sweep(epoch),
                problem: "it and the manifest are both damaged; restore one of them from a backup".to_owned(),
            });
        }
    }
    if copies.is_empty() {
        let problem = format!("{damaged}, and so are the copies of the sweep files; restore one of them from a backup");
        return Err(DirectoryError::Damaged { path: layout.manifest(), problem });
    }
    problems.push(Problem::of_file(layout.manifest(), damaged, Remedy::Beginning));
    Ok((None, copies))
}

/// The copies of sweep files, as far as they can be read.
fn copies(storage: &dyn Storage, layout: &Layout) -> Result<Vec<String>, DirectoryError> {
    let mut copies = Vec::new();
    loop {
        let path = layout.sweep(copies.len());
        if !storage.exists(&path).map_err(StorageError::at("look up", &path))? {
            return Ok(copies);
        }
        match read_text(storage, &path) {
            Ok(text) => copies.push(text),
            Err(DirectoryError::Damaged { .. }) => copies.push(String::new()),
            Err(error) => return Err(error),
        }
    }
}

/// In what a whole manifest belongs to other tables: their files tell another sweep, that of the copy.
fn foreign(storage: &dyn Storage, layout: &Layout, manifest: &Manifest, copies: &[String]) -> Option<String> {
    let told = |epoch: usize, text: &String| {
        manifest.sweeps.get(epoch) != Some(text) && part_texts(storage, layout, epoch).as_ref() == Some(text)
    };
    let epoch = copies.iter().enumerate().position(|(epoch, text)| told(epoch, text))?;
    Some(format!("it does not belong to these tables: their sweep {epoch} is another"))
}

/// The sweep that the parts of an epoch tell of, by the first whole one.
fn part_texts(storage: &dyn Storage, layout: &Layout, epoch: usize) -> Option<String> {
    let begins = name_of(epoch, 0).rsplit_once('-').map(|(epoch, _)| format!("{epoch}-"))?;
    let parts = files(storage, &layout.table(tables::JOBS)).ok()?;
    let of_epoch = parts
        .into_iter()
        .filter(|path| path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with(&begins)));
    let mut whole = of_epoch.filter(|path| checksum::check(storage, path).is_ok());
    footer(storage, &whole.next()?).ok()?.remove("sweep")
}
