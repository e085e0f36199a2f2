//! A results directory as it was found: opened once, valid from then on. Any version is read; only the current one is
//! run.

use crate::results::commit::Commit;
use crate::results::destination::refuse_reserved;
use crate::results::extension_file::{self, Record};
use crate::results::layout::{FIGURES, Layout, RUN, RUN_FOLDERS, is_hidden, is_table_file};
use crate::results::tables::{OptionalTable, RecordedTable};
use crate::results::workers::{self, Member};
use crate::sweep::{Extension, Part, PartName, Plan, Round, Sweep};
use crate::table::error::{ErrorKind, ResultsError};
use crate::table::file::{DataFile, Dataset, Footer};
use crate::table::storage::{StorageError, disk, gone_is_fine};
use std::collections::BTreeSet;
use std::io;
use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// A results directory: where it lies, and which sweeps it belongs to. Finished parts are looked up each time.
#[derive(Clone, Debug)]
pub struct Results<'a> {
    layout: Layout<'a>,
    records: Vec<Record>,
    /// At least one; the last belongs to the current sweep.
    extensions: Vec<Extension>,
    /// What the footers of the parts of each extension hold beside program and place.
    footers: Vec<Arc<Footer>>,
}

pub(super) const STRANGER: &str =
    "no part of this directory has this name, and readers of the folder would take it for one";

impl<'a> Results<'a> {
    /// Begins, resumes or extends the directory of a sweep. Nothing is written if it is refused.
    fn open(layout: &Layout<'a>, member: &Member<'a>, sweep: &Sweep) -> Result<Self, ResultsError> {
        loop {
            let found = Self::look(layout, sweep)?;
            if found.is_of(sweep) {
                found.write_copies(|| Ok(member.commit()))?;
                return Ok(found);
            }
            // In this order: a living worker that was taken for dead can commit nothing any more. Its files of
            // unfinished parts must go, since their jobs now belong to the new sweep.
            member.tidy(false)?;
            let done = found.done_parts()?;
            found.remove_unfinished(&done)?;
            if let Some(begun) = found.extended(sweep, &done).write_last(member)? {
                return Ok(begun);
            }
        }
    }

