//! Traces of an experiment: time, and force or displacement, become rows of slips.
//!
//! Contract: tables are read once for each pass, in pieces, so memory does not grow with them. The drop size must lie on
//! a plateau of the number of slips and above ten times the noise; else the trace is refused, with that number for many
//! sizes. A row that is not understood is refused with its place.

use super::Request;
use super::files::{Compared, SourceTable, compare_files, open};
use super::keys::{Given, Key, PURE, Sources, factor};
use super::rows::{Rows, RunOfSlips};
use super::series::parameters;
use crate::model::{Drive, Parameters};
use crate::observe::{Count, Counts, Finder, Pass, Samples, Survey, TraceDrive};
use crate::sweep::Measured;
use crate::table::value::{Shortest, floored};
use anyhow::{Context as _, Result, bail, ensure};
use std::ops::RangeInclusive;
use std::path::Path;

/// Drop sizes from which to which slips are counted, by the one that was asked for; steps from one to the next.
const RANGE: f64 = 3.0;
const STEP: f64 = 1.06;
/// Least drop size without one that was asked for, by the range of the force; and slips that its plateau must have.
const LEAST: f64 = 1e-2;
const MIN_SLIPS: u64 = 5;
/// Least drop size, by the noise.
const MIN_SIZE: f64 = 10.0;
/// A step in time that is a gap, by the mean one before it.
const GAP: f64 = 10.0;
/// Samples of a period from which on it is followed.
const MIN_SAMPLES: f64 = 15.0;

/// How slips are to be found in a trace.
#[derive(Clone, Debug, Default)]
pub struct TraceRequest {
    /// If none is given, it is the middle of the widest plateau.
    drop_size: Option<GivenSize>,
    /// Samples of which the mean is one.
    smooth: usize,
}

/// The least drop that a user gives.
#[derive(Clone, Debug)]
struct GivenSize {
    value: f64,
    unit: String,
}

impl TraceRequest {
    /// From `auto`, or a size and its unit.
    pub fn new(drop_size: &str, smooth: usize) -> Result<Self> {
        let wrong =
            || format!("--drop-size {drop_size}: must be SIZE:UNIT, such as 30:mN, or auto");
        ensure!(
            smooth > 0,
            "--smooth {smooth}: must be at least 1, which changes nothing"
        );
        if drop_size == "auto" {
            return Ok(Self {
                drop_size: None,
                smooth,
            });
        }
        let (size, unit) = drop_size.split_once(':').unwrap_or((drop_size, ""));
        let value = size
            .parse()
            .ok()
            .filter(|size: &f64| *size > 0.0 && size.is_finite());
        let drop_size = Some(GivenSize {
            value: value.with_context(wrong)?,
            unit: unit.to_owned(),
        });
        Ok(Self { drop_size, smooth })
    }

    /// The drop size in this unit.
    fn size(&self, unit: &str) -> Result<Option<f64>> {
        let Some(given) = &self.drop_size else {
            return Ok(None);
        };
        let of = if given.unit.is_empty() {
            unit
        } else {
            &given.unit
        };
        let factor = factor(of, unit).with_context(|| {
            let GivenSize { value, unit: of } = given;
            format!("--drop-size {value}:{of}: its unit must be {unit}, or with prefixes")
        })?;
        Ok(Some(given.value * factor))
    }
}

/// The number of slips for many drop sizes, and the one that was chosen.
#[derive(Clone, Debug)]
pub struct DropSizes {
    pub counts: Vec<Count>,
    pub chosen: Option<f64>,
    /// Standard deviation of the noise.
    pub noise: f64,
    /// Of force, or what stands for it.
    pub unit: &'static str,
}

/// No drop size that leaves the number of slips alone.
#[derive(Debug, thiserror::Error)]
#[error("{problem}")]
pub struct NoPlateau {
    problem: String,
    pub sizes: DropSizes,
}

