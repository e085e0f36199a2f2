//! [`Sweep`]: what a sweep file says. And its grid: the points of the axes in grid order, those that are jobs, and the
//! look-up of a job without walking.
//!
//! Grid order: axes as in the file, the last moves fastest. A point is a job if the conditions hold and no earlier
//! point has the same parameters; that happens without modulation only, where T, η and the frequency mean nothing:
//! there the first row of the axis that fixes the period counts (see [`Axis`]). Conditions see canonical values, so
//! they judge such points alike. Memory does not grow with the number of points.

use super::axes::Axis;
use super::cost::predicted_cost;
use super::expression::Expression;
use super::job::{Identity, Job, settings, solver_settings};
use super::measured::Measured;
use super::quantity::{GridPoint, Quantity};
use super::rounds::Rounds;
use super::source::SweepError;
use crate::model::theory::to_twelve_digits;
use crate::model::{Parameters, Selection, Symbol, Value};
use crate::observe::{Recording, RecordingKey};
use crate::sets::AllButSeed;
use crate::solver::Solver;
use crate::table::value::Shortest;
use std::ops::Range;

#[derive(Clone, Debug)]
pub struct Sweep {
    pub(super) name: String,
    pub(super) text: String,
    /// `[model]` over the defaults; what an axis sets is not used.
    pub(super) base: Parameters,
    pub(super) axes: Vec<Axis>,
    pub(super) conditions: Vec<Expression<Quantity>>,
    pub(super) recording: Recording,
    pub(super) solver: Solver,
    pub(super) identity: Identity,
    pub(super) rounds: Option<Rounds>,
    pub(super) controls: Option<Box<Self>>,
    pub(super) measured: Option<Measured>,
    /// In a sweep of controls, the sets that are run, in order; `None`: all.
    pub(super) needed: Option<Vec<u64>>,
}

