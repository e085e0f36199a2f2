//! Directories in one figure: the dots of the first, and others as hollow marks; their names, and what differs between
//! them.

use super::files::{ADVICE, read, sets_with_results};
use super::legend::{LegendEntry, Mark, entry};
use super::note::common;
use super::options::{BadOption, check_text};
use super::style::{HOLLOW, Look};
use crate::model::{Parameters, Symbol};
use crate::reduce::{BackboneBin, Condition, Difference, Point, advise};
use crate::results::Results;
use crate::sets::SetRow;
use anyhow::Result;
use std::ops::Range;
use std::path::Path;

/// A directory beside the first.
#[derive(Clone, Debug)]
pub(super) struct Other {
    pub(super) sets: Vec<SetRow>,
    pub(super) points: Vec<Point>,
    pub(super) bins: Vec<BackboneBin>,
}

/// What figures show beside their own directory.
#[derive(Clone, Debug, Default)]
pub struct Beside {
    /// Of all directories, the first one first; none if that is the only one.
    names: Vec<String>,
    pub(super) others: Vec<Other>,
}

impl Beside {
    /// Reads the others, whose reduced data are up to date. `names` are those of all; by default, their last folders,
    /// or the paths of those whose last folders are the same.
    pub fn read(first: &Results<'_>, others: &[Results<'_>], names: &[String]) -> Result<Self> {
        let all = std::iter::once(first).chain(others);
        let roots: Vec<&Path> = all.map(|results| results.layout().root()).collect();
        if others.len() > HOLLOW.len() {
            let count = others.len().to_string();
            let problem = format!("{} directories have a mark each", HOLLOW.len());
            return Err(BadOption::new("with", &count, &problem).into());
        }
        if !names.is_empty() && (names.len() != roots.len() || others.is_empty()) {
            let problem = format!(
                "{} directories are drawn: give a name for each, the first one first",
                roots.len()
            );
            return Err(BadOption::new("legend", &names.join(" --legend "), &problem).into());
        }
        for name in names {
            check_text("legend", name)?;
        }
        let read_other = |other: &Results<'_>| {
            let layout = other.layout();
            Ok(Other {
                sets: sets_with_results(layout).map_err(advise(ADVICE))?,
                points: read(layout)?,
                bins: read(layout)?,
            })
        };
        let names = match (names, others) {
            (_, []) => Vec::new(),
            ([], _) => short_names(&roots),
            (names, _) => names.to_vec(),
        };
        Ok(Self {
            names,
            others: others.iter().map(read_other).collect::<Result<_>>()?,
        })
    }

    /// Entries of a legend for all directories: the mark of the first, if it has any, and hollow ones of those that
    /// have some.
    pub(super) fn entries(
        &self,
        first: Option<Mark>,
        has_marks: impl Fn(usize) -> bool,
    ) -> Vec<LegendEntry> {
        let hollow = |other| has_marks(other).then_some(Mark::Hollow(other));
        let others = (0..self.others.len()).map(hollow);
        let found = std::iter::once(first).chain(others);
        let marks = found.map(|mark| mark.unwrap_or(Mark::Absent));
        let entry = |(mark, name)| entry(mark, name);
        marks.zip(&self.names).map(entry).collect()
    }

    /// Sets followed by those of the others, and which these are.
    pub(super) fn with_others(&self, mut sets: Vec<SetRow>) -> (Vec<SetRow>, Vec<Range<usize>>) {
        let mut ranges = Vec::new();
        for other in &self.others {
            let begin = sets.len();
            sets.extend(other.sets.iter().cloned());
            ranges.push(begin..sets.len());
        }
        (sets, ranges)
    }

    /// Leaves sets out for which a condition does not hold.
    pub(super) fn retain(&mut self, condition: &Condition) {
        for other in &mut self.others {
            other.sets.retain(|set| condition.holds(set));
        }
    }

    fn differences(&self, first: &[SetRow]) -> Vec<Difference> {
        let others = self.others.iter().map(|other| &other.sets[..]);
        let sets = std::iter::once(first).chain(others).map(parameters_of);
        Difference::all(&sets.collect::<Vec<_>>())
    }

    /// The name of each directory, the first one having these sets, and in what it differs from others.
    pub fn described(&self, first: &[SetRow]) -> impl Iterator<Item = (&str, String)> {
        let differences = self.differences(first);
        let settings = move |place| Difference::settings(&differences, place);
        let names = self.names.iter().enumerate();
        names.map(move |(place, name)| (&**name, settings(place)))
    }

    /// A look with what is common to these sets of the first directory in its small print, and, in a line for each
    /// directory, what differs between them.
    pub(super) fn look(&self, look: &Look, first: &[SetRow]) -> Look {
        let differences = self.differences(first);
        let differing: Vec<Symbol> = differences.iter().map(|found| found.symbol).collect();
        let line = |(name, settings): (&str, String)| format!("{name}: {settings}");
        let described = self
            .described(first)
            .filter(|(_, settings)| !settings.is_empty());
        Look {
            directories: described.map(line).collect(),
            ..look.with_note(&common(parameters_of(first).into_iter(), &differing))
        }
    }
}

fn parameters_of(sets: &[SetRow]) -> Vec<&Parameters> {
    sets.iter().map(|set| &*set.parameters).collect()
}

/// The last folder of each path, or the path as it was given if another one ends so, too.
fn short_names(paths: &[&Path]) -> Vec<String> {
    let name = |path: &&Path| {
        let last = path.file_name();
        let alike = paths.iter().filter(|other| other.file_name() == last);
        let folder = last.filter(|_| alike.count() == 1);
        folder
            .unwrap_or(path.as_os_str())
            .to_string_lossy()
            .into_owned()
    };
    paths.iter().map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_last_folders_or_whole_paths_of_those_that_end_alike() {
        let names = |paths: &[&str]| {
            let paths: Vec<&Path> = paths.iter().map(Path::new).collect();
            short_names(&paths)
        };
        assert_eq!(
            names(&["/r/model", "may/out/", ".."]),
            ["model", "out", ".."]
        );
        assert_eq!(names(&["model", "/may/out"]), ["model", "out"]);
        assert_eq!(
            names(&["model", "may/out", "out"]),
            ["model", "may/out", "out"]
        );
    }
}