    /// Opens the directory of a sweep as one of its workers, while `body` runs. Nothing is written if it is refused.
    pub fn join<T, E: From<ResultsError>>(
        layout: &Layout<'a>,
        sweep: &Sweep,
        threads: usize,
        body: impl FnOnce(&Member<'a>, &Self) -> Result<T, E>,
    ) -> Result<T, E> {
        Self::look(layout, sweep)?.done_parts()?;
        let folder = layout.storage.ensure_folder(layout.root());
        folder.map_err(ResultsError::from)?;
        workers::join(layout, sweep, threads, |member| {
            let opened = Self::open(layout, member, sweep);
            let ended = match &opened {
                Ok(results) => body(member, results),
                Err(error) => Err(error.clone().into()),
            };
            if ended.is_ok() {
                return ended;
            }
            // A directory that was moved, or taken over by others, explains any other error.
            let place_error = opened.ok().and_then(|results| results.check_place().err());
            let moved = place_error.filter(|error| error.kind == ErrorKind::Refused);
            match moved.or_else(|| member.taken_over()) {
                Some(reason) => Err(reason.into()),
                None => ended,
            }
        })
    }

    /// The directory of a sweep as a run would find it; nothing is written.
    pub fn preview(layout: &Layout<'a>, sweep: &Sweep) -> Result<Self, ResultsError> {
        let found = Self::look(layout, sweep)?;
        if found.is_of(sweep) {
            Ok(found)
        } else {
            Ok(found.extended(sweep, &found.done_parts()?))
        }
    }

    /// Reads a directory of any version.
    pub fn read(layout: &Layout<'a>) -> Result<Self, ResultsError> {
        let results = Self::new(layout, extension_file::read(layout)?.records)?;
        if results.records.is_empty() {
            Err(layout.no_results())
        } else {
            Ok(results)
        }
    }

    /// Reads a directory whose plan is that of this program, so that missing jobs are known.
    pub fn read_plan(layout: &Layout<'a>) -> Result<Self, ResultsError> {
        let results = Self::read(layout)?;
        results.refuse(
            &results.version_differences(),
            "use the program that wrote it; `stickslip show` reads it",
        )?;
        Ok(results)
    }

    pub(super) fn new(layout: &Layout<'a>, records: Vec<Record>) -> Result<Self, ResultsError> {
        let extensions = extension_file::extensions(layout, &records)?;
        let all = records.iter().zip(&extensions);
        let footers =
            all.map(|(record, extension)| Arc::new(record.footer(extension.sweep.name())));
        Ok(Self {
            layout: layout.clone(),
            footers: footers.collect(),
            records,
            extensions,
        })
    }

    /// Looks into a directory that a sweep is to be run in; one without extensions is fresh.
    fn look(layout: &Layout<'a>, sweep: &Sweep) -> Result<Self, ResultsError> {
        // In this order: another run may begin in between.
        let was_fresh = is_fresh(layout)?;
        let found = Self::new(layout, extension_file::read(layout)?.records)?;
        if found.records.is_empty() {
            if layout.root().is_symlink() && !layout.root().exists() {
                let problem =
                    "is a link that leads nowhere; remove it, or choose another with --out";
                return Err(ResultsError::refused(layout.root(), problem));
            }
            if was_fresh {
                refuse_reserved(layout.root())?;
                return Ok(found);
            }
            let problem = "is neither empty nor a results directory (there is no run/extension-000.json); choose another \
                           with --out, or see what `stickslip verify` says of it";
            return Err(ResultsError::refused(layout.root(), problem));
        }
        found.refuse_differences(sweep)?;
        Ok(found)
    }

    /// Refuses a sweep with other versions, settings or recording, and values that look like those of existing results.
    fn refuse_differences(&self, sweep: &Sweep) -> Result<(), ResultsError> {
        let mut differences = self.version_differences();
        differences.extend(self.sweep().differences(sweep));
        let mut way_out = "choose another directory with --out, or undo the change".to_owned();
        let [before, now] = [self.sweep(), sweep].map(|sweep| sweep.recording().slips);
        if let (Some(before), Some(now)) = (before, now)
            && differences.len() == 1
            && now > before
        {
            way_out = format!(
                "for more slips add seeds here and keep slips = {before}, or choose another directory with --out: a \
                 finished job cannot be lengthened"
            );
        }
        self.refuse(&differences, &way_out)?;
        if self.is_of(sweep) {
            return Ok(());
        }
        let done = self.done_parts()?;
        let has_results = |number| done.iter().any(|part| part.extension == number);
        let mut known = (0..self.extensions.len()).filter(|number| has_results(*number));
        match known.find_map(|number| sweep.twin_of(&self.extensions[number].sweep)) {
            Some(problem) => Err(ResultsError::refused(self.layout.root(), problem)),
            None => Ok(()),
        }
    }

    pub(super) fn is_of(&self, sweep: &Sweep) -> bool {
        self.extensions
            .last()
            .is_some_and(|last| last.sweep.text() == sweep.text())
    }

    pub(super) fn version_differences(&self) -> Vec<String> {
        let all = self.records.iter().zip(&self.extensions);
        all.map(|(record, extension)| record.difference(&extension.sweep))
            .max_by_key(Vec::len)
            .unwrap_or_default()
    }

    /// Refuses a directory that differs in something, with the way out.
    pub(super) fn refuse(&self, differences: &[String], way_out: &str) -> Result<(), ResultsError> {
        if differences.is_empty() {
            return Ok(());
        }
        let lines = differences.join("\n  ");
        let problem = format!("holds other results, nothing was changed:\n  {lines}\n{way_out}");
        Err(ResultsError::refused(self.layout.root(), problem))
    }

    /// The same with this sweep after the others, which keep their finished parts. Walks through the plan.
    fn extended(&self, sweep: &Sweep, done: &BTreeSet<PartName>) -> Self {
        let last = self.extensions.len().checked_sub(1);
        let kept = last
            .map(|last| Plan::new(&self.extensions).ranges(last, |part| done.contains(&part.name)));
        self.followed_by(sweep, sweep.first_round(), kept)
    }

    /// The same with a round of a sweep after the others, of which the last keeps these points, or all.
    pub(super) fn followed_by(
        &self,
        sweep: &Sweep,
        round: Option<Round>,
        kept: Option<Vec<RangeInclusive<u64>>>,
    ) -> Self {
        let mut all = self.clone();
        if let Some(last) = all.extensions.last_mut() {
            last.kept.clone_from(&kept);
        }
        let extension = Extension::in_round(sweep, &all.extensions, round);
        let record = Record::new(&extension, &self.records, kept);
        all.footers.push(Arc::new(record.footer(sweep.name())));
        all.records.push(record);
        all.extensions.push(extension);
        all
    }

    /// Writes the files of the last extension; `None` if another worker was first.
    pub(super) fn write_last(self, member: &Member<'_>) -> Result<Option<Self>, ResultsError> {
        let number = self.records.len() - 1;
        let file = self.layout.extension(number);
        let text = self.records[number].text();
        if !member.commit().create_new(&file, text.as_bytes())? {
            return Ok(None);
        }
        self.write_copies(|| Ok(member.commit()))?;
        Ok(Some(self))
    }

    /// Writes missing files of extensions. Another worker may do so at the same time.
    pub(super) fn write_copies(
        &self,
        begin: impl Fn() -> Result<Commit<'a>, StorageError>,
    ) -> Result<(), ResultsError> {
        let listed = self.layout.listed_extensions()?;
        for (number, record) in self.records.iter().enumerate() {
            for file in self.layout.files_of_extension(number) {
                let there = listed.get(&number);
                if !there.is_some_and(|there| there.contains(&file)) {
                    self.layout.ensure_folder(&self.layout.copies())?;
                    begin()?.create_new(&file, record.text().as_bytes())?;
                }
            }
        }
        Ok(())
    }

    /// Makes sure that the directory is still the one that was opened: another one must not get rows of its sweeps.
    pub fn check_place(&self) -> Result<(), ResultsError> {
        let last = self.records.len() - 1;
        for file in self.layout.files_of_extension(last) {
            let found = match self.layout.storage.read(&file) {
                Err(error) if error.is_missing() || error.is_no_file() => None,
                bytes => Some(bytes?),
            };
            if found.is_some_and(|bytes| bytes == self.records[last].text().as_bytes()) {
                return Ok(());
            }
        }
        let problem = "the results directory was moved, removed or replaced since it was opened; \
                       move it back or name its new place, and the same command resumes";
        Err(ResultsError::refused(self.layout.root(), problem))
    }

    /// The parts that have a file in a table. Names that no part of this directory can have are damage.
    pub fn parts_of(&self, table: RecordedTable) -> Result<BTreeSet<PartName>, ResultsError> {
        let folder = self.layout.table(table);
        let mut parts = BTreeSet::new();
        let names = self.layout.names_in(&folder)?.into_iter();
        for name in names.filter(|name| is_table_file(name)) {
            match PartName::of_path(name.as_ref()) {
                Some(part) if part.extension < self.extensions.len() => _ = parts.insert(part),
                // A run may have added an extension since the directory was opened.
                Some(_) if self.layout.listed_extensions()?.len() > self.extensions.len() => (),
                _ => return Err(ResultsError::damaged(&folder.join(name), STRANGER)),
            }
        }
        Ok(parts)
    }

    pub fn dataset(&self, table: RecordedTable) -> Result<Dataset<'a>, ResultsError> {
        let tables = self.layout.tables();
        let parts = self.parts_of(table)?.into_iter();
        let files = parts.map(|part| self.file_in(&tables, table, part));
        Ok(Dataset::of(self.layout.storage, files.collect()))
    }

