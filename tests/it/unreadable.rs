//! Files that cannot be read, limits on what a process may have, and names that could steer a terminal: nothing good is
//! moved, and no message passes for another.
#![cfg(target_os = "linux")]

use crate::program::{Ended, Folder, PROGRAM, json};
use rustix::fs::{CWD, FileType, Mode, mknodat};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

const SWEEP: &str = "\
name = \"small\"
[model]
N = 2
Ns = 1
Delta = 1e-6
[axes]
frequency = [29, 58]
seed = { count = 4 }
[record]
slips = 30
discard = 0
precursors = true
";

/// A sweep file, and its results in `r`.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("small.toml", SWEEP);
    folder.ends(0, "run small.toml --out r");
    folder
}

/// Runs the program within a limit that the shell sets.
fn run_within(folder: &Folder, limit: &str, arguments: &str) -> Ended {
    let script = format!("ulimit {limit} && exec '{PROGRAM}' {arguments}");
    // glibc reserves 64 MB of addresses for an arena of a thread where they are to be had: by chance, close to a limit.
    let shell = Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder.path(""))
        .env("MALLOC_ARENA_MAX", "1")
        .output();
    let output = shell.unwrap();
    let [stdout, stderr] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    Ended {
        code: output.status.code(),
        stdout,
        stderr,
    }
}

/// All commands that read.
const COMMANDS: [&str; 9] = [
    "plan small.toml --out r",
    "status r",
    "verify r",
    "verify r --repair",
    "run small.toml --out r --no-reduce",
    "run r",
    "reduce r",
    "plot r",
    "export r -o exported",
];

#[test]
fn within_limits_on_files_and_memory_every_command_works_or_says_what_it_could_not_do() {
    let folder = folder();
    let before = folder.tables("r");
    let mut refused = 0;
    for limit in [
        "-n 5",
        "-n 6",
        "-n 7",
        "-n 8",
        "-n 20",
        "-v 100000",
        "-v 400000",
    ] {
        for command in COMMANDS {
            let ended = run_within(&folder, limit, command);
            let case = format!("{limit}, {command}: {}{}", ended.stdout, ended.stderr);
            let lacks_memory = ended.stderr.contains("too little memory: ");
            assert!(lacks_memory <= limit.starts_with("-v"), "{case}");
            let refusal = if lacks_memory { 2 } else { 3 };
            assert!(
                [Some(0), Some(refusal)].contains(&ended.code),
                "{:?}, {case}",
                ended.code
            );
            if ended.code == Some(refusal) {
                assert!(ended.stderr.starts_with("error: "), "{case}");
                refused += 1;
            }
            assert!(folder.tables("r") == before, "{case}");
            assert!(!folder.path("r/run/quarantine").exists(), "{case}");
            let _ = fs::remove_dir_all(folder.path("exported"));
        }
    }
    assert!(refused > 0, "no limit was met");
}

#[test]
fn what_cannot_be_read_is_neither_damaged_nor_moved() {
    let folder = folder();
    let reduced = "r/reduced/sets.parquet";
    for table in ["slips", "precursors", "jobs"] {
        let file = format!("r/tables/{table}/part-000-000001.parquet");
        assert_unread(&folder, &file);
    }
    let copy = "r/run/copies/extension-000.json";
    for file in ["r/run/extension-000.json", copy, reduced] {
        assert_unread(&folder, file);
    }
}

/// Makes a file unreadable, for root too, by a name that leads to itself.
fn assert_unread(folder: &Folder, file: &str) {
    let (path, aside) = (folder.path(file), folder.path("aside"));
    fs::rename(&path, &aside).unwrap();
    symlink(&path, &path).unwrap();
    let before = folder.contents("r");
    for command in ["verify r", "verify r --repair"] {
        let ended = folder.ends(3, command);
        assert!(
            ended.stderr.contains(&format!("error: {file}: cannot ")),
            "{command}: {}",
            ended.stderr
        );
        let mut after = folder.contents("r");
        after.retain(|path, bytes| bytes.is_some() || before.contains_key(path));
        assert!(after == before, "{command}: {file}");
    }
    fs::remove_file(&path).unwrap();
    fs::rename(&aside, &path).unwrap();
}

#[test]
fn a_file_that_does_not_fit_in_memory_is_named() {
    let folder = folder();
    let path = "r/tables/jobs/part-000-000001.parquet";
    let file = File::options()
        .append(true)
        .open(folder.path(path))
        .unwrap();
    file.set_len(3 << 30).unwrap();
    let ended = run_within(&folder, "-v 200000", "verify r");
    assert!(
        ended.code == Some(3)
            && ended
                .stderr
                .starts_with(&format!("error: {path}: cannot read")),
        "{ended:?}"
    );
    file.set_len(8 << 30).unwrap();
    let ended = run_within(&folder, "-v 200000", "verify r");
    assert!(
        ended.code == Some(4) && ended.stdout.contains(&format!("{path}: it has more than")),
        "{ended:?}"
    );
}

