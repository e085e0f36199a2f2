//! The result of a sweep as `show` and the end of `run` tell it.

use crate::program::{Folder, json};
use crate::report::{page, unpacked};

const SWEEP: &str = "name = \"small\"\n[model]\nN = 10\nNs = 5\n[axes]\nDelta = [0, 1e-6]\nfrequency = [29, 58]\n\
                     seed = { count = 4 }\n[record]\nslips = 8\n";

#[test]
fn all_sets_of_a_value_of_an_eta_axis_have_that_value_one_bin_and_one_window_of_the_phase() {
    let folder = Folder::new();
    let sweep = "name = \"eta\"\n[model]\nN = 2\nNs = 4\n[axes]\nV0 = [3e-5, 1e-4, 3e-4]\n\
                 Delta = [3e-7, 7e-7, 1e-6]\neta = [0.5, 1, 2, 3, 7]\n[record]\nslips = 4\ndiscard = 0\n";
    folder.write("eta.toml", sweep);
    folder.ends(0, "run eta.toml --out out");
    let axis = [0.5, 1.0, 2.0, 3.0, 7.0];
    for table in [
        "tables/jobs/part-000-000000.parquet",
        "reduced/sets.parquet",
    ] {
        let found = folder.file(&format!("out/{table}")).reals("eta");
        assert!(!found.is_empty());
        assert!(found.iter().all(|eta| axis.contains(eta)), "{found:?}");
    }
    for eta in axis {
        let shown = format!("show out --csv --where eta=={eta}");
        assert_eq!(folder.ends(0, &shown).stdout.lines().count(), 1 + 9);
    }
    // None in the bin below 1.
    let bins = folder.file("out/reduced/backbone.parquet").reals("eta_low");
    assert!(
        bins.contains(&1.0) && bins.iter().all(|low| !(0.5..1.0).contains(low)),
        "{bins:?}"
    );
    // From φ_max and its margin down a turn, where an η a hair below 1 would reach π.
    let slips = folder.table("out", "slips");
    let (etas, phases) = (slips.reals("eta"), slips.reals("phase"));
    let of_one = etas.iter().zip(phases).filter(|(eta, _)| **eta == 1.0);
    let top = 0.5 * std::f64::consts::PI + 0.5;
    assert!(of_one.clone().count() > 30 && of_one.clone().all(|(_, phase)| phase <= top));
}

#[test]
fn run_ends_with_the_result_and_show_prints_it_again() {
    let folder = Folder::new();
    folder.write("small.toml", SWEEP);
    let [_, run, shown, ..] = folder.screens(
        "sweep",
        [
            "plan small.toml --threads 2",
            "run small.toml --out out --threads 2",
            "show out",
            "show out --columns frequency,tau_mean --csv",
            // Each column stands once, whether it is asked for or goes with another.
            "show out --csv --columns tau_sd_high,tau_sd,tau_sd_low",
            "status out",
            "verify out",
            "reduce out",
            "plot out",
            "report out",
            "export out -o exported",
            "plan small.toml --out out --threads 2",
            "run small.toml --out out --threads 2",
        ],
    );
    assert!(run.stdout.contains(&shown.stdout));
    // The numbers are those of the reduced table, in SI; rows go by frequency, not by period.
    let sets = folder.file("out/reduced/sets.parquet").reals("tau_mean");
    let of_table = [0, 2, 1].map(|set| sets[set]);
    let all = json(&folder.ends(0, "show out --json").stdout);
    let of_json: Vec<f64> = all["sets"]
        .as_array()
        .unwrap()
        .iter()
        .map(|set| set["tau_mean"].as_f64().unwrap())
        .collect();
    assert_eq!(of_json, of_table);
}

