//! Pulses in the built program: what they advance, beside their controls and the drive alone.

use crate::program::{Cell, Folder, json};
use std::fs;

const SWEEP: &str = "name = \"pulses\"\n[model]\nN = 10\nNs = 5\nfrequency = 29\n[axes]\n\
                     pulse_start = [0.5, 0.51, 0.52, 0.53, 0.54, 9]\nDelta = [1e-15, 1e-6]\nseed = { count = 9 }\n\
                     [record]\ntime = 0.7\ncontrol = true\n";

#[test]
fn pulses_advance_slips_beside_their_controls_and_the_drive_alone() {
    let folder = Folder::new();
    folder.write("pulses.toml", SWEEP);
    folder.ends(0, "run pulses.toml --out out");
    let [shown] = folder.screens("pulses", ["show out"]);
    // Slips after pulses have no sets of their own.
    folder.screens(
        "plot_pulses_where",
        [
            "plot out --where Delta>5e-7 --format svg",
            "plot out --where Delta>1",
        ],
    );

    let triggers = folder.file("out/reduced/triggers.parquet");
    assert_eq!(triggers.cells.len(), 6 * 2 * 9);
    let advances = triggers.reals("advance");
    assert!(advances.len() > 60, "{}", advances.len());
    assert!(
        triggers
            .reals("place")
            .iter()
            .all(|place| (0.0..1.0).contains(place))
    );
    assert!(
        triggers
            .reals("advance_drive")
            .iter()
            .all(|advance| *advance >= 0.0)
    );
    // All runs end before 9 s.
    let excluded = triggers
        .column("excluded")
        .filter(|cell| **cell == Cell::Text("after the last slip".to_owned()));
    assert_eq!(excluded.count(), 2 * 9);
    let noise = triggers.reals("noise")[0];
    let amplitudes = triggers.reals("Delta");
    let rows = || amplitudes.iter().zip(triggers.column("advance"));
    let advances = |least: f64| {
        rows().filter_map(move |(amplitude, cell)| match cell {
            Cell::Real(bits) if *amplitude >= least => Some(f64::from_bits(*bits).abs()),
            _ => None,
        })
    };
    assert!(
        noise < 0.01 && advances(1e-6).fold(0.0, f64::max) > 2.0 * noise,
        "{noise}"
    );

    let pulses = folder.file("out/reduced/pulses.parquet");
    let whole = pulses
        .reals("place_high")
        .iter()
        .position(|high| *high == 1.0);
    let told = json(&folder.ends(0, "show out --json").stdout)["pulses"].clone();
    assert_eq!(told.as_array().map(Vec::len), Some(1));
    for name in [
        "advance_mean",
        "advance_mean_low",
        "triggered_share",
        "triggered_excess_high",
    ] {
        assert_eq!(
            told[0][name].as_f64(),
            Some(pulses.reals(name)[whole.unwrap()]),
            "{name}"
        );
    }
    // They have no phase, and no figure but their own.
    let slips = folder.table("out", "slips");
    assert!(slips.reals("phase").is_empty() && slips.reals("T_onset").is_empty());
    for (figure, is_there) in [("triggering", true), ("phi-eta", false), ("tau-T", false)] {
        assert_eq!(
            folder.path(&format!("out/figures/{figure}.svg")).exists(),
            is_there,
            "{figure}"
        );
    }
    folder.ends(0, "export out --out exported --format csv");
    assert_eq!(
        fs::read_to_string(folder.path("exported/triggers.csv"))
            .unwrap()
            .lines()
            .count(),
        1 + 6 * 2 * 9
    );
    // It is made again like the other reduced data.
    fs::remove_file(folder.path("out/reduced/triggers.parquet")).unwrap();
    assert_eq!(folder.ends(0, "show out").stdout, shown.stdout);
}

#[test]
fn a_sweep_without_controls_or_pulses_says_so() {
    let folder = Folder::new();
    folder.write(
        "alone.toml",
        &SWEEP
            .replace("control = true\n", "")
            .replace("0.51, 0.52, 0.53, 0.54, ", ""),
    );
    folder.ends(0, "run alone.toml --out out");
    let why = folder.file("out/reduced/triggers.parquet");
    assert!(why.texts("excluded").iter().all(|why| *why == "no control"));
    folder.write(
        "plain.toml",
        &SWEEP.replace("pulse_start = [0.5, 0.51, 0.52, 0.53, 0.54, 9]\n", ""),
    );
    folder.ends(0, "run plain.toml --out plain");
    assert!(!folder.path("plain/reduced/triggers.parquet").exists());
    // Without modulation there is none.
    folder.write("still.toml", &SWEEP.replace("[1e-15, 1e-6]", "[0, 1e-6]"));
    folder.screens(
        "pulses_without_controls_or_refused",
        [
            "show out",
            "plan still.toml",
            "simulate --set Delta=1e-6 --set T=0.03 --set pulse_start=1 --set ramp_time=1 --set T_to=0.1",
        ],
    );
}

#[test]
fn noise_is_that_of_a_slider_whatever_lies_beside_it() {
    let folder = Folder::new();
    folder.write(
        "pulses.toml",
        &SWEEP.replace("[0.5, 0.51, 0.52, 0.53, 0.54, 9]", "[0.5, 0.53]"),
    );
    let of = |gammas: &str| -> Vec<(f64, f64)> {
        folder.ends(
            0,
            &format!("run pulses.toml --axis gamma={gammas} --out {gammas}"),
        );
        let triggers = folder.file(&format!("{gammas}/reduced/triggers.parquet"));
        let noise = triggers.reals("noise");
        assert_eq!(noise.len(), triggers.cells.len());
        triggers.reals("gamma").into_iter().zip(noise).collect()
    };
    let alone = [of("6462"), of("30")].concat();
    let mut beside = of("6462,30");
    beside.sort_by(|a, b| b.0.total_cmp(&a.0));
    assert_eq!(alone, beside);
    assert!(alone[0].1 != alone[alone.len() - 1].1, "{alone:?}");
}

#[test]
fn one_cycle_is_the_default_and_the_same_job() {
    let folder = Folder::new();
    folder.write(
        "pulses.toml",
        &SWEEP.replace("[0.5, 0.51, 0.52, 0.53, 0.54, 9]", "[0.5]"),
    );
    folder.ends(0, "run pulses.toml --out out");
    for (flags, jobs) in [
        ("--set pulse_cycles=1", 27),
        ("--axis pulse_cycles=1,2", 45),
    ] {
        folder.ends(0, &format!("run pulses.toml {flags} --out out"));
        assert_eq!(folder.table("out", "jobs").cells.len(), jobs, "{flags}");
    }
}

#[test]
fn a_pulse_that_moves_nothing_warns_of_nothing_and_a_lasting_modulation_does() {
    let folder = Folder::new();
    for (set, warns) in [("--set seed=1", false), ("--set pulse_start=none", true)] {
        let planned = folder.ends(0, &format!("plan --preset triggering {set}"));
        assert_eq!(
            planned.stderr.contains("warning"),
            warns,
            "{}",
            planned.stderr
        );
    }
}
