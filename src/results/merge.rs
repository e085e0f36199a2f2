//! Merging: the parts of directories in which shards of one sweep were run, put together into one.

use crate::results::commit::{Commit, alone};
use crate::results::error::ResultsError;
use crate::results::events::RunEvent;
use crate::results::handle::Results;
use crate::results::layout::{Layout, MERGER, part_name};
use crate::results::manifest::{self, Manifest};
use crate::sweep::Part;
use crate::table::checksum;
use crate::table::shown::shown;
use serde::Serialize;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Merged {
    /// Parts that were taken over.
    pub parts: u64,
    pub jobs: u64,
    /// Parts that the merged directory had already, from an earlier source or before.
    pub parts_there: u64,
    /// Parts that no directory has.
    pub parts_missing: u64,
    pub jobs_missing: u64,
}

/// Puts the parts of directories of one sweep into another directory, which is begun if it is not there. The sources are
/// not changed; of a part that several have, the first counts.
pub fn merge(sources: &[Layout<'_>], target: &Layout<'_>) -> Result<Merged, ResultsError> {
    let sources: Vec<Results<'_>> = sources.iter().map(Results::read).collect::<Result<_, _>>()?;
    let Some(first) = sources.first() else { return Ok(Merged::default()) };
    let expected = Manifest::new(first.extensions());
    for source in &sources {
        if !Manifest::new(source.extensions()).is_of_same_plan(&expected) {
            let problem = format!(
                "was run with other sweep files than {}, or had other parts done when they changed; merge shards of one sweep",
                shown(first.layout().root())
            );
            return Err(ResultsError::refused(source.layout().root(), problem));
        }
    }
    let is_new = Manifest::read(target)?.is_none();
    let merged = if is_new { Results::begin(target, first)? } else { Results::read(target)? };
    if !Manifest::new(merged.extensions()).is_of_same_plan(&expected) {
        let problem = "holds results of other sweep files; choose another directory with -o";
        return Err(ResultsError::refused(target.root(), problem));
    }
    merged.exclusively(|| merged.take_over(&sources))
}

impl Results<'_> {
    fn take_over(&self, sources: &[Results<'_>]) -> Result<Merged, ResultsError> {
        let done = self.done_parts()?;
        let mut available = Vec::new();
        for source in sources {
            let parts = source.done_parts()?;
            if parts.any_is_compacted() {
                let problem = "is compacted; merge directories before they are, and compact the merged one";
                return Err(ResultsError::refused(source.layout().root(), problem));
            }
            available.push((source, parts));
        }
        let mut log = self.begin_log()?;
        let mut merged = Merged::default();
        for part in self.plan().parts() {
            if done.has(&part) {
                merged.parts_there += 1;
                continue;
            }
            let mut having = available.iter().filter(|(_, parts)| parts.has(&part)).map(|(source, _)| source);
            let Some(source) = having.next() else {
                merged.parts_missing += 1;
                merged.jobs_missing += part.jobs.len() as u64;
                continue;
            };
            merged.parts_there += having.count() as u64;
            self.take_part(source, &part)?;
            merged.parts += 1;
            merged.jobs += part.jobs.len() as u64;
            log.write(&RunEvent::PartMerged { part: part_name(&part) })?;
        }
        Ok(merged)
    }

    /// Takes over the files of a part, as they are.
    fn take_part(&self, source: &Results<'_>, part: &Part) -> Result<(), ResultsError> {
        let storage = self.layout().storage;
        let mut commit = Commit::begin(self.layout(), &self.layout().staging(MERGER))?;
        for table in self.tables() {
            let from = source.part_file(table, part);
            checksum::check(storage, &from)?;
            self.layout().ensure_folder(&self.layout().table(table))?;
            commit.stage_link(&from, &self.part_file(table, part))?;
        }
        self.publish(commit)
    }

    /// Begins a directory with the extensions of another.
    fn begin<'t>(target: &Layout<'t>, of: &Results<'_>) -> Result<Results<'t>, ResultsError> {
        // Refuses what is not empty.
        let first = &of.extensions()[0].sweep;
        Results::preview(target, first)?;
        target.storage.ensure_folder(target.root())?;
        let _alone = alone(target, manifest::WRITER)?;
        Manifest::new(of.extensions()).write(target)?;
        Results::read(target)
    }
}
