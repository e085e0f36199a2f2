//! A results directory that fits this program: opened once, valid from then on.

use crate::results::commit::{Commit, alone};
use crate::results::error::ResultsError;
use crate::results::layout::{Layout, RUN, RUN_FOLDERS};
use crate::results::manifest::{self, Manifest};
use crate::results::parts::DoneParts;
use crate::results::tables;
use crate::sweep::{Extension, Job, Part, Plan, Sweep};
use crate::table::file::Footer;
use crate::table::storage::StorageError;
use std::io::ErrorKind;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

/// How long to wait for what a host of a network disk does not see yet, and between two looks.
const LATE: Duration = if cfg!(test) { Duration::from_millis(300) } else { Duration::from_mins(1) };
const LATE_PAUSE: Duration = if cfg!(test) { Duration::ZERO } else { Duration::from_millis(200) };

/// A results directory: where it lies, and which sweeps it belongs to. What of it is done is looked up when it is asked
/// for, since other processes may be at work on it.
#[derive(Clone, Debug)]
pub struct Results<'a> {
    layout: Layout<'a>,
    /// At least one; the last is that of the sweep that was asked for last.
    extensions: Vec<Extension>,
}

impl<'a> Results<'a> {
    /// Opens the directory of a sweep: begins it, resumes it, or extends it.
    /// Nothing is written if the directory is refused.
    pub fn open(layout: &Layout<'a>, sweep: &Sweep) -> Result<Self, ResultsError> {
        let before = Found::look(layout, sweep, 0)?;
        let results = Self::new(layout, before.extensions(sweep));
        if before.is_of(sweep) {
            return Ok(results);
        }
        layout.storage.ensure_folder(layout.root())?;
        let _alone = alone(layout, manifest::WRITER)?;
        // In this order: another run may have written the manifest before the lock was ours, and who is at work has.
        let at_work = layout.living(SystemTime::now())?;
        let found = Found::look(layout, sweep, 0)?;
        let is_as_before = (&found.manifest, &found.done) == (&before.manifest, &before.done);
        let results = if is_as_before { results } else { Self::new(layout, found.extensions(sweep)) };
        if !found.is_of(sweep) {
            let mut living = layout.living(SystemTime::now())?.into_iter();
            if let Some((_, other)) = living.find(|(name, _)| at_work.contains_key(name)) {
                let problem = format!(
                    "{}, for another sweep file; wait for it or stop it, or choose another directory with --out",
                    other.doing()
                );
                return Err(ResultsError::busy(layout.root(), problem));
            }
            // It is of parts that are no more.
            layout.storage.remove_folder(&layout.spill())?;
            Manifest::new(&results.extensions).write(layout)?;
        }
        Ok(results)
    }

    /// The directory of a sweep as a run would find it; nothing is written.
    pub fn preview(layout: &Layout<'a>, sweep: &Sweep) -> Result<Self, ResultsError> {
        Ok(Self::new(layout, Found::look(layout, sweep, 0)?.extensions(sweep)))
    }

    /// Reads a directory as it is.
    pub fn read(layout: &Layout<'a>) -> Result<Self, ResultsError> {
        let (manifest, extensions) = manifest::read_with_sweeps(layout)?.ok_or_else(|| layout.no_results())?;
        manifest::refuse(layout, &manifest.difference(&Manifest::new(&extensions)), "use the program that wrote it")?;
        Ok(Self::new(layout, extensions))
    }

    pub(super) fn new(layout: &Layout<'a>, extensions: Vec<Extension>) -> Self {
        Self { layout: layout.clone(), extensions }
    }

