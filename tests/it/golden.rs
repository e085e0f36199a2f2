//! The golden net: tables, reduced data and figures of small sweeps have the bytes that are written down in
//! `tests/golden/`, for one thread and for several, and after a kill and a resume.
//!
//! `UPDATE_GOLDEN=1 cargo test --release --test it golden` writes them again, after a change that is meant to change
//! results.

use crate::program::{Cell, Folder, Rows, TABLES, wait};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Intervals with all that can be recorded (Fig. 2), in one part.
const FIG2: &str = "\
name = \"fig2\"
[[axes.zip]]
dfs       = [6.9e-3, 0, 6.9e-3, 6.9e-3]
Delta     = [0, 0, 1e-6, 1e-6]
frequency = [29, 29, 29, 58]
[axes]
seed = { count = 4 }
[record]
slips = 12
precursors = true
drop_size = 0.5
";

/// Many sets with a derived axis and a condition (Fig. 3), in several parts.
const FIG3: &str = "\
name = \"fig3\"
where = \"frequency < 500\"
[axes]
V0    = { log = [1e-6, 2e-4], points = 5 }
Delta = [3e-7, 1e-6]
eta   = { log = [0.2, 1000], points = 9 }
seed  = { count = 3 }
[record]
slips = 6
";

/// A ramp of the period that ends a job by its time.
const DRAG: &str = "\
name = \"drag\"
[model]
Delta = 1e-6
T = 0.024
T_to = 0.048
ramp_time = 1.5
[axes]
seed = { count = 3 }
[record]
slips = 1000000
max_time = 3
";

/// Every rule for breaking, and precursors of another size.
const CHOICES: &str = "\
name = \"choices\"
[[axes.zip]]
Delta     = [0, 1e-6, 5e-6]
frequency = [29, 58, 200]
[axes]
break_on = [\"magnitude\", \"tension\"]
seed     = { count = 2 }
[record]
slips = 8
precursors = true
precursor_size = 5
";

fn hexadecimal(hash: &[u8]) -> String {
    hash.iter()
        .fold(String::new(), |text, byte| text + &format!("{byte:02x}"))
}

/// A hash of rows that does not depend on their order: the sum of the hashes of their cells.
fn hash_of_rows(rows: &Rows) -> String {
    let of_row = |row: &Vec<Cell>| {
        let hash = Sha256::digest(format!("{row:?}"));
        u128::from_be_bytes(hash[..16].try_into().unwrap())
    };
    hexadecimal(
        &rows
            .cells
            .iter()
            .map(of_row)
            .fold(0, u128::wrapping_add)
            .to_be_bytes(),
    )
}

/// One line for each file that is a result, and for the rows of each table.
fn fingerprint(folder: &Folder, directory: &str) -> String {
    let mut text = String::new();
    for below in ["tables", "reduced", "figures"] {
        for (path, bytes) in folder.contents(&format!("{directory}/{below}")) {
            if let Some(bytes) =
                bytes.filter(|_| path.extension().is_some_and(|extension| extension != "png"))
            {
                writeln!(
                    text,
                    "{}  {below}/{}",
                    hexadecimal(&Sha256::digest(bytes)),
                    path.display()
                )
                .unwrap();
            }
        }
    }
    for table in TABLES {
        let rows = folder.table(directory, table);
        if !rows.cells.is_empty() {
            writeln!(
                text,
                "{}  rows of {table}, in any order",
                hash_of_rows(&rows)
            )
            .unwrap();
        }
    }
    text
}

#[track_caller]
fn assert_golden(name: &str, sweep: &str) {
    let folder = Folder::new();
    folder.write("sweep.toml", sweep);
    folder.ends(0, "run sweep.toml --threads 1 --out one");
    let found = fingerprint(&folder, "one");

    let mut child = folder.start("run sweep.toml --threads 2 --out two");
    folder.wait_for_parts("two", 1, &mut child);
    child.kill().unwrap();
    wait(child);
    folder.ends(0, "run sweep.toml --threads 2 --out two");
    assert_eq!(
        fingerprint(&folder, "two"),
        found,
        "{name}: after a kill, with two threads"
    );

    folder.ends(0, "verify two");

    let file = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/golden")
        .join(format!("{name}.txt"));
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        fs::write(&file, &found).unwrap();
    }
    assert_eq!(
        found,
        fs::read_to_string(&file).unwrap_or_default(),
        "{name}: see the head of tests/it/golden.rs"
    );
}

#[test]
fn the_sweep_of_fig_2_has_its_golden_bytes() {
    assert_golden("fig2", FIG2);
}

#[test]
fn the_sweep_of_fig_3_has_its_golden_bytes() {
    assert_golden("fig3", FIG3);
}

#[test]
fn the_drag_of_a_ramp_has_its_golden_bytes() {
    assert_golden("drag", DRAG);
}

#[test]
fn the_model_s_choices_have_their_golden_bytes() {
    assert_golden("choices", CHOICES);
}
