//! Compaction by the built program: the same bytes whatever the history, every row once for readers at any time and after
//! any kill, and a directory that keeps working.

use crate::program::Folder;
use parquet::file::reader::{FileReader, SerializedFileReader};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::Path;
use std::time::{Duration, Instant};

/// Cheap jobs in several parts.
fn sweep(seeds: u64) -> String {
    format!(
        "name = \"cheap\"\n[model]\nN = 1\nNs = 1\n[axes]\nseed = {{ count = {seeds} }}\nV0 = [2e-4, 1e-4]\n\
         Delta = [1e-6, 0]\nfrequency = [29]\n[record]\nslips = 1\ndiscard = 0\n"
    )
}

/// Four jobs for each seed: parts of 4096 jobs, that is 3 of them.
const SEEDS: u64 = 2300;
const JOBS: u64 = 4 * SEEDS;
/// Before the extension: 2 parts.
const FEWER_SEEDS: u64 = 1100;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// A hash of the names and the bytes of all table files.
fn hash(folder: &Folder, directory: &str) -> String {
    let mut hasher = Sha256::new();
    for (path, bytes) in folder.contents(&format!("{directory}/tables")) {
        if let Some(bytes) = bytes {
            hasher.update(path.to_str().unwrap());
            hasher.update(bytes);
        }
    }
    format!("{:x?}", hasher.finalize())
}