impl Sweep {
    /// The name: letters, digits, `_` and `-`.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn text(&self) -> &str {
        &self.text
    }

    pub const fn recording(&self) -> &Recording {
        &self.recording
    }

    pub const fn solver(&self) -> Solver {
        self.solver
    }

    /// Where its slips come from, if they were not computed.
    pub const fn measured(&self) -> Option<&Measured> {
        self.measured.as_ref()
    }

    /// Parameters that nobody knows, as slips were measured.
    pub fn unknown(&self) -> &[Symbol] {
        &self.base.unknown
    }

    /// Each axis in grid order: the keys that it moves, joined by commas, and its number of rows.
    pub fn axes(&self) -> impl Iterator<Item = (String, u64)> {
        self.axes.iter().map(|axis| {
            let keys: Vec<&str> = axis.quantities().into_iter().map(Quantity::key).collect();
            (keys.join(", "), axis.len())
        })
    }

    /// Whether the modulation may be a pulse.
    pub fn has_pulses(&self) -> bool {
        self.base.pulse_start.is_some() || self.moves(Symbol::PulseStart)
    }

    /// Keys of all axes.
    pub fn swept(&self) -> impl Iterator<Item = &'static str> {
        let quantities = self.axes.iter().flat_map(Axis::quantities);
        quantities.map(Quantity::key)
    }

    /// Number of points of the grid, before the conditions drop some.
    pub fn point_count(&self) -> u64 {
        self.axes.iter().map(Axis::len).product()
    }

    /// Numbers of the points of the grid, and of the controls after them.
    pub(super) fn points(&self) -> Range<u64> {
        let controls = self.controls.as_ref();
        let control_points = controls.map_or(0, |controls| controls.point_count());
        0..self.point_count() + control_points
    }

    /// The jobs in grid order, then their controls.
    #[cfg(test)]
    pub(crate) fn jobs(&self) -> impl Iterator<Item = Job> + Clone + Send + '_ {
        self.jobs_at(self.points())
    }

    /// The jobs of the grid, without controls.
    pub fn jobs_of_grid(&self) -> impl Iterator<Item = Job> + Clone + Send + '_ {
        self.jobs_at(0..self.point_count())
    }

    pub fn jobs_at(&self, points: Range<u64>) -> impl Iterator<Item = Job> + Clone + Send + '_ {
        let count = self.point_count();
        let of_grid = self.admitted(points.start.min(count)..points.end.min(count));
        let others = points.start.max(count) - count..points.end.max(count) - count;
        let controls = self.controls.iter();
        let admitted = controls.flat_map(move |controls| controls.admitted(others.clone()));
        let of_controls = admitted.map(move |(number, point)| (count + number, point));
        let is_own = |(_, point): &(u64, GridPoint)| self.find_in_grid(&point.parameters).is_none();
        let points = of_grid.chain(of_controls.filter(is_own));
        let seeds = self.seeds_in_a_row();
        let mut last_set = None;
        points.map(move |(point, GridPoint { parameters, .. })| {
            let set = point / seeds;
            let cost = match last_set {
                Some((known, cost)) if known == set && point < count => cost,
                // To look slips up takes no time.
                _ if self.measured.is_some() => 0.0,
                _ => predicted_cost(&parameters, &self.recording, self.solver),
            };
            last_set = Some((set, cost));
            Job {
                point,
                parameters,
                cost,
            }
        })
    }

    /// How many neighbours differ in their seed alone, and so cost the same.
    fn seeds_in_a_row(&self) -> u64 {
        let moves_seed = |axis: &&Axis| axis.quantities() == [Quantity::Parameter(Symbol::Seed)];
        self.axes.last().filter(moves_seed).map_or(1, Axis::len)
    }

    /// Number of the point that is the job with these canonical parameters: exact bits, without walking through the
    /// points.
    pub fn find(&self, parameters: &Parameters) -> Option<u64> {
        let control =
            || Some(self.point_count() + self.controls.as_ref()?.find_in_grid(parameters)?);
        self.find_in_grid(parameters).or_else(control)
    }

    fn find_in_grid(&self, parameters: &Parameters) -> Option<u64> {
        let found = self.axes.iter().map(|axis| axis.find(parameters));
        let rows: Vec<u64> = found.collect::<Option<_>>()?;
        let point = self.point(&rows).canonical();
        if point.parameters != *parameters || !self.admits(&point) {
            return None;
        }
        let rows = self.axes.iter().zip(rows);
        let number = rows.fold(0, |number, (axis, row)| number * axis.len() + row);
        Some(number).filter(|&number| self.is_needed(number))
    }

    /// Number of a point of the grid with these canonical parameters and any seed.
    pub(super) fn find_set_in_grid(&self, parameters: &Parameters) -> Option<u64> {
        // Where no condition reads the seed, all seeds are jobs or none is.
        let tried = if self.reads_seed() { usize::MAX } else { 1 };
        let mut axes = self.axes.iter();
        let on_axis = axes.find_map(|axis| axis.seeds(parameters, tried));
        let seeds = on_axis.unwrap_or_else(|| vec![self.base.seed]);
        let mut jobs = seeds.into_iter().map(|seed| parameters.with_seed(seed));
        jobs.find_map(|job| self.find_in_grid(&job))
    }

    pub(super) fn reads_seed(&self) -> bool {
        let mut names = self.conditions.iter().flat_map(Expression::names);
        names.any(|name| *name == Quantity::SEED)
    }

    fn is_needed(&self, number: u64) -> bool {
        let is_among = |needed: &Vec<u64>| needed.binary_search(&self.set_of(number)).is_ok();
        self.needed.as_ref().is_none_or(is_among)
    }

    pub fn job_id(&self, parameters: &Parameters) -> String {
        self.identity.id(parameters, &Symbol::ALL)
    }

    pub fn set_id(&self, parameters: &Parameters) -> String {
        self.identity.id(parameters, AllButSeed::SYMBOLS)
    }

    /// This sweep with the ids that a program of other versions gave.
    pub fn with_ids_of(mut self, model_version: u32, rng_scheme: &str) -> Self {
        let versions = (model_version, rng_scheme);
        let measured = self.measured.as_ref();
        self.identity = Identity::new(versions, self.solver, &self.recording, measured);
        self
    }

    /// The same, if its slips are to be computed.
    pub fn computed(self) -> Result<Self, SweepError> {
        if self.measured.is_none() {
            return Ok(self);
        }
        let problem = format!(
            "{}: its slips were measured, and nothing is to be run; `stickslip measured` reads their files again",
            self.name
        );
        Err(SweepError::Made(problem))
    }

    /// The `stickslip simulate` command that does what a job of this sweep does: what differs from the defaults, in
    /// digits that read back to the same bits.
    pub fn command(&self, job: &Job) -> String {
        if self.measured.is_some() {
            return format!("series {} of the measured ones", job.parameters.seed);
        }
        let mut words = vec![self.command_of_set(&job.parameters)];
        let seed = job.parameters.seed;
        if seed != Parameters::default().seed {
            words.push(format!("--set seed={seed}"));
        }
        words.push(self.command_end());
        words.retain(|word| !word.is_empty());
        words.join(" ")
    }

    /// The beginning of the command of a job, which all jobs of its set have in common.
    pub fn command_of_set(&self, parameters: &Parameters) -> String {
        let mut words = vec!["stickslip simulate".to_owned()];
        let defaults = Parameters::default();
        for symbol in Symbol::ALL {
            let value = parameters.get(symbol);
            let is_default = value == defaults.get(symbol) || value == Value::Null;
            if symbol == Symbol::Seed || is_default {
                continue;
            }
            let frequency = value.number().filter(|_| symbol == Symbol::T);
            words.push(match frequency.and_then(frequency_of) {
                Some(frequency) => format!("--set frequency={frequency}"),
                None => format!("--set {}={value}", symbol.key()),
            });
        }
        words.join(" ")
    }

    /// The end of the command of a job, behind its seed, which all jobs of the sweep have in common.
    pub fn command_end(&self) -> String {
        let mut words = Vec::new();
        // `simulate` has another default.
        words.extend(self.recording.slips.map(|slips| format!("--slips {slips}")));
        // A single job has no control.
        let defaults = Recording {
            slips: self.recording.slips,
            control: self.recording.control,
            ..Recording::default()
        };
        for key in RecordingKey::ALL {
            let value = self.recording.get(key);
            if value != defaults.get(key) {
                words.push(format!("--record {}={value}", key.key()));
            }
        }
        let defaults = solver_settings(Solver::default());
        for setting in solver_settings(self.solver) {
            if !defaults.contains(&setting) {
                let (key, value) = setting;
                words.push(format!("--set {key}={value}"));
            }
        }
        words.join(" ")
    }

    /// How another sweep differs besides axes and conditions: name, model, recording, solver, each as section and key
    /// with the value before and after. Parameters that an axis of either sets are left out, as an axis may be added,
    /// changed or dropped.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let before = self.settings_beside(other);
        let after = other.settings_beside(self);
        let value = |values: &[(String, String)], key: &str| {
            let known = values.iter().find(|(other, _)| other == key);
            known.map_or_else(|| "none".to_owned(), |(_, value)| value.clone())
        };
        let is_new = |(key, _): &&(String, String)| before.iter().all(|(other, _)| other != key);
        let keys = before.iter().chain(after.iter().filter(is_new));
        let change = |(key, _): &(String, String)| {
            let old = value(&before, key);
            let new = value(&after, key);
            (old != new).then(|| format!("{key}: {old} -> {new}"))
        };
        keys.filter_map(change).collect()
    }

    /// Keys and values of name, model, solver and recording, without the parameters that an axis of either sweep sets.
    fn settings_beside(&self, other: &Self) -> Vec<(String, String)> {
        let parameter = |symbol: Symbol| {
            let value = self.base.get(symbol).to_string();
            (format!("model.{}", symbol.key()), value)
        };
        let is_fixed = |symbol: &Symbol| !self.moves(*symbol) && !other.moves(*symbol);
        let name = ("name".to_owned(), self.name.clone());
        let mut values = vec![name];
        values.extend(Symbol::ALL.into_iter().filter(is_fixed).map(parameter));
        values.extend(settings(self.solver, &self.recording));
        if let Some(measured) = &self.measured {
            values.push(("measured.rows".to_owned(), measured.rows.clone()));
            values.push(("measured.options".to_owned(), measured.options.clone()));
        }
        values
    }

    /// Whether an axis sets a parameter; T also through η or the frequency.
    pub(super) fn moves(&self, symbol: Symbol) -> bool {
        self.axes.iter().flat_map(Axis::quantities).any(|quantity| {
            quantity == Quantity::Parameter(symbol) || (symbol == Symbol::T && quantity.is_period())
        })
    }

    /// Those of these points of the grid that are jobs, with their numbers, in canonical form.
    pub(super) fn admitted(
        &self,
        points: Range<u64>,
    ) -> impl Iterator<Item = (u64, GridPoint)> + Clone + Send + '_ {
        self.walk(self.row_counts(), points)
            .filter(|(number, point)| self.admits(point) && self.is_needed(*number))
    }

    /// The points of one seed that are jobs if the conditions hold, in canonical form.
    pub(super) fn points_of_one_seed(&self) -> impl Iterator<Item = GridPoint> {
        let mut counts = self.row_counts();
        if let Some(axis) = self.seed_axis() {
            counts[axis] = 1;
        }
        let points = 0..counts.iter().product();
        self.walk(counts, points).map(|(_, point)| point)
    }

    /// Walks through these points of a grid with this many rows of each axis, past points that repeat an earlier one.
    /// Yields canonical points with their numbers.
    fn walk(
        &self,
        counts: Vec<u64>,
        points: Range<u64>,
    ) -> impl Iterator<Item = (u64, GridPoint)> + Clone + Send + '_ {
        let mut rows = vec![0; counts.len()];
        points.filter_map(move |number| {
            find_rows(number, &counts, &mut rows);
            let point = self.point(&rows);
            let mut axes = self.axes.iter().zip(&rows);
            let mut is_first = || axes.all(|(axis, &row)| axis.is_first(row));
            (point.is_modulated() || is_first()).then(|| (number, point.canonical()))
        })
    }

    pub(super) fn point(&self, rows: &[u64]) -> GridPoint {
        let mut point = GridPoint {
            parameters: self.base.clone(),
            fixes_period: None,
        };
        for (axis, &row) in self.axes.iter().zip(rows) {
            axis.apply(row, &mut point);
        }
        point
    }

    /// Whether a canonical point fulfils the conditions, which see η and the frequency as columns have them.
    pub(super) fn admits(&self, point: &GridPoint) -> bool {
        let number = |&quantity: &Quantity| {
            let number = point.number(quantity);
            match quantity {
                Quantity::Eta | Quantity::Frequency => to_twelve_digits(number),
                Quantity::Parameter(_) => number,
            }
        };
        let mut conditions = self.conditions.iter();
        conditions.all(|condition| condition.evaluate(&number) == 1.0)
    }
}

/// Finds the rows of a point by its number, in a grid with this many rows of each axis.
pub(super) fn find_rows(mut number: u64, counts: &[u64], rows: &mut [u64]) {
    for (row, count) in rows.iter_mut().zip(counts).rev() {
        *row = number % count;
        number /= count;
    }
}

/// The frequency of a period, if it is the number with fewer digits and gives the period back to the same bits.
fn frequency_of(period: f64) -> Option<Shortest> {
    let frequency = to_twelve_digits(1.0 / period);
    let is_exact = (1.0 / frequency).to_bits() == period.to_bits();
    // Of the significand.
    let digits = |number: f64| format!("{number:e}").find('e');
    (is_exact && digits(frequency) < digits(period)).then_some(Shortest(frequency))
}
