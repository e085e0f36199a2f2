//! The built program on adaptive sweeps: the rounds are the same for any processes, kills and earlier
//! sweeps, and they end.

use crate::program::{Folder, json, wait};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::time::Duration;

/// Some seconds of CPU time, in a dozen of rounds: the edges of two statistics at two frequencies.
const MAP: &str = "name = \"map\"\n[model]\nN = 20\nNs = 5\n[axes]\nfrequency = [29, 58]\n\
                   Delta = { log = [5e-8, 1.6e-6], points = 3 }\n[record]\nslips = 10\ncontrol = true\n\
                   [refine]\naxis = \"Delta\"\nby = [\"resultant_length\", \"resultant_drive\"]\nthreshold = 0.5\n\
                   to = 0.1\nseeds = { first = 5, from = 8, to = 200 }\njobs = 3000\n";

/// The files that say which rounds a directory has had.
fn extensions(folder: &Folder, out: &str) -> Vec<Vec<u8>> {
    let is_extension = |path: &PathBuf| path.to_str().unwrap().starts_with("extension-");
    let files = folder
        .contents(&format!("{out}/run"))
        .into_iter()
        .filter(|(path, _)| is_extension(path));
    files.filter_map(|(_, bytes)| bytes).collect()
}

#[test]
fn rounds_are_the_same_for_one_process_four_and_kills_whenever_they_come() {
    let folder = Folder::new();
    folder.write("map.toml", MAP);
    let whole = json(&folder.ends(0, "run map.toml --out whole --json").stdout);
    assert!(
        whole["rounds"]["round"].as_u64() > Some(4) && whole["rounds"]["is_over"] == true,
        "{whole}"
    );
    folder.ends(0, "verify whole");

    let shared: Vec<_> = (0..4)
        .map(|_| folder.start("run map.toml --out shared --threads 1 --worker"))
        .collect();
    let ended: Vec<_> = shared.into_iter().map(wait).collect();
    assert!(ended.iter().all(|(code, ..)| *code == Some(0)), "{ended:?}");

    // Kills in each of the first rounds and after the decisions between them, however fast the machine is; begun again
    // whenever the sweep has come to its end.
    let rounds = || {
        let file = |round: &usize| folder.path(&format!("killed/run/extension-{round:03}.json"));
        (0..100).take_while(|round| file(round).exists()).count()
    };
    let (mut kills, mut rounds_at_kills) = (0, BTreeSet::new());
    for run in 0.. {
        let mut child = folder.start("run map.toml --out killed --no-reduce");
        while rounds() < 1 + run % 5 && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(50 + 60 * (run as u64 % 7)));
        child.kill().unwrap();
        if wait(child).0.is_none() {
            kills += 1;
            rounds_at_kills.insert(rounds());
        } else {
            // One that had ended.
            fs::remove_dir_all(folder.path("killed")).unwrap();
        }
        if kills >= 20 && rounds_at_kills.len() >= 3 {
            break;
        }
        assert!(
            run < 200,
            "{kills} kills at these numbers of rounds: {rounds_at_kills:?}"
        );
    }
    folder.ends(0, "run map.toml --out killed");

    for out in ["shared", "killed"] {
        assert!(
            folder.tables(out) == folder.tables("whole"),
            "tables of {out}"
        );
        for results in ["reduced", "figures"] {
            assert!(
                folder.contents(&format!("{out}/{results}"))
                    == folder.contents(&format!("whole/{results}")),
                "{out}"
            );
        }
        assert!(
            extensions(&folder, out) == extensions(&folder, "whole"),
            "extensions of {out}"
        );
        folder.ends(0, &format!("verify {out}"));
    }
    let again = json(&folder.ends(0, "run whole --json --no-reduce").stdout);
    assert_eq!(
        (again["jobs_run"].as_u64(), &again["rounds"]),
        (Some(0), &whole["rounds"])
    );
}

