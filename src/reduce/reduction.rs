//! The reduction of a results directory: sets, histograms of τ (Fig. 2), backbone, points and edges, committed
//! together. Sets stand in the order of their parameters, so the same tables give the same bytes. Sets of an adaptive
//! sweep have further columns: the rounds in which a set ran, and whether it is as precise as is wanted.
//!
//! Reduced data are up to date by the content of the tables that they were made from, as a copied folder has other
//! times.

use super::backbone::{Backbone, BackboneBin};
use super::crossings::edge_rows;
use super::gather::{Gathering, MAX_SLIPS, Point, spacing};
use super::triggers::{note_noise, pulse_rows, trigger_rows};
use crate::results::commit::Commit;
use crate::results::layout::Layout;
use crate::results::tables::{OptionalTable, RecordedTable, gaps};
use crate::results::{ErrorKind, Results, ResultsError};
use crate::sets::SetRow;
use crate::sweep::{Goal, Precision, Sweep, Target};
use crate::table::arrow::Gaps;
use crate::table::checksum::hexadecimal;
use crate::table::columns::{Row, columns};
use crate::table::file::{DataFile, Dataset, Footer, TableWriter};
use crate::table::shown::shown;
use crate::table::storage::StorageError;
use crate::table::{Table, tables};
use anyhow::{Result, bail};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::collections::HashMap;
use std::io;
use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
#[error(
    "{}: holds no jobs; is this a results directory, and has its sweep been run?",
    shown(tables)
)]
pub struct NoJobs {
    tables: PathBuf,
}

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
    let (commit, summary) = stage(results, max_slips)?;
    results.publish(commit)?;
    for table in OptionalTable::ALL {
        let file = layout.reduced_file(table.word());
        if !results.has(table) && layout.storage.exists(&file)? {
            // Left by an earlier sweep.
            layout.remove(&file)?;
        }
    }
    Ok(summary)
}

/// Reads the tables, and stages what they are reduced to.
fn stage<'a>(results: &Results<'a>, max_slips: u64) -> Result<(Commit<'a>, ReductionSummary)> {
    let layout = results.layout();
    // In this order: what is committed in between makes these data old.
    let footer = results.footer_of_all().with(SOURCE, &source(results)?);
    let gathering = Gathering::of_jobs(results, &|_| true)?;
    let all_jobs = &gathering.sets;
    if all_jobs.is_empty() {
        bail!(NoJobs {
            tables: layout.table(RecordedTable::Jobs)
        });
    }
    let slips = all_jobs.iter().map(|set| set.slips);
    let total = slips.fold(0, u64::saturating_add);
    let mut summary = ReductionSummary {
        jobs: all_jobs.iter().map(|set| set.finished.len() as u64).sum(),
        failed_jobs: all_jobs.iter().map(|set| set.failed).sum(),
        ..ReductionSummary::default()
    };

    layout.ensure_folder(&layout.reduced())?;
    let mut staged = Staged {
        layout,
        commit: Commit::begin(layout)?,
        footer,
    };
    let rounds = RoundsOfSets::of(results);
    let mut set_writer = staged.begin::<SetInRounds>(&Gaps {
        left_out: rounds.left_out(),
        ..gaps(results.sweep())
    })?;
    let mut histogram_writer = staged.begin::<HistogramBin>(&Gaps::default())?;
    let mut triggers = Vec::new();
    let mut pooled = Backbone::default();
    let mut kept = Vec::new();
    gathering.each_set(max_slips, spacing(total), |set, explained| {
        triggers.extend(trigger_rows(&set, explained));
        let (set, points) = set.finish_with(explained);
        let row = &set.row;
        set_writer.push(&(row.clone(), rounds.of_set(row)))?;
        if row.is_control {
            return Ok(());
        }
        summary.sets += 1;
        summary.slips += row.slips;
        if row.parameters.pulse_start.is_some() {
            return Ok(());
        }
        for bin in histogram(row, &set.intervals) {
            histogram_writer.push(&bin)?;
        }
        pooled.push(&set);
        summary.phased_sets += u64::from(row.has_phase);
        for (place, mut point) in points {
            point.has_phase = row.has_phase;
            kept.push((place, point));
        }
        Ok(())
    })?;
    set_writer.finish()?;
    histogram_writer.finish()?;
    summary.backbone = pooled.finish();
    staged.write(summary.backbone.iter().copied())?;
    kept.sort_by_key(|(place, _)| *place);
    summary.points = kept.len() as u64;
    staged.write(kept.into_iter().map(|(_, point)| point))?;
    if results.has(OptionalTable::Triggers) {
        note_noise(&mut triggers);
        staged.write(pulse_rows(&triggers))?;
        staged.write(triggers)?;
    }
    if let Some(refinement) = results.sweep().refinement() {
        staged.write(edge_rows(results, refinement)?)?;
    }
    Ok((staged.commit, summary))
}

