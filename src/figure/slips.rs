//! Slips as dots of custom figures: a sample of the table of slips, with all parameters of their sets.

use super::BadOption;
use super::common;
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

/// The slips of these sets that fulfil a condition, of many every k-th; and a note on them.
pub(super) fn read(
    results: &Results<'_>,
    sets: &[SetRow],
    condition: Option<&str>,
) -> Result<(Vec<PlottedSlip>, String)> {
    let bad = |problem: String| BadOption::new("where", condition.unwrap_or_default(), &problem);
    let parsed = condition.map(|text| Condition::read_on(text, &PlottedSlip::columns()));
    let holds = parsed.transpose().map_err(bad)?;
    let of_id: HashMap<&str, _> = sets
        .iter()
        .map(|set| (&*set.set_id, &set.parameters))
        .collect();
    let mut slips: Vec<PlottedSlip> = Vec::new();
    let mut every = 1;
    let mut matching = 0_usize;
    let files = results.committed_files(SLIPS, &results.dataset(JOBS)?)?;
    for batch in files.rows::<(JobOfSlip, Slip)>() {
        for (job, slip) in batch? {
            let Some(&of_set) = of_id.get(&*job.set_id) else {
                continue;
            };
            let slip = ((job, of_set.clone()), (Loading::of(of_set), slip));
            if holds
                .as_ref()
                .is_none_or(|condition| condition.holds(&slip))
            {
                if matching.is_multiple_of(every) {
                    slips.push(slip);
                }
                matching += 1;
            }
        }
        while slips.len() > MAX_SLIPS {
            every *= 2;
            let mut is_kept = [true, false].into_iter().cycle();
            slips.retain(|_| is_kept.next() == Some(true));
        }
    }
    if let Some(condition) = holds.filter(|_| slips.is_empty()) {
        let (all, _) = read(results, sets, None)?;
        return Err(bad(condition.unmatched("slips", &all)).into());
    }
    let common = common(slips.iter().map(|slip| &*slip.0.1));
    let note = if every == 1 {
        format!("{common}; {matching} slips")
    } else {
        format!("{common}; one in {every} of {matching} slips")
    };
    Ok((slips, note))
}
