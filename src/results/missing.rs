//! A path that is no results directory: what it is, and which directory was probably meant.

use crate::results::error::ResultsError;
use crate::results::layout::{Layout, RESULTS};
use crate::sweep::{Sweep, nearest};
use crate::table::shown::shown;
use crate::table::storage::Storage;
use std::path::{Path, PathBuf};

/// Most results directories that a message names.
const MAX_NAMED: usize = 3;

/// A directory that is none of ours, for those who look at one.
pub(super) fn no_results(layout: &Layout<'_>) -> ResultsError {
    let (storage, root) = (layout.storage, layout.root());
    let way_out = "name one that a run made, such as results/fig3";
    let problem = if !storage.exists(root).unwrap_or(true) {
        match meant(storage, root) {
            Some(path) => format!("there is no such directory; did you mean {}?", shown(&path)),
            None => format!("there is no such directory; {way_out}"),
        }
    } else if let Some(sweep) = sweep_file(storage, root) {
        let directory = Layout::default_root(&sweep);
        format!("is a sweep file; name its results directory, by default {}", shown(&directory))
    } else {
        let inside = results_in(storage, root);
        let named: Vec<_> = inside.iter().take(MAX_NAMED).map(|name| shown(&root.join(name)).to_string()).collect();
        let named = named.join(", ");
        match inside.len() {
            0 => format!("is no results directory (there is no run/manifest.json); {way_out}"),
            1..=MAX_NAMED => format!("is no results directory, but holds some: {named}"),
            all => format!("is no results directory, but holds {all}, such as {named}"),
        }
    };
    ResultsError::refused(root, problem)
}

/// The results directory beside a missing one, or at the usual place, that has nearly its name.
fn meant(storage: &dyn Storage, missing: &Path) -> Option<PathBuf> {
    let name = missing.file_name()?.to_str()?;
    [missing.parent()?, Path::new(RESULTS)].into_iter().find_map(|folder| {
        let there = results_in(storage, folder);
        let there: Vec<&str> = there.iter().map(String::as_str).collect();
        nearest(name, &there).map(|near| folder.join(near))
    })
}

/// Names of the results directories in a folder; none if it cannot be listed.
fn results_in(storage: &dyn Storage, folder: &Path) -> Vec<String> {
    let names = storage.list(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }).unwrap_or_default();
    let has_manifest = |name: &String| storage.exists(&Layout::new(storage, &folder.join(name)).manifest());
    let names = names.into_iter().filter_map(|name| name.into_string().ok());
    names.filter(|name| has_manifest(name).unwrap_or(false)).collect()
}

/// The sweep of a sweep file.
fn sweep_file(storage: &dyn Storage, path: &Path) -> Option<Sweep> {
    path.extension().filter(|extension| *extension == "toml")?;
    Sweep::parse(&String::from_utf8(storage.read(path).ok()?).ok()?, path).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::Results;
    use crate::table::storage::Disk;
    use std::fs;

    /// Reads `DIR/<path>` beside these results directories; what is said of it, without the names of what lies above.
    fn refusal(made: &[&str], path: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let sweep = "name = \"fig3\"";
        fs::write(folder.path().join("sweep.toml"), sweep).unwrap();
        fs::write(folder.path().join("bad.toml"), "name = 3").unwrap();
        fs::create_dir_all(folder.path().join("empty")).unwrap();
        let sweep = Sweep::parse(sweep, Path::new("sweep.toml")).unwrap();
        for directory in made {
            Results::open(&Layout::new(&Disk, &folder.path().join(directory)), &sweep).unwrap();
        }
        let error = Results::read(&Layout::new(&Disk, &folder.path().join(path))).unwrap_err();
        error.to_string().replace(&format!("{}/", folder.path().display()), "")
    }

    #[test]
    fn a_directory_that_is_not_there_is_said_to_be_missing_and_the_nearest_that_is_there_named() {
        let there = ["results/fig2", "results/fig3", "results/friction"];
        for (path, way_out) in [
            ("results/fgi3", "did you mean results/fig3?"),
            ("results/fig3x/", "did you mean results/fig3?"),
            ("results/Friktion", "did you mean results/friction?"),
            ("results/unlike", "name one that a run made, such as results/fig3"),
            ("elsewhere/unlike", "name one that a run made, such as results/fig3"),
        ] {
            assert_eq!(refusal(&there, path), format!("{path}: there is no such directory; {way_out}"));
        }
    }

    #[test]
    fn results_directories_within_a_directory_are_named_up_to_three() {
        let made = ["results/a", "results/b", "results/c", "results/d"];
        for (made, expected) in [
            (&made[..1], "results: is no results directory, but holds some: results/a"),
            (&made[..3], "results: is no results directory, but holds some: results/a, results/b, results/c"),
            (&made[..], "results: is no results directory, but holds 4, such as results/a, results/b, results/c"),
        ] {
            assert_eq!(refusal(made, "results"), expected);
        }
        assert!(refusal(&made, "empty").contains("is no results directory (there is no run/manifest.json); name one"));
    }

    #[test]
    fn a_sweep_file_leads_to_its_results() {
        let expected = "sweep.toml: is a sweep file; name its results directory, by default results/fig3";
        assert_eq!(refusal(&[], "sweep.toml"), expected);
        assert!(refusal(&[], "bad.toml").contains("is no results directory"));
    }
}
