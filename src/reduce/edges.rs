//! Edges: where a statistic of the population crosses a threshold along an axis, each with its 95 % interval.
//!
//! Sets lie clearly on one side of the threshold, if their interval does, or are unclear. Between two clear neighbours of
//! opposite sides, unclear ones left out, lies an edge; up and down are edges of their own. Of the sets in between, the two
//! count between which the estimate crosses most steeply. If both are clear, the edge lies between them, and nothing is
//! said of the response in between. If one is unclear, the edge is near it: it is where the line through the two crosses,
//! with Fieller's interval (E. C. Fieller, J. R. Stat. Soc. B 16, 175 (1954)). A response that is steeper than this line
//! only makes it too wide.
//!
//! Covariances come from a jackknife over groups of seeds, left out of both sets together, since a seed is a realisation
//! of the disorder common to all sets (F. M. T. A. Busing et al., Stat. Comput. 9, 3 (1999), for groups of unequal size).

use super::confidence::student;
use super::drive_alone::Explained;
use super::gather::{Gathered, Gathering, MAX_SLIPS};
use crate::model::Parameters;
use crate::model::selected::Selected;
use crate::results::Results;
use crate::sweep::{AllButSeed, Interval, Refinement, Sweep};
use crate::table::columns::{columns, tables};
use crate::table::file::DatasetError;
use crate::table::value::words;
use std::collections::BTreeMap;

/// Groups of seeds, so that the cost of leaving them out is bounded.
pub const GROUPS: usize = 30;
/// Rows of the grid between two sets up to which the response is taken for a line: at most three times the wanted width.
const WINDOW: u64 = 3;

words! {
    /// Why an edge is as precise as it is.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Ended {
        Width = "width",
        Seeds = "seeds",
        Jobs = "jobs",
        #[default]
        NoCrossing = "no crossing",
    }
}

columns! {
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct EdgeRow {
        set_id: String = "", "set at bracket_low, of which the parameters are";
        parameters: Selected<AllButSeed>;
        axis: String = "", "the refined axis; its values follow in the unit of that parameter";
        statistic: String = "", "what crosses the threshold, such as `resultant_length`, or `periods = 4`: the share of intervals nearest 4 T";
        threshold: f64 = "", "the threshold, in the unit of the statistic";
        edge: Option<f64> = "", "where it is crossed; null if it is not";
        edge_interval as "edge": Option<Interval> = "", "lower end of its 95 % confidence interval; null if there is no end on one side";
        rises: Option<bool> = "", "whether the statistic is above the threshold above the edge";
        jobs: u64 = "", "jobs of the two sets that the edge lies between; of the whole row if it has no edge";
        bracket_low: f64 = "", "the nearest value clearly on one side; the least of the row if it has no edge";
        bracket_high: f64 = "", "the nearest clearly on the other; the largest of the row if it has no edge";
        ended: Ended = "",
            "`width`: the interval is as narrow as is wanted; `seeds`: its sets have the most; `jobs`: no more may run, or the run is not over; `no crossing` between the values of the row";
    }
}

tables! { EdgeRow = "edges", "One row per edge, and per row of sets without one, if the sweep has `[refine]`"; }

/// A statistic less its threshold, and what each group of seeds adds to it.
#[derive(Clone, Debug)]
pub struct Sample {
    excess: f64,
    /// Of the mean of independent values: the sums of their deviations from it, over their number.
    influences: [f64; GROUPS],
    /// Sum of the squared shares of the groups in all jobs.
    concentration: f64,
}

impl Sample {
    /// From the jobs of each group, and the value of all jobs but those of a group; `None` if one of these has none.
    pub fn new(counts: &[u64; GROUPS], threshold: f64, less: impl Fn(Option<usize>) -> Option<f64>) -> Option<Self> {
        let (jobs, value) = (counts.iter().sum::<u64>() as f64, less(None)?);
        let mut sample = Self { excess: value - threshold, influences: [0.0; GROUPS], concentration: 0.0 };
        for (group, &count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
            let share = count as f64 / jobs;
            sample.influences[group] = (1.0 - share) * (value - less(Some(group))?);
            sample.concentration += share * share;
        }
        Some(sample)
    }

