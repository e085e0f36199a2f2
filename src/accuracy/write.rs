//! What a study leaves behind: tables as Parquet, everything as JSON, and the work-precision figures, put in place together.

use super::study::{DistanceRow, Findings, MethodRow, Quantity, Study};
use super::tables::{distances, method, methods, setting, stability};
use super::{AccuracyError, Stability, cpu};
use crate::figure::{Picture, WorkPrecision, work_precision};
use crate::model::Parameters;
use crate::store::columns::Table;
use crate::store::commit::{Commit, create_folder};
use crate::store::dataset::{Footer, PROGRAM, TableWriter};
use crate::store::storage::Storage;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Version of the JSON.
const FORMAT: u32 = 1;

/// Findings as JSON.
#[must_use]
pub fn as_json(study: &Study, findings: &Findings) -> Value {
    json!({
        "format": FORMAT,
        "program": PROGRAM,
        "processor": cpu::processor(),
        "seeds": study.seeds,
        "slips": study.slips,
        "breaks": study.breaks,
        "followed_breaks": study.followed_breaks,
        "methods": findings.methods.iter().map(method_json).collect::<Vec<_>>(),
        "distances": findings.distances.iter().map(distance_json).collect::<Vec<_>>(),
    })
}

/// The stability table as JSON.
#[must_use]
pub fn stability_json(rows: &[Stability]) -> Value {
    json!({ "format": FORMAT, "program": PROGRAM, "processor": cpu::processor(), "cases": rows })
}

fn method_json(row: &MethodRow) -> Value {
    let breaks = row.break_times.map(|errors| {
        json!({
            "compared": errors.breaks,
            "missing": errors.missing,
            "median_error": errors.median,
            "largest_error": errors.largest,
            "together": errors.together,
            "together_seconds": errors.together_seconds,
            "together_throughout": errors.together_throughout,
        })
    });
    json!({
        "V0": row.parameters.drive_velocity,
        "Delta": row.parameters.modulation_amplitude,
        "T": row.parameters.modulation_period,
        "method": method(row.solver),
        "setting": setting(row.solver),
        "cpu_per_simulated_second": row.cost.per_simulated_second,
        "cpu_per_slip": row.cost.per_slip,
        "cpu_per_step": row.cost.per_step,
        "steps_per_slip": row.cost.steps_per_slip,
        "timed_slips": row.cost.timed_slips,
        "is_extrapolated": row.cost.timed_slips == 0,
        "break_times": breaks,
        "ledger_residual": row.ledger_residual,
    })
}

fn distance_json(row: &DistanceRow) -> Value {
    let distance = |distance: super::distance::Distance| json!({ "value": distance.value, "low": distance.low, "high": distance.high, "floor": distance.floor });
    json!({
        "V0": row.parameters.drive_velocity,
        "Delta": row.parameters.modulation_amplitude,
        "T": row.parameters.modulation_period,
        "method": method(row.solver),
        "setting": setting(row.solver),
        "quantity": row.quantity.name(),
        "slips": row.sizes.0,
        "reference_slips": row.sizes.1,
        "mean": row.means.0,
        "reference_mean": row.means.1,
        "deviation": row.deviations.0,
        "reference_deviation": row.deviations.1,
        "wasserstein": distance(row.distances.wasserstein),
        "kolmogorov_smirnov": distance(row.distances.kolmogorov),
    })
}

/// Writes tables, JSON and figures into a folder, over those of an earlier study; returns the files.
///
/// # Errors
/// When a file cannot be written.
pub fn write(
    storage: &dyn Storage,
    folder: &Path,
    study: &Study,
    findings: &Findings,
) -> Result<Vec<PathBuf>, AccuracyError> {
    let footer = Footer::default().with("processor", &cpu::processor());
    let mut output = Output::begin(storage, folder)?;
    output.table(methods(), &footer, &findings.methods)?;
    output.table(distances(), &footer, &findings.distances)?;
    output.bytes("accuracy.json", as_json(study, findings).to_string().as_bytes())?;
    for &velocity in &study.velocities {
        for (name, picture) in figures(velocity, findings)? {
            output.bytes(&format!("{name}.svg"), picture.svg().as_bytes())?;
            output.bytes(&format!("{name}.png"), &picture.png()?)?;
        }
    }
    output.publish()
}