/// Kills a command when a table has another part, or lets it end if it is quicker.
fn kill_after_a_part(folder: &Folder, directory: &str, command: &str) {
    let parts = folder.parts(directory, "jobs").len();
    let mut child = folder.start(command);
    let begin = Instant::now();
    while folder.parts(directory, "jobs").len() == parts && child.try_wait().unwrap().is_none() {
        assert!(begin.elapsed() < Duration::from_mins(1), "{command} hangs");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn compacted_tables_have_one_hash_for_the_same_extensions_whatever_else_the_history() {
    let folder = Folder::new();
    folder.write("cheap.toml", &sweep(SEEDS));
    folder.write("fewer.toml", &sweep(FEWER_SEEDS));
    let (mut hashes, mut rows, mut histories) = (BTreeMap::<bool, String>::new(), BTreeSet::new(), 0);
    for threads in [1, 2] {
        for shards in [1, 3] {
            for killed in [false, true] {
                for extended in [false, true] {
                    let directory = format!("r-{threads}-{shards}-{killed}-{extended}");
                    let run = |sweep: &str| {
                        for shard in 1..=shards {
                            let command = format!(
                                "run {sweep} --out {directory} --threads {threads} --shard {shard}/{shards} --no-reduce"
                            );
                            if killed {
                                kill_after_a_part(&folder, &directory, &command);
                            }
                            folder.ends(0, &command);
                        }
                    };
                    if extended {
                        run("fewer.toml");
                        // Whether it was compacted in between must make no difference, either.
                        if killed {
                            folder.ends(0, &format!("compact {directory}"));
                        }
                    }
                    run("cheap.toml");
                    let report = json(&folder.ends(0, &format!("compact {directory} --json")).stdout);
                    assert_eq!((report["jobs"].as_u64(), report["changed"].as_bool()), (Some(JOBS), Some(true)));
                    let hash = hash(&folder, &directory);
                    assert_eq!(*hashes.entry(extended).or_insert_with(|| hash.clone()), hash, "{directory}");
                    histories += 1;
                    if threads == 1 && shards == 1 {
                        let slips = folder.table(&directory, "slips").sorted_by(&["job_id"]);
                        rows.insert(format!("{:x?}", Sha256::digest(format!("{slips:?}"))));
                    }
                    fs::remove_dir_all(folder.path(&directory)).unwrap();
                }
            }
        }
    }
    assert_eq!((histories, hashes.len(), rows.len()), (16, 2, 1));
}

#[test]
fn compacted_tables_are_few_and_in_plan_order_and_the_directory_goes_on_working() {
    let folder = Folder::new();
    folder.write("cheap.toml", &sweep(SEEDS));
    folder.write("fewer.toml", &sweep(FEWER_SEEDS));
    folder.ends(0, "run fewer.toml --out r");
    let rows = |table| folder.table("r", table).sorted_by(&["job_id"]);
    let (slips, jobs) = (rows("slips"), rows("jobs"));
    let in_plan_order = folder.table("r", "jobs").cells;
    let reduced = json(&folder.ends(0, "reduce r --json").stdout);
    let status = folder.ends(0, "status r").stdout;
    folder.ends(0, "compact r");
    assert_eq!((folder.parts("r", "slips").len(), folder.parts("r", "jobs").len()), (1, 1));
    assert!(rows("slips") == slips && rows("jobs") == jobs);
    assert!(folder.table("r", "jobs").cells == in_plan_order);

    assert_eq!(folder.ends(0, "status r").stdout, status);
    let after = json(&folder.ends(0, "reduce r --json").stdout);
    for key in ["jobs", "failed_jobs", "sets", "locked_sets", "slips", "points"] {
        assert_eq!(after[key], reduced[key], "{key}");
    }
    let again = json(&folder.ends(0, "compact r --json").stdout);
    assert_eq!(again["changed"], false);
    let run = |sweep: &str| json(&folder.ends(0, &format!("run {sweep} --out r --json --no-reduce")).stdout);
    assert_eq!(run("fewer.toml")["jobs_run"].as_u64(), Some(0));
    assert_eq!(run("cheap.toml")["jobs_run"].as_u64(), Some(4 * (SEEDS - FEWER_SEEDS)));
    assert_eq!(json(&folder.ends(0, "verify r --json").stdout)["jobs"].as_u64(), Some(JOBS));
    assert_eq!(folder.parts("r", "jobs").len(), 66, "a compacted file and the parts of the extension");
    assert_eq!(folder.table("r", "jobs").sorted_by(&["job_id"]).len() as u64, JOBS);
    assert_eq!(json(&folder.ends(0, "reduce r --json").stdout)["jobs"].as_u64(), Some(JOBS));
    folder.ends(0, "compact r");
    assert_eq!(folder.parts("r", "jobs").len(), 2, "a compacted file for each of the two sweeps");
    // Another sweep that was run here already.
    assert_eq!(run("fewer.toml")["jobs_run"].as_u64(), Some(0));
    assert_eq!(json(&folder.ends(0, "compact r --json").stdout)["changed"], false);
    assert_eq!(folder.table("r", "jobs").sorted_by(&["job_id"]).len() as u64, JOBS);
}

#[test]
fn parts_with_failed_jobs_are_not_compacted_and_their_failed_jobs_can_be_run_again() {
    let folder = Folder::new();
    folder.write(
        "failing.toml",
        "name = \"failing\"\n[model]\nNs = 2\n[axes]\nN = [1, 2, 30]\nseed = { count = 2 }\n\
         [record]\nslips = 2\ndiscard = 0\nmax_events = 300\n",
    );
    folder.ends(1, "run failing.toml --out r --no-reduce");
    let compacted = json(&folder.ends(0, "compact r --json").stdout);
    assert_eq!((compacted["parts"].as_u64(), compacted["failed_parts"].as_u64()), (Some(4), Some(2)), "{compacted}");
    let before = hash(&folder, "r");
    let status = json(&folder.ends(1, "status r --json").stdout);
    assert_eq!((status["jobs_done"].as_u64(), status["jobs_failed"].as_u64()), (Some(4), Some(2)));
    let again = json(&folder.ends(1, "run failing.toml --out r --no-reduce --json").stdout);
    assert_eq!((again["jobs_run"].as_u64(), again["jobs_failed"].as_u64()), (Some(0), Some(2)));
    let retried = json(&folder.ends(1, "run failing.toml --out r --no-reduce --json --retry-failed").stdout);
    assert_eq!((retried["jobs_run"].as_u64(), retried["jobs_failed"].as_u64()), (Some(2), Some(2)));
    folder.ends(0, "verify r");
    folder.ends(0, "compact r");
    assert_eq!(hash(&folder, "r"), before);
}

/// What a reader gets who lists a table folder and reads its files: their rows, or that one is not there any more.
fn read(folder: &Path) -> Option<u64> {
    // The folder itself is there at every instant.
    let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    let mut rows = 0;
    for name in names {
        match File::open(folder.join(name)) {
            Err(error) if error.kind() == ErrorKind::NotFound => return None,
            file => rows += SerializedFileReader::new(file.unwrap()).unwrap().metadata().file_metadata().num_rows(),
        }
    }
    Some(rows.cast_unsigned())
}

#[test]
fn readers_get_every_row_once_or_an_error_while_tables_are_compacted_and_after_kills() {
    let folder = Folder::new();
    folder.write("cheap.toml", &sweep(SEEDS));
    folder.write("fewer.toml", &sweep(FEWER_SEEDS));
    folder.ends(0, "run fewer.toml --out r --no-reduce");
    folder.ends(0, "compact r");
    folder.ends(0, "run cheap.toml --out r --no-reduce");
    let (mut complete, mut refused, mut kills, mut finished) = (0_u64, 0_u64, 0, 0);
    let before = hash(&folder, "r");
    let kept = folder.contents("r");
    let begin = Instant::now();
    let mut round = 0;
    while finished < 2 {
        // From at once to after the end, which on a busy machine comes after seconds.
        let delay = Duration::from_millis(12 * round * (1 + round / 16));
        round += 1;
        let mut child = folder.start("compact r");
        let started = Instant::now();
        let exit = loop {
            for table in ["slips", "jobs"] {
                match read(&folder.path("r/tables").join(table)) {
                    Some(rows) => {
                        assert_eq!(rows, JOBS, "{table}");
                        complete += 1;
                    }
                    None => refused += 1,
                }
            }
            if let Some(exit) = child.try_wait().unwrap() {
                break Some(exit);
            }
            if started.elapsed() >= delay {
                child.kill().unwrap();
                child.wait().unwrap();
                break None;
            }
        };
        assert!(begin.elapsed() < Duration::from_mins(2), "it does not come to an end");
        kills += u64::from(exit.is_none());
        folder.ends(0, "verify r");
        assert_eq!(read(&folder.path("r/tables/slips")), Some(JOBS));
        if let Some(exit) = exit {
            let mut stderr = String::new();
            child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
            assert!(exit.success(), "{stderr}");
            finished += 1;
        }
        if hash(&folder, "r") != before && finished < 2 {
            // The exchange took place: once more, from the beginning.
            fs::remove_dir_all(folder.path("r")).unwrap();
            for (path, bytes) in &kept {
                let path = folder.path("r").join(path);
                match bytes {
                    None => fs::create_dir_all(path).unwrap(),
                    Some(bytes) => {
                        fs::create_dir_all(path.parent().unwrap()).unwrap();
                        fs::write(path, bytes).unwrap();
                    }
                }
            }
        }
    }
    println!("{kills} kills, {complete} complete reads, {refused} were refused since a file is gone");
    assert!(kills > 3 && complete > 100, "{kills} {complete}");
    folder.ends(0, "compact r");
    assert_eq!(folder.parts("r", "jobs").len(), 2);
    assert!(!folder.path("r/run/staging/compact").exists(), "a full copy of the tables would stay");
}
