//! Tables as files: Parquet, by its types, or CSV.
//!
//! Contract: a file is read as it is, or refused; each refusal of a row names its line. A library that panics on a
//! damaged file makes an error. Memory: what a row holds beside its file is that of [`Rows`].

use super::keys::Sources;
use super::rows::{Rows, is_missing};
use crate::sweep::{Measured, SourceFile};
use crate::table::checksum::hexadecimal;
use crate::table::value::words;
use anyhow::{Context, Result, anyhow, bail, ensure};
use arrow_ipc::reader::StreamReader;
use arrow_schema::Schema;
use bytes::Bytes;
use csv::{StringRecord, Terminator};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::reader::ChunkReader;
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::mpsc::sync_channel;
use std::thread;

/// A file as it is known again, but for its name: reads to the end, in pieces.
fn identified(mut from: impl Read) -> io::Result<SourceFile> {
    let mut hasher = Sha256::new();
    let mut piece = vec![0; 1 << 20];
    let mut bytes = 0;
    loop {
        let count = from.read(&mut piece)?;
        if count == 0 {
            break;
        }
        bytes += count as u64;
        hasher.update(&piece[..count]);
    }
    Ok(SourceFile {
        name: String::new(),
        bytes,
        sha256: hexadecimal(&hasher.finalize()),
    })
}

words! {
    /// A file of measured slips, compared with what was read.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Compared {
        Same = "as it was read",
        Differs = "differs from what was read",
        Absent = "is not there",
        Unreadable = "cannot be read",
        Pipe = "came from a pipe, and is gone",
    }
}

/// Compares files with what was read.
pub fn compare_files(measured: &Measured) -> impl Iterator<Item = (&str, Compared)> {
    let compare = |file: &SourceFile| -> io::Result<Compared> {
        if file.sha256.is_empty() {
            return Ok(Compared::Pipe);
        }
        let Some(found) = open_regular(Path::new(&file.name))? else {
            return Ok(Compared::Absent);
        };
        let has_length = found.metadata()?.len() == file.bytes;
        let is_same = has_length && identified(found)?.sha256 == file.sha256;
        Ok(if is_same {
            Compared::Same
        } else {
            Compared::Differs
        })
    };
    let files = measured.files.iter();
    files.map(move |file| (&*file.name, compare(file).unwrap_or(Compared::Unreadable)))
}