/// Reduced tables on the way to their places.
struct Staged<'r, 'a> {
    layout: &'r Layout<'a>,
    commit: Commit<'a>,
    footer: Footer,
}

impl Staged<'_, '_> {
    fn begin<R: Table>(&mut self, gaps: &Gaps) -> Result<TableWriter<R>, ResultsError> {
        let file = self.layout.reduced_file(R::NAME);
        let footer = self.footer.clone().at(&file);
        TableWriter::new(gaps, &file, self.commit.stage(&file)?, &footer)
    }

    fn write<R: Table>(&mut self, rows: impl IntoIterator<Item = R>) -> Result<(), ResultsError> {
        let mut writer = self.begin(&Gaps::default())?;
        for row in rows {
            writer.push(&row)?;
        }
        writer.finish().map(drop)
    }
}

columns! {
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct RoundOfSet {
        first_round: Option<u64> = "", "round in which the set began, from 1; null if the present sweep has not chosen it";
        last_round: Option<u64> = "", "round that gave it its last seeds";
        seeds: Option<u64> = "", "seeds that the rounds have given it";
        target_met: Option<bool> = "",
            "whether every statistic with a target meets it; null without any value";
    }
}

tables! {
    RoundOfSet = "sets of a sweep in rounds", "Further columns of `sets`, if the sweep has `[precision]` or `[refine]`";
}

pub type SetInRounds = (SetRow, RoundOfSet);

tables! { SetInRounds = SetRow::NAME, SetRow::MEANING; }

/// How the sets that the rounds of a sweep have chosen came about, by their numbers.
struct RoundsOfSets<'a> {
    sweep: &'a Sweep,
    of_sets: HashMap<u64, RoundOfSet>,
}

impl<'a> RoundsOfSets<'a> {
    fn of(results: &'a Results<'_>) -> Self {
        let sweep = results.sweep();
        let mut of_sets: HashMap<u64, RoundOfSet> = HashMap::new();
        for (round, extension) in (1..).zip(results.rounds()) {
            let rounds = extension.round.iter();
            let points = rounds.flat_map(|round| round.points.iter().cloned().flatten());
            for set in points.map(|point| sweep.set_of(point)) {
                let of_set = of_sets.entry(set).or_default();
                of_set.first_round.get_or_insert(round);
                of_set.last_round = Some(round);
                *of_set.seeds.get_or_insert(0) += 1;
            }
        }
        Self { sweep, of_sets }
    }

    fn left_out(&self) -> Vec<Cow<'static, str>> {
        match self.sweep.rounds() {
            Some(_) => Vec::new(),
            None => RoundOfSet::names(),
        }
    }

    fn of_set(&self, row: &SetRow) -> RoundOfSet {
        let Some(rounds) = self.sweep.rounds() else {
            return RoundOfSet::default();
        };
        let number = self.sweep.set_with(&row.parameters);
        let known = number.and_then(|set| self.of_sets.get(&set));
        let mut of_set = known.cloned().unwrap_or_default();
        if let Goal::Precision(precision) = &rounds.goal {
            let error = error_over_target(row, precision);
            of_set.target_met = error.map(|error| error <= 1.0);
        }
        of_set
    }
}

/// The half-width of the interval of the least precise statistic over its target: 1 or less if all are as precise as is
/// wanted. `None` if none of them has a value.
pub fn error_over_target(row: &SetRow, precision: &Precision) -> Option<f64> {
    let errors = precision.statistics.iter().filter_map(|statistic| {
        let (value, interval) = row.estimate(statistic.key)?;
        let half = interval.map_or(f64::INFINITY, |ends| 0.5 * (ends.high - ends.low));
        let target = match precision.target {
            Target::Relative(share) => share * value.abs(),
            Target::Absolute(target) => target,
        };
        // Nothing is known better than exactly.
        Some(if half == 0.0 { 0.0 } else { half / target })
    });
    errors.reduce(f64::max)
}

