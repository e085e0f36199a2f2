//! Exports by the built program: the same bytes whatever the history, all formats with the same rows, and no join
//! needed.

use crate::program::{Folder, json};
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::process::Child;
use stickslip::table::formats::Format;

/// Cheap jobs in several parts, and a parameter that no table of slips has.
fn sweep(seeds: u64) -> String {
    format!(
        "name = \"cheap\"\n[model]\nN = 1\nNs = 1\n[axes]\nseed = {{ count = {seeds} }}\nV0 = [2e-4, 1e-4]\n\
         Delta = [1e-6, 0]\nfrequency = [29]\nK = [1e8, 2e8]\n[record]\nslips = 1\ndiscard = 0\n"
    )
}

const SEEDS: u64 = 300;
const FEWER: u64 = 100;
const JOBS: u64 = 8 * SEEDS;

fn exported(folder: &Folder, directory: &str, format: &str) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let report = json(
        &folder
            .ends(
                0,
                &format!("export {directory} -o out --format {format} --json"),
            )
            .stdout,
    );
    assert_eq!(
        (report["jobs"].as_u64(), report["jobs_missing"].as_u64()),
        (Some(JOBS), Some(0)),
        "{report}"
    );
    let contents = folder.contents("out");
    fs::remove_dir_all(folder.path("out")).unwrap();
    contents
}

#[test]
fn an_export_has_the_same_bytes_whatever_threads_shards_kills_and_retries_came_before() {
    let folder = Folder::new();
    folder.write("cheap.toml", &sweep(SEEDS));
    folder.write("fewer.toml", &sweep(FEWER));
    let mut expected = BTreeMap::new();
    for (threads, shards, killed, extended) in [
        (2, 1, false, false),
        (1, 1, true, false),
        (2, 3, false, false),
        (1, 1, false, true),
        (2, 3, true, true),
    ] {
        let directory = format!("r-{threads}-{shards}-{killed}-{extended}");
        for sweep in if extended {
            &["fewer", "cheap"][..]
        } else {
            &["cheap"]
        } {
            for shard in 1..=shards {
                let command = format!(
                    "run {sweep}.toml --out {directory} --threads {threads} --shard {shard}/{shards} --no-reduce"
                );
                if killed {
                    let mut child = folder.start(&command);
                    folder.wait_for_parts(&directory, 1, &mut child);
                    child.kill().unwrap();
                    child.wait().unwrap();
                }
                folder.ends(0, &format!("{command} --retry-failed"));
            }
        }
        for format in Format::ALL.map(Format::word) {
            let found = exported(&folder, &directory, format);
            let first = expected
                .entry((extended, format))
                .or_insert_with(|| found.clone());
            assert!(found == *first, "{directory} {format}");
        }
    }
}

#[test]
fn reduced_data_that_are_out_of_date_are_made_again() {
    let folder = Folder::new();
    folder.write("cheap.toml", &sweep(SEEDS));
    folder.write("fewer.toml", &sweep(FEWER));
    folder.ends(0, "run fewer.toml --out r --no-reduce");
    folder.ends(0, "reduce r");
    let before = folder.contents("r/reduced");
    folder.ends(0, "run cheap.toml --out r --no-reduce");
    let found = exported(&folder, "r", "parquet");
    assert!(folder.contents("r/reduced") != before);
    folder.ends(0, "run cheap.toml --out whole --no-reduce");
    let sets = PathBuf::from("sets.parquet");
    assert!(found[&sets] == exported(&folder, "whole", "parquet")[&sets]);
}

#[test]
fn every_row_of_an_export_has_all_swept_parameters_and_the_frequency_in_the_order_of_the_plan() {
    let folder = Folder::new();
    folder.write("cheap.toml", &sweep(SEEDS));
    folder.ends(0, "run cheap.toml --out r --no-reduce");
    let jobs = folder.table("r", "jobs").cells.len();
    let files = exported(&folder, "r", "csv");
    let text =
        |name: &str| String::from_utf8(files[&PathBuf::from(name)].clone().unwrap()).unwrap();
    for (table, rows) in [
        ("jobs.csv", jobs),
        ("slips.csv", folder.table("r", "slips").cells.len()),
    ] {
        let text = text(table);
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let column = |name: &str| {
            names
                .iter()
                .position(|other| *other == name)
                .unwrap_or_else(|| panic!("{name}"))
        };
        let [frequency, amplitude, stiffness] = ["frequency", "Delta", "K"].map(column);
        let mut count = 0;
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let expected = if cells[amplitude] == "0.0" {
                ""
            } else {
                "29.0"
            };
            assert!(
                cells[frequency] == expected
                    && ["100000000.0", "200000000.0"].contains(&cells[stiffness]),
                "{line}"
            );
            count += 1;
        }
        assert_eq!(count, rows, "{table}");
    }
    let in_plan_order: Vec<String> = text("jobs.csv")
        .lines()
        .skip(1)
        .map(|line| line[..32].to_owned())
        .collect();
    assert_eq!(in_plan_order, folder.table("r", "jobs").texts("job_id"));
}

