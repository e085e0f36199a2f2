//! Keys of measured slips: what gives each, a column or one value for all rows, and in which unit.
//!
//! Contract: no key has a default. What could be meant as a key, and is not one, is refused with the flag to write.

use crate::sweep::hint;
use crate::table::value::words;
use anyhow::{Context, Result, bail, ensure};
use toml_edit::Array;

words! {
    /// What a table of slips, or of the samples of a trace, can say.
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
        Time = "time",
        Force = "force",
        Displacement = "displacement",
    }
}

impl Key {
    /// Its SI unit; empty for a name.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Onset | Self::T | Self::Maximum | Self::End | Self::Time => "s",
            Self::Drop | Self::PeakForce | Self::Force => "N",
            Self::Run => "",
            Self::V0 => "m/s",
            Self::Kd => "N/m",
            Self::Delta | Self::Displacement => "m",
            Self::Frequency => "Hz",
        }
    }

    /// Whether it becomes a parameter, of which equal values make one set.
    pub const fn is_parameter(self) -> bool {
        use Key::{Delta, Frequency, Kd, T, V0};
        matches!(self, V0 | Kd | Delta | T | Frequency)
    }

    /// Whether each slip or sample has one of its own; what others say was set, and written in a few digits.
    pub const fn is_of_row(self) -> bool {
        matches!(self, Self::Onset | Self::Drop | Self::PeakForce) || self.is_of_trace()
    }

    /// Whether it is one of samples.
    pub const fn is_of_trace(self) -> bool {
        matches!(self, Self::Time | Self::Force | Self::Displacement)
    }

    /// Whether a table can say it: of a trace, or of slips.
    const fn is_of(self, is_trace: bool) -> bool {
        let is_found = matches!(self, Self::Onset | Self::Drop | Self::PeakForce | Self::End);
        if is_trace {
            !is_found
        } else {
            !self.is_of_trace()
        }
    }

    /// Whether it means nothing without modulation.
    pub const fn is_of_modulation(self) -> bool {
        matches!(self, Self::T | Self::Frequency | Self::Maximum)
    }
}

/// The unit of drops that are no force, such as those of a friction coefficient.
pub const PURE: &str = "1";

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
        ensure!(
            word != "velocity",
            "integrate it to a displacement, and add --column displacement=NAME:UNIT"
        );
        let key = Key::from_word(word);
        let key = key.with_context(|| hint(word, &Key::ALL.map(Key::word)))?;
        ensure!(!from.is_empty(), "must be {word}=NAME or {word}=NAME:UNIT");
        let si = key.unit();
        let unit = unit.unwrap_or(si);
        let can_be_pure = matches!(key, Key::Drop | Key::Force);
        let is_pure = can_be_pure && unit == PURE;
        let factor = if is_pure { Some(1.0) } else { factor(unit, si) };
        let factor = factor.with_context(|| {
            let or_pure = if can_be_pure {
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
        self.unit == PURE || self.key == Key::Displacement
    }
}

/// The factor from a unit to that of SI.
pub fn factor(unit: &str, si: &str) -> Option<f64> {
    const PREFIXES: [&str; 9] = ["", "n", "u", "µ", "μ", "m", "c", "k", "M"];
    const FACTORS: [f64; 9] = [1.0, 1e-9, 1e-6, 1e-6, 1e-6, 1e-3, 1e-2, 1e3, 1e6];
    if let (Some((above, below)), Some((of, over))) = (unit.split_once('/'), si.split_once('/')) {
        return Some(factor(above, of)? / factor(below, over)?);
    }
    let mut prefixes = PREFIXES.iter();
    let place = prefixes.position(|prefix| unit.strip_prefix(prefix) == Some(si));
    match (unit, si) {
        (PURE, PURE) => Some(1.0),
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
    /// Whether rows are samples of a trace.
    is_trace: bool,
}

impl Sources {
    pub fn new(columns: Vec<Given>, settings: Vec<Given>, is_trace: bool) -> Result<Self> {
        for key in Key::ALL {
            let all = columns.iter().chain(&settings);
            let is_once = all.filter(|given| given.key == key).count() < 2;
            ensure!(is_once, "{} is given twice; keep one", key.word());
        }
        let mut all = columns.iter().chain(&settings);
        if let Some(other) = all.find(|given| !given.key.is_of(is_trace)) {
            let word = other.key.word();
            bail!(if is_trace {
                format!(
                    "{word} is of slips, which are found in a trace: leave it out, or --drop-size"
                )
            } else {
                format!(
                    "{word} is of a trace: say which falls are slips, as in --drop-size 30:mN, or auto"
                )
            });
        }
        let sources = Self {
            columns,
            settings,
            is_trace,
        };
        ensure!(
            !(sources.has(Key::Force) && sources.has(Key::Displacement)),
            "force and displacement are given; keep one"
        );
        Ok(sources)
    }

    pub fn has(&self, key: Key) -> bool {
        self.all().any(|given| given.key == key)
    }

    /// What `--column` and `--set` must say for them.
    pub fn flags(&self) -> [Array; 2] {
        let flag = |Given {
                        key, from, unit, ..
                    }: &Given| format!("{}={from}:{unit}", key.word());
        [&self.columns, &self.settings].map(|all| all.iter().map(flag).collect())
    }

    /// The column of a key, by default the one of its name.
    pub fn given(&self, key: Key) -> Result<Given> {
        let asked = self.columns.iter().find(|column| column.key == key);
        asked.map_or_else(
            || Given::new(key.word(), key.word(), None),
            |given| Ok(given.clone()),
        )
    }

    /// What each row must say.
    fn is_needed(&self, key: Key) -> bool {
        match key {
            Key::Onset => !self.is_trace,
            Key::Time => self.is_trace,
            Key::Force => self.is_trace && !self.has(Key::Displacement),
            _ => false,
        }
    }

    pub fn all(&self) -> impl Iterator<Item = &Given> {
        self.columns.iter().chain(&self.settings)
    }

    /// The columns among these names that give a key, with their places.
    pub fn choose(&self, names: &[String]) -> Result<Vec<(Given, usize)>> {
        let mut chosen: Vec<(Given, usize)> = Vec::new();
        for key in Key::ALL.into_iter().filter(|key| key.is_of(self.is_trace)) {
            let word = key.word();
            let is_asked = self.columns.iter().any(|column| column.key == key);
            let given = self.given(key)?;
            // Of force and displacement, what is given counts.
            if key.is_of_trace() && !is_asked && !self.is_needed(key) {
                continue;
            }
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
            if place.is_none() && (is_asked || self.is_needed(key) && !is_set) {
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
                let can_be =
                    key.is_of(self.is_trace) && (!key.is_of_trace() || self.is_needed(*key));
                can_be
                    && key.word().eq_ignore_ascii_case(word)
                    && self.all().all(|given| given.key != *key)
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
        let sources = Sources::new(Vec::new(), set(&["V0=1e-4", "Delta=0"]), false).unwrap();
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
        let sources = Sources::new(vec![column], set(&["V0=1e-4", "Delta=0"]), false).unwrap();
        assert_eq!(sources.choose(&names("t,x")).unwrap().len(), 1);
    }
}
