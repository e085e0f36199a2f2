//! Slips in traces, found by the built program: those of the model's own slip table, or a refusal.

use crate::program::Folder;
use std::fmt::Write;

/// Drives of the model, under which slips are found: the flags that both commands take.
const DRIVES: [&str; 4] = [
    "--set Delta=0",
    "--set Delta=6e-7 --set frequency=29",
    "--set Delta=6e-7 --set frequency=58",
    "--set Delta=6e-7 --set frequency=116",
];
const UNMODULATED: &str = "--set V0=1e-4 --set Delta=0";

fn gaussian(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// Every n-th sample as CSV: time in ms, and force in mN with noise of this standard deviation in N.
fn with_noise(times: &[f64], forces: &[f64], every: usize, noise: f64) -> String {
    let mut state = 1;
    let mut text = "t,F\n".to_owned();
    for (time, force) in times.iter().zip(forces).step_by(every) {
        let force = force + noise * gaussian(&mut state);
        writeln!(text, "{:.4},{:.3}", 1e3 * time, 1e3 * force).unwrap();
    }
    text
}

/// A slider that slips every 100 ms, sampled every 1 ms: it loads by 1 N a sample, and drops by 100 N.
fn sawtooth(samples: u32) -> Vec<(f64, f64)> {
    let force = |sample: u32| f64::from(sample % 100 + sample / 100 % 7);
    (0..samples)
        .map(|sample| (1e-3 * f64::from(sample), force(sample)))
        .collect()
}

fn csv(samples: &[(f64, f64)]) -> String {
    let lines = samples
        .iter()
        .map(|(time, force)| format!("{time},{force}\n"));
    format!("time,force\n{}", lines.collect::<String>())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn slips_of_the_models_traces_are_those_of_its_slip_table() {
    let folder = Folder::new();
    for blocks in [10, 70] {
        for (number, drive) in DRIVES.into_iter().enumerate() {
            let job = format!("--set N={blocks} {drive} --record discard=0");
            folder.ends(
                0,
                &format!(
                    "simulate {job} --slips 100000 --time 6 --trace trace.parquet --slip-table slips.parquet"
                ),
            );
            let expected = folder.file("slips.parquet");
            let [onsets, drops] = ["onset", "drop"].map(|column| expected.reals(column));
            let trace = folder.file("trace.parquet");
            let [times, forces] = ["time", "force"].map(|column| trace.reals(column));
            // Noise, by the mean drop; and samples between two that are read.
            for (noise, every) in [(0.0, 1), (0.0, 10), (0.01, 1), (0.01, 10)] {
                let name = format!("{blocks}-{number}-{noise}-{every}");
                folder.write(
                    "trace.csv",
                    &with_noise(&times, &forces, every, noise * mean(&drops)),
                );
                let columns =
                    "--column time=t:ms --column force=F:mN --drop-size auto --set V0=100:um/s";
                folder.ends(
                    0,
                    &format!("measured trace.csv -o {name} {columns} {drive}"),
                );
                let found = folder.table(&name, "slips");
                let found_onsets = found.reals("onset");
                // A fall that is a slip for a force is mostly one of the contacts.
                let extra = found_onsets.len().abs_diff(onsets.len());
                assert!(
                    extra * 50 <= onsets.len(),
                    "{name}: {extra} of {}",
                    onsets.len()
                );
                let step = 1e-4 * every as f64;
                let nearest = |onset: &f64| {
                    let off = found_onsets.iter().map(|found| (found - onset).abs());
                    off.fold(f64::INFINITY, f64::min)
                };
                let mut off: Vec<f64> = onsets.iter().map(nearest).collect();
                off.sort_by(f64::total_cmp);
                // The noise of a hundredth of a drop is that of a millisecond of loading.
                let largest = 0.5 * step + if noise > 0.0 { 1.6e-3 } else { 2e-5 };
                assert!(
                    off[off.len() / 2] <= largest,
                    "{name}: {}",
                    off[off.len() / 2]
                );
                if number == 0 {
                    let ratio = mean(&found.reals("drop")) / mean(&drops);
                    assert!((ratio - 1.0).abs() < 0.03, "{name}: {ratio}");
                }
                // Eight samples of a period are too few for phases.
                let has_phases = number > 0 && !(number == 3 && every == 10);
                let phases = found.reals("phase").len();
                assert_eq!(
                    phases,
                    if has_phases { found_onsets.len() } else { 0 },
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn what_makes_no_trace_is_refused_with_its_row() {
    let folder = Folder::new();
    let samples = sawtooth(3000);
    let good = csv(&samples);
    folder.write("good.csv", &good);
    let columns = format!("{UNMODULATED} --drop-size 30");
    folder.screens("trace", [&format!("measured good.csv -o good {columns}")]);
    assert_eq!(folder.table("good", "slips").reals("onset").len(), 29);
    let without = |from: usize, to: usize| [&samples[..from], &samples[to..]].concat();
    let changed = |from: &str, to: &str| good.replacen(from, to, 1);
    let clipped: Vec<(f64, f64)> = samples
        .iter()
        .map(|(time, force)| (*time, force.min(90.0)))
        .collect();
    let cases = [
        (
            csv(&without(500, 700)),
            "--drop-size 30",
            "s comes after 0.499 s, a gap for steps of 0.001 s",
        ),
        (
            changed("\n0.5,", "\n0.499,"),
            "--drop-size 30",
            "line 502: time 0.499 s is not after 0.499 s",
        ),
        (
            changed("\n0.5,5", "\n0.5,nan"),
            "--drop-size 30",
            "line 502: force is missing",
        ),
        (
            changed("\n0.5,5", "\n,5"),
            "--drop-size 30",
            "line 502: time is missing",
        ),
        (
            csv(&clipped),
            "--drop-size 30",
            "samples in a row have the largest force, 90 N",
        ),
        (
            good.clone(),
            "--drop-size 99",
            "--drop-size 99: the number of slips depends on it",
        ),
        (
            good.clone(),
            "--drop-size 0",
            "--drop-size 0: must be SIZE:UNIT",
        ),
        (good.clone(), "--drop-size 30:mm", "its unit must be N"),
        (good.clone(), "--drop-size 30 --smooth 0", "--smooth 0"),
        (
            good.clone(),
            "--column force=force",
            "--drop-size 30:mN, or auto",
        ),
        (
            good.clone(),
            "--column velocity=force --drop-size 30",
            "integrate it",
        ),
        (
            good.clone(),
            "--drop-size 30 --column onset=time",
            "onset is of slips",
        ),
        (
            good.replacen("force", "Force (mN)", 1),
            "--drop-size 30",
            "has no column force",
        ),
    ];
    for (text, options, expected) in cases {
        folder.write("trace.csv", &text);
        let refused = folder.ends(
            2,
            &format!("measured trace.csv -o out {UNMODULATED} {options}"),
        );
        assert!(
            refused.stderr.contains(expected),
            "{expected}: {}",
            refused.stderr
        );
        assert!(!folder.path("out/sweep.toml").exists(), "{expected}");
    }
    // Unequal steps are right.
    let uneven: Vec<(f64, f64)> = samples
        .iter()
        .enumerate()
        .filter(|(place, _)| place % 7 % 3 != 1)
        .map(|(_, sample)| *sample)
        .collect();
    folder.write("uneven.csv", &csv(&uneven));
    folder.ends(0, &format!("measured uneven.csv -o uneven {columns}"));
    assert_eq!(folder.table("uneven", "slips").reals("onset").len(), 29);
}

#[test]
fn a_refused_trace_leaves_its_figure_and_a_directory_that_takes_another_size() {
    let folder = Folder::new();
    folder.write("trace.csv", &csv(&sawtooth(3000)));
    let command = format!("measured trace.csv -o out {UNMODULATED}");
    let too_large = format!("{command} --drop-size 99");
    folder.screens(
        "trace_without_a_plateau",
        [&format!("{too_large} --dry-run")],
    );
    assert!(!folder.path("out").exists());
    folder.ends(2, &too_large);
    let figure = || std::fs::read_to_string(folder.path("out/figures/drop-size.svg")).unwrap();
    let refused = figure();
    assert!(refused.contains("Number of slips<") && refused.contains("Mean interval (s)<"));
    folder.screens(
        "trace_with_its_own_size",
        [&format!("{command} --drop-size auto"), "verify out"],
    );
    assert_ne!(figure(), refused);
    assert_eq!(folder.table("out", "slips").reals("onset").len(), 29);
}

#[test]
fn runs_of_a_trace_are_series_and_a_drift_changes_nothing() {
    let folder = Folder::new();
    let rows = sawtooth(3000).into_iter();
    let mut text = "id,time,force,Delta,frequency,T\n".replace(",T", "");
    for (sample, (time, force)) in rows.enumerate() {
        let (id, time) = if sample < 1500 {
            ("a,", time)
        } else {
            ("b,", time - 1.5)
        };
        let drive = if sample < 1500 { "0," } else { "1e-9,10" };
        // A load cell that drifts by a drop in all.
        writeln!(text, "{id}{time},{},{drive}", force + 0.03 * sample as f64).unwrap();
    }
    folder.write("runs.csv", &text);
    let command = "measured runs.csv -o out --set V0=1e-4 --drop-size auto --column run=id";
    folder.screens("trace_of_two_runs", [command]);
    let slips = folder.table("out", "slips");
    assert_eq!(slips.reals("onset").len(), 28);
    assert_eq!(slips.reals("phase").len(), 14);
    let jobs = folder.table("out", "jobs");
    assert_eq!(jobs.cells.len(), 2);
    // The stiffness of the whole is not that of the machine.
    let schema = slips.schema.unwrap();
    assert!(schema.index_of("V0").is_ok() && schema.index_of("Kd").is_err());
}

#[test]
fn a_stretch_of_a_trace_is_drawn_from_its_file_as_long_as_that_is_the_same() {
    let folder = Folder::new();
    let trace = csv(&sawtooth(3000)).replace("time,force", "t,F");
    let trace = trace.replace(',', ";").replace('.', ",");
    folder.write("trace.csv", &trace);
    let columns = "--decimal-comma --column time=t:s --column force=F:N --drop-size 30";
    folder.ends(
        0,
        &format!("measured trace.csv -o out {columns} {UNMODULATED}"),
    );
    let stretch = "plot out --from 0.55 --until 0.95";
    folder.ends(0, stretch);
    let figure = std::fs::read_to_string(folder.path("out/figures/trace.svg")).unwrap();
    assert!(figure.contains(">Time t (ms)<") && figure.contains(">onset of a slip<"));
    // Four slips, and their entry.
    assert_eq!(figure.matches("#d62020").count(), 5, "{figure}");
    folder.ends(0, &format!("{stretch} --size 120mmx80mm"));
    let sized = std::fs::read_to_string(folder.path("out/figures/trace.svg")).unwrap();
    // 96 pixels an inch.
    assert!(sized.contains(r#"width="453.54" height="302.36""#));
    let problem = |command: &str| folder.ends(2, command).stderr;
    assert!(problem("plot out --from 9").contains("fewer than two instants"));
    folder.write("trace.csv", &trace.replacen("\n0,5;", "\n0,50;", 1));
    assert!(problem(stretch).contains("trace.csv: differs from what was read"));
    std::fs::remove_file(folder.path("trace.csv")).unwrap();
    assert!(problem(stretch).contains("trace.csv: is not there"));
    folder.write("slips.csv", "onset\n1\n2.5\n3\n");
    folder.ends(0, &format!("measured slips.csv -o slips {UNMODULATED}"));
    assert!(problem("plot slips --until 3").contains("did not come from a trace"));
}

#[test]
fn a_displacement_is_the_force_over_the_stiffness() {
    let folder = Folder::new();
    let samples = sawtooth(3000);
    folder.write("force.csv", &csv(&samples));
    let mut text = "t,x\n".to_owned();
    for (time, force) in &samples {
        // The slider lags the drive of 100 µm/s by the force over 10 N/µm.
        writeln!(text, "{time},{}", 100.0 * time - 0.1 * force).unwrap();
    }
    folder.write("displacement.csv", &text);
    let drive = "--set V0=1e-4 --set Delta=1e-9 --set frequency=10";
    folder.ends(
        0,
        &format!("measured force.csv -o force {drive} --set Kd=1e7 --drop-size 30"),
    );
    let columns = "--column time=t:s --column displacement=x:um";
    let measured = format!("measured displacement.csv -o displacement {drive} {columns}");
    folder.screens(
        "trace_of_a_displacement",
        [
            &format!("{measured} --drop-size 3:um"),
            &format!("{measured} --drop-size 3:mN"),
        ],
    );
    let [force, displacement] =
        ["force", "displacement"].map(|name| folder.table(name, "slips").reals("onset"));
    assert_eq!(force.len(), 29);
    assert_eq!(displacement, force);
}

#[test]
fn the_mean_of_some_samples_makes_a_plateau_of_a_noisy_trace() {
    let folder = Folder::new();
    let mut state = 1;
    let noisy = sawtooth(30_000).into_iter();
    let noisy: Vec<(f64, f64)> = noisy
        .map(|(time, force)| (time, force + 8.0 * gaussian(&mut state)))
        .collect();
    folder.write("trace.csv", &csv(&noisy));
    let command = format!("measured trace.csv -o out {UNMODULATED} --drop-size 50");
    folder.screens("noisy_trace", [&command, &format!("{command} --smooth 8")]);
    assert_eq!(folder.table("out", "slips").reals("onset").len(), 299);
}

#[test]
fn an_overshoot_and_a_slip_in_two_parts_are_one_slip_each() {
    let folder = Folder::new();
    let mut samples = sawtooth(3000);
    for slip in 1..29 {
        let fall = 100 * slip;
        // The force falls below the level that it then takes, or halts within the fall and rises a little.
        samples[fall].1 -= if slip % 2 == 0 { 25.0 } else { -50.0 };
        samples[fall + 1].1 += if slip % 2 == 0 { 0.0 } else { 55.0 };
    }
    folder.write("trace.csv", &csv(&samples));
    folder.ends(
        0,
        &format!("measured trace.csv -o out {UNMODULATED} --drop-size 35"),
    );
    let onsets = folder.table("out", "slips").reals("onset");
    assert_eq!(onsets.len(), 29);
    for (slip, onset) in onsets.iter().enumerate() {
        let expected = 0.1 * (slip + 1) as f64 - 1e-3;
        assert!((onset - expected).abs() < 1e-9, "{slip}: {onset}");
    }
}
