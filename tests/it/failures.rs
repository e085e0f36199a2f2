//! Jobs that fail, in the built program: they stop no other, are reported with their reason, and can be run again
//! alone.

use crate::program::{FAILING, Folder, json};
use std::collections::BTreeMap;
use std::path::Path;
use stickslip::sweep::Sweep;

/// Each second job is poison: too stiff for the clock, too many events.
const POISON: &str = "\
name = \"poison\"
[model]
Ns = 4
Delta = 1e-6
[[axes.zip]]
N = [3, 3, 3, 30]
K = [1e8, 1e30, 1e8, 1e8]
dfs = [6.9e-3, 6.9e-3, 6.8e-3, 6.9e-3]
[axes]
eta = [3, 7]
[record]
slips = 2
discard = 0
max_events = 400
max_time = 7.5
precursor_size = 3
[solver]
tolerance = 3e-7
";

#[test]
fn a_failing_job_becomes_a_row_with_its_reason_and_the_others_continue() {
    let folder = Folder::new();
    folder.write("failing.toml", FAILING);
    folder.screens(
        "failed_jobs",
        [
            "run failing.toml --out r --threads 1",
            "status r",
            "reduce r",
        ],
    );
    let jobs = folder.table("r", "jobs");
    assert_eq!(jobs.counts("N"), [1, 1, 2, 2, 30, 30]);
    assert_eq!(
        jobs.texts("outcome"),
        ["done", "done", "done", "done", "failed", "failed"]
    );
    assert_eq!(jobs.texts("reason")[..4], [""; 4]);
    assert_eq!(jobs.counts("slips"), [2; 4]);

    let status = json(&folder.ends(1, "status r --json").stdout);
    assert_eq!(
        (status["jobs_done"].as_u64(), status["jobs_failed"].as_u64()),
        (Some(4), Some(2))
    );
    assert_eq!(
        json(&folder.ends(1, "reduce r --json").stdout)["failed_jobs"].as_u64(),
        Some(2)
    );
    let before = folder.tables("r");
    let again = json(
        &folder
            .ends(1, "run failing.toml --out r --no-reduce --json")
            .stdout,
    );
    assert_eq!(
        (again["jobs_run"].as_u64(), again["jobs_failed"].as_u64()),
        (Some(0), Some(2))
    );
    let retried = json(
        &folder
            .ends(
                1,
                "run failing.toml --out r --no-reduce --json --retry-failed",
            )
            .stdout,
    );
    assert_eq!(
        (
            retried["jobs_run"].as_u64(),
            retried["jobs_failed"].as_u64()
        ),
        (Some(2), Some(2))
    );
    assert!(folder.tables("r") == before);
}

#[test]
fn a_poison_job_is_reported_as_a_command_that_fails_in_the_same_way() {
    let folder = Folder::new();
    folder.write("poison.toml", POISON);
    let ended = folder.ends(1, "run poison.toml --out r");
    let jobs = folder.table("r", "jobs");
    let outcomes = jobs.texts("outcome");
    assert_eq!(
        outcomes
            .iter()
            .filter(|outcome| **outcome == "failed")
            .count(),
        4,
        "{outcomes:?}"
    );
    let reasons: BTreeMap<&str, &str> = jobs
        .texts("job_id")
        .into_iter()
        .zip(jobs.texts("reason"))
        .collect();
    for part in ["is lost in the resolution", "400 contact events"] {
        assert!(
            reasons.values().any(|reason| reason.contains(part)),
            "{reasons:?}"
        );
    }

    let failures = json(&folder.ends(1, "status r --json").stdout)["failures"]
        .as_array()
        .unwrap()
        .clone();
    let status_report = folder.ends(1, "status r").stdout;
    assert_eq!(failures.len(), 4);
    for failure in &failures {
        let [job_id, reason, command] =
            ["job_id", "reason", "command"].map(|key| failure[key].as_str().unwrap());
        assert_eq!(reasons[job_id], reason);
        for report in [&ended.stderr, &status_report] {
            assert!(
                report.contains(job_id) && report.contains(&format!("alone: {command}\n")),
                "{report}"
            );
        }
        let alone = folder.ends(1, command.strip_prefix("stickslip ").unwrap());
        assert_eq!(alone.stderr, format!("error: {reason}\n"), "{command}");
    }
}