    /// Makes sure that the directory is still the one that was opened. Another that has taken its place belongs to other
    /// sweeps, so rows of these must not get into it.
    pub fn check_place(&self) -> Result<(), ResultsError> {
        let found = Manifest::read(&self.layout)?;
        let text = self.sweep().text();
        let is_ours = |manifest: &Manifest| {
            let found = &manifest.extensions;
            // A run may have added a sweep since. Or, without locks, another was late to write an earlier round of this
            // sweep: those that it lacks follow from it.
            let lacking = self.extensions.get(found.len()..).unwrap_or_default();
            found.iter().zip(&self.extensions).all(|(found, ours)| found.is_of(ours))
                && lacking.iter().all(|ours| ours.round.is_some() && ours.sweep.text() == text)
                && (lacking.is_empty() || found.last().is_some_and(|last| last.sweep == text))
        };
        if found.as_ref().is_some_and(is_ours) {
            return Ok(());
        }
        let problem = "the results directory was moved, removed or replaced since it was opened; \
                       move it back or name its new place, and the same command resumes";
        Err(ResultsError::refused(self.layout.root(), problem))
    }

    /// Moves staged files to their targets, if the directory is still in its place. Should it be moved after this check,
    /// the staged files, which lie in it, are not found.
    pub fn publish(&self, commit: Commit<'_>) -> Result<(), ResultsError> {
        self.check_place()?;
        Ok(commit.publish()?)
    }

    /// Where it and everything in it lie.
    pub const fn layout(&self) -> &Layout<'a> {
        &self.layout
    }

    /// What was run here, one sweep after the other.
    pub fn extensions(&self) -> &[Extension] {
        &self.extensions
    }

    /// The sweep that was asked for last.
    pub fn sweep(&self) -> &Sweep {
        &self.extensions[self.extensions.len() - 1].sweep
    }

    /// All jobs in their parts.
    pub fn plan(&self) -> Plan<'_> {
        Plan::new(&self.extensions)
    }

    /// What the footers of table files with rows of an extension hold.
    pub fn footer(&self, extension: usize) -> Footer {
        let sweep = &self.extensions[extension].sweep;
        Footer::default().with_sweep(sweep.name(), sweep.text())
    }

    /// Names of the tables, that of the jobs last.
    pub fn tables(&self) -> impl Iterator<Item = &'static str> + use<> {
        let precursors = self.sweep().recording().precursors.then_some(tables::PRECURSORS);
        [Some(tables::SLIPS), precursors, Some(tables::JOBS)].into_iter().flatten()
    }

    /// Whether a job of a part is one of the sweep that was asked for last; results of others are kept.
    pub fn wants(&self, part: &Part, job: &Job) -> bool {
        part.extension + 1 == self.extensions.len() || self.sweep().contains(&job.parameters)
    }

    /// The id of a job of a part.
    pub fn job_id(&self, part: &Part, position: usize) -> String {
        self.extensions[part.extension].sweep.job_id(&part.jobs[position].parameters).to_string()
    }

    /// Brings the names of results to the disk: a process that was killed between a rename, or the creation of a
    /// folder, and the sync after it leaves names that are seen but would not survive a power cut.
    pub fn sync_names(&self) -> Result<(), StorageError> {
        for above in self.layout.root().ancestors().skip(1) {
            // Most are not ours, and who made the folders in them synced them if that is possible at all.
            let _ = self.layout.storage.sync_folder(if above.as_os_str().is_empty() { Path::new(".") } else { above });
        }
        for folder in self.layout.result_folders() {
            match self.layout.storage.sync_folder(&folder) {
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                synced => synced?,
            }
        }
        Ok(())
    }
}

/// What a directory holds that a sweep can be run in: its extensions, and which parts are done; none if it is fresh.
pub(super) struct Found {
    manifest: Option<Manifest>,
    pub extensions: Vec<Extension>,
    pub done: DoneParts,
}