/// A small sweep of three parts, run.
fn folder_with_results() -> Folder {
    let folder = Folder::new();
    folder.write("cheap.toml", &sweep(SEEDS));
    folder.ends(0, "run cheap.toml --out r --no-reduce");
    folder
}

#[test]
fn what_is_there_is_kept_and_a_place_in_a_results_directory_is_refused() {
    let folder = folder_with_results();
    fs::create_dir_all(folder.path("mine/.unfinished-thesis")).unwrap();
    folder.write("mine/.unfinished-thesis/ch1.txt", "precious");
    folder.write("file", "mine");
    symlink("r/tables", folder.path("link")).unwrap();
    folder.ends(0, "run cheap.toml --out other --no-reduce --shard 1/2");
    let before = folder.contents("");
    for there in ["mine", "file"] {
        let ended = folder.ends(2, &format!("export r -o {there}"));
        assert!(
            ended.stderr.contains("is there already"),
            "{}",
            ended.stderr
        );
    }
    for within in [
        "r",
        "link",
        "r/x",
        "r/tables/x",
        "r/tables/slips/x",
        "r/run/x",
        "r/reduced/x",
        "r/figures/x/y",
        "other/tables/jobs/x",
        "mine/../r/tables/x",
    ] {
        let ended = folder.ends(2, &format!("export r -o {within}"));
        let words = "lies in the results directory";
        assert!(ended.stderr.contains(words), "{}", ended.stderr);
    }
    assert!(folder.contents("") == before);
    folder.ends(0, "verify r");
    fs::create_dir(folder.path("empty")).unwrap();
    for free in ["r/../beside/new", "empty"] {
        folder.ends(0, &format!("export r -o {free}"));
    }
    assert_eq!(folder.contents("beside/new").len(), 3);
    assert_eq!(folder.contents("empty").len(), 3);
}

#[test]
fn what_is_missing_is_said_and_what_a_killed_export_left_is_no_export() {
    let folder = Folder::new();
    folder.write("cheap.toml", &sweep(SEEDS));
    folder.ends(0, "run cheap.toml --out r --shard 1/2 --no-reduce");
    let left = ".stickslip-abcdef.unfinished";
    fs::create_dir(folder.path(left)).unwrap();
    folder.write(&format!("{left}/slips.parquet"), "half");
    folder.screens("export_unfinished", ["status r", "export r -o out"]);
    assert_eq!(folder.contents("out").len(), 3);
    assert_eq!(folder.contents(left).len(), 1);
}

#[test]
fn a_part_without_its_slips_ends_an_export_with_damage_and_nothing_is_written() {
    let folder = folder_with_results();
    folder.ends(0, "reduce r");
    let slips = folder.parts("r", "slips");
    fs::remove_file(slips.last().unwrap()).unwrap();
    let before = folder.contents("");
    for flags in ["", " --format csv", " --json"] {
        let ended = folder.ends(4, &format!("export r -o a/b{flags}"));
        assert!(ended.stderr.contains("it is missing"), "{}", ended.stderr);
    }
    assert!(folder.contents("") == before);
    fs::remove_dir_all(folder.path("r/tables/slips")).unwrap();
    folder.ends(4, "export r -o out");
    assert!(!folder.path("out").exists());
}

#[test]
fn of_exports_into_one_folder_one_wins_and_the_others_are_refused() {
    let folder = folder_with_results();
    folder.ends(0, "export r -o alone");
    let exports: Vec<_> = (0..4).map(|_| folder.start("export r -o out")).collect();
    let ended = exports.into_iter().map(Child::wait_with_output);
    let mut codes: Vec<_> = ended.map(|ended| ended.unwrap().status.code()).collect();
    codes.sort_unstable();
    assert_eq!(codes, [Some(0), Some(2), Some(2), Some(2)]);
    assert!(folder.contents("out") == folder.contents("alone"));
    let left = fs::read_dir(folder.path("")).unwrap();
    assert_eq!(left.count(), 4, "the sweep, its results and two exports");
}
