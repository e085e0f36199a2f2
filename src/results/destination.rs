//! Destinations: files and folders that the user names, outside of the data of a results directory.
//!
//! They are checked before anything is computed, written as a draft with a random name beside their place, and renamed.
//! A killed process may leave its draft, which nothing reads.

use crate::results::layout::{Layout, RUN};
use crate::table::error::{ErrorKind, ResultsError};
use crate::table::shown::shown;
use crate::table::storage::{Disk, Storage, StorageError, StoredFile};
use std::fs::{self, File, Permissions};
use std::io::{self, Read};
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use tempfile::{Builder, TempDir};

const PREFIX: &str = ".stickslip-";
/// Bytes at the beginning of a file that say what it is.
const BEGINNING: u64 = 1024;
const THERE: &str = "is there already and was not changed; choose another name";

/// What a file holds. An existing file is replaced by its own kind only.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    name: &'static str,
    /// Its first bytes, and bytes that come soon after.
    signs: [&'static [u8]; 2],
}

impl Kind {
    /// No existing file is replaced.
    pub const NEW: Self = Self::new("", [b"", b""]);
    pub const REPORT: Self = Self::new("a report", [b"<!doctype html>", b"<title>stickslip "]);
    pub const PARQUET: Self = Self::new("a Parquet file", [b"PAR1", b""]);

    const fn new(name: &'static str, signs: [&'static [u8]; 2]) -> Self {
        Self { name, signs }
    }

    pub fn of_name(file: &Path) -> Option<Self> {
        match file.extension()?.to_str()? {
            "parquet" => Some(Self::PARQUET),
            "json" => Some(Self::new("an accuracy.json", [b"{\"b", b""])),
            "svg" => Some(Self::new("an SVG", [b"<", b"<svg"])),
            "png" => Some(Self::new("a PNG", [b"\x89PNG\r\n\x1a\n", b""])),
            "pdf" => Some(Self::new("a PDF", [b"%PDF-", b""])),
            _ => None,
        }
    }

    /// Whether a file with this beginning is of this kind, or empty.
    fn may_be(self, beginning: &[u8]) -> bool {
        let [first, later] = self.signs;
        let has_later = || beginning.windows(later.len()).any(|seen| seen == later);
        beginning.is_empty() || beginning.starts_with(first) && (later.is_empty() || has_later())
    }
}

#[derive(Debug)]
pub struct Destination {
    path: PathBuf,
    /// Where links lead.
    place: PathBuf,
    /// Whether it is a device or a FIFO, which is not replaced.
    is_device: bool,
}

impl Destination {
    /// Refuses a place where nothing can be written, or where something would be lost.
    pub fn new(path: &Path, kind: Kind) -> Result<Self, ResultsError> {
        let refused = |problem: &str| Err(ResultsError::refused(path, problem));
        let there = fs::metadata(path).ok();
        if path.is_dir() {
            return refused("is a folder; name a file in it");
        }
        if there.is_some() && kind.name.is_empty() {
            return refused(THERE);
        }
        let destination = |place: PathBuf, is_device: bool| Self {
            path: path.to_owned(),
            place,
            is_device,
        };
        if there.as_ref().is_some_and(|there| !there.is_file()) {
            return Ok(destination(path.to_owned(), true));
        }
        let place = resolved(path)?;
        if !place.parent().is_some_and(Path::is_dir) {
            return refused("its folder does not exist; make it, or name another file");
        }
        refuse_reserved(path)?;
        if there.is_some() {
            let mut beginning = Vec::new();
            let read = Disk
                .open(&place)?
                .take(BEGINNING)
                .read_to_end(&mut beginning);
            read.map_err(StorageError::at("read", path))?;
            if !kind.may_be(&beginning) {
                return refused(&format!(
                    "is not {} and was not replaced; name another file, or remove this one",
                    kind.name
                ));
            }
        }
        Ok(destination(place, false))
    }

