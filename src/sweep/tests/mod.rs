//! Sweeps from the text of a file to jobs and parts.

mod bad_files;
mod properties;
mod schema;

use super::*;
use crate::model::{BreakOn, Parameters, Symbol, Value};
use crate::solver::Solver;
use std::collections::HashSet;
use std::path::Path;

fn sweep(text: &str) -> Sweep {
    let text = if text.contains("name =") {
        text.to_owned()
    } else {
        format!("name = \"test\"\n{text}")
    };
    Sweep::parse(&text, Path::new("test.toml")).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn values(sweep: &Sweep, symbol: Symbol) -> Vec<Value> {
    sweep.jobs().map(|job| job.parameters.get(symbol)).collect()
}

fn counts(sweep: &Sweep, symbol: Symbol) -> Vec<u64> {
    let count = |value| {
        if let Value::Count(count) = value {
            count
        } else {
            panic!("{value} is no count")
        }
    };
    values(sweep, symbol).into_iter().map(count).collect()
}

#[test]
fn a_file_with_a_name_alone_is_one_job_of_the_defaults() {
    let sweep = sweep("");
    let jobs: Vec<Job> = sweep.jobs().collect();
    assert_eq!(
        (sweep.name(), sweep.point_count(), sweep.text()),
        ("test", 1, "name = \"test\"\n")
    );
    assert_eq!(jobs.len(), 1);
    assert_eq!(jobs[0].parameters, Parameters::default());
}

#[test]
fn samples_are_pinned() {
    // Known answers: points of a sample are parameters of jobs, and so part of every id.
    let sample = "points = 3\nseed = 7\nK = { linear = [1e7, 2e7] }\nKd = { linear = [1, 2] }";
    let found = values(&sweep(&format!("[axes.sobol]\n{sample}")), Symbol::Kd);
    let known = [1.592_596_173_29, 1.194_618_463_52, 1.365_000_367_16];
    assert_eq!(found, known.map(Value::Real));
}

#[test]
fn a_time_alone_leaves_the_number_of_slips_open() {
    let ends = |record: &str| {
        let recording = *sweep(&format!("[record]\n{record}")).recording();
        (recording.slips, recording.time)
    };
    assert_eq!(ends(""), (Some(40), None));
    assert_eq!(ends("time = 5"), (None, Some(5.0)));
    assert_eq!(ends("time = 5\nslips = 9"), (Some(9), Some(5.0)));
    assert_eq!(ends("max_time = 5"), (Some(40), None));
    let command = |record: &str| {
        let sweep = sweep(&format!("[record]\n{record}"));
        sweep.command(&sweep.jobs().next().unwrap())
    };
    assert_eq!(command("time = 5"), "stickslip simulate --record time=5");
    assert_eq!(
        command("time = 5\nslips = 40"),
        "stickslip simulate --slips 40 --record time=5"
    );
}

#[test]
fn a_command_has_the_frequency_where_its_period_has_more_digits() {
    let command = |period: &str| {
        let sweep = sweep(&format!("[model]\nDelta = 1\n{period}"));
        sweep.command(&sweep.jobs().next().unwrap())
    };
    let expected =
        |setting: &str| format!("stickslip simulate --set Delta=1 --set {setting} --slips 40");
    assert_eq!(command("frequency = 116"), expected("frequency=116"));
    assert_eq!(command("frequency = 50"), expected("T=0.02"));
    assert_eq!(command("T = 0.0123456789"), expected("T=0.0123456789"));
}

#[test]
fn all_sections_are_read() {
    let sweep = sweep(
        "[model]\nN = 0x14\nK = 2e8\nbreak_on = \"tension\"\nDelta = 1e-6\nT = 1\n\
         [record]\nslips = 7\ndiscard = 0\nmax_time = 2\nmax_events = 1_000\nprecursor_size = 3\nprecursors = true\n\
         drop_size = 5\n\
         [solver]\nmethod = \"fixed-step\"\ndt = 2e-6",
    );
    let parameters = sweep.jobs().next().unwrap().parameters;
    assert_eq!((parameters.blocks, parameters.slider_stiffness), (20, 2e8));
    assert_eq!(
        (parameters.break_on, parameters.modulation_period),
        (BreakOn::Tension, Some(1.0))
    );
    let recording = sweep.recording();
    assert_eq!(
        (recording.slips, recording.discard, recording.max_time),
        (Some(7), 0, Some(2.0))
    );
    assert_eq!(
        (
            recording.max_events,
            recording.precursor_size,
            recording.precursors
        ),
        (1000, Some(3), true)
    );
    assert_eq!(recording.drop_size, Some(5.0));
    assert_eq!(sweep.solver(), Solver::fixed_step(2e-6));
}

#[test]
fn the_last_axis_of_the_file_moves_fastest() {
    let sweep = sweep(
        "[axes]\nseed = { count = 2, first = 5 }\nN = [2, 1]\nbreak_on = [\"tension\", \"magnitude\"]",
    );
    assert_eq!(counts(&sweep, Symbol::Seed), [5, 5, 5, 5, 6, 6, 6, 6]);
    assert_eq!(counts(&sweep, Symbol::N), [2, 2, 1, 1, 2, 2, 1, 1]);
    let axes: Vec<_> = sweep.axes().collect();
    assert_eq!(
        axes,
        [
            ("seed".to_owned(), 2),
            ("N".to_owned(), 2),
            ("break_on".to_owned(), 2)
        ]
    );
}

#[test]
fn eta_and_frequency_fix_the_period() {
    let by_eta = sweep("[axes]\nDelta = [1e-6]\nV0 = [2e-4]\neta = [0.5, 4]");
    for (job, eta) in by_eta.jobs().zip([0.5, 4.0]) {
        assert!((job.parameters.eta() / eta - 1.0).abs() < 1e-15);
    }
    let by_frequency = sweep("[model]\nDelta = 1e-6\n[axes]\nfrequency = [29, 58]");
    assert_eq!(
        values(&by_frequency, Symbol::T),
        [Value::Real(1.0 / 29.0), Value::Real(1.0 / 58.0)]
    );
}

#[test]
fn a_range_holds_the_numbers_that_people_write() {
    let in_common = "seed = { count = 2 }\nDelta = [0, 1e-6]";
    let ranged = sweep(&format!(
        "where = \"V0 == 1e-4 or frequency == 30\"\n[axes]\nV0 = {{ log = [1e-6, 1e-3], points = 7 }}\n\
         frequency = {{ linear = [0.1, 99.9], points = 999 }}\n{in_common}"
    ));
    let velocities = "3.16227766017e-6, 1e-5, 3.16227766017e-5, 1e-4, 3.16227766017e-4, 1e-3";
    let frequencies: Vec<String> = (1..=999)
        .map(|tenths| format!("{}.{}", tenths / 10, tenths % 10))
        .collect();
    let listed = sweep(&format!(
        "where = \"V0 == 1e-4 or frequency == 30\"\n[axes]\nV0 = [1e-6, {velocities}]\nfrequency = [{}]\n{in_common}",
        frequencies.join(", ")
    ));
    assert_eq!(ranged.jobs().count(), 2 * (1 + 999 + 6));
    for (ranged, listed) in ranged.jobs().zip(listed.jobs()) {
        assert_eq!(ranged, listed);
    }
    let sample = |range: &str| {
        values(
            &sweep(&format!("[axes.sobol]\npoints = 9\nV0 = {{ {range} }}")),
            Symbol::V0,
        )
    };
    for value in [
        sample("log = [1e-6, 1e-3]"),
        sample("linear = [1e-6, 1e-3]"),
    ]
    .concat()
    {
        let Value::Real(value) = value else {
            panic!("{value}")
        };
        assert_eq!(format!("{value:.11e}").parse(), Ok(value));
    }
    assert!(
        Sweep::parse(
            "name = \"a\"\n[axes]\nV0 = { linear = [1, 1.00000000001], points = 9 }",
            Path::new("a.toml")
        )
        .unwrap_err()
        .to_string()
        .contains("repeats value 1 of this axis")
    );
}

#[test]
fn whole_quantities_take_rounded_values_of_a_range() {
    assert_eq!(
        counts(
            &sweep("[axes]\nN = { log = [1, 1000], points = 5 }"),
            Symbol::N
        ),
        [1, 6, 32, 178, 1000]
    );
}

#[test]
fn without_modulation_one_point_stands_for_all_periods() {
    let sweep = sweep("[axes]\nDelta = [0, 1e-6]\neta = [1, 2, 3]\nseed = { count = 2 }");
    let seen: Vec<(f64, u64)> = sweep
        .jobs()
        .map(|job| (job.parameters.modulation_amplitude, job.parameters.seed))
        .collect();
    assert_eq!(sweep.point_count(), 12);
    assert_eq!(seen.len(), 2 + 6);
    assert_eq!(seen[..2], [(0.0, 0), (0.0, 1)]);
}

#[test]
fn without_modulation_rows_of_a_zip_differ_by_their_other_columns() {
    let sweep = sweep("[axes.zip]\ndfs = [0, 0, 0.1, 0]\nDelta = [0, 0, 0, 1]\nT = [1, 2, 3, 1]");
    let deviations = [0.0, 0.1, 0.0].map(Value::Real);
    assert_eq!(values(&sweep, Symbol::Dfs), deviations);
}

#[test]
fn conditions_drop_points_that_would_not_be_valid() {
    let sweep = sweep("where = [\"dfs <= fs\", \"fs < 3\"]\n[axes]\ndfs = [1, 2]\nfs = [1, 2, 3]");
    assert_eq!(sweep.jobs().count(), 3);
    assert!(sweep.jobs().all(|job| job.parameters.validated().is_ok()));
}

#[test]
fn samples_fill_their_ranges() {
    let sweep = sweep(
        "[axes]\nseed = { count = 2 }\n[axes.sobol]\npoints = 64\nseed = 3\n\
         V0 = { log = [1e-5, 1e-3] }\nN = { linear = [2, 40] }",
    );
    let below = sweep
        .jobs()
        .filter(|job| job.parameters.drive_velocity < 1e-4)
        .count();
    assert_eq!((sweep.jobs().count(), below), (128, 64));
    assert!(
        sweep
            .jobs()
            .all(|job| (2..=40).contains(&job.parameters.blocks))
    );
}

#[test]
fn differences_are_reported_except_in_axes_and_conditions() {
    let before = sweep("[model]\nK = 1e8\n[axes]\nV0 = [1e-4]");
    let same = sweep(
        "where = \"V0 > 0\"\n[axes]\nV0 = [1e-4, 2e-4]\nseed = { count = 3 }\nDelta = [0, 1]\neta = [1]",
    );
    assert!(before.differences(&same).is_empty());
    let other = sweep(
        "name = \"b\"\n[model]\nK = 2e8\nDelta = 1\nT = 2\n[record]\nmax_time = 1\nslips = 3\n[solver]\ntolerance = 1e-7",
    );
    let reported = before.differences(&other);
    assert_eq!(
        reported,
        [
            "name: test -> b",
            "model.K: 1e8 -> 2e8",
            "model.Delta: 0 -> 1",
            "model.T: none -> 2",
            "solver.tolerance: 0.001 -> 1e-7",
            "record.slips: 40 -> 3",
        ]
    );
}

/// The extensions of these sweeps, each begun once all before it was done.
fn extensions<'a>(sweeps: impl IntoIterator<Item = &'a Sweep>) -> Vec<Extension> {
    let mut extensions: Vec<Extension> = Vec::new();
    for sweep in sweeps {
        if let Some(last) = extensions.len().checked_sub(1) {
            extensions[last].kept = Some(Plan::new(&extensions).ranges(last, |_| true));
        }
        extensions.push(Extension::new(sweep, &extensions));
    }
    extensions
}