#[test]
fn of_many_failures_the_first_are_listed_and_all_counted_by_reason() {
    let folder = Folder::new();
    let text = "name = \"flood\"\n[model]\nN = 2\nNs = 4\n[axes]\nV0 = { log = [1e-5, 1e-4], points = 30 }\n\
                seed = { count = 20 }\n[record]\nslips = 5\nmax_events = 10\n";
    folder.write("flood.toml", text);
    folder.screens(
        "many_failed_jobs",
        [
            "run flood.toml --out r --no-reduce --threads 1",
            "status r",
            // A run that finds them there counts none of its own.
            "run flood.toml --out r --no-reduce",
        ],
    );
    let reasons = json(&folder.ends(1, "status r --json").stdout)["failure_reasons"].clone();
    let counts: Vec<_> = reasons.as_object().unwrap().values().collect();
    assert_eq!(counts, [600]);
}

#[test]
fn the_command_of_a_job_is_that_job() {
    let folder = Folder::new();
    let sweeps = [
        POISON.to_owned(),
        "name = \"plain\"\n[axes]\nN = [3, 70]\nbreak_on = [\"magnitude\", \"tension\"]\n[record]\nslips = 1\n".to_owned(),
        "name = \"fixed\"\n[model]\nN = 2\n[axes]\nV0 = { log = [1e-4, 3e-4], points = 3 }\nseed = { count = 2, first = 5 }\n\
         [record]\nslips = 1\n[solver]\nmethod = \"fixed-step\"\ndt = 1.7e-6\n"
            .to_owned(),
    ];
    for text in sweeps {
        let sweep = Sweep::parse(&text, Path::new("sweep.toml")).unwrap();
        let mut compared = 0;
        for job in sweep.jobs_of_grid() {
            let command = sweep.command(&job);
            let ended = folder.run(&format!(
                "{} --json",
                command.strip_prefix("stickslip ").unwrap()
            ));
            // The poison among them names no id.
            if ended.code == Some(0) {
                compared += 1;
                let job_id = sweep.job_id(&job.parameters);
                assert_eq!(
                    json(&ended.stdout)["job_id"].as_str(),
                    Some(job_id.as_str()),
                    "{command}"
                );
            }
        }
        assert!(compared >= 4, "{text}");
    }
}

/// Where another disk is to be had: memory.
#[test]
#[cfg(target_os = "linux")]
fn a_folder_of_results_on_another_disk_is_refused_before_anything_is_computed() {
    use std::fs;
    use std::os::linux::fs::MetadataExt;
    let folder = Folder::new();
    let Ok(elsewhere) = tempfile::tempdir_in("/dev/shm") else {
        return;
    };
    let disk = |path: &Path| path.metadata().unwrap().st_dev();
    if disk(elsewhere.path()) == disk(&folder.path("")) {
        return;
    }
    folder.write(
        "tiny.toml",
        "name = \"tiny\"\n[model]\nN = 2\nNs = 1\n[record]\nslips = 2\n",
    );
    for place in [
        "tables",
        "tables/slips",
        "tables/jobs",
        "reduced",
        "figures",
        "run/spill",
    ] {
        folder.ends(0, "run tiny.toml --out r");
        let path = folder.path("r").join(place);
        let _ = fs::remove_dir_all(&path);
        std::os::unix::fs::symlink(elsewhere.path(), &path).unwrap();
        let error = folder.ends(2, "run tiny.toml --out r").stderr;
        assert!(
            error.contains(&format!("r/{place}: is on another disk")),
            "{place}: {error}"
        );
        fs::remove_dir_all(folder.path("r")).unwrap();
    }
    assert!(elsewhere.path().read_dir().unwrap().next().is_none());
}
