//! Whole runs of the built program: where results lie, that interruptions, threads, shards and extensions leave no
//! trace in them, and what exit codes say.

use crate::program::{Cell, FAILING, Folder, MANY, MANY_PARTS, json, wait};
use std::collections::BTreeSet;
use std::fs;
use std::time::{Duration, SystemTime};

/// Modulated and not, two velocities, two seeds, with precursors: 12 jobs, which differ in everything that is measured.
const TINY: &str = "\
name = \"tiny\"
[model]
N = 9
[axes]
V0 = [1e-4, 2e-4]
Delta = [0, 1e-6]
frequency = [29, 58]
seed = { count = 2 }
[record]
slips = 4
precursors = true
";
/// Jobs of [`TINY`]: without modulation one frequency stands for both.
const TINY_JOBS: u64 = 12;

/// Every row of every table, all columns, by job and slip.
fn sorted_rows(folder: &Folder, directory: &str) -> Vec<Vec<Vec<Cell>>> {
    vec![
        folder
            .table(directory, "slips")
            .sorted_by(&["job_id", "slip"]),
        folder
            .table(directory, "precursors")
            .sorted_by(&["job_id", "slip", "precursor"]),
        folder.table(directory, "jobs").sorted_by(&["job_id"]),
    ]
}

#[test]
fn a_run_ends_with_tables_reduced_data_and_figures_and_a_second_one_changes_nothing() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    let plan = json(&folder.ends(0, "plan tiny.toml --json").stdout);
    assert_eq!(
        (plan["jobs"].as_u64(), plan["format"].as_u64()),
        (Some(TINY_JOBS), Some(2))
    );
    // Of a job's contacts, blocks and slips, and of the slips of a part, which here is a job.
    assert_eq!(
        plan["thread_memory_bytes"].as_f64(),
        Some(155.0 * (9.0 * 20.0) + 1250.0 * 9.0 + 600.0 * (4.0 + 4.0))
    );
    assert_eq!(folder.contents("").len(), 1, "a plan writes nothing");

    folder.ends(0, "run tiny.toml");
    let before = folder.contents("results/tiny");
    let there: Vec<&str> = before
        .iter()
        .filter(|(_, bytes)| bytes.is_some())
        .map(|(p, _)| p.to_str().unwrap())
        .collect();
    for file in [
        "tables/slips/part-000-000000.parquet",
        "tables/precursors/part-000-000000.parquet",
        "tables/jobs/part-000-000000.parquet",
        "reduced/sets.parquet",
        "reduced/histograms.parquet",
        "reduced/backbone.parquet",
        "reduced/points.parquet",
        "figures/phi-eta.svg",
        "figures/phi-eta.png",
        "figures/tau-T.svg",
        "figures/tau-T.png",
        "run/extension-000.json",
    ] {
        assert!(there.contains(&file), "{file} is not in {there:?}");
    }
    let in_folder = |folder: &str| there.iter().filter(|file| file.starts_with(folder)).count();
    let is_result = |file: &&&str| !file.starts_with("run/") && !file.starts_with("tables/");
    assert_eq!(in_folder("reduced/"), 4, "{there:?}");
    assert_eq!(
        there.iter().filter(is_result).count(),
        4 + in_folder("figures/"),
        "{there:?}"
    );
    // Few jobs are parts of their own.
    assert_eq!(folder.parts("results/tiny", "jobs").len() as u64, TINY_JOBS);
    assert!(
        !there.iter().any(|file| file.starts_with("run/staging")),
        "{there:?}"
    );
    assert_eq!(
        folder.table("results/tiny", "jobs").cells.len() as u64,
        TINY_JOBS
    );
    assert_eq!(
        folder.table("results/tiny", "slips").cells.len() as u64,
        4 * TINY_JOBS
    );

    folder.ends(0, "run tiny.toml");
    assert!(folder.contents("results/tiny") == before);
}