#[test]
fn parts_end_at_their_cost_and_at_their_number_of_jobs() {
    let sizes = |seeds: u64, cost: f64| -> Vec<usize> {
        // The fixed step costs 110 ns.
        let steps = cost / 110e-9;
        let text = format!(
            "[record]\nmax_time = {}\n[solver]\nmethod = \"fixed-step\"\ndt = 1e-12\n[axes]\nseed = {{ count = {seeds} }}",
            steps * 1e-12
        );
        Plan::new(&extensions([&sweep(&text)]))
            .parts()
            .map(|part| part.jobs.len())
            .collect()
    };
    // Two parts at least, then 5 s each; expensive jobs alone; more than 5 s where parts would be too many.
    assert_eq!(sizes(10, 0.6), [5, 5]);
    assert_eq!(sizes(20, 0.6), [8, 8, 4]);
    assert_eq!(sizes(20, 6.0), [1; 20]);
    assert_eq!(sizes(20_000, 12.0)[..2], [1, 1]);
    assert_eq!(sizes(100_000, 3.0)[..2], [5, 5]);
    assert_eq!(
        sizes(10_000, 1e-5),
        [PART_JOBS, PART_JOBS, 10_000 - 2 * PART_JOBS]
    );
}

#[test]
fn what_an_earlier_sweep_did_is_kept_and_the_rest_belongs_to_the_new_one() {
    // Expensive enough for a part each.
    let record = "[record]\nslips = 10000";
    let wide = sweep(&format!(
        "[axes]\nV0 = [1e-4, 2e-4]\nseed = {{ count = 4 }}\n{record}"
    ));
    let narrow = sweep(&format!(
        "[axes]\nV0 = [1e-4]\nseed = {{ count = 4 }}\n{record}"
    ));
    let mut all = extensions([&wide]);
    all[0].kept = Some(Plan::new(&all).ranges(0, |part| [1, 2, 5].contains(&part.name.index)));
    let parts: Vec<usize> = Plan::new(&all)
        .parts()
        .map(|part| part.jobs.len())
        .collect();
    assert_eq!(
        (parts, &all[0].kept),
        (vec![1; 3], &Some(vec![1..=2, 5..=5]))
    );
    all.push(Extension::new(&narrow, &all));
    let jobs: Vec<(usize, u64, f64, u64)> = Plan::new(&all)
        .parts()
        .flat_map(|Part { outline, jobs }| {
            jobs.into_iter()
                .map(move |job| (outline.name.extension, outline.name.index, job))
        })
        .map(|(extension, index, job)| {
            (
                extension,
                index,
                job.parameters.drive_velocity,
                job.parameters.seed,
            )
        })
        .collect();
    assert_eq!(
        jobs,
        [
            (0, 1, 1e-4, 1),
            (0, 2, 1e-4, 2),
            (0, 5, 2e-4, 1),
            (1, 0, 1e-4, 0),
            (1, 1, 1e-4, 3)
        ]
    );
}

