//! Directories of programs of other versions: what is there is read, and nothing is run in them.

use super::{fine, options, run, run_all, sweep};
use crate::reduce::{read_reduced, reduce};
use crate::results::destination::NewFolder;
use crate::results::layout::Layout;
use crate::results::tables::{JobRow, Names, PrecursorRow, RecordedTable, SlipRow, gaps};
use crate::results::{ErrorKind, Results, of_other_versions};
use crate::sets::SetRow;
use crate::table::columns::Row;
use crate::table::file::{Dataset, Footer, TableWriter};
use crate::table::formats::Format;
use crate::table::storage::{Disk, Storage};
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

const SEEDS: u64 = 3;
/// A column that another version did not have.
const MISSING: &str = "grid_steps";

/// Rewrites a directory as another version of model and plan would have left it, without a column.
fn make_older(root: &Path) {
    let layout = Layout::new(&Disk, root);
    let results = Results::read(&layout).unwrap();
    let [slips, precursors, jobs] = RecordedTable::ALL.map(|table| {
        let files = results.dataset(table).unwrap();
        files.files().cloned().collect::<Vec<_>>()
    });
    for file in &slips {
        write_again::<SlipRow<'_>>(file, &results);
    }
    for file in &precursors {
        write_again::<PrecursorRow<'_>>(file, &results);
    }
    for file in &jobs {
        write_again::<JobRow>(file, &results);
    }
    for path in layout.files_of_extension(0) {
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, of_other_versions(&text, MISSING)).unwrap();
    }
}

/// Writes a file without the column, and as an earlier program that said less in the footer.
fn write_again<R: Row>(file: &Path, results: &Results<'_>) {
    let mut gaps = gaps(results.sweep());
    gaps.left_out.push(MISSING.into());
    let batches: Vec<_> = Dataset::new(&Disk, vec![file.to_owned()])
        .batches()
        .map(Result::unwrap)
        .collect();
    fs::remove_file(file).unwrap();
    let created = Disk.create(file).unwrap();
    let mut writer = TableWriter::<R>::new(&gaps, file, created, &Footer::default()).unwrap();
    for batch in &batches {
        writer.copy(batch, 0..batch.rows.num_rows()).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_directory_of_another_version_is_reduced_and_exported_unchanged_and_not_run() {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), &sweep(SEEDS, ""), &fine);
    let layout = Layout::new(&Disk, root.path());
    let sets = || {
        reduce(&Results::read(&layout).unwrap()).unwrap();
        read_reduced::<SetRow>(&layout).unwrap()
    };
    let expected = sets();
    make_older(root.path());
    assert_eq!(sets(), expected);
    let (own, out) = (
        Results::read(&layout).unwrap(),
        tempfile::tempdir().unwrap(),
    );
    let exported = own
        .export(
            NewFolder::new(&out.path().join("x")).unwrap(),
            Format::Csv,
            &AtomicBool::new(false),
            &mut |_, _| (),
        )
        .unwrap();
    assert_eq!((exported.jobs, exported.jobs_missing), (2 * SEEDS, 0));
    let jobs = fs::read_to_string(out.path().join("x/jobs.csv")).unwrap();
    let place = jobs
        .lines()
        .next()
        .unwrap()
        .split(',')
        .position(|column| column == MISSING)
        .unwrap();
    assert!(
        jobs.lines()
            .skip(1)
            .all(|row| row.split(',').nth(place) == Some("")),
        "{jobs}"
    );
    let errors = [
        Results::read_plan(&layout).unwrap_err(),
        run(
            &layout,
            &sweep(SEEDS, ""),
            options(&AtomicBool::new(false), 2),
            &fine,
            &mut |_| (),
        )
        .unwrap_err(),
    ];
    for error in errors {
        let differences = [
            "model version: 0 -> ",
            "plan version: 0 -> ",
            "with [\"grid_steps\"]",
        ];
        let text = error.to_string();
        assert!(
            error.kind == ErrorKind::Refused
                && differences.iter().all(|words| text.contains(words)),
            "{text}"
        );
    }
    // Ids of its jobs are those of its version.
    let ids: Vec<String> = own
        .dataset(RecordedTable::Jobs)
        .unwrap()
        .rows::<Names>()
        .map(|names| names.unwrap().job_id)
        .collect();
    let own_ids = |sweep: &crate::sweep::Sweep| {
        sweep
            .jobs()
            .map(|job| sweep.job_id(&job.parameters))
            .collect::<Vec<_>>()
    };
    assert_eq!(own_ids(&sweep(SEEDS, "")), ids);
    assert!(own_ids(own.sweep()).iter().all(|id| !ids.contains(id)));
}
