//! Several processes of the built program on one directory, and runs that have little time.

use crate::program::{Folder, MANY, MANY_PARTS, json, wait};
use std::collections::BTreeSet;
use std::fs;
use std::time::{Duration, Instant};

/// Three parts.
const TINY: &str =
    "name = \"tiny\"\n[model]\nN = 3\nNs = 4\n[axes]\nseed = { count = 3 }\n[record]\nslips = 2\n";

/// Jobs of some 20 ms, of which several make a part.
const DEAR: &str = "name = \"dear\"\n[axes]\nseed = { count = 300 }\n[record]\nslips = 16\n";

/// Names of the parts as the logs have them, in order.
fn committed(folder: &Folder, directory: &str) -> Vec<String> {
    let logs = folder.contents(&format!("{directory}/run/log"));
    let texts = logs
        .into_values()
        .flatten()
        .map(|bytes| String::from_utf8(bytes).unwrap());
    let mut parts: Vec<String> = texts
        .flat_map(|text| text.lines().map(json).collect::<Vec<_>>())
        .filter(|line| line["event"] == "part_committed")
        .map(|line| line["part"].as_str().unwrap().to_owned())
        .collect();
    parts.sort();
    parts
}

#[test]
fn processes_side_by_side_run_each_part_once_and_make_the_same_tables_reduced_data_and_figures() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    folder.ends(0, "run many.toml --out whole");
    for processes in [2, 3, 8] {
        let out = format!("shared-{processes}");
        let workers: Vec<_> = (0..processes)
            .map(|_| folder.start(&format!("run many.toml --out {out} --threads 1")))
            .collect();
        let ended: Vec<_> = workers.into_iter().map(wait).collect();
        for (code, _, stderr) in &ended {
            let left = stderr.contains("others run the last");
            assert_eq!(*code, Some(if left { 3 } else { 0 }), "{stderr}");
        }
        assert!(ended.iter().any(|(code, ..)| *code == Some(0)), "{ended:?}");
        for results in ["tables", "reduced", "figures"] {
            assert!(
                folder.contents(&format!("{out}/{results}"))
                    == folder.contents(&format!("whole/{results}")),
                "{results} of {processes}"
            );
        }
        let parts = committed(&folder, &out);
        assert_eq!(
            (parts.len(), parts.iter().collect::<BTreeSet<_>>().len()),
            (MANY_PARTS, MANY_PARTS)
        );
        let reduced = ended
            .iter()
            .filter(|(_, stdout, _)| stdout.contains("reduced data"))
            .count();
        assert_eq!(reduced, 1, "{ended:?}");
        let late = folder.ends(0, &format!("run many.toml --out {out} --json --no-reduce"));
        assert_eq!(json(&late.stdout)["jobs_run"].as_u64(), Some(0));
        for left in ["claims", "workers"] {
            let path = folder.path(&format!("{out}/run/{left}"));
            assert!(
                fs::read_dir(path).unwrap().next().is_none(),
                "{left} of {processes}"
            );
        }
    }
}

#[test]
fn the_parts_of_a_killed_process_are_taken_over_and_the_status_shows_living_workers() {
    let folder = Folder::new();
    folder.write("dear.toml", DEAR);
    folder.ends(0, "run dear.toml --out whole --no-reduce");
    let command = "run dear.toml --out r --no-reduce --threads 1";
    let (mut victim, mut heir) = (folder.start(command), folder.start(command));
    folder.wait_for_parts("r", 6, &mut victim);
    let status = json(&folder.ends(0, "status r --json").stdout);
    let workers = status["workers"].as_array().unwrap();
    assert_eq!(workers.len(), 2, "{status}");
    assert!(
        workers.iter().all(|worker| worker["threads"] == 1),
        "{status}"
    );
    folder.ends(3, "status r --check");
    victim.kill().unwrap();
    wait(victim);
    assert!(heir.try_wait().unwrap().is_none(), "it was to go on");
    let (code, _, stderr) = wait(heir);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(folder.tables("r") == folder.tables("whole"));
    folder.ends(0, "status r --check");
}

#[test]
fn a_run_that_leaves_the_rest_to_others_ends_with_3_and_a_worker_of_many_with_0() {
    let folder = Folder::new();
    // The first part takes seconds.
    let text = "name = \"long\"\n[[axes.zip]]\nN = [150, 3]\nNs = [100, 2]\n[axes]\nseed = [0]\n[record]\nslips = 300\n";
    folder.write("long.toml", text);
    let mut first = folder.start("run long.toml --out r --threads 1 --no-reduce");
    let claims = folder.path("r/run/claims/part-000-000000.0");
    while !claims.exists() {
        assert!(first.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(1));
    }
    for (flag, code) in [("", 3), ("--worker", 0)] {
        let ended = folder.ends(code, &format!("run long.toml --out r --no-reduce {flag}"));
        let left = "others run the last ";
        assert!(ended.stderr.contains(left), "{}", ended.stderr);
    }
    folder.ends(3, "status r --check");
    let (code, _, stderr) = wait(first);
    assert_eq!(code, Some(0), "{stderr}");
    folder.ends(0, "status r --check");
    folder.ends(0, "run long.toml --out r --no-reduce");
}

