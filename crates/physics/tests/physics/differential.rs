//! Random parameters, extremes included: grid, Taylor steps and a fixed step break the same contacts at the same times.
//!
//! Trajectories are chaotic, so each draw measures how far its events can be known, and compares as far as that:
//! - what a solver's tolerance makes of a break time, from runs with thresholds perturbed by it;
//! - what the fixed step makes of it, from steps of dt and dt/2.
//!
//! `PROPTEST_CASES` sets the number of draws, `DIFFERENTIAL_FIRST` the first of them.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use stickslip_physics::model::equation::largest_frequency;
use stickslip_physics::model::{BreakOn, Change, ContactEvent, Parameters};
use stickslip_physics::observe::{Observers, Recording, Slip, SlipObserver};
use stickslip_physics::solver::{Limits, Observer, Resolve, Solver, simulate};

/// Block, contact and generation.
type Life = (usize, usize, u32);

/// Tolerance of the reference, in Taylor steps.
const EXACT: f64 = 1e-9;
/// Block steps of the finer fixed step in a draw: some 0.04 s.
const BUDGET: f64 = 1.6e7;

/// Breaks are compared as long as their times are known to this part of them.
const COARSE: f64 = 0.05;

/// A break: which, its time in s, and the displacement of its block in m.
#[derive(Clone, Copy, Debug)]
struct Found {
    life: Life,
    time: f64,
    displacement: f64,
}

type Lives = HashMap<Life, Found>;

/// The breaks of one run.
struct Breaks {
    wanted: usize,
    in_order: Vec<Found>,
}

impl Observer for Breaks {
    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break {
            let life = (event.block, event.contact, event.generation);
            self.in_order.push(Found {
                life,
                time: event.time,
                displacement: event.displacement,
            });
        }
    }

    fn is_satisfied(&self) -> bool {
        self.in_order.len() >= self.wanted
    }
}

/// Numbers that follow from a seed: SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in the logarithm.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.uniform())
    }

    fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// A whole number below another.
    #[expect(clippy::cast_possible_truncation, reason = "below a usize")]
    fn whole(&mut self, below: usize) -> usize {
        (self.next() % below as u64) as usize
    }

    /// A whole number from 1 up to another, uniform in the logarithm.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small and positive"
    )]
    fn count(&mut self, largest: f64) -> usize {
        self.between(1.0, largest + 1.0) as usize
    }

    fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.whole(values.len())]
    }
}

/// A draw: parameters, the finer of the fixed steps, in s, and bounds on how long to look.
struct Draw {
    parameters: Parameters,
    step: f64,
    longest: f64,
    breaks: usize,
}