#[test]
fn tables_do_not_depend_on_threads() {
    let folder = Folder::new();
    for (name, text) in [("tiny", TINY), ("many", MANY)] {
        folder.write("sweep.toml", text);
        for threads in [1, 2] {
            let out = format!("{name}-{threads}");
            folder.ends(
                0,
                &format!("run sweep.toml --no-reduce --threads {threads} --out {out}"),
            );
        }
        let [one, two] = [1, 2].map(|threads| format!("{name}-{threads}"));
        // Every column of every row, bit by bit; and what is more, the files.
        assert!(
            sorted_rows(&folder, &one) == sorted_rows(&folder, &two),
            "{name}"
        );
        assert!(folder.tables(&one) == folder.tables(&two), "{name}");
    }
    assert_eq!(folder.parts("many-1", "jobs").len(), MANY_PARTS);
    assert!(!folder.table("tiny-1", "precursors").cells.is_empty());
}

#[test]
fn an_extended_axis_runs_its_new_jobs_alone() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    folder.ends(0, "run tiny.toml --no-reduce --out grown");
    let before = folder.tables("grown");
    folder.write("tiny.toml", &TINY.replace("count = 2", "count = 3"));
    let report = json(
        &folder
            .ends(0, "run tiny.toml --no-reduce --out grown --json")
            .stdout,
    );
    assert_eq!(report["jobs_run"].as_u64(), Some(TINY_JOBS / 2));
    let after = folder.tables("grown");
    assert!(
        before
            .iter()
            .all(|(path, bytes)| after.get(path) == Some(bytes))
    );
    assert_eq!(
        json(&folder.ends(0, "status grown --json").stdout)["jobs_kept"].as_u64(),
        Some(0)
    );
    folder.ends(0, "run tiny.toml --no-reduce --out at-once");
    assert!(sorted_rows(&folder, "grown") == sorted_rows(&folder, "at-once"));
}

#[test]
fn values_that_a_sweep_no_longer_has_keep_their_data_and_the_status_says_so() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    folder.ends(0, "run tiny.toml --no-reduce --out r");
    let before = folder.tables("r");
    folder.write(
        "tiny.toml",
        &TINY.replace("V0 = [1e-4, 2e-4]", "V0 = [2e-4]"),
    );
    let report = json(
        &folder
            .ends(0, "run tiny.toml --no-reduce --out r --json")
            .stdout,
    );
    assert_eq!(
        (report["jobs_run"].as_u64(), report["jobs_left"].as_u64()),
        (Some(0), Some(0))
    );
    assert!(folder.tables("r") == before);
    let status = json(&folder.ends(0, "status r --json").stdout);
    assert_eq!(
        (status["jobs_done"].as_u64(), status["jobs_kept"].as_u64()),
        (Some(TINY_JOBS), Some(TINY_JOBS / 2))
    );
    folder.screens("status_of_values_kept", ["status r", "show r"]);
}

