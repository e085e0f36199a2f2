//! Fuzzing of what is read from files that others may have changed: sweep files, the files in `run/`, tables. No panic,
//! no hang, and never another result than that of the file as it was written.
//!
//! `PROPTEST_CASES` sets the number of cases of each test.

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow_schema::DataType;
use parquet::file::reader::{FileReader, SerializedFileReader};
use proptest::prelude::*;
use proptest::sample::Index;
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use stickslip::figure::{Beside, Look, PictureFormat, draw_all};
use stickslip::observe::measure;
use stickslip::reduce::{BackboneBin, HistogramBin, Point, reduce};
use stickslip::results::Results;
use stickslip::results::layout::Layout;
use stickslip::results::tables::{JobRow, PrecursorRow, SlipRow};
use stickslip::rounds::next;
use stickslip::run::{MAX_FAILURES, Options, Shard, join, status};
use stickslip::sets::SetRow;
use stickslip::sweep::Sweep;
use stickslip::table::arrow::Gaps;
use stickslip::table::checksum::hexadecimal;
use stickslip::table::columns::Row;
use stickslip::table::file::{Batch, Dataset, Footer, TableWriter};
use stickslip::table::storage::{Disk, Storage};

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
    prop_oneof![
        words.prop_map(|word| word.as_bytes().to_vec()),
        prop::collection::vec(any::<u8>(), 1..8)
    ]
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
    let mut paths: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.retain(|path| {
        path.extension()
            .is_some_and(|extension| extension == "toml")
    });
    paths.sort();
    let mut texts: Vec<String> = paths
        .iter()
        .map(|path| fs::read_to_string(path).unwrap())
        .collect();
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

/// An edge between sets of few seeds.
const ROUNDS: &str = "\
name = \"rounds\"
[model]
N = 2
Ns = 1
[axes]
V0 = { log = [1e-4, 1e-2], points = 3 }
[record]
slips = 2
discard = 0
[refine]
axis = \"V0\"
by = \"slip_share\"
threshold = 0.5
to = 0.5
seeds = { from = 2, to = 6 }
jobs = 60
";

/// A folder with results directories: as they are run, and of a sweep in rounds.
struct Examples {
    folder: tempfile::TempDir,
}

static RESULTS: LazyLock<Examples> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    for name in EXAMPLES {
        let sweep = Sweep::parse(
            if name == "rounds" { ROUNDS } else { TINY },
            Path::new("tiny.toml"),
        )
        .unwrap();
        let stop = AtomicBool::new(false);
        let options = Options {
            threads: None,
            stop: &stop,
            retry_failed: false,
            shard: Shard::default(),
            walltime: None,
        };
        let (recording, solver) = (*sweep.recording(), sweep.solver());
        let kernel = |job: &stickslip::sweep::Job, stop: &AtomicBool| {
            measure(&job.parameters, &recording, solver, stop)
        };
        let folder = folder.path().join(name);
        let layout = Layout::new(&Disk, &folder);
        join(&layout, &sweep, options, |joined| {
            joined.run(&kernel, &mut |_| ())
        })
        .unwrap();
    }
    for name in EXAMPLES {
        reduce(&Results::read(&Layout::new(&Disk, &folder.path().join(name))).unwrap()).unwrap();
    }
    Examples { folder }
});

const EXAMPLES: [&str; 2] = ["parts", "rounds"];

fn example() -> impl Strategy<Value = &'static str> {
    prop::sample::select(EXAMPLES.to_vec())
}

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
    // Where syncs cost nothing, if there is such a place.
    let to = tempfile::tempdir_in("/dev/shm")
        .or_else(|_| tempfile::tempdir())
        .unwrap();
    let mut is_changed = false;
    for path in files(from) {
        let target = to.path().join(path.strip_prefix(from).unwrap());
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        let bytes = fs::read(&path).unwrap();
        let written = if path == file {
            changed(&bytes, changes)
        } else {
            bytes.clone()
        };
        is_changed |= written != bytes;
        fs::write(target, written).unwrap();
    }
    (to, is_changed)
}

/// Numbers that make no sense almost anywhere.
const NUMBERS: [&str; 10] = [
    "-1",
    "0",
    "1",
    "2",
    "1e308",
    "-1e-320",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "null",
];

/// An extension's file with one of its numbers replaced, and the checksum of that.
fn resealed_json(text: &str, which: Index, number: &str) -> String {
    let (body, _) = text.rsplit_once(",\n  \"sha256\"").unwrap();
    let is_of_number = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    let starts: Vec<usize> = body
        .char_indices()
        .filter(|&(at, c)| {
            (is_of_number(c) && !body[..at].ends_with(is_of_number))
                || body[at..].starts_with("null")
        })
        .map(|(at, _)| at)
        .collect();
    let at = starts[which.index(starts.len())];
    let rest = &body[at..];
    let end = if rest.starts_with("null") {
        4
    } else {
        rest.find(|c| !is_of_number(c)).unwrap_or(rest.len())
    };
    let body = format!("{}{number}{}", &body[..at], &rest[end..]);
    let sha256 = hexadecimal(&Sha256::digest(format!("{body}\n}}")));
    format!("{body},\n  \"sha256\": \"{sha256}\"\n}}\n")
}