#[test]
#[cfg(unix)]
fn what_is_finished_when_a_run_is_stopped_is_kept_and_not_run_again() {
    let folder = Folder::new();
    folder.write("dear.toml", &DEAR.replace("count = 300", "count = 450"));
    folder.ends(0, "run dear.toml --out whole --no-reduce");
    let (mut run, mut spilled, mut stops) = (0, 0, 0);
    loop {
        let child = folder.start("run dear.toml --out r --no-reduce --json");
        std::thread::sleep(Duration::from_millis(900));
        let process = rustix::process::Pid::from_child(&child);
        // It may have ended.
        let _ = rustix::process::kill_process(process, rustix::process::Signal::INT);
        let (code, stdout, stderr) = wait(child);
        let report = json(&stdout);
        // What was spilled before counts when its part is committed.
        run += report["jobs_run"].as_u64().unwrap();
        spilled += report["jobs_spilled"].as_u64().unwrap();
        if code == Some(0) {
            break;
        }
        assert!(
            code == Some(3) && stderr.contains("finished jobs are kept"),
            "{stderr}"
        );
        stops += 1;
    }
    assert!(
        stops > 1 && spilled > 0,
        "{stops} stops, {spilled} jobs spilled"
    );
    assert_eq!(run + spilled, 450, "{stops} stops, {spilled} jobs spilled");
    assert!(folder.tables("r") == folder.tables("whole"));
}

#[test]
fn shards_in_directories_of_their_own_reduce_what_is_there_and_report_what_is_missing() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    let first = folder.ends(0, "run many.toml --out r --shard 1/2");
    let missing = json(&folder.ends(0, "status r --json").stdout)["jobs_missing"]
        .as_u64()
        .unwrap();
    assert!((13_500..=14_500).contains(&missing), "{missing}");
    let note = format!("reduced what is there: {missing} jobs missing");
    assert!(first.stderr.contains(&note), "{}", first.stderr);
    let reduced = folder.ends(0, "reduce r --json");
    assert!(reduced.stderr.contains(&note), "{}", reduced.stderr);
    assert_eq!(
        json(&reduced.stdout)["jobs"].as_u64(),
        Some(28_000 - missing)
    );
}

#[test]
fn a_shard_without_parts_has_nothing_to_reduce_and_says_so() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    let first = folder.ends(0, "run tiny.toml --out r --shard 4/4");
    assert!(
        first.stderr.contains("no part is committed yet"),
        "{}",
        first.stderr
    );
}

#[test]
fn a_walltime_is_kept_and_the_same_command_resumes_until_all_is_done() {
    let folder = Folder::new();
    folder.write("many.toml", &MANY.replace("count = 28000", "count = 60000"));
    let begin = Instant::now();
    folder.ends(0, "run many.toml --no-reduce --out whole --threads 1");
    // Half a second is set aside for the end.
    let walltime = begin.elapsed().mul_f64(0.4) + Duration::from_millis(500);
    let (mut stops, mut jobs_run) = (0, 0);
    loop {
        let begin = Instant::now();
        let seconds = walltime.as_secs_f64();
        let ended = folder.run(&format!(
            "run many.toml --no-reduce --out r --threads 1 --walltime {seconds:.3}s --json"
        ));
        assert!(
            begin.elapsed() < walltime,
            "{:?}: {}",
            begin.elapsed(),
            ended.stderr
        );
        let report = json(&ended.stdout);
        jobs_run += report["jobs_run"].as_u64().unwrap() + report["jobs_spilled"].as_u64().unwrap();
        if ended.code == Some(0) {
            break;
        }
        assert_eq!(ended.code, Some(3), "{}", ended.stderr);
        assert!(
            ended.stderr.contains("The same command resumes."),
            "{}",
            ended.stderr
        );
        assert!(report["jobs_run"].as_u64() > Some(0), "{report}");
        stops += 1;
    }
    assert!(
        stops >= 1,
        "all jobs were run in less than half of the time"
    );
    assert_eq!(jobs_run, 60_000, "nothing was run twice");
    assert!(folder.tables("r") == folder.tables("whole"));
}

#[test]
fn a_walltime_too_short_for_any_part_says_so() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    folder.write(
        "long.toml",
        &MANY
            .replace("count = 28000", "count = 2")
            .replace("slips = 2", "slips = 1000000"),
    );
    folder.ends(0, "run many.toml --no-reduce --out r");
    folder.ends(3, "run long.toml --no-reduce --out long --walltime 0.501s");
    let ended = folder.ends(3, "run long.toml --no-reduce --out long --walltime 0.501s");
    assert!(
        ended.stderr.contains("No part") && ended.stderr.contains("give a longer --walltime"),
        "{}",
        ended.stderr
    );
}
