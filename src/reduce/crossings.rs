//! Edges: where a statistic of the population crosses a threshold along an axis, each with its 95 % interval.
//!
//! A set is clear if its interval lies on one side of the threshold. Between two clear neighbours of opposite sides,
//! unclear sets left out, lies an edge; up and down are separate edges. Of the sets in between, two neighbours count
//! between which the estimate crosses. If both are clear, the edge lies between them, and nothing is said of the
//! response there. If not, it is near: where a line through the sets of a small window crosses, with Fieller's interval
//! (E. C. Fieller, J. R. Stat. Soc. B 16, 175 (1954)); where that has no end, as the line may be level, with the
//! bracket of clear sets.
//!
//! Beyond the last clear set, and between two on the same side, an unclear set may hide edges, so a row says that
//! nothing crosses only if all its sets are clear.
//!
//! A seed is left out of all sets together, since it is one realisation of the disorder in all of them. Places on the
//! axis are rows of the grid and fractions of them.

use super::drive_alone::Explained;
use super::estimate::{CONFIDENCE, Estimate};
use super::gather::{Gathered, has_jobs, of_chosen};
use crate::model::{Parameters, Selected};
use crate::results::{Results, ResultsError};
use crate::sets::{AllButSeed, Digits, Statistic, label};
use crate::sweep::{Refinement, Sweep};
use crate::table::columns::{Interval, columns};
use crate::table::tables;
use crate::table::value::{floored, words};
use std::collections::BTreeMap;
use std::iter::once;

/// Rows up to which sets lie close to each other, and to the edge for the line: one is at most the wanted width. Fewer
/// where they are a larger share of the value at the edge, over which responses bend.
const WINDOW: f64 = 3.0;
const LARGEST_SHARE: f64 = 0.2;
/// Factor of the interval of a line, as windows that are steep by chance end first: measured, docs/rounds.md.
const LOOKS: f64 = 1.2;
/// How often the window is moved to where its line crosses.
const MOVES: usize = 3;

words! {
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Ended {
        Width = "width",
        Seeds = "seeds",
        Jobs = "jobs",
        Open = "open",
        UnclearEnd = "unclear end",
        Unclear = "unclear",
        NoValue = "no value",
        #[default]
        NoCrossing = "no crossing",
    }
}

columns! {
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct EdgeRow {
        set_id: String = "", "set at bracket_low, whose parameters follow";
        parameters: Selected<AllButSeed>;
        axis: String = "", "the refined axis; edge and brackets have its unit";
        statistic: String = "", "what crosses the threshold, such as `resultant_length`, or `periods = 4`: the share of intervals nearest 4 T";
        threshold: f64 = "", "in the unit of the statistic";
        edge: Option<f64> = "", "where it is crossed, if it is";
        edge_interval as "edge": Option<Interval> = "", "lower end of its 95 % confidence interval";
        rises: Option<bool> = "", "whether the statistic is higher above the edge";
        jobs: u64 = "", "jobs of the sets that place the edge or are unclear; of the whole row if nothing crosses";
        bracket_low: f64 = "", "nearest value that is clearly on one side, or the end of the row";
        bracket_high: f64 = "", "nearest value above it that is clearly on the other side (the same if `ended` is `unclear`), or the end of the row";
        ended: Ended = "",
            "`width`: the interval is narrow enough; `seeds`: its sets have the most seeds; `jobs`: no more may run; `open`: the rounds go on; `unclear end`: with all seeds or jobs, the interval of the set at an end of the row still holds the threshold; `unclear`: the same of a set between two on one side; `no value`: no set has a value; `no crossing`: all values are clearly on one side";
    }
}

tables! { EdgeRow = "edges", "One row per edge, and per row of sets without one, if the sweep has `[refine]`"; }

impl EdgeRow {
    /// What is crossed, in symbols.
    pub fn crossed(&self) -> String {
        let what = match self.statistic.split_once(" = ") {
            Some((_, n)) => format!("share of n = {n} is"),
            None => format!("{} =", label(&self.statistic).symbol),
        };
        format!("{what} {}", Digits::THREE.number(self.threshold))
    }

