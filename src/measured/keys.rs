//! Keys of measured slips: what gives each, a column or one value for all rows, and in which unit.
//!
//! Contract: no key has a default. What could be meant as a key, and is not one, is refused with the flag to write.

use crate::sweep::hint;
use crate::table::value::words;
use anyhow::{Context, Result, bail, ensure};

words! {
    /// What a table of slips can say.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Key {
        Onset = "onset",
        Drop = "drop",
        PeakForce = "peak_force",
        Run = "run",
        V0 = "V0",
        Kd = "Kd",
        Delta = "Delta",
        T = "T",
        Frequency = "frequency",
        Maximum = "maximum",
        End = "end",
    }
}

impl Key {
    /// Its SI unit; empty for a name.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Onset | Self::T | Self::Maximum | Self::End => "s",
            Self::Drop | Self::PeakForce => "N",
            Self::Run => "",
            Self::V0 => "m/s",
            Self::Kd => "N/m",
            Self::Delta => "m",
            Self::Frequency => "Hz",
        }
    }

    /// Whether it becomes a parameter, of which equal values make one set.
    pub const fn is_parameter(self) -> bool {
        use Key::{Delta, Frequency, Kd, T, V0};
        matches!(self, V0 | Kd | Delta | T | Frequency)
    }

    /// Whether each slip has one of its own; what others say was set, and written in a few digits.
    pub const fn is_of_slip(self) -> bool {
        matches!(self, Self::Onset | Self::Drop | Self::PeakForce)
    }

    /// Whether it means nothing without modulation.
    pub const fn is_of_modulation(self) -> bool {
        matches!(self, Self::T | Self::Frequency | Self::Maximum)
    }
}

/// The unit of drops that are no force, such as those of a friction coefficient.
const PURE: &str = "1";

/// What gives a key, as `KEY=FROM:UNIT` says: a column of this name, or this value.
#[derive(Clone, Debug)]
pub struct Given {
    pub key: Key,
    pub from: String,
    pub unit: String,
    /// From the unit to that of SI.
    pub factor: f64,
}

impl Given {
    /// In SI without a unit.
    pub fn new(word: &str, from: &str, unit: Option<&str>) -> Result<Self> {
        let key = Key::from_word(word);
        let key = key.with_context(|| hint(word, &Key::ALL.map(Key::word)))?;
        ensure!(!from.is_empty(), "must be {word}=NAME or {word}=NAME:UNIT");
        let si = key.unit();
        let unit = unit.unwrap_or(si);
        let is_pure = key == Key::Drop && unit == PURE;
        let factor = if is_pure { Some(1.0) } else { factor(unit, si) };
        let factor = factor.with_context(|| {
            let or_pure = if key == Key::Drop {
                ", or 1 if it is no force"
            } else {
                ""
            };
            format!("{unit}: must be {si}, or with prefixes{or_pure}")
        })?;
        Ok(Self {
            key,
            from: from.to_owned(),
            unit: unit.to_owned(),
            factor,
        })
    }

    fn parse(text: &str) -> Result<Self> {
        let (key, from) = text.split_once('=').unwrap_or((text, ""));
        let with_unit = from.rsplit_once(':');
        let (from, unit) = with_unit.map_or((from, None), |(from, unit)| (from, Some(unit)));
        Self::new(key, from, unit)
    }

    /// Reads the texts of a flag.
    pub fn parse_all(flag: &str, texts: &[String]) -> Result<Vec<Self>> {
        let parse = |text: &String| Self::parse(text).with_context(|| format!("{flag} {text}"));
        texts.iter().map(parse).collect()
    }

    pub fn is_pure(&self) -> bool {
        self.unit == PURE
    }
}

/// The factor from a unit to that of SI.
fn factor(unit: &str, si: &str) -> Option<f64> {
    const PREFIXES: [&str; 9] = ["", "n", "u", "µ", "μ", "m", "c", "k", "M"];
    const FACTORS: [f64; 9] = [1.0, 1e-9, 1e-6, 1e-6, 1e-6, 1e-3, 1e-2, 1e3, 1e6];
    if let (Some((above, below)), Some((of, over))) = (unit.split_once('/'), si.split_once('/')) {
        return Some(factor(above, of)? / factor(below, over)?);
    }
    let mut prefixes = PREFIXES.iter();
    let place = prefixes.position(|prefix| unit.strip_prefix(prefix) == Some(si));
    match (unit, si) {
        ("min", "s") => Some(60.0),
        ("h", "s") => Some(3600.0),
        _ => place.map(|place| FACTORS[place]),
    }
}

/// How the keys of slips are given.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    /// Columns whose names are not those of their keys, or in other units.
    columns: Vec<Given>,
    /// Values for all rows.
    pub settings: Vec<Given>,
}

impl Sources {
    pub fn new(columns: Vec<Given>, settings: Vec<Given>) -> Result<Self> {
        for key in Key::ALL {
            let all = columns.iter().chain(&settings);
            let is_once = all.filter(|given| given.key == key).count() < 2;
            ensure!(is_once, "{} is given twice; keep one", key.word());
        }
        Ok(Self { columns, settings })
    }

    pub fn all(&self) -> impl Iterator<Item = &Given> {
        self.columns.iter().chain(&self.settings)
    }