/// Opens a regular file; `None` if there is none. Nothing else is opened, as it could wait for ever.
pub fn open_regular(path: &Path) -> io::Result<Option<File>> {
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_file() => File::open(path).map(Some),
        Ok(_) => Ok(None),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// Whether a path is that of an open pipe of this process, which can be read once.
fn is_stream(path: &Path) -> bool {
    let streams = ["/dev/stdin", "/dev/fd", "/proc/self/fd"];
    streams.iter().any(|stream| path.starts_with(stream))
}

/// A table that can be read more than once.
#[derive(Debug)]
pub enum SourceTable {
    File(File),
    /// Of a pipe.
    Bytes(Bytes),
    /// In Arrow's own format, as a program that runs writes it: no file, which could be damaged.
    Stream(Vec<u8>),
}

/// Rows of a table at which they are passed on.
const PIECE: usize = 1 << 16;

/// Opens a table, and says how its file is known again, but for its name; a pipe, which is gone, has no checksum.
pub fn open(path: &Path) -> Result<(SourceTable, SourceFile)> {
    if is_stream(path) {
        let mut bytes = Vec::new();
        File::open(path)?.read_to_end(&mut bytes)?;
        return Ok((SourceTable::Bytes(bytes.into()), SourceFile::default()));
    }
    let file = open_regular(path)?;
    let file = file.context("is no file; save the table to one, or give it through /dev/stdin")?;
    let known = identified(file.get_read(0)?)?;
    Ok((SourceTable::File(file), known))
}

/// Takes rows and forgets them.
pub type Take<'a> = &'a mut dyn FnMut(&mut Rows) -> Result<()>;

impl SourceTable {
    /// Reads all rows.
    pub fn rows(&self, sources: &Sources, decimal_comma: bool) -> Result<Rows> {
        self.read(sources, decimal_comma, &mut |_| Ok(()))
    }

    /// Reads rows in pieces; returns what was not taken of them.
    pub fn read(&self, sources: &Sources, decimal_comma: bool, take: Take<'_>) -> Result<Rows> {
        let mut take_complete = |rows: &mut Rows| {
            rows.finish()?;
            take(rows)
        };
        let take = &mut take_complete;
        let mut rows = match self {
            Self::File(file) => read_table(file.try_clone()?, sources, decimal_comma, take)?,
            Self::Bytes(bytes) => read_table(bytes.clone(), sources, decimal_comma, take)?,
            Self::Stream(bytes) => read_stream(bytes, sources, take)?,
        };
        take(&mut rows)?;
        Ok(rows)
    }
}

fn read_table(
    table: impl ChunkReader + 'static,
    sources: &Sources,
    decimal_comma: bool,
    take: Take<'_>,
) -> Result<Rows> {
    let mut begin = Vec::new();
    table.get_read(0)?.take(4).read_to_end(&mut begin)?;
    if begin == b"PAR1" {
        ensure!(
            !decimal_comma,
            "is Parquet, whose numbers have no decimal commas"
        );
        let read = catch_unwind(AssertUnwindSafe(|| read_parquet(table, sources, take)));
        return read.unwrap_or_else(|_| bail!("is damaged: its reader broke off; write it again"));
    }
    let text = BufReader::new(table.get_read(0)?);
    read_text(text, sources, decimal_comma, take)
}

fn read_parquet(
    table: impl ChunkReader + 'static,
    sources: &Sources,
    take: Take<'_>,
) -> Result<Rows> {
    let builder = ParquetRecordBatchReaderBuilder::try_new(table)?;
    let mut rows = Rows::new(&names_of(builder.schema()), sources)?;
    let mask = ProjectionMask::roots(builder.parquet_schema(), rows.places());
    let builder = builder.with_projection(mask).with_batch_size(PIECE);
    let batches = builder.build()?;
    // One thread decodes while another takes what was decoded.
    let (decoded, ready) = sync_channel(1);
    thread::scope(|scope| {
        // If the rows are refused, nobody takes the rest.
        scope.spawn(move || {
            batches
                .map(|batch| decoded.send(batch))
                .take_while(Result::is_ok)
                .for_each(drop);
        });
        for batch in ready {
            rows.push_batch(&batch?)?;
            take(&mut rows)?;
        }
        Ok(rows)
    })
}

fn read_stream(bytes: &[u8], sources: &Sources, take: Take<'_>) -> Result<Rows> {
    let schema = StreamReader::try_new(bytes, None)?.schema();
    let mut rows = Rows::new(&names_of(&schema), sources)?;
    for batch in StreamReader::try_new(bytes, Some(rows.places()))? {
        rows.push_batch(&batch?)?;
        take(&mut rows)?;
    }
    Ok(rows)
}

fn names_of(schema: &Schema) -> Vec<String> {
    let fields = schema.fields().iter();
    fields.map(|field| field.name().clone()).collect()
}

const NOT_TEXT: &str = "is neither Parquet nor text in UTF-8; save it as one of them, or read it with pandas or SciPy in Python";

/// Reads CSV: names stand in the first line that is not empty and no remark, and their separator is that of all.
fn read_text(
    mut text: impl BufRead,
    sources: &Sources,
    decimal_comma: bool,
    take: Take<'_>,
) -> Result<Rows> {
    let mut remark = None;
    let mut line = String::new();
    let mut number = 0;
    loop {
        line.clear();
        let read = text.read_line(&mut line);
        let length = read.map_err(|error| match error.kind() {
            io::ErrorKind::InvalidData => anyhow!(NOT_TEXT),
            _ => error.into(),
        })?;
        number += 1;
        let content = line.trim_start_matches('\u{feff}').trim();
        if length > 0 && content.starts_with('#') {
            remark = Some((number, content.to_owned()));
        } else if length == 0 || !content.is_empty() {
            break;
        }
    }
    let head = line.trim_start_matches('\u{feff}');
    let separator = separator_of(head);
    let reader = |text| {
        csv::ReaderBuilder::new()
            .delimiter(separator)
            .terminator(Terminator::Any(b'\n'))
            .trim(csv::Trim::All)
            .flexible(true)
            .has_headers(false)
            .from_reader(text)
    };
    let names = reader(Box::new(head.as_bytes()) as Box<dyn Read>)
        .records()
        .next();
    let names = names.transpose()?.unwrap_or_default();
    let names: Vec<String> = names.iter().map(str::to_owned).collect();
    check_names(&names, number, remark)?;
    let mut rows = Rows::new(&names, sources)?;
    // Each row ends, so that lines are counted right.
    let mut reader = reader(Box::new(text.chain(&b"\n"[..])));
    let mut record = StringRecord::new();
    let mut begin = number + 1;
    while reader
        .read_record(&mut record)
        .map_err(|error| match error.kind() {
            csv::ErrorKind::Utf8 { .. } => anyhow!("line {begin}: {NOT_TEXT}"),
            _ => error.into(),
        })?
    {
        // The next one begins below it; empty lines count.
        let end = number + reader.position().line() - 1;
        let is_broken = record.iter().any(|cell| cell.contains('\n'));
        ensure!(
            !is_broken,
            "line {begin}: a cell has several lines: is a quote left open?"
        );
        begin = end + 1;
        if record.len() == 1 && record[0].is_empty() {
            continue;
        }
        let [found, expected] = [record.len(), names.len()];
        ensure!(
            found == expected,
            "line {end}: {found} cells for {expected} columns: cut off, or decimal commas between commas?"
        );
        let text = |place: usize| &record[place];
        let added = rows.push_texts(end, text, |text| parse(text, decimal_comma));
        added.with_context(|| format!("line {end}"))?;
        if rows.count.is_multiple_of(PIECE) {
            take(&mut rows)?;
        }
    }
    Ok(rows)
}

/// The separator that a line of names has most, outside of quotes.
fn separator_of(line: &str) -> u8 {
    let unquoted: String = line.split('"').step_by(2).collect();
    let count = |separator: &u8| unquoted.matches(char::from(*separator)).count();
    let separators = [b',', b';', b'\t'];
    separators.into_iter().max_by_key(count).unwrap_or(b',')
}

/// Refuses a first line that holds no names.
fn check_names(names: &[String], line: u64, remark: Option<(u64, String)>) -> Result<()> {
    let first = names.first().map_or("", String::as_str);
    if first.to_lowercase().starts_with("sep=") {
        bail!("line {line}: {first} is for Excel alone; remove the line");
    }
    let is_number = |name: &String| is_missing(name) || parse(name, name.contains(',')).is_ok();
    if names.is_empty() || !names.iter().all(is_number) {
        return Ok(());
    }
    match remark {
        Some((line, remark)) => bail!(
            "line {line}: if {remark} names the columns, remove the # before them: names stand in the first line that does not begin with #"
        ),
        None => bail!(
            "line {line}: has numbers where names of columns must stand; write a line of names above"
        ),
    }
}

/// The number that a text says, NaN if it says that there is none.
fn parse(text: &str, decimal_comma: bool) -> Result<f64> {
    if is_missing(text) {
        return Ok(f64::NAN);
    }
    let number = if decimal_comma {
        ensure!(
            !text.contains('.'),
            "has a point; with --decimal-comma there is none, not even between thousands"
        );
        text.replace(',', ".").parse::<f64>()
    } else {
        ensure!(
            !text.contains(','),
            "has a comma; if commas are decimal in this file, add --decimal-comma"
        );
        text.parse()
    };
    let number = number.ok().filter(|number| number.is_finite());
    number.context("must be a number")
}