/// Writes the stability table into a folder; returns the files.
///
/// # Errors
/// When a file cannot be written.
pub fn write_stability(
    storage: &dyn Storage,
    folder: &Path,
    rows: &[Stability],
) -> Result<Vec<PathBuf>, AccuracyError> {
    let mut output = Output::begin(storage, folder)?;
    output.table(stability(), &Footer::default().with("processor", &cpu::processor()), rows)?;
    output.bytes("hard-cases.json", stability_json(rows).to_string().as_bytes())?;
    output.publish()
}

/// The figures at one velocity, each with its name: cost against the error of break times, and against the distance of τ.
fn figures(velocity: f64, findings: &Findings) -> Result<Vec<(String, Picture)>, AccuracyError> {
    const WORK: &str = "CPU time per slip (s), * extrapolated from that per step";
    let breaks = lines(
        &findings.methods,
        velocity,
        |row| &row.parameters,
        |row| {
            let errors = row.break_times?;
            let uncertainty = Some((errors.median, errors.largest));
            Some((row, WorkPrecision { error: errors.median, uncertainty, work: row.cost.per_slip }))
        },
    );
    let intervals: Vec<&DistanceRow> =
        findings.distances.iter().filter(|row| row.quantity == Quantity::Interval).collect();
    let slips = lines(
        &findings.methods,
        velocity,
        |row| &row.parameters,
        |row| {
            let same = |other: &&&DistanceRow| other.parameters == row.parameters && other.solver == row.solver;
            let distance = intervals.iter().find(same)?.distances.wasserstein;
            let uncertainty = Some((distance.low, distance.high));
            Some((row, WorkPrecision { error: distance.value, uncertainty, work: row.cost.per_slip }))
        },
    );
    let mut figures = Vec::new();
    for (name, label, lines) in [
        ("break-times", "median error of the first break times, up to the largest (s)", breaks),
        ("intervals", "Wasserstein-1 distance of the distribution of τ (s)", slips),
    ] {
        if !lines.is_empty() {
            figures.push((format!("work-precision-{name}-V0-{velocity:e}"), work_precision(label, WORK, &lines)?));
        }
    }
    Ok(figures)
}

/// A line per method and drive at this velocity.
fn lines<'a>(
    rows: &'a [MethodRow],
    velocity: f64,
    parameters: fn(&MethodRow) -> &Parameters,
    point: impl Fn(&'a MethodRow) -> Option<(&'a MethodRow, WorkPrecision)>,
) -> Vec<(String, Vec<WorkPrecision>)> {
    let mut lines: Vec<(String, Vec<WorkPrecision>)> = Vec::new();
    for (row, point) in rows.iter().filter(|row| parameters(row).drive_velocity == velocity).filter_map(point) {
        let drive = if row.parameters.modulation_amplitude > 0.0 { "Δ > 0" } else { "Δ = 0" };
        let cost = if row.cost.timed_slips == 0 { "*" } else { "" };
        let name = format!("{}{cost}, {drive}", method(row.solver));
        match lines.iter_mut().find(|(known, _)| *known == name) {
            Some((_, points)) => points.push(point),
            None => lines.push((name, vec![point])),
        }
    }
    lines
}

fn staging(folder: &Path) -> PathBuf {
    folder.join("staging")
}

/// Files on their way into a folder.
struct Output<'a> {
    storage: &'a dyn Storage,
    folder: &'a Path,
    commit: Commit<'a>,
    files: Vec<PathBuf>,
}

impl<'a> Output<'a> {
    fn begin(storage: &'a dyn Storage, folder: &'a Path) -> Result<Self, AccuracyError> {
        create_folder(storage, folder)?;
        let commit = Commit::begin(storage, &staging(folder))?;
        Ok(Self { storage, folder, commit, files: Vec::new() })
    }

