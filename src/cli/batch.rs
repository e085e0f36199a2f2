//! `stickslip batch`: a script that submits a sweep to a batch system. It submits nothing itself.

use super::output::{self, quoted};
use super::sweep::{self, PresetFlag};
use super::{Exit, UsageError};
use crate::run::limits;
use crate::table::shown::shown;
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf, absolute};
use std::time::Duration;

/// Print a script that submits a sweep to a batch system
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip batch slurm sweeps/fig3.toml --workers 40 --threads 16 --time 4h | sh
  stickslip batch slurm sweeps/fig3.toml --workers 40 --threads 16 --time 4h -- --account=physics > fig3.sh
  sh fig3.sh --partition=short
  stickslip batch hyperqueue sweeps/fig3.toml --workers 40 --threads 16 --time 4h > fig3.sh

What follows -- goes to sbatch or `hq submit`, and so do options of the script. Program, sweep file and results
directory must have the same paths on all nodes. Logs are in run/batch of the results directory.

If a sweep needs more time, submit the script again, or give --starts 200: then another worker follows each one
whose time is over, until all is done. Workers that find nothing to do end at once.")]
pub struct Arguments {
    /// Batch system
    #[arg(value_enum)]
    engine: Engine,
    /// Sweep file, or results directory
    #[arg(value_name = "SWEEP.toml|DIR", required_unless_present = "preset")]
    sweep: Option<PathBuf>,
    #[command(flatten)]
    preset: PresetFlag,
    /// Results directory [default: the one named, or results/<name of the sweep>]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Workers at the same time
    #[arg(long, value_name = "N")]
    workers: NonZeroU32,
    /// Threads of each worker
    #[arg(long, value_name = "N", value_parser = limits::parse_threads)]
    threads: NonZeroUsize,
    /// Time of each worker in the queue, such as 55m, 1h30m or 1:30:00; it stops a little earlier
    #[arg(long, value_name = "TIME", value_parser = time_in_queue)]
    time: Duration,
    /// Workers in total, one after the other [default: as many as --workers]
    #[arg(long, value_name = "N")]
    starts: Option<NonZeroU32>,
    /// Options of sbatch or `hq submit`
    #[arg(last = true, value_name = "OPTIONS")]
    options: Vec<String>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Engine {
    Slurm,
    Hyperqueue,
}

/// Least time in a queue: Slurm counts in minutes.
const MIN_TIME: Duration = Duration::from_mins(1);
/// A worker stops this share of its time before its end, and at most so much before: for its start, for commits, and
/// for reduction and figures, which come on top.
const MARGIN_SHARE: u32 = 10;
const MAX_MARGIN: Duration = Duration::from_mins(2);
/// Seconds before the end at which Slurm is asked to send its signal; it may send it a minute earlier. With the largest
/// margin, the worker has stopped by then.
const WARNING: u32 = 15;

fn time_in_queue(text: &str) -> Result<Duration, String> {
    let time = parse_time(text)?;
    if time < MIN_TIME {
        Err("must be at least 1m".to_owned())
    } else {
        Ok(time)
    }
}

/// The scripts, with {{names}} where values go. A job script lies within Slurm's, as the folder of the logs must be
/// there before a job starts. HyperQueue gets relative paths of logs, as it reads a colon in one as a separator.
const SLURM: &str = include_str!("batch/slurm.sh");
const HYPERQUEUE: &str = include_str!("batch/hyperqueue.sh");

pub fn batch(arguments: &Arguments, program: Option<&Path>) -> Result<Exit> {
    let program = match program {
        Some(program) => program.to_owned(),
        None => std::env::current_exe().context("cannot find out where this program lies")?,
    };
    output::print(&script(arguments, &program)?)?;
    Ok(Exit::Done)
}

fn script(arguments: &Arguments, program: &Path) -> Result<String> {
    let sweep = sweep::read(arguments.sweep.as_deref(), arguments.preset, &[])?;
    output::warn(&sweep.warnings());
    arguments.check()?;
    let root = arguments.out.clone();
    let root =
        whole_path(&root.unwrap_or_else(|| sweep::root(arguments.sweep.as_deref(), &sweep)))?;
    let logs = format!("{root}/run/batch");
    let mut command = vec![whole_path(program)?, "run".to_owned()];
    match (&arguments.sweep, arguments.preset.preset) {
        (Some(file), _) => command.push(whole_path(file)?),
        (None, preset) => {
            command.push("--preset".to_owned());
            command.extend(preset.map(|preset| preset.name.to_owned()));
        }
    }
    let time = arguments.time;
    let walltime = with_units(time.saturating_sub(margin(time)));
    command.extend(["--out", &root, "--worker", "--walltime", &walltime].map(str::to_owned));
    let name = sweep.name();
    let (template, own_options, as_read): (_, _, fn(&str) -> String) = match arguments.engine {
        Engine::Slurm => (SLURM, arguments.of_slurm(name, &logs), directive),
        Engine::Hyperqueue => {
            command.extend(["--threads".to_owned(), arguments.threads.to_string()]);
            let as_read = |option: &str| quoted(option) + " \\\n    ";
            (HYPERQUEUE, arguments.of_hyperqueue(name), as_read)
        }
    };
    let all_options = own_options.iter().chain(&arguments.options);
    let options: String = all_options.map(|option| as_read(option)).collect();
    let words: Vec<String> = command.iter().map(|word| quoted(word)).collect();
    let values = [
        ("name", name),
        ("logs", &quoted(&logs)),
        ("options", &options),
        ("command", &words.join(" ")),
    ];
    Ok(filled(template, &values))
}

impl Arguments {
    fn starts(&self) -> NonZeroU32 {
        self.starts.unwrap_or(self.workers)
    }