    /// What finds the edge that may be there, if a set is not clear.
    pub fn way_out(&self) -> Option<&'static str> {
        match self.ended {
            Ended::UnclearEnd => Some("unclear: raise seeds.to, or widen the axis"),
            Ended::Unclear => Some("unclear: raise seeds.to"),
            Ended::NoValue => Some("no set has a value: record more slips a job"),
            Ended::Width | Ended::Seeds | Ended::Jobs | Ended::Open | Ended::NoCrossing => None,
        }
    }
}

/// What the rounds know of a set.
#[derive(Clone, Debug, Default)]
pub struct SetOfEdges {
    pub set_id: String,
    pub parameters: Parameters,
    pub seeds: u64,
    /// Each statistic less its threshold; `None` if it has no value.
    pub(crate) excesses: Vec<Option<Estimate>>,
}

/// Of a threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Below,
    Above,
}

impl Side {
    const fn sign(self) -> f64 {
        match self {
            Self::Below => -1.0,
            Self::Above => 1.0,
        }
    }
}

/// A set on the refined axis.
#[derive(Clone, Copy, Debug)]
pub struct Placed<'a> {
    pub row: u64,
    /// Where it lies, if that is clear.
    side: Option<Side>,
    excess: &'a Estimate,
    pub set: &'a SetOfEdges,
}

impl<'a> Placed<'a> {
    fn new(row: u64, excess: &'a Estimate, set: &'a SetOfEdges) -> Self {
        let mut placed = Self {
            row,
            side: None,
            excess,
            set,
        };
        if placed.error() < 1.0 {
            placed.side = Some(if excess.value < 0.0 {
                Side::Below
            } else {
                Side::Above
            });
        }
        placed
    }

    /// The half-width of its interval over its distance from the threshold: at least 1 if it is not clear.
    pub fn error(&self) -> f64 {
        let half = self.excess.half_width().unwrap_or(f64::INFINITY);
        half / self.excess.value.abs()
    }
}

/// Sets next to each other that are not clear, and lie between no two that are on opposite sides.
#[derive(Clone, Debug)]
pub struct Stretch<'a> {
    /// Those that decide whether an edge is hidden there: at an end of the line the last one, else all.
    pub sets: Vec<Placed<'a>>,
    /// The clear sets beside them, or the ends of the line.
    bracket: [Placed<'a>; 2],
    ended: Ended,
}

