//! The reduction of a results directory: four tables, committed together. Sets stand in the order of their parameters, so the
//! same tables give the same bytes.

use super::backbone::{Backbone, BackboneBin};
use super::crossings::{EdgeRow, edge_rows};
use super::gather::{Gathering, MAX_SLIPS};
use super::histogram::{HistogramBin, histogram};
use super::reduced::{SOURCE, source};
use super::sample::{Point, spacing};
use super::set::SetRow;
use super::set_writer::SetWriter;
use crate::results::Results;
use crate::results::commit::{Commit, exclusive_lock};
use crate::results::tables::JOBS;
use crate::table::columns::Table;
use crate::table::file::TableWriter;
use crate::table::shown::shown;
use anyhow::{Result, bail};
use serde::Serialize;
use std::path::PathBuf;

/// Name of the lock and of the staging folder of what is made from the tables: one process reduces or draws at a time.
pub const WRITER: &str = "reduce";

#[derive(Debug, thiserror::Error)]
#[error(
    "{}: holds no jobs; is this a results directory, and has its sweep been run?",
    shown(tables)
)]
pub struct NoJobs {
    /// Folder of the jobs table.
    tables: PathBuf,
}

/// What a reduction found, in brief.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ReductionSummary {
    /// Jobs run to an end.
    pub jobs: u64,
    pub failed_jobs: u64,
    /// Controls left out, as in all that follows.
    pub sets: u64,
    pub phased_sets: u64,
    pub slips: u64,
    /// Points kept for scatter figures.
    pub points: u64,
    pub backbone: Vec<BackboneBin>,
}

/// Reduces the tables of a results directory to `reduced/{sets,histograms,backbone,points}.parquet`, over those
/// of an earlier reduction, with the sweep that was asked for last in their footers.
/// On an error, earlier reduced files stay whole.
pub fn reduce(results: &Results<'_>) -> Result<ReductionSummary> {
    reduce_by(results, MAX_SLIPS)
}

fn reduce_by(results: &Results<'_>, max_slips: u64) -> Result<ReductionSummary> {
    let layout = results.layout();
    let _alone = exclusive_lock(layout, WRITER)?;
    let (commit, summary) = stage(results, max_slips)?;
    results.publish(commit)?;
    let edges = layout.reduced_file(EdgeRow::NAME);
    if results.sweep().refinement().is_none() && layout.storage.exists(&edges)? {
        // Left by an earlier sweep.
        layout.refuse_link(&edges)?;
        layout.storage.remove(&edges)?;
    }
    Ok(summary)
}

