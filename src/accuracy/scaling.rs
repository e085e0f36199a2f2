//! Scaling: what a slip costs as the slider grows, in blocks N and in contacts per block N_s.
//!
//! Every case breaks about as many contacts: the larger the slider, the fewer its slips. The start-up is also run alone
//! and its cost subtracted, which leaves that of the slips past start-up. Exponents are slopes of straight lines
//! through the logarithms.

use super::cost::Cost;
use super::{AccuracyError, Realisation};
use crate::model::{Parameters, Symbol};
use crate::observe::Recording;
use crate::solver::{Solver, Summary};
use crate::table::columns::{Table, columns};
use crate::table::selected::{Selected, Selection};

/// Slips of start-up, whose cost is subtracted.
const START_UP: u64 = 2;
/// Least slips that are timed.
const MIN_SLIPS: u64 = 2;

#[derive(Clone, Debug, PartialEq)]
pub struct Scaling {
    /// Numbers of blocks N, with the default contacts per block.
    pub blocks: Vec<usize>,
    /// Contacts per block N_s, with the default number of blocks.
    pub contacts_per_block: Vec<usize>,
    /// Tolerances of the event-driven solver.
    pub tolerances: Vec<f64>,
    /// Contacts N N_s of all slips of a case together.
    pub contacts: u64,
}

/// What grows: the number of blocks, and of contacts per block.
pub const SIZES: [Symbol; 2] = [Symbol::N, Symbol::Ns];

#[derive(Clone, Debug, PartialEq)]
pub struct Size;

impl Selection for Size {
    const SYMBOLS: &'static [Symbol] = &SIZES;
}

columns! {
    /// The cost at one size and tolerance; start-up is left out.
    #[derive(Clone, Debug, PartialEq)]
    pub struct SizeRow {
        parameters: Selected<Size>;
        tolerance: f64 = "", "tolerance of the event-driven solver";
        cost: Cost;
        leaps_per_slip: f64 = "", "of the steps, leaps per slip";
        breaks_per_slip: f64 = "", "contacts broken per slip, those between slips included";
        reattachments_per_slip: f64 = "", "contacts reattached per slip";
    }
}

impl Table for SizeRow {
    const NAME: &'static str = "scaling";
    const MEANING: &'static str = "One row per size of the slider and tolerance; start-up is left out";
}

columns! {
    /// Exponents of the powers of one size that fit best.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Exponents {
        size: Symbol = "", "what grows, N or Ns; the other is at its default";
        tolerance: f64 = "", "tolerance of the event-driven solver";
        cpu_per_slip: f64 = "", "exponent of CPU time per slip";
        cpu_per_simulated_second: f64 = "", "exponent of CPU time per simulated time";
        cpu_per_step: f64 = "", "exponent of CPU time per step";
        steps_per_slip: f64 = "", "exponent of steps per slip";
        breaks_per_slip: f64 = "", "exponent of breaks per slip";
    }
}

impl Table for Exponents {
    const NAME: &'static str = "scaling-exponents";
    const MEANING: &'static str =
        "One row per what grows and tolerance: exponents of the powers of it that fit the rows of `scaling` best";
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScalingFindings {
    /// Size by size, tolerance by tolerance.
    pub sizes: Vec<SizeRow>,
    /// Likewise; none of a size that does not grow.
    pub exponents: Vec<Exponents>,
}

impl Scaling {
    /// Over factors of sixteen, which takes minutes.
    pub fn full() -> Self {
        Self {
            blocks: vec![70, 140, 280, 560, 1120],
            contacts_per_block: vec![20, 80, 320],
            tolerances: vec![1e-6, 1e-10],
            contacts: 400_000,
        }
    }

    /// Over factors of four, which takes seconds.
    pub fn quick() -> Self {
        Self { blocks: vec![70, 140, 280], contacts_per_block: vec![20, 80], contacts: 30_000, ..Self::full() }
    }

