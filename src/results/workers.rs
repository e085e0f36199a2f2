//! Workers: the processes that run jobs of a directory, known to each other by a file each.
//!
//! `run/workers/<name>` holds host, process and threads. The worker writes it again every [`BEAT`], and removes it when
//! it ends. On its own host a process is looked up. On another host it lives if its file is at most [`SILENCE`] older
//! than that of the worker that looks: both times are the file server's, so no clocks are compared.
//!
//! A worker commits from its staging folder alone. A worker that takes over the parts of a dead worker, or begins
//! another sweep, removes the dead worker's folder first. So a suspended worker that wakes commits nothing, and reports
//! why. All living workers run the same sweep: of two that join for different sweeps at once, one at least sees the
//! other, and leaves.

use crate::results::commit::{Commit, own_number};
use crate::results::layout::{AGAIN, Layout, claim, shorter_in_tests, stays};
use crate::results::tables::RecordedTable;
use crate::sweep::Sweep;
use crate::table::checksum;
use crate::table::error::{ErrorKind, ResultsError};
use crate::table::shown::shown_text;
use crate::table::storage::{StorageError, gone_is_fine};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::ThreadId;
use std::time::{Duration, Instant, SystemTime};

pub const BEAT: Duration = shorter_in_tests(Duration::from_secs(5), Duration::from_secs(1));
/// A worker of another host is dead if its file is older by this time than the file of the worker that looks.
pub const SILENCE: Duration = shorter_in_tests(Duration::from_mins(1), Duration::from_secs(4));
pub(crate) const BEAT_THREAD: &str = "beat";
/// What the names of workers, and of their staging folders, begin with.
pub(super) const PREFIX: &str = "worker-";
/// What the name of a worker's file ends with while it is being written.
const NEW: &str = ".new";
/// Staged file whose links are the claims of a worker.
const CLAIM: &str = "claim";
/// What stands behind the name of a worker in a claim that it has given back.
pub(super) const GIVEN_BACK: &str = " gave it back";

/// A process, as its file says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Worker {
    pub host: String,
    pub process: u32,
    /// Boot and name space of its processes, within which it can look them up. Empty if unknown.
    system: String,
    /// When it began, in the ticks of its system: a later process may have the same id.
    process_start: Option<u64>,
    /// The identity of its results directory, where the host has one.
    directory: Option<Directory>,
    /// Checksum of its sweep file.
    sweep: String,
    pub threads: usize,
    /// Jobs that it has finished, in a second.
    pub jobs_per_second: f64,
}

/// What identifies a directory on a host, also once it was moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Directory {
    device: u64,
    inode: u64,
}

impl Directory {
    fn of(root: &Path) -> Option<Self> {
        let metadata = std::fs::metadata(root).ok()?;
        Some(Self {
            device: metadata.dev(),
            inode: metadata.ino(),
        })
    }
}

/// Names of the workers of this process, and their threads. In tests, a worker may die and its process live on.
static OWN: Mutex<BTreeMap<String, ThreadId>> = Mutex::new(BTreeMap::new());

fn own() -> MutexGuard<'static, BTreeMap<String, ThreadId>> {
    // Nothing panics while it is held.
    OWN.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Worker {
    fn here(sweep: &Sweep, threads: usize) -> Self {
        let process = std::process::id();
        Self {
            host: host(),
            process,
            system: system(),
            process_start: process_start(process),
            directory: None,
            sweep: checksum::of_text(sweep.text()),
            threads,
            jobs_per_second: 0.0,
        }
    }

    /// Whether the process lives and works at this directory, if it is one that can be looked up.
    fn lives_here(&self, name: &str, directory: Option<Directory>) -> Option<bool> {
        let can_look =
            !self.system.is_empty() && self.system == system() && self.process_start.is_some();
        if !can_look {
            return None;
        }
        let is_lost = self.process == std::process::id() && !own().contains_key(name);
        if is_lost || process_start(self.process) != self.process_start {
            return Some(false);
        }
        match (self.directory, directory) {
            // A copy of a directory has the files of the workers of the original.
            (Some(its), Some(here)) if its.device == here.device => Some(its.inode == here.inode),
            // Another device may be another mount of the same directory: heartbeats decide.
            (Some(_), Some(_)) => None,
            _ => Some(true),
        }
    }
}