#[test]
fn sets_are_chosen_sorted_and_computed_with() {
    let folder = Folder::new();
    folder.write("small.toml", SWEEP);
    folder.ends(0, "run small.toml --out out");
    let found = folder
        .run("show out --json --where 1/T>30 --columns frequency,1e3*tau_mean")
        .stdout;
    let sets = json(&found)["sets"].as_array().unwrap().clone();
    assert_eq!(
        (sets.len(), sets[0]["frequency"].as_f64().map(f64::round)),
        (1, Some(58.0))
    );
    let taus = |order: &str| -> Vec<f64> {
        let found = json(
            &folder
                .run(&format!(
                    "show out --json --sort {order} --columns tau_mean"
                ))
                .stdout,
        );
        found["sets"]
            .as_array()
            .unwrap()
            .iter()
            .map(|set| set["tau_mean"].as_f64().unwrap())
            .collect()
    };
    let (up, down) = (taus("tau_mean"), taus("-tau_mean"));
    assert!(
        up.is_sorted() && down.iter().rev().eq(&up),
        "{up:?} {down:?}"
    );
    folder.screens(
        "show_chosen",
        [
            // By heading, too; what was swept comes first.
            "show out --columns R,⟨τ⟩ --where η>0",
            "show out --where ⟨τ⟩>90",
            "show out --csv --where ⟨τ⟩>90",
            "show out --json --where ⟨τ⟩>90",
            "show out --columns tau_men",
            "show out --where tau_mean",
            "show out --sort colour",
        ],
    );
}

#[test]
fn columns_of_rounds_are_columns_and_values_are_told_apart() {
    let folder = Folder::new();
    let sweep = "name = \"rounds\"\n[model]\nN = 3\nNs = 4\n[axes]\nKd = [10025, 10027, 22540]\n[precision]\nof = \"tau_mean\"\n\
                 relative = 0.5\nseeds = { from = 2, to = 4 }\n[record]\nslips = 6\n";
    folder.write("rounds.toml", sweep);
    folder.ends(0, "run rounds.toml --out out");
    folder.screens(
        "show_rounds",
        ["show out --columns seeds,target_met,first_round,last_round --where seeds>=2 --sort -seeds"],
    );
    let all = folder.file("out/reduced/sets.parquet");
    let names = all.schema.as_ref().unwrap().fields().iter();
    let names: Vec<String> = names.map(|field| field.name().clone()).collect();
    folder.ends(0, &format!("show out --json --columns {}", names.join(",")));
    folder.ends(0, "plot out --x V0 --y tau_mean --colour Kd -o own.svg");
    let svg = std::fs::read_to_string(folder.path("own.svg")).unwrap();
    for value in ["10025", "10027", "22540"] {
        assert!(svg.contains(&format!(" = {value} N/m<")), "{value}");
    }
}

#[test]
fn directories_are_compared_seed_by_seed_where_all_that_varies_agrees() {
    let folder = Folder::new();
    folder.write("small.toml", SWEEP);
    folder.write(
        "stiff.toml",
        &SWEEP
            .replace("Ns = 5", "Ns = 5\nKd = 1e7")
            .replace("[29, 58]", "[58, 87]"),
    );
    folder.ends(0, "run small.toml --out a");
    folder.ends(0, "run stiff.toml --out b");
    let number = |set: &serde_json::Value, key: &str| set[key].as_f64();
    let sets = |arguments: &str| {
        json(&folder.ends(0, arguments).stdout)["sets"]
            .as_array()
            .unwrap()
            .clone()
    };
    let pairs = sets("show a b --json");
    assert_eq!(pairs.len(), 2, "without modulation, and 58 Hz");
    for pair in &pairs {
        for seeds in ["seeds_a", "seeds_b"] {
            assert_eq!(pair[seeds].as_u64(), Some(4), "a whole number");
        }
        let [a, b, difference, low, high] =
            ["a", "b", "difference", "difference_low", "difference_high"]
                .map(|end| number(pair, &format!("tau_mean_{end}")).unwrap());
        assert!(
            (b - a - difference).abs() < 1e-12 && low < difference && difference < high,
            "{pair}"
        );
    }
    let differences = &json(&folder.ends(0, "show a b --json").stdout)["differences"];
    assert_eq!(differences, &serde_json::json!({ "Kd": [4e7, 1e7] }));
    folder.screens("show_difference", ["show a b", "show a b --csv"]);
    let frequencies: Vec<_> = pairs.iter().map(|pair| number(pair, "frequency")).collect();
    assert!(frequencies.contains(&Some(58.0)), "{frequencies:?}");
    // As the table of sets says, also where runs end within an interval.
    folder.write("cut.toml", &format!("{SWEEP}max_time = 0.5\n"));
    folder.ends(0, "run cut.toml --out cut");
    for directory in ["a", "cut"] {
        let alone = sets(&format!("show {directory} --json"));
        let pairs = sets(&format!("show {directory} {directory} --json"));
        assert_eq!(alone.len(), pairs.len());
        for key in ["tau_mean", "mean_friction", "resultant_length"] {
            let of = |sets: &[serde_json::Value], key: &str| -> Vec<_> {
                sets.iter().map(|set| number(set, key)).collect()
            };
            assert_eq!(
                of(&alone, key),
                of(&pairs, &format!("{key}_a")),
                "{directory}"
            );
        }
    }
    assert!(
        sets("show a a --json")
            .iter()
            .all(|pair| number(pair, "mean_friction_difference") == Some(0.0))
    );
}

