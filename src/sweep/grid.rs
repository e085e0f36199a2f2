//! A sweep: the points of its axes in grid order, those that are jobs, and the look-up of a job without walking.
//!
//! Grid order: axes as in the file, the last moves fastest. A point is a job if the conditions hold and no earlier point
//! has the same parameters; that happens without modulation only, where T, η and the frequency mean nothing: there the
//! first row of the axis that fixes the period counts (see [`Axis`]). Conditions see canonical values, so they judge such
//! points alike. Memory does not grow with the number of points.

use super::axes::Axis;
use super::cost::predicted_cost;
use super::expression::Expression;
use super::job::{Identity, Job, settings};
use super::quantity::{Point, Quantity};
use super::rounds::Rounds;
use crate::model::theory::to_twelve_digits;
use crate::model::{Parameters, Symbol};
use crate::observe::Recording;
use crate::solver::Solver;
use std::ops::Range;

/// The version of the plan from which conditions see twelve digits of what fixes the period.
const CONDITIONS_SEE_COLUMNS: u32 = 7;

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
    /// The sweep of its controls; see `controls.rs`.
    pub(super) controls: Option<Box<Self>>,
    /// Of a sweep of controls, its sets that are run, in order; `None`: all.
    pub(super) needed: Option<Vec<u64>>,
    /// The version of the plan by which it is read.
    pub(super) plan_version: u32,
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

    /// Each axis in grid order: the keys that it moves, joined by commas, and its number of rows.
    pub fn axes(&self) -> impl Iterator<Item = (String, u64)> {
        self.axes.iter().map(|axis| {
            let keys: Vec<&str> = axis.quantities().into_iter().map(Quantity::key).collect();
            (keys.join(", "), axis.len())
        })
    }

    /// Keys of all axes.
    pub fn swept(&self) -> impl Iterator<Item = String> {
        self.axes
            .iter()
            .flat_map(Axis::quantities)
            .map(|quantity| quantity.key().to_owned())
    }

    /// Number of points of the grid, before the conditions drop some.
    pub fn point_count(&self) -> u64 {
        self.axes.iter().map(Axis::len).product()
    }

    /// Numbers of the points of the grid, and of the controls after them.
    pub(super) fn points(&self) -> Range<u64> {
        0..self.point_count()
            + self
                .controls
                .as_ref()
                .map_or(0, |controls| controls.point_count())
    }

    /// The jobs in grid order, then their controls.
    pub fn jobs(&self) -> impl Iterator<Item = Job> + Clone + Send + '_ {
        self.jobs_at(self.points())
    }

    /// The jobs of the grid, without controls.
    pub fn jobs_of_grid(&self) -> impl Iterator<Item = Job> + Clone + Send + '_ {
        self.jobs_at(0..self.point_count())
    }

    /// The jobs at these points, in order.
    pub fn jobs_at(&self, points: Range<u64>) -> impl Iterator<Item = Job> + Clone + Send + '_ {
        let count = self.point_count();
        let of_grid = self.admitted(points.start.min(count)..points.end.min(count));
        let others = points.start.max(count) - count..points.end.max(count) - count;
        let controls = self
            .controls
            .iter()
            .flat_map(move |controls| controls.admitted(others.clone()));
        let controls = controls.map(move |(number, point)| (count + number, point));
        let is_own = |(_, point): &(u64, Point)| self.find_in_grid(&point.parameters).is_none();
        of_grid
            .chain(controls.filter(is_own))
            .map(|(point, Point { parameters, .. })| {
                let cost = predicted_cost(&parameters, &self.recording, self.solver);
                Job {
                    point,
                    parameters,
                    cost,
                }
            })
    }

    /// Whether these canonical parameters are a job of this sweep: exact bits, without walking through the points.
    pub fn contains(&self, parameters: &Parameters) -> bool {
        self.find(parameters).is_some()
    }

    /// Number of the point that is the job with these canonical parameters.
    pub fn find(&self, parameters: &Parameters) -> Option<u64> {
        let control =
            || Some(self.point_count() + self.controls.as_ref()?.find_in_grid(parameters)?);
        self.find_in_grid(parameters).or_else(control)
    }

    /// Number of the point of a job with these canonical parameters, whatever its seed.
    pub fn find_set(&self, parameters: &Parameters) -> Option<u64> {
        let control =
            || Some(self.point_count() + self.controls.as_ref()?.find_set_in_grid(parameters)?);
        self.find_set_in_grid(parameters).or_else(control)
    }

    fn find_in_grid(&self, parameters: &Parameters) -> Option<u64> {
        let rows: Vec<u64> = self
            .axes
            .iter()
            .map(|axis| axis.find(parameters))
            .collect::<Option<_>>()?;
        let point = self.point(&rows).canonical();
        let number = || {
            self.axes
                .iter()
                .zip(rows)
                .fold(0, |number, (axis, row)| number * axis.len() + row)
        };
        let is_job = point.parameters == *parameters && self.admits(&point);
        is_job.then(number).filter(|&number| self.is_needed(number))
    }

    /// Number of a point of the grid with these canonical parameters, whatever the seed.
    pub(super) fn find_set_in_grid(&self, parameters: &Parameters) -> Option<u64> {
        // Where no condition reads the seed, all seeds are jobs or none is.
        let tried = if self.reads_seed() { usize::MAX } else { 1 };
        let seeds = self.axes.iter().find_map(|axis| axis.seeds(parameters));
        seeds
            .unwrap_or_else(|| Box::new(std::iter::once(self.base.seed)))
            .take(tried)
            .find_map(|seed| {
                self.find_in_grid(&Parameters {
                    seed,
                    ..parameters.clone()
                })
            })
    }

    /// Whether a condition reads the seed.
    pub(super) fn reads_seed(&self) -> bool {
        let mut names = self.conditions.iter().flat_map(Expression::names);
        names.any(|name| *name == Quantity::SEED)
    }

    fn is_needed(&self, number: u64) -> bool {
        let is_among = |needed: &Vec<u64>| needed.binary_search(&self.set_of(number)).is_ok();
        self.needed.as_ref().is_none_or(is_among)
    }

    pub fn job_id(&self, parameters: &Parameters) -> String {
        self.identity.job(parameters)
    }

    pub fn set_id(&self, parameters: &Parameters) -> String {
        self.identity.set(parameters)
    }

    /// The same with the ids that a program of other versions gave.
    pub fn with_ids_of(mut self, model_version: u32, rng_scheme: &str) -> Self {
        self.identity =
            Identity::of_versions(model_version, rng_scheme, self.solver, &self.recording);
        self
    }

    /// In what another sweep differs besides axes and conditions: name, model, recording, solver, each as section and key
    /// with the value before and after. Parameters that an axis of either sets are left out, as an axis may be added,
    /// changed or dropped.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let moved = |symbol| self.moves(symbol) || other.moves(symbol);
        let values = |sweep: &Self| {
            let model = Symbol::ALL
                .into_iter()
                .filter(|symbol| !moved(*symbol))
                .map(|symbol| {
                    (
                        format!("model.{}", symbol.key()),
                        sweep.base.get(symbol).to_string(),
                    )
                });
            let name = std::iter::once(("name".to_owned(), sweep.name.clone()));
            name.chain(model)
                .chain(settings(sweep.solver, &sweep.recording))
                .collect::<Vec<_>>()
        };
        let (before, after) = (values(self), values(other));
        let value = |values: &[(String, String)], key: &str| {
            values
                .iter()
                .find(|(other, _)| other == key)
                .map_or_else(|| "none".to_owned(), |(_, value)| value.clone())
        };
        let added = after
            .iter()
            .filter(|(key, _)| before.iter().all(|(other, _)| other != key));
        before
            .iter()
            .chain(added)
            .map(|(key, _)| (key, value(&before, key), value(&after, key)))
            .filter(|(_, before, after)| before != after)
            .map(|(key, before, after)| format!("{key}: {before} -> {after}"))
            .collect()
    }

    /// Whether an axis sets a parameter; T also through η or the frequency.
    fn moves(&self, symbol: Symbol) -> bool {
        self.axes.iter().flat_map(Axis::quantities).any(|quantity| {
            quantity == Quantity::Parameter(symbol) || (symbol == Symbol::T && quantity.is_period())
        })
    }

    /// Those of these points of the grid that are jobs, with their numbers, in canonical form.
    pub(super) fn admitted(
        &self,
        points: Range<u64>,
    ) -> impl Iterator<Item = (u64, Point)> + Clone + Send + '_ {
        self.walk(self.row_counts(), points)
            .filter(|(number, point)| self.admits(point) && self.is_needed(*number))
    }

    /// The points of one seed that are jobs if the conditions hold, in canonical form.
    pub(super) fn points_of_one_seed(&self) -> impl Iterator<Item = Point> {
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
    ) -> impl Iterator<Item = (u64, Point)> + Clone + Send + '_ {
        let mut rows = vec![0; counts.len()];
        points.filter_map(move |number| {
            find_rows(number, &counts, &mut rows);
            let point = self.point(&rows);
            let is_first = || {
                self.axes
                    .iter()
                    .zip(&rows)
                    .all(|(axis, &row)| axis.is_first(row))
            };
            (point.is_modulated() || is_first()).then(|| (number, point.canonical()))
        })
    }

    /// The point of these rows, as the axes set it.
    pub(super) fn point(&self, rows: &[u64]) -> Point {
        let mut point = Point {
            parameters: self.base.clone(),
            fixes_period: None,
        };
        for (axis, &row) in self.axes.iter().zip(rows) {
            axis.apply(row, &mut point);
        }
        point
    }

    /// Whether a canonical point fulfils the conditions, which see η and the frequency as columns have them.
    pub(super) fn admits(&self, point: &Point) -> bool {
        let number = |&quantity: &Quantity| {
            let number = point.number(quantity);
            let is_derived = matches!(quantity, Quantity::Eta | Quantity::Frequency);
            if is_derived && self.plan_version >= CONDITIONS_SEE_COLUMNS {
                to_twelve_digits(number)
            } else {
                number
            }
        };
        self.conditions
            .iter()
            .all(|condition| condition.evaluate(&number) == 1.0)
    }
}

/// Finds the rows of a point by its number, in a grid with this many rows of each axis.
pub(super) fn find_rows(mut number: u64, counts: &[u64], rows: &mut [u64]) {
    for (row, count) in rows.iter_mut().zip(counts).rev() {
        *row = number % count;
        number /= count;
    }
}
