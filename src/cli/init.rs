//! `stickslip init`: a commented sweep file to start from.

use super::sweep::{Preset, Variation, changes, preset_parser, vary};
use super::{Exit, output};
use crate::results::destination::{Destination, THERE};
use crate::sweep::{KeyChange, Sweep};
use crate::table::error::ResultsError;
use crate::table::shown::shown;
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Write a commented sweep file to start from
#[derive(Debug, Args)]
#[command(before_long_help = questions(), after_help = "\
Examples:
  stickslip init mine.toml                       every key with its unit, meaning and default
  stickslip init mine.toml --question friction   a question, with a figure as its answer, in half a minute
  stickslip init mine.toml --preset locking-map  from a sweep of this project
  stickslip init mine.toml --set N=140 --axis V0=log:1e-5:1e-3:9 --axis seed=count:8
  stickslip plan mine.toml                       next: what would run")]
pub struct Arguments {
    /// File to write; its name becomes that of the sweep
    #[arg(value_name = "FILE", default_value = "sweep.toml")]
    file: PathBuf,
    /// Start from a sweep that answers one of four questions in half a minute
    #[arg(
        long,
        value_name = "NAME",
        conflicts_with = "preset",
        hide_possible_values = true
    )]
    question: Option<Question>,
    /// Start from a sweep of this project
    #[arg(long, value_name = "NAME", value_parser = preset_parser())]
    preset: Option<Preset>,
    #[command(flatten)]
    variation: Variation,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Question {
    /// How strong must modulation be to lower friction?
    Friction,
    /// How long from slip to slip, and where do slips end, as the drive gets faster?
    Interval,
    /// At which frequencies and amplitudes do slips lock to the modulation?
    Locking,
    /// Where does the slider slide, in place of stick-slip?
    Sliding,
}

impl Question {
    /// The sweep that answers it: a preset, and axes in place of its own, which are cheaper.
    fn sweep(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Friction => ("friction", &[]),
            Self::Interval => ("sliding-velocity", &[]),
            Self::Locking => (
                "locking-map",
                &["frequency=linear:10:70:31", "Delta=log:2e-7:4e-6:9"],
            ),
            Self::Sliding => (
                "sliding-regimes",
                &["V0=log:1e-5:1e-2:10", "tau_r=log:1e-4:1e-1:10"],
            ),
        }
    }
}

/// What the help begins with.
fn questions() -> String {
    let values = Question::value_variants()
        .iter()
        .filter_map(Question::to_possible_value);
    let lines = values.map(|value| {
        let help = value.get_help().cloned().unwrap_or_default();
        format!("\n  --question {:10} {help}", value.get_name())
    });
    format!("Four to start from:{}", lines.collect::<String>())
}

/// A sweep that runs unchanged, with all other keys as comments.
const TEMPLATE: Preset = Preset {
    name: "sweep",
    text: include_str!("init/template.toml"),
};

pub fn init(arguments: &Arguments) -> Result<Exit> {
    let file = &arguments.file;
    let (preset, axes) = match arguments.question.map(Question::sweep) {
        Some((name, axes)) => (Preset::named(name).map_err(anyhow::Error::msg)?, axes),
        None => (arguments.preset.unwrap_or(TEMPLATE), [].as_slice()),
    };
    let sweep = renamed(preset, file)?;
    let axes = axes.iter().map(|&axis| axis.to_owned()).collect();
    let settings = Vec::new();
    let of_question = changes(&Variation { settings, axes })?;
    let own = changes(&arguments.variation)?;
    let sweep = vary(vary(sweep, &of_question)?, &own)?;
    let mut text = without_comments_on(sweep.text(), &own);
    let question = arguments.question.and_then(|it| it.to_possible_value());
    if let Some(question) = question.as_ref().and_then(|question| question.get_help()) {
        let begin = text.find("name = ").unwrap_or(0);
        text.replace_range(..begin, &format!("# {question}\n"));
    }
    if file.symlink_metadata().is_ok() {
        return Err(ResultsError::refused(file, THERE).into());
    }
    output::write(&Destination::new(file, "toml")?, text.as_bytes())?;
    let path = shown(file);
    let quoted = output::quoted_path(file);
    output::report(&format!(
        "wrote {path}. See what it would run: stickslip plan {quoted}"
    ));
    Ok(Exit::Done)
}

/// Keys and sections that are set need not stand as comments with what they might be.
fn without_comments_on(text: &str, changes: &[KeyChange]) -> String {
    let section = |line: &str| {
        changes
            .iter()
            .any(|change| line == format!("# [{}]", change.section))
    };
    let paragraphs = text
        .split("\n\n")
        .filter(|paragraph| !paragraph.lines().any(section));
    let text = paragraphs.collect::<Vec<_>>().join("\n\n");
    let key = |line: &str| {
        let is_of = |key: &str| line.starts_with(&format!("# {key} = "));
        changes.iter().any(|change| is_of(&change.key))
    };
    text.split_inclusive('\n')
        .filter(|line| !key(line))
        .collect()
}