    fn check(&self) -> Result<(), UsageError> {
        let starts = self.starts();
        let workers = self.workers;
        if starts < workers {
            return Err(UsageError(format!(
                "--starts {starts}: must be >= --workers, here {workers}"
            )));
        }
        let mut options = self.options.iter();
        match options.find(|option| option.contains(char::is_control)) {
            Some(option) => Err(UsageError(format!(
                "{option:?}: must hold no control characters"
            ))),
            None => Ok(()),
        }
    }

    fn of_slurm(&self, name: &str, logs: &str) -> Vec<String> {
        let starts = self.starts();
        let limit = if starts > self.workers {
            format!("%{}", self.workers)
        } else {
            String::new()
        };
        let seconds = self.time.as_secs();
        let escaped = logs.replace('%', "%%");
        let mut options = vec![
            format!("--job-name={name}"),
            format!("--array=1-{starts}{limit}"),
            format!("--cpus-per-task={}", self.threads),
            format!("--time={}:{:02}", seconds / 60, seconds % 60),
            format!("--output={escaped}/%A_%a.log"),
        ];
        if margin(self.time) == MAX_MARGIN {
            options.push(format!("--signal=B:USR1@{WARNING}"));
        }
        options
    }

    fn of_hyperqueue(&self, name: &str) -> Vec<String> {
        vec![
            format!("--name={name}"),
            format!("--array=1-{}", self.starts()),
            format!("--cpus={}", self.threads),
            format!("--time-limit={}", with_units(self.time)),
        ]
    }
}

/// A template with values in place of its {{names}}. Names within values stay.
fn filled(template: &str, values: &[(&str, &str)]) -> String {
    let mut pieces = template.split("{{");
    let first = pieces.next().unwrap_or_default().to_owned();
    pieces.fold(first, |filled, piece| {
        let (name, rest) = piece.split_once("}}").unwrap_or((piece, ""));
        let value = values.iter().find(|(known, _)| *known == name);
        filled + value.map_or("", |(_, value)| value) + rest
    })
}

/// How long before the end of its time a worker stops.
fn margin(time: Duration) -> Duration {
    MAX_MARGIN.min(time / MARGIN_SHARE)
}

/// An absolute path; symbolic links stay, since a common disk may be mounted elsewhere on other nodes.
fn whole_path(mut path: &Path) -> Result<String> {
    // The path of the current folder has no links, so that `..` after it needs no look at the disk.
    let mut folder = std::env::current_dir().unwrap_or_default();
    while let Ok(rest) = path.strip_prefix("..") {
        folder.pop();
        path = rest;
    }
    let path = absolute(folder.join(path))
        .with_context(|| format!("{}: cannot be made absolute", shown(path)))?;
    match path.to_str() {
        Some(text) if !text.contains(char::is_control) => Ok(text.to_owned()),
        _ => {
            let problem = "must be UTF-8 without control characters; choose another path";
            Err(UsageError(format!("{}: {problem}", shown(&path))).into())
        }
    }
}

/// The line of an option as sbatch reads it from a script: with quotes, and a backslash before what else would mean
/// something.
fn directive(option: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    if !option.is_empty() && option.chars().all(plain) {
        format!("#SBATCH {option}\n")
    } else {
        let escaped = option.replace('\\', r"\\").replace('"', "\\\"");
        format!("#SBATCH \"{escaped}\"\n")
    }
}

const MINUTE: u64 = 60;
const HOUR: u64 = 60 * MINUTE;
const DAY: u64 = 24 * HOUR;

/// A time such as `90s`, `55m`, `55min`, `1h30m`, or as Slurm reads it: `MM:SS`, `HH:MM:SS`, `D-HH`, `D-HH:MM`,
/// `D-HH:MM:SS`. A number alone is refused, since Slurm means minutes and people mean seconds.
pub fn parse_time(text: &str) -> Result<Duration, String> {
    if by_units(&format!("{text}s")).is_some() {
        return Err(format!(
            "{text} has no unit at its end; write {text}m for minutes or {text}s for seconds"
        ));
    }
    let seconds = if text.contains([':', '-']) {
        by_clock(text)
    } else {
        by_units(text)
    };
    let time = seconds
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .filter(|time| !time.is_zero());
    time.ok_or_else(|| {
        "must be a time with units d, h, m, s, such as 55m or 1h30m, or as for Slurm, such as 1:30:00 or 2-12"
            .to_owned()
    })
}

fn by_units(text: &str) -> Option<f64> {
    let mut seconds = 0.0;
    let mut rest = text;
    while !rest.is_empty() {
        let (number, tail) = rest.split_at(rest.find(|c: char| !(c.is_ascii_digit() || c == '.'))?);
        let next = tail.find(|c: char| c.is_ascii_digit());
        let (unit, after) = tail.split_at(next.unwrap_or(tail.len()));
        let unit = match unit {
            "d" => DAY,
            "h" => HOUR,
            "m" | "min" => MINUTE,
            "s" => 1,
            _ => return None,
        };
        seconds += number.parse::<f64>().ok()? * unit as f64;
        rest = after;
    }
    Some(seconds)
}

fn by_clock(text: &str) -> Option<f64> {
    let (days, clock) = match text.split_once('-') {
        Some((days, clock)) => (Some(days), clock),
        None => (None, text),
    };
    // With days the first number after them is hours; without, the last is seconds.
    let fields: Vec<&str> = clock.split(':').collect();
    let units: &[u64] = match (days, fields.len()) {
        (Some(_), 1..=3) | (None, 3) => &[HOUR, MINUTE, 1],
        (None, 2) => &[MINUTE, 1],
        _ => return None,
    };
    let pairs = fields.into_iter().zip(units);
    let mut seconds = 0.0;
    for (number, unit) in pairs.chain(days.map(|days| (days, &DAY))) {
        seconds += f64::from(number.parse::<u32>().ok()?) * *unit as f64;
    }
    Some(seconds)
}

/// A time with units, in whole seconds.
fn with_units(time: Duration) -> String {
    let seconds = time.as_secs();
    let parts = [
        (seconds / HOUR, "h"),
        (seconds % HOUR / MINUTE, "m"),
        (seconds % MINUTE, "s"),
    ];
    let nonzero = parts.into_iter().filter(|(number, _)| *number > 0);
    nonzero
        .map(|(number, unit)| format!("{number}{unit}"))
        .collect::<Vec<_>>()
        .concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::process::Command;

    #[test]
    fn times_have_units_or_are_read_as_slurm_reads_them() {
        let table = [
            ("90s", 90.0),
            ("55m", 3300.0),
            ("90min", 5400.0),
            ("1h30m", 5400.0),
            ("1h30min5s", 5405.0),
            ("0.5d", 43_200.0),
            ("1.5s", 1.5),
            ("5:30", 330.0),
            ("90:00", 5400.0),
            ("1:00:00", 3600.0),
            ("04:00:01", 14_401.0),
            ("1-12", 129_600.0),
            ("1-0:30", 88_200.0),
            ("2-01:02:03", 176_523.0),
        ];
        for (text, seconds) in table {
            assert_eq!(parse_time(text).unwrap().as_secs_f64(), seconds, "{text}");
        }
    }

    #[test]
    fn a_number_alone_is_refused_with_both_meanings() {
        for text in ["55", "1.5", "1h30"] {
            let error = parse_time(text).unwrap_err();
            assert!(
                error.contains(&format!("{text}m for minutes or {text}s for seconds")),
                "{error}"
            );
        }
    }

    #[test]
    fn what_is_no_time_is_refused() {
        let units = [
            "", "m", "0s", "-1", "nan", "nans", "inf", "infd", "1e300d", "5 m", "3w", "1m\u{e9}",
        ];
        let clocks = [
            "-1h", "2h-1h", ":", "1:", ":30", "0:00", "1:2:3:4", "1-2-3", "1-", "-12", "1:-2",
            "1.5:00", "1 :2",
        ];
        for text in units.into_iter().chain(clocks) {
            assert!(
                parse_time(text).unwrap_err().contains("such as 55m"),
                "{text}"
            );
        }
    }

    #[test]
    fn what_is_written_is_read_again() {
        for (seconds, units) in [(60, "1m"), (14_400, "4h"), (183_845, "51h4m5s")] {
            let time = Duration::from_secs(seconds);
            assert_eq!(
                (with_units(time).as_str(), parse_time(units)),
                (units, Ok(time))
            );
        }
    }

    /// Writes what it is called with, each on a line, to the file that `RECORD` names.
    const RECORDER: &str = "#!/bin/sh\nprintf '%s\\n' \"$@\" > \"$RECORD\"\n";
    /// Takes a job script as sbatch does.
    const SBATCH: &str = "#!/bin/sh\nexec cat > \"$JOB\"\n";
    /// Runs the command of a job as hq does.
    const HQ: &str = "#!/bin/sh\nwhile [ \"$1\" != -- ]; do shift; done\nshift\nexec \"$@\"\n";

    fn make_program(file: &Path, text: &str) {
        fs::write(file, text).unwrap();
        fs::set_permissions(file, fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Names that a shell or a template might take for something else.
    fn hostile_name() -> impl Strategy<Value = String> {
        let pieces = [
            "{{command}}",
            "{{logs}}",
            "{{",
            "}}",
            "$(touch PWNED)",
            "`touch PWNED`",
            "; touch PWNED;",
            "| touch PWNED",
            "& touch PWNED",
            "$HOME",
            "${IFS}",
            "'",
            "\"",
            "\\",
            "*",
            "?",
            "[a]",
            "~",
            "#",
            "!",
            "%",
            "%A",
            "-",
            "--",
            "=",
            ":",
            " ",
            "EOF",
            "ä",
            "Δ",
            "\u{a0}",
            "🐍",
            "a",
        ];
        prop::collection::vec(prop::sample::select(pieces.to_vec()), 1..6)
            .prop_map(|pieces| pieces.concat())
            .prop_filter("an option that ends options", |name| name != "--")
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

        #[test]
        fn no_text_of_a_path_or_an_option_is_a_command_of_the_script(
            name in hostile_name(),
            option in hostile_name(),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let hostile = folder.path().join(&name);
            let [fake, jobs] = ["fake", "jobs"].map(|name| folder.path().join(name));
            for made in [&hostile, &fake, &jobs] {
                fs::create_dir(made).unwrap();
            }
            let sweep = hostile.join("s.toml");
            fs::write(&sweep, "name = \"b\"\n[axes]\nseed = { count = 2 }\n").unwrap();
            let program = hostile.join("program");
            make_program(&program, RECORDER);
            make_program(&fake.join("sbatch"), SBATCH);
            make_program(&fake.join("hq"), HQ);
            let path = format!("{}:{}", fake.display(), std::env::var("PATH").unwrap());
            for (engine, shell) in [
                (Engine::Slurm, "dash"),
                (Engine::Slurm, "bash"),
                (Engine::Hyperqueue, "dash"),
                (Engine::Hyperqueue, "bash"),
            ] {
                let out = hostile.join("out");
                let arguments = Arguments {
                    engine,
                    sweep: Some(sweep.clone()),
                    preset: PresetFlag { preset: None },
                    out: Some(out.clone()),
                    workers: NonZeroU32::MIN,
                    threads: NonZeroUsize::MIN,
                    time: Duration::from_hours(1),
                    starts: None,
                    options: vec![option.clone()],
                };
                let [record, job, submission] =
                    ["record", "job", "submission"].map(|name| folder.path().join(name));
                let run = |file: &Path| {
                    let ended = Command::new(shell)
                        .arg(file)
                        .env("PATH", &path)
                        .env("RECORD", &record)
                        .env("JOB", &job)
                        .current_dir(&jobs)
                        .output()
                        .unwrap();
                    assert!(ended.status.success() && ended.stderr.is_empty(), "{ended:?}");
                };
                fs::write(&submission, script(&arguments, &program).unwrap()).unwrap();
                run(&submission);
                if matches!(engine, Engine::Slurm) {
                    run(&job);
                }
                let record = fs::read_to_string(&record).unwrap();
                let words = ["run", sweep.to_str().unwrap(), "--out", out.to_str().unwrap()];
                prop_assert!(record.starts_with(&(words.join("\n") + "\n--worker\n")), "{record}");
                let logs = out.join("run/batch");
                for looked_at in [&jobs, &logs] {
                    prop_assert_eq!(fs::read_dir(looked_at).unwrap().count(), 0);
                }
                fs::remove_dir_all(out).unwrap();
            }
        }
    }

    #[test]
    fn values_are_filled_in_once() {
        let values = [("a", "{{b}}"), ("b", "{{a}} }}")];
        assert_eq!(filled("{{a}} {b}} {{b}}", &values), "{{b}} {b}} {{a}} }}");
    }
}
