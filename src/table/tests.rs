//! A row type of tests, and how its columns are described.

use super::columns::*;
use super::tables;
use crate::documented::markdown;
use crate::model::{BreakOn, Symbol};
use crate::model::{Selected, Selection};

columns! {
    /// One reading.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Reading {
        force: f64 = "N", "shear force";
        phase: Option<f64> = "rad", "phase of the onset";
        position as "number": u64 = "", "number of the reading";
        name: String = "", "its name";
        is_high as "high": bool = "", "above 1 N";
        rule: Option<BreakOn> = "", "when its contacts break";
    }
}

/// A period and a rule.
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodAndRule;

impl Selection for PeriodAndRule {
    const SYMBOLS: &'static [Symbol] = &[Symbol::Delta, Symbol::T, Symbol::BreakOn];
}

pub(crate) type Readings = (Reading, Selected<PeriodAndRule>);

tables! { Readings = "readings", "One row per reading"; }

pub(crate) fn readings() -> [Readings; 2] {
    use crate::model::Parameters;

    let modulated = Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(0.01),
        ..Parameters::default()
    };
    let reading = |force, phase, position, rule| Reading {
        force,
        phase,
        position,
        name: format!("reading {position}"),
        is_high: force > 1.0,
        rule,
    };
    [
        (
            reading(1.5, None, 1, None),
            Selected::new(Parameters::default()),
        ),
        (
            reading(-2.5, Some(0.25), 2, Some(BreakOn::Tension)),
            Selected::new(modulated),
        ),
    ]
}

#[test]
fn a_column_has_its_name_unit_meaning_and_kind() {
    let columns = Readings::columns();
    let described = |name: &str| {
        let column = columns.iter().find(|column| column.name == name).unwrap();
        (column.unit, column.meaning, column.kind, column.nullable)
    };
    assert_eq!(
        described("phase"),
        ("rad", "phase of the onset", Kind::Real, true)
    );
    assert_eq!(
        described("number"),
        ("", "number of the reading", Kind::Count, false)
    );
    assert_eq!(
        described("T"),
        ("s", Symbol::T.description().meaning, Kind::Real, true)
    );
    assert_eq!(described("break_on").2, Kind::Text);
}

#[test]
fn a_cell_that_a_column_cannot_hold_is_named() {
    let error = Reading::from_cells("", &mut || Value::Null).unwrap_err();
    assert!(error.contains("column name cannot hold Null"), "{error}");
    let period = |value: f64| {
        let mut cells = [
            Value::Real(1e-6),
            Value::Real(value),
            Value::Text("magnitude"),
        ]
        .into_iter();
        Selected::<PeriodAndRule>::from_cells("", &mut || cells.next().unwrap())
    };
    assert!(period(-1.0).unwrap_err().contains("T = -1"));
}

#[test]
fn the_documentation_has_a_line_for_each_column() {
    let text = markdown::<Readings>(&[]);
    assert!(
        text.starts_with("## readings\n\nOne row per reading.\n"),
        "{text}"
    );
    assert!(
        text.contains("- `phase` (rad?): phase of the onset\n"),
        "{text}"
    );
    let text = markdown::<Readings>(&[("earlier", Reading::columns())]);
    assert!(
        text.contains(
            "- `force`, `phase`, `number`, `name`, `high`, `rule`: as in [earlier](#earlier)\n"
        ),
        "{text}"
    );
}