#[cfg(unix)]
#[test]
fn ctrl_c_and_sigterm_keep_what_is_done_and_the_next_run_makes_the_same_tables() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    folder.ends(0, "run many.toml --no-reduce --out whole");
    let whole = folder.tables("whole");
    for signal in ["INT", "TERM"] {
        // One thread, so that on a machine with many cores there is a middle, too.
        let command = format!("run many.toml --no-reduce --threads 1 --out {signal}");
        let mut child = folder.start(&command);
        folder.wait_for_parts(signal, 2, &mut child);
        let sent = std::process::Command::new("sh")
            .args(["-c", &format!("kill -{signal} {}", child.id())])
            .status();
        assert!(sent.unwrap().success());
        let (code, stdout, stderr) = wait(child);
        assert_eq!(code, Some(3), "{signal}: {stderr}");
        assert!(stderr.contains("The same command resumes."), "{stderr}");
        assert!(stdout.starts_with("jobs run"), "{stdout}");

        let kept = folder.tables(signal);
        assert!(
            (2..MANY_PARTS).contains(&folder.parts(signal, "jobs").len()),
            "it was to be stopped in the middle"
        );
        assert!(
            kept.iter()
                .all(|(path, bytes)| whole.get(path) == Some(bytes))
        );
        let times = folder.written(signal);
        let status = json(&folder.ends(0, &format!("status {signal} --json")).stdout);
        assert_eq!(
            status["parts_done"].as_u64(),
            Some(folder.parts(signal, "jobs").len() as u64)
        );
        assert!(status["jobs_missing"].as_u64() > Some(0));
        // Every command counts the same jobs as in unfinished parts and as missing.
        let reports = [
            json(
                &folder
                    .ends(0, &format!("export {signal} -o {signal}-exported --json"))
                    .stdout,
            ),
            json(&folder.ends(3, &format!("verify {signal} --json")).stdout),
            json(
                &folder
                    .ends(0, &format!("plan many.toml --out {signal} --json"))
                    .stdout,
            )["directory"]
                .clone(),
        ];
        for key in ["jobs_spilled", "jobs_missing", "parts_missing"] {
            for report in reports.iter().filter(|report| !report[key].is_null()) {
                assert_eq!(report[key], status[key], "{key}: {report}");
            }
        }
        let sum: u64 = ["jobs_done", "jobs_spilled", "jobs_failed", "jobs_missing"]
            .iter()
            .map(|key| status[key].as_u64().unwrap())
            .sum();
        assert_eq!(sum, 28_000, "{status}");
        let spilled = match status["jobs_spilled"].as_u64().unwrap() {
            0 => String::new(),
            spilled => format!(", {spilled} in unfinished parts"),
        };
        let words = format!(
            "{} jobs missing{spilled}; stickslip run",
            status["jobs_missing"]
        );
        let said = folder.ends(0, &format!("show {signal}")).stdout;
        assert!(
            said.contains(&format!("so far: {words}")),
            "{words}: {said}"
        );
        let said = folder.ends(0, &format!("reduce {signal}")).stderr;
        assert!(
            said.contains(&format!("reduced what is there: {words}")),
            "{words}: {said}"
        );

        folder.ends(0, &command);
        assert!(folder.tables(signal) == whole, "{signal}");
        let times_after = folder.written(signal);
        assert!(
            times.iter().all(|(path, time)| times_after[path] == *time),
            "a committed part was written again"
        );
    }
}

#[test]
fn the_status_counts_what_is_there_for_people_and_for_programs() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    folder.ends(0, "run many.toml --no-reduce --out r");
    for table in ["jobs", "slips"] {
        fs::remove_file(&folder.parts("r", table)[3]).unwrap();
    }
    let status = json(&folder.ends(0, "status r --json").stdout);
    let count = |key: &str| status[key].as_u64().unwrap();
    assert_eq!(
        (status["name"].as_str(), count("format")),
        (Some("many"), 3)
    );
    assert_eq!(
        (
            count("jobs_done"),
            count("jobs_failed"),
            count("jobs_missing")
        ),
        (28_000 - 437, 0, 437)
    );
    assert_eq!(
        (count("parts_done"), count("parts_missing")),
        (MANY_PARTS as u64 - 1, 1)
    );
    assert!(
        status["time_left"].as_f64() > Some(0.0)
            && status["workers"].as_array().unwrap().is_empty()
    );
    folder.screens("status_of_a_lost_part", ["status r", "verify r"]);
}

#[test]
fn reduced_data_and_figures_can_be_made_again() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    folder.ends(0, "run tiny.toml --out r");
    let before = folder.contents("r");
    for gone in ["reduced", "figures"] {
        fs::remove_dir_all(folder.path("r").join(gone)).unwrap();
    }
    folder.ends(0, "plot r");
    assert!(folder.contents("r") == before);
    let summary = json(&folder.ends(0, "reduce r --json").stdout);
    assert_eq!(
        (summary["jobs"].as_u64(), summary["slips"].as_u64()),
        (Some(TINY_JOBS), Some(4 * TINY_JOBS))
    );
    let drawn = folder.ends(0, "plot r").stdout;
    let drawn: BTreeSet<&str> = drawn.lines().collect();
    let there = before.iter().filter(|(_, bytes)| bytes.is_some());
    let there = there.map(|(path, _)| format!("r/{}", path.display()));
    let there: Vec<String> = there
        .filter(|path| path.starts_with("r/figures/"))
        .collect();
    assert_eq!(drawn, there.iter().map(String::as_str).collect());
    assert!(folder.contents("r") == before);
}

