//! Locks: which process runs a shard, so that none is run twice at once and that of a dead process can be taken over;
//! and who has a directory to itself, to change what is committed.
//!
//! A lock is one of the operating system on `run/lock/<name>`, and a heartbeat in that file: host, process, and a count
//! that grows as long as the process lives. Within one host the lock alone decides. Other hosts may not see it, as
//! network file systems can be mounted without; there a heartbeat that grows is a living process's, and one that stands
//! still for `TIMEOUT` a dead one's. No clocks are compared. Contract: a lock saves double work, and no more. Should
//! two processes run the same shard, as after a suspended one was taken for dead, they write the same bytes, each under
//! staged names of its own.
//!
//! Who wants a directory alone takes a lock of its own and then looks that no shard is locked; a run locks its shard
//! and then looks that nobody has the directory alone. So at least one of two that begin at once sees the other, and
//! leaves.

use crate::results::commit::token;
use crate::results::error::ResultsError;
use crate::results::events::{UNKNOWN_HOST, host};
use crate::results::handle::Results;
use crate::results::layout::Layout;
use crate::table::storage::{Lock, StorageError};
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant, SystemTime};

/// Time between two heartbeats.
const BEAT: Duration = Duration::from_secs(5);
/// How long a heartbeat must stand still to be a dead process's.
const TIMEOUT: Duration = Duration::from_secs(20);
/// How long to wait for a lock: a look at the status holds it for an instant.
const MAX_WAIT: Duration = Duration::from_millis(500);
/// How often to look whether it is free.
const POLL: Duration = Duration::from_millis(20);
/// Separates the parts of a heartbeat.
const SEPARATOR: char = '\t';
/// Lock of the process that has a directory to itself.
const EXCLUSIVE: &str = "exclusive";
/// What the names of the locks of shards begin with.
const SHARD: &str = "shard-";

impl<'a> Layout<'a> {
    /// Takes the lock of this name; `None` if another process has it.
    fn take_lock(&self, name: &str, timeout: Duration) -> Result<Option<HeldLock<'a>>, StorageError> {
        self.storage.ensure_folder(&self.locks())?;
        let file = self.locks().join(name);
        let lock = self.storage.wait_for_lock(&file, MAX_WAIT)?;
        if matches!(lock, Lock::Taken) {
            return Ok(None);
        }
        let before = self.storage.read(&file)?;
        let is_dead = !is_whole(&before) || (matches!(lock, Lock::Ours(_)) && is_of_this_host(&before));
        if !is_dead && self.grows(name, &before, timeout)? {
            return Ok(None);
        }
        let owner = format!("{}{SEPARATOR}{}{SEPARATOR}{}", host(), std::process::id(), token());
        let held = HeldLock { layout: self.clone(), file, owner, _lock: lock };
        held.beat(0)?;
        Ok(Some(held))
    }

    /// Whether a process has the lock of this name: by the operating system, or by a heartbeat of another host that is
    /// recent, as far as the hosts' clocks agree. Does not wait.
    ///
    /// # Errors
    /// When the lock cannot be looked at.
    pub fn is_locked(&self, name: &str) -> Result<bool, StorageError> {
        let (storage, file) = (self.storage, self.locks().join(name));
        if !storage.exists(&file)? {
            return Ok(false);
        }
        // A lock that cannot be tried, as in a read-only copy, is nobody's.
        let Ok(lock) = storage.lock(&file) else { return Ok(false) };
        let heartbeat = storage.read(&file)?;
        Ok(match lock {
            Lock::Taken => true,
            _ if !is_whole(&heartbeat) => false,
            Lock::Ours(_) if is_of_this_host(&heartbeat) => false,
            Lock::Ours(_) | Lock::Unknown => {
                let modified = storage.open(&file)?.metadata().and_then(|metadata| metadata.modified());
                modified.is_ok_and(|time| SystemTime::now().duration_since(time).is_ok_and(|age| age < TIMEOUT))
            }
        })
    }

    /// Whether a process has a lock, and does not give it back within an instant, as who looks at it does.
    fn stays_locked(&self, name: &str) -> Result<bool, StorageError> {
        let begin = Instant::now();
        while self.is_locked(name)? {
            if begin.elapsed() >= MAX_WAIT {
                return Ok(true);
            }
            std::thread::sleep(POLL);
        }
        Ok(false)
    }

    /// Watches a heartbeat for some time.
    fn grows(&self, name: &str, before: &[u8], timeout: Duration) -> Result<bool, StorageError> {
        let begin = Instant::now();
        while begin.elapsed() < timeout {
            std::thread::sleep(timeout / 20);
            if self.storage.read(&self.locks().join(name))? != before {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// A lock, until it is dropped.
pub struct HeldLock<'a> {
    layout: Layout<'a>,
    file: PathBuf,
    /// The heartbeat without its count.
    owner: String,
    _lock: Lock,
}

impl HeldLock<'_> {
    /// Runs `body` while renewing the heartbeat.
    pub fn while_held<T>(&self, body: impl FnOnce() -> T) -> T {
        std::thread::scope(|scope| {
            let (end, ended) = channel::<()>();
            scope.spawn(move || {
                for count in 1_u64.. {
                    if !matches!(ended.recv_timeout(BEAT), Err(RecvTimeoutError::Timeout)) {
                        return;
                    }
                    // A heartbeat that cannot grow costs double work at worst.
                    let _ = self.beat(count);
                }
            });
            let _end = end;
            body()
        })
    }

    fn beat(&self, count: u64) -> Result<(), StorageError> {
        self.layout.storage.create(&self.file)?.write(format!("{}{SEPARATOR}{count}", self.owner).as_bytes())
    }
}

impl Drop for HeldLock<'_> {
    /// Leaves an empty file: to remove it would let two processes lock two files of one name.
    fn drop(&mut self) {
        let _ = self.layout.storage.create(&self.file);
    }
}

