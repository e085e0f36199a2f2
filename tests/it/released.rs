//! Later versions read the directories that released versions wrote. Each version adds one, which never changes:
//! tests/released/VERSION, made by `run tests/released/sweep.toml`, without `run/lock` and `run/log`.

use crate::program::Folder;
use std::fs;
use std::path::Path;

/// Copies the files of a folder.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &to);
        } else {
            _ = fs::copy(entry.path(), to).unwrap();
        }
    }
}

#[test]
fn directories_of_released_versions_are_shown_drawn_reported_and_exported() {
    let released = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/released");
    let versions = fs::read_dir(released)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir());
    let mut count = 0;
    for path in versions {
        let folder = Folder::new();
        copy(&path, &folder.path("r"));
        let show = || {
            folder
                .ends(
                    0,
                    "show r --csv --columns frequency,slips,tau_mean,resultant_drive",
                )
                .stdout
        };
        let as_written = show();
        for words in [
            "58.0,6,0.011588447867285098,",
            "29.0,6,0.02298621917456732,",
        ] {
            assert!(
                as_written.contains(words),
                "{}: {as_written}",
                path.display()
            );
        }
        for command in ["plot r", "report r", "export r -o exported --format csv"] {
            folder.ends(0, command);
        }
        let rows = |table: &str| {
            fs::read_to_string(folder.path("exported").join(table))
                .unwrap()
                .lines()
                .count()
                - 1
        };
        assert_eq!((rows("jobs.csv"), rows("slips.csv")), (3, 13));
        // Reduced by this version, whose intervals and phases have its own definitions.
        fs::remove_dir_all(folder.path("r/reduced")).unwrap();
        let means = |text: &str| -> Vec<Vec<String>> {
            // After η, which is computed from the others: with twelve digits by early versions.
            let cells = text.lines().map(|line| line.split(',').skip(1).take(3));
            cells
                .map(|cells| cells.map(str::to_owned).collect())
                .collect()
        };
        assert_eq!(means(&show()), means(&as_written));
        count += 1;
    }
    assert!(count > 0);
}
