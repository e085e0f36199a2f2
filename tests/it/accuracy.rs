//! Scaling on the command line: tables, JSON and figure agree.

use crate::program::{Folder, json};

#[test]
fn scaling_writes_what_it_prints() {
    let folder = Folder::new();
    let printed = json(&folder.ends(0, "accuracy --scaling --quick --out cost --json").stdout);
    let written = json(&std::fs::read_to_string(folder.path("cost/scaling.json")).unwrap());
    assert_eq!(printed, written);
    let contents = folder.contents("cost");
    let names: Vec<_> = contents.keys().map(|name| name.to_str().unwrap()).collect();
    assert_eq!(names, ["scaling-exponents.parquet", "scaling.json", "scaling.parquet", "scaling.png", "scaling.svg"]);

    let (table, sizes) = (folder.file("cost/scaling.parquet"), printed["sizes"].as_array().unwrap());
    assert_eq!(table.counts("N"), [70, 70, 140, 140, 280, 280, 70, 70]);
    assert_eq!(table.counts("Ns"), [20, 20, 20, 20, 20, 20, 80, 80]);
    assert_eq!(table.reals("tolerance"), [1e-6, 1e-10].repeat(4));
    for column in ["cpu_per_slip", "cpu_per_simulated_second", "cpu_per_step", "steps_per_slip", "breaks_per_slip"] {
        let printed_value: Vec<f64> = sizes.iter().map(|row| row[column].as_f64().unwrap()).collect();
        assert_eq!(printed_value.len(), 8);
        for (printed_value, stored) in printed_value.into_iter().zip(table.reals(column)) {
            // The parser of the JSON may be off by the last bit.
            assert!(
                printed_value > 0.0 && (printed_value - stored).abs() <= 1e-15 * stored,
                "{column}: {printed_value} {stored}"
            );
        }
    }
    let exponents = folder.file("cost/scaling-exponents.parquet");
    assert_eq!(exponents.texts("size"), ["N", "N", "Ns", "Ns"]);
    // Counts, not times: these are the same on every machine. Measured: 0.93 to 1.03.
    for exponent in exponents.reals("breaks_per_slip") {
        assert!((exponent - 1.0).abs() < 0.15, "{exponent}");
    }
}

#[test]
fn scaling_takes_no_option_of_the_study() {
    let folder = Folder::new();
    for option in ["--hard-cases", "--seeds 3", "--slips 3"] {
        let ended = folder.ends(2, &format!("accuracy --scaling {option}"));
        assert!(ended.stderr.contains("cannot be used with"), "{}", ended.stderr);
    }
}