    pub fn refuse_same(all: &[Self]) -> Result<(), ResultsError> {
        for (number, one) in all.iter().enumerate() {
            if let Some(other) = all[..number].iter().find(|other| one.is_same(other)) {
                let other = shown(&other.path);
                let problem = format!("is the same file as {other}; give each output its own");
                return Err(ResultsError::refused(&one.path, problem));
            }
        }
        Ok(())
    }

    fn is_same(&self, other: &Self) -> bool {
        let inode = |file: &Self| {
            let there = fs::metadata(&file.place);
            there.map(|there| (there.dev(), there.ino())).ok()
        };
        self.place == other.place || inode(self).is_some_and(|of_one| Some(of_one) == inode(other))
    }

    /// Writes the whole file, or leaves the earlier one after an error or if `stop` is set. A device has no flag.
    pub fn write(
        &self,
        stop: impl FnOnce() -> anyhow::Result<&'static AtomicBool>,
        write: impl FnOnce(StoredFile) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let failed = |error: io::Error| StorageError::at("write", &self.path)(error);
        let place = &self.place;
        if self.is_device {
            let device = File::options().write(true).open(&self.path);
            return write(StoredFile::new(&self.path, device.map_err(failed)?));
        }
        let stop = stop()?;
        let before = fs::metadata(place).ok();
        // The draft of a private file is private, too.
        let mode = if before.is_some() { 0o600 } else { 0o666 };
        let draft = Builder::new()
            .prefix(PREFIX)
            .suffix(".draft")
            .permissions(Permissions::from_mode(mode))
            .tempfile_in(place.parent().unwrap_or(place))
            .map_err(failed)?;
        let file = draft.as_file().try_clone().map_err(failed)?;
        write(StoredFile::new(&self.path, file))?;
        if let Some(before) = before {
            // Only root gives files away; a group that cannot be kept has no rights.
            let _ = fchown(draft.as_file(), Some(before.uid()), None);
            let is_of_group = fchown(draft.as_file(), None, Some(before.gid())).is_ok();
            let kept = if is_of_group { 0o777 } else { 0o707 };
            let mode = Permissions::from_mode(before.mode() & kept);
            draft.as_file().set_permissions(mode).map_err(failed)?;
        }
        draft.as_file().sync_all().map_err(failed)?;
        refuse_stopped(stop, &self.path)?;
        draft.persist(place).map_err(|error| failed(error.error))?;
        Ok(())
    }
}

/// A folder that takes its place as a whole.
pub struct NewFolder {
    pub place: PathBuf,
    pub draft: TempDir,
}

impl NewFolder {
    /// Refuses a place in a results directory, and an existing one, except for an empty folder, which is replaced.
    pub fn new(path: &Path) -> Result<Self, ResultsError> {
        refuse_within_results(path, |_| true)?;
        let place = resolved(path)?;
        let there = fs::metadata(&place).ok();
        let is_empty = || fs::read_dir(&place).is_ok_and(|mut names| names.next().is_none());
        if there.is_some() && !is_empty() {
            return Err(ResultsError::refused(path, THERE));
        }
        if std::env::current_dir().is_ok_and(|current| current == place) {
            let problem = "is the current folder, which would be replaced; name a new one";
            return Err(ResultsError::refused(path, problem));
        }
        let mut above = place.ancestors().skip(1);
        let draft = Builder::new()
            .prefix(PREFIX)
            .suffix(".unfinished")
            .permissions(there.map_or(Permissions::from_mode(0o777), |there| there.permissions()))
            .tempdir_in(above.find(|above| above.exists()).unwrap_or(&place))
            .map_err(StorageError::at("create", path))?;
        Ok(Self { place, draft })
    }

    pub fn publish(self, storage: &dyn Storage) -> Result<(), ResultsError> {
        let parent = self.place.parent().unwrap_or(&self.place);
        storage.sync_folder(self.draft.path())?;
        storage.ensure_folder(parent)?;
        match storage.rename(self.draft.path(), &self.place) {
            // Another process was first.
            Err(_) if self.place.exists() => Err(ResultsError::refused(&self.place, THERE)),
            Err(error) => Err(error.into()),
            Ok(()) => Ok(storage.sync_folder(parent)?),
        }
    }
}