/// Name of this host.
pub fn host() -> String {
    let system = rustix::system::uname();
    system.nodename().to_string_lossy().into_owned()
}

pub fn plain(host: &str) -> String {
    host.replace(|c: char| !c.is_ascii_alphanumeric() && c != '-', "_")
}

/// The boot of the kernel and the name space of processes.
fn system() -> String {
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    let space = std::fs::read_link("/proc/self/ns/pid").unwrap_or_default();
    if boot.is_empty() {
        String::new()
    } else {
        format!("{} {}", boot.trim(), space.display())
    }
}

/// When a process began, in ticks since the boot; `None` if it has ended.
fn process_start(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // Behind the name in brackets: state, ..., the 22nd field of all.
    let mut fields = status.rsplit_once(')')?.1.split_whitespace();
    match fields.next()? {
        "Z" | "X" => None,
        _ => fields.nth(18)?.parse().ok(),
    }
}

/// A worker that lives, as far as another can know.
#[derive(Clone, Debug)]
pub struct Living {
    pub worker: Worker,
    /// Its last heartbeat, by the clock of the file system.
    pub beat: SystemTime,
    /// Whether the process was looked up.
    pub is_certain: bool,
}

/// This process among the workers of a directory, until it is dropped.
#[derive(Debug)]
pub struct Member<'a> {
    layout: Layout<'a>,
    name: String,
    worker: Worker,
    begin: Instant,
    jobs: AtomicU64,
    /// Its claims of parts that it has not finished, each with its generation.
    unfinished: Mutex<BTreeMap<String, u64>>,
}

/// Joins the workers on a directory, which must be there, and is one of them while `body` runs.
pub(super) fn join<'a, T, E: From<ResultsError>>(
    layout: &Layout<'a>,
    sweep: &Sweep,
    threads: usize,
    body: impl FnOnce(&Member<'a>) -> Result<T, E>,
) -> Result<T, E> {
    let member = &Member::join(layout, Worker::here(sweep, threads))?;
    member.refuse_another_sweep()?;
    std::thread::scope(|scope| {
        let (end, ended) = channel::<()>();
        let beats = move || {
            while matches!(ended.recv_timeout(BEAT), Err(RecvTimeoutError::Timeout)) {
                // A beat that cannot be written costs double work at worst.
                let _ = member.beat();
            }
        };
        let thread = std::thread::Builder::new().name(BEAT_THREAD.to_owned());
        // Without beats, workers of other hosts take this one for dead: double work.
        let _ = thread.spawn_scoped(scope, beats);
        let _end = end;
        body(member)
    })
}

impl Layout<'_> {
    /// The workers that live, by their names. Compares beats with `now`, by the clock of the file system.
    pub fn living(&self, now: SystemTime) -> Result<BTreeMap<String, Living>, StorageError> {
        let mut living = BTreeMap::new();
        let directory = Directory::of(self.root());
        for name in self.storage.list(&self.workers())? {
            let path = self.workers().join(&name);
            let name = name.to_string_lossy().into_owned();
            if !name.starts_with(PREFIX) || name.ends_with(NEW) {
                continue;
            }
            let (text, beat) = match self.read_beat(&path) {
                // The worker ends at this moment.
                Err(error) if error.is_missing() || error.is_no_file() => continue,
                // A worker whose file cannot be read may still be running.
                found => found?,
            };
            // A power cut can leave a file that does not parse.
            let Ok(worker) = serde_json::from_slice::<Worker>(&text) else {
                continue;
            };
            let lives_here = worker.lives_here(&name, directory);
            let is_certain = lives_here.is_some();
            let age = now.duration_since(beat).unwrap_or_default();
            if lives_here.unwrap_or(age < SILENCE) {
                living.insert(
                    name,
                    Living {
                        worker,
                        beat,
                        is_certain,
                    },
                );
            }
        }
        Ok(living)
    }

    fn read_beat(&self, path: &Path) -> Result<(Vec<u8>, SystemTime), StorageError> {
        let read = || Ok((self.storage.read(path)?, self.storage.modified(path)?));
        read().or_else(|error: StorageError| match error.kind() {
            // A heartbeat has replaced the file while it was read.
            io::ErrorKind::StaleNetworkFileHandle => read(),
            _ => Err(error),
        })
    }
}

