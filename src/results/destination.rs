//! Destinations: files and folders that the user names, outside of the data of a results directory.
//!
//! They are checked before anything is computed, written as a draft with a random name beside their place, and renamed.
//! A killed process may leave its draft, which nothing reads.

use crate::results::layout::{Layout, RUN};
use crate::table::error::{ErrorKind, ResultsError};
use crate::table::shown::shown;
use crate::table::storage::{Disk, Storage, StorageError, StoredFile};
use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use tempfile::{Builder, TempDir};

const PREFIX: &str = ".stickslip-";
pub const THERE: &str = "is there already and was not changed; choose another name";

/// A file that is written over an earlier one. Its name says what it holds, so that no sweep file or note is lost.
#[derive(Debug)]
pub struct Destination {
    path: PathBuf,
    /// Where links lead.
    place: PathBuf,
}

impl Destination {
    /// Refuses a place where nothing can be written, or where something would be lost.
    pub fn new(path: &Path, extension: &str) -> Result<Self, ResultsError> {
        let refused = |problem: &str| Err(ResultsError::refused(path, problem));
        let place = resolved(path)?;
        if place.extension().is_none_or(|its| its != extension) {
            let problem =
                format!("must end in .{extension}; so must the file that a link leads to");
            return refused(&problem);
        }
        if !place.parent().is_some_and(Path::is_dir) {
            return refused("its folder does not exist; make it, or name another file");
        }
        if fs::symlink_metadata(&place).is_ok_and(|there| !there.is_file()) {
            return refused("is there and is no regular file; name another file");
        }
        refuse_reserved(path)?;
        Ok(Self {
            path: path.to_owned(),
            place,
        })
    }

    pub fn refuse_same(all: &[Self]) -> Result<(), ResultsError> {
        for (number, one) in all.iter().enumerate() {
            let mut others = all[..number].iter();
            if let Some(other) = others.find(|other| one.place == other.place) {
                let other = shown(&other.path);
                let problem = format!("is the same file as {other}; give each output its own");
                return Err(ResultsError::refused(&one.path, problem));
            }
        }
        Ok(())
    }

    /// Writes the whole file, or leaves the earlier one after an error or if `stop` is set.
    pub fn write(
        &self,
        stop: &AtomicBool,
        write: impl FnOnce(StoredFile) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let failed = |error: io::Error| StorageError::at("write", &self.path)(error);
        let place = &self.place;
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
            let kept = draft.as_file().set_permissions(before.permissions());
            kept.map_err(failed)?;
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
        let there = fs::symlink_metadata(&place).ok();
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
    use std::os::unix::fs::{MetadataExt, symlink};
    use std::os::unix::net::UnixListener;

    static NEVER: AtomicBool = AtomicBool::new(false);
    static STOPPED: AtomicBool = AtomicBool::new(true);

    fn put(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
        Destination::new(path, "png")?.write(&NEVER, |mut file| Ok(file.write(bytes)?))
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
        let [file, link] = ["file.png", "link"].map(|name| folder.path().join(name));
        symlink("file.png", &link).unwrap();
        put(&file, b"old").unwrap();
        put(&link, b"new").unwrap();
        assert!(link.is_symlink());
        let destination = Destination::new(&file, "png").unwrap();
        let half = |mut file: StoredFile| {
            file.write(b"half")?;
            anyhow::bail!("full")
        };
        destination.write(&NEVER, half).unwrap_err();
        let whole = |mut file: StoredFile| Ok(file.write(b"stopped")?);
        destination.write(&STOPPED, whole).unwrap_err();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["file.png", "link"]);
    }

    #[test]
    fn a_replaced_file_keeps_its_mode_and_a_new_one_has_that_of_any_other() {
        let folder = tempfile::tempdir().unwrap();
        let [old, new, other] =
            ["old.png", "new.png", "other.png"].map(|name| folder.path().join(name));
        let mode = |file: &Path| fs::metadata(file).unwrap().mode() & 0o777;
        fs::write(&old, "").unwrap();
        for kept in [0o640, 0o666] {
            fs::set_permissions(&old, Permissions::from_mode(kept)).unwrap();
            put(&old, b"image").unwrap();
            assert_eq!(mode(&old), kept);
        }
        put(&new, b"image").unwrap();
        fs::write(&other, "").unwrap();
        assert_eq!(mode(&new), mode(&other));
    }

