//! The files of a study: everything as JSON, and figures.

use super::comparison::Bias;
use super::{Findings, MethodRow, Study, other_settings, others_in_words, verdict};
use crate::figure::{ErrorPanel, Look, Picture, WorkPrecision, work_precision};
use crate::model::Parameters;
use crate::results::destination::{Destination, refuse_reserved};
use crate::table::arrow;
use crate::table::file::PROGRAM;
use crate::table::storage::{Disk, Storage};
use anyhow::Result;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

const FORMAT: u32 = 6;

/// Name of the processor as the operating system gives it, and the architecture.
pub fn processor() -> String {
    let description = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |key: &str| {
        let line = description.lines().find(|line| line.starts_with(key))?;
        line.split_once(':')
            .map(|(_, value)| value.trim().to_owned())
    };
    let name = field("model name").unwrap_or_else(|| "unknown processor".to_owned());
    let clock = field("cpu MHz").map_or_else(String::new, |clock| format!(", {clock} MHz"));
    format!("{name} ({}{clock})", std::env::consts::ARCH)
}

pub fn to_json(study: &Study, findings: &Findings) -> Value {
    json!({
        "format": FORMAT,
        "program": PROGRAM,
        "processor": processor(),
        "first_seed": study.first_seed,
        "seeds": study.seeds,
        "first_set_multiple": study.first_set_multiple,
        "slips": study.slips,
        "breaks": study.breaks,
        "verdict": verdict(study, findings),
        "methods": findings.methods.iter().map(arrow::json).collect::<Value>(),
        "biases": findings.biases.iter().map(arrow::json).collect::<Value>(),
    })
}

/// Refuses what is no folder, and one among the data of a results directory.
pub fn check(folder: &Path) -> Result<()> {
    refuse_reserved(folder)?;
    Disk.list(folder)?;
    Ok(())
}

/// Writes what a study found into a folder, over what an earlier one left there, with a figure for the sets that differ
/// in the modulation alone; returns the files. A signal sets `stop`.
pub fn write(
    study: &Study,
    findings: &Findings,
    folder: &Path,
    stop: &AtomicBool,
) -> Result<Vec<PathBuf>> {
    let mut sets: Vec<Parameters> = Vec::new();
    for set in study.sets.iter().map(Parameters::without_modulation) {
        if !sets.contains(&set) {
            sets.push(set);
        }
    }
    let mut documents = vec![(
        "accuracy".to_owned(),
        "json",
        to_json(study, findings).to_string().into_bytes(),
    )];
    for set in sets {
        let settings = other_settings(&set).map(|(key, value)| format!("-{key}-{value}"));
        let others: String = settings.collect();
        let name = format!("work-precision-V0-{:e}{others}", set.drive_velocity);
        let picture = work_precision_figure(&set, findings)?;
        documents.push((name.clone(), "svg", picture.svg().into_bytes()));
        documents.push((name, "png", picture.png()?));
    }
    Disk.ensure_folder(folder)?;
    let mut files = Vec::new();
    for (name, extension, bytes) in documents {
        let file = folder.join(format!("{name}.{extension}"));
        Destination::new(&file, extension)?.write(stop, |mut file| Ok(file.write(&bytes)?))?;
        files.push(file);
    }
    Ok(files)
}

/// The figure of the sets that are this one without modulation: cost against the error of break times, and against the
/// biases of mean and standard deviation of τ, in units of the bias that chance alone stays under.
fn work_precision_figure(set: &Parameters, findings: &Findings) -> Result<Picture> {
    const WORK: &str = "CPU time per slip (s)";
    const NOTE: &str = "Biases: a method's slips less those of the reference, over what 95 of 100 samples without a bias stay under, \
                        so that chance alone puts 1 dot of 20 above 1; bars: 95 %. Errors of break times: median, bars up to the \
                        largest.";
    const EXTRAPOLATED: &str = " * Cost extrapolated from that of a step.";
    let methods = findings.methods.iter();
    let of_set = methods.filter(|row| row.parameters.without_modulation() == *set);
    let rows: Vec<&MethodRow> = of_set.collect();
    let breaks = points(&rows, |row| {
        let error = row.break_times.median?;
        Some((error, (error, row.break_times.largest?)))
    });
    let mut panels = vec![ErrorPanel {
        label: "Error of break times (s)".to_owned(),
        by_chance: None,
        points: breaks,
    }];
    let of_mean: fn(&Bias) -> Option<f64> =
        |bias| Some(bias.of_mean / (bias.interval_of_mean?.high - bias.of_mean));
    let of_deviation: fn(&Bias) -> Option<f64> =
        |bias| Some(bias.of_deviation / (bias.interval_of_deviation?.high - bias.of_deviation));
    for (name, over_chance) in [("mean τ", of_mean), ("s.d. of τ", of_deviation)] {
        let points = points(&rows, |row| {
            let of_chance = over_chance(&findings.bias_of(row, "interval")?.bias)?.abs();
            Some((of_chance, ((of_chance - 1.0).max(0.0), of_chance + 1.0)))
        });
        panels.push(ErrorPanel {
            label: format!("Bias of {name} / chance level"),
            by_chance: Some(1.0),
            points,
        });
    }
    panels.retain(|panel| !panel.points.is_empty());
    let others = others_in_words(set);
    let extrapolated = if rows.iter().any(|row| row.cost.is_extrapolated()) {
        EXTRAPOLATED
    } else {
        ""
    };
    let velocity = set.drive_velocity;
    let look = Look {
        note: format!("V0 = {velocity:e} m/s{others}. {NOTE}{extrapolated}"),
        ..Look::default()
    };
    work_precision(WORK, &panels, &look)
}

