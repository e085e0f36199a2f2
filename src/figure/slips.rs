//! Slips as dots of custom figures: a sample of the table of slips, with all parameters of their sets.

use super::BadOption;
use super::common;
use super::custom::CustomFigure;
use crate::model::Selected;
use crate::observe::Slip;
use crate::reduce::{Condition, SetRow};
use crate::results::Results;
use crate::results::tables::{JOBS, JobOfSlip, Loading, SLIPS};
use crate::sets::AllButSeed;
use crate::table::columns::Row;
use anyhow::Result;
use std::collections::HashMap;

/// Most dots: more hide each other, and make a picture of some megabytes.
const MAX_SLIPS: usize = 20_000;

/// A slip, and what it is a slip of.
pub type PlottedSlip = ((JobOfSlip, Selected<AllButSeed>), (Loading, Slip));

/// Every k-th of the slips that fulfil a condition.
pub(super) struct Sample {
    pub(super) slips: Vec<PlottedSlip>,
    every: usize,
    matching: usize,
}

impl Sample {
    fn push(&mut self, slip: PlottedSlip) {
        if self.matching.is_multiple_of(self.every) {
            self.slips.push(slip);
        }
        self.matching += 1;
        if self.slips.len() > MAX_SLIPS {
            self.every *= 2;
            let mut places = 0..;
            self.slips.retain(|_| {
                places
                    .next()
                    .is_some_and(|place: usize| place.is_multiple_of(2))
            });
        }
    }

    /// What the slips have in common, and which are shown.
    pub(super) fn note(&self) -> String {
        let common = common(self.slips.iter().map(|slip| &*slip.0.1));
        let Self {
            every, matching, ..
        } = self;
        if *every == 1 {
            format!("{common}; {matching} slips")
        } else {
            format!("{common}; one in {every} of {matching} slips")
        }
    }
}

/// Reads the slips of these sets that fulfil the condition of a figure.
pub(super) fn read(
    results: &Results<'_>,
    sets: &[SetRow],
    figure: &CustomFigure,
) -> Result<Sample> {
    let Some(text) = &figure.condition else {
        return sample(results, sets, |_| true);
    };
    let bad = |problem: String| BadOption::new("where", text, &problem);
    let condition = Condition::read_on(text, &PlottedSlip::columns()).map_err(bad)?;
    let matching = sample(results, sets, |slip| condition.holds(slip))?;
    if matching.slips.is_empty() {
        let all = sample(results, sets, |_| true)?;
        return Err(bad(condition.unmatched("slips", &all.slips)).into());
    }
    Ok(matching)
}

fn sample(
    results: &Results<'_>,
    sets: &[SetRow],
    matches: impl Fn(&PlottedSlip) -> bool,
) -> Result<Sample> {
    let parameters: HashMap<&str, _> = sets
        .iter()
        .map(|set| (&*set.set_id, &set.parameters))
        .collect();
    let mut sample = Sample {
        slips: Vec::new(),
        every: 1,
        matching: 0,
    };
    let files = results.committed_files(SLIPS, &results.dataset(JOBS)?)?;
    for batch in files.rows::<(JobOfSlip, Slip)>() {
        for (job, slip) in batch? {
            let Some(&of_set) = parameters.get(&*job.set_id) else {
                continue;
            };
            let slip = ((job, of_set.clone()), (Loading::of(of_set), slip));
            if matches(&slip) {
                sample.push(slip);
            }
        }
    }
    Ok(sample)
}
