//! Sweep files: strict TOML in, a valid [`Sweep`] out.
//!
//! Whatever is unknown, impossible, contradictory or without effect is refused with file, line, key, value and the way
//! out. All sections and entries are read, whatever was refused before; the sweep as a whole is checked if nothing was.
//! Contract: every job of a sweep that was read has valid parameters (see `checks.rs`), and there is at least one.

use super::axes::{Axis, AxisColumn};
use super::checks::{self, Places};
use super::expression::Expression;
use super::grid::Sweep;
use super::job::{Identity, VERSIONS};
use super::measured::Measured;
use super::quantity::{GridPoint, Quantity};
use super::read_axes;
use super::read_rounds::{read_precision, read_refinement, read_seeds};
use super::rounds::{Goal, Rounds};
use super::source::{Entry, Refused, Section, Source, SweepError, all};
use super::variation::SECTIONS;
use crate::model::{Parameters, Symbol, Value};
use crate::observe::{Recording, RecordingKey};
use crate::solver::{Solver, SolverKey};
use crate::table::storage::{Disk, Storage};
use std::iter;
use std::path::Path;

/// Longest name of a sweep, in characters: it becomes a folder.
pub const MAX_NAME: usize = 100;

impl Sweep {
    pub fn from_file(path: &Path) -> Result<Self, SweepError> {
        let bytes = Disk.read(path).map_err(|error| SweepError::Unreadable {
            path: path.to_owned(),
            source: error.source,
        })?;
        let text = String::from_utf8(bytes).map_err(|_| SweepError::NotUtf8(path.to_owned()))?;
        Self::parse(&text, path)
    }

    /// Reads the text of a sweep file; the path is for messages only.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SweepError> {
        let source = Source::new(path, text);
        read(&source, true).map_err(|_| source.error())
    }

    /// The same with a text that was made of something, such as flags.
    pub fn parse_made(text: &str, of: &str) -> Result<Self, SweepError> {
        let mut source = Source::new(Path::new(of), text);
        source.made_of = Some(of);
        read(&source, true).map_err(|_| source.error())
    }

    /// The same with a text that a results directory holds: what its sweep was allowed when it began stays readable.
    pub fn parse_stored(text: &str, path: &Path) -> Result<Self, SweepError> {
        let source = Source::new(path, text);
        read(&source, false).map_err(|_| source.error())
    }
}

/// Reads the whole file, also past mistakes.
fn read(source: &Source<'_>, is_new: bool) -> Result<Sweep, Refused> {
    let table = source.table()?;
    let file = Section {
        source,
        title: "the file",
        at: 0,
        table: &table,
    };
    let measured = file.entry("measured").map(|entry| entry.key);
    let known = [&["name", "where"], &SECTIONS[..], measured.as_slice()];
    file.only(&known.concat()).ok();
    let mut places = Places::new(source);
    let name = read_name(&file);
    let model = read_section(&file, "[model]", |model| read_model(model, &mut places));
    let listed = read_section(&file, "[axes]", |axes| read_axes::read(axes, &mut places));
    let recording = read_section(&file, "[record]", read_recording);
    let solver = read_section(&file, "[solver]", read_solver);
    let measured = read_section(&file, "[measured]", Measured::read);
    let (base, period) = model.ok().flatten().unwrap_or_default();
    let mut axes = listed.map(|axes| {
        period
            .into_iter()
            .chain(axes.into_iter().flatten())
            .collect::<Vec<Axis>>()
    });
    let rounds = read_rounds(&file, &mut axes, &mut places);
    let title = rounds_title(&file).filter(|_| is_new);
    let conditions = file
        .entry("where")
        .map_or(Ok(Vec::new()), |entry| read_conditions(&entry, title));
    source.passed()?;
    let recording = recording?.unwrap_or_default();
    let solver = solver?.unwrap_or_default();
    let measured = measured?;
    let mut sweep = Sweep {
        name: name?,
        text: source.text.to_owned(),
        base,
        axes: axes?,
        conditions: conditions?,
        recording,
        solver,
        identity: Identity::new(VERSIONS, solver, &recording, measured.as_ref()),
        measured,
        rounds: rounds?,
        controls: None,
        needed: None,
    };
    if sweep.measured.is_some() {
        // An experiment knows what moves it, and what its file says: of a tide, the period alone.
        let is_known = |symbol: &Symbol| {
            let has_amplitude = *symbol != Symbol::Delta || !sweep.moves(Symbol::T);
            sweep.moves(*symbol) || (symbol.is_of_modulation() && has_amplitude)
        };
        let unknown = Symbol::ALL.into_iter().filter(|symbol| !is_known(symbol));
        sweep.base.unknown = unknown.collect();
    }
    if sweep.has_pulses() {
        sweep.base.pulse_cycles.get_or_insert(1);
    }
    sweep.controls = recording.control.then(|| Box::new(sweep.unmodulated()));
    checks::whole(&sweep, &file, &places, is_new)?;
    checks::rounds(&sweep, &file)?;
    Ok(sweep)
}