    fn cases(&self) -> Vec<Parameters> {
        let wide = self.blocks.iter().map(|&blocks| Parameters { blocks, ..Parameters::default() });
        let dense = self.contacts_per_block.iter();
        let dense = dense.map(|&contacts_per_block| Parameters { contacts_per_block, ..Parameters::default() });
        let mut cases: Vec<Parameters> = Vec::new();
        for case in wide.chain(dense) {
            if !cases.contains(&case) {
                cases.push(case);
            }
        }
        cases
    }

    /// Slips that are timed at a size.
    fn slips(&self, parameters: &Parameters) -> u64 {
        (self.contacts / (parameters.blocks * parameters.contacts_per_block) as u64).max(MIN_SLIPS)
    }

    /// Runs it; `report` gets a line before each size.
    pub fn run(&self, report: &mut dyn FnMut(&str)) -> Result<ScalingFindings, AccuracyError> {
        let mut sizes = Vec::new();
        for parameters in &self.cases() {
            let slips = self.slips(parameters);
            report(&format!("{}: {slips} slips", size_in_words(parameters)));
            for &tolerance in &self.tolerances {
                sizes.push(timed(parameters, tolerance, slips)?);
            }
        }
        let pairs = SIZES.into_iter().flat_map(|size| self.tolerances.iter().map(move |&tolerance| (size, tolerance)));
        let exponents = pairs.filter_map(|(size, tolerance)| Exponents::of(size, tolerance, &sizes)).collect();
        Ok(ScalingFindings { sizes, exponents })
    }
}

fn timed(parameters: &Parameters, tolerance: f64, slips: u64) -> Result<SizeRow, AccuracyError> {
    let solver = Solver::event_driven(tolerance);
    let realisation = Realisation { parameters, solver, in_words: size_in_words };
    let run = |slips| realisation.measure(&Recording { slips, discard: 0, ..Recording::default() });
    let (start_up_seconds, start_up) = run(START_UP)?;
    let (all_seconds, all) = run(START_UP + slips)?;
    let (start_up, all) = (start_up.summary, all.summary);
    let past = Summary {
        end_time: all.end_time - start_up.end_time,
        steps: all.steps - start_up.steps,
        leaps: all.leaps - start_up.leaps,
        breaks: all.breaks - start_up.breaks,
        reattachments: all.reattachments - start_up.reattachments,
        ..all
    };
    let per_slip = |count: u64| count as f64 / slips as f64;
    Ok(SizeRow {
        parameters: Selected::new(parameters.clone()),
        tolerance,
        cost: Cost::of(all_seconds - start_up_seconds, &past, slips),
        leaps_per_slip: per_slip(past.leaps),
        breaks_per_slip: per_slip(past.breaks),
        reattachments_per_slip: per_slip(past.reattachments),
    })
}

/// The rows in which this size grows and the other is at its default.
pub(super) fn growing(size: Symbol, tolerance: f64, rows: &[SizeRow]) -> impl Iterator<Item = (f64, &SizeRow)> {
    let default = Parameters::default();
    let is_case = move |row: &&SizeRow| {
        let stays = |other| row.parameters.get(other) == default.get(other);
        row.tolerance == tolerance && SIZES.into_iter().all(|other| other == size || stays(other))
    };
    rows.iter().filter(is_case).map(move |row| {
        let count = if size == Symbol::N { row.parameters.blocks } else { row.parameters.contacts_per_block };
        (count as f64, row)
    })
}

impl Exponents {
    /// Those over the sizes; `None` for fewer than two.
    fn of(size: Symbol, tolerance: f64, rows: &[SizeRow]) -> Option<Self> {
        let fit = |value: fn(&SizeRow) -> f64| {
            exponent(&growing(size, tolerance, rows).map(|(count, row)| (count, value(row))).collect::<Vec<_>>())
        };
        Some(Self {
            size,
            tolerance,
            cpu_per_slip: fit(|row| row.cost.per_slip)?,
            cpu_per_simulated_second: fit(|row| row.cost.per_simulated_second)?,
            cpu_per_step: fit(|row| row.cost.per_step)?,
            steps_per_slip: fit(|row| row.cost.steps_per_slip)?,
            breaks_per_slip: fit(|row| row.breaks_per_slip)?,
        })
    }
}

/// Slope of the straight line through the logarithms, by least squares; `None` for fewer than two sizes.
fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let logarithms = || points.iter().map(|&(x, y)| (x.ln(), y.ln()));
    let count = points.len() as f64;
    let (x_mean, y_mean) = logarithms().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x / count, sum.1 + y / count));
    let spread: f64 = logarithms().map(|(x, _)| (x - x_mean).powi(2)).sum();
    let common: f64 = logarithms().map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
    (spread > 0.0).then(|| common / spread)
}

