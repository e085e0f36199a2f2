//! The reduction of a results directory: jobs once, slips as often as memory asks for, four files committed together.
//!
//! Sets stand in the order of their parameters and rows are summed in table order (file names, then rows), so the same
//! tables give the same bytes. Memory: a few hundred bytes per set, 8 bytes per job, 40 for each of [`MAX_SLIPS`] slips, and as
//! much again for those of the set at hand; where the tables hold more, the slips are read again for the next sets.

use super::PhaseLimits;
use super::backbone::{Backbone, BackboneBin};
use super::cells::{CellRow, cell_rows};
use super::histogram::{HistogramBin, histogram};
use super::point::{Point, RampStage, spacing};
use super::rounds::SetWriter;
use super::set::{SetJobs, SetRow, SetSlips};
use crate::model::{Symbol, Value};
use crate::observe::{Regime, Slip};
use crate::results::commit::{Commit, alone};
use crate::results::parts::committed_files;
use crate::results::tables::{All, JOBS, JobOutcome, SLIPS};
use crate::results::{Results, ResultsError};
use crate::table::columns::{Table, columns};
use crate::table::file::{Dataset, DatasetError, TableWriter};
use crate::table::selected::Selected;
use crate::table::shown::shown;
use crate::table::storage::StorageError;
use serde::Serialize;
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

/// Slips that are held at once: 170 MB.
const MAX_SLIPS: u64 = 1 << 22;
/// Name of the lock and of the staging folder of what is made from the tables: one process reduces or draws at a time.
pub const WRITER: &str = "reduce";
/// Version of [`ReductionSummary`] as JSON.
pub const SUMMARY_FORMAT: u32 = 1;

/// A directory that cannot be reduced.
#[derive(Debug, thiserror::Error)]
pub enum ReduceError {
    /// A table cannot be read, or reduced data cannot be written.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A folder or file cannot be prepared or put in its place.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The directory is not the one that was opened.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// There is nothing to reduce.
    #[error("{}: holds no jobs; is this a results directory, and has its sweep been run?", shown(tables))]
    NoJobs {
        /// Folder of the jobs table.
        tables: PathBuf,
    },
}

/// What a reduction found, in brief.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReductionSummary {
    pub format: u32,
    /// Jobs run to an end.
    pub jobs: u64,
    pub failed_jobs: u64,
    pub sets: u64,
    /// Sets with modulation whose phases are locked.
    pub locked_sets: u64,
    pub slips: u64,
    /// Points kept for scatter figures.
    pub points: u64,
    /// Bins of η.
    pub backbone: Vec<BackboneBin>,
}

/// Reduces the tables of a results directory to `reduced/{sets,histograms,backbone,points}.parquet`, over those
/// of an earlier reduction, with the sweep that was asked for last in their footers.
/// On an error, earlier reduced files stay whole.
pub fn reduce(results: &Results<'_>) -> Result<ReductionSummary, ReduceError> {
    reduce_by(results, MAX_SLIPS)
}

fn reduce_by(results: &Results<'_>, max_slips: u64) -> Result<ReductionSummary, ReduceError> {
    let layout = results.layout();
    let _alone = alone(layout, WRITER)?;
    let (commit, summary) = layout.read_tables(|| stage(results, max_slips))??;
    results.publish(commit)?;
    let cells = layout.reduced_file(CellRow::NAME);
    let is_refined = results.sweep().rounds().is_some_and(|rounds| rounds.refinement.is_some());
    if !is_refined && layout.storage.exists(&cells)? {
        // Of a sweep before.
        layout.storage.remove(&cells)?;
    }
    Ok(summary)
}