#[test]
fn an_interrupted_round_resumes_and_decides_the_same() {
    let folder = Folder::new();
    folder.write("map.toml", MAP);
    folder.ends(0, "run map.toml --out whole --no-reduce");
    let mut stops = 0;
    loop {
        let child = folder.start("run map.toml --out r --no-reduce");
        std::thread::sleep(Duration::from_millis(700));
        // It may have ended.
        let process = rustix::process::Pid::from_child(&child);
        let _ = rustix::process::kill_process(process, rustix::process::Signal::INT);
        let (code, _, stderr) = wait(child);
        if code == Some(0) {
            break;
        }
        assert_eq!(code, Some(3), "{stderr}");
        stops += 1;
    }
    assert!(stops > 0);
    assert!(extensions(&folder, "r") == extensions(&folder, "whole"));
    folder.ends(0, "verify r");
    assert!(folder.tables("r") == folder.tables("whole"));
}

#[test]
fn a_directory_that_has_had_other_sweeps_goes_through_the_same_rounds_and_runs_what_is_missing_alone()
 {
    let folder = Folder::new();
    folder.write("map.toml", MAP);
    // Other seeds of some of its sets, and sets of its own.
    let (axes, _) = MAP.split_once("[refine]").unwrap();
    folder.write(
        "plain.toml",
        &axes.replace("[record]", "seed = { count = 9 }\n[record]"),
    );
    folder.write("coarse.toml", &MAP.replace("to = 0.1", "to = 0.2"));
    let whole = json(
        &folder
            .ends(0, "run map.toml --out whole --no-reduce --json")
            .stdout,
    );
    for sweep in ["plain.toml", "coarse.toml"] {
        folder.ends(0, &format!("run {sweep} --out r --no-reduce"));
    }
    let after = json(
        &folder
            .ends(0, "run map.toml --out r --no-reduce --json")
            .stdout,
    );
    assert_eq!(after["rounds"], whole["rounds"]);
    assert!(
        after["jobs_run"].as_u64() < whole["jobs_run"].as_u64(),
        "{after}"
    );
    let wider = folder.ends(0, "plan map.toml --out r").stdout;
    assert!(wider.contains("0 to run"), "{wider}");
    let ids = folder.table("r", "jobs");
    let mut ids = ids.texts("job_id");
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count, "a job is there twice");
    folder.ends(0, "verify r");
}

#[test]
fn a_target_that_cannot_be_met_ends_at_the_cap_and_says_so() {
    let folder = Folder::new();
    let text = "name = \"hard\"\n[model]\nN = 10\nNs = 5\n[axes]\nV0 = [5e-5, 1e-4]\n[record]\nslips = 3\n\
                [precision]\nof = [\"tau_mean\", \"mean_friction\"]\nrelative = 1e-9\nseeds = { from = 3, to = 11 }\n";
    folder.write("hard.toml", text);
    folder.screens(
        "rounds_at_the_cap",
        [
            "plan hard.toml --threads 2",
            "run hard.toml --out r --threads 1",
            "status r",
            "run hard.toml --out s --shard 1/2",
        ],
    );
    let sets = folder.file("r/reduced/sets.parquet");
    assert_eq!(
        (
            sets.counts("jobs"),
            sets.counts("seeds"),
            sets.counts("last_round")
        ),
        (vec![11; 2], vec![11; 2], vec![1; 2])
    );
}

