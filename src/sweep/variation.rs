//! A sweep file with other values, as text. Everything else stays unchanged, with its comments.

use super::quantity::{Quantity, nearest};
use crate::observe::RecordingKey;
use crate::solver::SolverKey;
use toml_edit::{DocumentMut, Item, Value};

/// A key of a sweep file with its new value as TOML, and the section that it belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyChange {
    pub section: &'static str,
    pub key: String,
    pub value: String,
}

const AXES: &str = "axes";
pub(super) const SECTIONS: [&str; 6] = ["model", AXES, "record", "solver", "precision", "refine"];
/// Keys that take each other's place.
const RIVALS: [&[&str]; 3] = [
    &["T", "eta", "frequency"],
    &["relative", "absolute"],
    &["seed", "seeds"],
];
/// Whether a key has no effect without modulation.
fn is_of_modulation(key: &str) -> bool {
    let quantity = Quantity::from_key(key).filter(|_| key != "Delta");
    key == "control" || quantity.is_some_and(Quantity::is_of_modulation)
}

impl KeyChange {
    /// A key with one value. The sweep file's reader refuses what is unknown, in the section of what it is nearest to.
    pub fn setting(key: &str, value: &str) -> Self {
        let recording = RecordingKey::ALL.map(RecordingKey::key);
        let solver = SolverKey::ALL.map(SolverKey::key);
        let quantities = Quantity::all().map(Quantity::key);
        let known: Vec<&str> = quantities.chain(recording).chain(solver).collect();
        let section = match nearest(key, &known) {
            _ if matches!(key, "of" | "relative" | "absolute" | "seeds") => "precision",
            _ if matches!(key, "axis" | "by" | "value" | "threshold" | "to" | "jobs") => "refine",
            Some(known) if recording.contains(&known) => "record",
            Some(known) if solver.contains(&known) => "solver",
            _ => "model",
        };
        Self {
            section,
            key: key.to_owned(),
            value: scalar(value),
        }
    }

    /// A key with several values: `1e-5,1e-4`, `log:1e-5:1e-3:9`, `linear:0:1e-6:5`, `count:4`, or as a sweep file has
    /// them. The error is what to write in place of others.
    pub fn axis(key: &str, values: &str) -> Result<Self, &'static str> {
        let value = match values.split(':').map(str::trim).collect::<Vec<_>>()[..] {
            _ if values.starts_with(['[', '{']) => values.to_owned(),
            [form @ ("log" | "linear"), low, high, points] => {
                let [low, high, points] = [low, high, points].map(scalar);
                format!("{{ {form} = [{low}, {high}], points = {points} }}")
            }
            ["log" | "linear", ..] => {
                return Err("log:LOW:HIGH:POINTS, or linear, with the number of points");
            }
            ["count", count] => format!("{{ count = {} }}", scalar(count)),
            ["count", ..] => return Err("count:N, with the number of values"),
            [_, _, ..] => return Err("log:LOW:HIGH:POINTS, linear:LOW:HIGH:POINTS or a list"),
            [one] if key == "seed" && one.parse::<u64>().is_ok() => {
                return Err("count:N for N seeds, or [SEED] for a single one");
            }
            _ => {
                let list: Vec<String> = values.split(',').map(str::trim).map(scalar).collect();
                format!("[{}]", list.join(", "))
            }
        };
        value
            .parse::<Value>()
            .map_err(|_| "VALUES, such as 1e-5,1e-4")?;
        Ok(Self {
            section: AXES,
            key: key.to_owned(),
            value,
        })
    }
}

/// One value as TOML: a number, true or false; anything else is a word.
fn scalar(text: &str) -> String {
    match (text.parse::<i64>(), text.parse::<f64>()) {
        (Ok(whole), _) => whole.to_string(),
        (_, Ok(real)) if real.is_nan() => "nan".to_owned(),
        (_, Ok(real)) => format!("{real:?}"),
        _ if matches!(text, "true" | "false") => text.to_owned(),
        // A list or a table, if it is one.
        _ if text.starts_with(['[', '{']) && text.parse::<Value>().is_ok() => text.to_owned(),
        _ => format!("{text:?}"),
    }
}

