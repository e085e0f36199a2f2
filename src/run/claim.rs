//! Claims: which process runs a shard, so that none is run twice at once and that of a dead process can be taken over.
//!
//! A claim is a lock of the operating system on `run/lock/<shard>`, and a note in that file: host, process, and a count
//! that grows as long as the process lives. Within one host the lock tells all. Other hosts may not see it, as network file
//! systems can be mounted without; there a note that grows is a living process's, and one that stands still for
//! [`PATIENCE`] a dead one's. No clocks are compared. Contract: a claim saves double work, and no more. Should two
//! processes run the same shard, as after a suspended one was taken for dead, they write the same bytes, each under staged
//! names of its own.

use crate::results::commit::{create_folder, token};
use crate::results::layout::Layout;
use crate::run::log::host;
use crate::table::storage::{Lock, Storage, StorageError, wait_for_lock};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant, SystemTime};

/// How often the note grows.
const BEAT: Duration = Duration::from_secs(5);
/// How long a note must stand still to be a dead process's.
pub(super) const PATIENCE: Duration = Duration::from_secs(20);
/// How long to wait for a lock: a look at the status holds it for an instant.
const LONGEST_WAIT: Duration = Duration::from_millis(500);
/// Separates the parts of a note.
const SEPARATOR: char = '\t';

/// The claim to a shard, until it is dropped.
pub(super) struct Claim<'a> {
    storage: &'a dyn Storage,
    file: PathBuf,
    /// The note without its count.
    note: String,
    _lock: Lock,
}

impl<'a> Claim<'a> {
    /// Claims the shard of this name; `None` if another process has it.
    pub fn take(
        storage: &'a dyn Storage,
        layout: &Layout,
        shard: &str,
        patience: Duration,
    ) -> Result<Option<Self>, StorageError> {
        create_folder(storage, &layout.locks())?;
        let file = layout.locks().join(shard);
        let lock = wait_for_lock(storage, &file, LONGEST_WAIT)?;
        if matches!(lock, Lock::Taken) {
            return Ok(None);
        }
        let before = read(storage, &file)?;
        let is_dead = !is_whole(&before) || (matches!(lock, Lock::Ours(_)) && is_of_this_host(&before));
        if !is_dead && grows(storage, &file, &before, patience)? {
            return Ok(None);
        }
        let note = format!("{}{SEPARATOR}{}{SEPARATOR}{}", host(), std::process::id(), token());
        let claim = Self { storage, file, note, _lock: lock };
        claim.write(0)?;
        Ok(Some(claim))
    }

    /// Does something while the note grows.
    pub fn while_held<T>(&self, body: impl FnOnce() -> T) -> T {
        std::thread::scope(|scope| {
            let (end, ended) = channel::<()>();
            scope.spawn(move || {
                for count in 1_u64.. {
                    if !matches!(ended.recv_timeout(BEAT), Err(RecvTimeoutError::Timeout)) {
                        return;
                    }
                    // A note that cannot grow costs double work at worst.
                    let _ = self.write(count);
                }
            });
            let _end = end;
            body()
        })
    }

    fn write(&self, count: u64) -> Result<(), StorageError> {
        let written = self.storage.create(&self.file);
        let text = format!("{}{SEPARATOR}{count}", self.note);
        written.and_then(|mut file| file.write_all(text.as_bytes())).map_err(StorageError::at("write", &self.file))
    }
}

impl Drop for Claim<'_> {
    /// Leaves an empty file: to remove it would let two processes lock two files of one name.
    fn drop(&mut self) {
        let _ = self.storage.create(&self.file);
    }
}

/// Removes what dead processes left in the staging folders of other shards.
pub(super) fn clear_leftovers(storage: &dyn Storage, layout: &Layout) -> Result<(), StorageError> {
    let list = |folder: &Path| storage.list(folder).map_err(StorageError::at("list", folder));
    let folders = layout.staging("");
    for shard in list(&folders)?.iter().filter_map(|name| name.to_str()).filter(|name| name.starts_with("shard-")) {
        // Listed before the look at the claim: whoever claims it afterwards stages under other names.
        let left = list(&layout.staging(shard))?;
        if !left.is_empty() && !is_claimed(storage, layout, shard)? {
            for name in left {
                let path = layout.staging(shard).join(name);
                storage.remove(&path).map_err(StorageError::at("remove", &path))?;
            }
        }
    }
    Ok(())
}

/// Whether a process has a claim to the shard of this name, without waiting: by its lock, or by a note of another host that
/// has grown of late, as far as the hosts' clocks agree.
pub(super) fn is_claimed(storage: &dyn Storage, layout: &Layout, shard: &str) -> Result<bool, StorageError> {
    let file = layout.locks().join(shard);
    if !storage.exists(&file).map_err(StorageError::at("look up", &file))? {
        return Ok(false);
    }
    // A lock that cannot be tried, as in a read-only copy, is nobody's.
    let Ok(lock) = storage.lock(&file) else { return Ok(false) };
    let note = read(storage, &file)?;
    Ok(match lock {
        Lock::Taken => true,
        _ if !is_whole(&note) => false,
        Lock::Ours(_) if is_of_this_host(&note) => false,
        Lock::Ours(_) | Lock::Unknown => {
            let modified = storage.open(&file).and_then(|file| file.metadata()?.modified());
            modified.is_ok_and(|time| SystemTime::now().duration_since(time).is_ok_and(|age| age < PATIENCE))
        }
    })
}