impl DropSizes {
    /// What was found with a drop size on a plateau, each with its heading.
    fn found<'a>(
        &self,
        survey: &Survey,
        chosen: f64,
        plateau: [f64; 2],
        runs: impl Iterator<Item = &'a Run>,
    ) -> Vec<(String, String)> {
        let unit = self.unit;
        let step = survey.seconds / survey.samples as f64;
        let [low, high] = plateau.map(short);
        let mut found = Vec::new();
        let mut add = |head: &str, text: String| found.push((head.to_owned(), text));
        add(
            "samples",
            format!("{}, every {} s", survey.samples, short(step)),
        );
        add("noise", format!("{} {unit}", short(self.noise)));
        add(
            "drop size",
            format!(
                "{} {unit}, on a plateau from {low} to {high}",
                short(chosen)
            ),
        );
        add("slips for", self.in_words());
        let modulated: Vec<&Run> = runs.filter(|run| run.period.is_some()).collect();
        if unit != Key::Displacement.unit() && modulated.iter().any(|run| run.stiffness.is_none()) {
            let stiffness = short(survey.stiffness());
            add(
                "stiffness",
                format!(
                    "{stiffness} {unit}/m: the slope of loading over V0; it is not taken for Kd"
                ),
            );
        }
        if modulated
            .iter()
            .any(|run| run.period.is_some_and(|period| period < MIN_SAMPLES * step))
        {
            add(
                "warning",
                format!(
                    "a period has fewer than {MIN_SAMPLES} samples: onsets and drops are coarse"
                ),
            );
        }
        found
    }

    fn refused(&self, problem: &str) -> NoPlateau {
        let chosen = self
            .chosen
            .map_or("auto".to_owned(), |size| short(size).to_string());
        let problem = format!(
            "--drop-size {chosen}: {problem}; the noise is {} {}, and slips for drop sizes are {}. Try another size, or \
             --smooth by some samples",
            short(self.noise),
            self.unit,
            self.in_words()
        );
        NoPlateau {
            problem,
            sizes: self.clone(),
        }
    }

    /// The number of slips for some of the sizes.
    fn in_words(&self) -> String {
        let every = self.counts.len().div_ceil(7).max(1);
        let shown = self.counts.iter().step_by(every);
        let word = |count: &Count| format!("{} at {}", count.slips, short(count.least));
        let words: Vec<String> = shown.map(word).collect();
        format!("{} {}", words.join(", "), self.unit)
    }
}

/// With three digits.
pub fn short(number: f64) -> Shortest {
    Shortest(format!("{number:.2e}").parse().unwrap_or(number))
}

/// The slips of tables of samples.
#[derive(Debug)]
pub struct Traced {
    /// Of each table.
    pub rows: Vec<Rows>,
    pub sizes: DropSizes,
    /// Columns of samples, and the range of their numbers.
    pub columns: Vec<(Given, [f64; 2])>,
    /// What was found, each with its heading.
    pub found: Vec<(String, String)>,
}

/// The key that gives the force, and its unit, which may be that of a displacement or of a pure number.
#[derive(Clone, Copy, Debug)]
struct Force {
    key: Key,
    unit: &'static str,
}

impl Force {
    fn of(sources: &Sources) -> Self {
        let key = if sources.has(Key::Displacement) {
            Key::Displacement
        } else {
            Key::Force
        };
        let is_pure = sources
            .all()
            .any(|given| given.key == Key::Force && given.is_pure());
        Self {
            key,
            unit: if is_pure { PURE } else { key.unit() },
        }
    }
}