/// Refuses a place among the data of a results directory.
pub fn refuse_reserved(path: &Path) -> Result<(), ResultsError> {
    let reserved = ["tables", "reduced", RUN];
    refuse_within_results(path, |within| {
        reserved.iter().any(|folder| within.starts_with(folder))
    })
}

/// Refuses such a place in a results directory, by its name or by where links lead.
fn refuse_within_results(
    path: &Path,
    is_refused: impl Fn(&Path) -> bool,
) -> Result<(), ResultsError> {
    for whole in [path, &resolved(path)?] {
        for root in whole.ancestors().take_while(|above| !above.ends_with("..")) {
            if whole.strip_prefix(root).is_ok_and(&is_refused) && is_results(root) {
                let root = shown(root);
                let problem = format!("lies in the results directory {root}; choose another place");
                return Err(ResultsError::refused(path, problem));
            }
        }
    }
    Ok(())
}

fn is_results(folder: &Path) -> bool {
    let extensions = Layout::new(&Disk, folder).listed_extensions();
    extensions.is_ok_and(|numbers| !numbers.is_empty())
}

/// A path without links and `..`, whether or not it exists.
fn resolved(path: &Path) -> Result<PathBuf, ResultsError> {
    let here = if path == "" { Path::new(".") } else { path };
    let found = fs::canonicalize(here).map_err(StorageError::at("look up", path));
    match (found, path.parent(), path.file_name()) {
        (Err(error), Some(parent), Some(name)) if error.is_missing() => {
            if path.is_symlink() {
                let problem = "is a link that leads nowhere; remove it, or choose another name";
                return Err(ResultsError::refused(path, problem));
            }
            Ok(resolved(parent)?.join(name))
        }
        (place, ..) => Ok(place?),
    }
}

