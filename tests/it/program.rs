//! The built program, run in a folder of its own; and its tables, read back by another way than its own.

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, RecordBatch};
use arrow_schema::{DataType, SchemaRef};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant, SystemTime};

/// The program under test.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_stickslip");
/// After so long a command hangs: the longest takes seconds.
const LONGEST: Duration = Duration::from_mins(2);

/// The tables of a sweep.
pub const TABLES: [&str; 3] = ["slips", "precursors", "jobs"];

/// Many jobs of some 50 µs, in many parts: something to interrupt.
pub const MANY: &str = "\
name = \"many\"
[model]
N = 1
Ns = 1
[axes]
seed = { count = 28000 }
[record]
slips = 2
discard = 0
";
/// Parts of [`MANY`].
pub const MANY_PARTS: usize = 65;

/// One in three jobs needs more contact events than it may have.
pub const FAILING: &str = "\
name = \"failing\"
[model]
Ns = 2
[axes]
N = [1, 2, 30]
seed = { count = 2 }
[record]
slips = 2
discard = 0
max_events = 300
";

/// A temporary folder in which commands run.
pub struct Folder(tempfile::TempDir);

/// How a command ended.
#[derive(Debug)]
pub struct Ended {
    /// `None`: by a signal.
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    /// Runs the program with arguments that contain no spaces.
    pub fn run(&self, arguments: &str) -> Ended {
        let words: Vec<&str> = arguments.split_whitespace().collect();
        self.run_words(&words, "")
    }