    /// Below the threshold, above it, or equal if that is not clear.
    fn side(&self) -> f64 {
        let half = (quantile(self.concentration) * product(&self.influences, &self.influences)).sqrt();
        if self.excess.abs() > half { self.excess.signum() } else { 0.0 }
    }
}

/// The square of Student's t, with the degrees of freedom of these groups; and of what makes a sum of squares a variance.
fn quantile(concentration: f64) -> f64 {
    let t = student(1.0 / concentration - 1.0);
    t * t / (1.0 - concentration)
}

fn product(left: &[f64; GROUPS], right: &[f64; GROUPS]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

/// What the rounds know of a set.
#[derive(Clone, Debug, Default)]
pub struct SetOfEdges {
    pub set_id: String,
    pub parameters: Parameters,
    /// Seeds that it was given.
    pub seeds: u64,
    /// For each statistic; `None` if it has no value.
    pub samples: Vec<Option<Sample>>,
}

/// A set on the refined axis: its row, and its place there, on a logarithmic axis the logarithm.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    pub row: u64,
    place: f64,
    side: f64,
    sample: Option<&'a Sample>,
    pub set: &'a SetOfEdges,
}

/// Sets that differ in the refined axis alone, and the edges of one statistic.
#[derive(Clone, Debug)]
pub struct Line<'a> {
    /// Rows of all axes, that of the refined one being any.
    pub rows: Vec<u64>,
    statistic: usize,
    sets: Vec<Placed<'a>>,
    pub edges: Vec<Edge<'a>>,
}