/// Bins per mean interval: 1.9 ms at the paper's standard case, where the peaks are 5 ms wide and 50 ms apart.
const BINS_PER_MEAN: f64 = 60.0;

columns! {
    /// A bin of a histogram that holds at least one interval.
    #[derive(Clone, Debug, PartialEq)]
    pub struct HistogramBin {
        set_id: String = "", "the set, a row of the sets table";
        low: f64 = "s", "lower edge, included";
        high: f64 = "s", "upper edge, excluded";
        count: u64 = "", "intervals between slips";
        density: f64 = "1/s", "share of the set's intervals per second";
    }
}

tables! {
    HistogramBin = "histograms",
        "One row per bin of the intervals of a set, of a width of mean tau / 60; empty bins are left out";
}

/// The histogram of a set: bins of a width of mean τ/60, with an edge at 0; empty bins are left out.
pub(super) fn histogram(set: &SetRow, sorted: &[f64]) -> Vec<HistogramBin> {
    let width = set.tau_mean.unwrap_or_default() / BINS_PER_MEAN;
    if width <= 0.0 {
        return Vec::new();
    }
    let bin_of = |interval: f64| (interval / width).floor();
    let row = |members: &[f64]| {
        let bin = bin_of(members[0]);
        HistogramBin {
            set_id: set.set_id.clone(),
            low: bin * width,
            high: (bin + 1.0) * width,
            count: members.len() as u64,
            density: members.len() as f64 / (sorted.len() as f64 * width),
        }
    };
    let bins = sorted.chunk_by(|&left, &right| bin_of(left) == bin_of(right));
    bins.map(row).collect()
}

const SOURCE: &str = "reduced_from";

/// A checksum of all sweeps of a directory, and of names and sizes of the committed files of jobs.
fn source(results: &Results<'_>) -> Result<String, ResultsError> {
    let mut digest = Sha256::new();
    // All: which sets are controls follows from them.
    for sweep in results.plan().sweeps() {
        digest.update(sweep.text());
    }
    for path in results.dataset(RecordedTable::Jobs)?.files() {
        digest.update(path.file_name().unwrap_or_default().as_encoded_bytes());
        digest.update(results.layout().storage.length(path)?.to_le_bytes());
    }
    Ok(hexadecimal(&digest.finalize()))
}

/// The same directory with reduced data that are up to date: reduces the tables if they are not, and there are tables.
/// If nothing can be written there, the data lie elsewhere as long as the results live.
pub fn renew<'a>(results: &Results<'a>) -> Result<Results<'a>> {
    let layout = results.layout();
    let is_there = layout.storage.exists(&layout.reduced_file(SetRow::NAME))?;
    if is_there && !layout.storage.exists(&layout.table(RecordedTable::Jobs))? {
        return Ok(results.clone());
    }
    let source = Footer::empty().with(SOURCE, &source(results)?);
    let is_current = |table| {
        let file = DataFile::with_footer(layout.reduced_file(table), source.clone());
        file.check(layout.storage).is_ok()
    };
    let mut optional = results.optional_tables();
    if is_current(SetRow::NAME)
        && is_current(HistogramBin::NAME)
        && is_current(BackboneBin::NAME)
        && is_current(Point::NAME)
        && optional.all(|table| is_current(table.word()))
    {
        return Ok(results.clone());
    }
    match reduce(results) {
        Ok(_) => Ok(results.clone()),
        Err(error) if is_read_only(&error) => {
            let elsewhere = results.reduced_to(tempfile::tempdir()?);
            reduce(&elsewhere)?;
            Ok(elsewhere)
        }
        Err(error) if is_there => Err(error.context("the reduced data are out of date")),
        Err(error) => Err(error),
    }
}

/// Whether something failed because writing is not permitted.
fn is_read_only(error: &anyhow::Error) -> bool {
    use io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem};
    let of_storage = error.downcast_ref().map(StorageError::kind);
    let of_results = error.downcast_ref().map(|error: &ResultsError| error.kind);
    matches!(
        of_storage.map(ErrorKind::Disk).or(of_results),
        Some(ErrorKind::Disk(PermissionDenied | ReadOnlyFilesystem))
    )
}

