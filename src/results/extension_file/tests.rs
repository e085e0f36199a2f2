//! Directories that are begun, changed, damaged, somebody else's, or begun by two runs at once.

use super::*;
use crate::results::Results;
use crate::results::workers::tests::open;
use crate::table::storage::Disk;
use crate::table::storage::over_disk::{Access, OverDisk};
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A disk on which another run does something just before the n-th operation of this one.
struct Shared<F> {
    /// What the other run does, until it is done.
    other: Mutex<Option<F>>,
    operations_left: AtomicUsize,
}

impl<F: FnOnce() + Send> OverDisk for Shared<F> {
    fn before(&self, _: Access) -> io::Result<()> {
        if self.operations_left.fetch_sub(1, Ordering::Relaxed) == 0
            && let Some(other) = self.other.lock().unwrap().take()
        {
            other();
        }
        Ok(())
    }
}

fn sweep(text: &str) -> Sweep {
    Sweep::parse(&format!("name = \"test\"\n{text}"), Path::new("test.toml")).unwrap()
}

/// Every file below a folder with its bytes.
fn contents(folder: &Path) -> BTreeSet<(PathBuf, Vec<u8>)> {
    let mut all = BTreeSet::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(contents(&path));
        } else {
            all.insert((path.clone(), fs::read(&path).unwrap()));
        }
    }
    all
}

const TWO_SEEDS: &str = "[axes]\nseed = [0, 1]\n";
const THREE_SEEDS: &str = "[axes]\nseed = [0, 1, 2]\n";

/// The text of the file of an extension of a program with other versions, and without a column of the jobs.
pub(crate) fn of_other_versions(text: &str, column: &str) -> String {
    let mut record: Record = checksum::from_json(text).unwrap();
    (record.model_version, record.plan_version) = (0, 0);
    record
        .tables
        .get_mut(JOBS)
        .unwrap()
        .retain(|other| other != column);
    record.text()
}

#[test]
fn a_directory_is_begun_resumed_extended_and_narrowed() {
    let root = tempfile::tempdir().unwrap();
    let open = |text| open(&Layout::new(&Disk, root.path()), &sweep(text)).unwrap();
    let extensions = |text| {
        let extensions = open(text).extensions().to_vec();
        extensions
            .into_iter()
            .map(|extension| (extension.sweep.text().to_owned(), extension.kept))
            .collect::<Vec<_>>()
    };
    let text = |axes| sweep(axes).text().to_owned();
    let finish = |results: &Results<'_>| {
        for part in results.plan().parts() {
            for table in results.tables() {
                fs::create_dir_all(results.layout().table(table)).unwrap();
                fs::write(results.part_file(table, &part), "").unwrap();
            }
        }
    };
    assert_eq!(extensions(TWO_SEEDS), [(text(TWO_SEEDS), None)]);
    let before = contents(root.path());
    open(TWO_SEEDS);
    assert_eq!(contents(root.path()), before);
    finish(&open(TWO_SEEDS));
    let mut expected = vec![
        (text(TWO_SEEDS), Some(vec![0..=1])),
        (text(THREE_SEEDS), None),
    ];
    assert_eq!(extensions(THREE_SEEDS), expected);
    assert_eq!(extensions(THREE_SEEDS), expected);
    // Nothing was done of it, so nothing is kept.
    expected[1].1 = Some(vec![]);
    expected.push((text(TWO_SEEDS), None));
    assert_eq!(extensions(TWO_SEEDS), expected);
    let read = Results::read(&Layout::new(&Disk, root.path())).unwrap();
    assert_eq!(read.plan().totals().jobs, 2);
}

#[test]
fn another_model_recording_or_version_is_refused_with_the_difference_and_nothing_is_written() {
    let root = tempfile::tempdir().unwrap();
    open(
        &Layout::new(&Disk, root.path()),
        &sweep("[model]\nK = 1e8\n[record]\nslips = 3"),
    )
    .unwrap();
    let refused = |text: &str, differences: &[&str]| {
        let before = contents(root.path());
        let error = open(&Layout::new(&Disk, root.path()), &sweep(text))
            .unwrap_err()
            .to_string();
        assert!(
            differences
                .iter()
                .all(|difference| error.contains(difference)),
            "{error}"
        );
        assert!(error.contains("--out"), "{error}");
        assert_eq!(contents(root.path()), before);
    };
    refused(
        "[model]\nK = 2e8\n[record]\nslips = 4",
        &["model.K", "record.slips: 3 -> 4"],
    );
    let path = root.path().join("run/extension-000.json");
    let text = fs::read_to_string(&path).unwrap();
    let mut other: Record = checksum::from_json(&text).unwrap();
    other.rng_scheme = "dice".to_owned();
    other
        .tables
        .get_mut("slips")
        .unwrap()
        .iter_mut()
        .filter(|column| *column == "onset")
        .for_each(|column| {
            *column = "start".to_owned();
        });
    fs::write(&path, other.text()).unwrap();
    refused(
        "[model]\nK = 1e8\n[record]\nslips = 3",
        &["random numbers: dice -> ", "without [\"start\"]"],
    );
    let mut other: Record = checksum::from_json(&text).unwrap();
    other.identity = "0".repeat(32);
    fs::write(&path, other.text()).unwrap();
    refused(
        "[model]\nK = 1e8\n[record]\nslips = 3",
        &["ids of jobs: those of stickslip"],
    );
    fs::write(
        &path,
        text.replace("\"format\": 7", "\"format\": 8, \"new\": 0"),
    )
    .unwrap();
    let error = Results::read(&Layout::new(&Disk, root.path()))
        .unwrap_err()
        .to_string();
    assert!(error.contains("has format 8"), "{error}");
}

