//! Directories that are begun, changed, damaged, somebody else's, or begun by two runs at once.

use super::*;
use crate::results::commit::Commit;
use crate::results::tables::RecordedTable;
use crate::results::workers::tests::open;
use crate::results::{ErrorKind, Results};
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

fn read_text(text: &str) -> Record {
    serde_json::from_str(&checksum::checked(text).unwrap()).unwrap()
}

/// Writes both files of an extension.
fn write_both(layout: &Layout<'_>, number: usize, text: &str) {
    for file in layout.files_of_extension(number) {
        fs::write(file, text).unwrap();
    }
}

/// The text of the file of an extension of a program with other versions, and without a column of the jobs.
pub(crate) fn of_other_versions(text: &str, column: &str) -> String {
    let mut record: Record = read_text(text);
    (record.model_version, record.plan_version) = (0, 0);
    record
        .tables
        .get_mut(RecordedTable::Jobs.word())
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
    let layout = Layout::new(&Disk, root.path());
    let text = fs::read_to_string(layout.extension(0)).unwrap();
    let mut other = read_text(&text);
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
    write_both(&layout, 0, &other.text());
    refused(
        "[model]\nK = 1e8\n[record]\nslips = 3",
        &["random numbers: dice -> ", "without [\"start\"]"],
    );
    let mut other = read_text(&text);
    other.plan_version = PLAN_VERSION - 1;
    write_both(&layout, 0, &other.text());
    refused(
        "[model]\nK = 1e8\n[record]\nslips = 3",
        &[&format!(
            "plan version: {} -> {PLAN_VERSION}",
            PLAN_VERSION - 1
        )],
    );
    let mut other = read_text(&text);
    other.identity = "0".repeat(32);
    write_both(&layout, 0, &other.text());
    refused(
        "[model]\nK = 1e8\n[record]\nslips = 3",
        &["ids of jobs: those of stickslip"],
    );
}

#[derive(Serialize)]
struct Newer {
    format: u32,
    news: bool,
}

#[test]
fn a_newer_format_is_refused_and_a_changed_digit_of_the_format_is_damage() {
    let root = tempfile::tempdir().unwrap();
    let layout = Layout::new(&Disk, root.path());
    open(&layout, &sweep(TWO_SEEDS)).unwrap();
    let text = fs::read_to_string(layout.extension(0)).unwrap();
    let error = || Results::read(&layout).unwrap_err();
    for digit in ["0", "5", "8", "9", "77"] {
        let changed = text.replace("\"format\": 7", &format!("\"format\": {digit}"));
        write_both(&layout, 0, &changed);
        let error = error();
        assert!(error.kind == ErrorKind::Damaged, "{error}");
    }
    // With a key that this program does not know.
    let newer = Newer {
        format: 8,
        news: true,
    };
    write_both(&layout, 0, &checksum::to_json(&newer).unwrap());
    let error = error();
    assert!(
        error.kind == ErrorKind::Refused && error.to_string().contains("has format 8"),
        "{error}"
    );
}

#[test]
fn a_table_file_with_a_name_that_no_part_has_is_damage_and_what_others_leave_is_passed_over() {
    let root = tempfile::tempdir().unwrap();
    let begin = || open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS));
    begin().unwrap();
    let jobs = root.path().join("tables/jobs");
    fs::create_dir_all(&jobs).unwrap();
    for name in [
        "compact-000-000000-000001-0123456789abcdef.parquet",
        "part-001-000000.parquet",
        "part-000-000000 (copy).parquet",
    ] {
        fs::write(jobs.join(name), "").unwrap();
        let error = begin().unwrap_err();
        let text = error.to_string();
        assert!(
            error.kind == ErrorKind::Damaged
                && text.contains(name)
                && text.contains("no part of this directory has this name"),
            "{text}"
        );
        fs::remove_file(jobs.join(name)).unwrap();
    }
    for name in [
        "notes.txt",
        ".DS_Store",
        "._part-000-000000.parquet",
        "_SUCCESS",
        "_metadata.parquet",
    ] {
        fs::write(jobs.join(name), "").unwrap();
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
    for hidden in [".DS_Store", "run/.nfs0000", "run/_notes"] {
        fs::write(root.path().join(hidden), "").unwrap();
    }
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
    second.write_copies(|| Commit::begin(&layout)).unwrap();
    assert_eq!(Results::read(&layout).unwrap().rounds().len(), 2);
    assert!(first.check_place().is_ok() && second.check_place().is_ok());
    open(&Layout::new(&Disk, other.path()), &sweep(TWO_SEEDS)).unwrap();
    for number in [0, 1] {
        let text = fs::read_to_string(other.path().join("run/extension-000.json")).unwrap();
        write_both(&layout, number, &text);
    }
    assert!(first.check_place().is_err() && second.check_place().is_err());
    let error = Results::read(&layout).unwrap_err().to_string();
    assert!(error.contains("extension-001.json: damaged"), "{error}");
}