/// Each method under each modulation: `error` gives an error and its uncertainty.
fn points(
    rows: &[&MethodRow],
    error: impl Fn(&MethodRow) -> Option<(f64, (f64, f64))>,
) -> Vec<WorkPrecision> {
    let sets = rows.iter().map(|row| &row.parameters);
    let mut modulated = sets.filter(|set| set.modulation_amplitude > 0.0);
    let first = modulated.next();
    let is_one = modulated.all(|other| Some(other) == first);
    let point = |row: &&MethodRow| {
        let (error, uncertainty) = error(row)?;
        let amplitude = row.parameters.modulation_amplitude;
        let drive = match row.parameters.frequency() {
            None => "Δ = 0".to_owned(),
            Some(_) if is_one => "Δ > 0".to_owned(),
            Some(frequency) => format!("Δ = {amplitude:e} m, {frequency} Hz"),
        };
        let mark = if row.cost.is_extrapolated() { "*" } else { "" };
        let method = format!("{}{mark}", row.solver.name());
        Some(WorkPrecision {
            method,
            drive,
            error,
            uncertainty,
            work: row.cost.per_slip,
        })
    };
    rows.iter().filter_map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::super::BiasRow;
    use super::super::SolverColumns;
    use super::super::comparison::{BreakErrors, Sample};
    use super::*;
    use crate::model::Selected;
    use crate::solver::Solver;
    use crate::table::columns::{Column, Row};

    static NEVER: AtomicBool = AtomicBool::new(false);

    fn findings() -> Findings {
        let parameters = Parameters::default();
        let solver = SolverColumns::from(Solver::fixed_step(1e-6));
        let break_times = BreakErrors {
            breaks: Some(100),
            missing: Some(0),
            median: Some(1e-7),
            largest: Some(1e-6),
        };
        let cost = super::super::Cost {
            per_simulated_second: 0.2,
            per_slip: 0.02,
            steps_per_slip: 1e5,
            per_step: 2e-7,
            timed_slips: 0,
        };
        let method = MethodRow {
            unbalanced: None,
            parameters: Selected::new(parameters.clone()),
            case: "defaults".to_owned(),
            solver: solver.clone(),
            cost,
            break_times,
        };
        let untested = MethodRow {
            unbalanced: None,
            break_times: BreakErrors::default(),
            ..method.clone()
        };
        let bias = BiasRow {
            parameters: Selected::new(parameters),
            case: "defaults".to_owned(),
            solver,
            quantity: "interval".to_owned(),
            slips: 3,
            reference_slips: 3,
            mean: 0.11,
            reference_mean: 0.11,
            deviation: 0.01,
            reference_deviation: 0.01,
            bias: Bias::of(
                &Sample::of(vec![vec![0.1], vec![0.11, 0.12]]).unwrap(),
                &Sample::of(vec![vec![0.1, 0.11], vec![0.13]]).unwrap(),
            ),
        };
        Findings {
            methods: vec![method, untested],
            biases: vec![bias],
        }
    }

    #[test]
    fn a_study_is_written_as_json_and_figures() {
        let folder = tempfile::tempdir().unwrap();
        let study = Study {
            sets: vec![Parameters::default()],
            ..Study::quick()
        };
        let findings = findings();
        check(folder.path()).unwrap();
        let files = write(&study, &findings, folder.path(), &NEVER).unwrap();
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, files.len(), "a draft stayed");
        let names: Vec<_> = files
            .iter()
            .map(|file| file.file_name().unwrap().to_str().unwrap())
            .collect();
        assert_eq!(
            names,
            [
                "accuracy.json",
                "work-precision-V0-1e-4.svg",
                "work-precision-V0-1e-4.png"
            ]
        );
        assert!(files.iter().all(|file| file.is_file()));
        let json: Value = serde_json::from_slice(&std::fs::read(&files[0]).unwrap()).unwrap();
        assert_eq!(json["methods"][0]["timed_slips"], 0);
        assert_eq!(
            (
                &json["methods"][0]["median_break_error"],
                &json["methods"][0]["T"]
            ),
            (&json!(1e-7), &Value::Null)
        );
        assert_eq!(json["methods"][1]["median_break_error"], Value::Null);
        assert_eq!(json["biases"][0]["quantity"], "interval");
        check(folder.path()).unwrap();
        let again = write(&study, &findings, folder.path(), &NEVER).unwrap();
        assert_eq!(again, files, "over an earlier study");
        check(&files[0]).unwrap_err();
    }

    #[test]
    fn every_field_of_the_json_is_documented() {
        let page = include_str!("../../docs/commands.md");
        let study = Study {
            sets: vec![Parameters::default()],
            ..Study::quick()
        };
        let findings = findings();
        let row = page
            .lines()
            .find(|line| line.starts_with("| `accuracy` |"))
            .unwrap();
        for field in to_json(&study, &findings).as_object().unwrap().keys() {
            assert!(row.contains(&format!("`{field}`")), "{field}");
        }
    }

    #[test]
    fn every_column_is_documented() {
        let page = include_str!("../../docs/commands.md");
        let described = |name: &str, columns: Vec<Column>| {
            let row = page
                .lines()
                .find(|line| line.starts_with(&format!("| `{name}` |")))
                .unwrap();
            // The ends of all intervals are described together.
            for column in columns.iter().map(|column| {
                column
                    .name
                    .trim_end_matches("_low")
                    .trim_end_matches("_high")
            }) {
                assert!(row.contains(&format!("`{column}`")), "{name}.{column}");
            }
        };
        described("methods", MethodRow::columns());
        described("biases", BiasRow::columns());
    }
}