/// Reads the tables, and stages what they are reduced to.
fn stage<'a>(results: &Results<'a>, max_slips: u64) -> Result<(Commit<'a>, ReductionSummary)> {
    let layout = results.layout();
    // In this order: what is committed in between makes these data old.
    let footer = &results.footer_of_all().with(SOURCE, &source(results)?);
    let gathering = Gathering::of_jobs(results, &|_| true)?;
    let all_jobs = &gathering.sets;
    if all_jobs.is_empty() {
        bail!(NoJobs {
            tables: layout.table(JOBS)
        });
    }
    let slips = all_jobs.iter().map(|set| set.slips);
    let total = slips.fold(0, u64::saturating_add);
    let mut summary = ReductionSummary {
        jobs: all_jobs.iter().map(|set| set.finished).sum(),
        failed_jobs: all_jobs.iter().map(|set| set.failed).sum(),
        ..ReductionSummary::default()
    };

    layout.ensure_folder(&layout.reduced())?;
    let mut commit = Commit::begin(layout, &layout.staging(WRITER))?;
    let mut stage = |name: &str| commit.stage(&layout.reduced_file(name));
    let at = |name: &str| footer.clone().at(&layout.reduced_file(name));
    let mut set_writer = SetWriter::new(results, stage(SetRow::NAME)?, &at(SetRow::NAME))?;
    let mut histogram_writer =
        TableWriter::new(stage(HistogramBin::NAME)?, &at(HistogramBin::NAME))?;
    let mut backbone_writer = TableWriter::new(stage(BackboneBin::NAME)?, &at(BackboneBin::NAME))?;
    let mut point_writer = TableWriter::new(stage(Point::NAME)?, &at(Point::NAME))?;

    let mut pooled = Backbone::default();
    let mut kept = Vec::new();
    gathering.each_set(max_slips, spacing(total), |set, explained| {
        let (set, points) = set.finish_with(explained);
        let row = &set.row;
        set_writer.push(row)?;
        if row.is_control {
            return Ok(());
        }
        summary.sets += 1;
        for bin in histogram(row, &set.intervals) {
            histogram_writer.push(&bin)?;
        }
        pooled.push(&set);
        summary.slips += row.slips;
        summary.phased_sets += u64::from(row.has_phase);
        for (place, mut point) in points {
            point.has_phase = row.has_phase;
            kept.push((place, point));
        }
        Ok(())
    })?;
    kept.sort_by_key(|(place, _)| *place);
    summary.points = kept.len() as u64;
    for (_, point) in &kept {
        point_writer.push(point)?;
    }
    summary.backbone = pooled.finish();
    for bin in &summary.backbone {
        backbone_writer.push(bin)?;
    }
    if let Some(refinement) = results.sweep().refinement() {
        let mut edge_writer = TableWriter::new(stage(EdgeRow::NAME)?, &at(EdgeRow::NAME))?;
        for edge in edge_rows(results, refinement)? {
            edge_writer.push(&edge)?;
        }
        edge_writer.finish()?;
    }
    set_writer.finish()?;
    histogram_writer.finish()?;
    backbone_writer.finish()?;
    point_writer.finish()?;
    Ok((commit, summary))
}

#[cfg(test)]
mod tests {
    use super::super::read_reduced;
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;
    use crate::observe::{Averages, Measurements, Modulation, Slip};
    use crate::results::layout::Layout;
    use crate::results::tables::{
        DriveAndSeed, JobLabel, JobRecord, JobRow, Loading, Names, SlipRow, relabel,
    };
    use crate::results::workers::tests::open;
    use crate::solver::Summary;
    use crate::sweep::Sweep;
    use crate::table::file::Footer;
    use crate::table::storage::{Disk, Storage};
    use std::borrow::Cow;
    use std::fs;
    use std::path::Path;

    const PERIOD: f64 = 0.01;

    fn label(set: u32, seed: u64, amplitude: f64) -> JobLabel<DriveAndSeed> {
        let parameters = Parameters {
            seed,
            modulation_amplitude: amplitude,
            modulation_period: Some(PERIOD),
            ..Parameters::default()
        };
        // Names not in the order of the parameters.
        let names = Names {
            job_id: format!("{set:016x}{seed:016x}"),
            set_id: format!("{:032x}", 100 - set),
        };
        let parameters = parameters.validated().unwrap();
        let loading = Loading::of(&parameters);
        (names, Selected::new(parameters), loading)
    }

    fn job_result((_, parameters, _): &JobLabel<DriveAndSeed>, slips: u32) -> Measurements {
        let slip = |number: u32| Slip {
            number: u64::from(number),
            onset: f64::from(number) * 12.0 * PERIOD,
            interval: (number > 0).then_some(12.0 * PERIOD + 1e-5 * f64::from(number % 3)),
            phase: parameters
                .modulation_period
                .map(|_| -0.9 - 0.01 * f64::from(number % 7)),
            modulation: Modulation {
                period: parameters.modulation_period,
                amplitude: parameters.modulation_amplitude,
            },
            periods: (number > 0).then_some(12),
            peak_force: 480.0,
            drop: 100.0 + f64::from(number) + 0.1 * parameters.seed as f64,
            nucleation: 0.0,
            nucleation_block: 1,
            duration: 0.005,
            size: 1400,
            precursors: 2,
            ..Slip::default()
        };
        let summary = Summary {
            satisfied: true,
            ..Summary::default()
        };
        Measurements {
            slips: (0..slips).map(slip).collect(),
            averages: Some(Averages {
                time: 1.0,
                friction: 430.0,
                attached_fraction: 0.7 + 0.01 * parameters.seed as f64,
                ..Averages::default()
            }),
            summary,
            ..Measurements::default()
        }
    }