/// The text of a sweep file with these changes. A key leaves all other sections, so that an axis becomes a parameter,
/// or the other way round; a new key for the period, the target or the seeds replaces the one that is there; Delta = 0
/// removes all that has no effect without modulation. A text that is not TOML stays unchanged.
pub fn varied(text: &str, changes: &[KeyChange]) -> String {
    let Ok(mut document) = text.parse::<DocumentMut>() else {
        return text.to_owned();
    };
    let is_zero = |change: &KeyChange| matches!(change.value.parse(), Ok(0.0));
    let is_still = changes
        .iter()
        .any(|change| change.key == "Delta" && is_zero(change));
    let is_refined = document.contains_key("refine");
    let section_of = |change: &KeyChange| match &*change.key {
        "seeds" if is_refined => "refine",
        _ => change.section,
    };
    for section in SECTIONS {
        let Some(table) = document.get_mut(section).and_then(Item::as_table_like_mut) else {
            continue;
        };
        let is_set_here =
            |change: &KeyChange, key: &str| section_of(change) == section && change.key == key;
        let stays = |key: &str| changes.iter().any(|change| is_set_here(change, key));
        let are_rivals = |new: &str, key: &str| {
            let mut rivals = RIVALS.iter();
            rivals.any(|keys| keys.contains(&new) && keys.contains(&key))
        };
        let goes = |key: &str| {
            let replaces = |change: &KeyChange| change.key == key || are_rivals(&change.key, key);
            changes.iter().any(replaces) || is_still && is_of_modulation(key)
        };
        let keys: Vec<String> = table.iter().map(|(key, _)| key.to_owned()).collect();
        for key in keys.iter().filter(|key| goes(key) && !stays(key)) {
            table.remove(key);
        }
    }
    for change @ KeyChange { key, value, .. } in changes {
        let section = section_of(change);
        if !document.contains_key(section) {
            document.insert(section, toml_edit::table());
            set_below_last_comments(&mut document, section);
        }
        let table = &mut document[section];
        let Ok(mut value) = value.parse::<Value>() else {
            continue;
        };
        // The old comment may be about the old value.
        if table.is_table() {
            let flag = if section == AXES { "axis" } else { "set" };
            value.decor_mut().set_suffix(format!("  # --{flag}"));
        }
        let Some(table) = table.as_table_like_mut() else {
            continue;
        };
        if let Some(place) = table.get_mut(key) {
            *place = Item::Value(value);
        } else {
            table.insert(key, Item::Value(value));
        }
    }
    document.to_string()
}

