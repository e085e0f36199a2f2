//! Sweep files that are refused: the line, the key with its value, and words of the way out.

use super::super::{Mistake, Sweep, SweepError};
use std::path::Path;

fn refused(text: &str) -> Vec<Mistake> {
    match Sweep::parse(text, Path::new("bad.toml")) {
        Err(SweepError::Invalid { mistakes, .. }) => mistakes,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("must be refused:\n{text}"),
    }
}

fn assert_refused(table: &[(&str, usize, &[&str])]) {
    for (text, line, words) in table {
        let mistakes = refused(text);
        let [
            Mistake {
                line: found,
                problem,
            },
        ] = mistakes.as_slice()
        else {
            panic!("{text}\n{mistakes:?}")
        };
        assert_eq!(found, line, "{text}\n{problem}");
        for word in *words {
            assert!(
                problem.contains(word),
                "{word:?} is missing in: {problem}\n{text}"
            );
        }
    }
}

#[test]
fn invalid_toml_is_refused_with_its_line() {
    assert_refused(&[
        ("name = \"a\"\n[model\nN = 3", 2, &["TOML"]),
        ("name = \"a\"\n\n[model]\nN = ", 4, &["TOML"]),
        (
            "name = \"a\"\n[model]\nN = 3\nN = 4",
            4,
            &["N: ", "duplicate key"],
        ),
        (
            "name = \"a\"\n[model]\n[axes]\n[model]",
            4,
            &["model", "duplicate key"],
        ),
        (
            "name = \"a\"\n[model]\nV0 = 1e",
            3,
            &["V0 = 1e", "exponent", "TOML"],
        ),
        ("name = \"a\"\r\n[model]\r\nV0 = 'x", 3, &["TOML"]),
    ]);
}