fn draw(number: u64) -> Draw {
    let mut random = Random(number);
    let r = &mut random;
    let sizes = [1, 2, 3, 7, 8, 9, 16, 17, 64, 65, 70, 128, 130];
    let blocks = if r.chance(0.6) {
        r.one_of(&sizes)
    } else {
        r.count(130.0)
    };
    let contacts = if r.chance(0.4) {
        r.one_of(&[1, 2, 8, 9, 17, 20, 60])
    } else {
        r.count(60.0)
    };
    let mut parameters = Parameters {
        blocks,
        contacts_per_block: contacts,
        seed: r.next() >> 40,
        ..Parameters::default()
    };
    parameters.drive_velocity = r.between(1e-7, 1e-2);
    parameters.reattachment_time = if r.chance(0.3) {
        0.005
    } else {
        r.between(1e-6, 1.0)
    };
    parameters.damping_rate = match r.next() % 4 {
        0 => 6462.0,
        1 => r.one_of(&[0.0, 1.0, 1e5, 1e6]),
        _ => r.between(1.0, 1e6),
    };
    parameters.slider_stiffness *= if r.chance(0.5) {
        1.0
    } else {
        r.between(1e-2, 10.0)
    };
    let spread = match r.next() % 4 {
        0 => 0.0,
        1 => 0.005,
        _ => r.between(1e-4, 0.5),
    };
    if r.chance(0.25) {
        parameters.break_on = BreakOn::Tension;
    }
    let (amplitude, period) = (r.between(1e-9, 3e-6), r.between(1e-4, 0.1));
    let (is_modulated, is_ramped) = (r.chance(0.7), r.chance(0.3));
    let (turning_period, turning_amplitude) = (
        r.between(1e-4, 0.1),
        if r.chance(0.3) {
            0.0
        } else {
            r.between(1e-9, 3e-6)
        },
    );

    if is_modulated {
        parameters.modulation_period = Some(period);
    }
    let shortest = if is_modulated && is_ramped {
        period.min(turning_period)
    } else {
        period
    };
    let mut step = (0.2 / largest_frequency(&parameters)).min(0.1 * parameters.reattachment_time);
    if parameters.damping_rate > 0.0 {
        step = step.min(0.2 / parameters.damping_rate);
    }
    if is_modulated {
        step = step.min(shortest / 400.0);
    }
    let longest = step * BUDGET / (blocks as f64 + 8.0);
    // Where a fixed step would take too long to the first break, displacements are scaled down: the model is linear but
    // for the thresholds.
    let stiffness = parameters.block_contact_stiffness();
    let chain = (stiffness * parameters.coupling_stiffness())
        .sqrt()
        .min(stiffness * blocks as f64)
        + stiffness;
    let pulled = parameters.drive_velocity * parameters.drive_stiffness
        / (parameters.drive_stiffness + chain);
    let scale = (pulled * longest * r.between(0.1, 0.6) / parameters.contact_reach()).min(1.0);
    parameters.mean_threshold *= scale;
    parameters.threshold_deviation = spread * parameters.mean_threshold;
    if is_modulated {
        parameters.modulation_amplitude = amplitude * scale;
        if is_ramped {
            parameters.turning_period = r.chance(0.7).then_some(turning_period);
            parameters.turning_amplitude = Some(turning_amplitude * scale);
            parameters.ramp_time = longest * r.between(0.01, 1.0);
        }
    }
    let breaks = 3 + r.count(400.0);
    Draw {
        parameters: parameters.validated().expect("a draw is valid"),
        step,
        longest,
        breaks,
    }
}

/// Breaks and slips up to a time in s.
struct Run {
    breaks: Vec<Found>,
    slips: Vec<Slip>,
    end: f64,
}

impl Run {
    /// Up to `end` s, or a number of breaks.
    fn new(
        parameters: &Parameters,
        solver: Solver,
        end: f64,
        wanted: usize,
    ) -> Result<Self, String> {
        let recording = Recording {
            slips: Some(u64::MAX),
            discard: 0,
            ..Recording::default()
        };
        let mut breaks = Breaks {
            wanted,
            in_order: Vec::new(),
        };
        let mut slips = SlipObserver::new(parameters, &recording);
        let limits = Limits {
            end_time: end,
            events: 200_000,
            interrupt: None,
        };
        let mut both = Observers(vec![&mut breaks, &mut slips]);
        let summary = simulate(parameters, solver, limits, &mut both)
            .map_err(|error| format!("{solver:?}: {error}"))?;
        if !breaks.in_order.is_sorted_by_key(|found| found.time) {
            return Err(format!("{solver:?}: breaks are not in order"));
        }
        Ok(Self {
            breaks: breaks.in_order,
            slips: slips.into_measurements(summary).slips,
            end: summary.end_time,
        })
    }
}

/// For each break of a reference the largest difference so far of other runs; infinite from where one lacks it.
fn spread(reference: &[Found], others: &[Lives]) -> Vec<f64> {
    let mut largest = 0.0_f64;
    let at = |found: &Found| {
        for other in others {
            let difference = other
                .get(&found.life)
                .map_or(f64::INFINITY, |other| (other.time - found.time).abs());
            largest = largest.max(difference);
        }
        largest
    };
    reference.iter().map(at).collect()
}

fn by_life(breaks: &[Found]) -> Lives {
    breaks.iter().map(|found| (found.life, *found)).collect()
}