#[test]
fn an_extended_sweep_owns_its_new_jobs_alone() {
    let two = sweep("[axes]\nV0 = [1e-4, 2e-4]\nseed = { count = 2 }");
    let three = sweep("[axes]\nseed = { count = 3 }\nV0 = [2e-4, 1e-4]");
    let extensions = extensions([&two, &three, &three]);
    let plan = Plan::new(&extensions);
    let seeds = |extension| {
        let jobs = plan.parts_of(extension).flat_map(|part| part.jobs);
        jobs.map(|job| job.parameters.seed).collect::<Vec<_>>()
    };
    assert_eq!(seeds(0), [0, 1, 0, 1]);
    assert_eq!(seeds(1), [2, 2]);
    assert!(seeds(2).is_empty());
    assert_eq!(plan.totals().jobs, 6);
}

#[test]
fn the_sweeps_of_the_figures_are_read_and_take_minutes_at_most() {
    for (text, name) in [
        (include_str!("../../../sweeps/fig2.toml"), "fig2"),
        (include_str!("../../../sweeps/fig3.toml"), "fig3"),
    ] {
        let sweep = sweep(text);
        let totals = Plan::new(&extensions([&sweep])).totals();
        assert_eq!(sweep.name(), name);
        assert!((5.0..300.0).contains(&totals.cost), "{name}: {totals:?}");
        let jobs: HashSet<String> = sweep
            .jobs()
            .map(|job| sweep.job_id(&job.parameters))
            .collect();
        assert_eq!(jobs.len() as u64, totals.jobs);
    }
}