/// Finds the slips of tables, each with its name.
pub fn find(
    tables: &[(String, SourceTable)],
    request: &Request,
    trace: &TraceRequest,
) -> Result<Traced> {
    let force = Force::of(&request.sources);
    let reader = TraceReader {
        tables,
        request,
        smooth: trace.smooth,
        force,
    };
    let size = trace.size(force.unit)?;
    let mut survey = Survey::default();
    reader.read(&mut survey, f64::NAN)?;
    if let Some(samples) = survey.clipped() {
        bail!(
            "{samples} samples in a row have the largest {}, {} {}: it was cut off there; leave these slips out",
            force.key.word(),
            short(survey.high),
            force.unit
        );
    }
    let chosen = reader.choose(size, &survey)?;
    let mut finder = Finder::new(chosen.size, chosen.sizes.noise);
    let read = reader.read(&mut finder, survey.stiffness())?;
    let found = chosen.sizes.found(
        &survey,
        chosen.size,
        chosen.plateau,
        read.iter().flat_map(|(runs, _)| runs),
    );
    let all_runs = || read.iter().flat_map(|(runs, _)| runs);
    let columns = vec![
        (
            request.sources.given(Key::Time)?,
            range(all_runs().map(|run| [run.first, run.last])),
        ),
        (
            request.sources.given(force.key)?,
            range(all_runs().map(|run| run.forces)),
        ),
    ];
    let mut slips = finder.runs.into_iter();
    let rows = read.into_iter().map(|(runs, samples)| {
        let runs = runs.into_iter().zip(slips.by_ref());
        let runs = runs.map(
            |(
                Run {
                    name,
                    values,
                    last: end,
                    ..
                },
                slips,
            )| RunOfSlips {
                name,
                values,
                end,
                slips,
            },
        );
        samples.with_slips(runs, force.unit == Key::Force.unit())
    });
    let rows = rows.collect::<Result<_>>()?;
    Ok(Traced {
        rows,
        sizes: chosen.sizes,
        columns,
        found,
    })
}

/// A part of a trace, read again from its file.
#[derive(Debug)]
pub struct Excerpt {
    /// Times in s and forces in N.
    pub samples: Vec<(f64, f64)>,
    /// Whether a maximum of the modulation was given: it is not at time 0.
    pub has_maximum: bool,
}

/// A stretch of the trace that slips came from.
pub fn stretch(measured: &Measured, range: RangeInclusive<f64>) -> Result<Excerpt> {
    let Some(trace) = &measured.trace else {
        bail!("--from, --until: the slips did not come from a trace with one run");
    };
    let Some((name, compared)) = compare_files(measured).next() else {
        bail!("--from, --until: a program gave the trace, and it is gone");
    };
    ensure!(compared == Compared::Same, "{name}: {}", compared.word());
    let columns = Given::parse_all("--column", &trace.columns)?;
    let settings = Given::parse_all("--set", &trace.settings)?;
    let sources = Sources::new(columns, settings, true)?;
    let force = Force::of(&sources);
    ensure!(
        force.unit == Key::Force.unit(),
        "--from, --until: the trace is of no force"
    );
    let mut found = Excerpt {
        samples: Vec::new(),
        has_maximum: sources.has(Key::Maximum),
    };
    open(Path::new(name))?
        .0
        .read(&sources, trace.decimal_comma, &mut |rows| {
            let of = |key| rows.of(key).unwrap_or_default().iter().copied();
            let samples = of(Key::Time).zip(of(Key::Force));
            let within = samples.filter(|(time, _)| range.contains(time));
            found.samples.extend(within);
            rows.clear();
            Ok(())
        })?;
    Ok(found)
}

/// Drop sizes for which slips are counted: around one that is asked for, or all above the noise.
fn sizes(size: Option<f64>, noise: f64, range: f64) -> Result<impl Iterator<Item = f64>> {
    let (low, high) = match size {
        Some(size) => (size / RANGE, size * RANGE),
        None => ((LEAST * range).max(MIN_SIZE * noise), range),
    };
    ensure!(
        high > low,
        "there is no fall of more than ten times the noise; try --smooth by some samples"
    );
    // With an even number of steps, a size that is asked for is among them.
    let steps = 2 * floored(0.5 * (high / low).ln() / STEP.ln() + 1.0);
    Ok((0..=steps).map(move |step| low * (high / low).powf(step as f64 / steps as f64)))
}

/// A drop size, with the plateau of the number of slips around it, from the lowest to the highest size.
struct ChosenSize {
    size: f64,
    plateau: [f64; 2],
    /// All that were tried.
    sizes: DropSizes,
}

