//! The text of a sweep file: sections, entries and values that know their place, and errors that name it.
//!
//! A mistake is reported where it is found, and [`Refused`] says so from there on: the reader continues with what does
//! not depend on it, and all mistakes of a file are reported at once.
//!
//! Reads TOML with spans (crate `toml`), so that every refusal says file, line, key and value as written. Not by
//! serde's derive: the keys come from tables ([`fields!`](crate::model::fields)) or are open, and its errors name
//! neither the value as written nor the way out.

use super::quantity::{Quantity, hint, nearest};
use crate::table::shown::{shown, shown_text};
use crate::table::value::{Field, Value};
use std::cell::RefCell;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    #[error(
        "{}: cannot be read: {source}; check the path and its permissions",
        shown(path)
    )]
    Unreadable {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}: is not UTF-8 text; save it as UTF-8, or name a sweep file", shown(.0))]
    NotUtf8(PathBuf),
    /// The file does not say what to run.
    #[error("{}", listed(path, mistakes))]
    Invalid {
        path: PathBuf,
        /// At least one, in the order of their lines.
        mistakes: Vec<Mistake>,
    },
    /// Flags, or other things that a text was made of, do not say what to run.
    #[error("{0}")]
    Made(String),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Line, counted from 1.
    pub line: usize,
    /// Key, value, what is allowed and the way out.
    pub problem: String,
}

/// Longest value that an error message shows, in characters.
const MAX_EXCERPT: usize = 40;
/// Most mistakes that an error message shows.
const MAX_SHOWN: usize = 10;

/// One mistake on its line, several below each other.
fn listed(path: &Path, mistakes: &[Mistake]) -> String {
    let path = shown(path);
    let shown =
        |Mistake { line, problem }: &Mistake| format!("{path}:{line}: {}", shown_text(problem));
    if let [mistake] = mistakes {
        return shown(mistake);
    }
    let heading = format!("{path}: has {} mistakes:", mistakes.len());
    let mut lines = vec![heading];
    lines.extend(mistakes.iter().take(MAX_SHOWN).map(shown));
    if mistakes.len() > MAX_SHOWN {
        lines.push(format!("and {} more", mistakes.len() - MAX_SHOWN));
    }
    lines.join("\n  ")
}

/// Something was refused, and its [`Source`] has the mistake.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refused(());

/// Reads everything, so that all mistakes are reported, whether or not one of them makes the whole useless.
pub(super) fn all<T>(read: impl Iterator<Item = Result<T, Refused>>) -> Result<Vec<T>, Refused> {
    read.collect::<Vec<_>>().into_iter().collect()
}

/// A file, its text, and the mistakes that were found in it.
pub(super) struct Source<'a> {
    path: &'a Path,
    pub text: &'a str,
    /// What the text was made of, such as flags: its author knows no lines of it, and no `[model]`.
    pub made_of: Option<&'a str>,
    /// Each with the byte of the text that it is about.
    mistakes: RefCell<Vec<(usize, String)>>,
}

impl<'a> Source<'a> {
    pub const fn new(path: &'a Path, text: &'a str) -> Self {
        Self {
            path,
            text,
            made_of: None,
            mistakes: RefCell::new(Vec::new()),
        }
    }

    pub fn refuse(&self, at: usize, problem: impl Into<String>) -> Refused {
        self.mistakes.borrow_mut().push((at, problem.into()));
        Refused(())
    }

    pub fn passed(&self) -> Result<(), Refused> {
        match self.mistakes.borrow()[..] {
            [] => Ok(()),
            _ => Err(Refused(())),
        }
    }

