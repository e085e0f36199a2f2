//! A corpus of damage to results directories: each kind is found and named, nothing is changed by looking, and the commands
//! that are printed make the tables what they were.

use crate::program::Folder;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Two parts of a job, extended by one; some slips have precursors.
fn sweep(name: &str, seeds: u64) -> String {
    format!(
        "name = \"{name}\"\n[model]\nN = 2\nNs = 1\n[axes]\nseed = {{ count = {seeds} }}\n\
         [record]\nslips = 300\ndiscard = 0\nprecursors = true\n"
    )
}

const FIRST: &str = "part-000-000000.parquet";
const SECOND: &str = "part-000-000001.parquet";
const EXTENSION: &str = "part-001-000000.parquet";
const TABLES: [&str; 3] = ["slips", "precursors", "jobs"];

/// A kind of damage: its name, what it does, the file that is to be named, and how many jobs it concerns.
struct Damage {
    name: &'static str,
    to: fn(&Path),
    file: &'static str,
    jobs: usize,
}

const fn damage(name: &'static str, file: &'static str, jobs: usize, to: fn(&Path)) -> Damage {
    Damage { name, to, file, jobs }
}

fn in_all_tables(change: impl Fn(&str)) {
    for table in TABLES {
        change(table);
    }
}

fn path(root: &Path, table: &str, name: &str) -> PathBuf {
    root.join("tables").join(table).join(name)
}

fn change(path: &Path, how: impl FnOnce(&mut Vec<u8>)) {
    let mut bytes = fs::read(path).unwrap();
    how(&mut bytes);
    fs::write(path, bytes).unwrap();
}

fn flip(path: &Path, at: impl FnOnce(usize) -> usize) {
    change(path, |bytes| {
        let at = at(bytes.len());
        bytes[at] ^= 0x10;
    });
}

/// Puts a FIFO into the place of a file.
#[cfg(unix)]
fn fifo(path: &Path) {
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    fs::remove_file(path).unwrap();
    mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
}

fn swap(one: &Path, other: &Path) {
    let aside = one.with_extension("aside");
    fs::rename(one, &aside).unwrap();
    fs::rename(other, one).unwrap();
    fs::rename(aside, other).unwrap();
}

/// The compacted file of a table with the first two parts.
fn compacted(root: &Path, table: &str) -> PathBuf {
    let files = fs::read_dir(root.join("tables").join(table)).unwrap().map(|entry| entry.unwrap().path());
    files.min().unwrap()
}

/// The directory of another sweep beside this one.
fn other(root: &Path) -> PathBuf {
    root.with_file_name("other")
}

/// The same, compacted.
fn other_compacted(root: &Path) -> PathBuf {
    root.with_file_name("other-compacted")
}

