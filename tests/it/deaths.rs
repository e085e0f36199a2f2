//! Jobs that end the process which runs them, in the built program: they are named, and all others are done.
#![cfg(target_os = "linux")]

use crate::program::{Ended, Folder, PROGRAM, json, wait};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// 92 small jobs, and four that take 0.70 GB: more than 0.51 GB in any case, and 0.726 GB as predicted.
const BIG: &str = "\
name = \"big\"
[model]
Ns = 226
[axes]
N = [3, 20000, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25]
seed = { count = 4 }
[record]
slips = 1
discard = 0
max_time = 1e-3
";
/// kB of address space: less than a big job takes in any case, and less than it takes.
const FORBIDDEN: &str = "ulimit -v 450000";
const TOO_LITTLE: &str = "ulimit -v 640000";

/// Starts the program where a shell has set a limit.
fn start_within(folder: &Folder, limit: &str, arguments: &str) -> Child {
    Command::new("sh")
        .args(["-c", &format!("{limit} && exec {PROGRAM} {arguments}")])
        .current_dir(folder.path(""))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn run_within(folder: &Folder, limit: &str, arguments: &str) -> Ended {
    let (code, stdout, stderr) = wait(start_within(folder, limit, arguments));
    Ended {
        code,
        stdout,
        stderr,
    }
}

/// Jobs that are done, failed and missing.
fn counts(folder: &Folder, directory: &str) -> [u64; 3] {
    let status = json(&folder.run(&format!("status {directory} --json")).stdout);
    ["jobs_done", "jobs_failed", "jobs_missing"].map(|key| status[key].as_u64().unwrap())
}

/// All big jobs are rows with their reason, and run again without a limit.
fn assert_forbidden(folder: &Folder, directory: &str) {
    assert_eq!(counts(folder, directory), [92, 4, 0]);
    let status = folder.ends(1, &format!("status {directory}")).stdout;
    let lines: Vec<_> = status
        .lines()
        .filter(|line| line.starts_with("failed"))
        .collect();
    assert_eq!(lines.len(), 4, "{status}");
    for line in lines {
        assert!(line.contains(": memory: needs at least 508 MB, "), "{line}");
        assert!(
            line.contains(" allowed here; run it again where more is allowed"),
            "{line}"
        );
    }
    let again = json(
        &folder
            .ends(0, &format!("run {directory} --no-reduce --json"))
            .stdout,
    );
    assert_eq!(again["jobs_run"].as_u64(), Some(4));
}

/// All big jobs are named with what is known of them, and done without a limit.
fn assert_named(folder: &Folder, directory: &str) {
    assert_eq!(counts(folder, directory), [92, 0, 4]);
    let status = folder.ends(0, &format!("status {directory}")).stdout;
    let lines: Vec<_> = status
        .lines()
        .filter(|line| line.starts_with("deaths  part-"))
        .collect();
    assert!(!lines.is_empty(), "{status}");
    for line in lines {
        assert!(
            line.contains("; jobs: 1; predicted memory of a job: 726 MB"),
            "{line}"
        );
    }
    assert!(
        status.contains("stickslip simulate --set N=20000 --set Ns=226"),
        "{status}"
    );
    folder.ends(0, &format!("run {directory} --no-reduce"));
    let claims = folder.contents(&format!("{directory}/run/claims"));
    assert!(claims.is_empty(), "{:?}", claims.keys());
}

fn whole(folder: &Folder) {
    folder.write("big.toml", BIG);
    folder.ends(0, "run big.toml --no-reduce --out whole");
}

#[test]
fn what_a_hard_limit_of_memory_forbids_becomes_rows_and_all_others_are_done() {
    let folder = Folder::new();
    whole(&folder);
    for _ in 0..6 {
        let ended = run_within(&folder, FORBIDDEN, "run big.toml --out r --threads 2");
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    }
    let workers: Vec<_> = (0..3)
        .map(|_| {
            start_within(
                &folder,
                FORBIDDEN,
                "run big.toml --out shared --worker --threads 2",
            )
        })
        .collect();
    let ended: Vec<_> = workers.into_iter().map(wait).collect();
    assert!(ended.iter().all(|(code, ..)| code.is_some()), "{ended:?}");
    for directory in ["r", "shared"] {
        assert_forbidden(&folder, directory);
        assert!(
            folder.tables(directory) == folder.tables("whole"),
            "{directory}"
        );
    }
}

#[test]
fn jobs_that_end_their_process_for_lack_of_memory_stop_no_others_and_are_named() {
    let folder = Folder::new();
    whole(&folder);
    for start in 0..6 {
        let ended = run_within(&folder, TOO_LITTLE, "run big.toml --out r --threads 2");
        assert_eq!(ended.code, None, "start {start}: {}", ended.stderr);
        assert_eq!(counts(&folder, "r"), [92, 0, 4], "start {start}");
    }
    let claims = folder.contents("r/run/claims").into_iter();
    let of_parts = claims.filter(|(claim, _)| claim.to_string_lossy().starts_with("part-000-"));
    let missing: BTreeSet<_> = of_parts.map(|(_, worker)| worker).collect();
    assert_eq!(missing.len(), 6, "{missing:?}");
    // Six deaths at four parts, of which a second one is named. A worker that starts late may find nothing to do.
    let mut deaths = 0;
    for _ in 0..6 {
        let workers: Vec<_> = (deaths..6)
            .take(3)
            .map(|_| start_within(&folder, TOO_LITTLE, "run big.toml --out shared --threads 2"))
            .collect();
        let ended: Vec<_> = workers.into_iter().map(wait).collect();
        deaths += ended.iter().filter(|(code, ..)| code.is_none()).count();
    }
    assert_eq!(deaths, 6);
    for directory in ["r", "shared"] {
        assert_named(&folder, directory);
        assert!(
            folder.tables(directory) == folder.tables("whole"),
            "{directory}"
        );
    }
}

#[test]
fn a_run_ends_in_order_under_any_hard_limit_and_what_plan_says_is_enough() {
    let folder = Folder::new();
    let small = BIG.replace("N = [3, 20000, ", "N = [3, ");
    folder.write("small.toml", &small);
    for threads in [1, 3] {
        let plan = format!("plan small.toml --json --threads {threads}");
        let plan = json(&folder.ends(0, &plan).stdout);
        let enough = plan["address_space_bytes"].as_f64().unwrap();
        for (share, code) in [(1.0, 0), (0.75, 2), (0.3, 2)] {
            let limit = format!("ulimit -v {:.0}", (share * enough / 1024.0).ceil());
            let command = format!("run small.toml --out r{threads} --threads {threads}");
            let ended = run_within(&folder, &limit, &command);
            assert_eq!(ended.code, Some(code), "{limit}: {ended:?}");
            let problem = format!("too little memory: --threads {threads} may take ");
            assert_eq!(ended.stderr.contains(&problem), code == 2, "{ended:?}");
        }
    }
    let ended = run_within(&folder, "ulimit -d 60000", "run small.toml --threads 3");
    assert!(
        ended.stderr.contains(" more of data, `ulimit -d`"),
        "{ended:?}"
    );
    let ended = run_within(&folder, "ulimit -v 150000", "accuracy --threads 2");
    assert!(ended.stderr.contains("too little memory"), "{ended:?}");
}

/// A control group with a limit of memory, where this process may make one.
struct Group(PathBuf);

impl Group {
    fn new(bytes: u64) -> Option<Self> {
        let name = format!("stickslip-test-{}-{bytes}", std::process::id());
        let limits = [
            ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
            ("/sys/fs/cgroup", "memory.max"),
        ];
        limits.into_iter().find_map(|(mount, file)| {
            let mount = PathBuf::from(mount);
            let is_mounted = mount.join("cgroup.procs").exists();
            let group = Self(mount.join(&name));
            fs::create_dir(&group.0).ok().filter(|()| is_mounted)?;
            fs::write(group.0.join(file), bytes.to_string()).ok()?;
            Some(group)
        })
    }

    fn limit(&self) -> String {
        format!("echo $$ > {}", self.0.join("cgroup.procs").display())
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        let begin = Instant::now();
        while fs::remove_dir(&self.0).is_err() && begin.elapsed() < Duration::from_secs(5) {
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

#[test]
fn a_control_group_forbids_jobs_and_one_that_kills_them_stops_no_others() {
    let groups = [Group::new(400_000_000), Group::new(600_000_000)];
    let [Some(forbidden), Some(too_little)] = groups else {
        println!("skipped: no control group can be made here");
        return;
    };
    let folder = Folder::new();
    whole(&folder);
    let ended = run_within(
        &folder,
        &forbidden.limit(),
        "run big.toml --out r --threads 2",
    );
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    assert_forbidden(&folder, "r");
    for start in 0..6 {
        let ended = run_within(
            &folder,
            &too_little.limit(),
            "run big.toml --out s --threads 2",
        );
        assert_eq!(ended.code, None, "start {start}: {}", ended.stderr);
        assert_eq!(counts(&folder, "s"), [92, 0, 4], "start {start}");
    }
    assert_named(&folder, "s");
    for directory in ["r", "s"] {
        assert!(
            folder.tables(directory) == folder.tables("whole"),
            "{directory}"
        );
    }
}

/// Four jobs that take a while, each a part, and others that take none.
const LONG_FIRST: &str = "\
name = \"long\"
[[axes.zip]]
N = [100, 3, 4, 5, 6, 7, 8, 9]
Ns = [100, 2, 2, 2, 2, 2, 2, 2]
[axes]
seed = { count = 4 }
[record]
slips = 2
[solver]
tolerance = 1e-6
";

#[test]
fn a_part_whose_process_is_killed_each_time_stops_no_others_and_is_done_once_none_is_killed() {
    let folder = Folder::new();
    folder.write("long.toml", LONG_FIRST);
    folder.ends(0, "run long.toml --no-reduce --out whole");
    // The claim of this process: those that were killed have left theirs.
    let is_at_the_first = |process: u32| {
        let claims = fs::read_dir(folder.path("r/run/claims"));
        claims.into_iter().flatten().flatten().any(|claim| {
            let name = claim.file_name().into_string().unwrap();
            let worker = fs::read_to_string(claim.path()).unwrap_or_default();
            name.starts_with("part-000-000000.") && worker.contains(&format!("-{process}-"))
        })
    };
    let begin = Instant::now();
    for death in 1..=6 {
        let mut child = folder.start("run long.toml --no-reduce --out r --threads 1");
        while !is_at_the_first(child.id()) {
            assert!(child.try_wait().unwrap().is_none());
            assert!(begin.elapsed() < Duration::from_mins(1));
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().unwrap();
        assert_eq!(wait(child).0, None);
        let status = folder.ends(0, "status r").stdout;
        // One kill is no news of the parts that were taken; a second one at the same part is.
        let lines = status.lines().filter(|line| line.starts_with("deaths"));
        assert!(death > 1 || lines.count() == 1, "{status}");
        let named = format!("deaths  part-000-000000: deaths of workers: {death};");
        assert_eq!(status.contains(&named), death > 1, "{status}");
    }
    assert_eq!(counts(&folder, "r"), [31, 0, 1]);
    let status = folder.ends(0, "status r").stdout;
    let deaths = "deaths  part-000-000000: deaths of workers: 6; jobs: 1;";
    assert!(status.contains(deaths), "{status}");
    folder.ends(0, "run long.toml --no-reduce --out r");
    assert!(folder.tables("r") == folder.tables("whole"));
    assert!(folder.contents("r/run/claims").is_empty());
}

#[test]
fn a_worker_of_the_original_is_none_of_a_copy() {
    let folder = Folder::new();
    folder.write("long.toml", &LONG_FIRST.replace("slips = 2", "slips = 300"));
    let mut child = folder.start("run long.toml --no-reduce --out r --threads 1");
    while !folder.path("r/run/log").exists() {
        assert!(child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(2));
    }
    // A beat may take a file from under it.
    let mut copy = Command::new("cp");
    copy.args(["-a", "r", "copy"]).current_dir(folder.path(""));
    copy.status().unwrap();
    let workers = |directory: &str| {
        let status = json(&folder.run(&format!("status {directory} --json")).stdout);
        status["workers"].as_array().unwrap().len()
    };
    assert_eq!([workers("r"), workers("copy")], [1, 0]);
    let other = LONG_FIRST.replace("count = 4", "count = 1");
    folder.write("other.toml", &other.replace("slips = 2", "slips = 300"));
    // One that works at another sweep would be refused beside a worker.
    let beside = folder.ends(2, "run other.toml --no-reduce --out r");
    assert!(
        beside.stderr.contains("for another sweep file"),
        "{}",
        beside.stderr
    );
    let ended = folder.ends(3, "run other.toml --no-reduce --out copy --walltime 1.5s");
    assert!(ended.stderr.contains("stopped with"), "{}", ended.stderr);
    assert!(child.try_wait().unwrap().is_none(), "it goes on");
    child.kill().unwrap();
    wait(child);
}
