//! Properties of random sweeps: what is printed is read, every job is found, parts cover the jobs once and in order.

use super::super::job::VERSIONS;
use super::super::{Extension, Identity, Job, PART_JOBS, Plan, Sweep};
use super::{extensions, sweep};
use crate::model::{Parameters, Symbol, Value};
use crate::table::value::Shortest;
use proptest::collection::btree_set;
use proptest::prelude::*;
use std::collections::HashSet;

/// A random axis as a file writes it: its lines below `[axes]`, or a separate table.
fn list(
    key: &'static str,
    values: impl Strategy<Value = Vec<f64>>,
) -> impl Strategy<Value = String> {
    values.prop_map(move |values| format!("{key} = {}\n", listed(&values)))
}

fn listed(values: &[f64]) -> String {
    let values: Vec<String> = values
        .iter()
        .map(|value| Shortest(*value).to_string())
        .collect();
    format!("[{}]", values.join(", "))
}

/// Distinct positive numbers, in no order.
fn numbers(max: usize) -> impl Strategy<Value = Vec<f64>> {
    btree_set(1_u32..4000, 1..=max)
        .prop_map(|set| {
            set.into_iter()
                .map(|n| f64::from(n) * 1e-7)
                .collect::<Vec<_>>()
        })
        .prop_shuffle()
}

fn range(key: &'static str) -> impl Strategy<Value = String> {
    (
        prop_oneof![Just("linear"), Just("log")],
        1e-6..1e-3,
        1.1..100.0,
        2_u64..9,
    )
        .prop_map(move |(kind, low, ratio, points): (_, f64, f64, _)| {
            format!(
                "{key} = {{ {kind} = [{}, {}], points = {points} }}\n",
                Shortest(low),
                Shortest(low * ratio)
            )
        })
}

/// What fixes the period, with amplitudes that include 0: a separate axis, in a zip or in a sample.
fn modulation() -> impl Strategy<Value = String> {
    let key = || prop_oneof![Just("T"), Just("eta"), Just("frequency")];
    let amplitudes = prop_oneof![Just("[0, 3e-7, 1e-6]"), Just("[2e-7, 0]"), Just("[1e-6]")];
    let own = (key(), amplitudes.clone(), numbers(5)).prop_map(|(key, amplitudes, values)| {
        format!("{key} = {}\nDelta = {amplitudes}\n", listed(&values))
    });
    let zip = (key(), amplitudes.clone(), numbers(6)).prop_map(|(key, _, values)| {
        let amplitudes: Vec<f64> = (0..values.len())
            .map(|row| if row % 3 == 1 { 1e-6 } else { 0.0 })
            .collect();
        let amplitudes = if values.len() < 2 {
            vec![1e-6; values.len()]
        } else {
            amplitudes
        };
        format!(
            "[[axes.zip]]\n{key} = {}\nDelta = {}\n",
            listed(&values),
            listed(&amplitudes)
        )
    });
    let sample =
        (key(), amplitudes, 1..20, any::<u32>()).prop_map(|(key, amplitudes, points, seed)| {
            format!(
                "Delta = {amplitudes}\n[axes.sobol]\npoints = {points}\nseed = {seed}\n\
                 {key} = {{ log = [0.01, 50] }}\nKd = {{ linear = [1e6, 1e8] }}\n"
            )
        });
    prop_oneof![Just(String::new()), own, zip, sample]
}

/// The text of a random sweep that is valid.
fn texts() -> impl Strategy<Value = String> {
    let velocity = prop_oneof![Just(String::new()), list("V0", numbers(4)), range("V0")];
    let seeds = prop_oneof![
        Just(String::new()),
        (1_u64..5, 0_u64..9)
            .prop_map(|(count, first)| format!("seed = {{ count = {count}, first = {first} }}\n"))
    ];
    let blocks = prop_oneof![
        Just(String::new()),
        Just("N = [3, 70, 1]\nbreak_on = [\"tension\", \"magnitude\"]\n".to_owned())
    ];
    let condition = prop_oneof![
        Just(""),
        Just("where = \"V0 > 1e-5 or N >= 1 and (eta < 5 or T < 2)\"\n")
    ];
    (condition, velocity, seeds, blocks, modulation()).prop_map(
        |(condition, velocity, seeds, blocks, modulation)| {
            format!("name = \"random\"\n{condition}[axes]\n{velocity}{seeds}{blocks}{modulation}")
        },
    )
}

