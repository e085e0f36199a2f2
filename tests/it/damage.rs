//! A corpus of damage to results directories: each kind is found and named, nothing is changed by looking, and the
//! commands that are printed make the tables what they were.

use crate::program::{Ended, Folder};
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
    Damage {
        name,
        to,
        file,
        jobs,
    }
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

/// The directory of another sweep beside this one.
fn other(root: &Path) -> PathBuf {
    root.with_file_name("other")
}

/// A directory of the same sweep that had more jobs before it.
fn longer(root: &Path) -> PathBuf {
    root.with_file_name("longer")
}

const PARTS: &[Damage] = &[
    damage(
        "a jobs file cut in half",
        "tables/jobs/part-000-000001.parquet",
        1,
        |root| {
            change(&path(root, "jobs", SECOND), |bytes| {
                bytes.truncate(bytes.len() / 2);
            });
        },
    ),
    damage(
        "a slips file without its last byte",
        "tables/slips/part-000-000001.parquet",
        1,
        |root| {
            change(&path(root, "slips", SECOND), |bytes| {
                bytes.truncate(bytes.len() - 1);
            });
        },
    ),
    damage(
        "an empty precursors file",
        "tables/precursors/part-000-000001.parquet",
        1,
        |root| {
            fs::write(path(root, "precursors", SECOND), "").unwrap();
        },
    ),
    damage(
        "a bit of the data",
        "tables/slips/part-000-000000.parquet",
        1,
        |root| {
            flip(&path(root, "slips", FIRST), |length| length / 3);
        },
    ),
    damage(
        "a bit of the footer",
        "tables/jobs/part-001-000000.parquet",
        1,
        |root| {
            flip(&path(root, "jobs", EXTENSION), |length| length - 300);
        },
    ),
    damage(
        "a bit of the first bytes",
        "tables/slips/part-000-000001.parquet",
        1,
        |root| {
            flip(&path(root, "slips", SECOND), |_| 1);
        },
    ),
    damage(
        "a bit of the last bytes",
        "tables/jobs/part-000-000001.parquet",
        1,
        |root| {
            flip(&path(root, "jobs", SECOND), |length| length - 1);
        },
    ),
    damage(
        "a bit of the length of the footer",
        "tables/jobs/part-000-000001.parquet",
        1,
        |root| {
            flip(&path(root, "jobs", SECOND), |length| length - 7);
        },
    ),
    damage(
        "bytes at the end",
        "tables/slips/part-000-000001.parquet",
        1,
        |root| {
            change(&path(root, "slips", SECOND), |bytes| bytes.extend([0; 100]));
        },
    ),
    damage(
        "a hole of zeros",
        "tables/jobs/part-000-000000.parquet",
        1,
        |root| {
            change(&path(root, "jobs", FIRST), |bytes| {
                bytes[4096..8192].fill(0);
            });
        },
    ),
    damage(
        "another text in the file's place",
        "tables/slips/part-001-000000.parquet",
        1,
        |root| {
            fs::write(path(root, "slips", EXTENSION), "Permission denied\n").unwrap();
        },
    ),
    damage(
        "a missing slips file",
        "tables/slips/part-000-000001.parquet",
        1,
        |root| {
            fs::remove_file(path(root, "slips", SECOND)).unwrap();
        },
    ),
    damage(
        "a missing precursors file",
        "tables/precursors/part-001-000000.parquet",
        1,
        |root| {
            fs::remove_file(path(root, "precursors", EXTENSION)).unwrap();
        },
    ),
    damage(
        "all tables but the jobs missing",
        "tables/slips/part-000-000000.parquet",
        3,
        |root| {
            for table in ["slips", "precursors"] {
                fs::remove_dir_all(root.join("tables").join(table)).unwrap();
            }
        },
    ),
    damage(
        "a missing table",
        "tables/precursors/part-000-000000.parquet",
        3,
        |root| {
            fs::remove_dir_all(root.join("tables/precursors")).unwrap();
        },
    ),
    damage(
        "a copy under another name",
        "tables/slips/part-000-000001 (copy).parquet",
        0,
        |root| {
            fs::copy(
                path(root, "slips", SECOND),
                path(root, "slips", "part-000-000001 (copy).parquet"),
            )
            .unwrap();
        },
    ),
    damage(
        "a copy under a number past the plan",
        "tables/jobs/part-000-000002.parquet",
        0,
        |root| {
            fs::copy(
                path(root, "jobs", SECOND),
                path(root, "jobs", "part-000-000002.parquet"),
            )
            .unwrap();
        },
    ),
    damage(
        "a part of an extension that there is not",
        "tables/jobs/part-002-000000.parquet",
        0,
        |root| {
            fs::copy(
                path(root, "jobs", SECOND),
                path(root, "jobs", "part-002-000000.parquet"),
            )
            .unwrap();
        },
    ),
    damage(
        "names of two parts swapped",
        "tables/jobs/part-000-000000.parquet",
        2,
        |root| {
            in_all_tables(|table| swap(&path(root, table, FIRST), &path(root, table, SECOND)));
        },
    ),
    damage(
        "names of two slips files swapped",
        "tables/slips/part-000-000001.parquet",
        2,
        |root| {
            swap(&path(root, "slips", FIRST), &path(root, "slips", SECOND));
        },
    ),
    damage(
        "names of parts of two extensions swapped",
        "tables/slips/part-001-000000.parquet",
        2,
        |root| {
            swap(
                &path(root, "slips", EXTENSION),
                &path(root, "slips", SECOND),
            );
        },
    ),
    damage(
        "a file in the folder of another table",
        "tables/slips/part-000-000001.parquet",
        1,
        |root| {
            fs::copy(path(root, "jobs", SECOND), path(root, "slips", SECOND)).unwrap();
        },
    ),
    damage(
        "a file moved to the folder of another table",
        "tables/precursors/part-000-000001.parquet",
        1,
        |root| {
            fs::rename(
                path(root, "slips", SECOND),
                path(root, "precursors", SECOND),
            )
            .unwrap();
        },
    ),
    damage(
        "a part of another sweep",
        "tables/slips/part-000-000001.parquet",
        1,
        |root| {
            in_all_tables(|table| {
                fs::copy(path(&other(root), table, FIRST), path(root, table, SECOND)).unwrap();
            });
        },
    ),
    damage(
        "a part of a directory with the same sweep and another history",
        "tables/jobs/part-001-000000.parquet",
        1,
        |root| {
            in_all_tables(|table| {
                fs::copy(
                    path(&longer(root), table, EXTENSION),
                    path(root, table, EXTENSION),
                )
                .unwrap();
            });
        },
    ),
    damage(
        "a stray table file",
        "tables/jobs/notes.parquet",
        0,
        |root| {
            fs::write(path(root, "jobs", "notes.parquet"), "to do").unwrap();
        },
    ),
    damage(
        "a folder with the name of a table file",
        "tables/slips/old.parquet",
        0,
        |root| {
            fs::create_dir(path(root, "slips", "old.parquet")).unwrap();
            fs::copy(
                path(root, "slips", SECOND),
                path(root, "slips/old.parquet", SECOND),
            )
            .unwrap();
        },
    ),
    damage(
        "a folder in a file's place",
        "tables/jobs/part-000-000001.parquet",
        1,
        |root| {
            fs::remove_file(path(root, "jobs", SECOND)).unwrap();
            fs::create_dir(path(root, "jobs", SECOND)).unwrap();
        },
    ),
    damage(
        "an extension cut in half",
        "run/extension-000.json",
        0,
        |root| {
            change(&root.join("run/extension-000.json"), |bytes| {
                bytes.truncate(bytes.len() / 2);
            });
        },
    ),
    damage(
        "a bit of an extension's texts",
        "run/extension-000.json",
        0,
        |root| {
            let path = root.join("run/extension-000.json");
            let text = fs::read_to_string(&path).unwrap();
            fs::write(path, text.replace("count = 2", "count = 4")).unwrap();
        },
    ),
    damage(
        "a changed digit of the format",
        "run/extension-001.json",
        0,
        |root| {
            let path = root.join("run/extension-001.json");
            let text = fs::read_to_string(&path).unwrap();
            fs::write(path, text.replace("\"format\": 7", "\"format\": 5")).unwrap();
        },
    ),
    damage(
        "a copy of an extension cut in half",
        "run/copies/extension-001.json",
        0,
        |root| {
            change(&root.join("run/copies/extension-001.json"), |bytes| {
                bytes.truncate(bytes.len() / 2);
            });
        },
    ),
    damage(
        "one file of each extension",
        "run/extension-001.json",
        0,
        |root| {
            fs::write(root.join("run/copies/extension-000.json"), "").unwrap();
            fs::write(root.join("run/extension-001.json"), "").unwrap();
        },
    ),
    damage(
        "a missing first extension",
        "run/extension-000.json",
        0,
        |root| {
            fs::remove_file(root.join("run/extension-000.json")).unwrap();
        },
    ),
    damage(
        "the extension of another directory",
        "run/extension-000.json",
        0,
        |root| {
            fs::copy(
                other(root).join("run/extension-000.json"),
                root.join("run/extension-000.json"),
            )
            .unwrap();
        },
    ),
    damage(
        "an extension of random bytes",
        "run/extension-001.json",
        0,
        |root| {
            fs::write(root.join("run/extension-001.json"), [0xff, 0xfe, 0x00]).unwrap();
        },
    ),
    damage(
        "a missing last extension",
        "run/extension-001.json",
        0,
        |root| {
            fs::remove_file(root.join("run/extension-001.json")).unwrap();
        },
    ),
    damage(
        "all extensions missing",
        "run/extension-000.json",
        0,
        |root| {
            for number in [0, 1] {
                fs::remove_file(root.join(format!("run/extension-00{number}.json"))).unwrap();
            }
        },
    ),
    damage(
        "files of two extensions swapped",
        "run/extension-000.json",
        0,
        |root| {
            swap(
                &root.join("run/extension-000.json"),
                &root.join("run/extension-001.json"),
            );
        },
    ),
    #[cfg(unix)]
    damage(
        "a FIFO in a file's place",
        "tables/slips/part-000-000001.parquet",
        1,
        |root| {
            fifo(&path(root, "slips", SECOND));
        },
    ),
    #[cfg(unix)]
    damage(
        "a FIFO in an extension's place",
        "run/extension-000.json",
        0,
        |root| {
            fifo(&root.join("run/extension-000.json"));
        },
    ),
    damage(
        "a folder in an extension's place",
        "run/extension-000.json",
        0,
        |root| {
            fs::remove_file(root.join("run/extension-000.json")).unwrap();
            fs::create_dir_all(root.join("run/extension-000.json/full")).unwrap();
        },
    ),
    #[cfg(unix)]
    damage(
        "a FIFO among reduced data",
        "reduced/sets.parquet",
        0,
        |root| fifo(&root.join("reduced/sets.parquet")),
    ),
    damage("a bit of reduced data", "reduced/sets.parquet", 0, |root| {
        flip(&root.join("reduced/sets.parquet"), |length| length / 2);
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

/// A directory `parts`, and `other` of another sweep.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("a.toml", &sweep("damaged", 2));
    folder.write("b.toml", &sweep("damaged", 3));
    folder.write("c.toml", &sweep("other", 1));
    folder.ends(0, "run a.toml --out parts --no-reduce");
    folder.ends(0, "run b.toml --out parts");
    folder.ends(0, "run c.toml --out other --no-reduce");
    folder.write("d.toml", &sweep("damaged", 1));
    folder.ends(0, "run d.toml --out longer --no-reduce");
    folder.ends(0, "run b.toml --out longer --no-reduce");
    for directory in ["parts", "other", "longer"] {
        let report = json(&folder.ends(0, &format!("verify {directory} --json")).stdout);
        assert_eq!(report["whole"], true, "{report}");
    }
    folder
}

/// Damages a copy of a directory, and repairs it by what is printed.
fn damage_and_repair(folder: &Folder, whole: &str, damage: &Damage) {
    let Damage {
        name,
        to,
        file,
        jobs,
    } = damage;
    let directory = folder.path("r");
    copy_all(&folder.path(whole), &directory);
    to(&directory);
    let before = folder.contents("r");
    let Ended {
        code,
        stdout: text,
        stderr,
    } = folder.run("verify r");
    assert!(
        code == Some(4) && text.contains(&format!("r/{file}")),
        "{name}: {code:?} {text}{stderr}"
    );
    let report = json(&folder.ends(4, "verify r --json").stdout);
    assert!(
        folder.contents("r") == before,
        "{name}: looking changed something"
    );
    let problems = report["problems"].as_array().unwrap();
    let found: usize = problems
        .iter()
        .map(|problem| problem["jobs"].as_array().unwrap().len())
        .sum();
    assert_eq!(found, *jobs, "{name}: {text}");
    let commands: Vec<&str> = report["commands"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c.as_str().unwrap())
        .collect();
    assert!(!commands.is_empty(), "{name}");
    for command in &commands {
        assert!(text.contains(command), "{name}: {command} is not in {text}");
        // A repair leaves parts to be run.
        let ended = folder.run(command.strip_prefix("stickslip ").unwrap());
        assert!(
            matches!(ended.code, Some(0 | 3)),
            "{name}: {command}: {ended:?}"
        );
    }
    let after = folder.ends(0, "verify r").stdout;
    assert!(
        tables(folder, "r") == tables(folder, whole),
        "{name}: {commands:?}\n{text}\n{after}"
    );
    let run = json(
        &folder
            .ends(0, "run b.toml --out r --no-reduce --json")
            .stdout,
    );
    assert_eq!(run["jobs_run"].as_u64(), Some(0), "{name}");
    fs::remove_dir_all(directory).unwrap();
}

#[test]
fn every_kind_of_damage_is_found_named_and_repaired_by_what_is_printed() {
    let folder = folder();
    for damage in PARTS {
        damage_and_repair(&folder, "parts", damage);
    }
}

/// Puts files of one part into the place of those of another, so that rows would be read twice, and others not at all.
#[test]
fn a_part_under_the_name_of_another_ends_every_command_that_reads_it_with_code_4_and_its_name() {
    let folder = folder();
    let whole = tables(&folder, "parts");
    let root = folder.path("parts");
    for tables_of in [&["jobs"][..], &["slips"], &["slips", "precursors", "jobs"]] {
        for table in tables_of {
            fs::copy(path(&root, table, FIRST), path(&root, table, EXTENSION)).unwrap();
        }
        fs::remove_dir_all(root.join("reduced")).unwrap();
        for command in [
            "reduce parts",
            "show parts",
            "plot parts",
            "report parts -o x.html",
            "export parts -o exported",
            "run parts",
            "run b.toml --out parts",
            "status parts",
        ] {
            if command.starts_with("status") && !tables_of.contains(&"jobs") {
                continue;
            }
            let ended = folder.ends(4, command);
            assert!(
                ended
                    .stderr
                    .contains(&format!("/{EXTENSION}: damaged: it was written as ")),
                "{command}: {}",
                ended.stderr
            );
        }
        folder.ends(4, "verify parts");
        folder.ends(3, "verify parts --repair");
        assert_eq!(
            json(&folder.ends(0, "run parts --json").stdout)["jobs_run"],
            1
        );
        assert!(tables(&folder, "parts") == whole);
    }
}

#[test]
fn what_others_leave_in_the_folders_is_passed_over_by_every_command_and_listed_by_verify() {
    let folder = folder();
    let whole = tables(&folder, "parts");
    let exported = |to: &str| {
        folder.ends(0, &format!("export parts -o {to}"));
        folder.contents(to)
    };
    let before = exported("before");
    let root = folder.path("parts");
    let (mut seen, mut left) = (Vec::new(), Vec::new());
    for place in [
        ".",
        "tables",
        "tables/slips",
        "tables/precursors",
        "tables/jobs",
        "reduced",
        "run",
        "run/claims",
        "run/copies",
        "run/log",
        "run/spill",
        "run/spill/slips",
        "run/spill/jobs",
        "run/staging",
        "run/staging/reduce",
        "run/workers",
    ] {
        for name in [
            ".DS_Store",
            ".gitkeep",
            ".nfs000000000123",
            "._part-000-000000.parquet",
            "_SUCCESS",
            "_metadata.parquet",
            "part-000-000001.parquet~",
            "notes.txt",
            ".reduce.1",
        ] {
            fs::create_dir_all(root.join(place)).unwrap();
            fs::write(root.join(place).join(name), "mine").unwrap();
            left.push(root.join(place).join(name));
            if place.starts_with("tables") || place == "reduced" {
                seen.push(format!("parts/{place}/{name}"));
            }
        }
        for name in [".git", "_old", "folder"] {
            fs::create_dir_all(root.join(place).join(name)).unwrap();
            fs::write(root.join(place).join(name).join(SECOND), "mine").unwrap();
            left.push(root.join(place).join(name).join(SECOND));
        }
    }
    for command in [
        "status parts",
        "show parts",
        "reduce parts",
        "plot parts",
        "report parts",
        "plan b.toml --out parts",
        "run parts",
        "run b.toml --out parts",
        "verify parts",
        "verify parts --repair",
    ] {
        folder.ends(0, command);
    }
    assert_eq!(exported("after"), before);
    let report = json(&folder.ends(0, "verify parts --json").stdout);
    assert_eq!(report["whole"], true);
    let passed_over: Vec<&str> = report["passed_over"]
        .as_array()
        .unwrap()
        .iter()
        .map(|path| path.as_str().unwrap())
        .collect();
    for path in &seen {
        assert!(
            passed_over.contains(&path.as_str()),
            "{path}: {passed_over:?}"
        );
    }
    folder.screens("verify_passing_over", ["verify parts"]);
    // New parts are run beside them, in a directory begun beside them, too.
    folder.write("e.toml", &sweep("damaged", 4));
    folder.ends(0, "run e.toml --out parts");
    fs::create_dir_all(folder.path("new/run/.git")).unwrap();
    fs::write(folder.path("new/.DS_Store"), "mine").unwrap();
    folder.ends(0, "run a.toml --out new");
    assert!(left.iter().all(|path| fs::read(path).unwrap() == b"mine"));
    let mut after = tables(&folder, "parts");
    after.retain(|path, _| whole.contains_key(path));
    assert!(after == whole);
}

#[test]
fn a_part_that_is_gone_is_named_and_run_again() {
    let folder = folder();
    let whole = tables(&folder, "parts");
    for missing in [&["jobs"][..], &TABLES] {
        for table in missing {
            fs::remove_file(path(&folder.path("parts"), table, EXTENSION)).unwrap();
        }
        folder.screens("verify_without_a_part", ["verify parts"]);
        assert_eq!(
            json(&folder.ends(0, "run parts --json").stdout)["jobs_run"],
            1
        );
        assert!(tables(&folder, "parts") == whole);
    }
}

#[test]
fn a_missing_slips_file_ends_every_command_that_reads_it_with_code_4_and_run_makes_it_again() {
    let folder = folder();
    let whole = tables(&folder, "parts");
    for table in ["slips", "precursors"] {
        let missing = path(&folder.path("parts"), table, FIRST);
        fs::remove_file(&missing).unwrap();
        let commands: &[&str] = if table == "slips" {
            &["reduce parts", "report parts -o x.html"]
        } else {
            &[]
        };
        for command in commands {
            let ended = folder.ends(4, command);
            let expected = format!(
                "parts/tables/{table}/{FIRST}: damaged: it is missing, though the jobs of its part are"
            );
            assert!(
                ended.stderr.contains(&expected),
                "{command}: {}",
                ended.stderr
            );
        }
        assert_eq!(
            json(&folder.ends(0, "status parts --json").stdout)["jobs_missing"],
            1,
            "{table}"
        );
        assert_eq!(
            json(&folder.ends(0, "run parts --json").stdout)["jobs_run"],
            1,
            "{table}"
        );
        assert!(tables(&folder, "parts") == whole, "{table}");
    }
}

#[test]
fn what_is_not_yet_done_is_no_damage() {
    let folder = Folder::new();
    folder.write("a.toml", &sweep("unfinished", 2));
    folder.ends(0, "run a.toml --out r --shard 2/2 --no-reduce");
    // As a run leaves it that is killed between two files of a part.
    folder.ends(0, "run a.toml --out other --no-reduce");
    fs::copy(
        path(&folder.path("other"), "slips", FIRST),
        path(&folder.path("r"), "slips", FIRST),
    )
    .unwrap();
    folder.screens("verify_unfinished", ["verify r"]);
    let report = json(&folder.ends(3, "verify r --json").stdout);
    assert_eq!(
        (report["parts"].as_u64(), report["jobs"].as_u64()),
        (Some(1), Some(1))
    );
    assert_eq!(report["missing"][0], "part-000-000000", "{report}");
    // Readers see that file, so it must be whole nevertheless.
    flip(&path(&folder.path("r"), "slips", FIRST), |length| {
        length / 2
    });
    folder.screens("verify_unfinished_and_damaged", ["verify r", "status r"]);
    folder.ends(2, "verify missing");
}