/// The first break at which a run differs from a reference by more than is allowed, in words; else how many were
/// compared, up to where the bound is coarse, and the largest ratio of difference and bound.
fn compare(reference: &Run, allowed: &[f64], run: &Run) -> Result<(usize, f64), String> {
    let times = by_life(&run.breaks);
    let (mut compared, mut worst, mut until) = (0, 0.0_f64, 0.0);
    for (expected, &allowed) in reference.breaks.iter().zip(allowed) {
        let Found { life, time, .. } = *expected;
        if time + allowed >= reference.end || allowed > COARSE * time {
            break;
        }
        let found = times.get(&life).map(|found| found.time);
        let difference = found.map_or(f64::INFINITY, |found| (found - time).abs());
        if difference > allowed {
            return Err(format!(
                "break {compared}, {life:?}: {found:?} instead of {time} s, within {allowed:.2e} s"
            ));
        }
        worst = worst.max(difference / allowed);
        compared += 1;
        until = time - allowed;
    }
    // Nothing else breaks meanwhile, unless the reference has it soon after.
    let known = by_life(&reference.breaks);
    for &Found { life, time, .. } in run.breaks.iter().take_while(|found| found.time < until) {
        if known
            .get(&life)
            .is_none_or(|other| other.time > time + 2.0 * COARSE * time)
        {
            return Err(format!(
                "{life:?} breaks at {time} s, in the reference at {:?}",
                known.get(&life)
            ));
        }
    }
    Ok((compared, worst))
}

/// What one draw showed.
#[derive(Default)]
struct Shown {
    breaks: usize,
    slips: usize,
    /// Breaks compared, and largest ratio of difference and bound: of each solver, then of the fixed step.
    compared: Vec<(usize, f64)>,
    /// Whether the fixed step converges too slowly to decide.
    is_open: bool,
    problems: Vec<String>,
}

const SOLVERS: [(f64, Resolve); 4] = [
    (1e-3, Resolve::Grid),
    (1e-6, Resolve::Grid),
    (1e-3, Resolve::Taylor),
    (1e-6, Resolve::Taylor),
];
/// A solver's displacements may be off by this many tolerances.
const TOLERANCES: f64 = 3.0;
/// What a perturbation does to the time of a break is known to within this factor, by four examples.
const FACTOR: f64 = 4.0;
/// Radians of the fastest mode that a slider remembers at the default damping: errors of the grid may add up beyond.
const REMEMBERED: f64 = 130.0;
/// Halvings of the fixed step.
const HALVINGS: usize = 6;

const fn reference_solver() -> Solver {
    Solver {
        resolve: Resolve::Taylor,
        ..Solver::event_driven(EXACT)
    }
}

/// For each break of the reference, the largest change of its time so far, in s, if displacements are off by a part
/// `size` of the contact reach: with thresholds so much higher or lower, together or each.
fn sensitivity(parameters: &Parameters, reference: &Run, size: f64) -> Result<Vec<f64>, String> {
    let (mean, deviation) = (parameters.mean_threshold, parameters.threshold_deviation);
    let perturbed: Result<Vec<Lives>, String> = [
        (1.0 + size, 0.0),
        (1.0 - size, 0.0),
        (1.0, size),
        (1.0, -size),
    ]
    .into_iter()
    .map(|(scale, wider)| {
        let changed = Parameters {
            mean_threshold: scale * mean,
            threshold_deviation: scale * (deviation + wider * mean).abs(),
            ..parameters.clone()
        };
        Ok(by_life(
            &Run::new(
                &changed,
                reference_solver(),
                1.02 * reference.end,
                usize::MAX,
            )?
            .breaks,
        ))
    })
    .collect();
    Ok(spread(&reference.breaks, &perturbed?))
}

/// How many tolerances the grid's displacements may be off by: more where little is forgotten.
fn grid_share(parameters: &Parameters, end: f64) -> f64 {
    let memory = if parameters.damping_rate > 0.0 {
        end.min(2.0 / parameters.damping_rate)
    } else {
        end
    };
    TOLERANCES * (largest_frequency(parameters) * memory / REMEMBERED).max(1.0)
}