    /// The columns among these names that give a key, with their places.
    pub fn choose(&self, names: &[String]) -> Result<Vec<(Given, usize)>> {
        let mut chosen: Vec<(Given, usize)> = Vec::new();
        for key in Key::ALL {
            let word = key.word();
            let asked = self.columns.iter().find(|column| column.key == key);
            let given =
                asked.map_or_else(|| Given::new(word, word, None), |given| Ok(given.clone()))?;
            let name = given.from.clone();
            let mut found = (0..names.len()).filter(|&place| names[place] == name);
            let place = found.next();
            let is_alone = found.next().is_none();
            ensure!(is_alone, "has several columns {name}; rename one");
            let is_set = self.settings.iter().any(|set| set.key == key);
            ensure!(
                !is_set || place.is_none(),
                "has a column {name} beside --set {word}; keep one"
            );
            if place.is_none() && (asked.is_some() || key == Key::Onset && !is_set) {
                let known: Vec<&str> = names.iter().map(String::as_str).collect();
                let hint = hint(&name, &known);
                bail!("has no column {name}; {hint}, in --column {word}=NAME:UNIT");
            }
            chosen.extend(place.map(|place| (given, place)));
        }
        self.refuse_misnamed(names, &chosen)?;
        self.refuse_incomplete(&chosen)?;
        Ok(chosen)
    }

    /// Refuses columns whose names are those of keys but for case, or for a unit in brackets.
    fn refuse_misnamed(&self, names: &[String], chosen: &[(Given, usize)]) -> Result<()> {
        let is_free = |place: usize| chosen.iter().all(|(_, other)| *other != place);
        for name in (0..names.len())
            .filter(|&place| is_free(place))
            .map(|place| &names[place])
        {
            let (word, unit) = without_unit(name);
            let is_meant = |key: &Key| {
                key.word().eq_ignore_ascii_case(word) && self.all().all(|given| given.key != *key)
            };
            if let Some(key) = Key::ALL.into_iter().find(is_meant) {
                let key = key.word();
                let unit = unit.map_or_else(String::new, |unit| format!(":{unit}"));
                bail!(
                    "column {name}: is it {key}? Write --column '{key}={name}{unit}', or what {key} is: --set {key}=VALUE"
                );
            }
        }
        Ok(())
    }

    /// Refuses a table without what every slip must have.
    fn refuse_incomplete(&self, chosen: &[(Given, usize)]) -> Result<()> {
        let has = |key: Key| {
            let columns = chosen.iter().map(|(given, _)| given);
            columns.chain(&self.settings).any(|given| given.key == key)
        };
        ensure!(
            has(Key::V0),
            "V0 is missing: --column V0=NAME:UNIT, or --set V0=VALUE:UNIT"
        );
        ensure!(
            has(Key::Delta) || has(Key::T) || has(Key::Frequency),
            "Delta is missing: --column Delta=NAME:UNIT, or without modulation --set Delta=0"
        );
        Ok(())
    }
}

/// A name and the unit in brackets at its end.
fn without_unit(name: &str) -> (&str, Option<&str>) {
    let brackets = [('(', ')'), ('[', ']')];
    let split = brackets.into_iter().find_map(|(open, close)| {
        let (word, unit) = name.trim_end().strip_suffix(close)?.rsplit_once(open)?;
        Some((word.trim(), Some(unit.trim())))
    });
    split.unwrap_or((name.trim(), None))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_prefixes_and_times_minutes_and_hours() {
        let factors = [
            ("ms", "s", 1e-3),
            ("min", "s", 60.0),
            ("h", "s", 3600.0),
            ("µm/s", "m/s", 1e-6),
            ("mm/min", "m/s", 1e-3 / 60.0),
            ("N/um", "N/m", 1e6),
            ("kHz", "Hz", 1e3),
            ("", "", 1.0),
        ];
        for (unit, si, expected) in factors {
            let found = factor(unit, si).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-12, "{unit}: {found}");
        }
        for (unit, si) in [("N", "s"), ("m", "m/s"), ("m/s", "m"), ("furlong", "m")] {
            assert_eq!(factor(unit, si), None, "{unit}");
        }
    }

    #[test]
    fn columns_named_almost_like_a_key_are_refused_with_the_flag_to_write() {
        let names = |text: &str| text.split(',').map(str::to_owned).collect::<Vec<_>>();
        let set = |texts: &[&str]| {
            let texts: Vec<String> = texts.iter().map(|text| (*text).to_owned()).collect();
            Given::parse_all("--set", &texts).unwrap()
        };
        let sources = Sources::new(Vec::new(), set(&["V0=1e-4", "Delta=0"])).unwrap();
        for (column, flag) in [
            ("Drop", "'drop=Drop'"),
            ("drop [mN]", "'drop=drop [mN]:mN'"),
            ("PEAK_FORCE (kN)", "'peak_force=PEAK_FORCE (kN):kN'"),
            ("Run", "'run=Run'"),
            ("t", "'T=t'"),
        ] {
            let refused = sources.choose(&names(&format!("onset,{column}")));
            let problem = refused.unwrap_err().to_string();
            assert!(problem.contains(flag), "{column}: {problem}");
        }
        // What a flag gives is no riddle, nor is a column that gives another key.
        let chosen = sources.choose(&names("onset,v0,delta (um),shear"));
        assert_eq!(chosen.unwrap().len(), 1);
        let column = Given::new("onset", "t", Some("ms")).unwrap();
        let sources = Sources::new(vec![column], set(&["V0=1e-4", "Delta=0"])).unwrap();
        assert_eq!(sources.choose(&names("t,x")).unwrap().len(), 1);
    }
}