#[test]
fn reduced_data_of_other_tables_are_made_again_whatever_their_age() {
    let folder = Folder::new();
    let text = |seeds: u32| {
        TINY.replace(
            "seed = { count = 2 }",
            &format!("seed = {{ count = {seeds} }}"),
        )
    };
    assert_ne!(text(2), text(3));
    folder.write("tiny.toml", &text(2));
    folder.ends(0, "run tiny.toml --out r");
    let read = || {
        ["sets", "points"]
            .map(|name| fs::read(folder.path(&format!("r/reduced/{name}.parquet"))).unwrap())
    };
    let write = |bytes: &[Vec<u8>; 2]| {
        for (name, bytes) in ["sets", "points"].iter().zip(bytes) {
            fs::write(folder.path(&format!("r/reduced/{name}.parquet")), bytes).unwrap();
        }
    };
    let few = read();
    folder.write("tiny.toml", &text(3));
    folder.ends(0, "run tiny.toml --out r");
    let many = read();
    assert!(few != many);
    for command in ["plot r", "plot r --x V0 --y tau_mean", "report r"] {
        // As in a copy without times: these are newer than the tables, and not theirs.
        write(&few);
        folder.ends(0, command);
        assert!(read() == many, "{command}");
    }
    // Those that are theirs stay, though all else is newer.
    let set_modified = |name: &str, time| {
        fs::File::options()
            .write(true)
            .open(folder.path(name))
            .unwrap()
            .set_modified(time)
            .unwrap();
    };
    let long_ago = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000_000);
    set_modified("r/reduced/sets.parquet", long_ago);
    folder.ends(0, "report r");
    let kept = fs::metadata(folder.path("r/reduced/sets.parquet"))
        .unwrap()
        .modified()
        .unwrap();
    assert_eq!(kept, long_ago);
}

#[test]
fn damaged_data_end_with_code_4_and_the_file_and_its_remedy_works() {
    let folder = Folder::new();
    folder.write("many.toml", MANY);
    folder.ends(0, "run many.toml --no-reduce --out r");
    let whole = folder.tables("r");
    for (table, commands) in [
        (
            "jobs",
            &["run many.toml --out r", "status r", "reduce r"][..],
        ),
        ("slips", &["run many.toml --out r", "reduce r"]),
    ] {
        let part = folder.parts("r", table)[1].clone();
        let name = part
            .strip_prefix(folder.path(""))
            .unwrap()
            .display()
            .to_string();
        let bytes = fs::read(&part).unwrap();
        fs::write(&part, &bytes[..bytes.len() / 2]).unwrap();
        for command in commands {
            let ended = folder.ends(4, command);
            assert!(
                ended.stderr.contains(&format!("{name}: damaged")),
                "{command}: {}",
                ended.stderr
            );
            assert!(
                ended.stderr.contains("stickslip verify"),
                "{}",
                ended.stderr
            );
        }
        // The way out that the message gives.
        folder.ends(4, "verify r");
        folder.ends(3, "verify r --repair");
        let report = json(
            &folder
                .ends(0, "run many.toml --out r --no-reduce --json")
                .stdout,
        );
        assert_eq!(report["jobs_run"].as_u64(), Some(437));
        assert!(folder.tables("r") == whole, "{table}");
    }
    for (file, text) in [
        ("run/extension-000.json", "{"),
        ("run/extension-000.json", ""),
    ] {
        let kept = fs::read(folder.path("r").join(file)).unwrap();
        let both = [file, "run/copies/extension-000.json"];
        for file in both {
            folder.write(&format!("r/{file}"), text);
        }
        for command in ["run many.toml --out r", "status r", "reduce r", "plot r"] {
            let ended = folder.ends(4, command);
            assert!(
                ended.stderr.contains(&format!("r/{file}: damaged")),
                "{command}: {}",
                ended.stderr
            );
        }
        for file in both {
            fs::write(folder.path("r").join(file), &kept).unwrap();
        }
    }
    assert!(folder.tables("r") == whole);
}