fn check(number: u64) -> Result<Shown, String> {
    let Draw {
        parameters,
        step,
        longest,
        breaks: wanted,
    } = draw(number);
    let reference = Run::new(&parameters, reference_solver(), longest, wanted)?;
    let mut shown = Shown {
        breaks: reference.breaks.len(),
        slips: reference.slips.len(),
        ..Shown::default()
    };
    for (tolerance, resolve) in SOLVERS {
        let found = Run::new(
            &parameters,
            Solver {
                resolve,
                ..Solver::event_driven(tolerance)
            },
            reference.end,
            usize::MAX,
        )?;
        // The events of a step of the grid are told at the last of them.
        let (share, late) = match resolve {
            Resolve::Grid => (
                grid_share(&parameters, reference.end),
                2.5 / largest_frequency(&parameters),
            ),
            _ => (TOLERANCES, 0.0),
        };
        let size = (share * tolerance).min(0.1);
        let changes = sensitivity(&parameters, &reference, size)?;
        // And rounding.
        let allowed: Vec<f64> = changes
            .iter()
            .map(|change| FACTOR * change + 1e-12)
            .collect();
        match compare(&reference, &allowed, &found) {
            Ok((compared, worst)) => {
                shown.compared.push((compared, worst));
                shown.problems.extend(
                    compare_slips(
                        &parameters,
                        &reference,
                        &found,
                        &allowed[..compared],
                        [late, size],
                    )
                    .err(),
                );
            }
            Err(problem) => shown
                .problems
                .push(format!("{resolve:?} {tolerance:e}: {problem}")),
        }
    }
    match check_fixed_step(&parameters, &reference, step)? {
        Decided::Agrees(compared, worst) => shown.compared.push((compared, worst)),
        Decided::Open => shown.is_open = true,
        Decided::Differs(problem) => shown.problems.push(problem),
    }
    Ok(shown)
}

/// What a fixed step says about the reference.
enum Decided {
    Agrees(usize, f64),
    Open,
    Differs(String),
}

/// Compares the reference with a fixed step, which is halved where it disagrees.
fn check_fixed_step(
    parameters: &Parameters,
    reference: &Run,
    mut step: f64,
) -> Result<Decided, String> {
    let run = |time_step: f64| {
        Run::new(
            parameters,
            Solver::fixed_step(time_step),
            reference.end,
            usize::MAX,
        )
    };
    let changes = sensitivity(parameters, reference, 1e-6)?;
    let mut coarse = run(2.0 * step)?;
    let mut problem = String::new();
    for _ in 0..=HALVINGS {
        let fine = run(step)?;
        let late: HashMap<Life, f64> = fine
            .breaks
            .iter()
            .map(|found| found.life)
            .zip(spread(&fine.breaks, &[by_life(&coarse.breaks)]))
            .collect();
        let mut largest = 0.0_f64;
        let bound = |(found, change): (&Found, &f64)| {
            largest = largest.max(late.get(&found.life).copied().unwrap_or(f64::INFINITY));
            3.0 * (largest + 2.0 * step + change)
        };
        let allowed: Vec<f64> = reference.breaks.iter().zip(&changes).map(bound).collect();
        problem = match compare(reference, &allowed, &fine) {
            Ok((compared, worst)) => return Ok(Decided::Agrees(compared, worst)),
            Err(problem) => problem,
        };
        (coarse, step) = (fine, 0.5 * step);
    }
    // Both steps may meet the same wrong cycle of a modulation: what do their errors of displacement do?
    let known = by_life(&reference.breaks);
    let off = |found: &&Found| {
        known
            .get(&found.life)
            .is_some_and(|other| (found.time - other.time).abs() < 1e-3 * found.time)
    };
    let largest = coarse
        .breaks
        .iter()
        .filter(off)
        .map(|found| (found.displacement - known[&found.life].displacement).abs())
        .fold(0.0, f64::max);
    let size = (4.0 * largest / parameters.contact_reach()).clamp(1e-6, 0.1);
    let allowed: Vec<f64> = sensitivity(parameters, reference, size)?
        .iter()
        .map(|change| FACTOR * change + 4.0 * step)
        .collect();
    Ok(match compare(reference, &allowed, &coarse) {
        Ok(_) => Decided::Open,
        Err(_) => Decided::Differs(format!("fixed step {step:e}: {problem}")),
    })
}

