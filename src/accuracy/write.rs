//! What a study leaves behind: tables as Parquet, everything as JSON, and the figures, put in place together.

use super::distance::Distance;
use super::scaling::{ScalingFindings, SizeRow, growing};
use super::study::{Findings, MethodRow, Quantity, Study};
use super::tables::method;
use super::{AccuracyError, Stability, cpu};
use crate::figure::{ErrorPanel, Growth, Line, Picture, WorkPrecision, scaling, work_precision};
use crate::model::Symbol;
use crate::results::commit::{Commit, create_folder};
use crate::table::arrow;
use crate::table::columns::{Row, Table};
use crate::table::file::{Footer, PROGRAM, TableWriter};
use crate::table::storage::Storage;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Version of the JSON.
const FORMAT: u32 = 3;

/// The findings of a study as JSON.
#[must_use]
pub fn as_json(study: &Study, findings: &Findings) -> Value {
    document(json!({
        "seeds": study.seeds,
        "first_drive_multiple": study.first_drive_multiple,
        "slips": study.slips,
        "breaks": study.breaks,
        "followed_breaks": study.followed_breaks,
        "methods": rows(&findings.methods),
        "distances": rows(&findings.distances),
    }))
}

/// Scaling as JSON.
#[must_use]
pub fn scaling_json(findings: &ScalingFindings) -> Value {
    document(json!({
        "sizes": rows(&findings.sizes),
        "exponents": rows(&findings.exponents),
    }))
}

/// The stability table as JSON.
#[must_use]
pub fn stability_json(cases: &[Stability]) -> Value {
    document(json!({ "cases": rows(cases) }))
}

/// Adds what every document begins with.
fn document(mut fields: Value) -> Value {
    fields["format"] = FORMAT.into();
    fields["program"] = PROGRAM.into();
    fields["processor"] = cpu::processor().into();
    fields
}

fn rows<R: Row>(rows: &[R]) -> Value {
    rows.iter().map(arrow::json).collect()
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
    let mut output = Output::begin(storage, folder)?;
    output.table(&findings.methods)?;
    output.table(&findings.distances)?;
    output.json("accuracy.json", &as_json(study, findings))?;
    for &velocity in &study.velocities {
        output.picture(&format!("work-precision-V0-{velocity:e}"), &figure(velocity, findings)?)?;
    }
    output.publish()
}

/// Writes tables, JSON and figure of a scaling into a folder; returns the files.
///
/// # Errors
/// When a file cannot be written.
pub fn write_scaling(
    storage: &dyn Storage,
    folder: &Path,
    findings: &ScalingFindings,
) -> Result<Vec<PathBuf>, AccuracyError> {
    let mut output = Output::begin(storage, folder)?;
    output.table(&findings.sizes)?;
    output.table(&findings.exponents)?;
    output.json("scaling.json", &scaling_json(findings))?;
    output.picture("scaling", &scaling_figure(findings)?)?;
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
    output.table(rows)?;
    output.json("hard-cases.json", &stability_json(rows))?;
    output.publish()
}

/// The figure at one velocity: cost against the error of break times, and against distances of distributions from those of
/// the reference, in units of the distance that chance alone stays under.
fn figure(velocity: f64, findings: &Findings) -> Result<Picture, AccuracyError> {
    const WORK: &str = "CPU time per slip (s), * extrapolated from that per step";
    let breaks = lines(&findings.methods, velocity, |row| {
        let (error, largest) = (row.break_times.median?, row.break_times.largest?);
        Some(WorkPrecision { error, uncertainty: Some((error, largest)), work: row.cost.per_slip })
    });
    let label = "First break times, error (s)".to_owned();
    let mut panels = vec![ErrorPanel { label, by_chance: None, methods: breaks }];
    for (quantity, name) in [(Quantity::Interval, "τ"), (Quantity::FrontSpeed, "front speed")] {
        let methods = lines(&findings.methods, velocity, |row| {
            let Distance { value, low, high, floor } = findings.distances_of(row, quantity)?.wasserstein;
            let uncertainty = Some((low / floor, high / floor));
            Some(WorkPrecision { error: value / floor, uncertainty, work: row.cost.per_slip })
        });
        panels.push(ErrorPanel { label: format!("W₁ of {name} / chance"), by_chance: Some(1.0), methods });
    }
    panels.retain(|panel| !panel.methods.is_empty());
    Ok(work_precision(WORK, &panels)?)
}