const PARTS: &[Damage] = &[
    damage("a jobs file cut in half", "tables/jobs/part-000-000001.parquet", 1, |root| {
        change(&path(root, "jobs", SECOND), |bytes| bytes.truncate(bytes.len() / 2));
    }),
    damage("a slips file without its last byte", "tables/slips/part-000-000001.parquet", 1, |root| {
        change(&path(root, "slips", SECOND), |bytes| bytes.truncate(bytes.len() - 1));
    }),
    damage("an empty precursors file", "tables/precursors/part-000-000001.parquet", 1, |root| {
        fs::write(path(root, "precursors", SECOND), "").unwrap();
    }),
    damage("a bit of the data", "tables/slips/part-000-000000.parquet", 1, |root| {
        flip(&path(root, "slips", FIRST), |length| length / 3);
    }),
    damage("a bit of the footer", "tables/jobs/part-001-000000.parquet", 1, |root| {
        flip(&path(root, "jobs", EXTENSION), |length| length - 300);
    }),
    damage("a bit of the first bytes", "tables/slips/part-000-000001.parquet", 1, |root| {
        flip(&path(root, "slips", SECOND), |_| 1);
    }),
    damage("a bit of the last bytes", "tables/jobs/part-000-000001.parquet", 1, |root| {
        flip(&path(root, "jobs", SECOND), |length| length - 1);
    }),
    damage("a bit of the length of the footer", "tables/jobs/part-000-000001.parquet", 1, |root| {
        flip(&path(root, "jobs", SECOND), |length| length - 7);
    }),
    damage("bytes at the end", "tables/slips/part-000-000001.parquet", 1, |root| {
        change(&path(root, "slips", SECOND), |bytes| bytes.extend([0; 100]));
    }),
    damage("a hole of zeros", "tables/jobs/part-000-000000.parquet", 1, |root| {
        change(&path(root, "jobs", FIRST), |bytes| bytes[4096..8192].fill(0));
    }),
    damage("another text in the file's place", "tables/slips/part-001-000000.parquet", 1, |root| {
        fs::write(path(root, "slips", EXTENSION), "Permission denied\n").unwrap();
    }),
    damage("a missing slips file", "tables/slips/part-000-000001.parquet", 1, |root| {
        fs::remove_file(path(root, "slips", SECOND)).unwrap();
    }),
    damage("a missing precursors file", "tables/precursors/part-001-000000.parquet", 1, |root| {
        fs::remove_file(path(root, "precursors", EXTENSION)).unwrap();
    }),
    damage("a missing jobs file", "tables/jobs/part-000-000001.parquet", 1, |root| {
        fs::remove_file(path(root, "jobs", SECOND)).unwrap();
    }),
    damage("a missing part", "tables/jobs/part-001-000000.parquet", 1, |root| {
        in_all_tables(|table| fs::remove_file(path(root, table, EXTENSION)).unwrap());
    }),
    damage("a missing table", "tables/precursors/part-000-000000.parquet", 3, |root| {
        fs::remove_dir_all(root.join("tables/precursors")).unwrap();
    }),
    damage("a copy under another name", "tables/slips/part-000-000001 (copy).parquet", 0, |root| {
        fs::copy(path(root, "slips", SECOND), path(root, "slips", "part-000-000001 (copy).parquet")).unwrap();
    }),
    damage("a copy under a number past the plan", "tables/jobs/part-000-000002.parquet", 0, |root| {
        fs::copy(path(root, "jobs", SECOND), path(root, "jobs", "part-000-000002.parquet")).unwrap();
    }),
    damage("a part of an extension that there is not", "tables/jobs/part-002-000000.parquet", 0, |root| {
        fs::copy(path(root, "jobs", SECOND), path(root, "jobs", "part-002-000000.parquet")).unwrap();
    }),
    damage("names of two parts swapped", "tables/jobs/part-000-000000.parquet", 2, |root| {
        in_all_tables(|table| swap(&path(root, table, FIRST), &path(root, table, SECOND)));
    }),
    damage("names of two slips files swapped", "tables/slips/part-000-000001.parquet", 2, |root| {
        swap(&path(root, "slips", FIRST), &path(root, "slips", SECOND));
    }),
    damage("names of parts of two extensions swapped", "tables/slips/part-001-000000.parquet", 2, |root| {
        swap(&path(root, "slips", EXTENSION), &path(root, "slips", SECOND));
    }),
    damage("a file in the folder of another table", "tables/slips/part-000-000001.parquet", 1, |root| {
        fs::copy(path(root, "jobs", SECOND), path(root, "slips", SECOND)).unwrap();
    }),
    damage("a file moved to the folder of another table", "tables/precursors/part-000-000001.parquet", 1, |root| {
        fs::rename(path(root, "slips", SECOND), path(root, "precursors", SECOND)).unwrap();
    }),
    damage("a part of another sweep", "tables/slips/part-000-000001.parquet", 1, |root| {
        in_all_tables(|table| {
            fs::copy(path(&other(root), table, FIRST), path(root, table, SECOND)).unwrap();
        });
    }),
    damage("a stray file", "tables/jobs/notes.txt", 0, |root| {
        fs::write(path(root, "jobs", "notes.txt"), "to do").unwrap();
    }),
    damage("a folder among the files", "tables/slips/old", 0, |root| {
        fs::create_dir(path(root, "slips", "old")).unwrap();
        fs::copy(path(root, "slips", SECOND), path(root, "slips/old", SECOND)).unwrap();
    }),
    damage("a folder in a file's place", "tables/jobs/part-000-000001.parquet", 1, |root| {
        fs::remove_file(path(root, "jobs", SECOND)).unwrap();
        fs::create_dir(path(root, "jobs", SECOND)).unwrap();
    }),
    damage("a table that is none", "tables/backup", 0, |root| {
        fs::create_dir(root.join("tables/backup")).unwrap();
        fs::copy(path(root, "jobs", SECOND), path(root, "backup", SECOND)).unwrap();
    }),
    damage("a manifest cut in half", "run/manifest.json", 0, |root| {
        change(&root.join("run/manifest.json"), |bytes| bytes.truncate(bytes.len() / 2));
    }),
    damage("a bit of the manifest's texts", "run/manifest.json", 0, |root| {
        let path = root.join("run/manifest.json");
        let text = fs::read_to_string(&path).unwrap();
        fs::write(path, text.replace("count = 3", "count = 4")).unwrap();
    }),
    damage("a missing manifest", "run/manifest.json", 0, |root| {
        fs::remove_file(root.join("run/manifest.json")).unwrap();
    }),
    damage("the manifest of another directory", "run/manifest.json", 0, |root| {
        fs::copy(other(root).join("run/manifest.json"), root.join("run/manifest.json")).unwrap();
    }),
    damage("a changed sweep file", "run/sweep-000.toml", 0, |root| {
        fs::write(root.join("run/sweep-000.toml"), sweep("damaged", 7)).unwrap();
    }),
    damage("a sweep file of random bytes", "run/sweep-001.toml", 0, |root| {
        fs::write(root.join("run/sweep-001.toml"), [0xff, 0xfe, 0x00]).unwrap();
    }),
    damage("a missing sweep file", "run/sweep-000.toml", 0, |root| {
        fs::remove_file(root.join("run/sweep-000.toml")).unwrap();
    }),
    #[cfg(unix)]
    damage("a FIFO in a file's place", "tables/slips/part-000-000001.parquet", 1, |root| {
        fifo(&path(root, "slips", SECOND));
    }),
    #[cfg(unix)]
    damage("a FIFO in the manifest's place", "run/manifest.json", 0, |root| fifo(&root.join("run/manifest.json"))),
    damage("a folder in the manifest's place", "run/manifest.json", 0, |root| {
        fs::remove_file(root.join("run/manifest.json")).unwrap();
        fs::create_dir_all(root.join("run/manifest.json/full")).unwrap();
    }),
    damage("a folder in a sweep file's place", "run/sweep-001.toml", 0, |root| {
        fs::remove_file(root.join("run/sweep-001.toml")).unwrap();
        fs::create_dir(root.join("run/sweep-001.toml")).unwrap();
    }),
    #[cfg(unix)]
    damage("a FIFO among reduced data", "reduced/sets.parquet", 0, |root| fifo(&root.join("reduced/sets.parquet"))),
    damage("a bit of reduced data", "reduced/sets.parquet", 0, |root| {
        flip(&root.join("reduced/sets.parquet"), |length| length / 2);
    }),
];