/// Writes a file of a table again, with a value that makes no sense in a column.
fn write_nonsense<R: Row>(path: &Path, column: Index, row: Index, value: Index) {
    let metadata = SerializedFileReader::new(fs::File::open(path).unwrap()).unwrap();
    let texts = metadata
        .metadata()
        .file_metadata()
        .key_value_metadata()
        .unwrap();
    let kept = texts
        .iter()
        .filter(|text| !["seal", "units", "meaning", "ARROW:schema"].contains(&text.key.as_str()));
    let footer = kept.fold(Footer::default(), |new, text| {
        new.with(&text.key, text.value.as_deref().unwrap_or_default())
    });
    let batches: Vec<Batch> = Dataset::new(&Disk, vec![path.to_owned()])
        .batches()
        .collect::<Result<_, _>>()
        .unwrap();
    let is_left_out = |name: &Cow<'static, str>| {
        batches
            .iter()
            .any(|batch| batch.rows.column_by_name(name).is_none())
    };
    let left_out = R::columns()
        .into_iter()
        .map(|column| column.name)
        .filter(is_left_out)
        .collect();
    let gaps = Gaps {
        left_out,
        ..Gaps::default()
    };
    Disk.remove(path).unwrap();
    let mut writer =
        TableWriter::<R>::new(&gaps, path, Disk.create(path).unwrap(), &footer).unwrap();
    for Batch { path, rows } in batches
        .into_iter()
        .filter(|batch| batch.rows.num_rows() > 0)
    {
        let (column, row) = (column.index(rows.num_columns()), row.index(rows.num_rows()));
        let mut columns = rows.columns().to_vec();
        columns[column] = nonsense(&columns[column], row, value);
        let rows = RecordBatch::try_new(rows.schema(), columns).unwrap();
        writer
            .copy(
                &Batch {
                    path,
                    rows: rows.clone(),
                },
                0..rows.num_rows(),
            )
            .unwrap();
    }
    writer.finish().unwrap();
}

fn nonsense(column: &ArrayRef, row: usize, value: Index) -> ArrayRef {
    const REALS: [f64; 8] = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        -1.0,
        0.0,
        1e-320,
        1e300,
    ];
    const COUNTS: [i64; 7] = [-1, 0, 1, i64::MAX, i64::MIN, 1 << 40, i64::MAX - 1];
    const TEXTS: [&str; 5] = [
        "",
        "done",
        "failed",
        "\u{1b}[31m",
        "ffffffffffffffffffffffffffffffff",
    ];
    match column.data_type() {
        DataType::Float64 => {
            let mut cells: Vec<Option<f64>> = column.as_primitive::<Float64Type>().iter().collect();
            cells[row] = Some(REALS[value.index(REALS.len())]);
            Arc::new(Float64Array::from(cells))
        }
        DataType::Int64 => {
            let mut cells: Vec<Option<i64>> = column.as_primitive::<Int64Type>().iter().collect();
            cells[row] = Some(COUNTS[value.index(COUNTS.len())]);
            Arc::new(Int64Array::from(cells))
        }
        DataType::Utf8 => {
            let mut cells: Vec<Option<&str>> = column.as_string::<i32>().iter().collect();
            cells[row] = Some(TEXTS[value.index(TEXTS.len())]);
            Arc::new(StringArray::from(cells))
        }
        _ => Arc::clone(column),
    }
}

/// Reads all that depends on a file of a directory. Errors are fine.
fn read_all(root: &Path, file: &Path) {
    let begin = Instant::now();
    let layout = Layout::new(&Disk, root);
    let _ = Results::verify(&layout);
    if let Ok(results) = Results::read(&layout) {
        if results.round().is_some() {
            let _ = next(&results);
        }
        if file.starts_with(layout.reduced()) {
            let _ = draw_all(
                &layout,
                &Beside::default(),
                &Look::default(),
                &PictureFormat::ALL,
            );
        } else {
            let _ = status(&results, MAX_FAILURES);
            let _ = reduce(&results);
        }
    }
    assert!(begin.elapsed() < LONGEST, "{:?}", begin.elapsed());
    assert!(
        peak_memory().is_none_or(|bytes| bytes < MAX_MEMORY),
        "{:?}",
        peak_memory()
    );
}

/// All tests of this process take less.
const MAX_MEMORY: u64 = 3 << 30;

/// The most memory that this process ever had, in bytes, where the kernel says.
fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

