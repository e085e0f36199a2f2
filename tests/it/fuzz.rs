//! Fuzzing of what is read from files that others may have changed: sweep files, the files in `run/`, tables. No panic, no
//! hang, and never another result than that of the file as it was written.
//!
//! `PROPTEST_CASES` sets the number of cases of each test.

use proptest::prelude::*;
use proptest::sample::Index;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use stickslip::observe::measure;
use stickslip::results::Results;
use stickslip::results::layout::Layout;
use stickslip::run::{Options, Shard, run};
use stickslip::sweep::Sweep;
use stickslip::table::file::Dataset;
use stickslip::table::storage::Disk;

/// No case takes longer; it takes milliseconds.
const LONGEST: Duration = Duration::from_secs(20);

/// What is done to bytes.
#[derive(Clone, Debug)]
enum Change {
    Flip(Index, u8),
    Set(Index, u8),
    Cut(Index),
    Remove(Index, usize),
    Insert(Index, Vec<u8>),
    /// A stretch is copied to another place.
    Copy(Index, Index, usize),
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        4 => (any::<Index>(), 0..8_u8).prop_map(|(at, bit)| Change::Flip(at, bit)),
        4 => (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Change::Set(at, byte)),
        1 => any::<Index>().prop_map(Change::Cut),
        2 => (any::<Index>(), 1..40_usize).prop_map(|(at, length)| Change::Remove(at, length)),
        2 => (any::<Index>(), token()).prop_map(|(at, bytes)| Change::Insert(at, bytes)),
        2 => (any::<Index>(), any::<Index>(), 1..40_usize).prop_map(|(from, to, length)| Change::Copy(from, to, length)),
    ]
}

/// What parsers trip over.
fn token() -> impl Strategy<Value = Vec<u8>> {
    let words = prop::sample::select(vec![
        "-1",
        "1e308",
        "1e-320",
        "nan",
        "inf",
        "99999999999999999999",
        "18446744073709551615",
        "\"",
        "[",
        "]",
        "{",
        "}",
        "= ",
        "count = ",
        "log = [",
        "points = 0",
        "\u{0}",
        "\u{feff}",
        "'''",
        "\n[axes]\n",
        "where = \"",
        "((((",
        "seed",
        "eta",
        "zip",
        "sobol",
        "0.1.2",
        "#",
        "\\u",
        "true",
        "null",
        ",",
        "/ 0",
    ]);
    prop_oneof![words.prop_map(|word| word.as_bytes().to_vec()), prop::collection::vec(any::<u8>(), 1..8)]
}

fn apply(bytes: &mut Vec<u8>, change: &Change) {
    let length = bytes.len();
    if length == 0 {
        return;
    }
    match change {
        Change::Flip(at, bit) => bytes[at.index(length)] ^= 1 << bit,
        Change::Set(at, byte) => bytes[at.index(length)] = *byte,
        Change::Cut(at) => bytes.truncate(at.index(length)),
        Change::Remove(at, count) => {
            let at = at.index(length);
            bytes.drain(at..length.min(at + count));
        }
        Change::Insert(at, inserted) => {
            let at = at.index(length);
            bytes.splice(at..at, inserted.iter().copied());
        }
        Change::Copy(from, to, count) => {
            let (from, to) = (from.index(length), to.index(length));
            let copied = bytes[from..length.min(from + count)].to_vec();
            bytes.splice(to..to, copied);
        }
    }
}

fn changed(bytes: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for change in changes {
        apply(&mut bytes, change);
    }
    bytes
}

/// The sweep files of the repository, and one with everything in it.
static SWEEPS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("sweeps");
    let mut paths: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    paths.sort();
    let mut texts: Vec<String> = paths.iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    texts.push(TINY.to_owned());
    texts
});

const TINY: &str = "\
name = \"tiny\"
[model]
N = 2
Ns = 1
[axes]
V0 = { log = [1e-4, 2e-4], points = 2 }
Delta = [0, 1e-6]
frequency = [29.0]
seed = { count = 2 }
[record]
slips = 2
discard = 0
precursors = true
";

/// A folder with a results directory, and one that is compacted.
struct Examples {
    folder: tempfile::TempDir,
}