/// Makes a FIFO, which nobody writes.
pub fn fifo(path: &Path) {
    mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
}

#[test]
fn a_fifo_makes_no_command_wait() {
    let folder = folder();
    fifo(&folder.path("fifo.toml"));
    for command in [
        "plan fifo.toml",
        "run fifo.toml",
        "simulate fifo.toml",
        "accuracy fifo.toml",
        "batch slurm fifo.toml --workers 1 --threads 1 --time 1h",
    ] {
        let ended = folder.ends(2, command);
        assert!(
            ended
                .stderr
                .contains("fifo.toml: cannot be read: it is no regular file"),
            "{command}: {}",
            ended.stderr
        );
    }
    // (file, how verify ends)
    for (file, code) in [
        ("r/tables/jobs/part-000-000001.parquet", 4),
        ("r/tables/slips/stray.parquet", 4),
        ("r/run/extension-000.json", 4),
        ("r/run/copies/extension-000.json", 4),
        // Reduced again by `plot`.
        ("r/reduced/sets.parquet", 0),
        ("r/run/log/0.jsonl", 0),
    ] {
        let (path, aside) = (folder.path(file), folder.path("aside"));
        let was_there = fs::rename(&path, &aside).is_ok();
        fifo(&path);
        for command in [
            "status r",
            "run r --no-reduce",
            "plot r",
            "plan small.toml --out r",
        ] {
            let ended = folder.run(command);
            assert!(
                matches!(ended.code, Some(0 | 2 | 3 | 4)),
                "{file}, {command}: {ended:?}"
            );
        }
        let text = folder.ends(code, "verify r").stdout;
        assert!(code == 0 || text.contains(file), "{file}: {text}");
        fs::remove_file(&path).unwrap();
        if was_there {
            fs::rename(&aside, &path).unwrap();
        }
    }
}

#[test]
fn names_and_keys_pass_for_no_other_line_of_a_message() {
    let folder = folder();
    let names: [&[u8]; 6] = [
        b"a\nnext:\n  rm -r x.parquet",
        b"\x1b[31mred.parquet",
        b"\xff\xfe.parquet",
        b"a\nnext:\n  rm -r y",
        b"\x1b[31mblue",
        b"\xff\xff",
    ];
    for name in names {
        fs::write(
            folder.path("r/tables/jobs").join(OsStr::from_bytes(name)),
            "",
        )
        .unwrap();
    }
    folder.screens("verify_among_odd_names", ["verify r"]);
    let report = json(&folder.ends(4, "verify r --json").stdout);
    let paths: Vec<&str> = report["problems"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["path"].as_str().unwrap())
        .collect();
    assert_eq!(
        paths,
        [
            "r/tables/jobs/\u{1b}[31mred.parquet",
            "r/tables/jobs/a\nnext:\n  rm -r x.parquet",
            r"r/tables/jobs/\xff\xfe.parquet"
        ]
    );
    folder.write(
        "key.toml",
        "name = \"x\"\n[axes]\n\"\\u001b[31mN\\nerror: forged\" = [1]\n",
    );
    let text = folder.ends(2, "plan key.toml").stderr;
    assert!(
        text.starts_with(r"error: key.toml:3: \u{1b}[31mN\nerror: forged = [1]: unknown"),
        "{text}"
    );
}

#[test]
fn a_directory_whose_name_is_no_text_is_shown_as_a_shell_reads_it() {
    let folder = folder();
    let root = folder.path("").join(OsStr::from_bytes(b"a\xff'\n"));
    fs::rename(folder.path("r"), &root).unwrap();
    fs::write(root.join("tables/jobs/notes.parquet"), "").unwrap();
    let verify = |json: &[&str]| {
        let output = Command::new(PROGRAM)
            .arg("verify")
            .arg(&root)
            .args(json)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(4), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let report = json(&verify(&["--json"]));
    let command = report["commands"][0].as_str().unwrap();
    assert!(verify(&[]).contains(&format!("  {command}\n")), "{command}");
    let arguments = command.strip_prefix("stickslip ").unwrap();
    let repaired = Command::new("bash")
        .args(["-c", &format!("'{PROGRAM}' {arguments}")])
        .status()
        .unwrap();
    assert!(repaired.success(), "{command}");
    assert!(
        root.join("run/quarantine/jobs/notes.parquet").exists(),
        "{command}"
    );
}