impl<'a> Member<'a> {
    fn join(layout: &Layout<'a>, worker: Worker) -> Result<Self, ResultsError> {
        let host = plain(&worker.host);
        let number = own_number();
        let name = format!("{PREFIX}{host}-{}-{number:016x}", worker.process);
        own().insert(name.clone(), std::thread::current().id());
        let member = Self {
            layout: layout.of_worker(&name),
            name,
            worker,
            begin: Instant::now(),
            jobs: AtomicU64::new(0),
            unfinished: Mutex::default(),
        };
        layout.ensure_folder(&layout.workers())?;
        // First, so that no other worker takes the staging folder for that of a dead worker.
        member.beat()?;
        match member.stage_claim() {
            Ok(()) => Ok(member),
            Err(error) => Err(member.taken_over().unwrap_or_else(|| error.into())),
        }
    }

    pub const fn layout(&self) -> &Layout<'a> {
        &self.layout
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn staging(&self) -> PathBuf {
        self.layout.staging(&self.name)
    }

    pub(super) fn claim(&self) -> PathBuf {
        self.staging().join(CLAIM)
    }

    fn unfinished(&self) -> MutexGuard<'_, BTreeMap<String, u64>> {
        // Nothing panics while it is held.
        self.unfinished
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    pub fn count_job(&self) {
        self.jobs.fetch_add(1, Ordering::Relaxed);
    }

    fn beat(&self) -> Result<(), StorageError> {
        let jobs_per_second =
            self.jobs.load(Ordering::Relaxed) as f64 / self.begin.elapsed().as_secs_f64();
        let worker = Worker {
            directory: Directory::of(self.layout.root()),
            jobs_per_second,
            ..self.worker.clone()
        };
        // It always has a form as JSON: it holds texts and numbers alone.
        let text = serde_json::to_string(&worker).unwrap_or_default();
        let storage = self.layout.storage;
        let new = self.layout.workers().join(format!("{}{NEW}", self.name));
        loop {
            // A beat that failed may have left it.
            let _ = storage.remove(&new);
            storage.create(&new)?.write(text.as_bytes())?;
            match storage.rename(&new, &self.file()) {
                // A worker that saw no other took it for that of a dead worker, which happens a few times at most.
                Err(error) if error.kind() == io::ErrorKind::NotFound => (),
                renamed => return renamed,
            }
        }
    }

    fn file(&self) -> PathBuf {
        self.layout.workers().join(&self.name)
    }

    pub fn others(&self) -> Result<BTreeMap<String, Living>, StorageError> {
        let own = self.layout.storage.modified(&self.file());
        let mut living = self
            .layout
            .living(own.unwrap_or_else(|_| SystemTime::now()))?;
        living.remove(&self.name);
        Ok(living)
    }

    /// Makes the staging folder, and the file whose links are the claims of this worker.
    fn stage_claim(&self) -> Result<(), StorageError> {
        self.layout.ensure_folder(&self.staging())?;
        let mut claim = self.layout.storage.create(&self.claim())?;
        claim.write(self.name.as_bytes())
    }

    /// Says in a claim of this worker that it runs the part no more.
    fn give_back(&self, what: &str, generation: u64) -> Result<(), StorageError> {
        let layout = self.layout();
        let name = format!("{what}.{generation}");
        let text = self.staging().join(&name);
        let given_back = format!("{}{GIVEN_BACK}", self.name());
        layout.storage.create(&text)?.write(given_back.as_bytes())?;
        layout.storage.rename(&text, &layout.claims().join(name))
    }