    fn place(&mut self, name: &str) -> PathBuf {
        let file = self.folder.join(name);
        self.files.push(file.clone());
        file
    }

    fn table<Row>(&mut self, table: Table<Row>, footer: &Footer, rows: &[Row]) -> Result<(), AccuracyError> {
        let file = self.place(&format!("{}.parquet", table.name));
        let mut writer = TableWriter::create(self.storage, &self.commit.stage(&file), table, footer)?;
        for row in rows {
            writer.push(row)?;
        }
        Ok(writer.finish()?)
    }

    fn bytes(&mut self, name: &str, bytes: &[u8]) -> Result<(), AccuracyError> {
        let file = self.place(name);
        Ok(self.commit.stage_bytes(&file, bytes)?)
    }

    fn publish(self) -> Result<Vec<PathBuf>, AccuracyError> {
        self.commit.publish()?;
        // Empty now; should it not go, it does no harm.
        let _ = std::fs::remove_dir(staging(self.folder));
        Ok(self.files)
    }
}

#[cfg(test)]
mod tests {
    use super::super::breaks::BreakErrors;
    use super::super::distance::distances as measured;
    use super::super::study::Cost;
    use super::*;
    use crate::solver::Solver;
    use crate::store::dataset::Reader;
    use crate::store::storage::Disk;

    fn findings() -> Findings {
        let (parameters, solver) = (Parameters::default(), Solver::FixedStep { time_step: 1e-6 });
        let break_times = Some(BreakErrors {
            breaks: 100,
            missing: 0,
            median: 1e-7,
            largest: 1e-6,
            together: 140,
            together_seconds: 0.06,
            together_throughout: false,
        });
        let cost =
            Cost { per_simulated_second: 0.2, per_slip: 0.02, steps_per_slip: 1e5, per_step: 2e-7, timed_slips: 0 };
        let method =
            MethodRow { parameters: parameters.clone(), solver, cost, break_times, ledger_residual: Some(-1e-3) };
        let untested = MethodRow { break_times: None, ledger_residual: None, ..method.clone() };
        let distance = DistanceRow {
            parameters,
            solver,
            quantity: Quantity::Interval,
            sizes: (3, 3),
            means: (0.11, 0.11),
            deviations: (0.01, 0.01),
            distances: measured(&[0.1, 0.11, 0.12], &[0.1, 0.11, 0.13], 0).unwrap(),
        };
        Findings { methods: vec![method, untested], distances: vec![distance] }
    }

    #[test]
    fn a_study_is_written_as_tables_json_and_figures() {
        let folder = tempfile::tempdir().unwrap();
        let study = Study { velocities: vec![1e-4], ..Study::quick() };
        let files = write(&Disk, folder.path(), &study, &findings()).unwrap();
        let names: Vec<_> = files.iter().map(|file| file.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(
            names,
            [
                "methods.parquet",
                "distances.parquet",
                "accuracy.json",
                "work-precision-break-times-V0-1e-4.svg",
                "work-precision-break-times-V0-1e-4.png",
                "work-precision-intervals-V0-1e-4.svg",
                "work-precision-intervals-V0-1e-4.png"
            ]
        );
        assert!(files.iter().all(|file| file.is_file()));
        let rows: usize =
            Reader::new(&Disk, files[..1].to_vec(), None).map(|batch| batch.unwrap().rows.num_rows()).sum();
        assert_eq!(rows, 2);
        let json: Value = serde_json::from_slice(&std::fs::read(&files[2]).unwrap()).unwrap();
        assert_eq!(json["methods"][0]["is_extrapolated"], true);
        assert_eq!(json["methods"][1]["break_times"], Value::Null);
        assert_eq!(json["distances"][0]["quantity"], "interval");
        assert!(!folder.path().join("staging").exists(), "the staging folder must not stay");
    }
}