impl Found {
    /// Looks into a directory where this process has `own` workers.
    pub fn look(layout: &Layout<'_>, sweep: &Sweep, own: usize) -> Result<Self, ResultsError> {
        let begin = Instant::now();
        // In this order: another run may write the manifest in between, and none removes it.
        let mut seen = (is_fresh(layout)?, manifest::read_with_sweeps(layout)?);
        while begin.elapsed() < LATE && is_late(layout, seen.1.as_ref().map(|(manifest, _)| manifest), sweep, own)? {
            std::thread::sleep(LATE_PAUSE);
            seen = (is_fresh(layout)?, manifest::read_with_sweeps(layout)?);
        }
        let (is_fresh, found) = seen;
        let Some((manifest, extensions)) = found else {
            if layout.root().is_symlink() && !layout.root().exists() {
                let problem = "is a link that leads nowhere; remove it, or choose another with --out";
                return Err(ResultsError::refused(layout.root(), problem));
            }
            if is_fresh {
                return Ok(Self { manifest: None, extensions: Vec::new(), done: DoneParts::default() });
            }
            let problem =
                "is neither empty nor a results directory (there is no run/manifest.json); choose another with --out";
            return Err(ResultsError::refused(layout.root(), problem));
        };
        let before = Results::new(layout, extensions);
        let done = before.done_parts()?;
        let mut differences = manifest.difference(&Manifest::new(&before.extensions));
        differences.extend(before.sweep().difference(sweep).iter().map(ToString::to_string));
        if before.sweep().recording().max_time != sweep.recording().max_time && done.any_is_compacted() {
            differences.push("record.max_time: jobs that it ended cannot run again once they are compacted".to_owned());
        }
        manifest::refuse(layout, &differences, "choose another directory with --out, or undo the change")?;
        Ok(Self { manifest: Some(manifest), extensions: before.extensions, done })
    }

    /// Whether this sweep was the one asked for last.
    pub fn is_of(&self, sweep: &Sweep) -> bool {
        self.extensions.last().is_some_and(|last| last.sweep.text() == sweep.text())
    }

    /// The extensions once the directory is opened with this sweep. Walks through the plan where they are others.
    fn extensions(&self, sweep: &Sweep) -> Vec<Extension> {
        let mut extensions = self.extensions.clone();
        if self.is_of(sweep) {
            return extensions;
        }
        if let Some(last) = extensions.len().checked_sub(1) {
            // What is done stays where it is; what is not belongs to the new sweep, or to none.
            extensions[last].kept = Some(Plan::new(&extensions).ranges(last, |part| self.done.has(part)));
        }
        extensions.push(Extension::new(sweep, &extensions));
        extensions
    }
}

/// Whether a host of a network disk sees an older manifest than its listing has. The copies of sweep files come first, so
/// one that the manifest does not have says so, or was left by a run that was killed between the two.
fn is_late(layout: &Layout<'_>, manifest: Option<&Manifest>, sweep: &Sweep, own: usize) -> Result<bool, StorageError> {
    let names = match layout.storage.list(&layout.run()) {
        // A file at this place is somebody else's.
        Err(error) if error.kind() == ErrorKind::NotADirectory => return Ok(false),
        names => names?,
    };
    if manifest.is_none() && names.iter().any(|name| Some(name.as_os_str()) == layout.manifest().file_name()) {
        return Ok(true);
    }
    let known = manifest.map_or(0, |manifest| manifest.extensions.len());
    let Some(copy) = layout.sweeps()?.into_iter().nth(known) else { return Ok(false) };
    // If nobody is at work, to write the same again mends it.
    let is_ours = layout.storage.read(&copy).is_ok_and(|text| text == sweep.text().as_bytes());
    Ok(!is_ours || layout.living(SystemTime::now())?.len() > own)
}

/// Whether a directory holds nothing, or no more than what a run leaves that was killed before it had a manifest.
pub(super) fn is_fresh(layout: &Layout<'_>) -> Result<bool, StorageError> {
    let storage = layout.storage;
    let first_sweep = layout.sweep(0);
    let ours = |name: &std::ffi::OsString| {
        RUN_FOLDERS.iter().any(|folder| name == folder) || Some(name.as_os_str()) == first_sweep.file_name()
    };
    match storage.list(layout.root()) {
        // A file at this place is somebody else's.
        Err(error) if error.kind() == ErrorKind::NotADirectory => Ok(false),
        names => Ok(names?.iter().all(|name| name == RUN) && storage.list(&layout.run())?.iter().all(ours)),
    }
}