#[test]
fn a_pipe_gets_the_report_and_nothing_else() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    let report = folder.ends(0, "run tiny.toml --json --out r").stdout;
    assert_eq!(
        (
            json(&report)["jobs_run"].as_u64(),
            json(&report)["format"].as_u64()
        ),
        (Some(TINY_JOBS), Some(2))
    );
    for command in [
        "plan tiny.toml --json",
        "status r --json",
        "reduce r --json",
        "verify r --json",
        "export r -o e --json",
        "simulate --set N=3 --slips 1 --json",
    ] {
        let format = match command.split(' ').next() {
            Some("verify") => 5,
            Some("status") => 3,
            Some("simulate") => 1,
            _ => 2,
        };
        assert_eq!(
            json(&folder.ends(0, command).stdout)["format"].as_u64(),
            Some(format),
            "{command}"
        );
    }
}

#[test]
fn a_reader_that_leaves_does_not_end_a_run() {
    let folder = Folder::new();
    folder.write("failing.toml", FAILING);
    // Both ends of what it says are closed at once.
    let mut child = folder.start("run failing.toml --out r");
    drop((child.stdout.take(), child.stderr.take()));
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert_eq!(folder.table("r", "jobs").cells.len(), 6);
    let mut child = folder.start("generate completions bash");
    drop(child.stdout.take());
    assert_eq!(wait(child), (Some(0), String::new(), String::new()));
}

#[test]
fn completions_are_there_for_the_usual_shells() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = folder
            .ends(0, &format!("generate completions {shell}"))
            .stdout;
        for word in ["stickslip", "simulate", "retry-failed"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
}

#[test]
fn the_help_of_every_command_holds_an_example() {
    let folder = Folder::new();
    let [help] = folder.screens("help", ["--help"]);
    let lines = help.stdout.lines().skip_while(|line| *line != "Commands:");
    let lines = lines.skip(1).take_while(|line| !line.is_empty());
    let commands = lines.filter_map(|line| line.split_whitespace().next());
    for command in commands.filter(|word| *word != "help").chain(["generate"]) {
        let [help] = folder.screens(&format!("help_{command}"), [&format!("{command} --help")]);
        let example = help.stdout.split_once("Example").unwrap().1;
        assert!(example.contains(&format!("  stickslip {command}")));
        if folder.ends(0, &format!("{command} -h")).stdout != help.stdout {
            folder.screens(&format!("help_{command}_short"), [&format!("{command} -h")]);
        }
    }
}

#[test]
fn a_plan_names_the_longest_job_which_no_number_of_threads_makes_shorter() {
    let folder = Folder::new();
    let text = "name = \"s\"\n[axes]\nN = [9, 100, 20]\nseed = { count = 2 }\n[record]\nslips = 4";
    folder.write("s.toml", text);
    let plan = json(&folder.ends(0, "plan s.toml --threads 99 --json").stdout);
    let command = "stickslip simulate --set N=100 --slips 4";
    assert_eq!(plan["longest_job"], command);
    assert_eq!(
        plan["longest_job_cpu_seconds"],
        plan["predicted_wall_seconds"]
    );
}

#[test]
fn a_directory_resumes_without_its_sweep_file() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    folder.ends(0, "run tiny.toml --no-reduce");
    let whole = folder.contents("results/tiny/tables");
    fs::remove_file(folder.path("results/tiny/tables/jobs/part-000-000000.parquet")).unwrap();
    fs::remove_file(folder.path("tiny.toml")).unwrap();
    folder.screens(
        "run_of_a_directory",
        [
            "status results/tiny",
            "run results/tiny --no-reduce --threads 1",
        ],
    );
    assert_eq!(folder.contents("results/tiny/tables"), whole);
}