#[derive(Clone, Debug)]
pub struct Edge<'a> {
    /// The two sets that it lies between by their estimates.
    pub pair: [Placed<'a>; 2],
    bracket: [Placed<'a>; 2],
    /// Whether both sets of the pair are clear.
    pub is_bracketed: bool,
    /// Where it is, and the ends of its interval, as places on the axis.
    pub(crate) place: f64,
    pub(crate) interval: Option<[f64; 2]>,
    /// Width of the interval over that wanted.
    pub error: f64,
}

impl<'a> Edge<'a> {
    /// Between the first and the last of these sets, which are clear, the others not.
    fn between(sets: &[Placed<'a>], width: f64) -> Option<Self> {
        let bracket = [*sets.first()?, *sets.last()?];
        let excess = |set: &Placed<'_>| set.sample.map_or(0.0, |sample| bracket[1].side * sample.excess);
        let rise = |pair: &&[Placed<'_>]| excess(&pair[1]) - excess(&pair[0]);
        let crossings = sets.windows(2).filter(|pair| excess(&pair[0]) <= 0.0 && excess(&pair[1]) > 0.0);
        let steepest = crossings.max_by(|left, right| rise(left).total_cmp(&rise(right)))?;
        let pair = [steepest[0], steepest[1]];
        let (at, ends) = crossing(pair[0].sample?, pair[1].sample?);
        let place = |share: f64| pair[0].place + share * (pair[1].place - pair[0].place);
        let is_bracketed = pair.iter().all(|set| set.side != 0.0);
        let interval = if is_bracketed { Some([0.0, 1.0]) } else { ends }.map(|ends| ends.map(place));
        let error = interval.map_or(f64::INFINITY, |[low, high]| (high - low) / width);
        Some(Self { pair, bracket, is_bracketed, place: place(at), interval, error })
    }

    fn gap(&self) -> u64 {
        self.pair[1].row - self.pair[0].row
    }

    /// The row of the set that is wanted next between the two, if these are too far from each other.
    pub fn wanted_row(&self) -> Option<u64> {
        let [low, high] = self.pair;
        if self.is_bracketed {
            return (self.gap() > 1).then(|| low.row + self.gap() / 2);
        }
        let share = (self.place - low.place) / (high.place - low.place);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a number of rows")]
        let row = low.row + (share * self.gap() as f64).round() as u64;
        (self.gap() > WINDOW).then(|| row.clamp(low.row + WINDOW - 1, high.row - (WINDOW - 1)))
    }

    /// Whether its interval is as narrow as is wanted.
    pub fn is_done(&self) -> bool {
        self.wanted_row().is_none() && (self.is_bracketed || self.error <= 1.0)
    }
}

/// Where the line through two samples crosses zero, as a share of the way between them, and the ends of its interval: none
/// if the slope may be zero.
fn crossing(low: &Sample, high: &Sample) -> (f64, Option<[f64; 2]>) {
    let (begin, slope) = (low.excess, high.excess - low.excess);
    let slopes = std::array::from_fn(|group| high.influences[group] - low.influences[group]);
    let factor = quantile(low.concentration.max(high.concentration));
    // All shares x at which the line is no more than t standard deviations away: a + 2 b x + c x² <= 0.
    let a = begin * begin - factor * product(&low.influences, &low.influences);
    let b = begin * slope - factor * product(&low.influences, &slopes);
    let c = slope * slope - factor * product(&slopes, &slopes);
    let root = (b * b - a * c).max(0.0).sqrt();
    (-begin / slope, (c > 0.0).then(|| [-(b + root) / c, (root - b) / c]))
}

/// The rows of sets, in the order of the grid, for each statistic.
pub fn lines<'a>(sweep: &Sweep, refinement: &Refinement, sets: &'a BTreeMap<u64, SetOfEdges>) -> Vec<Line<'a>> {
    let mut rows_of: BTreeMap<Vec<u64>, Vec<(u64, &SetOfEdges)>> = BTreeMap::new();
    for (&number, set) in sets {
        let mut rows = sweep.rows(number);
        let row = std::mem::take(&mut rows[refinement.axis]);
        rows_of.entry(rows).or_default().push((row, set));
    }
    let width = if refinement.is_log { libm::log1p(refinement.to) } else { refinement.to };
    let line = |rows: &Vec<u64>, of_row: &[(u64, &'a SetOfEdges)], statistic: usize| {
        let placed = |&(row, set): &(u64, &'a SetOfEdges)| {
            let (_, value) = sweep.value_at(refinement.axis, row)?;
            let sample = set.samples.get(statistic).and_then(Option::as_ref);
            let place = if refinement.is_log { libm::log(value) } else { value };
            Some(Placed { row, place, side: sample.map_or(0.0, Sample::side), sample, set })
        };
        let sets: Vec<Placed<'_>> = of_row.iter().filter_map(placed).collect();
        // Without a value, a set says nothing.
        let known: Vec<Placed<'_>> = sets.iter().copied().filter(|set| set.sample.is_some()).collect();
        let clear: Vec<usize> = (0..known.len()).filter(|&index| known[index].side != 0.0).collect();
        let opposite = clear.windows(2).filter(|pair| known[pair[0]].side != known[pair[1]].side);
        let edges = opposite.filter_map(|pair| Edge::between(&known[pair[0]..=pair[1]], width)).collect();
        Line { rows: rows.clone(), statistic, sets, edges }
    };
    let statistics = 0..refinement.by.len();
    rows_of.iter().flat_map(|(rows, sets)| statistics.clone().map(|number| line(rows, sets, number))).collect()
}

/// The table of edges of a directory.
pub(super) fn edge_rows(results: &Results<'_>, refinement: &Refinement) -> Result<Vec<EdgeRow>, DatasetError> {
    let (sweep, sets) = (results.sweep(), sets_of_edges(results, refinement)?);
    let mut found = Vec::new();
    for Line { statistic, sets, edges, .. } in lines(sweep, refinement, &sets) {
        let value = |place: f64| if refinement.is_log { libm::exp(place) } else { place };
        let row = |bracket: [Placed<'_>; 2], edge: Option<&Edge<'_>>| {
            let ends = bracket.map(|set| sweep.value_at(refinement.axis, set.row));
            let [Some((axis, bracket_low)), Some((_, bracket_high))] = ends else { return None };
            let is_capped = |edge: &Edge<'_>| edge.pair.iter().all(|set| set.set.seeds >= sweep.seed_count());
            let jobs = |sets: &[Placed<'_>]| sets.iter().map(|set| set.set.seeds).sum();
            Some(EdgeRow {
                set_id: bracket[0].set.set_id.clone(),
                parameters: Selected::new(bracket[0].set.parameters.clone()),
                axis: axis.to_owned(),
                statistic: refinement.name_of(statistic),
                threshold: refinement.threshold,
                edge: edge.map(|edge| value(edge.place)),
                edge_interval: edge
                    .and_then(|edge| edge.interval)
                    .map(|[low, high]| Interval { low: value(low), high: value(high) }),
                rises: edge.map(|edge| edge.bracket[1].side > 0.0),
                jobs: edge.map_or_else(|| jobs(&sets), |edge| jobs(&edge.pair)),
                bracket_low,
                bracket_high,
                ended: match edge {
                    None => Ended::NoCrossing,
                    Some(edge) if edge.is_done() => Ended::Width,
                    Some(edge) if edge.wanted_row().is_none() && is_capped(edge) => Ended::Seeds,
                    Some(_) => Ended::Jobs,
                },
            })
        };
        found.extend(edges.iter().filter_map(|edge| row(edge.bracket, Some(edge))));
        if let (true, Some(&first), Some(&last)) = (edges.is_empty(), sets.first(), sets.last()) {
            found.extend(row([first, last], None));
        }
    }
    Ok(found)
}

/// The sets that the rounds of a directory have chosen, by their numbers, controls left out.
pub fn sets_of_edges(
    results: &Results<'_>,
    refinement: &Refinement,
) -> Result<BTreeMap<u64, SetOfEdges>, DatasetError> {
    let (sweep, chosen) = (results.sweep(), results.chosen());
    let is_chosen = |parameters: &Parameters| sweep.find(parameters).is_some_and(|point| chosen.has(point));
    let mut sets = BTreeMap::new();
    Gathering::of_jobs(results, &is_chosen)?.each_gathered(MAX_SLIPS, u64::MAX, |set, explained| {
        let number = sweep.set_with(&set.jobs.parameters).filter(|&number| number < sweep.point_count());
        sets.extend(number.map(|number| (number, of_set(&set, &explained, refinement))));
        Ok(())
    })?;
    Ok(sets)
}

fn of_set(set: &Gathered, explained: &Explained, refinement: &Refinement) -> SetOfEdges {
    let group = |seed: u64| usize::try_from(seed % GROUPS as u64).unwrap_or_default();
    let mut counts = [0; GROUPS];
    set.jobs.averages.keys().for_each(|&seed| counts[group(seed)] += 1);
    let without = |left_out: Option<usize>| {
        let part = set.only(|seed| Some(group(seed)) != left_out);
        if let Some(periods) = refinement.periods {
            return vec![part.slips.share_of_periods(periods as f64)];
        }
        let row = part.finish_with(explained).0.row;
        refinement.by.iter().map(|by| row.number(by.key)).collect()
    };
    let all = without(None);
    let each: Vec<Vec<Option<f64>>> = counts
        .iter()
        .enumerate()
        .map(|(group, count)| if *count > 0 { without(Some(group)) } else { Vec::new() })
        .collect();
    let sample = |statistic: usize| {
        Sample::new(&counts, refinement.threshold, |group| {
            group.map_or(&all, |group| &each[group]).get(statistic).copied()?
        })
    };
    SetOfEdges {
        set_id: set.jobs.set_id.clone(),
        parameters: set.jobs.parameters.clone(),
        seeds: set.jobs.finished + set.jobs.failed,
        samples: (0..refinement.by.len()).map(sample).collect(),
    }
}
