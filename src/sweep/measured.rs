//! `[measured]`: the slips of a sweep were measured, not computed. `stickslip measured` writes it.

use super::source::{Entry, Refused, Section, all};
use crate::table::value::Field as _;

/// Where measured slips come from.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Empty if a program gave them.
    pub files: Vec<SourceFile>,
    /// SHA-256 of the numbers that were read: what ids depend on.
    pub rows: String,
    /// The flags that read the files again.
    pub options: String,
    /// Of a trace with one run.
    pub trace: Option<TraceSource>,
    /// Columns of slips that are known beside the onset.
    columns: Vec<String>,
    /// Those of them that have another unit than the model's, or none: `drop` alone can be one.
    pub pure: Vec<String>,
}

/// How a trace is read again.
#[derive(Clone, Debug)]
pub struct TraceSource {
    /// Of `--column` and `--set`, each `KEY=FROM:UNIT`.
    pub columns: Vec<String>,
    pub settings: Vec<String>,
    pub decimal_comma: bool,
}

/// A file that was read.
#[derive(Clone, Debug, Default)]
pub struct SourceFile {
    pub name: String,
    pub bytes: u64,
    /// Empty if it was a pipe.
    pub sha256: String,
}

/// Columns of slips and jobs that are always known.
const KNOWN: &[&str] = &[
    "slip",
    "onset",
    "interval",
    "T_onset",
    "Delta_onset",
    "periods",
    "phase",
    "outcome",
    "reason",
    "slips",
];

impl Measured {
    pub(super) fn read(section: &Section<'_>) -> Result<Self, Refused> {
        section.only(&[
            "files", "bytes", "sha256", "rows", "options", "series", "columns", "pure", "trace",
            "settings", "commas",
        ])?;
        let required = |key| section.required(key, "`stickslip measured` writes this section");
        let text = |entry: &Entry<'_>| {
            let text = entry.word().map(str::to_owned);
            text.ok_or_else(|| entry.must_be("a text"))
        };
        let list = |key| {
            let entry = required(key)?;
            entry.list().ok_or_else(|| entry.must_be("a list"))
        };
        let texts = |key| all(list(key)?.iter().map(text));
        let trace = section.entry("trace").map(|_| -> Result<_, Refused> {
            let decimal_comma = required("commas")?;
            let flag = decimal_comma.value().and_then(bool::from_value);
            Ok(TraceSource {
                columns: texts("trace")?,
                settings: texts("settings")?,
                decimal_comma: flag.ok_or_else(|| decimal_comma.must_be("true or false"))?,
            })
        });
        // Where each series begins is for readers alone.
        texts("series")?;
        let names = texts("files")?;
        let lengths = list("bytes")?;
        let lengths = all(lengths.iter().map(|entry| entry.count(0, u64::MAX)))?;
        let checksums = texts("sha256")?;
        let is_whole = names.len() == lengths.len() && names.len() == checksums.len();
        if !is_whole {
            return Err(required("files")?.must_be("as long as bytes and sha256"));
        }
        let files = names.into_iter().zip(lengths).zip(checksums);
        let file = |((name, bytes), sha256)| SourceFile {
            name,
            bytes,
            sha256,
        };
        Ok(Self {
            files: files.map(file).collect(),
            rows: text(&required("rows")?)?,
            options: text(&required("options")?)?,
            trace: trace.transpose()?,
            columns: texts("columns")?,
            pure: texts("pure")?,
        })
    }

    /// Whether a column of slips or jobs is known.
    pub fn has(&self, column: &str) -> bool {
        KNOWN.contains(&column) || self.columns.iter().any(|known| known == column)
    }
}