/// The promise of the plan, measured: run with `--ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn ten_million_jobs_are_planned_in_seconds() {
    let text = "where = \"frequency < 1e9\"\n[axes]\nV0 = { log = [3e-5, 2e-4], points = 100 }\n\
                Delta = { log = [3e-7, 1e-6], points = 10 }\neta = { log = [0.2, 1000], points = 100 }\n\
                seed = { count = 99 }";
    let [first, more] = [
        sweep(text),
        sweep(&text.replace("count = 99", "count = 100")),
    ];
    let start = std::time::Instant::now();
    let before = extensions([&first]);
    println!("begun in {:?}", start.elapsed());
    let start = std::time::Instant::now();
    let totals = Plan::new(&before).totals();
    println!("{totals:?} in {:?}", start.elapsed());
    let start = std::time::Instant::now();
    let all = extensions([&first, &more]);
    let new: usize = Plan::new(&all)
        .parts_of(1)
        .map(|part| part.jobs.len())
        .sum();
    println!("{new} new jobs found in {:?}", start.elapsed());
    let start = std::time::Instant::now();
    let hashed = first
        .jobs()
        .take(1_000_000)
        .filter(|job| !first.job_id(&job.parameters).starts_with("00"));
    println!("{} of 1e6 ids in {:?}", hashed.count(), start.elapsed());
    assert_eq!((totals.jobs, new), (9_900_000, 100_000));
}
