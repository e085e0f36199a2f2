//! The sets of chosen jobs: the rows that decide on the next round.
//!
//! Contract: a function of the jobs and their rows alone. Jobs of a set are taken in the order of their seeds, whatever
//! files they lie in, so that no digit depends on a compaction or on what was run here before.

use super::PhaseLimits;
use super::reduction::{JobFacts, JobOfSet};
use super::set::{SetJobs, SetRow, SetSlips};
use crate::model::Parameters;
use crate::observe::Slip;
use crate::results::parts::committed_files;
use crate::results::tables::{All, JOBS, SLIPS};
use crate::results::{Results, ResultsError};
use crate::table::columns::columns;
use crate::table::file::{Dataset, DatasetError};
use crate::table::selected::Selected;
use std::collections::{BTreeMap, HashMap};

/// Slips that are held at once: 170 MB.
const MAX_SLIPS: u64 = 1 << 19;

/// A set of chosen jobs.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenSet {
    /// What it was chosen as.
    pub number: u64,
    /// Number of its jobs, failed ones included.
    pub jobs: u64,
    pub row: SetRow,
}

/// The jobs of a set, by their seeds.
struct Jobs {
    number: u64,
    set_id: String,
    parameters: Parameters,
    by_seed: BTreeMap<u64, JobFacts>,
}

/// Reduces the sets of the jobs that `choose` gives a number, in the order of the numbers: one for each set.
pub fn reduce_chosen(
    results: &Results<'_>,
    choose: impl Fn(&Parameters) -> Option<u64>,
) -> Result<Vec<ChosenSet>, ResultsError> {
    let layout = results.layout();
    let reduced = layout.read_tables(|| {
        let job_files = layout.dataset(JOBS)?;
        let slip_files = committed_files(layout, SLIPS, &job_files)?;
        let mut reduced = Vec::new();
        let (mut chunk, mut slips) = (Vec::new(), 0);
        for jobs in read_jobs(job_files, &choose)? {
            let more: u64 = jobs.by_seed.values().filter_map(|job| job.slips).sum();
            if slips + more > MAX_SLIPS && !chunk.is_empty() {
                reduced.extend(reduce_sets(slip_files.clone(), std::mem::take(&mut chunk))?);
                slips = 0;
            }
            slips += more;
            chunk.push(jobs);
        }
        reduced.extend(reduce_sets(slip_files, chunk)?);
        Ok::<_, DatasetError>(reduced)
    });
    Ok(reduced??)
}

fn read_jobs(
    files: Dataset<'_>,
    choose: impl Fn(&Parameters) -> Option<u64>,
) -> Result<impl Iterator<Item = Jobs>, DatasetError> {
    let mut sets: BTreeMap<u64, Jobs> = BTreeMap::new();
    for batch in files.rows::<(JobOfSet, Selected<All>)>() {
        for (JobOfSet { set_id, facts }, Selected { parameters, .. }) in batch? {
            let Some(number) = choose(&parameters) else { continue };
            let seed = parameters.seed;
            let new = || Jobs { number, set_id, parameters, by_seed: BTreeMap::new() };
            sets.entry(number).or_insert_with(new).by_seed.insert(seed, facts);
        }
    }
    Ok(sets.into_values())
}

columns! {
    /// The set and the seed of a slip.
    struct SeedOfSlip {
        set_id: String;
        seed: u64;
    }
}

/// The row of a set of these jobs.
#[cfg(test)]
pub(crate) fn row_of(parameters: &Parameters, jobs: &[crate::observe::Measurements]) -> SetRow {
    use crate::results::tables::JobOutcome;
    let limits = PhaseLimits::at(parameters.eta());
    let (mut set, mut slips) = (SetJobs::new(String::new(), parameters.clone()), SetSlips::default());
    for job in jobs {
        let averages = job.averages;
        set.push(&JobFacts {
            outcome: JobOutcome::of(job),
            slips: Some(job.slips.len() as u64),
            mean_friction: averages.map(|averages| averages.friction),
            attached_fraction: averages.map(|averages| averages.attached_fraction),
            slip_share: averages.map(|averages| averages.slip_share),
            regime: job.regime(),
        });
        job.slips.iter().for_each(|slip| slips.push_of(parameters, slip, &limits));
    }
    slips.finish(set).row
}

fn reduce_sets(files: Dataset<'_>, sets: Vec<Jobs>) -> Result<Vec<ChosenSet>, DatasetError> {
    let mut slips: HashMap<String, BTreeMap<u64, Vec<Slip>>> = HashMap::new();
    for Jobs { set_id, by_seed, .. } in &sets {
        slips.insert(set_id.clone(), by_seed.keys().map(|&seed| (seed, Vec::new())).collect());
    }
    if !slips.is_empty() {
        for batch in files.rows::<(SeedOfSlip, Slip)>() {
            for (SeedOfSlip { set_id, seed }, slip) in batch? {
                if let Some(of_job) = slips.get_mut(&set_id).and_then(|set| set.get_mut(&seed)) {
                    of_job.push(slip);
                }
            }
        }
    }
    let reduce = |Jobs { number, set_id, parameters, by_seed }: Jobs| {
        let by_job = slips.remove(&set_id).unwrap_or_default();
        let limits = PhaseLimits::at(parameters.eta());
        let (mut set, mut set_slips) = (SetJobs::new(set_id, parameters), SetSlips::default());
        for job in by_seed.values() {
            set.push(job);
        }
        for slip in by_job.values().flatten() {
            set_slips.push_of(&set.parameters, slip, &limits);
        }
        ChosenSet { number, jobs: by_seed.len() as u64, row: set_slips.finish(set).row }
    };
    Ok(sets.into_iter().map(reduce).collect())
}