/// The section that makes a sweep adaptive.
fn rounds_title(file: &Section<'_>) -> Option<&'static str> {
    let mut titles = ["[refine]", "[precision]"].into_iter();
    titles.find(|title| file.entry(key_of(title)).is_some())
}

/// Reads `[precision]` or `[refine]`, and adds the axis of the seeds that it chooses.
fn read_rounds(
    file: &Section<'_>,
    axes: &mut Result<Vec<Axis>, Refused>,
    places: &mut Places<'_>,
) -> Result<Option<Rounds>, Refused> {
    let Some(title) = rounds_title(file) else {
        return Ok(None);
    };
    if let (Some(_), Some(precision)) = (file.entry("refine"), file.entry("precision")) {
        let problem = "[precision]: [refine] gives sets the seeds that its edges need; keep one of them, or take two sweeps";
        return Err(file.source.refuse(precision.at, problem));
    }
    read_section(file, title, |section| {
        let goal = if title == "[refine]" {
            read_refinement(section, file, axes).map(Goal::Edges)
        } else {
            read_precision(section).map(Goal::Precision)
        };
        read_seeds(section, goal, axes, places)
    })
}

fn key_of(title: &str) -> &str {
    title.trim_matches(['[', ']'])
}

/// Reads a table of the file, if it is there.
fn read_section<'a, T>(
    file: &Section<'a>,
    title: &'static str,
    read: impl FnOnce(&Section<'a>) -> Result<T, Refused>,
) -> Result<Option<T>, Refused> {
    let Some(entry) = file.entry(key_of(title)) else {
        return Ok(None);
    };
    let section = entry
        .section(title)
        .ok_or_else(|| entry.must_be(&format!("a table {title}")))?;
    read(&section).map(Some)
}

fn read_name(file: &Section<'_>) -> Result<String, Refused> {
    // A name within a section is refused as misplaced; it is not missing, too.
    let misplaced = |table: Entry<'_>| {
        let name = table.section("")?.entry("name")?;
        Some(name.unknown(&format!("[{}]", table.key), &[]))
    };
    if file.entry("name").is_none()
        && let Some(refused) = file.entries().into_iter().find_map(misplaced)
    {
        return Err(refused);
    }
    let entry = file.required("name", "it becomes a folder, such as name = \"fig3\"")?;
    let allowed = |name: &&str| {
        let characters = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        (1..=MAX_NAME).contains(&name.len())
            && name.chars().all(characters)
            && !name.starts_with('-')
    };
    let name = entry.word().filter(allowed).map(str::to_owned);
    let form = format!("1 to {MAX_NAME} letters, digits, _ and - in quotes, not with - in front");
    name.ok_or_else(|| entry.must_be(&form))
}

/// Reads the parameters, and η or the frequency as an axis of one value.
fn read_model(
    model: &Section<'_>,
    places: &mut Places<'_>,
) -> Result<(Parameters, Option<Axis>), Refused> {
    let mut given = GridPoint::default();
    all(model.entries().iter().map(|entry| {
        let quantity = read_axes::known(entry, model.title, &[], places)?;
        given.set(quantity, read_axes::read_value(entry, quantity)?);
        Ok(())
    }))?;
    let period = given.fixes_period.and_then(|(quantity, value)| {
        let values = vec![Value::Real(value)];
        Axis::table(vec![AxisColumn { quantity, values }]).ok()
    });
    Ok((given.parameters, period))
}

/// Reads the conditions; `rounds` is the section that chooses the seeds, if there is one.
fn read_conditions(
    entry: &Entry<'_>,
    rounds: Option<&str>,
) -> Result<Vec<Expression<Quantity>>, Refused> {
    let quantity = |name: &str| match (Quantity::comparable(name)?, rounds) {
        (Quantity::SEED, Some(section)) => Err(format!(
            "seed is chosen by {section}; leave it out of conditions, and begin at another seed by \
             seeds = {{ first = .., from = .., to = .. }}"
        )),
        (quantity, _) => Ok(quantity),
    };
    let form = "a condition in quotes, or a list of them, such as where = \"frequency < 500\"";
    let entries = entry.list().unwrap_or_else(|| vec![*entry]);
    all(entries.iter().map(|entry| {
        let text = entry.word().ok_or_else(|| entry.must_be(form))?;
        let condition = Expression::condition(text, &quantity);
        condition.map_err(|error| entry.refuse(error))
    }))
}

fn read_recording(record: &Section<'_>) -> Result<Recording, Refused> {
    let keys = RecordingKey::ALL.map(RecordingKey::key);
    let mut recording = Recording::default();
    if record.entry("time").is_some() && record.entry("slips").is_none() {
        recording.slips = None;
    }
    all(record.entries().iter().map(|entry| {
        let key =
            RecordingKey::from_key(entry.key).ok_or_else(|| entry.unknown(record.title, &keys))?;
        let value = entry.value().and_then(|value| key.checked(value));
        value
            .and_then(|value| recording.put(key, value))
            .ok_or_else(|| entry.must_be(&key.description().allowed()))
    }))?;
    Ok(recording)
}

fn read_solver(section: &Section<'_>) -> Result<Solver, Refused> {
    let mut solver = Solver::default();
    read_setting(section, SolverKey::Method, &mut solver)?;
    let settings = solver.method.settings();
    let keys = settings.iter().map(|key| key.key());
    let known: Vec<&str> = iter::once(SolverKey::Method.key()).chain(keys).collect();
    section.only(&known).ok();
    all(settings
        .iter()
        .map(|&key| read_setting(section, key, &mut solver)))?;
    Ok(solver)
}

/// Reads a setting, which must be there if it has no default.
fn read_setting(section: &Section<'_>, key: SolverKey, solver: &mut Solver) -> Result<(), Refused> {
    let is_given = section.entry(key.key()).is_some();
    if !is_given && solver.get(key) != Value::Null {
        return Ok(());
    }
    let description = key.description();
    let entry = section.required(key.key(), description.meaning)?;
    let value = entry.value().and_then(|value| key.checked(value));
    value
        .and_then(|value| solver.put(key, value))
        .ok_or_else(|| entry.must_be(&description.allowed()))
}