const COMPACTED: &[Damage] = &[
    damage("a bit of compacted slips", "tables/slips/compact-000-000000-000001-", 2, |root| {
        flip(&compacted(root, "slips"), |length| length / 2);
    }),
    damage("compacted jobs cut in half", "tables/jobs/compact-000-000000-000001-", 2, |root| {
        change(&compacted(root, "jobs"), |bytes| bytes.truncate(bytes.len() / 2));
    }),
    damage("missing compacted precursors", "tables/precursors/compact-000-000000-000001-", 2, |root| {
        fs::remove_file(compacted(root, "precursors")).unwrap();
    }),
    damage("missing compacted jobs", "tables/jobs/compact-000-000000-000001-", 2, |root| {
        fs::remove_file(compacted(root, "jobs")).unwrap();
    }),
    damage("all compacted files of a sweep missing", "tables/jobs/part-000-000000.parquet", 2, |root| {
        in_all_tables(|table| fs::remove_file(compacted(root, table)).unwrap());
    }),
    damage("all tables missing", "tables/jobs/part-001-000000.parquet", 3, |root| {
        fs::remove_dir_all(root.join("tables")).unwrap();
    }),
    damage("compacted files in each other's place", "tables/slips/compact-000-000000-000001-", 2, |root| {
        swap(&compacted(root, "slips"), &compacted(root, "precursors"));
        let (slips, precursors) = (compacted(root, "slips"), compacted(root, "precursors"));
        let names = [&slips, &precursors].map(|path| path.file_name().unwrap().to_owned());
        fs::rename(&slips, slips.with_file_name(&names[1])).unwrap();
        fs::rename(&precursors, precursors.with_file_name(&names[0])).unwrap();
    }),
    damage("a compacted file under the name of other parts", "tables/slips/compact-000-000000-000000-", 2, |root| {
        let path = compacted(root, "jobs");
        let name = path.file_name().unwrap().to_str().unwrap().replace("000000-000001", "000000-000000");
        fs::rename(&path, path.with_file_name(name)).unwrap();
    }),
    damage("a compacted part back among the files", "tables/jobs/part-000-000001.parquet", 0, |root| {
        let parts = root.with_file_name("parts");
        fs::copy(path(&parts, "jobs", SECOND), path(root, "jobs", SECOND)).unwrap();
    }),
    damage("a compacted file of another directory", "tables/slips/compact-000-000000-000000-", 0, |root| {
        let from = compacted(&other_compacted(root), "slips");
        fs::copy(&from, path(root, "slips", from.file_name().unwrap().to_str().unwrap())).unwrap();
    }),
    damage("a compacted file of parts past the plan", "tables/slips/compact-000-000007-000009-", 0, |root| {
        let name = "compact-000-000007-000009-0123456789abcdef.parquet";
        fs::copy(compacted(root, "slips"), path(root, "slips", name)).unwrap();
    }),
];