impl<'a> Stretch<'a> {
    /// Between two sets of a line that are clear, or beyond the last; `None` if all there are clear.
    fn between(all: &[Placed<'a>], first: Option<usize>, last: Option<usize>) -> Option<Self> {
        let unclear = &all[first.map_or(0, |first| first + 1)..last.unwrap_or(all.len())];
        let [low, high] = [*unclear.first()?, *unclear.last()?];
        let ends = [
            first.is_none().then_some(low),
            last.is_none().then_some(high),
        ];
        let mut sets: Vec<Placed<'_>> = ends.into_iter().flatten().collect();
        sets.dedup_by_key(|set| set.row);
        let mut ended = Ended::UnclearEnd;
        if sets.is_empty() {
            (sets, ended) = (unclear.to_vec(), Ended::Unclear);
        }
        let beside = |clear: Option<usize>, end| clear.map_or(end, |clear| all[clear]);
        Some(Self {
            sets,
            bracket: [beside(first, low), beside(last, high)],
            ended,
        })
    }
}

/// Sets that differ in the refined axis alone, and the edges of one statistic.
#[derive(Clone, Debug)]
pub struct Line<'a> {
    /// Rows of all axes, that of the refined one being 0.
    pub rows: Vec<u64>,
    statistic: Statistic,
    sets: Vec<(u64, &'a SetOfEdges)>,
    has_values: bool,
    pub edges: Vec<Edge<'a>>,
    pub unclear: Vec<Stretch<'a>>,
}

#[derive(Clone, Debug)]
pub struct Edge<'a> {
    /// The sets that say where it is: two neighbours that are clear, or those of the window.
    pub sets: Vec<Placed<'a>>,
    bracket: [Placed<'a>; 2],
    /// Where it is, and the ends of its interval.
    pub(crate) place: f64,
    pub(crate) interval: [f64; 2],
    /// The row of the axis at which a line through these sets crosses.
    crossing: Option<Estimate>,
    /// Width of the interval over that wanted; infinite if no line gives one.
    pub error: f64,
    /// The row between two neighbours that is wanted next, if these are too far from each other.
    pub wanted_row: Option<u64>,
    is_bracketed: bool,
}

impl<'a> Edge<'a> {
    /// Between two sets of a line that are clear, those in between being unclear. `width` is wanted; `window` are the
    /// rows for a line at a place.
    fn between(
        all: &[Placed<'a>],
        [first, last]: [usize; 2],
        width: f64,
        window: impl Fn(f64) -> u64,
    ) -> Option<Self> {
        let bracket = [all[first], all[last]];
        let sign = bracket[1].side?.sign();
        let excess = |set: &Placed<'_>| sign * set.excess.value;
        let rise = |pair: &&[Placed<'_>]| excess(&pair[1]) - excess(&pair[0]);
        let crosses = |pair: &&[Placed<'_>]| excess(&pair[0]) <= 0.0 && excess(&pair[1]) > 0.0;
        let crossings = all[first..=last].windows(2).filter(crosses);
        let pair = crossings.max_by(|left, right| rise(left).total_cmp(&rise(right)))?;
        let ends = [pair[0].row, pair[1].row].map(|row| row as f64);
        if pair.iter().all(|set| set.side.is_some()) {
            let gap = pair[1].row - pair[0].row;
            let wanted_row = (gap > 1).then(|| pair[0].row + gap / 2);
            let place = ends[0] - gap as f64 * excess(&pair[0]) / rise(&pair);
            let error = gap as f64 / width;
            return Some(Self {
                crossing: fit(pair, ends[0]).map(|line| line.estimate),
                sets: pair.to_vec(),
                bracket,
                place,
                interval: ends,
                error,
                wanted_row,
                is_bracketed: true,
            });
        }
        let near =
            |set: &&Placed<'_>, place: f64| (set.row as f64 - place).abs() <= window(place) as f64;
        let mut place = fit(pair, ends[0])?.crossing;
        let ends = bracket.map(|set| set.row as f64);
        for _ in 0..MOVES {
            let sets = all.iter().filter(|set| near(set, place));
            let line = fit(&sets.copied().collect::<Vec<_>>(), place);
            let Some(line) = line.filter(|line| line.slope * sign > 0.0) else {
                break;
            };
            place = line.crossing.clamp(ends[0], ends[1]);
        }
        let above = all
            .partition_point(|set| set.row as f64 <= place)
            .clamp(1, all.len() - 1);
        let low = all[above - 1].row;
        let high = all[above].row;
        let nearest = floored(place.round()) as u64;
        let window = window(place);
        let inner = window.saturating_sub(1).max(1);
        let wanted_row = (high - low > window).then(|| nearest.clamp(low + inner, high - inner));
        let is_used = |set: &&Placed<'_>| near(set, place) || set.row == low || set.row == high;
        let sets: Vec<Placed<'_>> = all.iter().filter(is_used).copied().collect();
        let line = fit(&sets, place)?;
        let (place, interval, error) = match line.interval {
            Some([low, high]) => (line.crossing, [low, high], (high - low) / width),
            None => (place, ends, f64::INFINITY),
        };
        Some(Self {
            sets,
            bracket,
            place,
            interval,
            crossing: Some(line.estimate),
            error,
            wanted_row,
            is_bracketed: false,
        })
    }

    /// Fewest and most seeds of its sets.
    pub fn seeds(&self) -> [u64; 2] {
        let seeds = self.sets.iter().map(|set| set.set.seeds);
        seeds.fold([u64::MAX, 0], |[fewest, most], seeds| {
            [fewest.min(seeds), most.max(seeds)]
        })
    }

    /// Whether its interval is as narrow as is wanted.
    pub fn is_done(&self) -> bool {
        let [fewest, most] = self.seeds();
        self.wanted_row.is_none() && (self.is_bracketed || (self.error <= 1.0 && fewest == most))
    }

    /// What ended the search, if a set has at most `max_seeds` seeds.
    fn ended(&self, max_seeds: u64, is_over: bool) -> Ended {
        if self.is_done() {
            Ended::Width
        } else if self.wanted_row.is_none() && self.seeds()[0] >= max_seeds {
            Ended::Seeds
        } else if is_over {
            Ended::Jobs
        } else {
            Ended::Open
        }
    }
}

/// A line through the samples of sets.
struct Fit {
    slope: f64,
    /// Where it crosses zero, and the ends of its interval; `None` if the slope may be zero.
    crossing: f64,
    interval: Option<[f64; 2]>,
    estimate: Estimate,
}

/// By least squares, sets weighted by their seeds; `None` for less than two rows.
fn fit(sets: &[Placed<'_>], origin: f64) -> Option<Fit> {
    let point = |set: &Placed<'_>| (set.row as f64 - origin, set.set.seeds as f64);
    let points = || sets.iter().map(point);
    let total: f64 = points().map(|(_, weight)| weight).sum();
    let mean = points().map(|(x, weight)| weight * x).sum::<f64>() / total;
    let moments = points().map(|(x, weight)| weight * (x - mean) * (x - mean));
    let moment: f64 = moments.sum();
    // Of the line at the origin, and of its slope.
    let sum = |weight: &dyn Fn(f64, f64) -> f64| {
        let pairs = sets.iter().zip(points());
        let terms = pairs.map(|(set, (x, of_set))| set.excess.times(weight(x, of_set)));
        terms.reduce(|sum, term| Estimate::function([&sum, &term], |[sum, term]| sum + term))
    };
    let of_slope = |x: f64, weight: f64| weight * (x - mean) / moment;
    let begin = sum(&|x, weight| weight / total - mean * of_slope(x, weight))?;
    let slope = sum(&of_slope)?;
    let t = LOOKS * slope.student(CONFIDENCE);
    let [not_seen, ends] = begin.allowances();
    let beyond_error = |left: &Estimate, right: &Estimate| {
        let covariance = left.covariance(right).unwrap_or(f64::INFINITY);
        left.value * right.value - t * t * covariance
    };
    // All x at which the line is no more than so many standard deviations away: a + 2 b x + c x² <= 0.
    let a = beyond_error(&begin, &begin) - (not_seen + ends) * (not_seen + ends);
    let b = beyond_error(&begin, &slope);
    let c = beyond_error(&slope, &slope);
    let root = (b * b - a * c).max(0.0).sqrt();
    let interval = (c > 0.0).then(|| [origin - (b + root) / c, origin + (root - b) / c]);
    let estimate = Estimate::function([&begin, &slope], |[begin, slope]| origin - begin / slope);
    (moment > 0.0).then(|| Fit {
        estimate,
        slope: slope.value,
        crossing: origin - begin.value / slope.value,
        interval,
    })
}

/// The rows of sets, in the order of the grid, for each statistic.
pub fn lines<'a>(
    sweep: &Sweep,
    refinement: &Refinement,
    sets: &'a BTreeMap<u64, SetOfEdges>,
) -> Vec<Line<'a>> {
    let mut rows_of: BTreeMap<Vec<u64>, Vec<(u64, &SetOfEdges)>> = BTreeMap::new();
    for (&number, set) in sets {
        let mut rows = sweep.rows(number);
        let row = std::mem::take(&mut rows[refinement.axis]);
        rows_of.entry(rows).or_default().push((row, set));
    }
    let to = if refinement.is_log {
        libm::log1p(refinement.to)
    } else {
        refinement.to
    };
    let scale = Scale::of(sweep, refinement);
    let width = to / scale.step;
    let window = |place: f64| {
        let value = if scale.is_log {
            1.0
        } else {
            scale.value(place).abs()
        };
        floored((LARGEST_SHARE * value / scale.step).clamp(1.0, WINDOW)) as u64
    };
    let mut lines = Vec::new();
    for (rows, sets) in &rows_of {
        for (number, &statistic) in refinement.by.iter().enumerate() {
            // Without a value, a set says nothing.
            let placed = |&(row, set): &(u64, &'a SetOfEdges)| {
                let excess = set.excesses.get(number)?.as_ref()?;
                Some(Placed::new(row, excess, set))
            };
            let known: Vec<Placed<'_>> = sets.iter().filter_map(placed).collect();
            let is_clear = |index: &usize| known[*index].side.is_some();
            let clear = (0..known.len()).filter(is_clear).map(Some);
            let bounds: Vec<Option<usize>> = once(None).chain(clear).chain([None]).collect();
            let mut line = Line {
                rows: rows.clone(),
                statistic,
                sets: sets.clone(),
                has_values: !known.is_empty(),
                edges: Vec::new(),
                unclear: Vec::new(),
            };
            for pair in bounds.windows(2) {
                match (pair[0], pair[1]) {
                    (Some(first), Some(last)) if known[first].side != known[last].side => {
                        let edge = Edge::between(&known, [first, last], width, window);
                        line.edges.extend(edge);
                    }
                    (first, last) => line.unclear.extend(Stretch::between(&known, first, last)),
                }
            }
            lines.push(line);
        }
    }
    lines
}

/// Where the rows of the refined axis lie.
struct Scale {
    /// Value of the first row, and the step of rows; of their logarithms on a logarithmic axis.
    first: f64,
    step: f64,
    is_log: bool,
}

impl Scale {
    fn of(sweep: &Sweep, refinement: &Refinement) -> Self {
        let is_log = refinement.is_log;
        let place = |row: u64| {
            let (_, value) = sweep.value_at(refinement.axis, row);
            if is_log { libm::log(value) } else { value }
        };
        let last = sweep.row_counts()[refinement.axis] - 1;
        let first = place(0);
        Self {
            first,
            step: (place(last) - first) / last as f64,
            is_log,
        }
    }

    /// The value of the parameter at a row, or a fraction of one.
    fn value(&self, row: f64) -> f64 {
        let place = self.first + self.step * row;
        if self.is_log { libm::exp(place) } else { place }
    }
}

pub(super) fn edge_rows(
    results: &Results<'_>,
    refinement: &Refinement,
) -> Result<Vec<EdgeRow>, ResultsError> {
    let sweep = results.sweep();
    let sets = sets_of_edges(results, refinement)?;
    let scale = Scale::of(sweep, refinement);
    let is_over = results.rounds_so_far().is_none_or(|rounds| rounds.is_over);
    let mut rows = Vec::new();
    for line in lines(sweep, refinement, &sets) {
        let key = line.statistic.key;
        for edge in &line.edges {
            let [low, high] = &edge.bracket;
            rows.push(EdgeRow {
                edge: Some(scale.value(edge.place)),
                edge_interval: Some(Interval {
                    low: scale.value(edge.interval[0]),
                    high: scale.value(edge.interval[1]),
                }),
                rises: Some(high.side == Some(Side::Above)),
                jobs: edge.sets.iter().map(|set| set.set.seeds).sum(),
                ended: edge.ended(sweep.seed_count(), is_over),
                ..row_between(sweep, refinement, key, (low.row, low.set), high.row)
            });
        }
        for stretch in &line.unclear {
            let [low, high] = &stretch.bracket;
            rows.push(EdgeRow {
                jobs: stretch.sets.iter().map(|set| set.set.seeds).sum(),
                ended: if is_over { stretch.ended } else { Ended::Open },
                ..row_between(sweep, refinement, key, (low.row, low.set), high.row)
            });
        }
        if line.edges.is_empty()
            && line.unclear.is_empty()
            && let Some((first, last)) = line.sets.first().zip(line.sets.last())
        {
            rows.push(EdgeRow {
                jobs: line.sets.iter().map(|(_, set)| set.seeds).sum(),
                ended: if line.has_values {
                    Ended::NoCrossing
                } else {
                    Ended::NoValue
                },
                ..row_between(sweep, refinement, key, *first, last.0)
            });
        }
    }
    Ok(rows)
}

/// The edges of two statistics on one row, by how much the second lies further, and its interval.
pub struct EdgePair {
    pub edges: [EdgeRow; 2],
    pub difference: f64,
    pub interval: Option<Interval>,
}

/// Of the first statistic and each other, by the seeds of both.
pub fn pairs_of_edges(results: &Results<'_>) -> Result<Vec<EdgePair>, ResultsError> {
    let sweep = results.sweep();
    let has_jobs = has_jobs(results)?;
    let refinement = sweep.refinement();
    let Some(refinement) = refinement.filter(|refinement| refinement.by.len() > 1 && has_jobs)
    else {
        return Ok(Vec::new());
    };
    let sets = sets_of_edges(results, refinement)?;
    let scale = Scale::of(sweep, refinement);
    let mut found = Vec::new();
    for of_row in lines(sweep, refinement, &sets).chunk_by(|line, next| line.rows == next.rows) {
        let others = of_row.iter().skip(1);
        let edges = others.flat_map(|other| {
            of_row[0]
                .edges
                .iter()
                .zip(&other.edges)
                .map(move |pair| (pair, other))
        });
        for ((edge, other), line) in edges {
            let Some([crossing, of_other]) = edge
                .crossing
                .as_ref()
                .zip(other.crossing.as_ref())
                .map(<[_; 2]>::from)
            else {
                continue;
            };
            let value = |row| scale.value(row);
            let difference = Estimate::function([crossing, of_other], |[row, other]| {
                value(other) - value(row)
            });
            // As wide as that of an edge, for the same reason.
            let half = difference.half_width().map(|half| LOOKS * half);
            let row = |key, edge: &Edge<'_>| EdgeRow {
                edge: Some(scale.value(edge.place)),
                ..row_between(
                    sweep,
                    refinement,
                    key,
                    (edge.bracket[0].row, edge.bracket[0].set),
                    edge.bracket[1].row,
                )
            };
            found.push(EdgePair {
                edges: [
                    row(of_row[0].statistic.key, edge),
                    row(line.statistic.key, other),
                ],
                difference: difference.value,
                interval: half.map(|half| Interval::around(difference.value, half)),
            });
        }
    }
    Ok(found)
}

/// A row without an edge between the first of these rows of the axis, with its set, and the last.
fn row_between(
    sweep: &Sweep,
    refinement: &Refinement,
    key: &str,
    (first, set): (u64, &SetOfEdges),
    last: u64,
) -> EdgeRow {
    let (axis, bracket_low) = sweep.value_at(refinement.axis, first);
    let (_, bracket_high) = sweep.value_at(refinement.axis, last);
    EdgeRow {
        set_id: set.set_id.clone(),
        parameters: Selected::new(set.parameters.clone()),
        axis: axis.to_owned(),
        statistic: match refinement.periods {
            None => key.to_owned(),
            Some(periods) => format!("{key} = {periods}"),
        },
        threshold: refinement.threshold,
        bracket_low,
        bracket_high,
        ..EdgeRow::default()
    }
}

/// The sets that the rounds of a directory have chosen, by their numbers.
pub fn sets_of_edges(
    results: &Results<'_>,
    refinement: &Refinement,
) -> Result<BTreeMap<u64, SetOfEdges>, ResultsError> {
    of_chosen(results, |set, explained| of_set(set, explained, refinement))
}

fn of_set(set: Gathered, explained: &Explained, refinement: &Refinement) -> SetOfEdges {
    let share = refinement
        .periods
        .map(|periods| set.slips.share_of_periods(periods as f64));
    let seeds = set.jobs.finished.len() as u64 + set.jobs.failed;
    let set_id = set.jobs.set_id.clone();
    let parameters = set.jobs.parameters.clone();
    let mut estimates = set.finish_with(explained).0.estimates;
    let mut of = |statistic: &Statistic| {
        share
            .clone()
            .unwrap_or_else(|| estimates.remove(statistic.key))
    };
    let excess = |estimate: Estimate| estimate.plus(-refinement.threshold);
    SetOfEdges {
        set_id,
        parameters,
        seeds,
        excesses: refinement.by.iter().map(|by| of(by).map(excess)).collect(),
    }
}
