//! What a new user does first: a sweep file to start from, sweeps of the paper without a file, manual pages.

use super::program::Folder;
use std::fs;

#[test]
fn a_sweep_file_to_start_from_plans_as_it_is_and_is_not_overwritten() {
    let folder = Folder::new();
    let said = folder.ends(0, "init mine.toml").stderr;
    assert!(said.contains("stickslip plan mine.toml"), "{said}");
    let planned = folder.ends(0, "plan mine.toml").stdout;
    assert!(planned.contains("mine") && planned.contains("18 after conditions"), "{planned}");
    let text = fs::read_to_string(folder.path("mine.toml")).unwrap();
    let again = folder.ends(2, "init mine.toml --preset fig2");
    assert!(again.stderr.contains("is there already and was not changed"), "{}", again.stderr);
    assert_eq!(fs::read_to_string(folder.path("mine.toml")).unwrap(), text);
}

#[test]
fn a_sweep_of_the_paper_runs_without_a_file_and_can_be_changed() {
    let folder = Folder::new();
    assert!(folder.ends(0, "plan --preset fig3-full").stdout.contains("14230 after conditions"));
    folder.ends(0, "run --preset eq1 --no-reduce");
    assert_eq!(folder.table("results/eq1", "jobs").cells.len(), 1);
    folder.ends(0, "init my-map.toml --preset locking-map");
    assert!(folder.ends(0, "plan my-map.toml").stdout.contains("my-map"));
    let unknown = folder.ends(2, "run --preset fig33");
    assert!(unknown.stderr.contains("fig3"), "{}", unknown.stderr);
    let both = folder.ends(2, "plan my-map.toml --preset fig3");
    assert!(both.stderr.contains("cannot be used with"), "{}", both.stderr);
    let neither = folder.ends(2, "run");
    assert!(neither.stderr.contains("SWEEP.toml"), "{}", neither.stderr);
}

#[test]
fn a_file_name_that_suits_no_sweep_is_rejected_and_leaves_nothing() {
    let folder = Folder::new();
    let said = folder.ends(2, "init my.sweep.toml").stderr;
    assert!(said.contains("my.sweep.toml") && said.contains("letters, digits"), "{said}");
    assert!(!folder.path("my.sweep.toml").exists());
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = Folder::new();
    folder.ends(0, "generate man pages/man1");
    for command in ["", "-run", "-simulate", "-init"] {
        let page = fs::read_to_string(folder.path(&format!("pages/man1/stickslip{command}.1"))).unwrap();
        assert!(page.contains(".SH DESCRIPTION") || page.contains(".SH OPTIONS"), "{command}: {page}");
    }
}