fn copy_all(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_all(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// The files of all tables with their bytes.
fn tables(folder: &Folder, directory: &str) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    folder.contents(&format!("{directory}/tables"))
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// A directory `parts`, and `compacted`, which is the same compacted; and both of another sweep.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("a.toml", &sweep("damaged", 2));
    folder.write("b.toml", &sweep("damaged", 3));
    folder.write("c.toml", &sweep("other", 1));
    folder.ends(0, "run a.toml --out parts --no-reduce");
    folder.ends(0, "run b.toml --out parts");
    folder.ends(0, "run c.toml --out other --no-reduce");
    for (parts, compacted) in [("parts", "compacted"), ("other", "other-compacted")] {
        copy_all(&folder.path(parts), &folder.path(compacted));
        folder.ends(0, &format!("compact {compacted}"));
    }
    for directory in ["parts", "compacted", "other", "other-compacted"] {
        let report = json(&folder.ends(0, &format!("verify {directory} --json")).stdout);
        assert_eq!(report["whole"], true, "{report}");
    }
    folder
}

/// Damages a copy of a directory, and repairs it by what is printed.
fn damage_and_repair(folder: &Folder, whole: &str, damage: &Damage) {
    let Damage { name, to, file, jobs } = damage;
    let directory = folder.path("r");
    copy_all(&folder.path(whole), &directory);
    to(&directory);
    let before = folder.contents("r");
    let text = folder.ends(4, "verify r").stdout;
    assert!(text.contains(&format!("r/{file}")), "{name}: {text}");
    let report = json(&folder.ends(4, "verify r --json").stdout);
    assert!(folder.contents("r") == before, "{name}: looking changed something");
    let problems = report["problems"].as_array().unwrap();
    let found: usize = problems.iter().map(|problem| problem["jobs"].as_array().unwrap().len()).sum();
    assert_eq!(found, *jobs, "{name}: {text}");
    let commands: Vec<&str> = report["commands"].as_array().unwrap().iter().map(|c| c.as_str().unwrap()).collect();
    assert!(!commands.is_empty(), "{name}");
    for command in &commands {
        assert!(text.contains(command), "{name}: {command} is not in {text}");
        folder.ends(0, command.strip_prefix("stickslip ").unwrap());
    }
    let after = folder.ends(0, "verify r").stdout;
    assert!(tables(folder, "r") == tables(folder, whole), "{name}: {commands:?}\n{text}\n{after}");
    let run = json(&folder.ends(0, "run b.toml --out r --no-reduce --json").stdout);
    assert_eq!(run["jobs_run"].as_u64(), Some(0), "{name}");
    fs::remove_dir_all(directory).unwrap();
}

#[test]
fn every_kind_of_damage_is_found_named_and_repaired_by_what_is_printed() {
    let folder = folder();
    for damage in PARTS {
        damage_and_repair(&folder, "parts", damage);
    }
    for damage in COMPACTED {
        damage_and_repair(&folder, "compacted", damage);
    }
}

#[test]
fn what_is_not_yet_done_is_no_damage() {
    let folder = Folder::new();
    folder.write("a.toml", &sweep("unfinished", 2));
    folder.ends(0, "run a.toml --out r --shard 2/2 --no-reduce");
    // As a run leaves it that is killed between two files of a part.
    folder.ends(0, "run a.toml --out other --no-reduce");
    fs::copy(path(&folder.path("other"), "slips", FIRST), path(&folder.path("r"), "slips", FIRST)).unwrap();
    let text = folder.ends(0, "verify r").stdout;
    assert!(text.contains("not yet done  1 part, 1 job\ndamaged       nothing\n"), "{text}");
    let report = json(&folder.ends(0, "verify r --json").stdout);
    assert_eq!((report["parts"].as_u64(), report["jobs"].as_u64()), (Some(1), Some(1)));
    assert!(report["commands"].as_array().unwrap().is_empty(), "{report}");
    // Readers see that file, so it must be whole nevertheless.
    flip(&path(&folder.path("r"), "slips", FIRST), |length| length / 2);
    let text = folder.ends(4, "verify r").stdout;
    assert!(text.contains(&format!("r/tables/slips/{FIRST}: ")), "{text}");
    folder.ends(2, "verify missing");
}