pub fn refuse_stopped(stop: &AtomicBool, path: &Path) -> Result<(), ResultsError> {
    if stop.load(Ordering::Relaxed) {
        let problem = "was not written, as a signal stopped the command";
        return Err(ResultsError::new(ErrorKind::Stopped, path, problem));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{FileTypeExt, chown, symlink};
    use std::process::Command;

    static NEVER: AtomicBool = AtomicBool::new(false);
    static STOPPED: AtomicBool = AtomicBool::new(true);
    const PARQUET: &[u8] = b"PAR1 and more";

    fn put(path: &Path, kind: Kind, bytes: &[u8]) -> anyhow::Result<()> {
        Destination::new(path, kind)?.write(|| Ok(&NEVER), |mut file| Ok(file.write(bytes)?))
    }

    #[track_caller]
    fn assert_refused<T>(made: Result<T, ResultsError>, words: &str) {
        let error = made.err().unwrap();
        assert_eq!(error.kind, ErrorKind::Refused, "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }

    fn names(folder: &Path) -> Vec<String> {
        let names = Disk.list(folder).unwrap().into_iter();
        names.map(|name| name.into_string().unwrap()).collect()
    }

    /// A folder with what looks like a results directory, `d`.
    fn folder_with_results() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for made in ["run", "tables/slips", "reduced", "figures"] {
            fs::create_dir_all(folder.path().join("d").join(made)).unwrap();
        }
        fs::write(folder.path().join("d/run/extension-000.json"), "").unwrap();
        folder
    }

    #[test]
    fn a_file_is_replaced_where_links_lead_and_no_draft_remains() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        symlink("file", &link).unwrap();
        assert_refused(Destination::new(&link, Kind::PARQUET), "leads nowhere");
        put(&file, Kind::PARQUET, b"PAR1 old").unwrap();
        put(&link, Kind::PARQUET, PARQUET).unwrap();
        assert!(link.is_symlink());
        assert_refused(
            Destination::new(folder.path(), Kind::PARQUET),
            "is a folder",
        );
        let destination = Destination::new(&file, Kind::PARQUET).unwrap();
        let half = |mut file: StoredFile| {
            file.write(b"PAR1 half")?;
            anyhow::bail!("full")
        };
        destination.write(|| Ok(&NEVER), half).unwrap_err();
        let whole = |mut file: StoredFile| Ok(file.write(b"PAR1 stopped")?);
        destination.write(|| Ok(&STOPPED), whole).unwrap_err();
        assert_eq!(fs::read(&file).unwrap(), PARQUET);
        assert_eq!(names(folder.path()), ["file", "link"]);
    }

    #[test]
    fn a_replaced_file_keeps_owner_and_mode_and_a_new_one_has_those_of_any_other() {
        let folder = tempfile::tempdir().unwrap();
        let [private, new, other] =
            ["private", "new", "other"].map(|name| folder.path().join(name));
        fs::write(&private, "").unwrap();
        fs::set_permissions(&private, Permissions::from_mode(0o640)).unwrap();
        // As root only.
        let _ = chown(&private, Some(1234), Some(1235));
        let rights = |file: &Path| {
            let there = fs::metadata(file).unwrap();
            (there.mode(), there.uid(), there.gid())
        };
        let before = rights(&private);
        put(&private, Kind::PARQUET, PARQUET).unwrap();
        assert_eq!(rights(&private), before);
        put(&new, Kind::PARQUET, PARQUET).unwrap();
        fs::write(&other, "").unwrap();
        assert_eq!(rights(&new), rights(&other));
    }

    #[test]
    fn what_is_not_of_the_kind_that_is_written_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let of_name = |name| Kind::of_name(Path::new(name)).unwrap();
        let page = "<!doctype html>\n<head>\n<title>stickslip report</title>";
        let svg = "<?xml version=\"1.0\"?>\n<!-- edited -->\n<svg xmlns=\"\">";
        let kinds = [
            (Kind::REPORT, page.as_bytes()),
            (Kind::PARQUET, PARQUET),
            (of_name("a.json"), b"{\"breaks\":100}"),
            (of_name("a.svg"), svg.as_bytes()),
            (of_name("a.png"), b"\x89PNG\r\n\x1a\n..."),
            (of_name("a.pdf"), b"%PDF-1.7"),
        ];
        let others: [&[u8]; 8] = [
            b"name = \"sweep\"",
            b"\n",
            b"\0",
            b"<!doctype html>\n<title>thesis</title>",
            b"{\"mine\": 1}",
            b"P",
            b"\x89PN",
            b"<svg",
        ];
        let file = folder.path().join("file");
        for (number, (kind, own)) in kinds.into_iter().enumerate() {
            let of_other_kinds = kinds
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != number);
            let foreign = of_other_kinds.map(|(_, (_, bytes))| *bytes).chain(others);
            // The least that begins like an SVG is one.
            for foreign in foreign.filter(|bytes| kind.name != "an SVG" || *bytes != b"<svg") {
                fs::write(&file, foreign).unwrap();
                assert_refused(Destination::new(&file, kind), "was not replaced");
                assert_eq!(fs::read(&file).unwrap(), foreign);
            }
            for before in [b"", own] {
                fs::write(&file, before).unwrap();
                put(&file, kind, own).unwrap();
                assert_refused(Destination::new(&file, Kind::NEW), "is there already");
            }
        }
    }

    #[test]
    fn two_names_of_one_file_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("below")).unwrap();
        fs::write(path("there"), "").unwrap();
        symlink("there", path("link")).unwrap();
        symlink(".", path("here")).unwrap();
        fs::hard_link(path("there"), path("hard")).unwrap();
        let destinations = |names: [&str; 2]| {
            names.map(|name| Destination::new(&path(name), Kind::PARQUET).unwrap())
        };
        for same in [
            ["new", "new"],
            ["new", "./new"],
            ["new", "below/../new"],
            ["new", "here/new"],
            ["there", "link"],
            ["there", "hard"],
            ["link", "here/hard"],
        ] {
            assert_refused(Destination::refuse_same(&destinations(same)), "same file");
        }
        for different in [["new", "there"], ["new", "below/new"], ["new", "NEW"]] {
            Destination::refuse_same(&destinations(different)).unwrap();
        }
    }

    #[test]
    fn writers_of_one_folder_never_get_the_draft_of_another() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for number in 0..8 {
                let file = folder.path().join(number.to_string());
                scope.spawn(move || {
                    for round in 0..50 {
                        let bytes = format!("PAR1 {number} {round}");
                        put(&file, Kind::PARQUET, bytes.as_bytes()).unwrap();
                        assert_eq!(fs::read_to_string(&file).unwrap(), bytes);
                    }
                });
            }
        });
        assert_eq!(names(folder.path()).len(), 8);
    }

    #[test]
    fn a_pipe_is_written_to_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        std::thread::scope(|scope| {
            let read = scope.spawn(|| fs::read_to_string(&pipe).unwrap());
            let destination = Destination::new(&pipe, Kind::REPORT).unwrap();
            let flag = || panic!("signals must end the program");
            destination
                .write(flag, |mut file| Ok(file.write(b"page")?))
                .unwrap();
            assert_eq!(read.join().unwrap(), "page");
        });
        assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
    }

    #[test]
    fn no_file_goes_among_the_data_of_a_results_directory() {
        let folder = folder_with_results();
        let path = |name: &str| folder.path().join(name);
        symlink("d", path("link")).unwrap();
        symlink("d/tables", path("tables")).unwrap();
        fs::create_dir(path("elsewhere")).unwrap();
        fs::remove_dir(path("d/reduced")).unwrap();
        symlink("../elsewhere", path("d/reduced")).unwrap();
        for refused in [
            "d/tables/x",
            "d/tables/slips/x",
            "d/run/x",
            "d/reduced/x",
            "link/tables/slips/x",
            "tables/slips/x",
            "elsewhere/../d/run/x",
            "d/figures/../tables/x",
        ] {
            assert_refused(
                Destination::new(&path(refused), Kind::PARQUET),
                "lies in the results directory",
            );
        }
        for allowed in ["x", "d/x", "d/figures/x", "d/tables/../x", "elsewhere/x"] {
            Destination::new(&path(allowed), Kind::PARQUET).unwrap();
        }
        assert_refused(
            Destination::new(&path("missing/x"), Kind::PARQUET),
            "folder does not exist",
        );
    }

    #[test]
    fn a_new_folder_is_outside_of_results_and_there_as_a_whole_or_not_at_all() {
        let folder = folder_with_results();
        let path = |name: &str| folder.path().join(name);
        symlink("d/figures", path("link")).unwrap();
        fs::create_dir_all(path("mine/thesis")).unwrap();
        for (refused, words) in [
            ("d/x", "lies in the results directory"),
            ("d/tables/slips/x", "lies in the results directory"),
            ("d/figures/a/b", "lies in the results directory"),
            ("link/x", "lies in the results directory"),
            ("mine/../d/x", "lies in the results directory"),
            ("d", "lies in the results directory"),
            ("mine", "is there already"),
        ] {
            assert_refused(NewFolder::new(&path(refused)), words);
        }
        let current = std::env::current_dir().unwrap();
        assert!(NewFolder::new(&current).is_err());
        let before = names(folder.path());
        drop(NewFolder::new(&path("a/b")).unwrap());
        assert_eq!(names(folder.path()), before);
        let [first, second] = ["a/b", "d/../a/b"].map(|name| NewFolder::new(&path(name)).unwrap());
        fs::write(first.draft.path().join("file"), "first").unwrap();
        fs::write(second.draft.path().join("file"), "second").unwrap();
        first.publish(&Disk).unwrap();
        assert_refused(second.publish(&Disk), "is there already");
        assert_eq!(fs::read_to_string(path("a/b/file")).unwrap(), "first");
        assert_eq!(names(&path("a")), ["b"]);
        let mode = |name: &str| fs::metadata(path(name)).unwrap().mode();
        assert_eq!(mode("a"), mode("a/b"));
        fs::create_dir(path("empty")).unwrap();
        fs::set_permissions(path("empty"), Permissions::from_mode(0o750)).unwrap();
        let third = NewFolder::new(&path("empty")).unwrap();
        fs::write(third.draft.path().join("file"), "third").unwrap();
        third.publish(&Disk).unwrap();
        assert_eq!(mode("empty") & 0o777, 0o750);
        assert_eq!(names(&path("empty")), ["file"]);
    }
}