/// Compares number, times and sizes of the slips that end before the last of the breaks compared. Observers may hear
/// of breaks `late` s after their time; displacements may be off by a part `size` of the contact reach.
fn compare_slips(
    parameters: &Parameters,
    reference: &Run,
    found: &Run,
    allowed: &[f64],
    [late, size]: [f64; 2],
) -> Result<(), String> {
    let Some((last, off)) = reference.breaks[..allowed.len()].last().zip(allowed.last()) else {
        return Ok(());
    };
    let until = last.time - 2.0 * off;
    // Errors decide whether a gap as long as the crossing time parts two slips.
    let gap = parameters.wave_crossing_time();
    let is_unsure = |pair: &&[Found]| (pair[1].time - pair[0].time - gap).abs() <= 2.0 * off + late;
    let until = reference
        .breaks
        .windows(2)
        .find(is_unsure)
        .map_or(until, |pair| until.min(pair[0].time - gap));
    let over = |slip: &&Slip| slip.nucleation + slip.duration < until;
    for (number, slip) in reference.slips.iter().filter(over).enumerate() {
        let Some(other) = found.slips.get(number) else {
            return Err(format!("slip {number} is missing"));
        };
        let differences = [
            other.nucleation - slip.nucleation,
            other.duration - slip.duration,
        ];
        // Of two maxima alike, errors decide which is the larger.
        let lifted = parameters.drive_stiffness * size * parameters.contact_reach();
        let is_onset = (other.onset - slip.onset).abs() <= 2.0 * off + late
            || (other.peak_force - slip.peak_force).abs() <= 2.0 * lifted;
        if !is_onset {
            return Err(format!(
                "onset of slip {number}: {} s instead of {} s",
                other.onset, slip.onset
            ));
        }
        if differences
            .iter()
            .any(|difference| difference.abs() > 2.0 * off)
            || other.size != slip.size
        {
            return Err(format!("slip {number}: {other:?} instead of {slip:?}"));
        }
    }
    Ok(())
}

#[test]
fn random_parameters_break_the_same_contacts_in_every_solver() {
    let number = |name: &str| {
        std::env::var(name)
            .ok()
            .and_then(|value| value.parse::<u64>().ok())
    };
    let (first, draws) = (
        number("DIFFERENTIAL_FIRST").unwrap_or(0),
        number("PROPTEST_CASES").unwrap_or(500),
    );
    let (next, shown) = (AtomicU64::new(first), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, Into::into) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= first + draws {
                        break;
                    }
                    let of_draw = check(number);
                    shown.lock().unwrap().push((number, of_draw));
                }
            });
        }
    });
    let mut shown = shown.into_inner().unwrap();
    shown.sort_by_key(|(number, _)| *number);
    let mut problems = String::new();
    let mut totals = [(0, 0.0_f64); SOLVERS.len() + 1];
    let (mut breaks, mut slips, mut open) = (0, 0, 0);
    for (number, of_draw) in shown {
        match of_draw {
            Ok(of_draw) => {
                breaks += of_draw.breaks;
                slips += of_draw.slips;
                open += u64::from(of_draw.is_open);
                for problem in &of_draw.problems {
                    writeln!(
                        problems,
                        "draw {number}: {problem}\n    {:?}",
                        draw(number).parameters
                    )
                    .unwrap();
                }
                for (total, (compared, worst)) in totals.iter_mut().zip(&of_draw.compared) {
                    *total = (total.0 + compared, total.1.max(*worst));
                }
            }
            Err(error) => writeln!(
                problems,
                "draw {number}: {error}\n    {:?}",
                draw(number).parameters
            )
            .unwrap(),
        }
    }
    println!(
        "{draws} draws, {breaks} breaks, {slips} slips, {open} open; compared, and share of the bound: {totals:?}"
    );
    assert!(problems.is_empty(), "\n{problems}");
    // Not all is vague: a quarter of the breaks at the loosest.
    for (compared, _) in totals {
        assert!(
            4 * compared > breaks,
            "{compared} of {breaks} breaks compared"
        );
    }
    assert!(
        10 * open <= draws,
        "the fixed step decides nothing in {open} of {draws} draws"
    );
}