impl<'a> Results<'a> {
    /// Locks the shard of this name, which begins with `shard-`; `None` if another process has it.
    ///
    /// # Errors
    /// When another process has the whole directory to itself.
    pub fn lock_shard(&self, name: &str) -> Result<Option<HeldLock<'a>>, ResultsError> {
        let lock = self.layout().take_lock(name, TIMEOUT)?;
        if lock.is_some() && self.layout().stays_locked(EXCLUSIVE)? { Err(self.is_repaired()) } else { Ok(lock) }
    }

    /// Runs `body` while nobody else changes the directory.
    ///
    /// # Errors
    /// When a shard is being run, or another process has the directory to itself; and what `body` says.
    pub(crate) fn exclusively<T>(&self, body: impl FnOnce() -> Result<T, ResultsError>) -> Result<T, ResultsError> {
        let layout = self.layout();
        let lock = layout.take_lock(EXCLUSIVE, TIMEOUT)?.ok_or_else(|| self.is_repaired())?;
        for name in layout.storage.list(&layout.locks())? {
            let shard = name.to_string_lossy();
            if shard.starts_with(SHARD) && layout.stays_locked(&shard)? {
                let problem = format!("is being run ({shard}); wait for it or stop it, then try again");
                return Err(ResultsError::busy(layout.root(), problem));
            }
        }
        lock.while_held(body)
    }

    fn is_repaired(&self) -> ResultsError {
        let problem = "is being repaired or compacted by another process; try again when it has ended";
        ResultsError::busy(self.layout().root(), problem)
    }

    /// Removes what dead processes left in the staging folders of shards.
    ///
    /// # Errors
    /// When something cannot be looked at or removed.
    pub fn clear_abandoned_staging(&self) -> Result<(), StorageError> {
        let layout = self.layout();
        let storage = layout.storage;
        for shard in storage.list(&layout.staging(""))? {
            let shard = shard.to_string_lossy();
            let staging = layout.staging(&shard);
            // Listed before the look at the lock: whoever takes it afterwards stages under other names.
            let left = if shard.starts_with(SHARD) { storage.list(&staging)? } else { Vec::new() };
            if !left.is_empty() && !layout.is_locked(&shard)? {
                left.into_iter().try_for_each(|name| storage.remove(&staging.join(name)))?;
            }
        }
        Ok(())
    }
}