struct TraceReader<'a> {
    tables: &'a [(String, SourceTable)],
    request: &'a Request,
    smooth: usize,
    force: Force,
}

impl TraceReader<'_> {
    /// Chooses the drop size that is asked for, or the middle of the widest plateau.
    fn choose(&self, size: Option<f64>, survey: &Survey) -> Result<ChosenSize> {
        let noise = survey.noise();
        let mut counts = Counts::new(sizes(size, noise, survey.high - survey.low)?);
        self.read(&mut counts, survey.stiffness())?;
        let plateau = counts.plateau(size, if size.is_some() { 1 } else { MIN_SLIPS });
        let chosen = size.or_else(|| plateau.map(|[low, high]| (low * high).sqrt()));
        let counts = counts.of_sizes;
        let sizes = DropSizes {
            counts,
            chosen,
            noise,
            unit: self.force.unit,
        };
        match (plateau, chosen) {
            (Some(plateau), Some(size)) if size >= MIN_SIZE * noise => Ok(ChosenSize {
                size,
                plateau,
                sizes,
            }),
            (Some(_), _) => Err(sizes
                .refused("the drop size is less than ten times the noise")
                .into()),
            (None, _) => Err(sizes
                .refused("the number of slips depends on it, as there is no plateau")
                .into()),
        }
    }

    /// Goes over all runs; returns those of each table, and what is left of it.
    fn read(&self, pass: &mut dyn Pass, stiffness: f64) -> Result<Vec<(Vec<Run>, Rows)>> {
        let mut all = Vec::new();
        for (name, table) in self.tables {
            let mut runs = Runs {
                reader: self,
                pass,
                stiffness,
                begun: Vec::new(),
                loading: None,
                mean: Smoothing::default(),
            };
            let Request {
                sources,
                decimal_comma,
                ..
            } = self.request;
            let read = table.read(sources, *decimal_comma, &mut |rows| {
                runs.take(rows)?;
                rows.clear();
                Ok(())
            });
            let rows = read.with_context(|| name.clone())?;
            runs.end();
            all.push((runs.begun, rows));
        }
        Ok(all)
    }
}

/// A run of a table.
#[derive(Debug)]
struct Run {
    name: Option<String>,
    /// Of all columns, where it begins.
    values: Vec<f64>,
    first: f64,
    last: f64,
    /// Least and largest, as they were read.
    forces: [f64; 2],
    samples: u64,
    period: Option<f64>,
    /// As it was given.
    stiffness: Option<f64>,
}

/// The samples of which one is made.
#[derive(Debug, Default)]
struct Smoothing {
    count: usize,
    time: f64,
    force: f64,
}

/// The runs of a table, as they are read.
struct Runs<'a> {
    reader: &'a TraceReader<'a>,
    pass: &'a mut dyn Pass,
    /// Where none is given.
    stiffness: f64,
    begun: Vec<Run>,
    loading: Option<TraceDrive>,
    mean: Smoothing,
}