#[test]
fn unknown_and_missing_keys_are_refused_with_the_nearest_known() {
    assert_refused(&[
        ("", 1, &["name is missing", "name = \"fig3\""]),
        (
            "name = \"a\"\n[modle]\nN = 3",
            2,
            &["modle", "unknown key", "did you mean model?"],
        ),
        (
            "name = \"a\"\nV0 = 1e-4",
            2,
            &["V0 = 1e-4", "[model] or [axes]"],
        ),
        (
            "name = \"a\"\nfriction = 1",
            2,
            &["friction = 1", "allowed are name, where, model"],
        ),
        (
            "name = \"a\"\n[model]\nv0 = 1e-4",
            3,
            &["v0 = 1e-4", "[model]", "did you mean V0?"],
        ),
        (
            "name = \"a\"\n[model]\ngama = 3",
            3,
            &["did you mean gamma?"],
        ),
        ("name = \"a\"\n[model]\nmass = 3", 3, &["did you mean M?"]),
        (
            "name = \"a\"\n[model]\nhumidity = 3",
            3,
            &["humidity = 3", "allowed are ", "N, Ns, M, K, "],
        ),
        (
            "name = \"a\"\n[model]\netta = 3",
            3,
            &["etta = 3", "did you mean eta"],
        ),
        (
            "name = \"a\"\n[axes]\nwhere = \"V0 > 1\"",
            3,
            &["where must stand above"],
        ),
        (
            "name = \"a\"\n[axes]\nfrequenzy = [3]",
            3,
            &["frequenzy = [3]", "did you mean frequency?"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = { log = [1, 2], point = 3 }",
            3,
            &["point = 3", "did you mean points?"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = { log = [1, 2] }",
            3,
            &["points is missing"],
        ),
        (
            "name = \"a\"\n[record]\nslip = 3",
            3,
            &["slip = 3", "did you mean slips?"],
        ),
        (
            "name = \"a\"\n[record]\nslips = 10000001",
            3,
            &["slips = 10000001", "to 10000000", "memory"],
        ),
        (
            "name = \"a\"\n[solver]\nmethod = \"fixed-step\"",
            2,
            &["dt is missing", "dt = 1e-6"],
        ),
        (
            "name = \"a\"\n[solver]\nmethod = \"fixed\"\ndt = 1",
            3,
            &["\"fixed\"", "fixed-step"],
        ),
        (
            "name = \"a\"\n[solver]\ndt = 1e-6",
            3,
            &["dt = 1e-6", "allowed are method, tolerance"],
        ),
        (
            "name = \"a\"\n[solver]\nmethod = \"fixed-step\"\ntolerance = 1\ndt = 1e-6",
            4,
            &["tolerance = 1", "method, dt"],
        ),
        (
            "name = \"a\"\n[axes.sobol]\nV0 = { log = [1, 2] }",
            2,
            &["points is missing", "[axes.sobol]"],
        ),
        (
            "name = \"a\"\n[axes.sobol]\npoints = 4\nseeds = 1",
            4,
            &["seeds = 1", "did you mean seed?"],
        ),
    ]);
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of cases")]
fn wrong_kinds_and_impossible_values_are_refused_with_what_is_allowed() {
    assert_refused(&[
        ("name = 3", 1, &["name = 3", "letters"]),
        ("name = \"a/b\"", 1, &["name = \"a/b\"", "letters"]),
        ("name = \"-a\"", 1, &["not with - in front"]),
        (
            "name = \"a\"\nmodel = 3",
            2,
            &["model = 3", "a table [model]"],
        ),
        (
            "name = \"a\"\n[model]\nDelta = 1\nT = -0.01",
            4,
            &["T = -0.01", "must be a finite number > 0"],
        ),
        (
            "name = \"a\"\n[model]\nN = \"70\"",
            3,
            &["N = \"70\"", "a whole number from 1"],
        ),
        (
            "name = \"a\"\n[model]\nN = 1.5",
            3,
            &["N = 1.5", "a whole number"],
        ),
        (
            "name = \"a\"\n[model]\nV0 = [1, 2]",
            3,
            &["V0 = [1, 2]", "belong in [axes]"],
        ),
        (
            "name = \"a\"\n[model]\nV0 = nan",
            3,
            &["V0 = nan", "finite"],
        ),
        (
            "name = \"a\"\n[model]\nseed = 99999999999999999999",
            3,
            &["seed = 99999999999999999999", "2^53"],
        ),
        (
            "name = \"a\"\n[model]\nV0 = 0x99999999999999999999",
            3,
            &["V0 = 0x99999999999999999999", "finite"],
        ),
        (
            "name = \"a\"\n[model]\nseed = 9007199254740992",
            3,
            &["seed = 9007199254740992", "2^53"],
        ),
        (
            "name = \"a\"\n[model]\nbreak_on = \"force\"",
            3,
            &["break_on = \"force\"", "\"tension\""],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = 1e-4",
            3,
            &["V0 = 1e-4", "a list [..]", "belongs in [model]"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = []",
            3,
            &["V0 = []", "at least one value"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = [\n1e-4,\n0,\n]",
            5,
            &["V0 = 0", "must be a finite number > 0"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = [1, 2.0, 2]",
            3,
            &["V0 = 2", "repeats value 2", "keep one"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = { log = [0, 1], points = 3 }",
            3,
            &["log = 0", "> 0"],
        ),
        (
            "name = \"a\"\n[axes]\nDelta = { log = [0, 1], points = 3 }",
            3,
            &["log = [0, 1]", "0 has no logarithm"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = { linear = [2, 1], points = 3 }",
            3,
            &["linear = [2, 1]", "low < high: [1, 2]"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = { linear = [2], points = 3 }",
            3,
            &["linear = [2]", "[low, high]"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = { log = [1, 2], points = 0 }",
            3,
            &["points = 0", "a whole number from 2"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = { log = [1, 2], linear = [1, 2], points = 4 }",
            3,
            &["keep one"],
        ),
        (
            "name = \"a\"\n[axes]\nN = { linear = [1, 3], points = 4 }",
            3,
            &["N = 2", "repeats", "fewer points"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = { count = 3 }",
            3,
            &["V0", "fits whole numbers only"],
        ),
        (
            "name = \"a\"\n[axes]\nN = { count = 3 }",
            3,
            &["N = 0", "first"],
        ),
        (
            "name = \"a\"\n[axes]\nseed = { count = 0 }",
            3,
            &["count = 0", "a whole number from 1"],
        ),
        (
            "name = \"a\"\n[axes]\nbreak_on = { linear = [1, 2], points = 2 }",
            3,
            &["list its values"],
        ),
        (
            "name = \"a\"\n[axes]\nzip = 3",
            3,
            &["zip = 3", "[axes.zip]"],
        ),
        (
            "name = \"a\"\n[axes.zip]\nV0 = [1, 2]\nN = [1]",
            4,
            &["N = [1]", "equal length", "V0 has 2"],
        ),
        (
            "name = \"a\"\n[axes.zip]\nV0 = [1, 2]",
            2,
            &["at least two columns"],
        ),
        (
            "name = \"a\"\n\n[[axes.zip]]\nV0 = [1, 1]\nN = [1, 1]",
            3,
            &["row 2 repeats row 1"],
        ),
        (
            "name = \"a\"\n[axes.sobol]\npoints = 65537\nV0 = { log = [1, 2] }",
            3,
            &["points = 65537", "65536"],
        ),
        (
            "name = \"a\"\n[axes.sobol]\npoints = 4",
            2,
            &["at least one quantity"],
        ),
        (
            "name = \"a\"\n[axes.sobol]\npoints = 4\nV0 = [1, 2]",
            4,
            &["V0 = [1, 2]", "in a sample"],
        ),
        (
            "name = \"a\"\n[axes.sobol]\npoints = 9\nN = { linear = [1, 2] }",
            2,
            &["row 3 repeats row 2", "fewer points"],
        ),
        (
            "name = \"a\"\nwhere = \"V0 < \"",
            2,
            &["where = \"V0 < \"", "character 6"],
        ),
        (
            "name = \"a\"\nwhere = [\"V0 < 1\",\n\"v < 1\"]",
            3,
            &["\"v < 1\"", "character 1", "not a known quantity"],
        ),
        (
            "name = \"a\"\nwhere = true",
            2,
            &["where = true", "a condition in quotes"],
        ),
        (
            "name = \"a\"\n[record]\nslips = 0",
            3,
            &["slips = 0", "a whole number from 1"],
        ),
        (
            "name = \"a\"\n[record]\nmax_time = -1",
            3,
            &["max_time = -1", "finite number > 0, in s"],
        ),
        (
            "name = \"a\"\n[record]\ntime = 0",
            3,
            &["time = 0", "finite number > 0, in s"],
        ),
        (
            "name = \"a\"\n[record]\ntime = inf",
            3,
            &["time = inf", "finite number > 0, in s"],
        ),
        (
            "name = \"a\"\n[record]\ntime = \"5 s\"",
            3,
            &["time = \"5 s\"", "finite number > 0, in s"],
        ),
        (
            "name = \"a\"\n[record]\ntime = 3\nmax_time = 3",
            2,
            &[
                "time = 3: no job gets there",
                "max_time = 3",
                "leave one of them out",
            ],
        ),
        (
            "name = \"a\"\n[record]\nprecursors = 1",
            3,
            &["precursors = 1", "true or false"],
        ),
        (
            "name = \"a\"\n[record]\ndrop_size = 0",
            3,
            &["drop_size = 0", "a finite number > 0, in N"],
        ),
        (
            "name = \"a\"\n[record]\ndrop_size = true",
            3,
            &["drop_size = true", "a finite number > 0, in N"],
        ),
        (
            "name = \"a\"\n[record]\ndrop_sise = 5",
            3,
            &["drop_sise = 5", "did you mean drop_size?"],
        ),
        (
            "name = \"a\"\n[solver]\nmethod = \"fixed-step\"\ndt = 0",
            4,
            &["dt = 0", "in s"],
        ),
        (
            "name = \"a\"\n[solver]\nmethod = \"fixed-step\"\ndt = 5e-6",
            4,
            &["dt = 5e-6", "limit", "4.8719e-6 s"],
        ),
        (
            "name = \"a\"\n[solver]\ndt = 4e-6\nmethod = \"fixed-step\"\n[axes]\nM = [1]",
            3,
            &["dt = 4e-6", "limit"],
        ),
        (
            "name = \"a\"\n[solver]\ntolerance = 1",
            3,
            &["tolerance = 1", "from 1e-12 to 1e-2"],
        ),
        (
            "name = \"a\"\n[solver]\ntolerance = 0.5",
            3,
            &["tolerance = 0.5", "relative to fs/k"],
        ),
    ]);
}

#[test]
fn contradictions_and_settings_without_effect_are_refused_with_the_other_place() {
    assert_refused(&[
        (
            "name = \"a\"\n[model]\nV0 = 1e-4\n[axes]\nV0 = [1]",
            5,
            &["V0", "[model]", "line 3", "keep one"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = [1]\n[axes.zip]\nV0 = [2]\nN = [1]",
            5,
            &["V0 in [axes.zip]: is set in [axes], too (line 3)"],
        ),
        (
            "name = \"a\"\n[model]\nT = 1\nDelta = 1\n[axes]\neta = [1]",
            6,
            &["eta", "T in [model]", "line 3"],
        ),
        (
            "name = \"a\"\n[axes]\nDelta = [1]\neta = [1]\nfrequency = [1]",
            5,
            &["frequency", "eta in [axes]"],
        ),
        (
            "name = \"a\"\n[axes]\neta = [1, 2]",
            3,
            &["eta", "no effect while Delta = 0"],
        ),
        (
            "name = \"a\"\n[model]\nT = 1",
            3,
            &["T", "no effect while Delta = 0"],
        ),
        (
            "name = \"a\"\n[model]\nDelta = 1",
            3,
            &["Delta > 0", "needs a period"],
        ),
        (
            "name = \"a\"\n[model]\neta = 3",
            3,
            &["eta", "no effect while Delta = 0"],
        ),
        (
            "name = \"a\"\n[model]\nDelta = 1\neta = 3\nT = 1",
            5,
            &["T in [model]: fixes the period, as does eta in [model] (line 4)"],
        ),
        (
            "name = \"a\"\n[axes]\nDelta = [0, 1]",
            3,
            &["Delta > 0", "frequency (Hz) or eta"],
        ),
        (
            "name = \"a\"\n[axes]\nDelta = [1]\neta = [1, 1.00000000000001]",
            4,
            &["eta", "agrees with 1 in twelve digits"],
        ),
        (
            "name = \"a\"\n[model]\ndfs = 2",
            3,
            &["dfs = 2", "dfs <= fs"],
        ),
        (
            "name = \"a\"\n[model]\ndfs = 1\n[axes]\nfs = [2, 0.5]",
            3,
            &["dfs = 1", "at the point fs = 0.5", "where"],
        ),
        (
            "name = \"a\"\n[axes]\nV0 = [1]\nfs = [1, 1e-3]",
            4,
            &["dfs = 0.0069", "fs = 0.001"],
        ),
        (
            "name = \"a\"\n[axes]\nN = [100, 10000]\nNs = [10, 10000]",
            4,
            &["Ns = 10000", "N = 10000"],
        ),
        (
            "name = \"a\"\n[axes]\nDelta = [1]\nV0 = [1e-200]\neta = [1]",
            5,
            &["eta", "between 1e-100 and 1e100"],
        ),
        (
            "name = \"a\"\nwhere = \"V0 > 1\"\n[axes]\nN = [1, 2]",
            2,
            &["drops every point"],
        ),
        (
            "name = \"a\"\n[axes]\nseed = { count = 9007199254740992 }\nN = { count = 10000, first = 1 }",
            2,
            &["2^64"],
        ),
        (
            "name = \"a\"\nwhere = \"V0 > 1\"\n[axes]\nseed = { count = 5000001 }\nN = [1, 2]",
            3,
            &["10000002 points", "at most 10000000", "[axes.sobol]"],
        ),
    ]);
}

#[test]
fn a_missing_file_is_named() {
    let error = Sweep::from_file(Path::new("no/such/file.toml")).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("no/such/file.toml: cannot be read: "),
        "{error}"
    );
}

#[test]
fn an_error_reads_file_line_key_value_and_what_is_allowed() {
    let error = Sweep::parse(
        "name = \"fig3\"\n[model]\nDelta = 1e-6\nT = -0.01",
        Path::new("sweeps/fig3.toml"),
    );
    assert_eq!(
        error.unwrap_err().to_string(),
        "sweeps/fig3.toml:4: T = -0.01: must be a finite number > 0, in s"
    );
}

/// Errors in every section, out of the order in which the sections are read; those of the whole are not among them.
const MANY: &str = "\
nmae = \"a\"
where = [\"V0 < \", \"T < 1\", \"v < 1\"]
[solver]
tolerance = 1
resolve = \"fast\"
[record]
slips = 0
slps = 3
[model]
T = -1
gama = 3
[axes]
eta = [1, 2]
V0 = { log = [1, 2], point = 3 }
";

#[test]
fn all_errors_of_a_file_are_reported_at_once_in_the_order_of_its_lines() {
    let expected = [
        (
            1,
            "nmae = \"a\": unknown key in the file; did you mean name?",
        ),
        (2, "where = \"V0 < \": at character 6"),
        (2, "where = \"v < 1\": at character 1"),
        (4, "tolerance = 1: must be"),
        (5, "resolve = \"fast\": must be"),
        (7, "slips = 0: must be"),
        (8, "slps = 3: unknown key in [record]; did you mean slips?"),
        (10, "T = -1: must be"),
        (11, "gama = 3: unknown key in [model]; did you mean gamma?"),
        (
            13,
            "eta in [axes]: fixes the period, as does T in [model] (line 10)",
        ),
        (
            14,
            "point = 3: unknown key in an axis; did you mean points?",
        ),
    ];
    let mistakes = refused(MANY);
    for (Mistake { line, problem }, (expected_line, words)) in mistakes.iter().zip(expected) {
        assert!(
            *line == expected_line && problem.starts_with(words),
            "{line}: {problem}, not {expected_line}: {words}"
        );
    }
    assert_eq!(mistakes.len(), expected.len());
}

#[test]
fn ten_errors_are_shown_and_the_others_counted() {
    let bad = |count: usize| {
        let keys: Vec<String> = (0..count).map(|n| format!("x{n} = 1")).collect();
        let text = format!("name = \"a\"\n[record]\n{}", keys.join("\n"));
        Sweep::parse(&text, Path::new("bad.toml"))
            .unwrap_err()
            .to_string()
    };
    let shown = bad(12);
    let lines: Vec<&str> = shown.lines().collect();
    assert_eq!(lines.len(), 12, "{shown}");
    assert_eq!(lines[0], "bad.toml: has 12 mistakes:");
    assert!(
        lines[1].starts_with("  bad.toml:3: x0 = 1: unknown key in [record]; "),
        "{shown}"
    );
    assert!(lines[10].starts_with("  bad.toml:12: x9 = 1: "), "{shown}");
    assert_eq!(lines[11], "  and 2 more");
    assert!(bad(10).contains("allowed are "), "{}", bad(10));
    assert!(!bad(1).contains('\n'), "{}", bad(1));
}

#[test]
fn an_error_leads_to_no_other() {
    for (text, words) in [
        // What is refused is not missing.
        ("name = 3\n[axes]\nDelta = [1]", "name = 3"),
        ("[model]\nname = \"a\"\nDelta = 1", "name must stand above"),
        (
            "name = \"a\"\n[solver]\nmethod = \"fixed-step\"\ndt = 0",
            "dt = 0",
        ),
        (
            "name = \"a\"\n[solver]\nmethod = \"fixed\"\ndt = 1\ntolerance = 1",
            "method = ",
        ),
        (
            "name = \"a\"\n[axes.sobol]\npoint = 4\nV0 = { log = [1, 2] }",
            "did you mean points?",
        ),
        // A column that is refused makes a zip neither short nor uneven.
        ("name = \"a\"\n[axes.zip]\nV0 = [1, 2]\nN = [0]", "N = 0"),
        (
            "name = \"a\"\n[axes.sobol]\npoints = 4\nV0 = [1, 2]",
            "V0 = [1, 2]",
        ),
        // Nor is a period missing, or a modulation, or any point.
        ("name = \"a\"\n[model]\nDelta = 1\nT = -1", "T = -1"),
        (
            "name = \"a\"\n[model]\nDelta = -1\n[axes]\neta = [1]",
            "Delta = -1",
        ),
        (
            "name = \"a\"\nwhere = \"V0 > 1\"\n[axes]\nV0 = [1, 2, \"x\"]",
            "V0 = \"x\"",
        ),
        // Nor is the rest of a broken file refused.
        ("name = 3\n[model\nN = 3\nNs = 4\n[axes]\nV0 = [1]", "TOML"),
        (
            "name = \"a\"\n[axes]\nV0 = [1, 2\nN = [3]\nNs = [3]\n",
            "TOML",
        ),
        ("name = \"a\"\n[model]\nV0 = \"abc\nN = 3\nNs = 4", "TOML"),
    ] {
        let mistakes = refused(text);
        assert!(
            mistakes.len() == 1 && mistakes[0].problem.contains(words),
            "{text}\n{mistakes:?}"
        );
    }
}

#[test]
fn every_column_of_a_zip_or_a_sample_and_every_axis_is_read() {
    let mistakes = refused(
        "name = \"a\"\n[axes]\nfs = []\nseed = { count = 0 }\n[[axes.zip]]\nV0 = [0]\nN = [0]\n\
         [axes.sobol]\npoints = 0\nseed = -1\nK = 3\nfs = { log = [1, 2] }\nM = { log = [2, 1] }\n",
    );
    let lines: Vec<usize> = mistakes.iter().map(|mistake| mistake.line).collect();
    assert_eq!(lines, [3, 4, 6, 7, 9, 10, 11, 12, 13], "{mistakes:?}");
}

#[test]
fn a_condition_on_seeds_that_rounds_choose_is_refused_at_its_line() {
    let seeds = "seeds = { from = 24, to = 30 }";
    let precision = format!("[precision]\nof = \"tau_mean\"\nrelative = 0.1\n{seeds}");
    let refine = format!(
        "[axes]\nV0 = {{ linear = [1e-4, 2e-4], points = 3 }}\n[refine]\naxis = \"V0\"\n\
         by = \"tau_mean\"\nthreshold = 1\nto = 1e-6\njobs = 500\n{seeds}"
    );
    for (rounds, section) in [(precision, "[precision]"), (refine, "[refine]")] {
        for condition in [
            "seed != 1",
            "V0 * (2 - seed) < 1e-3",
            "V0 > 1 or -seed > 0 - 9",
        ] {
            let text = format!("name = \"a\"\nwhere = [\"V0 > 0\",\n\"{condition}\"]\n{rounds}");
            let words = &["seed is chosen by", section, "seeds = { first = .., from"];
            assert_refused(&[(&text, 3, words)]);
        }
        let text = format!("name = \"a\"\nwhere = \"V0 > 0\"\n{rounds}");
        Sweep::parse(&text, Path::new("good.toml")).unwrap();
    }
}

#[test]
fn a_drive_whose_slips_the_clock_does_not_resolve_is_refused_with_the_least_that_works() {
    let slow =
        |velocity: &str, rest: &str| format!("name = \"a\"\n[model]\nV0 = {velocity}\n{rest}");
    for rest in [
        "",
        "N = 1",
        "K = 1e14",
        "Kd = 1e3\n[record]\nslips = 4000",
        "tau_r = 50",
    ] {
        let text = slow("1e-18", rest);
        let [Mistake { line: 3, problem }] = &refused(&text)[..] else {
            panic!("{text}");
        };
        let least = problem
            .split("write V0 = ")
            .nth(1)
            .unwrap()
            .split(' ')
            .next()
            .unwrap();
        Sweep::parse(&slow(least, rest), Path::new("least.toml")).unwrap();
        let below = 0.97 * least.parse::<f64>().unwrap();
        refused(&slow(&format!("{below:e}"), rest));
    }
    let axis = "name = \"a\"\nwhere = \"V0 > 0\"\n[axes]\nV0 = [1e-4, 1e-18]\nN = [3]";
    assert_refused(&[(axis, 4, &["V0 = 1e-18", "at the point V0 = 1e-18"])]);
    for rest in [
        "[record]\nmax_time = 1e3",
        "[axes]\nN = [70]\n[record]\nmax_time = 1",
    ] {
        Sweep::parse(&slow("1e-18", rest), Path::new("short.toml")).unwrap();
    }
    let dropped = axis.replace("V0 > 0", "V0 > 1e-9");
    Sweep::parse(&dropped, Path::new("dropped.toml")).unwrap();
}

#[test]
fn targets_that_cannot_be_are_refused_with_what_is_allowed() {
    let precision = |text: &str| format!("name = \"a\"\n[precision]\n{text}");
    let seeds = "seeds = { from = 4, to = 8 }";
    let precise = |of: &str| precision(&format!("of = {of}\nrelative = 0.01\n{seeds}"));
    let table: Vec<(String, usize, &[&str])> = vec![
        (
            precise("\"tau\""),
            3,
            &["of = \"tau\"", "no statistic of a set", "tau_mean"],
        ),
        (precise("\"tau_meen\""), 3, &["did you mean tau_mean?"]),
        (
            precise("\"tau_25\""),
            3,
            &["of = \"tau_25\"", "no confidence interval", "mean_friction"],
        ),
        (precise("[]"), 3, &["at least one statistic"]),
        (precise("[\"tau_mean\",\n3]"), 4, &["of = 3", "in quotes"]),
        (
            precise("\"phase_mean\""),
            4,
            &["relative = 0.01", "an angle", "absolute"],
        ),
        (
            precision(&format!("of = \"tau_mean\"\n{seeds}")),
            2,
            &["relative is missing", "or absolute"],
        ),
        (
            precision(&format!("relative = 0.1\n{seeds}")),
            2,
            &["of is missing"],
        ),
        (
            precision(&format!(
                "of = \"resultant_excess\"\nrelative = 0.1\n{seeds}"
            )),
            2,
            &[
                "resultant_excess needs controls",
                "control = true in [record]",
            ],
        ),
        (
            "name = \"a\"\n[record]\ncontrol = true\n".to_owned(),
            2,
            &["control: has no effect while Delta = 0"],
        ),
        (
            precision(&format!("of = \"tau_mean\"\nrelative = 0\n{seeds}")),
            4,
            &["relative = 0", "> 0 and < 1"],
        ),
        (
            precision(&format!("of = \"tau_mean\"\nrelative = -0.1\n{seeds}")),
            4,
            &["relative = -0.1", "> 0 and < 1"],
        ),
        (
            precision(&format!("of = \"tau_mean\"\nabsolute = 0\n{seeds}")),
            4,
            &["absolute = 0", "> 0, in s"],
        ),
        (
            precision(&format!(
                "of = \"tau_mean\"\nrelative = 0.1\nabsolute = 1\n{seeds}"
            )),
            5,
            &["absolute = 1", "relative is there too", "keep one"],
        ),
        (
            precision(&format!(
                "of = [\"tau_mean\", \"drop_mean\"]\nabsolute = 1\n{seeds}"
            )),
            4,
            &["absolute = 1", "different units"],
        ),
        (
            precision("of = \"tau_mean\"\nrelative = 0.1"),
            2,
            &["seeds is missing"],
        ),
        (
            precision("of = \"tau_mean\"\nrelative = 0.1\nseeds = 8"),
            5,
            &["seeds = 8", "{ from = 24, to = 256 }"],
        ),
        (
            precision("of = \"tau_mean\"\nrelative = 0.1\nseeds = { from = 8, to = 4 }"),
            5,
            &["to = 4", "at least from, which is 8"],
        ),
        (
            precision("of = \"tau_mean\"\nrelative = 0.1\nseeds = { from = 1, to = 4 }"),
            5,
            &["from = 1", "from 2"],
        ),
        (
            precise("\"tau_mean\"\nrelativ = 3"),
            4,
            &["relativ = 3", "[precision]", "did you mean relative?"],
        ),
        (
            format!(
                "{}\n[axes]\nseed = {{ count = 3 }}",
                precise("\"tau_mean\"")
            ),
            5,
            &["seed", "is set in [axes], too (line 7)"],
        ),
    ];
    for (text, line, words) in &table {
        assert_refused(&[(text, *line, words)]);
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of cases")]
fn refinements_that_cannot_be_are_refused_with_what_is_allowed() {
    const RANGES: &str = "name = \"a\"\n[axes]\nfrequency = { linear = [5, 75], points = 8 }\n\
                          Delta = { log = [1e-7, 4e-6], points = 5 }\nV0 = [1e-4]\n";
    let refine = |text: &str| format!("{RANGES}[refine]\n{text}");
    let good = "axis = \"frequency\"\nby = \"resultant_length\"\nthreshold = 0.5\nto = 0.1\n\
                seeds = { first = 7, from = 4, to = 48 }\njobs = 960\n";
    Sweep::parse(&refine(good), Path::new("good.toml")).unwrap();
    let instead = |from: &str, to: &str| refine(&good.replace(from, to));
    let table: Vec<(String, usize, &[&str])> = vec![
        (
            instead("frequency", "frequenzy"),
            7,
            &["axis = \"frequenzy\"", "did you mean frequency?"],
        ),
        (
            instead("\"frequency\"", "[\"frequency\"]"),
            7,
            &["axis = [\"frequency\"]", "the name of one axis"],
        ),
        (
            instead("frequency", "break_on"),
            7,
            &["axis = \"break_on\"", "is a word"],
        ),
        (
            instead("frequency", "N"),
            7,
            &["axis = \"N\"", "whole numbers"],
        ),
        (
            instead("frequency", "T"),
            7,
            &["axis = \"T\"", "no range of its own in [axes]"],
        ),
        (
            instead("frequency", "K"),
            7,
            &["axis = \"K\"", "no range of its own in [axes]"],
        ),
        (
            instead("frequency", "V0"),
            7,
            &["axis = \"V0\"", "no range of its own in [axes]", "linear"],
        ),
        (
            format!(
                "name = \"a\"\n[axes.zip]\nK = [1e8, 2e8]\nV0 = [1e-4, 2e-4]\n[refine]\n{}",
                good.replace("frequency", "K")
            ),
            6,
            &["axis = \"K\"", "no range of its own in [axes]"],
        ),
        (
            instead("\"resultant_length\"", "\"resultant\""),
            8,
            &["by = \"resultant\"", "no statistic of a set"],
        ),
        (
            instead("\"resultant_length\"", "\"tau_meen\""),
            8,
            &["did you mean tau_mean?"],
        ),
        (
            instead("\"resultant_length\"", "[\"tau_mean\", \"tau_50\"]"),
            8,
            &["by = \"tau_50\"", "crosses no threshold"],
        ),
        (
            instead("\"resultant_length\"", "\"phase_mean\""),
            8,
            &["by = \"phase_mean\"", "crosses no threshold"],
        ),
        (
            instead("\"resultant_length\"", "\"regime\""),
            8,
            &["by = \"regime\"", "allowed are periods, slip_share"],
        ),
        (
            instead("\"resultant_length\"", "[]"),
            8,
            &["at least one statistic"],
        ),
        (
            instead("\"resultant_length\"", "3"),
            8,
            &["by = 3", "in quotes"],
        ),
        (
            instead("resultant_length", "resultant_drive"),
            6,
            &["resultant_drive needs controls", "control = true"],
        ),
        (
            instead("threshold = 0.5", "value = 4\nthreshold = 0.5"),
            9,
            &["value = 4", "by = \"periods\""],
        ),
        (
            instead("threshold = 0.5\n", ""),
            6,
            &["threshold is missing"],
        ),
        (
            instead("threshold = 0.5", "threshold = true"),
            9,
            &["threshold = true", "a finite number"],
        ),
        (
            instead("resultant_length", "periods"),
            6,
            &["value is missing", "n of tau = n T"],
        ),
        (
            instead("\"resultant_length\"", "\"periods\"\nvalue = 3.5"),
            9,
            &["value = 3.5", "whole"],
        ),
        (
            instead("to = 0.1", "to = 10"),
            10,
            &["to = 10", "finer than 10"],
        ),
        (instead("to = 0.1", "to = 0"), 10, &["to = 0", "> 0"]),
        (
            instead("to = 0.1", "to = 1e-9"),
            10,
            &["to = 1e-9", "1000000 values"],
        ),
        (
            instead("from = 4, to = 48", "from = 4"),
            11,
            &["to is missing in seeds"],
        ),
        (
            instead("first = 7", "first = -7"),
            11,
            &["first = -7", "from 0"],
        ),
        (
            instead("jobs = 960", "jobs = 959"),
            12,
            &["jobs = 959", "at least the 960 of the first round"],
        ),
        (
            instead("jobs = 960", "jobs = 0"),
            12,
            &["jobs = 0", "from 1 to 1000000"],
        ),
        (instead("jobs = 960\n", ""), 6, &["jobs is missing"]),
        (
            instead("jobs = 960", "jobs = 960\nfiner = 3"),
            13,
            &["finer = 3", "[refine]", "allowed are axis, by"],
        ),
        (
            format!(
                "{}[precision]\nof = \"tau_mean\"\nrelative = 0.1\n",
                refine(good)
            ),
            13,
            &[
                "[precision]: [refine] gives sets the seeds",
                "keep one of them",
            ],
        ),
        (
            refine(good).replace("V0 = [1e-4]", "seed = { count = 3 }"),
            11,
            &["seed", "is set in [axes], too (line 5)"],
        ),
    ];
    for (text, line, words) in &table {
        assert_refused(&[(text, *line, words)]);
    }
}
