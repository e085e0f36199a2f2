//! Work in batch systems: the scripts that submit it, threads that they grant, signals and limits that they set.

use crate::program::{Ended, FAILING, Folder, MANY, PROGRAM, json, wait};
use std::fs;
use std::process::{Child, Command};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Two jobs of a moment.
const SMALL: &str =
    "name = \"small\"\n[model]\nN = 3\nNs = 4\n[axes]\nseed = { count = 2 }\n[record]\nslips = 2\n";
/// A folder that a shell, and Slurm, read only if it is quoted.
const ODD: &str = "it's \"50%\" $HOME";
/// The variables that say how many threads there are.
const VARIABLES: [&str; 5] = [
    "SLURM_CPUS_PER_TASK",
    "OMP_NUM_THREADS",
    "NCPUS",
    "NSLOTS",
    "LSB_DJOB_NUMPROC",
];

/// Runs a command in a folder, with none of the variables but those given.
fn run(folder: &Folder, command: &[&str], environment: &[(&str, &str)]) -> Ended {
    let mut process = Command::new(command[0]);
    process.args(&command[1..]).current_dir(folder.path("."));
    for variable in VARIABLES {
        process.env_remove(variable);
    }
    let output = process.envs(environment.iter().copied()).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ended {
        code: output.status.code(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

/// A folder with a sweep in an odd folder, some of it done, and stand-ins for the commands of batch systems.
fn folder_with_engines() -> Folder {
    let folder = Folder::new();
    fs::create_dir_all(folder.path(ODD)).unwrap();
    fs::create_dir(folder.path("bin")).unwrap();
    let sweep = format!("{ODD}/small sweep.toml");
    folder.write(&sweep, SMALL);
    let ended = run(
        &folder,
        &[
            PROGRAM,
            "run",
            &sweep,
            "--out",
            &format!("{ODD}/out"),
            "--no-reduce",
        ],
        &[],
    );
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    folder.write(&sweep, &SMALL.replace("count = 2", "count = 3"));
    folder.write(
        "bin/sbatch",
        "#!/bin/sh\nprintf '%s\\n' \"$@\" > options\ncat > job\n",
    );
    let hq = "#!/bin/sh\nwhile [ \"$1\" != -- ]; do echo \"$1\"; shift; done\nshift\nexec \"$@\"\n";
    folder.write("bin/hq", hq);
    let ended = run(&folder, &["chmod", "+x", "bin/sbatch", "bin/hq"], &[]);
    assert_eq!(ended.code, Some(0));
    folder
}

/// Prints the script of a sweep in the odd folder, has it checked, and runs it.
fn submit(folder: &Folder, engine: &str, flags: &[&str], options: &[&str]) -> Ended {
    let (sweep, out) = (format!("{ODD}/small sweep.toml"), format!("{ODD}/out"));
    let mut command = vec![
        PROGRAM,
        "batch",
        engine,
        &sweep,
        "--out",
        &out,
        "--workers",
        "40",
        "--threads",
        "2",
    ];
    command.extend_from_slice(flags);
    let before = folder.contents("");
    let printed = run(folder, &command, &[]);
    assert_eq!((printed.code, printed.stderr.as_str()), (Some(0), ""));
    assert!(folder.contents("") == before, "something was written");
    folder.write("script", &printed.stdout);
    let checked = run(folder, &["bash", "-n", "script"], &[]);
    assert_eq!(
        (checked.code, checked.stderr.as_str()),
        (Some(0), ""),
        "{}",
        printed.stdout
    );
    let path = format!(
        "{}:{}",
        folder.path("bin").display(),
        std::env::var("PATH").unwrap()
    );
    let command: Vec<&str> = ["sh", "script"]
        .into_iter()
        .chain(options.iter().copied())
        .collect();
    run(folder, &command, &[("PATH", &path)])
}

#[test]
fn the_script_for_slurm_submits_unchanged_and_its_job_runs_missing_jobs() {
    let folder = folder_with_engines();
    let flags = [
        "--time",
        "1-01:30:00",
        "--",
        "--account=physics",
        "--comment=a \"b\" \\c",
    ];
    let ended = submit(
        &folder,
        "slurm",
        &flags,
        &["--partition=short", "--qos=a b"],
    );
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(
        folder.path(&format!("{ODD}/out/run/batch")).is_dir(),
        "Slurm makes no folder for its logs"
    );
    assert_eq!(
        fs::read_to_string(folder.path("options")).unwrap(),
        "--partition=short\n--qos=a b\n"
    );

    // From a folder beside it, too, the paths are the same.
    let (sweep, out) = (
        format!("../{ODD}/small sweep.toml"),
        format!("../{ODD}/out"),
    );
    let command = [
        PROGRAM,
        "batch",
        "slurm",
        &sweep,
        "--out",
        &out,
        "--workers",
        "40",
        "--threads",
        "2",
    ];
    let mut beside = Command::new(PROGRAM);
    let beside = beside
        .args(&command[1..])
        .args(flags)
        .current_dir(folder.path("bin"))
        .output()
        .unwrap();
    assert_eq!(
        String::from_utf8(beside.stdout).unwrap(),
        fs::read_to_string(folder.path("script")).unwrap()
    );

    let job = fs::read_to_string(folder.path("job")).unwrap();
    let root = folder.path("").display().to_string();
    let output = format!("{root}it's \\\"50%%\\\" $HOME/out/run/batch/%A_%a.log");
    let expected = [
        "--requeue",
        "--open-mode=append",
        "--job-name=small",
        "--array=1-40",
        "--cpus-per-task=2",
        "--time=1530:00",
        &format!("\"--output={output}\""),
        "--signal=B:USR1@15",
        "--account=physics",
        "\"--comment=a \\\"b\\\" \\\\c\"",
    ];
    let directives: Vec<&str> = job
        .lines()
        .filter_map(|line| line.strip_prefix("#SBATCH "))
        .collect();
    assert_eq!(directives, expected);
    let last = job.lines().last().unwrap();
    let odd = ODD.replace('\'', "'\\''");
    let paths = format!(
        " run '{root}{odd}/small sweep.toml' --out '{root}{odd}/out' --worker --walltime 25h28m"
    );
    assert!(
        last.starts_with("exec /") && last.ends_with(&paths),
        "{last}\n{paths}"
    );

    let ended = run(&folder, &["sh", "job"], &[("SLURM_CPUS_PER_TASK", "2")]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(
        ended.stderr.contains("running 1 job, 2 there already"),
        "{}",
        ended.stderr
    );
    assert!(
        ended.stderr.contains("on 2 threads (SLURM_CPUS_PER_TASK)"),
        "{}",
        ended.stderr
    );
}

#[test]
fn more_starts_than_workers_keep_so_many_at_work_until_all_is_done() {
    let folder = folder_with_engines();
    submit(&folder, "slurm", &["--time", "10m", "--starts", "200"], &[]);
    let job = fs::read_to_string(folder.path("job")).unwrap();
    assert!(
        job.contains("\n#SBATCH --array=1-200%40\n") && job.contains("--walltime 9m\n"),
        "{job}"
    );
    assert!(
        !job.contains("--signal"),
        "a warning that may come before the end of the walltime: {job}"
    );
    let ended = submit(
        &folder,
        "hyperqueue",
        &["--time", "10m", "--starts", "200"],
        &[],
    );
    assert!(ended.stdout.contains("--array=1-200\n"), "{}", ended.stdout);
}

#[test]
fn the_script_for_hyperqueue_submits_unchanged_and_its_tasks_run_missing_jobs() {
    let folder = folder_with_engines();
    let flags = ["--time", "4h", "--", "--priority", "3"];
    let ended = submit(&folder, "hyperqueue", &flags, &["--pin=taskset"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let expected = "\
submit
--stdout=%{JOB_ID}_%{TASK_ID}_%{INSTANCE_ID}.out\n--stderr=%{JOB_ID}_%{TASK_ID}_%{INSTANCE_ID}.err
--name=small\n--array=1-40\n--cpus=2\n--time-limit=4h\n--priority\n3\n--pin=taskset\n";
    assert!(ended.stdout.starts_with(expected), "{}", ended.stdout);
    assert!(folder.path(&format!("{ODD}/out/run/batch")).is_dir());
    assert!(
        ended.stderr.contains("running 1 job, 2 there already"),
        "{}",
        ended.stderr
    );
    assert!(ended.stderr.contains("on 2 threads\n"), "{}", ended.stderr);
}

#[test]
fn threads_are_those_that_a_batch_system_grants() {
    let folder = Folder::new();
    folder.write("small.toml", SMALL);
    let start = |out: &str, flags: &[&str], environment: &[(&str, &str)]| {
        let command = [
            &[PROGRAM, "run", "small.toml", "--no-reduce", "--out", out],
            flags,
        ]
        .concat();
        run(&folder, &command, environment)
    };
    let (openmp, slurm) = (("OMP_NUM_THREADS", "3,2"), ("SLURM_CPUS_PER_TASK", "2"));
    let said = |ended: Ended, words: &str| {
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert!(ended.stderr.contains(words), "{words}: {}", ended.stderr);
    };
    said(
        start("flag", &["--threads", "1"], &[slurm]),
        "on 1 thread\n",
    );
    said(
        start("slurm", &[], &[openmp, slurm]),
        "on 2 threads (SLURM_CPUS_PER_TASK)\n",
    );
    said(
        start("openmp", &[], &[openmp, ("HQ_CPUS", "4,5,6")]),
        "on 3 threads (OMP_NUM_THREADS)\n",
    );
    let planned = |flags: &[&str]| {
        let command = [&[PROGRAM, "plan", "small.toml", "--json"], flags].concat();
        json(&run(&folder, &command, &[slurm]).stdout)["threads"].as_u64()
    };
    assert_eq!(planned(&[]), Some(2));
    assert_eq!(planned(&["--threads", "5"]), Some(5));
    let ended = start("bad", &[], &[("NSLOTS", "many")]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(
        ended
            .stderr
            .contains("NSLOTS=many: must be a whole number from 1 to 1024; unset it"),
        "{}",
        ended.stderr
    );
    assert!(!folder.path("bad").exists());
}

/// Sends signals to a program, one directly after the other.
fn send(child: &Child, signals: &[&str]) {
    let commands: Vec<String> = signals
        .iter()
        .map(|signal| format!("kill -{signal} {}", child.id()))
        .collect();
    assert!(
        Command::new("sh")
            .args(["-c", &commands.join(";")])
            .status()
            .unwrap()
            .success()
    );
}

#[test]
fn signals_stop_a_run_and_those_that_warn_a_worker_of_its_end_are_no_failure() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    let run = "run many.toml --no-reduce --out r --threads 1";
    let worker = format!("{run} --worker --walltime 1h");
    let mut parts = 0;
    for (command, signals, expected) in [
        (&worker[..], &["USR1"][..], 0),
        (&worker, &["XCPU", "USR2", "USR2"], 0),
        (&worker, &["INT"], 3),
        (&worker, &["USR1", "TERM", "TERM"], 3),
        (&worker, &["XCPU", "USR2", "INT", "TERM", "USR1"], 3),
        (run, &["USR1"], 3),
    ] {
        let mut child = folder.start(command);
        folder.wait_for_parts("r", parts + 1, &mut child);
        send(&child, signals);
        let (code, _, stderr) = wait(child);
        assert_eq!(code, Some(expected), "{command}, {signals:?}: {stderr}");
        assert!(
            stderr.contains("The same command resumes."),
            "{command}, {signals:?}: {stderr}"
        );
        let kept = folder.parts("r", "jobs").len();
        assert!(kept > parts, "{command}, {signals:?}");
        parts = kept;
    }
    let mut child = folder.start(&worker);
    folder.wait_for_parts("r", parts + 1, &mut child);
    send(&child, &["INT", "INT"]);
    assert_eq!(wait(child).0, Some(3), "a second Ctrl-C exits at once");
    let ended = folder.ends(0, &worker);
    assert!(
        !ended.stderr.contains("28000 jobs"),
        "parts were kept: {}",
        ended.stderr
    );
}

/// As many points as a sweep may have: the walk over them alone takes seconds.
const LONG_PLAN: &str = "\
name = \"long\"
[model]
N = 1
Ns = 1
[axes]
seed = { count = 10000000 }
[record]
slips = 1
";

#[test]
fn ten_million_jobs_are_planned_in_seconds_and_in_constant_memory() {
    let folder = Folder::new();
    folder.write("long.toml", LONG_PLAN);
    let begin = Instant::now();
    // What the program maps at its start, and 16 bytes for each job: a job has 200.
    let limited = format!("ulimit -v 250000 && exec {PROGRAM} plan long.toml --json");
    let planned = run(&folder, &["sh", "-c", &limited], &[]);
    assert_eq!(planned.code, Some(0), "{}", planned.stderr);
    assert_eq!(json(&planned.stdout)["jobs"], 10_000_000);
    assert!(
        begin.elapsed() < Duration::from_mins(1),
        "{:?}",
        begin.elapsed()
    );
}

#[test]
fn a_signal_while_a_run_plans_stops_it_before_its_first_job() {
    let folder = Folder::new();
    folder.write("long.toml", LONG_PLAN);
    let child = folder.start("run long.toml --out r");
    sleep(Duration::from_millis(500));
    send(&child, &["TERM"]);
    let (code, _, stderr) = wait(child);
    assert_eq!(code, Some(3), "{stderr}");
    assert!(folder.parts("r", "jobs").is_empty(), "{stderr}");
}

#[test]
fn a_worker_that_is_warned_before_it_has_finished_a_job_has_failed() {
    let folder = Folder::new();
    // Nor does a job end where the slider slides.
    folder.write(
        "long.toml",
        &SMALL.replace("slips = 2", "slips = 10000000\ngive_up_after = 1e9"),
    );
    let mut child = folder.start("run long.toml --no-reduce --out r --worker");
    let has_begun = || {
        folder
            .path("r/run/log")
            .read_dir()
            .is_ok_and(|mut logs| logs.next().is_some())
    };
    while !has_begun() && child.try_wait().unwrap().is_none() {
        sleep(Duration::from_millis(1));
    }
    send(&child, &["USR1"]);
    let (code, _, stderr) = wait(child);
    assert_eq!(code, Some(3), "{stderr}");
}

#[test]
fn a_worker_whose_time_is_over_ends_well() {
    let folder = Folder::new();
    folder.write(
        "many.toml",
        &MANY.replace("count = 28000", "count = 3000000"),
    );
    folder.ends(3, "run many.toml --no-reduce --out r --walltime 3s");
    // A slow machine may need longer for a part.
    let mut seconds = 3;
    let ended = loop {
        let before = folder.parts("r", "jobs").len();
        let ended = folder.run(&format!(
            "run many.toml --no-reduce --out r --worker --walltime {seconds}s"
        ));
        let has_parts = folder.parts("r", "jobs").len() > before;
        let expected = if has_parts { 0 } else { 3 };
        assert_eq!(ended.code, Some(expected), "{}", ended.stderr);
        if has_parts {
            break ended;
        }
        seconds *= 2;
        assert!(seconds < 100, "no part: {}", ended.stderr);
    };
    assert!(ended.stderr.contains("stopped with"), "{}", ended.stderr);
    let nothing = folder.ends(
        3,
        "run many.toml --no-reduce --out r --worker --walltime 0.501s",
    );
    assert!(
        nothing.stderr.contains("give a longer --walltime"),
        "{}",
        nothing.stderr
    );
    folder.write("failing.toml", FAILING);
    folder.ends(1, "run failing.toml --no-reduce --out failing --worker");
}

#[test]
fn a_limit_on_the_size_of_files_is_an_error_of_the_disk() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    let limited = format!("ulimit -f 8; exec {PROGRAM} run many.toml --no-reduce --out r");
    let ended = run(&folder, &["sh", "-c", &limited], &[]);
    assert_eq!(ended.code, Some(3), "{}", ended.stderr);
    assert!(ended.stderr.contains("File too large"), "{}", ended.stderr);
    folder.ends(0, "run many.toml --out r");
    for command in [
        "reduce r",
        "report r -o page.html",
        "export r -o exported",
        "plot r --x V0 --y tau_mean -o a.png",
        "simulate --slips 40 --trace a.parquet",
        "simulate --slips 4 --plot a.svg",
    ] {
        let limited = format!("ulimit -f 2; exec {PROGRAM} {command}");
        let ended = run(&folder, &["sh", "-c", &limited], &[]);
        assert_eq!(ended.code, Some(3), "{command}: {}", ended.stderr);
        assert!(ended.stderr.contains("File too large"), "{}", ended.stderr);
    }
}

#[test]
fn the_commands_of_the_page_on_clusters_are_right() {
    let page =
        fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/clusters.md")).unwrap();
    let folder = Folder::new();
    let mut commands = 0;
    for block in page.split("```sh\n").skip(1) {
        let block = block.split("```").next().unwrap();
        folder.write("block", block);
        assert_eq!(
            run(&folder, &["bash", "-n", "block"], &[]).code,
            Some(0),
            "{block}"
        );
        for line in block.lines() {
            let Some((_, command)) = line.split_once("stickslip ") else {
                continue;
            };
            let end = command.find(['>', '#', '"']).unwrap_or(command.len());
            let words = command[..end].split(" -- ").next().unwrap();
            // With --help, what precedes it is parsed, and nothing is done.
            folder.ends(0, &format!("{words} --help"));
            commands += 1;
        }
    }
    assert!(commands >= 8, "{commands}");
}