    pub fn error(&self) -> SweepError {
        let mut mistakes = self.mistakes.take();
        mistakes.sort_unstable();
        // A misspelt key that stands for a required key is met twice.
        mistakes.dedup();
        if let Some(of) = self.made_of {
            let between = if mistakes.len() > 1 { "\n  " } else { " " };
            let problems = mistakes.into_iter().map(|(_, problem)| problem);
            let joined = problems.collect::<Vec<_>>().join(between);
            return SweepError::Made(format!("in the {of}:{between}{joined}"));
        }
        let placed = |(at, problem)| Mistake {
            line: self.line(at),
            problem,
        };
        SweepError::Invalid {
            path: self.path.to_owned(),
            mistakes: mistakes.into_iter().map(placed).collect(),
        }
    }

    /// Where a key stands, as messages name it.
    pub fn in_section(&self, title: &str) -> String {
        if self.made_of.is_some() && title == "[model]" {
            String::new()
        } else {
            format!(" in {title}")
        }
    }

    /// The line of a byte of the text, as messages name it; empty where nobody knows lines.
    pub fn line_in_words(&self, at: usize) -> String {
        match self.made_of {
            Some(_) => String::new(),
            None => format!(" (line {})", self.line(at)),
        }
    }

    /// The line of a byte of the text, counted from 1.
    pub fn line(&self, at: usize) -> usize {
        let before = self.text.as_bytes().get(..at).unwrap_or_default();
        before.split(|byte| *byte == b'\n').count()
    }

    pub fn table(&self) -> Result<DeTable<'a>, Refused> {
        // Only the first error: others mostly follow from it.
        let parsed = DeTable::parse(self.text).map(Spanned::into_inner);
        parsed.map_err(|error| {
            let span = error.span().unwrap_or(self.text.len()..self.text.len());
            // The end of the file lies on its last line, not below it.
            let at = span.start.min(self.text.trim_end().len());
            let mut written = self.excerpt(span);
            if written.is_empty() {
                let mut lines = self.text.lines();
                written.push_str(lines.nth(self.line(at) - 1).unwrap_or_default());
            }
            let problem = error.message();
            let problem = format!("{written}: {problem}; the file must be TOML 1.0");
            self.refuse(at, problem)
        })
    }

    /// The first line of a stretch of text, shortened.
    fn excerpt(&self, span: Range<usize>) -> String {
        let text = self.text.get(span).unwrap_or_default();
        let line = text.lines().next().unwrap_or_default().trim_end();
        if line.chars().count() > MAX_EXCERPT || line.len() < text.trim_end().len() {
            format!("{}...", line.chars().take(MAX_EXCERPT).collect::<String>())
        } else {
            line.to_owned()
        }
    }
}

/// A table of the file under its name.
pub(super) struct Section<'a> {
    pub source: &'a Source<'a>,
    /// As errors name it: `[model]`, `the file`.
    pub title: &'static str,
    /// Byte of its heading.
    pub at: usize,
    pub table: &'a DeTable<'a>,
}

impl<'a> Section<'a> {
    /// The entries in the order of the file.
    pub fn entries(&self) -> Vec<Entry<'a>> {
        let unsorted = self.table.iter().map(|(key, node)| Entry {
            source: self.source,
            key: key.get_ref(),
            at: key.span().start,
            node,
        });
        let mut entries: Vec<_> = unsorted.collect();
        entries.sort_by_key(|entry| entry.at);
        entries
    }

    pub fn entry(&self, key: &str) -> Option<Entry<'a>> {
        self.entries().into_iter().find(|entry| entry.key == key)
    }

    /// Byte of an entry, or of the heading if it is not there.
    pub fn place_of(&self, key: &str) -> usize {
        self.entry(key).map_or(self.at, |entry| entry.at)
    }

    /// An entry that must be there, unless a misspelt one was meant; `need` says what it is for.
    pub fn required(&self, key: &str, need: &str) -> Result<Entry<'a>, Refused> {
        let is_near = |entry: &Entry<'_>| nearest(entry.key, &[key]).is_some();
        self.entry(key).ok_or_else(|| {
            if let Some(misspelt) = self.entries().into_iter().find(is_near) {
                return misspelt.unknown(self.title, &[key]);
            }
            let problem = format!("{key} is missing in {}: {need}", self.title);
            self.source.refuse(self.at, problem)
        })
    }

    pub fn only(&self, allowed: &[&str]) -> Result<(), Refused> {
        let mut unknown = self.entries();
        unknown.retain(|entry| !allowed.contains(&entry.key));
        let refused = unknown
            .iter()
            .map(|entry| Err(entry.unknown(self.title, allowed)));
        all(refused).map(|_: Vec<()>| ())
    }
}