    pub(super) fn dataset_of(&self, table: RecordedTable, part: PartName) -> Dataset<'a> {
        let file = self.file_in(&self.layout.tables(), table, part);
        Dataset::of(self.layout.storage, vec![file])
    }

    /// The file of a part of a table, below the tables or the spill.
    pub(super) fn file_in(&self, place: &Path, table: RecordedTable, part: PartName) -> DataFile {
        DataFile {
            path: place.join(table.word()).join(part.file()),
            rows: 0..=u64::MAX,
            footer: Arc::clone(&self.footers[part.extension]),
        }
    }

    pub fn done_parts(&self) -> Result<BTreeSet<PartName>, ResultsError> {
        if self.extensions.is_empty() {
            return Ok(BTreeSet::new());
        }
        // The jobs first: a part that has its jobs had its other files before.
        let mut done = self.parts_of(RecordedTable::Jobs)?;
        for table in self.tables().filter(|table| *table != RecordedTable::Jobs) {
            done = &done & &self.parts_of(table)?;
        }
        Ok(done)
    }

    /// Removes what earlier runs left of unfinished parts: files of some of their tables, and spilled jobs.
    fn remove_unfinished(&self, done: &BTreeSet<PartName>) -> Result<(), StorageError> {
        let layout = &self.layout;
        let spill = layout.spill();
        for above in [layout.tables(), spill.clone()] {
            for folder in RecordedTable::ALL.map(|table| above.join(table.word())) {
                let mut parts = layout.parts_in(&folder)?;
                // A worker that begins the same sweep now may run parts of the next extension.
                parts.retain(|part| part.extension < self.extensions.len());
                parts.retain(|part| above == spill || !done.contains(part));
                for part in &parts {
                    layout.remove(&folder.join(part.file()))?;
                }
                if !parts.is_empty() {
                    layout.storage.sync_folder(&folder)?;
                }
            }
        }
        Ok(())
    }

    /// Refuses folders on another disk than that of the staging folder, as no file could be moved to them.
    pub fn check_disks(&self) -> Result<(), ResultsError> {
        let layout = &self.layout;
        let mut folders = vec![
            layout.tables(),
            layout.spill(),
            layout.reduced(),
            layout.figures(),
        ];
        folders.extend(RecordedTable::ALL.map(|table| layout.table(table)));
        let staging = disk(&layout.staging(""));
        for folder in folders {
            let found = disk(&folder);
            if found.is_some() && staging.is_some() && found != staging {
                let problem = "is on another disk or mount than run/staging, and no file can be moved to it as a whole; \
                               make it a plain folder, or place the whole results directory on the other disk with --out";
                return Err(ResultsError::refused(&folder, problem));
            }
        }
        Ok(())
    }

    /// Moves staged files to their targets, if the directory, in which they lie, is still in its place.
    pub fn publish(&self, commit: Commit<'_>) -> Result<(), ResultsError> {
        self.check_place()?;
        Ok(commit.publish()?)
    }

    /// The same with reduced data in another folder, which is there as long as this.
    pub fn reduced_to(&self, elsewhere: TempDir) -> Self {
        let mut same = self.clone();
        same.layout.elsewhere = Some(Arc::new(elsewhere));
        // Elsewhere there are no workers.
        same.layout.worker = None;
        same
    }

    pub const fn layout(&self) -> &Layout<'a> {
        &self.layout
    }

    /// The sweeps that were run here, in order.
    pub fn extensions(&self) -> &[Extension] {
        &self.extensions
    }

    /// The current sweep: the one that was run last.
    pub fn sweep(&self) -> &Sweep {
        &self.extensions[self.extensions.len() - 1].sweep
    }

    pub fn plan(&self) -> Plan<'_> {
        Plan::new(&self.extensions)
    }

    /// The footer of files that are made from all tables: it has the current sweep.
    pub fn footer_of_all(&self) -> Footer {
        Footer::default().with_sweep(self.sweep().name(), self.sweep().text())
    }

    /// The tables, that of the jobs last.
    pub fn tables(&self) -> impl DoubleEndedIterator<Item = RecordedTable> {
        RecordedTable::of(self.sweep().recording())
    }

    pub fn has(&self, table: OptionalTable) -> bool {
        match table {
            OptionalTable::Edges => self.sweep().refinement().is_some(),
            OptionalTable::Triggers | OptionalTable::Pulses => {
                self.plan().sweeps().any(Sweep::has_pulses)
            }
        }
    }

    /// Those that this directory has.
    pub fn optional_tables(&self) -> impl Iterator<Item = OptionalTable> + '_ {
        let all = OptionalTable::ALL.into_iter();
        all.filter(|table| self.has(*table))
    }

    pub fn job_id(&self, part: &Part, position: usize) -> String {
        self.extensions[part.name.extension]
            .sweep
            .job_id(&part.jobs[position].parameters)
    }

    /// Syncs the names of results, as a process may have been killed between a rename and the sync after it.
    pub fn sync_names(&self) -> Result<(), StorageError> {
        let layout = &self.layout;
        for above in layout.root().ancestors().skip(1) {
            // Most of these belong to others, and need not allow it.
            let _ = layout.storage.sync_folder(above);
        }
        let mut folders = vec![
            layout.root().to_owned(),
            layout.run(),
            layout.copies(),
            layout.tables(),
        ];
        folders.extend(RecordedTable::ALL.map(|table| layout.table(table)));
        for folder in folders {
            gone_is_fine(layout.storage.sync_folder(&folder))?;
        }
        Ok(())
    }
}

/// Whether a directory is empty, or holds only what a run leaves that was killed before its first extension, or the
/// figure of a trace that was refused.
pub(super) fn is_fresh(layout: &Layout<'_>) -> Result<bool, StorageError> {
    let storage = layout.storage;
    let holds_only = |folder: &Path, known: &[&str]| -> Result<bool, StorageError> {
        let mut names = storage.list(folder)?.into_iter();
        Ok(names.all(|name| is_hidden(&name) || known.iter().any(|known| name == *known)))
    };
    match holds_only(layout.root(), &[RUN, FIGURES]) {
        // Another program's file stands in its place.
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => Ok(false),
        is_fresh => Ok(is_fresh?
            && holds_only(&layout.run(), &RUN_FOLDERS)?
            && holds_only(&layout.figures(), &["drop-size.svg", "drop-size.png"])?),
    }
}