    #[test]
    fn what_is_no_file_of_the_name_that_is_written_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("note.toml"), "mine").unwrap();
        fs::create_dir(path("folder.png")).unwrap();
        let _socket = UnixListener::bind(path("socket.png")).unwrap();
        for (target, link) in [
            ("nowhere.png", "dangling.png"),
            ("note.toml", "to_note.png"),
            ("folder.png", "to_folder.png"),
            ("socket.png", "to_socket.png"),
            ("loop.png", "loop.png"),
        ] {
            symlink(target, path(link)).unwrap();
        }
        for (name, words) in [
            ("note.toml", "must end in .png"),
            ("new", "must end in .png"),
            ("png", "must end in .png"),
            (".png", "must end in .png"),
            ("to_note.png", "must end in .png"),
            ("folder.png", "no regular file"),
            ("socket.png", "no regular file"),
            ("to_folder.png", "no regular file"),
            ("to_socket.png", "no regular file"),
            ("dangling.png", "no regular file"),
        ] {
            assert_refused(Destination::new(&path(name), "png"), words);
        }
        Destination::new(&path("loop.png"), "png").unwrap_err();
        assert_eq!(fs::read(path("note.toml")).unwrap(), b"mine");
    }

    #[test]
    fn two_names_of_one_file_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("below")).unwrap();
        fs::write(path("there.png"), "").unwrap();
        symlink("there.png", path("link")).unwrap();
        symlink(".", path("here")).unwrap();
        let destinations =
            |names: [&str; 2]| names.map(|name| Destination::new(&path(name), "png").unwrap());
        for same in [
            ["new.png", "new.png"],
            ["new.png", "./new.png"],
            ["new.png", "below/../new.png"],
            ["new.png", "here/new.png"],
            ["there.png", "link"],
            ["link", "here/there.png"],
        ] {
            assert_refused(Destination::refuse_same(&destinations(same)), "same file");
        }
        for different in ["there.png", "below/new.png", "NEW.png"] {
            Destination::refuse_same(&destinations(["new.png", different])).unwrap();
        }
    }

    #[test]
    fn writers_of_one_folder_never_get_the_draft_of_another() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for number in 0..8 {
                let file = folder.path().join(format!("{number}.png"));
                scope.spawn(move || {
                    for round in 0..50 {
                        let bytes = format!("{number} {round}");
                        put(&file, bytes.as_bytes()).unwrap();
                        assert_eq!(fs::read_to_string(&file).unwrap(), bytes);
                    }
                });
            }
        });
        assert_eq!(names(folder.path()).len(), 8);
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
            "d/tables/x.png",
            "d/tables/slips/x.png",
            "d/run/x.png",
            "d/reduced/x.png",
            "link/tables/slips/x.png",
            "tables/slips/x.png",
            "elsewhere/../d/run/x.png",
            "d/figures/../tables/x.png",
        ] {
            assert_refused(
                Destination::new(&path(refused), "png"),
                "lies in the results directory",
            );
        }
        for allowed in [
            "x.png",
            "d/x.png",
            "d/figures/x.png",
            "d/tables/../x.png",
            "elsewhere/x.png",
        ] {
            Destination::new(&path(allowed), "png").unwrap();
        }
        assert_refused(
            Destination::new(&path("missing/x.png"), "png"),
            "folder does not exist",
        );
    }

    #[test]
    fn a_new_folder_is_outside_of_results_and_there_as_a_whole_or_not_at_all() {
        let folder = folder_with_results();
        let path = |name: &str| folder.path().join(name);
        symlink("d/figures", path("link")).unwrap();
        symlink("nowhere", path("dangling")).unwrap();
        fs::create_dir_all(path("mine/thesis")).unwrap();
        for (refused, words) in [
            ("d/x", "lies in the results directory"),
            ("d/tables/slips/x", "lies in the results directory"),
            ("d/figures/a/b", "lies in the results directory"),
            ("link/x", "lies in the results directory"),
            ("mine/../d/x", "lies in the results directory"),
            ("d", "lies in the results directory"),
            ("mine", "is there already"),
            ("dangling", "is there already"),
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
