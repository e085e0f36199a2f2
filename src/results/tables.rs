//! The tables of a sweep: slips, precursors, jobs. A new output column is one line here.
//!
//! Quantities are SI. Nothing in a table tells when, where or how fast it was computed.

use crate::model::{Parameters, Symbol};
use crate::observe::{Measurements, Precursor, Slip};
use crate::results::records;
use crate::table::columns::{Column, Getter, Table};

/// Outcome of a job that recorded all its slips.
pub const DONE: &str = "done";
/// Outcome of a job that reached `max_time` before.
pub const TIME_LIMIT: &str = "time limit";
/// Outcome of a job that could not be finished.
pub const FAILED: &str = "failed";

/// What every row says about its job.
#[derive(Clone, Debug, PartialEq)]
pub struct JobLabel {
    /// Id of the job, 32 hexadecimal characters.
    pub job_id: String,
    /// Id of its set (the seed aside), 32 hexadecimal characters.
    pub set_id: String,
    /// Its parameters.
    pub parameters: Parameters,
}

/// A row of the slips table.
#[derive(Clone, Copy, Debug)]
pub struct SlipRow<'a> {
    /// The job.
    pub job: &'a JobLabel,
    /// The slip.
    pub slip: &'a Slip,
}

/// A row of the precursors table.
#[derive(Clone, Copy, Debug)]
pub struct PrecursorRow<'a> {
    /// The job.
    pub job: &'a JobLabel,
    /// The precursor.
    pub precursor: &'a Precursor,
}

/// A row of the jobs table.
#[derive(Clone, Copy, Debug)]
pub struct JobRow<'a> {
    /// The job.
    pub job: &'a JobLabel,
    /// What it measured, or why it failed.
    pub result: Result<&'a Measurements, &'a str>,
}

impl JobRow<'_> {
    fn outcome(&self) -> &'static str {
        match self.result {
            Err(_) => FAILED,
            Ok(result) if result.summary.satisfied => DONE,
            Ok(_) => TIME_LIMIT,
        }
    }

    fn measured<T>(&self, of: impl FnOnce(&Measurements) -> T) -> Option<T> {
        self.result.ok().map(of)
    }
}

const JOB_ID: (&str, &str) = ("job_id", "hash of all that defines the job");
const SET_ID: (&str, &str) = ("set_id", "hash of the same but the seed: common to all realisations");
const ETA: (&str, &str) = ("eta", "2 pi Delta / (T V0), harmonic against uniform loading rate; 0 without modulation");
const PERIOD_AT_ONSET: (&str, &str) =
    ("T_onset", "period of the modulation at the onset, T unless ramped; null without modulation");
const AMPLITUDE_AT_ONSET: (&str, &str) =
    ("Delta_onset", "amplitude of the modulation at the onset, Delta unless ramped; 0 without modulation");

/// The parameters that label every slip and precursor; the others stand in the jobs table.
const LABELS: [Symbol; 4] = [Symbol::V0, Symbol::Delta, Symbol::T, Symbol::Seed];