/// An error of a table, with what to do.
pub fn advise(advice: &'static str) -> impl Fn(ResultsError) -> anyhow::Error {
    move |error| {
        let advised = format!("{error}; {advice}");
        anyhow::Error::new(error).context(advised)
    }
}

/// The rows of a reduced table, such as [`Point`].
pub fn read_reduced<R: Table>(layout: &Layout<'_>) -> Result<Vec<R>, ResultsError> {
    let file = layout.reduced_file(R::NAME);
    Dataset::new(layout.storage, vec![file]).rows().collect()
}

/// The same; none of a table that this directory does not have.
pub fn read_optional<R: Table>(layout: &Layout<'_>) -> Result<Vec<R>, ResultsError> {
    if layout.storage.exists(&layout.reduced_file(R::NAME))? {
        read_reduced(layout)
    } else {
        Ok(Vec::new())
    }
}

/// The rows of the reduced sets with how they came about in rounds, controls left out, in order.
pub fn read_sets_in_rounds<'a>(
    layout: &Layout<'a>,
) -> impl Iterator<Item = Result<SetInRounds, ResultsError>> + use<'a> {
    let file = layout.reduced_file(SetRow::NAME);
    let rows = Dataset::new(layout.storage, vec![file]).rows::<SetInRounds>();
    rows.filter(|row| !matches!(row, Ok((set, _)) if set.is_control))
}

/// The set that was run as a control alone, if there is a single one.
pub fn read_control(layout: &Layout<'_>) -> Result<Option<SetRow>, ResultsError> {
    let file = layout.reduced_file(SetRow::NAME);
    let rows = Dataset::new(layout.storage, vec![file]).rows::<SetRow>();
    let mut controls = rows.filter(|row| !matches!(row, Ok(set) if !set.is_control));
    let first = controls.next().transpose()?;
    Ok(first.filter(|_| controls.next().is_none()))
}

/// The rows of the reduced sets, controls left out, in order.
pub fn read_sets<'a>(
    layout: &Layout<'a>,
) -> impl Iterator<Item = Result<SetRow, ResultsError>> + use<'a> {
    read_sets_in_rounds(layout).map(|row| row.map(|(set, _)| set))
}

#[cfg(test)]
mod tests {
    use super::super::set::SetSlips;
    use super::super::set::tests::{jobs, slip};
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;
    use crate::observe::{Averages, Measurements, Modulation, Slip};
    use crate::results::layout::Layout;
    use crate::results::tables::{
        DriveAndSeed, JobLabel, JobRecord, JobRow, Loading, Names, RecordedTable, SlipRow, relabel,
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
        fs::create_dir_all(layout.table(RecordedTable::Slips)).unwrap();
        fs::create_dir_all(layout.table(RecordedTable::Jobs)).unwrap();
        for (part, seed) in (0..).zip(seeds) {
            let name = format!("part-000-{part:06}.parquet");
            let path = layout.table(RecordedTable::Slips).join(&name);
            let file = Disk.create(&path).unwrap();
            let mut slip_writer =
                TableWriter::<SlipRow<'_>>::new(&Gaps::default(), &path, file, &Footer::default())
                    .unwrap();
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
                let path = layout.table(RecordedTable::Jobs).join(&name);
                let file = Disk.create(&path).unwrap();
                let mut job_writer =
                    TableWriter::<JobRow>::new(&Gaps::default(), &path, file, &Footer::default())
                        .unwrap();
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
        assert!(Disk.list(&layout.drafts()).unwrap().is_empty());
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

    #[test]
    fn a_histogram_counts_every_interval_once_and_its_density_integrates_to_one() {
        let mut set = SetSlips::default();
        for step in 0..500_u32 {
            set.push(0, &slip(Some(0.1 + 0.001 * f64::from(step % 37)), None));
        }
        let set = set.finish(&jobs(0.0, 1.0));
        let bins = histogram(&set.row, &set.intervals);
        assert_eq!(bins.iter().map(|bin| bin.count).sum::<u64>(), 500);
        let integral: f64 = bins
            .iter()
            .map(|bin| bin.density * (bin.high - bin.low))
            .sum();
        assert!((integral - 1.0).abs() < 1e-12);
        assert!(
            bins.windows(2)
                .all(|pair| pair[0].high <= pair[1].low * (1.0 + 1e-12))
        );
        assert!(histogram(&set.row, &[]).is_empty());
    }
}
