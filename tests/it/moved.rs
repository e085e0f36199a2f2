//! A results directory that is moved, removed or replaced under a run: the run ends with an error, and nothing is
//! written at its old place.

use crate::program::{Folder, wait};
use std::fs;
use std::path::Path;

/// Jobs of some 20 ms, several parts of them.
const DEAR: &str = "name = \"dear\"\n[axes]\nseed = { count = 300 }\n[record]\nslips = 8\n";
const OTHER: &str =
    "name = \"other\"\n[model]\nN = 3\nNs = 4\n[axes]\nseed = { count = 3 }\n[record]\nslips = 2\n";

/// Runs a sweep in `r`, does something to that once a part is committed, and returns how the run ended.
fn run_and(folder: &Folder, act: impl FnOnce()) -> (Option<i32>, String) {
    folder.write("dear.toml", DEAR);
    let mut run = folder.start("run dear.toml --out r --threads 1");
    folder.wait_for_parts("r", 1, &mut run);
    act();
    let (code, _, stderr) = wait(run);
    (code, stderr)
}

/// Removes a directory while something writes into it.
fn remove(path: &Path) {
    while path.exists() {
        let _ = fs::remove_dir_all(path);
    }
}

#[test]
fn a_run_whose_directory_is_moved_or_removed_ends_and_begins_no_other_at_its_place() {
    for is_moved in [true, false] {
        let folder = Folder::new();
        let r = folder.path("r");
        let (code, stderr) = run_and(&folder, || {
            if is_moved {
                fs::rename(&r, folder.path("moved")).unwrap();
            } else {
                remove(&r);
            }
        });
        assert_eq!(code, Some(2), "{stderr}");
        assert!(
            stderr.contains("r: the results directory was moved, removed or replaced"),
            "{stderr}"
        );
        assert!(!r.exists());
        if is_moved {
            folder.ends(3, "verify moved");
            folder.ends(0, "run dear.toml --out moved --no-reduce");
        }
    }
}

#[test]
fn a_run_whose_directory_is_replaced_by_that_of_another_sweep_leaves_that_unchanged() {
    let folder = Folder::new();
    folder.write("other.toml", OTHER);
    folder.ends(0, "run other.toml --out other");
    let tables = folder.contents("other/tables");
    let (code, stderr) = run_and(&folder, || {
        fs::rename(folder.path("r"), folder.path("moved")).unwrap();
        fs::rename(folder.path("other"), folder.path("r")).unwrap();
    });
    assert_eq!(code, Some(2), "{stderr}");
    assert!(
        stderr.contains("r: the results directory was moved, removed or replaced"),
        "{stderr}"
    );
    assert!(folder.contents("r/tables") == tables);
    folder.ends(0, "verify r");
    folder.ends(3, "verify moved");
}

#[test]
fn a_run_whose_tables_are_moved_away_ends_and_begins_no_others() {
    let folder = Folder::new();
    let tables = folder.path("r/tables");
    let (code, stderr) = run_and(&folder, || {
        fs::rename(&tables, folder.path("tables")).unwrap();
    });
    assert_eq!(code, Some(3), "{stderr}");
    assert!(
        stderr.contains("r/tables: cannot create anything in it: it was moved or removed"),
        "{stderr}"
    );
    assert!(!tables.exists());
    fs::rename(folder.path("tables"), &tables).unwrap();
    folder.ends(0, "run dear.toml --out r --no-reduce");
    folder.ends(0, "verify r");
}