/// The slips table.
#[must_use]
pub fn slips<'a>() -> Table<SlipRow<'a>> {
    use Getter::{Count, OptionalCount, OptionalReal, Real, Text};
    let mut columns = vec![
        Column::new(JOB_ID.0, "", JOB_ID.1, Text(|row: &SlipRow<'a>| row.job.job_id.clone())),
        Column::new(SET_ID.0, "", SET_ID.1, Text(|row| row.job.set_id.clone())),
    ];
    columns.extend(LABELS.map(|symbol| Column::parameter(symbol, |row: &SlipRow<'a>| &row.job.parameters)));
    columns.extend([
        Column::new(ETA.0, "", ETA.1, Real(|row: &SlipRow<'a>| row.job.parameters.eta())),
        Column::new(
            "slip",
            "",
            "number of the slip within its job, from 0 past start-up",
            Count(|row| row.slip.number),
        ),
        Column::new(
            "onset",
            "s",
            "time of the largest shear force since the previous slip's end",
            Real(|row| row.slip.onset),
        ),
        Column::new("interval", "s", "time since the previous onset", OptionalReal(|row| row.slip.interval)),
        Column::new(PERIOD_AT_ONSET.0, "s", PERIOD_AT_ONSET.1, OptionalReal(|row| row.slip.modulation.period)),
        Column::new(AMPLITUDE_AT_ONSET.0, "m", AMPLITUDE_AT_ONSET.1, Real(|row| row.slip.modulation.amplitude)),
        Column::new(
            "n",
            "",
            "interval in periods T_onset, rounded; null without modulation",
            OptionalCount(|row| row.slip.modulation.periods(row.slip.interval?)),
        ),
        Column::new("phase", "rad", "phase of the onset against the modulation", OptionalReal(|row| row.slip.phase)),
        Column::new("peak_force", "N", "shear force at the onset", Real(|row| row.slip.peak_force)),
        Column::new("drop", "N", "peak force minus the least shear force during the slip", Real(|row| row.slip.drop)),
        Column::new("nucleation", "s", "time of the first break", Real(|row| row.slip.nucleation)),
        Column::new(
            "nucleation_block",
            "",
            "block of the first break, from 1 at the trailing edge",
            Count(|row| row.slip.nucleation_block),
        ),
        Column::new("duration", "s", "from the first to the last break", Real(|row| row.slip.duration)),
        Column::new("size", "", "breaks in the rupture", Count(|row| row.slip.size)),
        Column::new("front_speed", "m/s", "speed of the rupture front", OptionalReal(|row| row.slip.front_speed)),
        Column::new("precursors", "", "precursors since the previous slip", Count(|row| row.slip.precursors)),
        Column::new(
            "slow_front_speed",
            "m/s",
            "advance of the reach through these precursors; null for fewer than two",
            OptionalReal(|row| row.slip.slow_front_speed),
        ),
        Column::new(
            "drops_before",
            "",
            "drops of the shear force since the previous slip; null unless the sweep records drops, as what follows",
            OptionalCount(|row| Some(row.slip.drops?.before)),
        ),
        Column::new(
            "largest_drop_before",
            "N",
            "the largest of them; null without any",
            OptionalReal(|row| row.slip.drops?.largest_before),
        ),
        Column::new(
            "drop_during",
            "N",
            "the largest drop under way during the slip; null if the slip is not seen as a drop",
            OptionalReal(|row| row.slip.drops?.during),
        ),
    ]);
    Table { name: "slips", meaning: "One row per slip past start-up", columns }
}

/// The precursors table.
#[must_use]
pub fn precursors<'a>() -> Table<PrecursorRow<'a>> {
    use Getter::{Count, OptionalReal, Real, Text};
    let mut columns = vec![
        Column::new(JOB_ID.0, "", JOB_ID.1, Text(|row: &PrecursorRow<'a>| row.job.job_id.clone())),
        Column::new(SET_ID.0, "", SET_ID.1, Text(|row| row.job.set_id.clone())),
    ];
    columns.extend(LABELS.map(|symbol| Column::parameter(symbol, |row: &PrecursorRow<'a>| &row.job.parameters)));
    columns.extend([
        Column::new(ETA.0, "", ETA.1, Real(|row: &PrecursorRow<'a>| row.job.parameters.eta())),
        Column::new("slip", "", "number of the slip that it precedes", Count(|row| row.precursor.slip)),
        Column::new(
            "precursor",
            "",
            "number of the precursor before that slip, from 0",
            Count(|row| row.precursor.precursor),
        ),
        Column::new(
            "onset",
            "s",
            "time of the largest shear force since the previous rupture of at least this size",
            Real(|row| row.precursor.onset),
        ),
        Column::new(
            "interval",
            "s",
            "time since the onset of the previous precursor of the same slip",
            OptionalReal(|row| row.precursor.interval),
        ),
        Column::new(PERIOD_AT_ONSET.0, "s", PERIOD_AT_ONSET.1, OptionalReal(|row| row.precursor.modulation.period)),
        Column::new(AMPLITUDE_AT_ONSET.0, "m", AMPLITUDE_AT_ONSET.1, Real(|row| row.precursor.modulation.amplitude)),
        Column::new("nucleation", "s", "time of the first break", Real(|row| row.precursor.nucleation)),
        Column::new(
            "nucleation_block",
            "",
            "block of the first break, from 1 at the trailing edge",
            Count(|row| row.precursor.nucleation_block),
        ),
        Column::new("duration", "s", "from the first to the last break", Real(|row| row.precursor.duration)),
        Column::new("size", "", "breaks in the rupture", Count(|row| row.precursor.size)),
        Column::new("extent", "", "distinct blocks with a break", Count(|row| row.precursor.extent)),
        Column::new("reach", "", "the furthest of them, from 1", Count(|row| row.precursor.reach)),
        Column::new("front_speed", "m/s", "speed of the rupture front", OptionalReal(|row| row.precursor.front_speed)),
    ]);
    Table {
        name: "precursors",
        meaning: "One row per precursor of a recorded slip; only if the sweep records precursors",
        columns,
    }
}

/// The jobs table.
#[must_use]
pub fn jobs<'a>() -> Table<JobRow<'a>> {
    use Getter::{OptionalCount, OptionalReal, OptionalText, Real, Text};
    let mut columns = vec![
        Column::new(JOB_ID.0, "", JOB_ID.1, Text(|row: &JobRow<'a>| row.job.job_id.clone())),
        Column::new(SET_ID.0, "", SET_ID.1, Text(|row| row.job.set_id.clone())),
    ];
    columns.extend(Symbol::ALL.map(|symbol| Column::parameter(symbol, |row: &JobRow<'a>| &row.job.parameters)));
    columns.extend([
        Column::new(ETA.0, "", ETA.1, Real(|row: &JobRow<'a>| row.job.parameters.eta())),
        Column::new(
            "outcome",
            "",
            "`done`; `time limit`: `max_time` came before the last slip; or `failed`",
            Text(|row| row.outcome().to_owned()),
        ),
        Column::new(
            "reason",
            "",
            "why it failed; null unless failed",
            OptionalText(|row| row.result.err().map(str::to_owned)),
        ),
        Column::new(
            "slips",
            "",
            "slips recorded; null if failed, as all that follows",
            OptionalCount(|row| row.measured(|result| result.slips.len() as u64)),
        ),
        Column::new(
            "precursors",
            "",
            "their precursors",
            OptionalCount(|row| row.measured(|result| result.slips.iter().map(|slip| slip.precursors).sum())),
        ),
        Column::new(
            "ruptures",
            "",
            "ruptures of any size, start-up included",
            OptionalCount(|row| row.measured(|result| result.ruptures)),
        ),
        Column::new("breaks", "", "contacts broken", OptionalCount(|row| row.measured(|result| result.summary.breaks))),
        Column::new(
            "reattachments",
            "",
            "contacts reattached",
            OptionalCount(|row| row.measured(|result| result.summary.reattachments)),
        ),
        Column::new(
            "mean_friction",
            "N",
            "time average of the shear force past start-up",
            OptionalReal(|row| row.measured(|result| result.mean_friction).flatten()),
        ),
        Column::new(
            "simulated_time",
            "s",
            "model time reached",
            OptionalReal(|row| row.measured(|result| result.summary.end_time)),
        ),
        Column::new(
            "steps",
            "",
            "steps of the solver",
            OptionalCount(|row| row.measured(|result| result.summary.steps)),
        ),
        Column::new(
            "leaps",
            "",
            "of these, leaps over quiet time",
            OptionalCount(|row| row.measured(|result| result.summary.leaps)),
        ),
    ]);
    Table { name: "jobs", meaning: "One row per job", columns }
}

/// All tables of a sweep, and those of one simulation, in Markdown, one section each.
#[must_use]
pub fn markdown() -> String {
    let sweep = [slips().markdown(), precursors().markdown(), jobs().markdown()];
    let records = [records::trace().markdown(), records::map().markdown(), records::contacts().markdown()];
    [sweep, records].concat().join("\n")
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::observe::Modulation;
    use crate::table::columns::tests::assert_documented;
    use arrow_array::cast::AsArray;
    use arrow_array::types::Int64Type;

    pub(crate) fn slip(number: u64) -> Slip {
        Slip {
            number,
            onset: 1.0,
            interval: Some(0.137),
            phase: None,
            modulation: Modulation::default(),
            peak_force: 477.0,
            drop: 100.0,
            nucleation: 1.001,
            nucleation_block: 3,
            duration: 0.005,
            size: 1400,
            front_speed: Some(300.0),
            precursors: 2,
            slow_front_speed: None,
            drops: None,
        }
    }

    #[test]
    fn columns_of_a_table_have_distinct_names() {
        let names = |schema: arrow_schema::SchemaRef| {
            schema.fields().iter().map(|field| field.name().clone()).collect::<Vec<_>>()
        };
        for names in [names(slips().schema()), names(precursors().schema()), names(jobs().schema())] {
            let mut unique = names.clone();
            unique.sort();
            unique.dedup();
            assert_eq!(unique.len(), names.len(), "{names:?}");
        }
    }

    #[test]
    fn n_counts_periods_at_the_onset_and_is_null_without_modulation() {
        let job = JobLabel { job_id: "0".repeat(32), set_id: "1".repeat(32), parameters: Parameters::default() };
        let (still, first) = (slip(1), Slip { interval: None, ..slip(0) });
        let modulated = |period| Slip { modulation: Modulation { period: Some(period), amplitude: 1e-6 }, ..slip(1) };
        let (table, mut buffer) = (slips(), slips().buffer());
        let all = [still, first, modulated(1.0 / 29.0), modulated(1.0 / 58.0)];
        for slip in &all {
            table.push(&mut buffer, &SlipRow { job: &job, slip });
        }
        let batch = buffer.take().unwrap();
        let n: Vec<_> = batch.column_by_name("n").unwrap().as_primitive::<Int64Type>().iter().collect();
        assert_eq!(n, [None, None, Some(4), Some(8)]);
    }

    #[test]
    fn documented_tables_are_those_written() {
        let text = format!(
            "# Tables\n\nUnits are SI. Every file of a table has these columns in this order; units and meanings are \
             also in its metadata.\n\n{}",
            markdown()
        );
        assert_documented("tables.md", &text);
    }
}