/// A table file of a copy of one of the directories.
fn table_file(example: &str, which: Index) -> (tempfile::TempDir, PathBuf) {
    let root = RESULTS.folder.path().join(example);
    let tables: Vec<PathBuf> = ["tables", "reduced"]
        .iter()
        .flat_map(|folder| files(&root.join(folder)))
        .collect();
    let file = &tables[which.index(tables.len())];
    let (copy, _) = copy(&root, Path::new(""), &[]);
    let file = copy.path().join(file.strip_prefix(&root).unwrap());
    (copy, file)
}

fn config() -> ProptestConfig {
    config_with(400)
}

fn config_with(cases: u32) -> ProptestConfig {
    let cases = std::env::var("PROPTEST_CASES")
        .ok()
        .and_then(|cases| cases.parse().ok())
        .unwrap_or(cases);
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
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
                for job in sweep.jobs_of_grid().take(20) {
                    prop_assert!(sweep.find(&job.parameters).is_some());
                    prop_assert!(job.cost.is_finite() && job.cost >= 0.0, "{}", job.cost);
                    prop_assert_eq!(sweep.job_id(&job.parameters).len(), 32);
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
        example in example(),
        which in any::<Index>(),
        changes in prop::collection::vec(change(), 1..6),
    ) {
        let begin = Instant::now();
        let root = RESULTS.folder.path().join(example);
        let mut run_files = files(&root.join("run"));
        run_files.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
        let file = &run_files[which.index(run_files.len())];
        let (copy, is_changed) = copy(&root, file, &changes);
        let layout = Layout::new(&Disk, copy.path());
        // Its copy is whole.
        let texts = |results: &Results<'_>| -> Vec<String> {
            results.extensions().iter().map(|extension| extension.sweep.text().to_owned()).collect()
        };
        let read = Results::read(&layout).unwrap();
        prop_assert_eq!(texts(&read), texts(&Results::read(&Layout::new(&Disk, &root)).unwrap()));
        prop_assert_eq!(Results::verify(&layout).unwrap().whole, !is_changed);
        let name = file.file_name().unwrap();
        for both in [layout.run(), layout.run().join("copies")] {
            fs::write(both.join(name), changed(&fs::read(file).unwrap(), &changes)).unwrap();
        }
        prop_assert_eq!(Results::read(&layout).is_err(), is_changed);
        prop_assert_eq!(Results::verify(&layout).is_err(), is_changed);
        prop_assert!(begin.elapsed() < LONGEST);
    }

    #[test]
    fn tables_are_read_as_they_were_written_or_refused(
        example in example(),
        which in any::<Index>(),
        changes in prop::collection::vec(change(), 1..6),
    ) {
        let begin = Instant::now();
        let root = RESULTS.folder.path().join(example);
        let tables = files(&root.join("tables"));
        let file = &tables[which.index(tables.len())];
        let (copy, is_changed) = copy(&root, file, &changes);
        let file = copy.path().join(file.strip_prefix(&root).unwrap());
        prop_assert_eq!(Dataset::new(&Disk, vec![file.clone()]).batches().any(|batch| batch.is_err()), is_changed);
        let verification = Results::verify(&Layout::new(&Disk, copy.path())).unwrap();
        prop_assert_eq!(verification.whole, !is_changed);
        prop_assert!(!is_changed || verification.problems.iter().any(|problem| problem.path == file));
        prop_assert!(begin.elapsed() < LONGEST);
    }
}

proptest! {
    #![proptest_config(config_with(100))]

    #[test]
    fn values_that_make_no_sense_under_a_right_checksum_are_refused_or_reduced(
        which in any::<Index>(),
        column in any::<Index>(),
        row in any::<Index>(),
        value in any::<Index>(),
    ) {
        let (copy, file) = table_file("parts", which);
        let name = if file.starts_with(copy.path().join("reduced")) { file.file_stem() } else { file.parent().unwrap().file_name() };
        let write = match name.unwrap().to_str().unwrap() {
            "slips" => write_nonsense::<SlipRow<'_>>,
            "precursors" => write_nonsense::<PrecursorRow<'_>>,
            "jobs" => write_nonsense::<JobRow>,
            "sets" => write_nonsense::<SetRow>,
            "histograms" => write_nonsense::<HistogramBin>,
            "backbone" => write_nonsense::<BackboneBin>,
            "points" => write_nonsense::<Point>,
            other => panic!("a table {other}"),
        };
        write(&file, column, row, value);
        read_all(copy.path(), &file);
    }

    #[test]
    fn an_extension_that_makes_no_sense_under_a_right_checksum_is_refused(
        example in example(),
        which in any::<Index>(),
        number in prop::sample::select(NUMBERS.to_vec()),
    ) {
        let (copy, _) = table_file(example, which);
        let file = copy.path().join("run/extension-000.json");
        let text = resealed_json(&fs::read_to_string(&file).unwrap(), which, number);
        for file in [&file, &copy.path().join("run/copies/extension-000.json")] {
            fs::write(file, &text).unwrap();
        }
        read_all(copy.path(), &file);
    }
}