#[test]
fn a_budget_of_events_can_be_raised_for_the_jobs_that_it_failed() {
    let folder = Folder::new();
    let with = |events: &str| {
        format!(
            "name = \"b\"\n[model]\nN = 9\n[axes]\nseed = [0, 1]\n[record]\nslips = 2\n{events}"
        )
    };
    folder.write("b.toml", &with(""));
    folder.ends(0, "run b.toml --out whole --no-reduce");
    folder.write("few.toml", &with("max_events = 300"));
    folder.write("more.toml", &with("max_events = 100000"));
    folder.screens(
        "run_with_a_budget_raised",
        [
            "run few.toml --out r --no-reduce --threads 1",
            "run more.toml --out r --no-reduce --threads 1",
            "run more.toml --out r --no-reduce --retry-failed --threads 1",
        ],
    );
    for table in ["slips", "jobs"] {
        let rows = |directory| folder.table(directory, table).sorted_by(&["job_id"]);
        assert_eq!(rows("r"), rows("whole"), "{table}");
    }
}

#[test]
fn a_plan_says_what_of_the_sweep_is_in_its_directory() {
    let folder = Folder::new();
    let text = |seeds: u32, model: &str| {
        format!(
            "name = \"p\"\n[model]\nN = 9\n{model}\n[axes]\nseed = {{ count = {seeds} }}\n[record]\nslips = 2\n"
        )
    };
    folder.write("p.toml", &text(3, ""));
    folder.screens("plan_of_a_new_sweep", ["plan p.toml --threads 2"]);
    folder.ends(0, "run p.toml --no-reduce");
    let before = folder.contents("results");
    folder.write("more.toml", &text(5, ""));
    folder.write("fewer.toml", &text(1, ""));
    folder.write("other.toml", &text(3, "Ns = 10"));
    folder.screens(
        "plan_beside_a_directory",
        [
            "plan more.toml --threads 2",
            "plan fewer.toml --threads 2",
            "plan other.toml --threads 2",
            "plan fewer.toml --threads 2 --json",
            "plan other.toml --threads 2 --json",
        ],
    );
    assert!(
        folder.contents("results") == before,
        "a plan writes nothing"
    );
}

#[test]
fn a_directory_that_is_named_is_the_one_that_plan_and_batch_are_about() {
    let folder = Folder::new();
    folder.write("tiny.toml", TINY);
    folder.ends(0, "run tiny.toml --no-reduce --out elsewhere");
    let plan = json(&folder.ends(0, "plan elsewhere --json").stdout);
    let directory = &plan["directory"];
    assert_eq!(
        (&directory["path"], &directory["jobs_missing"]),
        (&"elsewhere".into(), &0.into())
    );
    let script = "batch slurm elsewhere --workers 2 --threads 1 --time 1h";
    let script = folder.ends(0, script).stdout;
    assert!(script.contains("/elsewhere --worker"), "{script}");
    assert!(!script.contains("results/tiny"), "{script}");
    let varied = json(&folder.ends(0, "plan elsewhere --set slips=9 --json").stdout);
    assert!(varied["directory"].is_null(), "{varied}");
}

#[test]
fn an_extension_with_a_value_that_differs_in_the_last_digits_is_refused() {
    let folder = Folder::new();
    let sweep = |values: &str| TINY.replace("[29, 58]", values);
    folder.write("tiny.toml", &sweep("[29, 58]"));
    folder.ends(0, "run tiny.toml --no-reduce");
    let before = folder.contents("results/tiny");
    folder.write("digits.toml", &sweep("[29, 57.99999999999999]"));
    folder.write("both.toml", &sweep("[29, 58, 57.99999999999999]"));
    folder.screens(
        "values_that_differ_in_the_last_digits",
        [
            "run digits.toml",
            "run digits.toml --out results/tiny",
            "plan digits.toml --threads 2",
            "plan both.toml --out none",
        ],
    );
    assert!(
        folder.contents("results/tiny") == before,
        "nothing was changed"
    );
    folder.write("tiny.toml", &sweep("[29, 57.9999, 58]"));
    folder.ends(0, "run tiny.toml --no-reduce");
    let simulated = folder.ends(0, "simulate --set V0=0.30000000000000004 --time 1e-3");
    assert!(simulated.stderr.is_empty() || simulated.stderr.contains("warning"));
}