/// Parameters that differ in the last bit, or by one.
fn perturbed(parameters: &Parameters, symbol: Symbol) -> Option<Parameters> {
    let mut other = parameters.clone();
    let value = match parameters.get(symbol) {
        Value::Real(real) => Value::Real(real.next_up()),
        Value::Count(count) => Value::Count(count + 1),
        _ => return None,
    };
    other.set(symbol, value).ok()?;
    (symbol != Symbol::Delta || parameters.modulation_amplitude > 0.0).then_some(other)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn numbers_in_a_file_are_read_to_their_last_bit(value in prop::num::f64::POSITIVE) {
        let text = format!("[model]\nL = {}\n[axes]\nFN = [{value:?}]", Shortest(value));
        let parameters = sweep(&text).jobs().next().unwrap().parameters;
        prop_assert_eq!(parameters.slider_length.to_bits(), value.to_bits());
        prop_assert_eq!(parameters.normal_force.to_bits(), value.to_bits());
    }

    #[test]
    fn every_job_is_valid_found_and_unlike_any_other(text in texts()) {
        let sweep = sweep(&text);
        let jobs: Vec<Job> = sweep.jobs().collect();
        let ids: HashSet<_> = jobs.iter().map(|job| sweep.job_id(&job.parameters)).collect();
        prop_assert_eq!(ids.len(), jobs.len());
        prop_assert!(jobs.len() as u64 <= sweep.point_count());
        for Job { point, parameters, cost } in &jobs {
            prop_assert_eq!(&parameters.clone().validated().unwrap(), parameters);
            prop_assert_eq!(sweep.find(parameters), Some(*point), "{:?}", parameters);
            prop_assert!(*cost > 0.0);
        }
    }

    #[test]
    fn parameters_of_no_job_are_not_found(text in texts(), of in any::<prop::sample::Index>()) {
        let sweep = sweep(&text);
        let jobs: Vec<Job> = sweep.jobs().collect();
        let ids: HashSet<_> = jobs.iter().map(|job| sweep.job_id(&job.parameters)).collect();
        let parameters = &jobs[of.index(jobs.len())].parameters;
        for other in Symbol::ALL.into_iter().filter_map(|symbol| perturbed(parameters, symbol)) {
            let is_job = ids.contains(&sweep.job_id(&other));
            prop_assert_eq!(sweep.find(&other).is_some(), is_job, "{:?}", other);
        }
    }

    #[test]
    fn parts_cover_the_jobs_of_all_extensions_once_and_in_order(texts in prop::collection::vec(texts(), 1..4)) {
        let sweeps: Vec<Sweep> = texts.iter().map(|text| sweep(text)).collect();
        let identity = Identity::new(VERSIONS, sweeps[0].solver(), sweeps[0].recording(), None);
        let mut seen = HashSet::new();
        let mut expected = Vec::new();
        for (extension, sweep) in sweeps.iter().enumerate() {
            expected.extend(sweep.jobs().filter(|job| seen.insert(identity.id(&job.parameters, &Symbol::ALL))).map(|job| (extension, job)));
        }
        let extensions = extensions(&sweeps);
        let plan = Plan::new(&extensions);
        let mut covered = Vec::new();
        let mut next = vec![0; extensions.len()];
        for part in plan.parts() {
            prop_assert_eq!(part.name.index, next[part.name.extension]);
            next[part.name.extension] += 1;
            prop_assert!(!part.jobs.is_empty() && part.jobs.len() <= PART_JOBS);
            prop_assert!(part.jobs.len() == 1 || part.cost <= extensions[part.name.extension].part_cost);
            prop_assert_eq!(&plan.part(&part.outline), &part);
            let super::Part { outline, jobs } = part;
            covered.extend(jobs.into_iter().map(|job| (outline.name.extension, job)));
        }
        prop_assert_eq!(covered, expected);
    }

    /// Whatever was done of each sweep when the next began.
    #[test]
    fn every_job_of_the_last_sweep_is_there_once_and_of_the_others_what_was_done(
        texts in prop::collection::vec(texts(), 2..4), is_done in prop::collection::vec(any::<bool>(), 64)
    ) {
        let sweeps: Vec<Sweep> = texts.iter().map(|text| sweep(text)).collect();
        let identity = Identity::new(VERSIONS, sweeps[0].solver(), sweeps[0].recording(), None);
        let (mut extensions, mut done): (Vec<Extension>, Vec<_>) = (Vec::new(), Vec::new());
        for sweep in &sweeps {
            if let Some(last) = extensions.len().checked_sub(1) {
                let is_done = |index: u64| is_done[usize::try_from(index).unwrap().wrapping_add(7 * last) % is_done.len()];
                let plan = Plan::new(&extensions);
                done.extend(plan.parts_of(last).filter(|part| is_done(part.name.index)));
                extensions[last].kept = Some(plan.ranges(last, |part| is_done(part.name.index)));
            }
            extensions.push(Extension::new(sweep, &extensions));
        }
        let parts: Vec<_> = Plan::new(&extensions).parts().collect();
        prop_assert_eq!(&parts[..done.len()], &done[..]);
        let again: Vec<_> = Plan::new(&extensions).outlines().map(|outline| Plan::new(&extensions).part(&outline)).collect();
        prop_assert_eq!(&again, &parts);
        let ids = |jobs: &mut dyn Iterator<Item = &Job>| jobs.map(|job| identity.id(&job.parameters, &Symbol::ALL)).collect::<Vec<_>>();
        let there = ids(&mut parts.iter().flat_map(|part| &part.jobs));
        let once: HashSet<_> = there.iter().cloned().collect();
        prop_assert_eq!(once.len(), there.len());
        let last: Vec<Job> = sweeps[sweeps.len() - 1].jobs().collect();
        let wanted: HashSet<_> = ids(&mut last.iter()).into_iter().collect();
        let kept: HashSet<_> = ids(&mut done.iter().flat_map(|part| &part.jobs)).into_iter().collect();
        prop_assert_eq!(once, wanted.union(&kept).cloned().collect::<HashSet<_>>());
    }

    #[test]
    fn no_text_breaks_the_reader(text in "[\\[\\]{}=\",.a-zA-Z0-9 \n-]{0,80}") {
        let _ = Sweep::parse(&text, std::path::Path::new("random.toml"));
    }
}