/// A key and its value, or a key and one value of its list.
#[derive(Clone, Copy)]
pub(super) struct Entry<'a> {
    pub source: &'a Source<'a>,
    pub key: &'a str,
    /// Byte of the text that errors point to.
    pub at: usize,
    pub node: &'a Spanned<DeValue<'a>>,
}

impl<'a> Entry<'a> {
    pub fn refuse(&self, problem: impl AsRef<str>) -> Refused {
        let reason = problem.as_ref();
        let value = match self.node.get_ref() {
            DeValue::Table(_) => String::new(),
            _ => format!(" = {}", self.source.excerpt(self.node.span())),
        };
        self.source
            .refuse(self.at, format!("{}{value}: {reason}", self.key))
    }

    pub fn must_be(&self, allowed: &str) -> Refused {
        self.refuse(format!("must be {allowed}"))
    }

    pub fn unknown(&self, title: &str, allowed: &[&str]) -> Refused {
        let hint = match self.key {
            "name" | "where" => format!("{} must stand above the first [section]", self.key),
            key if title == "the file" && Quantity::from_key(key).is_some() => {
                "parameters belong in [model] or [axes]".to_owned()
            }
            key => hint(key, allowed),
        };
        let place = self.source.in_section(title);
        self.refuse(format!("unknown key{place}; {hint}"))
    }

    /// The values of a list, each at its own place.
    pub fn list(&self) -> Option<Vec<Self>> {
        let nodes = self.node.get_ref().as_array()?.iter();
        let values = nodes.map(|node| Self {
            at: node.span().start,
            node,
            ..*self
        });
        Some(values.collect())
    }

    pub fn section(&self, title: &'static str) -> Option<Section<'a>> {
        let table = self.node.get_ref().as_table()?;
        Some(Section {
            source: self.source,
            title,
            at: self.at,
            table,
        })
    }

    pub fn word(&self) -> Option<&'a str> {
        self.node.get_ref().as_str()
    }

    /// The value as written: a count where it is one.
    pub fn value(&self) -> Option<Value<'a>> {
        match self.node.get_ref() {
            DeValue::Integer(integer) => {
                let digits = integer.as_str();
                let count = u64::from_str_radix(digits, integer.radix()).ok();
                let real = digits.parse().ok().filter(|_| integer.radix() == 10);
                count.map(Value::Count).or(real.map(Value::Real))
            }
            DeValue::Float(float) => float.as_str().parse().map(Value::Real).ok(),
            DeValue::Boolean(flag) => Some(Value::Flag(*flag)),
            // As `plan` and the template show what is not set; TOML has no null.
            DeValue::String(word) if word == "none" => Some(Value::Null),
            DeValue::String(word) => Some(Value::Text(word)),
            _ => None,
        }
    }

    /// A finite number that `fits`, as the words `allowed` say.
    pub fn number(&self, allowed: &str, fits: impl Fn(f64) -> bool) -> Result<f64, Refused> {
        let number = self.value().and_then(Value::number);
        let fitting = number.filter(|number| number.is_finite() && fits(*number));
        fitting.ok_or_else(|| self.must_be(allowed))
    }

    pub fn count(&self, min: u64, max: u64) -> Result<u64, Refused> {
        match self.value().and_then(u64::from_value) {
            Some(count) if (min..=max).contains(&count) => Ok(count),
            _ => Err(self.must_be(&format!("a whole number from {min} to {max}"))),
        }
    }
}