fn read(storage: &dyn Storage, file: &Path) -> Result<Vec<u8>, StorageError> {
    let mut note = Vec::new();
    let read = storage.open(file).and_then(|mut file| file.read_to_end(&mut note));
    read.map(|_| note).map_err(StorageError::at("read", file))
}

/// Whether this is a note: released claims are empty, and a power cut may leave part of one.
fn is_whole(note: &[u8]) -> bool {
    note.split(|&byte| byte == SEPARATOR as u8).count() == 4
}

/// Whether a process of this host wrote a note. A host without a name is like no other, nor like itself.
fn is_of_this_host(note: &[u8]) -> bool {
    let host = host();
    host != super::log::UNKNOWN_HOST && note.starts_with(format!("{host}{SEPARATOR}").as_bytes())
}

/// Watches a note for some time.
fn grows(storage: &dyn Storage, file: &Path, before: &[u8], patience: Duration) -> Result<bool, StorageError> {
    let begin = Instant::now();
    while begin.elapsed() < patience {
        std::thread::sleep(patience / 20);
        if read(storage, file)? != before {
            return Ok(true);
        }
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::storage::Disk;
    use crate::table::storage::over_disk::OverDisk;
    use std::fs::{self, File};
    use std::io;

    const SHORT: Duration = Duration::from_millis(200);

    /// A disk whose locks are not seen by others.
    struct WithoutLocks;

    impl OverDisk for WithoutLocks {
        fn try_lock(&self, file: &Path) -> io::Result<Lock> {
            File::options().create(true).append(true).open(file)?;
            Ok(Lock::Unknown)
        }
    }

    fn take<'a>(storage: &'a dyn Storage, layout: &Layout) -> Option<Claim<'a>> {
        Claim::take(storage, layout, "shard-1-of-1", SHORT).unwrap()
    }

    /// Leaves the note that a process of this host leaves which is killed.
    fn die(layout: &Layout, host: &str) {
        fs::create_dir_all(layout.locks()).unwrap();
        fs::write(layout.locks().join("shard-1-of-1"), format!("{host}\t77\tabc\t5")).unwrap();
    }

    #[test]
    fn a_claim_is_refused_while_held_and_free_afterwards() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        let held = take(&Disk, &layout).unwrap();
        assert!(take(&Disk, &layout).is_none() && is_claimed(&Disk, &layout, "shard-1-of-1").unwrap());
        assert!(Claim::take(&Disk, &layout, "shard-1-of-2", SHORT).unwrap().is_some());
        drop(held);
        assert!(!is_claimed(&Disk, &layout, "shard-1-of-1").unwrap());
        assert!(take(&Disk, &layout).is_some());
    }

    #[test]
    fn the_claim_of_a_dead_process_is_taken_over_at_once_on_its_host_and_after_a_while_from_another() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        for (dead_host, waits) in [(host(), false), ("elsewhere".to_owned(), true)] {
            die(&layout, &dead_host);
            let begin = Instant::now();
            assert!(take(&Disk, &layout).is_some());
            assert_eq!(begin.elapsed() >= SHORT, waits, "{dead_host}");
        }
        // What a power cut leaves of a note.
        fs::write(layout.locks().join("shard-1-of-1"), "elsewh").unwrap();
        let begin = Instant::now();
        assert!(take(&Disk, &layout).is_some() && begin.elapsed() < SHORT);
    }

    #[test]
    fn where_locks_are_not_seen_a_note_that_grows_keeps_others_out() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        let held = take(&WithoutLocks, &layout).unwrap();
        let refused = std::thread::scope(|scope| {
            scope.spawn(|| {
                for count in 1..8 {
                    std::thread::sleep(SHORT / 5);
                    held.write(count).unwrap();
                }
            });
            take(&WithoutLocks, &layout).is_none()
        });
        assert!(refused && is_claimed(&WithoutLocks, &layout, "shard-1-of-1").unwrap());
        drop(held);
        assert!(!is_claimed(&WithoutLocks, &layout, "shard-1-of-1").unwrap());
        assert!(take(&WithoutLocks, &layout).is_some());
    }

    #[test]
    fn a_claim_that_is_held_grows() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        let held = take(&Disk, &layout).unwrap();
        let file = layout.locks().join("shard-1-of-1");
        let first = fs::read(&file).unwrap();
        held.while_held(|| assert!(grows(&Disk, &file, &first, 2 * BEAT).unwrap()));
    }
}