/// Reads the tables, and stages what they are reduced to.
fn stage<'a>(results: &Results<'a>, max_slips: u64) -> Result<(Commit<'a>, ReductionSummary), ReduceError> {
    let layout = results.layout();
    // Listed once: what other runs commit meanwhile is left out as a whole.
    let job_files = layout.dataset(JOBS)?;
    let slip_files = committed_files(layout, SLIPS, &job_files)?;
    let all_jobs = read_jobs(job_files)?;
    if all_jobs.is_empty() {
        return Err(ReduceError::NoJobs { tables: layout.table(JOBS) });
    }
    let total = all_jobs.iter().map(|set| set.slips).fold(0, u64::saturating_add);
    let mut summary = ReductionSummary {
        format: SUMMARY_FORMAT,
        jobs: all_jobs.iter().map(|set| set.finished).sum(),
        failed_jobs: all_jobs.iter().map(|set| set.failed).sum(),
        sets: all_jobs.len() as u64,
        locked_sets: 0,
        slips: 0,
        points: 0,
        backbone: Vec::new(),
    };

    layout.ensure_folder(&layout.reduced())?;
    let mut commit = Commit::begin(layout, &layout.staging(WRITER))?;
    let mut stage = |name: &str| commit.stage(&layout.reduced_file(name));
    let footer = &results.footer(results.extensions().len() - 1);
    let mut set_writer = SetWriter::new(results, stage(SetRow::NAME)?, footer)?;
    let refinement = results.sweep().rounds().and_then(|rounds| rounds.refinement.as_ref());
    let mut refined_sets = BTreeMap::new();
    let mut histogram_writer = TableWriter::new(stage(HistogramBin::NAME)?, footer)?;
    let mut backbone_writer = TableWriter::new(stage(BackboneBin::NAME)?, footer)?;
    let mut point_writer = TableWriter::new(stage(Point::NAME)?, footer)?;

    let (mut pooled, mut kept) = (Backbone::default(), Vec::new());
    for chunk in chunks(all_jobs, max_slips) {
        let gathered = gather(slip_files.clone(), chunk, spacing(total))?;
        for (jobs, slips, set_points) in gathered {
            let set = slips.finish(jobs);
            let row = &set.row;
            set_writer.push(row)?;
            if refinement.is_some() {
                refined_sets.extend(set_writer.chosen(row).map(|number| (number, row.clone())));
            }
            for bin in histogram(row, &set.intervals) {
                histogram_writer.push(&bin)?;
            }
            pooled.push(&set);
            summary.slips += row.slips;
            summary.locked_sets += u64::from(row.is_locked);
            kept.extend(
                set_points.into_iter().map(|(place, point)| (place, Point { is_locked: row.is_locked, ..point })),
            );
        }
    }
    kept.sort_by_key(|(place, _)| *place);
    summary.points = kept.len() as u64;
    for (_, point) in &kept {
        point_writer.push(point)?;
    }
    summary.backbone = pooled.finish();
    for bin in &summary.backbone {
        backbone_writer.push(bin)?;
    }
    if let Some(refinement) = refinement {
        let mut cell_writer = TableWriter::new(stage(CellRow::NAME)?, footer)?;
        let known = refined_sets.iter().map(|(&number, row)| (number, row)).collect();
        cell_rows(results.sweep(), refinement, &known).iter().try_for_each(|cell| cell_writer.push(cell))?;
        cell_writer.finish()?;
    }
    set_writer.finish()?;
    histogram_writer.finish()?;
    backbone_writer.finish()?;
    point_writer.finish()?;
    Ok((commit, summary))
}

columns! {
    /// The set of a job, and the job.
    pub(super) struct JobOfSet {
        set_id: String;
        facts: JobFacts;
    }
}

columns! {
    /// What a reduction takes from the jobs table beside set and parameters.
    pub(super) struct JobFacts {
        outcome: JobOutcome;
        slips: Option<u64>;
        mean_friction: Option<f64>;
        attached_fraction: Option<f64>;
        slip_share: Option<f64>;
        regime: Option<Regime>;
    }
}

columns! {
    /// The set of a slip.
    struct SetOfSlip {
        set_id: String;
    }
}

impl SetJobs {
    /// A job of the set has ended.
    pub(super) fn push(&mut self, job: &JobFacts) {
        if job.outcome == JobOutcome::Failed {
            self.failed += 1;
            return;
        }
        self.finished += 1;
        self.slips = self.slips.saturating_add(job.slips.unwrap_or(0));
        self.without_slips += u64::from(job.outcome == JobOutcome::NoSlips);
        self.friction.extend(job.mean_friction);
        self.attached_fraction.extend(job.attached_fraction);
        self.slip_share.extend(job.slip_share);
        self.regime = match (self.regime, job.regime) {
            (Some(regime), Some(other)) if regime != other => Some(Regime::Mixed),
            (regime, other) => other.or(regime),
        };
    }
}

/// The sets of all jobs, in the order of their parameters.
fn read_jobs(jobs: Dataset<'_>) -> Result<Vec<SetJobs>, DatasetError> {
    let mut sets: BTreeMap<String, SetJobs> = BTreeMap::new();
    for batch in jobs.rows::<(JobOfSet, Selected<All>)>() {
        for (job, parameters) in batch? {
            let new = |set_id: &String| SetJobs::new(set_id.clone(), parameters.parameters);
            let set = sets.entry(job.set_id).or_insert_with_key(new);
            set.push(&job.facts);
        }
    }
    let mut sets: Vec<SetJobs> = sets.into_values().collect();
    sets.sort_by(by_parameters);
    Ok(sets)
}