    fn without_jobs() -> (tempfile::TempDir, Results<'static>) {
        let root = tempfile::tempdir().unwrap();
        let sweep = Sweep::parse("name = \"test\"\n", Path::new("test.toml")).unwrap();
        let results = open(&Layout::new(&Disk, root.path()), &sweep).unwrap();
        (root, results)
    }

    /// Two parts, three sets of two seeds, one failed job; the slips of a third part are without their jobs.
    fn directory(slips: u32) -> (tempfile::TempDir, Results<'static>) {
        directory_of(slips, [0, 1, 2])
    }

    /// The same with these seeds of its parts.
    fn directory_of(slips: u32, seeds: [u64; 3]) -> (tempfile::TempDir, Results<'static>) {
        let (root, results) = without_jobs();
        let layout = results.layout();
        fs::create_dir_all(layout.table("slips")).unwrap();
        fs::create_dir_all(layout.table("jobs")).unwrap();
        for (part, seed) in (0..).zip(seeds) {
            let name = format!("part-000-{part:06}.parquet");
            let path = layout.table("slips").join(&name);
            let file = Disk.create(&path).unwrap();
            let mut slip_writer =
                TableWriter::<SlipRow<'_>>::new(file, &Footer::default()).unwrap();
            let labels: Vec<JobLabel<DriveAndSeed>> = (0..3)
                .map(|set| label(set, seed, [0.0, 1e-6, 2e-6][set as usize]))
                .collect();
            let measured: Vec<Measurements> = labels
                .iter()
                .map(|label| job_result(label, slips))
                .collect();
            for (job, result) in labels.iter().zip(&measured) {
                for slip in &result.slips {
                    let row = (Cow::Borrowed(job), Cow::Borrowed(slip));
                    slip_writer.push(&row).unwrap();
                }
            }
            slip_writer.finish().unwrap();
            if part < 2 {
                let path = layout.table("jobs").join(&name);
                let file = Disk.create(&path).unwrap();
                let mut job_writer = TableWriter::<JobRow>::new(file, &Footer::default()).unwrap();
                for (job, result) in labels.iter().zip(&measured) {
                    job_writer
                        .push(&(relabel(job), JobRecord::new(Ok(result))))
                        .unwrap();
                }
                let failed = label(2, 77, 2e-6);
                job_writer
                    .push(&(relabel(&failed), JobRecord::new(Err("out of budget"))))
                    .unwrap();
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
        assert_eq!(
            (summary.slips, summary.points, summary.phased_sets),
            (120, 120, 2)
        );
        assert_eq!(
            summary.backbone.iter().map(|bin| bin.slips).sum::<u64>(),
            80
        );
        let sets: Vec<SetRow> = read_reduced(results.layout()).unwrap();
        let counts = |set: &SetRow| {
            (
                set.parameters.modulation_amplitude,
                set.intervals,
                set.failed_jobs,
            )
        };
        assert_eq!(
            sets.iter().map(counts).collect::<Vec<_>>(),
            [(0.0, 38, 0), (1e-6, 38, 0), (2e-6, 38, 2)]
        );
        assert!((sets[1].mean_friction.unwrap() - 430.0).abs() < 1e-9);
        assert_eq!(sets[1].periods, Some(12));
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
    fn no_digit_depends_on_the_order_in_which_seeds_were_run() {
        let of_seeds = |seeds, max_slips| {
            let (_root, results) = directory_of(50, seeds);
            reduce_by(&results, max_slips).unwrap();
            let sets: Vec<SetRow> = read_reduced(results.layout()).unwrap();
            sets
        };
        let ascending = of_seeds([1, 6, 9], MAX_SLIPS);
        assert_eq!(of_seeds([6, 1, 9], MAX_SLIPS), ascending);
        assert_eq!(of_seeds([6, 1, 9], 1), ascending);
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
