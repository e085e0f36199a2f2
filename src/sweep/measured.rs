//! `[measured]`: the slips of a sweep were measured, not computed. `stickslip measured` writes it.

use super::grid::Sweep;
use super::source::{Entry, Refused, Section, SweepError, all};

/// Where measured slips come from.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Files, behind their SHA-256.
    pub files: Vec<String>,
    /// The command that reads them again, without the directory of the results.
    pub command: String,
    /// Columns of slips that the files have beside the onset.
    columns: Vec<String>,
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
        section.only(&["files", "series", "command", "columns"])?;
        let required = |key| section.required(key, "`stickslip measured` writes this section");
        let text = |entry: &Entry<'_>| {
            let text = entry.word().map(str::to_owned);
            text.ok_or_else(|| entry.must_be("a text"))
        };
        let texts = |key| {
            let entry = required(key)?;
            let list = entry.list();
            let list = list.ok_or_else(|| entry.must_be("a list of texts"))?;
            all(list.iter().map(text))
        };
        // Where each series begins is for readers alone.
        texts("series")?;
        Ok(Self {
            files: texts("files")?,
            command: text(&required("command")?)?,
            columns: texts("columns")?,
        })
    }

    /// Whether a column of slips or jobs is known.
    pub fn has(&self, column: &str) -> bool {
        KNOWN.contains(&column) || self.columns.iter().any(|known| known == column)
    }
}

impl Sweep {
    /// The same, if its slips are to be computed.
    pub fn computed(self) -> Result<Self, SweepError> {
        if self.measured.is_none() {
            return Ok(self);
        }
        let problem = format!(
            "{}: its slips were measured, and nothing is to be run; `stickslip measured` reads their files again",
            self.name
        );
        Err(SweepError::Made(problem))
    }
}
