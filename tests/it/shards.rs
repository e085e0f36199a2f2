//! Several processes of the built program on one directory, and runs that have little time.

use crate::program::{Folder, MANY, json, wait};
use std::time::{Duration, Instant};

/// A single part.
const TINY: &str = "name = \"tiny\"\n[model]\nN = 3\nNs = 4\n[axes]\nseed = { count = 3 }\n[record]\nslips = 2\n";

#[test]
fn shards_side_by_side_make_the_same_tables_reduced_data_and_figures() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    folder.ends(0, "run many.toml --out whole");
    for round in 0..3 {
        let out = format!("sharded-{round}");
        let shards =
            [1, 2, 3].map(|shard| folder.start(&format!("run many.toml --out {out} --threads 1 --shard {shard}/3")));
        for shard in shards {
            let (code, _, stderr) = wait(shard);
            assert_eq!(code, Some(0), "{stderr}");
        }
        for results in ["tables", "reduced", "figures"] {
            assert!(
                folder.contents(&format!("{out}/{results}")) == folder.contents(&format!("whole/{results}")),
                "{results}"
            );
        }
    }
}

#[test]
fn a_shard_without_parts_that_ends_first_has_nothing_to_reduce_and_says_so() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    let first = folder.ends(0, "run tiny.toml --out r --shard 2/2");
    assert!(first.stderr.contains("no part is committed yet"), "{}", first.stderr);
    let last = folder.ends(0, "run tiny.toml --out r --shard 1/2");
    assert!(!last.stderr.contains("missing"), "{}", last.stderr);
    assert!(folder.path("r/reduced/sets.parquet").exists());
}

#[test]
fn what_is_there_is_reduced_and_what_is_missing_is_reported() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    let first = folder.ends(0, "run many.toml --out r --shard 1/2");
    let missing = json(&folder.ends(0, "status r --json").stdout)["jobs_missing"].as_u64().unwrap();
    assert!(missing > 4096, "{missing}");
    let note = format!("reduced what is there: {missing} jobs in 3 parts are missing");
    assert!(first.stderr.contains(&note), "{}", first.stderr);
    let reduced = folder.ends(0, "reduce r --json");
    assert!(reduced.stderr.contains(&note), "{}", reduced.stderr);
    assert_eq!(json(&reduced.stdout)["jobs"].as_u64(), Some(28_000 - missing));
}

#[test]
fn the_same_shard_is_refused_while_its_process_lives_and_taken_over_when_it_is_dead() {
    let folder = Folder::new();
    folder.write("many.toml", &MANY.replace("count = 28000", "count = 200000"));
    let command = "run many.toml --out r --no-reduce --threads 1 --shard 1/2";
    let mut child = folder.start(command);
    folder.wait_for_parts("r", 1, &mut child);
    let refused = folder.ends(2, command);
    assert!(refused.stderr.contains("shard 1/2 is being run by another process"), "{}", refused.stderr);
    let running = json(&folder.ends(0, "status r --json").stdout)["running"].clone();
    assert_eq!(running, serde_json::json!(["1/2"]));
    child.kill().unwrap();
    wait(child);

    let begin = Instant::now();
    let mut heir = folder.start(command);
    let parts = folder.parts("r", "jobs").len();
    folder.wait_for_parts("r", parts + 1, &mut heir);
    assert!(heir.try_wait().unwrap().is_none(), "it was to continue the shard");
    // Within one host nobody waits for a note that stands still.
    assert!(begin.elapsed() < Duration::from_secs(15));
    heir.kill().unwrap();
    wait(heir);
}

#[test]
fn a_walltime_is_kept_and_the_same_command_goes_on_until_all_is_done() {
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
        let ended =
            folder.run(&format!("run many.toml --no-reduce --out r --threads 1 --walltime {seconds:.3}s --json"));
        assert!(begin.elapsed() < walltime, "{:?}: {}", begin.elapsed(), ended.stderr);
        let report = json(&ended.stdout);
        jobs_run += report["jobs_run"].as_u64().unwrap();
        if ended.code == Some(0) {
            break;
        }
        assert_eq!(ended.code, Some(3), "{}", ended.stderr);
        assert!(ended.stderr.contains("The same command resumes."), "{}", ended.stderr);
        assert!(report["jobs_run"].as_u64() > Some(0), "{report}");
        stops += 1;
    }
    assert!(stops >= 1, "all jobs were run in less than half of the time");
    assert_eq!(jobs_run, 60_000, "nothing was run twice");
    assert!(folder.tables("r") == folder.tables("whole"));
}

#[test]
fn a_walltime_too_short_for_any_part_says_so() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    folder.ends(0, "run many.toml --no-reduce --out r --shard 1/2");
    let ended = folder.ends(3, "run many.toml --no-reduce --out r --walltime 0.501s");
    assert!(ended.stderr.contains("No part") && ended.stderr.contains("give a longer --walltime"), "{}", ended.stderr);
}