/// Whether this is a heartbeat: released locks are empty, and a power cut may leave part of one.
fn is_whole(heartbeat: &[u8]) -> bool {
    heartbeat.split(|&byte| byte == SEPARATOR as u8).count() == 4
}

/// Whether it is that of a process of this host. A host without a name is like no other, nor like itself.
fn is_of_this_host(heartbeat: &[u8]) -> bool {
    let host = host();
    host != UNKNOWN_HOST && heartbeat.starts_with(format!("{host}{SEPARATOR}").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::storage::Disk;
    use crate::table::storage::over_disk::OverDisk;
    use std::fs::{self, File};
    use std::path::Path;

    const SHORT: Duration = Duration::from_millis(200);

    /// A disk whose locks are not seen by others.
    struct WithoutLocks;

    impl OverDisk for WithoutLocks {
        fn try_lock(&self, file: &Path) -> Result<Lock, StorageError> {
            File::options().create(true).append(true).open(file).map_err(StorageError::at("lock", file))?;
            Ok(Lock::Unknown)
        }
    }

    const NAME: &str = "shard-1-of-1";

    fn take<'a>(layout: &Layout<'a>) -> Option<HeldLock<'a>> {
        layout.take_lock(NAME, SHORT).unwrap()
    }

    /// Leaves what is in the lock of a process that was killed.
    fn die(layout: &Layout<'_>, heartbeat: &str) {
        fs::create_dir_all(layout.locks()).unwrap();
        fs::write(layout.locks().join(NAME), heartbeat).unwrap();
    }

    #[test]
    fn a_lock_is_refused_while_held_and_free_afterwards() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(&Disk, root.path());
        let held = take(&layout).unwrap();
        assert!(take(&layout).is_none() && layout.is_locked(NAME).unwrap());
        assert!(layout.take_lock("shard-1-of-2", SHORT).unwrap().is_some());
        drop(held);
        assert!(!layout.is_locked(NAME).unwrap());
        assert!(take(&layout).is_some());
    }

    #[test]
    fn the_lock_of_a_dead_process_is_taken_over_at_once_on_its_host_and_after_a_while_from_another() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(&Disk, root.path());
        for (dead_host, waits) in [(host(), false), ("elsewhere".to_owned(), true)] {
            die(&layout, &format!("{dead_host}\t77\tabc\t5"));
            let begin = Instant::now();
            assert!(take(&layout).is_some());
            assert_eq!(begin.elapsed() >= SHORT, waits, "{dead_host}");
        }
        // What a power cut leaves of a heartbeat.
        die(&layout, "elsewh");
        let begin = Instant::now();
        assert!(take(&layout).is_some() && begin.elapsed() < SHORT);
    }

    #[test]
    fn where_locks_are_not_seen_a_heartbeat_that_grows_keeps_others_out() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(&WithoutLocks, root.path());
        let held = take(&layout).unwrap();
        let refused = std::thread::scope(|scope| {
            scope.spawn(|| {
                for count in 1..8 {
                    std::thread::sleep(SHORT / 5);
                    held.beat(count).unwrap();
                }
            });
            take(&layout).is_none()
        });
        assert!(refused && layout.is_locked(NAME).unwrap());
        drop(held);
        assert!(!layout.is_locked(NAME).unwrap());
        assert!(take(&layout).is_some());
    }

    #[test]
    fn a_lock_that_is_held_grows() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(&Disk, root.path());
        let held = take(&layout).unwrap();
        let first = fs::read(layout.locks().join(NAME)).unwrap();
        held.while_held(|| assert!(layout.grows(NAME, &first, 2 * BEAT).unwrap()));
    }
}
