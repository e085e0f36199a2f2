//! Files and folders that commands write where their user says: what the program did not make is left alone.

use crate::program::Folder;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};

const SWEEP: &str = "\
name = \"q\"
[model]
N = 2
Ns = 2
[axes]
V0 = [1e-4, 2e-4]
seed = { count = 2 }
[record]
slips = 2
discard = 0
";
/// A job that ends in a moment.
const JOB: &str = "simulate --set N=2 --set Ns=2 --slips 1 --record discard=0";

fn folder_with_results() -> Folder {
    let folder = Folder::new();
    folder.write("a.toml", SWEEP);
    folder.ends(0, "run a.toml -o r --threads 1");
    folder
}

#[test]
fn no_output_replaces_what_has_not_a_name_of_its_kind() {
    let folder = folder_with_results();
    folder.write("note", "mine");
    symlink("note", folder.path("link.html")).unwrap();
    // Found to be wrong after a computation of days, this would come too late.
    let long = "simulate --set N=2000 --slips 1000000";
    let commands = [
        "report r -o a.toml".to_owned(),
        "report r -o note".to_owned(),
        "report r -o link.html".to_owned(),
        "report r -o r/reduced/sets.parquet".to_owned(),
        "plot r --x V0 --y tau_mean -o r/run/a.svg".to_owned(),
        "plot r --x V0 --y tau_mean -o note".to_owned(),
        "accuracy -o note".to_owned(),
        "init a.toml".to_owned(),
        "init note".to_owned(),
        "init new".to_owned(),
        format!("{long} --trace a.toml"),
        format!("{long} --map a.toml"),
        format!("{long} --profile a.toml"),
        format!("{long} --contacts a.toml"),
        format!("{long} --slip-table a.toml"),
        format!("{long} --slip-table r/tables/slips/part-000-000000.parquet"),
        format!("{long} --plot a.toml"),
        format!("{long} --plot new.svg --plot ./new.svg"),
        format!("{long} --trace new.parquet --map ./new.parquet"),
        format!("{long} --trace missing/new.parquet"),
        format!("{long} --trace /dev/null"),
    ];
    let before = folder.contents("");
    for command in commands {
        folder.ends(2, &command);
    }
    assert!(folder.contents("") == before);
}

#[test]
fn an_output_replaces_a_file_of_its_name_and_keeps_the_mode() {
    let folder = folder_with_results();
    let commands = [
        ("report r -o page.html", "page.html"),
        ("plot r --x V0 --y tau_mean -o own.svg", "own.svg"),
        (&format!("{JOB} --trace table.parquet"), "table.parquet"),
        (&format!("{JOB} --plot own.png"), "own.png"),
    ];
    for (command, name) in commands {
        folder.ends(0, command);
        let file = folder.path(name);
        let first = fs::read(&file).unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        folder.ends(0, command);
        assert!(fs::read(&file).unwrap() == first, "{command}");
        let mode = fs::metadata(&file).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{command}");
    }
    folder.ends(0, "report r -o /dev/null");
    let page = folder.ends(0, "report r -o /dev/stdout").stdout;
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
    let names = folder.contents("").into_keys();
    let drafts = names.filter(|path| path.to_string_lossy().contains(".stickslip-"));
    assert_eq!(drafts.count(), 0);
}

#[test]
fn tidying_follows_no_link() {
    for linked in [
        "run/claims",
        "run/staging",
        "run/staging/reduce",
        "run/workers",
    ] {
        let folder = folder_with_results();
        fs::create_dir_all(folder.path("mine/reduce")).unwrap();
        for file in ["mine/worker-x-1-0", "mine/thesis", "mine/reduce/thesis"] {
            folder.write(file, "precious");
        }
        let _ = fs::remove_dir_all(folder.path("r").join(linked));
        symlink(folder.path("mine"), folder.path("r").join(linked)).unwrap();
        for command in ["run r", "reduce r", "report r"] {
            folder.run(command);
        }
        let left = folder.contents("mine");
        let precious = left
            .values()
            .flatten()
            .filter(|bytes| *bytes == b"precious");
        assert_eq!(precious.count(), 3, "{linked}");
    }
}