#[test]
fn edges_have_intervals_and_say_how_they_ended_and_rows_without_one_say_so() {
    let folder = Folder::new();
    folder.write("map.toml", MAP);
    folder.write(
        "few.toml",
        &MAP.replace("jobs = 3000", "jobs = 150")
            .replace("threshold = 0.5", "threshold = 0.999"),
    );
    folder.screens(
        "rounds_to_edges",
        [
            "plan map.toml --threads 2",
            "run map.toml --out r --threads 2",
            "status r",
        ],
    );
    let edges = folder.file("r/reduced/edges.parquet");
    let (place, low, high) = (
        edges.reals("edge"),
        edges.reals("edge_low"),
        edges.reals("edge_high"),
    );
    assert_eq!(
        edges.texts("statistic").len(),
        4,
        "two frequencies, two statistics"
    );
    for ((place, low), (high, ended)) in place
        .iter()
        .zip(&low)
        .zip(high.iter().zip(edges.texts("ended")))
    {
        assert!(
            5e-8 < *low && low < place && place < high && *high < 1.6e-6,
            "{low} {place} {high}"
        );
        assert_eq!(
            ended == "width",
            high / low < 1.1 * (1.0 + 1e-9),
            "{ended}: {low} to {high}"
        );
    }
    assert!(folder.path("r/figures/edges.svg").exists());
    let told = json(&folder.ends(0, "show r --json").stdout)["edges"]
        .as_array()
        .unwrap()
        .clone();
    let of_json = |key: &str| {
        told.iter()
            .map(|edge| edge[key].as_f64().unwrap())
            .collect::<Vec<_>>()
    };
    assert!(
        of_json("edge") == place
            && of_json("edge_high") == high
            && told[0]["statistic"].is_string(),
        "{told:?}"
    );
    assert!(folder.table("r", "jobs").counts("seed").into_iter().min() == Some(5));
    let end = |name: &str, ended: &str| {
        folder.ends(0, &format!("run {name}.toml --out {name}"));
        let edges = folder.file(&format!("{name}/reduced/edges.parquet"));
        let texts = edges.texts("ended");
        assert!(texts.iter().all(|text| *text == ended), "{name}: {texts:?}");
    };
    end("few", "no crossing");
    // Too short for two cycles of the load, and so for a phase.
    folder.write(
        "short.toml",
        &MAP.replace("slips = 10", "slips = 2")
            .replace("[29, 58]", "[3, 5]"),
    );
    end("short", "no value");
    folder.screens("rows_without_an_edge", ["show few", "show short"]);
}

#[test]
fn a_row_whose_end_is_not_clear_says_so_and_what_to_do() {
    let folder = Folder::new();
    let (axes, _) = MAP.split_once("[refine]").unwrap();
    let axes = axes.replace("[29, 58]", "[29, 58, 87]");
    let seeds = "seed = { first = 5, count = 24 }\n[record]";
    folder.write("plain.toml", &axes.replace("[record]", seeds));
    folder.ends(0, "run plain.toml --out plain");
    let sets = folder.file("plain/reduced/sets.parquet");
    // The value of a set with its first seeds, so that a few more leave it unclear.
    let at_threshold = |set: usize| {
        let refine = "[refine]\naxis = \"Delta\"\nby = \"resultant_length\"\nto = 0.5\n\
                      seeds = { first = 5, from = 24, to = 32 }\njobs = 3000\nthreshold = ";
        format!("{axes}{refine}{}\n", sets.reals("resultant_length")[set])
    };
    folder.write("end.toml", &at_threshold(0));
    folder.ends(0, "run end.toml --out r");
    let edges = folder.file("r/reduced/edges.parquet");
    let ended = edges.texts("ended");
    let unclear = ended.iter().position(|ended| *ended == "unclear end");
    let unclear = unclear.unwrap_or_else(|| panic!("{ended:?}"));
    assert_eq!(edges.counts("jobs")[unclear], 32, "it got all seeds");
    assert_eq!(edges.reals("bracket_low")[unclear], 5e-8);
    folder.screens("rows_with_an_unclear_end", ["show r", "status r"]);
}

#[test]
fn lost_rounds_are_restored() {
    let folder = Folder::new();
    folder.write("map.toml", MAP);
    folder.ends(0, "run map.toml --out r --no-reduce");
    let (before, tables) = (extensions(&folder, "r"), folder.tables("r"));
    for number in 0..before.len() {
        fs::remove_file(folder.path(&format!("r/run/extension-{number:03}.json"))).unwrap();
    }
    folder.ends(4, "verify r");
    folder.ends(0, "verify r --repair");
    assert!(extensions(&folder, "r") == before);
    let lost = folder.path("r/run/extension-001.json");
    let text = fs::read_to_string(&lost).unwrap();
    fs::write(&lost, text.replace("sets_done", "sets_dome")).unwrap();
    assert!(
        folder
            .ends(4, "verify r")
            .stdout
            .contains("extension-001.json")
    );
    folder.ends(0, "verify r --repair");
    assert_eq!(fs::read_to_string(&lost).unwrap(), text);
    // A part of an early round is run again before anything else.
    let lost = folder.parts("r", "jobs")[1].clone();
    fs::remove_file(&lost).unwrap();
    folder.ends(0, "run map.toml --out r --no-reduce");
    assert!(folder.tables("r") == tables && extensions(&folder, "r") == before);
}