    /// Runs the program with these arguments and what a pipe gives it.
    pub fn run_words(&self, words: &[&str], input: &str) -> Ended {
        let mut command = assert_cmd::Command::new(PROGRAM);
        let output = command
            .args(words)
            .write_stdin(input)
            .current_dir(self.0.path())
            .timeout(LONGEST)
            .output()
            .unwrap();
        Ended {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Runs the program and expects an exit code.
    #[track_caller]
    pub fn ends(&self, code: i32, arguments: &str) -> Ended {
        let ended = self.run(arguments);
        assert_eq!(
            ended.code,
            Some(code),
            "{arguments}\n{}\n{}",
            ended.stdout,
            ended.stderr
        );
        ended
    }

    /// Runs commands one after the other and compares all that they print with a file in `tests/it/snapshots`, but for
    /// times. `INSTA_UPDATE=always` writes the file again, after a change that is meant.
    pub fn screens<const N: usize>(&self, name: &str, commands: [&str; N]) -> [Ended; N] {
        let mut screens = String::new();
        let ended = commands.map(|command| {
            let ended = self.run(command);
            write!(screens, "$ stickslip {command}\n{}", ended.stdout).unwrap();
            if !ended.stderr.is_empty() {
                write!(screens, "[stderr]\n{}", ended.stderr).unwrap();
            }
            if ended.code != Some(0) {
                writeln!(screens, "[exit code {:?}]", ended.code.unwrap()).unwrap();
            }
            screens.push('\n');
            ended
        });
        let mut settings = insta::Settings::new();
        settings.set_prepend_module_to_snapshot(false);
        settings.set_omit_expression(true);
        settings.add_filter(r"(?m)^(CPU time|wall time)( +)[0-9.]+ \w+", "$1${2}TIME");
        settings.add_filter(r"[0-9.]+ \w+ at the pace", "TIME at the pace");
        // Of a run that takes long on a slow machine.
        let progress = r"(?m)^(?:[0-9.]+ \w+, [0-9]+ %:|1 job has run) .*\n";
        settings.add_filter(progress, "");
        settings.bind(|| insta::assert_snapshot!(name, screens));
        ended
    }

    /// Starts the program; its output can be had from the child.
    pub fn start(&self, arguments: &str) -> Child {
        Command::new(PROGRAM)
            .args(arguments.split_whitespace())
            .current_dir(self.0.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// All that lies below a folder: the files with their bytes, the folders without.
    pub fn contents(&self, below: &str) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
        let mut found = BTreeMap::new();
        let mut folders = vec![self.path(below)];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).unwrap() {
                let path = entry.unwrap().path();
                let bytes = path.is_file().then(|| fs::read(&path).unwrap());
                if path.is_dir() {
                    folders.push(path.clone());
                }
                found.insert(
                    path.strip_prefix(self.path(below)).unwrap().to_owned(),
                    bytes,
                );
            }
        }
        found
    }

    /// The files of one table of a results directory, in order of their names.
    pub fn parts(&self, directory: &str, table: &str) -> Vec<PathBuf> {
        let Ok(entries) = fs::read_dir(self.path(directory).join("tables").join(table)) else {
            return Vec::new();
        };
        let mut parts: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        parts.sort();
        parts
    }

    /// The files of all tables with their bytes.
    pub fn tables(&self, directory: &str) -> BTreeMap<PathBuf, Vec<u8>> {
        let paths = TABLES.iter().flat_map(|table| self.parts(directory, table));
        let files = paths.map(|path| {
            let bytes = fs::read(&path).unwrap();
            (
                path.strip_prefix(self.path(directory)).unwrap().to_owned(),
                bytes,
            )
        });
        files.collect()
    }

    /// Waits until so many parts are committed, or the program has ended.
    pub fn wait_for_parts(&self, directory: &str, parts: usize, child: &mut Child) {
        let begin = Instant::now();
        while self.parts(directory, "jobs").len() < parts && child.try_wait().unwrap().is_none() {
            assert!(
                begin.elapsed() < Duration::from_mins(1),
                "no part is committed"
            );
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// When the committed files were written.
    pub fn written(&self, directory: &str) -> BTreeMap<PathBuf, SystemTime> {
        let written = |path: PathBuf| {
            (
                path.clone(),
                fs::metadata(path).unwrap().modified().unwrap(),
            )
        };
        self.parts(directory, "jobs")
            .into_iter()
            .map(written)
            .collect()
    }

    /// All rows of one table of a results directory.
    pub fn table(&self, directory: &str, table: &str) -> Rows {
        let mut rows = Rows::default();
        self.parts(directory, table)
            .iter()
            .for_each(|path| rows.read(path));
        rows
    }

    /// All rows of one file.
    pub fn file(&self, name: &str) -> Rows {
        let mut rows = Rows::default();
        rows.read(&self.path(name));
        rows
    }
}

/// What the program printed as JSON.
pub fn json(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// Exit code, standard output and standard error of a program that was started.
pub fn wait(mut child: Child) -> (Option<i32>, String, String) {
    let code = child.wait().unwrap().code();
    let (mut stdout, mut stderr) = (String::new(), String::new());
    if let Some(mut pipe) = child.stdout.take() {
        pipe.read_to_string(&mut stdout).unwrap();
    }
    if let Some(mut pipe) = child.stderr.take() {
        pipe.read_to_string(&mut stderr).unwrap();
    }
    (code, stdout, stderr)
}

/// A cell, compared bit by bit.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cell {
    Null,
    Real(u64),
    Count(i64),
    Text(String),
    Flag(bool),
}

/// Rows of a table.
#[derive(Default)]
pub struct Rows {
    pub schema: Option<SchemaRef>,
    pub cells: Vec<Vec<Cell>>,
}

impl Rows {
    fn read(&mut self, path: &Path) {
        let file = File::open(path).unwrap();
        let reader = ParquetRecordBatchReaderBuilder::try_new(file)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        self.schema = Some(reader.schema().clone());
        reader
            .build()
            .unwrap()
            .for_each(|batch| self.take(&batch.unwrap()));
    }

    fn take(&mut self, batch: &RecordBatch) {
        self.cells.extend((0..batch.num_rows()).map(|row| {
            batch
                .columns()
                .iter()
                .map(|column| {
                    if column.is_null(row) {
                        Cell::Null
                    } else {
                        cell(column, row)
                    }
                })
                .collect()
        }));
    }

    fn index(&self, column: &str) -> usize {
        self.schema.as_ref().unwrap().index_of(column).unwrap()
    }

    /// The cells of a column.
    pub fn column(&self, column: &str) -> impl Iterator<Item = &Cell> {
        let index = self.index(column);
        self.cells.iter().map(move |row| &row[index])
    }

    /// A column of doubles, without its nulls.
    pub fn reals(&self, column: &str) -> Vec<f64> {
        self.column(column)
            .filter_map(|cell| match cell {
                Cell::Real(bits) => Some(f64::from_bits(*bits)),
                Cell::Null => None,
                other => panic!("{column}: {other:?}"),
            })
            .collect()
    }

    /// A column of whole numbers, without its nulls.
    pub fn counts(&self, column: &str) -> Vec<i64> {
        self.column(column)
            .filter_map(|cell| match cell {
                Cell::Count(count) => Some(*count),
                Cell::Null => None,
                other => panic!("{column}: {other:?}"),
            })
            .collect()
    }

    /// A column of texts, nulls as empty ones.
    pub fn texts(&self, column: &str) -> Vec<&str> {
        self.column(column)
            .map(|cell| match cell {
                Cell::Text(text) => text.as_str(),
                Cell::Null => "",
                other => panic!("{column}: {other:?}"),
            })
            .collect()
    }

    /// The rows in the order of these columns.
    pub fn sorted_by(&self, columns: &[&str]) -> Vec<Vec<Cell>> {
        if self.cells.is_empty() {
            return Vec::new();
        }
        let keys: Vec<usize> = columns.iter().map(|column| self.index(column)).collect();
        let mut rows = self.cells.clone();
        rows.sort_by_cached_key(|row| keys.iter().map(|&key| row[key].clone()).collect::<Vec<_>>());
        rows
    }

    /// The unit of a column, from the metadata of its field.
    pub fn unit(&self, column: &str) -> String {
        self.schema
            .as_ref()
            .unwrap()
            .field(self.index(column))
            .metadata()["unit"]
            .clone()
    }
}

fn cell(column: &dyn Array, row: usize) -> Cell {
    match column.data_type() {
        DataType::Float64 => Cell::Real(column.as_primitive::<Float64Type>().value(row).to_bits()),
        DataType::Int64 => Cell::Count(column.as_primitive::<Int64Type>().value(row)),
        DataType::Boolean => Cell::Flag(column.as_boolean().value(row)),
        DataType::Utf8 => Cell::Text(column.as_string::<i32>().value(row).to_owned()),
        other => panic!("a column of {other}"),
    }
}