fn size_in_words(parameters: &Parameters) -> String {
    format!("N = {}, Ns = {}", parameters.blocks, parameters.contacts_per_block)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponent_of_a_power_is_found_and_one_size_has_none() {
        let points: Vec<(f64, f64)> = [70.0, 140.0, 560.0].iter().map(|&n: &f64| (n, 0.3 * n.powf(1.7))).collect();
        assert!((exponent(&points).unwrap() - 1.7).abs() < 1e-12);
        assert_eq!(exponent(&points[..1]), None);
        assert_eq!(exponent(&[]), None);
    }

    #[test]
    fn every_size_is_run_once_with_about_as_many_contacts() {
        let scaling = Scaling::full();
        let cases = scaling.cases();
        assert_eq!(cases.len(), 7);
        for case in &cases {
            let contacts = scaling.slips(case) * (case.blocks * case.contacts_per_block) as u64;
            assert!((380_000..=400_000).contains(&contacts), "{}: {contacts}", size_in_words(case));
        }
        assert_eq!(Scaling { contacts: 1, ..scaling }.slips(&cases[0]), MIN_SLIPS);
    }

    #[test]
    fn breaks_grow_as_the_contacts_and_steps_as_the_breaks() {
        let scaling = Scaling {
            blocks: vec![35, 70],
            contacts_per_block: vec![10, 20],
            tolerances: vec![1e-6],
            contacts: 20_000,
        };
        let findings = scaling.run(&mut |_| {}).unwrap();
        assert_eq!(findings.sizes.len(), 3);
        for row in &findings.sizes {
            let contacts = (row.parameters.blocks * row.parameters.contacts_per_block) as f64;
            // Every contact breaks, some again and again.
            assert!(row.breaks_per_slip > contacts && row.breaks_per_slip < 20.0 * contacts, "{row:?}");
            // What breaks attaches again, some of it after the last slip.
            assert!((row.reattachments_per_slip / row.breaks_per_slip - 1.0).abs() < 0.2, "{row:?}");
            assert!(row.leaps_per_slip < row.cost.steps_per_slip && row.cost.per_slip > 0.0, "{row:?}");
        }
        let [wide, dense] = findings.exponents[..] else { panic!("{:?}", findings.exponents) };
        assert_eq!((wide.size, dense.size), (Symbol::N, Symbol::Ns));
        for exponents in [wide, dense] {
            assert!((0.5..2.0).contains(&exponents.breaks_per_slip), "{exponents:?}");
        }
    }

    #[test]
    fn a_size_grows_over_its_own_rows_only() {
        let row = |blocks, contacts_per_block| SizeRow {
            parameters: Selected::new(Parameters { blocks, contacts_per_block, ..Parameters::default() }),
            tolerance: 1e-6,
            cost: Cost::default(),
            leaps_per_slip: 0.0,
            breaks_per_slip: 0.0,
            reattachments_per_slip: 0.0,
        };
        let rows = [row(70, 20), row(140, 20), row(70, 80)];
        let sizes = |size| growing(size, 1e-6, &rows).map(|(count, _)| count).collect::<Vec<_>>();
        assert_eq!(sizes(Symbol::N), [70.0, 140.0]);
        assert_eq!(sizes(Symbol::Ns), [20.0, 80.0]);
        assert_eq!(growing(Symbol::N, 1e-10, &rows).count(), 0);
    }
}