/// A new table at the end comes after the comments there, which are about what stands above them.
fn set_below_last_comments(document: &mut DocumentMut, section: &str) {
    let comments = document.trailing().as_str().unwrap_or_default().to_owned();
    if let Some(table) = document[section].as_table_mut() {
        table.decor_mut().set_prefix(comments + "\n");
        document.set_trailing("");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::{Goal, Sweep};
    use std::path::Path;

    const TEXT: &str = "# About it.\nname = \"mine\"\n\n[model]\n# Stiff.\nKd = 1e8  # N/m\nNs = 4\n\n[axes]\n\
                        # Slow and fast.\nV0    = [1e-5, 1e-4]  # two\nDelta = [1e-6]\nT     = [0.02]\n\
                        [record] # short\nslips = 3\n";

    fn axis(key: &str, values: &str) -> KeyChange {
        KeyChange::axis(key, values).unwrap()
    }

    #[test]
    fn what_is_not_changed_stands_as_it_was() {
        assert_eq!(varied(TEXT, &[]), TEXT);
        let changes = [
            KeyChange::setting("V0", "2e-4"),
            axis("Kd", "1e7, 1e8"),
            axis("frequency", "log:20:80:5"),
            KeyChange::setting("slips", "7"),
        ];
        let text = varied(TEXT, &changes);
        assert_eq!(
            text,
            "# About it.\nname = \"mine\"\n\n[model]\nNs = 4\nV0 = 0.0002  # --set\n\n[axes]\nDelta = [1e-6]\n\
             Kd = [10000000.0, 100000000.0]  # --axis\nfrequency = { log = [20, 80], points = 5 }  # --axis\n\
             [record] # short\nslips = 7  # --set\n"
        );
        assert_eq!(varied(&text, &changes), text);
        assert_eq!(
            Sweep::parse(&text, Path::new("mine.toml"))
                .unwrap()
                .jobs()
                .count(),
            2 * 5
        );
    }

    #[test]
    fn a_new_section_comes_after_the_comments_at_the_end() {
        let text = format!("{TEXT}# time = 3\n");
        let changes = ["of=tau_mean", "relative=0.1"]
            .map(|change| change.split_once('=').unwrap())
            .map(|(key, value)| KeyChange::setting(key, value));
        let section = "\n[precision]\nof = \"tau_mean\"  # --set\nrelative = 0.1  # --set\n";
        assert_eq!(varied(&text, &changes), text + section);
    }

    #[test]
    fn a_value_in_its_place_keeps_the_comment_above_it_and_no_other() {
        let text = varied(
            TEXT,
            &[
                KeyChange::setting("Kd", "2e7"),
                axis("V0", "linear:1e-5:2e-5:3"),
                axis("seed", "count:4"),
            ],
        );
        assert!(
            text.contains("# Stiff.\nKd = 20000000.0  # --set\nNs"),
            "{text}"
        );
        assert!(
            text.contains(
                "# Slow and fast.\nV0    = { linear = [1e-5, 2e-5], points = 3 }  # --axis\nDelta"
            ),
            "{text}"
        );
        assert_eq!(
            Sweep::parse(&text, Path::new("mine.toml"))
                .unwrap()
                .jobs()
                .count(),
            3 * 4
        );
    }

    #[test]
    fn what_has_no_effect_without_modulation_goes_with_it_unless_it_is_set() {
        let text = TEXT.replace("slips = 3\n", "slips = 3\ncontrol = true\n");
        let still = varied(&text, &[KeyChange::setting("Delta", "0")]);
        assert!(
            !still.contains("T ") && !still.contains("control"),
            "{still}"
        );
        assert_eq!(
            Sweep::parse(&still, Path::new("mine.toml"))
                .unwrap()
                .jobs()
                .count(),
            2
        );
        let set = varied(
            &text,
            &[
                KeyChange::setting("Delta", "0.0"),
                KeyChange::setting("T", "1"),
            ],
        );
        assert!(
            set.contains("T = 1  # --set") && set.contains("Delta = 0.0"),
            "{set}"
        );
        assert!(varied(&text, &[KeyChange::setting("Delta", "1e-7")]).contains("control"));
    }

    #[test]
    fn a_target_and_seeds_take_the_place_of_what_was_there() {
        let parsed = |text: &str| Sweep::parse(text, Path::new("mine.toml")).unwrap();
        let precise = [
            KeyChange::setting("of", "tau_mean"),
            KeyChange::setting("relative", "0.02"),
        ];
        let seeds = KeyChange::setting("seeds", "{ from = 24, to = 48 }");
        let fixed = TEXT.replace("[record]", "seed = { count = 4 }\n[record]");
        let text = varied(&fixed, &[precise.as_slice(), &[seeds]].concat());
        assert!(!text.contains("seed = "), "{text}");
        assert!(
            matches!(parsed(&text).rounds().unwrap().goal, Goal::Precision(_)),
            "{text}"
        );
        let text = varied(
            &text,
            &[
                KeyChange::setting("absolute", "1e-3"),
                KeyChange::setting("seeds", "{ from = 30, to = 40 }"),
            ],
        );
        assert!(
            !text.contains("relative") && text.contains("absolute = 0.001  # --set"),
            "{text}"
        );
        assert_eq!(parsed(&text).rounds().unwrap().seeds, 30..=40);
        let refined = "name = \"edge\"\n[refine]\nto = 0.1\nseeds = { from = 24, to = 48 }\n";
        let text = varied(
            refined,
            &[
                KeyChange::setting("axis", "V0"),
                KeyChange::setting("seeds", "{ from = 30, to = 40 }"),
            ],
        );
        let expected =
            "[refine]\nto = 0.1\nseeds = { from = 30, to = 40 }  # --set\naxis = \"V0\"  # --set\n";
        assert!(text.ends_with(expected), "{text}");
    }

    #[test]
    fn every_form_of_an_axis_and_a_file_without_sections_are_read() {
        let text = "name = \"mine\"\nmodel = { Ns = 4, V0 = 1e-5 }\n";
        for (values, count) in [
            ("1e-5", 1),
            ("[1e-5, 1e-4]", 2),
            ("{ log = [1e-5, 1e-3], points = 3 }", 3),
        ] {
            let text = varied(
                text,
                &[
                    axis("V0", values),
                    KeyChange::setting("Ns", "9"),
                    KeyChange::setting("tolerance", "1e-5"),
                ],
            );
            let sweep = Sweep::parse(&text, Path::new("mine.toml")).unwrap();
            assert_eq!(
                (
                    sweep.jobs().count(),
                    sweep.jobs().next().unwrap().parameters.contacts_per_block
                ),
                (count, 9)
            );
        }
        assert!(KeyChange::axis("V0", "[1e-5").is_err());
        assert_eq!(
            KeyChange::setting("break_on", "tension").value,
            "\"tension\""
        );
    }
}
