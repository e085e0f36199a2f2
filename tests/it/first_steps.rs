//! What a new user does first: a sweep file to start from, sweeps of the paper without a file, manual pages.

use super::program::Folder;
use std::fs;

#[test]
fn a_sweep_file_to_start_from_plans_unchanged_and_is_not_overwritten() {
    let folder = Folder::new();
    folder.screens("init", ["init mine.toml", "plan mine.toml --threads 2"]);
    let text = fs::read_to_string(folder.path("mine.toml")).unwrap();
    folder.screens(
        "init_of_a_file_that_is_there",
        ["init mine.toml --preset fig2"],
    );
    assert_eq!(fs::read_to_string(folder.path("mine.toml")).unwrap(), text);
}

#[test]
fn a_sweep_of_the_paper_runs_without_a_file_and_can_be_changed() {
    let folder = Folder::new();
    folder.ends(
        0,
        "run --preset fig4 --set Delta=0 --set seed=0 --set slips=2 --no-reduce",
    );
    assert_eq!(folder.table("results/fig4", "jobs").cells.len(), 1);
    folder.screens(
        "presets",
        [
            "plan --preset fig3 --axis seed=count:3 --threads 2",
            "init my-map.toml --preset locking-map",
            "plan my-map.toml --threads 2",
            "run --preset fig33",
            "plan my-map.toml --preset fig3",
            "run",
        ],
    );
}

#[test]
fn a_sweep_is_varied_without_an_editor_and_goes_to_a_directory_of_its_own() {
    let folder = Folder::new();
    let text = "# Mine.\nname = \"mine\"\n[model]\nN = 3\nNs = 4\n[axes]\nV0 = [1e-4, 2e-4]  # two\n[record]\nslips = 2\n";
    fs::write(folder.path("mine.toml"), text).unwrap();
    folder.ends(0, "run mine.toml --no-reduce");
    let flags = "--set V0=3e-4 --axis seed=count:3 --set slips=1";
    let [plan, run] = ["plan", "run"].map(|command| format!("{command} mine.toml {flags}"));
    folder.screens(
        "varied_without_an_editor",
        [&format!("{plan} --threads 2"), &run],
    );
    folder.ends(0, &format!("run mine.toml {flags} -o other --no-reduce"));
    let jobs = folder.table("other", "jobs");
    assert_eq!(jobs.reals("V0"), [3e-4; 3]);
    // That text is the directory's own, so the same command resumes, and so does its name alone.
    for again in [
        format!("run mine.toml {flags} -o other"),
        "run other".to_owned(),
        "run other --set V0=3e-4".to_owned(),
    ] {
        let ended = folder.ends(0, &format!("{again} --no-reduce"));
        assert!(
            ended.stdout.starts_with("jobs run         0\n"),
            "{again}: {}",
            ended.stdout
        );
    }
    assert_eq!(
        folder.table("results/mine", "jobs").reals("V0"),
        [1e-4, 2e-4]
    );
    // Where there is no directory yet, none can be extended by mistake.
    folder.ends(
        0,
        "run --preset sliding-velocity --set V0=1e-4 --set seed=0 --set N=3 --set Ns=4 --no-reduce",
    );
    let jobs = folder.table("results/sliding-velocity", "jobs");
    assert_eq!(jobs.counts("N"), [3]);
    folder.screens(
        "varied_preset",
        [
            &format!("init other.toml --preset sliding-velocity {flags}"),
            "plan other.toml --threads 2",
        ],
    );
    folder.ends(0, "simulate mine.toml --set V0=1e-4");
}

#[test]
fn each_question_is_a_sweep_that_plans() {
    let folder = Folder::new();
    folder.screens(
        "questions",
        [
            "init friction.toml --question friction",
            "plan friction.toml --threads 2",
            "init interval.toml --question interval",
            "plan interval.toml --threads 2",
            "init locking.toml --question locking",
            "plan locking.toml --threads 2",
            "init sliding.toml --question sliding",
            "plan sliding.toml --threads 2",
        ],
    );
    for file in folder.contents("").into_values().flatten() {
        let text = String::from_utf8(file).unwrap();
        assert!(text.lines().next().unwrap().ends_with('?'), "{text}");
    }
}

#[test]
fn a_file_name_that_suits_no_sweep_is_rejected_and_leaves_nothing() {
    let folder = Folder::new();
    let said = folder.ends(2, "init my.sweep.toml").stderr;
    assert!(
        said.contains("my.sweep.toml") && said.contains("letters, digits"),
        "{said}"
    );
    assert!(!folder.path("my.sweep.toml").exists());
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = Folder::new();
    folder.ends(0, "generate man pages/man1");
    for command in ["", "-run", "-simulate", "-init"] {
        let page =
            fs::read_to_string(folder.path(&format!("pages/man1/stickslip{command}.1"))).unwrap();
        assert!(
            page.contains(".SH DESCRIPTION") || page.contains(".SH OPTIONS"),
            "{command}: {page}"
        );
    }
}