/// A preset under the name of a file.
fn renamed(preset: Preset, file: &Path) -> Result<Sweep> {
    let name = file.file_stem().and_then(|stem| stem.to_str());
    let named = |name: &str| format!("name = \"{name}\"");
    let text = preset
        .text
        .replace(&named(preset.name), &named(name.unwrap_or_default()));
    Sweep::parse(&text, file)
        .with_context(|| format!("{}: the name of the file must suit a sweep", shown(file)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Symbol;
    use crate::observe::RecordingKey;

    fn sweep(text: &str) -> Sweep {
        Sweep::parse(text, Path::new("template.toml")).unwrap()
    }

    #[test]
    fn the_template_runs_unchanged_and_names_every_key_with_its_default() {
        // The tables of rounds stand as a whole or not at all.
        let text = TEMPLATE.text.split("\n# Seeds until").next().unwrap();
        let is_setting = |line: &str| line.contains(" = ") && !line.contains("where");
        let uncommented = |line: &str| {
            line.strip_prefix("# ")
                .filter(|line| is_setting(line))
                .map(ToOwned::to_owned)
        };
        let all: Vec<String> = text
            .lines()
            .map(|line| uncommented(line).unwrap_or_else(|| line.to_owned()))
            .collect();
        let sparse = sweep(TEMPLATE.text);
        let full = sweep(&all.join("\n"));
        assert_eq!(sparse.jobs().count(), 3 * 3 * 2);
        assert!(
            sparse
                .jobs()
                .map(|job| job.parameters)
                .eq(full.jobs().map(|job| job.parameters))
        );
        assert_eq!(
            (sparse.recording(), sparse.solver()),
            (full.recording(), full.solver())
        );
        let keys = Symbol::ALL
            .map(Symbol::key)
            .into_iter()
            .chain(RecordingKey::ALL.map(RecordingKey::key));
        for key in keys.filter(|key| *key != "T") {
            let is_of = |line: &str| {
                line.trim_start_matches("# ")
                    .starts_with(&format!("{key} "))
            };
            assert!(text.lines().any(is_of), "{key}");
        }
    }

    #[test]
    fn the_tables_of_rounds_in_the_template_may_stand() {
        let text = TEMPLATE.text;
        for table in ["[precision]", "[refine]"] {
            let start = text.find(&format!("# {table}")).unwrap();
            let end = text[start..]
                .find("\n\n")
                .map_or(text.len(), |length| start + length);
            let table: Vec<&str> = text[start..end]
                .lines()
                .map(|line| line.trim_start_matches("# "))
                .collect();
            let table = table.join("\n");
            let changed = format!("{}{table}{}", &text[..start], &text[end..]);
            let changed = if table.contains("seeds") {
                changed.replace("seed      =", "# seed      =")
            } else {
                changed
            };
            assert!(sweep(&changed).bounds().is_some(), "{table}");
        }
    }

    #[test]
    fn what_is_set_is_no_comment_any_more() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.toml");
        let variation = Variation {
            settings: vec!["N=140".to_owned()],
            axes: vec!["tolerance=1e-5,1e-4".to_owned()],
        };
        let arguments = Arguments {
            file: file.clone(),
            preset: None,
            question: None,
            variation,
        };
        assert!(
            init(&arguments)
                .unwrap_err()
                .to_string()
                .contains("tolerance"),
            "no axis"
        );
        assert!(!file.exists());
        let variation = Variation {
            axes: vec!["V0=1e-5,1e-4".to_owned()],
            ..arguments.variation
        };
        init(&Arguments {
            variation,
            ..arguments
        })
        .unwrap();
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(
            text.contains("\nN = 140  # --set\n") && !text.contains("# N = 70"),
            "{text}"
        );
        assert_eq!(sweep(&text).jobs().count(), 2 * (1 + 2) * 2);
    }

    #[test]
    fn a_section_that_is_set_is_no_comment_any_more() {
        let changes = [KeyChange::setting("relative", "0.1")];
        let text = without_comments_on(TEMPLATE.text, &changes);
        assert!(!text.contains("# [precision]"), "{text}");
        assert!(text.contains("# [refine]"), "{text}");
    }

    #[test]
    fn a_file_that_is_there_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.toml");
        std::fs::write(&file, "mine").unwrap();
        let error = init(&Arguments {
            file: file.clone(),
            preset: None,
            question: None,
            variation: Variation::default(),
        })
        .unwrap_err();
        assert!(error.to_string().contains("is there already"), "{error}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    }
}