impl Runs<'_> {
    /// Takes the next samples of the table.
    fn take(&mut self, rows: &Rows) -> Result<()> {
        let of = |key| rows.of(key).unwrap_or_default();
        let times = of(Key::Time);
        let force = self.reader.force.key;
        let forces = of(force);
        let begins = rows.begins();
        let ends = begins.iter().copied().skip(1).chain([rows.count]);
        for (&begin, end) in begins.iter().zip(ends) {
            let is_of_last = |last: &Run| {
                last.name == rows.run_name(0) && is_same(&last.values, &rows.values(0))
            };
            if begin > 0 || !self.begun.last().is_some_and(is_of_last) {
                self.begin(rows, begin).with_context(|| rows.place(begin))?;
            }
            if let Some(run) = self.begun.last_mut() {
                for row in begin..end {
                    let followed = run.follow(times[row], forces[row], force);
                    followed.with_context(|| rows.place(row))?;
                }
            }
            self.push(&times[begin..end], &forces[begin..end]);
        }
        Ok(())
    }

    fn begin(&mut self, rows: &Rows, row: usize) -> Result<()> {
        self.end();
        let [velocity, stiffness, amplitude, period] = parameters(rows, row)?;
        let stiffness = match self.reader.force.unit {
            "N" => stiffness,
            _ => None,
        };
        let of_unit = if self.reader.force.key == Key::Displacement {
            1.0
        } else {
            self.stiffness
        };
        let parameters = Parameters {
            drive_velocity: velocity.unwrap_or(f64::NAN),
            drive_stiffness: stiffness.unwrap_or(of_unit),
            modulation_amplitude: amplitude.unwrap_or(0.0),
            modulation_period: period,
            ..Parameters::default()
        };
        let maximum = rows.of(Key::Maximum).map_or(0.0, |maxima| maxima[row]);
        let maximum = if maximum.is_nan() { 0.0 } else { maximum };
        let loading = TraceDrive {
            drive: Drive::new(&parameters),
            maximum,
        };
        self.loading = Some(loading);
        self.mean = Smoothing::default();
        self.pass.begin();
        let first = rows.of(Key::Time).map_or(f64::NAN, |times| times[row]);
        self.begun.push(Run {
            name: rows.run_name(row),
            values: rows.values(row),
            first,
            last: f64::NEG_INFINITY,
            forces: [f64::INFINITY, f64::NEG_INFINITY],
            samples: 0,
            period,
            stiffness,
        });
        Ok(())
    }

    /// Ends the run that was begun last.
    fn end(&mut self) {
        if let Some(loading) = self.loading.take() {
            self.pass.end(&loading);
        }
    }

    fn push(&mut self, times: &[f64], forces: &[f64]) {
        let Some(loading) = self.loading else { return };
        let smooth = self.reader.smooth;
        if self.reader.force.key == Key::Force && smooth == 1 {
            return self.pass_on(&loading, times, forces);
        }
        let (mut mean_times, mut mean_forces) = (Vec::new(), Vec::new());
        for (&time, &force) in times.iter().zip(forces) {
            let is_force = self.reader.force.key == Key::Force;
            self.mean.count += 1;
            self.mean.time += time;
            self.mean.force += if is_force {
                force
            } else {
                loading.driven(time) - force
            };
            if self.mean.count == smooth {
                mean_times.push(self.mean.time / smooth as f64);
                mean_forces.push(self.mean.force / smooth as f64);
                self.mean = Smoothing::default();
            }
        }
        self.pass_on(&loading, &mean_times, &mean_forces);
    }

    fn pass_on(&mut self, loading: &TraceDrive, times: &[f64], forces: &[f64]) {
        if !times.is_empty() {
            self.pass.push(loading, Samples { times, forces });
        }
    }
}

impl Run {
    /// Takes a sample: its time must follow the one before it, and not after a gap.
    fn follow(&mut self, time: f64, force: f64, key: Key) -> Result<()> {
        const BEGIN: &str = "where runs begin, a column must say so: --column run=NAME";
        ensure!(!time.is_nan(), "time is missing");
        ensure!(!force.is_nan(), "{} is missing", key.word());
        let before = self.last;
        ensure!(
            time > before,
            "time {time} s is not after {before} s above it; {BEGIN}"
        );
        let steps = (self.samples.max(2) - 1) as f64;
        let seconds = before - self.first;
        let is_gap = self.samples > 1 && (time - before) * steps > GAP * seconds;
        ensure!(
            !is_gap,
            "time {time} s comes after {before} s, a gap for steps of {} s; {BEGIN}",
            short(seconds / steps)
        );
        self.samples += 1;
        self.last = time;
        self.forces = [self.forces[0].min(force), self.forces[1].max(force)];
        Ok(())
    }
}

/// Of all numbers in these ranges.
fn range(all: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    all.reduce(|all, own| [all[0].min(own[0]), all[1].max(own[1])])
        .unwrap_or_default()
}

/// To the bit.
fn is_same(left: &[f64], right: &[f64]) -> bool {
    let mut pairs = left.iter().zip(right);
    pairs.all(|(left, right)| left.to_bits() == right.to_bits())
}