#[test]
fn a_directory_of_an_older_program_is_refused_with_the_way_out_and_so_is_one_with_compacted_tables()
{
    let root = tempfile::tempdir().unwrap();
    let begin = || open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS));
    fs::create_dir_all(root.path().join("run")).unwrap();
    fs::write(
        root.path().join("run/manifest.json"),
        "{\"format\": 6, \"program\": \"stickslip 0.1.0\"}",
    )
    .unwrap();
    let error = begin().unwrap_err().to_string();
    assert!(
        error.contains("has format 6, this program knows 7; use the program that wrote it"),
        "{error}"
    );
    fs::remove_file(root.path().join("run/manifest.json")).unwrap();
    begin().unwrap();
    let jobs = root.path().join("tables/jobs");
    fs::create_dir_all(&jobs).unwrap();
    for name in [
        "compact-000-000000-000001-0123456789abcdef.parquet",
        "part-001-000000.parquet",
        "notes.txt",
    ] {
        fs::write(jobs.join(name), "").unwrap();
        let error = open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS))
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(name) && error.contains("is no part of this directory's sweeps"),
            "{error}"
        );
        fs::remove_file(jobs.join(name)).unwrap();
    }
    begin().unwrap();
}

#[test]
fn a_directory_of_something_else_is_refused_and_an_unfinished_beginning_is_not() {
    let root = tempfile::tempdir().unwrap();
    fs::create_dir_all(root.path().join("run/staging/worker-dead")).unwrap();
    fs::write(root.path().join("thesis.tex"), "").unwrap();
    let before = contents(root.path());
    let error = open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("is neither empty nor a results directory"),
        "{error}"
    );
    assert_eq!(contents(root.path()), before);
    fs::remove_file(root.path().join("thesis.tex")).unwrap();
    open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)).unwrap();
}

#[test]
fn two_runs_may_begin_a_directory_at_once_whichever_is_first() {
    let mut n = 0;
    loop {
        let root = tempfile::tempdir().unwrap();
        let open = |layout: Layout<'_>| open(&layout, &sweep(TWO_SEEDS)).map(drop);
        let other = Mutex::new(Some(|| open(Layout::new(&Disk, root.path())).unwrap()));
        let shared = Shared {
            other,
            operations_left: AtomicUsize::new(n),
        };
        open(Layout::new(&shared, root.path()))
            .unwrap_or_else(|error| panic!("before operation {n}: {error}"));
        if shared.other.lock().unwrap().is_some() {
            break;
        }
        n += 1;
    }
    assert!(n > 5, "the other run never came in between");
}

#[test]
fn a_directory_that_another_has_replaced_is_not_ours_any_more_and_one_with_a_further_round_is() {
    let [root, other] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let layout = Layout::new(&Disk, root.path());
    let rounds =
        sweep("[precision]\nof = \"tau_mean\"\nrelative = 0.1\nseeds = { from = 2, to = 3 }");
    let first = open(&layout, &rounds).unwrap();
    let round = Round {
        points: vec![2..=2],
        ..Round::default()
    };
    let second = first.followed_by(first.sweep(), Some(round), None);
    fs::write(layout.extension(1), second.record(1).text()).unwrap();
    assert_eq!(Results::read(&layout).unwrap().rounds().len(), 2);
    assert!(first.check_place().is_ok() && second.check_place().is_ok());
    open(&Layout::new(&Disk, other.path()), &sweep(TWO_SEEDS)).unwrap();
    for number in [0, 1] {
        fs::copy(
            other.path().join("run/extension-000.json"),
            layout.extension(number),
        )
        .unwrap();
    }
    assert!(first.check_place().is_err() && second.check_place().is_err());
    let error = Results::read(&layout).unwrap_err().to_string();
    assert!(error.contains("extension-001.json: damaged"), "{error}");
}

#[test]
fn a_changed_or_cut_file_of_an_extension_is_named() {
    let root = tempfile::tempdir().unwrap();
    open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)).unwrap();
    let path = root.path().join("run/extension-000.json");
    let text = fs::read_to_string(&path).unwrap();
    for changed in [
        &text[..text.len() / 2],
        &text.replace("[0, 1]", "[0, 2]"),
        "",
    ] {
        fs::write(&path, changed).unwrap();
        let error = open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("run/extension-000.json: damaged"),
            "{error}"
        );
    }
    fs::remove_file(&path).unwrap();
    fs::create_dir_all(root.path().join("tables/jobs")).unwrap();
    fs::write(root.path().join("tables/jobs/part-000-000000.parquet"), "").unwrap();
    for lost in [
        open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)),
        Results::read(&Layout::new(&Disk, root.path())),
    ] {
        let error = lost.unwrap_err().to_string();
        assert!(
            error.contains("run/extension-000.json: damaged: it is missing"),
            "{error}"
        );
    }
}

#[test]
fn the_file_of_an_extension_is_made_again_from_the_footer_of_any_of_its_parts() {
    let root = tempfile::tempdir().unwrap();
    let layout = Layout::new(&Disk, root.path());
    open(&layout, &sweep(TWO_SEEDS)).unwrap();
    let extended = open(&layout, &sweep(THREE_SEEDS)).unwrap();
    for number in [0, 1] {
        let footer = extended.footer(number);
        let texts =
            ["sweep", "extension"].map(|key| (key.to_owned(), footer.get(key).unwrap().to_owned()));
        let again = Record::of_footer(&texts.into()).unwrap();
        assert_eq!(
            again.text(),
            fs::read_to_string(layout.extension(number)).unwrap()
        );
    }
}