static RESULTS: LazyLock<Examples> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let sweep = Sweep::parse(TINY, Path::new("tiny.toml")).unwrap();
    for name in ["parts", "compacted"] {
        let stop = AtomicBool::new(false);
        let options =
            Options { threads: None, stop: &stop, retry_failed: false, shard: Shard::default(), walltime: None };
        let (recording, solver) = (*sweep.recording(), sweep.solver());
        let kernel =
            |job: &stickslip::sweep::Job, stop: &AtomicBool| measure(&job.parameters, &recording, solver, stop);
        run(&Layout::new(&Disk, &folder.path().join(name)), &sweep, options, &kernel, &mut |_| ()).unwrap();
    }
    Results::read(&Layout::new(&Disk, &folder.path().join("compacted"))).unwrap().compact().unwrap();
    Examples { folder }
});

/// The files of a folder and those below it.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Copies a directory, with a file changed, to a place of its own.
fn copy(from: &Path, file: &Path, changes: &[Change]) -> (tempfile::TempDir, bool) {
    let to = tempfile::tempdir().unwrap();
    let mut is_changed = false;
    for path in files(from) {
        let target = to.path().join(path.strip_prefix(from).unwrap());
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        let bytes = fs::read(&path).unwrap();
        let written = if path == file { changed(&bytes, changes) } else { bytes.clone() };
        is_changed |= written != bytes;
        fs::write(target, written).unwrap();
    }
    (to, is_changed)
}

fn config() -> ProptestConfig {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(400);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn sweep_files_are_read_or_refused(which in any::<Index>(), changes in prop::collection::vec(change(), 1..12)) {
        let begin = Instant::now();
        let text = String::from_utf8_lossy(&changed(SWEEPS[which.index(SWEEPS.len())].as_bytes(), &changes)).into_owned();
        match Sweep::parse(&text, Path::new("fuzzed.toml")) {
            Err(error) => prop_assert!(error.to_string().starts_with("fuzzed.toml"), "{}", error),
            Ok(sweep) => {
                // What is admitted can be planned: the first jobs have ids and are found again.
                for job in sweep.jobs().take(20) {
                    prop_assert!(sweep.contains(&job.parameters));
                    prop_assert!(job.cost.is_finite() && job.cost >= 0.0, "{}", job.cost);
                    prop_assert_eq!(sweep.job_id(&job.parameters).to_string().len(), 32);
                }
            }
        }
        prop_assert!(begin.elapsed() < LONGEST);
    }

    #[test]
    fn any_text_as_a_sweep_file_is_refused_or_read(text in "(\\PC|\\n|=|\\[|\\]|\"|\\{|\\}){0,200}") {
        let begin = Instant::now();
        let _ = Sweep::parse(&text, Path::new("fuzzed.toml"));
        prop_assert!(begin.elapsed() < LONGEST);
    }

    #[test]
    fn files_of_a_directory_are_read_or_refused(
        compacted in any::<bool>(),
        which in any::<Index>(),
        changes in prop::collection::vec(change(), 1..6),
    ) {
        let begin = Instant::now();
        let root = RESULTS.folder.path().join(if compacted { "compacted" } else { "parts" });
        let mut run_files = files(&root.join("run"));
        run_files.retain(|path| path.extension().is_some_and(|extension| extension == "json" || extension == "toml"));
        let (copy, is_changed) = copy(&root, &run_files[which.index(run_files.len())], &changes);
        let read = Results::read(&Layout::new(&Disk, copy.path()));
        prop_assert_eq!(read.is_err(), is_changed);
        match Results::verify(&Layout::new(&Disk, copy.path())) {
            Ok(verification) => prop_assert_eq!(verification.whole, !is_changed),
            Err(error) => prop_assert!(is_changed, "{}", error),
        }
        prop_assert!(begin.elapsed() < LONGEST);
    }

    #[test]
    fn tables_are_read_as_they_were_written_or_refused(
        compacted in any::<bool>(),
        which in any::<Index>(),
        changes in prop::collection::vec(change(), 1..6),
    ) {
        let begin = Instant::now();
        let root = RESULTS.folder.path().join(if compacted { "compacted" } else { "parts" });
        let tables = files(&root.join("tables"));
        let file = &tables[which.index(tables.len())];
        let (copy, is_changed) = copy(&root, file, &changes);
        let file = copy.path().join(file.strip_prefix(&root).unwrap());
        prop_assert_eq!(Dataset::new(&Disk, vec![file.clone()]).batches().any(|batch| batch.is_err()), is_changed);
        let verification = Results::verify(&Layout::new(&Disk, copy.path())).unwrap();
        prop_assert_eq!(verification.whole, !is_changed);
        prop_assert!(!is_changed || verification.problems.iter().any(|problem| problem.path == file));
        // What is read of the footer alone, before any checksum is looked at, may be refused but must not break.
        let _ = stickslip::table::file::footer(&Disk, &file);
        prop_assert!(begin.elapsed() < LONGEST);
    }
}
