//! Controls of the built program: what the drive alone explains, added to a finished sweep.

use crate::program::{Cell, Folder, json};
use std::fs;

const SWEEP: &str = "name = \"small\"\n[model]\nN = 10\nNs = 5\nfrequency = 29\n[axes]\nDelta = [3e-7, 1e-6]\nV0 = [5e-5, 1e-4]\n\
                     seed = { count = 3 }\n[record]\nslips = 12\n";

#[test]
fn controls_run_once_for_the_other_values_and_are_no_sets_of_their_own() {
    let folder = Folder::new();
    folder.write("plain.toml", SWEEP);
    folder.write("control.toml", &format!("{SWEEP}control = true\n"));
    let plain = json(&folder.ends(0, "run plain.toml --out out --json").stdout);
    assert_eq!(plain["jobs_run"].as_u64(), Some(12));
    let before = folder.ends(0, "reduce out --json").stdout;
    // Two velocities of three seeds; nothing else runs again.
    let added = json(&folder.ends(0, "run control.toml --out out --json").stdout);
    assert_eq!(added["jobs_run"].as_u64(), Some(6));
    folder.ends(0, "verify out");
    let after = folder.ends(0, "reduce out --json").stdout;
    let of = |text: &str, key: &str| json(text)[key].as_u64();
    assert_eq!(
        (of(&after, "jobs"), of(&before, "jobs")),
        (Some(18), Some(12))
    );
    for key in ["sets", "slips", "points"] {
        assert_eq!(of(&after, key), of(&before, key), "{key}");
    }
    // What the drive alone explains is there, with a seed of the control for each of the set.
    let rows = folder.file("out/reduced/sets.parquet");
    for column in [
        "resultant_drive",
        "resultant_excess_low",
        "locking_index_drive",
        "locking_index_excess_high",
    ] {
        assert_eq!(rows.reals(column).len(), 4, "{column}");
    }
    // In one run from the beginning the statistics are the same.
    folder.ends(0, "run control.toml --out whole");
    folder.screens("control", ["plan control.toml --threads 2", "show whole"]);
    for table in ["sets", "histograms", "backbone", "points"] {
        let cells = |out: &str| folder.file(&format!("{out}/reduced/{table}.parquet")).cells;
        assert!(cells("out") == cells("whole"), "{table}");
    }
}

#[test]
fn a_control_stays_one_whatever_a_later_sweep_asks_for() {
    let folder = Folder::new();
    let asking = format!("{SWEEP}control = true\n");
    folder.write("control.toml", &asking);
    folder.write("plain.toml", SWEEP);
    folder.write(
        "later.toml",
        &asking.replace("{ count = 3 }", "{ first = 3, count = 2 }"),
    );
    folder.ends(0, "run control.toml --out out");
    let excess = |sets: usize| {
        let rows = folder.file("out/reduced/sets.parquet");
        let controls = rows
            .column("control")
            .filter(|cell| **cell == Cell::Flag(true));
        assert_eq!(controls.count(), 2);
        assert_eq!(rows.reals("resultant_excess").len(), sets);
    };
    excess(4);
    let exported = |flags: usize| {
        folder.ends(0, "export out -o exported --format csv");
        for table in ["jobs", "slips"] {
            let text = fs::read_to_string(folder.path(&format!("exported/{table}.csv"))).unwrap();
            assert!(text.lines().next().unwrap().ends_with(",control"), "{text}");
            let of_controls = text.lines().filter(|line| line.ends_with(",true")).count();
            let rows = if table == "jobs" { flags } else { 12 * flags };
            assert_eq!(of_controls, rows, "{table}");
        }
        fs::remove_dir_all(folder.path("exported")).unwrap();
    };
    exported(6);
    // The file as it was, without the key.
    folder.ends(0, "run plain.toml --out out");
    assert_eq!(
        folder.ends(0, "show out --csv").stdout.lines().count(),
        1 + 4
    );
    excess(4);
    // Other seeds: those of the controls' first ones have left the sweep.
    folder.ends(0, "run later.toml --out out");
    assert_eq!(
        folder.ends(0, "show out --csv").stdout.lines().count(),
        1 + 4
    );
    excess(4);
    // In a sweep that has them as sets they are sets.
    folder.write("sets.toml", &asking.replace("[3e-7, 1e-6]", "[0, 1e-6]"));
    folder.ends(0, "run sets.toml --out out");
    assert_eq!(
        folder.ends(0, "show out --csv").stdout.lines().count(),
        1 + 6
    );
}

#[test]
fn a_modulation_slower_than_slips_has_phases_over_whole_cycles_and_no_locking_index() {
    let folder = Folder::new();
    folder.write(
        "slow.toml",
        "name = \"slow\"\n[model]\nN = 5\nNs = 4\nDelta = 1e-6\n[axes]\nT = [0.3, 40]\nseed = { count = 2 }\n\
         [record]\nslips = 40\ncontrol = true\n",
    );
    folder.ends(0, "run slow.toml --out out");
    folder.screens("show_without_a_phase", ["show out"]);
    let sets = folder.file("out/reduced/sets.parquet");
    assert_eq!(
        sets.counts("periods"),
        [0, 0],
        "slips follow faster than cycles"
    );
    for column in [
        "locking_index",
        "locking_index_drive",
        "locking_index_excess",
    ] {
        assert!(sets.reals(column).is_empty(), "{column}");
    }
    for column in ["resultant_length", "resultant_drive", "resultant_excess"] {
        assert_eq!(sets.reals(column).len(), 1, "{column}");
    }
    // By hand: of each job, the slips within whole cycles from its first one.
    let slips = folder.table("out", "slips");
    let real = |cell: &Cell| match cell {
        Cell::Real(bits) => f64::from_bits(*bits),
        _ => f64::NAN,
    };
    let column = |name: &str| slips.column(name).map(real).collect::<Vec<f64>>();
    let (periods, onsets, phases) = (column("T"), column("onset"), column("phase"));
    let seeds = slips.counts("seed");
    let (mut count, mut sum) = (0.0, [0.0, 0.0]);
    for seed in [0, 1] {
        let job: Vec<usize> = (0..seeds.len())
            .filter(|&row| seeds[row] == seed && periods[row] == 0.3)
            .collect();
        let [first, last] = [job[0], job[job.len() - 1]].map(|row| onsets[row]);
        let cycles = ((last - first) / 0.3).floor();
        assert!(cycles >= 2.0 && job.len() == 40, "{cycles} cycles");
        for row in job {
            if onsets[row] < first + 0.3 * cycles {
                count += 1.0;
                sum = [sum[0] + phases[row].cos(), sum[1] + phases[row].sin()];
            }
        }
    }
    let expected = sum[0].hypot(sum[1]) / count;
    assert!((sets.reals("resultant_length")[0] - expected).abs() < 1e-12);
}
