//! Rounds end, whatever a condition leaves out, and a stop is obeyed between two of them.

use super::*;
use proptest::prelude::*;

/// Far more than any of these sweeps has when each round brings new points.
const MANY_ROUNDS: usize = 60;

const OF_SEEDS: &str = "[precision]\nof = \"tau_mean\"\nrelative = 1e-3\n";
const OF_EDGES: &str =
    "[refine]\naxis = \"V0\"\nby = \"tau_mean\"\nthreshold = 1.55\nto = 1e-6\njobs = 900\n";

/// A sweep in rounds as a directory may hold it, also with conditions that a new one is refused; `None` if they drop
/// all.
fn in_rounds(condition: &str, rounds: &str, control: bool) -> Option<Sweep> {
    let text = format!(
        "name = \"test\"\nwhere = \"{condition}\"\n[model]\nfrequency = 29\n[axes]\nDelta = [0, 1e-6]\n\
         V0 = {{ linear = [1e-4, 2e-4], points = 3 }}\n[record]\nslips = 3\ncontrol = {control}\n\
         {rounds}seeds = {{ from = 24, to = 60 }}\n"
    );
    Sweep::parse_stored(&text, Path::new("test.toml")).ok()
}

/// Intervals of slips that grow with the velocity and vary with the seed.
#[expect(clippy::unnecessary_wraps, reason = "a kernel")]
fn varied(job: &Job, _: &AtomicBool) -> Result<Measurements, SimulationError> {
    let mut measured = measure(&job.parameters);
    let noise = (0.618 * job.parameters.seed as f64).fract();
    for slip in &mut measured.slips {
        slip.interval = Some(1e4 * job.parameters.drive_velocity + 0.3 * noise);
    }
    Ok(measured)
}

fn extensions(root: &Path) -> usize {
    fs::read_dir(root.join("run"))
        .unwrap()
        .filter(|file| {
            let name = file.as_ref().unwrap().file_name();
            name.to_str().unwrap().starts_with("extension-")
        })
        .count()
}

/// Runs until the rounds are over, or until there are far too many.
fn ends(sweep: &Sweep) -> RunReport {
    let root = tempfile::tempdir().unwrap();
    let stop = AtomicBool::new(false);
    let layout = Layout::new(&Disk, root.path());
    let mut watch = |_: &RunEvent| {
        let is_endless = extensions(root.path()) > MANY_ROUNDS;
        stop.fetch_or(is_endless, Ordering::Relaxed);
    };
    run(&layout, sweep, options(&stop, 2), &varied, &mut watch).unwrap()
}

#[test]
fn rounds_that_choose_no_new_point_are_over() {
    for rounds in [OF_SEEDS, OF_EDGES] {
        for condition in ["seed != 1", "V0 * seed < 2e-3", "seed > 30 or V0 > 1.2e-4"] {
            let report = ends(&in_rounds(condition, rounds, false).unwrap());
            let over = report.rounds.unwrap();
            assert!(over.is_over && !report.stopped, "{condition} {rounds}");
            assert_eq!(over.standing.sets_open, 0);
        }
    }
}

#[test]
fn a_stop_is_obeyed_between_two_rounds() {
    let root = tempfile::tempdir().unwrap();
    let layout = Layout::new(&Disk, root.path());
    let sweep = in_rounds("V0 == 1e-4 and Delta == 0", OF_SEEDS, false).unwrap();
    let stop = AtomicBool::new(false);
    // All jobs of the first round are in one part.
    let mut watch = |event: &RunEvent| {
        let is_commit = matches!(event, RunEvent::PartCommitted { .. });
        stop.fetch_or(is_commit, Ordering::Relaxed);
    };
    let report = run(&layout, &sweep, options(&stop, 1), &varied, &mut watch).unwrap();
    assert!(report.stopped && report.jobs_left == 0, "{report:?}");
    assert_eq!(extensions(root.path()), 1);
    let stop = AtomicBool::new(false);
    let report = run(&layout, &sweep, options(&stop, 1), &varied, &mut |_| ()).unwrap();
    assert!(report.rounds.unwrap().is_over && extensions(root.path()) > 2);
}

const QUANTITIES: &[&str] = &[
    "seed",
    "V0 * 2e4",
    "Delta * 1e6",
    "eta",
    "seed * V0 * 1e4",
    "T",
    "seed / eta",
];
const SIGNS: &[&str] = &["<", "<=", ">", ">=", "==", "!="];

fn comparison() -> impl Strategy<Value = String> {
    let values = prop_oneof![(0..40).prop_map(f64::from), 0.0..4.0];
    let quantities = prop::sample::select(QUANTITIES);
    let signs = prop::sample::select(SIGNS);
    (quantities, signs, values)
        .prop_map(|(quantity, sign, value)| format!("{quantity} {sign} {value:.3}"))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn rounds_end_whatever_a_condition_leaves_out(
        first in comparison(), second in comparison(), by in prop::sample::select(&["and", "or"][..]),
        rounds in prop::sample::select(&[OF_SEEDS, OF_EDGES][..]), control in any::<bool>()
    ) {
        if let Some(sweep) = in_rounds(&format!("{first} {by} {second}"), rounds, control) {
            prop_assert!(ends(&sweep).rounds.unwrap().is_over);
        }
    }
}