fn by_parameters(left: &SetJobs, right: &SetJobs) -> Ordering {
    let others = Symbol::ALL.into_iter().filter(|&symbol| symbol != Symbol::Seed);
    others
        .map(|symbol| match (left.parameters.get(symbol), right.parameters.get(symbol)) {
            (Value::Real(left), Value::Real(right)) => left.total_cmp(&right),
            (Value::Count(left), Value::Count(right)) => left.cmp(&right),
            (left, right) => left.to_string().cmp(&right.to_string()),
        })
        .find(|order| order.is_ne())
        .unwrap_or_else(|| left.set_id.cmp(&right.set_id))
}

/// Cuts the sets where their slips would exceed the most.
fn chunks(sets: Vec<SetJobs>, max_slips: u64) -> Vec<Vec<SetJobs>> {
    let mut chunks: Vec<Vec<SetJobs>> = Vec::new();
    let mut slips = 0;
    for set in sets {
        slips = set.slips.saturating_add(slips);
        match chunks.last_mut() {
            Some(chunk) if slips <= max_slips => chunk.push(set),
            _ => {
                slips = set.slips;
                chunks.push(vec![set]);
            }
        }
    }
    chunks
}

/// A set, its slips, and the points among them with their place in table order.
type Gathered = (SetJobs, SetSlips, Vec<(u64, Point)>);

/// Reads all slips and keeps those of these sets.
fn gather(slips: Dataset<'_>, sets: Vec<SetJobs>, spacing: u64) -> Result<Vec<Gathered>, DatasetError> {
    let index: HashMap<String, usize> =
        sets.iter().enumerate().map(|(index, set)| (set.set_id.clone(), index)).collect();
    let limits: Vec<PhaseLimits> = sets.iter().map(|set| PhaseLimits::at(set.parameters.eta())).collect();
    let mut gathered: Vec<Gathered> = sets.into_iter().map(|set| (set, SetSlips::default(), Vec::new())).collect();
    let mut place = 0;
    for batch in slips.rows::<(SetOfSlip, Slip)>() {
        for (SetOfSlip { set_id }, slip) in batch? {
            let here = place;
            place += 1;
            let Some(&index) = index.get(&set_id) else { continue };
            let (set, slips, points) = &mut gathered[index];
            let parameters = &set.parameters;
            let is_ramped = parameters.ramp_time > 0.0;
            let eta = slip.modulation.eta(parameters.drive_velocity);
            slips.push_of(parameters, &slip, &limits[index]);
            if here % spacing == 0 {
                let point = Point {
                    drive_velocity: parameters.drive_velocity,
                    amplitude: slip.modulation.amplitude,
                    period: slip.modulation.period,
                    eta,
                    ramp_stage: is_ramped.then(|| RampStage::at(slip.onset, parameters.ramp_time)),
                    onset: slip.onset,
                    interval: slip.interval,
                    periods: slip.periods,
                    phase: slip.phase,
                    is_locked: false,
                };
                points.push((here, point));
            }
        }
    }
    Ok(gathered)
}

#[cfg(test)]
mod tests {
    use super::super::read_reduced;
    use super::*;
    use crate::model::Parameters;
    use crate::observe::{Averages, Measurements, Modulation};
    use crate::results::layout::Layout;
    use crate::results::tables::{DriveAndSeed, JobRecord, JobRow, Label, Loading, Names, SlipRow, relabel};
    use crate::solver::Summary;
    use crate::sweep::Sweep;
    use crate::table::file::Footer;
    use crate::table::storage::{Disk, Storage};
    use std::fs;
    use std::path::Path;

    const PERIOD: f64 = 0.01;

    fn label(set: u32, seed: u64, amplitude: f64) -> Label<DriveAndSeed> {
        let parameters = Parameters {
            seed,
            modulation_amplitude: amplitude,
            modulation_period: Some(PERIOD),
            ..Parameters::default()
        };
        // Names not in the order of the parameters.
        let names = Names { job_id: format!("{set:016x}{seed:016x}"), set_id: format!("{:032x}", 100 - set) };
        let parameters = parameters.validated().unwrap();
        let eta = parameters.eta();
        (names, Selected::new(parameters), Loading { eta })
    }

    fn job_result((_, parameters, _): &Label<DriveAndSeed>, slips: u32) -> Measurements {
        let slip = |number: u32| Slip {
            number: u64::from(number),
            onset: f64::from(number) * 12.0 * PERIOD,
            interval: (number > 0).then_some(12.0 * PERIOD + 1e-5 * f64::from(number % 3)),
            phase: parameters.modulation_period.map(|_| -0.9 - 0.01 * f64::from(number % 7)),
            modulation: Modulation { period: parameters.modulation_period, amplitude: parameters.modulation_amplitude },
            periods: (number > 0).then_some(12),
            peak_force: 480.0,
            drop: 100.0 + f64::from(number),
            nucleation: 0.0,
            nucleation_block: 1,
            duration: 0.005,
            size: 1400,
            precursors: 2,
            ..Slip::default()
        };
        let summary = Summary { satisfied: true, ..Summary::default() };
        Measurements {
            slips: (0..slips).map(slip).collect(),
            averages: Some(Averages { friction: 430.0, ..Averages::default() }),
            summary,
            ..Measurements::default()
        }
    }