    /// Notes that it runs a part by this claim.
    pub fn begin_part(&self, what: &str, generation: u64) {
        self.unfinished().insert(what.to_owned(), generation);
    }

    /// Notes that the part is finished.
    pub fn end_part(&self, what: &str) -> Result<(), StorageError> {
        let generation = self.unfinished().remove(what);
        match generation {
            Some(generation) if what.starts_with(AGAIN) => self.give_back(what, generation),
            _ => Ok(()),
        }
    }

    /// Refuses to run beside a worker that runs another sweep.
    fn refuse_another_sweep(&self) -> Result<(), ResultsError> {
        let mut others = self.others()?.into_values().map(|other| other.worker);
        let Some(other) = others.find(|other| other.sweep != self.worker.sweep) else {
            return Ok(());
        };
        let process = other.process;
        let host = shown_text(&other.host);
        let problem = format!(
            "is being run by process {process} on {host}, for another sweep file; wait for it or stop it, or choose \
             another directory with --out"
        );
        let root = self.layout.root();
        Err(ResultsError::new(ErrorKind::Busy, root, problem))
    }

    /// Why it can commit nothing any more, if others took it for dead. A listing is true also on a network disk.
    pub(super) fn taken_over(&self) -> Option<ResultsError> {
        let is_listed = |folder: &Path, name: &str| match self.layout.storage.list(folder) {
            Ok(names) => names.iter().any(|there| there == name),
            Err(_) => true,
        };
        let is_taken_over = is_listed(&self.layout.run(), "staging")
            && !is_listed(&self.layout.staging(""), &self.name);
        let silence = SILENCE.as_secs();
        let problem = format!(
            "this worker gave no sign of life for over {silence} s, as on a machine that was suspended, so others have \
             taken over its work; nothing that was committed is lost, and the same command resumes"
        );
        is_taken_over.then(|| ResultsError::new(ErrorKind::Stopped, self.layout.root(), problem))
    }

    pub(super) fn commit(&self) -> Commit<'a> {
        Commit::within(self.layout.storage, &self.staging())
    }

    /// Removes what dead workers left. Claims go only once this worker is alone, as another may have looked up what is
    /// done before they ended; those of missing parts stay, and, unless a run ends in order, those of jobs that run
    /// again.
    pub fn tidy(&self, is_end: bool) -> Result<(), StorageError> {
        let layout = &self.layout;
        let storage = layout.storage;
        // Listed before the living, so that a worker that joins in between is not in these lists.
        let claims = storage.list(&layout.claims())?;
        let mut left = storage.list(&layout.workers())?;
        left.extend(storage.list(&layout.staging(""))?);
        let others = self.others()?;
        for name in left {
            let name = name.to_string_lossy();
            let may_join = name.ends_with(NEW) && !others.is_empty();
            let is_living = *name == self.name || others.contains_key(&*name);
            if !name.starts_with(PREFIX) || may_join || is_living {
                continue;
            }
            layout.refuse_link(&layout.staging(&name))?;
            storage.remove_folder(&layout.staging(&name))?;
            let file = layout.workers().join(&*name);
            if storage.exists(&file)? {
                layout.remove(&file)?;
            }
        }
        if others.is_empty() {
            layout.refuse_link(&layout.claims().join("any"))?;
            let done = layout.parts_in(&layout.table(RecordedTable::Jobs))?;
            let goes = |(what, _): (&str, u64)| !stays(what, is_end, &done);
            for name in claims.iter().filter(|name| claim(name).is_some_and(goes)) {
                gone_is_fine(storage.remove(&layout.claims().join(name)))?;
            }
        }
        Ok(())
    }
}