/// A line per method and drive at this velocity.
fn lines(
    rows: &[MethodRow],
    velocity: f64,
    point: impl Fn(&MethodRow) -> Option<WorkPrecision>,
) -> Vec<(String, Vec<WorkPrecision>)> {
    let mut lines: Vec<(String, Vec<WorkPrecision>)> = Vec::new();
    for row in rows.iter().filter(|row| row.parameters.drive_velocity == velocity) {
        let Some(point) = point(row) else { continue };
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

/// Costs, steps and breaks over either size, a line per tolerance.
fn scaling_figure(findings: &ScalingFindings) -> Result<Picture, AccuracyError> {
    let mut tolerances: Vec<f64> = findings.sizes.iter().map(|row| row.tolerance).collect();
    tolerances.sort_by(|a, b| b.total_cmp(a));
    tolerances.dedup();
    let lines = |size, name: &str, value: fn(&SizeRow) -> f64| {
        let points = |tolerance| growing(size, tolerance, &findings.sizes).map(|(count, row)| (count, value(row)));
        tolerances.iter().map(|&tolerance| (format!("{name} {tolerance:e}"), points(tolerance).collect())).collect()
    };
    let columns = [(Symbol::N, "Blocks N"), (Symbol::Ns, "Contacts per block Nₛ")].map(|(size, label)| {
        let mut counts: Vec<Line> = lines(size, "steps,", |row| row.cost.steps_per_slip);
        // Breaks hardly depend on the tolerance.
        let breaks: Vec<Line> = lines(size, "breaks,", |row| row.breaks_per_slip);
        counts.extend(breaks.into_iter().take(1).map(|(_, points)| ("breaks".to_owned(), points)));
        Growth { label: label.to_owned(), costs: lines(size, "tolerance", |row| row.cost.per_slip), counts }
    });
    Ok(scaling(&columns)?)
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

    fn table<R: Table>(&mut self, rows: &[R]) -> Result<(), AccuracyError> {
        let footer = Footer::default().with("processor", &cpu::processor());
        let file = self.place(&format!("{}.parquet", R::NAME));
        let mut writer = TableWriter::create(self.storage, &self.commit.stage(&file), &footer)?;
        for row in rows {
            writer.push(row)?;
        }
        Ok(writer.finish()?)
    }

    fn bytes(&mut self, name: &str, bytes: &[u8]) -> Result<(), AccuracyError> {
        let file = self.place(name);
        Ok(self.commit.stage_bytes(&file, bytes)?)
    }

    fn json(&mut self, name: &str, value: &Value) -> Result<(), AccuracyError> {
        self.bytes(name, value.to_string().as_bytes())
    }

    fn picture(&mut self, name: &str, picture: &Picture) -> Result<(), AccuracyError> {
        self.bytes(&format!("{name}.svg"), picture.svg().as_bytes())?;
        self.bytes(&format!("{name}.png"), &picture.png()?)
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
    use super::super::study::DistanceRow;
    use super::*;
    use crate::model::Parameters;
    use crate::solver::Solver;
    use crate::table::columns::Selected;
    use crate::table::file::Reader;
    use crate::table::storage::Disk;

    fn findings() -> Findings {
        let (parameters, solver) = (Parameters::default(), Solver::FixedStep { time_step: 1e-6 });
        let break_times = BreakErrors {
            breaks: Some(100),
            missing: Some(0),
            median: Some(1e-7),
            largest: Some(1e-6),
            together: Some(140),
            together_seconds: Some(0.06),
            together_throughout: false,
        };
        let cost = cpu::Cost {
            per_simulated_second: 0.2,
            per_slip: 0.02,
            steps_per_slip: 1e5,
            per_step: 2e-7,
            timed_slips: 0,
        };
        let method = MethodRow {
            parameters: Selected::new(parameters.clone()),
            solver,
            cost,
            cost_spread: 1.0,
            break_times,
            ledger_residual: Some(-1e-3),
        };
        let untested = MethodRow { break_times: BreakErrors::default(), ledger_residual: None, ..method.clone() };
        let distance = DistanceRow {
            parameters: Selected::new(parameters),
            solver,
            quantity: Quantity::Interval,
            slips: 3,
            reference_slips: 3,
            mean: 0.11,
            reference_mean: 0.11,
            deviation: 0.01,
            reference_deviation: 0.01,
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
                "work-precision-V0-1e-4.svg",
                "work-precision-V0-1e-4.png"
            ]
        );
        assert!(files.iter().all(|file| file.is_file()));
        let rows: usize = Reader::new(&Disk, files[..1].to_vec()).map(|batch| batch.unwrap().rows.num_rows()).sum();
        assert_eq!(rows, 2);
        let json: Value = serde_json::from_slice(&std::fs::read(&files[2]).unwrap()).unwrap();
        assert_eq!(json["methods"][0]["timed_slips"], 0);
        assert_eq!((&json["methods"][0]["median_break_error"], &json["methods"][0]["T"]), (&json!(1e-7), &Value::Null));
        assert_eq!(json["methods"][1]["median_break_error"], Value::Null);
        assert_eq!(json["distances"][0]["quantity"], "interval");
        assert!(!folder.path().join("staging").exists(), "the staging folder must not stay");
    }

    #[test]
    fn every_field_of_the_json_is_documented() {
        let page = include_str!("../../docs/results.md");
        let documents = [
            ("accuracy", as_json(&Study::quick(), &findings())),
            ("accuracy --scaling", scaling_json(&ScalingFindings::default())),
            ("accuracy --hard-cases", stability_json(&[])),
        ];
        for (command, document) in documents {
            let row = page.lines().find(|line| line.starts_with(&format!("| `{command}` |"))).unwrap();
            for field in document.as_object().unwrap().keys() {
                assert!(row.contains(&format!("`{field}`")), "{command}: {field}");
            }
        }
    }

    #[test]
    fn a_scaling_is_drawn_whatever_the_order_of_its_rows_and_not_without_any() {
        let row = |blocks, tolerance| SizeRow {
            parameters: Selected::new(Parameters { blocks, ..Parameters::default() }),
            tolerance,
            cost: cpu::Cost { per_slip: 0.01, steps_per_slip: 1e4, ..cpu::Cost::default() },
            leaps_per_slip: 100.0,
            breaks_per_slip: 3e3,
            reattachments_per_slip: 3e3,
        };
        let sizes = vec![row(70, 1e-10), row(70, 1e-6), row(140, 1e-10), row(140, 1e-6)];
        let svg = scaling_figure(&ScalingFindings { sizes, exponents: Vec::new() }).unwrap().svg();
        for name in ["tolerance 1e-6", "tolerance 1e-10", "steps, 1e-6", "steps, 1e-10", "breaks"] {
            assert_eq!(svg.matches(&format!(">{name}<")).count(), 1, "{name}");
        }
        assert!(matches!(scaling_figure(&ScalingFindings::default()), Err(AccuracyError::Figure(_))));
    }
}