    fn without_jobs() -> (tempfile::TempDir, Results<'static>) {
        let root = tempfile::tempdir().unwrap();
        let sweep = Sweep::parse("name = \"test\"\n", Path::new("test.toml")).unwrap();
        let results = Results::open(&Layout::new(&Disk, root.path()), &sweep).unwrap();
        (root, results)
    }

    /// Two parts, three sets of two seeds, one failed job; the slips of a third part are without their jobs.
    fn directory(slips: u32) -> (tempfile::TempDir, Results<'static>) {
        let (root, results) = without_jobs();
        let layout = results.layout();
        fs::create_dir_all(layout.table("slips")).unwrap();
        fs::create_dir_all(layout.table("jobs")).unwrap();
        for part in 0..3 {
            let name = format!("part-000-{part:06}.parquet");
            let path = layout.table("slips").join(&name);
            let file = Disk.create(&path).unwrap();
            let mut slip_writer = TableWriter::<SlipRow<'_>>::new(file, &Footer::default()).unwrap();
            let labels: Vec<Label<DriveAndSeed>> =
                (0..3).map(|set| label(set, part, [0.0, 1e-6, 2e-6][set as usize])).collect();
            let measured: Vec<Measurements> = labels.iter().map(|label| job_result(label, slips)).collect();
            for (job, result) in labels.iter().zip(&measured) {
                result.slips.iter().for_each(|slip| slip_writer.push(&(job, slip)).unwrap());
            }
            slip_writer.finish().unwrap();
            if part < 2 {
                let path = layout.table("jobs").join(&name);
                let file = Disk.create(&path).unwrap();
                let mut job_writer = TableWriter::<JobRow>::new(file, &Footer::default()).unwrap();
                for (job, result) in labels.iter().zip(&measured) {
                    job_writer.push(&(relabel(job), JobRecord::new(Ok(result)))).unwrap();
                }
                let failed = label(2, 77, 2e-6);
                job_writer.push(&(relabel(&failed), JobRecord::new(Err("out of budget")))).unwrap();
                job_writer.finish().unwrap();
            }
        }
        (root, results)
    }

    fn reduced_bytes(layout: &Layout<'_>) -> Vec<Vec<u8>> {
        ["sets", "histograms", "backbone", "points"]
            .map(|name| fs::read(layout.reduced_file(name)).unwrap())
            .to_vec()
    }

    #[test]
    fn every_committed_slip_is_counted_once_and_no_other() {
        let (_root, results) = directory(20);
        let summary = reduce(&results).unwrap();
        assert_eq!((summary.jobs, summary.failed_jobs, summary.sets), (6, 2, 3));
        assert_eq!((summary.slips, summary.points, summary.locked_sets), (120, 120, 2));
        assert_eq!(summary.backbone.iter().map(|bin| bin.slips).sum::<u64>(), 80);
        let sets: Vec<SetRow> = read_reduced(results.layout()).unwrap();
        let counts = |set: &SetRow| (set.parameters.modulation_amplitude, set.intervals, set.failed_jobs);
        assert_eq!(sets.iter().map(counts).collect::<Vec<_>>(), [(0.0, 38, 0), (1e-6, 38, 0), (2e-6, 38, 2)]);
        assert!((sets[1].mean_friction.unwrap() - 430.0).abs() < 1e-9);
        assert!((sets[1].periods_mean.unwrap() - 12.0).abs() < 0.01);
    }

    #[test]
    fn reading_in_several_passes_changes_nothing() {
        let (_root, results) = directory(50);
        let layout = results.layout();
        let whole = reduce(&results).unwrap();
        let bytes = reduced_bytes(layout);
        let passes = reduce_by(&results, 1).unwrap();
        assert_eq!(passes, whole);
        assert!(reduced_bytes(layout) == bytes);
        assert!(Disk.list(&layout.staging(WRITER)).unwrap().is_empty());
    }

    #[test]
    fn of_many_slips_every_kth_becomes_a_point() {
        let (_root, results) = directory(5000);
        let summary = reduce(&results).unwrap();
        assert_eq!((summary.slips, summary.points), (30_000, 15_000));
    }

    #[test]
    fn a_directory_without_jobs_is_refused() {
        let (_root, results) = without_jobs();
        let error = reduce(&results).unwrap_err();
        assert!(error.to_string().contains("holds no jobs"), "{error}");
    }
}
