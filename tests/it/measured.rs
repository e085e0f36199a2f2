//! Measured slips in the built program: read in any form, reduced as the model's, refused where they make no sense.

use crate::program::{Cell, Folder, json};
use crate::unreadable::fifo;
use std::collections::BTreeMap;
use std::fs;
use stickslip::measured::{Experiment, Given, Request, Sources};

/// The model, as a source of slips: without modulation and with two.
const MODEL: &str = "name = \"model\"\n[model]\nN = 10\nNs = 5\n[axes]\nseed = { count = 9 }\n\
                     zip = { Delta = [0, 1e-6, 1e-6], frequency = [29, 29, 58] }\n\
                     [record]\nslips = 60\ndiscard = 0\n";
const COLUMNS: &str = "--decimal-comma --column run=id --column onset=t:ms --column V0=v:um/s --column Delta=amp:µm \
                       --column frequency=f --column drop=d:mN --column peak_force=F:kN";

/// The slips of the model as an experiment would write them, with the seeds of each set counted on.
fn experiment(folder: &Folder, digits: usize) -> String {
    folder.write("model.toml", MODEL);
    folder.ends(0, "run model.toml --out model");
    folder.ends(0, "export model --out exported --format csv");
    let text = fs::read_to_string(folder.path("exported/slips.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let place = |name: &str| names.iter().position(|known| *known == name).unwrap();
    let mut rows = vec!["id;t;v;amp;f;d;F".to_owned()];
    for cells in lines {
        let cell = |name: &str| cells[place(name)];
        let scaled = |name: &str, factor: f64| {
            let value: f64 = cell(name).parse().unwrap();
            format!("{:.digits$e}", factor * value)
        };
        rows.push(format!(
            "{}/{}/{};{};{};{};{};{};{}",
            cell("Delta"),
            cell("frequency"),
            cell("seed"),
            scaled("onset", 1e3),
            scaled("V0", 1e6),
            scaled("Delta", 1e6),
            cell("frequency"),
            scaled("drop", 1e3),
            scaled("peak_force", 1e-3),
        ));
    }
    // With decimal commas.
    rows.join("\r\n").replace('.', ",")
}

/// The names of all columns of sets that are numbers, and their values set by set.
fn numbers(folder: &Folder, directory: &str) -> Vec<(String, Vec<Option<f64>>)> {
    let rows = folder.file(&format!("{directory}/reduced/sets.parquet"));
    let number = |cell: &Cell| match cell {
        Cell::Real(bits) => Some(f64::from_bits(*bits)),
        Cell::Count(count) => Some(*count as f64),
        _ => None,
    };
    let fields = rows.schema.as_ref().unwrap().fields().iter();
    fields
        .map(|field| {
            (
                field.name().clone(),
                rows.column(field.name()).map(number).collect(),
            )
        })
        .collect()
}

#[test]
fn slips_of_the_model_read_back_in_other_units_have_the_same_statistics() {
    let folder = Folder::new();
    folder.write("slips.csv", &experiment(&folder, 14));
    folder.screens(
        "measured_in_other_units",
        [&format!(
            "measured slips.csv -o out {COLUMNS} --set Kd=40:N/um"
        )],
    );
    let expected = numbers(&folder, "model");
    let mut same = 0;
    for ((name, found), (_, expected)) in numbers(&folder, "out").iter().zip(&expected) {
        // What only a model knows, and the drive alone, for which this model has no control.
        let is_known = found.iter().all(Option::is_some) || expected.iter().all(Option::is_none);
        if !is_known || name.contains("drive") || name.contains("excess") {
            continue;
        }
        same += 1;
        for (found, expected) in found.iter().zip(expected) {
            let off = found.zip(*expected).map_or(0.0, |(found, expected)| {
                (found - expected).abs() / expected.abs().max(1e-9)
            });
            assert!(off < 1e-9, "{name}: {found:?}, {expected:?}");
        }
    }
    assert!(same > 40, "{same}");
    // Against its own control, and no parameter that nobody measured.
    let sets = folder.file("out/reduced/sets.parquet");
    assert_eq!(sets.reals("resultant_excess").len(), 2);
    for (table, unknown) in [
        ("slips", "size"),
        ("slips", "onset_cut"),
        ("jobs", "N"),
        ("jobs", "breaks"),
    ] {
        let rows = folder.table("out", table);
        assert!(
            rows.column(unknown).all(|cell| *cell == Cell::Null),
            "{unknown}"
        );
    }
    assert!(sets.column("N").all(|cell| *cell == Cell::Null));
    assert_eq!(sets.reals("Kd"), [4e7; 3]);
    assert_eq!(folder.table("out", "slips").unit("size"), "");
}

#[test]
fn every_command_takes_a_directory_of_measured_slips_or_says_what_it_is() {
    let folder = Folder::new();
    folder.write("slips.csv", &experiment(&folder, 8));
    let command = format!("measured slips.csv -o out {COLUMNS}");
    folder.ends(0, &command);
    assert_eq!(folder.parts("out", "slips").len(), 1);
    let before = folder.tables("out");
    folder.ends(0, &command);
    assert_eq!(folder.tables("out"), before);
    folder.screens(
        "commands_that_take_no_measured_slips",
        [
            "run out",
            "plan out",
            "batch slurm out --workers 2 --threads 2 --time 1h",
            "run model.toml --out out",
            "measured slips.csv -o out --decimal-comma --column run=id --column onset=t --set V0=1e-4 --set Delta=0",
            "plot out --of slips --x onset --y size",
            "show out --columns size",
        ],
    );

    folder.screens("verify_measured", ["verify out"]);
    // What is damaged is read again, also under another name of the directory.
    fs::rename(folder.path("out"), folder.path("moved")).unwrap();
    let part = folder.parts("moved", "slips").remove(0);
    fs::write(&part, "damaged").unwrap();
    folder.screens(
        "verify_measured_and_damaged",
        ["verify moved", "verify moved --repair"],
    );
    folder.ends(0, &command.replace("-o out", "-o moved"));
    assert_eq!(folder.tables("moved"), before);
    fs::rename(folder.path("moved"), folder.path("out")).unwrap();
    // One byte in as many, and fewer.
    let read = fs::read_to_string(folder.path("slips.csv")).unwrap();
    folder.write("slips.csv", &read.replacen(';', ",", 1));
    folder.screens("verify_measured_and_changed", ["verify out"]);
    folder.write("slips.csv", "changed");
    folder.ends(4, "verify out");
    fs::remove_file(folder.path("slips.csv")).unwrap();
    let [gone] = folder.screens("verify_measured_and_gone", ["verify out"]);
    fifo(&folder.path("slips.csv"));
    assert_eq!(folder.ends(0, "verify out").stdout, gone.stdout);

    folder.screens(
        "measured_directory",
        [
            "status out",
            "reduce out",
            "report out",
            "export out --out csv --format csv",
            "show out",
            "show model out",
        ],
    );
    folder.ends(0, "show out --json");
    assert!(
        !fs::read_to_string(folder.path("out/report.html"))
            .unwrap()
            .contains("simulate --set")
    );
    assert_errors_add(&folder);
}

/// The same slips on both sides, taken as independent: for the mean interval without modulation, an error and what was
/// not seen add by their squares, and the ends of jobs cancel. All three from the slips (docs/model.md).
fn assert_errors_add(folder: &Folder) {
    let sets = |command: &str| json(&folder.ends(0, command).stdout)["sets"][0].clone();
    let half = |set: &serde_json::Value, name: &str| {
        let number = |end: &str| set[format!("{name}{end}")].as_f64().unwrap();
        0.5 * (number("_high") - number("_low"))
    };
    let of_one = sets("show model --json");
    assert_eq!(of_one["Delta"], 0.0);
    let slips = folder.table("model", "slips");
    let mut jobs: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    let without = slips.column("Delta").map(|delta| *delta == Cell::Real(0));
    let seeds = slips.counts("seed").into_iter();
    for ((is_it, seed), interval) in without.zip(seeds).zip(slips.column("interval")) {
        if let (true, Cell::Real(bits)) = (is_it, interval) {
            jobs.entry(seed).or_default().push(f64::from_bits(*bits));
        }
    }
    let all: Vec<f64> = jobs.values().flatten().copied().collect();
    let count = all.len() as f64;
    let sum: f64 = all.iter().sum();
    let mean = sum / count;
    let spread = all.iter().map(|interval| (interval - mean).powi(2));
    let spread = (spread.sum::<f64>() / count).sqrt();
    let at_ends: f64 = jobs
        .values()
        .map(|job| 0.5 * (job[0] + job[job.len() - 1]))
        .sum();
    let halved = (sum - at_ends) / (count - jobs.len() as f64);
    let not_seen = 3.0 * spread / count;
    // Student's t of 9 and of 18 units.
    let [of_nine, of_both] = [2.306_004, 2.109_816];
    let scattered = half(&of_one, "tau_mean") - (halved - mean).abs();
    let error = (scattered.powi(2) - not_seen.powi(2)).sqrt() / of_nine;
    let expected = (of_both * (17.0_f64 / 8.0).sqrt() * error).hypot(2.0_f64.sqrt() * not_seen);
    let found = half(&sets("show model out --json"), "tau_mean_difference");
    assert!((found / expected - 1.0).abs() < 1e-5, "{found}, {expected}");
}

#[test]
fn figures_show_other_directories_as_hollow_marks_under_their_names() {
    let folder = Folder::new();
    folder.write("slips.csv", &experiment(&folder, 8));
    folder.ends(0, &format!("measured slips.csv -o mine {COLUMNS}"));
    let figure =
        |name: &str| fs::read_to_string(folder.path(&format!("model/figures/{name}.svg"))).unwrap();
    let standing = ["phi-eta", "overview"];
    let before = standing.map(figure);
    folder.ends(0, "plot model --with mine");
    for (name, before) in standing.iter().zip(before) {
        let with = figure(name);
        for directory in [">mine<", ">model<"] {
            assert!(
                with.contains(directory) && !before.contains(directory),
                "{name}: {directory}"
            );
        }
        assert!(
            with.matches("<path").count() > before.matches("<path").count(),
            "{name}"
        );
    }
    folder.ends(
        0,
        "plot mine --with model --x frequency --y drop_mean -o custom.svg",
    );
    let custom = fs::read_to_string(folder.path("custom.svg")).unwrap();
    assert!(custom.contains(">model<"), "{custom}");
    // The experiment has a control, and so a drive alone; this model has neither.
    folder.ends(
        0,
        "plot model --with mine --x frequency --y resultant_length -o drive.svg",
    );
    let drive = fs::read_to_string(folder.path("drive.svg")).unwrap();
    let dots = drive.matches(r##"r="2.5" fill="#8c8c8c""##).count();
    let entries = drive.matches(">by the drive alone").count();
    assert_eq!((dots, entries), (2, 1), "{drive}");
    // What it was drawn from stands as it was.
    folder.ends(0, "plot model");
    assert!(!figure("phi-eta").contains(">mine<"));
    folder.ends(2, "plot model --with nowhere");
    folder.ends(2, "plot model --with mine --of slips --x onset --y drop");
}

/// A directory of a model of two sizes, and one of 16 measured slips at each of these settings.
fn beside(measured: &[(&str, &str)]) -> Folder {
    let folder = Folder::new();
    let sizes = MODEL
        .replace("N = 10\n", "")
        .replace("seed = { count = 9 }", "seed = { count = 3 }\nN = [5, 10]");
    folder.write("model.toml", &sizes);
    folder.ends(0, "run model.toml --out model");
    folder.write("slips.csv", &lines("onset", |n| format!("{}.5", n * n)));
    for (directory, settings) in measured {
        folder.ends(0, &format!("measured slips.csv -o {directory} {settings}"));
    }
    folder
}

#[test]
fn in_what_directories_differ_is_said_wherever_they_stand_side_by_side() {
    let folder = beside(&[
        (
            "slow",
            "--set V0=2e-5 --set Kd=2254 --set Delta=1e-6 --set frequency=29",
        ),
        (
            "same",
            "--set V0=1e-4 --set Kd=4e7 --set Delta=1e-6 --set frequency=29",
        ),
    ]);
    let plot = "plot model --x frequency --y tau_mean --style print -o own.svg";
    folder.screens(
        "plot_beside_measured",
        [
            &format!("{plot} --with slow"),
            // What only the model knows is common to all that know it, and what all share is no difference.
            &format!("{plot} --with same"),
            "plot model --with slow",
        ],
    );
    let svg = fs::read_to_string(folder.path("model/figures/overview.svg")).unwrap();
    assert!(svg.contains(" = 2254 N/m, V₀ = 2·10⁻⁵ m/s"), "{svg}");

    folder.screens(
        "show_beside_measured",
        ["show model slow", "show model same"],
    );
    // The size, which no experiment knows, hinders no pair, on either side; each side has its count of seeds.
    for (pair, seeds, difference) in [
        ("model slow", [3, 1], [1e-4, 2e-5]),
        ("slow model", [1, 3], [2e-5, 1e-4]),
    ] {
        let found = json(&folder.ends(0, &format!("show {pair} --json")).stdout);
        assert_eq!(found["differences"]["V0"], serde_json::json!(difference));
        assert!(found["differences"]["N"].is_null() && found["differences"]["T"].is_null());
        let sets = found["sets"].as_array().unwrap();
        let sizes: Vec<_> = sets.iter().map(|set| set["N"].as_u64().unwrap()).collect();
        assert_eq!(sizes, [5, 10], "{pair}");
        assert!(
            sets.iter()
                .all(|set| set["seeds_a"] == seeds[0] && set["seeds_b"] == seeds[1])
        );
    }
}

#[test]
fn each_directory_with_a_mark_has_an_entry_of_its_name_and_others_are_named() {
    let drive = "--set V0=1e-4 --set Delta=1e-6 --set frequency=29";
    let folder = beside(&[
        ("may/out", drive),
        ("june/out", drive),
        ("still", "--set V0=1e-4 --set Delta=0"),
    ]);
    let flags = "--with may/out --with june/out --with still -o own.svg";
    let svg_of = |name: &str, options: &str| {
        folder.screens(
            name,
            [&format!("plot model --y tau_mean {flags} {options}")],
        );
        fs::read_to_string(folder.path("own.svg")).unwrap()
    };
    let svg = svg_of("plot_with_others", "--x eta");
    for name in ["model", "may/out", "june/out", "still"] {
        assert!(svg.contains(&format!(">{name}<")), "{name}");
    }
    let svg = svg_of("plot_without_one", "--x frequency");
    assert!(!svg.contains(">still<"));
    let svg = svg_of(
        "plot_with_legends",
        "--x eta --legend theory --legend first --legend second --legend third",
    );
    assert!(svg.contains(">theory<") && svg.contains(">third<") && !svg.contains("out<"));
    folder.screens(
        "legends_refused",
        [
            &format!("plot model --y tau_mean {flags} --x eta --legend theory --legend first"),
            "plot model --legend theory",
        ],
    );
}

/// Ten slips, and what else a line holds.
fn lines(head: &str, line: impl Fn(u32) -> String) -> String {
    let lines = (1..11).map(line).collect::<Vec<_>>().join("\n");
    format!("{head}\n{lines}\n")
}

#[test]
fn files_of_other_programs_just_work() {
    let folder = Folder::new();
    let plain = lines("onset,drop", |n| format!("{}.5,3", n * n));
    let forms = [
        ("plain.csv", plain.clone()),
        ("bom.csv", format!("\u{feff}{plain}")),
        ("windows.csv", plain.replace('\n', "\r\n")),
        ("quoted.csv", plain.replace("onset", "\"onset\"")),
        ("comments.csv", format!("\n# rig 1\n\n{plain}\n\n")),
        ("tabs.tsv", plain.replace(',', "\t")),
        ("semicolons.csv", plain.replace(',', ";")),
        ("spaces.csv", plain.replace(',', " , ")),
        (
            "missing.csv",
            plain
                .replace("\n4.5,3", "\n4.5,NA")
                .replace("\n9.5,3", "\n9.5,-")
                .replace("\n16.5,3", "\n16.5,nan")
                .replace("\n25.5,3", "\n25.5,"),
        ),
        ("no-end.csv", plain.trim_end().to_owned()),
    ];
    let mut found = Vec::new();
    for (name, text) in forms {
        folder.write(name, &text);
        let unmodulated = "--set V0=1e-4 --set Delta=0";
        folder.ends(0, &format!("measured {name} -o {name}-out {unmodulated}"));
        found.push(folder.table(&format!("{name}-out"), "slips").reals("onset"));
    }
    assert!(found.iter().all(|onsets| *onsets == found[0]), "{found:?}");
    assert_eq!(found[0].len(), 10);
    folder.ends(
        0,
        "simulate --set N=10 --set Ns=5 --slips 9 --slip-table slips.parquet",
    );
    folder.ends(
        0,
        "simulate --set N=10 --set Ns=5 --set seed=1 --slips 9 --slip-table other.parquet",
    );
    folder.ends(
        0,
        "measured slips.parquet other.parquet -o both --column run=seed",
    );
}

/// Tables and flags with which they are refused for this reason, and nothing is written.
fn refuse(cases: &[(String, &str, &str)]) {
    let folder = Folder::new();
    for (text, options, expected) in cases {
        folder.write("slips.csv", text);
        let speed = if options.contains("V0") {
            ""
        } else {
            "--set V0=1e-4"
        };
        // What a tide has, or a table of its own amplitudes.
        let amplitude = if ["T=", "Delta"]
            .iter()
            .any(|word| options.contains(word) || text.contains("Delta"))
            || text.contains(",T")
        {
            ""
        } else {
            "--set Delta=0"
        };
        let refused = folder.ends(
            2,
            &format!("measured slips.csv -o out {speed} {amplitude} {options}"),
        );
        assert!(
            refused.stderr.starts_with("error: ") && refused.stderr.contains(expected),
            "{expected}: {}",
            refused.stderr
        );
        assert!(!folder.path("out").exists(), "{expected}");
    }
}

#[test]
fn columns_and_units_that_are_not_understood_are_refused() {
    let good = lines("onset,drop", |n| format!("{n},3"));
    refuse(&[
        (good.replace("onset", "t"), "", "has no column onset"),
        (good.clone(), "--column onset=time", "has no column time"),
        (good.clone(), "--column drop=size", "has no column size"),
        (
            good.clone(),
            "--column onset=onset:furlong",
            "furlong: must be s",
        ),
        (good.clone(), "--column onst=drop", "did you mean onset?"),
        (good.clone(), "--set drop=3", "beside --set drop"),
        (
            good.clone(),
            "--column drop=drop:1 --set drop=3",
            "drop is given twice",
        ),
        (
            good.replace("\n4,3", "\n3,3"),
            "",
            "line 5: onset 3 s is not after 3 s",
        ),
        (
            good.replace("\n4,3", "\n2.5,3"),
            "",
            "line 5: onset 2.5 s is not after 3 s",
        ),
        (
            good.replace("\n4,3", "\nNaN,3"),
            "",
            "line 5: onset is missing",
        ),
        (
            good.replace("\n4,3", "\ninf,3"),
            "",
            "line 5: onset = inf: must be a number",
        ),
        (
            good.replace("\n4,3", "\n4,inf"),
            "",
            "line 5: drop = inf: must be a number",
        ),
        (
            good.replace("\n4,3", "\n,3"),
            "",
            "line 5: onset is missing",
        ),
        (
            good.replace("\n4,3", "\n4,x"),
            "",
            "line 5: drop = x: must be a number",
        ),
        (good.replace("\n4,3", "\n-4,3"), "", "line 5: onset = -4 s"),
        (
            good.replace("\n4,3", "\n4"),
            "",
            "line 5: 1 cells for 2 columns",
        ),
        (good.replace("\n4,3", "\n4,0,3,1"), "", "decimal commas"),
    ]);
}

#[test]
fn numbers_that_are_not_understood_are_refused_with_their_lines() {
    let good = lines("onset,drop", |n| format!("{n},3"));
    refuse(&[
        (
            good.replace("\n4,3", "\nonset,drop"),
            "",
            "line 5: onset = onset",
        ),
        (
            good.replace("\n4,3", "\n4,\"3"),
            "",
            "line 5: a cell has several lines",
        ),
        (
            good.replace("onset,drop", "onset,onset"),
            "",
            "several columns onset",
        ),
        (
            good.clone(),
            "--set Delta=1e-6 --set T=1 --set frequency=1",
            "T and frequency are given",
        ),
        (
            good.clone(),
            "--maximum nan",
            "maximum = nan: must be a number",
        ),
        (
            good.clone(),
            "--maximum 1 --set maximum=2",
            "maximum is given twice",
        ),
        (
            good.clone(),
            "--set N=9",
            "allowed are onset, drop, peak_force, run, V0, Kd",
        ),
        (String::new(), "", "has no column onset"),
        (
            good.replace(",3", ",\"1,012\""),
            "",
            "drop = 1,012: has a comma; if commas are decimal in this file, add --decimal-comma",
        ),
        (
            good.replace(',', "\t").replace("\t3", "\t1,012"),
            "",
            "line 2: drop = 1,012: has a comma",
        ),
        (
            good.replace(',', ";").replace(";3", ";1.012"),
            "--decimal-comma",
            "line 2: drop = 1.012: has a point",
        ),
        (
            good.replace("onset,drop\n", ""),
            "",
            "line 1: has numbers where names of columns must stand",
        ),
        (
            format!("# {good}"),
            "",
            "line 1: if # onset,drop names the columns, remove the #",
        ),
        (
            format!("sep=,\n{good}"),
            "",
            "line 1: sep= is for Excel alone",
        ),
        (
            good.clone(),
            "--set end=9",
            "line 11: end is before the onset at 10 s",
        ),
        (
            lines("onset,end", |n| format!("{n},{}", 20 + n / 9)),
            "",
            "line 10: end differs within a series",
        ),
        (
            lines("onset,Delta,T", |n| {
                format!("{n},{},1", if n == 7 { "" } else { "1e-6" })
            }),
            "",
            "line 8: Delta is missing",
        ),
    ]);
}

#[test]
fn what_a_key_lacks_and_what_parameters_cannot_be_is_refused() {
    let good = lines("onset,drop", |n| format!("{n},3"));
    refuse(&[
        (
            lines("onset,Kd", |n| {
                format!("{n},{}", if n == 7 { "NA" } else { "4e7" })
            }),
            "",
            "line 8: Kd is missing",
        ),
        (
            lines("onset,T", |n| {
                format!("{n},{}", if n == 7 { "nan" } else { "1" })
            }),
            "",
            "line 8: T is missing",
        ),
        (
            lines("onset,run", |n| {
                format!("{n},{}", if n == 7 { "-" } else { "a" })
            }),
            "",
            "line 8: run is missing",
        ),
        (
            lines("onset,maximum", |n| {
                format!("{n},{}", if n == 7 { "" } else { "0.1" })
            }),
            "--set T=2",
            "line 8: maximum is missing",
        ),
        (
            lines("onset,delta", |n| format!("{n},1e-6")),
            "--set T=2",
            "column delta: is it Delta?",
        ),
        (
            good.replace("drop", "Peak_Force [kN]"),
            "",
            "--column 'peak_force=Peak_Force [kN]:kN'",
        ),
        (
            good.replace("onset,drop", "onset,T"),
            "--set frequency=2",
            "T and frequency are given",
        ),
        (
            (0..50)
                .map(|n| format!("c{n:02}"))
                .collect::<Vec<_>>()
                .join(","),
            "",
            "c38, c39, .., in --column onset",
        ),
        ("onset,drop\n".to_owned(), "", "has no slips"),
        ("\u{0}\u{1}PAR".to_owned(), "", "has no column onset"),
        (
            "onset\n1".to_owned(),
            "--set V0=1e-4:furlong",
            "furlong: must be m/s",
        ),
        ("PAR1".to_owned(), "", "slips.csv: "),
        (
            good.clone(),
            "--set V0=-1",
            "V0 = -1: must be a finite number > 0",
        ),
        (
            good.clone(),
            "--set Delta=1e-6",
            "Delta > 0: needs T or frequency",
        ),
        (good.clone(), "--set Kd=0", "Kd = 0: must be"),
    ]);
}

#[test]
fn series_are_refused_where_they_run_into_each_other_and_lines_are_counted_right() {
    let folder = Folder::new();
    let good = lines("onset,drop", |n| format!("{n},3"));
    folder.write("slips.csv", &good);
    folder.write(
        "runs.csv",
        &lines("onset,run", |n| format!("{n},{}", n / 3 % 2)),
    );
    // Lines count whatever ends them, and those without a row.
    let breaks = format!("# a\n\n{}", good.replace("\n4,3", "\n\n4,x")).replace('\n', "\r\n");
    folder.write("breaks.csv", &breaks);
    folder.screens(
        "series_refused",
        [
            "measured slips.csv -o out",
            "measured runs.csv -o out --set V0=1e-4 --set Delta=0",
            "measured breaks.csv -o out --set V0=1e-4 --set Delta=0",
            "measured slips.csv -o fast --set V0=100 --set Delta=0",
        ],
    );
}

#[test]
fn a_missing_control_and_a_single_series_are_named() {
    let folder = Folder::new();
    folder.write("slips.csv", &lines("onset", |n| format!("{}", n * n)));
    let options = "--set V0=2e-4 --set Kd=3e7 --set Delta=1e-6 --set T=0.03 --maximum 10:ms";
    folder.screens(
        "measured_without_a_control",
        [&format!("measured slips.csv -o out {options}")],
    );
    let phases = folder.table("out", "slips").reals("phase");
    let turns = (1.0 - 0.01) / 0.03_f64;
    let expected = std::f64::consts::TAU * (turns - turns.round());
    assert!((phases[0] - expected).abs() < 1e-9, "{phases:?}");

    // Each series from its own maximum; and if that is forgotten, phases scatter more than the drive lets them.
    let mut rows = Vec::new();
    for run in 0..24 {
        for slip in 1..40 {
            let shift = 0.125 * f64::from(run);
            let time = 7.0 * f64::from(slip) + f64::from(slip * 5 % 7) + 0.001 * f64::from(run);
            rows.push(format!("free {run},{time},0,0"));
            let time = 30.0 * f64::from(slip) - 1.0 + shift;
            rows.push(format!("{run},{time},1e-6,{shift}"));
        }
    }
    rows.sort_by_key(|row: &String| row.split(',').next().map(str::to_owned));
    folder.write(
        "series.csv",
        &format!("run,onset,Delta,zero\n{}\n", rows.join("\n")),
    );
    let command = "measured series.csv --set V0=1e-6 --set T=3";
    folder.screens(
        "measured_from_maxima",
        [
            &format!("{command} -o aligned --column maximum=zero"),
            &format!("{command} -o forgotten"),
        ],
    );
    assert!(
        folder
            .file("aligned/reduced/sets.parquet")
            .reals("resultant_length")[0]
            > 0.999
    );
}

/// Irregular onsets, of which no two lists are equal.
fn irregular(count: u32, seed: u32) -> Vec<f64> {
    let interval = |n: u32| 1.0 + f64::from(n.wrapping_mul(2_654_435_761) >> 20) / 4096.0;
    let mut time = 0.0;
    let onset = |n| {
        time += interval(n + 1000 * seed);
        time
    };
    (0..count).map(onset).collect()
}

fn table(head: &str, rows: impl Iterator<Item = String>) -> String {
    format!("{head}\n{}\n", rows.collect::<Vec<_>>().join("\n"))
}

#[test]
fn the_same_slips_twice_are_refused_with_both_places() {
    let folder = Folder::new();
    let onsets = irregular(12, 0);
    let rows = || {
        onsets
            .iter()
            .map(|onset| format!("{onset},{}", 300.0 + onset))
    };
    let text = table("onset,drop", rows());
    folder.write("a.csv", &text);
    folder.write("b.csv", &format!("# another byte\n{text}"));
    let unmodulated = "--set V0=1e-4 --set Delta=0";
    // Within a table, under other parameters.
    let both = rows().map(|row| format!("{row},a,1e-4"));
    let both = both.chain(rows().map(|row| format!("{row},b,2e-4")));
    folder.write("both.csv", &table("onset,drop,run,V0", both));
    folder.screens(
        "the_same_slips_twice",
        [
            &format!("measured a.csv b.csv -o out {unmodulated}"),
            "measured both.csv -o out --set Delta=0",
        ],
    );
    // Few slips, regular ones, and those of which only the times are known may be equal and others.
    let few = || rows().take(9);
    let regular = || (1..20).map(|n: u32| format!("{n},3"));
    let times = || onsets.iter().map(f64::to_string);
    for (name, first, second) in [
        (
            "few",
            table("onset,drop", few()),
            table("onset,drop", few()),
        ),
        (
            "regular",
            table("onset,drop", regular()),
            table("onset,drop", regular()),
        ),
        ("times", table("onset", times()), table("onset", times())),
    ] {
        folder.write("c.csv", &first);
        folder.write("d.csv", &format!("\n{second}"));
        folder.ends(0, &format!("measured c.csv d.csv -o {name} {unmodulated}"));
    }
}

#[test]
fn samples_of_a_trace_are_refused_and_slips_that_lock_are_not() {
    let folder = Folder::new();
    let every = |count: u32, seconds: f64| {
        table(
            "onset",
            (1..=count).map(|n| format!("{}", seconds * f64::from(n))),
        )
    };
    folder.write("trace.csv", &every(100, 0.0005));
    let options = "--set V0=1e-4 --set Delta=1e-6";
    let refused = folder.ends(
        2,
        &format!("measured trace.csv -o out {options} --set T=0.03"),
    );
    assert!(
        refused.stderr.contains("samples of a trace"),
        "{}",
        refused.stderr
    );
    folder.write("short.csv", &every(99, 0.0005));
    folder.ends(
        0,
        &format!("measured short.csv -o short {options} --set T=0.03"),
    );
    folder.write("locked.csv", &every(120, 0.06));
    folder.ends(
        0,
        &format!("measured locked.csv -o locked {options} --set T=0.03"),
    );
    folder.ends(
        2,
        &format!("measured locked.csv -o out {options} --set T=0.04"),
    );
}

#[test]
fn a_tide_whose_amplitude_nobody_knows_has_phases_and_no_excess() {
    let folder = Folder::new();
    let onsets = irregular(40, 0);
    folder.write(
        "tide.csv",
        &table("onset", onsets.iter().map(f64::to_string)),
    );
    folder.screens(
        "measured_tide",
        ["measured tide.csv -o out --set V0=1e-9 --set T=0.7"],
    );
    let sets = folder.file("out/reduced/sets.parquet");
    for known in ["resultant_length", "locking_index", "phase_mean"] {
        assert_eq!(sets.reals(known).len(), 1, "{known}");
    }
    for unknown in ["Delta", "eta", "resultant_drive", "resultant_excess"] {
        assert!(
            sets.column(unknown).all(|cell| *cell == Cell::Null),
            "{unknown}"
        );
    }
    let slips = folder.table("out", "slips");
    for unknown in ["eta", "Delta", "Delta_onset"] {
        assert!(
            slips.column(unknown).all(|cell| *cell == Cell::Null),
            "{unknown}"
        );
    }
    for command in [
        "show out --json",
        "report out",
        "plot out",
        "export out --out csv --format csv",
        "status out",
    ] {
        folder.ends(0, command);
    }
}

#[test]
fn the_end_of_records_says_how_much_too_short_the_mean_is() {
    let folder = Folder::new();
    let onsets = irregular(11, 0);
    let text = table("onset", onsets.iter().map(f64::to_string));
    folder.write("slips.csv", &text);
    let command = "measured slips.csv --set V0=1e-4 --set Delta=0";
    folder.screens(
        "measured_with_and_without_an_end",
        [
            &format!("{command} -o without"),
            &format!("{command} -o with --set end=40:s"),
        ],
    );
    let off = |directory: &str| {
        let sets = folder.file(&format!("{directory}/reduced/sets.parquet"));
        sets.reals("tau_mean_off").first().copied()
    };
    assert_eq!(off("without"), None);
    let sets = folder.file("with/reduced/sets.parquet");
    let variation = sets.reals("tau_sd")[0] / sets.reals("tau_mean")[0];
    let expected = -variation * variation / 10.0;
    assert!((off("with").unwrap() / expected - 1.0).abs() < 1e-9);
}

#[test]
fn drops_that_are_no_force_have_a_shape_and_no_newtons() {
    let folder = Folder::new();
    let onsets = irregular(30, 0);
    let rows = onsets
        .iter()
        .map(|onset| format!("{onset},{}", 0.1 + 0.01 * onset.fract()));
    folder.write("slips.csv", &table("onset,mu", rows));
    folder.ends(
        0,
        "measured slips.csv -o out --column drop=mu:1 --set V0=1e-4 --set Delta=0",
    );
    let sets = folder.file("out/reduced/sets.parquet");
    for unknown in ["drop_mean", "drop_mean_low", "drop_sd", "drop_sd_high"] {
        assert!(
            sets.column(unknown).all(|cell| *cell == Cell::Null),
            "{unknown}"
        );
    }
    let slips = folder.table("out", "slips");
    assert_eq!(slips.unit("drop"), "");
    let drops = slips.reals("drop");
    let mean = drops.iter().sum::<f64>() / 30.0;
    let variance = drops.iter().map(|drop| (drop - mean).powi(2)).sum::<f64>() / 29.0;
    let [variation] = sets.reals("drop_cv")[..] else {
        panic!()
    };
    assert!(
        (variation / (variance.sqrt() / mean) - 1.0).abs() < 1e-9,
        "{variation}"
    );
    let other = folder.ends(
        2,
        "measured slips.csv -o no --column peak_force=mu:1 --set V0=1e-4 --set Delta=0",
    );
    assert!(
        other.stderr.contains("1: must be N, or with prefixes"),
        "{}",
        other.stderr
    );
}

#[test]
fn what_is_read_is_said_before_anything_is_written() {
    let folder = Folder::new();
    let text = lines("t_(ms),amp,note,rig", |n| format!("{}.5,0.6,x,7", n * n));
    folder.write("slips.csv", &text);
    let command = "measured slips.csv -o out --column onset=t_(ms):ms --column Delta=amp:um --set V0=100:um/s --set T=0.03";
    let dry = format!("{command} --dry-run");
    let [said] = folder.screens("measured_dry_run", [&dry]);
    assert!(!folder.path("out").exists());
    let [read] = folder.screens("measured", [command]);
    assert!(read.stdout.starts_with(&said.stdout));
    // With a space in the head, too.
    let spaced = |text: &str| text.replace('_', " ");
    folder.write("slips.csv", &spaced(&text));
    let words: Vec<String> = dry.split(' ').map(spaced).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    assert_eq!(folder.run_words(&words, "").stdout, spaced(&said.stdout));
}

#[test]
fn ids_follow_from_what_was_read_and_not_from_where_it_lay() {
    let folder = Folder::new();
    fs::create_dir(folder.path("sub")).unwrap();
    let text = table("onset", irregular(12, 0).iter().map(f64::to_string));
    folder.write("a.csv", &text);
    folder.write("sub/b.csv", &text.replace('\n', "\r\n"));
    let options = "--set V0=1e-4 --set Delta=0";
    folder.ends(0, &format!("measured a.csv -o out {options}"));
    folder.ends(0, &format!("measured sub/b.csv -o other {options}"));
    let ids = |directory: &str| {
        let jobs = folder.table(directory, "jobs");
        jobs.column("job_id").cloned().collect::<Vec<_>>()
    };
    assert_eq!(ids("out"), ids("other"));
    // The same, read again from elsewhere, is nothing new; other numbers are.
    fs::rename(folder.path("a.csv"), folder.path("sub/a.csv")).unwrap();
    folder.ends(0, &format!("measured sub/a.csv -o out {options}"));
    folder.write("a.csv", &text.replacen(".0", ".1", 1).replacen('1', "0", 1));
    folder.ends(2, &format!("measured a.csv -o out {options}"));
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused_at_once_and_a_pipe_is_read_once() {
    let folder = Folder::new();
    let options = "--set V0=1e-4 --set Delta=0";
    fifo(&folder.path("fifo"));
    for path in ["fifo", "/dev/zero", "."] {
        let refused = folder.ends(2, &format!("measured {path} -o out {options}"));
        assert!(
            refused.stderr.contains("is no file"),
            "{path}: {}",
            refused.stderr
        );
    }
    let text = table("onset", irregular(12, 0).iter().map(f64::to_string));
    let command = format!("measured /dev/stdin -o out {options}");
    let words: Vec<&str> = command.split_whitespace().collect();
    let piped = folder.run_words(&words, &text);
    assert_eq!(piped.code, Some(0), "{}", piped.stderr);
    folder.screens("verify_measured_from_a_pipe", ["verify out"]);
}

#[test]
fn no_cut_or_changed_file_makes_a_panic() {
    let folder = Folder::new();
    folder.ends(
        0,
        "simulate --set N=10 --set Ns=5 --slips 9 --slip-table slips.parquet",
    );
    let parquet = fs::read(folder.path("slips.parquet")).unwrap();
    let given = |text: &str| Given::parse_all("--set", &[text.to_owned()]).unwrap();
    let request = Request {
        sources: Sources::new(Vec::new(), given("Delta=0"), false).unwrap(),
        ..Request::default()
    };
    let text = lines("run,onset,drop,V0", |n| format!("\"a\",{n}.5,3e2,1e-4"));
    for (name, bytes) in [("a.csv", text.into_bytes()), ("a.parquet", parquet)] {
        let file = [folder.path(name)];
        let step = bytes.len() / 97 + 1;
        for place in (0..bytes.len()).step_by(step) {
            let mut changed = bytes.clone();
            changed[place] ^= 0x15;
            for bytes in [&bytes[..place], &changed] {
                fs::write(&file[0], bytes).unwrap();
                let read = Experiment::read(&file, &request);
                assert!(read.is_ok() || format!("{:#}", read.unwrap_err()).contains(name));
            }
        }
    }
}