#[test]
fn a_changed_cut_or_lost_file_of_an_extension_does_no_harm_and_with_its_copy_it_is_named() {
    let root = tempfile::tempdir().unwrap();
    let layout = Layout::new(&Disk, root.path());
    open(&layout, &sweep(TWO_SEEDS)).unwrap();
    open(&layout, &sweep(THREE_SEEDS)).unwrap();
    let texts = [0, 1].map(|number| fs::read_to_string(layout.extension(number)).unwrap());
    fs::create_dir_all(root.path().join("tables/jobs")).unwrap();
    fs::write(root.path().join("tables/jobs/part-000-000000.parquet"), "").unwrap();
    for number in [0, 1] {
        let text = &texts[number];
        let files = layout.files_of_extension(number);
        let cut = &text[..text.len() / 2];
        let changed = text.replace("[0, 1", "[0, 2");
        for damage in [
            Some(cut),
            Some(&*changed),
            Some(""),
            Some(&*texts[1 - number]),
            None,
        ] {
            let to = |file: &Path| match damage {
                Some(text) => fs::write(file, text).unwrap(),
                None => fs::remove_file(file).unwrap(),
            };
            for file in &files {
                to(file);
                let read = Results::read(&layout).unwrap();
                assert_eq!(read.extensions().len(), 2);
                read.check_place().unwrap();
                open(&layout, &sweep(THREE_SEEDS)).unwrap();
                assert!(damage.is_some() || fs::read_to_string(file).unwrap() == *text);
                fs::write(file, text).unwrap();
            }
            for file in &files {
                to(file);
            }
            for lost in [open(&layout, &sweep(THREE_SEEDS)), Results::read(&layout)] {
                // The last one is as if it had never been, if both are lost.
                let is_last = number == 1 && damage.is_none();
                let name = format!("run/extension-00{number}.json: damaged");
                match lost {
                    Ok(_) => assert!(is_last),
                    Err(error) => assert!(error.to_string().contains(&name), "{error}"),
                }
            }
            write_both(&layout, number, text);
        }
    }
}

#[test]
fn of_two_whole_files_that_differ_the_one_after_them_says_which_counts() {
    let [root, other] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let layout = Layout::new(&Disk, root.path());
    let foreign = Layout::new(&Disk, other.path());
    open(&layout, &sweep(TWO_SEEDS)).unwrap();
    open(&foreign, &sweep("")).unwrap();
    let [file, copy] = layout.files_of_extension(0);
    fs::copy(foreign.extension(0), &file).unwrap();
    let error = Results::read(&layout).unwrap_err();
    assert!(
        error.kind == ErrorKind::Damaged
            && error.to_string().contains("one is of another directory"),
        "{error}"
    );
    fs::copy(copy, &file).unwrap();
    open(&layout, &sweep(THREE_SEEDS)).unwrap();
    fs::copy(foreign.extension(0), &file).unwrap();
    let found = read(&layout).unwrap();
    assert_eq!(found.records[0].sweep, sweep(TWO_SEEDS).text());
    assert_eq!(found.unsound[0].0, file);
}

#[test]
fn a_worker_that_opens_a_directory_writes_the_copies_that_another_did_not_come_to() {
    let root = tempfile::tempdir().unwrap();
    let layout = Layout::new(&Disk, root.path());
    open(&layout, &sweep(TWO_SEEDS)).unwrap();
    open(&layout, &sweep(THREE_SEEDS)).unwrap();
    let before = contents(root.path());
    for lost in [
        "run/copies",
        "run/copies/extension-001.json",
        "run/extension-000.json",
    ] {
        let path = root.path().join(lost);
        if path.is_dir() {
            fs::remove_dir_all(path).unwrap();
        } else {
            fs::remove_file(path).unwrap();
        }
        open(&layout, &sweep(THREE_SEEDS)).unwrap();
        assert_eq!(contents(root.path()), before, "{lost}");
    }
}