#[test]
fn sets_of_a_zip_with_seeds_are_in_the_sweep_and_those_that_left_it_are_named() {
    let folder = Folder::new();
    let sweep = |velocities: &str, seeds: &str| {
        format!(
            "name = \"zip\"\n[model]\nN = 2\nNs = 2\n[axes]\nzip = [{{ V0 = {velocities}, seed = {seeds} }}]\n\
             [record]\nslips = 2\ndiscard = 0\n"
        )
    };
    folder.write(
        "zip.toml",
        &sweep("[1e-4, 2e-4, 1e-4, 3e-4]", "[3, 4, 5, 3]"),
    );
    folder.write("narrowed.toml", &sweep("[1e-4, 2e-4]", "[7, 4]"));
    folder.screens(
        "run_narrowed",
        [
            "run zip.toml --out out --threads 1",
            "run narrowed.toml --out out --threads 1",
        ],
    );
}

#[test]
fn jobs_that_max_time_cut_are_counted_with_about_what_is_missing_by_show_and_report() {
    let folder = Folder::new();
    folder.write(
        "cut.toml",
        "name = \"cut\"\n[model]\nN = 5\nNs = 5\n[axes]\nseed = { count = 6 }\n[record]\nslips = 400\nmax_time = 0.4\n",
    );
    folder.screens(
        "cut_by_max_time",
        [
            "run cut.toml --out out --threads 1",
            "run cut.toml --set max_time=0.01 --out early --threads 1",
            // Those that end at a time are whole.
            "run cut.toml --set max_time=9 --set slips=4 --set time=0.4 --out whole --threads 1",
        ],
    );
    let columns = "--json --columns tau_mean,tau_sd,intervals,slips,jobs_cut,tau_mean_off";
    let set = &json(&folder.ends(0, &format!("show out {columns}")).stdout)["sets"][0];
    let number = |column: &str| set[column].as_f64().unwrap();
    let variation = number("tau_sd") / number("tau_mean");
    let off = -variation * variation * 6.0 / number("intervals");
    assert_eq!(number("jobs_cut"), 6.0);
    assert!((number("tau_mean_off") / off - 1.0).abs() < 1e-12);
    folder.ends(0, "report out");
    let census = &unpacked(&page(&folder, "out/report.html"))["census"];
    let shown = census["tau_off"].as_f64().unwrap();
    assert_eq!(census["jobs_cut"], 6);
    assert!((shown / off - 1.0).abs() < 1e-12);
    let set = &json(&folder.ends(0, &format!("show whole {columns}")).stdout)["sets"][0];
    assert_eq!(
        (set["jobs_cut"].as_u64(), set["tau_mean_off"].as_f64()),
        (Some(0), None)
    );
}

#[test]
fn jobs_without_slips_are_reported_with_a_command_that_shows_one() {
    let folder = Folder::new();
    folder.write(
        "fast.toml",
        "name = \"fast\"\n[model]\nN = 5\nNs = 5\n[axes]\nV0 = [1e-4, 1]\nseed = { count = 2 }\n[record]\nslips = 4\ngive_up_after = 0.5\n",
    );
    // A sweep that no longer has the set has no command for it.
    let fast = std::fs::read_to_string(folder.path("fast.toml")).unwrap();
    folder.write("slow.toml", &fast.replace("[1e-4, 1]", "[1e-4]"));
    folder.screens(
        "jobs_without_slips",
        [
            "run fast.toml --out out --threads 1",
            // Without an end of any interval, the unit is that of what it is at least.
            "show out --where V0==1 --columns tau_mean,tau_mean_bound",
            "run slow.toml --out out --threads 1",
        ],
    );
}