impl Drop for Member<'_> {
    fn drop(&mut self) {
        for (what, generation) in std::mem::take(&mut *self.unfinished()) {
            // At worst it counts as a death.
            let _ = self.give_back(&what, generation);
        }
        // What stays is removed when the next worker begins.
        let _ = self.layout.storage.remove_folder(&self.staging());
        let _ = self.layout.storage.remove(&self.file());
        own().remove(&self.name);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::results::ErrorKind;
    use crate::results::directory::Results;
    use crate::sweep::Sweep;
    use crate::table::storage::over_disk::{Access, OverDisk};
    use crate::table::storage::{Disk, Storage};
    use std::fs::{self, File};

    /// Opens a directory as a run does.
    pub fn open<'a>(layout: &Layout<'a>, sweep: &Sweep) -> Result<Results<'a>, ResultsError> {
        Results::join(layout, sweep, 1, |_, results| Ok(results.clone()))
    }

    /// Lets the workers of a thread look dead, as if their machine had been suspended for long.
    pub fn lose(thread: ThreadId) {
        own().retain(|_, of| *of != thread);
    }

    fn sweep() -> Sweep {
        Sweep::parse("name = \"test\"", Path::new("test.toml")).unwrap()
    }

    pub fn results(root: &Path) -> Results<'static> {
        open(&Layout::new(&Disk, root), &sweep()).unwrap()
    }

    /// Leaves the file of a worker on another host, or of one here that was killed, which last beat so long ago.
    pub fn leave(layout: &Layout<'_>, sweep: &Sweep, name: &str, is_here: bool, silent: Duration) {
        let here = Worker::here(sweep, 3);
        let elsewhere = Worker {
            host: "elsewhere".to_owned(),
            system: "another".to_owned(),
            ..here.clone()
        };
        let path = layout.workers().join(name);
        fs::create_dir_all(layout.workers()).unwrap();
        // As a worker beats: nobody sees half of it.
        let new = layout.workers().join(format!("{name}{NEW}"));
        fs::write(
            &new,
            serde_json::to_string(if is_here { &here } else { &elsewhere }).unwrap(),
        )
        .unwrap();
        File::options()
            .write(true)
            .open(&new)
            .unwrap()
            .set_modified(SystemTime::now() - silent)
            .unwrap();
        fs::rename(new, path).unwrap();
    }

    pub fn join<T>(results: &Results<'static>, body: impl FnOnce(&Member<'static>) -> T) -> T {
        Results::join::<_, ResultsError>(results.layout(), &sweep(), 1, |member, _| {
            Ok(body(member))
        })
        .unwrap()
    }

    #[test]
    fn a_worker_is_seen_while_it_lives_and_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let results = results(root.path());
        join(&results, |first| {
            assert!(first.others().unwrap().is_empty());
            join(&results, |second| {
                let seen = &first.others().unwrap()[second.name()];
                assert!(seen.is_certain && seen.worker.process == std::process::id());
                assert_eq!(
                    second.others().unwrap().into_keys().collect::<Vec<_>>(),
                    [first.name()]
                );
            });
            assert!(first.others().unwrap().is_empty());
        });
        for folder in ["run/workers", "run/staging"] {
            let left: Vec<_> = fs::read_dir(root.path().join(folder))
                .unwrap()
                .map(|entry| entry.unwrap().path())
                .collect();
            assert!(left.is_empty(), "{left:?}");
        }
    }

    #[test]
    fn a_worker_killed_here_is_dead_at_once_and_elsewhere_after_a_silence() {
        let root = tempfile::tempdir().unwrap();
        let results = results(root.path());
        let layout = results.layout();
        leave(layout, &sweep(), "worker-here", true, Duration::ZERO);
        leave(layout, &sweep(), "worker-fresh", false, Duration::ZERO);
        leave(layout, &sweep(), "worker-slow", false, SILENCE / 2);
        leave(layout, &sweep(), "worker-dead", false, 2 * SILENCE);
        fs::write(layout.workers().join("worker-torn"), "{").unwrap();
        join(&results, |member| {
            let others = member.others().unwrap();
            assert_eq!(
                others.keys().collect::<Vec<_>>(),
                ["worker-fresh", "worker-slow"]
            );
            assert!(others.values().all(|living| !living.is_certain));
            member.tidy(false).unwrap();
        });
        let mut left: Vec<_> = fs::read_dir(layout.workers())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        left.sort();
        assert_eq!(left, ["worker-fresh", "worker-slow"]);
    }

    #[test]
    #[cfg(unix)]
    fn a_worker_that_cannot_be_read_may_live_and_a_folder_is_no_worker() {
        let root = tempfile::tempdir().unwrap();
        let results = results(root.path());
        join(&results, |member| {
            fs::create_dir(results.layout().workers().join("worker-folder")).unwrap();
            assert!(member.others().unwrap().is_empty());
            // It leads to itself.
            let path = results.layout().workers().join("worker-loop");
            std::os::unix::fs::symlink(&path, &path).unwrap();
            assert!(member.others().unwrap_err().path == path);
            assert!(member.tidy(false).is_err() && path.is_symlink());
            fs::remove_file(path).unwrap();
        });
    }

    #[test]
    fn a_member_beats_as_long_as_it_is_one() {
        let root = tempfile::tempdir().unwrap();
        let results = results(root.path());
        join(&results, |member| {
            let beat = || results.layout().storage.modified(&member.file()).unwrap();
            let first = beat();
            std::thread::sleep(2 * BEAT);
            assert!(beat() > first);
        });
    }

    #[test]
    fn a_worker_that_was_taken_for_dead_commits_nothing_any_more_and_says_why() {
        let root = tempfile::tempdir().unwrap();
        let results = results(root.path());
        let layout = results.layout();
        let target = layout.run().join("target");
        let suspended = Results::join::<(), ResultsError>(layout, &sweep(), 1, |first, _| {
            let mut commit = first.commit();
            commit.stage_bytes(&target, b"late").unwrap();
            lose(std::thread::current().id());
            join(&results, |second| second.tidy(false).unwrap());
            let late = commit.publish();
            assert!(late.is_err() && first.commit().stage(&target).is_err());
            Ok(late?)
        });
        let error = suspended.unwrap_err();
        assert!(
            error.kind == ErrorKind::Stopped && error.to_string().contains("suspended"),
            "{error}"
        );
        assert!(!target.exists());
    }

    /// A disk on which others tidy up so often while a worker joins, and remove its announcement each time.
    struct Tidied {
        workers: PathBuf,
        times: AtomicU64,
    }

    impl OverDisk for Tidied {
        fn before(&self, _: Access) -> io::Result<()> {
            for name in Disk.list(&self.workers).unwrap() {
                if name.to_string_lossy().ends_with(NEW) && self.times.load(Ordering::Relaxed) > 0 {
                    self.times.fetch_sub(1, Ordering::Relaxed);
                    Disk.remove(&self.workers.join(name)).unwrap();
                }
            }
            Ok(())
        }
    }

    #[test]
    fn a_worker_joins_however_often_others_tidy_up_before_it_is_seen() {
        let root = tempfile::tempdir().unwrap();
        let results = results(root.path());
        let disk = Tidied {
            workers: results.layout().workers(),
            times: AtomicU64::new(5),
        };
        let joined = Results::join(
            &Layout::new(&disk, root.path()),
            &sweep(),
            1,
            |member, _| Ok(member.file().exists()),
        );
        assert_eq!(joined, Ok::<_, ResultsError>(true));
        assert_eq!(disk.times.into_inner(), 0);
    }

    #[test]
    fn workers_at_different_sweeps_keep_each_other_out() {
        let root = tempfile::tempdir().unwrap();
        let results = results(root.path());
        let other = Sweep::parse(
            "name = \"test\"\n[axes]\nseed = [1, 2]",
            Path::new("test.toml"),
        )
        .unwrap();
        join(&results, |_| {
            let error = open(results.layout(), &other).unwrap_err();
            assert!(
                error.to_string().contains("for another sweep file"),
                "{error}"
            );
        });
        assert_eq!(
            open(results.layout(), &other).unwrap().extensions().len(),
            2
        );
    }
}
